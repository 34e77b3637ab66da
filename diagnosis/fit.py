"""Fit of a model to all windows: Gauss-Newton on whitened residuals.

Every version of the model has its own filter (``innovations``): with e(theta) the innovations of its replay by its own
filter, psi = -d(e)/d(theta) by differences, so that what a gust does to the outputs is predicted by the version that is
judged. Standard deviations are those of the model at hand. What belongs to one window, its start and its trims, is
eliminated there:

    H = sum over windows (H_tt - H_tl H_ll^-1 H_lt),   g likewise.                                             (2)

docs/methods/diagnosis.md, section 3.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate, Subject
from wingwatch.diagnosis.innovations import (
    Gains,
    LinearModel,
    Noise,
    air_response,
    estimate_air,
    fastest_rad_s,
    linear_model,
    settled_gains,
    whiten,
)
from wingwatch.diagnosis.measured import LEAD_S, OUTPUTS, Window
from wingwatch.diagnosis.replay import (
    AIR,
    DELAY,
    SCALE,
    TRIMS,
    Inputs,
    Model,
    body_state,
    fly_window,
    inputs_of,
    measured_start,
    sense,
    without_delays,
)
from wingwatch.diagnosis.trims import measured_trims

__all__ = [
    "Evaluation",
    "Point",
    "Problem",
    "Reduced",
    "RunsAwayError",
    "Solution",
    "WORKERS",
    "evaluate",
    "filter_of",
    "fit",
    "inflation",
    "lead_of",
    "linear_at",
    "model_at",
    "own_columns",
    "own_count",
    "own_fitted",
    "own_prior",
    "prepare",
    "reduce",
    "residual_of",
    "simulate",
    "with_air",
]

Array = NDArray[np.float64]

_START_STEPS = np.array([1e-2, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3])
_START_SPREAD = np.array([3.0, 3.0, 3.0, 0.1, 0.1, 0.1, 0.1, 0.1])
"""How far a window's start may be from what its first samples say."""
_TRIM_STEPS = np.array([1e-3, 1e-3, 1e-4, 1e-4, 1e-4, 1e-4])
_TRIM_SPREAD = np.array([1.0, 0.3, 0.05, 0.2, 0.05, 0.3])
_BLOCK_S = 2.0
_LARGEST_PRODUCT = 0.4
"""Of the fastest eigenvalue and a step of integration."""
WORKERS = 2
_MOST_PASSES = 6
_ENOUGH = 0.05
"""Gain of log-likelihood below which a step is not worth another pass."""


class RunsAwayError(ArithmeticError):
    """A simulation that leaves the flight so far that its numbers end."""


@dataclass(frozen=True, slots=True)
class Problem:
    """A flight cut into windows, ready to be fitted.

    Attributes:
        subject: aircraft, flight, model as stated.
        windows: of the flight.
        inputs: of each window.
        groups: which windows share equation (1), by the first of them, (windows,).
        centres: mean motion of each window's group, (windows, 8).
        starts: as the first samples of each have them, (windows, 8).
        trims: as mean forces and moments of each have them, (windows, 6).
        free_trims: which of ``TRIMS`` each window has of its own.
        used: outputs that count.
    """

    subject: Subject
    windows: tuple[Window, ...]
    inputs: tuple[Inputs, ...]
    groups: tuple[int, ...]
    centres: Array
    starts: Array
    free_trims: tuple[int, ...]
    used: tuple[int, ...]
    trims: Array

    def part(self, windows: Sequence[int]) -> "Problem":
        """Some of the windows."""
        return replace(
            self,
            inputs=tuple(self.inputs[w] for w in windows),
            windows=tuple(self.windows[w] for w in windows),
            groups=tuple([self.groups[v] for v in windows].index(self.groups[w]) for w in windows),
            centres=self.centres[list(windows)],
            starts=self.starts[list(windows)],
            trims=self.trims[list(windows)],
        )


