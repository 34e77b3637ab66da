"""Rigid-body motion with sensors that err: the model of the flight-path reconstruction.

States: roll, pitch, heading, U V W (through the air at large), altitude, the gusts that vanes and airspeed see on top;
then the sensors' errors, constant. A sensor reads (1 + scale) truth + bias + gust; the air at large may rise or sink.
Motion: ``kinematics``. Gusts are of first order (Dryden's form for u), their standard deviation and time handed in.
They are added to what the sensor makes of the motion: as factors of each other a gust and a scale error have no most
likely value.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.kinematics import GRAVITY_M_S2

__all__ = ["ERRORS", "MOTION", "READINGS", "PathModel"]

Array = NDArray[np.float64]
AnyArray = NDArray[np.float64] | NDArray[np.complex128]

MOTION = 10
"""States before the sensors' errors: three angles, three velocities, altitude, three gusts."""

ERRORS: tuple[tuple[str, str], ...] = (
    ("bias of roll_rate_rad_s", "rad/s"),
    ("bias of pitch_rate_rad_s", "rad/s"),
    ("bias of yaw_rate_rad_s", "rad/s"),
    ("bias of specific_force_x_m_s2", "m/s2"),
    ("bias of specific_force_y_m_s2", "m/s2"),
    ("bias of specific_force_z_m_s2", "m/s2"),
    ("scale of airspeed_true_m_s", ""),
    ("bias of airspeed_true_m_s", "m/s"),
    ("scale of angle_of_attack_rad", ""),
    ("bias of angle_of_attack_rad", "rad"),
    ("scale of sideslip_rad", ""),
    ("bias of sideslip_rad", "rad"),
    ("rising air", "m/s"),
)
"""Names and units of the constants, in the state's order after ``MOTION``."""

READINGS = (
    "roll_rad", "pitch_rad", "heading_rad", "airspeed_true_m_s", "angle_of_attack_rad", "sideslip_rad", "altitude_m",
)  # fmt: skip
"""Channels that correct the state; gyros and accelerometers drive it."""

_STEP = 1e-20
"""Of the complex-step derivative: exact to rounding, whatever its size."""


@dataclass(frozen=True, slots=True)
class PathModel:
    """The motion over a step and what the sensors read.

    Attributes:
        gust_time_s: correlation time of the gusts u, v, w, shape (3,).
        speed_m_s: at which a gust across turns the flow by gust / speed.
    """

    gust_time_s: Array
    speed_m_s: float

    def rate(self, x: AnyArray, inputs: Array) -> AnyArray:
        """dx/dt, shape of ``x`` (states, ...), for readings of gyros and accelerometers (6,)."""
        roll, pitch = x[0], x[1]
        u, v, w = x[3], x[4], x[5]
        e = x[MOTION:]
        p, q, r = inputs[0] - e[0], inputs[1] - e[1], inputs[2] - e[2]
        ax, ay, az = inputs[3] - e[3], inputs[4] - e[4], inputs[5] - e[5]
        sin_roll, cos_roll, sin_pitch, cos_pitch = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
        turn = q * sin_roll + r * cos_roll
        out = np.zeros_like(x)
        out[0] = p + turn * sin_pitch / cos_pitch
        out[1] = q * cos_roll - r * sin_roll
        out[2] = turn / cos_pitch
        out[3] = ax - q * w + r * v - GRAVITY_M_S2 * sin_pitch
        out[4] = ay - r * u + p * w + GRAVITY_M_S2 * cos_pitch * sin_roll
        out[5] = az + q * u - p * v + GRAVITY_M_S2 * cos_pitch * cos_roll
        out[6] = u * sin_pitch - cos_pitch * (v * sin_roll + w * cos_roll) + e[12]
        for j in range(3):
            out[7 + j] = -x[7 + j] / self.gust_time_s[j]
        return out

    def step(self, x: AnyArray, inputs: Array, dt: float) -> AnyArray:
        """The state after ``dt`` by the midpoint rule, ``inputs`` the mean over the step."""
        return x + dt * self.rate(x + 0.5 * dt * self.rate(x, inputs), inputs)

    def readings(self, x: AnyArray) -> AnyArray:
        """What ``READINGS`` say, shape (7, ...), for states (states, ...)."""
        e = x[MOTION:]
        u, v, w = x[3], x[4], x[5]
        ahead = np.sqrt(u * u + w * w)
        alpha, beta = np.arctan(w / u), np.arctan(v / ahead)
        speed = np.sqrt(u * u + v * v + w * w)
        return np.array(
            [
                x[0], x[1], x[2], (1.0 + e[6]) * speed + e[7] + x[7],
                (1.0 + e[8]) * alpha + e[9] + x[9] / self.speed_m_s,
                (1.0 + e[10]) * beta + e[11] + x[8] / self.speed_m_s, x[6],
            ]
        )  # fmt: skip

    def step_jacobian(self, x: Array, inputs: Array, dt: float) -> tuple[Array, Array]:
        """The state after a step and its Jacobian (states, states)."""
        moved = self.step(x[:, None] + 1j * _STEP * np.eye(x.size), inputs, dt)
        return np.real(self.step(x, inputs, dt)), np.imag(moved) / _STEP

    def readings_jacobian(self, x: Array) -> Array:
        """Jacobian of the readings, shape (7, states)."""
        return np.asarray(np.imag(self.readings(x[:, None] + 1j * _STEP * np.eye(x.size))) / _STEP)
