"""What sensors do to the columns of a flight, compiled; ``sensors`` fills the tables and says in what order.

Stages take whole arrays and indices: a slice for each of them costs more than the work on a short piece of a flight.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import helper, whole
from wingwatch.simulation.random_numbers import fill_normals, uniform

__all__ = [
    "ENTRY",
    "FAULT",
    "LAG_STATES",
    "MEMORY",
    "STREAMS",
    "SensorState",
    "SensorTable",
    "read_sensors",
]

_BLOCK = 256
"""Samples that pass through one column's stages together; they and their noise stay in the processor's cache."""
LAG_STATES = 3
_TURN = 2.0 * math.pi
_ON_TIME = 1e-6
"""Share of a reading's period by which rounding may make a reading late."""

ENTRY: tuple[str, ...] = (
    "column", "angle", "lag", "output", "delayed", "delay", "ring_start", "ring_mask", "gain", "bias", "noise_std",
    "stream", "resolution", "rate_hz", "held", "faulty", "freeze_s",
)  # fmt: skip
"""Numbers of an entry: a column of the flight table that is not simply true.

- ``angle``: 1 for a column that leaps by a turn;
- ``lag``: row of the lag table, -1 for none; ``output``: which of its states is read;
- ``delay`` in samples; ``ring_*``: where its piece of the ring is, and its length (a power of two) less 1;
- ``stream``: number of the one that its noise is drawn from;
- ``rate_hz``: 0 for an entry that keeps pace with the table; ``held``: 1 for one that repeats its last reading;
- ``freeze_s``: time after which it repeats its last reading up to then; infinite for one that does not freeze.
"""
(
    COLUMN, ANGLE, LAG, OUTPUT, DELAYED, DELAY, RING_START, RING_MASK, GAIN, BIAS, NOISE_STD,
    STREAM, RESOLUTION, RATE, HELD, FAULTY, FREEZE,
) = range(len(ENTRY))  # fmt: skip

FAULT: tuple[str, ...] = ("entry", "bias", "scale", "delay_samples", "size", "onset_s", "ramp_s")
"""Numbers of a fault; entry -1 in padding."""

MEMORY: tuple[str, ...] = ("z", "x", "x_rate", "last", "turns", "reading", "frozen")
"""What an entry remembers: its lag's states, its last input and the turns in it, its last reading, that which a freeze
repeats."""
LAST, TURNS, READING, FROZEN = 3, 4, 5, 6

STREAMS = 2
"""Streams of noise of a vehicle: that of the sensors of its motion, and that of its navigation receiver."""


class SensorTable(NamedTuple):
    """What does not change in a flight."""

    entry_count: NDArray[np.int64]
    """(vehicles,): entries of each; those behind are padding."""
    entries: NDArray[np.float64]
    """(vehicles, entries, ENTRY)."""
    faults: NDArray[np.float64]
    """(vehicles, faults, FAULT)."""
    dropout: NDArray[np.float64]
    """(vehicles, 1 + entries, 3): fraction, chance to begin and to end at a sample; the first is of whole samples."""
    lags: NDArray[np.float64]
    """(lags, 3, 5): Phi, gain of the input one sample ago, gain of the input now."""


class SensorState(NamedTuple):
    """What changes."""

    noise: NDArray[np.uint64]
    """(vehicles, STREAMS, 4)."""
    chance: NDArray[np.uint64]
    """(vehicles, 4): the dropouts' stream."""
    memory: NDArray[np.float64]
    """(vehicles, entries, MEMORY)."""
    ring: NDArray[np.float64]
    """Latest inputs of the delayed entries, one piece each."""
    missing: NDArray[np.bool_]
    """(vehicles, 1 + entries)."""


class _Piece(NamedTuple):
    """Samples of one vehicle that pass through the stages together."""

    vehicle: int
    first: int
    """Row of the first of them."""
    rows: int
    sample: int
    """Number of the first of them since the start of the flight."""
    rate_hz: float


class _Workspace(NamedTuple):
    """Room for a piece."""

    normals: NDArray[np.float64]
    """(STREAMS, rows * entries): of each stream, one sample's numbers after another's."""
    noisy: NDArray[np.int64]
    """(STREAMS,): entries with noise, numbers of each stream a sample."""
    drawn: NDArray[np.int64]
    """(STREAMS,): how many of these are used up."""
    x: NDArray[np.float64]
    """(rows,): one column."""
    errors: NDArray[np.float64]
    """(3, rows): its gain, bias and delay in samples."""


@helper
def _wrapped(angle):  # type: ignore[no-untyped-def]
    """To [-pi, pi], untouched where it is there."""
    if -math.pi <= angle <= math.pi:
        return angle
    return angle - _TURN * np.rint(angle / _TURN)


