"""Segments that are over, in order: what the test remembers of the last half minute.

All of them lie in a few arrays, by place and row: kernels go through them without a copy. Of the symmetric sums of
(E, f) the lower triangle is kept, row by row (``pair``).
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import helper, whole
from wingwatch.monitor.detection.redundancy.layout import COLUMNS, ROWS
from wingwatch.monitor.detection.redundancy.samples import (
    GOING,
    LEFT,
    LOG_S,
    PRODUCTS,
    SAMPLES,
    SQUARE,
    Memory,
    Segment,
)

__all__ = ["EXCESS", "KNOWN_PAIRS", "MOST_SEGMENTS", "PAIRS", "Segments", "pair"]

Array = NDArray[np.float64]

MOST_SEGMENTS = 12
"""Segments that are remembered; one more has room, until older ones are joined."""
KNOWN_PAIRS = COLUMNS * (COLUMNS + 1) // 2
PAIRS = KNOWN_PAIRS + COLUMNS + 1
"""Numbers of the lower triangle of E alone, and of (E, f)."""
EXCESS = LOG_S + 1
"""Number of ``Segments.scalar``: Q of (4) by what was known before the segment."""

_ROWS, _PLACES = len(ROWS), MOST_SEGMENTS + 1
_OUT_OF_MEASURE = 1e30
_SUMS = [SAMPLES, SQUARE, PRODUCTS, LOG_S, EXCESS]


@helper
def pair(i, j):  # type: ignore[no-untyped-def]
    """Place in the triangle, a scalar, of two columns; their order does not matter."""
    return i * (i + 1) // 2 + j if i >= j else j * (j + 1) // 2 + i


@whole
def _close(segment, effect, filtered, place, information, vector, start, scalar):  # type: ignore[no-untyped-def]
    """The running segment into a place, and empty sums from now on.

    Rows that readings out of all measure have spoiled say nothing of the segment, and their filters start anew.
    """
    lower, moved, began, numbers = segment
    c = COLUMNS
    for row in range(lower.shape[0]):
        sound = True
        for i in range(c + 1):
            sound = sound and abs(moved[row, i]) < _OUT_OF_MEASURE
            for j in range(i + 1):
                sound = sound and abs(lower[row, i, j]) < _OUT_OF_MEASURE
        for i in range(c):
            sound = sound and abs(began[row, i]) < _OUT_OF_MEASURE and abs(effect[row, i]) < _OUT_OF_MEASURE
        for k in range(EXCESS):
            sound = sound and abs(numbers[row, k]) < _OUT_OF_MEASURE
        if not sound:
            filtered[row, GOING] = 0.0
        at = 0
        for i in range(c + 1):
            vector[place, row, i] = moved[row, i] if sound else 0.0
            moved[row, i] = 0.0
            for j in range(i + 1):
                information[place, row, at] = lower[row, i, j] if sound else 0.0
                lower[row, i, j] = 0.0
                at += 1
        for i in range(c):
            start[place, row, i] = began[row, i] if sound else 0.0
            effect[row, i] = effect[row, i] if sound else 0.0
            began[row, i] = effect[row, i]
        for k in range(EXCESS):
            scalar[place, row, k] = numbers[row, k] if sound else 0.0
            numbers[row, k] = 0.0
        scalar[place, row, EXCESS] = scalar[place, row, SQUARE]
        numbers[row, LEFT] = 1.0


@dataclass(slots=True)
class Segments:
    """Segments one after another, the oldest first.

    Attributes:
        count: how many are remembered; the place behind them holds the one that was closed last until it is kept.
        start_s, seconds: stamp at which each starts, and how long it is, (places,).
        information, vector, start: as in ``Segment``, (places, rows, PAIRS), (places, rows, COLUMNS + 1), (places,
            rows, COLUMNS).
        scalar: samples; sum of e2/S; of products of e/S^(1/2) with the one before; f at the end; sum of ln S; Q of (4)
            by what was known before (places, rows, 6).
    """

    count: int = 0
    start_s: Array = field(default_factory=lambda: np.zeros(_PLACES))
    seconds: Array = field(default_factory=lambda: np.zeros(_PLACES))
    information: Array = field(default_factory=lambda: np.zeros((_PLACES, _ROWS, PAIRS)))
    vector: Array = field(default_factory=lambda: np.zeros((_PLACES, _ROWS, COLUMNS + 1)))
    start: Array = field(default_factory=lambda: np.zeros((_PLACES, _ROWS, COLUMNS)))
    scalar: Array = field(default_factory=lambda: np.zeros((_PLACES, _ROWS, EXCESS + 1)))

    def __len__(self) -> int:
        return self.count

    @property
    def starts_s(self) -> Array:
        """Stamps at which they start, (count,)."""
        return self.start_s[: self.count]

    def close(self, segment: Segment, memory: Memory, start_s: float, seconds: float) -> None:
        """Lay the running segment, of so many seconds, behind the others, for ``keep``, and begin the next one."""
        self.start_s[self.count], self.seconds[self.count] = start_s, seconds
        _close(
            segment, memory.effect, memory.scalar, self.count,
            self.information, self.vector, self.start, self.scalar,
        )  # fmt: skip

    def keep(self) -> None:
        """Remember the segment that was closed last; ``ValueError`` where there is no room."""
        if self.count > MOST_SEGMENTS:
            raise ValueError(f"{self.count} segments are remembered already: join or drop one first")
        self.count += 1

    def join(self, k: int) -> None:
        """Make one of two that follow one another, the first at place ``k``."""
        left = self.scalar[k, :, LEFT].copy()
        carry = np.ones((_ROWS, PAIRS))
        carry[:, KNOWN_PAIRS:] = left[:, None]
        carry[:, -1] *= left
        self.information[k] += carry * self.information[k + 1]
        self.vector[k, :, :COLUMNS] += self.vector[k + 1, :, :COLUMNS]
        self.vector[k, :, COLUMNS] += left * self.vector[k + 1, :, COLUMNS]
        self.scalar[k][:, _SUMS] += self.scalar[k + 1][:, _SUMS]
        self.scalar[k, :, LEFT] = left * self.scalar[k + 1, :, LEFT]
        self.seconds[k] += self.seconds[k + 1]
        self.drop(k + 1)

    def drop(self, k: int) -> None:
        """Forget the one at place ``k``."""
        self.count -= 1
        for one in (self.start_s, self.seconds, self.information, self.vector, self.start, self.scalar):
            one[k : self.count] = one[k + 1 : self.count + 1]

    def forget(self, row: int) -> None:
        """They say nothing of a row any more."""
        for one in (self.information, self.vector, self.start, self.scalar):
            one[:, row] = 0.0
