"""Likelihood of all windows' innovations, its gradient and information (docs/methods/filter_error.md).

    cost(p) = sum (e^2 / s + ln s) / 2 + sum ((p - mean) / std)^2 / 2,                                     (2)

each window's own constants (``Window``) being those that make it least: innovations are linear in them. Without process
noise (still air) the innovations are what the model's response leaves of the readings, and s is their mean square by
channel (thesis 5.17). What noise of the measured surfaces is expected to add to the cost is taken out of it
(Nakamura 1990): with G the response of the innovations to a surface's noise of variance v,

    corrected cost = cost - sum v G' S^-1 G / 2.                                                           (3)

Sensitivities are differences between filters a small step apart, gains and variances
included; what a window's own constants can explain is taken out of them (Golub and Pereyra 1973, Kaufman 1975).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.estimators.offline.innovations import (
    Record,
    System,
    Trace,
    empty_trace,
    filter_columns,
    innovations,
)
from wingwatch.estimators.offline.parameters import Model
from wingwatch.estimators.offline.window import Window, following

__all__ = [
    "Evaluation",
    "Prior",
    "Problem",
    "Sensitivities",
    "evaluate",
    "information_inverse",
    "open_loop",
    "sensitivities",
]

Array = NDArray[np.float64]

_MEMORY_S = 6.0
"""After this an innovation no longer answers to the noise of one sample."""

_PASSES = 4
"""Turns in which noise and a window's own constants, which depend on each other, are found."""

_FLAT = 1e-12
"""Of a window's own constants: combinations with less of the largest information are not seen and stay 0."""


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known of the parameters beforehand, and how the search handles them; (size,) each.

    Attributes:
        mean, std: of a normal distribution.
        start: where the search begins.
        step: of the differences that make sensitivities.
    """

    mean: Array
    std: Array
    start: Array
    step: Array


@dataclass(frozen=True, slots=True)
class Problem:
    """Data, model and prior; ``free`` says which parameters are searched, (size,)."""

    windows: Sequence[Window]
    model: Model
    prior: Prior
    free: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The likelihood at one point.

    Attributes:
        parameters: p, (size,).
        cost: (2).
        systems, traces: of each window.
        own: each window's own constants, (own,).
        own_columns: what they add to the innovations, (own, samples, channels) each.
        surface_noises: innovations that the noise of measured surfaces makes, whitened, so that their squares add to
            what it adds to the cost, (inputs, readings) each; empty where surfaces are known without noise.
    """

    parameters: Array
    cost: float
    systems: list[System]
    traces: list[Trace]
    own: list[Array]
    own_columns: list[Array]
    surface_noises: list[Array]


@dataclass(frozen=True, slots=True)
class Sensitivities:
    """How one window's innovations answer to the parameters.

    Attributes:
        predicted: -de/dp / sqrt(s) less what the window's own constants can explain, (size, readings).
        variance: ds/dp / s, (size, readings).
        innovations: e / sqrt(s), (readings,).
        used: whether a reading is there, (readings,).
        surface_noise_score: what the noise of surfaces takes from the score, (size,).
        surface_noise_information: what it adds to the information, (size, size).
        surface_noise_scatter: what it adds to the score's variance, (size, size).
    """

    predicted: Array
    variance: Array
    innovations: Array
    used: NDArray[np.bool_]
    surface_noise_score: Array
    surface_noise_information: Array
    surface_noise_scatter: Array

    def score(self) -> Array:
        """Gradient of the log-likelihood by reading, without (3), (size, readings)."""
        e = self.innovations
        return np.asarray(self.predicted * e + 0.5 * self.variance * np.where(self.used, e * e - 1.0, 0.0))

    def information(self) -> Array:
        """Expected information, with what noise of surfaces adds to it, (size, size)."""
        return np.asarray(self.predicted @ self.predicted.T + 0.5 * self.variance @ self.variance.T)


def evaluate(problem: Problem, p: Array) -> Evaluation | None:
    """The likelihood at parameters p (size,) of ``Model.layout``; None where the motion would grow without bounds or the
    result is not finite."""
    model = problem.model
    if any(model.grows(p, w) for w in problem.windows):
        return None
    off = (p - problem.prior.mean) / problem.prior.std
    cost = 0.5 * float(np.sum(off[problem.free] ** 2))
    point = Evaluation(p, 0.0, [], [], [], [], [])
    for window in problem.windows:
        system = model.system(p, window)
        trace = empty_trace(len(window), window.readings.shape[1], system.covariance.shape[0])
        innovations(system, model.record(window, np.zeros(window.own)), trace, True)
        if not (np.isfinite(trace.innovations).all() and trace.variances.min() > 0.0):
            return None
        point.systems.append(system)
        point.traces.append(trace)
        point.own_columns.append(_own_columns(model, window, system, trace))
        if not np.isfinite(point.own_columns[-1]).all():
            return None
    _take_own_out(problem, point)
    for m, window in enumerate(problem.windows):
        system, trace = point.systems[m], point.traces[m]
        surface_noise = _surface_noise(model, window, system, trace)
        point.surface_noises.append(surface_noise)
        cost += 0.5 * float(np.sum(trace.innovations**2 / trace.variances + np.log(trace.variances)))
        cost -= 0.5 * float(np.sum(surface_noise**2))
    if not math.isfinite(cost):
        return None
    return replace(point, cost=cost)


