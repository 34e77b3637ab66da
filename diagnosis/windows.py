"""What a version of the simulation reads in a window, and how its residual is seen by equation (1)."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.innovations import Mask, estimate_disturbance, response
from wingwatch.diagnosis.linear_model import LinearModel
from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.problem import WORKERS, Point, Problem, lead_of, linear_at, model_at
from wingwatch.diagnosis.replay import (
    AIR,
    Inputs,
    Model,
    body_state,
    fly_window,
    sense,
    without_delays,
)

__all__ = [
    "START_STEPS",
    "TRIM_STEPS",
    "all_seen",
    "residual_of",
    "seen_in",
    "simulate",
    "with_disturbance",
    "with_own_columns",
]

Array = NDArray[np.float64]

START_STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3])
TRIM_STEPS = np.array([1e-3, 1e-3, 1e-4, 1e-4, 1e-4, 1e-4])


def _inputs(problem: Problem, point: Point, w: int) -> Inputs:
    """Of a window, as disturbed as estimated."""
    disturbed, inputs = point.disturbed[w], problem.inputs[w]
    air = disturbed[:, :AIR]
    return inputs._replace(air=np.vstack([air, air[-1:]]), flown=inputs.flown + disturbed[:, AIR:])


def simulate(problem: Problem, point: Point, w: int, models: Sequence[Model]) -> Array:
    """What each version's sensors read in a window, (versions, samples, outputs)."""
    start = body_state(point.starts[w], problem.inputs[w].altitude)
    rows = np.array([m.row for m in models])
    window = problem.windows[w]
    out = np.empty((len(models), window.stop - window.start, len(OUTPUTS)))
    count = len(models)
    fly_window(
        rows, np.tile(start, (count, 1)), np.tile(point.trims[w], (count, 1)), _inputs(problem, point, w), out,
        np.empty((count, 13)),
    )  # fmt: skip
    for i, model in enumerate(models):
        out[i] = sense(out[i], model)
    return out


def with_own_columns(problem: Problem, point: Point) -> Point:
    """The point with the change of outputs with starts and trims computed anew."""
    model = model_at(problem, point)

    @np.errstate(all="ignore")  # what runs away is told by its numbers
    def of_window(w: int) -> Array:
        return _own_columns(problem, point, w, model)

    with ThreadPoolExecutor(WORKERS) as pool:
        return replace(point, own=tuple(pool.map(of_window, range(len(problem.inputs)))))


def _own_columns(problem: Problem, point: Point, w: int, base: Model) -> Array:
    """Change of the outputs with a window's start and free trims, (samples, outputs, own)."""
    altitude, free = problem.inputs[w].altitude, problem.free_trims
    count = len(START_STEPS) + len(free)
    starts = np.tile(point.starts[w], (count, 1))
    starts[: len(START_STEPS)] += np.diag(START_STEPS)
    trims = np.tile(point.trims[w], (count, 1))
    for i, k in enumerate(free):
        trims[len(START_STEPS) + i, k] += TRIM_STEPS[k]
    window = problem.windows[w]
    out = np.empty((count, window.stop - window.start, len(OUTPUTS)))
    fly_window(
        np.tile(base.row, (count, 1)), np.array([body_state(s, altitude) for s in starts]), trims,
        _inputs(problem, point, w), out, np.empty((count, 13)),
    )  # fmt: skip
    read = simulate(problem, point, w, [base])[0]
    steps = np.concatenate([START_STEPS, TRIM_STEPS[list(free)]])
    return np.asarray(np.moveaxis((sense(out, base) - read) / steps[:, None, None], 0, -1))


def residual_of(
    problem: Problem, point: Point, w: int, measured: Array, read: Array, linear: LinearModel
) -> Array:
    """Residual of a window as it would be undisturbed, (samples, used); 0 where nothing was measured."""
    window, used = problem.windows[w], list(problem.used)
    answered = response(linear, point.disturbed[w])
    residual = np.nan_to_num(measured[window.start : window.stop]) - read + answered
    return np.ascontiguousarray(residual[:, used])


def seen_in(problem: Problem, w: int, measured: Array) -> Mask:
    """Which readings of a window count, (samples, used)."""
    window = problem.windows[w]
    seen = np.isfinite(measured[window.start : window.stop, list(problem.used)])
    seen[: lead_of(problem, w)] = False
    return seen


def all_seen(problem: Problem, group: int) -> Mask:
    """Of windows of a group that miss no reading, (samples of the longest, used)."""
    alike = [w for w, g in zip(problem.windows, problem.groups, strict=True) if g == group]
    seen = np.ones((max(w.stop - w.start for w in alike), len(problem.used)), dtype=np.bool_)
    seen[: lead_of(problem, group)] = False
    return seen


def with_disturbance(problem: Problem, point: Point) -> Point:
    """The point with air and surfaces' noise estimated anew."""
    model = model_at(problem, point)
    measured = without_delays(problem.subject.flight, model)

    @np.errstate(all="ignore")
    def of_window(w: int) -> Array:
        linear = linear_at(problem, problem.groups[w], model, point.noise)
        read = simulate(problem, point, w, [model])[0]
        if not np.isfinite(read).all():
            return np.zeros_like(point.disturbed[w])
        residual = np.full_like(read, np.nan)
        residual[:, list(problem.used)] = residual_of(problem, point, w, measured, read, linear)
        window = problem.windows[w]
        residual[~np.isfinite(measured[window.start : window.stop])] = np.nan
        found = estimate_disturbance(linear, point.noise, residual, problem.used, lead_of(problem, w))
        disturbed = (*point.disturbed[:w], found, *point.disturbed[w + 1 :])
        flies = bool(np.isfinite(simulate(problem, replace(point, disturbed=disturbed), w, [model])).all())
        return found if flies else np.zeros_like(found)

    with ThreadPoolExecutor(WORKERS) as pool:
        return replace(point, disturbed=tuple(pool.map(of_window, range(len(problem.inputs)))))
