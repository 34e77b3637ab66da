"""Signals as the recursion takes them: on an even clock, in half seconds, as deviations from a record's beginning.

The first two seconds of a record are kept until they are all there. Their median step is the clock's; their medians are
what everything is a deviation from; their second differences say how noisy the readings are. Then rows go half second
by half second. Where rows are missing the forcing goes on a line and nothing is read; a gap of more than MAX_GAP_S
begins a new record. A surface that only its sensor's noise moves within a half second is taken at its level.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.telemetry import MAX_GAP_S

__all__ = [
    "BLOCK_ROWS",
    "WARM_ROWS",
    "Columns",
    "Intake",
    "begins",
    "block_rows",
    "regrid",
    "take_rows",
    "to_rows",
]

Array = NDArray[np.float64]

BLOCK_S, WARM_S = 0.5, 2.0

BLOCK_ROWS = 100
"""Rows of a half second at most: above 200 Hz a block is shorter."""

WARM_ROWS = 4 * BLOCK_ROWS

_OFF_CLOCK, _OFF_ROWS = 0.3, 25
"""So many rows in succession that are off the clock by so much of a step: the rate is another."""

_CHANCE = 4.753
"""Normal quantile of 1 - 1e-6: that noise alone scatters more."""

_DRIFT = 4.0
"""Errors of its mean by which a level may stray and still be one level."""

_POOLED = 0.95
"""What is left of a half second's scatter after the next: ten seconds."""

_AFTER = 6.0
"""Half seconds after one in which a surface moved, in which it may go on moving by less than its noise: an autopilot
answers as long as the motion lasts."""

_LEAST_VARIANCE = 1e-12
"""Of a reading that does not change during the first two seconds."""

WAITING, BLOCK, RECORD, LOST = 0, 1, 2, 3


class Columns(NamedTuple):
    """Where things stand in a row of signals, and what is known of them.

    Attributes:
        states, inputs, channels: of the structure.
        accelerometer, first_input, kinematic, known_moments: columns.
        reference: airspeed and density that derivatives are referred to.
        forward, down: turning speed of the force equation by each state, of the forward and the downward speed,
            (states,) each.
        held: whether each input is held between samples, (inputs,).
        input_variance: of each input's noise, (inputs,).
    """

    states: int
    inputs: int
    channels: int
    accelerometer: int
    first_input: int
    kinematic: int
    known_moments: int
    reference: Array
    forward: Array
    down: Array
    held: NDArray[np.bool_]
    input_variance: Array


class Intake(NamedTuple):
    """Of all vehicles.

    Attributes:
        pending: rows that wait, the last column saying whether they were measured, (vehicles, WARM_ROWS, columns + 1).
        tally: rows that wait; whether a record has begun; rows off the clock in succession; samples in all,
            (vehicles, 4).
        clock: step, s; last stamp; (vehicles, 2).
        last: last measured row, (vehicles, columns).
        origin: medians that began the record, (vehicles, columns).
        inputs: of the last row that went, then level and samples of each one's last rest, and squares
            and degrees of freedom of its scatter while it seemed to rest, half seconds in which it may go on moving,
            (vehicles, 6, inputs).
        spread: sum of squares and number of each reading, (vehicles, 2, channels).
        noise: of each reading as the first two seconds show it, variance, (vehicles, channels).
    """

    pending: Array
    tally: NDArray[np.int64]
    clock: Array
    last: Array
    origin: Array
    inputs: Array
    spread: Array
    noise: Array


@njit(cache=True)
def block_rows(step):  # type: ignore[no-untyped-def]
    """Rows of half a second."""
    return min(max(int(np.round(BLOCK_S / step)), 2), BLOCK_ROWS)


@njit(cache=True)
def _is_whole(columns, row):  # type: ignore[no-untyped-def]
    for c in range(columns.kinematic + 4):
        if not np.isfinite(row[c]) and not (
            c == columns.accelerometer and columns.channels == columns.states
        ):
            return False
    return True


