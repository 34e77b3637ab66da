"""What the watch of manoeuvres costs: a vehicle's samples with it and without, in turns of one run.

Two flights of one vehicle, as a service takes them in, ten samples a message: one on which no surface moves but by the
autopilot, and one with a doublet of each surface in turn, every six seconds one. With the watch each manoeuvre that
ends gets its verdict. Without, the monitor is the same and looks for none. Both take turns message by message, so that
what else the machine does meets both; the ratio is that of their processor times.

Run: python benchmarks/manoeuvre_watch.py [--seconds 120] [--turns 5] [--seed 1]
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from saving import run_benchmark

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor import Solution, VehicleMonitor, verdict
from wingwatch.monitor.vehicle.manoeuvre_watch import FlownManoeuvre
from wingwatch.simulation import Manoeuvre, Scenario, doublet_schedule, simulate
from wingwatch.telemetry import SampleBlock

A_MESSAGE = 10
AEROSONDE = load_aircraft("aerosonde")


class NoWatch:
    """In the place of ``ManoeuvreWatch``: finds none."""

    def add(self, block: SampleBlock) -> None:
        """Nothing."""

    def look(self, before: Solution | None, solution: Solution) -> FlownManoeuvre | None:
        """None."""
        return None

    def end(self, solution: Solution) -> FlownManoeuvre | None:
        """None."""
        return None


def monitor_of(flight: SampleBlock, watched: bool) -> VehicleMonitor:
    """The monitor of one vehicle, with the watch or without."""
    monitor = VehicleMonitor(AEROSONDE, "default", "uav1", flight.present, {}, new_id=lambda: "a1")
    if not watched:
        monitor._manoeuvres = NoWatch()  # type: ignore[assignment]
    return monitor


@dataclass(slots=True)
class Cost:
    """Of one flight: processor times by whether it was watched, verdicts, and the longest message with one."""

    took_s: dict[bool, float]
    judged: int = 0
    longest_s: float = 0.0

    @property
    def ratio(self) -> float:
        """With the watch over without."""
        return self.took_s[True] / self.took_s[False]


def flown(flight: SampleBlock) -> Cost:
    """Both monitors, message by message in turns."""
    monitors, cost = {w: monitor_of(flight, w) for w in (True, False)}, Cost({True: 0.0, False: 0.0})
    for number, start in enumerate(range(0, len(flight), A_MESSAGE)):
        message = SampleBlock(flight.values[start : start + A_MESSAGE])
        for watched in (True, False) if number % 2 else (False, True):
            began = time.process_time()
            report = monitors[watched].feed(message)
            for one in report.manoeuvres:
                cost.judged += 1
                verdict(monitors[watched], one, cost.judged)
            took_s = time.process_time() - began
            cost.took_s[watched] += took_s
            if report.manoeuvres:
                cost.longest_s = max(cost.longest_s, took_s)
    return cost


def compared(name: str, manoeuvres: Sequence[Manoeuvre], seconds: float, turns: int, seed: int) -> float:
    """Print what a flight costs with the watch and without; the ratio."""
    flight = simulate(Scenario(AEROSONDE, manoeuvres=tuple(manoeuvres), seed=seed), seconds)
    flown(SampleBlock(flight.values[:1000]))  # what is compiled and kept by the first
    costs = [flown(flight) for _ in range(turns)]
    with_us, without_us = (
        1e6 * float(np.median([c.took_s[w] for c in costs])) / len(flight) for w in (True, False)
    )
    ratios = [c.ratio for c in costs]
    print(
        f"{name}: {costs[0].judged} manoeuvres judged in {seconds:g} s of flight; with {with_us:.1f} us a sample, "
        f"without {without_us:.1f}; ratio {np.median(ratios):.3f} ({min(ratios):.3f} to {max(ratios):.3f}); longest "
        f"message with a verdict {1e3 * min(c.longest_s for c in costs):.1f} ms"
    )
    return float(np.median(ratios))


def main() -> None:
    """Print both flights."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    assert AEROSONDE.envelope is not None
    doublets = doublet_schedule(AEROSONDE, AEROSONDE.envelope.cruise, period_s=18.0, spacing_s=6.0)
    for name, manoeuvres in (("quiet", ()), ("full of manoeuvres", (doublets,))):
        compared(name, manoeuvres, arguments.seconds, arguments.turns, arguments.seed)


if __name__ == "__main__":
    run_benchmark(main)
