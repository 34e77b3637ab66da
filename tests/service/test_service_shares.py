"""Who should watch which vehicle: even shares, few moves, and the right answer in every situation."""

import math
import random
from collections import Counter
from collections.abc import Mapping
from typing import Any

import pytest

from wingwatch.baselines import Holder, VehicleName
from wingwatch.service.workers.shares import Ask, Pace, Plan, Shares, Situation, Worker, score

FLEET: list[VehicleName] = [("default", f"uav{k}") for k in range(4000)]
UAV = ("default", "uav1")


def there(**capacities: float) -> dict[str, Worker]:
    return {name: Worker(name, capacity) for name, capacity in capacities.items()}


def first(workers: Mapping[str, Worker]) -> dict[VehicleName, str]:
    shares = Shares()
    return {vehicle: shares.order(vehicle, workers)[0] for vehicle in FLEET}


# -- the order ----------------------------------------------------------------------------------------


def test_shares_are_as_the_capacities() -> None:
    """Within four standard deviations of a draw."""
    counts = Counter(first(there(a=200, b=200, c=400)).values())
    for name, fraction in (("a", 0.25), ("b", 0.25), ("c", 0.5)):
        deviation = (len(FLEET) * fraction * (1.0 - fraction)) ** 0.5
        assert abs(counts[name] - len(FLEET) * fraction) < 4.0 * deviation


def test_a_worker_that_joins_takes_its_share_from_all_others_and_nothing_else_moves() -> None:
    before, after = first(there(a=200, b=200, c=200)), first(there(a=200, b=200, c=200, d=200))
    moved = {vehicle for vehicle in FLEET if before[vehicle] != after[vehicle]}
    assert {after[vehicle] for vehicle in moved} == {"d"}
    assert abs(len(moved) - 1000) < 4.0 * (len(FLEET) * 0.25 * 0.75) ** 0.5
    given = Counter(before[vehicle] for vehicle in moved)
    assert all(abs(given[name] - 333) < 80 for name in "abc")


def test_of_a_worker_that_leaves_only_its_own_vehicles_move_and_to_all_others() -> None:
    before, after = first(there(a=200, b=200, c=200)), first(there(a=200, b=200))
    moved = {vehicle for vehicle in FLEET if before[vehicle] != after[vehicle]}
    assert moved == {vehicle for vehicle in FLEET if before[vehicle] == "c"}
    assert abs(Counter(after[v] for v in moved)["a"] - len(moved) / 2) < 4.0 * (len(moved) / 4) ** 0.5


def test_the_order_is_the_same_everywhere() -> None:
    """In every process of every version, whatever came first."""
    workers = there(a=1, b=1, c=1)
    backwards = dict(reversed(workers.items()))
    assert [Shares().order(v, workers) for v in FLEET[:50]] == [
        Shares().order(v, backwards) for v in FLEET[:50]
    ]
    assert score(Worker("a", 2.0), UAV) == 2.0 * score(Worker("a", 1.0), UAV)
    drawn = 0x30F254A66ADB407E  # printf 'a\\0default\\0uav1' | b2sum -l 64
    assert score(Worker("a", 1.0), UAV) == pytest.approx(-1.0 / math.log(drawn / 2**64), rel=1e-9)
    assert score(Worker("a", 1.0), ("other", "uav1")) != score(Worker("a", 1.0), UAV)


def test_orders_that_are_followed_are_those_computed_anew() -> None:
    """Through joins, departures and changes of capacity, one at a time and several."""
    chance, followed, fleet = random.Random(5), Shares(), FLEET[:40]
    workers: dict[str, Worker] = {}
    for step in range(150):
        for _ in range(chance.choice((1, 1, 1, 5))):
            name = f"w{chance.randrange(9)}"
            if name in workers and chance.random() < 0.6:
                workers.pop(name)
            else:
                workers[name] = Worker(name, chance.choice((1.0, 2.0)))
        now = dict(workers)
        for vehicle in chance.sample(fleet, 10):
            assert followed.order(vehicle, now) == Shares().order(vehicle, now), step
            assert followed.target(vehicle, "", now) == next(iter(Shares().order(vehicle, now)), None)


# -- situations ---------------------------------------------------------------------------------------


