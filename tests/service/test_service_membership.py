"""Workers that see each other, ask each other for vehicles, and share a fleet, over real links and a real database."""

import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
import zenoh
from loopback import free_endpoint

from wingwatch.baselines import Lease, LeaseLostError, LeaseTable, VehicleName, open_database
from wingwatch.monitor import AlertState, AlertView
from wingwatch.service.store import DatabaseStore
from wingwatch.service.stored_alerts import alert_record
from wingwatch.service.watch import connected
from wingwatch.service.workers.membership import Membership
from wingwatch.service.workers.shares import Worker
from wingwatch.service.workers.watch_keeping import WatchKeeper
from wingwatch.service.workers.watch_ports import KeeperPorts
from wingwatch.service.workers.worker_moves import ZenohMoves
from wingwatch.telemetry import KeyNameError, ZenohSettings, open_session
from wingwatch.telemetry.worker_keys import new_worker_name, token_key, worker_key

PATIENCE_S = 60.0
UAV = ("default", "uav1")
ALERT = AlertView(
    id="a1", fleet="default", vehicle="uav1", kind="icing", cause="icing", level="warning",
    state=AlertState.ACTIVE, raised_s=80.5, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97,
    basis="a-priori", text="Icing.", evidence=(), note=(),
)  # fmt: skip


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


@pytest.fixture
def endpoint() -> str:
    return free_endpoint()


@pytest.fixture
def router(endpoint: str) -> Iterator[zenoh.Session]:
    with open_session(ZenohSettings(mode="router", listen=(endpoint,))) as session:
        yield session


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as opened:
        yield opened


def link(endpoint: str) -> ZenohSettings:
    return ZenohSettings.for_service(connect=(endpoint,))


def session_of(stack: ExitStack, endpoint: str) -> zenoh.Session:
    return stack.enter_context(open_session(link(endpoint)))


def member(stack: ExitStack, endpoint: str, name: str, capacity: float = 200.0) -> Membership:
    session = session_of(stack, endpoint)
    made = stack.enter_context(
        Membership(session, name, capacity, lambda: connected(session, link(endpoint)))
    )
    made.appear()
    return made


# -- who is there ---------------------------------------------------------------------------------------


@pytest.mark.usefixtures("router")
def test_workers_see_each_other_with_capacity_and_load_whoever_came_first(
    endpoint: str, stack: ExitStack
) -> None:
    first, second = member(stack, endpoint, "w1"), member(stack, endpoint, "w2", 50)
    both = {"w1": Worker("w1", 200), "w2": Worker("w2", 50)}
    until(lambda: first.workers() == both == second.workers())
    second.appear()  # again
    first.say_load(0.5)
    until(lambda: second.workers()["w1"] == Worker("w1", 200, 0.5) == first.workers()["w1"])
    assert first.linked()
    assert first.strange == second.strange == 0


@pytest.mark.usefixtures("router")
def test_a_worker_that_leaves_is_seen_without_capacity_before_it_goes(
    endpoint: str, stack: ExitStack
) -> None:
    first = member(stack, endpoint, "w1")
    with ExitStack() as of_second:
        second = member(of_second, endpoint, "w2")
        until(lambda: "w2" in first.workers())
        second.retire()
        second.retire()
        second.appear()  # too late
        until(lambda: first.workers()["w2"] == Worker("w2", 0))
    until(lambda: set(first.workers()) == {"w1"})
    assert first.workers() == {"w1": Worker("w1", 200)}


@pytest.mark.usefixtures("router")
def test_a_worker_that_is_not_ready_takes_nothing_beside_others_and_all_where_there_are_none(
    endpoint: str, stack: ExitStack
) -> None:
    session, ready = session_of(stack, endpoint), threading.Event()
    alone = stack.enter_context(Membership(session, "w1", 1.0, lambda: True, ready.is_set))
    alone.appear()
    until(lambda: alone.workers() == {"w1": Worker("w1", 1.0)})
    changes = threading.Event()
    late = Membership(session_of(stack, endpoint), "w2", 1.0, lambda: True, ready.is_set, changes.set)
    stack.enter_context(late)
    until(lambda: late.workers() == {"w1": Worker("w1", 1.0), "w2": Worker("w2", 0.0)})
    changes.clear()
    late.appear()
    assert late.workers()["w2"].capacity == 0.0
    ready.set()
    late.appear()
    until(lambda: alone.workers() == {"w1": Worker("w1", 1.0), "w2": Worker("w2", 1.0)})
    assert changes.wait(PATIENCE_S)


