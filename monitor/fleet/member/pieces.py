"""Messages cut into pieces of bounded cost, so that one vehicle's large message keeps nobody waiting."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from wingwatch.telemetry import SampleBlock, SensorsMessage

__all__ = ["PIECE_ROWS", "PIECE_S", "pieces"]

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
