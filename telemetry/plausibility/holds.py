"""Channels that repeat each value: their true rate, and the rows at which a value is new."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Hold", "hold_of", "new_rows"]

Array = NDArray[np.float64]

_LEAST_CHANGES = 40
_LOCKED = 0.97
_COVERED = 0.15
"""Fraction of the time in which the channel changes at its own rate: single steps with rests between are no rate."""
_LONGEST_S = 0.6


@dataclass(frozen=True, slots=True)
class Hold:
    """A channel that holds each value for some rows.

    Attributes:
        rows: mean number of rows from one new value to the next, above 1.9.
        rate_hz: of new values.
        table_hz: of the rows.
    """

    rows: float
    rate_hz: float
    table_hz: float


def hold_of(time_s: Array, values: Array) -> Hold | None:
    """How a channel is held; None where it is not, or does not move enough to tell.

    New values come at multiples of some rows (a slower message in a faster table), or as evenly as rows allow. A
    channel of few digits repeats values, too, but not evenly.

    Args:
        time_s: rising stamps, (n,).
        values: finite, (n,).
    """
    steps = np.diff(time_s)
    if steps.size < _LEAST_CHANGES or not (step_s := float(np.median(steps))) > 0.0:
        return None
    new = np.flatnonzero(np.diff(values) != 0.0) + 1
    if new.size < _LEAST_CHANGES or new.size > 0.6 * values.size:
        return None
    rows = _locked(np.rint((time_s[new] - time_s[0]) / step_s), _LONGEST_S / step_s) or _even(np.diff(new))
    if rows < 1.9 or rows * step_s > _LONGEST_S or new.size * rows < _COVERED * values.size:
        return None
    return Hold(rows, 1.0 / (rows * step_s), 1.0 / step_s)


def _locked(at: Array, longest: float) -> float:
    """The largest number of rows of which nearly all changes are multiples apart; 0 if none."""
    for rows in range(int(longest), 1, -1):
        if float(np.mean(np.diff(at) % rows == 0)) >= _LOCKED:
            return float(rows)
    return 0.0


def _even(apart: NDArray[np.int64]) -> float:
    """Mean rows between changes that are as evenly apart as whole rows allow; 0 if they are not."""
    near = apart[apart <= 2.0 * np.median(apart)]
    mean = float(np.mean(near))
    even = np.isin(apart, (np.floor(mean), np.ceil(mean)))
    return mean if float(np.mean(even)) >= 0.9 else 0.0


def new_rows(time_s: Array, values: Array, hold: Hold) -> NDArray[np.int64]:
    """Rows at which a held channel is new; where it rests, rows as far apart as its rate says.

    Args:
        time_s: rising stamps, (n,).
        values: finite, (n,).
        hold: of this channel.
    """
    new = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1, [values.size]])
    length = np.diff(new)
    parts = np.maximum(np.rint(length / hold.rows), 1.0).astype(np.int64)
    rows = [
        begin + (np.arange(count) * size) // count
        for begin, size, count in zip(new[:-1].tolist(), length.tolist(), parts.tolist(), strict=True)
    ]
    return np.concatenate(rows).astype(np.int64)
