"""Whitened sums of all windows at a point, and what belongs to one window taken out of them.

Every version of the model has its own filter (``innovations``): with e(theta) the innovations of its replay by its own
filter, psi = -d(e)/d(theta) by differences, so that what a gust does to the outputs is predicted by the version that is
judged. Standard deviations are those of the model at hand. What belongs to one window, its start and its trims, is
eliminated there:

    H = sum over windows (H_tt - H_tl H_ll^-1 H_lt),   g likewise.                                             (4)
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.innovations import (
    Change,
    Filter,
    Mask,
    change_of,
    kalman_filter,
    sensitivities,
    whiten,
)
from wingwatch.diagnosis.linear_model import LinearModel
from wingwatch.diagnosis.problem import WORKERS, Point, Problem, linear_at, model_at
from wingwatch.diagnosis.replay import DELAY, SCALE, Model, without_delays
from wingwatch.diagnosis.windows import (
    START_STEPS,
    all_seen,
    residual_of,
    seen_in,
    simulate,
    with_own_columns,
)

__all__ = ["Evaluation", "Reduced", "evaluate", "own_offset", "own_prior", "reduce"]

Array = NDArray[np.float64]

_START_SPREAD = np.array([3.0, 3.0, 3.0, 0.1, 0.1, 0.1, 0.1, 0.1])
"""How far a window's start may be from what its first samples say."""

_TRIM_SPREAD = np.array([1.0, 0.3, 0.05, 0.2, 0.05, 0.3])
_BLOCK_S = 2.0


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Sums of whitened products at a point; columns: residual, what is the window's own, parameters.

    Attributes:
        blocks: of each window, (blocks, columns, columns).
        deviations: standard deviations of the innovations that they were divided by, of each window, (samples, used).
        readings: how many innovations.
    """

    blocks: tuple[Array, ...]
    deviations: tuple[Array, ...]
    readings: int

    @property
    def log_spread(self) -> float:
        """Sum of the ln of standard deviations; not a number where the simulation runs away."""
        return float(sum(np.log(d).sum() for d in self.deviations))


def _versions(problem: Problem, point: Point, further: Sequence[Candidate]) -> tuple[list[Model], Array]:
    """The model at a point, then one step along each parameter; the steps."""
    base = model_at(problem, point)
    models, steps = [base], []
    for i, cause in enumerate(point.causes):
        for j, parameter in enumerate(cause.parameters):
            at = [v.copy() for v in point.values]
            step = parameter.step if at[i][j] + parameter.step <= parameter.high else -parameter.step
            at[i][j] += step
            models.append(model_at(problem, replace(point, values=tuple(at))))
            steps.append(step)
    for cause in further:
        for j, parameter in enumerate(cause.parameters):
            model, values = base.copy(), np.zeros(len(cause.parameters))
            values[j] = parameter.step
            cause.change(model, values)
            models.append(model)
            steps.append(parameter.step)
    return models, np.array(steps)


@dataclass(frozen=True, slots=True)
class _Versions:
    """The model at a point, then one step along each parameter.

    Attributes:
        linear: equation (1) of each by group; None: as of the first.
        filters: of the first by group, and its changes, where no reading is missing.
    """

    models: list[Model]
    steps: Array
    measured: Array
    linear: dict[int, list[LinearModel | None]]
    filters: dict[int, tuple[Filter, Change]]


def _prepared(problem: Problem, point: Point, models: list[Model], steps: Array) -> _Versions:
    def of_group(group: int) -> tuple[list[LinearModel | None], tuple[Filter, Change]]:
        base = models[0]
        linear: list[LinearModel | None] = [linear_at(problem, group, base, point.noise)]
        for model in models[1:]:
            same = np.array_equal(model.row, base.row)
            same = same and np.array_equal(model.sensors[:, SCALE], base.sensors[:, SCALE])
            linear.append(None if same else linear_at(problem, group, model, point.noise))
        return linear, _filters(problem, point, linear, steps, all_seen(problem, group))

    groups = tuple(dict.fromkeys(problem.groups))
    with ThreadPoolExecutor(WORKERS) as pool:
        found = dict(zip(groups, pool.map(of_group, groups), strict=True))
    measured = without_delays(problem.subject.flight, models[0])
    return _Versions(
        models, steps, measured, {g: f[0] for g, f in found.items()}, {g: f[1] for g, f in found.items()}
    )


def _filters(
    problem: Problem, point: Point, linear: Sequence[LinearModel | None], steps: Array, seen: Mask
) -> tuple[Filter, Change]:
    """Filter of the first version, and its changes."""
    assert linear[0] is not None
    base = kalman_filter(linear[0], point.noise, problem.used, seen)
    others = [
        None if one is None else kalman_filter(one, point.noise, problem.used, seen, base)
        for one in linear[1:]
    ]
    return base, change_of(base, others, steps)


def _innovations(
    problem: Problem, point: Point, w: int, versions: _Versions, weights: Array | None
) -> tuple[Array, Array]:
    """Whitened residual, own columns, parameters' columns (samples, used, columns), and what they were divided by."""
    base, group, used = versions.models[0], problem.groups[w], list(problem.used)
    seen, filters = seen_in(problem, w, versions.measured), versions.filters[group]
    if not np.array_equal(seen, all_seen(problem, group)[: len(seen)]):
        filters = _filters(problem, point, versions.linear[group], versions.steps, seen)
    filtering, change = filters
    read = simulate(problem, point, w, versions.models)
    own = point.own[w]
    runs_away = [not bool(np.isfinite(one).all()) for one in read]
    read = np.nan_to_num(read)
    linear = [one or filtering.linear for one in versions.linear[group]]
    residual = np.array([
        residual_of(problem, point, w, versions.measured, its, one)
        for its, one in zip(read, linear, strict=True)
    ])  # fmt: skip
    path = whiten(filtering, residual[0], seen)
    by_theta = (residual[1:] - residual[0]) / versions.steps[:, None, None]
    slope = _predicted_slope(problem, w, versions.measured, path.innovations)
    for i, model in enumerate(versions.models[1:]):
        late = model.sensors[used, DELAY] - base.sensors[used, DELAY]
        if late.any():
            by_theta[i] += late * slope / versions.steps[i]
    columns = np.concatenate([-own[:, used], np.moveaxis(by_theta, 0, -1)], axis=-1)
    psi = -sensitivities(filtering, path, change, columns)
    deviation = path.deviation if weights is None else weights
    white = np.concatenate([path.innovations[..., None], psi], axis=-1) / deviation[..., None]
    white[..., [own.shape[-1] + i for i in range(1, len(read)) if runs_away[i]]] = np.nan
    if runs_away[0]:
        white[..., 0] = np.nan
    return white, deviation


