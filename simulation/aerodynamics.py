"""Aerodynamic forces and moments about the reference point, compiled.

What an aircraft file's coefficients mean is ``wingwatch.aircraft.aerodynamics``, to which tests hold this; on
top of them come the terms of an aircraft that is no longer symmetric or linear (``layout.PARAMETERS``),
non-linear ice (``icing_increments``) and the propeller's slipstream on the tail.

Slipstream: by momentum theory the fully contracted stream of a disk of area A has V_s^2 = V^2 + 2 T / (rho A),
so the part of the tail that lies in it feels a dynamic pressure greater by T / A; a share of the tail, by that
share. The elevator's and rudder's terms (of lift, drag, side force and all moments) go with that dynamic
pressure. The damping that the tail gives (CL_q, CL_alphadot, Cm_q, Cm_alphadot, CY_r, Cn_r) goes with the
stream's speed, the root of it: a rate q turns the flow by q l / V_s there, so the force goes with V_s^2 q l /
V_s. The tail's own share in CL_alpha, Cm_alpha, CY_beta and Cn_beta cannot be separated from the wing's and the
body's and stays; a thrust that is negative blows on nothing.
"""

import math
from typing import NamedTuple

from wingwatch.kernels.decorators import compiled
from wingwatch.simulation.icing_increments import icing_increments
from wingwatch.simulation.layout import (
    ALPHA_REFERENCE,
    CD_AILERON,
    CD_CL_AT_MIN,
    CD_ELEVATOR,
    CD_MIN,
    CD_RUDDER,
    CHORD,
    CL_ALPHA,
    CL_ALPHA_SQUARE,
    CL_ALPHADOT,
    CL_ELEVATOR,
    CL_Q,
    CL_ZERO,
    CM_ALPHA,
    CM_ALPHA_SQUARE,
    CM_ALPHADOT,
    CM_ELEVATOR,
    CM_Q,
    CM_ZERO,
    CN_AILERON,
    CN_ALPHA,
    CN_BETA,
    CN_P,
    CN_R,
    CN_RUDDER,
    CN_ZERO,
    CY_AILERON,
    CY_BETA,
    CY_P,
    CY_R,
    CY_RUDDER,
    CY_ZERO,
    ICE_LEFT_LESS_RIGHT,
    ICE_TAIL,
    ICE_WING,
    ROLL_AILERON,
    ROLL_ALPHA,
    ROLL_BETA,
    ROLL_P,
    ROLL_R,
    ROLL_RUDDER,
    ROLL_ZERO,
    SPAN,
    STALL_ANGLE,
    STALL_SHARPNESS,
    WIND_AXES,
)  # fmt: skip
from wingwatch.simulation.prepared import (
    DRAG_DUE_TO_LIFT,
    HALF_AREA,
    HALF_CHORD,
    HALF_SPAN,
    ICED,
    KEEP_BITS,
    STALL_CLEAR,
    STALL_FACTOR,
)  # fmt: skip

__all__ = ["Deflections", "Motion", "arc_tangent", "load"]

_STILL_M_S = 1e-6
"""Airspeed below which the air exerts nothing, so that no rate is divided by zero."""
_SMALL_TANGENT = 0.3


class Motion(NamedTuple):
    """Motion of the reference point through the air, body axes, m/s and rad/s."""

    u: float
    v: float
    w: float
    p: float
    q: float
    r: float


class Deflections(NamedTuple):
    """Deflections of elevator, aileron and rudder in rad."""

    eta: float
    xi: float
    zeta: float


@compiled(error_model="numpy", fastmath=KEEP_BITS, inline="always")
def arc_tangent(y, x):  # type: ignore[no-untyped-def]
    """atan2(y, x), faster within 0.29 rad of zero: there atan(t)/t by its interpolation in t^2 at Chebyshev's
    nine nodes of 0 to 0.09, relative error below 3e-16."""
    t = y / x
    if x > 0.0 and abs(t) <= _SMALL_TANGENT:
        z = t * t
        z2 = z * z
        z4 = z2 * z2
        low = (0.9999999999999999 - 0.3333333333331369 * z) + z2 * (
            0.19999999994165543 - 0.14285713616896606 * z
        )
        high = (0.11111072589787031 - 0.09089657206601419 * z) + z2 * (
            0.07668228774462543 - 0.06392746314207133 * z
        )
        return t * (low + z4 * (high + z4 * 0.04140630606870263))
    return math.atan2(y, x)


@compiled(error_model="numpy", fastmath=KEEP_BITS, inline="always")
def _stalled(c, line, alpha, sine, cosine):  # type: ignore[no-untyped-def]
    """The straight lift line blended with a flat plate, 2 sin|sin| cos (``aircraft.coefficients.StallBlend``).

    With e = e^(-M (|alpha| - alpha0)) the sigmoid of the near side is 1/(1 + e), that of the far side e/(e +
    e^(2 M alpha0)).
    """
    if abs(alpha) < c[STALL_CLEAR]:
        return line
    e = math.exp(-c[STALL_SHARPNESS] * (abs(alpha) - c[STALL_ANGLE]))
    near, far = 1.0 / (1.0 + e), e / (e + c[STALL_FACTOR])
    share = near + far - near * far
    return line + share * (2.0 * sine * abs(sine) * cosine - line)


