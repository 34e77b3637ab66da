"""The equations of motion of one rigid aircraft over a flat earth, compiled.

Newton and Euler in body axes with the full inertia tensor of a symmetric aircraft (I_xz), attitude by quaternion,
aerodynamics as the aircraft file defines them (``wingwatch.aircraft.aerodynamics``, to which tests hold this), thrust
along x body through the centre of gravity without torque, standard atmosphere, gravity constant.

Arrays are laid out as in ``wingwatch.simulation.layout``.
"""

import math

import numpy as np
from numba import njit

from wingwatch.aircraft import GRAVITY_M_S2
from wingwatch.simulation.layout import (
    AREA,
    CD_AILERON,
    CD_CL_AT_MIN,
    CD_ELEVATOR,
    CD_MIN,
    CD_OSWALD,
    CD_RUDDER,
    CHORD,
    CL_ALPHA,
    CL_ALPHADOT,
    CL_ELEVATOR,
    CL_Q,
    CL_ZERO,
    CM_ALPHA,
    CM_ALPHADOT,
    CM_ELEVATOR,
    CM_Q,
    CM_ZERO,
    CN_AILERON,
    CN_BETA,
    CN_P,
    CN_R,
    CN_RUDDER,
    CY_AILERON,
    CY_BETA,
    CY_P,
    CY_R,
    CY_RUDDER,
    DIAMETER,
    ELECTRIC,
    INERTIA_X,
    INERTIA_XZ,
    INERTIA_Y,
    INERTIA_Z,
    MASS,
    MOTOR_CONSTANT,
    NO_LOAD_CURRENT,
    RESISTANCE,
    ROLL_AILERON,
    ROLL_BETA,
    ROLL_P,
    ROLL_R,
    ROLL_RUDDER,
    SPAN,
    STALL_ANGLE,
    STALL_SHARPNESS,
    THRUST_0,
    THRUST_1,
    THRUST_2,
    THRUST_MAX,
    TORQUE_0,
    TORQUE_1,
    TORQUE_2,
    TORQUE_CONSTANT,
    VOLTAGE_MAX,
    WIND_AXES,
)  # fmt: skip

__all__ = ["air_density", "derivatives", "euler_angles", "runge_kutta_step", "thrust_n"]

_G = GRAVITY_M_S2
_SEA_LEVEL_K, _LAPSE_K_M, _SEA_LEVEL_PA, _GAS = 288.15, 0.0065, 101325.0, 287.05287
_TROPOPAUSE_M = 11000.0
_TROPOPAUSE_K = _SEA_LEVEL_K - _LAPSE_K_M * _TROPOPAUSE_M
_EXPONENT = _G / (_GAS * _LAPSE_K_M)
_TROPOPAUSE_DENSITY = _SEA_LEVEL_PA * (_TROPOPAUSE_K / _SEA_LEVEL_K) ** _EXPONENT / (_GAS * _TROPOPAUSE_K)
_STILL_M_S = 1e-6
"""Airspeed below which the air exerts nothing, so that no rate is divided by zero."""


@njit(cache=True, error_model="numpy")
def air_density(altitude_m):  # type: ignore[no-untyped-def]
    """Density in kg/m3 of the standard atmosphere up to 20000 m (ISO 2533, as ``aircraft.isa_density_kg_m3``)."""
    if altitude_m <= _TROPOPAUSE_M:
        kelvin = _SEA_LEVEL_K - _LAPSE_K_M * altitude_m
        return _SEA_LEVEL_PA / (_GAS * kelvin) * math.exp(_EXPONENT * math.log(kelvin / _SEA_LEVEL_K))
    return _TROPOPAUSE_DENSITY * math.exp(-_G * (altitude_m - _TROPOPAUSE_M) / (_GAS * _TROPOPAUSE_K))


@njit(cache=True, error_model="numpy")
def thrust_n(vehicle, throttle, airspeed, density):  # type: ignore[no-untyped-def]
    """Thrust in N at a throttle of 0 to 1.

    Electric propeller: steady balance of motor torque K_Q ((V_in - K_V Omega)/R - i0) and propeller torque
    rho D^5 n^2 C_Q(J), n = Omega/(2 pi), J = V/(n D), a quadratic in Omega (Beard and McLain, Small Unmanned
    Aircraft, section 4.3); a motor that would be driven backwards stands still. Otherwise throttle times a constant.
    """
    if vehicle[ELECTRIC] == 0.0:
        return throttle * vehicle[THRUST_MAX]
    d = vehicle[DIAMETER]
    turn = 2.0 * math.pi
    d3 = density * d * d * d
    kq_r = vehicle[TORQUE_CONSTANT] / vehicle[RESISTANCE]
    a = d3 * d * d * vehicle[TORQUE_0] / (turn * turn)
    b = d3 * d * airspeed * vehicle[TORQUE_1] / turn + kq_r * vehicle[MOTOR_CONSTANT]
    c = (
        d3 * airspeed * airspeed * vehicle[TORQUE_2]
        - kq_r * vehicle[VOLTAGE_MAX] * throttle
        + vehicle[TORQUE_CONSTANT] * vehicle[NO_LOAD_CURRENT]
    )
    omega = max(0.0, (-b + math.sqrt(max(0.0, b * b - 4.0 * a * c))) / (2.0 * a))
    n = omega / turn
    return (
        d3 * d * n * n * vehicle[THRUST_0]
        + d3 * airspeed * n * vehicle[THRUST_1]
        + (d3 / d * airspeed * airspeed * vehicle[THRUST_2])
    )


