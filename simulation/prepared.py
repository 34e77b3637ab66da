"""What the equations of motion need of a parameter row that does not change from one instant to the next, compiled.

A working row is a parameter row (``layout.PARAMETERS``) with these columns behind it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import GRAVITY_M_S2
from wingwatch.kernels.decorators import helper, whole
from wingwatch.simulation.layout import (
    AREA,
    CD_OSWALD,
    CG_X,
    CG_Y,
    CG_Z,
    CHORD,
    CL_ALPHADOT,
    CM_ALPHADOT,
    DIAMETER,
    ICE_LEFT_LESS_RIGHT,
    ICE_TAIL,
    ICE_WING,
    INERTIA_X,
    INERTIA_XY,
    INERTIA_XZ,
    INERTIA_Y,
    INERTIA_YZ,
    INERTIA_Z,
    MASS,
    MOTOR_CONSTANT,
    NO_LOAD_CURRENT,
    PARAMETERS,
    RESISTANCE,
    SLIPSTREAM_SHARE,
    SPAN,
    STALL_ANGLE,
    STALL_SHARPNESS,
    THRUST_0,
    THRUST_1,
    THRUST_2,
    TORQUE_0,
    TORQUE_1,
    TORQUE_2,
    TORQUE_CONSTANT,
    VOLTAGE_MAX,
)  # fmt: skip

__all__ = ["KEEP_BITS", "PREPARED", "WIDTH", "prepare", "working_row"]

PREPARED: tuple[str, ...] = (
    "gravity", "mass_inverse",
    "inverse_xx", "inverse_yy", "inverse_zz", "inverse_xy", "inverse_xz", "inverse_yz",
    "half_area", "half_chord", "half_span", "drag_due_to_lift", "stall_factor", "stall_clear",
    "motor_square", "motor_linear", "motor_linear_airspeed", "motor_constant_term", "motor_airspeed_square",
    "motor_throttle", "thrust_square", "thrust_mixed", "thrust_airspeed_square",
    "slipstream_per_newton", "unsteady", "off_centre", "iced",
)  # fmt: skip
"""``stall_clear``: angle of attack below which the stall's share is less than rounding; ``unsteady``, ``off_centre``,
``iced``: whether there are terms in alphadot, a centre of gravity off the reference point, non-linear ice."""

(
    GRAVITY, MASS_INVERSE,
    INVERSE_XX, INVERSE_YY, INVERSE_ZZ, INVERSE_XY, INVERSE_XZ, INVERSE_YZ,
    HALF_AREA, HALF_CHORD, HALF_SPAN, DRAG_DUE_TO_LIFT, STALL_FACTOR, STALL_CLEAR,
    MOTOR_SQUARE, MOTOR_LINEAR, MOTOR_LINEAR_AIRSPEED, MOTOR_CONSTANT_TERM, MOTOR_AIRSPEED_SQUARE,
    MOTOR_THROTTLE, THRUST_SQUARE, THRUST_MIXED, THRUST_AIRSPEED_SQUARE,
    SLIPSTREAM_PER_NEWTON, UNSTEADY, OFF_CENTRE, ICED,
) = range(len(PARAMETERS), len(PARAMETERS) + len(PREPARED))  # fmt: skip

WIDTH = len(PARAMETERS) + len(PREPARED)
"""Columns of a working row."""

KEEP_BITS = {"contract", "arcp", "nsz"}
"""What the compiler may do with the floating point of the equations of motion: nothing that breaks on
infinities or NaN. A function that is compiled without a word on this takes the flags of whoever happens to call
it first; so those that the equations of motion call say these, and nothing else is called from a function that
has them."""

_ROUNDING = 37.0
"""e^-37 is 1e-16."""
_GREATEST_EXPONENT = 300.0


@whole
def prepare(c):  # type: ignore[no-untyped-def]
    """Fill the prepared columns of a working row from its parameters."""
    c[GRAVITY] = GRAVITY_M_S2
    c[MASS_INVERSE] = 1.0 / c[MASS]
    _invert_inertia(c)
    c[HALF_AREA], c[HALF_CHORD], c[HALF_SPAN] = 0.5 * c[AREA], 0.5 * c[CHORD], 0.5 * c[SPAN]
    c[DRAG_DUE_TO_LIFT] = c[AREA] / (math.pi * c[CD_OSWALD] * c[SPAN] * c[SPAN])
    sharpness, angle = c[STALL_SHARPNESS], c[STALL_ANGLE]
    c[STALL_CLEAR] = angle - _ROUNDING / sharpness if sharpness > 0.0 else math.inf
    c[STALL_FACTOR] = math.exp(min(_GREATEST_EXPONENT, 2.0 * sharpness * angle))
    d, turn = c[DIAMETER], 2.0 * math.pi
    torque_per_volt = c[TORQUE_CONSTANT] / c[RESISTANCE] if c[RESISTANCE] > 0.0 else 0.0
    c[MOTOR_SQUARE] = d**5 * c[TORQUE_0] / (turn * turn)
    c[MOTOR_LINEAR] = torque_per_volt * c[MOTOR_CONSTANT]
    c[MOTOR_LINEAR_AIRSPEED] = d**4 * c[TORQUE_1] / turn
    c[MOTOR_CONSTANT_TERM] = c[TORQUE_CONSTANT] * c[NO_LOAD_CURRENT]
    c[MOTOR_AIRSPEED_SQUARE] = d**3 * c[TORQUE_2]
    c[MOTOR_THROTTLE] = torque_per_volt * c[VOLTAGE_MAX]
    c[THRUST_SQUARE] = d**4 * c[THRUST_0] / (turn * turn)
    c[THRUST_MIXED] = d**3 * c[THRUST_1] / turn
    c[THRUST_AIRSPEED_SQUARE] = d * d * c[THRUST_2]
    disk = 0.25 * math.pi * d * d
    c[SLIPSTREAM_PER_NEWTON] = c[SLIPSTREAM_SHARE] / disk if disk > 0.0 else 0.0
    c[UNSTEADY] = 1.0 if c[CL_ALPHADOT] != 0.0 or c[CM_ALPHADOT] != 0.0 else 0.0
    c[OFF_CENTRE] = 1.0 if c[CG_X] != 0.0 or c[CG_Y] != 0.0 or c[CG_Z] != 0.0 else 0.0
    c[ICED] = 1.0 if c[ICE_WING] != 0.0 or c[ICE_TAIL] != 0.0 or c[ICE_LEFT_LESS_RIGHT] != 0.0 else 0.0


@helper
def _invert_inertia(c):  # type: ignore[no-untyped-def]
    """Inverse of [[Ix, -Ixy, -Ixz], [-Ixy, Iy, -Iyz], [-Ixz, -Iyz, Iz]], by cofactors."""
    ix, iy, iz = c[INERTIA_X], c[INERTIA_Y], c[INERTIA_Z]
    xy, xz, yz = c[INERTIA_XY], c[INERTIA_XZ], c[INERTIA_YZ]
    xx = iy * iz - yz * yz
    across = xy * iz + yz * xz
    along = xy * yz + iy * xz
    determinant = ix * xx - xy * across - xz * along
    c[INVERSE_XX] = xx / determinant
    c[INVERSE_YY] = (ix * iz - xz * xz) / determinant
    c[INVERSE_ZZ] = (ix * iy - xy * xy) / determinant
    c[INVERSE_XY] = across / determinant
    c[INVERSE_XZ] = along / determinant
    c[INVERSE_YZ] = (ix * yz + xy * xz) / determinant


def working_row(row: NDArray[np.float64]) -> NDArray[np.float64]:
    """A working row of its own from a parameter row, shape (WIDTH,)."""
    c = np.zeros(WIDTH)
    c[: len(PARAMETERS)] = row
    prepare(c)
    return c
