"""How soon after the first input the estimates are right: the error and the stated interval on the way there.

The plants of ``reference_plant`` (short period and Dutch roll, thesis's linearised Aerosonde, 50 Hz) fly level for 6 s
and then a 2-degree doublet every 3 s. Both online estimators start 30 % off, know no noise level and solve at 2 Hz as
live; read between two solutions, they solve once more on a copy. A cycle is 2 pi over the mode's natural frequency.

Run: python benchmarks/convergence.py [--seeds N]
"""

import argparse
import copy
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from reference_plant import (
    AMPLITUDE_RAD,
    CONDITION,
    PLANTS,
    RATE_HZ,
    SOLVE_EVERY,
    START_AT,
    Plant,
    noise_std,
    signals,
)
from saving import run_benchmark

from wingwatch.estimators import (
    EkfConfig,
    EkfEstimator,
    EkfState,
    Estimate,
    FourierConfig,
    FourierEstimator,
    FourierState,
    Outcome,
)
from wingwatch.simulation import linear_response

Array = NDArray[np.float64]

START_S, EVERY_S, DURATION_S = 6.0, 3.0, 18.0
WITHIN = 0.05
Z_95 = 1.959964


@dataclass(frozen=True, slots=True)
class Course:
    """What one estimator says at each sample from the first input on.

    Attributes:
        since_s: time since the input began, (samples,).
        value, standard_error: (samples, vehicles, derivatives).
        converged: whether the derivative is called so, the same shape.
    """

    since_s: Array
    value: Array
    standard_error: Array
    converged: NDArray[np.bool_]


def cycle_s(plant: Plant) -> float:
    """One cycle of the plant's oscillation at its natural frequency, s."""
    d = plant.truth
    return 2.0 * math.pi / math.sqrt(d[0] * d[4] - d[1] * d[3])


def doublets(
    plant: Plant, duration_s: float = DURATION_S, start_s: float = START_S, every_s: float = EVERY_S
) -> Array:
    """The thesis's doublet again and again, rad from trim, shape (samples,), held between samples."""
    pulse, every = round(plant.pulse_s * RATE_HZ), round(every_s * RATE_HZ)
    u = np.zeros(round(duration_s * RATE_HZ))
    for first in range(round(start_s * RATE_HZ), u.size, every):
        u[first : first + pulse] = AMPLITUDE_RAD
        u[first + pulse : first + 2 * pulse] = -AMPLITUDE_RAD
    return u


def rows_of(plant: Plant, states: Array, surface: Array, seeds: int) -> Array:
    """Signal rows: one clean vehicle if ``seeds`` is 0, else so many at signal-to-noise 5 of the reference record."""
    if seeds == 0:
        return signals(plant, states[None], surface)
    noise = np.stack([np.random.default_rng(s).standard_normal(states.shape) for s in range(seeds)])
    return signals(plant, states + noise_std(plant) * noise, surface)


def estimators(plant: Plant) -> tuple[FourierEstimator, EkfEstimator]:
    """Both online estimators with the live chain's settings, started 30 % off."""
    truth = np.array(plant.truth)
    start = START_AT * truth
    start[1] -= plant.turn
    size = np.abs(truth)
    reference = (CONDITION.airspeed_true_m_s, CONDITION.air_density_kg_m3)
    fourier = FourierConfig(
        plant.structure,
        (0.1, 4.0),
        start,
        3.0 * size,
        reference,
        held=(True,),
        force_from_accelerometer=False,
    )
    ekf = EkfConfig(plant.structure, start, size, reference, held=(True,), use_accelerometer=False)
    return FourierEstimator(fourier), EkfEstimator(ekf)


def _read(estimator: FourierEstimator | EkfEstimator, state: FourierState | EkfState) -> list[Estimate]:
    """Estimates of all vehicles as of the last sample, the state left as it is."""
    if isinstance(estimator, FourierEstimator):
        assert isinstance(state, FourierState)
        now = copy.deepcopy(state)
        estimator.solve(now)
        return [estimator.estimate(now, i) for i in range(len(now.theta))]
    assert isinstance(state, EkfState)
    latest = copy.deepcopy(state)
    estimator.solve(latest)
    return [estimator.estimate(latest, i) for i in range(len(latest.z))]


