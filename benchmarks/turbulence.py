"""How far turbulence pulls the estimates: mean error of each derivative over simulated flights, still and rough air.

    .venv/bin/python benchmarks/turbulence.py [--flights 6] [--seconds 200]

Seeds are fixed. Flights are as `wingwatch simulate` flies them (how finely the air has to be drawn: ``air_steps``).
Truth is the linearisation at the condition that the estimate is reported at.
"""

import argparse
import sys
from collections.abc import Sequence

import numpy as np
from simulated_flights import (
    AMPLITUDE_RAD,
    RATE_HZ,
    STRUCTURES,
    Z_95,
    cruise_of,
    last_estimates,
    truth_of,
)

from wingwatch.aircraft import load_aircraft
from wingwatch.estimators import Estimate, Outcome
from wingwatch.simulation import FleetSimulation, Scenario, Turbulence, doublet_schedule
from wingwatch.telemetry import SampleBlock, complete

AIRCRAFT = load_aircraft("aerosonde")
FIRST_SEED = 7000
LEVELS: tuple[Turbulence, ...] = ("none", "light", "moderate")


def finals(turbulence: Turbulence, flights: int, seconds: float) -> list[Estimate]:
    """Both estimators' last estimates of short period and lateral structure, over all flights."""
    doublets = doublet_schedule(AIRCRAFT, cruise_of(AIRCRAFT), AMPLITUDE_RAD)
    fleet = FleetSimulation(
        [
            Scenario(AIRCRAFT, manoeuvres=(doublets,), turbulence=turbulence, seed=FIRST_SEED + i)
            for i in range(flights)
        ],
        rate_hz=RATE_HZ,
    )
    blocks = [complete(SampleBlock(values)) for values in fleet.step(round(RATE_HZ * seconds))]
    return [estimate for block in blocks for estimate in last_estimates(AIRCRAFT, block)]


def main() -> int:
    parser = argparse.ArgumentParser(
        description="How far turbulence pulls the estimates, and whether their stated errors hold."
    )
    parser.add_argument("--flights", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=200.0)
    chosen = parser.parse_args()
    print(
        f"{chosen.flights} flights of {chosen.seconds:g} s, doublets every 20 s, autopilot closed; mean error in % of"
    )
    print(
        "truth (toward smaller magnitude is negative), and in brackets the rms error over the stated standard error;"
    )
    print(
        "last, truth inside the stated 95 % interval over all derivatives: those that claim standing, and all"
    )
    for level in LEVELS:
        estimates = finals(level, chosen.flights, chosen.seconds)
        for structure in STRUCTURES:
            for name in ("fourier", "ekf"):
                mine = [e for e in estimates if e.structure == structure and e.estimator == name]
                print(f"{level:9}{structure.name:13}{name:8}{row(mine)}")
    return 0


def row(mine: Sequence[Estimate]) -> str:
    """Mean error in percent and rms error over stated error by derivative, then the shares inside the interval."""
    truth = np.array([truth_of(AIRCRAFT, e) for e in mine])
    error = np.array([e.value for e in mine]) - truth
    scores = error / np.array([e.standard_error for e in mine])
    stands = np.array([[o in (Outcome.CONVERGED, Outcome.SETTLING) for o in e.outcomes] for e in mine])
    mean, rms = np.mean(100.0 * error / truth, axis=0), np.sqrt(np.mean(np.square(scores), axis=0))
    inside = np.abs(scores) <= Z_95
    symbols = mine[0].structure.derivatives
    cells = [f"{d} {m:+.0f} ({r:.1f})" for d, m, r in zip(symbols, mean, rms, strict=True)]
    standing = f"{100.0 * inside[stands].mean():.0f}" if stands.any() else "-"
    covered = f"  | {standing} % of {stands.sum()}, {100.0 * inside.mean():.0f} % of {inside.size}"
    return "  ".join(cells) + covered


if __name__ == "__main__":
    sys.exit(main())
