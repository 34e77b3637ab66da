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
def _rate(x, inputs, gust_time_s, out):  # type: ignore[no-untyped-def]
    """dx/dt of a real or complex state (states,) into ``out``, for readings of gyros and accelerometers (6,)."""
    roll, pitch, u, v, w = x[0], x[1], x[3], x[4], x[5]
    p, q, r = inputs[0] - x[MOTION], inputs[1] - x[MOTION + 1], inputs[2] - x[MOTION + 2]
    ax, ay, az = inputs[3] - x[MOTION + 3], inputs[4] - x[MOTION + 4], inputs[5] - x[MOTION + 5]
    sin_roll, cos_roll, sin_pitch, cos_pitch = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    turn = q * sin_roll + r * cos_roll
    out[0] = p + turn * sin_pitch / cos_pitch
    out[1] = q * cos_roll - r * sin_roll
    out[2] = turn / cos_pitch
    out[3] = ax - q * w + r * v - GRAVITY_M_S2 * sin_pitch
    out[4] = ay - r * u + p * w + GRAVITY_M_S2 * cos_pitch * sin_roll
    out[5] = az + q * u - p * v + GRAVITY_M_S2 * cos_pitch * cos_roll
    out[6] = u * sin_pitch - cos_pitch * (v * sin_roll + w * cos_roll) + x[MOTION + 12]
    for j in range(3):
        out[7 + j] = -x[7 + j] / gust_time_s[j]
    for j in range(MOTION, x.size):
        out[j] = 0.0


@helper
def _step(x, inputs, dt, gust_time_s, rate, out):  # type: ignore[no-untyped-def]
    """The state after ``dt`` by the midpoint rule into ``out``; ``rate`` is work space."""
    _rate(x, inputs, gust_time_s, rate)
    for j in range(x.size):
        out[j] = x[j] + 0.5 * dt * rate[j]
    _rate(out, inputs, gust_time_s, rate)
    for j in range(x.size):
        out[j] = x[j] + dt * rate[j]


@helper
def _readings(x, speed_m_s, out):  # type: ignore[no-untyped-def]
    """What ``READINGS`` say of a real or complex state into ``out`` (7,)."""
    u, v, w = x[3], x[4], x[5]
    ahead = np.sqrt(u * u + w * w)
    speed = np.sqrt(u * u + v * v + w * w)
    out[0], out[1], out[2], out[6] = x[0], x[1], x[2], x[6]
    out[3] = (1.0 + x[MOTION + 6]) * speed + x[MOTION + 7] + x[7]
    out[4] = (1.0 + x[MOTION + 8]) * np.arctan(w / u) + x[MOTION + 9] + x[9] / speed_m_s
    out[5] = (1.0 + x[MOTION + 10]) * np.arctan(v / ahead) + x[MOTION + 11] + x[8] / speed_m_s


@compiled()
def _step_jacobian(x, inputs, dt, gust_time_s):  # type: ignore[no-untyped-def]
    """``_step`` and its derivative by complex steps, column by column."""
    n = x.size
    nudged, moved, rate = np.zeros(n, np.complex128), np.zeros(n, np.complex128), np.zeros(n, np.complex128)
    jacobian, after, work = np.empty((n, n)), np.empty(n), np.empty(n)
    for j in range(n):
        nudged[j] = complex(x[j], 0.0)
    for j in range(n):
        nudged[j] = complex(x[j], _STEP)
        _step(nudged, inputs, dt, gust_time_s, rate, moved)
        for i in range(n):
            jacobian[i, j] = moved[i].imag / _STEP
        nudged[j] = complex(x[j], 0.0)
    _step(x, inputs, dt, gust_time_s, work, after)
    return after, jacobian


@compiled()
def _readings_jacobian(x, speed_m_s):  # type: ignore[no-untyped-def]
    """``_readings`` and its derivative by complex steps, column by column."""
    n = x.size
    nudged, said = np.zeros(n, np.complex128), np.zeros(7, np.complex128)
    jacobian, here = np.empty((7, n)), np.empty(7)
    for j in range(n):
        nudged[j] = complex(x[j], 0.0)
    for j in range(n):
        nudged[j] = complex(x[j], _STEP)
        _readings(nudged, speed_m_s, said)
        for i in range(7):
            jacobian[i, j] = said[i].imag / _STEP
        nudged[j] = complex(x[j], 0.0)
    _readings(x, speed_m_s, here)
    return here, jacobian


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
        _solve(ahead, correction)
        for i in range(n):
            for j in range(n):
                smooth[k, active[i]] += carried[j, i] * correction[j] / size[j]
    return smooth


@helper
def _solve(matrix, right):  # type: ignore[no-untyped-def]
    """Solution of matrix (n, n) times it = right (n,) into ``right``; the matrix is used up.

    Elimination with partial pivoting (Golub and Van Loan 2013, algorithm 3.4.1). numpy's own takes numba four seconds
    to compile.
    """
    n = right.size
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if matrix[pivot, k] == 0.0:
            raise np.linalg.LinAlgError("a covariance of the flight path is singular")
        for j in range(n):
            matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
        right[k], right[pivot] = right[pivot], right[k]
        for i in range(k + 1, n):
            part = matrix[i, k] / matrix[k, k]
            for j in range(k, n):
                matrix[i, j] -= part * matrix[k, j]
            right[i] -= part * right[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]
