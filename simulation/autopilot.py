"""A simple autopilot: airspeed, altitude and heading hold by successive loops, its gains derived from the trim.

Loop bandwidths are fixed and lie well below the modes that are to be identified (short period 8 to 14 rad/s, Dutch roll
3 to 6 rad/s on the Aerosonde), so an excitation of 2.3/omega_n is over before the autopilot has answered it: it
is soft by design, always, and need not be told of excitations. It reads the true state: navigation is taken as perfect.

- pitch attitude -> elevator: K = q/eta of the steady short period, gain PITCH / |K|, so that theta' = K eta closes at
  PITCH rad/s; an integral of the same over INTEGRAL_RATIO takes out a changed trim;
- altitude -> pitch attitude: h' = V (theta - alpha), gain ALTITUDE / V, with an integral;
- airspeed -> throttle: m V' = dT/dthrottle, gain AIRSPEED m / (dT/dthrottle), with an integral;
- bank -> aileron: p = (-l_xi/l_p) xi, gain BANK over that;
- heading -> bank: psi' = g phi / V, gain HEADING V / g.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.aircraft import (
    GRAVITY_M_S2,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    FlightCondition,
    linearised_derivatives,
)
from wingwatch.simulation.dynamics import euler_angles, thrust_n
from wingwatch.simulation.layout import MASS, vehicle_row
from wingwatch.simulation.trim import TrimPoint

__all__ = ["AUTOPILOT", "INTEGRATORS", "autopilot", "autopilot_row"]

PITCH_RAD_S = 1.5
ALTITUDE_RAD_S = 0.35
AIRSPEED_RAD_S = 0.4
BANK_RAD_S = 1.5
HEADING_RAD_S = 0.3
INTEGRAL_RATIO = 5.0
"""Each integral acts this many times slower than its loop."""
CLIMB_LIMIT_RAD = 0.25
BANK_LIMIT_RAD = 0.5
THROTTLE_STEP = 0.01

AUTOPILOT: tuple[str, ...] = (
    "pitch_gain", "altitude_gain", "airspeed_gain", "bank_gain", "heading_gain",
    "pitch_trim", "elevator_trim", "aileron_trim", "rudder_trim", "throttle_trim",
    "airspeed_demand", "altitude_demand", "heading_demand",
)  # fmt: skip
(
    PITCH_GAIN, ALTITUDE_GAIN, AIRSPEED_GAIN, BANK_GAIN, HEADING_GAIN,
    PITCH_TRIM, ELEVATOR_TRIM, AILERON_TRIM, RUDDER_TRIM, THROTTLE_TRIM,
    AIRSPEED_DEMAND, ALTITUDE_DEMAND, HEADING_DEMAND,
) = range(len(AUTOPILOT))  # fmt: skip

INTEGRATORS = 3
"""Integrals kept: of elevator (rad), of pitch demand (rad), of throttle."""


def autopilot_row(aircraft: Aircraft, condition: FlightCondition, point: TrimPoint) -> NDArray[np.float64]:
    """Gains and demands that hold a trim point, shape (len(AUTOPILOT),).

    Raises:
        AircraftDataError, TrimError: as ``linearised_derivatives``.
        ValueError: surfaces without power, on which no loop can be closed.
    """
    longitudinal = linearised_derivatives(aircraft, condition, SHORT_PERIOD)
    lateral = linearised_derivatives(aircraft, condition, LATERAL)
    d = longitudinal
    steady_pitch_rate = -(d["m_eta"] * d["z_w"] - d["m_w"] * d["z_eta"]) / (
        d["z_w"] * d["m_q"] - d["m_w"] * d["z_q"]
    )
    steady_roll_rate = -lateral["l_xi"] / lateral["l_p"]
    vehicle = vehicle_row(aircraft)
    speed, density = condition.airspeed_true_m_s, condition.air_density_kg_m3
    slope = (
        thrust_n(vehicle, point.throttle + THROTTLE_STEP, speed, density)
        - thrust_n(vehicle, point.throttle - THROTTLE_STEP, speed, density)
    ) / (2.0 * THROTTLE_STEP)
    if not (steady_pitch_rate < 0.0 and steady_roll_rate < 0.0 and slope > 0.0):
        raise ValueError(
            f"aircraft {aircraft.name} cannot be flown by the autopilot at {speed:g} m/s: per unit, elevator "
            f"gives pitch rate {steady_pitch_rate:.3g} 1/s, aileron roll rate {steady_roll_rate:.3g} 1/s (both must be "
            f"negative) and throttle {slope:.3g} N (must be positive); check its coefficients and propulsion"
        )
    return np.array([
        PITCH_RAD_S / -steady_pitch_rate, ALTITUDE_RAD_S / speed, AIRSPEED_RAD_S * vehicle[MASS] / slope,
        BANK_RAD_S / -steady_roll_rate, HEADING_RAD_S * speed / GRAVITY_M_S2,
        point.pitch_rad, point.elevator_rad, point.aileron_rad, point.rudder_rad, point.throttle,
        speed, condition.altitude_m, 0.0,
    ])  # fmt: skip


@njit(cache=True, error_model="numpy")
def _held(value, limit):  # type: ignore[no-untyped-def]
    return min(limit, max(-limit, value))


@njit(cache=True, error_model="numpy")
def autopilot(state, airspeed, gains, integrals, dt, out):  # type: ignore[no-untyped-def]
    """Commands for the next ``dt`` seconds; the integrals advance.

    Args:
        state: rigid-body state (13,).
        airspeed: true airspeed, m/s.
        gains: row of ``AUTOPILOT``.
        integrals: (INTEGRATORS,), advanced; each stops at the limit of what it may command.
        dt: s.
        out: elevator, aileron, rudder in rad, throttle, then the demands of bank and pitch in rad, (6,).
    """
    roll, pitch, heading = euler_angles(state)
    speed_error = gains[AIRSPEED_DEMAND] - airspeed
    height_error = gains[ALTITUDE_DEMAND] + state[2]
    climb = gains[ALTITUDE_GAIN] * height_error
    pitch_demand = gains[PITCH_TRIM] + _held(climb + integrals[1], CLIMB_LIMIT_RAD)
    pitch_error = pitch - pitch_demand
    elevator = gains[PITCH_GAIN] * pitch_error
    turn = gains[HEADING_DEMAND] - heading
    turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
    bank_demand = _held(gains[HEADING_GAIN] * turn, BANK_LIMIT_RAD)
    throttle = gains[AIRSPEED_GAIN] * speed_error
    out[0] = gains[ELEVATOR_TRIM] + elevator + integrals[0]
    out[1] = gains[AILERON_TRIM] + gains[BANK_GAIN] * (roll - bank_demand)
    out[2] = gains[RUDDER_TRIM]
    out[3] = min(1.0, max(0.0, gains[THROTTLE_TRIM] + throttle + integrals[2]))
    out[4], out[5] = bank_demand, pitch_demand
    integrals[0] = _held(integrals[0] + dt * PITCH_RAD_S / INTEGRAL_RATIO * elevator, CLIMB_LIMIT_RAD)
    integrals[1] = _held(
        integrals[1] + dt * ALTITUDE_RAD_S / INTEGRAL_RATIO * _held(climb, CLIMB_LIMIT_RAD), CLIMB_LIMIT_RAD
    )
    integrals[2] = _held(integrals[2] + dt * AIRSPEED_RAD_S / INTEGRAL_RATIO * throttle, 1.0)
