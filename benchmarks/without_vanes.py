"""Flights without vanes: what the reconstructed velocities give, beside the same flights with vanes.

    .venv/bin/python benchmarks/without_vanes.py [--flights 6] [--seconds 200]

Aerosondes of the six-degree-of-freedom simulation with doublets every 20 s and the autopilot closed; seeds are fixed.
Estimates: mean error in % of truth (towards smaller magnitude is negative), in brackets the rms error over the stated
standard error; last, truth inside the stated 95 % interval, of derivatives that claim standing and of all.
"""

import argparse
import sys
from collections.abc import Sequence

import numpy as np
from simulated_flights import PERIOD_S, RATE_HZ, STRUCTURES, cruise_of, last_estimates
from turbulence import AIRCRAFT, LEVELS, row

from wingwatch.simulation import FleetSimulation, Scenario, Turbulence, doublet_schedule
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

FIRST_SEED = 9000
VANES = [CHANNEL_INDEX[name] for name in ("angle_of_attack_rad", "sideslip_rad")]


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


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Estimates of flights without vanes beside those with.")
    parser.add_argument("--flights", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=200.0)
    chosen = parser.parse_args(arguments)
    estimates(chosen.flights, chosen.seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
