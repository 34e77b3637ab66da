"""A vehicle has one owner at a time, whoever asks at once, and its number grows whenever it changes hands."""

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

import pytest
from sqlalchemy import update

from wingwatch.baselines import Database, Holder, Lease, LeaseTable, VehicleName, open_database
from wingwatch.baselines.tables import WorkerLeaseRow

UAV1, UAV2, UAV3 = ("default", "uav1"), ("default", "uav2"), ("other", "uav1")
FLEET: list[VehicleName] = [("default", f"uav{k}") for k in range(40)]


@dataclass
class Table:
    """Leases of a database, whose clock the tests move by moving the ends of leases."""

    database: Database
    leases: LeaseTable

    def run_out(self, owner: str, ago_s: float = 0.0) -> None:
        with self.database.writing() as session:
            worker = WorkerLeaseRow.owner == owner
            session.execute(
                update(WorkerLeaseRow).where(worker).values(until_s=WorkerLeaseRow.until_s - 60.0 - ago_s)
            )


@pytest.fixture
def table(database: Database) -> Table:
    return Table(database, LeaseTable(database, lease_s=30.0))


def test_a_vehicle_that_nobody_holds_is_taken_by_the_first_who_asks(table: Table) -> None:
    for worker in ("a", "b"):
        table.leases.renew(worker)
    assert table.leases.take("a", [UAV1, UAV3]) == {UAV1: Lease("a", 1), UAV3: Lease("a", 1)}
    assert table.leases.take("b", [UAV1, UAV2]) == {UAV2: Lease("b", 1)}
    assert table.leases.look("b").vehicles == {
        UAV1: Holder("a", 1, True), UAV2: Holder("b", 1, True), UAV3: Holder("a", 1, True),
    }  # fmt: skip


def test_taking_again_keeps_the_number(table: Table) -> None:
    """Whoever did not hear the reply may ask again."""
    table.leases.renew("a")
    assert table.leases.take("a", [UAV1]) == table.leases.take("a", [UAV1]) == {UAV1: Lease("a", 1)}


def test_what_is_given_up_may_be_taken_at_once_under_a_higher_number(table: Table) -> None:
    for worker in ("a", "b"):
        table.leases.renew(worker)
    table.leases.take("a", [UAV1, UAV2])
    table.leases.give_up("b", [UAV1])  # it is not b's
    assert table.leases.take("b", [UAV1]) == {}
    table.leases.give_up("a", [UAV1])
    assert table.leases.take("b", [UAV1, UAV2]) == {UAV1: Lease("b", 2)}
    table.leases.give_up("b", [UAV1])
    assert table.leases.take("b", [UAV1]) == {
        UAV1: Lease("b", 3)
    }  # what waited under 2 is of an earlier watch


def test_a_worker_that_does_not_renew_loses_its_vehicles_to_whoever_takes_them(table: Table) -> None:
    for worker in ("a", "b"):
        table.leases.renew(worker)
    table.leases.take("a", [UAV1, UAV2])
    table.run_out("a")
    seen = table.leases.look("b", everything=False)
    assert seen.workers == {"a": False, "b": True}
    assert seen.vehicles == {UAV1: Holder("a", 1, False), UAV2: Holder("a", 1, False)}
    assert table.leases.take("b", [UAV1]) == {UAV1: Lease("b", 2)}
    table.leases.renew("a")  # it wakes: what nobody took is still its own
    assert table.leases.look("a", everything=False).vehicles == {UAV2: Holder("a", 1, True)}
    assert table.leases.take("a", [UAV1]) == {}


def test_a_worker_that_has_not_renewed_takes_nothing(table: Table) -> None:
    assert table.leases.take("new", [UAV1]) == {}
    table.leases.renew("a")
    table.run_out("a")
    assert table.leases.take("a", [UAV1]) == {}


def test_a_lease_from_before_the_clock_was_set_back_does_not_hold(table: Table) -> None:
    """Its owner may be dead, and nobody would watch its vehicles for as long as that; one that lives renews."""
    for worker in ("a", "b"):
        table.leases.renew(worker)
    table.leases.take("a", [UAV1])
    table.run_out("a", -3600.0)
    assert table.leases.look("b").workers == {"a": False, "b": True}
    table.leases.renew("a")
    assert table.leases.look("b").workers == {"a": True, "b": True}
    table.run_out("a", -3600.0)
    assert table.leases.take("b", [UAV1]) == {UAV1: Lease("b", 2)}


