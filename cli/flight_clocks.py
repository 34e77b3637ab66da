"""The clocks of a recorded flight: one, unless its stamps begin anew or leap by more than an hour."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingwatch.telemetry import Cleaner, CleanerConfig, SampleBlock

__all__ = ["Clock", "clocks_of", "clocks_text", "on_clock"]

_ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth")


@dataclass(frozen=True, slots=True)
class Clock:
    """Accepted samples in a row whose stamps belong together.

    Attributes:
        from_s, to_s: its first and last stamp.
        samples: how many.
    """

    from_s: float
    to_s: float
    samples: int


def clocks_of(block: SampleBlock) -> tuple[Clock, ...]:
    """The clocks that the cleaner believed, in the order of the rows; none where it accepted no sample."""
    time_s = Cleaner().clean(block).block.time_s
    if not time_s.size:
        return ()
    steps = np.diff(time_s)
    ends = np.flatnonzero((steps <= 0.0) | (steps > CleanerConfig().forward_jump_s)) + 1
    parts = np.split(time_s, ends)
    return tuple(Clock(float(part[0]), float(part[-1]), int(part.size)) for part in parts)


def clocks_text(clocks: Sequence[Clock]) -> str:
    """One sentence for a person; empty where there is one clock."""
    if len(clocks) < 2:
        return ""
    each = "; ".join(
        f"the {_ordinal(k)} from {c.from_s:.1f} to {c.to_s:.1f} s ({c.samples} samples)"
        for k, c in enumerate(clocks[:4])
    )
    more = f" and {len(clocks) - 4} more" if len(clocks) > 4 else ""
    return f"The file has {len(clocks)} clocks: {each}{more}."


def on_clock(number: int) -> str:
    """How a time is named that is of the clock of that number, counted from 0."""
    return f" of the {_ordinal(number)} clock"


def _ordinal(number: int) -> str:
    return _ORDINALS[number] if number < len(_ORDINALS) else f"{number + 1}th"
