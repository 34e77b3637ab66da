"""The filter's window of recent signal rows, and its checkpoints: what ``relinearise`` runs again is kept here."""

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.state import ACCELERATION, ALPHA, ALTITUDE, NEWEST, TIME, VANE, EkfState
from wingwatch.kernels.copying import copy_into
from wingwatch.kernels.decorators import helper, part, whole

__all__ = [
    "FIRST",
    "NOT_KEPT",
    "SOLUTIONS",
    "WINDOW_ROWS",
    "advance_checkpoints",
    "begin_window",
    "cut_at",
    "empty_window",
    "innovation_log_variance",
    "recalled",
    "remember",
    "set_checkpoint",
]

Array = NDArray[np.float64]

WINDOW_ROWS = 640
"""Rows that are kept at most."""

_LONG_ROWS, _LONG_S = 600, 12.0
"""A window of so many rows or so much time is cut at its second checkpoint; that is set at half of it."""

NOT_KEPT = 2
"""Columns of a signal row that are not kept (``_is_kept``)."""

SOLUTIONS = 64
"""Solutions within a window that are kept at most."""

FIRST, SECOND = np.int64(0), np.int64(1)
"""The checkpoints of a window. Not Python's integers: for each of them a kernel would be compiled anew."""


@part
def _is_kept(c, kinematic):  # type: ignore[no-untyped-def]
    """Whether a column of a signal row is kept: not the altitude, which the filter only reports, nor whether there was
    a vane, which the sign of the time says."""
    return c != kinematic + ALTITUDE and c != kinematic + VANE


@whole
def remember(signals, lanes, kinematic, state_rows, rows, filled):  # type: ignore[no-untyped-def]
    """Complete rows join the window; beyond its size they are counted.

    In single precision, finer than any sensor resolves. In the time's place stands the time since the row before,
    negative where no vane measured.

    Args:
        signals: (vehicles, samples, columns), of ``lanes``.
        kinematic: column of the kinematic term; a row is complete where all up to the angle of attack are finite.
        state_rows: of ``EkfState``, before the filter takes the signals in.
        rows, filled: of ``Window``.
    """
    for m in range(lanes.place.size):
        i = lanes.place[m]
        before = state_rows[i, NEWEST, TIME]
        for k in range(lanes.counts[m]):
            finite = True
            for c in range(kinematic + ALPHA):
                finite = finite and np.isfinite(signals[m, k, c])
            if not finite:
                continue
            r, kept = filled[i], 1
            if r < rows.shape[1]:
                for c in range(1, signals.shape[2]):
                    if _is_kept(c, kinematic):
                        rows[i, r, kept] = signals[m, k, c]
                        kept += 1
                since = signals[m, k, TIME] - before
                since = since if np.isfinite(since) else 0.0
                rows[i, r, TIME] = math.copysign(since, signals[m, k, kinematic + VANE] - 0.5)
            before = signals[m, k, TIME]
            filled[i] += 1


def recalled(rows: NDArray[np.float32], before_s: float, kinematic: int) -> Array:
    """Rows of the window as the filter takes them, (rows, columns); the altitude is 0.

    Args:
        rows: (rows, columns kept); before_s: time of the row before them.
        kinematic: column of the kinematic term.
    """
    signals, altitude, vane = np.zeros((len(rows), rows.shape[1] + 2)), kinematic + ALTITUDE, kinematic + VANE
    signals[:, :altitude], signals[:, altitude + 1 : vane] = rows[:, :altitude], rows[:, altitude : vane - 1]
    signals[:, vane + 1 :] = rows[:, vane - 1 :]
    signals[:, vane] = ~np.signbit(rows[:, TIME])
    since = np.abs(rows[:, TIME], dtype=np.float64)
    signals[:, TIME] = np.cumsum(since) + (before_s if np.isfinite(before_s) else 0.0)
    return signals


@helper
def innovation_log_variance(model, state, i, out):  # type: ignore[no-untyped-def]
    """Logarithms of the innovations' variances of vehicle i, by state and for the accelerometer, (ns + 1,).

    Of a random walk with Q a step, read with R, the prediction has the variance (Q + sqrt(Q^2 + 4 Q R)) / 2. An
    unmeasured acceleration that lasts T moves a rate by T times what drives it a step.
    """
    reading, unmeasured, airspeed = state.noise.reading[i], state.noise.unmeasured[i], state.condition[i, 1]
    lasts_s = 0.0
    if model.sizes.gusts > 0 and airspeed > 0.0:
        lasts_s = model.gust_length_m[ACCELERATION] / airspeed
    for j in range(out.size):
        walk = state.noise.gust[i] if j == 0 else 0.0
        if 0 < j < unmeasured.size:
            walk = unmeasured[j] * lasts_s * lasts_s
        out[j] = np.log(reading[j] + 0.5 * (walk + np.sqrt(walk * walk + 4.0 * walk * reading[j])))


