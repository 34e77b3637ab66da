"""Windows of a flight: runs without a gap, on an even time base, and slopes that know the stamps."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.sample import LEAPING_CHANNELS, MAX_GAP_S, SampleBlock

__all__ = ["even_window", "runs", "slopes"]

Array = NDArray[np.float64]


def runs(time_s: Array, max_gap_s: float = MAX_GAP_S) -> list[slice]:
    """Rows between gaps: consecutive stamps that increase by no more than ``max_gap_s``; shape of input (n,)."""
    step = np.diff(time_s)
    with np.errstate(invalid="ignore"):
        breaks = np.flatnonzero(~((step > 0.0) & (step <= max_gap_s))) + 1
    edges = [0, *breaks.tolist(), len(time_s)]
    return [slice(a, b) for a, b in pairwise(edges) if b > a]


def even_window(
    block: SampleBlock, names: Sequence[str], max_gap_s: float = MAX_GAP_S
) -> tuple[Array, Mapping[str, Array]]:
    """The longest window in which every named channel has readings at most ``max_gap_s`` apart, evenly sampled.

    The step is the median one; readings are interpolated, roll and heading unwrapped. Even stamps stay to the bit.

    Returns:
        Stamps, shape (n,), and the channels by name, each (n,).

    Raises:
        ValueError: a channel without a reading, or no window of at least 64 samples.
    """
    columns = [block.column(name) for name in names]
    if absent := [n for n, c in zip(names, columns, strict=True) if not np.isfinite(c).any()]:
        raise ValueError(f"the flight has no {absent[0]}: this needs {', '.join(names)}")
    time_s = block.time_s
    kept = [np.isfinite(c) for c in columns]
    covered = [_covered(time_s, k, max_gap_s) for k in kept]
    inside = np.logical_and.reduce([np.isfinite(time_s), *covered])
    rows = np.flatnonzero(inside)
    windows = [rows[s] for s in runs(np.where(inside, time_s, np.nan)[rows], max_gap_s)] if rows.size else []
    longest = max(windows, key=len, default=rows)
    if len(longest) < 64:
        raise ValueError(
            f"the longest window without a gap has {len(longest)} samples: at least 64 are needed"
        )
    step = float(np.median(np.diff(time_s[longest])))
    even = time_s[longest]
    if np.ptp(np.diff(even)) > 1e-6:
        even = np.arange(even[0], even[-1] + 1e-9, step)
    sampled = {}
    for name, column, present in zip(names, columns, kept, strict=True):
        there = longest[present[longest]]
        values = np.unwrap(column[there]) if name in LEAPING_CHANNELS else column[there]
        sampled[name] = np.interp(even, time_s[there], values)
    return even, sampled


def _covered(time_s: Array, present: NDArray[np.bool_], max_gap_s: float) -> NDArray[np.bool_]:
    """Whether a row lies between readings that are no more than a gap apart."""
    index = np.arange(time_s.size)
    before = np.maximum.accumulate(np.where(present, index, -1))
    after = np.minimum.accumulate(np.where(present, index, time_s.size)[::-1])[::-1]
    inside = (before >= 0) & (after < time_s.size)
    width = np.full(time_s.shape, np.inf)
    width[inside] = time_s[after[inside]] - time_s[before[inside]]
    return present | (inside & (width <= max_gap_s))


def slopes(time_s: Array, values: Array, max_gap_s: float = MAX_GAP_S) -> Array:
    """Rates of change by a quartic through seven neighbours (thesis 6.6.1, local differentiation).

    White noise of standard deviation s gives 0.51 s / dt; at a twentieth of the sample rate 0.2 % of the slope is lost.

    Args:
        time_s: stamps, shape (n,).
        values: shape (n,) or (n, k).
        max_gap_s: windows end at longer steps; at a window's ends the quartic of the nearest whole window is used.

    Returns:
        Shape of ``values``; NaN in windows of fewer than seven samples and where a neighbour is missing.
    """
    half_width = 3
    width = 2 * half_width + 1
    columns = values.reshape(len(time_s), -1)
    out = np.full(columns.shape, np.nan)
    for run in runs(time_s, max_gap_s):
        t, x = time_s[run], columns[run]
        if len(t) < width:
            continue
        first = np.clip(np.arange(len(t)) - half_width, 0, len(t) - width)
        rows = first[:, None] + np.arange(width)
        near = t[rows] - t[:, None]
        size = float(np.max(np.abs(near)))
        gain = np.linalg.pinv(np.stack([(near / size) ** j for j in range(5)], axis=-1))[:, 1, :] / size
        out[run] = np.einsum("nw,nwk->nk", gain, x[rows])
    return out.reshape(values.shape)