@helper
def _follow(x, n, sample, entries, lags, memory, i, j):  # type: ignore[no-untyped-def]
    """The lag: z' = Phi z + older u + newer u', exact for an input that is linear between samples."""
    row, output = int(entries[i, j, LAG]), int(entries[i, j, OUTPUT])
    angle = entries[i, j, ANGLE] > 0.0
    last, turns = memory[i, j, LAST], memory[i, j, TURNS]
    for k in range(n):
        new = x[k]
        if sample + k == 0:
            memory[i, j, 0], memory[i, j, 1], memory[i, j, 2], last = new, new, 0.0, new
            continue
        if angle:
            new += _TURN * turns
            leap = np.rint((new - last) / _TURN)
            new, turns = new - _TURN * leap, turns - leap
        z0, z1, z2 = memory[i, j, 0], memory[i, j, 1], memory[i, j, 2]
        for m in range(LAG_STATES):
            total = lags[row, m, 0] * z0 + lags[row, m, 1] * z1 + lags[row, m, 2] * z2
            memory[i, j, m] = total + lags[row, m, 3] * last + lags[row, m, 4] * new
        last = new
        x[k] = _wrapped(memory[i, j, output]) if angle else memory[i, j, output]
    memory[i, j, LAST], memory[i, j, TURNS] = last, turns


@helper
def _severities(faults, piece, j, errors):  # type: ignore[no-untyped-def]
    """Faults of one entry onto its gain, bias and delay (rows of ``errors``); severity as in ``Effect.severity``."""
    i, sample = piece.vehicle, piece.sample
    for f in range(faults.shape[1]):
        if faults[i, f, 0] != j:
            continue
        size, onset, ramp = faults[i, f, 4], faults[i, f, 5], faults[i, f, 6]
        for k in range(piece.rows):
            since = (sample + k) / piece.rate_hz - onset
            if since < 0.0:
                continue
            severity = size if since >= ramp else size * since / ramp
            errors[1, k] += severity * faults[i, f, 1]
            errors[0, k] *= 1.0 + severity * faults[i, f, 2]
            errors[2, k] = max(errors[2, k] + severity * faults[i, f, 3], 0.0)


@helper
def _delay(x, n, delay, sample, angle, ring, start, mask):  # type: ignore[no-untyped-def]
    """Each sample as it was ``delay[2]`` samples ago, linear in between; before the flight as at its start."""
    if sample == 0 and n > 0:
        for k in range(mask + 1):
            ring[start + k] = x[0]
    for k in range(n):
        now = sample + k
        ring[start + (now & mask)] = x[k]
        whole = int(delay[2, k])
        value = ring[start + ((now - whole) & mask)]
        change = ring[start + ((now - whole - 1) & mask)] - value
        if angle:
            change = _wrapped(change)
        value += (delay[2, k] - whole) * change
        x[k] = _wrapped(value) if angle else value


@helper
def _renew(x, n, sample, rate_hz, own_hz, held, reading):  # type: ignore[no-untyped-def]
    """A slow column: a reading at the first sample at or after each of its own instants 0, 1/own_hz, 2/own_hz ..."""
    for k in range(n):
        now = sample + k
        due = math.floor(now * own_hz / rate_hz + _ON_TIME)
        if now == 0 or due > math.floor((now - 1) * own_hz / rate_hz + _ON_TIME):
            reading = x[k]
        elif held:
            x[k] = reading
        else:
            x[k] = np.nan
    return reading


@helper
def _late_and_faulty(piece, table, ring, j, work):  # type: ignore[no-untyped-def]
    """Delay, gain and bias of one entry that is delayed or has faults."""
    entries, i, n, x, errors = table.entries, piece.vehicle, piece.rows, work.x, work.errors
    for k in range(n):
        errors[0, k], errors[1, k], errors[2, k] = (
            entries[i, j, GAIN],
            entries[i, j, BIAS],
            entries[i, j, DELAY],
        )
    if entries[i, j, FAULTY] > 0.0:
        _severities(table.faults, piece, j, errors)
    if entries[i, j, DELAYED] > 0.0:
        start, mask = int(entries[i, j, RING_START]), int(entries[i, j, RING_MASK])
        _delay(x, n, errors, piece.sample, entries[i, j, ANGLE] > 0.0, ring, start, mask)
    for k in range(n):
        x[k] = errors[0, k] * x[k] + errors[1, k]


@helper
def _add_noise(x, n, noise_std, stream, work):  # type: ignore[no-untyped-def]
    """White noise from the stream's next number of each sample."""
    place, noisy = work.drawn[stream], work.noisy[stream]
    work.drawn[stream] += 1
    for k in range(n):
        x[k] += noise_std * work.normals[stream, place + k * noisy]


