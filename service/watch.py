"""What watches vehicles, wired together: Zenoh in, monitor, database, checkpoints, Zenoh out, diagnoses of alerts.

A service and a worker begin the same watch; what asks it, over HTTP or over Zenoh, is begun beside it.
"""

import gc
import logging
import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from uuid import uuid4

import zenoh
from threadpoolctl import threadpool_limits

from wingwatch.api import WorkerView
from wingwatch.baselines import Database, open_database
from wingwatch.monitor import FleetFigures, FleetMonitor, FleetPorts, FleetSettings, Outputs
from wingwatch.operations.diagnosis_change import RING_CHANNELS
from wingwatch.operations.faults import CommandError
from wingwatch.service.aircraft_registry import AircraftRegistry
from wingwatch.service.alert_diagnoses import AlertDiagnoses
from wingwatch.service.checkpoints import CheckpointFolder
from wingwatch.service.database_probe import DatabaseProbe
from wingwatch.service.diagnosis_jobs import DiagnosisJobs
from wingwatch.service.ingest import IngestLoop
from wingwatch.service.kernel_steps import AT_FIRST_USE, LIVE
from wingwatch.service.kernels import KernelCompiler, Preparation
from wingwatch.service.link_settings import link_security
from wingwatch.service.outputs import ZenohOutputs
from wingwatch.service.recorded_ports import RecordedCheckpoints, RecordedStore
from wingwatch.service.recorder import Recorder
from wingwatch.service.settings import ServeSettings
from wingwatch.service.store import DatabaseStore
from wingwatch.service.vehicle_leases import VehicleLeases
from wingwatch.telemetry import SensorSubscriber, ZenohSettings, open_session, with_free_ports

__all__ = ["DATABASE_PATIENCE_S", "Watch", "WatchPlan", "begin_watch", "connected", "link_of", "waiting_for"]

_LOG = logging.getLogger(__name__)
DATABASE_PATIENCE_S = 1.0
"""For another process that writes."""
_MOST_QUEUED_S = 5.0
_SWITCH_S = (
    0.0005  # each message that arrives waits so long for the interpreter while the ingest loop is busy
)


@dataclass(frozen=True, slots=True)
class Watch:
    """What a watch consists of, each of them started and ended elsewhere."""

    monitor: FleetMonitor
    database: Database
    probe: DatabaseProbe
    store: DatabaseStore
    checkpoints: CheckpointFolder
    session: zenoh.Session
    link: ZenohSettings
    subscriber: SensorSubscriber
    outputs: ZenohOutputs
    ingest: IngestLoop
    preparation: Preparation
    diagnoses: DiagnosisJobs
    alert_diagnoses: AlertDiagnoses | None
    recorder: Recorder | None = None

    def as_worker(
        self,
        name: str,
        capacity: float,
        figures: FleetFigures | None = None,
        moves: Mapping[str, int] | None = None,
    ) -> WorkerView:
        """The watch as one of the workers.

        Args:
            figures: of its fleet, where they have been asked for already.
            moves: vehicles taken over and given up.
        """
        figures = figures or self.monitor.figures()
        return WorkerView(
            name,
            socket.gethostname(),
            os.getpid(),
            self.ingest.load,
            capacity,
            sum(figures.vehicles.values()),
            figures.left_out,
            max(self.subscriber.waiting_s, self.ingest.in_hand_s),
            {"taken": 0, "given": 0} if moves is None else moves,
        )


@dataclass(frozen=True, slots=True)
class WatchPlan:
    """How a watch begins.

    Attributes:
        preparation: done before messages are taken in; None: the kernels of the live path are loaded, and compiled
            where this machine has not done so yet.
        wall_clock: seconds since 1970-01-01 UTC.
        announcing: what the monitor's news goes to, around Zenoh's outputs.
        heard: called with each vehicle that is there, where others are watched elsewhere: nothing is taken of a vehicle
            before the subscriber is to watch it, and none goes on from its checkpoint by itself. None: every
            vehicle is watched here.
        owns: whether a vehicle is watched here; what others say of one that is not is no forgery.
        leases: under which the database is written; None where nobody else writes.
    """

    preparation: Preparation | None = None
    wall_clock: Callable[[], float] = time.time
    announcing: Callable[[Outputs], Outputs] = field(default=lambda outputs: outputs)
    heard: Callable[[str, str], None] | None = None
    owns: Callable[[str, str], bool] | None = None
    leases: VehicleLeases | None = None


def begin_watch(
    stack: ExitStack, settings: ServeSettings, registry: AircraftRegistry, plan: WatchPlan
) -> Watch:
    """Begin all but the loop that takes messages in, which whoever calls this starts; all ends with the stack.

    Raises:
        DatabaseError, LinkError, LinkSecurityError, CommandError: one sentence each.
    """
    wall_clock = plan.wall_clock
    database = stack.enter_context(open_database(settings.where, busy_timeout_s=DATABASE_PATIENCE_S))
    store = stack.enter_context(DatabaseStore(database, wall_clock, settings.history.retention, plan.leases))
    checkpoints = stack.enter_context(CheckpointFolder(settings.checkpoints, wall_clock))
    link = link_of(settings)
    session = stack.enter_context(open_session(link))
    outputs = stack.enter_context(ZenohOutputs(session, lambda: connected(session, link), plan.owns))
    _tune_interpreter(stack)
    recorder = _recorder(stack, settings, wall_clock)
    announced = plan.announcing(outputs)
    monitor = _fleet(stack, settings, registry, store, announced, wall_clock, checkpoints, recorder)
    if plan.heard is None:
        _resume(monitor, checkpoints)
    outputs.answer_from(monitor)
    arrived, subscriber = _subscribed(stack, session, outputs, plan.heard)
    preparation = plan.preparation or KernelCompiler(LIVE, AT_FIRST_USE)
    record = None if recorder is None else recorder.messages
    ingest = IngestLoop(subscriber, monitor, arrived, preparation, record=record)
    jobs = stack.enter_context(DiagnosisJobs(registry.find))
    return Watch(
        monitor=monitor, database=database, probe=DatabaseProbe(database.check), store=store, checkpoints=checkpoints,
        session=session, link=link, subscriber=subscriber, outputs=outputs, ingest=ingest, preparation=preparation,
        diagnoses=jobs, alert_diagnoses=_alerts_diagnosed(stack, settings, monitor, jobs), recorder=recorder,
    )  # fmt: skip


