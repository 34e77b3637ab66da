"""Does the monitor see what happens, say the right cause and size, and keep quiet otherwise? Seeded flights.

Aerosondes of the six-degree-of-freedom simulation at 25 m/s and 1000 m, 300 s each, doublets on all surfaces every
20 s; what befalls them does so at 100 s. Each flight is watched by ``VehicleMonitor`` as live, without earlier flights.

Run: python benchmarks/alerts.py [--flights N] [--turbulence LEVEL] [--seconds S] [--seed N]
"""

import argparse
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, FlightCondition, load_aircraft
from wingwatch.monitor import AlertView, VehicleMonitor
from wingwatch.simulation import (
    AileronEffectiveness,
    Effect,
    ElevatorEffectiveness,
    FleetSimulation,
    Icing,
    RudderEffectiveness,
    Scenario,
    Turbulence,
    doublet_schedule,
)
from wingwatch.telemetry import SampleBlock

RATE_HZ, DURATION_S, ONSET_S = 50.0, 300.0, 100.0
PIECE = 25
FIRST_DOUBLET_S, PERIOD_S = 5.0, 20.0


@dataclass(frozen=True, slots=True)
class Case:
    """A kind of flight.

    Attributes:
        effect: what befalls it, or None for a healthy flight.
        doublets: whether it is excited at all.
    """

    name: str
    effect: Effect | None
    turbulence: Turbulence
    doublets: bool = True


@dataclass(frozen=True, slots=True)
class Flight:
    """What was said of one flight: each alert as raised, and as it stood last."""

    raised: tuple[AlertView, ...]
    last: tuple[AlertView, ...]
    hours_without: float

    @property
    def false(self) -> int:
        """Alerts while nothing was wrong."""
        return sum(a.raised_s < self.hours_without * 3600.0 for a in self.raised)

    @property
    def hit(self) -> AlertView | None:
        """The first alert after the onset, as it stood last."""
        return next((a for a in self.last if a.raised_s >= self.hours_without * 3600.0), None)


def cases(turbulence: Turbulence) -> tuple[Case, ...]:
    """Healthy flights in every air, then effects in air of the given turbulence."""
    healthy = (
        Case("healthy, still air", None, "none"),
        Case("healthy, light turbulence", None, "light"),
        Case("healthy, moderate turbulence", None, "moderate"),
        Case("healthy, still, no doublets", None, "none", doublets=False),
    )
    icing = tuple(Case(f"icing {size:g}", Icing(size, ONSET_S), turbulence) for size in (0.05, 0.15, 0.3))
    losses = tuple(
        Case(f"{kind.name.split('_')[0]} loss {size:g}", kind(size, ONSET_S), turbulence)
        for kind in (ElevatorEffectiveness, AileronEffectiveness, RudderEffectiveness)
        for size in (0.3, 0.5)
    )
    return healthy + icing + losses


def fly(case: Case, aircraft: Aircraft, flights: int, seconds: float, first_seed: int) -> list[Flight]:
    """Flights of a case, each with its own noise, air and moment of the first doublet."""
    scenarios = [_scenario(case, aircraft, first_seed + i) for i in range(flights)]
    monitors: list[VehicleMonitor] = []
    raised: list[dict[str, AlertView]] = [{} for _ in scenarios]
    last: list[dict[str, AlertView]] = [{} for _ in scenarios]
    for values in _pieces(scenarios, seconds):
        blocks = [SampleBlock(v) for v in values]
        if not monitors:
            monitors = [_monitor(aircraft, b.present) for b in blocks]
        for i, block in enumerate(blocks):
            for alert in monitors[i].feed(block).alerts:
                raised[i].setdefault(alert.id, alert)
                last[i][alert.id] = alert
    without = seconds if case.effect is None else min(ONSET_S, seconds)
    return [
        Flight(tuple(r.values()), tuple(z.values()), without / 3600.0)
        for r, z in zip(raised, last, strict=True)
    ]