@helper
def set_checkpoint(model, state, i, checkpoints, m):  # type: ignore[no-untyped-def]
    """A vehicle's present state as its checkpoint ``m``; what follows is linearised about it."""
    k = state.vector.shape[1]
    first = state.z.shape[1] - k - state.noise.reading.shape[1] + 1
    innovation_log_variance(model, state, i, checkpoints.log_variance[i, m])
    copy_into(state.rows[i], checkpoints.rows[i, m])
    copy_into(state.z[i], checkpoints.z[i, m])
    copy_into(state.cov[i], checkpoints.cov[i, m])
    copy_into(state.z[i, first : first + k], checkpoints.value[i, m])
    copy_into(state.cov[i, first : first + k, first : first + k], checkpoints.covariance[i, m])
    copy_into(state.information[i], checkpoints.information[i, m])
    levels, noise = checkpoints.levels, state.noise
    levels.accelerometer[i, m] = noise.reading[i, noise.reading.shape[1] - 1]
    levels.gain[i, m] = noise.gain[i]
    copy_into(noise.fisher[i], levels.fisher[i, m])
    copy_into(noise.unmeasured[i], levels.unmeasured[i, m])
    copy_into(state.moment_level.information[i], levels.information[i, m])


@helper
def empty_window(window, i):  # type: ignore[no-untyped-def]
    """Nothing that came before is run again."""
    window.filled[i] = window.middle[i] = window.solutions[i] = window.skipped[i] = 0


@helper
def begin_window(model, state, i):  # type: ignore[no-untyped-def]
    """What follows may be run again from here, nothing before it."""
    empty_window(state.window, i)
    set_checkpoint(model, state, i, state.window.checkpoints, FIRST)


@part
def _cut(window, i):  # type: ignore[no-untyped-def]
    """The window begins at its second checkpoint, which moves to the first one's place."""
    cut, points, kept = window.middle[i], window.checkpoints, 0
    levels = points.levels
    copy_into(points.z[i, 1], points.z[i, 0])
    copy_into(points.cov[i, 1], points.cov[i, 0])
    copy_into(points.rows[i, 1], points.rows[i, 0])
    copy_into(points.log_variance[i, 1], points.log_variance[i, 0])
    copy_into(points.value[i, 1], points.value[i, 0])
    copy_into(points.covariance[i, 1], points.covariance[i, 0])
    copy_into(points.information[i, 1], points.information[i, 0])
    copy_into(levels.fisher[i, 1], levels.fisher[i, 0])
    copy_into(levels.unmeasured[i, 1], levels.unmeasured[i, 0])
    copy_into(levels.information[i, 1], levels.information[i, 0])
    levels.accelerometer[i, 0], levels.gain[i, 0] = levels.accelerometer[i, 1], levels.gain[i, 1]
    for s in range(window.solutions[i]):
        if window.ends[i, s] > cut:
            window.ends[i, kept] = window.ends[i, s] - cut
            window.keep[i, kept] = window.keep[i, s]
            copy_into(window.resting[i, s], window.resting[i, kept])
            kept += 1
    rows = window.rows[i]
    left = window.filled[i] - cut
    for r in range(left):
        copy_into(rows[r + cut], rows[r])
    window.filled[i], window.middle[i], window.solutions[i] = left, left, kept
    window.skipped[i] = max(window.skipped[i] - cut, 0)


@part
def advance_checkpoints(model, state, i, fresh):  # type: ignore[no-untyped-def]
    """Sets the second checkpoint at half of the window; cuts it there when it is long or cannot take ``fresh`` more."""
    window = state.window
    count, span, rows = window.filled[i], 0.0, window.rows[i]
    for r in range(1, count):
        span += abs(rows[r, TIME])
    full = count + fresh > rows.shape[0] or window.solutions[i] == window.ends.shape[1]
    if window.middle[i] == 0 and (full or 2 * count >= _LONG_ROWS or 2.0 * span >= _LONG_S):
        window.middle[i] = count
        set_checkpoint(model, state, i, window.checkpoints, SECOND)
    if not (full or count >= _LONG_ROWS or span >= _LONG_S):
        return
    cut = window.middle[i]
    _cut(window, i)
    if count > cut:
        set_checkpoint(model, state, i, window.checkpoints, SECOND)


def cut_at(state: EkfState, before: int) -> None:
    """The window of a batch of one loses all up to the end of its first ``before`` solutions; the caller sets its first
    checkpoint."""
    window = state.window
    count, solutions = int(window.filled[0]), int(window.solutions[0])
    cut = int(window.ends[0, before - 1]) if before > 0 else 0
    left, kept = count - cut, solutions - before
    window.rows[0, :left] = window.rows[0, cut:count].copy()
    for array in (window.ends, window.keep, window.resting):
        array[0, :kept] = array[0, before:solutions].copy()
    window.ends[0, :kept] -= cut
    window.filled[0], window.middle[0], window.solutions[0] = left, 0, kept
    window.skipped[0] = max(int(window.skipped[0]) - cut, 0)
