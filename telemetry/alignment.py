"""Stated delays taken out of a stream: every row leaves with what its sensors show later.

A row waits until the readings that belong to its instant have come, so what leaves is late by the largest delay. The
answer does not depend on how the stream is cut into blocks. ``conditioning.align`` does the same on a whole table.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.flight import REQUIRED_CHANNELS
from wingwatch.telemetry.sample import CHANNEL_INDEX, LEAPING_CHANNELS, MAX_GAP_S, SampleBlock
from wingwatch.telemetry.shown_later import shown_later

__all__ = ["Aligner", "AlignerState", "aligned_delays"]

Array = NDArray[np.float64]

MOST_ROWS = 20_000
"""A row waits for at most so many others, whatever their stamps: 10 s at 2 kHz."""

_REQUIRED = [CHANNEL_INDEX[name] for name in REQUIRED_CHANNELS]


def aligned_delays(stated_s: Mapping[str, float], kinds: Mapping[str, str]) -> dict[str, float]:
    """Delays of the channels of a completed table: a surface known by its command has the command's delay.

    Args:
        stated_s: by channel, as an aircraft file states them.
        kinds: ``position`` or ``command`` of the surfaces; what is not named is a position.
    """
    commanded = {n: n.removesuffix("_rad") + "_command_rad" for n, kind in kinds.items() if kind == "command"}
    delays = {name: delay for name, delay in stated_s.items() if name not in commanded}
    delays.update({name: stated_s[command] for name, command in commanded.items() if command in stated_s})
    return {name: delay for name, delay in delays.items() if delay > 0.0}


@dataclass(frozen=True, slots=True)
class AlignerState:
    """Everything an aligner remembers between blocks.

    Attributes:
        waiting: rows whose readings have not all come, shape (rows, channels).
        dropped: rows left out so far.
    """

    waiting: Array
    dropped: int


class Aligner:
    """Takes delays out of consecutive blocks of clean samples.

    Args:
        delays_s: by channel, each from 0 on; without any, blocks pass as they are.
        held: channels that are held rather than interpolated, beside the ``*_command_rad``.

    Attributes:
        dropped: rows left out so far, because a reading of theirs never came: the stream ended or tore before it.

    Raises:
        ValueError: a name that is no channel, or the time, or a delay that is not a finite number from 0 on.
    """

    def __init__(self, delays_s: Mapping[str, float], held: Collection[str] = ()) -> None:
        for name, delay_s in delays_s.items():
            if name not in CHANNEL_INDEX or name == "time_s":
                raise ValueError(f"{name!r} cannot be aligned: give a flight-table channel other than time_s")
            if not (np.isfinite(delay_s) and delay_s >= 0.0):
                raise ValueError(
                    f"the delay of {name} is {delay_s}; give a finite number of seconds from 0 on"
                )
        self._delays = {name: delay for name, delay in delays_s.items() if delay > 0.0}
        self._held = {*held, *(name for name in CHANNEL_INDEX if name.endswith("_command_rad"))}
        self._waiting = np.empty((0, len(CHANNEL_INDEX)))
        self.dropped = 0

    @property
    def state(self) -> AlignerState:
        """What must be kept to go on later as if there had been no interruption."""
        return AlignerState(self._waiting, self.dropped)

    def resume(self, state: AlignerState) -> None:
        """Go on from where an aligner with the same delays stopped.

        Raises:
            ValueError: its rows have other channels.
        """
        if state.waiting.ndim != 2 or state.waiting.shape[1] != len(CHANNEL_INDEX):
            raise ValueError(f"the aligner's rows have shape {state.waiting.shape}")
        self._waiting, self.dropped = state.waiting, state.dropped

    def feed(self, block: SampleBlock) -> SampleBlock:
        """Rows whose readings are complete, in order; those without a required channel are left out."""
        if not self._delays:
            return block
        rows = np.concatenate([self._waiting, block.values])
        with np.errstate(invalid="ignore"):
            step = np.diff(rows[:, 0])
            breaks = np.flatnonzero(~((step > 0.0) & (step <= MAX_GAP_S))) + 1
        runs = np.split(rows, breaks)
        done = [self._aligned(run)[0] for run in runs[:-1]]
        last, ready = self._aligned(runs[-1])
        self._waiting = runs[-1][ready:].copy()
        out = np.concatenate([*done, last[:ready]])
        whole = np.isfinite(out[:, _REQUIRED]).all(axis=1)
        self.dropped += int(np.count_nonzero(~whole))
        return SampleBlock(out[whole])

    def _aligned(self, run: Array) -> tuple[Array, int]:
        """A run without gaps, aligned as far as its readings go, and how many of its first rows are complete."""
        out, ready = run.copy(), len(run)
        for name, delay_s in self._delays.items():
            column = CHANNEL_INDEX[name]
            present = np.flatnonzero(np.isfinite(run[:, column]))
            if not present.size:
                continue
            values, waits = _later(
                run[present, 0], run[present, column], delay_s, name in self._held, name in LEAPING_CHANNELS
            )
            out[present, column] = values
            waits &= (run[-1, 0] <= run[present, 0] + delay_s + MAX_GAP_S) & (len(run) - present <= MOST_ROWS)
            if waits.any():
                ready = min(ready, int(present[int(np.argmax(waits))]))
        return out, ready


def _later(
    time_s: Array, values: Array, delay_s: float, held: bool, leaping: bool
) -> tuple[Array, NDArray[np.bool_]]:
    """What readings (n,) show ``delay_s`` later, NaN where that is not known; and where it has not come yet."""
    shown = shown_later(time_s, values, delay_s, held, leaping)
    waits = shown.right >= time_s.size
    far = np.minimum(shown.right, time_s.size - 1) - np.arange(time_s.size) > MOST_ROWS
    return np.where(waits | far | (shown.width_s > MAX_GAP_S), np.nan, shown.values), waits
