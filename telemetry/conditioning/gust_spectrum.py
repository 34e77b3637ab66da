"""The gust in what a kinematic identity leaves: its strength beside the vane's and the inertial channels' noise."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.kinematics import Columns
from wingwatch.telemetry.conditioning.sensor_noise import identity_noise
from wingwatch.telemetry.conditioning.spectra import Bins

__all__ = ["Gust", "dryden_across", "fit_gust"]

Array = NDArray[np.float64]

_SURE = 9.0
"""Twice the log-likelihood ratio from which a gust is believed: three standard errors."""


@dataclass(frozen=True, slots=True)
class Gust:
    """One component's strength.

    Attributes:
        sigma_m_s: root mean square of the whole gust by Dryden's form.
        standard_error_m_s: of it.
        seen: whether it stands above the sensors' noise.
        power: of the identity's residual that the gust makes, shape (bins,); zeros where it is not seen.
    """

    sigma_m_s: float
    standard_error_m_s: float
    seen: bool
    power: Array


def dryden_across(omega_rad_s: Array, time_s: float) -> Array:
    """Dryden's two-sided spectrum of v or w for a variance of 1, in s: T (1 + 3 x^2) / (1 + x^2)^2, x = w T, T = L / V.

    Its integral over all frequencies in Hz is 1 (MIL-F-8785C 3.7.2.2, L as in that specification).
    """
    x2 = (omega_rad_s * time_s) ** 2
    return np.asarray(time_s * (1.0 + 3.0 * x2) / (1.0 + x2) ** 2)


def fit_gust(power: Array, identity: str, columns: Columns, bins: Bins, gust_time_s: float) -> Gust:
    """Strength of the gust in the power that an identity leaves, w^2 s^2 G + w^2 R + A (``turbulence_intensity``).

    Args:
        power: squared transform of what is left, shape (bins,).
        identity: of ``kinematics``.
        columns: at the centre of gravity, each (n,).
        bins: of the transform.
        gust_time_s: scale over airspeed.
    """
    omega, window = bins.omega_rad_s, bins.step_s * float(np.sum(bins.taper**2))
    shapes = np.array([omega**2 * dryden_across(omega, gust_time_s), omega**2, np.ones_like(omega)])
    inertial = identity_noise(identity, columns, bins) / window
    fit = _Whittle(
        power / window, shapes, inertial, math.sqrt(bins.overlap / (0.1 * bins.samples)), bins.overlap
    )
    x, likelihood = fit.best(gusts=True)
    seen = 2.0 * (likelihood - fit.best(gusts=False)[1]) > _SURE
    sigma = math.exp(0.5 * x[0])
    made = sigma**2 * shapes[0] * window if seen else np.zeros_like(omega)
    return Gust(sigma, sigma * fit.half_error(x), seen, made)


@dataclass(frozen=True, slots=True)
class _Whittle:
    """Likelihood of a periodogram over the logarithms of the levels of gust, vane and inertial channels.

    Attributes:
        power: periodogram (k,).
        shapes: what each level multiplies, (3, k).
        inertial: the third level as the channels themselves tell it.
        doubt: standard error of its logarithm.
        overlap: of the bins: so many of them say what one independent one does.
    """

    power: Array
    shapes: Array
    inertial: float
    doubt: float
    overlap: float

    def best(self, gusts: bool) -> tuple[Array, float]:
        """The most likely logarithms (3,), and their log-likelihood; without gusts the first is as good as absent."""
        start = np.log([max(float(np.median(self.power / s)), 1e-12) for s in self.shapes])
        start[2] = math.log(max(self.inertial, 1e-12))
        bounds = [(-40.0, 20.0) if gusts else (-40.0, -40.0), (-40.0, 20.0), (-40.0, 20.0)]
        start[0] = start[0] if gusts else -40.0
        found = scipy.optimize.minimize(self._cost, start, jac=True, method="L-BFGS-B", bounds=bounds)
        return np.asarray(found.x, dtype=np.float64), -float(found.fun)

    def half_error(self, x: Array) -> float:
        """Standard error of half the first logarithm: relative error of the root mean square."""
        parts = np.exp(x)[:, None] * self.shapes / (np.exp(x) @ self.shapes)
        information = parts @ parts.T / self.overlap
        information[2, 2] += self.doubt**-2.0
        return 0.5 * math.sqrt(max(float(np.linalg.pinv(information)[0, 0]), 0.0))

    def _cost(self, x: Array) -> tuple[float, Array]:
        model = np.exp(x) @ self.shapes
        slope = np.exp(x) * (self.shapes @ (1.0 / model - self.power / model**2)) / self.overlap
        off = x[2] - math.log(max(self.inertial, 1e-12))
        slope[2] += off / self.doubt**2
        value = (
            float(np.sum(np.log(model) + self.power / model)) / self.overlap + 0.5 * (off / self.doubt) ** 2
        )
        return value, slope
