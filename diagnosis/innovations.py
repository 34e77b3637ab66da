"""The residual of a replay, whitened: what sensor noise, gusts and unmodelled moments can do is taken out of it.

A Kalman filter of equation (1) (``linear_model``) turns the residual into independent innovations. It looks back only,
so what an autopilot makes of a gust is no evidence of anything. Gusts are large motions. So the replay flies through
the air as it is estimated, the linear response to that air is added to its residual, and only what the estimate misses
is linearised. With x the states, the outputs k one after another,

    e_k = r_k - h_k x,   x <- x + K_k e_k;   after the last output   x' = Phi x.                                (2)

A parameter changes the replay and the filter; the innovations change by the derivative of (2), for all parameters c
side by side:

    e_k,c = r_k,c - h_k,c x - h_k x_c,   x_c <- x_c + K_k,c e_k + K_k e_k,c;   x_c' = Phi x_c + Phi_c x.        (3)

docs/methods/diagnosis.md, section 2.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.diagnosis.linear_model import STATES, WIDTH, LinearModel, Noise
from wingwatch.diagnosis.measured import OUTPUTS

__all__ = [
    "Change",
    "Filter",
    "Path",
    "change_of",
    "estimate_disturbance",
    "kalman_filter",
    "response",
    "sensitivities",
    "whiten",
]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_K = len(OUTPUTS)
_HOLDS = 1e-4
"""Relative change of gains below which they hold."""


class Filter(NamedTuple):
    """A Kalman filter of equation (1).

    Attributes:
        linear: equation (1).
        output: its outputs that count, (used, 21).
        gain: (samples, used, 21), the last one holds from then on; deviation: of the innovations, (samples, used).
    """

    linear: LinearModel
    output: Array
    gain: Array
    deviation: Array


def kalman_filter(
    linear: LinearModel, noise: Noise, used: Sequence[int], seen: Mask, like: Filter | None = None
) -> Filter:
    """Filter for windows whose readings are there where ``seen`` (samples, used) says so.

    Args:
        linear: equation (1).
        noise: standard deviations.
        used: outputs that count.
        seen: which readings are there.
        like: a filter with as many samples of gains; without it, until they hold.
    """
    process, start = linear.covariances(noise)
    index = np.array(used)
    samples = len(seen) if like is None else len(like.gain)
    gain, deviation = np.zeros((samples, index.size, WIDTH)), np.ones((samples, index.size))
    output = np.ascontiguousarray(linear.output[index])
    holds_from = int(np.flatnonzero(np.r_[True, (seen[1:] != seen[:-1]).any(axis=1)])[-1])
    count = _settle(
        linear.transition, output, (process, noise.sensors[index] ** 2, start), seen, gain, deviation,
        holds_from if like is None else samples,
    )  # fmt: skip
    return Filter(linear, output, gain[:count], deviation[:count])


class Change(NamedTuple):
    """Derivatives of a filter by parameters.

    Attributes:
        transition: transposed, (21, 21, parameters).
        output: (used, 21, parameters).
        gain: (samples, used, 21, parameters).
    """

    transition: Array
    output: Array
    gain: Array


def change_of(base: Filter, others: Sequence[Filter | None], steps: Array) -> Change:
    """Differences of filters by their steps; None: the parameter does not change the filter."""
    samples, used, _ = base.gain.shape
    change = Change(
        np.zeros((WIDTH, WIDTH, len(others))),
        np.zeros((used, WIDTH, len(others))),
        np.zeros((samples, used, WIDTH, len(others))),
    )
    for i, other in enumerate(others):
        if other is not None:
            change.transition[..., i] = (other.linear.transition - base.linear.transition).T / steps[i]
            change.output[..., i] = (other.output - base.output) / steps[i]
            change.gain[..., i] = (other.gain - base.gain) / steps[i]
    return change


class Path(NamedTuple):
    """Innovations of a window, and x of equation (2) on the way.

    Attributes:
        innovations: (samples, used), 0 where nothing was measured; deviation: of them, 1 there.
        seen: where something was measured.
        before: x before each output, (samples, used, 21); after: the last, (samples, 21).
    """

    innovations: Array
    deviation: Array
    seen: Mask
    before: Array
    after: Array


def whiten(filtering: Filter, residual: Array, seen: Mask) -> Path:
    """Innovations of a residual (samples, used), of which the readings count that are ``seen`` (samples, used)."""
    samples, used = residual.shape
    path = Path(
        np.zeros((samples, used)), np.ones((samples, used)), seen, np.empty((samples, used, WIDTH)),
        np.empty((samples, WIDTH)),
    )  # fmt: skip
    _whiten(
        filtering.linear.transition, filtering.output, filtering.gain, filtering.deviation, residual, path
    )
    return path


def sensitivities(filtering: Filter, path: Path, change: Change, columns: Array) -> Array:
    """Change of a window's innovations by parameters, equation (3).

    Args:
        filtering: of the window.
        path: its innovations.
        change: of the filter, for the last parameters; the first ones do not change it.
        columns: of the residual, (samples, used, parameters).
    """
    columns = np.array(columns)
    samples, used, width = columns.shape
    first = width - change.output.shape[-1]
    for k in range(used):
        columns[:, k, first:] -= path.before[:, k] @ change.output[k]
    moved = (path.after @ change.transition.reshape(WIDTH, -1)).reshape(samples, WIDTH, width - first)
    _differentiate(
        filtering.linear.transition,
        filtering.output,
        filtering.gain,
        change.gain,
        moved,
        columns,
        path,
        first,
    )
    return columns


@njit(cache=True, error_model="numpy", nogil=True)
def _whiten(f, h, gains, deviations, residual, path):  # type: ignore[no-untyped-def]
    """Equation (2)."""
    samples, outputs = residual.shape
    x = np.zeros(f.shape[0])
    for t in range(samples):
        at = min(t, gains.shape[0] - 1)
        for k in range(outputs):
            path.before[t, k] = x
            if path.seen[t, k]:
                e = residual[t, k]
                for i in range(x.size):
                    e -= h[k, i] * x[i]
                for i in range(x.size):
                    x[i] += gains[at, k, i] * e
                path.innovations[t, k], path.deviation[t, k] = e, deviations[at, k]
        path.after[t] = x
        x = f @ x


@njit(cache=True, error_model="numpy", nogil=True)
def _differentiate(f, h, gains, gain_changes, moved, columns, path, first):  # type: ignore[no-untyped-def]
    """Equation (3), in place: columns of the residual become columns of the innovations."""
    samples, outputs, width = columns.shape
    n = f.shape[0]
    x = np.zeros((n, width))
    for t in range(samples):
        at = min(t, gains.shape[0] - 1)
        for k in range(outputs):
            e = columns[t, k]
            if not path.seen[t, k]:
                e[:] = 0.0
                continue
            here = path.innovations[t, k]
            for i in range(n):
                if h[k, i] != 0.0:
                    for c in range(width):
                        e[c] -= h[k, i] * x[i, c]
            for i in range(n):
                change = gain_changes[at, k, i]
                for c in range(width):
                    x[i, c] += gains[at, k, i] * e[c]
                for c in range(first, width):
                    x[i, c] += change[c - first] * here
        x = f @ x
        x[:, first:] += moved[t]


@njit(cache=True, error_model="numpy", nogil=True)
def _settle(f, h, covariances, seen, gain, deviation, holds_from):  # type: ignore[no-untyped-def]
    """Gains and deviations of every sample until they hold; how many samples these are.

    Covariances of the processes' noise (n, n), of the outputs' (used,), of the states before the first sample (n, n).
    """
    process, variance, p = covariances
    samples, outputs = deviation.shape
    n = f.shape[0]
    new, work, transposed = np.zeros(n), np.zeros((n, n)), np.ascontiguousarray(f.T)
    gains, deviations = np.zeros((outputs, n)), np.ones(outputs)
    for t in range(samples):
        change = 0.0
        for k in range(outputs):
            if seen[t, k]:
                change = max(change, _gain(p, h, variance[k], gains, new, deviations, k))
                deviation[t, k] = deviations[k]
                for i in range(n):
                    gain[t, k, i] = gains[k, i]
        if change < _HOLDS and t > holds_from:
            return t + 1
        np.dot(f, p, work)
        np.dot(work, transposed, p)
        for i in range(n):
            for j in range(n):
                p[i, j] += process[i, j]
    return samples


def estimate_disturbance(
    linear: LinearModel, noise: Noise, residual: Array, used: Sequence[int], lead: int
) -> Array:
    """Disturbance (samples, 11) that explains a residual (samples, outputs) best, looking back and ahead."""
    process, start = linear.covariances(noise)
    index = np.array(used)
    states = _smooth(
        linear.transition, np.ascontiguousarray(linear.output[index]), process, noise.sensors[index] ** 2, start,
        np.ascontiguousarray(residual[:, index]), lead,
    )  # fmt: skip
    return np.asarray(states[:, STATES:] @ linear.disturbance[:, STATES:].T)


def response(linear: LinearModel, disturbance: Array) -> Array:
    """What a disturbance (samples, 11) alone does to the simulated outputs by (1), (samples, outputs)."""
    out = np.empty((len(disturbance), _K))
    _respond(
        np.ascontiguousarray(linear.transition[:STATES, :STATES]), np.ascontiguousarray(linear.output[:, :STATES]),
        linear.first, linear.last, linear.direct, disturbance, out,
    )  # fmt: skip
    return out


@njit(cache=True, error_model="numpy", nogil=True)
def _respond(f, h, first, last, direct, disturbance, out):  # type: ignore[no-untyped-def]
    x = np.zeros(f.shape[0])
    for t in range(out.shape[0]):
        out[t] = h @ x + direct @ disturbance[t]
        x = f @ x + first @ disturbance[t] + last @ disturbance[min(t + 1, out.shape[0] - 1)]


@njit(cache=True, error_model="numpy", nogil=True)
def _gain(p, h, variance, gains, new, deviations, k):  # type: ignore[no-untyped-def]
    """Gain of one output, and p after it; returns the relative change of the innovation's deviation."""
    n = p.shape[0]
    s = variance
    for i in range(n):
        new[i] = 0.0
    for j in range(n):
        weight = h[k, j]
        if weight != 0.0:
            for i in range(n):
                new[i] += p[j, i] * weight
    for i in range(n):
        s += h[k, i] * new[i]
    deviation = math.sqrt(s)
    change = abs(deviation / deviations[k] - 1.0)
    deviations[k] = deviation
    for i in range(n):
        moved = new[i] / s
        change = max(change, abs((moved - gains[k, i]) * h[k, i]))
        gains[k, i] = moved
        for j in range(n):
            p[i, j] -= moved * new[j]
    return change