def test_a_lost_router_is_noticed_and_everybody_is_seen_again_afterwards(
    endpoint: str, stack: ExitStack
) -> None:
    with open_session(ZenohSettings(mode="router", listen=(endpoint,))):
        first, second = member(stack, endpoint, "w1"), member(stack, endpoint, "w2")
        until(lambda: set(first.workers()) == {"w1", "w2"} == set(second.workers()))
    until(lambda: not first.linked() and "w2" not in first.workers())
    with open_session(ZenohSettings(mode="router", listen=(endpoint,))):
        until(first.linked)
        until(lambda: set(first.workers()) == {"w1", "w2"} == set(second.workers()))
        assert first.workers() == second.workers() == {name: Worker(name, 200) for name in ("w1", "w2")}


def test_what_is_no_token_and_no_load_is_counted(
    router: zenoh.Session, endpoint: str, stack: ExitStack
) -> None:
    first = member(stack, endpoint, "w1")
    root = "wingwatch/workers/v1"

    def linked() -> bool:  # what is declared takes a moment to be known
        router.put(f"{root}/w1/load", "0.5")
        return first.workers() == {"w1": Worker("w1", 200, 0.5)}

    until(linked)
    tokens = [
        f"{root}/alive/{what}" for what in ("W1/200", "w3/-1", "w3/many", "w3/1e3", f"w3/{10**9}", "w3/.")
    ]
    declared = [router.liveliness().declare_token(key) for key in tokens]
    for load in ("much", "nan", "-1"):
        router.put(f"{root}/w1/load", load)
    router.put(f"{root}/w9/load", "0.5")  # of nobody
    router.put(f"{root}/w1/load", "0.25")
    until(lambda: first.workers() == {"w1": Worker("w1", 200, 0.25)})
    until(lambda: first.strange == len(tokens) + 1)
    assert len(declared) == 6


def test_names_and_capacities_that_cannot_be_are_refused(router: zenoh.Session) -> None:
    with pytest.raises(KeyNameError, match="worker 'A/b' is no valid name"):
        Membership(router, "A/b", 200, lambda: True)
    with pytest.raises(ValueError, match=r"the capacity is 0; give a number from 0\.001 to 1000"):
        Membership(router, "w1", 0, lambda: True)
    with pytest.raises(KeyNameError, match="the workers' tokens stand there"):
        Membership(router, "alive", 200, lambda: True)
    with pytest.raises(KeyNameError, match="too long a name"):
        new_worker_name("w" * 60)
    with pytest.raises(KeyNameError, match="no valid name"):
        new_worker_name("Worker 1")
    assert new_worker_name("hangar") != new_worker_name("hangar")
    assert worker_key(new_worker_name("hangar"), "release").startswith("wingwatch/workers/v1/hangar-")
    assert len(new_worker_name("w" * 54)) == 63
    shown = [token_key("w1", capacity).rpartition("/")[2] for capacity in (0.0, 1.0, 2.5, 200)]
    assert shown == ["0", "1", "2.5", "200"]


# -- what they say about vehicles ---------------------------------------------------------------------------


class Answering:
    """A keeper that releases a vehicle once, with a large checkpoint."""

    def __init__(self) -> None:
        self.asked: list[tuple[VehicleName, str]] = []
        self.announced: list[tuple[VehicleName, int]] = []
        self.later: list[Callable[[bytes | None], None]] = []
        self.state: bytes | None = b"\0checkpoint" * 50_000

    def release(self, vehicle: VehicleName, asker: str, answer: Callable[[bytes | None], None]) -> None:
        self.asked.append((vehicle, asker))
        if vehicle[1] == "later":
            self.later.append(answer)
        else:
            answer(self.state)

    def taken(self, vehicle: VehicleName, number: int) -> None:
        self.announced.append((vehicle, number))


