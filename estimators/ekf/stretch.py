"""The filter's last stretch of signal rows, and its marks: what ``relinearise`` runs again is kept here."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["SOLUTIONS", "STRETCH_ROWS", "Singles", "advance_marks", "mark", "recalled", "remember", "weigh"]

Array = NDArray[np.float64]
Singles = NDArray[np.float32]

STRETCH_ROWS = 640
"""Rows that are kept at most."""

_LONG_ROWS, _LONG_S = 600, 12.0
"""A stretch of so many rows or so much time is cut at its second mark; that is set at half of it."""

SOLUTIONS = 64
"""Solutions within a stretch that are kept at most."""


@njit(cache=True)
def remember(signals, complete, rows, stretch, tally):  # type: ignore[no-untyped-def]
    """Complete rows (the first ``complete`` columns finite) join the stretch; beyond its size they are counted.

    In single precision, finer than any sensor resolves, the time since the row before in the place of the time.
    ``rows`` of ``EkfState``, before the filter takes the signals in.
    """
    for i in range(signals.shape[0]):
        before = rows[i, 0, 0]
        for k in range(signals.shape[1]):
            finite = True
            for c in range(complete):
                finite = finite and np.isfinite(signals[i, k, c])
            if not finite:
                continue
            r = tally[i, 0]
            if r < stretch.shape[1]:
                for c in range(1, signals.shape[2]):
                    stretch[i, r, c] = signals[i, k, c]
                since = signals[i, k, 0] - before
                stretch[i, r, 0] = since if np.isfinite(since) else 0.0
            before = signals[i, k, 0]
            tally[i, 0] += 1


def recalled(stretch: Singles, rows: int, before_s: float) -> Array:
    """Rows of the stretch as the filter takes them, (rows, columns); ``before_s``: time of the row before them."""
    signals = stretch[:rows].astype(np.float64)
    signals[:, 0] = np.cumsum(signals[:, 0]) + (before_s if np.isfinite(before_s) else 0.0)
    return signals


@njit(cache=True)
def weigh(noise, weighed):  # type: ignore[no-untyped-def]
    """Logarithms of the innovations' variances that noise levels make, by state and for the accelerometer, (ns + 1,).

    Of a level that wanders with Q a step, read with R, the prediction has the variance (Q + sqrt(Q^2 + 4 Q R)) / 2.
    """
    ns = weighed.size - 1
    for j in range(ns + 1):
        wander = noise[ns + 1] if j == 0 else 0.0
        weighed[j] = np.log(noise[j] + 0.5 * (wander + np.sqrt(wander * wander + 4.0 * wander * noise[j])))


@njit(cache=True)
def mark(m, z, cov, noise, rows, first, information, marks_z, marks_cov, marks_rows, weighed, about):  # type: ignore[no-untyped-def]
    """The present state as mark ``m`` of a vehicle (arrays as in ``EkfState``); what follows is linearised about it.

    ``information``: inverse of the derivatives' covariance.
    """
    k = about.shape[1]
    weigh(noise, weighed[m])
    for r in range(rows.shape[0]):
        for c in range(rows.shape[1]):
            marks_rows[m, r, c] = rows[r, c]
    for a in range(z.size):
        marks_z[m, a] = z[a]
        for b in range(z.size):
            marks_cov[m, a, b] = cov[a, b]
    for a in range(k):
        about[m, a, 0] = z[first + a]
        for b in range(k):
            about[m, a, 1 + b] = cov[first + a, first + b]
            about[m, a, 1 + k + b] = information[a, b]


@njit(cache=True)
def advance_marks(  # type: ignore[no-untyped-def]
    z, cov, noise, rows, information, stretch, tally, solved, marks_z, marks_cov, marks_rows, weighed, about, first,
    fresh,
):  # fmt: skip
    """Sets the second mark at half of the stretch; cuts it there when it is long, or ``fresh`` more might not fit."""
    count, span = tally[0], 0.0
    for r in range(1, count):
        span += abs(stretch[r, 0])
    full = count + fresh > stretch.shape[0] or tally[2] == solved.shape[0]
    if tally[1] == 0 and (full or 2 * count >= _LONG_ROWS or 2.0 * span >= _LONG_S):
        tally[1] = count
        mark(1, z, cov, noise, rows, first, information, marks_z, marks_cov, marks_rows, weighed, about)
    if not (full or count >= _LONG_ROWS or span >= _LONG_S):
        return
    cut, kept = tally[1], 0
    marks_z[0], marks_cov[0], marks_rows[0] = marks_z[1], marks_cov[1], marks_rows[1]
    weighed[0], about[0] = weighed[1], about[1]
    for s in range(tally[2]):
        if solved[s, 0] > cut:
            solved[kept] = solved[s]
            solved[kept, 0] -= cut
            kept += 1
    for r in range(count - cut):
        stretch[r] = stretch[r + cut]
    tally[0], tally[1], tally[2] = count - cut, count - cut, kept
    if count > cut:
        mark(1, z, cov, noise, rows, first, information, marks_z, marks_cov, marks_rows, weighed, about)
