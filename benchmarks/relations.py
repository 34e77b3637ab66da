"""How often relations alone raise a false alert, how soon they see a fault, in flights drawn as studies draw them.

The monitor's other half, the derivatives, is left out: an hour of flight takes a quarter of a minute.

Run: python benchmarks/relations.py [--kind healthy] [--flights N] [--seconds S] [--seed N] [--all]
"""

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from saving import run_benchmark

from wingwatch.aircraft import Aircraft
from wingwatch.monitor import surface_kinds
from wingwatch.monitor.detection.redundancy import RedundancyWatch
from wingwatch.monitor.detection.redundancy.sequential import Finding
from wingwatch.monitor.detection.redundancy.watch import LOG_THRESHOLD
from wingwatch.simulation.sensor_errors import SIMULATED
from wingwatch.studies.flight import FlightMaker
from wingwatch.studies.grid import KINDS, UNSENT, load_grid
from wingwatch.studies.plan import FlightPlan, draw_plan, load_fleet
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

PIECE = 10


@dataclass(frozen=True)
class Watched:
    """One flight: when the statistic first passed its threshold (infinite: never), what it said, the most it was."""

    plan: FlightPlan
    seen_s: float
    said: str
    cause: str
    most: float

    @property
    def onset_s(self) -> float:
        """Of the fault; infinite in a healthy flight."""
        return float("inf") if self.plan.severity is None or self.plan.onset_s is None else self.plan.onset_s

    @property
    def early(self) -> bool:
        """Whether it was passed before anything was wrong."""
        return self.seen_s < self.onset_s

    @property
    def healthy_s(self) -> float:
        """Seconds of the flight in which an alert would have been false."""
        return min(self.onset_s, self.plan.seconds)


def watched(
    plan: FlightPlan, block: SampleBlock, aircraft: Aircraft, watches: dict[tuple[str, ...], RedundancyWatch]
) -> Watched:
    """The flight as far as the first finding beyond the threshold."""
    lacking = (*UNSENT.get(plan.sensors, ()), *UNSENT.get(plan.surfaces, ()))
    given = tuple(c for c in SIMULATED if c not in lacking)
    values = block.values.copy()
    values[:, [CHANNEL_INDEX[c] for c in lacking]] = np.nan
    whole = complete(SampleBlock(values), given)
    watch = watches.setdefault(
        (plan.aircraft, *given), RedundancyWatch(aircraft, whole.present, surface_kinds(given))
    )
    state, most = watch.init(), -np.inf
    for first in range(0, len(whole), PIECE):
        for second in watch.feed(state, SampleBlock(whole.values[first : first + PIECE])):
            if second.finding is None or not second.finding.ranked:
                continue
            most = max(most, second.finding.log_statistic)
            if most > LOG_THRESHOLD:
                cause = second.finding.ranked[0].hypothesis.cause
                return Watched(plan, second.time_s, _words(second.finding), cause, most)
    return Watched(plan, np.inf, "", "", most)


def _words(finding: Finding) -> str:
    best = finding.ranked[0]
    part = best.hypothesis.channel or best.hypothesis.part
    return f"{best.hypothesis.cause} {part} {best.size:.3g} +- {best.standard_error:.2g}"


def _line(one: Watched) -> str:
    plan = one.plan
    fault = "healthy" if plan.severity is None else f"{plan.effect} {plan.target} {plan.severity:.3g}"
    when = f"{one.seen_s:6.1f} s" if np.isfinite(one.seen_s) else "   never"
    return (
        f"{plan.seed} {plan.aircraft:<14}{plan.turbulence:<9}{plan.excitation:<10}{fault:<44}"
        f"{'FALSE' if one.early and np.isfinite(one.seen_s) else '':<6}{when}  {one.said}  (most {one.most:.1f})"
    )


def _table(flights: Sequence[Watched]) -> None:
    faulty = [w for w in flights if np.isfinite(w.onset_s)]
    for air in sorted({w.plan.turbulence for w in flights}):
        of = [w for w in flights if w.plan.turbulence == air]
        false = sum(w.early and np.isfinite(w.seen_s) for w in of)
        hours = sum(w.healthy_s for w in of) / 3600.0
        seen = [w.seen_s - w.onset_s for w in of if not w.early and np.isfinite(w.seen_s)]
        print(
            f"{air:<10}{len(of):5d} flights  false {false:3d} in {hours:6.2f} h   seen {len(seen):4d}, "
            f"within 5 s {sum(d <= 5.0 for d in seen):4d}, within 30 s {sum(d <= 30.0 for d in seen):4d}"
        )
    named = sum(w.cause == w.plan.effect for w in faulty if not w.early)
    rising = Counter(int(min(w.most, 16.0) // 4.0) * 4 for w in flights if not np.isfinite(w.onset_s))
    if faulty:
        print(f"of {len(faulty)} faults the first cause said is right in {named}")
    if rising:
        shares = ", ".join(f"from {least} on: {rising[least]}" for least in sorted(rising))
        print(f"most of the statistic in healthy flights (threshold {LOG_THRESHOLD:.1f}): {shares}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", choices=KINDS, default="healthy", help="of study whose flights are drawn")
    parser.add_argument("--flights", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=None, help="of a flight (the grid's)")
    parser.add_argument("--seed", type=int, default=0, help="of the first flight")
    parser.add_argument(
        "--all", action="store_true", help="print every flight, not only those with a false alert"
    )
    given = parser.parse_args()
    grid = load_grid(given.kind, None)
    fleet = load_fleet(grid)
    maker, watches = FlightMaker(fleet), dict[tuple[str, ...], RedundancyWatch]()
    flights: list[Watched] = []
    for seed in range(given.seed, given.seed + given.flights):
        plan = draw_plan(given.kind, grid, seed, fleet)
        if given.seconds is not None:
            plan = replace(plan, seconds=given.seconds)
        if given.kind == "healthy":
            plan = replace(plan, severity=None)
        one = watched(plan, maker.samples(plan), fleet[plan.aircraft], watches)
        flights.append(one)
        if given.all or (one.early and np.isfinite(one.seen_s)):
            print(_line(one), flush=True)
    _table(flights)


if __name__ == "__main__":
    run_benchmark(main)
