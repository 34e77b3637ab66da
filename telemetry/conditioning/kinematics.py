"""What rigid-body motion says of channels to one another, whatever the aerodynamics: the kinematic identities.

Thesis 4.3 and 7.1 to 7.3 in still (or steadily moving) air, U = V cos(alpha) cos(beta), V sin(beta),
W = V sin(alpha) cos(beta):

    roll'    = p + tan(theta) (q sin(phi) + r cos(phi))        pitch' = q cos(phi) - r sin(phi)
    heading' = (q sin(phi) + r cos(phi)) / cos(theta)
    U' = a_x - q W + r V - g sin(theta)                         V' = a_y - r U + p W + g cos(theta) sin(phi)
    W' = a_z + q U - p V + g cos(theta) cos(phi)
    altitude' = U sin(theta) - V cos(theta) sin(phi) - W cos(theta) cos(phi)
"""

from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.atmosphere import GRAVITY_M_S2

__all__ = ["IDENTITIES", "Columns", "velocity"]

Array = NDArray[np.float64]
Columns: TypeAlias = Mapping[str, Array]


def velocity(c: Columns) -> tuple[Array, Array, Array]:
    """U, V, W from airspeed and flow angles at the centre of gravity (thesis 6.2); absent angles are taken as 0."""
    airspeed = c["airspeed_true_m_s"]
    alpha = c.get("angle_of_attack_rad", np.zeros_like(airspeed))
    beta = c.get("sideslip_rad", np.zeros_like(airspeed))
    ahead = airspeed * np.cos(beta)
    return ahead * np.cos(alpha), airspeed * np.sin(beta), ahead * np.sin(alpha)


def _roll(c: Columns) -> tuple[Array, Array]:
    turn = c["pitch_rate_rad_s"] * np.sin(c["roll_rad"]) + c["yaw_rate_rad_s"] * np.cos(c["roll_rad"])
    return c["roll_rad"], c["roll_rate_rad_s"] + np.tan(c["pitch_rad"]) * turn


def _pitch(c: Columns) -> tuple[Array, Array]:
    roll = c["roll_rad"]
    return c["pitch_rad"], c["pitch_rate_rad_s"] * np.cos(roll) - c["yaw_rate_rad_s"] * np.sin(roll)


def _heading(c: Columns) -> tuple[Array, Array]:
    turn = c["pitch_rate_rad_s"] * np.sin(c["roll_rad"]) + c["yaw_rate_rad_s"] * np.cos(c["roll_rad"])
    return c["heading_rad"], turn / np.cos(c["pitch_rad"])


def _ahead(c: Columns) -> tuple[Array, Array]:
    u, v, w = velocity(c)
    gravity = -GRAVITY_M_S2 * np.sin(c["pitch_rad"])
    return u, c["specific_force_x_m_s2"] - c["pitch_rate_rad_s"] * w + c["yaw_rate_rad_s"] * v + gravity


def _across(c: Columns) -> tuple[Array, Array]:
    u, v, w = velocity(c)
    gravity = GRAVITY_M_S2 * np.cos(c["pitch_rad"]) * np.sin(c["roll_rad"])
    return v, c["specific_force_y_m_s2"] - c["yaw_rate_rad_s"] * u + c["roll_rate_rad_s"] * w + gravity


def _down(c: Columns) -> tuple[Array, Array]:
    u, v, w = velocity(c)
    gravity = GRAVITY_M_S2 * np.cos(c["pitch_rad"]) * np.cos(c["roll_rad"])
    return w, c["specific_force_z_m_s2"] + c["pitch_rate_rad_s"] * u - c["roll_rate_rad_s"] * v + gravity


def _altitude(c: Columns) -> tuple[Array, Array]:
    u, v, w = velocity(c)
    sin, cos = np.sin(c["pitch_rad"]), np.cos(c["pitch_rad"])
    return c["altitude_m"], u * sin - v * cos * np.sin(c["roll_rad"]) - w * cos * np.cos(c["roll_rad"])


IDENTITIES: Mapping[str, Callable[[Columns], tuple[Array, Array]]] = {
    "roll": _roll,
    "pitch": _pitch,
    "heading": _heading,
    "down": _down,
    "across": _across,
    "ahead": _ahead,
    "altitude": _altitude,
}
"""By name: columns, each (n,), to what is measured and to what the other channels say is its rate, each (n,)."""
