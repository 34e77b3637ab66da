"""A worker: a watch over the vehicles that are its own, asked over Zenoh; no HTTP, no port."""

import threading
import time
from base64 import b64decode
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from typing import Any

from wingwatch.api import WorkerSilentError
from wingwatch.baselines import Database
from wingwatch.monitor import AlertView, Outputs
from wingwatch.monitor.ports import News
from wingwatch.service.aircraft_registry import AircraftRegistry
from wingwatch.service.ingest import IngestLoop
from wingwatch.service.kernels import Preparation
from wingwatch.service.patient import PatientReader
from wingwatch.service.settings import ServeSettings
from wingwatch.service.stored_alerts import alert_view
from wingwatch.service.watch import Watch, WatchPlan, begin_watch
from wingwatch.service.watch_health import WatchHealth
from wingwatch.service.workers import messages as forms
from wingwatch.service.workers.answering import AnsweringPorts, WorkerAnswers
from wingwatch.service.workers.link import WorkerLink
from wingwatch.service.workers.live import Capacities, LiveWorkers
from wingwatch.service.workers.messages import AnswerError, WorkerState
from wingwatch.service.workers.moves import MovesPorts, VehicleMoves
from wingwatch.service.workers.ownership import ByOrder
from wingwatch.telemetry import PROTOBUF, InboundMessage, ServiceStream, encode_aircraft
from wingwatch.telemetry.worker_keys import WorkerToken, check_worker, new_worker_name, token_key

__all__ = ["Worker", "running_worker"]

_ALERTS_OF_ONE = 1000
_HEAR_S = 0.5
_LEAVE_S = 1.5
_RELEASE_S = 1.0
_CAPACITY_S = 0.5
_ALERTS_PATIENCE_S = 3.0


class Worker:
    """What runs: its name, its watch, and what it says of itself."""

    def __init__(self, name: str, watch: Watch, moves: VehicleMoves, capacity: float) -> None:
        self.name = name
        self._watch, self._moves, self._capacity = watch, moves, capacity
        self._health = WatchHealth(watch, {})

    @property
    def ingest(self) -> IngestLoop:
        """What takes messages in."""
        return self._watch.ingest

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Of Zenoh: the routers connected to, or those listened on."""
        return self._watch.link.connect or self._watch.link.listen

    @property
    def url(self) -> str:
        """A worker has none."""
        return ""

    @property
    def waits_for(self) -> str | None:
        """Why no samples are taken in; None once they are."""
        return self.ingest.problem

    @property
    def starting(self) -> bool:
        """Whether samples are, or will be taken in."""
        return self.ingest.loop.alive

    def wait(self, timeout_s: float) -> bool:
        """Wait until samples are taken in; whether they are."""
        return self.ingest.wait(timeout_s)

    def state(self) -> WorkerState:
        """What it says of itself; it returns at once."""
        watch, figures = self._watch, self._watch.monitor.figures()
        problems = {**self._health.problems(), "moves": self._moves.loop.problem}
        counters = dict(self._health.counters())
        counters["loop"] = {**counters["loop"], "restarts_moves": self._moves.loop.restarts}
        return WorkerState(
            watch.as_worker(self.name, self._capacity, figures, self._moves.counts),
            replace(figures, alerts={}),
            self._health.figures(),
            counters,
            {part: problem for part, problem in problems.items() if problem is not None},
            watch.preparation.view(),
        )


@contextmanager
def running_worker(
    settings: ServeSettings,
    *,
    preparation: Preparation | None = None,
    wall_clock: Callable[[], float] = time.time,
) -> Iterator[Worker]:
    """Start a worker and end it on the way out.

    Args:
        settings: ``worker_name`` and ``capacity`` are its own; what is of HTTP is not used.
        preparation: as for ``running_service``.
        wall_clock: seconds since 1970-01-01 UTC.

    Raises:
        DatabaseError, LinkError, LinkSecurityError, AircraftFileError, CommandError, KeyNameError: one sentence each.
    """
    name = check_worker(settings.worker_name or new_worker_name())
    with ExitStack() as stack:
        registry = AircraftRegistry(settings.aircraft)
        live: LiveWorkers
        link: WorkerLink
        own = name, settings.capacity
        capacities = Capacities(own, lambda: live.names, lambda other: _capacity_of(link, other))
        moves = stack.enter_context(VehicleMoves(ByOrder(name, capacities.look)))
        begun = threading.Event()
        plan = WatchPlan(
            preparation, wall_clock, lambda outputs: _BegunOutputs(outputs, begun), moves.heard, moves.owns
        )
        watch = begin_watch(stack, settings, registry, plan)
        link = WorkerLink(watch.session)
        live = stack.enter_context(LiveWorkers(watch.session, WorkerToken.ALIVE, moves.look_again))
        worker = Worker(name, watch, moves, settings.capacity)
        reader = PatientReader(_ALERTS_PATIENCE_S)

        def alerts(fleet: str, vehicle: str) -> Sequence[AlertView]:
            return reader.ask(lambda: _alerts_of(watch.database, fleet, vehicle))

        moves.begin(
            MovesPorts(
                watch.monitor,
                watch.subscriber,
                watch.checkpoints.read,
                alerts,
                lambda vehicles: _released_by_others(link, name, live, vehicles),
            )
        )
        ports = AnsweringPorts(
            watch.monitor,
            watch.diagnoses,
            worker.state,
            moves.owns,
            watch.subscriber.announcements,
            lambda vehicles: _release(watch, moves, vehicles),
            lambda fleet, vehicle: watch.monitor.take_over(fleet, vehicle, None, alerts(fleet, vehicle)),
            settings.capacity,
        )
        stack.enter_context(WorkerAnswers(watch.session, name, ports, wall_clock))
        watch.subscriber.take_announcements(_announced_before(watch))
        stack.callback(watch.ingest.stop)
        watch.ingest.start()
        begun.set()
        stack.enter_context(_Joining(name, watch, live, moves))
        yield worker


def _announced_before(watch: Watch) -> list[InboundMessage]:
    """What vehicles have said of their aircraft whose checkpoints are in the folder: some say it once."""
    now_s = time.monotonic()
    return [
        InboundMessage(one.fleet, one.vehicle, "aircraft", encode_aircraft(one.message), PROTOBUF, now_s)
        for one in watch.checkpoints.load()
    ]


def _capacity_of(link: WorkerLink, worker: str) -> float:
    try:
        return forms.CAPACITY.decode(link.ask(worker, "capacity", b"", _CAPACITY_S))
    except AnswerError as error:
        raise WorkerSilentError(f"worker {worker} does not say its capacity: {error}") from None


def _released_by_others(
    link: WorkerLink, name: str, live: LiveWorkers, vehicles: Sequence[tuple[str, str]]
) -> None:
    """Have others give vehicles up that are this worker's by now; one that is frozen is waited for a second."""
    if any(other != name for other in live.names):
        link.ask_all("release", forms.VEHICLE_NAMES.encode(tuple(vehicles)), _RELEASE_S)


