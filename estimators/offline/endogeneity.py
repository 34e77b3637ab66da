"""What a residual that no sensor explains may have done to the regressors, and so to the estimates.

Equation error takes regressors and residuals for independent. A moment that nobody measured (rolling or turning air,
above all) is in the residual and moves the aircraft, so the regressors follow it: they are endogenous, and no
correlation of the residual with itself says how far the estimates are off. Two things are known without a model of
that moment (Durbin 1954, Wu 1973, Hausman 1978):

1. Instruments Z, here the response of the model to the measured surfaces alone, do not follow it in open loop.
   d = theta_IV - theta, with theta_IV from Z' (y - R theta_IV) = 0, has mean zero where the regressors do not follow it
   either, and the covariance V_d = H cov(e) H', H = (Z'R)^-1 Z' - (R'R)^-1 R'. V_d is small where surfaces made most of
   the motion, large where the air did. Where d is within chance V_d is what the instruments cannot exclude, where it is
   beyond chance the estimates are off by d, give or take V_d: the covariance gets V_d, or d d' + V_d.
2. Whatever it does, |sum h e| <= |h| |e| (Cauchy and Schwarz), e being what the sensors leave of the residual. No
   derivative can be off by more.

An autopilot moves the surfaces by the same moment. Then theta_IV is off as well, to the same side in what was tried,
and d is too small, the less so the more doublets there are. Where so much is left that the model does not hold
(``regression.left_over``), the bound alone is taken.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.estimators.offline.likelihood import open_loop
from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.parameters import Model
from wingwatch.estimators.offline.window import window
from wingwatch.estimators.plant.motion import Plant

__all__ = ["Difference", "left_unexplained", "may_be_off", "surface_response"]

Array = NDArray[np.float64]

_CHANCE = 0.01
"""Chance that a residual that the sensors explain, or a difference that chance explains, is called more than that."""

_FLAT = 1e-9
"""Of the largest eigenvalue of V_d's correlation: what is less is rounding."""


@dataclass(frozen=True, slots=True)
class Difference:
    """What one equation's residual may have done to derivatives.

    Attributes:
        value: theta_IV - theta of the equation's own derivatives, (k,); NaN where there are no instruments.
        covariance: V_d of the same, 0 elsewhere, (k, k).
        bound: |e|^2 h h' summed, e what the sensors leave of the residual, h its influence on the derivatives, (k, k).
    """

    value: Array
    covariance: Array
    bound: Array

    def by_bound(self) -> "Difference":
        """The bound alone: where the model does not hold its response to the surfaces tells nothing."""
        return Difference(np.full_like(self.value, np.nan), self.covariance, self.bound)


def surface_response(part: Manoeuvre, theta: Array) -> Array:
    """Response of the model to the measured surfaces alone, about the manoeuvre's mean.

    Args:
        part: a manoeuvre.
        theta: referred derivatives, (equations, states + inputs).

    Returns:
        (n, states); NaN where the response runs away.
    """
    inputs = part.inputs - part.inputs.mean(axis=0)
    alone = replace(part, states=0.0 * part.states, rest=0.0 * part.rest, inputs=inputs)
    none = np.zeros(0, dtype=np.int64)
    model = Model(Plant(part.config.structure, none, part.config.lever_m), False, np.ones(theta.size), np.inf)
    data = window(alone, none, np.zeros(inputs.shape[1]), deviations=False)
    return open_loop(model, data, model.system(theta.reshape(-1), data))


def left_unexplained(own: float, due: float, freedom: float) -> float:
    """Part of a residual's power that the sensors' noise does not explain; 0 where chance may be all of it.

    Args:
        own: power of the residual over its degrees of freedom; due: what the sensors' noise makes of it.
        freedom: of the residual.
    """
    if own <= due * float(scipy.stats.chi2.ppf(1.0 - _CHANCE, freedom)) / freedom:
        return 0.0
    return own - due


def may_be_off(differences: Sequence[Difference]) -> Array:
    """Covariance by which what no sensor explains may have put the concise derivatives off, (k, k)."""
    return np.asarray(sum(_of_one(d) for d in differences))


def _of_one(d: Difference) -> Array:
    """V_d, and d d' where d is beyond chance, but no derivative's error above its bound."""
    reach = np.sqrt(np.diagonal(d.bound))
    if not (np.isfinite(d.value).all() and np.isfinite(d.covariance).all() and d.covariance.any()):
        return d.bound
    known = np.flatnonzero(np.diagonal(d.covariance) > 0.0)
    scale = np.sqrt(np.diagonal(d.covariance)[known])
    values, vectors = np.linalg.eigh(d.covariance[np.ix_(known, known)] / np.outer(scale, scale))
    kept = values > _FLAT * values[-1]
    part = vectors[:, kept].T @ (d.value[known] / scale)
    off = d.covariance.copy()
    if float(part @ (part / values[kept])) > scipy.stats.chi2.ppf(1.0 - _CHANCE, int(kept.sum())):
        off += np.outer(d.value, d.value)
    shrink = np.minimum(1.0, reach / np.sqrt(np.maximum(np.diagonal(off), 1e-300)))
    return np.asarray(off * np.outer(shrink, shrink))
