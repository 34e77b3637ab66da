"""Keeps a worker's share of the fleet: renews its lease, takes what is its own, hands over what is others'.

One thread does everything in turns: once a second a round (renew, look, take, ask), and between rounds what others ask
and answer. Nothing waits for another worker: an answer comes in as an event. What is watched is exactly what is held:
``lease_of`` gives the lease under which a vehicle's entries are written.

What a worker cannot know it does not act on. Without the database it watches on, and its entries wait. Without the
network it does not renew, so that others may take its vehicles; where nobody does, it goes on with all of them. That
another worker is absent it believes after it has had both for the length of a lease. See
``docs/decisions/0119-leases-and-moving.md``.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from wingwatch.baselines import LEASE_S, DatabaseError, Holder, Lease, Leases, VehicleName
from wingwatch.service.workers.shares import Ask, Pace, Shares, Situation
from wingwatch.service.workers.watch_ports import KeeperPorts

__all__ = ["LEAVE_S", "WatchKeeper"]

_LOG = logging.getLogger(__name__)
_EVERY_S = 1.0
_LOOK_AT_ALL_S = (
    60.0  # what others hold matters only to whoever asks for it, and then a wrong answer makes it look
)
_LOOK_AT_THE_ABSENT_S = 5.0
_LATE_S = 2.0
"""For so long a worker may be on the network without a lease: the database's clock may have jumped, or it is slow."""
_ANSWER_S = 5.0
LEAVE_S = 10.0
"""How long a worker that leaves waits for others to take its vehicles."""
_STARTED_AT_ONCE = 20
_MOST_EVENTS = 10_000
_MOST_STATES = 500
_MOVES_PER_S, _RESCUES_PER_S = 4.0, 25.0


