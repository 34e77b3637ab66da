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

from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.kernels.decorators import compiled, helper

__all__ = ["ERRORS", "MOTION", "READINGS", "PathModel", "smoothed"]

Array = NDArray[np.float64]

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

    def step_jacobian(self, x: Array, inputs: Array, dt: float) -> tuple[Array, Array]:
        """The state after ``dt`` by the midpoint rule and its Jacobian (states, states).

        Args:
            x: state, shape (states,).
            inputs: mean readings of gyros and accelerometers over the step, shape (6,).
            dt: length of the step, s.
        """
        moved, jacobian = _step_jacobian(x, inputs, dt, self.gust_time_s)
        return moved, jacobian

    def readings_jacobian(self, x: Array) -> tuple[Array, Array]:
        """What ``READINGS`` say of a state (states,), shape (7,), and its Jacobian (7, states)."""
        said, jacobian = _readings_jacobian(x, self.speed_m_s)
        return said, jacobian

    def process(self, jacobian: Array, input_power: Array, gust_std_m_s: Array, dt: float) -> Array:
        """What a step adds to the covariance (states, states): noise as the biases' columns carry it, and gusts.

        Args:
            jacobian: of the step, shape (states, states).
            input_power: variance of gyros and accelerometers, shape (6,).
            gust_std_m_s: of the gusts u, v, w, shape (3,).
            dt: length of the step, s.
        """
        power: Array = _process(jacobian, input_power, gust_std_m_s, self.gust_time_s, dt)
        return power


@compiled()
def _process(jacobian, input_power, gust_std, gust_time_s, dt):  # type: ignore[no-untyped-def]
    """See ``PathModel.process``."""
    power = np.zeros_like(jacobian)
    for i in range(MOTION):
        for j in range(MOTION):
            for k in range(6):
                power[i, j] += jacobian[i, MOTION + k] * input_power[k] * jacobian[j, MOTION + k]
    for j in range(3):
        power[7 + j, 7 + j] += gust_std[j] ** 2 * -np.expm1(-2.0 * dt / gust_time_s[j])
    return power


@helper
def _rate(x, inputs, gust_time_s):  # type: ignore[no-untyped-def]
    """dx/dt of a real or complex state (states,), for readings of gyros and accelerometers (6,)."""
    roll, pitch, u, v, w = x[0], x[1], x[3], x[4], x[5]
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
        out[7 + j] = -x[7 + j] / gust_time_s[j]
    return out


@helper
def _step(x, inputs, dt, gust_time_s):  # type: ignore[no-untyped-def]
    """The state after ``dt`` by the midpoint rule."""
    return x + dt * _rate(x + 0.5 * dt * _rate(x, inputs, gust_time_s), inputs, gust_time_s)


@helper
def _readings(x, speed_m_s):  # type: ignore[no-untyped-def]
    """What ``READINGS`` say of a real or complex state."""
    e = x[MOTION:]
    u, v, w = x[3], x[4], x[5]
    ahead = np.sqrt(u * u + w * w)
    speed = np.sqrt(u * u + v * v + w * w)
    out = np.zeros(7, dtype=x.dtype)
    out[0], out[1], out[2], out[6] = x[0], x[1], x[2], x[6]
    out[3] = (1.0 + e[6]) * speed + e[7] + x[7]
    out[4] = (1.0 + e[8]) * np.arctan(w / u) + e[9] + x[9] / speed_m_s
    out[5] = (1.0 + e[10]) * np.arctan(v / ahead) + e[11] + x[8] / speed_m_s
    return out


@compiled()
def _step_jacobian(x, inputs, dt, gust_time_s):  # type: ignore[no-untyped-def]
    """``_step`` and its derivative by complex steps, column by column."""
    nudged = x.astype(np.complex128)
    jacobian = np.empty((x.size, x.size))
    for j in range(x.size):
        nudged[j] = complex(x[j], _STEP)
        jacobian[:, j] = _step(nudged, inputs, dt, gust_time_s).imag / _STEP
        nudged[j] = complex(x[j], 0.0)
    return _step(x, inputs, dt, gust_time_s), jacobian


@compiled()
def _readings_jacobian(x, speed_m_s):  # type: ignore[no-untyped-def]
    """``_readings`` and its derivative by complex steps, column by column."""
    nudged = x.astype(np.complex128)
    jacobian = np.empty((7, x.size))
    for j in range(x.size):
        nudged[j] = complex(x[j], _STEP)
        jacobian[:, j] = _readings(nudged, speed_m_s).imag / _STEP
        nudged[j] = complex(x[j], 0.0)
    return _readings(x, speed_m_s), jacobian


@compiled()
def smoothed(
    state: Array,
    predicted: Array,
    covariance: Array,
    jacobian: Array,
    process: Array,
    active: NDArray[np.intp],
) -> Array:
    """States by the whole flight, shape (samples, states) (Rauch, Tung and Striebel 1965).

    Args:
        state: filtered, shape (samples, states).
        predicted: from the sample before, the same shape.
        covariance: of the filtered states, shape (samples, states, states).
        jacobian: of the step to each sample, the same shape.
        process: what that step added to the motion's covariance, shape (samples, MOTION, MOTION).
        active: states that are not known beforehand; the others stay as they are.
    """
    smooth = state.copy()
    n = active.size
    before, step, ahead = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    size, correction = np.empty(n), np.empty(n)
    for k in range(len(state) - 2, -1, -1):
        for i in range(n):
            for j in range(n):
                before[i, j] = covariance[k, active[i], active[j]]
                step[i, j] = jacobian[k + 1, active[i], active[j]]
                ahead[i, j] = 0.0
                if active[i] < MOTION and active[j] < MOTION:
                    ahead[i, j] = process[k + 1, active[i], active[j]]
        carried = step @ before
        ahead += carried @ step.T
        for i in range(n):
            size[i] = np.sqrt(ahead[i, i])
        for i in range(n):
            correction[i] = (smooth[k + 1, active[i]] - predicted[k + 1, active[i]]) / size[i]
            for j in range(n):
                ahead[i, j] /= size[i] * size[j]
        move = carried.T @ (np.linalg.solve(ahead, correction) / size)
        for i in range(n):
            smooth[k, active[i]] += move[i]
    return smooth
