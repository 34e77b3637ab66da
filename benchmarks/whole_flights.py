"""Estimators of whole flights beside the two online ones, in simulated flight with the autopilot closed.

Doublets of each surface every 20 s; truth is the linearisation at the condition that an estimate is reported at. Each
line: mean error in percent of the truth, in brackets the rms of error over stated standard error; then the share of
truths, of all flights, inside the stated 95 % interval: of all derivatives, and of those that claim to be converged.
The air acts by its mean over a step, as in ``turbulence``.

Run: python benchmarks/whole_flights.py [--flights N] [--seconds S] [--turbulence none light] [--offline-only]
"""

import argparse
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark
from simulated_flights import (
    AMPLITUDE_RAD,
    STRUCTURES,
    Z_95,
    cruise_of,
    flight_form,
    fly,
    last_estimates,
    truth_of,
)
from turbulence import AIRCRAFT, FIRST_SEED, LEVELS

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, ModeStructure, analysis_band_hz
from wingwatch.estimators import (
    Estimate,
    Fit,
    FrequencyEquationErrorConfig,
    Manoeuvre,
    Outcome,
    equation_error,
    flight_manoeuvres,
    frequency_equation_error,
    in_form,
    inertia_coupling,
    output_error,
)
from wingwatch.simulation import doublet_schedule
from wingwatch.telemetry import SampleBlock

Array = NDArray[np.float64]

FORM = flight_form(AIRCRAFT, cruise_of(AIRCRAFT), inertia_coupling(AIRCRAFT))


def by_frequency(parts: Sequence[Manoeuvre]) -> tuple[Estimate, Fit]:
    """Equation error in the band that the aircraft file states."""
    return frequency_equation_error(
        parts, FrequencyEquationErrorConfig(analysis_band_hz(AIRCRAFT, parts[0].config.structure))
    )


SOLVE: dict[str, Callable[[Sequence[Manoeuvre]], tuple[Estimate, Fit]]] = {
    "equation error, time": equation_error,
    "equation error, frequency": by_frequency,
    "output error": output_error,
}

Found = dict[tuple[str, str], list[tuple[Array, Array, Array, Array]]]


def add_online(found: Found, block: SampleBlock) -> None:
    """Both online estimators of both structures on one flight."""
    for estimate in last_estimates(AIRCRAFT, block):
        reach = Z_95 * estimate.standard_error
        ends = np.column_stack([estimate.value - reach, estimate.value + reach])
        found.setdefault((estimate.structure.name, estimate.estimator), []).append(_row(estimate, ends))


def add_offline(found: Found, block: SampleBlock, structure: ModeStructure) -> None:
    """Every estimator of whole flights of one structure on one flight."""
    parts = flight_manoeuvres(structure, FORM, [block])
    for name, solve in SOLVE.items():
        estimate, fit = in_form(*solve(parts), structure)
        found.setdefault((structure.name, name), []).append(_row(estimate, fit.interval))


def _row(estimate: Estimate, interval: Array) -> tuple[Array, Array, Array, Array]:
    """Relative error in percent, error over standard error, whether the interval holds the truth, and whether the
    derivative claims to be converged."""
    truth = truth_of(AIRCRAFT, estimate)
    error = estimate.value - truth
    inside = (interval[:, 0] <= truth) & (truth <= interval[:, 1])
    claims = np.array([o is Outcome.CONVERGED for o in estimate.outcomes])
    return (
        100.0 * error / np.abs(truth), error / estimate.standard_error, inside.astype(np.float64),
        claims.astype(np.float64),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description="Estimators of whole flights in simulated flight.")
    parser.add_argument("--flights", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=200.0)
    parser.add_argument("--turbulence", nargs="+", choices=LEVELS, default=["none", "light"])
    parser.add_argument("--offline-only", action="store_true", help="leave the two online estimators out")
    given = parser.parse_args()
    print(f"{given.flights} flights of {given.seconds:g} s, doublets every 20 s, autopilot closed")
    doublets = doublet_schedule(AIRCRAFT, cruise_of(AIRCRAFT), AMPLITUDE_RAD)
    for level in given.turbulence:
        found: Found = {}
        for flight in range(given.flights):
            block = fly(AIRCRAFT, [doublets], FIRST_SEED + flight, given.seconds, level)
            if not given.offline_only:
                add_online(found, block)
            for structure in STRUCTURES:
                add_offline(found, block, structure)
        for (name, estimator), rows in found.items():
            _print(level, name, estimator, np.array(rows))


def _print(level: str, name: str, estimator: str, rows: Array) -> None:
    symbols = (SHORT_PERIOD if name == SHORT_PERIOD.name else LATERAL).derivatives
    mean, rms = rows[:, 0].mean(axis=0), np.sqrt(np.mean(rows[:, 1] ** 2, axis=0))
    inside, claims = rows[:, 2], rows[:, 3] > 0.5
    shares = f"{100.0 * inside.mean():4.0f} % of {inside.size}"
    claimed = (
        f"{100.0 * inside[claims].mean():4.0f} % of {claims.sum()}" if claims.any() else "   none claims"
    )
    cells = [f"{d} {m:+.1f} ({r:.1f})" for d, m, r in zip(symbols, mean, rms, strict=True)]
    print(
        f"{level:9}{name:13}{estimator:26}{shares}, converged {claimed}  | {'  '.join(cells)}",
        flush=True,
    )


if __name__ == "__main__":
    run_benchmark(main)
