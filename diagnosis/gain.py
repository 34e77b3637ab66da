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
        {OUTPUTS[k]: _intervals(before, after, k) for k in used if before.pairs(k)},
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


def _intervals(before: Replayed, after: Replayed, k: int) -> Mapping[str, tuple[Interval, Interval]]:
    """Of the figures of ``Misfit`` that are made of sums over windows, before and after."""
    both = [_figures_of_draws(flown, k) for flown in (before, after)]
    return {name: (both[0][name], both[1][name]) for name in both[0]}


@np.errstate(all="ignore")  # windows that are drawn may hold no motion: such a figure is not known
def _figures_of_draws(flown: Replayed, k: int) -> Mapping[str, Interval]:
    """Each figure of all windows, with its interval by drawing windows anew (``misfit_of`` has the sums)."""
    rows = [
        (
            len(a), float(((a - b) ** 2).sum()), float(((a - a.mean()) ** 2).sum()),
            float(((b - a.mean()) ** 2).sum()), (a.mean() - b.mean()) ** 2, (a.std() - b.std()) ** 2,
        )
        for a, b in flown.pairs(k)
    ]  # fmt: skip
    sums = np.array(rows)
    drawn = np.random.default_rng(_SEED).integers(0, len(sums), (_DRAWS, len(sums)))
    of_draws, of_all = _figures(sums[drawn]), _figures(sums[None])
    return {
        name: Interval(float(of_all[name][0]), *map(float, np.nanquantile(values, [0.025, 0.975])))
        for name, values in of_draws.items()
    }


def _figures(sums: Array) -> Mapping[str, Array]:
    """Of (draws, windows, sums)."""
    count, left, moved, other, mean, deviation = np.moveaxis(sums, -1, 0)
    square = left.sum(axis=1) / count.sum(axis=1)
    bias, variance = (np.minimum(part.mean(axis=1) / square, 1.0) for part in (mean, deviation))
    return {
        "r_squared": 1.0 - left.sum(axis=1) / moved.sum(axis=1),
        "tic": np.sqrt(left.sum(axis=1)) / (np.sqrt(moved.sum(axis=1)) + np.sqrt(other.sum(axis=1))),
        "bias": bias, "variance": variance, "covariance": np.maximum(0.0, 1.0 - bias - variance),
    }  # fmt: skip
