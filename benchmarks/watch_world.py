"""Workers that share a fleet, in simulated time: the real ``WatchKeeper`` of each, all else simulated.

What must hold in every history is checked at each tenth of a second (``World.check``) and at its end
(``World.check_end``).
"""

import heapq
import itertools
import random
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

from wingwatch.baselines import LEASE_S, DatabaseError, Holder, Lease, Leases, VehicleName
from wingwatch.service.workers.shares import Shares, Worker
from wingwatch.service.workers.watch_keeping import WatchKeeper
from wingwatch.service.workers.watch_ports import KeeperPorts

TICK_S = 0.1
LATENCY_S = 0.02
TOKEN_LEASE_S = 10.0  # of a process that is frozen: Zenoh's own
ASK_TIMEOUT_S = 2.0
REPLACED_WITHIN_S = 5.0
STEADY_S = 1.5  # a worker that came back has looked at the leases by then
CALM_S = LEASE_S + 2.0  # a worker is sure of others' absence so long after it came back


class Broken(AssertionError):
    """A history breaks what must hold."""


class LeaseDatabase:
    """The leases as ``LeaseTable`` keeps them, in memory; calls of a process fail while it has no way to them."""

    def __init__(self, world: "World") -> None:
        self._world = world
        self.rows: dict[VehicleName, Lease] = {}
        self.until_s: dict[str, float] = {}
        self.down = False

    def of(self, process: "Process") -> "LeasesOfProcess":
        """As one process sees them."""
        return LeasesOfProcess(self, process)

    def valid(self, owner: str) -> bool:
        """Whether the owner has renewed in time."""
        return self.until_s.get(owner, 0.0) > self._world.now_s

    def changes_hands(self, owner: str, name: VehicleName) -> bool:
        """Take a vehicle where it is free; whether it is the owner's now."""
        row = self.rows.setdefault(name, Lease("", 0))
        if row.owner != owner and not self.valid(row.owner):
            self.rows[name] = Lease(owner, row.number + 1)
        return self.rows[name].owner == owner


class LeasesOfProcess:
    """Implements ``LeasePort``."""

    def __init__(self, database: LeaseDatabase, process: "Process") -> None:
        self._database, self._process = database, process

    def _call(self, act: Callable[[], None] = lambda: None) -> None:
        """Do it; a call may fail before it has done anything, or afterwards with its reply lost."""
        process, chance = self._process, self._process.world.chance
        if self._database.down or process.without_database:
            raise DatabaseError("the database cannot be reached")
        if process.flaky and chance.random() < 0.1:
            raise DatabaseError("the database was asked in vain")
        act()
        if process.flaky and chance.random() < 0.1:
            raise DatabaseError("the reply of the database was lost")

    def renew(self, owner: str) -> None:
        """Hold what is the owner's for a lease's length more."""
        until_s = self._process.world.now_s + LEASE_S
        self._call(lambda: self._database.until_s.update({owner: until_s}))

    def take(self, owner: str, vehicles: Collection[VehicleName]) -> dict[VehicleName, Lease]:
        """Take what nobody holds."""
        taken: dict[VehicleName, Lease] = {}

        def act() -> None:
            if self._database.valid(owner):
                mine = [name for name in vehicles if self._database.changes_hands(owner, name)]
                taken.update({name: self._database.rows[name] for name in mine})

        self._call(act)
        return taken

    def give_up(self, owner: str, vehicles: Collection[VehicleName]) -> None:
        """Others may take these at once."""
        rows = self._database.rows

        def act() -> None:
            for name in vehicles:
                if name in rows and rows[name].owner == owner:
                    rows[name] = Lease("", rows[name].number)

        self._call(act)

    def forget(self, owner: str, vehicles: Collection[VehicleName]) -> None:
        """Nobody needs to watch these any more."""

        def act() -> None:
            for name in vehicles:
                self._database.rows.pop(name, None)

        self._call(act)

    def leave(self, owner: str) -> None:
        """Give up everything."""
        self.give_up(owner, [n for n, lease in self._database.rows.items() if lease.owner == owner])

        def act() -> None:
            self._database.until_s.pop(owner, None)

        self._call(act)

    def look(self, owner: str, everything: bool = True) -> Leases:
        """The leases as they stand."""
        self._call()
        database = self._database
        rows = {
            name: Holder(row.owner, row.number, database.valid(row.owner))
            for name, row in database.rows.items()
        }
        seen = {n: h for n, h in rows.items() if everything or h.owner == owner or not h.valid}
        return Leases({name: database.valid(name) for name in database.until_s}, seen, everything)


