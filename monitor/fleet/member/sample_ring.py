"""The latest minutes of a vehicle's samples, as they came: what a diagnosis looks into after an alert."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

__all__ = ["KEPT_S", "SampleRing"]

KEPT_S = 120.0
"""Of flight."""
_FIRST_ROWS, _MOST_ROWS = 512, 12_000
"""Rows that the ring begins with and grows to: 120 s at 100 Hz; of faster samples it covers less time."""


class SampleRing:
    """Time stamps in double precision, readings in single: a copy of a message's samples costs microseconds.

    A single has 24 bits: 6e-8 of a reading, below every sensor's resolution, but 128 s of a stamp of 1.7e9 s.

    Args:
        names: channels that are kept, without the time.
    """

    __slots__ = ("_columns", "_next", "_rows", "_time", "_values", "names")

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._columns = np.array([CHANNEL_INDEX[name] for name in names])
        self._time = np.empty(_FIRST_ROWS)
        self._values = np.empty((_FIRST_ROWS, len(names)), dtype=np.float32)
        self._next = self._rows = 0

    def __len__(self) -> int:
        """Samples that are kept."""
        return self._rows

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""
        return self._time.nbytes + self._values.nbytes

    def add(self, block: SampleBlock) -> None:
        """Keep the samples of a message; the oldest ones give way."""
        time_s, values = block.time_s[-_MOST_ROWS:], block.values[-_MOST_ROWS:]
        count = len(time_s)
        while self._rows + count > len(self._time) and self._must_grow(float(time_s[-1])):
            self._grow()
        capacity = len(self._time)
        if count > capacity:
            time_s, values, count = time_s[-capacity:], values[-capacity:], capacity
        end = self._next + count
        if end <= capacity:
            self._time[self._next : end] = time_s
            self._values[self._next : end] = values[:, self._columns]
        else:
            places = np.arange(self._next, end) % capacity
            self._time[places] = time_s
            self._values[places] = values[:, self._columns]
        self._next, self._rows = end % capacity, min(self._rows + count, capacity)

    def latest(self) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        """Stamps (samples,) and readings (samples, channels) of the last ``KEPT_S``, in the order they came."""
        places = np.arange(self._next - self._rows, self._next) % len(self._time)
        time_s = self._time[places]
        finite = time_s[np.isfinite(time_s)]
        if finite.size:
            places, time_s = places[time_s >= finite[-1] - KEPT_S], time_s[time_s >= finite[-1] - KEPT_S]
        return time_s, self._values[places]

    def _must_grow(self, now_s: float) -> bool:
        """Whether what would give way is younger than ``KEPT_S``, and there may be more."""
        if len(self._time) >= _MOST_ROWS:
            return False
        if self._rows < len(self._time):
            return True
        return not now_s - self._time[self._next] > KEPT_S

    def _grow(self) -> None:
        places = np.arange(self._next - self._rows, self._next) % len(self._time)
        time_s, values = self._time[places], self._values[places]
        rows = min(len(self._time) + len(self._time) // 4, _MOST_ROWS)
        self._time = np.empty(rows)
        self._values = np.empty((rows, len(self.names)), dtype=np.float32)
        self._time[: self._rows], self._values[: self._rows] = time_s, values
        self._next = self._rows