@dataclass(frozen=True, slots=True)
class Point:
    """A model and what each window starts from.

    Attributes:
        causes: candidates that are in the model; values: of each one's parameters.
        starts: (windows, 8); trims: (windows, 6).
        noise: standard deviations.
        air: estimated states of the air in each window, (samples, 8) each.
    """

    causes: tuple[Candidate, ...]
    values: tuple[Array, ...]
    starts: Array
    trims: Array
    noise: Noise
    air: tuple[Array, ...]

    def part(self, windows: Sequence[int]) -> "Point":
        """For some of the windows."""
        air = tuple(self.air[w] for w in windows)
        return replace(self, starts=self.starts[list(windows)], trims=self.trims[list(windows)], air=air)

    @property
    def theta(self) -> Array:
        """All parameters, one after another."""
        return np.concatenate([np.zeros(0), *self.values])


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


@dataclass(frozen=True, slots=True)
class Solution:
    """A fit.

    Attributes:
        point: the best.
        cost: minus log-likelihood there, less constants; without priors.
        covariance: of all parameters, for residuals as correlated as they are.
        evaluation: at the point, with columns of the model's own parameters.
    """

    point: Point
    cost: float
    covariance: Array
    evaluation: Evaluation


def _mean(rows: Array) -> Array:
    """Of each column's finite values; 0 where there is none."""
    there = np.isfinite(rows)
    return np.asarray(np.where(there, rows, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1))


def prepare(subject: Subject, noise: Noise) -> tuple[Problem, Point]:
    """Windows and what each starts from, as measured."""
    flight, row = subject.flight, subject.model.row
    free = (*(() if subject.trims_known else range(5)), *(() if subject.throttle_known else (5,)))
    inputs, centres, starts = [], [], []
    for window in flight.windows:
        start = measured_start(flight, window, row)
        mean = _mean(flight.outputs[window.start : window.stop])
        velocity = start[:3] * mean[0] / max(float(np.linalg.norm(start[:3])), 1.0)
        starts.append(start)
        centres.append(np.array([*velocity, 0.0, 0.0, 0.0, mean[7], mean[8]]))
        inputs.append(inputs_of(flight, window, 4, subject.throttle_known, subject.followed))
    count = len(starts)
    groups = _groups(np.array(centres), np.array([i.density for i in inputs]))
    centres = [
        np.mean([c for c, g in zip(centres, groups, strict=True) if g == group], axis=0) for group in groups
    ]
    problem = Problem(
        subject,
        flight.windows,
        tuple(inputs),
        groups,
        np.array(centres),
        np.array(starts),
        free,
        _used(subject),
        np.zeros((count, len(TRIMS))),
    )
    trims = np.zeros((count, len(TRIMS)))
    if free:
        found = [measured_trims(flight, w, row, i) for w, i in zip(flight.windows, inputs, strict=True)]
        trims[:, list(free)] = np.array(found)[:, list(free)]
    problem = replace(problem, trims=trims)
    air = tuple(np.zeros((w.stop - w.start, AIR)) for w in flight.windows)
    point = Point((), (), problem.starts.copy(), trims.copy(), noise, air)
    steps = [_steps(linear_at(problem, point, w, subject.model), i.dt) for w, i in enumerate(inputs)]
    return replace(
        problem, inputs=tuple(i._replace(steps=n) for i, n in zip(inputs, steps, strict=True))
    ), point


_SEEN_IN = {3: (1, 12), 6: (7,), 1: (5, 10), 5: (3, 13), 4: (2, 11), 7: (8,), 2: (6, 9), 0: (0, 4)}
"""Outputs that a state of ``START`` shows in, which say nothing of the simulation where it is followed."""


def _used(subject: Subject) -> tuple[int, ...]:
    hidden = {k for j in subject.followed for k in _SEEN_IN[j]}
    return tuple(k for k in subject.flight.compared if k not in hidden)


_ALIKE = np.array([0.04, 0.04, 0.04, 1.0, 1.0, 1.0, 0.3, 0.15])
"""Motion within which one equation (1) holds: velocities in parts of the speed, rad/s, rad."""


