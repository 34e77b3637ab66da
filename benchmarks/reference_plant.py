"""Both estimators on the reference plants: error on clean data, and error beside the Cramer-Rao bound on noisy data.

The plants are the two-degree-of-freedom short period and Dutch roll with the linearised Aerosonde derivatives of the
thesis (Jameson 2013, 25 m/s, 1000 m), flown with its 2-degree doublets, 50 Hz, 12 s. Only velocity, rate and surface
are measured; the estimators are given no noise level and start 30 % off.

Run: python benchmarks/reference_plant.py [--seeds N] [--signal-to-noise 5 3 10 30]

The first of the levels is shown in full; a table then has every level's share of truths in the stated 95 % interval.
"""

import argparse
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from saving import run_benchmark

from wingwatch.aircraft import DUTCH_ROLL, SHORT_PERIOD, FlightCondition, ModeStructure
from wingwatch.estimators import (
    EkfConfig,
    EkfEstimator,
    FourierConfig,
    FourierEstimator,
    SignalLayout,
)
from wingwatch.simulation import linear_response

Array = NDArray[np.float64]

RATE_HZ, DURATION_S, START_S = 50.0, 12.0, 1.0
SAMPLES = round(RATE_HZ * DURATION_S)
AMPLITUDE_RAD = math.radians(2.0)
CONDITION = FlightCondition(25.0, 1000.0)
SIGNAL_TO_NOISE = 5.0
LEVELS = (SIGNAL_TO_NOISE, 3.0, 10.0, 30.0)
VELOCITY_OFFSET_M_S, RATE_OFFSET_RAD_S, SURFACE_OFFSET_RAD = 1.3, 0.05, 0.05
START_AT = 0.7
SOLVE_EVERY = 25
"""Samples between solutions: 2 Hz, as live."""


@dataclass(frozen=True, slots=True)
class Plant:
    """A plant of known derivatives.

    Attributes:
        structure: its mode.
        truth: concise derivatives in the order of ``structure.derivatives``.
        turn: the kinematic part of the rate's derivative in the force equation, m/s: +U in z_q, -U in y_r.
        pulse_s: length of each half of the doublet, which takes effect in whole samples.
    """

    structure: ModeStructure
    truth: tuple[float, ...]
    turn: float
    pulse_s: float

    @property
    def by_symbol(self) -> dict[str, float]:
        """Derivatives by symbol."""
        return dict(zip(self.structure.derivatives, self.truth, strict=True))


PLANTS = (
    # thesis tables 7.3, 8.1 and 9.1, row "linearised"
    Plant(SHORT_PERIOD, (-4.139, 24.33, -2.361, -4.289, -6.035, -32.54), 25.0, 0.2018),
    # thesis tables 7.8, 8.5 and 9.3, row "linearised"
    Plant(DUTCH_ROLL, (-0.643, -25.02, 3.517, 0.684, -1.043, -22.10), -25.0, 0.3846),
)


@dataclass(frozen=True, slots=True)
class Result:
    """Final estimates of a batch: value and stated standard error, both (seeds, derivatives)."""

    value: Array
    standard_error: Array


@dataclass(frozen=True, slots=True)
class Score:
    """One estimator against the truth, each (derivatives,)."""

    std: Array
    bias: Array
    rms: Array
    stated: Array
    covered: Array


def doublet(plant: Plant) -> Array:
    """The surface, rad from trim, shape (samples,), each value held to the next sample."""
    pulse = round(plant.pulse_s * RATE_HZ)
    first = round(START_S * RATE_HZ)
    u = np.zeros(SAMPLES)
    u[first : first + pulse] = AMPLITUDE_RAD
    u[first + pulse : first + 2 * pulse] = -AMPLITUDE_RAD
    return u


def clean_states(plant: Plant) -> Array:
    """States from trim, shape (samples, 2), exact."""
    return linear_response(plant.structure, plant.by_symbol, doublet(plant), 1.0 / RATE_HZ)


def signals(plant: Plant, states: Array, surface: Array) -> Array:
    """Signal rows as ``wingwatch.estimators.Signals`` lays them out, from measured states (vehicles, samples, 2)."""
    layout = SignalLayout(2, 1)
    rows = np.zeros((*states.shape[:2], layout.columns))
    rows[..., 0] = np.arange(states.shape[1]) / RATE_HZ
    rows[..., 1:3] = states
    rows[..., layout.first_input] = surface
    c = layout.kinematic
    rows[..., c] = plant.turn * states[..., 1]
    rows[..., c + 1] = 1.0
    rows[..., c + 2] = CONDITION.airspeed_true_m_s
    rows[..., c + 3] = CONDITION.air_density_kg_m3
    rows[..., c + 4] = CONDITION.altitude_m
    rows[..., c + 6] = 1.0
    return rows


