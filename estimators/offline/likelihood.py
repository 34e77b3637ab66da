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

from wingwatch.estimators.offline.fit import ChannelFit, channel_fit
from wingwatch.estimators.offline.innovations import (
    Record,
    System,
    Trace,
    empty_trace,
    filter_columns,
    innovations,
    respond,
)
from wingwatch.estimators.offline.parameters import Model
from wingwatch.estimators.offline.window import Window, following

__all__ = [
    "Evaluation",
    "Prior",
    "Problem",
    "Sensitivities",
    "channel_fits",
    "evaluate",
    "information_inverse",
    "open_loop",
    "sensitivities",
]

Array = NDArray[np.float64]

_MEMORY_S = 6.0
"""After this an innovation no longer answers to the noise of one sample."""

_PASSES = 3
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
        variance: ds/dp / s, (size, readings); None where s does not depend on the parameters.
        innovations: e / sqrt(s), (readings,).
        window: whose.
        surface_noises: as of ``Evaluation``; surface_noise_slopes: their derivatives, (size, inputs * readings).
        driven: how many of the parameters, the derivatives, say what the noise of surfaces drives.
    """

    predicted: Array
    variance: Array | None
    innovations: Array
    window: Window
    surface_noises: Array
    surface_noise_slopes: Array
    driven: int

    def score(self) -> Array:
        """Gradient of the log-likelihood by reading, without (3), (size, readings)."""
        e = self.innovations
        score = self.predicted * e
        if self.variance is not None:
            score += 0.5 * self.variance * np.where(self.window.used.ravel(), e * e - 1.0, 0.0)
        return score

    def information(self) -> Array:
        """Expected information, with what noise of surfaces adds to it, (size, size)."""
        information = self.predicted @ self.predicted.T
        if self.variance is not None:
            information += 0.5 * self.variance @ self.variance.T
        return np.asarray(information)

    @property
    def surface_noise_score(self) -> Array:
        """What the noise of surfaces takes from the score, (size,)."""
        return np.asarray(self.surface_noise_slopes @ self.surface_noises.ravel())

    @property
    def surface_noise_information(self) -> Array:
        """What it adds to the information, (size, size): noises of sensors and air change how a response is weighted,
        not what it is of, and that is in the information already."""
        driven = self.surface_noise_slopes.copy()
        driven[self.driven :] = 0.0
        return np.asarray(driven @ driven.T)

    def surface_noise_scatter(self) -> Array:
        """What it adds to the score's variance, (size, size)."""
        (size, _), (samples, channels) = self.predicted.shape, self.window.readings.shape
        total = np.zeros((size, size))
        rows = self.predicted.reshape(size, samples, channels)
        for place, j in enumerate(_noisy(self.window)):
            moving = self.window.moving[:, j]
            # the pulse is at the second sample of a response
            answer = self.surface_noises[place].reshape(-1, channels)
            seen = _seen_after(self.window, len(answer))[:, None]
            answer = (answer / seen)[1:] / math.sqrt(np.count_nonzero(moving))
            answered = sum(
                scipy.signal.fftconvolve(rows[:, :, c], answer[::-1, c][None], axes=1)[:, len(answer) - 1 :]
                for c in range(channels)
            )
            total += (answered * moving) @ np.asarray(answered).T
        return total


def evaluate(problem: Problem, p: Array) -> Evaluation | None:
    """The likelihood at parameters p (size,) of ``Model.layout``; None where motion would grow without bounds or the
    result is not finite."""
    model = problem.model
    if any(model.grows(p, w) for w in problem.windows):
        return None
    off = (p - problem.prior.mean) / problem.prior.std
    cost = 0.5 * float(np.sum(off[problem.free] ** 2))
    point = Evaluation(p, 0.0, [], [], [], [], [])
    for window in problem.windows:
        system = model.system(p, window)
        trace = empty_trace(len(window), window.readings.shape[1], len(system.covariance))
        _filter(model, system, model.record(window, np.zeros(window.own)), trace, True)
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
        surface_noise = _surface_noise(model, window, _pulses(model, window), system, trace)
        point.surface_noises.append(surface_noise)
        cost += 0.5 * float(np.sum(trace.innovations**2 / trace.variances + np.log(trace.variances)))
        cost -= 0.5 * float(np.sum(surface_noise**2))
    if not math.isfinite(cost):
        return None
    return replace(point, cost=cost)