def _predicted_slope(problem: Problem, w: int, measured: Array, innovations: Array) -> Array:
    """Time derivative of the outputs as predicted from the past, (samples, used): what a small delay takes away.

    The measured one would hold the noise's own derivative, which a delay moves but does not change.
    """
    window = problem.windows[w]
    slope = np.zeros_like(innovations)
    predicted = measured[window.start : window.stop, list(problem.used)] - innovations
    slope[1:] = np.nan_to_num(np.diff(predicted, axis=0)) / problem.inputs[w].dt
    return slope


@np.errstate(all="ignore")  # what runs away is told by its numbers
def _of_window(
    problem: Problem, point: Point, w: int, versions: _Versions, weights: Array | None
) -> tuple[Array, Array, int]:
    white, deviation = _innovations(problem, point, w, versions, weights)
    width = white.shape[-1]
    known = np.array([bool(np.isfinite(white[..., c]).all()) for c in range(width)])
    if not known[: 1 + own_count(problem)].all():
        return np.full((1, width, width), np.nan), np.full_like(deviation, np.nan), 0
    white[..., ~known] = 0.0  # a version that runs away in this window says nothing here
    count = max(1, round(len(white) * problem.inputs[w].dt / _BLOCK_S))
    cuts = np.linspace(0, len(white), count + 1).round().astype(int)
    blocks = np.empty((count, width, width))
    for b in range(count):
        rows = white[cuts[b] : cuts[b + 1]].reshape(-1, width)
        blocks[b] = rows.T @ rows
    return blocks, deviation, int((white[..., 0] != 0.0).sum())


