"""What a version of the simulation reads in a window, and how its residual is seen by equation (1)."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.innovations import Gains, LinearModel, air_response, estimate_air, settled_gains
from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.problem import WORKERS, Point, Problem, lead_of, linear_at, model_at
from wingwatch.diagnosis.replay import AIR, Inputs, Model, body_state, fly_window, sense, without_delays

__all__ = ["START_STEPS", "TRIM_STEPS", "filter_of", "own_columns", "residual_of", "simulate", "with_air"]

Array = NDArray[np.float64]

START_STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3])
TRIM_STEPS = np.array([1e-3, 1e-3, 1e-4, 1e-4, 1e-4, 1e-4])


def _inputs(problem: Problem, point: Point, w: int, linear: LinearModel) -> Inputs:
    """Of a window, through the air as estimated."""
    air = point.air[w] @ linear.air[:, -AIR:].T
    return problem.inputs[w]._replace(air=np.vstack([air, air[-1:]]))


def simulate(problem: Problem, point: Point, w: int, models: Sequence[Model], linear: LinearModel) -> Array:
    """What each version's sensors read in a window, (versions, samples, outputs)."""
    start = body_state(point.starts[w], problem.inputs[w].altitude)
    rows = np.array([m.row for m in models])
    window = problem.windows[w]
    out = np.empty((len(models), window.stop - window.start, len(OUTPUTS)))
    count = len(models)
    fly_window(
        rows, np.tile(start, (count, 1)), np.tile(point.trims[w], (count, 1)), _inputs(problem, point, w, linear), out,
        np.empty((count, 13)),
    )  # fmt: skip
    for i, model in enumerate(models):
        out[i] = sense(out[i], model)
    return out


def own_columns(
    problem: Problem, point: Point, w: int, base: Model, linear: LinearModel, read: Array
) -> Array:
    """Change of the outputs with a window's start and free trims, (samples, outputs, own)."""
    altitude, free = problem.inputs[w].altitude, problem.free_trims
    count = len(START_STEPS) + len(free)
    starts = np.tile(point.starts[w], (count, 1))
    starts[: len(START_STEPS)] += np.diag(START_STEPS)
    trims = np.tile(point.trims[w], (count, 1))
    for i, k in enumerate(free):
        trims[len(START_STEPS) + i, k] += TRIM_STEPS[k]
    out = np.empty((count, *read.shape))
    fly_window(
        np.tile(base.row, (count, 1)), np.array([body_state(s, altitude) for s in starts]), trims,
        _inputs(problem, point, w, linear), out, np.empty((count, 13)),
    )  # fmt: skip
    steps = np.concatenate([START_STEPS, TRIM_STEPS[list(free)]])
    return np.asarray(np.moveaxis((sense(out, base) - read) / steps[:, None, None], 0, -1))


def residual_of(
    problem: Problem, point: Point, w: int, measured: Array, read: Array, linear: LinearModel
) -> Array:
    """Residual of a window (samples, outputs), as it would be without the estimated air."""
    window = problem.windows[w]
    return np.asarray(measured[window.start : window.stop] - read + air_response(linear, point.air[w]))


def filter_of(problem: Problem, point: Point, group: int, model: Model) -> tuple[LinearModel, Gains]:
    """Equation (1) of a group of windows, and its gains."""
    linear = linear_at(problem, point, group, model)
    alike = [w for w, g in zip(problem.windows, problem.groups, strict=True) if g == group]
    samples = max(w.stop - w.start for w in alike)
    return linear, settled_gains(linear, point.noise, problem.used, lead_of(problem, group), samples)


def with_air(problem: Problem, point: Point) -> Point:
    """The point with the air estimated anew."""
    model = model_at(problem, point)
    measured = without_delays(problem.subject.flight, model)

    @np.errstate(all="ignore")
    def of_window(w: int) -> Array:
        linear = linear_at(problem, point, problem.groups[w], model)
        read = simulate(problem, point, w, [model], linear)[0]
        if not np.isfinite(read).all():
            return np.zeros_like(point.air[w])
        residual = residual_of(problem, point, w, measured, read, linear)
        found = estimate_air(linear, point.noise, residual, problem.used, lead_of(problem, w))
        blown = replace(point, air=(*point.air[:w], found, *point.air[w + 1 :]))
        flies = bool(np.isfinite(simulate(problem, blown, w, [model], linear)).all())
        return found if flies else np.zeros_like(found)

    with ThreadPoolExecutor(WORKERS) as pool:
        return replace(point, air=tuple(pool.map(of_window, range(len(problem.inputs)))))
