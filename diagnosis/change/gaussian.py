"""A likelihood near its maximum beside a Gaussian prior: where both meet, and what the whole is worth.

With minus the log-likelihood a - g'd + d'Hd/2 at x + d and a prior N(mean, precision^-1),

    ln evidence = -a + g'd - d'Hd/2 - (x + d - mean)' precision (x + d - mean)/2 - ln det(H + precision)/2
                  + ln det(precision)/2                                                                       (10)

at the best d within limits (Laplace's method). docs/methods/diagnosis.md, section 10.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Belief", "Meeting", "Quadratic", "met"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Belief:
    """A Gaussian of parameters: mean (n,), precision (n, n)."""

    mean: Array
    precision: Array

    @property
    def covariance(self) -> Array:
        """Of the parameters, (n, n)."""
        return np.asarray(np.linalg.inv(self.precision))

    def widened(self, variance: Array) -> "Belief":
        """Of parameters that have changed since by something of these variances, (n,)."""
        return Belief(self.mean, np.asarray(np.linalg.inv(self.covariance + np.diag(variance))))

    def beside(self, spread: Array) -> "Belief":
        """With further parameters that are 0 beforehand, with standard deviations ``spread`` (k,)."""
        n, k = len(self.mean), len(spread)
        precision = np.zeros((n + k, n + k))
        precision[:n, :n] = self.precision
        precision[range(n, n + k), range(n, n + k)] = spread**-2.0
        return Belief(np.concatenate([self.mean, np.zeros(k)]), precision)


@dataclass(frozen=True, slots=True)
class Quadratic:
    """Minus a log-likelihood near a point.

    Attributes:
        at: the point, (n,).
        cost: there.
        score: gradient of the log-likelihood there, (n,); information: minus its curvature, (n, n).
    """

    at: Array
    cost: float
    score: Array
    information: Array


@dataclass(frozen=True, slots=True)
class Meeting:
    """Equation (10): where both are likeliest, as a Gaussian, and the log of the evidence."""

    belief: Belief
    log_evidence: float

    @property
    def mode(self) -> Array:
        """Where both are likeliest, (n,)."""
        return self.belief.mean


def met(likelihood: Quadratic, prior: Belief, low: Array | None = None, high: Array | None = None) -> Meeting:
    """Both together.

    Args:
        likelihood: near a point.
        prior: of the same parameters.
        low, high: limits of the last parameters, (k,) each; parameters before them have none.
    """
    whole = likelihood.information + prior.precision
    gradient = likelihood.score - prior.precision @ (likelihood.at - prior.mean)
    step = np.asarray(np.linalg.solve(whole, gradient), dtype=np.float64)
    if low is not None and high is not None and len(low):
        step = _within(whole, gradient, step, likelihood.at, (low, high))
    mode = likelihood.at + step
    off = mode - prior.mean
    cost = (
        likelihood.cost - float(likelihood.score @ step) + 0.5 * float(step @ likelihood.information @ step)
    )
    cost += 0.5 * float(off @ prior.precision @ off)
    volume = 0.5 * (np.linalg.slogdet(prior.precision)[1] - np.linalg.slogdet(whole)[1])
    return Meeting(Belief(mode, whole), volume - cost)


def _within(whole: Array, gradient: Array, step: Array, at: Array, limits: tuple[Array, Array]) -> Array:
    """The step with its last parameters within limits, the others at their best beside them."""
    k = len(limits[0])
    last = np.clip(at[-k:] + step[-k:], *limits) - at[-k:]
    if np.array_equal(last, step[-k:]):
        return step
    first = np.linalg.solve(whole[:-k, :-k], gradient[:-k] - whole[:-k, -k:] @ last)
    return np.concatenate([first, last])