def estimators(plant: Plant) -> dict[str, FourierEstimator | EkfEstimator]:
    """Both estimators, and the filter without forgetting, started 30 % off with priors as wide as the live chain's:
    three times a derivative's size for the Fourier estimator, once for the filter."""
    truth = np.array(plant.truth)
    start = START_AT * truth
    start[1] -= plant.turn
    size = np.abs(truth)
    reference = (CONDITION.airspeed_true_m_s, CONDITION.air_density_kg_m3)
    fourier = FourierConfig(
        plant.structure, (0.1, 4.0), start, 3.0 * size, reference, block_s=DURATION_S, held=(True,),
        force_from_accelerometer=False,
    )  # fmt: skip
    live = EkfConfig(plant.structure, start, size, reference, held=(True,), use_accelerometer=False)
    endless = EkfConfig(
        plant.structure, start, size, reference, held=(True,), use_accelerometer=False, memory_s=1e9
    )
    return {
        "fourier": FourierEstimator(fourier),
        "ekf": EkfEstimator(live),
        "ekf, no forgetting": EkfEstimator(endless),
    }


def run(estimator: FourierEstimator | EkfEstimator, rows: Array) -> Result:
    """Feed a batch half a second at a time, solving after each, and read the last estimates."""
    values, errors = [], []
    if isinstance(estimator, FourierEstimator):
        fourier = estimator.init(rows.shape[0])
        for k in range(0, rows.shape[1], SOLVE_EVERY):
            estimator.update(fourier, rows[:, k : k + SOLVE_EVERY])
            estimator.solve(fourier)
        last = [estimator.estimate(fourier, i) for i in range(rows.shape[0])]
    else:
        ekf = estimator.init(rows.shape[0])
        for k in range(0, rows.shape[1], SOLVE_EVERY):
            estimator.update(ekf, rows[:, k : k + SOLVE_EVERY])
            estimator.solve(ekf)
        last = [estimator.estimate(ekf, i) for i in range(rows.shape[0])]
    for estimate in last:
        values.append(estimate.value)
        errors.append(estimate.standard_error)
    return Result(np.array(values), np.array(errors))


def clean_errors(plant: Plant) -> dict[str, Array]:
    """Error in percent of the truth on data without noise, by estimator."""
    rows = signals(plant, clean_states(plant)[None], doublet(plant))
    truth = np.array(plant.truth)
    return {
        name: 100.0 * (run(e, rows).value[0] - truth) / np.abs(truth) for name, e in estimators(plant).items()
    }


def noise_std(plant: Plant, ratio: float = SIGNAL_TO_NOISE) -> Array:
    """Noise of the two measured states at the stated ratio of standard deviations."""
    return np.asarray(clean_states(plant).std(axis=0) / ratio)


def _outputs(plant: Plant, parameters: Array) -> Array:
    """Measured states for derivatives (6), constants of the two equations (2) and initial states (2).

    A constant input beside the surface brings the constants in; free constants and free initial states are the
    same as free output offsets and free trim constants.
    """
    a = np.zeros((2, 2))
    b = np.zeros((2, 3))
    for k in range(2):
        a[k], b[k, 0] = parameters[3 * k : 3 * k + 2], parameters[3 * k + 2]
    b[:, 1:] = np.eye(2)
    return _held_response(a, b, doublet(plant), parameters[6:8], parameters[8:10])


def _held_response(a: Array, b: Array, surface: Array, constant: Array, initial: Array) -> Array:
    """Exact response by one matrix exponential, summed here as a series so that it stays smooth in ``a``."""
    dt = 1.0 / RATE_HZ
    whole = np.zeros((5, 5))
    whole[:2, :2], whole[:2, 2:] = a * dt, b * dt
    grown, term = np.eye(5), np.eye(5)
    for order in range(1, 20):
        term = term @ whole / order
        grown = grown + term
    states = np.empty((surface.size, 2))
    states[0] = initial
    forced = np.column_stack([surface, np.tile(constant, (surface.size, 1))]) @ grown[:2, 2:].T
    for i in range(1, surface.size):
        states[i] = grown[:2, :2] @ states[i - 1] + forced[i - 1]
    return states


def cramer_rao(plant: Plant, std: Array) -> Array:
    """Smallest standard error of an unbiased estimate, (6,): inverse Fisher information of the ten parameters.

    Noise variances that are unknown cost nothing (their information is orthogonal). Sensitivities by central
    differences of the exact response.
    """
    centre = np.concatenate([plant.truth, np.zeros(4)])
    sensitivity = np.empty((SAMPLES, 2, centre.size))
    for j in range(centre.size):
        step = np.zeros(centre.size)
        step[j] = 1e-5 * max(abs(centre[j]), 1.0)
        difference = _outputs(plant, centre + step) - _outputs(plant, centre - step)
        sensitivity[:, :, j] = difference / (2.0 * step[j])
    information = np.einsum("nij,i,nik->jk", sensitivity, std**-2.0, sensitivity)
    return np.asarray(np.sqrt(np.diagonal(np.linalg.inv(information))[:6]))


