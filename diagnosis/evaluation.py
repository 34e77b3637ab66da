"""Whitened sums of all windows at a point, and what belongs to one window taken out of them.

Every version of the model has its own filter (``innovations``): with e(theta) the innovations of its replay by its own
filter, psi = -d(e)/d(theta) by differences, so that what a gust does to the outputs is predicted by the version that is
judged. Standard deviations are those of the model at hand. What belongs to one window, its start and its trims, is
eliminated there:

    H = sum over windows (H_tt - H_tl H_ll^-1 H_lt),   g likewise.                                             (2)
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.innovations import Gains, LinearModel, whiten
from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.problem import WORKERS, Point, Problem, lead_of, model_at
from wingwatch.diagnosis.replay import DELAY, SCALE, Model, without_delays
from wingwatch.diagnosis.windows import START_STEPS, filter_of, own_columns, residual_of, simulate

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
        log_spread: sum of the ln of innovations' standard deviations.
        readings: how many innovations.
    """

    blocks: tuple[Array, ...]
    log_spread: float
    readings: int


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
    """The model at a point, then one step along each parameter; equation (1) and gains of each, by group."""

    models: list[Model]
    steps: Array
    measured: Array
    filters: dict[int, list[tuple[LinearModel, Gains]]]


def _prepared(problem: Problem, point: Point, models: list[Model], steps: Array) -> _Versions:
    def filters(group: int) -> list[tuple[LinearModel, Gains]]:
        base = models[0]
        out = [filter_of(problem, point, group, base)]
        for model in models[1:]:
            same = np.array_equal(model.row, base.row)
            same = same and np.array_equal(model.sensors[:, SCALE], base.sensors[:, SCALE])
            out.append(out[0] if same else filter_of(problem, point, group, model))
        return out

    groups = tuple(dict.fromkeys(problem.groups))
    with ThreadPoolExecutor(WORKERS) as pool:
        found = dict(zip(groups, pool.map(filters, groups), strict=True))
    return _Versions(models, steps, without_delays(problem.subject.flight, models[0]), found)


def _innovations(problem: Problem, point: Point, w: int, versions: _Versions) -> tuple[Array, Array]:
    """Whitened residual, own columns, parameters' columns (readings, columns), and standard deviations (readings,)."""
    base, lead = versions.models[0], lead_of(problem, w)
    filters = versions.filters[problem.groups[w]]
    linear, gains = filters[0]
    read = simulate(problem, point, w, versions.models, linear)
    own = own_columns(problem, point, w, base, linear, read[0])
    runs_away = [not bool(np.isfinite(one).all()) for one in read]
    residual = residual_of(problem, point, w, versions.measured, np.nan_to_num(read[0]), linear)
    together = np.concatenate([residual[..., None], own], axis=-1)
    first, spread = whiten(linear, point.noise, together, problem.used, lead, gains)
    columns = [first]
    slope = _predicted_slope(problem, w, versions.measured, first[..., 0])
    for i in range(1, len(versions.models)):
        model, (its, its_gains) = versions.models[i], filters[i]
        residual = residual_of(problem, point, w, versions.measured, np.nan_to_num(read[i]), its)
        residual += (model.sensors[:, DELAY] - base.sensors[:, DELAY]) * slope
        e, _ = whiten(its, point.noise, residual[..., None], problem.used, lead, its_gains)
        columns.append((first[..., :1] - e) / versions.steps[i - 1])
    white = np.concatenate(columns, axis=-1) / spread[..., None]
    white[..., [own.shape[-1] + i for i in range(1, len(read)) if runs_away[i]]] = np.nan
    if runs_away[0]:
        white[..., 0] = np.nan
    return white, spread


def _predicted_slope(problem: Problem, w: int, measured: Array, innovations: Array) -> Array:
    """Time derivative of the outputs as predicted from the past, (samples, outputs): what a small delay takes away.

    The measured one would hold the noise's own derivative, which a delay moves but does not change.
    """
    window, used = problem.windows[w], list(problem.used)
    slope = np.zeros((window.stop - window.start, len(OUTPUTS)))
    predicted = measured[window.start : window.stop, used] - innovations
    slope[1:, used] = np.nan_to_num(np.diff(predicted, axis=0)) / problem.inputs[w].dt
    return slope


@np.errstate(all="ignore")  # what runs away is told by its numbers
def _of_window(problem: Problem, point: Point, w: int, versions: _Versions) -> tuple[Array, float, int]:
    white, spread = _innovations(problem, point, w, versions)
    width = white.shape[-1]
    known = np.array([bool(np.isfinite(white[..., c]).all()) for c in range(width)])
    if not known[: 1 + own_count(problem)].all():
        return np.full((1, width, width), np.nan), np.nan, 0
    white[..., ~known] = 0.0  # a version that runs away in this window says nothing here
    count = max(1, round(len(white) * problem.inputs[w].dt / _BLOCK_S))
    cuts = np.linspace(0, len(white), count + 1).round().astype(int)
    blocks = np.empty((count, width, width))
    for b in range(count):
        rows = white[cuts[b] : cuts[b + 1]].reshape(-1, width)
        blocks[b] = rows.T @ rows
    return blocks, float(np.log(spread).sum()), int((white[..., 0] != 0.0).sum())


def evaluate(problem: Problem, point: Point, further: Sequence[Candidate] = ()) -> Evaluation:
    """Sums at a point, with columns for the parameters in the model and for further candidates."""
    models, steps = _versions(problem, point, further)
    versions = _prepared(problem, point, models, steps)
    with ThreadPoolExecutor(WORKERS) as pool:
        parts = list(pool.map(lambda w: _of_window(problem, point, w, versions), range(len(problem.inputs))))
    return Evaluation(tuple(p[0] for p in parts), float(sum(p[1] for p in parts)), sum(p[2] for p in parts))


def own_count(problem: Problem) -> int:
    """Parameters that a window has of its own."""
    return len(START_STEPS) + len(problem.free_trims)


def own_prior(problem: Problem) -> Array:
    """Information that is known of a window's own parameters beforehand: nearly none."""
    return np.asarray(np.concatenate([_START_SPREAD, _TRIM_SPREAD[list(problem.free_trims)]]) ** -2.0)


@dataclass(frozen=True, slots=True)
class Reduced:
    """Equation (2): cost, gradient downwards, information of the parameters; and what each window's own would move.

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
