"""Still-air flights of one minute: each estimator's error beside that of output error on the same flights.

Aircraft whose files state coefficients fly at their cruise, sensors as their files say, autopilot closed, three
doublets a surface. The online estimators run in the live chain, with a file whose coefficients of stability and
control are each 30 % off to either side; output error works on the whole flight with the same sensor places and
servos. Truth is the linearisation at the condition that an estimate is reported at.

    .venv/bin/python benchmarks/still_flights.py [--flights 8] [--seconds 60]
        [--aircraft aerosonde twinotter ultrastick25e] [--json]

Per aircraft, structure and estimator: rms error over output error's, of the median and of the worst derivative; over
the bound (output error's covariance for white sensor noise, surfaces taken as exact); share of derivatives called
``converged``; truth in the stated 95 % interval of these and of all; largest error over stated error of these.

A new estimator of whole flights is a row in ``WHOLE``.
"""

import argparse
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark
from simulated_flights import (
    AMPLITUDE_RAD,
    PERIOD_S,
    STRUCTURES,
    Z_95,
    cruise_of,
    flight_form,
    fly,
    last_solution,
    misstated,
    truth_of,
)

from wingwatch.aircraft import Aircraft, ModeStructure, load_aircraft
from wingwatch.estimators import (
    Estimate,
    Fit,
    Manoeuvre,
    Outcome,
    flight_manoeuvres,
    in_form,
    output_error,
)
from wingwatch.simulation import doublet_schedule
from wingwatch.telemetry import SampleBlock

Array = NDArray[np.float64]

AIRCRAFT = ("aerosonde", "twinotter", "ultrastick25e")
FIRST_SEED = 3000
PEER = "output error"

WHOLE: dict[str, Callable[[Sequence[Manoeuvre]], tuple[Estimate, Fit]]] = {PEER: output_error}


@dataclass(frozen=True, slots=True)
class Reading:
    """One estimate of one flight, (k,) each: error, stated error, whether claimed, and the bound if there is one."""

    error: Array
    stated: Array
    claimed: NDArray[np.bool_]
    bound: Array | None = None


@dataclass(frozen=True, slots=True)
class Figures:
    """One estimator of one structure over all flights; ratios of rms errors, percent, stated errors.

    Attributes:
        aircraft, structure, estimator: names.
        flights: number.
        over_peer_median, over_peer_worst, worst_derivative: rms error over output error's.
        over_bound_median: rms error over the rms of the bound.
        claimed, covered_claims, covered_all, worst_score: as the module says; None without claims.
        over_peer: ratio by derivative.
    """

    aircraft: str
    structure: str
    estimator: str
    flights: int
    over_peer_median: float
    over_peer_worst: float
    worst_derivative: str
    over_bound_median: float
    claimed: float
    covered_claims: float | None
    covered_all: float
    worst_score: float
    over_peer: tuple[float, ...]


def reading(aircraft: Aircraft, estimate: Estimate, fit: Fit | None = None) -> Reading:
    """An estimate beside its truth."""
    claimed = np.array([o is Outcome.CONVERGED for o in estimate.outcomes])
    bound = None if fit is None else np.sqrt(np.diagonal(fit.covariance_white))
    return Reading(estimate.value - truth_of(aircraft, estimate), estimate.standard_error, claimed, bound)


def read(aircraft: Aircraft, block: SampleBlock, structure: ModeStructure, seed: int) -> dict[str, Reading]:
    """Every estimator of one structure on one flight; ``seed``: of what the live chain's file misstates."""
    mode = last_solution(misstated(aircraft, seed), block).modes[structure.name]
    found = {e.estimator: reading(aircraft, e) for e in mode.estimates}
    parts = flight_manoeuvres(structure, flight_form(aircraft, cruise_of(aircraft)), [block])
    for name, solve in WHOLE.items():
        estimate, fit = in_form(*solve(parts), structure)
        found[name] = reading(aircraft, estimate, fit)
    return found