def _groups(centres: Array, densities: Array) -> tuple[int, ...]:
    """For each window the first one whose mean motion is alike."""
    groups: list[int] = []
    for w, centre in enumerate(centres):
        reach = _ALIKE * np.where(np.arange(8) < 3, np.linalg.norm(centre[:3]), 1.0)
        first = [
            g for g in dict.fromkeys(groups)
            if (np.abs(centres[g] - centre) < reach).all() and abs(densities[g] / densities[w] - 1.0) < 0.04
        ]  # fmt: skip
        groups.append(first[0] if first else w)
    return tuple(groups)


def _steps(linear: LinearModel, dt_s: float) -> int:
    """Steps of integration in a sample."""
    return min(max(1, int(np.ceil(fastest_rad_s(linear, dt_s) * dt_s / _LARGEST_PRODUCT))), 50)


def linear_at(problem: Problem, point: Point, w: int, model: Model) -> LinearModel:
    """Equation (1) of a model in a window."""
    span_m = problem.subject.aircraft.need_geometry("diagnosis").span_m
    linear = linear_model(model, problem.centres[w], point.trims[w], problem.inputs[w], span_m)
    return linear.without(problem.subject.followed)


def model_at(problem: Problem, point: Point) -> Model:
    """The simulation with the causes of a point."""
    model = problem.subject.model.copy()
    for cause, values in zip(point.causes, point.values, strict=True):
        cause.change(model, values)
    return model


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
    count = len(_START_STEPS) + len(free)
    starts = np.tile(point.starts[w], (count, 1))
    starts[: len(_START_STEPS)] += np.diag(_START_STEPS)
    trims = np.tile(point.trims[w], (count, 1))
    for i, k in enumerate(free):
        trims[len(_START_STEPS) + i, k] += _TRIM_STEPS[k]
    out = np.empty((count, *read.shape))
    fly_window(
        np.tile(base.row, (count, 1)), np.array([body_state(s, altitude) for s in starts]), trims,
        _inputs(problem, point, w, linear), out, np.empty((count, 13)),
    )  # fmt: skip
    steps = np.concatenate([_START_STEPS, _TRIM_STEPS[list(free)]])
    return np.asarray(np.moveaxis((sense(out, base) - read) / steps[:, None, None], 0, -1))


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


def lead_of(problem: Problem, w: int) -> int:
    """Samples of a window that do not count."""
    return round(LEAD_S / problem.inputs[w].dt)


def residual_of(
    problem: Problem, point: Point, w: int, measured: Array, read: Array, linear: LinearModel
) -> Array:
    """Residual of a window (samples, outputs), as it would be without the estimated air."""
    window = problem.windows[w]
    return np.asarray(measured[window.start : window.stop] - read + air_response(linear, point.air[w]))


@dataclass(frozen=True, slots=True)
class _Versions:
    """The model at a point, then one step along each parameter; equation (1) and gains of each, by group."""

    models: list[Model]
    steps: Array
    measured: Array
    filters: dict[int, list[tuple[LinearModel, Gains]]]


def filter_of(problem: Problem, point: Point, group: int, model: Model) -> tuple[LinearModel, Gains]:
    """Equation (1) of a group of windows, and its gains."""
    linear = linear_at(problem, point, group, model)
    alike = [w for w, g in zip(problem.windows, problem.groups, strict=True) if g == group]
    samples = max(w.stop - w.start for w in alike)
    return linear, settled_gains(linear, point.noise, problem.used, lead_of(problem, group), samples)


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
    return len(_START_STEPS) + len(problem.free_trims)


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


def _own_offset(problem: Problem, point: Point, w: int) -> Array:
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
        total, off = blocks.sum(axis=0), _own_offset(problem, point, w)
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


def _prior(causes: Sequence[Candidate]) -> Array:
    return np.array([p.spread**-2.0 for c in causes for p in c.parameters])


def _limits(causes: Sequence[Candidate]) -> tuple[Array, Array]:
    low = [p.low for c in causes for p in c.parameters]
    return np.array(low), np.array([p.high for c in causes for p in c.parameters])