def evaluate(
    problem: Problem,
    point: Point,
    further: Sequence[Candidate] = (),
    weights: Sequence[Array] | None = None,
) -> Evaluation:
    """Sums at a point.

    Args:
        problem: the flight.
        point: the model; its own columns are computed if it has none.
        further: candidates that get columns beside the parameters in the model.
        weights: standard deviations to divide by, of each window (samples, used); without them the point's own.
    """
    point = point if point.own else with_own_columns(problem, point)
    models, steps = _versions(problem, point, further)
    versions = _prepared(problem, point, models, steps)

    def of_window(w: int) -> tuple[Array, Array, int]:
        return _of_window(problem, point, w, versions, None if weights is None else weights[w])

    with ThreadPoolExecutor(WORKERS) as pool:
        parts = list(pool.map(of_window, range(len(problem.inputs))))
    return Evaluation(tuple(p[0] for p in parts), tuple(p[1] for p in parts), sum(p[2] for p in parts))


def own_count(problem: Problem) -> int:
    """Parameters that a window has of its own."""
    return len(START_STEPS) + len(problem.free_trims)


def own_prior(problem: Problem) -> Array:
    """Information that is known of a window's own parameters beforehand: nearly none."""
    return np.asarray(np.concatenate([_START_SPREAD, _TRIM_SPREAD[list(problem.free_trims)]]) ** -2.0)


@dataclass(frozen=True, slots=True)
class Reduced:
    """Equation (4): cost, gradient downwards, information of the parameters; and what each window's own would move.

    Attributes:
        cost: minus log-likelihood, own parameters at their best.
        score, information: (parameters,), (parameters, parameters).
        scatter: sum over blocks of outer products of their scores at the best parameters; blocks: how many.
        own: per window: (move at no change of parameters (own,), and by parameters (own, parameters)).
    """

    cost: float
    score: Array
    information: Array
    block_scores: Array
    block_information: Array
    own: tuple[tuple[Array, Array], ...]


def own_offset(problem: Problem, point: Point, w: int) -> Array:
    """What a window has of its own, less what was known of it beforehand."""
    free = list(problem.free_trims)
    return np.concatenate(
        [point.starts[w] - problem.starts[w], point.trims[w, free] - problem.trims[w, free]]
    )


def reduce(problem: Problem, point: Point, evaluation: Evaluation) -> Reduced:
    """Eliminate what belongs to one window."""
    n, prior = own_count(problem), own_prior(problem)
    size = evaluation.blocks[0].shape[-1] - 1 - n
    cost, score, information = evaluation.log_spread, np.zeros(size), np.zeros((size, size))
    block_scores, block_information, own = [], [], []
    for w, blocks in enumerate(evaluation.blocks):
        total, off = blocks.sum(axis=0), own_offset(problem, point, w)
        inverse = np.linalg.inv(total[1 : n + 1, 1 : n + 1] + np.diag(prior))
        to_start, by_theta = (
            inverse @ (total[1 : n + 1, 0] - prior * off),
            inverse @ total[1 : n + 1, n + 1 :],
        )
        cost += 0.5 * float(total[0, 0] + prior @ off**2 - (total[0, 1 : n + 1] - prior * off) @ to_start)
        score += total[n + 1 :, 0] - total[n + 1 :, 1 : n + 1] @ to_start
        information += total[n + 1 :, n + 1 :] - total[n + 1 :, 1 : n + 1] @ by_theta
        own.append((to_start, by_theta))
        # of a block: its rows with the window's own taken out
        e = blocks[:, n + 1 :, 0] - blocks[:, n + 1 :, 1 : n + 1] @ to_start
        e -= (blocks[:, 1 : n + 1, 0] - blocks[:, 1 : n + 1, 1 : n + 1] @ to_start) @ by_theta
        h = blocks[:, n + 1 :, n + 1 :] - blocks[:, n + 1 :, 1 : n + 1] @ by_theta
        h = h - np.swapaxes(blocks[:, n + 1 :, 1 : n + 1] @ by_theta, 1, 2)
        h += np.swapaxes(by_theta, 0, 1) @ blocks[:, 1 : n + 1, 1 : n + 1] @ by_theta
        block_scores.append(e)
        block_information.append(h)
    return Reduced(
        cost, score, 0.5 * (information + information.T), np.concatenate(block_scores),
        np.concatenate(block_information), tuple(own),
    )  # fmt: skip
