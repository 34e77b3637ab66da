"""Samples of one vehicle that its monitor has not taken in yet, in pieces of bounded cost.

So one vehicle's large message keeps nobody waiting.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry import CHANNELS, SampleBlock, SensorsMessage

__all__ = ["PIECE_ROWS", "PIECE_S", "WaitingSamples", "pieces"]

PIECE_ROWS = 10
"""Samples that a piece may have whatever their stamps: two solutions, and one closed block of evidence."""

PIECE_S = 1.0
"""Time that a piece of more samples covers: three solutions."""


def pieces(message: SensorsMessage) -> Iterator[SensorsMessage]:
    """The message itself where it is small, else its samples in consecutive pieces.

    How samples are cut changes no number. A thousand slow samples take a second of processor time together; in pieces,
    those of other vehicles are taken in between.
    """
    values, time_s = message.block.values, message.block.time_s
    start = 0
    while start + PIECE_ROWS < len(values):
        rest = time_s[start + PIECE_ROWS :]
        outside = ~(np.abs(rest - time_s[start]) < PIECE_S)
        if not outside.any():
            break
        end = start + PIECE_ROWS + int(np.argmax(outside))
        yield replace(message, block=SampleBlock(values[start:end]))
        start = end
    yield replace(message, block=SampleBlock(values[start:])) if start else message


class WaitingSamples:
    """A queue of pieces; its length is theirs."""

    __slots__ = ("_pieces",)

    def __init__(self) -> None:
        self._pieces: deque[SensorsMessage] = deque()

    def __len__(self) -> int:
        return len(self._pieces)

    @property
    def given(self) -> tuple[str, ...]:
        """Channels of the oldest message; IndexError where none waits."""
        return self._pieces[0].given

    @property
    def values(self) -> NDArray[np.float64]:
        """All samples, shape (samples, channels)."""
        return np.concatenate([np.empty((0, len(CHANNELS))), *(one.block.values for one in self._pieces)])

    def add(self, message: SensorsMessage) -> int:
        """A message joins the queue; in how many pieces."""
        before = len(self._pieces)
        self._pieces.extend(pieces(message))
        return len(self._pieces) - before

    def take(self) -> SampleBlock:
        """The samples of the oldest piece, which leaves the queue."""
        return self._pieces.popleft().block

    def drop(self) -> int:
        """Nothing waits any longer; how many samples did."""
        dropped = sum(len(one.block) for one in self._pieces)
        self._pieces.clear()
        return dropped
