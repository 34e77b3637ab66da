"""Innovations of all windows at a point, summed; and what belongs to one window taken out of the sums.

Every version of the model has its own filter (``innovations``). With e(theta) the innovations by it, psi =
-d(e)/d(theta) by differences, so that what a gust does to the outputs is predicted by the version that is judged. What
belongs to one window, its trims, is eliminated there:

    H = sum over windows (H_tt - H_tl H_ll^-1 H_lt),   g likewise.                                             (4)
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.innovations import Filter, Mask, Path, kalman_filter
from wingwatch.diagnosis.linear_model import LinearModel
from wingwatch.diagnosis.problem import WORKERS, Point, Problem, linear_at, model_at
from wingwatch.diagnosis.replay import DELAY, SCALE, TRIM_STEPS, Model, smoothed, without_delays
from wingwatch.diagnosis.windows import all_seen, fly_filtered, seen_in

__all__ = [
    "Evaluation",
    "Reduced",
    "block_cuts",
    "evaluate",
    "own_count",
    "own_offset",
    "own_prior",
    "reduce",
]

Array = NDArray[np.float64]

Columns = Callable[[int, Filter, Path], Array]
"""Of a window, its filter and its path: what further terms take from the innovations, (samples, used, terms)."""

_TRIM_SPREAD = np.array([1.0, 0.3, 0.05, 0.2, 0.05, 1.0])
_BLOCK_S = 2.0


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Sums of whitened products at a point; columns: residual, what is the window's own, parameters.

    Attributes:
        blocks: of each window, (blocks, columns, columns).
        deviations: standard deviations of the innovations that they were divided by, of each window, (samples, used).
        readings: how many innovations.
        own: of each window, what its free trims take from the innovations, (samples, used, trims).
        unweighted: the same by the point's own standard deviations, where others were asked for.
    """

    blocks: tuple[Array, ...]
    deviations: tuple[Array, ...]
    readings: int
    own: tuple[Array, ...]
    unweighted: "Evaluation | None" = None

    def with_columns(self, kept: Sequence[int]) -> "Evaluation":
        """With some of the columns."""
        blocks = tuple(np.ascontiguousarray(b[:, kept][:, :, kept]) for b in self.blocks)
        return replace(self, blocks=blocks, unweighted=None)

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
        measured: the flight's outputs at the times that they are of by each, (samples, outputs).
        slopes: of the outputs that are later by some version, (samples, outputs).
        linear: equation (1) of each by group; None: as of the first.
        filters: of each by group, where no reading is missing.
    """

    models: list[Model]
    steps: Array
    measured: Array
    slopes: Array
    linear: dict[int, list[LinearModel | None]]
    filters: dict[int, list[Filter]]


def _prepared(problem: Problem, point: Point, models: list[Model], steps: Array) -> _Versions:
    def of_group(group: int) -> tuple[list[LinearModel | None], list[Filter]]:
        base = models[0]
        linear: list[LinearModel | None] = [linear_at(problem, group, base, point.noise)]
        for model in models[1:]:
            same = np.array_equal(model.row, base.row)
            same = same and np.array_equal(model.sensors[:, SCALE], base.sensors[:, SCALE])
            linear.append(None if same else linear_at(problem, group, model, point.noise))
        return linear, _filters(problem, point, linear, all_seen(problem, group))

    groups = tuple(dict.fromkeys(problem.groups))
    with ThreadPoolExecutor(WORKERS) as pool:
        found = dict(zip(groups, pool.map(of_group, groups), strict=True))
    measured = without_delays(problem.subject.flight, models[0])
    late = np.zeros(len(models[0].sensors), dtype=np.bool_)
    for model in models[1:]:
        late |= model.sensors[:, DELAY] != models[0].sensors[:, DELAY]
    linear, filters = {g: f[0] for g, f in found.items()}, {g: f[1] for g, f in found.items()}
    return _Versions(models, steps, measured, _slopes(problem, measured, late), linear, filters)


def _filters(
    problem: Problem, point: Point, linear: Sequence[LinearModel | None], seen: Mask
) -> list[Filter]:
    """Of every version."""
    assert linear[0] is not None
    base = kalman_filter(linear[0], point.noise, problem.used, seen)
    return [base, *(
        base if one is None else kalman_filter(one, point.noise, problem.used, seen, base) for one in linear[1:]
    )]  # fmt: skip


def _filters_of(problem: Problem, point: Point, w: int, versions: _Versions) -> list[Filter]:
    """Of a window, whatever readings it misses."""
    group, seen = problem.groups[w], seen_in(problem, w, versions.measured)
    if np.array_equal(seen, all_seen(problem, group)[: len(seen)]):
        return versions.filters[group]
    return _filters(problem, point, versions.linear[group], seen)


def _innovations(
    problem: Problem, point: Point, w: int, versions: _Versions, own: Array | None, columns: Columns | None
) -> tuple[Array, Array, Array, Array]:
    """Innovations, their deviations (samples, used), what free trims and what the parameters take from them.

    The last two are (samples, used, trims) and (samples, used, parameters).
    """
    filters, trims = _filters_of(problem, point, w, versions), point.trims[w]
    base = versions.models[0]
    path = fly_filtered(problem, w, base, trims, filters[0], versions.measured)
    if own is None:
        own = np.empty((*path.innovations.shape, own_count(problem)))
        for i, k in enumerate(problem.free_trims):
            moved = trims + TRIM_STEPS[k] * (np.arange(len(trims)) == k)
            changed = fly_filtered(problem, w, base, moved, filters[0], versions.measured).innovations
            own[..., i] = (path.innovations - changed) / TRIM_STEPS[k]
    psi = np.empty((*path.innovations.shape, len(versions.steps)))
    for i, (model, filtering) in enumerate(zip(versions.models[1:], filters[1:], strict=True)):
        measured, late = versions.measured, model.sensors[:, DELAY] - base.sensors[:, DELAY]
        if late.any():
            measured = measured + late * versions.slopes
        changed = fly_filtered(problem, w, model, trims, filtering, measured).innovations
        psi[..., i] = (path.innovations - changed) / versions.steps[i]
    if columns is not None:
        psi = np.concatenate([psi, columns(w, filters[0], path)], axis=-1)
    return path.innovations, path.deviation, own, psi


def _slopes(problem: Problem, measured: Array, late: NDArray[np.bool_]) -> Array:
    """Time derivative of the outputs that may be late, smoothed, (samples, outputs); 0 of the others.

    The smoothing has no phase. So the slope of white noise is not correlated with the noise itself, however the filter
    colours both, and a right delay is left where it is.
    """
    slopes = np.zeros_like(measured)
    for k in np.flatnonzero(late):
        if np.isfinite(measured[:, k]).any():
            slopes[:, k] = smoothed(measured[:, k], problem.subject.flight.dt_s, 1)
    return slopes


@np.errstate(all="ignore")
def _of_window(
    problem: Problem,
    point: Point,
    w: int,
    versions: _Versions,
    own: Array | None,
    weights: Array | None,
    columns: Columns | None,
) -> tuple[list[tuple[Array, Array, int]], Array]:
    """``_summed`` by the weights, if there are any, then by the point's own deviations; what free trims take."""
    innovations, deviation, own, psi = _innovations(problem, point, w, versions, own, columns)
    taken = np.concatenate([innovations[..., None], own, psi], axis=-1)
    by = [deviation] if weights is None else [weights, deviation]
    return [_summed(problem, w, taken, one) for one in by], own