@compiled(error_model="numpy", fastmath=KEEP_BITS, inline="always")
def load(c, motion, deflections, density, blown):  # type: ignore[no-untyped-def]
    """(X, Y, Z in N, L, M, N in N m, lift in N and pitching moment in N m per rad/s of alphadot), body axes.

    Args:
        c: working row.
        motion: ``Motion``.
        deflections: ``Deflections``.
        density: kg/m3.
        blown: what the slipstream adds to the dynamic pressure on the tail, Pa.
    """
    u, v, w, p, q, r = motion
    eta, xi, zeta = deflections
    forward = u * u + w * w
    airspeed = math.sqrt(forward + v * v)
    if airspeed < _STILL_M_S:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    plane = math.sqrt(forward)
    cos_alpha, sin_alpha = (u / plane, w / plane) if plane > 0.0 else (1.0, 0.0)
    alpha, beta = arc_tangent(w, u), arc_tangent(v, plane)
    per_speed = 1.0 / airspeed
    half_chord, half_span = c[HALF_CHORD] * per_speed, c[HALF_SPAN] * per_speed
    p, q, r = p * half_span, q * half_chord, r * half_span
    pressure = 0.5 * density * airspeed * airspeed
    tail, damping = 1.0, 1.0
    if blown != 0.0:
        tail = 1.0 + blown / pressure
        damping = math.sqrt(tail)
        eta, zeta, q = tail * eta, tail * zeta, damping * q
    line = c[CL_ZERO] + c[CL_ALPHA] * alpha
    excess = line - c[CD_CL_AT_MIN]
    drag = (
        c[CD_MIN] + excess * excess * c[DRAG_DUE_TO_LIFT]
        + c[CD_ELEVATOR] * abs(eta) + c[CD_AILERON] * abs(xi) + c[CD_RUDDER] * abs(zeta)
    )  # fmt: skip
    beyond = alpha - c[ALPHA_REFERENCE]
    square = beyond * beyond
    lift = (
        _stalled(c, line, alpha, sin_alpha, cos_alpha)
        + c[CL_Q] * q
        + c[CL_ELEVATOR] * eta
        + c[CL_ALPHA_SQUARE] * square
    )
    pitch = (
        c[CM_ZERO] + c[CM_ALPHA] * alpha + c[CM_ALPHA_SQUARE] * square + c[CM_Q] * q + c[CM_ELEVATOR] * eta
    )
    side, roll, yaw = _lateral(c, alpha, beta, p, r, damping * r, xi, zeta)
    if c[ICED] != 0.0:
        d_lift, d_drag, d_roll, d_pitch, d_yaw = icing_increments(
            alpha, eta / tail, c[ICE_WING], c[ICE_TAIL], c[ICE_LEFT_LESS_RIGHT]
        )
        lift, drag, roll, pitch, yaw = (
            lift + d_lift,
            drag + d_drag,
            roll + d_roll,
            pitch + d_pitch,
            yaw + d_yaw,
        )
    along, across = -drag, side
    if c[WIND_AXES] != 0.0:
        cos_beta, sin_beta = plane * per_speed, v * per_speed
        along = -drag * cos_beta - side * sin_beta
        across = -drag * sin_beta + side * cos_beta
    force = density * airspeed * airspeed * c[HALF_AREA]
    span_force, chord_force = force * c[SPAN], force * c[CHORD]
    unsteady = force * half_chord * damping
    return (
        force * (along * cos_alpha + lift * sin_alpha), force * across, force * (along * sin_alpha - lift * cos_alpha),
        span_force * roll, chord_force * pitch, span_force * yaw,
        unsteady * c[CL_ALPHADOT], unsteady * c[CHORD] * c[CM_ALPHADOT],
    )  # fmt: skip


@compiled(error_model="numpy", fastmath=KEEP_BITS, inline="always")
def _lateral(c, alpha, beta, p, r, tail_r, xi, zeta):  # type: ignore[no-untyped-def]
    """CY, Cl, Cn; ``tail_r`` is the yaw rate as a blown tail feels it."""
    side = (
        c[CY_ZERO]
        + c[CY_BETA] * beta
        + c[CY_P] * p
        + c[CY_R] * tail_r
        + c[CY_AILERON] * xi
        + c[CY_RUDDER] * zeta
    )
    roll = (
        c[ROLL_ZERO] + c[ROLL_ALPHA] * alpha + c[ROLL_BETA] * beta + c[ROLL_P] * p + c[ROLL_R] * r
        + c[ROLL_AILERON] * xi + c[ROLL_RUDDER] * zeta
    )  # fmt: skip
    yaw = (
        c[CN_ZERO] + c[CN_ALPHA] * alpha + c[CN_BETA] * beta + c[CN_P] * p + c[CN_R] * tail_r
        + c[CN_AILERON] * xi + c[CN_RUDDER] * zeta
    )  # fmt: skip
    return side, roll, yaw