@njit(cache=True)
def _take(columns, intake, i, row):  # type: ignore[no-untyped-def]
    """One row of vehicle i; says whether rows wait to be worked on (BLOCK), a record can begin (RECORD), or the
    record has ended (LOST) and the row is to be given once more."""
    if not _is_whole(columns, row):
        return WAITING
    count, clock, last = intake.tally[i], intake.clock[i], intake.last[i]
    if count[3] > 0:
        dt = row[0] - clock[1]
        if dt == 0.0:
            return WAITING
        if not 0.0 < dt <= MAX_GAP_S:
            count[3] = 0
            count[2] = 0
            return LOST
    if count[1] == 0:
        _append(intake, i, row, 1.0)
        first = intake.pending[i, 0, 0]
        full = count[0] == WARM_ROWS
        spans = count[0] > 8 and (row[0] - first) * count[0] / (count[0] - 1.0) >= WARM_S * (1.0 - 1e-6)
        _keep(intake, i, row)
        return RECORD if full or spans else WAITING
    steps = (row[0] - clock[1]) / clock[0]
    whole = max(int(np.round(steps)), 1)
    count[2] = count[2] + 1 if abs(steps - whole) > _OFF_CLOCK else 0
    if count[2] > _OFF_ROWS:
        count[3] = 0
        count[2] = 0
        return LOST
    for missing in range(1, whole):
        if count[0] < WARM_ROWS - 1:
            share = missing / whole
            between = last + (row - last) * share
            for u in range(columns.inputs):
                if columns.held[u]:
                    between[columns.first_input + u] = last[columns.first_input + u]
            _append(intake, i, between, 0.0)
    _append(intake, i, row, 1.0)
    _keep(intake, i, row)
    return BLOCK if count[0] >= block_rows(clock[0]) else WAITING


@njit(cache=True)
def take_rows(columns, intake, condition, i, rows, at):  # type: ignore[no-untyped-def]
    """Rows (samples, columns) of vehicle i from ``at`` on, until something is to be done.

    Args:
        condition: airspeed, altitude, density and angle of attack of the last sample, (vehicles, 4), in place.

    Returns:
        What is to be done, and the next row.
    """
    for r in range(at, rows.shape[0]):
        row = rows[r]
        found = _take(columns, intake, i, row)
        if found == LOST:
            return LOST, r
        if intake.clock[i, 1] == row[0]:
            condition[i, 0] = row[columns.kinematic + 2]
            condition[i, 1] = row[columns.kinematic + 4]
            condition[i, 2] = row[columns.kinematic + 3]
            condition[i, 3] = row[columns.kinematic + 5]
        if found != WAITING:
            return found, r + 1
    return WAITING, rows.shape[0]


@njit(cache=True)
def regrid(columns, intake, i):  # type: ignore[no-untyped-def]
    """Put the rows that began a record on its clock."""
    waiting = intake.tally[i, 0]
    kept = intake.pending[i, :waiting].copy()
    width = kept.shape[1] - 1
    intake.tally[i, 0] = 0
    _append(intake, i, kept[0, :width], 1.0)
    _keep(intake, i, kept[0, :width])
    for r in range(1, waiting):
        _take(columns, intake, i, kept[r, :width])


@njit(cache=True)
def _append(intake, i, row, measured):  # type: ignore[no-untyped-def]
    at = intake.tally[i, 0]
    intake.pending[i, at, : row.size] = row
    intake.pending[i, at, row.size] = measured
    intake.tally[i, 0] += 1


@njit(cache=True)
def _keep(intake, i, row):  # type: ignore[no-untyped-def]
    intake.clock[i, 1] = row[0]
    intake.last[i] = row
    intake.tally[i, 3] += 1


@njit(cache=True)
def begins(columns, intake, i):  # type: ignore[no-untyped-def]
    """The clock, the origin and the noise of a record, from the rows that wait; whether a vane measured any."""
    count, rows = intake.tally[i, 0], intake.pending[i]
    steps = np.empty(count - 1)
    for r in range(count - 1):
        steps[r] = rows[r + 1, 0] - rows[r, 0]
    intake.clock[i, 0] = np.median(steps)
    width = intake.origin.shape[1]
    for c in range(width):
        intake.origin[i, c] = np.median(rows[:count, c])
    squares = np.empty(count - 2)
    for q in range(columns.channels):
        c = 1 + q if q < columns.states else columns.accelerometer
        for r in range(count - 2):
            squares[r] = (rows[r, c] - 2.0 * rows[r + 1, c] + rows[r + 2, c]) ** 2
        # a normal variable's squares have a median of 0.455 of their mean; second differences six times the variance
        intake.noise[i, q] = max(np.median(squares) / (0.455 * 6.0), _LEAST_VARIANCE)
    intake.spread[i] = 0.0
    for u in range(columns.inputs):
        intake.inputs[i, 0, u] = rows[0, columns.first_input + u]
        # the level of a surface that rests from the beginning on
        intake.inputs[i, 1, u] = np.mean(rows[:count, columns.first_input + u])
        intake.inputs[i, 2, u] = count
        if columns.input_variance[u] > 0.0:
            # or its distance from the origin would be a step at the beginning
            intake.origin[i, columns.first_input + u] = intake.inputs[i, 1, u]
        intake.inputs[i, 3:5, u] = 0.0
        intake.inputs[i, 5, u] = -1.0
    intake.tally[i, 1] = 1
    return np.any(rows[:count, columns.kinematic + 6] == 1.0)


