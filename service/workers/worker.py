"""A worker: a watch over the vehicles that are its own, asked over Zenoh; no HTTP, no port.

Which vehicles are its own its keeper decides, with the leases in the database (``watch_keeping``).
"""

import threading
import time
from base64 import b64decode
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from typing import Self

import zenoh

from wingwatch.api import WorkerSilentError
from wingwatch.baselines import DatabaseError, Lease, LeaseTable, VehicleName
from wingwatch.monitor import AlertState, Outputs
from wingwatch.monitor.ports import News
from wingwatch.service.aircraft_registry import AircraftRegistry
from wingwatch.service.ingest import IngestLoop
from wingwatch.service.kernels import Preparation
from wingwatch.service.loops import Loop
from wingwatch.service.settings import ServeSettings
from wingwatch.service.watch import Watch, WatchPlan, begin_watch, connected
from wingwatch.service.watch_health import WatchHealth
from wingwatch.service.workers import messages as forms
from wingwatch.service.workers.answering import AnsweringPorts, WorkerAnswers
from wingwatch.service.workers.link import WorkerLink
from wingwatch.service.workers.membership import Membership
from wingwatch.service.workers.messages import AnswerError, WorkerState
from wingwatch.service.workers.vehicle_watch import VehicleWatch
from wingwatch.service.workers.watch_keeping import LEAVE_S, WatchKeeper
from wingwatch.service.workers.watch_ports import KeeperPorts
from wingwatch.service.workers.worker_moves import ZenohMoves
from wingwatch.telemetry import PROTOBUF, InboundMessage, ServiceStream, encode_aircraft
from wingwatch.telemetry.worker_keys import new_worker_name

__all__ = ["Worker", "running_worker"]

_HEAR_S = 0.5
_CLAIM_S = 2.0
_LOOK_S = 0.02
_LOAD_S = 1.0
_END_S = 2.0


@dataclass(frozen=True, slots=True)
class _Keeping:
    """What decides which vehicles are watched, and carries it out."""

    keeper: WatchKeeper
    members: Membership
    vehicles: VehicleWatch


