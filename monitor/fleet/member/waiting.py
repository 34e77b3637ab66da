"""Samples of one vehicle that its monitor has not taken in yet."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from wingwatch.monitor.fleet.member.pieces import pieces
from wingwatch.telemetry import CHANNELS, SampleBlock, SensorsMessage

__all__ = ["WaitingSamples"]


class WaitingSamples:
    """A queue of messages cut into pieces of bounded cost; its length is theirs."""

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