@njit(cache=True, error_model="numpy", nogil=True)
def _smooth(f, h, process, variance, p, residual, lead):  # type: ignore[no-untyped-def]
    """States by Rauch, Tung and Striebel's smoother in Bryson and Frazier's form, (samples, n).

    Backward adjoint: lambda over the samples behind, so that no covariance is inverted.
    """
    samples, outputs = residual.shape
    n = f.shape[0]
    predicted, spreads = np.zeros((samples, n)), np.zeros((samples, n, n))
    gains, scales, errors = (
        np.zeros((samples, outputs, n)),
        np.zeros((samples, outputs)),
        np.zeros((samples, outputs)),
    )
    x, new, deviations = np.zeros(n), np.zeros(n), np.ones(outputs)
    for t in range(samples):
        predicted[t], spreads[t] = x, p
        for k in range(outputs):
            if t < lead or residual[t, k] != residual[t, k]:
                continue
            _gain(p, h, variance[k], gains[t], new, deviations, k)
            scales[t, k] = 1.0 / (deviations[k] * deviations[k])
            errors[t, k] = residual[t, k] - np.dot(h[k], x)
            x += gains[t, k] * errors[t, k]
        x = f @ x
        p = f @ p @ f.T + process
    out, behind = np.empty((samples, n)), np.zeros(n)
    for t in range(samples - 1, -1, -1):
        behind = f.T @ behind
        for k in range(outputs - 1, -1, -1):
            if scales[t, k] > 0.0:
                behind = behind + h[k] * (errors[t, k] * scales[t, k] - np.dot(gains[t, k], behind))
        out[t] = predicted[t] + spreads[t] @ behind
    return out