def collect(
    aircraft: Aircraft, structure: ModeStructure, flights: int, seconds: float
) -> dict[str, list[Reading]]:
    """Readings over flights with seeds from ``FIRST_SEED`` on, by estimator."""
    doublets = doublet_schedule(aircraft, cruise_of(aircraft), AMPLITUDE_RAD, period_s=PERIOD_S)
    found: dict[str, list[Reading]] = {}
    for k in range(flights):
        block = fly(aircraft, [doublets], FIRST_SEED + k, seconds)
        for name, one in read(aircraft, block, structure, FIRST_SEED + k).items():
            found.setdefault(name, []).append(one)
    return found


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))


def figures(aircraft: str, structure: ModeStructure, found: dict[str, list[Reading]]) -> list[Figures]:
    """Every estimator beside output error on the same flights."""
    peer = _rms(np.array([r.error for r in found[PEER]]))
    bound = _rms(np.array([r.bound for r in found[PEER]]))
    rows = []
    for name, readings in found.items():
        error = np.array([r.error for r in readings])
        claimed = np.array([r.claimed for r in readings])
        score = np.abs(error) / np.array([r.stated for r in readings])
        score = np.where(np.isfinite(score), score, np.inf)
        ratio = _rms(error) / peer
        inside = score <= Z_95
        rows.append(
            Figures(
                aircraft,
                structure.name,
                name,
                len(readings),
                float(np.median(ratio)),
                float(ratio.max()),
                structure.derivatives[int(ratio.argmax())],
                float(np.median(_rms(error) / bound)),
                100.0 * float(claimed.mean()),
                100.0 * float(inside[claimed].mean()) if claimed.any() else None,
                100.0 * float(inside.mean()),
                float(score[claimed].max()) if claimed.any() else math.nan,
                tuple(float(r) for r in ratio),
            )
        )
    return rows


HEADER = (
    f"{'aircraft':15}{'structure':14}{'estimator':14}{'over output error':>22}{'over':>8}{'claims':>8}{'in 95 %:':>10}"
    f"{'':6}{'worst':>7}\n{'':43}{'median':>10}{'worst':>12}{'bound':>8}{'%':>8}{'claims':>10}{'all':>6}{'z':>7}"
)


def line(f: Figures) -> str:
    """One row of the table, and every derivative's ratio."""
    covered = f"{'-':>10}" if f.covered_claims is None else f"{f.covered_claims:10.0f}"
    worst = f"{f.over_peer_worst:.2f} {f.worst_derivative}"
    each = " ".join(f"{r:.2f}" for r in f.over_peer)
    return (
        f"{f.aircraft:15}{f.structure:14}{f.estimator:14}{f.over_peer_median:10.2f}{worst:>14}{f.over_bound_median:6.2f}"
        f"{f.claimed:8.0f}{covered}{f.covered_all:6.0f}{f.worst_score:7.1f}   {each}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Estimators in still air beside output error on the same flights."
    )
    parser.add_argument("--flights", type=int, default=8, help="an aircraft, at least 1")
    parser.add_argument("--seconds", type=float, default=60.0, help="of a flight, at least 15")
    parser.add_argument("--aircraft", nargs="+", default=list(AIRCRAFT))
    parser.add_argument("--json", action="store_true", help="one JSON object a line instead of the table")
    chosen = parser.parse_args()
    if chosen.flights < 1:
        parser.error(f"--flights is {chosen.flights}; give at least 1")
    if not 15.0 <= chosen.seconds < math.inf:
        parser.error(f"--seconds is {chosen.seconds:g}; give at least 15")
    if not chosen.json:
        print(
            f"{chosen.flights} flights of {chosen.seconds:g} s in still air, doublets every {PERIOD_S:g} s\n{HEADER}"
        )
    for name in chosen.aircraft:
        aircraft = load_aircraft(name)
        for structure in STRUCTURES:
            for row in figures(name, structure, collect(aircraft, structure, chosen.flights, chosen.seconds)):
                print(json.dumps(asdict(row)) if chosen.json else line(row), flush=True)
    return 0


if __name__ == "__main__":
    run_benchmark(main)
