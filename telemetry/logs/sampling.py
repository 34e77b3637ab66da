"""Readings of one rate brought to the stamps of another: filtered where faster, interpolated or held where slower."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.telemetry.shown_later import SAME_STAMP_S

__all__ = [
    "Placement",
    "Readings",
    "decimated",
    "is_faster",
    "low_passed",
    "news_of",
    "placed",
    "rate_hz",
    "repeats",
    "sampled",
    "without_repeats",
]

Array = NDArray[np.float64]

_FASTER = 1.2  # times the table's rate, from where a channel is filtered before it is sampled
_CORNER = 0.35  # of the table's rate; passed twice, 37 dB are left out at half of it and more above
_ORDER = 6
_RUN_STEPS = 2.5  # usual steps; a longer one ends a run, and nothing is filtered across
_MOSTLY = 0.8
_FEWEST = 10


@dataclass(frozen=True, slots=True)
class Readings:
    """One channel on its own stamps.

    Attributes:
        time_s: rising, shape (n,).
        values: shape (n,), finite.
        held: a command, which holds until the next; else a state, between whose readings the line counts.
        period: of an angle that leaps, in its unit; 0 for any other channel.
    """

    time_s: Array
    values: Array
    held: bool
    period: float = 0.0


def rate_hz(time_s: Array) -> float:
    """Usual rate of rising stamps: one by their median step; 0 for fewer than two."""
    return 1.0 / float(np.median(np.diff(time_s))) if time_s.size > 1 else 0.0


def decimated(time_s: Array, most_hz: float) -> Array:
    """Every k-th stamp, such that their rate is at most ``most_hz``."""
    every = max(1, int(np.ceil(rate_hz(time_s) / most_hz - 0.05)))
    return time_s[::every]


def without_repeats(readings: Readings, max_gap_s: float) -> Readings:
    """Without readings that only repeat the one before, where a state changes at every k-th reading as a clock does.

    A value that rests within its resolution changes now and then; its readings all count. A repeated reading stays
    where nothing else would be left for ``max_gap_s``: it says that the value holds.
    """
    return news_of(readings, max_gap_s) if repeats(readings) else readings


def repeats(readings: Readings) -> bool:
    """Whether a state changes at every k-th reading only, as a clock does, k of 2 and more."""
    if readings.held or readings.values.size < _FEWEST:
        return False
    every = np.diff(np.flatnonzero(_changed(readings)))
    if every.size < 3:
        return False
    usual = float(np.median(every))
    return usual >= 2.0 and bool(np.mean((np.abs(every - usual) <= 1.0) & (every > 1)) >= _MOSTLY)


def news_of(readings: Readings, max_gap_s: float) -> Readings:
    """The readings that differ from the one before, the last, and those that ``max_gap_s`` needs."""
    new = _changed(readings)
    kept, time_s = new.copy(), readings.time_s
    kept[-1] = True
    last_s = time_s[0]
    for i in range(1, new.size):
        if not kept[i] and time_s[i + 1] - last_s > max_gap_s:
            kept[i] = True
        if kept[i]:
            last_s = time_s[i]
    return Readings(readings.time_s[kept], readings.values[kept], False, readings.period)


def _changed(readings: Readings) -> NDArray[np.bool_]:
    return np.concatenate(([True], np.diff(readings.values) != 0.0))


def is_faster(readings: Readings, table_hz: float, rate: float | None = None) -> bool:
    """Whether a state comes so much faster than the table that it is filtered before it is sampled."""
    rate = rate_hz(readings.time_s) if rate is None else rate
    return not readings.held and table_hz > 0.0 and rate >= _FASTER * table_hz


def low_passed(readings: Readings, table_hz: float, rate: float | None = None) -> Readings:
    """A state faster than the table without what the table's rate cannot show: zero phase, so no delay.

    Runs too short for the filter stay as they are.

    Args:
        readings: in their order.
        table_hz: rate of the table.
        rate: usual rate of the readings, where a part of them is all that is here.
    """
    rate = rate_hz(readings.time_s) if rate is None else rate
    if not is_faster(readings, table_hz, rate):
        return readings
    values = _unwrapped(readings)
    sections = _filter(table_hz, rate)
    breaks = np.flatnonzero(np.diff(readings.time_s) > _RUN_STEPS / rate) + 1
    shortest = int(3.0 * rate / (_CORNER * table_hz)) + 3 * (2 * len(sections) + 1)
    for run in np.split(np.arange(values.size), breaks):
        if run.size > shortest:
            values[run] = scipy.signal.sosfiltfilt(sections, values[run], padlen=min(shortest, run.size - 1))
    return Readings(readings.time_s, values, False, readings.period)


@lru_cache(maxsize=256)
def _filter(table_hz: float, rate: float) -> Array:
    sections: Array = scipy.signal.butter(_ORDER, _CORNER * table_hz, fs=rate, output="sos")
    return sections


@dataclass(frozen=True, slots=True)
class Placement:
    """Where stamps lie among readings: the same for every channel of one topic.

    Attributes:
        left: reading that each stamp is at or after.
        there: reading that it is at or before.
        exact: stamps that are those of a reading.
        weight: fraction of the way from one to the other.
        known: stamps that have a value.
    """

    left: NDArray[np.int64]
    there: NDArray[np.int64]
    exact: NDArray[np.bool_]
    weight: Array
    known: NDArray[np.bool_]


def placed(time_s: Array, wanted_s: Array, max_gap_s: float, held: bool) -> Placement:
    """Where ``sampled`` reads the readings of these stamps."""
    right = np.searchsorted(time_s, wanted_s - SAME_STAMP_S, side="left")
    there = np.minimum(right, time_s.size - 1)
    exact = np.abs(time_s[there] - wanted_s) <= SAME_STAMP_S
    left = np.where(exact, there, right - 1)
    known = left >= 0
    left = np.maximum(left, 0)
    since = wanted_s - time_s[left]
    if held:
        return Placement(left, there, exact, since, known & (since <= max_gap_s))
    width = time_s[there] - time_s[left]
    weight = np.divide(since, width, out=np.zeros_like(width), where=width > 0.0)
    return Placement(left, there, exact, weight, known & (right < time_s.size) & (width <= max_gap_s))


def sampled(
    readings: Readings, wanted_s: Array, max_gap_s: float, placement: Placement | None = None
) -> Array:
    """Values at other stamps: NaN before the first reading, after the last, and over longer gaps.

    Args:
        readings: at least one.
        wanted_s: shape (rows,).
        max_gap_s: a state between two readings further apart has no value, nor a command held for longer.
        placement: ``placed`` for these stamps, where it is known already.

    Returns:
        Shape (rows,); an angle that leaps within one period about zero.
    """
    at = placed(readings.time_s, wanted_s, max_gap_s, readings.held) if placement is None else placement
    if readings.held:
        return np.where(at.known, readings.values[at.left], np.nan)
    values = _unwrapped(readings) if readings.period else readings.values
    before, after = values[at.left], values[at.there]
    between = np.where(at.exact, after, before + at.weight * (after - before))
    result = np.where(at.known, between, np.nan)
    if not readings.period:
        return result
    folded = (result + readings.period / 2.0) % readings.period - readings.period / 2.0
    return np.where(np.abs(result) <= readings.period / 2.0, result, folded)


def _unwrapped(readings: Readings) -> Array:
    if not readings.period:
        return readings.values.copy()
    return np.unwrap(readings.values, period=readings.period)