@helper
def _freeze(x, piece, freeze_s, frozen):  # type: ignore[no-untyped-def]
    """After a time the last reading up to then, wherever there is a reading; left with what is repeated."""
    for k in range(piece.rows):
        if math.isnan(x[k]):
            continue
        if (piece.sample + k) / piece.rate_hz <= freeze_s:
            frozen = x[k]
        else:
            x[k] = frozen
    return frozen


@helper
def _read_piece(values, piece, table, state, work):  # type: ignore[no-untyped-def]
    """A piece through every stage but dropouts."""
    i, first, n, sample = piece.vehicle, piece.first, piece.rows, piece.sample
    entries, memory, x = table.entries, state.memory, work.x
    work.drawn[:] = 0
    for j in range(table.entry_count[i]):
        column = int(entries[i, j, COLUMN])
        for k in range(n):
            x[k] = values[i, first + k, column]
        if entries[i, j, LAG] >= 0.0:
            _follow(x, n, sample, entries, table.lags, memory, i, j)
        gain, bias, noise_std = entries[i, j, GAIN], entries[i, j, BIAS], entries[i, j, NOISE_STD]
        if entries[i, j, FAULTY] > 0.0 or entries[i, j, DELAYED] > 0.0:
            _late_and_faulty(piece, table, state.ring, j, work)
        elif gain != 1.0 or bias != 0.0:
            for k in range(n):
                x[k] = gain * x[k] + bias
        if noise_std > 0.0:
            _add_noise(x, n, noise_std, int(entries[i, j, STREAM]), work)
        if entries[i, j, RESOLUTION] > 0.0:
            resolution = entries[i, j, RESOLUTION]
            for k in range(n):
                x[k] = resolution * np.rint(x[k] / resolution)
        if entries[i, j, ANGLE] > 0.0:
            for k in range(n):
                x[k] = _wrapped(x[k])
        if entries[i, j, RATE] > 0.0:
            memory[i, j, READING] = _renew(
                x,
                n,
                sample,
                piece.rate_hz,
                entries[i, j, RATE],
                entries[i, j, HELD] > 0.0,
                memory[i, j, READING],
            )
        if entries[i, j, FREEZE] < math.inf:
            memory[i, j, FROZEN] = _freeze(x, piece, entries[i, j, FREEZE], memory[i, j, FROZEN])
        for k in range(n):
            values[i, first + k, column] = x[k]


@helper
def _drop(values, piece, table, state):  # type: ignore[no-untyped-def]
    """Two-state Markov dropouts of whole samples (first) and of single columns, one number each a sample."""
    i, first = piece.vehicle, piece.first
    dropout, missing, entries, stream = table.dropout, state.missing, table.entries, state.chance[i]
    for k in range(first, first + piece.rows):
        for j in range(1 + table.entry_count[i]):
            if dropout[i, j, 0] == 0.0:
                continue
            drawn = uniform(stream)
            if piece.sample + k - first == 0:
                missing[i, j] = drawn < dropout[i, j, 0]
            elif missing[i, j]:
                missing[i, j] = drawn >= dropout[i, j, 2]
            else:
                missing[i, j] = drawn < dropout[i, j, 1]
            if not missing[i, j]:
                continue
            if j == 0:
                for c in range(1, values.shape[2]):
                    values[i, k, c] = np.nan
            else:
                values[i, k, int(entries[i, j - 1, COLUMN])] = np.nan


@whole
def read_sensors(values, first_sample, rate_hz, table, state):  # type: ignore[no-untyped-def]
    """True columns (vehicles, samples, channels) become readings in place; the state advances by as many samples.

    Args:
        values: column 0 is the time.
        first_sample: number of the first row since the start of the flight.
        rate_hz: samples a second.
        table: ``SensorTable``.
        state: ``SensorState``.
    """
    entries = table.entries
    length = min(_BLOCK, values.shape[1])
    work = _Workspace(
        np.empty((STREAMS, length * entries.shape[1])),
        np.zeros(STREAMS, np.int64),
        np.zeros(STREAMS, np.int64),
        np.empty(length),
        np.empty((3, length)),
    )
    for i in range(values.shape[0]):
        dropping = table.dropout[i, 0, 0] > 0.0
        work.noisy[:] = 0
        for j in range(table.entry_count[i]):
            work.noisy[int(entries[i, j, STREAM])] += entries[i, j, NOISE_STD] > 0.0
            dropping |= table.dropout[i, 1 + j, 0] > 0.0
        for first in range(0, values.shape[1], _BLOCK):
            n = min(_BLOCK, values.shape[1] - first)
            piece = _Piece(i, first, n, first_sample + first, rate_hz)
            for stream in range(STREAMS):
                fill_normals(state.noise[i, stream], work.normals[stream, : n * work.noisy[stream]])
            _read_piece(values, piece, table, state, work)
            if dropping:
                _drop(values, piece, table, state)
