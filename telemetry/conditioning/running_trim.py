"""The running trim: what a channel does more slowly than any mode, and what is left when that is taken away."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.windows import runs
from wingwatch.telemetry.sample import CHANNEL_INDEX, MAX_GAP_S, SampleBlock

__all__ = ["RunningTrim", "running_trim", "without_trim"]

Array = NDArray[np.float64]
_REACH = 4.0
"""Standard deviations of the kernel that are summed; what is left out is 6e-5 of it."""


@dataclass(frozen=True, slots=True)
class RunningTrim:
    """A flight split in two: ``trim + perturbation`` is the flight, channel by channel.

    Attributes:
        trim: the slow part of the channels that were asked for; the others as they were.
        perturbation: the fast part of these; the others as they were.
    """

    trim: SampleBlock
    perturbation: SampleBlock


def running_trim(time_s: Array, values: Array, corner_hz: float, max_gap_s: float = MAX_GAP_S) -> Array:
    """Slow part of each column: a straight line fitted around every instant under a Gaussian weight.

    Away from a window's ends it is a filter without phase, gain exp(-(2 pi f s)^2 / 2) with s such that the power
    is halved at the corner. A constant and a straight drift are wholly trim, at the ends too. It is linear and the
    same for all columns, so what is left obeys the same linear equations as the whole, dx/dt = A x + B u, with the
    trim's constant gone: at the corner states and inputs shrink alike. Missing values weigh nothing.

    Args:
        time_s: stamps, shape (n,); nearly even within a window.
        values: shape (n,) or (n, k).
        corner_hz: below it belongs to the trim; a tenth of the slowest mode of interest.
        max_gap_s: a new trim starts after a longer step.

    Returns:
        Shape of ``values``; NaN where a value is missing, and in windows of fewer than three samples.

    Raises:
        ValueError: a corner that is not positive.
    """
    if not (math.isfinite(corner_hz) and corner_hz > 0.0):
        raise ValueError(f"corner_hz is {corner_hz}; give a positive number of Hz")
    width_s = math.sqrt(math.log(2.0)) / (2.0 * math.pi * corner_hz)
    columns = values.reshape(len(time_s), -1)
    out = np.full(columns.shape, np.nan)
    for run in runs(time_s, max_gap_s):
        t = time_s[run]
        if len(t) < 3:
            continue
        step = float(np.median(np.diff(t)))
        lag = np.arange(-math.ceil(_REACH * width_s / step), math.ceil(_REACH * width_s / step) + 1) * step
        kernels = np.exp(-0.5 * (lag / width_s) ** 2) * (lag / width_s) ** np.arange(3)[:, None]
        out[run] = np.stack([_local_line(column, kernels) for column in columns[run].T], axis=1)
    return out.reshape(values.shape)


def _local_line(x: Array, kernels: Array) -> Array:
    """Value at every sample of the weighted straight line around it; ``kernels`` hold lag^0, lag^1, lag^2."""
    present = np.isfinite(x).astype(np.float64)
    middle = float(np.mean(x[present > 0.0])) if present.any() else 0.0
    level = np.where(present > 0.0, x - middle, 0.0)

    def moment(series: Array, power: int) -> Array:
        # the sample at lag j from here is weighted by kernel[j]: correlation, so the odd kernel turns its sign
        return np.asarray(
            scipy.signal.fftconvolve(series, kernels[power][::-1], mode="full"), dtype=np.float64
        )[kernels.shape[1] // 2 : kernels.shape[1] // 2 + len(series)]

    m0, m1, m2 = (moment(present, power) for power in range(3))
    b0, b1 = moment(level, 0), moment(level, 1)
    determinant = m0 * m2 - m1**2
    with np.errstate(invalid="ignore", divide="ignore"):
        line = np.where(determinant > 1e-12 * m0**2, (m2 * b0 - m1 * b1) / determinant, b0 / m0)
    return np.where(present > 0.0, line + middle, np.nan)


def without_trim(
    block: SampleBlock, channels: Sequence[str], corner_hz: float, max_gap_s: float = MAX_GAP_S
) -> RunningTrim:
    """A flight split into trim and perturbation in the named channels (``running_trim``).

    Roll and heading are unwrapped first, so their trim may leave [-pi, pi].

    Raises:
        KeyError: a name that is no channel.
        ValueError: a corner that is not positive.
    """
    index = [CHANNEL_INDEX[name] for name in channels]
    whole = block.values.copy()
    for name in ("roll_rad", "heading_rad"):
        if name in channels:
            column = whole[:, CHANNEL_INDEX[name]]
            there = np.isfinite(column)
            column[there] = np.unwrap(column[there])
    slow, fast = whole.copy(), whole.copy()
    slow[:, index] = running_trim(block.time_s, whole[:, index], corner_hz, max_gap_s)
    fast[:, index] = whole[:, index] - slow[:, index]
    return RunningTrim(SampleBlock(slow), SampleBlock(fast))
