"""The equations of motion as one function of everything, attitudes, and flight with everything held, compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import helper, whole
from wingwatch.simulation.atmosphere import CELL_M, air_density, expand_density
from wingwatch.simulation.prepared import WIDTH, prepare
from wingwatch.simulation.propulsion import thrust_n
from wingwatch.simulation.rigid_body import (
    DENSITY,
    DENSITY_ALTITUDE,
    DENSITY_CURVE,
    DENSITY_SLOPE,
    ELEVATOR,
    FORCE,
    SETTING_WIDTH,
    THROTTLE,
    advance,
    rates,
)

__all__ = ["air_density", "derivatives", "euler_angles", "fly_held", "quaternion", "set_density", "thrust_n"]


@whole
def derivatives(state, surfaces, throttle, row, force, out):  # type: ignore[no-untyped-def]
    """d(state)/dt in still air into ``out`` (13,).

    Args:
        state: rigid-body state (13,).
        surfaces: elevator, aileron, rudder in rad.
        throttle: 0 to 1.
        row: of ``layout.PARAMETERS``, as they are at this instant.
        force: left with the specific force at the centre of gravity (3,), m/s2.
        out: the result.
    """
    c, s = np.zeros(WIDTH), np.zeros(SETTING_WIDTH)
    c[: row.size] = row
    prepare(c)
    s[THROTTLE] = throttle
    s[ELEVATOR : ELEVATOR + 3] = surfaces
    s[DENSITY_ALTITUDE], s[DENSITY] = -state[2], air_density(-state[2])
    rates(c, s, state, 0, 0.0, out)
    force[:] = s[FORCE : FORCE + 3]


@helper
def set_density(s, altitude_m):  # type: ignore[no-untyped-def]
    """The density's expansion about an altitude into a row of ``rigid_body.SETTING``, anew once its cell is left."""
    if not abs(altitude_m - s[DENSITY_ALTITUDE]) <= 0.5 * CELL_M:
        s[DENSITY_ALTITUDE], s[DENSITY], s[DENSITY_SLOPE], s[DENSITY_CURVE] = expand_density(altitude_m)


@whole
def fly_held(c, state, surfaces, throttle, dt_s, steps):  # type: ignore[no-untyped-def]
    """Advance a state (13,) in place by steps in still air, surfaces (3,) and throttle held; ``c`` is a working row."""
    s, k, middle, total = np.zeros(SETTING_WIDTH), np.empty(13), np.empty(13), np.empty(13)
    s[THROTTLE] = throttle
    for stage in range(3):
        s[ELEVATOR + 3 * stage : ELEVATOR + 3 * stage + 3] = surfaces
    s[DENSITY_ALTITUDE] = math.inf
    for _ in range(steps):
        set_density(s, -state[2])
        advance(c, s, state, dt_s, k, middle, total)


@helper
def euler_angles(state):  # type: ignore[no-untyped-def]
    """(roll, pitch, heading) in rad of a rigid-body state; heading between -pi and pi."""
    q0, q1, q2, q3 = state[6], state[7], state[8], state[9]
    roll = math.atan2(2.0 * (q2 * q3 + q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2))
    pitch = math.asin(min(1.0, max(-1.0, 2.0 * (q0 * q2 - q1 * q3))))
    heading = math.atan2(2.0 * (q1 * q2 + q0 * q3), 1.0 - 2.0 * (q2 * q2 + q3 * q3))
    return roll, pitch, heading


def quaternion(roll_rad: float, pitch_rad: float, heading_rad: float) -> NDArray[np.float64]:
    """Quaternion (scalar first) of Euler angles, body to earth."""
    cr, sr = math.cos(roll_rad / 2), math.sin(roll_rad / 2)
    cp, sp = math.cos(pitch_rad / 2), math.sin(pitch_rad / 2)
    ch, sh = math.cos(heading_rad / 2), math.sin(heading_rad / 2)
    return np.array([
        cr * cp * ch + sr * sp * sh,
        sr * cp * ch - cr * sp * sh,
        cr * sp * ch + sr * cp * sh,
        cr * cp * sh - sr * sp * ch,
    ])  # fmt: skip