@pytest.fixture
def two(router: zenoh.Session, endpoint: str, stack: ExitStack) -> tuple[ZenohMoves, Answering, ZenohMoves]:
    asking = stack.enter_context(ZenohMoves(session_of(stack, endpoint), "w1"))
    answering = stack.enter_context(ZenohMoves(session_of(stack, endpoint), "w2"))
    keeper = Answering()
    answering.answer_from(keeper)
    answers: list[bytes | None] = []

    def reachable() -> bool:  # what is declared takes a moment to be known
        asking.ask("w2", ("default", "trial"), answers.append)
        until(lambda: bool(answers))
        return answers.pop() is not None

    until(reachable)
    keeper.asked.clear()
    return asking, keeper, answering


def test_a_vehicle_is_asked_for_and_comes_with_its_checkpoint(
    two: tuple[ZenohMoves, Answering, ZenohMoves],
) -> None:
    asking, keeper, _ = two
    answers: list[bytes | None] = []
    asking.ask("w2", UAV, answers.append)
    until(lambda: bool(answers))
    keeper.state = b""
    asking.ask("w2", UAV, answers.append)
    until(lambda: len(answers) == 2)
    keeper.state = None
    asking.ask("w2", UAV, answers.append)
    until(lambda: len(answers) == 3)
    assert answers == [b"\0checkpoint" * 50_000, b"", None]
    assert keeper.asked == [(UAV, "w1")] * 3


def test_an_answer_may_come_later_or_never_and_counts_once(
    two: tuple[ZenohMoves, Answering, ZenohMoves], monkeypatch: pytest.MonkeyPatch
) -> None:
    asking, keeper, _ = two
    monkeypatch.setattr("wingwatch.service.workers.worker_moves._TIMEOUT_S", 0.3)
    answers: list[bytes | None] = []
    asking.ask("nobody", UAV, answers.append)
    until(lambda: answers == [None])
    asking.ask("w2", ("default", "later"), answers.append)
    until(lambda: answers == [None, None])
    keeper.later.pop()(b"state")  # nobody waits any more
    asking.ask("w2", ("default", "later"), answers.append)
    until(lambda: bool(keeper.later))
    keeper.later.pop()(b"state")
    until(lambda: len(answers) >= 3)
    assert answers == [None, None, b"state"]


def test_a_worker_learns_that_its_lease_has_passed_on(two: tuple[ZenohMoves, Answering, ZenohMoves]) -> None:
    asking, keeper, _ = two
    asking.tell("w2", UAV, 7)
    asking.tell("nobody", UAV, 7)
    until(lambda: bool(keeper.announced))
    assert keeper.announced == [(UAV, 7)]


def test_questions_that_are_none_are_counted_and_not_answered(
    two: tuple[ZenohMoves, Answering, ZenohMoves], router: zenoh.Session
) -> None:
    _, keeper, answering = two
    questions = (b"", b"[]", b"{}", b"\xff", b'{"fleet": "a", "vehicle": "**", "asker": "w1"}', b" " * 2000)
    for question in questions:
        assert list(router.get(worker_key("w2", "release"), payload=question, timeout=5.0)) == []
    list(
        router.get(
            worker_key("w2", "taken"), payload=b'{"fleet": "a", "vehicle": "b", "number": "7"}', timeout=5.0
        )
    )
    until(lambda: answering.strange == len(questions) + 1)
    assert (keeper.asked, keeper.announced) == ([], [])


# -- the whole ----------------------------------------------------------------------------------------------


