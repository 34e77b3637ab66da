"""What a block's residuals have because derivatives, and courses of surfaces between samples, are not known; compiled.

Derivation: ``docs/methods/fourier.md`` section 2, (10a) to (10c).
"""

from wingwatch.estimators.fourier.noise import channel_variance
from wingwatch.estimators.fourier.state import COURSES, GUST, ROLLING
from wingwatch.kernels.decorators import lean

__all__ = ["doubt_of", "doubt_of_courses"]


@lean
def _beside_size(covariance, scale, plant, k, m):  # type: ignore[no-untyped-def]
    """Covariance of two derivatives by roll rate beside an error that all of them share, (docs (10b))."""
    nd = plant.derivatives.shape[1]
    a, b, roll = k * nd + 1, m * nd + 1, nd + 1
    by_a = plant.roll_column[k] / plant.roll_column[1] * scale[roll]
    by_b = plant.roll_column[m] / plant.roll_column[1] * scale[roll]
    own = scale[a] * scale[b] * covariance[a, b]
    own -= by_b * scale[a] * covariance[a, roll] + by_a * scale[b] * covariance[b, roll]
    return own + by_a * by_b * covariance[roll, roll]


@lean
def doubt_of(covariance, scale, plant, noise, doubt):  # type: ignore[no-untyped-def]
    """What noise and air leave in the residuals because the derivatives are not known, (docs (10a), (10b)).

    Args:
        covariance: (k, k) of the derivatives, referred; scale: (k,) from these to present ones.
        plant: ``Plant`` at which they are linearised.
        noise: all variances.
        doubt: (DOUBTED, states, states), filled.
    """
    ns = doubt.shape[1]
    nd = scale.size // ns
    for k in range(ns):
        for m in range(ns):
            doubt[0, k, m] = 0.0
            for j in range(nd):
                a, b = k * nd + j, m * nd + j
                doubted = scale[a] * scale[b] * covariance[a, b]
                doubt[0, k, m] += channel_variance(noise, j if j < ns else j + 1, ns) * doubted
                if j == ns - 1:
                    doubt[1, k, m] = noise[GUST] * doubted
            rolls = ns == 3 and plant.roll_column[1] != 0.0
            doubt[2, k, m] = noise[ROLLING] * _beside_size(covariance, scale, plant, k, m) if rolls else 0.0


@lean
def doubt_of_courses(sums, plant, doubt):  # type: ignore[no-untyped-def]
    """Add what is not known of surfaces between samples, (docs (10c)).

    Args:
        sums: of ``Block``.
        plant: ``Plant`` at which the block is linearised.
        doubt: (states, states) white, in place.
    """
    ns, nd = plant.derivatives.shape
    for j in range(nd - ns):
        moved, doubted = sums[COURSES + 2 * j], sums[COURSES + 2 * j + 1]
        if not (moved > 0.0 and doubted > 0.0):
            continue
        for k in range(ns):
            for m in range(ns):
                doubt[k, m] += _by_surface(plant, k, ns + j) * _by_surface(plant, m, ns + j) * doubted / moved


@lean
def _by_surface(plant, k, c):  # type: ignore[no-untyped-def]
    """What row k makes of a surface elsewhere between samples: an accelerometer's line misses it as the surface's."""
    if k > 0 or not plant.by_accelerometer:
        return plant.derivatives[k, c]
    turned = 0.0
    for m in range(1, plant.lever.size):
        turned += plant.lever[m] * plant.derivatives[m, c]
    return turned