def follow(
    estimator: FourierEstimator | EkfEstimator, rows: Array, start_s: float = START_S, every: int = 1
) -> Course:
    """Run a batch, solving at 2 Hz, and read it after each ``every`` samples from ``start_s`` on."""
    first = round(start_s * RATE_HZ)
    since, value, error, converged = [], [], [], []
    state: FourierState | EkfState = estimator.init(rows.shape[0])
    for k in range(rows.shape[1]):
        if isinstance(estimator, FourierEstimator):
            assert isinstance(state, FourierState)
            estimator.update(state, rows[:, k : k + 1])
            if (k + 1) % SOLVE_EVERY == 0:
                estimator.solve(state)
        else:
            assert isinstance(state, EkfState)
            estimator.update(state, rows[:, k : k + 1])
            if (k + 1) % SOLVE_EVERY == 0:
                estimator.solve(state)
        if k > first and (k - first) % every == 0:
            now = _read(estimator, state)
            since.append((k - first) / RATE_HZ)
            value.append([e.value for e in now])
            error.append([e.standard_error for e in now])
            converged.append([[o is Outcome.CONVERGED for o in e.outcomes] for e in now])
    return Course(np.array(since), np.array(value), np.array(error), np.array(converged))


def time_from(since_s: Array, holds: NDArray[np.bool_]) -> Array:
    """First time from which something holds to the end, along the first axis; infinite where it does not at the end."""
    kept = np.flip(np.minimum.accumulate(np.flip(holds, 0), 0), 0)
    return np.where(kept[-1], since_s[np.argmax(kept, axis=0)], np.inf)


def _table(plant: Plant, name: str, course: Course, truth: Array) -> None:
    cycle = cycle_s(plant)
    error = (course.value - truth) / np.abs(truth)
    inside = np.abs(course.value - truth) <= Z_95 * course.standard_error
    to_5 = np.median(time_from(course.since_s, np.abs(error) <= WITHIN), axis=0)
    claimed = np.median(time_from(course.since_s, course.converged), axis=0)
    print(f"  {name}")
    _line("  s to within 5 %, for good", to_5)
    _line("  s to `converged`, for good", claimed)
    for cycles in (1.0, 2.0, 4.0):
        at = int(np.argmin(np.abs(course.since_s - cycles * cycle)))
        _line(f"  after {cycles:g}: rms error, %", 100.0 * np.sqrt(np.mean(error[at] ** 2, axis=0)))
        _line(f"  after {cycles:g}: inside 95 %, %", 100.0 * inside[at].mean(axis=0))
    _line("  inside, first 4 cycles, %", 100.0 * inside[course.since_s <= 4.0 * cycle].mean(axis=(0, 1)))
    called = course.converged[course.since_s <= 4.0 * cycle]
    share = inside[course.since_s <= 4.0 * cycle]
    with np.errstate(invalid="ignore"):
        _line(
            "  ... while `converged`, %", 100.0 * (share & called).sum(axis=(0, 1)) / called.sum(axis=(0, 1))
        )


def _line(label: str, cells: Array) -> None:
    print(f"  {label:<34}" + "".join(f"{c:10.2f}" if np.isfinite(c) else f"{'-':>10}" for c in cells))


def main() -> None:
    parser = argparse.ArgumentParser(description="How soon after the first input the estimates are right.")
    parser.add_argument("--seeds", type=int, default=20, help="noisy records a plant, at least 1")
    seeds = parser.parse_args().seeds
    if seeds < 1:
        parser.error(f"--seeds is {seeds}; give at least 1")
    for plant in PLANTS:
        surface = doublets(plant)
        states = linear_response(plant.structure, plant.by_symbol, surface, 1.0 / RATE_HZ)
        for records, what in ((0, "no noise"), (seeds, f"signal-to-noise 5, {seeds} seeds, medians")):
            print(
                f"\n{plant.structure.name}: {what}; a cycle is {cycle_s(plant):.2f} s, first input at {START_S:g} s"
            )
            print(" " * 36 + "".join(f"{s:>10}" for s in plant.structure.derivatives))
            rows = rows_of(plant, states, surface, records)
            for estimator in estimators(plant):
                course = follow(estimator, rows, every=5 if records else 1)
                _table(plant, estimator.name, course, np.array(plant.truth))


if __name__ == "__main__":
    run_benchmark(main)
