"""Filter error beside output error and truth on simulated flights.

Each line: truths inside the stated 95 % interval, of all derivatives and of those that claim to be converged, the share
that claims, rms of error over stated error of each derivative, and median stated error in per cent of the truth. On
plants of two degrees of freedom ``situations.py --estimators filter-error`` runs it.

Run: python benchmarks/filter_error.py [--flights N] [--seconds S] [--turbulence LEVEL ...] [--structure ...]
"""

import argparse
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark
from simulated_flights import AMPLITUDE_RAD, Z_95, cruise_of, flight_form, fly, truth_of
from turbulence import AIRCRAFT, FIRST_SEED, LEVELS

from wingwatch.aircraft import MODEL_STRUCTURES, SURFACE_OF_INPUT, ModeStructure
from wingwatch.baselines import OutOfEnvelope, apriori_envelope
from wingwatch.estimators import (
    Estimate,
    FilterErrorConfig,
    Fit,
    Outcome,
    filter_error,
    flight_manoeuvres,
    in_form,
    inertia_coupling,
    offsets,
    output_error,
)
from wingwatch.simulation import Turbulence, doublet_schedule
from wingwatch.telemetry import SampleBlock

Array = NDArray[np.float64]

CRUISE = cruise_of(AIRCRAFT)


def estimate_flight(block: SampleBlock, structure: ModeStructure, *, beside: bool) -> tuple[Estimate, Fit]:
    """As ``wingwatch estimate`` does it; output error where ``beside``."""
    envelope = apriori_envelope(AIRCRAFT, structure)
    found = envelope.lookup(CRUISE)
    assert not isinstance(found, OutOfEnvelope)
    own = found.value - offsets(structure, CRUISE.airspeed_true_m_s, CRUISE.angle_of_attack_rad)
    natural = np.maximum(np.abs(own), 2.0 * found.standard_error)
    form = flight_form(AIRCRAFT, CRUISE, inertia_coupling(AIRCRAFT), 12.0 if beside else 30.0)
    parts = flight_manoeuvres(structure, form, [block])
    if beside:
        return in_form(*output_error(parts, natural=natural), structure)
    assert AIRCRAFT.geometry is not None
    config = FilterErrorConfig(
        AIRCRAFT.geometry.span_m, AIRCRAFT.sensors.vane_position_m[0],
        input_noise_std=tuple(AIRCRAFT.noise_std(f"{SURFACE_OF_INPUT[u]}_rad") or 0.0 for u in structure.inputs),
    )  # fmt: skip
    return in_form(*filter_error(parts, config, expected=own, natural=natural), structure)


def show(name: str, found: list[tuple[Estimate, Array]], seconds: float) -> None:
    """One line, and with few flights one line each."""
    value = np.array([e.value for e, _ in found])
    error = np.array([e.standard_error for e, _ in found])
    truth = np.array([t for _, t in found])
    z = (value - truth) / error
    claims = np.array([[o is Outcome.CONVERGED for o in e.outcomes] for e, _ in found])
    inside = np.abs(z) <= Z_95
    claimed = f"{100.0 * inside[claims].mean():3.0f}" if claims.any() else "  -"
    rms = " ".join(f"{r:.1f}" for r in np.sqrt(np.mean(z**2, axis=0)))
    stated = " ".join(f"{s:.2g}" for s in 100.0 * np.median(error / np.abs(truth), axis=0))
    print(
        f"{name:46} {100.0 * inside.mean():3.0f} %  converged {claimed} % of {100.0 * claims.mean():3.0f} %"
        f"  rms/stated {rms}  stated % {stated}  {seconds / len(found):.1f} s",
        flush=True,
    )


def both_estimators(
    blocks: Sequence[SampleBlock], structure: ModeStructure, turbulence: Turbulence, *, verbose: bool
) -> None:
    """One structure on the same flights by filter error and by output error."""
    for beside in (False, True):
        start = time.perf_counter()
        estimates = [estimate_flight(b, structure, beside=beside)[0] for b in blocks]
        found = [(e, truth_of(AIRCRAFT, e)) for e in estimates]
        show(f"{turbulence} {structure.name} {estimates[0].estimator}", found, time.perf_counter() - start)
        for e, truth in found if verbose else ():
            rows = zip(structure.derivatives, e.value, truth, e.standard_error, e.outcomes, strict=True)
            cells = (f"{d} {(v - t) / s:+.1f} ({100 * s / abs(t):.2g}%) {o[:4]}" for d, v, t, s, o in rows)
            print("   ", *cells, e.reason)


def main() -> int:
    parser = argparse.ArgumentParser(description="Filter error beside output error and truth.")
    parser.add_argument("--flights", type=int, default=6)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--turbulence", nargs="*", choices=LEVELS, default=list(LEVELS))
    parser.add_argument("--structure", nargs="*", default=["short_period", "dutch_roll", "lateral"])
    parser.add_argument("--verbose", action="store_true")
    chosen = parser.parse_args()
    for turbulence in chosen.turbulence:
        doublets = doublet_schedule(AIRCRAFT, CRUISE, AMPLITUDE_RAD)
        seeds = range(FIRST_SEED + 500, FIRST_SEED + 500 + chosen.flights)
        blocks = [fly(AIRCRAFT, [doublets], seed, chosen.seconds, turbulence) for seed in seeds]
        for name in chosen.structure:
            both_estimators(blocks, MODEL_STRUCTURES[name], turbulence, verbose=chosen.verbose)
    return 0


if __name__ == "__main__":
    run_benchmark(main)
