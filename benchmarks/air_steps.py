"""How finely the air has to be drawn: bias of the derivatives in rough air against the steps of the simulation.

The same aircraft flies through light air with the loop closed and doublets, its air drawn 50 to 800 times a second and
sensors read at 50 Hz; once as the simulation does it, with the air's mean over each step (``simulation.turbulence``),
and once with the roll rate of the air straight between steps. Estimates are the live chain's filter, the only one that
works on the roll rate of the air. Truth is the linearisation at the condition that an estimate is reported at.

    .venv/bin/python benchmarks/air_steps.py [--flights 16] [--seconds 100] [--aircraft aerosonde twinotter]
        [--level light] [--finer 1 2 4 8]

Per row: mean error of the lateral derivatives that roll brings in, percent, and its standard error over the flights.
"""

import argparse
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark
from simulated_flights import AMPLITUDE_RAD, RATE_HZ, cruise_of, last_solution, truth_of

from wingwatch.aircraft import LATERAL, Aircraft, load_aircraft
from wingwatch.simulation import FleetSimulation, Scenario, Turbulence, doublet_schedule
from wingwatch.simulation.turbulence import LEVELS
from wingwatch.telemetry import SampleBlock, complete

Array = NDArray[np.float64]

FIRST_SEED = 500
SHOWN = ("l_v", "l_p", "l_xi", "n_p", "n_v", "n_r")
PLACES = [LATERAL.derivatives.index(d) for d in SHOWN]


def rough_fleet(
    aircraft: Aircraft, level: Turbulence, flights: int, finer: int, straight: bool
) -> FleetSimulation:
    """Flights through rough air; ``straight``: the air's roll rate is a line between steps, without its own mean."""
    at = cruise_of(aircraft)
    doublets = doublet_schedule(aircraft, at, AMPLITUDE_RAD)
    scenarios = [
        Scenario(
            aircraft, at.airspeed_true_m_s, at.altitude_m, (doublets,), turbulence=level, seed=FIRST_SEED + i
        )
        for i in range(flights)
    ]
    fleet = FleetSimulation(scenarios, RATE_HZ * finer)
    if straight:
        fleet._fleet.gust_filter[:, -2:] = (
            0.5,
            0.0,
        )  # mean of p over a step: of its ends, and nothing of its own
    return fleet


def errors(aircraft: Aircraft, fleet: FleetSimulation, finer: int, seconds: float) -> Array:
    """The filter's final error of ``SHOWN`` in percent of the truth, (flights, derivatives)."""
    rows = []
    for values in fleet.step(round(RATE_HZ * finer * seconds)):
        block = complete(SampleBlock(np.ascontiguousarray(values[::finer])))
        estimate = last_solution(aircraft, block).modes[LATERAL.name].ekf
        truth = truth_of(aircraft, estimate)
        rows.append(100.0 * (estimate.value[PLACES] - truth[PLACES]) / truth[PLACES])
    return np.array(rows)


def line(name: str, steps_hz: float, how: str, found: Array) -> str:
    """One row of the table."""
    mean, spread = found.mean(axis=0), found.std(axis=0, ddof=1) / math.sqrt(len(found))
    cells = "".join(f"{f'{m:+.1f} ({s:.1f})':>14}" for m, s in zip(mean, spread, strict=True))
    return f"{name:11}{steps_hz:7.0f}  {how:10}{cells}"


def table(
    names: Sequence[str], level: Turbulence, flights: int, seconds: float, finer: Sequence[int]
) -> None:
    """Print every aircraft, rate and way."""
    print(f"{'aircraft':11}{'steps/s':>7}  {'air':10}" + "".join(f"{d:>14}" for d in SHOWN))
    for name in names:
        aircraft = load_aircraft(name)
        for straight in (True, False):
            for times in finer:
                fleet = rough_fleet(aircraft, level, flights, times, straight)
                steps_hz = float(fleet.steps_hz[0])
                found = errors(aircraft, fleet, times, seconds)
                print(line(name, steps_hz, "straight" if straight else "with mean", found), flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Bias of the derivatives against how finely the air is drawn."
    )
    parser.add_argument("--flights", type=int, default=16, help="a row, at least 2")
    parser.add_argument("--seconds", type=float, default=100.0, help="of a flight, at least 30")
    parser.add_argument("--aircraft", nargs="+", default=["aerosonde", "twinotter"])
    parser.add_argument("--level", choices=[name for name in LEVELS if name != "none"], default="light")
    parser.add_argument("--finer", type=int, nargs="+", default=[1, 2, 4, 8], help="times 50 Hz, 1 to 20")
    chosen = parser.parse_args()
    if chosen.flights < 2:
        parser.error(f"--flights is {chosen.flights}; give at least 2")
    if not 30.0 <= chosen.seconds < math.inf:
        parser.error(f"--seconds is {chosen.seconds:g}; give at least 30")
    if not all(1 <= times <= 20 for times in chosen.finer):
        parser.error(f"--finer is {chosen.finer}; give 1 to 20")
    print(
        f"{chosen.level} air, {chosen.flights} flights of {chosen.seconds:g} s; mean error in % (standard error)"
    )
    table(chosen.aircraft, chosen.level, chosen.flights, chosen.seconds, chosen.finer)
    return 0


if __name__ == "__main__":
    run_benchmark(main)