def ordered(*names: str) -> VehicleName:
    """A vehicle whose order of workers of equal capacity is this one."""
    shares, workers = Shares(), there(**dict.fromkeys(names, 1.0))
    return next(vehicle for vehicle in FLEET if shares.order(vehicle, workers) == names)


ABC = ordered("a", "b", "c")
HELD_BY_B, HELD_BY_C, FREE = Holder("b", 3, True), Holder("c", 3, True), Holder("", 3, False)
B_RAN_OUT = Holder("b", 3, False)
TAKE, ASK_B, ASK_C = Plan((ABC,)), Plan((), (Ask(ABC, "b"),)), Plan((), (Ask(ABC, "c"),))
WAIT = Plan(waiting=1)
ALL = {name: Worker(name, 1.0) for name in "abc"}


def but(**changes: Worker | None) -> dict[str, Worker]:
    return {name: worker for name, worker in (ALL | changes).items() if worker is not None}


FULL_A, OVER_A, OVER_B = Worker("a", 1.0, 0.9), Worker("a", 1.0, 1.2), Worker("b", 1.0, 1.2)
LEAVING_B, LEAVING_A = Worker("b", 0.0), Worker("a", 0.0)

SITUATIONS: dict[str, tuple[dict[str, Any], Plan]] = {
    "a new vehicle": ({"known": [ABC]}, TAKE),
    "a new vehicle at the start, when others may not be seen yet": ({"known": [ABC], "settled": False}, TAKE),
    "a new vehicle of another": ({"known": [ABC], "me": "b"}, Plan()),
    "a vehicle that was given up": ({"leases": {ABC: FREE}}, TAKE),
    "a vehicle that is silent, and given up": ({"leases": {ABC: FREE}, "known": []}, TAKE),
    "our own": ({"leases": {ABC: Holder("a", 3, True)}}, Plan()),
    "a join: it is another's, and we are the first": ({"leases": {ABC: HELD_BY_B}}, ASK_B),
    "a join seen by the others": ({"leases": {ABC: HELD_BY_B}, "me": "c"}, Plan()),
    "no move is left": ({"leases": {ABC: HELD_BY_B}, "moves": 0}, Plan()),
    "already asked for": ({"leases": {ABC: HELD_BY_B}, "asked": {ABC}}, Plan()),
    "a death, before the lease has run out": ({"leases": {ABC: HELD_BY_B}, "workers": but(b=None)}, WAIT),
    "a death, afterwards": ({"leases": {ABC: B_RAN_OUT}, "workers": but(b=None)}, TAKE),
    "a death of the first": (
        {"leases": {ABC: Holder("a", 3, False)}, "workers": but(a=None), "me": "b"}, TAKE,
    ),
    "a death, seen by who is not next": (
        {"leases": {ABC: Holder("a", 3, False)}, "workers": but(a=None), "me": "c"}, Plan(),
    ),
    "a death, seen by who has just come back": (
        {"leases": {ABC: B_RAN_OUT}, "workers": but(b=None), "settled": False}, WAIT,
    ),
    "a freeze: on the network, its lease ran out just now": ({"leases": {ABC: B_RAN_OUT}}, WAIT),
    "a freeze, or no way to the database": ({"leases": {ABC: B_RAN_OUT}, "gone": frozenset("b")}, TAKE),
    "the first has no way to the database, and we are next": (
        {"leases": {ABC: Holder("a", 3, False)}, "gone": frozenset("a"), "me": "b"}, TAKE,
    ),
    "we have no way to the database ourselves, as others see it": (
        {"leases": {ABC: B_RAN_OUT}, "gone": frozenset("ab")}, Plan(),
    ),
    "a part of the network: we see nobody, and they renew": (
        {"leases": {ABC: HELD_BY_B}, "workers": but(b=None, c=None)}, WAIT,
    ),
    "another part of the network: two that both believe to be first": (
        {"leases": {ABC: Holder("a", 3, True)}, "workers": but(a=None), "me": "b"}, WAIT,
    ),
    "a worker leaves": ({"leases": {ABC: HELD_BY_B}, "workers": but(b=LEAVING_B), "moves": 0}, ASK_B),
    "a worker leaves, and we are not next": (
        {"leases": {ABC: Holder("a", 3, True)}, "workers": but(a=LEAVING_A), "me": "c"}, Plan(),
    ),
    "we leave": ({"leases": {ABC: FREE}, "known": [ABC], "workers": but(a=LEAVING_A)}, Plan()),
    "a lot of work: the first calls nothing back": ({"leases": {ABC: HELD_BY_B}, "workers": but(a=FULL_A)}, Plan()),
    "a lot of work: another is first with room": (
        {"leases": {ABC: HELD_BY_C}, "workers": but(a=FULL_A), "me": "b"}, ASK_C,
    ),
    "a lot of work keeps what it has": (
        {"leases": {ABC: Holder("a", 3, True)}, "workers": but(a=FULL_A), "me": "b"}, Plan(),
    ),
    "overload hands on to the next with room": (
        {"leases": {ABC: Holder("a", 3, True)}, "workers": but(a=OVER_A), "me": "b"},
        Plan((), (Ask(ABC, "a"),)),
    ),
    "overload, and the next has no room": (
        {"leases": {ABC: Holder("a", 3, True)}, "workers": but(a=OVER_A, b=OVER_B), "me": "c"},
        Plan((), (Ask(ABC, "a"),)),
    ),
    "overload everywhere: nothing moves": (
        {"leases": {ABC: HELD_BY_B}, "workers": {n: Worker(n, 1.0, 1.5) for n in "abc"}}, Plan(),
    ),
    "overload everywhere, and a new vehicle: the first has it, and leaves out what it must": (
        {"known": [ABC], "workers": {n: Worker(n, 1.0, 1.5) for n in "abc"}}, TAKE,
    ),
    "a new vehicle goes to who has room": ({"known": [ABC], "workers": but(a=OVER_A), "me": "b"}, TAKE),
}  # fmt: skip


