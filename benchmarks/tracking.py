"""A derivative that changes in flight is followed, and ten hours of quiet flight change nothing.

First a step of 20 % in the surface's moment (m_eta, n_zeta) of the plants of ``reference_plant``, flown at
signal-to-noise 5 with a 2-degree doublet every 2 s: how far each derivative is from its truth after the step, beside
the same records without a step. Then excited flight followed by ten hours of quiet flight at 50 Hz with sensor noise.

Run: python benchmarks/tracking.py [--seeds 10] [--hours 10]
"""

import argparse
from dataclasses import dataclass, fields

import numpy as np
from convergence import Z_95, Course, doublets, estimators, follow, time_from
from numpy.typing import NDArray
from reference_plant import PLANTS, RATE_HZ, SOLVE_EVERY, Plant, noise_std, signals
from saving import run_benchmark

from wingwatch.estimators import (
    EkfEstimator,
    EkfState,
    Estimate,
    FourierEstimator,
    FourierState,
    Outcome,
)
from wingwatch.estimators.ekf.state import arrays_of
from wingwatch.simulation import linear_response

Array = NDArray[np.float64]

DURATION_S, STEP_S, EVERY_S = 75.0, 50.0, 2.0
STEP = -0.20
CHANGED = 5
"""Place of the surface's moment, m_eta or n_zeta, in both structures."""
QUIET_CHUNK_S = 600.0


@dataclass(frozen=True, slots=True)
class Quiet:
    """What quiet flight did to one estimator, (vehicles, derivatives) where not said otherwise.

    Attributes:
        hidden_s: time from the end of excitation until the mode is called not observable, (vehicles,).
        drift: largest distance of any estimate from the last excited one, in its 95 % half-widths then.
        outside: share of readings whose value lies outside the last excited 95 % interval.
        claimed: share of readings in which any derivative is claimed.
        growth: per name of the state, largest magnitude at the end over that after the first ten quiet minutes.
    """

    hidden_s: Array
    drift: Array
    outside: Array
    claimed: float
    growth: dict[str, float]


def stepped_truth(plant: Plant) -> Array:
    """Truth after the step, (6,)."""
    truth = np.array(plant.truth)
    truth[CHANGED] *= 1.0 + STEP
    return truth


def step_states(plant: Plant, surface: Array, stepped: bool) -> Array:
    """States (samples, 2) of a plant whose moment derivative changes at ``STEP_S``, exact."""
    at = round(STEP_S * RATE_HZ)
    before = linear_response(plant.structure, plant.by_symbol, surface[: at + 1], 1.0 / RATE_HZ)
    later = dict(
        zip(plant.structure.derivatives, (stepped_truth(plant) if stepped else plant.truth), strict=True)
    )
    after = linear_response(plant.structure, later, surface[at:], 1.0 / RATE_HZ, before[-1])
    return np.concatenate([before[:-1], after])


def noisy_rows(plant: Plant, states: Array, surface: Array, seeds: int) -> Array:
    """Signal rows (seeds, samples, columns) at signal-to-noise 5 of the reference record."""
    noise = np.stack([np.random.default_rng(s).standard_normal(states.shape) for s in range(seeds)])
    return signals(plant, states + noise_std(plant) * noise, surface)


def follow_step(plant: Plant, seeds: int, stepped: bool) -> dict[str, Course]:
    """Both estimators' courses from the step on, by name."""
    surface = doublets(plant, DURATION_S, 6.0, EVERY_S)
    rows = noisy_rows(plant, step_states(plant, surface, stepped), surface, seeds)
    found = {e.name: follow(e, rows, STEP_S, every=SOLVE_EVERY) for e in estimators(plant)}
    return {**found, "ekf, reset by fourier as in the live chain": follow_supervised(plant, rows)}


