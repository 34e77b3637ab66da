"""Referred derivatives and concise ones, which both estimators state.

Aerodynamic stability derivatives grow with rho V and control derivatives with rho V^2 (thesis table B.3), so an
estimate made at one airspeed is carried to another by a ratio, without any geometry. Referred means: as it would be
at the reference airspeed and density. The kinematic parts (forward speed in z_q and y_r, W in y_p and x_q) are offsets.
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wingwatch.aircraft.structures import ModeStructure

__all__ = ["offsets", "referred_scale"]

Array = NDArray[np.float64]


def referred_scale(
    structure: ModeStructure,
    airspeed_true_m_s: ArrayLike,
    air_density_kg_m3: ArrayLike,
    reference: tuple[float, float],
) -> Array:
    """Factor from referred to present aerodynamic derivatives, shape (..., k) at airspeeds and densities (...).

    Columns of velocities and rates grow with rho V, those of angles and inputs with rho V^2. Phugoid and spiral are
    gravity and the full motion's quotients, of which neither law holds: theirs are not carried over, the factor is 1.
    """
    airspeed: Array = np.asarray(airspeed_true_m_s)[..., None]
    density: Array = np.asarray(air_density_kg_m3)[..., None]
    goes_by_angle = _goes_by_angle(structure)
    if goes_by_angle is None:
        return np.ones((*airspeed.shape[:-1], len(structure.derivatives)))
    by_velocity = density * airspeed / (reference[0] * reference[1])
    by_angle = by_velocity * airspeed / reference[0]
    return np.where(goes_by_angle, by_angle, by_velocity)


@cache
def _goes_by_angle(structure: ModeStructure) -> NDArray[np.bool_] | None:
    """Which derivatives grow with rho V^2, (k,); None where neither law holds."""
    if any(row in ("theta", "phi") for row in structure.equations):
        return None
    row = [c in ("alpha", "beta", *structure.inputs) for c in structure.regressors]
    return np.array(row * len(structure.equations))


def offsets(structure: ModeStructure, airspeed_true_m_s: ArrayLike, angle_of_attack_rad: ArrayLike) -> Array:
    """Kinematic part of each concise derivative (thesis table B.4), shape (..., k) at airspeeds and angles (...)."""
    speed, alpha = np.asarray(airspeed_true_m_s), np.asarray(angle_of_attack_rad)
    alpha = np.where(np.isfinite(alpha), alpha, 0.0)
    forward, down = speed * np.cos(alpha), speed * np.sin(alpha)
    kinematic = {"z_q": forward, "y_r": -forward, "y_p": down, "x_q": -down}
    out = np.zeros((*np.shape(forward), len(structure.derivatives)))
    for k, symbol in _kinematic(structure):
        out[..., k] = kinematic[symbol]
    return out


@cache
def _kinematic(structure: ModeStructure) -> tuple[tuple[int, str], ...]:
    """Places and symbols of the derivatives with a kinematic part."""
    return tuple((k, s) for k, s in enumerate(structure.derivatives) if s in ("z_q", "y_r", "y_p", "x_q"))