def _filter(model: Model, system: System, record: Record, trace: Trace, lead: bool) -> None:
    """Fill a trace (``innovations``); without process noise there is nothing to correct."""
    if model.air:
        innovations(system, record, trace, lead)
    else:
        left = record.readings - respond(system, record.start, record.end, record.state)
        trace.innovations[...] = np.where(record.used, left, 0.0)


def _filtered(model: Model, system: System, trace: Trace, used: NDArray[np.bool_], columns: Array) -> Array:
    """Innovations that readings (columns, samples, channels) make."""
    if not model.air:
        return columns * used
    filter_columns(system, trace, used, columns)
    return columns


def _take_own_out(problem: Problem, point: Evaluation) -> None:
    """Each window's own constants and the innovations that they leave, and the noise where it follows from these."""
    raw = [trace.innovations.copy() for trace in point.traces]
    if not problem.model.air:
        _set_noise(
            problem,
            point,
            [np.where(w.used, w.readings - w.readings.mean(axis=0), 0.0) for w in problem.windows],
        )
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


def _pulses(model: Model, window: Window) -> tuple[slice, Array]:
    """A sample's noise of each measured input, as strong as all samples' together, and over which samples its effect is
    looked at: (inputs, samples, forcings). The sample, the second, is one from which on the gains have settled."""
    inputs, often = _noisy(window), window.moving.sum(axis=0)
    at = len(window) // 3 if model.air else 0
    length = min(len(window) - at, math.ceil(_MEMORY_S / window.dt))
    pulses = np.zeros((inputs.size, length, window.start.shape[1]))
    for place, j in enumerate(inputs):
        pulses[place, 1, model.plant.states + j] = math.sqrt(window.input_noise[j] * often[j])
    return slice(at, at + length), pulses


def _surface_noise(
    model: Model, window: Window, pulses: tuple[slice, Array], system: System, trace: Trace
) -> Array:
    """Innovations after ``_pulses``, whitened, (inputs, readings); so many samples later a sample's effect is seen but
    for those near the window's end."""
    span, drives = pulses
    if not len(drives):
        return np.zeros((0, 0))
    late = Trace(trace.innovations[span], trace.variances[span], trace.gains[span], trace.renewed[span])
    here = system._replace(level=system.level[span])
    still = np.zeros(len(system.covariance))
    columns = np.array([respond(here, drive, following(drive), still) for drive in drives])
    columns = _filtered(model, here, late, window.used[span], columns)
    seen = _seen_after(window, drives.shape[1])[:, None]
    return np.asarray((columns * (seen / np.sqrt(late.variances))).reshape(len(drives), -1))


def _seen_after(window: Window, length: int) -> Array:
    """Root of the share of samples whose noise is still seen so many samples later, (length,); 1 at the pulse."""
    return np.asarray(np.sqrt(1.0 - np.maximum(np.arange(length) - 1.0, 0.0) / len(window)))


def _noisy(window: Window) -> NDArray[np.int64]:
    """Inputs whose noise drives the model."""
    return np.flatnonzero(window.input_noise * window.moving.sum(axis=0))


def open_loop(model: Model, window: Window, system: System) -> Array:
    """Readings that a window's forcing alone makes, without noise or correction, (samples, channels)."""
    readings: Array = respond(system, window.start, window.end, np.zeros(len(system.covariance)))
    readings[:, model.plant.states :] += window.aerodynamic[:, model.plant.forces]
    return readings


