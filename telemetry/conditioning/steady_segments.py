"""Steady segments: windows of straight flight at rest, with means and their standard errors (thesis 4.2.1)."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.delays import coloured_spread
from wingwatch.telemetry.conditioning.windows import runs
from wingwatch.telemetry.sample import SampleBlock

__all__ = ["SteadyLimits", "SteadySegment", "steady_segments"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SteadyLimits:
    """What counts as steady.

    Attributes:
        window_s: conditions hold in the mean of a running window of this length, centred.
        shortest_s: shorter segments are left out.
        longest_s: longer ones are cut.
        roll_rad: largest bank.
        rate_rad_s: largest root mean square of roll and pitch rate.
        speeding_m_s2: largest rate of the airspeed.
        memory_s: readings farther apart count as independent in the standard error of a mean.
    """

    window_s: float = 2.0
    shortest_s: float = 4.0
    longest_s: float = 15.0
    roll_rad: float = 0.09
    rate_rad_s: float = 0.03
    speeding_m_s2: float = 0.15
    memory_s: float = 1.0

    def __post_init__(self) -> None:
        for name in self.__slots__:
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; give a positive number")


@dataclass(frozen=True, slots=True)
class SteadySegment:
    """One segment.

    Attributes:
        start_s: stamp of the first sample.
        end_s: of the last.
        mean: by channel.
        standard_error: of the means, allowing for readings that go together.
    """

    start_s: float
    end_s: float
    mean: Mapping[str, float]
    standard_error: Mapping[str, float]


def steady_segments(block: SampleBlock, limits: SteadyLimits | None = None) -> tuple[SteadySegment, ...]:
    """Segments of straight flight in which nothing was done, in order of time.

    Args:
        block: samples with airspeed, roll, roll rate and pitch rate; the means are of every channel present.
        limits: what counts as steady.

    Raises:
        ValueError: one of these channels is missing.
    """
    c = SteadyLimits() if limits is None else limits
    needed = ("airspeed_true_m_s", "roll_rad", "roll_rate_rad_s", "pitch_rate_rad_s")
    if absent := [name for name in needed if name not in block.present]:
        raise ValueError(f"the flight has no {absent[0]}: steady segments need {', '.join(needed)}")
    rows = np.flatnonzero(np.isfinite(np.stack([block.column(n) for n in needed])).all(axis=0))
    dense = SampleBlock(block.values[rows])
    found: list[SteadySegment] = []
    for run in runs(dense.time_s):
        part = SampleBlock(dense.values[run])
        found += [_segment(SampleBlock(part.values[s]), c) for s in _pieces(part, c)]
    return tuple(found)


def _pieces(part: SampleBlock, c: SteadyLimits) -> list[slice]:
    """Rows of the steady pieces of a run without gaps."""
    time_s = part.time_s
    if len(part) < 8 or time_s[-1] - time_s[0] < c.shortest_s:
        return []
    step = float(np.median(np.diff(time_s)))
    half = max(1, round(0.5 * c.window_s / step))
    speed = part.column("airspeed_true_m_s")
    bank = _mean(part.column("roll_rad"), half)
    turning = np.sqrt(
        np.maximum(
            _mean(part.column("roll_rate_rad_s") ** 2, half),
            _mean(part.column("pitch_rate_rad_s") ** 2, half),
        )
    )
    smooth = _mean(speed, half)
    low, high = (
        np.maximum(np.arange(len(part)) - half, 0),
        np.minimum(np.arange(len(part)) + half, len(part) - 1),
    )
    speeding = (smooth[high] - smooth[low]) / (time_s[high] - time_s[low])
    calm = (np.abs(bank) < c.roll_rad) & (turning < c.rate_rad_s) & (np.abs(speeding) < c.speeding_m_s2)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], calm, [False]]).astype(np.int8)))
    pieces = []
    for first, last in edges.reshape(-1, 2).tolist():
        # within half a window of unsteady flight the mean is not of steady flight alone
        start, end = first + (half if first > 0 else 0), last - (half if last < len(part) else 0)
        count = max(1, int(np.ceil((end - start) * step / c.longest_s)))
        cuts = np.linspace(start, max(end, start), count + 1).astype(int).tolist()
        for a, b in pairwise(cuts):
            if (b - a) * step >= c.shortest_s:
                pieces.append(slice(a, b))
    return pieces


def _mean(values: Array, half: int) -> Array:
    """Mean over ``half`` samples to either side, fewer at the ends."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    index = np.arange(values.size)
    low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, values.size)
    return np.asarray((total[high] - total[low]) / (high - low))


def _segment(part: SampleBlock, c: SteadyLimits) -> SteadySegment:
    mean, error = {}, {}
    step = float(np.median(np.diff(part.time_s)))
    for name in part.present:
        values = part.column(name)
        values = values[np.isfinite(values)]
        mean[name] = float(np.mean(values))
        spread = coloured_spread((values - mean[name])[:, None], round(c.memory_s / step))[0, 0]
        error[name] = float(np.sqrt(max(spread, 0.0)) / values.size)
    return SteadySegment(float(part.time_s[0]), float(part.time_s[-1]), mean, error)