@njit(cache=True, error_model="numpy")
def _logistic(x):  # type: ignore[no-untyped-def]
    """1 / (1 + e^-x) without overflow."""
    if x >= 0.0:
        return 1.0 / (1.0 + math.exp(-x))
    grown = math.exp(x)
    return grown / (1.0 + grown)


@njit(cache=True, error_model="numpy")
def _lift_and_drag(vehicle, coefficients, alpha, q_hat, surfaces):  # type: ignore[no-untyped-def]
    """CL without its alphadot term, and CD."""
    c = coefficients
    line = c[CL_ZERO] + c[CL_ALPHA] * alpha
    excess = line - c[CD_CL_AT_MIN]
    aspect = vehicle[SPAN] * vehicle[SPAN] / vehicle[AREA]
    drag = (
        c[CD_MIN]
        + excess * excess / (math.pi * c[CD_OSWALD] * aspect)
        + c[CD_ELEVATOR] * abs(surfaces[0])
        + c[CD_AILERON] * abs(surfaces[1])
        + c[CD_RUDDER] * abs(surfaces[2])
    )
    sharpness = vehicle[STALL_SHARPNESS]
    if sharpness > 0.0:
        up = _logistic(sharpness * (alpha - vehicle[STALL_ANGLE]))
        down = _logistic(-sharpness * (alpha + vehicle[STALL_ANGLE]))
        share = up + down - up * down
        sine = math.sin(alpha)
        line = (1.0 - share) * line + share * 2.0 * sine * abs(sine) * math.cos(alpha)
    return line + c[CL_Q] * q_hat + c[CL_ELEVATOR] * surfaces[0], drag


@njit(cache=True, error_model="numpy")
def _aerodynamics(vehicle, coefficients, air, density, surfaces, out):  # type: ignore[no-untyped-def]
    """Forces X, Y, Z in N and moments L, M, N in N m in body axes into ``out[:6]``; into ``out[6:8]`` the lift force
    and the pitching moment per rad/s of alphadot.

    ``air``: velocity and angular rates relative to the air (u, v, w, p, q, r), body axes.
    """
    c = coefficients
    u, v, w = air[0], air[1], air[2]
    airspeed = math.sqrt(u * u + v * v + w * w)
    if airspeed < _STILL_M_S:
        out[:8] = 0.0
        return
    plane = math.sqrt(u * u + w * w)
    cos_alpha, sin_alpha = (u / plane, w / plane) if plane > 0.0 else (1.0, 0.0)
    alpha, beta = math.atan2(w, u), math.asin(v / airspeed)
    half_chord = 0.5 * vehicle[CHORD] / airspeed
    half_span = 0.5 * vehicle[SPAN] / airspeed
    p, q, r = air[3] * half_span, air[4] * half_chord, air[5] * half_span
    lift, drag = _lift_and_drag(vehicle, c, alpha, q, surfaces)
    xi, zeta = surfaces[1], surfaces[2]
    side = c[CY_BETA] * beta + c[CY_P] * p + c[CY_R] * r + c[CY_AILERON] * xi + c[CY_RUDDER] * zeta
    roll = c[ROLL_BETA] * beta + c[ROLL_P] * p + c[ROLL_R] * r + c[ROLL_AILERON] * xi + c[ROLL_RUDDER] * zeta
    pitch = c[CM_ZERO] + c[CM_ALPHA] * alpha + c[CM_Q] * q + c[CM_ELEVATOR] * surfaces[0]
    yaw = c[CN_BETA] * beta + c[CN_P] * p + c[CN_R] * r + c[CN_AILERON] * xi + c[CN_RUDDER] * zeta
    along, across = -drag, side
    if vehicle[WIND_AXES] != 0.0:
        cos_beta, sin_beta = plane / airspeed, v / airspeed
        along = -drag * cos_beta - side * sin_beta
        across = -drag * sin_beta + side * cos_beta
    pressure_area = 0.5 * density * airspeed * airspeed * vehicle[AREA]
    out[0] = pressure_area * (along * cos_alpha + lift * sin_alpha)
    out[1] = pressure_area * across
    out[2] = pressure_area * (along * sin_alpha - lift * cos_alpha)
    out[3] = pressure_area * vehicle[SPAN] * roll
    out[4] = pressure_area * vehicle[CHORD] * pitch
    out[5] = pressure_area * vehicle[SPAN] * yaw
    out[6] = pressure_area * half_chord * c[CL_ALPHADOT]
    out[7] = pressure_area * half_chord * vehicle[CHORD] * c[CM_ALPHADOT]


