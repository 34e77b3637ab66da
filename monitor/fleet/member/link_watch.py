"""How a vehicle's messages arrive: rate, gaps and delay, second by second, of the last ten minutes."""

from array import array
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from wingwatch.monitor.record_views import LinkSecond, LinkView

__all__ = ["GAP_STEPS", "KEPT_SECONDS", "LinkWatch"]

Array = NDArray[np.float64]

KEPT_SECONDS = 600

GAP_STEPS = 3.0
"""A step of so many usual ones is a gap: two samples are missing."""

_RATE_OVER_S = 10
_TIME, _SAMPLES, _MESSAGES, _SPAN, _STEPS, _LONGEST, _SLOWEST, _FASTEST, _ARRIVED = range(9)
_COLUMNS = 9


class LinkWatch:
    """A ring of seconds of arrivals; 43 kB, and a few microseconds a message.

    A second of a vehicle is a second on our clock in which a message of it arrived. Clocks of vehicles are not ours, so
    a delay is stated beyond that of the fastest message that is kept.
    """

    __slots__ = ("_at", "_count", "_last_s", "_second", "_table")

    def __init__(self) -> None:
        self._table = array("d")
        self._second, self._at, self._count = -inf, -1, 0
        self._last_s = inf

    def note(self, time_s: Array, arrival_s: float) -> None:
        """A message with these stamps, (n,), arrived then on our clock."""
        n = len(time_s)
        first_s, last_s = (float(time_s[0]), float(time_s[-1])) if n else (inf, inf)
        if not (isfinite(first_s) and isfinite(last_s) and isfinite(arrival_s)):
            return
        row = self._row(arrival_s)
        before_s, table = self._last_s, self._table
        goes_on = 0.0 <= first_s - before_s < inf
        longest_s = first_s - before_s if goes_on else 0.0
        if n > 1:
            longest_s = max(longest_s, float(np.max(np.diff(time_s))))
        delay_s = arrival_s - last_s
        table[row + _TIME] = max(table[row + _TIME], last_s)
        table[row + _SAMPLES] += n
        table[row + _MESSAGES] += 1.0
        table[row + _SPAN] += last_s - (before_s if goes_on else first_s)
        table[row + _STEPS] += n if goes_on else n - 1
        table[row + _LONGEST] = max(table[row + _LONGEST], longest_s)
        table[row + _SLOWEST] = max(table[row + _SLOWEST], delay_s)
        table[row + _FASTEST] = min(table[row + _FASTEST], delay_s)
        table[row + _ARRIVED] = arrival_s
        self._last_s = last_s

    def _row(self, arrival_s: float) -> int:
        """Where the entry of this second begins."""
        if (second := float(int(arrival_s))) != self._second:
            self._second = second
            self._at = (self._at + 1) % KEPT_SECONDS
            self._count = min(self._count + 1, KEPT_SECONDS)
            fresh = array("d", (-inf, 0.0, 0.0, 0.0, 0.0, 0.0, -inf, inf, arrival_s))
            if len(self._table) < KEPT_SECONDS * _COLUMNS and self._at * _COLUMNS == len(self._table):
                self._table.extend(fresh)
            else:
                self._table[self._at * _COLUMNS : (self._at + 1) * _COLUMNS] = fresh
        return self._at * _COLUMNS

    def view(self, now_s: float) -> LinkView:
        """As it stands; ``now_s`` is on the clock of the arrivals."""
        kept = np.array(self._table).reshape(-1, _COLUMNS)
        if not len(kept):
            return LinkView(None, None, 0, 0.0, None, None, None, ())
        rows = np.roll(kept, -(self._at + 1), axis=0) if self._count == KEPT_SECONDS else kept
        arrived_s = rows[:, _ARRIVED]
        recent = arrived_s > now_s - _RATE_OVER_S
        begun_s = float(np.floor(arrived_s[recent][0])) if recent.any() else now_s
        over_s = max(1.0, now_s - begun_s)
        paced = rows[:, _STEPS] > 0.0
        step_s = float(np.median(rows[paced, _SPAN] / rows[paced, _STEPS])) if paced.any() else None
        longest_s = rows[:, _LONGEST]
        gaps = longest_s > GAP_STEPS * step_s if step_s else np.zeros(len(rows), dtype=np.bool_)
        delays = rows[:, _SLOWEST] - float(np.min(rows[:, _FASTEST]))
        return LinkView(
            rate_hz=float(rows[recent, _SAMPLES].sum()) / over_s,
            step_s=step_s,
            gaps=int(np.count_nonzero(gaps)),
            longest_gap_s=float(longest_s[gaps].max()) if gaps.any() else 0.0,
            delay_s=float(np.median(delays)),
            longest_delay_s=float(delays.max()),
            silent_s=max(0.0, now_s - float(arrived_s[-1])),
            seconds=tuple(
                LinkSecond(row[_TIME], int(row[_SAMPLES]), int(row[_MESSAGES]), row[_LONGEST], delay)
                for row, delay in zip(rows.tolist(), delays.tolist(), strict=True)
            ),
        )