def follow_supervised(plant: Plant, rows: Array) -> Course:
    """The filter's course from the step on where the Fourier estimator tells it which derivatives have changed."""
    fourier, ekf = estimators(plant)
    sums, state = fourier.init(len(rows)), ekf.init(len(rows))
    since, read = [], []
    for k in range(0, rows.shape[1], SOLVE_EVERY):
        piece = rows[:, k : k + SOLVE_EVERY]
        fourier.update(sums, piece)
        fourier.solve(sums)
        ekf.update(state, piece)
        ekf.solve(state)
        for i in range(len(rows)):
            ekf.release(state, fourier.changed(sums, np.array([i]))[0], i, fourier.block_start_s(sums, i))
        if piece[0, -1, 0] > rows[0, 0, 0] + STEP_S:
            since.append(float(piece[0, -1, 0] - rows[0, 0, 0]) - STEP_S)
            read.append([ekf.estimate(state, i) for i in range(len(rows))])
    return Course(
        np.array(since),
        np.array([[e.value for e in now] for now in read]),
        np.array([[e.standard_error for e in now] for now in read]),
        np.array([[[o is Outcome.CONVERGED for o in e.outcomes] for e in now] for now in read]),
    )


def quiet_flight(
    plant: Plant, estimator: FourierEstimator | EkfEstimator, hours: float, vehicles: int
) -> Quiet:
    """Thirty seconds of doublets, then quiet flight with sensor noise; solved and read at 2 Hz."""
    surface = doublets(plant, 30.0, 6.0, EVERY_S)
    excited = step_states(plant, np.concatenate([surface, np.zeros(round(45.0 * RATE_HZ))]), False)[
        : surface.size
    ]
    state: FourierState | EkfState = estimator.init(vehicles)
    rng, std = np.random.default_rng(4), noise_std(plant)
    rows = signals(plant, excited + std * rng.standard_normal((vehicles, surface.size, 2)), surface)
    _run(estimator, state, rows, [])
    last = [estimator.estimate(state, i) for i in range(vehicles)]  # type: ignore[arg-type]
    value, half = np.array([e.value for e in last]), Z_95 * np.array([e.standard_error for e in last])
    drift, outside, stands, count = np.zeros_like(value), np.zeros_like(value), 0, 0
    hidden_s, early = np.full(vehicles, np.inf), {}
    chunk = round(QUIET_CHUNK_S * RATE_HZ)
    still = np.zeros(chunk)
    for k in range(round(hours * 3600.0 / QUIET_CHUNK_S)):
        rows = signals(plant, std * rng.standard_normal((vehicles, chunk, 2)), still)
        rows[..., 0] += 30.0 + k * QUIET_CHUNK_S
        readings: list[list[Estimate]] = []
        _run(estimator, state, rows, readings)
        for j, reading in enumerate(readings):
            now = np.array([e.value for e in reading])
            drift = np.maximum(drift, np.abs(now - value) / half)
            outside += np.abs(now - value) > half
            since = k * QUIET_CHUNK_S + (j + 1) * SOLVE_EVERY / RATE_HZ
            if since > 10.0:
                stands += sum(any(o is not Outcome.NOT_OBSERVABLE for o in e.outcomes) for e in reading)
                count += vehicles
            for i, e in enumerate(reading):
                if e.outcome is not Outcome.NOT_OBSERVABLE:
                    hidden_s[i] = np.inf
                elif np.isinf(hidden_s[i]):
                    hidden_s[i] = since
        if k == 0:
            early = _sizes(state)
    readings_taken = max(count, 1)
    growth = {
        n: s / max(early[n], 1e-300) for n, s in _sizes(state).items() if n not in ("counts", "rows", "clock")
    }
    return Quiet(
        hidden_s, drift, outside / (hours * 3600.0 * RATE_HZ / SOLVE_EVERY), stands / readings_taken, growth
    )


def _run(
    estimator: FourierEstimator | EkfEstimator,
    state: FourierState | EkfState,
    rows: Array,
    into: list[list[Estimate]],
) -> None:
    for k in range(0, rows.shape[1], SOLVE_EVERY):
        estimator.update(state, rows[:, k : k + SOLVE_EVERY])  # type: ignore[arg-type]
        estimator.solve(state)  # type: ignore[arg-type]
        into.append([estimator.estimate(state, i) for i in range(rows.shape[0])])  # type: ignore[arg-type]


