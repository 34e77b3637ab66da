"""Likelihood of all windows' innovations, its gradient and information (docs/methods/filter_error.md).

    cost(p) = sum (e^2 / s + ln s) / 2 + sum ((p - mean) / std)^2 / 2,                                     (2)

each window's own constants (of its readings, and the copy's state at its first sample) being those that make it least:
innovations are linear in them. Sensitivities are differences between filters a small step apart, gains and variances
included; what a window's own constants can explain is taken out of them (Golub and Pereyra 1973, Kaufman 1975).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.kalman.innovations import (
    System,
    Trace,
    empty_trace,
    filter_columns,
    innovations,
)
from wingwatch.estimators.kalman.model import FilterModel
from wingwatch.estimators.kalman.window import Window

__all__ = [
    "Evaluation",
    "Prior",
    "Problem",
    "Sensitivities",
    "evaluate",
    "information_inverse",
    "sensitivities",
]

Array = NDArray[np.float64]

_FASTEST_GROWTH = 1.0
"""Motion that grows faster than this, 1/s, is none of an aircraft that is flown."""

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
    model: FilterModel
    prior: Prior
    free: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The likelihood at one point.

    Attributes:
        parameters: p, (size,).
        cost: (2).
        systems, traces: of each window.
        own: each window's own constants, (channels + states,).
        own_columns: what they add to the innovations, (channels + states, samples, channels) each.
    """

    parameters: Array
    cost: float
    systems: list[System]
    traces: list[Trace]
    own: list[Array]
    own_columns: list[Array]


@dataclass(frozen=True, slots=True)
class Sensitivities:
    """How one window's innovations answer to the parameters.

    Attributes:
        predicted: -de/dp / sqrt(s) less what the window's own constants can explain, (size, readings).
        variance: ds/dp / s, (size, readings).
        innovations: e / sqrt(s), (readings,).
        used: whether a reading is there, (readings,).
    """

    predicted: Array
    variance: Array
    innovations: Array
    used: NDArray[np.bool_]

    def score(self) -> Array:
        """Gradient of the log-likelihood by reading, (size, readings)."""
        e = self.innovations
        return np.asarray(self.predicted * e + 0.5 * self.variance * np.where(self.used, e * e - 1.0, 0.0))

    def information(self) -> Array:
        """Expected information, (size, size)."""
        return np.asarray(self.predicted @ self.predicted.T + 0.5 * self.variance @ self.variance.T)


def evaluate(problem: Problem, p: Array) -> Evaluation | None:
    """The likelihood at p; None where the motion would grow without bounds or nothing finite comes out."""
    model = problem.model
    if any(model.growth(p, w) > _FASTEST_GROWTH for w in problem.windows):
        return None
    cost = 0.5 * float(np.sum(((p - problem.prior.mean) / problem.prior.std) ** 2))
    point = Evaluation(p, 0.0, [], [], [], [])
    for window in problem.windows:
        system = model.system(p, window)
        trace = empty_trace(*window.readings.shape, system.transition.shape[0])
        channels, ns = window.readings.shape[1], model.states
        innovations(system, model.record(p, window, np.zeros(channels + ns)), trace, True)
        if not (np.isfinite(trace.innovations).all() and trace.variances.min() > 0.0):
            return None
        columns = _own_columns(system, trace, window, ns)
        own = _least_squares(columns, trace)
        trace.innovations[...] -= np.einsum("c,ctq->tq", own, columns)
        point.systems.append(system)
        point.traces.append(trace)
        point.own.append(own)
        point.own_columns.append(columns)
        cost += 0.5 * float(np.sum(trace.innovations**2 / trace.variances + np.log(trace.variances)))
    if not math.isfinite(cost):
        return None
    return Evaluation(p, cost, point.systems, point.traces, point.own, point.own_columns)


def _own_columns(system: System, trace: Trace, window: Window, ns: int) -> Array:
    """Innovations that a unit of each of the window's own constants makes, (channels + states, samples, channels)."""
    samples, channels = window.readings.shape
    n = system.transition.shape[0]
    readings = np.zeros((channels + ns, samples, channels))
    states = np.zeros((channels + ns, n))
    for c in range(channels):
        readings[c, :, c] = 1.0
    for j in range(ns):
        states[channels + j, n - ns + j] = 1.0
    filter_columns(system, trace, window.used, readings, states)
    readings[channels:] *= -1.0
    return readings


def _least_squares(columns: Array, trace: Trace) -> Array:
    """The own constants with the least innovations, (columns,)."""
    root = 1.0 / np.sqrt(trace.variances)
    x = (columns * root).reshape(columns.shape[0], -1)
    return np.asarray(information_inverse(x @ x.T) @ (x @ (trace.innovations * root).ravel()))


def information_inverse(matrix: Array) -> Array:
    """Pseudo-inverse of an information matrix whose entries have different units."""
    diagonal = np.diagonal(matrix)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, np.inf))
    return np.asarray(
        np.linalg.pinv(matrix * np.outer(scale, scale), rcond=_FLAT, hermitian=True) * np.outer(scale, scale)
    )


def sensitivities(problem: Problem, point: Evaluation, m: int) -> Sensitivities:
    """Of window m at an evaluated point; rows of parameters that are not free are 0."""
    window, model, p = problem.windows[m], problem.model, point.parameters
    trace, size = point.traces[m], p.size
    readings = trace.innovations.size
    root = 1.0 / np.sqrt(trace.variances)
    predicted, variance = np.zeros((size, readings)), np.zeros((size, readings))
    lane = Trace(
        np.zeros_like(trace.innovations), np.ones_like(trace.variances), np.zeros_like(trace.gains),
        trace.renewed,
    )  # fmt: skip
    for i in np.flatnonzero(problem.free):
        step = problem.prior.step[i]
        moved = p.copy()
        moved[i] += step
        innovations(model.system(moved, window), model.record(moved, window, point.own[m]), lane, False)
        predicted[i] = ((trace.innovations - lane.innovations) * root).ravel() / step
        variance[i] = ((lane.variances - trace.variances) / trace.variances).ravel() / step
    x = (point.own_columns[m] * root).reshape(-1, readings)
    predicted -= (predicted @ x.T) @ information_inverse(x @ x.T) @ x
    return Sensitivities(predicted, variance, (trace.innovations * root).ravel(), window.used.ravel())