@njit(cache=True)
def _condition(columns, row):  # type: ignore[no-untyped-def]
    """Factors of stability and control derivatives, forward and downward speed."""
    airspeed, density = max(row[columns.kinematic + 2], 1.0), row[columns.kinematic + 3]
    alpha = row[columns.kinematic + 5]
    if alpha != alpha:
        alpha = 0.0
    stability = density * airspeed / (columns.reference[0] * columns.reference[1])
    control = stability * airspeed / columns.reference[0]
    return stability, control, airspeed * np.cos(alpha), airspeed * np.sin(alpha)


@njit(cache=True)
def to_rows(columns, intake, i, taken, rows):  # type: ignore[no-untyped-def]
    """The first ``taken`` rows that wait become rows of a window (``increments.row_width``); the others move up."""
    ns, nu, ch = columns.states, columns.inputs, columns.channels
    pending, origin = intake.pending[i], intake.origin[i]
    moving = 0
    for u in range(nu):
        if _at_rest(columns, intake, i, taken, u):
            moving += 1 << u
    s_0, c_0, forward, down = _condition(columns, origin)
    for r in range(taken):
        raw, row = pending[r], rows[r]
        measured = raw[raw.size - 1] == 1.0
        s, c, forward, down = _condition(columns, raw)
        loaded = c / c_0
        stability = ch + ns + 2 * nu
        known = origin[columns.accelerometer]
        if ch == ns:
            known = -origin[columns.kinematic]
        turned = 0.0
        for j in range(ns):
            off = raw[1 + j] - origin[1 + j]
            row[j] = off if measured else np.nan
            row[ch + j] = (s - s_0 * loaded) * origin[1 + j]
            turning = columns.forward[j] * forward + columns.down[j] * down
            row[stability + 1 + j] = turning
            turned += turning * off
            moment = 0.0 if j == 0 else origin[columns.known_moments + j - 1]
            row[stability + 1 + ns + j] = (loaded - 1.0) * (known if j == 0 else -moment)
            row[stability + 1 + 2 * ns + j] = 0.0 if j == 0 else raw[columns.known_moments + j - 1] - moment
        row[stability + 1 + 2 * ns] = raw[columns.kinematic] - origin[columns.kinematic] - turned
        if raw[columns.kinematic + 6] != 1.0:
            row[0] = np.nan
        if ch > ns:
            row[ns] = raw[columns.accelerometer] - origin[columns.accelerometer] if measured else np.nan
        for u in range(nu):
            at = columns.first_input + u
            row[ch + ns + u] = c * (raw[at] - origin[at])
            arriving = intake.inputs[i, 0, u] if columns.held[u] else raw[at]
            row[ch + ns + nu + u] = c * (arriving - origin[at])
            intake.inputs[i, 0, u] = raw[at]
        row[stability] = s
        row[row.size - 2] = max(raw[columns.kinematic + 2], 1.0)
        row[row.size - 1] = moving
        for q in range(ch):
            if row[q] == row[q]:
                intake.spread[i, 0, q] += row[q] ** 2
                intake.spread[i, 1, q] += 1.0
    for r in range(taken, intake.tally[i, 0]):
        pending[r - taken] = pending[r]
    intake.tally[i, 0] -= taken


@njit(cache=True)
def _limit(variance, freedom):  # type: ignore[no-untyped-def]
    """Sum of squares about a mean that noise alone exceeds once in a million (Wilson and Hilferty 1931)."""
    step = 2.0 / (9.0 * max(freedom, 1.0))
    return variance * freedom * (1.0 - step + _CHANCE * np.sqrt(step)) ** 3


@njit(cache=True)
def _at_rest(columns, intake, i, taken, u):  # type: ignore[no-untyped-def]
    """Put an input that its noise alone moves at its level; whether its noise drives the model."""
    variance, at = columns.input_variance[u], columns.first_input + u
    if variance == 0.0:
        return False
    values = intake.pending[i, :taken, at]
    mean, squares = np.mean(values), np.var(values) * taken
    intake.inputs[i, 5, u] -= 1.0
    if squares > _limit(variance, taken - 1.0):
        intake.inputs[i, 5, u] = _AFTER
        return True
    if intake.inputs[i, 5, u] >= 0.0:
        return True
    # jitter that half a second does not tell from noise shows in ten
    pool = intake.inputs[i, 3:5, u]
    pool *= _POOLED
    pool[0] += squares
    pool[1] += taken - 1.0
    if pool[0] > _limit(variance, pool[1]):
        return True
    before = intake.inputs[i, 2, u]
    error = np.sqrt(variance * (1.0 / taken + 1.0 / before)) if before > 0.0 else 0.0
    if before == 0.0 or abs(mean - intake.inputs[i, 1, u]) > _DRIFT * error:
        # a level is kept as it was found: one that follows its own mean would be steps that never were
        intake.inputs[i, 1, u] = mean
        intake.inputs[i, 2, u] = taken
    intake.pending[i, :taken, at] = intake.inputs[i, 1, u]
    return False