def noisy_scores(plant: Plant, seeds: int, ratio: float = SIGNAL_TO_NOISE) -> dict[str, Score]:
    """Each estimator's score over seeds 0 to ``seeds`` - 1, trim offsets left in the data."""
    clean, std = clean_states(plant), noise_std(plant, ratio)
    offset = np.array([VELOCITY_OFFSET_M_S, RATE_OFFSET_RAD_S])
    noise = np.stack([np.random.default_rng(s).standard_normal(clean.shape) for s in range(seeds)])
    rows = signals(plant, clean + offset + std * noise, doublet(plant) + SURFACE_OFFSET_RAD)
    truth = np.array(plant.truth)
    scores = {}
    for name, estimator in estimators(plant).items():
        result = run(estimator, rows)
        error = result.value - truth
        scores[name] = Score(
            std=error.std(axis=0, ddof=1),
            bias=error.mean(axis=0),
            rms=np.sqrt(np.mean(error**2, axis=0)),
            stated=result.standard_error.mean(axis=0),
            covered=np.mean(np.abs(error) <= 1.959964 * result.standard_error, axis=0),
        )
    return scores


def _line(label: str, cells: Array, form: str = "10.3f") -> None:
    print(f"  {label:<34}" + "".join(f"{c:{form}}" for c in cells))


def _print_clean(plant: Plant) -> None:
    print(f"\n{plant.structure.name}: no noise, error in percent of the truth")
    print(" " * 36 + "".join(f"{s:>10}" for s in plant.structure.derivatives))
    _line("truth", np.array(plant.truth))
    for name, error in clean_errors(plant).items():
        _line(name, error)


def _print_noisy(plant: Plant, seeds: int, ratio: float, scores: dict[str, Score]) -> None:
    bound = cramer_rao(plant, noise_std(plant, ratio))
    print(f"\n{plant.structure.name}: signal-to-noise {ratio:g}, trim offsets left in, {seeds} seeds")
    print(" " * 36 + "".join(f"{s:>10}" for s in plant.structure.derivatives))
    _line("Cramer-Rao bound", bound, "10.4f")
    for name, score in scores.items():
        print(f"  {name}")
        _line("  standard deviation", score.std, "10.4f")
        _line("  bias", score.bias, "10.4f")
        _line("  rms error", score.rms, "10.4f")
        _line("  standard deviation / bound", score.std / bound)
        _line("  bias / bound", score.bias / bound)
        _line("  rms error / bound", score.rms / bound)
        _line("  mean stated error / scatter", score.stated / score.std)
        _line("  truth in 95 % interval, %", 100.0 * score.covered, "10.1f")
    _line("bound / prior's width (filter)", bound / np.abs(np.array(plant.truth)))


def _print_coverage(scores: dict[tuple[str, float], dict[str, Score]], levels: list[float]) -> None:
    print("\ntruth in the stated 95 % interval, %; rms error / Cramer-Rao bound; by signal-to-noise")
    for plant in PLANTS:
        symbols = plant.structure.derivatives
        print(f"{plant.structure.name:36}" + "".join(f"{s:>11}" for s in symbols) + "       all")
        for name in ("fourier", "ekf"):
            for ratio in sorted(levels):
                score = scores[plant.structure.name, ratio][name]
                over = score.rms / cramer_rao(plant, noise_std(plant, ratio))
                cells = [f"{100.0 * c:6.1f} {o:4.2f}" for c, o in zip(score.covered, over, strict=True)]
                print(
                    f"  {name:8} {ratio:>4g}{'':21}"
                    + "".join(f"{c}" for c in cells)
                    + f"{100.0 * score.covered.mean():10.1f}"
                )


def main() -> None:
    parser = argparse.ArgumentParser(description="Both estimators on the reference plants.")
    parser.add_argument("--seeds", type=int, default=200, help="noisy records a plant, at least 2")
    parser.add_argument("--signal-to-noise", type=float, nargs="+", default=list(LEVELS))
    chosen = parser.parse_args()
    seeds, levels = chosen.seeds, chosen.signal_to_noise
    if seeds < 2:
        parser.error(f"--seeds is {seeds}; give at least 2")
    if min(levels) <= 0.0:
        parser.error(f"--signal-to-noise is {min(levels):g}; give ratios above 0")
    for plant in PLANTS:
        _print_clean(plant)
    scores = {(p.structure.name, ratio): noisy_scores(p, seeds, ratio) for p in PLANTS for ratio in levels}
    for plant in PLANTS:
        _print_noisy(plant, seeds, levels[0], scores[plant.structure.name, levels[0]])
    _print_coverage(scores, levels)
    print(
        f"\nWith {seeds} seeds a standard deviation is known to {100.0 / math.sqrt(2.0 * seeds):.0f} % (one sigma), "
        f"a share of 95 % to {100.0 * math.sqrt(0.95 * 0.05 / seeds):.1f} points."
    )


if __name__ == "__main__":
    run_benchmark(main)