class Worker:
    """What runs: its name, its watch, and what it says of itself."""

    def __init__(self, watch: Watch, keeping: _Keeping, capacity: float) -> None:
        self.name = keeping.keeper.me
        self._watch, self._keeping, self._capacity = watch, keeping, capacity
        self._health = WatchHealth(watch, {})
        self.loop = Loop(
            "wingwatch-keeper", "the loop that keeps leases", self._keep, keeping.keeper.news.set
        )
        self._ending = threading.Event()
        self._load_s = float("-inf")

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
        keeper = self._keeping.keeper
        problems = {**self._health.problems(), "leases": keeper.problem or self.loop.problem}
        counters = dict(self._health.counters())
        counters["loop"] = {**counters["loop"], "restarts_leases": self.loop.restarts}
        counts = keeper.counts
        moves = {
            "taken": counts["taken"], "given": counts["released"],
            "lost": counts["lost"], "failed": counts["failed_starts"],
        }  # fmt: skip
        return WorkerState(
            watch.as_worker(self.name, self._capacity, figures, moves),
            replace(figures, alerts={}),
            self._health.figures(),
            counters,
            {part: problem for part, problem in problems.items() if problem is not None},
            watch.preparation.view(),
        )

    def __enter__(self) -> Self:
        self.loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Hand all vehicles over, or give them up, their states written."""
        self._ending.set()
        self._keeping.keeper.leave()
        self._keeping.keeper.left.wait(self._keeping.keeper.leave_s + _END_S)
        self.loop.join(_END_S)

    def claim(self, fleet: str, vehicle: str) -> None:
        """Have a vehicle that is watched nowhere watched here.

        Raises:
            DatabaseError: it has not been taken in time; it may be another worker's.
        """
        self._keeping.vehicles.heard(fleet, vehicle)
        until_s = time.monotonic() + _CLAIM_S
        while not self._keeping.vehicles.watches(fleet, vehicle):
            if time.monotonic() > until_s:
                raise DatabaseError(
                    f"'{vehicle}' of fleet '{fleet}' is not watched by the worker that was asked, so nothing has "
                    "happened; try again"
                )
            time.sleep(_LOOK_S)

    def _keep(self) -> None:
        self._ending.wait(_HEAR_S)  # for the others' tokens
        if not self._ending.is_set():
            self._learn()
        self._keeping.keeper.run(self._each_step)

    def _each_step(self) -> None:
        self._keeping.vehicles.tidy()
        now_s = time.monotonic()
        if now_s - self._load_s >= _LOAD_S:
            self._load_s = now_s
            with suppress(zenoh.ZError):  # without a link nobody hears it
                self._keeping.members.say_load(self._load())

    def _load(self) -> float:
        """1.0 is all that it can do; more where vehicles are left out for it."""
        left_out, size = self._watch.monitor.left_out, self._watch.monitor.size
        return 1.0 + left_out / max(1, size) if left_out else self._watch.ingest.load

    def _learn(self) -> None:
        """What vehicles have said of their aircraft before this worker was there, from one that was."""
        link = WorkerLink(self._watch.session)
        for name in self._keeping.members.workers():
            if name == self.name:
                continue
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


@contextmanager
def running_worker(
    settings: ServeSettings,
    *,
    preparation: Preparation | None = None,
    wall_clock: Callable[[], float] = time.time,
    leave_s: float = LEAVE_S,
) -> Iterator[Worker]:
    """Start a worker and end it on the way out.

    Args:
        settings: ``worker_name`` and ``capacity`` are its own; what is of HTTP is not used.
        preparation: as for ``running_service``.
        wall_clock: seconds since 1970-01-01 UTC.
        leave_s: how long it waits at its end for others to take its vehicles.

    Raises:
        DatabaseError, LinkError, LinkSecurityError, AircraftFileError, CommandError, KeyNameError: one sentence each.
    """
    name = new_worker_name(settings.worker_name or "")
    with ExitStack() as stack:
        registry = AircraftRegistry(settings.aircraft)
        leases, begun = _Leases(), threading.Event()
        vehicles = VehicleWatch(leases.forget)
        plan = WatchPlan(
            preparation=preparation, wall_clock=wall_clock, announcing=lambda outputs: _BegunOutputs(outputs, begun),
            heard=vehicles.heard, owns=vehicles.watches, leases=leases,
        )  # fmt: skip
        watch = begin_watch(stack, settings, registry, plan)
        vehicles.begin(watch)
        watch.monitor.tell_forgotten(vehicles.forgotten)
        moves = ZenohMoves(watch.session, name)
        members = Membership(
            watch.session, name, settings.capacity, lambda: connected(watch.session, watch.link),
            lambda: watch.ingest.problem is None, leases.look,
        )  # fmt: skip
        ports = KeeperPorts(LeaseTable(watch.database), members, vehicles, _ExpectingMoves(moves, vehicles))
        leases.keeper = WatchKeeper(name, ports, time.monotonic, leave_s)
        worker = Worker(watch, _Keeping(leases.keeper, members, vehicles), settings.capacity)
        answers = AnsweringPorts(
            watch.monitor, watch.diagnoses, worker.state, vehicles.watches, watch.subscriber.announcements, worker.claim
        )  # fmt: skip
        stack.enter_context(WorkerAnswers(watch.session, name, answers, wall_clock))
        stack.enter_context(moves)
        moves.answer_from(leases.keeper)
        watch.subscriber.take_announcements(_announced_before(watch))
        for alert in watch.monitor.alerts():
            if (
                alert.state is not AlertState.CLEARED
            ):  # a person may act on it, whether its vehicle sends or not
                vehicles.heard(alert.fleet, alert.vehicle)
        stack.callback(watch.ingest.stop)
        watch.ingest.start()
        begun.set()
        stack.enter_context(members)
        stack.enter_context(worker)
        yield worker


def _announced_before(watch: Watch) -> list[InboundMessage]:
    """What vehicles have said of their aircraft whose checkpoints are in the folder: some say it once."""
    now_s = time.monotonic()
    return [
        InboundMessage(one.fleet, one.vehicle, "aircraft", encode_aircraft(one.message), PROTOBUF, now_s)
        for one in watch.checkpoints.load()
    ]


class _Leases:
    """Implements ``VehicleLeases`` by the keeper, which begins after the store.

    Attributes:
        keeper: None before it has begun: until then no vehicle is watched.
    """

    def __init__(self) -> None:
        self.keeper: WatchKeeper | None = None

    def lease_of(self, fleet: str, vehicle: str) -> Lease | None:
        """The lease of a vehicle that is watched here."""
        return None if self.keeper is None else self.keeper.lease_of(fleet, vehicle)

    def lost(self, fleet: str, vehicle: str, lease: Lease) -> None:
        """The database has refused a write under this lease."""
        if self.keeper is not None:
            self.keeper.lost(fleet, vehicle, lease)

    def forget(self, vehicles: Collection[VehicleName]) -> None:
        """Nobody needs to watch these any more."""
        if self.keeper is not None:
            self.keeper.forget(vehicles)

    def look(self) -> None:
        """Something has changed that the keeper may wait for; returns at once."""
        if self.keeper is not None:
            self.keeper.news.set()


class _ExpectingMoves:
    """Implements ``MovesPort``: what a vehicle sends while another worker is asked for it waits here."""

    def __init__(self, moves: ZenohMoves, vehicles: VehicleWatch) -> None:
        self._moves, self._vehicles = moves, vehicles
        self.tell = moves.tell

    def ask(self, owner: str, vehicle: VehicleName, answered: Callable[[bytes | None], None]) -> None:
        """Ask a worker to release a vehicle."""
        self._vehicles.expect(vehicle)
        self._moves.ask(owner, vehicle, answered)


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