def _take_own_out(problem: Problem, point: Evaluation) -> None:
    """Each window's own constants and the innovations that they leave, and the noise where it follows from these."""
    raw = [trace.innovations.copy() for trace in point.traces]
    if not problem.model.air:
        _set_noise(problem, point, [np.where(w.used, w.readings - w.readings.mean(axis=0), 0.0) for w in problem.windows])
    for _ in range(1 if problem.model.air else _PASSES):
        point.own.clear()
        for trace, columns, innovation in zip(point.traces, point.own_columns, raw, strict=True):
            point.own.append(_least_squares(columns, trace, innovation))
            trace.innovations[...] = innovation - np.einsum("c,ctq->tq", point.own[-1], columns)
        if not problem.model.air:
            _set_noise(problem, point, [trace.innovations for trace in point.traces])


def _set_noise(problem: Problem, point: Evaluation, left: Sequence[Array]) -> None:
    """Variance of each channel by the mean square of what is left of it in all windows (thesis 5.17)."""
    counts = np.sum([w.used.sum(axis=0) for w in problem.windows], axis=0)
    squares = np.sum([np.sum(e**2, axis=0) for e in left], axis=0)
    floor = np.mean([w.floor for w in problem.windows], axis=0)
    variance = np.maximum(squares / np.maximum(counts, 1), floor)
    for window, trace in zip(problem.windows, point.traces, strict=True):
        trace.variances[...] = np.where(window.used, variance, 1.0)


def _surface_noise(model: Model, window: Window, system: System, trace: Trace) -> Array:
    """Innovations after one sample's noise of each measured input, whitened and as strong as all samples' together,
    (inputs, readings). The sample is one from which on the gains have settled."""
    inputs, often = _noisy(window), window.moving.sum(axis=0)
    if not inputs.size:
        return np.zeros((0, 0))
    ns, at = model.plant.states, len(window) // 3
    length = min(len(window) - at, math.ceil(_MEMORY_S / window.dt))
    span = slice(at, at + length)
    late = Trace(trace.innovations[span], trace.variances[span], trace.gains[span], trace.renewed[span])
    here = system._replace(level=system.level[span])
    columns = np.zeros((inputs.size, length, window.readings.shape[1]))
    for place, j in enumerate(inputs):
        pulse = np.zeros((length, window.start.shape[1] - ns))
        pulse[1, ns + j] = math.sqrt(window.input_noise[j] * often[j])
        columns[place] = open_loop(model, _driven_by(window, span, pulse, np.zeros((length, ns))), here)
    states = np.zeros((inputs.size, system.covariance.shape[0]))
    filter_columns(here, late, window.used[span], columns, states)
    return np.asarray((columns / np.sqrt(late.variances)).reshape(inputs.size, -1))


def _noisy(window: Window) -> NDArray[np.int64]:
    """Inputs whose noise drives the model."""
    return np.flatnonzero(window.input_noise * window.moving.sum(axis=0))


def _surface_noise_scatter(window: Window, predicted: Array, surface_noises: Array) -> Array:
    """Variance of the score that the surfaces' noise in the innovations makes, (size, size)."""
    size, channels = predicted.shape[0], window.readings.shape[1]
    total = np.zeros((size, size))
    rows = predicted.reshape(size, len(window), channels)
    for place, j in enumerate(_noisy(window)):
        moving = window.moving[:, j]
        # the pulse is at the second sample of a response
        answer = surface_noises[place].reshape(-1, channels)[1:] / math.sqrt(np.count_nonzero(moving))
        answered = sum(
            scipy.signal.fftconvolve(rows[:, :, c], answer[::-1, c][None], axes=1)[:, answer.shape[0] - 1 :]
            for c in range(channels)
        )
        total += (answered * moving) @ np.asarray(answered).T
    return total


def _driven_by(window: Window, span: slice, drives: Array, aerodynamic: Array) -> Window:
    """A window in which nothing happens but these drives, on lines between samples, and accelerations."""
    start = np.column_stack([drives, aerodynamic])
    return replace(
        window, readings=np.zeros_like(window.readings[span]), used=window.used[span], start=start,
        end=following(start), aerodynamic=aerodynamic, trims=window.trims[span],
    )  # fmt: skip


