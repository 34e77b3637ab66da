"""The equations of motion of one rigid aircraft over a flat earth, and their integration, compiled.

Newton and Euler in body axes about the centre of gravity, with the full inertia tensor; attitude by quaternion; gravity
constant. Aerodynamic forces and thrust act at the reference point that the aircraft file's coefficients mean:
its motion through the air gives the forces, and their moments are carried over to the centre of gravity. Thrust
has no torque.
"""

import math

from wingwatch.kernels.decorators import compiled, helper
from wingwatch.simulation.aerodynamics import Deflections, Motion, load
from wingwatch.simulation.layout import (
    CG_X,
    CG_Y,
    CG_Z,
    INERTIA_X,
    INERTIA_XY,
    INERTIA_XZ,
    INERTIA_Y,
    INERTIA_YZ,
    INERTIA_Z,
    THRUST_LINE_Z,
)
from wingwatch.simulation.prepared import (
    GRAVITY,
    INVERSE_XX,
    INVERSE_XY,
    INVERSE_XZ,
    INVERSE_YY,
    INVERSE_YZ,
    INVERSE_ZZ,
    KEEP_BITS,
    MASS_INVERSE,
    OFF_CENTRE,
    SLIPSTREAM_PER_NEWTON,
    UNSTEADY,
)
from wingwatch.simulation.propulsion import thrust

__all__ = ["SETTING", "SETTING_WIDTH", "advance", "airspeed", "rates", "rotation"]

SETTING: tuple[str, ...] = (
    "throttle",
    "elevator", "aileron", "rudder",
    "elevator_middle", "aileron_middle", "rudder_middle",
    "elevator_end", "aileron_end", "rudder_end",
    "wind_north", "wind_east", "wind_down", "shear_north", "shear_east", "shear_down", "shear_altitude",
    "gust_u", "gust_v", "gust_w", "gust_p", "gust_q", "gust_r",
    "rise_u", "rise_v", "rise_w", "rise_p", "rise_q", "rise_r",
    "curve_u", "curve_v", "curve_w", "curve_p", "curve_q", "curve_r",
    "density_altitude", "density", "density_slope", "density_curve",
    "air_u", "air_v", "air_w", "air_p", "air_q", "air_r", "force_x", "force_y", "force_z",
    "spin_p", "spin_q", "spin_r",
)  # fmt: skip
"""What a step needs beside the state and the working row: throttle; surfaces at its start, middle and end; wind over
the ground at an altitude and its change per metre of altitude; the air's own motion at the start, body axes, what it
gains in the step, and how far its middle lies from the straight line (a parabola); density about an altitude
(``atmosphere.expand_density``). Behind them what ``rates`` leaves: motion of the reference point through the air,
specific force at the centre of gravity in m/s2 and angular acceleration, all of the step's start."""

(
    THROTTLE,
    ELEVATOR, _AILERON, _RUDDER,
    _ELEVATOR_MIDDLE, _AILERON_MIDDLE, _RUDDER_MIDDLE,
    _ELEVATOR_END, _AILERON_END, _RUDDER_END,
    WIND, WIND_EAST, WIND_DOWN, SHEAR, SHEAR_EAST, SHEAR_DOWN, SHEAR_ALTITUDE,
    GUST, GUST_V, GUST_W, GUST_P, GUST_Q, GUST_R,
    RISE, RISE_V, RISE_W, RISE_P, RISE_Q, RISE_R,
    CURVE, CURVE_V, CURVE_W, CURVE_P, CURVE_Q, CURVE_R,
    DENSITY_ALTITUDE, DENSITY, DENSITY_SLOPE, DENSITY_CURVE,
    AIR, AIR_V, AIR_W, AIR_P, AIR_Q, AIR_R, FORCE, FORCE_Y, FORCE_Z,
    SPIN, SPIN_Q, SPIN_R,
) = range(len(SETTING))  # fmt: skip

SETTING_WIDTH = len(SETTING)

_LEAST_PLANE = 1e-6


@compiled(error_model="numpy", fastmath=KEEP_BITS, inline="always")
def rotation(q0, q1, q2, q3):  # type: ignore[no-untyped-def]
    """Body to earth, row by row."""
    return (
        1.0 - 2.0 * (q2 * q2 + q3 * q3), 2.0 * (q1 * q2 - q0 * q3), 2.0 * (q1 * q3 + q0 * q2),
        2.0 * (q1 * q2 + q0 * q3), 1.0 - 2.0 * (q1 * q1 + q3 * q3), 2.0 * (q2 * q3 - q0 * q1),
        2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2),
    )  # fmt: skip


