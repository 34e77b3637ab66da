"""The gust in what a kinematic identity leaves: its strength beside the vane's and the inertial channels' noise."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import compiled, helper
from wingwatch.telemetry.conditioning.kinematics import Columns
from wingwatch.telemetry.conditioning.sensor_noise import identity_noise
from wingwatch.telemetry.conditioning.spectra import Bins

__all__ = ["Gust", "Whittle", "dryden_across", "fit_gust"]

Array = NDArray[np.float64]

_SURE = 9.0
"""Twice the log-likelihood ratio from which a gust is believed: three standard errors."""

_ABSENT, _MOST = -40.0, 20.0
"""Logarithms of levels at least and at most: at the least one a part is as good as absent."""

_FURTHEST, _MOST_STEPS, _SETTLED = 3.0, 200, 1e-9
"""Most that a logarithm moves in a step, most steps, and the gain in log-likelihood that is none."""

_MOST_DAMPED = 1e9
"""Damping beyond which no step pays: the place is the most likely to rounding."""


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
    fit = Whittle(
        power / window, shapes, inertial, math.sqrt(bins.overlap / (0.1 * bins.samples)), bins.overlap
    )
    x, likelihood = fit.best(gusts=True)
    seen = 2.0 * (likelihood - fit.best(gusts=False)[1]) > _SURE
    sigma = math.exp(0.5 * x[0])
    made = sigma**2 * shapes[0] * window if seen else np.zeros_like(omega)
    return Gust(sigma, sigma * fit.half_error(x), seen, made)


@dataclass(frozen=True, slots=True)
class Whittle:
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
        x = np.log([max(float(np.median(self.power / s)), 1e-12) for s in self.shapes])
        inertial = math.log(max(self.inertial, 1e-12))
        x[2] = inertial
        if not gusts:
            x[0] = _ABSENT
        sums = _Sums(np.empty(3), np.empty((3, 3)), np.empty(3))
        least = _descend(
            self.power, self.shapes, (inertial, self.doubt, self.overlap), 0 if gusts else 1, x, sums
        )
        return x, -float(least)

    def half_error(self, x: Array) -> float:
        """Standard error of half the first logarithm: relative error of the root mean square."""
        parts = np.exp(x)[:, None] * self.shapes / (np.exp(x) @ self.shapes)
        information = parts @ parts.T / self.overlap
        information[2, 2] += self.doubt**-2.0
        return 0.5 * math.sqrt(max(float(np.linalg.pinv(information)[0, 0]), 0.0))


class _Sums(NamedTuple):
    """Workspace of ``_descend``: the slope (3,), the information (3, 3), and where a step leads (3,)."""

    slope: Array
    information: Array
    trial: Array


@helper
def _cost(power, shapes, prior, x):  # type: ignore[no-untyped-def]
    """Minus the log-likelihood of logarithms of levels x (3,); ``prior`` as for ``_descend``."""
    inertial, doubt, overlap = prior
    gust, vane, flat, total = math.exp(x[0]), math.exp(x[1]), math.exp(x[2]), 0.0
    for f in range(power.size):
        model = gust * shapes[0, f] + vane * shapes[1, f] + flat * shapes[2, f]
        total += math.log(model) + power[f] / model
    return total / overlap + 0.5 * ((x[2] - inertial) / doubt) ** 2


@helper
def _expand(power, shapes, prior, x, sums):  # type: ignore[no-untyped-def]
    """Slope of the cost at x and its expected curvature, Fisher's information, into the workspace."""
    inertial, doubt, overlap = prior
    slope, information = sums.slope, sums.information
    slope[:], information[:, :] = 0.0, 0.0
    levels = np.exp(x)
    for f in range(power.size):
        model = levels[0] * shapes[0, f] + levels[1] * shapes[1, f] + levels[2] * shapes[2, f]
        off = (1.0 - power[f] / model) / overlap
        for a in range(3):
            part = levels[a] * shapes[a, f] / model
            slope[a] += part * off
            for b in range(a + 1):
                information[a, b] += part * levels[b] * shapes[b, f] / (model * overlap)
    for a in range(3):
        for b in range(a):
            information[b, a] = information[a, b]
    slope[2] += (x[2] - inertial) / doubt**2
    information[2, 2] += doubt**-2.0


@helper
def _step(first, damping, x, sums):  # type: ignore[no-untyped-def]
    """Where a damped step of scoring leads from x, the levels before ``first`` kept, into ``sums.trial``."""
    matrix, step = sums.information.copy(), -sums.slope
    for a in range(first, 3):
        matrix[a, a] = (1.0 + damping) * matrix[a, a] + 1e-12
    for a in range(first, 3):
        for b in range(a + 1, 3):
            ratio = matrix[b, a] / matrix[a, a]
            step[b] -= ratio * step[a]
            for c in range(a, 3):
                matrix[b, c] -= ratio * matrix[a, c]
    for a in range(2, first - 1, -1):
        for c in range(a + 1, 3):
            step[a] -= matrix[a, c] * step[c]
        step[a] /= matrix[a, a]
    for a in range(3):
        moved = min(max(step[a], -_FURTHEST), _FURTHEST) if a >= first else 0.0
        sums.trial[a] = min(max(x[a] + moved, _ABSENT), _MOST)


@compiled(error_model="numpy", nogil=True)
def _descend(power, shapes, prior, first, x, sums):  # type: ignore[no-untyped-def]
    """Find the most likely logarithms of levels, by Fisher's scoring, damped where a step does not pay.

    Args:
        power: periodogram (k,).
        shapes: (3, k).
        prior: logarithm of the third level, its standard error, and the bins' overlap.
        first: the first level that is sought.
        x: (3,) where it begins, and in place where it ends.
        sums: ``_Sums``.

    Returns:
        minus the log-likelihood there.
    """
    least, damping = _cost(power, shapes, prior, x), 0.0
    _expand(power, shapes, prior, x, sums)
    for _ in range(_MOST_STEPS):
        _step(first, damping, x, sums)
        cost = _cost(power, shapes, prior, sums.trial)
        if cost <= least:
            gain = least - cost
            for j in range(x.size):
                x[j] = sums.trial[j]
            least, damping = cost, 0.1 * damping
            if gain <= _SETTLED:
                break
            _expand(power, shapes, prior, x, sums)
        elif damping > _MOST_DAMPED:
            break
        else:
            damping = max(10.0 * damping, 1e-3)
    return least