def open_loop(model: Model, window: Window, system: System) -> Array:
    """Readings that a window's forcing alone makes, without noise or correction, (samples, channels)."""
    samples, channels = window.readings.shape
    still = system._replace(noise=0.0 * system.noise, covariance=0.0 * system.covariance)
    trace = empty_trace(samples, channels, system.covariance.shape[0])
    silent = replace(window, readings=np.zeros_like(window.readings), used=np.ones_like(window.used))
    innovations(still, model.record(silent, np.zeros(window.own)), trace, True)
    return -trace.innovations


def _own_columns(model: Model, window: Window, system: System, trace: Trace) -> Array:
    """Innovations that a unit of each of the window's own constants takes away, (own, samples, channels)."""
    samples, channels = window.readings.shape
    ns, n, pushes = model.plant.states, system.covariance.shape[0], window.trims.shape[1]
    readings = np.zeros((window.own, samples, channels))
    states = np.zeros((window.own, n))
    drives = np.zeros_like(window.start[:, ns:])
    for c in range(pushes * ns):
        aerodynamic = np.zeros((samples, ns))
        aerodynamic[:, c % ns] = window.trims[:, c // ns]
        readings[c] = open_loop(model, _driven_by(window, slice(None), drives, aerodynamic), system)
    for c, channel in enumerate(window.constants, pushes * ns):
        readings[c, :, channel] = 1.0
    for j in range(ns):
        states[window.own - ns + j, n - ns + j] = -1.0
    filter_columns(system, trace, window.used, readings, states)
    return readings


def _least_squares(columns: Array, trace: Trace, innovation: Array) -> Array:
    """The own constants that leave least of the innovations, (columns,)."""
    root = 1.0 / np.sqrt(trace.variances)
    x = (columns * root).reshape(columns.shape[0], -1)
    return np.asarray(information_inverse(x @ x.T) @ (x @ (innovation * root).ravel()))


def information_inverse(matrix: Array, flat: float = _FLAT) -> Array:
    """Pseudo-inverse of an information matrix (n, n) whose entries have different units.

    ``flat``: of the largest information; directions with less stay 0.
    """
    diagonal = np.diagonal(matrix)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, np.inf))
    return np.asarray(
        np.linalg.pinv(matrix * np.outer(scale, scale), rcond=flat, hermitian=True) * np.outer(scale, scale)
    )


@dataclass(frozen=True, slots=True)
class _Lane:
    """Innovations, their variances and the response to the surfaces' noise at parameters a step away."""

    innovations: Array
    variances: Array
    surface_noise: Array


def _lane(problem: Problem, point: Evaluation, m: int, i: int, record: Record) -> _Lane:
    """The filter of window m with parameter i moved."""
    window, model, there = problem.windows[m], problem.model, point.traces[m]
    moved = point.parameters.copy()
    moved[i] += problem.prior.step[i]
    system = model.system(moved, window)
    lane = Trace(
        np.zeros_like(there.innovations),
        np.ones_like(there.variances),
        np.zeros_like(there.gains),
        there.renewed,
    )
    innovations(system, record, lane, False)
    if not model.air:
        lane.variances[...] = there.variances
    return _Lane(lane.innovations, lane.variances, _surface_noise(model, window, system, lane))


def sensitivities(problem: Problem, point: Evaluation, m: int) -> Sensitivities:
    """Of window m at an evaluated point; rows of parameters that are not free are 0."""
    window, trace, size = problem.windows[m], point.traces[m], point.parameters.size
    readings = trace.innovations.size
    root = 1.0 / np.sqrt(trace.variances)
    predicted, variance = np.zeros((size, readings)), np.zeros((size, readings))
    record = problem.model.record(window, point.own[m])
    surface_noises = np.zeros((size, *point.surface_noises[m].shape))
    for i in np.flatnonzero(problem.free).tolist():
        step = problem.prior.step[i]
        there = _lane(problem, point, m, i, record)
        predicted[i] = ((trace.innovations - there.innovations) * root).ravel() / step
        variance[i] = ((there.variances - trace.variances) / trace.variances).ravel() / step
        surface_noises[i] = (there.surface_noise - point.surface_noises[m]) / step
    x = (point.own_columns[m] * root).reshape(-1, readings)
    predicted -= (predicted @ x.T) @ information_inverse(x @ x.T) @ x
    flat = surface_noises.reshape(size, -1)
    driven = (
        flat.copy()
    )  # noises change how a response is weighted, not what it is of: that is in the information already
    driven[problem.model.layout.theta.stop :] = 0.0
    return Sensitivities(
        predicted, variance, (trace.innovations * root).ravel(), window.used.ravel(),
        flat @ point.surface_noises[m].ravel(), driven @ driven.T,
        _surface_noise_scatter(window, predicted, point.surface_noises[m]),
    )  # fmt: skip