@compiled(error_model="numpy", fastmath=KEEP_BITS, inline="always")
def _through_the_wind(s, x, axes):  # type: ignore[no-untyped-def]
    """Velocity of the centre of gravity beside the wind, gusts apart, body axes; ``axes`` of ``rotation``."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = axes
    higher = -x[2] - s[SHEAR_ALTITUDE]
    n, e = s[WIND] + higher * s[SHEAR], s[WIND_EAST] + higher * s[SHEAR_EAST]
    d = s[WIND_DOWN] + higher * s[SHEAR_DOWN]
    return (
        x[3] - (r00 * n + r10 * e + r20 * d),
        x[4] - (r01 * n + r11 * e + r21 * d),
        x[5] - (r02 * n + r12 * e + r22 * d),
    )


@compiled(error_model="numpy", fastmath=KEEP_BITS, inline="always")
def _density(s, above):  # type: ignore[no-untyped-def]
    """Air density so far ``above`` the altitude of its expansion, kg/m3."""
    return s[DENSITY] + above * (s[DENSITY_SLOPE] + above * s[DENSITY_CURVE])


@compiled(error_model="numpy", fastmath=KEEP_BITS, inline="always")
def rates(c, s, x, stage, share, k):  # type: ignore[no-untyped-def]
    """d(state)/dt into ``k`` (13,); at stage 0 ``s`` is left with motion through the air, specific force and spin-up.

    Args:
        c: working row.
        s: row of ``SETTING``.
        x: rigid-body state (13,).
        stage: 0, 1, 2: the surfaces of the step's start, middle or end.
        share: of the step, 0 to 1: how far along the gust's course it is.
        k: the result.

    The lift and moment due to alphadot make the equations implicit; both are linear in it, so it is solved for. It is
    that of the motion through the air: the downwash that reaches the tail late is that of the wing's incidence,
    whatever made it. The gust's own part, -w_g'/V, is the air's turning q_g, which the span smooths; the rate of the
    gust at a point has no limit. What shear adds to it is left out.
    """
    u, v, w, p, q, r = x[3], x[4], x[5], x[10], x[11], x[12]
    q0, q1, q2, q3 = x[6], x[7], x[8], x[9]
    axes = rotation(q0, q1, q2, q3)
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = axes
    uw, vw, ww = _through_the_wind(s, x, axes)
    arc = 4.0 * share * (1.0 - share)
    ua = uw - (s[GUST] + share * s[RISE] + arc * s[CURVE])
    va = vw - (s[GUST_V] + share * s[RISE_V] + arc * s[CURVE_V])
    wa = ww - (s[GUST_W] + share * s[RISE_W] + arc * s[CURVE_W])
    pa = p - (s[GUST_P] + share * s[RISE_P] + arc * s[CURVE_P])
    qa = q - (s[GUST_Q] + share * s[RISE_Q] + arc * s[CURVE_Q])
    ra = r - (s[GUST_R] + share * s[RISE_R] + arc * s[CURVE_R])
    cg_x, cg_y, cg_z, turning = c[CG_X], c[CG_Y], c[CG_Z], q - qa
    if c[OFF_CENTRE] != 0.0:
        ua, va, wa = ua - (qa * cg_z - ra * cg_y), va - (ra * cg_x - pa * cg_z), wa - (pa * cg_y - qa * cg_x)
    density = _density(s, -x[2] - s[DENSITY_ALTITUDE])
    forward = ua * ua + wa * wa
    push = thrust(c, s[THROTTLE], math.sqrt(forward + va * va), density)
    surface = ELEVATOR + 3 * stage
    fx, fy, fz, roll, pitch, yaw, z_rate, m_rate = load(
        c,
        Motion(ua, va, wa, pa, qa, ra),
        Deflections(s[surface], s[surface + 1], s[surface + 2]),
        density,
        max(0.0, push) * c[SLIPSTREAM_PER_NEWTON],
    )
    fx += push
    pitch += push * c[THRUST_LINE_Z]
    g, per_mass = c[GRAVITY], c[MASS_INVERSE]
    gx, gy, gz = r20 * g, r21 * g, r22 * g
    if c[UNSTEADY] != 0.0:
        forward = max(forward, _LEAST_PLANE)
        per_plane = 1.0 / math.sqrt(forward)
        per_x, per_z = z_rate * wa * per_plane, -z_rate * ua * per_plane
        still = ua * (fz * per_mass + gz + q * uw - p * vw) + forward * turning
        still -= wa * (fx * per_mass + gx + r * vw - q * ww)
        alphadot = still / (forward - (ua * per_z - wa * per_x) * per_mass)
        fx, fz, pitch = fx + per_x * alphadot, fz + per_z * alphadot, pitch + m_rate * alphadot
    if c[OFF_CENTRE] != 0.0:
        roll, pitch, yaw = (
            roll - (cg_y * fz - cg_z * fy),
            pitch - (cg_z * fx - cg_x * fz),
            yaw - (cg_x * fy - cg_y * fx),
        )
    fx, fy, fz = fx * per_mass, fy * per_mass, fz * per_mass
    k[0], k[1], k[2] = r00 * u + r01 * v + r02 * w, r10 * u + r11 * v + r12 * w, r20 * u + r21 * v + r22 * w
    k[3], k[4], k[5] = fx + gx + r * v - q * w, fy + gy + p * w - r * u, fz + gz + q * u - p * v
    k[6], k[7] = -0.5 * (p * q1 + q * q2 + r * q3), 0.5 * (p * q0 + r * q2 - q * q3)
    k[8], k[9] = 0.5 * (q * q0 - r * q1 + p * q3), 0.5 * (r * q0 + q * q1 - p * q2)
    k[10], k[11], k[12] = _spin_up(c, p, q, r, roll, pitch, yaw)
    if stage == 0:
        s[AIR], s[AIR_V], s[AIR_W], s[AIR_P], s[AIR_Q], s[AIR_R] = ua, va, wa, pa, qa, ra
        s[FORCE], s[FORCE_Y], s[FORCE_Z] = fx, fy, fz
        s[SPIN], s[SPIN_Q], s[SPIN_R] = k[10], k[11], k[12]


@helper
def airspeed(c, s, x):  # type: ignore[no-untyped-def]
    """Airspeed of the reference point, m/s, at the start of a step: the size of what ``rates`` leaves in ``s``."""
    p, q, r = x[10] - s[GUST_P], x[11] - s[GUST_Q], x[12] - s[GUST_R]
    uw, vw, ww = _through_the_wind(s, x, rotation(x[6], x[7], x[8], x[9]))
    u = uw - s[GUST] - (q * c[CG_Z] - r * c[CG_Y])
    v = vw - s[GUST_V] - (r * c[CG_X] - p * c[CG_Z])
    w = ww - s[GUST_W] - (p * c[CG_Y] - q * c[CG_X])
    return math.sqrt(u * u + v * v + w * w)


@compiled(error_model="numpy", fastmath=KEEP_BITS, inline="always")
def _spin_up(c, p, q, r, roll, pitch, yaw):  # type: ignore[no-untyped-def]
    """Angular acceleration, I^-1 (M - omega x I omega)."""
    hx = c[INERTIA_X] * p - c[INERTIA_XY] * q - c[INERTIA_XZ] * r
    hy = c[INERTIA_Y] * q - c[INERTIA_XY] * p - c[INERTIA_YZ] * r
    hz = c[INERTIA_Z] * r - c[INERTIA_XZ] * p - c[INERTIA_YZ] * q
    a, b, d = roll - (q * hz - r * hy), pitch - (r * hx - p * hz), yaw - (p * hy - q * hx)
    return (
        c[INVERSE_XX] * a + c[INVERSE_XY] * b + c[INVERSE_XZ] * d,
        c[INVERSE_XY] * a + c[INVERSE_YY] * b + c[INVERSE_YZ] * d,
        c[INVERSE_XZ] * a + c[INVERSE_YZ] * b + c[INVERSE_ZZ] * d,
    )


@compiled(error_model="numpy", fastmath=KEEP_BITS)
def advance(c, s, x, dt, k, middle, total):  # type: ignore[no-untyped-def]
    """One classical fourth-order Runge-Kutta step of the state, in place; the quaternion is brought back to length one.

    Args:
        c: working row.
        s: row of ``SETTING``; what ``rates`` leaves there is left as at the step's start.
        x: rigid-body state (13,), advanced.
        dt: s.
        k, middle, total: work space (13,).
    """
    for i in range(13):
        middle[i], total[i] = x[i], 0.0
    for stage in range(4):
        rates(c, s, middle, (stage + 1) // 2, 0.5 * ((stage + 1) // 2), k)
        weight = 2.0 if stage == 1 or stage == 2 else 1.0
        reach = dt if stage == 2 else 0.5 * dt
        for i in range(13):
            total[i] += weight * k[i]
            middle[i] = x[i] + reach * k[i]
    for i in range(13):
        x[i] += dt / 6.0 * total[i]
    length = math.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9])
    for i in range(6, 10):
        x[i] /= length
