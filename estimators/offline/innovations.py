"""Innovations of a small Kalman filter over one window of samples, compiled.

Readings are taken one after another (their noises are independent), so no matrix is inverted. The covariance does not
depend on the data: once the gain of a full set of readings has settled it is kept until a reading is missing. Which
samples renewed it is noted, so that filters with parameters a little different do as the first did, and their
innovations differ by what the parameters make of them and by nothing else.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import compiled, helper

__all__ = ["Record", "System", "Trace", "empty_trace", "filter_columns", "innovations", "respond"]

Array = NDArray[np.float64]

_SETTLED = 1e-7
"""A gain has settled where its change over a step moves no predicted reading by more than this part of its noise."""


class System(NamedTuple):
    """The filter's model over one window, at the few levels of dynamic pressure that it went through.

    Attributes:
        level: at each sample and over the step after it, (samples,).
        transition: F of each level, (levels, n, n).
        noise: Q, (levels, n, n).
        early, late: what the forcing at a step's start and at its end adds to the first states, (levels, s, forcings).
        output: C, (levels, channels, n).
        direct: what the readings have of the forcing at once, nothing of it in the first s, (channels, forcings).
        variance: R of each channel, (channels,).
        covariance: P before the first reading, (n, n).
    """

    level: NDArray[np.int64]

    transition: Array
    noise: Array
    early: Array
    late: Array
    output: Array
    direct: Array
    variance: Array
    covariance: Array


class Record(NamedTuple):
    """What a filter is given of one window; times are those of the samples.

    Attributes:
        readings: (samples, channels).
        used: whether a reading is there, (samples, channels).
        start, end: forcing at the beginning and at the end of the step after each sample, (samples, forcings).
        state: at the first sample, before its readings, (n,).
    """

    readings: Array
    used: NDArray[np.bool_]
    start: Array
    end: Array
    state: Array


class Trace(NamedTuple):
    """What a filter leaves of one window.

    Attributes:
        innovations, variances: e and s of every reading, (samples, channels); 0 and 1 where there is none.
        gains: K of every reading, (samples, channels, n).
        renewed: whether the covariance was computed anew at a sample, (samples,).
    """

    innovations: Array
    variances: Array
    gains: Array
    renewed: NDArray[np.bool_]


def empty_trace(samples: int, channels: int, states: int) -> Trace:
    """Memory for ``innovations``."""
    shape = (samples, channels)
    return Trace(
        np.zeros(shape), np.ones(shape), np.zeros((*shape, states)), np.ones(samples, dtype=np.bool_)
    )


@helper
def _places(matrix):  # type: ignore[no-untyped-def]
    """Columns of the entries that are not zero, row by row, and how many: most of a transition is, at any level."""
    n = matrix.shape[0]
    count, where = np.zeros(n, dtype=np.int64), np.zeros((n, n), dtype=np.int64)
    for i in range(n):
        for j in range(n):
            if matrix[i, j] != 0.0:
                where[i, count[i]] = j
                count[i] += 1
    return count, where


@helper
def _spread(f, noise, p, work, count, where):  # type: ignore[no-untyped-def]
    """P = F P F' + Q, in place."""
    n = p.shape[0]
    for i in range(n):
        for j in range(n):
            work[i, j] = 0.0
        for at in range(count[i]):
            c = where[i, at]
            factor = f[i, c]
            for j in range(n):
                work[i, j] += factor * p[c, j]
    for i in range(n):
        for j in range(i + 1):
            total = noise[i, j]
            for at in range(count[j]):
                c = where[j, at]
                total += work[i, c] * f[j, c]
            p[i, j] = total
            p[j, i] = total


@helper
def _advance(system, start, end, t, x, old):  # type: ignore[no-untyped-def]
    """x from sample t - 1 to t, in place."""
    n, at = x.size, system.level[t - 1]
    for i in range(n):
        old[i] = x[i]
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += system.transition[at, i, j] * old[j]
        x[i] = total
    for i in range(system.early.shape[1]):
        for m in range(start.shape[1]):
            x[i] += system.early[at, i, m] * start[t - 1, m]
            x[i] += system.late[at, i, m] * end[t - 1, m]


@helper
def _predicted(system, start, t, q, x):  # type: ignore[no-untyped-def]
    """Reading of channel q at sample t."""
    total = 0.0
    for m in range(start.shape[1] if q >= system.early.shape[1] else 0):
        total += system.direct[q, m] * start[t, m]
    for i in range(x.size):
        total += system.output[system.level[t], q, i] * x[i]
    return total