def _summed(problem: Problem, w: int, taken: Array, deviation: Array) -> tuple[Array, Array, int]:
    """Of a window: sums of its blocks, the standard deviations, how many innovations."""
    white = taken / deviation[..., None]
    width = white.shape[-1]
    known = np.array([bool(np.isfinite(white[..., c]).all()) for c in range(width)])
    if not known[: 1 + own_count(problem)].all():
        return np.full((1, width, width), np.nan), np.full_like(deviation, np.nan), 0
    white[..., ~known] = 0.0  # a version that runs away in this window says nothing here
    cuts = block_cuts(len(white), problem.inputs[w].dt)
    blocks = np.empty((len(cuts) - 1, width, width))
    for b in range(len(blocks)):
        rows = white[cuts[b] : cuts[b + 1]].reshape(-1, width)
        blocks[b] = rows.T @ rows
    return blocks, deviation, int((white[..., 0] != 0.0).sum())


def block_cuts(samples: int, dt_s: float) -> NDArray[np.int64]:
    """First samples of the blocks of a window, then the sample after the last."""
    count = max(1, round(samples * dt_s / _BLOCK_S))
    return np.asarray(np.linspace(0, samples, count + 1).round(), dtype=np.int64)


def evaluate(
    problem: Problem,
    point: Point,
    further: Sequence[Candidate] = (),
    *,
    weights: Sequence[Array] | None = None,
    own: Sequence[Array] | None = None,
    columns: Columns | None = None,
) -> Evaluation:
    """Sums at a point.

    Args:
        problem: the flight.
        point: the model.
        further: candidates that get columns beside the parameters in the model.
        weights: standard deviations to divide by, of each window (samples, used); without them the point's own.
        own: what free trims take from the innovations at a point nearby; without them the point's own.
        columns: of a window (index, filter, path), what further terms take from its innovations, (samples, used, n).
    """
    models, steps = _versions(problem, point, further)
    versions = _prepared(problem, point, models, steps)

    def of_window(w: int) -> tuple[list[tuple[Array, Array, int]], Array]:
        known, weight = None if own is None else own[w], None if weights is None else weights[w]
        return _of_window(problem, point, w, versions, known, weight, columns)

    with ThreadPoolExecutor(WORKERS) as pool:
        parts = list(pool.map(of_window, range(len(problem.inputs))))
    trims, found = tuple(own for _, own in parts), None
    for sums in reversed(list(zip(*(by for by, _ in parts), strict=True))):
        blocks, deviations, readings = zip(*sums, strict=True)
        found = Evaluation(blocks, deviations, sum(readings), trims, found)
    assert found is not None
    return found


def own_count(problem: Problem) -> int:
    """Parameters that a window has of its own."""
    return len(problem.free_trims)


def own_prior(problem: Problem) -> Array:
    """Information that is known of a window's own parameters beforehand: nearly none."""
    return np.asarray(_TRIM_SPREAD[list(problem.free_trims)] ** -2.0)


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
    return np.asarray(point.trims[w, free] - problem.trims[w, free])


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
