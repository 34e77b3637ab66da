"""Histories of a fleet on several workers, in simulated time: joins, deaths, freezes, outages, and all at once.

Two kinds of histories are drawn: of one fault at a time, in which a vehicle must be watched again within 5 s of its
owner's death, and of many at once. What must hold in both is in ``watch_world.py``.

    .venv/bin/python benchmarks/watch_histories.py --histories 400 --seed 1
"""

import argparse
import logging
import random
from collections import Counter
from collections.abc import Callable

from saving import run_benchmark
from watch_world import Broken, Process, World


def _some(world: World) -> Process | None:
    """A running worker that is not the last one."""
    running = [p for p in world.running if p.capacity > 0.0]
    return world.chance.choice(running) if len(running) > 1 else None


def _join(world: World) -> None:
    if len(world.running) < 6:
        world.join(world.chance.choice((100.0, 200.0, 400.0)))


def _with_some(act: Callable[[World, Process], None]) -> Callable[[World], None]:
    def happens(world: World) -> None:
        process = _some(world)
        if process is not None:
            act(world, process)

    return happens


def _flaky(world: World, process: Process) -> None:
    process.flaky = True
    world.after(world.chance.uniform(2.0, 15.0), lambda: setattr(process, "flaky", False))


def _loaded(world: World, process: Process) -> None:
    process.load = world.chance.choice((0.9, 1.3))
    world.after(world.chance.uniform(5.0, 20.0), lambda: setattr(process, "load", 0.0))


def _no_database(world: World, process: Process) -> None:
    process.no_database_until_s = world.now_s + world.chance.uniform(1.0, 15.0)


HAPPENS: dict[str, Callable[[World], None]] = {
    "join": _join,
    "death": _with_some(World.kill),
    "freeze": _with_some(lambda world, p: world.freeze(p, world.chance.uniform(0.5, 25.0))),
    "leave": _with_some(lambda world, p: p.keeper.leave()),
    "no network": _with_some(lambda world, p: world.unlink(p, world.chance.uniform(0.5, 20.0))),
    "no database": _with_some(_no_database),
    "lost replies": _with_some(_flaky),
    "load": _with_some(_loaded),
    "router": lambda world: world.restart_router(world.chance.uniform(0.1, 5.0)),
    "database": lambda world: world.database_outage(world.chance.uniform(0.5, 12.0)),
    "new vehicle": lambda world: world.fleet.append(("default", f"new{len(world.fleet)}")),
}


def history(seed: int, one_at_a_time: bool, happenings: int = 12, vehicles: int = 24) -> World:
    """Play a history, and check it.

    Args:
        one_at_a_time: whether all is well again before the next thing happens.

    Raises:
        Broken: what must hold does not.
    """
    world = World(random.Random(seed), workers=3, vehicles=vehicles)
    world.run(15.0)
    for _ in range(happenings):
        what = world.chance.choice(list(HAPPENS))
        world.counts[what] += 1
        HAPPENS[what](world)
        world.run(45.0 if one_at_a_time else world.chance.expovariate(1.0 / 4.0))
    world.run(60.0)
    world.check_end()
    return world


def main() -> int:
    """Play many histories and print what happened in them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--histories", type=int, default=400, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    logging.disable()  # what keepers say of each fault
    failed = 0
    for kind in (True, False):
        total: Counter[str] = Counter()
        gap_s = 0.0
        for number in range(arguments.histories):
            try:
                world = history(1000 * arguments.seed + number, kind)
            except Broken as broken:
                print(f"seed {1000 * arguments.seed + number}: {broken}")
                failed += 1
                continue
            total += world.counts
            gap_s = max(gap_s, world.longest_gap_s)
        print(f"{arguments.histories} histories, {'one fault at a time' if kind else 'all at once'}:")
        print("  " + ", ".join(f"{what} {count}" for what, count in sorted(total.items())))
        print(f"  longest time without a watch while all other workers were well: {gap_s:.1f} s")
    print(f"{failed} broken")
    return 1 if failed else 0


if __name__ == "__main__":
    run_benchmark(main)