@helper
def _read(system, trace, t, q, p, before):  # type: ignore[no-untyped-def]
    """Gain and innovation variance of channel q at sample t, and P after it; returns the change of the gain by
    what it does to predicted readings, in their noises."""
    n, at = p.shape[0], system.level[t]
    gain = trace.gains[t, q]
    s = system.variance[q]
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += p[i, j] * system.output[at, q, j]
        gain[i] = total
        s += total * system.output[at, q, i]
    for i in range(n):
        gain[i] /= s
    change = 0.0
    for c in range(system.variance.size):
        moved = 0.0
        for i in range(n):
            moved += system.output[at, c, i] * (gain[i] - before[i])
        change = max(change, abs(moved) * np.sqrt(s / system.variance[c]))
    for i in range(n):
        for j in range(i + 1):
            p[i, j] -= gain[i] * gain[j] * s
            p[j, i] = p[i, j]
    trace.variances[t, q] = s
    return change


@compiled()
def innovations(system, record, trace, lead):  # type: ignore[no-untyped-def]
    """Run the filter over a window.

    Args:
        system: see ``System``; record: see ``Record``.
        trace: filled. ``renewed`` is filled where ``lead``, and followed where not.
        lead: whether this filter decides when its covariance has settled.
    """
    samples, channels = record.readings.shape
    n = record.state.size
    x, old, p, work = record.state.copy(), np.zeros(n), system.covariance.copy(), np.zeros((n, n))
    count, where = _places(system.transition[0])
    settled = False
    for t in range(samples):
        same = t > 0
        if t > 0:
            _advance(system, record.start, record.end, t, x, old)
            same = system.level[t] == system.level[t - 1]
            for q in range(channels):
                same = same and record.used[t, q] == record.used[t - 1, q]
        if lead:
            trace.renewed[t] = not (settled and same)
        if trace.renewed[t] and t > 0:
            # after samples that kept their gain P is that of the last renewed one: settled, so still right
            at = system.level[t - 1]
            _spread(system.transition[at], system.noise[at], p, work, count, where)
        change = 0.0
        for q in range(channels):
            if not record.used[t, q]:
                continue
            if trace.renewed[t]:
                change = max(change, _read(system, trace, t, q, p, trace.gains[max(t - 1, 0), q]))
            else:
                trace.variances[t, q] = trace.variances[t - 1, q]
                trace.gains[t, q] = trace.gains[t - 1, q]
            e = record.readings[t, q] - _predicted(system, record.start, t, q, x)
            trace.innovations[t, q] = e
            for i in range(n):
                x[i] += trace.gains[t, q, i] * e
        settled = same and change <= _SETTLED


@compiled()
def respond(system, start, end, state):  # type: ignore[no-untyped-def]
    """Readings that forcing and a state at the first sample make, without noise or correction.

    Args:
        system: for its transition, forcing and output.
        start, end, state: as in ``Record``.

    Returns:
        (samples, channels).
    """
    samples, channels = start.shape[0], system.output.shape[1]
    n = system.transition.shape[1]
    x, old, readings = state.copy(), np.zeros(n), np.zeros((samples, channels))
    for t in range(samples):
        if t > 0:
            _advance(system, start, end, t, x, old)
        for q in range(channels):
            readings[t, q] = _predicted(system, start, t, q, x)
    return readings


@compiled()
def filter_columns(system, trace, used, readings):  # type: ignore[no-untyped-def]
    """Readings of any number of columns sent through the filter of a trace, from rest, in place.

    Args:
        system: for its transition and output; trace: for its gains.
        used: (samples, channels).
        readings: (columns, samples, channels); becomes the innovations.
    """
    columns, samples, channels = readings.shape
    n = system.transition.shape[1]
    x, old = np.zeros(n), np.zeros(n)
    for c in range(columns):
        for i in range(n):
            x[i] = 0.0
        for t in range(samples):
            if t > 0:
                for i in range(n):
                    old[i] = x[i]
                for i in range(n):
                    total = 0.0
                    for j in range(n):
                        total += system.transition[system.level[t - 1], i, j] * old[j]
                    x[i] = total
            for q in range(channels):
                if not used[t, q]:
                    readings[c, t, q] = 0.0
                    continue
                e = readings[c, t, q]
                for i in range(n):
                    e -= system.output[system.level[t], q, i] * x[i]
                readings[c, t, q] = e
                for i in range(n):
                    x[i] += trace.gains[t, q, i] * e
