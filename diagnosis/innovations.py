"""Innovations of a flight: what a version of the simulation, corrected by all readings before, says wrongly.

The simulation itself predicts from sample to sample, flying through the air as it is known so far; every reading
corrects its states and the air by the gains of a Kalman filter of equation (1) (``linear_model``). So only what is not
known yet is linearised. The filter looks back only: what an autopilot makes of a gust is no evidence of anything. With
the simulation f, g, its states and the air x, the outputs k one after another,

    e_k = y_k - g_k(x) - h_k dx,   dx <- dx + K_k e_k;   after the last output   x' = f(x + dx).                (2)

This is the filter error method (Maine and Iliff 1981; Jategaonkar 2015, chapter 5). What changes the filter alone
changes the innovations by the derivative of (2), linearised, for all such parameters c side by side:

    e_k,c = - h_k,c x - h_k x_c,   x_c <- x_c + K_k,c e_k + K_k e_k,c;   x_c' = Phi x_c + Phi_c x.              (3)

docs/methods/diagnosis.md, section 2.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.diagnosis.linear_model import STATES, WIDTH, LinearModel, Noise
from wingwatch.diagnosis.replay import (
    BIAS,
    SCALE,
    Inputs,
    Model,
    follow,
    move,
    read_sensors,
    ready,
    set_attitude,
    with_trims,
    work_space,
)
from wingwatch.simulation.dynamics import euler_angles

__all__ = [
    "Change",
    "Filter",
    "Path",
    "change_of",
    "fly",
    "kalman_filter",
    "sensitivities",
]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_HOLDS = 1e-4
"""Relative change of gains below which they hold."""


class Filter(NamedTuple):
    """A Kalman filter of equation (1).

    Attributes:
        linear: equation (1).
        used: outputs that count, (used,); output: equation (1)'s, (used, 22).
        gain: (samples, used, 22), the last one holds from then on; deviation: of the innovations, (samples, used).
        given: how many outputs, the first, move the aircraft instead of being predicted: they correct the states, and
            their innovations are no evidence, 0 with a deviation of 1.
    """

    linear: LinearModel
    used: NDArray[np.int64]
    output: Array
    gain: Array
    deviation: Array
    given: int


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
    given = int(noise.any_force_x)
    deviation[:, :given] = 1.0
    return Filter(linear, index, output, gain[:count], deviation[:count], given)


class Change(NamedTuple):
    """Derivatives of a filter by parameters.

    Attributes:
        transition: transposed, (22, 22, parameters).
        output: (used, 22, parameters).
        gain: (samples, used, 22, parameters).
    """

    transition: Array
    output: Array
    gain: Array


def change_of(base: Filter, others: Sequence[Filter], steps: Array) -> Change:
    """Differences of filters by their steps."""
    samples, used, _ = base.gain.shape
    change = Change(
        np.zeros((WIDTH, WIDTH, len(others))),
        np.zeros((used, WIDTH, len(others))),
        np.zeros((samples, used, WIDTH, len(others))),
    )
    for i, other in enumerate(others):
        change.transition[..., i] = (other.linear.transition - base.linear.transition).T / steps[i]
        change.output[..., i] = (other.output - base.output) / steps[i]
        change.gain[..., i] = (other.gain - base.gain) / steps[i]
    return change


class Path(NamedTuple):
    """A window flown with its filter.

    Attributes:
        innovations: (samples, used), 0 where nothing was measured; deviation: of them, 1 there.
        seen: where something was measured.
        before: states of the air before each output, (samples, used, 22), 0 of the motion; after: the last, (samples,
            22); empty where they were not asked for.
    """

    innovations: Array
    deviation: Array
    seen: Mask
    before: Array
    after: Array


def fly(
    filtering: Filter,
    model: Model,
    start: Array,
    trims: Array,
    inputs: Inputs,
    measured: Array,
    seen: Mask,
    *,
    air_too: bool = False,
) -> Path:
    """A window flown by a version of the simulation, its states corrected by every reading: equation (2).

    Args:
        filtering: of the version.
        model: the version.
        start: rigid-body state (13,); trims: of the window, (6,).
        inputs: of the window.
        measured: the outputs that count, (samples, used); seen: which readings count.
        air_too: whether states of the air are recorded; else they are empty.
    """
    samples, used = measured.shape
    recorded = samples if air_too else 0
    path = Path(
        np.zeros((samples, used)), np.ones((samples, used)), seen, np.zeros((recorded, used, WIDTH)),
        np.zeros((recorded, WIDTH)),
    )  # fmt: skip
    linear = filtering.linear
    air = np.ascontiguousarray(linear.disturbance[:, STATES:])
    moves = np.ascontiguousarray(linear.transition[STATES:, STATES:])
    _fly(
        (model.row, model.sensors, start, trims), inputs, measured, filtering.used, (air, moves, filtering.output),
        filtering.gain, filtering.deviation, path,
    )  # fmt: skip
    path.innovations[:, : filtering.given] = 0.0
    return path


def sensitivities(filtering: Filter, path: Path, change: Change) -> Array:
    """Change of a window's innovations by what changes its filter alone, (samples, used, parameters): equation (3)."""
    samples, used, width = *path.innovations.shape, change.output.shape[-1]
    columns = np.zeros((samples, used, width))
    for k in range(used):
        columns[:, k] -= path.before[:, k] @ change.output[k]
    moved = (path.after @ change.transition.reshape(WIDTH, -1)).reshape(samples, WIDTH, width)
    _differentiate(
        filtering.linear.transition, filtering.output, filtering.gain, change.gain, moved, columns, path
    )
    columns[:, : filtering.given] = 0.0
    return columns