def _moved(problem: Problem, point: Point, reduced: Reduced, step: Array, part: float) -> Point:
    """A point some part of a Gauss-Newton step away."""
    low, high = _limits(point.causes)
    theta = np.clip(point.theta + part * step, low, high)
    taken = theta - point.theta
    values, at = [], 0
    for v in point.values:
        values.append(theta[at : at + len(v)])
        at += len(v)
    starts, trims = point.starts.copy(), point.trims.copy()
    for w, (alone, by_theta) in enumerate(reduced.own):
        move = part * alone - by_theta @ taken
        starts[w] += move[: len(_START_STEPS)]
        trims[w, list(problem.free_trims)] += move[len(_START_STEPS) :]
    return replace(point, values=tuple(values), starts=starts, trims=trims)


def fit(problem: Problem, point: Point, passes: int = _MOST_PASSES) -> Solution:
    """The most likely parameters of the causes in the model, and starts."""
    evaluation = evaluate(problem, point)
    if not np.isfinite(evaluation.log_spread):
        raise RunsAwayError("the simulation runs away from the flight")
    reduced = reduce(problem, point, evaluation)
    prior = _prior(point.causes)
    for _ in range(passes):
        pull = reduced.score - prior * point.theta
        step = np.asarray(np.linalg.solve(reduced.information + np.diag(prior), pull), dtype=np.float64)
        here = _whole_cost(problem, evaluation, point, prior)
        promised = _promised(evaluation, reduced, here)
        part, better = 1.0, False
        while part > 0.1 and not better:
            there = _moved(problem, point, reduced, step, part)
            tried = evaluate(problem, there)
            better = bool(_whole_cost(problem, tried, there, prior) < here)  # not where it is not a number
            part *= 0.4
        if not better:
            break
        gained = here - _whole_cost(problem, tried, there, prior)
        point, evaluation = there, tried
        reduced = reduce(problem, point, evaluation)
        if gained < _ENOUGH or promised < _ENOUGH:
            break
    return Solution(point, reduced.cost, _covariance(reduced, point, prior), evaluation)


def _promised(evaluation: Evaluation, reduced: Reduced, here: float) -> float:
    return (
        here - reduced.cost + 0.5 * float(reduced.score @ np.linalg.pinv(reduced.information) @ reduced.score)
    )


def _whole_cost(problem: Problem, evaluation: Evaluation, point: Point, prior: Array) -> float:
    """At the point itself."""
    residual = sum(float(b[:, 0, 0].sum()) for b in evaluation.blocks)
    for w in range(len(problem.inputs)):
        residual += float(own_prior(problem) @ _own_offset(problem, point, w) ** 2)
    return 0.5 * residual + evaluation.log_spread + 0.5 * float(prior @ point.theta**2)


def _covariance(reduced: Reduced, point: Point, prior: Array) -> Array:
    """Sandwich where residuals are correlated (White 1982): never less than the inverse information."""
    if point.theta.size == 0:
        return np.zeros((0, 0))
    inverse = np.linalg.inv(reduced.information + np.diag(prior))
    return np.asarray(inverse * inflation(reduced, slice(None)))


_PRIOR_BLOCKS = 10.0


def inflation(reduced: Reduced, part: slice | Array) -> float:
    """Variance of the blocks' scores over what independent innovations would have; at least 1."""
    h = reduced.information[part][:, part]
    scale = np.linalg.pinv(h)
    blocks = len(reduced.block_scores)
    moved = scale @ reduced.score[part]
    scores = reduced.block_scores[:, part] - np.einsum(
        "bij,j->bi", reduced.block_information[:, part][:, :, part], moved
    )
    found = float(np.einsum("bi,ij,bj->", scores, scale, scores)) / max(len(h), 1)
    return max(1.0, (found * blocks + _PRIOR_BLOCKS) / (blocks + _PRIOR_BLOCKS))


def own_fitted(problem: Problem, point: Point) -> Point:
    """The point with starts and trims of its windows at their best, causes held."""
    for _ in range(2):
        reduced = reduce(problem, point, evaluate(problem, point))
        starts, trims = point.starts.copy(), point.trims.copy()
        for w, (alone, _) in enumerate(reduced.own):
            if not np.isfinite(alone).all():
                continue  # it runs away in this window
            starts[w] += alone[: starts.shape[1]]
            trims[w, list(problem.free_trims)] += alone[starts.shape[1] :]
        point = replace(point, starts=starts, trims=trims)
    return point
