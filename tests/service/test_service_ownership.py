"""Who watches which: rendezvous hashing, balanced by capacity, with the least movement."""

from collections import Counter

from wingwatch.service.workers.ownership import ByOrder, EveryVehicle, first_in_order, in_order

NAMES = [f"uav{k}" for k in range(2000)]


def firsts(capacities: dict[str, float]) -> dict[str, str]:
    return {name: in_order(capacities, "default", name)[0] for name in NAMES}


def test_each_worker_is_first_for_its_part_by_capacity() -> None:
    counted = Counter(firsts({"a": 1.0, "b": 1.0, "c": 2.0}).values())
    for worker, expected in (("a", 500), ("b", 500), ("c", 1000)):
        assert (
            abs(counted[worker] - expected) < 5.0 * 25.0
        )  # five standard deviations of a binomial draw, 22.4 at most


def test_a_worker_that_goes_moves_its_own_vehicles_alone() -> None:
    before, after = firsts({"a": 1.0, "b": 1.0, "c": 1.0}), firsts({"a": 1.0, "b": 1.0})
    moved = {name for name in NAMES if before[name] != after[name]}
    assert moved == {name for name in NAMES if before[name] == "c"}


def test_a_worker_that_grows_takes_vehicles_and_gives_none() -> None:
    before, after = firsts({"a": 1.0, "b": 1.0}), firsts({"a": 1.0, "b": 1.5})
    assert {after[name] for name in NAMES if before[name] != after[name]} == {"b"}


def test_one_of_those_that_live_owns_a_vehicle_and_no_other() -> None:
    live = ("a", "b")
    owners = {
        name: [w for w in ("a", "b", "c") if ByOrder(w, lambda: live).owns("default", name)] for name in NAMES
    }
    assert all(found == [first_in_order(live, "default", name)] for name, found in owners.items())
    assert not ByOrder("c", lambda: ()).owns("default", "uav1")
    assert EveryVehicle().owns("default", "uav1")
