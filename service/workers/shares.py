"""Which vehicles a worker should watch: a pure function of who is there, what vehicles are known, and the leases.

Each vehicle has an order of the workers by weighted rendezvous hashing (Thaler and Ravishankar, 1998; weights as in
Mosharaf and others: -capacity / ln h, h uniform by a hash of worker and vehicle): the first watches it. When a worker
joins or leaves, only its own vehicles move, and they spread over all others by their capacities. Every worker computes
the same order by itself; where two do not see the same workers the leases in the database decide.
"""

import math
from bisect import insort
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import blake2b

from wingwatch.baselines import Holder, VehicleName

__all__ = ["HAS_ROOM", "OVERLOADED", "Ask", "Pace", "Plan", "Shares", "Situation", "Worker", "score"]

OVERLOADED = 1.0
"""Load above which a worker hands vehicles on."""

HAS_ROOM = 0.8
"""Load below which a worker takes what others watch. The gap between the two keeps vehicles from going to and fro."""

_UNIFORM_BITS = 52
_KEPT = 4


@dataclass(frozen=True, slots=True)
class Worker:
    """A worker on the network.

    Attributes:
        capacity: vehicles that it is meant for; 0 where it leaves: it takes nothing, and others take what it has.
        load: fraction of what it can do; 1.0 is full.
    """

    name: str
    capacity: float
    load: float = 0.0

    @property
    def has_room(self) -> bool:
        """Whether it takes what others watch."""
        return self.load < HAS_ROOM


def score(worker: Worker, vehicle: VehicleName) -> float:
    """Place of a worker in a vehicle's order: the highest score is the first. Positive; the capacity must be."""
    name = f"{worker.name}\0{vehicle[0]}\0{vehicle[1]}".encode()
    drawn = int.from_bytes(blake2b(name, digest_size=8).digest(), "big") >> (64 - _UNIFORM_BITS)
    uniform = (drawn + 0.5) / 2.0**_UNIFORM_BITS  # neither 0 nor 1
    return -worker.capacity / math.log(uniform)


@dataclass(frozen=True)
class Situation:
    """What a worker knows when it decides.

    Attributes:
        me: its name.
        workers: on the network, by name, this one included.
        gone: of these, who has not renewed its lease for so long that it is taken for gone.
        settled: whether this worker has had network and database for long enough to believe that others are absent.
        known: vehicles that send or are announced.
        leases: as last seen.
        asked: vehicles whose release has been asked for and not been answered.
        moves: how many vehicles may be asked for to balance the load.
        rescues: how many may be asked for of workers that leave.
    """

    me: str
    workers: Mapping[str, Worker]
    leases: Mapping[VehicleName, Holder]
    known: Collection[VehicleName] = ()
    gone: frozenset[str] = frozenset()
    settled: bool = True
    asked: Collection[VehicleName] = ()
    moves: int = 0
    rescues: int = 0

    @cached_property
    def candidates(self) -> dict[str, Worker]:
        """Workers that may watch vehicles."""
        there = self.workers.values()
        return {w.name: w for w in there if w.capacity > 0.0 and w.name not in self.gone}


@dataclass(frozen=True, slots=True)
class Ask:
    """A vehicle whose owner is asked to release it."""

    vehicle: VehicleName
    owner: str


@dataclass(frozen=True, slots=True)
class Plan:
    """What a worker should do.

    Attributes:
        take: vehicles to take now: nobody holds them, or their owner is gone.
        ask: vehicles to ask for.
        waiting: vehicles whose owner is not there and whose lease has not run out.
    """

    take: tuple[VehicleName, ...] = ()
    ask: tuple[Ask, ...] = ()
    waiting: int = 0


class _Orders:
    """Orders of vehicles, followed as workers come and go: who joins costs one hash a vehicle, who leaves none.

    Of each order the first few are kept; the rest is computed where it is asked for.
    """

    def __init__(self) -> None:
        self._workers: dict[str, float] = {}
        self._seen: Mapping[str, Worker] = {}
        self._first: dict[VehicleName, list[tuple[float, str]]] = {}

    def of(self, vehicle: VehicleName, candidates: Mapping[str, Worker]) -> Iterator[str]:
        """Names of the workers, the first in the vehicle's order first."""
        if candidates is not self._seen:
            self._follow(candidates)
        first = self._first.get(vehicle)
        if not first:
            first = self._first[vehicle] = _ranked(vehicle, candidates)[:_KEPT]
        for _, name in first:
            yield name
        if len(first) < len(candidates):
            for _, name in _ranked(vehicle, candidates)[len(first) :]:
                yield name

    def bound(self, vehicles: int) -> None:
        """Forget what is of vehicles that are not known any more, once it is most."""
        if len(self._first) > 2 * vehicles + 1000:
            self._first.clear()

    def _follow(self, candidates: Mapping[str, Worker]) -> None:
        now = {worker.name: worker.capacity for worker in candidates.values()}
        left = {name for name, capacity in self._workers.items() if now.get(name) != capacity}
        joined = [w for w in candidates.values() if self._workers.get(w.name) != w.capacity]
        stayed = len(self._workers) - len(left)
        self._workers, self._seen = now, candidates
        if not left and not joined:
            return
        for vehicle, first in self._first.items():
            if left:
                first[:] = [place for place in first if place[1] not in left]
            # Nothing is known of the places behind those that are kept.
            whole = len(first) == stayed
            for worker in joined if first or whole else ():
                place = -score(worker, vehicle), worker.name
                if whole or place < first[-1]:
                    insort(first, place)
            del first[_KEPT:]