def _release(watch: Watch, moves: VehicleMoves, vehicles: Sequence[tuple[str, str]]) -> None:
    """Give vehicles up; returns once their last states are written, or after a second."""
    moves.release(vehicles)
    until_s = time.monotonic() + _RELEASE_S
    while time.monotonic() < until_s and (
        any(watch.monitor.knows(*key) and not moves.owns(*key) for key in vehicles)
        or watch.checkpoints.waiting
    ):
        time.sleep(0.01)


def _alerts_of(database: Database, fleet: str, vehicle: str) -> Sequence[AlertView]:
    page = database.alerts(fleet=fleet, vehicle=vehicle, limit=_ALERTS_OF_ONE)
    return [alert_view(record) for record in page.items]


class _BegunOutputs:
    """Implements the monitor's ``Outputs``: what a monitor repeats of earlier runs at its start is not said.

    It is of all vehicles; whoever takes a vehicle over says its alerts again.
    """

    def __init__(self, outputs: Outputs, begun: threading.Event) -> None:
        self._outputs, self._begun = outputs, begun

    def announce(self, fleet: str, vehicle: str, stream: ServiceStream, news: Callable[[], News]) -> None:
        """Hand on once it has begun."""
        if self._begun.is_set():
            self._outputs.announce(fleet, vehicle, stream, news)

    def ask_aircraft(self, fleet: str, vehicle: str) -> None:
        """Hand on."""
        self._outputs.ask_aircraft(fleet, vehicle)


class _Joining:
    """Has a worker join the others: at once where there are none, else as soon as it can take messages in.

    Messages wait in the first worker while its kernels are being compiled, as in a service; beside others a worker that
    cannot compute yet would only take vehicles away from those that can.
    """

    def __init__(self, name: str, watch: Watch, live: LiveWorkers, moves: VehicleMoves) -> None:
        self._name, self._watch, self._live, self._moves = name, watch, live, moves
        self._token: Any = None
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wingwatch-join", daemon=True)

    def __enter__(self) -> "_Joining":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Give up all vehicles, their states saved; the others take them over from there."""
        self._ending.set()
        self._thread.join(1.0)
        self._moves.give_up_all()
        until_s = time.monotonic() + _LEAVE_S
        while time.monotonic() < until_s and self._watch.ingest.loop.alive and self._holds:
            time.sleep(0.02)
        if self._token is not None:
            self._token.undeclare()

    @property
    def _holds(self) -> bool:
        """Whether vehicles are still watched, or their states not yet written."""
        return bool(self._watch.monitor.size) or not self._watch.checkpoints.idle

    def _run(self) -> None:
        self._ending.wait(_HEAR_S)  # for the others' tokens
        self._learn()
        while self._live.names and not self._ending.is_set() and not self._watch.ingest.wait(_HEAR_S):
            continue
        if not self._ending.is_set():
            key = token_key(WorkerToken.ALIVE, self._name)
            self._token = self._watch.session.liveliness().declare_token(key)

    def _learn(self) -> None:
        """What vehicles have said of their aircraft before this worker was there, from one that was."""
        link = WorkerLink(self._watch.session)
        for name in self._live.names:
            with suppress(WorkerSilentError, AnswerError):
                found = forms.ANNOUNCED.decode(link.ask(name, "announced", b""))
                now_s = time.monotonic()
                self._watch.subscriber.take_announcements(
                    [
                        InboundMessage(
                            one.fleet, one.vehicle, "aircraft", b64decode(one.payload), one.encoding, now_s
                        )
                        for one in found
                    ]
                )
                return
