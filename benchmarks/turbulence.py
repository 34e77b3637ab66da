"""How far turbulence pulls the estimates: mean error of each derivative over simulated flights, still and rough air.

    .venv/bin/python benchmarks/turbulence.py [--flights 6] [--seconds 200]

Seeds are fixed. Flights are as `wingwatch simulate` flies them (how finely the air has to be drawn: ``air_steps``).
Truth is the linearisation at the condition that the estimate is reported at.
"""

import argparse
import sys

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    FlightCondition,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)
from wingwatch.estimators import Estimate, Outcome, offsets
from wingwatch.monitor import VehicleMonitor
from wingwatch.simulation import FleetSimulation, Scenario, Turbulence, doublet_schedule
from wingwatch.telemetry import SampleBlock, complete

AIRCRAFT = load_aircraft("aerosonde")
FIRST_SEED = 7000
RATE_HZ = 50
LEVELS: tuple[Turbulence, ...] = ("none", "light", "moderate")


def finals(turbulence: Turbulence, flights: int, seconds: float) -> list[Estimate]:
    """Both estimators' last estimates of short period and lateral structure, over all flights."""
    doublets = doublet_schedule(AIRCRAFT, FlightCondition(25.0, 1000.0), np.deg2rad(2.0))
    fleet = FleetSimulation(
        [
            Scenario(AIRCRAFT, manoeuvres=(doublets,), turbulence=turbulence, seed=FIRST_SEED + i)
            for i in range(flights)
        ],
        rate_hz=RATE_HZ,
    )
    found: list[Estimate] = []
    for values in fleet.step(round(RATE_HZ * seconds)):
        block = complete(SampleBlock(values))
        monitor = VehicleMonitor(AIRCRAFT, "default", "uav", block.present, {}, new_id=lambda: "alert")
        last = list(monitor.feed(block).solutions)[-1]
        for structure in (SHORT_PERIOD, LATERAL):
            mode = last.modes[structure.name]
            found += [mode.fourier, mode.ekf]
    return found


def truth_of(e: Estimate) -> NDArray[np.float64]:
    """Linearisation at the airspeed and density of an estimate; W in y_p is that of its own angle of attack, which
    gusts take away from the trim's."""
    airspeed, altitude, density, alpha = e.condition
    at = trimmed(AIRCRAFT, FlightCondition(airspeed, altitude, density))
    table = linearised_derivatives(AIRCRAFT, at, e.structure)
    concise = np.array([table[d] for d in e.structure.derivatives])
    kinematic = offsets(e.structure, airspeed, alpha) - offsets(e.structure, airspeed, at.angle_of_attack_rad)
    return np.asarray(concise + kinematic)


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
        for structure in (SHORT_PERIOD, LATERAL):
            for name in ("fourier", "ekf"):
                mine = [e for e in estimates if e.structure == structure and e.estimator == name]
                _print_row(level, mine)
    return 0


def _print_row(level: str, mine: list[Estimate]) -> None:
    truth = np.array([truth_of(e) for e in mine])
    error = np.array([e.value for e in mine]) - truth
    scores = error / np.array([e.standard_error for e in mine])
    stands = np.array([[o in (Outcome.CONVERGED, Outcome.SETTLING) for o in e.outcomes] for e in mine])
    mean, rms = np.mean(100.0 * error / truth, axis=0), np.sqrt(np.mean(np.square(scores), axis=0))
    structure = mine[0].structure
    inside = np.abs(scores) <= 1.959964
    cells = [f"{d} {m:+.0f} ({r:.1f})" for d, m, r in zip(structure.derivatives, mean, rms, strict=True)]
    standing = f"{100.0 * inside[stands].mean():.0f}" if stands.any() else "-"
    covered = f"  | {standing} % of {stands.sum()}, {100.0 * inside.mean():.0f} % of {inside.size}"
    print(f"{level:9}{structure.name:13}{mine[0].estimator:8}" + "  ".join(cells) + covered)


if __name__ == "__main__":
    sys.exit(main())