def _pieces(scenarios: Sequence[Scenario], seconds: float) -> Iterator[NDArray[np.float64]]:
    simulation = FleetSimulation(scenarios, RATE_HZ)
    for _ in range(round(seconds * RATE_HZ) // PIECE):
        yield simulation.step(PIECE)


def _scenario(case: Case, aircraft: Aircraft, seed: int) -> Scenario:
    start_s = FIRST_DOUBLET_S + np.random.default_rng(seed).uniform(0.0, PERIOD_S)
    schedule = doublet_schedule(aircraft, FlightCondition(25.0, 1000.0), period_s=PERIOD_S, start_s=start_s)
    return Scenario(
        aircraft,
        manoeuvres=(schedule,) if case.doublets else (),
        effects=() if case.effect is None else (case.effect,),
        turbulence=case.turbulence,
        seed=seed,
    )


def _monitor(aircraft: Aircraft, present: Sequence[str]) -> VehicleMonitor:
    numbers = itertools.count(1)
    return VehicleMonitor(aircraft, "benchmark", "one", present, {}, new_id=lambda: str(next(numbers)))


def _effect_row(case: Case, effect: Effect, flights: Sequence[Flight]) -> str:
    hits = [h for f in flights if (h := f.hit) is not None]
    right = [h for h in hits if h.cause == effect.name]
    row = f"{case.name:<30}{len(hits) / len(flights):9.0%}{len(right) / len(flights):9.0%}"
    if hits:
        delays = [h.raised_s - ONSET_S for h in hits]
        row += f"{float(np.median(delays)):10.1f}{max(delays):9.1f}"
    else:
        row += f"{'-':>10}{'-':>9}"
    if right:
        error = np.array([h.size - effect.size for h in right])
        scaled = error / np.array([h.size_standard_error for h in right])
        row += f"{error.mean():+12.3f}{math.sqrt(float(np.mean(error**2))):9.3f}"
        row += f"{math.sqrt(float(np.mean(scaled**2))):12.2f}"
    else:
        row += f"{'-':>12}{'-':>9}{'-':>12}"
    wrong = sorted({h.cause for h in hits} - {effect.name})
    return row + "  " + ", ".join(wrong)


def _false_row(label: str, flights: Sequence[Flight]) -> str:
    hours = sum(f.hours_without for f in flights)
    false = sum(f.false for f in flights)
    causes = sorted({a.cause for f in flights for a in f.raised if a.raised_s < f.hours_without * 3600.0})
    return f"{label:<30}{hours:10.2f}{false:10d}{false / hours:12.2f}  {', '.join(causes)}"


def main() -> None:
    parser = argparse.ArgumentParser(description="Monte-Carlo flights through the monitor.")
    parser.add_argument("--flights", type=int, default=8, help="flights of each kind")
    parser.add_argument(
        "--turbulence",
        choices=("none", "light", "moderate"),
        default="none",
        help="of flights with an effect",
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of the first flight: other flights of the same kind"
    )
    parser.add_argument("--seconds", type=float, default=DURATION_S, help="length of a flight, above 100")
    given = parser.parse_args()
    if given.flights < 1 or not given.seconds > ONSET_S:
        parser.error(f"give --flights of at least 1 and --seconds above {ONSET_S:g}")
    aircraft = load_aircraft("aerosonde")
    done: dict[str, tuple[Case, list[Flight]]] = {}
    for number, case in enumerate(cases(given.turbulence)):
        done[case.name] = (
            case,
            fly(case, aircraft, given.flights, given.seconds, given.seed + 1000 * number),
        )
    print(
        f"{given.flights} flights of {given.seconds:g} s each; effects from {ONSET_S:g} s on; air of flights"
    )
    print(
        f"with an effect: turbulence {given.turbulence}. Rates of all flights; delay from the onset; size as it"
    )
    print("stood last where the cause is right; z: rms of size error over its stated standard error.\n")
    print(
        f"{'effect':<30}{'detected':>9}{'cause':>9}{'median, s':>10}{'max, s':>9}{'size bias':>12}{'rms':>9}"
        f"{'z':>12}  wrong causes"
    )
    for case, flights in done.values():
        if case.effect is not None:
            print(_effect_row(case, case.effect, flights))
    print(f"\n{'nothing wrong':<30}{'hours':>10}{'alerts':>10}{'an hour':>12}  causes")
    for case, flights in done.values():
        if case.effect is None:
            print(_false_row(case.name, flights))
    print(_false_row("before the onset", [f for c, fs in done.values() if c.effect for f in fs]))


if __name__ == "__main__":
    main()