@dataclass(eq=False)
class Process:
    """One worker: its keeper, what it watches, and what ails it. It implements the other ports."""

    world: "World"
    name: str
    capacity: float
    load: float = 0.0
    alive: bool = True
    seen: bool = False
    frozen_until_s: float = 0.0
    frozen_since_s: float = float("inf")
    unlinked_until_s: float = 0.0
    no_database_until_s: float = 0.0
    flaky: bool = False
    well_since_s: float = 0.0
    watching: dict[VehicleName, Lease] = field(default_factory=dict)
    entries: list[tuple[VehicleName, Lease]] = field(default_factory=list)
    inbox: list[Callable[[], None]] = field(default_factory=list)
    keeper: WatchKeeper = field(init=False)

    def __post_init__(self) -> None:
        ports = KeeperPorts(self.world.database.of(self), self, self, self)
        self.keeper = WatchKeeper(self.name, ports, lambda: self.world.now_s)

    @property
    def running(self) -> bool:
        """Alive and not frozen."""
        return self.alive and self.world.now_s >= self.frozen_until_s

    @property
    def without_database(self) -> bool:
        """Whether it has no way to the database."""
        return self.world.now_s < self.no_database_until_s

    # -- who is on the network

    def linked(self) -> bool:
        """Whether it is on the network."""
        return not self.world.router_down and self.world.now_s >= self.unlinked_until_s

    def shows(self) -> bool:
        """Whether others see its token: a frozen one's for a while."""
        frozen_s = self.world.now_s - self.frozen_since_s
        return self.alive and self.seen and self.linked() and (self.running or frozen_s < TOKEN_LEASE_S)

    def workers(self) -> dict[str, Worker]:
        """Whom it sees."""
        there = [p for p in self.world.processes if p is self or (self.linked() and p.shows())]
        return {p.name: Worker(p.name, p.capacity, p.load) for p in there if p.seen}

    def appear(self) -> None:
        """Be seen."""
        self.seen = True

    def retire(self) -> None:
        """Be seen as one that leaves."""
        self.capacity = 0.0

    # -- watching

    def known(self) -> Collection[VehicleName]:
        """Everybody knows the whole fleet."""
        return self.world.fleet

    def start(self, vehicle: VehicleName, lease: Lease, state: bytes | None) -> None:
        """Watch a vehicle."""
        if vehicle in self.watching:
            raise Broken(f"{self.name} begins to watch {vehicle} twice")
        if state:
            self.world.check_state(vehicle, state)
        self.watching[vehicle] = lease
        self.world.watched_s[vehicle] = self.world.now_s

    def stop(self, vehicles: Sequence[VehicleName]) -> Mapping[VehicleName, bytes]:
        """Watch these no longer; a state says when it was taken."""
        self.write()
        for vehicle in vehicles:
            self.watching.pop(vehicle)
        return dict.fromkeys(vehicles, str(self.world.now_s).encode())

    def drop(self, vehicle: VehicleName, lease: Lease) -> None:
        """It is another's already."""
        if self.watching.pop(vehicle) != lease:
            raise Broken(f"{self.name} is to drop another lease of {vehicle} than it watches under")

    # -- other workers

    def ask(self, owner: str, vehicle: VehicleName, answered: Callable[[bytes | None], None]) -> None:
        """Ask a worker for a vehicle; a frozen one answers when it wakes, and by then nobody listens."""
        open_question = [True]

        def answer(state: bytes | None) -> None:
            if open_question:
                open_question.clear()
                self.deliver(lambda: answered(state))

        def put(other: Process) -> None:
            other.keeper.release(
                vehicle, self.name, lambda state: self.world.after(LATENCY_S, lambda: answer(state))
            )

        self.world.send(self, owner, put)
        self.world.after(ASK_TIMEOUT_S, lambda: answer(None))

    def tell(self, owner: str, vehicle: VehicleName, number: int) -> None:
        """Say to a worker that its lease has passed on."""
        self.world.send(self, owner, lambda other: other.keeper.taken(vehicle, number))

    def deliver(self, message: Callable[[], None]) -> None:
        """Handled at once, or when the process wakes."""
        self.inbox.append(message)

    # -- its turn

    def turn(self) -> None:
        """Hear what came, keep the share, and write."""
        inbox, self.inbox = self.inbox, []
        for message in inbox:
            message()
        keeper = self.keeper
        if keeper.news.is_set() or self.world.now_s >= keeper._due_s:
            keeper.step()
        if keeper.left.is_set():
            self.alive = False
        if set(self.watching) != set(keeper.held) and self.alive:
            raise Broken(f"{self.name} watches other vehicles than it holds")
        self.work()

    def work(self) -> None:
        """Find something about each vehicle, and write it under the lease of that moment."""
        for vehicle in self.watching:
            lease = self.keeper.lease_of(*vehicle)
            if lease is not None and self.world.chance.random() < 0.1:
                self.entries.append((vehicle, lease))
        if self.world.chance.random() < 0.5:
            self.write()

    def write(self) -> None:
        """Write what waits, as the store does: what is refused is reported."""
        database = self.world.database
        if database.down or self.without_database:
            return
        entries, self.entries = self.entries, []
        for vehicle, lease in entries:
            if database.rows.get(vehicle) == lease:
                self.world.note_written(vehicle, lease)
            else:
                self.world.counts["refused writes"] += 1
                self.keeper.lost(*vehicle, lease)


