"""Surfaces that move together: what cannot be distinguished is named, and only that.

Simulated flights of the Aerosonde, six degrees of freedom, autopilot closed, sensor noise: with independent doublets of
all surfaces, with aileron and rudder doublets at the same moments, with a rudder that is mixed to the aileron, and
without any doublets in still and in rough air. The mixed rudder is flown as an aircraft whose ailerons alone do what
both would, with the rudder's record replaced: any pair with l_xi + k l_zeta = the simulated l_xi describes that flight
exactly.

Run: python benchmarks/correlated_inputs.py [--seconds 120]
"""

import argparse
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.estimators import Estimate, Outcome
from wingwatch.monitor import VehicleMonitor
from wingwatch.simulation import DoubletSchedule, FleetSimulation, Scenario, Turbulence, doublet_schedule
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

Array = NDArray[np.float64]

AIRCRAFT = load_aircraft("aerosonde")
MIX = 0.5
SEED = 9100
READ_FROM_S = 60.0
SURFACES = ("xi", "zeta")


@dataclass(frozen=True, slots=True)
class Case:
    """One way of flying: its doublets, its air, and the share of the aileron that the rudder is mixed with."""

    name: str
    doublets: DoubletSchedule | None
    turbulence: Turbulence = "none"
    mix: float = 0.0


def cases() -> tuple[Case, ...]:
    """The ways of flying, the first and the last two without anything that cannot be distinguished."""
    usual = doublet_schedule(AIRCRAFT, FlightCondition(25.0, 1000.0), period_s=10.0, spacing_s=3.0)
    aileron = replace(
        usual,
        surfaces=usual.surfaces[1:2],
        amplitudes_rad=usual.amplitudes_rad[1:2],
        pulses_s=usual.pulses_s[1:2],
    )
    at_once = replace(usual, spacing_s=0.0)
    return (
        Case("independent doublets", usual),
        Case("all doublets at once", at_once),
        Case(f"rudder = {MIX:g} aileron", aileron, mix=MIX),
        Case(f"rudder = {MIX:g} aileron, light turbulence", aileron, "light", MIX),
        Case("no doublets, still air", None),
        Case("no doublets, light turbulence", None, "light"),
    )


def _read_with_noise(values: Array, rng: np.random.Generator) -> None:
    """Sensor noise of the aircraft file, in place: the surfaces are mixed, not their readings."""
    for name, column in CHANNEL_INDEX.items():
        values[:, column] += (AIRCRAFT.noise_std(name) or 0.0) * rng.standard_normal(len(values))


def flown(case: Case, seconds: float, seed: int = SEED) -> list[Estimate]:
    """Estimates of all modes by both estimators at every half second from ``READ_FROM_S`` on."""
    manoeuvres = () if case.doublets is None else (case.doublets,)
    scenario = Scenario(
        AIRCRAFT, manoeuvres=manoeuvres, turbulence=case.turbulence, seed=seed, noise=not case.mix
    )
    (values,) = FleetSimulation([scenario]).step(round(50 * seconds))
    if case.mix:
        values[:, CHANNEL_INDEX["rudder_rad"]] = case.mix * values[:, CHANNEL_INDEX["aileron_rad"]]
        _read_with_noise(values, np.random.default_rng(seed))
    block = complete(SampleBlock(values))
    monitor = VehicleMonitor(AIRCRAFT, "default", "uav", block.present, {}, new_id=lambda: "alert")
    found: list[Estimate] = []
    for solution in monitor.feed(block).solutions:
        if solution.time_s >= READ_FROM_S:
            for mode in solution.modes.values():
                found += mode.estimates
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Surfaces that move together: what cannot be distinguished is named."
    )
    parser.add_argument("--seconds", type=float, default=120.0, help=f"of flight, more than {READ_FROM_S:g}")
    seconds = parser.parse_args().seconds
    if seconds <= READ_FROM_S:
        parser.error(f"--seconds is {seconds:g}; give more than {READ_FROM_S:g}")
    print(
        f"one flight of {seconds:g} s each; share of solutions from {READ_FROM_S:g} s on that name a set, and the sets"
    )
    for case in cases():
        print(f"\n{case.name}")
        found = flown(case, seconds)
        for key in dict.fromkeys((e.structure.name, e.estimator) for e in found):
            mine = [e for e in found if (e.structure.name, e.estimator) == key]
            sets = Counter(names for e in mine for names in e.confounded)
            share = 100.0 * sum(bool(e.confounded) for e in mine) / len(mine)
            named = "; ".join(
                f"{' '.join(names)} ({100.0 * n / len(mine):.0f} %)" for names, n in sets.most_common(4)
            )
            hidden = [
                d
                for d, o in zip(mine[-1].structure.derivatives, mine[-1].outcomes, strict=True)
                if o is Outcome.NOT_OBSERVABLE
            ]
            print(f"  {key[0]:13} {key[1]:8} {share:4.0f} %  {named or '-'}")
            print(f"  {'':13} {'':8} not observable at the end: {' '.join(hidden) or '-'}")


if __name__ == "__main__":
    run_benchmark(main)
