"""What an aircraft file's [propulsion] gives in steady running: thrust, and how it changes with throttle and airspeed.

This is the meaning of that table. The simulation's compiled thrust is held to it by tests.
"""

import math
from typing import NamedTuple

import numpy as np

from wingwatch.aircraft.aircraft_file import ConstantThrust, ElectricPropulsion
from wingwatch.aircraft.bracketed_root import bracketed_root

__all__ = ["ThrustSlopes", "propulsion_thrust_n", "thrust_slopes"]

Number = float | complex
_STEP = 1e-20
"""Imaginary step of a complex-step derivative."""


class ThrustSlopes(NamedTuple):
    """How thrust changes about a steady point.

    Attributes:
        throttle: 0 to 1, at which the thrust is what was asked for.
        by_airspeed: dT/dV in N s/m.
        by_throttle: dT/d(throttle) in N.
    """

    throttle: float
    by_airspeed: float
    by_throttle: float


def propulsion_thrust_n(
    propulsion: ElectricPropulsion | ConstantThrust,
    throttle: Number,
    airspeed_m_s: Number,
    air_density_kg_m3: float,
) -> Number:
    """Thrust in N; complex arguments serve complex-step derivatives.

    Electric propeller: the speed Omega at which motor torque K_Q ((V_in - K_V Omega) / R - i0) and propeller torque
    balance, a quadratic (Beard and McLain, Small Unmanned Aircraft, section 4.3); a motor that would be driven
    backwards stands still. Else throttle times a constant.
    """
    if isinstance(propulsion, ConstantThrust):
        return throttle * propulsion.thrust_max_n
    d, density, v = propulsion.propeller_diameter_m, air_density_kg_m3, airspeed_m_s
    per_volt = propulsion.torque_constant_n_m_a / propulsion.resistance_ohm
    q0, q1, q2 = propulsion.torque_coefficients
    square = density * d**5 * q0 / (2.0 * math.pi) ** 2
    linear = density * d**4 * q1 * v / (2.0 * math.pi) + per_volt * propulsion.motor_constant_v_s_rad
    rest = density * d**3 * q2 * v * v - per_volt * propulsion.voltage_max_v * throttle
    rest += propulsion.torque_constant_n_m_a * propulsion.no_load_current_a
    inside = linear * linear - 4.0 * square * rest
    omega = (np.sqrt(inside) - linear) / (2.0 * square) if inside.real > 0.0 else 0.0
    turns = omega / (2.0 * math.pi) if omega.real > 0.0 else 0.0
    t0, t1, t2 = propulsion.thrust_coefficients
    return density * d * d * (d * d * t0 * turns * turns + d * t1 * v * turns + t2 * v * v)


def thrust_slopes(
    propulsion: ElectricPropulsion | ConstantThrust,
    thrust_n: float,
    airspeed_m_s: float,
    air_density_kg_m3: float,
) -> ThrustSlopes | None:
    """Throttle for a thrust, and the slopes there; None where no throttle of 0 to 1 gives that thrust."""

    def surplus(throttle: float) -> float:
        return (
            float(propulsion_thrust_n(propulsion, throttle, airspeed_m_s, air_density_kg_m3).real) - thrust_n
        )

    if surplus(0.0) > 0.0 or surplus(1.0) < 0.0:
        return None
    throttle = bracketed_root(surplus, 0.0, 1.0)
    by_speed = propulsion_thrust_n(propulsion, throttle, complex(airspeed_m_s, _STEP), air_density_kg_m3)
    by_throttle = propulsion_thrust_n(propulsion, complex(throttle, _STEP), airspeed_m_s, air_density_kg_m3)
    return ThrustSlopes(throttle, by_speed.imag / _STEP, by_throttle.imag / _STEP)
