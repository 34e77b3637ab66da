"""Workers killed with SIGKILL at random instants, each time one that watches a vehicle with an alert in force.

A gateway and two workers run as processes over loopback, on one data folder; three vehicles fly on, faster than real
ones; one loses elevator, one aileron effect, and the first kill comes when both alerts are in force. Another worker is
started after each kill. Instants, and whose worker is killed, are drawn with a seed. How long vehicles are not watched
is as REST shows it: until all have a worker that lives and that has taken in what they sent after the kill. A vehicle
counts as watched twice where published solutions of it go back in time twice within a second.

Run: python benchmarks/worker_kills.py [--kills 10] [--seed 0] [--speed 4]
"""

import argparse
import signal
import sys
import tempfile
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from saving import run_benchmark
from service_process import prepare_kernels
from worker_fleet import Shown, WorkerFleet, flown, worker_fleet

SHORTEST_S, LONGEST_S = 0.5, 6.0
"""Wall-clock time between two workers' being there and the next kill."""
BEFORE_SPEED = 12.0
ILL = ("v1", "v2")
PATIENCE_S = 60.0


@dataclass
class Tally:
    """What was found.

    Attributes:
        again_s: how long it took until all vehicles were watched again, by kill.
        shown: what REST and Zenoh have said meanwhile; None before it has begun.
        of_killed: vehicles that the killed workers had.
        expected: alerts before the first kill; fenced: writes that were refused; messages_lost: of all vehicles.
    """

    kills: int = 0
    again_s: list[float] = field(default_factory=list)
    of_killed: list[int] = field(default_factory=list)
    shown: Shown | None = None
    expected: int = 0
    fenced: int = 0
    messages_lost: int = 0


def course(tally: Tally, kills: int, seed: int, speed: float) -> None:
    """Start, fly and kill so many times."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as name, worker_fleet(Path(name), "w0", "w1") as fleet:
        tally.shown = fleet.shown
        fleet.until(lambda: fleet.watched(0.0, fleet.workers))
        flown(fleet, len(ILL), BEFORE_SPEED)
        tally.expected, fleet.speed = len(fleet.shown.announced), speed
        for kill in range(kills):
            fleet.wait(float(rng.uniform(SHORTEST_S, LONGEST_S)))
            tally.again_s.append(killed(fleet, ILL[rng.integers(len(ILL))], tally))
            tally.kills += 1
            fleet.start(f"w{kill + 2}")
            fleet.until(lambda: sum(bool(one["pid"]) for one in fleet.rest.items("/v1/fleet/workers")) == 2)
            fleet.until(lambda: fleet.watched(fleet.flown_s - 2.0 * speed, fleet.workers))
            print(f"\r{tally.kills} of {kills}", end="", file=sys.stderr, flush=True)
        tally.fenced = fleet.counter("store", "fenced")
        lost = (one["counts"].get("messages_lost", 0) for one in fleet.vehicles().values())
        tally.messages_lost = sum(lost)
    print(file=sys.stderr)


def killed(fleet: WorkerFleet, ill: str, tally: Tally) -> float:
    """Kill the worker of a vehicle; the seconds until all vehicles are watched again."""
    fleet.until(lambda: fleet.watcher(ill))
    owner = fleet.watcher(ill) or ""
    shown = [one["worker"] or "" for one in fleet.vehicles().values()]
    tally.of_killed.append(sum(worker.startswith(f"{owner}-") for worker in shown))
    fleet.signal(owner, signal.SIGKILL)
    since_s = fleet.flown_s
    return fleet.until(lambda: fleet.watched(since_s, fleet.workers), PATIENCE_S)


def show(tally: Tally) -> None:
    """Print what was found."""
    shown = tally.shown
    if shown is None or not tally.again_s:
        print("no kill")
        return
    print(
        f"kills: {tally.kills}, of workers with {np.mean(tally.of_killed):.1f} of three vehicles on average"
    )
    print(f"alerts before the first kill: {tally.expected}, lost: {len(shown.lost)}, raised again as another one: "
          f"{len(shown.announced) - tally.expected}, in force at the end: {len(shown.in_force)}")  # fmt: skip
    print(f"faults that turned healthy: {shown.turned_healthy}")
    print(
        f"until all are watched again: median {np.median(tally.again_s):.1f} s, worst {max(tally.again_s):.1f} s"
    )
    print(f"vehicles watched twice: {len(shown.twice)}, by {shown.solutions} published solutions")
    print(f"writes refused because another worker had the vehicle: {tally.fenced}")
    print(f"messages of ten samples lost while nobody watched: {tally.messages_lost}")


def main() -> None:
    parser = argparse.ArgumentParser(description="Kill workers at random instants and see what is lost.")
    parser.add_argument("--kills", type=int, default=10, help="1 to 10000")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--speed", type=float, default=4.0, help="flight seconds a second, 1 to 20")
    arguments = parser.parse_args()
    if not 1 <= arguments.kills <= 10_000:
        parser.error(f"--kills is {arguments.kills}; give 1 to 10000")
    if not 1.0 <= arguments.speed <= 20.0:
        parser.error(f"--speed is {arguments.speed}; give 1 to 20")
    tally = Tally()
    prepare_kernels()
    try:
        with suppress(KeyboardInterrupt):
            course(tally, arguments.kills, arguments.seed, arguments.speed)
    finally:
        show(tally)  # what was found until then, whatever ended it


if __name__ == "__main__":
    run_benchmark(main)