class WatchKeeper:
    """Keeps the share of one worker. It implements ``VehicleLeases`` for the store.

    Args:
        me: this worker's name; it must be new at each start.
        ports: the outside.
        clock: monotonic seconds.
        leave_s: how long it waits for others to take its vehicles once it leaves.

    Attributes:
        news: set when there is something to do before the next round.
        left: set when everything has been handed over or given up, after ``leave``.
        problem: why leases are not kept; None while they are.
    """

    def __init__(
        self, me: str, ports: KeeperPorts, clock: Callable[[], float], leave_s: float = LEAVE_S
    ) -> None:
        self.me, self._ports, self._clock, self.leave_s = me, ports, clock, leave_s
        self._held: dict[VehicleName, Lease] = {}
        self._stopped: set[VehicleName] = set()  # ours, and not watched: to be given up
        self._states: dict[VehicleName, tuple[float, bytes]] = {}  # handed over, and not taken yet
        self._leases: dict[VehicleName, Holder] = {}
        self._asked: dict[VehicleName, float] = {}
        self._late: dict[str, float] = {}
        self._shares = Shares()
        self._moves, self._rescues = Pace(_MOVES_PER_S, _MOVES_PER_S), Pace(_RESCUES_PER_S, _RESCUES_PER_S)
        self._releases = Pace(_MOVES_PER_S, _MOVES_PER_S)
        self._events: deque[Callable[[], None]] = deque(maxlen=_MOST_EVENTS)
        self._requests: deque[_Request] = deque(maxlen=_MOST_EVENTS)
        self._due_s = self._round_s = float("-inf")
        self._renewed_s = float("-inf")
        self._linked_since_s = self._leased_since_s = float("inf")
        self._looked_s, self._seen = float("-inf"), frozenset[tuple[str, float]]()
        self._leaving_since_s: float | None = None
        self._waiting = 0  # vehicles whose owner is absent, as far as we know
        self._counts = dict.fromkeys(
            ("taken", "asked", "not_released", "released", "lost", "failed_starts", "database_failures"), 0
        )
        self.news, self.left = threading.Event(), threading.Event()
        self.problem: str | None = None

    # -- in any thread ------------------------------------------------------------------------------

    @property
    def held(self) -> dict[VehicleName, Lease]:
        """What this worker watches, and under which leases."""
        return dict(self._held)

    @property
    def counts(self) -> dict[str, int]:
        """Vehicles taken, asked for, not released when asked for, released, lost to others without having been asked,
        not started, and rounds without the database."""
        return dict(self._counts)

    def lease_of(self, fleet: str, vehicle: str) -> Lease | None:
        """The lease of a vehicle that this worker watches; None of others."""
        return self._held.get((fleet, vehicle))

    def lost(self, fleet: str, vehicle: str, lease: Lease) -> None:
        """The database has refused a write under this lease."""
        self._post(lambda: self._drop((fleet, vehicle), lease.number))

    def release(self, vehicle: VehicleName, asker: str, answer: Callable[[bytes | None], None]) -> None:
        """Another worker asks for a vehicle; it is answered once, later."""
        self._requests.append(_Request(vehicle, asker, answer))
        self.news.set()

    def taken(self, vehicle: VehicleName, number: int) -> None:
        """Another worker has taken a vehicle under this number."""
        self._post(lambda: self._drop(vehicle, number - 1))

    def forget(self, vehicles: Collection[VehicleName]) -> None:
        """Nobody needs to watch these any more; whoever calls has stopped watching them."""
        self._post(lambda: self._forget(list(vehicles)))

    def leave(self) -> None:
        """Hand everything over and end: ``left`` is set about ``leave_s`` later at the latest."""
        self._post(self._retire)

    def _post(self, event: Callable[[], None]) -> None:
        self._events.append(event)
        self.news.set()

    # -- in the keeper's thread -----------------------------------------------------------------------

    def run(self, each: Callable[[], object] = lambda: None) -> None:
        """Keep the share until it is left.

        Args:
            each: called before each step: once a second, and when there is news.
        """
        while not self.left.is_set():
            self.news.wait(max(0.0, self._due_s - self._clock()))
            each()
            self.step()

    def step(self) -> None:
        """Do what is due, and what others have asked and answered."""
        self.news.clear()
        if self._clock() >= self._due_s:
            self._try(self._round)
        while self._events:
            self._try(self._events.popleft())
        if self._requests:
            self._try(self._answer_requests)
        if self._leaving_since_s is not None:
            self._end_where_done(self._leaving_since_s)

    def _try(self, act: Callable[[], None]) -> None:
        try:
            act()
        except DatabaseError as error:
            self._counts["database_failures"] += 1
            if self.problem is None:
                _LOG.warning("leases are not kept: %s", error)
            self.problem = str(error)

    def _round(self) -> None:
        now_s = self._clock()
        self._due_s = now_s + _EVERY_S
        linked = self._note_link(now_s)
        if linked:
            self._renew()
        seen = self._look(now_s)
        self.problem = None
        self._reconcile(seen)
        if linked and self._leaving_since_s is None:
            self._ports.members.appear()
            self._decide()

    def _note_link(self, now_s: float) -> bool:
        linked = self._ports.members.linked()
        was_away = now_s - self._round_s > LEASE_S  # frozen, or in the database's hands
        if not linked or was_away:
            self._linked_since_s = now_s if linked else float("inf")
        else:
            self._linked_since_s = min(self._linked_since_s, now_s)
        self._round_s = now_s
        return linked

    def _renew(self) -> None:
        now_s = self._clock()
        try:
            self._ports.leases.renew(self.me)
        except DatabaseError:
            self._leased_since_s = float("inf")
            raise
        if now_s - self._renewed_s > LEASE_S or self._leased_since_s == float("inf"):
            self._leased_since_s = now_s
        self._renewed_s = now_s

    def _renew_where_due(self) -> None:
        if self._clock() - self._renewed_s >= _EVERY_S and self._ports.members.linked():
            self._renew()

    def _look(self, now_s: float) -> Leases:
        """See who holds what: of others' leases only now and then, and whenever the workers are not the same."""
        workers = self._ports.members.workers().values()
        members = frozenset((worker.name, worker.capacity) for worker in workers)
        every_s = _LOOK_AT_THE_ABSENT_S if self._waiting else _LOOK_AT_ALL_S
        everything = members != self._seen or now_s - self._looked_s >= every_s
        seen = self._ports.leases.look(self.me, everything)
        if not everything and self._has_moved(seen):
            everything, seen = True, self._ports.leases.look(self.me, True)
        if everything:
            self._looked_s, self._seen, self._leases = now_s, members, dict(seen.vehicles)
        else:
            self._leases |= seen.vehicles
        self._note_late(seen.workers, now_s)
        return seen

    def _has_moved(self, seen: Leases) -> bool:
        """Whether a vehicle that was ours or free is somebody's by now."""
        return any(
            name not in seen.vehicles and (holder.owner == self.me or not holder.valid)
            for name, holder in self._leases.items()
        )

    def _note_late(self, renewed: Mapping[str, bool], now_s: float) -> None:
        """Since when each worker that is on the network has been seen without a lease."""
        late = [name for name in self._ports.members.workers() if not renewed.get(name, False)]
        self._late = {name: self._late.get(name, now_s) for name in late}

    def _reconcile(self, seen: Leases) -> None:
        """Watch what is ours, and nothing else."""
        mine = {name: h.lease for name, h in seen.vehicles.items() if h.owner == self.me}
        for name, lease in list(self._held.items()):
            if mine.get(name) != lease:
                self._drop(name, lease.number)
        unheld = {n: lease for n, lease in mine.items() if n not in self._held and n not in self._stopped}
        self._stopped &= set(mine)
        if self._stopped:
            self._give_up(list(self._stopped))
        self._start(unheld)

    def _situation(self, now_s: float) -> Situation:
        settled_s = max(self._linked_since_s, self._leased_since_s)
        gone = {n for n, since_s in self._late.items() if n != self.me and now_s - since_s >= _LATE_S}
        settled = now_s - settled_s >= LEASE_S
        return Situation(
            self.me,
            self._ports.members.workers(),
            self._leases,
            self._ports.watch.known(),
            frozenset(gone) if settled else frozenset(),
            settled,
            self._asked,
            self._moves.allowed(now_s),
            self._rescues.allowed(now_s),
        )

    def _decide(self) -> None:
        now_s = self._clock()
        self._asked = {n: at_s for n, at_s in self._asked.items() if now_s - at_s < _ANSWER_S}
        self._states = {n: kept for n, kept in self._states.items() if now_s - kept[0] < _ANSWER_S}
        now = self._situation(now_s)
        plan = self._shares.decide(now)
        self._waiting = plan.waiting
        self._take(plan.take)
        for ask in plan.ask:
            pace = self._moves if ask.owner in now.candidates else self._rescues
            pace.spend(1)
            self._ask(ask, now_s)

    def _take(self, wanted: Sequence[VehicleName]) -> None:
        if not wanted:
            return
        taken = dict(self._ports.leases.take(self.me, wanted))
        if len(taken) < len(wanted):
            self._looked_s = float("-inf")  # somebody was faster: see who
        owners = {name: self._leases[name].owner for name in taken if name in self._leases}
        self._leases |= {name: Holder(self.me, lease.number, True) for name, lease in taken.items()}
        there = self._ports.members.workers()
        for name, owner in owners.items():
            if owner in there and owner != self.me:
                self._ports.moves.tell(owner, name, taken[name].number)
        self._start({name: lease for name, lease in taken.items() if name not in self._held})

    def _start(self, taken: Mapping[VehicleName, Lease]) -> None:
        names = list(taken)
        for start in range(0, len(names), _STARTED_AT_ONCE):
            for name in names[start : start + _STARTED_AT_ONCE]:
                self._counts["taken"] += self._start_one(name, taken[name], self._state_of(name))
            self._renew_where_due()

    def _start_one(self, name: VehicleName, lease: Lease, state: bytes | None) -> bool:
        self._held[name] = lease  # before it is watched: what it says at once is written under the lease
        try:
            self._ports.watch.start(name, lease, state)
        except Exception:  # one vehicle must not keep the others from being watched
            _LOG.exception("%s/%s could not be taken over", *name)
            self._counts["failed_starts"] += 1
            self._held.pop(name, None)
            self._stopped.add(name)
            return False
        return True

    def _state_of(self, name: VehicleName) -> bytes | None:
        """What was handed over with a vehicle, where that is not so old that others may have watched it since."""
        at_s, state = self._states.pop(name, (float("-inf"), None))
        return state if self._clock() - at_s < _ANSWER_S else None

    def _ask(self, ask: Ask, now_s: float) -> None:
        self._asked[ask.vehicle] = now_s
        self._counts["asked"] += 1

        def answered(state: bytes | None) -> None:
            self._post(lambda: self._answered(ask.vehicle, state))

        self._ports.moves.ask(ask.owner, ask.vehicle, answered)

    def _answered(self, vehicle: VehicleName, state: bytes | None) -> None:
        self._asked.pop(vehicle, None)
        if state is None:
            self._counts["not_released"] += 1
            self._looked_s = float("-inf")  # what we believe of the leases may be old
            return
        if state and len(self._states) < _MOST_STATES:
            self._states[vehicle] = self._clock(), state
        self._take([vehicle])

    def _answer_requests(self) -> None:
        """Release what others ask for: all at once, for what waits is written in one go."""
        asked = [self._requests.popleft() for _ in range(len(self._requests))]
        now_s = self._clock()
        now = self._situation(now_s)
        allowed = self._releases.allowed(now_s)
        granted: list[_Request] = []
        for one in asked:
            free = self._leaving_since_s is not None
            of_ours = one.vehicle in self._held and all(g.vehicle != one.vehicle for g in granted)
            of_ours = of_ours and self.problem is None
            if of_ours and (free or allowed > 0) and self._shares.may_release(now, one.vehicle, one.asker):
                granted.append(one)
                if not free:
                    allowed -= 1
                    self._releases.spend(1)
            else:
                one.answer(None)
        if granted:
            self._release(granted)

    def _release(self, granted: Sequence["_Request"]) -> None:
        """Stop, give up, answer. Where the database does not take it nobody could take over: we watch on."""
        names = [one.vehicle for one in granted]
        try:
            states = self._ports.watch.stop(names)
        except Exception:  # whatever happened, they are not watched any more
            _LOG.exception("%d vehicles are released without a checkpoint", len(names))
            states = {}
        leases = {name: self._held.pop(name) for name in names}
        try:
            self._give_up(names)
        except DatabaseError:
            for one in granted:
                self._start_one(one.vehicle, leases[one.vehicle], states.get(one.vehicle))
                one.answer(None)
            self._due_s = float("-inf")  # it may have taken it all the same: look at once
            self.news.set()
            raise
        for one in granted:
            one.answer(states.get(one.vehicle, b""))
        self._counts["released"] += len(names)

    def _give_up(self, names: Sequence[VehicleName]) -> None:
        self._ports.leases.give_up(self.me, names)
        self._stopped -= set(names)
        for name in names:
            if name in self._leases:
                self._leases[name] = replace(self._leases[name], owner="", valid=False)

    def _drop(self, name: VehicleName, number: int) -> None:
        """A vehicle is another's, where ours is under this number or an older one."""
        lease = self._held.get(name)
        if lease is None or lease.number > number:
            return
        self._held.pop(name)
        self._counts["lost"] += 1
        self._looked_s = float("-inf")
        try:
            self._ports.watch.drop(name, lease)
        except Exception:
            _LOG.exception("%s/%s could not be dropped", *name)

    def _forget(self, names: Sequence[VehicleName]) -> None:
        for name in names:
            self._held.pop(name, None)
            self._leases.pop(name, None)
        self._stopped |= set(names)  # until the database knows
        self._ports.leases.forget(self.me, names)
        self._stopped -= set(names)

    def _retire(self) -> None:
        if self._leaving_since_s is None:
            self._leaving_since_s = self._clock()
            self._ports.members.retire()

    def _end_where_done(self, since_s: float) -> None:
        others = any(w.capacity > 0.0 and w.name != self.me for w in self._ports.members.workers().values())
        if self._held and others and self._clock() - since_s < self.leave_s:
            return
        try:
            self._ports.watch.stop(list(self._held))
        except Exception:
            _LOG.exception("the last vehicles could not be stopped in order")
        self._held.clear()
        try:
            self._ports.leases.leave(self.me)
        except DatabaseError as error:
            _LOG.warning("the leases run out by themselves: %s", error)
        self.left.set()


@dataclass(frozen=True, slots=True)
class _Request:
    """Another worker's question for a vehicle."""

    vehicle: VehicleName
    asker: str
    answer: Callable[[bytes | None], None]