def test_a_look_at_the_own_leaves_out_what_others_hold(table: Table) -> None:
    for worker in ("a", "b"):
        table.leases.renew(worker)
    table.leases.take("a", [UAV1, UAV3])
    table.leases.take("b", [UAV2])
    table.leases.give_up("a", [UAV3])
    seen = table.leases.look("a", everything=False)
    assert (set(seen.vehicles), seen.complete) == ({UAV1, UAV3}, False)
    assert not seen.vehicles[UAV3].valid
    assert set(table.leases.look("a").vehicles) == {UAV1, UAV2, UAV3}


def test_who_leaves_gives_up_everything_and_old_workers_are_forgotten(table: Table) -> None:
    for worker in ("a", "b", "ended", "holds"):
        table.leases.renew(worker)
    table.leases.take("a", [UAV1])
    table.leases.take("holds", [UAV2])
    table.run_out("ended", 86_400.0)
    table.run_out("holds", 86_400.0)
    table.leases.leave("a")
    assert table.leases.look("b").workers == {"b": True, "holds": False}
    assert table.leases.take("b", [UAV1, UAV2]) == {UAV1: Lease("b", 2), UAV2: Lease("b", 2)}


def test_what_nobody_needs_to_watch_is_forgotten(table: Table) -> None:
    table.leases.renew("a")
    table.leases.take("a", [UAV1, UAV2])
    table.leases.forget("a", [UAV1])
    table.leases.forget("b", [UAV2])
    assert set(table.leases.look("a").vehicles) == {UAV2}


def test_leases_run_out_by_the_clock_of_the_database(database: Database) -> None:
    leases = LeaseTable(database, lease_s=0.05)
    leases.renew("a")
    leases.take("a", [UAV1])
    ended = threading.Event()
    while leases.look("a").workers["a"]:
        ended.wait(0.01)
    assert not leases.look("a").vehicles[UAV1].valid


def test_of_many_threads_that_ask_at_once_one_gets_each_vehicle(table: Table) -> None:
    workers = [f"w{k}" for k in range(6)]
    for worker in workers:
        table.leases.renew(worker)
    ready = threading.Barrier(len(workers))

    def ask(worker: str) -> dict[VehicleName, Lease]:
        ready.wait()
        got: dict[VehicleName, Lease] = {}
        for start in range(0, len(FLEET), 10):
            got |= table.leases.take(worker, FLEET[start : start + 10])
        return got

    with ThreadPoolExecutor(len(workers)) as pool:
        answers = list(pool.map(ask, workers))
    owners = [(name, lease.owner) for got in answers for name, lease in got.items()]
    assert sorted(name for name, _ in owners) == sorted(FLEET)
    assert {name: h.owner for name, h in table.leases.look("w0").vehicles.items()} == dict(owners)


def passing_on(url: str, owner: str, rounds: int, said: Any) -> None:
    """Takes whatever it can and gives it up again; says under which numbers it held each vehicle."""
    held: list[tuple[str, int]] = []
    with open_database(url) as database:
        leases = LeaseTable(database, lease_s=60.0)
        leases.renew(owner)
        for _ in range(rounds):
            got = leases.take(owner, FLEET[:4])
            held += [(name[1], lease.number) for name, lease in got.items()]
            leases.give_up(owner, list(got))
    said.put(held)


@contextmanager
def programs(url: str, count: int, rounds: int) -> Iterator[Any]:
    spawn = get_context("spawn")
    said = spawn.Queue()
    started = [spawn.Process(target=passing_on, args=(url, f"w{k}", rounds, said)) for k in range(count)]
    for program in started:
        program.start()
    yield said
    for program in started:
        program.join()
        assert program.exitcode == 0


def test_of_several_programs_no_two_ever_hold_a_vehicle_under_one_number(
    database: Database, url: str
) -> None:
    count, rounds = 2, 40
    with programs(url, count, rounds) as said:
        held = [one for _ in range(count) for one in said.get(timeout=60)]
    assert len(held) == len(set(held))
    numbers = {v: max(n for name, n in held if name == v) for v, _ in held}
    stored = LeaseTable(database).look("w0").vehicles
    assert {name[1]: h.number for name, h in stored.items()} == numbers
    assert all(h.owner == "" for h in stored.values())
