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

from wingwatch.diagnosis.covariance import (
    Covariances,
    advance_covariances,
    in_rows,
    predict_covariances,
    settle,
    sparse,
)
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
from wingwatch.kernels.rows import ROW, add_row, add_rows
from wingwatch.simulation.dynamics import euler_angles

__all__ = [
    "Filter",
    "Path",
    "fly",
    "kalman_filter",
    "sensitivities",
]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


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
    index = np.array(used)
    samples = len(seen) if like is None else len(like.gain)
    gain, deviation = np.zeros((samples, index.size, WIDTH)), np.ones((samples, index.size))
    output = np.ascontiguousarray(linear.output[index])
    holds_from = int(np.flatnonzero(np.r_[True, (seen[1:] != seen[:-1]).any(axis=1)])[-1])
    them = _covariances([linear], [noise], index)
    count = settle(them, seen, gain, deviation, holds_from if like is None else samples)
    given = int(noise.any_force_x)
    deviation[:, :given] = 1.0
    return Filter(linear, index, output, gain[:count], deviation[:count], given)


def _entries(matrix: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Rows, columns and values of what is not 0, which is little."""
    rows, columns = np.nonzero(matrix)
    return rows, columns, matrix[rows, columns]


def _covariances(
    linear: Sequence[LinearModel], noises: Sequence[Noise], index: NDArray[np.int64]
) -> Covariances:
    """Before the first sample, of several versions of equation (1)."""
    both = [its.covariances(noise) for its, noise in zip(linear, noises, strict=True)]
    return Covariances(
        sparse(np.array([its.transition for its in linear])), sparse(np.array([its.output[index] for its in linear])),
        in_rows(np.array([process for process, _ in both])), np.array([n.sensors[index] ** 2 for n in noises]),
        in_rows(np.array([start for _, start in both])), np.zeros((WIDTH, ROW)), np.zeros((WIDTH, ROW)),
        np.zeros((1, ROW)),
    )  # fmt: skip


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
    of_outputs = sparse(filtering.output[None])
    _fly(
        (model.row, model.sensors, start, trims), inputs, measured, filtering.used, (air, moves, of_outputs),
        filtering.gain, filtering.deviation, path,
    )  # fmt: skip
    path.innovations[:, : filtering.given] = 0.0
    return path


def sensitivities(
    filtering: Filter,
    seen: Mask,
    versions: Sequence[tuple[LinearModel, Noise]],
    step: float,
    paths: Sequence[Path],
) -> tuple[Array, list[Array]]:
    """What changes a filter alone changes of its deviations and of the innovations of windows: equation (3).

    Args:
        filtering: of the windows.
        seen: which readings its gains are for, (samples, used).
        versions: equation (1) and noise, each one step along a parameter; at most ``ROW``.
        step: so long.
        paths: of the windows, with states of the air.

    Returns derivatives of ln of the deviations, (samples of gains, used, versions); of each window's innovations,
    (samples, used, versions).

    Raises:
        ValueError: more versions than a row has places.
    """
    if len(versions) > ROW:
        raise ValueError(f"{len(versions)} versions side by side; at most {ROW} have a place in a row")
    linear, noises = zip(*versions, strict=True)
    them = _covariances([filtering.linear, *linear], [noises[0], *noises], filtering.used)
    used, lengths = filtering.used.size, np.array([len(path.innovations) for path in paths])
    padded = [
        np.zeros((len(paths), lengths.max(), *np.shape(part)[1:]), np.asarray(part).dtype)
        for part in paths[0]
    ]
    for w, path in enumerate(paths):
        for whole, part in zip(padded, path, strict=True):
            whole[w, : lengths[w]] = part
    spreads = np.zeros((len(filtering.gain), used, ROW))
    columns = np.zeros((len(paths), lengths.max() * used, ROW))
    by_step = [(values[1:] - values[0]) / step for values in (them.transition.values, them.output.values)]
    differ = np.flatnonzero(by_step[0].any(axis=1) | by_step[1].any(axis=1))
    _differentiate(
        (filtering.gain, filtering.deviation), them, seen, step, (differ, *by_step), (lengths, Path(*padded)),
        spreads, columns,
    )  # fmt: skip
    columns = columns.reshape(len(paths), -1, used, ROW)[..., : len(versions)]
    spreads[:, : filtering.given], columns[:, :, : filtering.given] = 0.0, 0.0
    return spreads[..., : len(versions)], [columns[w, :length] for w, length in enumerate(lengths)]


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
                e = measured[t, i] - (1.0 + sensors[k, SCALE]) * read[k] - sensors[k, BIAS]
                for n in range(h.starts[i], h.starts[i + 1]):
                    e -= h.values[0, n] * dx[h.columns[n]]
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
            roll, pitch, heading = euler_angles(x)
            set_attitude(x, roll + dx[6], pitch + dx[7], heading)
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


@compiled(error_model="numpy", nogil=True)
def _differentiate(base, them, seen, step, differences, windows, spreads, columns):  # type: ignore[no-untyped-def]
    """Equation (3) for all versions side by side, sample by sample with the covariances: their gains are not kept.

    ``them``: the filter's own version, then the others; ``differences``: which of these have another equation (1), and
    its derivatives; ``columns``: (windows, samples * used, ROW).
    """
    (gains, deviations), (lengths, paths) = base, windows
    outputs, versions = deviations.shape[1], them.variance.shape[0] - 1
    now, spread = np.zeros((versions, outputs, WIDTH)), np.ones((versions, outputs))
    changes, x, work = (
        np.zeros((outputs * WIDTH, ROW)),
        np.zeros((lengths.size, WIDTH, ROW)),
        np.zeros((WIDTH, ROW)),
    )
    for t in range(paths.innovations.shape[1]):
        at = min(t, gains.shape[0] - 1)
        for v in range(versions):
            if t > at:
                break  # all gains hold
            advance_covariances(them, v + 1, seen[t], now[v], spread[v])
            predict_covariances(them, v + 1)
            for k in range(outputs):
                if seen[t, k]:
                    spreads[t, k, v] = math.log(spread[v, k] / deviations[t, k]) / step
                    for i in range(WIDTH):
                        changes[k * WIDTH + i, v] = (now[v, k, i] - gains[t, k, i]) / step
        for w in range(lengths.size):
            if t < lengths[w]:
                _take(them, gains[at], changes, differences, (paths, w, t), x[w], work, columns[w])


@helper
def _take(them, gain, changes, differences, here, x, work, columns):  # type: ignore[no-untyped-def]
    """Equation (3) over one sample of a window: its rows of ``columns``, and x (22, ROW) advanced."""
    (differ, by_transition, by_output), (paths, w, t) = differences, here
    outputs, (starts, places, values) = gain.shape[0], them.output
    weights = values[0]
    for k in range(outputs):
        if not paths.seen[w, t, k]:
            continue
        row, innovation = t * outputs + k, paths.innovations[w, t, k]
        for n in range(starts[k], starts[k + 1]):
            for v in differ:
                columns[row, v] -= by_output[v, n] * paths.before[w, t, k, places[n]]
            add_row(columns, row, -weights[n], x, places[n])
        for i in range(WIDTH):
            add_row(x, i, gain[k, i], columns, row)
            add_row(x, i, innovation, changes, k * WIDTH + i)
    starts, places, values = them.transition
    weights = values[0]
    work[:] = 0.0
    for i in range(WIDTH):
        add_rows(work, i, weights, places, starts[i], starts[i + 1], x)
        for n in range(starts[i], starts[i + 1]):
            for v in differ:
                work[i, v] += by_transition[v, n] * paths.after[w, t, places[n]]
    x[:] = work
