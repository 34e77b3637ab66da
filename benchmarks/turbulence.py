"""How far turbulence pulls the estimates: mean error of each derivative over simulated flights, still and rough air.

    .venv/bin/python benchmarks/turbulence.py [--flights 6] [--seconds 200] [--rate 50] [--aircraft aerosonde]
        [--seed 7000] [--model dryden] [--drawn-doublets] [--commands] [--air none,light,moderate]
        [--misstated] [--noise 1]

Seeds are fixed. Flights are as `wingwatch simulate` flies them (how finely the air has to be drawn: ``air_steps``).
Truth is the linearisation at the condition that the estimate is reported at.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import get_args

import numpy as np
from saving import run_benchmark
from simulated_flights import (
    AMPLITUDE_RAD,
    RATE_HZ,
    STRUCTURES,
    Z_95,
    cruise_of,
    last_estimates,
    misstated,
    truth_of,
)

from wingwatch.aircraft import Aircraft, load_aircraft
from wingwatch.estimators import Estimate, Outcome
from wingwatch.simulation import (
    DoubletSchedule,
    FleetSimulation,
    Scenario,
    Turbulence,
    TurbulenceModel,
    doublet_schedule,
)
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

AIRCRAFT = load_aircraft("aerosonde")
FIRST_SEED = 7000
LEVELS: tuple[Turbulence, ...] = ("none", "light", "moderate")


def drawn(doublets: DoubletSchedule, seed: int) -> DoubletSchedule:
    """The same with other times and lengths, which are no multiples of a sample."""
    rng = np.random.default_rng(seed)
    return replace(
        doublets,
        start_s=5.0 + rng.uniform(0.0, 1.0),
        spacing_s=4.0 + rng.uniform(0.0, 1.0),
        period_s=20.0 + rng.uniform(0.0, 2.0),
        pulses_s=tuple(pulse * rng.uniform(0.8, 1.3) for pulse in doublets.pulses_s),
    )


def finals(
    scenarios: Sequence[Scenario], files: Sequence[Aircraft], rate_hz: float, seconds: float, commands: bool
) -> list[Estimate]:
    """Both estimators' last estimates of short period and lateral structure, over all flights.

    Args:
        files: what the estimators may know of each flight's aircraft.
        commands: whether surfaces are known by command alone.
    """
    flown, kinds = FleetSimulation(scenarios, rate_hz=rate_hz).step(round(rate_hz * seconds)), {}
    for surface in ("elevator", "aileron", "rudder") if commands else ():
        flown[:, :, CHANNEL_INDEX[f"{surface}_rad"]] = flown[:, :, CHANNEL_INDEX[f"{surface}_command_rad"]]
        kinds[f"{surface}_rad"] = "command"
    blocks = [complete(SampleBlock(values)) for values in flown]
    return [e for file, b in zip(files, blocks, strict=True) for e in last_estimates(file, b, kinds)]


def with_noise(aircraft: Aircraft, factor: float) -> Aircraft:
    """The same with another sensor noise, which its file states."""
    noise = {name: factor * std for name, std in aircraft.sensors.noise_std.items()} if factor else {}
    sensors = aircraft.sensors.model_copy(update={"noise_std": noise})
    return aircraft.model_copy(update={"sensors": sensors})


def main() -> int:
    parser = argparse.ArgumentParser(
        description="How far turbulence pulls the estimates, and whether their stated errors hold."
    )
    parser.add_argument("--flights", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=200.0)
    parser.add_argument("--rate", type=float, default=RATE_HZ, help="samples a second")
    parser.add_argument("--aircraft", default=AIRCRAFT.name, help="name in the library")
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help="of the first flight of each air")
    parser.add_argument("--air", default=",".join(LEVELS), help="which, of " + ",".join(LEVELS))
    parser.add_argument(
        "--drawn-doublets",
        action="store_true",
        help="times and lengths of the doublets differ from flight to flight",
    )
    parser.add_argument("--commands", action="store_true", help="surfaces are known by command alone")
    parser.add_argument("--model", choices=get_args(TurbulenceModel), default="dryden", help="of the air")
    parser.add_argument(
        "--misstated", action="store_true", help="files have every coefficient 30 %% off, by chance"
    )
    parser.add_argument("--noise", type=float, default=1.0, help="of the sensors, times what the file states")
    chosen = parser.parse_args()
    if not 0.0 <= chosen.noise < math.inf:
        parser.error(f"--noise is {chosen.noise:g}; give 0 or more")
    aircraft = with_noise(load_aircraft(chosen.aircraft), chosen.noise)
    at = cruise_of(aircraft)
    doublets = doublet_schedule(aircraft, at, AMPLITUDE_RAD)
    print(
        f"{chosen.flights} flights of {chosen.seconds:g} s, doublets every 20 s, autopilot closed; mean error in % of"
    )
    print(
        "truth (toward smaller magnitude is negative), and in brackets the rms error over the stated standard error;"
    )
    print(
        "last, truth inside the stated 95 % interval over all derivatives: those that are claimed, and all; the"
        "\nlargest error over stated error of those that are claimed"
    )
    for level in LEVELS:
        if level not in chosen.air.split(","):
            continue
        scenarios = [
            Scenario(
                aircraft,
                at.airspeed_true_m_s,
                at.altitude_m,
                manoeuvres=(drawn(doublets, chosen.seed + i) if chosen.drawn_doublets else doublets,),
                turbulence=level,
                turbulence_model=chosen.model,
                seed=chosen.seed + i,
            )
            for i in range(chosen.flights)
        ]
        files = [misstated(aircraft, s.seed) if chosen.misstated else aircraft for s in scenarios]
        estimates = finals(scenarios, files, chosen.rate, chosen.seconds, chosen.commands)
        for structure in STRUCTURES:
            for name in ("fourier", "ekf"):
                mine = [e for e in estimates if e.structure == structure and e.estimator == name]
                print(f"{level:9}{structure.name:13}{name:8}{row(mine, aircraft)}", flush=True)
    return 0


def row(mine: Sequence[Estimate], aircraft: Aircraft = AIRCRAFT) -> str:
    """Mean error in percent and rms error over stated error by derivative, then the shares inside the interval."""
    truth = np.array([truth_of(aircraft, e) for e in mine])
    error = np.array([e.value for e in mine]) - truth
    scores = error / np.array([e.standard_error for e in mine])
    stands = np.array([[o in (Outcome.CONVERGED, Outcome.SETTLING) for o in e.outcomes] for e in mine])
    of_truth = np.where(truth == 0.0, np.nan, truth)  # some aircraft have derivatives that are nothing
    mean, rms = np.mean(100.0 * error / of_truth, axis=0), np.sqrt(np.mean(np.square(scores), axis=0))
    inside = np.abs(scores) <= Z_95
    symbols = mine[0].structure.derivatives
    cells = [
        f"{d} {'-' if math.isnan(m) else f'{m:+.0f}'} ({r:.1f})"
        for d, m, r in zip(symbols, mean, rms, strict=True)
    ]
    standing = f"{100.0 * inside[stands].mean():.0f}" if stands.any() else "-"
    largest = f"{np.abs(scores[stands]).max():.1f}" if stands.any() else "-"
    covered = f"  | {standing} % of {stands.sum()}, {100.0 * inside.mean():.0f} % of {inside.size}; {largest}"
    return "  ".join(cells) + covered


if __name__ == "__main__":
    run_benchmark(main)