class World:
    """Workers, a fleet, and what happens to them.

    Args:
        chance: draws everything that is random.
        vehicles: that are known from the start.
    """

    def __init__(self, chance: random.Random, workers: int, vehicles: int) -> None:
        self.chance = chance
        self.now_s = 1000.0
        self.fleet: list[VehicleName] = [("default", f"uav{k}") for k in range(vehicles)]
        self.database = LeaseDatabase(self)
        self.processes: list[Process] = []
        self.router_down = False
        self.counts: Counter[str] = Counter()
        self.watched_s: dict[VehicleName, float] = {}
        self.longest_gap_s = 0.0
        self._written: dict[VehicleName, int] = {}
        self._unwatched_since_s: dict[VehicleName, float] = {}
        self._later: list[tuple[float, int, Callable[[], None]]] = []
        self._serial = itertools.count()
        for _ in range(workers):
            self.join()

    # -- what happens ---------------------------------------------------------------------------------

    def join(self, capacity: float = 200.0) -> Process:
        """A new worker."""
        process = Process(self, f"w{len(self.processes)}", capacity, well_since_s=self.now_s)
        self.processes.append(process)
        return process

    @property
    def running(self) -> list[Process]:
        """Workers that are alive and not frozen."""
        return [p for p in self.processes if p.running]

    def kill(self, process: Process) -> None:
        """It ends without a word."""
        process.alive = False
        process.watching.clear()

    def freeze(self, process: Process, for_s: float) -> None:
        """It stands still, and goes on as though nothing had been."""
        process.frozen_since_s, process.frozen_until_s = self.now_s, self.now_s + for_s

    def unlink(self, process: Process, for_s: float) -> None:
        """It has no network."""
        process.unlinked_until_s = max(process.unlinked_until_s, self.now_s + for_s)

    def restart_router(self, for_s: float) -> None:
        """Everybody comes back at a time of his own."""
        for process in self.processes:
            self.unlink(process, for_s + self.chance.uniform(0.3, 3.0))

    def database_outage(self, for_s: float) -> None:
        """Nobody reaches the database."""
        self.database.down = True

        def up() -> None:
            self.database.down = False

        self.after(for_s, up)

    # -- messages and time ------------------------------------------------------------------------------

    def after(self, delay_s: float, act: Callable[[], None]) -> None:
        """Do it later."""
        heapq.heappush(self._later, (self.now_s + delay_s, next(self._serial), act))

    def send(self, sender: Process, receiver: str, put: Callable[[Process], None]) -> None:
        """A message, which arrives where both are on the network."""
        found = next((p for p in self.processes if p.name == receiver), None)
        if found is not None and sender.linked() and found.linked() and found.alive:
            self.after(LATENCY_S, lambda: found.deliver(lambda: put(found)))

    def run(self, for_s: float) -> None:
        """Let time pass."""
        until_s = self.now_s + for_s
        while self.now_s < until_s:
            self.now_s += TICK_S
            while self._later and self._later[0][0] <= self.now_s:
                heapq.heappop(self._later)[2]()
            turns = self.running
            self.chance.shuffle(turns)
            for process in turns:
                process.turn()
            self.check()

    # -- what must hold ---------------------------------------------------------------------------------

    def note_written(self, vehicle: VehicleName, lease: Lease) -> None:
        """Nothing is written under an older number than something before."""
        if lease.number < self._written.get(vehicle, 0):
            raise Broken(f"{vehicle} is written under {lease} after {self._written[vehicle]}")
        self._written[vehicle] = lease.number
        self.counts["writes"] += 1

    def check_state(self, vehicle: VehicleName, state: bytes) -> None:
        """Nobody has begun to watch a vehicle since the state was taken that it goes on from."""
        if self.watched_s.get(vehicle, 0.0) > float(state):
            raise Broken(f"{vehicle} goes on from a state older than another's")
        self.counts["handed over"] += 1

    def check(self) -> None:
        """No vehicle is watched twice for long, and none is without a watch for long after its owner's death."""
        self._note_well()
        well = [p for p in self.running if self.now_s - p.well_since_s > CALM_S]
        calm = len(well) == len(self.running) == len([p for p in self.processes if p.alive])
        for vehicle in self.fleet:
            held = [
                p
                for p in self.running
                if p.watching.get(vehicle) == self.database.rows.get(vehicle, "nobody")
            ]
            steady = [p for p in self.running if self.now_s - p.well_since_s > STEADY_S]
            watching = [p.name for p in steady if vehicle in p.watching]
            if len(held) > 1:
                raise Broken(f"{vehicle} is watched twice under one number")
            since_s = self._unwatched_since_s.get(vehicle)
            if held:
                self._unwatched_since_s.pop(vehicle, None)
            else:
                self._unwatched_since_s.setdefault(vehicle, self.now_s)
            if len(watching) > 1:
                raise Broken(f"{vehicle} is watched by {watching} at once")
            if since_s is not None and calm:
                gap_s = self.now_s - since_s
                self.longest_gap_s = max(self.longest_gap_s, gap_s)
                calm_s = min(self.now_s - p.well_since_s for p in well)
                if gap_s > REPLACED_WITHIN_S + TICK_S and calm_s > gap_s + CALM_S:
                    raise Broken(f"{vehicle} is not watched for {gap_s:.1f} s")

    def _note_well(self) -> None:
        for p in self.processes:
            if not (p.running and p.linked()) or p.without_database or self.database.down or p.flaky:
                p.well_since_s = self.now_s

    def check_end(self) -> None:
        """After some quiet every vehicle is watched once, by the first in its order, and the database says so."""
        there = {p.name: Worker(p.name, p.capacity) for p in self.running}
        shares = Shares()
        for vehicle in self.fleet:
            who = [p.name for p in self.running if vehicle in p.watching]
            if who != [shares.order(vehicle, there)[0]]:
                raise Broken(
                    f"at the end {vehicle} is watched by {who}, and not by {shares.order(vehicle, there)[0]}"
                )
            if self.database.rows[vehicle].owner != who[0]:
                raise Broken(f"at the end the lease of {vehicle} is {self.database.rows[vehicle]}")