@njit(cache=True, error_model="numpy", nogil=True)
def _fly(version, inputs, measured, used, linear, gains, deviations, path):  # type: ignore[no-untyped-def]
    """Equation (2): the prediction by the simulation itself, the correction by the gains of equation (1)."""
    row, sensors, start, trims = version
    air, moves, h = linear
    samples, outputs = measured.shape
    c, work, x = with_trims(row, trims), work_space(inputs.steps), start.copy()
    blown, dx, read = np.zeros(moves.shape[0]), np.zeros(STATES + moves.shape[0]), np.empty(sensors.shape[0])
    here, there, later = np.zeros(air.shape[0]), np.zeros(air.shape[0]), np.zeros(blown.size)
    ready(c, inputs, work)
    for t in range(samples):
        at = min(t, gains.shape[0] - 1)
        follow(x, inputs.follow[t], inputs.follow[t])
        read_sensors(c, x, inputs, t, work, here, read)
        dx[:] = 0.0
        for i in range(outputs):
            if path.before.shape[0] > 0:
                for j in range(blown.size):
                    path.before[t, i, STATES + j] = blown[j] + dx[STATES + j]
            if path.seen[t, i]:
                k = used[i]
                e = measured[t, i] - (1.0 + sensors[k, SCALE]) * read[k] - sensors[k, BIAS]
                for j in range(dx.size):
                    e -= h[i, j] * dx[j]
                for j in range(dx.size):
                    dx[j] += gains[at, i, j] * e
                path.innovations[t, i], path.deviation[t, i] = e, deviations[at, i]
        for j in range(blown.size):
            blown[j] += dx[STATES + j]
        if path.after.shape[0] > 0:
            path.after[t, STATES:] = blown
        for j in range(3):
            x[3 + j] += dx[j]
            x[10 + j] += dx[3 + j]
        if dx[6] != 0.0 or dx[7] != 0.0:
            roll, pitch, _ = euler_angles(x)
            set_attitude(x, roll + dx[6], pitch + dx[7])
        _multiply(air, blown, here)
        _multiply(moves, blown, later)
        blown[:] = later
        _multiply(air, blown, there)
        move(c, x, inputs, t, work, here, there)
        here[:] = there


@njit(cache=True, error_model="numpy", nogil=True)
def _multiply(matrix, vector, out):  # type: ignore[no-untyped-def]
    """Their product into ``out``; a library's call costs more than so small a product."""
    for i in range(matrix.shape[0]):
        total = 0.0
        for j in range(vector.size):
            total += matrix[i, j] * vector[j]
        out[i] = total


@njit(cache=True, error_model="numpy", nogil=True)
def _differentiate(f, h, gains, gain_changes, moved, columns, path):  # type: ignore[no-untyped-def]
    """Equation (3), in place: columns begin with what the changed outputs make of the states."""
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
                for c in range(width):
                    x[i, c] += gains[at, k, i] * e[c] + gain_changes[at, k, i, c] * here
        x = f @ x
        x += moved[t]


@njit(cache=True, error_model="numpy", nogil=True)
def _settle(f, h, covariances, seen, gain, deviation, holds_from):  # type: ignore[no-untyped-def]
    """Gains and deviations of every sample until they hold; how many samples these are.

    Covariances of the processes' noise (n, n), of the outputs' (used,), of the states before the first sample (n, n).
    """
    process, variance, p = covariances
    samples, outputs = deviation.shape
    n = f.shape[0]
    new, half, whole = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
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
        _times(f, p, half)
        for i in range(n):
            for j in range(n):
                whole[i, j] = half[j, i]
        _times(f, whole, p)
        for i in range(n):
            for j in range(n):
                p[i, j] += process[i, j]
    return samples


@njit(cache=True, error_model="numpy", nogil=True)
def _times(f, p, out):  # type: ignore[no-untyped-def]
    """f p into ``out``; two thirds of f are nothing."""
    n = p.shape[0]
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.0
        for k in range(n):
            weight = f[i, k]
            if weight != 0.0:
                for j in range(n):
                    out[i, j] += weight * p[k, j]


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
