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
from numpy.typing import NDArray

from wingwatch.diagnosis.linear_model import STATES, WIDTH, LinearModel, Noise
from wingwatch.diagnosis.replay import (
    BIAS,
    DISTURBANCES,
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
from wingwatch.kernels.decorators import compiled, helper
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


def _entries(matrix: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Rows, columns and values of what is not 0, which is little."""
    rows, columns = np.nonzero(matrix)
    return rows, columns, matrix[rows, columns]


class Change(NamedTuple):
    """Derivatives of a filter by parameters.

    Attributes:
        transition: transposed, (parameters, 22, 22).
        output: (parameters, used, 22).
        gain: (parameters, samples, used, 22).
    """

    transition: Array
    output: Array
    gain: Array


def change_of(base: Filter, others: Sequence[Filter], steps: Array) -> Change:
    """Differences of filters by their steps."""
    pairs = list(zip(others, steps, strict=True))
    return Change(
        np.array([(other.linear.transition - base.linear.transition).T / step for other, step in pairs]),
        np.array([(other.output - base.output) / step for other, step in pairs]),
        np.array([(other.gain - base.gain) / step for other, step in pairs]),
    )


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
    air, moves = _entries(linear.disturbance[:, STATES:]), _entries(linear.transition[STATES:, STATES:])
    _fly(
        (model.row, model.sensors, start, trims), inputs, measured, filtering.used, (air, moves, filtering.output),
        filtering.gain, filtering.deviation, path,
    )  # fmt: skip
    path.innovations[:, : filtering.given] = 0.0
    return path


def sensitivities(filtering: Filter, path: Path, change: Change) -> Array:
    """Change of a window's innovations by what changes its filter alone, (samples, used, parameters): equation (3)."""
    samples, used, width = *path.innovations.shape, len(change.output)
    columns = np.zeros((samples, used, width))
    for k in range(used):
        columns[:, k] -= path.before[:, k] @ change.output[:, k].T
    _differentiate(
        np.ascontiguousarray(filtering.linear.transition.T), filtering.output, filtering.gain, change.gain,
        path.after @ change.transition, columns, path,
    )  # fmt: skip
    columns[:, : filtering.given] = 0.0
    return columns


@compiled(error_model="numpy", nogil=True)
def _fly(version, inputs, measured, used, linear, gains, deviations, path):  # type: ignore[no-untyped-def]
    """Equation (2): the prediction by the simulation itself, the correction by the gains of equation (1)."""
    row, sensors, start, trims = version
    air, moves, h = linear
    samples, outputs = measured.shape
    c, work, x = with_trims(row, trims), work_space(inputs.steps), start.copy()
    blown, dx, read = np.zeros(WIDTH - STATES), np.zeros(WIDTH), np.empty(sensors.shape[0])
    here, there, later = np.zeros(DISTURBANCES), np.zeros(DISTURBANCES), np.zeros(WIDTH - STATES)
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
                e = measured[t, i] - (1.0 + sensors[k, SCALE]) * read[k] - sensors[k, BIAS] - _along(h, i, dx)
                for j in range(WIDTH):
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


@helper
def _multiply(entries, vector, out):  # type: ignore[no-untyped-def]
    """Product of ``_entries`` and a vector into ``out``."""
    rows, columns, values = entries
    out[:] = 0.0
    for n in range(values.size):
        out[rows[n]] += values[n] * vector[columns[n]]


@compiled(error_model="numpy", nogil=True, fastmath={"reassoc", "contract"})
def _along(h, i, vector):  # type: ignore[no-untyped-def]
    """Row ``i`` of h times a vector (22,), summed in any order: one after another each sum would wait for the last."""
    total = 0.0
    for j in range(WIDTH):
        total += h[i, j] * vector[j]
    return total


@compiled(error_model="numpy", nogil=True)
def _differentiate(f, h, gains, gain_changes, moved, columns, path):  # type: ignore[no-untyped-def]
    """Equation (3), in place: columns begin with what the changed outputs make of the states; f is Phi transposed."""
    samples, outputs, width = columns.shape
    x = np.zeros((width, WIDTH))
    for t in range(samples):
        at = min(t, gains.shape[0] - 1)
        for k in range(outputs):
            if not path.seen[t, k]:
                columns[t, k, :] = 0.0
                continue
            here = path.innovations[t, k]
            for c in range(width):
                e = columns[t, k, c] - _along(h, k, x[c])
                columns[t, k, c] = e
                for i in range(WIDTH):
                    x[c, i] += gains[at, k, i] * e + gain_changes[c, at, k, i] * here
        x = x @ f
        x += moved[:, t]


@compiled(error_model="numpy", nogil=True)
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


@helper
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


@helper
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
