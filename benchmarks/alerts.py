"""Does the monitor see what happens, say the right cause and size, and keep quiet otherwise? Seeded flights.

An aircraft of the library in the six-degree-of-freedom simulation, the Aerosonde at 25 m/s and 1000 m or another one at
its cruise, 300 s each, doublets on all surfaces every 20 s; what befalls it does so at 100 s. Each flight is watched by
``VehicleMonitor`` as live, without earlier flights.

Run: python benchmarks/alerts.py [--flights N] [--turbulence LEVEL] [--seconds S] [--seed N] [--aircraft NAME]
    [--rate HZ] [--commands]
"""

import argparse
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark

from wingwatch.aircraft import Aircraft, FlightCondition, load_aircraft
from wingwatch.monitor import AlertView, MonitorStart, Report, VehicleMonitor, surface_kinds
from wingwatch.monitor.fleet.together import feed_together
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
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

RATE_HZ, DURATION_S, ONSET_S = 50.0, 300.0, 100.0
PIECE_S = 0.5
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
class Flown:
    """What flies, and what of it is measured.

    Attributes:
        aircraft, condition: of all flights; rate_hz: of the samples.
        hidden: channels that nobody sends.
    """

    aircraft: Aircraft
    condition: FlightCondition
    rate_hz: float = RATE_HZ
    hidden: tuple[str, ...] = ()


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
        """The first alert after the onset that is about the airframe, as it stood last.

        An alert that drag has grown may come before it and is cleared by it.
        """
        after = (a for a in self.last if a.raised_s >= self.hours_without * 3600.0)
        return next((a for a in after if a.channel is None), None)


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


def fly(case: Case, flown: Flown, flights: int, seconds: float, first_seed: int) -> list[Flight]:
    """Flights of a case, each with its own noise, air and moment of the first doublet."""
    scenarios = [scenario_of(case, flown, first_seed + i) for i in range(flights)]
    monitors: list[VehicleMonitor] = []
    raised: list[dict[str, AlertView]] = [{} for _ in scenarios]
    last: list[dict[str, AlertView]] = [{} for _ in scenarios]
    for values in pieces(scenarios, flown, seconds):
        given = [SampleBlock(v) for v in values]
        blocks = [complete(b) for b in given]
        monitors = monitors or monitors_of(flown.aircraft, given)
        for i, report in enumerate(fed(monitors, blocks)):
            for alert in report.alerts:
                raised[i].setdefault(alert.id, alert)
                last[i][alert.id] = alert
    without = seconds if case.effect is None else min(ONSET_S, seconds)
    return [
        Flight(tuple(r.values()), tuple(z.values()), without / 3600.0)
        for r, z in zip(raised, last, strict=True)
    ]


def pieces(scenarios: Sequence[Scenario], flown: Flown, seconds: float) -> Iterator[NDArray[np.float64]]:
    """The samples of all flights, half a second at a time, what nobody sends left out."""
    simulation = FleetSimulation(scenarios, flown.rate_hz)
    for _ in range(round(seconds / PIECE_S)):
        values = simulation.step(round(PIECE_S * flown.rate_hz))
        for name in flown.hidden:
            values[..., CHANNEL_INDEX[name]] = np.nan
        yield values


def scenario_of(case: Case, flown: Flown, seed: int) -> Scenario:
    """A flight of a case."""
    start_s = FIRST_DOUBLET_S + np.random.default_rng(seed).uniform(0.0, PERIOD_S)
    schedule = doublet_schedule(flown.aircraft, flown.condition, period_s=PERIOD_S, start_s=start_s)
    return Scenario(
        flown.aircraft,
        flown.condition.airspeed_true_m_s,
        flown.condition.altitude_m,
        manoeuvres=(schedule,) if case.doublets else (),
        effects=() if case.effect is None else (case.effect,),
        turbulence=case.turbulence,
        seed=seed,
    )


def monitors_of(aircraft: Aircraft, given: Sequence[SampleBlock]) -> list[VehicleMonitor]:
    """A monitor for each vehicle of a type by its first samples; they know nothing of earlier flights."""
    kinds, start, monitors = surface_kinds(given[0].present), MonitorStart(), list[VehicleMonitor]()
    for block in given:
        present, numbers = complete(block).present, map(str, itertools.count(1))
        monitor = VehicleMonitor(
            aircraft, "benchmark", "one", present, kinds, new_id=numbers.__next__, start=start
        )
        monitors.append(monitor)
        start = MonitorStart(chain=monitor.chain, relations=monitor.relations)
    return monitors


def fed(monitors: Sequence[VehicleMonitor], blocks: Sequence[SampleBlock]) -> Iterator[Report]:
    """What the samples of each vehicle lead to; together they cost less, and say the same to the bit."""
    for report in feed_together(monitors, blocks):
        if isinstance(report, Exception):
            raise report
        yield report


def flown_of(given: argparse.Namespace) -> Flown:
    """What the arguments ask for."""
    aircraft = load_aircraft(given.aircraft)
    condition = FlightCondition(25.0, 1000.0)
    if given.aircraft != "aerosonde" and aircraft.envelope is not None:
        condition = aircraft.envelope.cruise
    hidden = ("elevator_rad", "aileron_rad", "rudder_rad") if given.commands else ()
    return Flown(aircraft, condition, given.rate, hidden)


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
    parser.add_argument("--aircraft", default="aerosonde", help="name in the library, with [coefficients]")
    parser.add_argument("--rate", type=float, default=RATE_HZ, help="samples a second, 10 to 400")
    parser.add_argument("--commands", action="store_true", help="surfaces are known by command alone")
    given = parser.parse_args()
    if given.flights < 1 or not given.seconds > ONSET_S or not 10.0 <= given.rate <= 400.0:
        parser.error(f"give --flights of at least 1, --seconds above {ONSET_S:g} and --rate of 10 to 400")
    flown = flown_of(given)
    done: dict[str, tuple[Case, list[Flight]]] = {}
    for number, case in enumerate(cases(given.turbulence)):
        done[case.name] = (
            case,
            fly(case, flown, given.flights, given.seconds, given.seed + 1000 * number),
        )
    print(f"{flown.aircraft.name} at {flown.rate_hz:g} Hz; not sent: {', '.join(flown.hidden) or 'nothing'}")
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
    run_benchmark(main)