def _own_columns(model: Model, window: Window, system: System, trace: Trace) -> Array:
    """Innovations that a unit of each of the window's own constants takes away, (own, samples, channels)."""
    ns, n, pushes = model.plant.states, len(system.covariance), window.trims.shape[1]
    columns, none = np.zeros((window.own, *window.readings.shape)), np.zeros_like(window.start)
    for c in range(pushes * ns):
        push = none.copy()
        push[:, c % ns - ns] = window.trims[:, c // ns]
        columns[c] = respond(system, push, following(push), np.zeros(n))
        columns[c, :, ns:] += push[:, model.plant.forces - ns]
    for c, channel in enumerate(window.constants, pushes * ns):
        columns[c, :, channel] = 1.0
    for j in range(ns):
        columns[window.own - ns + j] = respond(system, none, none, np.eye(n)[n - ns + j])
    return _filtered(model, system, trace, window.used, columns)


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


def _lane(
    problem: Problem, point: Evaluation, m: int, i: int, record: Record, pulses: tuple[slice, Array]
) -> tuple[Trace, Array]:
    """The filter of window m with parameter i moved, and its innovations by the surfaces' noise."""
    window, model, there = problem.windows[m], problem.model, point.traces[m]
    moved = point.parameters.copy()
    moved[i] += problem.prior.step[i]
    system = model.system(moved, window)
    variances = np.ones_like(there.variances) if model.air else there.variances
    gains = np.zeros_like(there.gains) if model.air else there.gains
    lane = Trace(np.zeros_like(there.innovations), variances, gains, there.renewed)
    _filter(model, system, record, lane, False)
    return lane, _surface_noise(model, window, pulses, system, lane)


def sensitivities(problem: Problem, point: Evaluation, m: int) -> Sensitivities:
    """Of window m at an evaluated point; rows of parameters that are not free are 0."""
    window, trace, size, model = problem.windows[m], point.traces[m], point.parameters.size, problem.model
    readings, noises = trace.innovations.size, point.surface_noises[m]
    root = 1.0 / np.sqrt(trace.variances)
    predicted, slopes = np.zeros((size, readings)), np.zeros((size, noises.size))
    variance = np.zeros((size, readings)) if model.air else None
    record, pulses = model.record(window, point.own[m]), _pulses(model, window)
    for i in np.flatnonzero(problem.free).tolist():
        step = problem.prior.step[i]
        lane, surface_noise = _lane(problem, point, m, i, record, pulses)
        predicted[i] = ((trace.innovations - lane.innovations) * root).ravel() / step
        slopes[i] = (surface_noise - noises).ravel() / step
        if variance is not None:
            variance[i] = ((lane.variances - trace.variances) / trace.variances).ravel() / step
    x = (point.own_columns[m] * root).reshape(-1, readings)
    whole = np.sum(predicted**2, axis=1)
    predicted -= (predicted @ x.T) @ information_inverse(x @ x.T) @ x
    predicted[np.sum(predicted**2, axis=1) <= _FLAT * whole] = 0.0  # own constants explain all but rounding
    innovation = (trace.innovations * root).ravel()
    return Sensitivities(predicted, variance, innovation, window, noises, slopes, model.layout.theta.stop)


def channel_fits(
    problem: Problem, point: Evaluation, taken: Array
) -> tuple[tuple[ChannelFit, ...], list[list[Array]]]:
    """Statistics of one-step predictions of every channel that was read, and its innovations by window, SI units.

    ``taken``: degrees of freedom that the parameters take from each channel, (channels,).
    """
    channels, windows = [], []
    for c, name in enumerate(problem.model.plant.channel_names):
        both = zip(problem.windows, point.traces, strict=True)
        read = [(w.readings[w.used[:, c], c], t.innovations[w.used[:, c], c]) for w, t in both]
        read = [(z, e) for z, e in read if z.size]
        if read:
            channels.append(
                channel_fit(name, [z for z, _ in read], [z - e for z, e in read], float(taken[c]))
            )
            windows.append([e for _, e in read])
    return tuple(channels), windows
