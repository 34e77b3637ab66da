"""How far turbulence pulls the estimates: mean error of each derivative over simulated flights, still and rough air.

    .venv/bin/python benchmarks/turbulence.py [--flights 6] [--seconds 200]

Seeds are fixed. Truth is the linearisation at the condition that the estimate is reported at.
"""

import argparse
import sys

import numpy as np

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, FlightCondition, linearised_derivatives, load_aircraft
from wingwatch.estimators import Estimate
from wingwatch.monitor import VehicleMonitor
from wingwatch.simulation import FleetSimulation, Scenario, Turbulence, doublet_schedule
from wingwatch.telemetry import SampleBlock, complete

AIRCRAFT = load_aircraft("aerosonde")
FIRST_SEED = 7000
LEVELS: tuple[Turbulence, ...] = ("none", "light", "moderate")


def finals(turbulence: Turbulence, flights: int, seconds: float) -> list[Estimate]:
    """Both estimators' last estimates of short period and lateral structure, over all flights."""
    doublets = doublet_schedule(AIRCRAFT, FlightCondition(25.0, 1000.0), np.deg2rad(2.0))
    fleet = FleetSimulation(
        [
            Scenario(AIRCRAFT, manoeuvres=(doublets,), turbulence=turbulence, seed=FIRST_SEED + i)
            for i in range(flights)
        ]
    )
    found: list[Estimate] = []
    for values in fleet.step(round(50 * seconds)):
        block = complete(SampleBlock(values))
        monitor = VehicleMonitor(AIRCRAFT, "default", "uav", block.present, {}, new_id=lambda: "alert")
        last = list(monitor.feed(block).solutions)[-1]
        for structure in (SHORT_PERIOD, LATERAL):
            mode = last.modes[structure.name]
            found += [mode.fourier, mode.ekf]
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description="How far turbulence pulls the estimates.")
    parser.add_argument("--flights", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=200.0)
    chosen = parser.parse_args()
    print(
        f"{chosen.flights} flights of {chosen.seconds:g} s with doublets every 20 s; mean error in % of truth"
    )
    print(
        "(toward smaller magnitude is negative), and in brackets the rms error over the stated standard error"
    )
    for level in LEVELS:
        estimates = finals(level, chosen.flights, chosen.seconds)
        for structure in (SHORT_PERIOD, LATERAL):
            for name in ("fourier", "ekf"):
                mine = [e for e in estimates if e.structure == structure and e.estimator == name]
                errors, scores = [], []
                for e in mine:
                    airspeed, altitude, density, alpha = e.condition
                    at = FlightCondition(airspeed, altitude, density, angle_of_attack_rad=alpha)
                    truth = np.array(
                        [linearised_derivatives(AIRCRAFT, at, structure)[d] for d in structure.derivatives]
                    )
                    errors.append(100.0 * (e.value - truth) / truth)
                    scores.append((e.value - truth) / e.standard_error)
                mean, rms = np.mean(errors, axis=0), np.sqrt(np.mean(np.square(scores), axis=0))
                cells = [
                    f"{d} {m:+.0f} ({r:.1f})"
                    for d, m, r in zip(structure.derivatives, mean, rms, strict=True)
                ]
                print(f"{level:9}{structure.name:13}{name:8}" + "  ".join(cells))
    return 0


if __name__ == "__main__":
    sys.exit(main())
