"""The stamps of a whole flight: what a person would notice about them before anything is made of the samples."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.sample import MAX_GAP_S

__all__ = ["ClockError", "TimeSource", "check_clock", "unwrapped"]

Array = NDArray[np.float64]

_WRAPS: Mapping[float, str] = {
    2.0**32 * 1e-9: "32-bit nanoseconds",
    2.0**16 * 1e-3: "16-bit milliseconds",
    3600.0: "minutes and seconds",
    2.0**31 * 1e-6: "31-bit microseconds",
    2.0**32 * 1e-6: "32-bit microseconds",
    86_400.0: "the time of day",
    604_800.0: "the GPS week",
    2.0**31 * 1e-3: "31-bit milliseconds",
    2.0**32 * 1e-3: "32-bit milliseconds",
}
"""Periods of clocks that begin anew when they are full, s."""

_WRAP_STEPS = 10.0
"""A step over the end of a full clock is at most so many ordinary ones."""

_LEAST_ROWS = 10
_UNRESOLVED = 0.6
_TOO_LONG_S, _TOO_SHORT_S = 2.0, 5e-5
_UNITS: Mapping[str, float] = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_RATES_HZ = (3.0, 3000.0)
_TINY = 0.1
_MOST_SENSORS = 4


class ClockError(ValueError):
    """Stamps that cannot be the flight's; one clause with what to write."""


@dataclass(frozen=True, slots=True)
class TimeSource:
    """Where the stamps come from, for the line that a person is to write.

    Attributes:
        source: column or expression.
        factor: seconds in one unit of it, as it was read.
    """

    source: str
    factor: float


def unwrapped(time_s: Array) -> tuple[Array, tuple[str, ...]]:
    """Stamps that go on where a full clock began anew, and one clause about it.

    Such a step back is that of a clock's whole period (2^32 microseconds, a day, ...) to within a few ordinary steps,
    and the stamps after it go on from there; any other step back is left as it is.

    Args:
        time_s: stamps, (rows,); NaN where a row has none.
    """
    known = np.flatnonzero(np.isfinite(time_s))
    steps = np.diff(time_s[known])
    forward = steps[steps > 0.0]
    if not forward.size or not (steps < 0.0).any():
        return time_s, ()
    usual = _WRAP_STEPS * float(np.median(forward))
    shift = np.zeros(time_s.size)
    names: dict[str, int] = {}
    for k in np.flatnonzero(steps < -1.0):
        back = float(steps[k])
        period = next((p for p in _WRAPS if 0.0 < back + p <= min(usual, 0.5 * p)), None)
        after = steps[k + 1 : k + 4]
        if period is None or (np.abs(after) > max(usual, MAX_GAP_S)).any():
            continue
        shift[known[k + 1] :] += period
        names[f"{_WRAPS[period]}, {period:.10g} s"] = names.get(f"{_WRAPS[period]}, {period:.10g} s", 0) + 1
    notes = tuple(
        f"the clock ({name}) began anew {'once' if times == 1 else f'{times} times'}: its stamps are counted on"
        for name, times in names.items()
    )
    return (time_s + shift if notes else time_s), notes


def check_clock(
    time_s: Array, read: TimeSource, signal: Array, columns: Mapping[str, Array] | None = None
) -> None:
    """Refuse stamps by which nothing can be estimated, with the likely cause.

    Args:
        time_s: stamps, (rows,).
        read: where they come from.
        signal: a reading that is new in every sample, (rows,).
        columns: other columns of the file, (rows,) each, among them perhaps the number of a sensor.

    Raises:
        ClockError: steps of another unit, stamps that do not resolve the samples, or several sensors in turn.
    """
    known = np.flatnonzero(np.isfinite(time_s))
    if known.size < _LEAST_ROWS:
        return
    steps = np.diff(time_s[known])
    new = np.diff(signal[known]) != 0.0
    same = np.abs(steps) <= 1e-6
    if float(np.mean(same & new)) > _UNRESOLVED:
        digits = "written with too few digits" if float(np.mean(same)) > 0.99 else "of a clock too coarse"
        raise ClockError(
            f"{np.count_nonzero(same)} of {known.size} stamps of {read.source} repeat the one before, so they do not "
            f"resolve the samples: they are {digits}; export them with all digits, or name another column for time_s"
        )
    forward = steps[steps > 0.0]
    if not forward.size:
        raise ClockError(f"the stamps of {read.source} never rise: name another column for time_s")
    _check_unit(float(np.median(forward)), read)
    _check_turns(time_s[known], steps, new, {n: c[known] for n, c in (columns or {}).items()})


def _check_unit(step_s: float, read: TimeSource) -> None:
    if _TOO_SHORT_S <= step_s < _TOO_LONG_S:
        return
    written = step_s / read.factor
    for unit, factor in {**_UNITS, "s": 1.0}.items():
        if _RATES_HZ[0] <= 1.0 / (written * factor) <= _RATES_HZ[1] and factor != read.factor:
            line = f'time_s = {{ source = "{read.source}", unit = "{unit}" }}'
            raise ClockError(
                f"samples follow each other in steps of {_amount(step_s)}: if {read.source} is in {_UNIT_WORDS[unit]}, "
                f"write {line}; a log so {'slow' if step_s > 1.0 else 'fast'} cannot be estimated from"
            )


_UNIT_WORDS = {"ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds", "s": "seconds"}


def _check_turns(time_s: Array, steps: Array, new: NDArray[np.bool_], columns: Mapping[str, Array]) -> None:
    """Rows in groups of two to four that follow each other at once: as many sensors in turn."""
    usual = float(np.quantile(steps, 0.9))
    tiny = (steps >= 0.0) & (steps < _TINY * usual)
    ends = np.flatnonzero(~tiny)
    if ends.size < _LEAST_ROWS or not 0.3 < float(np.mean(tiny)) < 0.85:
        return
    sizes, counts = np.unique(np.diff(ends), return_counts=True)
    size = int(sizes[np.argmax(counts)])
    if not 2 <= size <= _MOST_SENSORS or counts.max() < 0.9 * counts.sum() or np.mean(new[tiny]) < 0.5:
        return
    apart = _amount(float(np.median(steps[tiny])))
    number = next((n for n, c in columns.items() if _counts_sensors(c, size)), None)
    how = f'filter = "{number} == {np.nanmin(columns[number]):g}"' if number else 'filter = "instance == 0"'
    raise ClockError(
        f"samples come in groups of {size}, {apart} apart, and differ: {size} sensors in one table? Keep one of them "
        f"in the channel map, with [rows] {how}"
    )


def _counts_sensors(column: Array, size: int) -> bool:
    """Whether a column holds as many whole numbers, in turn."""
    values = np.unique(column[np.isfinite(column)])
    return (
        values.size == size
        and bool((values == np.round(values)).all())
        and float(np.mean(np.diff(column) != 0.0)) > 0.9
    )


def _amount(seconds: float) -> str:
    """A time for a person."""
    if seconds >= 0.5:
        return f"{seconds:.6g} s"
    return f"{1e3 * seconds:.3g} ms" if seconds >= 1e-3 else f"{1e6 * seconds:.3g} us"
