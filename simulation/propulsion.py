"""Thrust of a propeller on an electric motor, or in proportion to the throttle, compiled."""

import math

from wingwatch.kernels.decorators import compiled
from wingwatch.simulation.layout import ELECTRIC, THRUST_MAX, THRUST_SHARE
from wingwatch.simulation.prepared import (
    KEEP_BITS,
    MOTOR_AIRSPEED_SQUARE,
    MOTOR_CONSTANT_TERM,
    MOTOR_LINEAR,
    MOTOR_LINEAR_AIRSPEED,
    MOTOR_SQUARE,
    MOTOR_THROTTLE,
    THRUST_AIRSPEED_SQUARE,
    THRUST_MIXED,
    THRUST_SQUARE,
    WIDTH,
    working_row,
)

__all__ = ["thrust", "thrust_n"]


@compiled(error_model="numpy", fastmath=KEEP_BITS, inline="always")
def thrust(c, throttle, airspeed, density):  # type: ignore[no-untyped-def]
    """Thrust in N at a throttle of 0 to 1; ``c`` is a working row.

    Electric propeller: steady balance of motor torque K_Q ((V_in - K_V Omega)/R - i0) and propeller torque
    rho D^5 n^2 C_Q(J), n = Omega/(2 pi), J = V/(n D), a quadratic in Omega (Beard and McLain, Small Unmanned
    Aircraft, section 4.3); a motor that would be driven backwards stands still. Otherwise throttle times a constant.
    A share of the thrust that is lost is one of what pulls; the drag of a propeller that brakes stays.
    """
    if c[ELECTRIC] == 0.0:
        return throttle * c[THRUST_MAX] * c[THRUST_SHARE]
    flow = density * airspeed
    square = density * c[MOTOR_SQUARE]
    linear = flow * c[MOTOR_LINEAR_AIRSPEED] + c[MOTOR_LINEAR]
    rest = flow * airspeed * c[MOTOR_AIRSPEED_SQUARE] - throttle * c[MOTOR_THROTTLE] + c[MOTOR_CONSTANT_TERM]
    root = math.sqrt(max(0.0, linear * linear - 4.0 * square * rest))
    omega = max(0.0, (root - linear) / (2.0 * square))
    push = density * omega * omega * c[THRUST_SQUARE] + flow * (
        omega * c[THRUST_MIXED] + airspeed * c[THRUST_AIRSPEED_SQUARE]
    )
    return c[THRUST_SHARE] * push if push > 0.0 else push


def thrust_n(row, throttle: float, airspeed_m_s: float, density_kg_m3: float) -> float:  # type: ignore[no-untyped-def]
    """``thrust`` of a parameter row (``layout.PARAMETERS``) or a working row."""
    c = row if len(row) == WIDTH else working_row(row)
    return float(thrust(c, throttle, airspeed_m_s, density_kg_m3))
