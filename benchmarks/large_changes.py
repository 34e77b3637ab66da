"""What both estimators say of an aircraft after ice or damage has changed it, by the time since.

Flights as those of ``alerts`` (doublets on all surfaces every 20 s, the effect at 100 s). At some moments after the
effect each derivative is held against the linearisation of the aircraft as it is then (where it could fly steadily; an
iced one may be at an airspeed that it cannot hold): which share is claimed
(converged or settling), and how much of what is claimed has the truth in its stated 95 % interval. Beside it the
median error of what is claimed, in natural sizes (the truth before the effect).

Run: python benchmarks/large_changes.py [--flights 3] [--turbulence LEVEL] [--seed N] [--aircraft NAME] [--rate HZ]
    [--commands]
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from alerts import ONSET_S, PIECE_S, Case, Flown, cases, fed, flown_of, monitors_of, pieces, scenario_of
from numpy.typing import NDArray
from saving import run_benchmark
from simulated_flights import STRUCTURES, Z_95

from wingwatch.aircraft import FlightCondition, TrimError
from wingwatch.estimators import Estimate, Outcome, offsets
from wingwatch.monitor import VehicleMonitor
from wingwatch.simulation import Effect, linearise, trim
from wingwatch.telemetry import SampleBlock, complete

Array = NDArray[np.float64]

SINCE_S = (-1.0, 5.0, 15.0, 25.0, 45.0, 75.0, 115.0)
"""Seconds after the effect; the first row is of the aircraft as it was."""
ESTIMATORS = ("fourier", "ekf")


@dataclass(frozen=True, slots=True)
class Said:
    """What an estimator said at a moment: of each derivative whether it was claimed, the error over the stated one,
    and the error in natural sizes."""

    since_s: float
    estimator: str
    claimed: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    score: Array = field(default_factory=lambda: np.zeros(0))
    error: Array = field(default_factory=lambda: np.zeros(0))


def truth_at(flown: Flown, effects: tuple[Effect, ...], estimate: Estimate, time_s: float) -> Array:
    """Linearisation of the aircraft under effects at an estimate's condition; the velocities in y_p, y_r and z_q are
    those of the angle of attack that the estimate reports."""
    airspeed, altitude, density, alpha = estimate.condition
    at = FlightCondition(airspeed, altitude, density)
    table = linearise(flown.aircraft, at, estimate.structure, effects, time_s)
    concise = np.array([table[d] for d in estimate.structure.derivatives])
    level = trim(flown.aircraft, at, effects=effects, time_s=time_s).angle_of_attack_rad
    seen = offsets(estimate.structure, airspeed, alpha if math.isfinite(alpha) else level)
    return np.asarray(concise + seen - offsets(estimate.structure, airspeed, level))


def said(
    case: Case, flown: Flown, flights: int, first_seed: int, since: Sequence[float] = SINCE_S
) -> Iterator[Said]:
    """What both estimators say in flights of a case, at moments ``since`` the effect, s."""
    scenarios = [scenario_of(case, flown, first_seed + i) for i in range(flights)]
    monitors: list[VehicleMonitor] = []
    moments = [ONSET_S + since_s for since_s in since]
    for n, values in enumerate(pieces(scenarios, flown, moments[-1] + PIECE_S)):
        given = [SampleBlock(v) for v in values]
        monitors = monitors or monitors_of(flown.aircraft, given)
        latest = [report.solutions[-1:] for report in fed(monitors, [complete(b) for b in given])]
        now_s = (n + 1) * PIECE_S
        if now_s not in moments:
            continue
        for scenario, solutions in zip(scenarios, latest, strict=True):
            for structure in STRUCTURES:
                mode = solutions[0].modes[structure.name]
                for estimate in mode.estimates:
                    try:
                        natural = truth_at(flown, (), estimate, 0.0)
                        truth = truth_at(flown, scenario.effects, estimate, now_s)
                    except TrimError:  # gusts have it at an airspeed that it cannot hold any more
                        yield Said(now_s - ONSET_S, estimate.estimator)
                        continue
                    error = estimate.value - truth
                    stands = np.array([o in (Outcome.CONVERGED, Outcome.SETTLING) for o in estimate.outcomes])
                    yield Said(
                        now_s - ONSET_S, estimate.estimator, stands, error / estimate.standard_error,
                        error / np.maximum(np.abs(natural), 1e-9),
                    )  # fmt: skip


def row(of_moment: list[Said]) -> str:
    """Share claimed, share of that inside, median error of it."""
    claimed = np.concatenate([s.claimed for s in of_moment])
    score, error = (np.concatenate([getattr(s, name) for s in of_moment]) for name in ("score", "error"))
    if not claimed.any():
        return f"{0:7d}{'-':>7}{'-':>8}"
    inside = 100.0 * float((np.abs(score[claimed]) <= Z_95).mean())
    return (
        f"{100.0 * claimed.mean():7.0f}{inside:7.0f}{100.0 * float(np.median(np.abs(error[claimed]))):8.1f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="What estimators say after ice or damage.")
    parser.add_argument("--flights", type=int, default=3, help="flights of each effect")
    parser.add_argument("--turbulence", choices=("none", "light", "moderate"), default="none")
    parser.add_argument("--seed", type=int, default=0, help="of the first flight")
    parser.add_argument("--aircraft", default="aerosonde", help="name in the library, with [coefficients]")
    parser.add_argument("--rate", type=float, default=50.0, help="samples a second, 10 to 400")
    parser.add_argument("--commands", action="store_true", help="surfaces are known by command alone")
    given = parser.parse_args()
    if given.flights < 1 or not 10.0 <= given.rate <= 400.0:
        parser.error("give --flights of at least 1 and --rate of 10 to 400")
    flown = flown_of(given)
    print(
        f"{flown.aircraft.name}, {flown.rate_hz:g} Hz, turbulence {given.turbulence}, {given.flights} flights of each"
    )
    print(
        "effect. By seconds since then, of all derivatives: claimed %, truth inside the 95 % interval of these %,"
    )
    print("their median error in % of the derivative before the effect.")
    print(f"{'':22}{'':10}" + "".join(f"{since_s:>+22.0f} s" for since_s in SINCE_S))
    for number, case in enumerate(cases(given.turbulence)):
        if case.effect is None:
            continue
        flights = list(
            said(replace(case, turbulence=given.turbulence), flown, given.flights, given.seed + 1000 * number)
        )
        for estimator in ESTIMATORS:
            parts = [[s for s in flights if (s.since_s, s.estimator) == (at, estimator)] for at in SINCE_S]
            print(f"{case.name:22}{estimator:10}" + "".join(f"  {row(part)}" for part in parts), flush=True)


if __name__ == "__main__":
    run_benchmark(main)