@njit(cache=True, error_model="numpy")
def air_relative(state, wind, gust, air):  # type: ignore[no-untyped-def]
    """Velocity and angular rates relative to the air (body axes) into ``air``.

    ``wind``: steady, earth axes, m/s. ``gust``: u, v, w in m/s and p, q, r in rad/s of the air, body axes.
    """
    q0, q1, q2, q3 = state[6], state[7], state[8], state[9]
    n, e, d = wind[0], wind[1], wind[2]
    air[0] = (
        state[3]
        - gust[0]
        - (
            (1.0 - 2.0 * (q2 * q2 + q3 * q3)) * n
            + 2.0 * (q1 * q2 + q0 * q3) * e
            + 2.0 * (q1 * q3 - q0 * q2) * d
        )
    )
    air[1] = (
        state[4]
        - gust[1]
        - (
            2.0 * (q1 * q2 - q0 * q3) * n
            + (1.0 - 2.0 * (q1 * q1 + q3 * q3)) * e
            + 2.0 * (q2 * q3 + q0 * q1) * d
        )
    )
    air[2] = (
        state[5]
        - gust[2]
        - (
            2.0 * (q1 * q3 + q0 * q2) * n
            + 2.0 * (q2 * q3 - q0 * q1) * e
            + (1.0 - 2.0 * (q1 * q1 + q2 * q2)) * d
        )
    )
    air[3], air[4], air[5] = state[10] - gust[3], state[11] - gust[4], state[12] - gust[5]


@njit(cache=True, error_model="numpy")
def _kinematics(state, out):  # type: ignore[no-untyped-def]
    """Rates of position and quaternion."""
    u, v, w = state[3], state[4], state[5]
    q0, q1, q2, q3 = state[6], state[7], state[8], state[9]
    p, q, r = state[10], state[11], state[12]
    out[0] = (
        (1.0 - 2.0 * (q2 * q2 + q3 * q3)) * u + 2.0 * (q1 * q2 - q0 * q3) * v + 2.0 * (q1 * q3 + q0 * q2) * w
    )
    out[1] = (
        2.0 * (q1 * q2 + q0 * q3) * u + (1.0 - 2.0 * (q1 * q1 + q3 * q3)) * v + 2.0 * (q2 * q3 - q0 * q1) * w
    )
    out[2] = (
        2.0 * (q1 * q3 - q0 * q2) * u + 2.0 * (q2 * q3 + q0 * q1) * v + (1.0 - 2.0 * (q1 * q1 + q2 * q2)) * w
    )
    out[6] = 0.5 * (-p * q1 - q * q2 - r * q3)
    out[7] = 0.5 * (p * q0 + r * q2 - q * q3)
    out[8] = 0.5 * (q * q0 - r * q1 + p * q3)
    out[9] = 0.5 * (r * q0 + q * q1 - p * q2)


