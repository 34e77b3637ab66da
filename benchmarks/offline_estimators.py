"""The estimators that work on files, on the reference plants: error beside the Cramer-Rao bound, and interval coverage.

Plants, inputs, noise, offsets and bound are those of ``reference_plant``. Only velocity, rate and surface are
measured; no estimator is given a noise level or a derivative.

Run: python benchmarks/offline_estimators.py [--seeds N] [--signal-to-noise R ...]
"""

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from reference_plant import (
    CONDITION,
    DURATION_S,
    PLANTS,
    RATE_OFFSET_RAD_S,
    SURFACE_OFFSET_RAD,
    VELOCITY_OFFSET_M_S,
    Plant,
    clean_states,
    cramer_rao,
    doublet,
    signals,
)
from saving import run_benchmark

from wingwatch.estimators import (
    Estimate,
    Fit,
    FrequencyEquationErrorConfig,
    Manoeuvre,
    ManoeuvreConfig,
    OutputErrorConfig,
    equation_error,
    frequency_equation_error,
    manoeuvres,
    output_error,
)

Array = NDArray[np.float64]
Solve = Callable[[Sequence[Manoeuvre]], tuple[Estimate, Fit]]

SIGNAL_TO_NOISE = (5.0, 3.0, 10.0, 30.0)
BAND_HZ = (0.1, 4.0)

ESTIMATORS: Mapping[str, Solve] = {
    "equation error, time": equation_error,
    "equation error, frequency": lambda parts: frequency_equation_error(
        parts, FrequencyEquationErrorConfig(BAND_HZ)
    ),
    "output error, Levenberg-Marquardt": output_error,
    "output error, Gauss-Newton": lambda parts: output_error(parts, OutputErrorConfig("gauss-newton")),
}

SCORED = tuple(ESTIMATORS)[:3]
"""Of these the noisy records are scored: both ways of climbing meet at the same maximum (a test says so)."""


@dataclass(frozen=True, slots=True)
class Score:
    """One estimator against the truth, each (derivatives,); ``coloured`` is a share of records."""

    rms: Array
    bias: Array
    scatter: Array
    stated: Array
    covered: Array
    coloured: float


def config(plant: Plant) -> ManoeuvreConfig:
    """One manoeuvre of the record's length, the surface held between samples."""
    return ManoeuvreConfig(
        plant.structure, (CONDITION.airspeed_true_m_s, CONDITION.air_density_kg_m3), held=(True,),
        window_s=DURATION_S, use_accelerometer=False,
    )  # fmt: skip


def noise_std(plant: Plant, signal_to_noise: float) -> Array:
    """Noise of velocity and rate at a ratio of standard deviations, (2,)."""
    return np.asarray(clean_states(plant).std(axis=0) / signal_to_noise)


def record(plant: Plant, seed: int | None, signal_to_noise: float) -> tuple[Manoeuvre, ...]:
    """One noisy record with its trim offsets left in; without noise for no seed."""
    states = clean_states(plant) + np.array([VELOCITY_OFFSET_M_S, RATE_OFFSET_RAD_S])
    if seed is not None:
        noise = np.random.default_rng(seed).standard_normal(states.shape)
        states = states + noise_std(plant, signal_to_noise) * noise
    rows = signals(plant, states[None], doublet(plant) + SURFACE_OFFSET_RAD)
    return manoeuvres(config(plant), rows[0])


def clean_error(plant: Plant, solve: Solve) -> Array:
    """Error in percent of the truth without noise."""
    truth = np.array(plant.truth)
    estimate, _ = solve(record(plant, None, SIGNAL_TO_NOISE[0]))
    return np.asarray(100.0 * (estimate.value - truth) / np.abs(truth))


def score(plant: Plant, solve: Solve, seeds: int, signal_to_noise: float) -> Score:
    """Score over seeds 0 to ``seeds`` - 1; an interval that is missing does not hold the truth."""
    truth = np.array(plant.truth)
    errors, stated, covered, coloured = [], [], [], 0
    for seed in range(seeds):
        estimate, fit = solve(record(plant, seed, signal_to_noise))
        errors.append(estimate.value - truth)
        stated.append(estimate.standard_error)
        covered.append((fit.interval[:, 0] <= truth) & (truth <= fit.interval[:, 1]))
        coloured += fit.coloured
    error = np.array(errors)
    return Score(
        np.sqrt(np.mean(error**2, axis=0)), error.mean(axis=0), error.std(axis=0, ddof=1), np.mean(stated, axis=0),
        np.mean(covered, axis=0), coloured / seeds,
    )  # fmt: skip


def _line(label: str, cells: Array, form: str = "10.3f") -> None:
    print(f"  {label:<38}" + "".join(f"{c:{form}}" for c in cells))


def _print_plant(plant: Plant, seeds: int, ratios: Sequence[float]) -> None:
    names = "".join(f"{s:>10}" for s in plant.structure.derivatives)
    print(f"\n{plant.structure.name}: no noise, error in percent of the truth\n{'':40}{names}")
    for name, solve in ESTIMATORS.items():
        _line(name, clean_error(plant, solve))
    for ratio in ratios:
        bound = cramer_rao(plant, noise_std(plant, ratio))
        print(
            f"\n{plant.structure.name}: signal-to-noise {ratio:g}, trim offsets left in, {seeds} seeds\n{'':40}{names}"
        )
        _line("Cramer-Rao bound", bound, "10.4f")
        for name in SCORED:
            found = score(plant, ESTIMATORS[name], seeds, ratio)
            print(f"  {name}", flush=True)
            _line("  rms error / bound", found.rms / bound)
            _line("  bias / bound", found.bias / bound)
            _line("  mean stated error / scatter", found.stated / found.scatter)
            _line("  truth in 95 % interval, %", 100.0 * found.covered, "10.1f")
            print(f"    intervals for coloured residuals in {100.0 * found.coloured:.0f} % of the records")


def main() -> None:
    parser = argparse.ArgumentParser(description="Estimators on files, on the reference plants.")
    parser.add_argument("--seeds", type=int, default=1000, help="noisy records a plant, at least 2")
    parser.add_argument("--signal-to-noise", type=float, nargs="+", default=list(SIGNAL_TO_NOISE))
    given = parser.parse_args()
    if given.seeds < 2:
        parser.error(f"--seeds is {given.seeds}; give at least 2")
    for plant in PLANTS:
        _print_plant(plant, given.seeds, given.signal_to_noise)
    print(
        f"\nWith {given.seeds} seeds an rms error is known to {100.0 / math.sqrt(2.0 * given.seeds):.1f} % "
        f"(one sigma), a share of 95 % to {100.0 * math.sqrt(0.95 * 0.05 / given.seeds):.1f} points."
    )


if __name__ == "__main__":
    run_benchmark(main)
