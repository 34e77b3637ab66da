"""Inertia coupling: angular accelerations that follow from the rates and the moments of inertia alone.

Euler's equations of a rigid body that is symmetric about its x-z plane, with the inertia tensor
[[I_x, 0, -I_xz], [0, I_y, 0], [-I_xz, 0, I_z]] (Stevens and Lewis 2003, 1.3; Beard and McLain 2012, 3.13 to 3.17), give
beside the aerodynamic moments over the inertias

    dp/dt = G1 p q - G2 q r
    dq/dt = G5 p r - G6 (p^2 - r^2)
    dr/dt = G7 p q - G1 q r

    G1 = I_xz (I_x - I_y + I_z) / G          G5 = (I_z - I_x) / I_y
    G2 = (I_z (I_z - I_y) + I_xz^2) / G      G6 = I_xz / I_y
    G7 = (I_x (I_x - I_y) + I_xz^2) / G      G  = I_x I_z - I_xz^2

Roll and yaw are the accelerations themselves, I_xz solved for, as the concise derivatives of these equations are.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, Mass

__all__ = ["InertiaCoupling", "inertia_coupling"]


@dataclass(frozen=True, slots=True)
class InertiaCoupling:
    """Moments of inertia about the centre of gravity, body axes, kg m2; only their ratios count."""

    inertia_x_kg_m2: float
    inertia_y_kg_m2: float
    inertia_z_kg_m2: float
    inertia_xz_kg_m2: float = 0.0

    @classmethod
    def of(cls, mass: Mass) -> Self:
        """That of an aircraft file's [mass]."""
        return cls(mass.inertia_x_kg_m2, mass.inertia_y_kg_m2, mass.inertia_z_kg_m2, mass.inertia_xz_kg_m2)

    def coefficients(self, rate: str) -> NDArray[np.float64]:
        """What multiplies p q, q r, p r and p^2 - r^2 in the angular acceleration of ``rate`` (``p``, ``q``, ``r``).

        Returns:
            shape (4,), no unit (rad/s2 from products of rad/s).
        """
        x, y, z, xz = (
            self.inertia_x_kg_m2,
            self.inertia_y_kg_m2,
            self.inertia_z_kg_m2,
            self.inertia_xz_kg_m2,
        )
        both = x * z - xz**2
        table = {
            "p": (xz * (x - y + z) / both, -(z * (z - y) + xz**2) / both, 0.0, 0.0),
            "q": (0.0, 0.0, (z - x) / y, -xz / y),
            "r": ((x * (x - y) + xz**2) / both, -xz * (x - y + z) / both, 0.0, 0.0),
        }
        return np.array(table[rate])


def inertia_coupling(aircraft: Aircraft) -> InertiaCoupling | None:
    """Of an aircraft file's [mass]; None where it states none."""
    return None if aircraft.mass is None else InertiaCoupling.of(aircraft.mass)
