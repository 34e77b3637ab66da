"""Workers that share a fleet, in simulated time: no vehicle is watched twice, and none is left alone for long."""

import random
from collections.abc import Callable, Collection

import pytest
from watch_histories import history
from watch_world import Broken, Process, World

from wingwatch.baselines import LEASE_S, DatabaseError, Lease, VehicleName
from wingwatch.service.workers.shares import Shares, Situation
from wingwatch.service.workers.watch_keeping import WatchKeeper

MOVES_PER_S = 4.0


def world(workers: int = 3, vehicles: int = 24, seed: int = 1, settled_s: float = 15.0) -> World:
    """A fleet that has been watched for a while."""
    made = World(random.Random(seed), workers, vehicles)
    made.run(settled_s)
    return made


def held(process: Process) -> set[str]:
    return {name[1] for name in process.keeper.held}


def numbers(of: World) -> list[int]:
    return [of.database.rows[name].number for name in of.fleet]


def time_until(of: World, condition: Callable[[], bool], most_s: float) -> float:
    began_s = of.now_s
    while not condition():
        assert of.now_s - began_s < most_s
        of.run(0.1)
    return of.now_s - began_s


def all_watched(of: World) -> bool:
    return {name for p in of.running for name in p.watching} == set(of.fleet)


def test_one_worker_watches_everything_at_once() -> None:
    alone = world(workers=1, settled_s=1.5)
    assert held(alone.processes[0]) == {name[1] for name in alone.fleet}
    assert numbers(alone) == [1] * 24


def test_three_that_start_together_share_the_fleet() -> None:
    together = world()
    together.check_end()
    assert min(len(held(p)) for p in together.processes) > 0


def test_a_new_vehicle_is_watched_within_a_round() -> None:
    of = world()
    of.fleet.append(("default", "new"))
    assert time_until(of, lambda: all_watched(of), 5.0) < 1.2


def test_a_worker_that_joins_takes_its_share_a_few_a_second_and_nothing_else_moves() -> None:
    of = world(workers=2, vehicles=90)
    before = {name: p.name for p in of.processes for name in p.watching}
    joined = of.join()
    took_s = time_until(of, lambda: len(joined.watching) >= 30, 30.0)
    assert took_s > (30 - MOVES_PER_S) / MOVES_PER_S - 1.0
    of.run(15.0)
    of.check_end()
    moved = [
        name
        for name in of.fleet
        if name not in joined.watching and of.database.rows[name].owner != before[name]
    ]
    assert moved == []
    assert of.counts["handed over"] >= len(joined.watching)


@pytest.mark.parametrize("seed", range(6))
def test_the_vehicles_of_a_worker_that_is_killed_are_watched_again_within_5_s(seed: int) -> None:
    of = world(seed=seed)
    of.run(of.chance.uniform(0.0, 1.0))
    of.kill(of.chance.choice(of.processes))
    assert time_until(of, lambda: all_watched(of), 10.0) <= 5.0
    of.check_end()


def test_a_worker_that_leaves_hands_everything_over_and_nothing_is_left_alone() -> None:
    of = world(workers=2, vehicles=60)
    leaves, stays = of.processes
    had = len(leaves.watching)
    leaves.keeper.leave()
    longest_s = 0.0
    while leaves.alive:
        of.run(0.1)
        gaps = [of.now_s - since_s for since_s in of._unwatched_since_s.values()]
        longest_s = max([longest_s, *gaps])
    of.run(0.3)  # the last answer is on its way
    assert longest_s < 0.6
    assert len(stays.watching) == 60
    assert of.counts["handed over"] >= had


def test_a_worker_that_leaves_alone_ends_at_once_and_whoever_comes_takes_over() -> None:
    of = world(workers=1)
    of.processes[0].keeper.leave()
    assert time_until(of, lambda: not of.processes[0].alive, 5.0) < 0.5
    assert {lease.owner for lease in of.database.rows.values()} == {""}
    of.join()
    assert time_until(of, lambda: all_watched(of), 5.0) < 1.5


def test_a_frozen_worker_that_wakes_writes_nothing_and_takes_its_share_again() -> None:
    of = world()
    frozen = of.processes[0]
    lost = dict(frozen.keeper.held)
    frozen.entries = list(lost.items())  # found, and not written before it froze
    before = of.counts["refused writes"]
    of.freeze(frozen, 20.0)
    of.run(19.9)
    assert all(of.database.rows[name].number == lease.number + 1 for name, lease in lost.items())
    of.run(1.5)
    assert of.counts["refused writes"] - before >= len(lost)
    assert frozen.keeper.counts["lost"] == len(lost)
    of.run(30.0)
    of.check_end()


def test_a_short_freeze_moves_nothing() -> None:
    of = world()
    before = numbers(of)
    of.freeze(of.processes[0], LEASE_S + 1.0)
    of.run(30.0)
    assert numbers(of) == before


@pytest.mark.parametrize("what", ["database", "router"])
def test_an_outage_for_all_moves_nothing(what: str) -> None:
    """However long; while the database is away everything is watched on."""
    of = world()
    before = numbers(of)
    if what == "database":
        of.database_outage(40.0)
        of.run(39.0)
        assert all_watched(of)
    else:
        of.restart_router(20.0)
    of.run(40.0)
    assert numbers(of) == before
    of.check_end()


def test_without_a_way_to_the_database_others_take_over() -> None:
    """What such a worker finds could not be stored, and so never be announced."""
    of = world()
    cut_off = of.processes[0]
    cut_off.no_database_until_s = of.now_s + 30.0
    took_s = time_until(of, lambda: not cut_off.watching, 20.0)
    assert took_s < 10.0
    assert cut_off.keeper.problem == "the database cannot be reached"
    of.run(60.0)
    of.check_end()
    assert cut_off.keeper.problem is None


