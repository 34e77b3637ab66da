"""What no linear model describes, as a dispersion of what a window says; compiled.

Derivation and symbols: ``docs/methods/fourier.md`` section 10, (37a) and (37b). Arrays are those of one vehicle.
"""

from wingwatch.estimators.evidence.dispersion import CHI_SQUARE, DISPERSION, FREEDOM
from wingwatch.kernels.decorators import lean

__all__ = ["misfit_dispersions"]

MISFIT, LARGEST_MISFIT = 0.05, 0.15
"""Fraction of what an equation explains that no linear model describes: as expected beforehand, and the most that is
taken for misfit instead of a change. Of the accelerations of JSBSim's bundled aircraft in flights with small doublets
the linear model leaves 0.2 to 30 %, half of them less than 4 % (``benchmarks/jsbsim_aircraft.py``)."""

MISFIT_FREEDOM = 1.0
"""Weight of what is expected beforehand, in degrees of freedom: the order of magnitude is known, no more."""


@lean
def _signal_to_noise(k, theta, work):  # type: ignore[no-untyped-def]
    """What equation k explains, over the noise, as the mean over the bins that it lies in."""
    present, power, weights = work.derivatives, work.equation.power, work.noise.weights
    regressors = work.transforms.without_errors
    ns, nd = present.shape
    total = squares = explained = 0.0
    for f in range(weights.shape[3]):
        x = y = 0.0
        for c in range(nd):
            channel = c if c < ns else c + 1
            x += present[k, c] * regressors[channel, 0, f]
            y += present[k, c] * regressors[channel, 1, f]
        in_bin = weights[k, k, 0, f] * (x * x + y * y)
        total += in_bin
        squares += in_bin * in_bin
    for c in range(nd):
        for d in range(nd):
            a, b = k * nd + c, k * nd + d
            explained += theta[a] * power[a, b] * theta[b]
    return max(explained, 0.0) * squares / (total * total) if squares > 0.0 else 0.0


@lean
def misfit_dispersions(theta, scatter, work, dispersions):  # type: ignore[no-untyped-def]
    """Variance of noise and misfit over that of noise alone, by equation, (docs (37b)).

    Args:
        theta: (k,) derivatives at which the window was linearised.
        scatter: (equations, 3) of the blocks so far.
        work: ``SolutionWorkspace`` of the window's solution.
        dispersions: (equations, 3), as ``evidence.dispersion.disperse`` takes them.
    """
    for k in range(dispersions.shape[0]):
        ratio = _signal_to_noise(k, theta, work)
        expected, most = 1.0 + MISFIT**2 * ratio, 1.0 + LARGEST_MISFIT**2 * ratio
        freedom = MISFIT_FREEDOM + scatter[k, FREEDOM]
        scattered = (MISFIT_FREEDOM * expected + scatter[k, CHI_SQUARE]) / freedom
        dispersions[k, DISPERSION] = min(max(scattered, 1.0), most)