def _sizes(state: FourierState | EkfState) -> dict[str, float]:
    """Largest finite magnitude of every array of a state."""
    arrays = (
        dict(arrays_of(state))
        if isinstance(state, EkfState)
        else {f.name: getattr(state, f.name) for f in fields(state)}
    )
    sizes = {}
    for name, array in arrays.items():
        array = np.abs(array)
        sizes[name] = float(np.max(array, where=np.isfinite(array), initial=0.0))
    return sizes


def _line(label: str, cells: Array) -> None:
    print(f"  {label:<34}" + "".join(f"{c:10.2f}" if np.isfinite(c) else f"{'-':>10}" for c in cells))


def _print_step(plant: Plant, seeds: int) -> None:
    symbols = plant.structure.derivatives
    print(f"\n{plant.structure.name}: {symbols[CHANGED]} {100 * STEP:+.0f} % at {STEP_S:g} s; {seeds} seeds")
    print(" " * 36 + "".join(f"{s:>10}" for s in symbols))
    calm, moved = follow_step(plant, seeds, False), follow_step(plant, seeds, True)
    for name, course in moved.items():
        truth = stepped_truth(plant)
        miss = course.value - truth
        print(f"  {name}")
        near = np.abs(miss[..., CHANGED] / truth[CHANGED]) <= 0.05
        to = time_from(course.since_s, near)
        print(
            f"    within 5 % of the new value, for good: median {np.median(to):.1f} s, last {np.max(to):.1f} s"
        )
        for after in (1.0, 2.0, 3.0, 6.0, 12.0):
            at = int(np.argmin(np.abs(course.since_s - after)))
            _line(f"  {after:g} s: rms error, %", 100.0 * np.sqrt(np.mean((miss[at] / truth) ** 2, axis=0)))
        scores = np.abs(miss) / course.standard_error
        quiet = np.abs(calm[name].value - np.array(plant.truth)) / calm[name].standard_error
        _line("  inside 95 %, 3 s on, %", 100.0 * (scores[course.since_s >= 3.0] <= Z_95).mean(axis=(0, 1)))
        _line(
            "  the same without a step, %", 100.0 * (quiet[course.since_s >= 3.0] <= Z_95).mean(axis=(0, 1))
        )
        _line("  largest error / stated error", scores.max(axis=(0, 1)))
        _line("  the same without a step", quiet.max(axis=(0, 1)))


def _print_quiet(plant: Plant, hours: float) -> None:
    symbols = plant.structure.derivatives
    print(
        f"\n{plant.structure.name}: {hours:g} h of quiet flight at 50 Hz after 24 s of doublets, 2 vehicles"
    )
    print(" " * 36 + "".join(f"{s:>10}" for s in symbols))
    for estimator in estimators(plant):
        found = quiet_flight(plant, estimator, hours, 2)
        print(f"  {estimator.name}")
        _line("  largest drift / 95 % half-width", found.drift.max(axis=0))
        _line("  readings outside it, %", 100.0 * found.outside.mean(axis=0))
        print(f"    not observable, for good, after {found.hidden_s.max():.1f} s;", end=" ")
        print(f"later than 10 s some derivative is claimed in {100.0 * found.claimed:.2f} % of readings")
        grown = {n: g for n, g in found.growth.items() if g > 1.05}
        print(
            "    grown since the first ten minutes: "
            + (", ".join(f"{n} {g:.2f}" for n, g in grown.items()) or "none")
        )


def main() -> None:
    parser = argparse.ArgumentParser(description="Following a change, and keeping still in quiet flight.")
    parser.add_argument("--seeds", type=int, default=10, help="noisy records a plant")
    parser.add_argument("--hours", type=float, default=10.0, help="of quiet flight; 0 for none")
    chosen = parser.parse_args()
    if chosen.seeds < 1 or chosen.hours < 0.0:
        parser.error("give at least 1 seed and no fewer than 0 hours")
    for plant in PLANTS:
        _print_step(plant, chosen.seeds)
    if chosen.hours > 0.0:
        for plant in PLANTS:
            _print_quiet(plant, chosen.hours)


if __name__ == "__main__":
    run_benchmark(main)
