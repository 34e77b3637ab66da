"""What the mended model gains on data that it was not fitted to."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.measured import OUTPUTS
from wingwatch.diagnosis.misfit import Replayed, misfit_of
from wingwatch.diagnosis.result import Gain, Interval, Misfit

__all__ = ["gain_of", "misfits"]

Array = NDArray[np.float64]

_DRAWS = 1000
_SEED = 20240501
"""Of the bootstrap."""


def misfits(flown: Replayed, noise: Array, used: tuple[int, ...]) -> Mapping[str, Misfit]:
    """Figures of every compared output."""
    found = {OUTPUTS[k]: misfit_of(flown, k, float(noise[k])) for k in used}
    return {name: figures for name, figures in found.items() if figures is not None}


def gain_of(before: Replayed, after: Replayed, noise: Array, used: tuple[int, ...], source: str) -> Gain:
    """Misfit by the stated and the mended model, and the change of the rms residual with its interval."""
    return Gain(
        source,
        misfits(before, noise, used),
        misfits(after, noise, used),
        {OUTPUTS[k]: change for k in used if (change := _change(before, after, k)) is not None},
    )


def _change(before: Replayed, after: Replayed, k: int) -> Interval | None:
    """Rms residual after over before, minus 1; the interval by drawing windows anew."""
    was = np.array([float(((a - b) ** 2).sum()) for a, b in before.pairs(k)])
    now = np.array([float(((a - b) ** 2).sum()) for a, b in after.pairs(k)])
    if was.size == 0 or was.size != now.size or not was.sum() > 0.0:
        return None
    drawn = np.random.default_rng(_SEED).integers(0, was.size, (_DRAWS, was.size))
    ratios = np.sqrt(now[drawn].sum(axis=1) / np.maximum(was[drawn].sum(axis=1), 1e-300)) - 1.0
    low, high = np.quantile(ratios, [0.025, 0.975])
    return Interval(float(np.sqrt(now.sum() / was.sum()) - 1.0), float(low), float(high))