@njit(cache=True, error_model="numpy")
def derivatives(state, surfaces, throttle, wind, gust, vehicle, coefficients, air, load, out):  # type: ignore[no-untyped-def]
    """d(state)/dt into ``out`` (13,).

    Args:
        state: rigid-body state (13,).
        surfaces: elevator, aileron, rudder in rad.
        throttle: 0 to 1.
        wind: steady wind in earth axes, m/s.
        gust: motion of the air at the aircraft, body axes (6,).
        vehicle: row of ``layout.VEHICLE``.
        coefficients: row of ``layout.COEFFICIENTS`` as they are at this instant.
        air: left with the motion relative to the air (6,).
        load: work space (8,); ``load[:3]`` is left with the specific force at the centre of gravity, m/s2.
        out: the result.

    The lift and moment due to alphadot make the equations implicit; both are linear in it, so it is solved for
    (alphadot of the inertial velocity: the rate of the gust's own angle of attack is not counted).
    """
    mass = vehicle[MASS]
    air_relative(state, wind, gust, air)
    density = air_density(-state[2])
    _aerodynamics(vehicle, coefficients, air, density, surfaces, load)
    speed = math.sqrt(air[0] * air[0] + air[1] * air[1] + air[2] * air[2])
    u, v, w = state[3], state[4], state[5]
    p, q, r = state[10], state[11], state[12]
    q0, q1, q2, q3 = state[6], state[7], state[8], state[9]
    gx, gy = 2.0 * (q1 * q3 - q0 * q2) * _G, 2.0 * (q2 * q3 + q0 * q1) * _G
    gz = (1.0 - 2.0 * (q1 * q1 + q2 * q2)) * _G
    fx = (load[0] + thrust_n(vehicle, throttle, speed, density)) / mass
    fy = load[1] / mass
    fz = load[2] / mass
    pitch = load[4]
    if load[6] != 0.0 or load[7] != 0.0:
        plane = max(air[0] * air[0] + air[2] * air[2], _STILL_M_S)
        per_x = load[6] / mass * air[2] / math.sqrt(plane)
        per_z = -load[6] / mass * air[0] / math.sqrt(plane)
        still = air[0] * (fz + gz + q * u - p * v) - air[2] * (fx + gx + r * v - q * w)
        alphadot = still / (plane - air[0] * per_z + air[2] * per_x)
        fx += per_x * alphadot
        fz += per_z * alphadot
        pitch += load[7] * alphadot
    load[0], load[1], load[2] = fx, fy, fz
    _kinematics(state, out)
    out[3] = fx + gx + r * v - q * w
    out[4] = fy + gy + p * w - r * u
    out[5] = fz + gz + q * u - p * v
    ix, iy, iz, ixz = vehicle[INERTIA_X], vehicle[INERTIA_Y], vehicle[INERTIA_Z], vehicle[INERTIA_XZ]
    roll = load[3] + ixz * p * q - (iz - iy) * q * r
    yaw = load[5] - ixz * q * r - (iy - ix) * p * q
    determinant = ix * iz - ixz * ixz
    out[10] = (iz * roll + ixz * yaw) / determinant
    out[11] = (pitch - (ix - iz) * p * r - ixz * (p * p - r * r)) / iy
    out[12] = (ixz * roll + ix * yaw) / determinant


@njit(cache=True, error_model="numpy")
def runge_kutta_step(state, first, dt, surfaces, throttle, wind, gusts, vehicle, coefficients, work):  # type: ignore[no-untyped-def]
    """One classical fourth-order Runge-Kutta step, in place; the quaternion is brought back to length one.

    Args:
        state: rigid-body state (13,), advanced.
        first: its derivative at the start of the step.
        dt: step in s.
        surfaces: positions at start, middle and end, shape (3, 3).
        throttle: over the step.
        wind: steady wind.
        gusts: at start and end (2, 6), linear in between.
        vehicle: row of ``layout.VEHICLE``.
        coefficients: row of ``layout.COEFFICIENTS``.
        work: shape (5, 13).
    """
    middle, rate, total, air, load = work[0], work[1], work[2], work[3], work[4]
    gust = work[3, 6:12]
    n = state.size
    for i in range(n):
        total[i] = first[i]
        middle[i] = state[i] + 0.5 * dt * first[i]
    for i in range(6):
        gust[i] = 0.5 * (gusts[0, i] + gusts[1, i])
    derivatives(middle, surfaces[1], throttle, wind, gust, vehicle, coefficients, air, load, rate)
    for i in range(n):
        total[i] += 2.0 * rate[i]
        middle[i] = state[i] + 0.5 * dt * rate[i]
    derivatives(middle, surfaces[1], throttle, wind, gust, vehicle, coefficients, air, load, rate)
    for i in range(n):
        total[i] += 2.0 * rate[i]
        middle[i] = state[i] + dt * rate[i]
    derivatives(middle, surfaces[2], throttle, wind, gusts[1], vehicle, coefficients, air, load, rate)
    for i in range(n):
        state[i] += dt / 6.0 * (total[i] + rate[i])
    length = math.sqrt(state[6] ** 2 + state[7] ** 2 + state[8] ** 2 + state[9] ** 2)
    for i in range(6, 10):
        state[i] /= length


@njit(cache=True, error_model="numpy")
def euler_angles(state):  # type: ignore[no-untyped-def]
    """(roll, pitch, heading) in rad of a rigid-body state; heading between -pi and pi."""
    q0, q1, q2, q3 = state[6], state[7], state[8], state[9]
    roll = math.atan2(2.0 * (q2 * q3 + q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2))
    pitch = math.asin(min(1.0, max(-1.0, 2.0 * (q0 * q2 - q1 * q3))))
    heading = math.atan2(2.0 * (q1 * q2 + q0 * q3), 1.0 - 2.0 * (q2 * q2 + q3 * q3))
    return roll, pitch, heading


def quaternion(
    roll_rad: float, pitch_rad: float, heading_rad: float
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
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