class Watching:
    """Watches by counting in an alert's text how often a vehicle was handed over; all know the same fleet."""

    def __init__(self, fleet: Collection[VehicleName]) -> None:
        self.fleet = fleet
        self.states: dict[VehicleName, bytes] = {}
        self.store: DatabaseStore | None = None

    def known(self) -> Collection[VehicleName]:
        return self.fleet

    def start(self, vehicle: VehicleName, lease: Lease, state: bytes | None) -> None:
        self.states[vehicle] = state or b""
        self.say(vehicle)

    def say(self, vehicle: VehicleName) -> None:
        assert self.store is not None
        self.store.save_alert(
            replace(ALERT, id=vehicle[1], vehicle=vehicle[1], text=self.states[vehicle].decode())
        )

    def stop(self, vehicles: Sequence[VehicleName]) -> Mapping[VehicleName, bytes]:
        assert self.store is not None
        assert self.store.wait_for(vehicles, PATIENCE_S)
        return {name: self.states.pop(name) + b"+" for name in vehicles}

    def drop(self, vehicle: VehicleName, lease: Lease) -> None:
        assert self.store is not None
        self.states.pop(vehicle)
        self.store.drop(*vehicle, lease)


class Running:
    """A worker's keeper in a thread of its own, with a link, a database and a store of its own."""

    def __init__(self, endpoint: str, path: Path, name: str, fleet: Collection[VehicleName]) -> None:
        self.stack = ExitStack()
        self.database = self.stack.enter_context(open_database(path))
        session = session_of(self.stack, endpoint)
        members = Membership(session, name, 200, lambda: connected(session, link(endpoint)))
        moves = self.stack.enter_context(ZenohMoves(session, name))
        self.watching = Watching(fleet)
        ports = KeeperPorts(
            LeaseTable(self.database), self.stack.enter_context(members), self.watching, moves
        )
        self.keeper = WatchKeeper(name, ports, time.monotonic)
        self.store = self.stack.enter_context(DatabaseStore(self.database, time.time, leases=self.keeper))
        self.watching.store = self.store
        moves.answer_from(self.keeper)
        self.thread = threading.Thread(target=self.keeper.run, daemon=True)
        self.thread.start()

    @property
    def has(self) -> set[VehicleName]:
        return set(self.watching.states)

    @property
    def alerts(self) -> dict[str, str]:
        return {alert.id: alert.text for alert in self.database.alerts().items}

    def die(self) -> None:
        """Without a word: its link and its thread end."""
        self.keeper.left.set()
        self.keeper.news.set()
        self.thread.join(PATIENCE_S)
        self.stack.close()


@pytest.mark.usefixtures("router")
def test_workers_share_a_fleet_through_a_join_a_death_and_a_departure(endpoint: str, tmp_path: Path) -> None:
    fleet = {("default", f"uav{k}") for k in range(12)}
    path = tmp_path / "w.db"
    first = Running(endpoint, path, "w1", fleet)
    until(lambda: first.has == fleet)
    second = Running(endpoint, path, "w2", fleet)
    until(lambda: len(second.has) >= 3)  # by the names
    until(lambda: first.has | second.has == fleet and not first.has & second.has)
    moved = second.has
    assert {second.watching.states[name] for name in moved} == {b"+"}  # handed over with their checkpoints
    until(lambda: first.alerts == {name[1]: "+" if name in moved else "" for name in fleet})
    lost = next(iter(moved))
    lease = second.keeper.lease_of(*lost)
    second.die()
    until(lambda: first.has == fleet)
    until(lambda: set(first.alerts.values()) == {""})
    with pytest.raises(LeaseLostError):
        first.database.save_alert(alert_record(replace(ALERT, id=lost[1], vehicle=lost[1]), 1.0, 1.0), lease)
    third = Running(endpoint, path, "w3", fleet)
    until(lambda: len(third.has) >= 3)
    first.keeper.leave()
    assert first.keeper.left.wait(PATIENCE_S)
    until(lambda: third.has == fleet)
    assert first.has == set()
    until(lambda: set(third.alerts.values()) == {"+"})
    assert first.store.counts["fenced"] == third.store.counts["fenced"] == 0
    first.stack.close()
    third.die()
