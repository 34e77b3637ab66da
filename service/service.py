"""The service: HTTP, database, Zenoh and the fleet's monitor wired together, started and ended in order."""

import gc
import logging
import os
import shutil
import socket
import ssl
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from uuid import uuid4

import zenoh
from threadpoolctl import threadpool_limits

from wingwatch import __version__
from wingwatch.api import (
    AccessSettings,
    AppSettings,
    HttpServer,
    ServiceFigures,
    beyond_loopback,
    create_app,
    listen,
    read_certificate,
)
from wingwatch.baselines import open_database
from wingwatch.monitor import FleetMonitor, FleetPorts, FleetSettings, Outputs
from wingwatch.notifications import Clocks
from wingwatch.operations.diagnosis_change import RING_CHANNELS
from wingwatch.operations.faults import CommandError
from wingwatch.operations.study_folder import StudyFolder
from wingwatch.service.aircraft_registry import AircraftRegistry
from wingwatch.service.alert_diagnoses import AlertDiagnoses
from wingwatch.service.checkpoints import CheckpointFolder
from wingwatch.service.database_probe import DatabaseProbe
from wingwatch.service.diagnosis_jobs import DiagnosisJobs
from wingwatch.service.health import Health, Parts, connected, waiting_for
from wingwatch.service.ingest import IngestLoop
from wingwatch.service.kernel_steps import AT_FIRST_USE, LIVE
from wingwatch.service.kernels import KernelCompiler, Preparation
from wingwatch.service.link_settings import link_security
from wingwatch.service.notifications import Notifications, NotifyingOutputs
from wingwatch.service.notify_settings import channel_plans
from wingwatch.service.outputs import ZenohOutputs
from wingwatch.service.patient import PatientHistory
from wingwatch.service.patient_baselines import PatientBaselines
from wingwatch.service.recorded_ports import RecordedCheckpoints, RecordedStore
from wingwatch.service.recorder import Recorder
from wingwatch.service.settings import ServeSettings
from wingwatch.service.store import DatabaseStore
from wingwatch.service.tokens import TokenFile, TokenRegister
from wingwatch.telemetry import SensorSubscriber, ZenohSettings, open_session, with_free_ports

__all__ = ["Parts", "IngestLoop", "Service", "running_service"]

_LOG = logging.getLogger(__name__)
_DATABASE_PATIENCE_S = 1.0
_SWITCH_S = (
    0.0005  # each message that arrives waits so long for the interpreter while the ingest loop is busy
)


class Service:
    """What runs: its address, its monitor, and whether all of it works."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._health = Health(parts)

    @property
    def monitor(self) -> FleetMonitor:
        """Of the fleet."""
        return self._parts.monitor

    @property
    def ingest(self) -> IngestLoop:
        """What takes messages in."""
        return self._parts.ingest

    @property
    def url(self) -> str:
        """Of the status page."""
        return self._parts.http.url

    @property
    def port(self) -> int:
        """Of HTTP."""
        return self._parts.http.port

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Of Zenoh: those listened on, or the routers connected to."""
        return self._parts.link.listen or self._parts.link.connect

    def readiness(self) -> Mapping[str, str | None]:
        """Per part None, or its problem in one sentence; the database is asked, for two seconds at most."""
        return self._health.readiness()

    def problems(self) -> Mapping[str, str | None]:
        """The same at once: the database is not asked."""
        return self._health.problems()

    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """What each part dropped or failed on."""
        return self._health.counters()

    def figures(self) -> ServiceFigures:
        """The service in numbers, beside its counters."""
        return self._health.figures()


def _remove_memory(settings: ServeSettings) -> None:
    """Remove the SQLite file with what belongs to it, and the checkpoints."""
    for suffix in ("", "-wal", "-shm"):
        Path(f"{settings.where}{suffix}").unlink(missing_ok=True)
    shutil.rmtree(settings.checkpoints, ignore_errors=True)


def _tls(settings: ServeSettings) -> ssl.SSLContext | None:
    """What TLS is offered with, where a certificate is set."""
    if settings.certificate is None or settings.private_key is None:
        return None
    return read_certificate(settings.certificate, settings.private_key)


def _link(settings: ServeSettings) -> ZenohSettings:
    """How Zenoh is reached, and what protects it."""
    security = link_security(settings.zenoh, os.environ)
    return ZenohSettings.for_service(with_free_ports(settings.listen), settings.connect, security)


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
    """The fleet's monitor, resumed; what has changed is saved at the end."""
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
    _resume(monitor, checkpoints)
    preparing = ThreadPoolExecutor(1, "wingwatch-expectations")
    stack.callback(preparing.shutdown, cancel_futures=True)
    monitor.prepare_with(preparing)
    stack.callback(_save, monitor, checkpoints)
    return monitor


