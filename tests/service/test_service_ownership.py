"""Who watches which: rendezvous hashing, balanced by capacity, with the least movement."""

from collections import Counter

from wingwatch.api import WorkerSilentError
from wingwatch.service.workers.live import Capacities
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
    live = {"a": 1.0, "b": 1.0}
    vehicles = [("default", name) for name in NAMES]
    of_a, of_b, of_c = (ByOrder(worker, lambda: live).owned(vehicles) for worker in ("a", "b", "c"))
    assert of_a | of_b == set(vehicles)
    assert not of_a & of_b
    assert not of_c
    assert all(first_in_order(live, *key) == "a" for key in of_a)
    assert EveryVehicle().owned(vehicles) == set(vehicles)


def test_a_capacity_is_asked_once_and_one_counts_while_a_worker_does_not_say() -> None:
    asked, now_s, silent = list[str](), [0.0], {"c"}

    def ask(name: str) -> float:
        asked.append(name)
        if name in silent:
            raise WorkerSilentError("silent")
        return 2.5

    capacities = Capacities(("a", 0.5), lambda: ("a", "b", "c"), ask, lambda: now_s[0])
    assert capacities.look() == capacities.look() == {"a": 0.5, "b": 2.5, "c": 1.0}
    assert asked == ["b", "c"]
    silent.clear()
    now_s[0] = 6.0
    assert capacities.look() == {"a": 0.5, "b": 2.5, "c": 2.5}