@pytest.mark.parametrize("what", SITUATIONS)
def test_what_is_done_in_each_situation(what: str) -> None:
    given, plan = SITUATIONS[what]
    usual: dict[str, Any] = {"me": "a", "workers": ALL, "leases": {}, "moves": 4, "rescues": 4}
    assert Shares().decide(Situation(**(usual | given))) == plan


def test_no_more_is_asked_for_than_may_move() -> None:
    leases = {vehicle: Holder("b", 1, True) for vehicle in FLEET[:300]}
    balance = Situation("a", there(a=1, b=1), leases, moves=4, rescues=25)
    assert len(Shares().decide(balance).ask) == 4
    leaving = Situation("a", there(a=1, b=0), leases, moves=4, rescues=25)
    assert len(Shares().decide(leaving).ask) == 25


def test_a_vehicle_is_released_to_whom_its_owner_finds_first_too() -> None:
    mine = {ABC: HELD_BY_B}
    now = Situation("b", ALL, mine)
    assert [Shares().may_release(now, ABC, asker) for asker in ("a", "b", "c", "strange")] == [
        True,
        *[False] * 3,
    ]
    assert not Shares().may_release(Situation("b", but(a=None), mine), ABC, "a")  # it does not see it
    assert not Shares().may_release(Situation("b", ALL, mine, gone=frozenset("a")), ABC, "a")
    assert not Shares().may_release(Situation("b", but(a=FULL_A), mine), ABC, "a")
    assert Shares().may_release(Situation("b", but(a=FULL_A, b=OVER_B), mine), ABC, "c")
    assert Shares().may_release(Situation("b", but(a=None, b=LEAVING_B), mine), ABC, "c")


def test_overload_does_not_send_a_vehicle_to_and_fro() -> None:
    """After it has moved its first owner is below the limit, and still does not call it back before it has room."""
    shares = Shares()
    for load, target in ((1.2, "b"), (0.99, "b"), (0.85, "b"), (0.79, "a")):
        workers = but(a=Worker("a", 1.0, load))
        holder = "a" if load > 1.0 else "b"
        assert shares.target(ABC, holder, workers) == target


def test_a_pace_lets_so_many_move_in_the_long_run() -> None:
    pace = Pace(4.0, 4.0)
    moved = []
    for tenth in range(100):
        now = pace.allowed(tenth / 10)
        pace.spend(now)
        moved.append(now)
    assert moved[0] == 4
    assert sum(moved) == pytest.approx(4 + 4 * 9.9, abs=1.0)
    assert pace.allowed(1e9) == 4