@contextmanager
def running_service(
    settings: ServeSettings,
    *,
    preparation: Preparation | None = None,
    wall_clock: Callable[[], float] = time.time,
    fresh: bool = False,
    refusals: Mapping[str, int] | None = None,
) -> Iterator[Service]:
    """Start a service and end it on the way out.

    The HTTP port is taken first. Requests are answered, and messages wait, while ``preparation`` goes on.

    Args:
        preparation: done before messages are taken in; without, the kernels of the live path are loaded, and compiled
            where this machine has not done so yet.
        wall_clock: seconds since 1970-01-01 UTC, for the database's entries.
        fresh: remove the SQLite file of ``settings`` and the checkpoints first, once the port is ours.
        refusals: counts of what access rules refuse, where they are kept and read (``noticed_refusals``).

    Raises:
        AddressError, CertificateError, DatabaseError, LinkError, LinkSecurityError, AircraftFileError,
            CommandError: one sentence each.
    """
    with ExitStack() as stack:
        listening = listen(settings.host, settings.port)
        stack.callback(listening.close)
        tokens = TokenRegister(TokenFile(settings.data))
        access = _access(settings, listening, tokens)
        tls = _tls(settings)
        registry = AircraftRegistry(settings.aircraft)
        if fresh:
            _remove_memory(settings)
        database = stack.enter_context(open_database(settings.where, busy_timeout_s=_DATABASE_PATIENCE_S))
        store = stack.enter_context(DatabaseStore(database, wall_clock, settings.history.retention))
        checkpoints = stack.enter_context(CheckpointFolder(settings.checkpoints, wall_clock))
        link = _link(settings)
        session = stack.enter_context(open_session(link))
        outputs = stack.enter_context(ZenohOutputs(session, lambda: connected(session, link)))
        notifications = _notifications(stack, settings, listening, wall_clock)
        _tune_interpreter(stack)
        recorder = _recorder(stack, settings, wall_clock)
        announced = NotifyingOutputs(outputs, notifications)
        monitor = _fleet(stack, settings, registry, store, announced, wall_clock, checkpoints, recorder)
        outputs.answer_from(monitor)
        arrived, subscriber = _subscribed(stack, session, outputs)
        preparation = preparation or KernelCompiler(LIVE, AT_FIRST_USE)
        record = None if recorder is None else recorder.messages
        ingest = IngestLoop(subscriber, monitor, arrived, preparation, record=record)
        jobs = stack.enter_context(DiagnosisJobs(registry.find))
        asked = AppSettings(
            access=access, aircraft=registry.find, diagnoses=jobs, kernels=preparation.view,
            counters=lambda: service.counters(), figures=lambda: service.figures(),
            problems=lambda: service.problems(), database_problem=lambda: waiting_for(store),
            baselines=PatientBaselines(database, wall_clock), documents=settings.documents,
            studies=None if settings.studies is None else StudyFolder(settings.studies),
        )  # fmt: skip
        app = create_app(monitor, lambda: service.readiness(), PatientHistory(database), __version__, asked)
        http = HttpServer(app, listening, tls=tls)
        parts = Parts(
            http=http, monitor=monitor, probe=DatabaseProbe(database.check), store=store, checkpoints=checkpoints,
            session=session, link=link, subscriber=subscriber, outputs=outputs, ingest=ingest, tokens=tokens,
            diagnoses=jobs, alert_diagnoses=_alerts_diagnosed(stack, settings, monitor, jobs), refusals=refusals or {},
            notifications=notifications, recorder=recorder,
        )  # fmt: skip
        service: Service = Service(parts)
        notifications.begin(monitor)
        stack.callback(ingest.stop)
        ingest.start()
        stack.enter_context(http)
        yield service


def _subscribed(
    stack: ExitStack, session: zenoh.Session, outputs: ZenohOutputs
) -> tuple[threading.Event, SensorSubscriber]:
    """What hears vehicles, with what is set when it has; they are asked for their aircraft through it."""
    arrived = threading.Event()
    subscriber = stack.enter_context(SensorSubscriber(session, time.monotonic, arrived.set))
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


def _notifications(
    stack: ExitStack, settings: ServeSettings, listening: socket.socket, wall_clock: Callable[[], float]
) -> Notifications:
    """What says alerts to people, on the channels that are set.

    Raises:
        CommandError: a channel cannot be set up.
    """
    address, port, *_ = listening.getsockname()
    host = next(iter(settings.name), f"[{address}]" if ":" in address else address)
    url = f"{'http' if settings.certificate is None else 'https'}://{host}:{port}"
    plans = channel_plans(settings.notify, os.environ, url)
    return stack.enter_context(Notifications(plans, settings.outboxes, Clocks(wall=wall_clock)))


def _access(settings: ServeSettings, listening: socket.socket, tokens: TokenRegister) -> AccessSettings:
    """Who may do what at the address that is listened on.

    Raises:
        CommandError: tokens are required there, and there is none.
    """
    others = beyond_loopback(listening)
    if others or settings.require_token:
        tokens.require_some()
    if others and settings.certificate is None:
        _LOG.warning(
            "listening on %s without TLS: tokens and answers can be read on the way; give --certificate and "
            "--private-key unless something in front of the service offers TLS",
            listening.getsockname()[0],
        )
    return AccessSettings(
        find=tokens.find,
        required=others or settings.require_token,
        names=(settings.host, *settings.name),
    )
