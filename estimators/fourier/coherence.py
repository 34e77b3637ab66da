"""How much of what the equations leave goes with the motion that they explain; compiled.

Derivation and symbols: ``docs/methods/fourier.md`` section 8. Arrays are those of one vehicle.
"""

from wingwatch.estimators.evidence.dispersion import coherent_dispersion
from wingwatch.kernels.decorators import lean

__all__ = ["dispersion_of_bins", "gather_coherence"]

REAL, IMAGINARY, VARIANCE = range(3)
"""Of a bin: products of residual and motion summed over blocks, and the variance that noise gives them."""


@lean
def gather_coherence(transforms, plant, work, keep, coherence):  # type: ignore[no-untyped-def]
    """Add the products of a closed block to those of earlier blocks, bin by bin, (docs (32a)).

    A shift in time turns motion and residual alike, so a manoeuvre that is flown again adds to the same sums.

    Args:
        transforms: ``Transforms`` with the residual at the derivatives that are known now.
        plant: ``Plant`` at these.
        work: ``NoiseWorkspace`` after ``products.expected_products``.
        keep: what is kept of the blocks before.
        coherence: (equations, 3, bins), in place.
    """
    ns, nd = plant.derivatives.shape
    regressors, residual, weights = transforms.without_errors, transforms.residual, work.weights
    for k in range(ns):
        sums, driven = coherence[k], work.driven[k]
        for f in range(sums.shape[1]):
            a = b = x = y = 0.0
            for c in range(nd):
                channel = c if c < ns else c + 1
                a += plant.derivatives[k, c] * regressors[channel, 0, f]
                b += plant.derivatives[k, c] * regressors[channel, 1, f]
            for m in range(residual.shape[0]):
                u, v = weights[k, m, 0, f], weights[k, m, 1, f]
                x += u * residual[m, 0, f] - v * residual[m, 1, f]
                y += u * residual[m, 1, f] + v * residual[m, 0, f]
            sums[REAL, f] = keep * sums[REAL, f] + a * x + b * y - driven[0, f]
            sums[IMAGINARY, f] = keep * sums[IMAGINARY, f] + a * y - b * x - driven[1, f]
            sums[VARIANCE, f] = keep * keep * sums[VARIANCE, f] + (a * a + b * b) * weights[k, k, 0, f]


@lean
def dispersion_of_bins(sums, columns):  # type: ignore[no-untyped-def]
    """Power of one equation's products over that which noise gives them, at least one, (docs (32b)).

    Args:
        sums: (3, bins) of ``gather_coherence``.
        columns: derivatives of the equation, each of which has taken a degree of freedom.
    """
    found = expected = squares = 0.0
    for f in range(sums.shape[1]):
        found += sums[REAL, f] ** 2 + sums[IMAGINARY, f] ** 2
        expected += sums[VARIANCE, f]
        squares += sums[VARIANCE, f] ** 2
    if not squares > 0.0:
        return 1.0
    return coherent_dispersion(found, expected, 2.0 * expected * expected / squares, 1.0 * columns)