def link_of(settings: ServeSettings) -> ZenohSettings:
    """How Zenoh is reached, and what protects it.

    Raises:
        LinkError, LinkSecurityError: one sentence.
    """
    security = link_security(settings.zenoh, os.environ)
    return ZenohSettings.for_service(with_free_ports(settings.listen), settings.connect, security)


def connected(session: zenoh.Session, link: ZenohSettings) -> bool:
    """Whether a client has its router."""
    info = session.info
    return link.mode != "client" or bool([*info.routers_zid(), *info.peers_zid()])


def waiting_for(store: DatabaseStore) -> str | None:
    """Why entries wait for the database, without asking it."""
    if store.problem is not None:
        return f"{store.problem}."
    if store.behind_s <= _MOST_QUEUED_S:
        return None
    return f"the database has taken no entry for {store.behind_s:.0f} s."


def _resume(monitor: FleetMonitor, checkpoints: CheckpointFolder) -> None:
    """At the start: every vehicle goes on from its checkpoint; says how long that took."""
    began_s, spent_s = time.monotonic(), time.thread_time()
    monitor.resume()
    if resumed := checkpoints.counts["resumed"]:
        took = resumed, time.monotonic() - began_s, time.thread_time() - spent_s
        _LOG.info("%d vehicles resumed in %.3f s, of which %.3f s are processor time", *took)


def _save(monitor: FleetMonitor, checkpoints: CheckpointFolder) -> None:
    """At the end: what has changed since the last checkpoints."""
    for saved in monitor.unsaved():
        checkpoints.write(saved)


def _tune_interpreter(stack: ExitStack) -> None:
    """Short turns of the threads, one thread for matrices; ends with the service, as the loop's frozen objects do."""
    stack.callback(gc.unfreeze)
    stack.callback(sys.setswitchinterval, sys.getswitchinterval())
    sys.setswitchinterval(_SWITCH_S)
    # The matrices are small: a second thread only waits, spinning, on the core that the others need.
    stack.enter_context(threadpool_limits(1, "blas"))


def _fleet(
    stack: ExitStack,
    settings: ServeSettings,
    registry: AircraftRegistry,
    store: DatabaseStore,
    outputs: Outputs,
    wall_clock: Callable[[], float],
    checkpoints: CheckpointFolder,
    recorder: Recorder | None,
) -> FleetMonitor:
    """The fleet's monitor; what has changed is saved at the end."""
    ports = FleetPorts(store, outputs, checkpoints)
    if recorder is not None:
        recorded = RecordedCheckpoints(checkpoints, recorder, wall_clock)
        ports = FleetPorts(RecordedStore(store, recorder), outputs, recorded)
    monitor = FleetMonitor(
        registry.find,
        time.monotonic,
        lambda: uuid4().hex,
        ports,
        FleetSettings(
            stale_s=settings.stale_s,
            excite=settings.excite,
            excite_interval_s=60.0 * settings.excite_minutes,
            ring_channels=RING_CHANNELS if settings.diagnose_alerts else (),
        ),
        wall_clock,
    )
    preparing = ThreadPoolExecutor(1, "wingwatch-expectations")
    stack.callback(preparing.shutdown, cancel_futures=True)
    monitor.prepare_with(preparing)
    stack.callback(_save, monitor, checkpoints)
    return monitor


def _subscribed(
    stack: ExitStack,
    session: zenoh.Session,
    outputs: ZenohOutputs,
    heard: Callable[[str, str], None] | None,
) -> tuple[threading.Event, SensorSubscriber]:
    """What hears vehicles, with what is set when it has; they are asked for their aircraft through it."""
    arrived = threading.Event()
    subscriber = stack.enter_context(SensorSubscriber(session, time.monotonic, arrived.set, heard=heard))
    outputs.ask_through(subscriber.ask_aircraft)
    return arrived, subscriber


def _recorder(stack: ExitStack, settings: ServeSettings, wall_clock: Callable[[], float]) -> Recorder | None:
    """What records, where that is wanted.

    Raises:
        CommandError: the folder cannot be written.
    """
    if settings.record is None:
        return None
    try:
        recorder = stack.enter_context(Recorder(settings.record, settings.recording.limits, wall_clock))
    except OSError as error:
        reason = (error.strerror or "it cannot be written").lower()
        raise CommandError(
            f"--record {settings.record}: {reason}; give a folder that can be written"
        ) from None
    for path in settings.aircraft:
        recorder.attach(f"aircraft/{path.name}", path.read_bytes())
    return recorder


def _alerts_diagnosed(
    stack: ExitStack, settings: ServeSettings, monitor: FleetMonitor, jobs: DiagnosisJobs
) -> AlertDiagnoses | None:
    """What has alerts diagnosed, where that is wanted."""
    return stack.enter_context(AlertDiagnoses(monitor, jobs)) if settings.diagnose_alerts else None
