"""Flights without vanes: what the reconstructed velocities give beside flights with vanes, and what is noticed.

    .venv/bin/python benchmarks/without_vanes.py [--flights 6] [--seconds 200]
    .venv/bin/python benchmarks/without_vanes.py --alerts [--flights 6] [--seconds 240] [--seed 9000] [--rate 50]
        [--commands] [--air none,light,moderate] [--aircraft aerosonde,ultrastick25e,twinotter]

Flights of the six-degree-of-freedom simulation with doublets every 20 s and the autopilot closed; seeds are fixed.
Estimates, of Aerosondes: mean error in % of truth (towards smaller magnitude is negative), in brackets the rms error
over the stated standard error; last, truth inside the stated 95 % interval, of derivatives that are claimed and of
all. Alerts: what befalls a flight does so at 100 s. Noticed: by any alert within 60 s, also by one of channels that
contradict each other, which needs no vane. By derivatives: by one of the airframe within 60 s that names the cause.
"""

import argparse
from collections.abc import Sequence

import numpy as np
from alerts import ONSET_S, Case, Flight, Flown, fly
from saving import run_benchmark
from simulated_flights import PERIOD_S, RATE_HZ, STRUCTURES, cruise_of, last_estimates
from turbulence import AIRCRAFT, LEVELS, row

from wingwatch.aircraft import load_aircraft
from wingwatch.simulation import (
    Effect,
    ElevatorEffectiveness,
    FleetSimulation,
    Icing,
    Scenario,
    Turbulence,
    doublet_schedule,
)
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

FIRST_SEED = 9000
VANE_CHANNELS = ("angle_of_attack_rad", "sideslip_rad")
POSITION_CHANNELS = ("elevator_rad", "aileron_rad", "rudder_rad")
VANES = [CHANNEL_INDEX[name] for name in VANE_CHANNELS]
SOON_S = 60.0
EFFECTS_AT_ONSET = (None, Icing(0.15, ONSET_S), Icing(0.3, ONSET_S), ElevatorEffectiveness(0.3, ONSET_S))


def flown(turbulence: Turbulence, flights: int, seconds: float) -> list[SampleBlock]:
    """Flights as they come from an aircraft with vanes."""
    schedule = doublet_schedule(AIRCRAFT, cruise_of(AIRCRAFT), period_s=PERIOD_S, start_s=5.0)
    scenarios = [
        Scenario(AIRCRAFT, manoeuvres=(schedule,), turbulence=turbulence, seed=FIRST_SEED + i)
        for i in range(flights)
    ]
    return [SampleBlock(values) for values in FleetSimulation(scenarios).step(round(RATE_HZ * seconds))]


def without_vanes(block: SampleBlock) -> SampleBlock:
    """The flight as an aircraft without vanes would have recorded it."""
    values = block.values.copy()
    values[:, VANES] = np.nan
    return complete(SampleBlock(values))


def estimates(flights: int, seconds: float) -> None:
    print(f"\nestimates, {flights} flights of {seconds:g} s")
    for level in LEVELS:
        blocks = flown(level, flights, seconds)
        for label, change in (("vanes", complete), ("without", without_vanes)):
            found = [e for block in blocks for e in last_estimates(AIRCRAFT, change(block))]
            for structure in STRUCTURES:
                for name in ("fourier", "ekf"):
                    mine = [e for e in found if e.structure == structure and e.estimator == name]
                    if mine:
                        print(f"{level:9}{label:8}{structure.name:13}{name:8}{row(mine)}")


def alerts(chosen: argparse.Namespace) -> None:
    """What is noticed of flights without vanes, by aircraft, air and kind."""
    hidden = (*VANE_CHANNELS, *(POSITION_CHANNELS if chosen.commands else ()))
    print(
        f"\n{chosen.flights} flights of {chosen.seconds:g} s each at {chosen.rate:g} Hz; not sent: {', '.join(hidden)}"
    )
    print(
        f"{'aircraft':<15}{'air':<10}{'kind':<16}{'noticed':>8}{'by derivatives':>16}{'median, s':>11}  false"
    )
    hours, false = 0.0, 0
    for name in chosen.aircraft.split(","):
        aircraft = load_aircraft(name)
        flown = Flown(aircraft, cruise_of(aircraft), chosen.rate, hidden)
        for air in chosen.air.split(","):
            for number, effect in enumerate(EFFECTS_AT_ONSET):
                label = "healthy" if effect is None else f"{effect.name.split('_')[0]} {effect.size:g}"
                flights = fly(
                    Case(label, effect, air),
                    flown,
                    chosen.flights,
                    chosen.seconds,
                    chosen.seed + 1000 * number,
                )
                hours, false = (
                    hours + sum(f.hours_without for f in flights),
                    false + sum(f.false for f in flights),
                )
                print(
                    f"{name:<15}{air:<10}{label:<16}{_noticed(effect, flights)}  {sum(f.false for f in flights)}",
                    flush=True,
                )
    print(f"false alerts: {false} in {hours:.1f} h without anything wrong")


def _noticed(effect: Effect | None, flights: Sequence[Flight]) -> str:
    if effect is None:
        return f"{'-':>8}{'-':>16}{'-':>11}"
    soon = ONSET_S + SOON_S
    noticed = sum(any(ONSET_S <= a.raised_s <= soon for a in f.raised) for f in flights)
    named = [f.hit.raised_s - ONSET_S for f in flights if f.hit is not None and f.hit.cause == effect.name]
    quick = sum(delay <= SOON_S for delay in named)
    median = f"{np.median(named):.0f}" if named else "-"
    return f"{noticed}/{len(flights)}".rjust(8) + f"{quick}/{len(flights)}".rjust(16) + median.rjust(11)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Estimates and alerts of flights without vanes.")
    parser.add_argument("--flights", type=int, default=6)
    parser.add_argument("--seconds", type=float, help="200 for estimates, 240 for alerts")
    parser.add_argument("--alerts", action="store_true", help="what is noticed, not estimates")
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help="of the first flight")
    parser.add_argument("--rate", type=float, default=RATE_HZ, help="samples a second")
    parser.add_argument("--commands", action="store_true", help="surfaces are known by command alone")
    parser.add_argument("--air", default=",".join(LEVELS))
    parser.add_argument("--aircraft", default="aerosonde,ultrastick25e,twinotter")
    chosen = parser.parse_args(arguments)
    if chosen.seconds is None:
        chosen.seconds = 240.0 if chosen.alerts else 200.0
    if chosen.alerts:
        alerts(chosen)
    else:
        estimates(chosen.flights, chosen.seconds)
    return 0


if __name__ == "__main__":
    run_benchmark(main)
