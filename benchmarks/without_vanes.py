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
from numpy.typing import NDArray

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    FlightCondition,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)
from wingwatch.estimators import Estimate, Outcome
from wingwatch.monitor import VehicleMonitor
from wingwatch.simulation import FleetSimulation, Scenario, Turbulence, doublet_schedule
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

AIRCRAFT = load_aircraft("aerosonde")
CRUISE = FlightCondition(25.0, 1000.0)
FIRST_SEED = 9000
VANES = [CHANNEL_INDEX[name] for name in ("angle_of_attack_rad", "sideslip_rad")]


def flown(turbulence: Turbulence, flights: int, seconds: float) -> list[SampleBlock]:
    """Flights as they come from an aircraft with vanes."""
    schedule = doublet_schedule(AIRCRAFT, CRUISE, period_s=20.0, start_s=5.0)
    scenarios = [
        Scenario(AIRCRAFT, manoeuvres=(schedule,), turbulence=turbulence, seed=FIRST_SEED + i)
        for i in range(flights)
    ]
    return [SampleBlock(values) for values in FleetSimulation(scenarios).step(round(50.0 * seconds))]


def without_vanes(block: SampleBlock) -> SampleBlock:
    """The flight as an aircraft without vanes would have recorded it."""
    values = block.values.copy()
    values[:, VANES] = np.nan
    return complete(SampleBlock(values))


def finals(block: SampleBlock) -> list[Estimate]:
    """Both estimators' last estimates of short period and lateral structure."""
    monitor = VehicleMonitor(AIRCRAFT, "default", "uav", block.present, {}, new_id=lambda: "alert")
    last = list(monitor.feed(block).solutions)[-1]
    found = []
    for structure in (SHORT_PERIOD, LATERAL):
        found += [last.modes[structure.name].fourier, last.modes[structure.name].ekf]
    return found


def truth_of(e: Estimate) -> NDArray[np.float64]:
    """Linearisation at the airspeed and density that an estimate is reported at."""
    airspeed, altitude, density, _ = e.condition
    at = trimmed(AIRCRAFT, FlightCondition(airspeed, altitude, density))
    table = linearised_derivatives(AIRCRAFT, at, e.structure)
    return np.array([table[d] for d in e.structure.derivatives])


def estimates(flights: int, seconds: float) -> None:
    print(f"\nestimates, {flights} flights of {seconds:g} s")
    levels: tuple[Turbulence, ...] = ("none", "light", "moderate")
    for level in levels:
        blocks = flown(level, flights, seconds)
        for label, change in (("vanes", complete), ("without", without_vanes)):
            found = [e for block in blocks for e in finals(change(block))]
            for structure in (SHORT_PERIOD, LATERAL):
                for name in ("fourier", "ekf"):
                    mine = [e for e in found if e.structure == structure and e.estimator == name]
                    if mine:
                        _row(f"{level:9}{label:8}{structure.name:13}{name:8}", mine)


def _row(label: str, mine: Sequence[Estimate]) -> None:
    truth = np.array([truth_of(e) for e in mine])
    error = np.array([e.value for e in mine]) - truth
    scores = error / np.array([e.standard_error for e in mine])
    stands = np.array([[o in (Outcome.CONVERGED, Outcome.SETTLING) for o in e.outcomes] for e in mine])
    mean, rms = np.mean(100.0 * error / truth, axis=0), np.sqrt(np.mean(np.square(scores), axis=0))
    inside = np.abs(scores) <= 1.959964
    cells = [
        f"{d} {m:+.0f} ({r:.1f})" for d, m, r in zip(mine[0].structure.derivatives, mean, rms, strict=True)
    ]
    standing = f"{100.0 * inside[stands].mean():.0f}" if stands.any() else "-"
    print(
        label + "  ".join(cells) + f"  | {standing} % of {stands.sum()}, {100.0 * inside.mean():.0f} % of all"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Estimates of flights without vanes beside those with.")
    parser.add_argument("--flights", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=200.0)
    chosen = parser.parse_args(arguments)
    estimates(chosen.flights, chosen.seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