def test_a_worker_without_the_network_lets_its_vehicles_go() -> None:
    of = world()
    of.unlink(of.processes[0], 30.0)
    elsewhere = lambda: {n for p in of.processes[1:] for n in p.watching} == set(of.fleet)  # noqa: E731
    assert time_until(of, elsewhere, 20.0) <= 5.0
    of.run(60.0)
    of.check_end()


def test_two_that_do_not_see_each_other_leave_each_others_vehicles_alone() -> None:
    """Both believe to be the first everywhere, and both renew."""
    of = world(workers=2)
    before = numbers(of)
    for process in of.processes:
        process.shows = lambda: False  # type: ignore[method-assign]
    of.run(30.0)
    assert numbers(of) == before
    assert sum(len(p.watching) for p in of.processes) == 24


def test_an_overloaded_worker_hands_on_until_it_is_not_and_is_given_nothing_back_before_it_has_room() -> None:
    of = world(workers=2, vehicles=60)
    full, other = of.processes
    had = len(full.watching)
    full.load = 1.3
    of.run(3.0)
    assert had - 16 <= len(full.watching) < had
    full.load = 0.9
    of.run(1.0)
    has = len(full.watching)
    of.run(20.0)
    assert len(full.watching) == has
    full.load = 0.5
    of.run(30.0)
    assert len(full.watching) == had
    assert len(other.watching) == 60 - had


def test_a_vehicle_that_nobody_needs_to_watch_is_forgotten() -> None:
    of = world(workers=2)
    name = of.fleet.pop()
    (owner,) = [p for p in of.processes if name in p.watching]
    owner.watching.pop(name)
    owner.keeper.forget([name])
    of.run(15.0)
    assert name not in of.database.rows
    assert all(name not in p.watching for p in of.processes)


def test_a_vehicle_that_cannot_be_started_does_not_keep_others_from_it() -> None:
    of = world(workers=1, vehicles=5)
    start, broken = Process.start, ("default", "broken")

    def failing(process: Process, vehicle: tuple[str, str], lease: Lease, state: bytes | None) -> None:
        if vehicle == broken and of.now_s < 1018.0:
            raise OSError("no room")
        start(process, vehicle, lease, state)

    of.processes[0].start = failing.__get__(of.processes[0])  # type: ignore[method-assign]
    of.fleet += [broken, ("default", "other")]
    of.run(2.5)
    assert held(of.processes[0]) == {"uav0", "uav1", "uav2", "uav3", "uav4", "other"}
    assert of.processes[0].keeper.counts["failed_starts"] > 1
    of.run(3.0)
    of.check_end()


@pytest.mark.parametrize("reply", ["is not reached", "is reached, and its reply is lost"])
def test_a_vehicle_is_not_released_where_the_database_does_not_take_that(
    reply: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody could take it over, so its owner watches on with the state that it had, until it knows better."""
    of = world(workers=2)
    first, second = of.processes
    name, before = next(iter(first.watching)), numbers(of)
    first.load, leases = 1.3, first.keeper._ports.leases
    give_up = leases.give_up
    answers: list[bytes | None] = []

    def failing(owner: str, vehicles: Collection[VehicleName]) -> None:
        if reply != "is not reached":
            give_up(owner, vehicles)
        monkeypatch.setattr(leases, "give_up", give_up)
        raise DatabaseError("the database cannot be reached")

    monkeypatch.setattr(leases, "give_up", failing)
    first.keeper.release(name, second.name, answers.append)
    first.turn()
    assert answers == [None]
    assert name in first.watching
    assert first.keeper.problem == "the database cannot be reached"
    first.load = 0.0
    of.run(10.0)
    assert first.keeper.problem is None
    assert of.database.rows[name].number == before[of.fleet.index(name)] + (reply != "is not reached")
    of.check_end()


# -- drawn histories ----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_one_fault_after_another(seed: int) -> None:
    assert history(seed, one_at_a_time=True, happenings=6).longest_gap_s <= 5.1


@pytest.mark.parametrize("seed", range(100, 106))
def test_many_faults_at_once(seed: int) -> None:
    assert history(seed, one_at_a_time=False).counts["writes"] > 0


def test_the_checks_notice_a_keeper_that_believes_too_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that takes what belongs to workers that it does not see yet: after a router's restart all of it moves."""
    of = world()
    before = numbers(of)
    situation = WatchKeeper._situation

    def hasty(keeper: WatchKeeper, now_s: float) -> Situation:
        now = situation(keeper, now_s)
        return Situation(**{**{f: getattr(now, f) for f in Situation.__dataclass_fields__}, "settled": True})

    monkeypatch.setattr(WatchKeeper, "_situation", hasty)
    of.restart_router(20.0)
    of.run(40.0)
    assert numbers(of) != before


def test_the_checks_notice_a_keeper_that_does_not_let_go(monkeypatch: pytest.MonkeyPatch) -> None:
    of = world()
    monkeypatch.setattr(WatchKeeper, "_drop", lambda *_: None)
    of.freeze(of.processes[0], 10.0)
    with pytest.raises(Broken, match=r"is watched by .* at once"):
        of.run(30.0)


def test_the_checks_notice_a_keeper_that_waits_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    of = world()
    monkeypatch.setattr(Shares, "_is_free", staticmethod(lambda *_: False))
    of.kill(of.processes[0])
    with pytest.raises(Broken, match=r"is not watched for 5\.[12] s"):
        of.run(10.0)