def _ranked(vehicle: VehicleName, candidates: Mapping[str, Worker]) -> list[tuple[float, str]]:
    return sorted((-score(worker, vehicle), worker.name) for worker in candidates.values())


class Shares:
    """Decides; it remembers the orders of vehicles among the present workers, and nothing else."""

    def __init__(self) -> None:
        self._orders = _Orders()

    def order(self, vehicle: VehicleName, candidates: Mapping[str, Worker]) -> tuple[str, ...]:
        """Names of the workers, the first in the vehicle's order first."""
        return tuple(self._orders.of(vehicle, candidates))

    def target(self, vehicle: VehicleName, holder: str, candidates: Mapping[str, Worker]) -> str | None:
        """Who should watch a vehicle that ``holder`` watches (empty: nobody); None where there is no worker.

        The first in the order who has room. The holder keeps the vehicle where nobody before it has room, and hands it
        on where it is overloaded and anybody has room. Without a holder, and where nobody has room, those that are
        not overloaded come first.
        """

        def first(suits: Callable[[Worker], bool]) -> str | None:
            return next(
                (name for name in self._orders.of(vehicle, candidates) if suits(candidates[name])), None
            )

        mine = candidates.get(holder)
        if mine is not None and mine.load <= OVERLOADED:
            return first(lambda worker: worker.name == holder or worker.has_room)
        with_room = first(lambda worker: worker.has_room)
        if with_room is not None or mine is not None:
            return with_room or holder
        return first(lambda worker: worker.load <= OVERLOADED) or first(lambda _: True)

    def decide(self, now: Situation) -> Plan:
        """Which vehicles to take, and whom to ask for which."""
        take: list[VehicleName] = []
        asks: list[Ask] = []
        left = {"moves": now.moves, "rescues": now.rescues}
        waiting = 0
        if now.me not in now.candidates:
            return Plan()
        for vehicle in dict.fromkeys((*now.leases, *now.known)):
            holder = now.leases.get(vehicle)
            owner = "" if holder is None else holder.owner
            if owner == now.me or self.target(vehicle, owner, now.candidates) != now.me:
                continue
            if holder is None or not owner or self._is_free(holder, now):
                take.append(vehicle)
            elif not holder.valid or owner not in now.workers:
                waiting += 1
            elif vehicle not in now.asked:
                pace = "moves" if owner in now.candidates else "rescues"
                if left[pace] > 0:
                    left[pace] -= 1
                    asks.append(Ask(vehicle, owner))
        self._orders.bound(len(now.leases) + len(now.known))
        return Plan(tuple(take), tuple(asks), waiting)

    def may_release(self, now: Situation, vehicle: VehicleName, asker: str) -> bool:
        """Whether this worker, which watches a vehicle, finds too that another should: so nothing goes to and fro."""
        return asker != now.me and self.target(vehicle, now.me, now.candidates) == asker

    @staticmethod
    def _is_free(holder: Holder, now: Situation) -> bool:
        """Whether the owner's lease has run out, and it is not merely late."""
        is_away = holder.owner not in now.workers or holder.owner in now.gone
        return not holder.valid and is_away and now.settled


@dataclass(slots=True)
class Pace:
    """Limits how many vehicles move: a token bucket.

    Args:
        per_s: moves a second in the long run.
        most: at once.
    """

    per_s: float
    most: float
    _left: float = field(init=False)
    _at_s: float | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self._left = self.most

    def allowed(self, now_s: float) -> int:
        """How many may move now."""
        if self._at_s is not None:
            self._left = min(self.most, self._left + self.per_s * max(0.0, now_s - self._at_s))
        self._at_s = now_s
        return int(self._left)

    def spend(self, moves: int) -> None:
        """So many move."""
        self._left -= moves
