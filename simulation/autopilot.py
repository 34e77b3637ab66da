"""The autopilot: airspeed, altitude, and heading or a route, by successive loops whose gains come from the trim.

Loop bandwidths are fixed and lie well below the modes that are to be identified (short period 8 to 14 rad/s, Dutch roll
3 to 6 rad/s on the Aerosonde), so an excitation of 2.3/omega_n is over before the autopilot has answered it: it
is soft by design, always, and needs no notice of excitations. Navigation and attitude are taken as perfect; airspeed
is what its sensor reads.

- pitch attitude -> elevator: K = q/eta of the steady short period, gain PITCH / |K|, so that theta' = K eta closes at
  PITCH rad/s; an integral of the same over INTEGRAL_RATIO takes out a changed trim;
- altitude -> pitch attitude: h' = V (theta - alpha), gain ALTITUDE / V, with an integral;
- airspeed -> throttle: m V' = dT/dthrottle, gain AIRSPEED m / (dT/dthrottle), with an integral;
- bank -> aileron: p = (-l_xi/l_p) xi, gain BANK over that, with an integral (a wing that has lost its twin's shape);
- heading -> bank: psi' = g phi / V, gain HEADING V / g; on a route the L1 law (``simulation.route``) takes its place.

The rudder stays at its trim: a yaw damper would answer every sideslip and take from the rudder's own excitation, and
turns are coordinated by the fin alone.

Altitude and airspeed demands move to a new target at limited rates, so loops never see a step. What is known ahead is
fed forward: climb angle and the thrust for it and for gathering speed; angle of attack and elevator for a turn's load
factor and for an airspeed other than the trim's (lift goes with V^2, so both change as (V_trim/V)^2 does; rates per
deflection go with V, so the gains of attitude do as V_trim/V). All this is scheduled with the airspeed demanded, not
with the one read, which has the gusts in it and would put them on the surfaces.

Where thrust does not suffice, airspeed gives way first; below DROOP of the demand altitude does.
"""

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    GRAVITY_M_S2,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    FlightCondition,
    linearised_derivatives,
)
from wingwatch.kernels.decorators import helper
from wingwatch.simulation.dynamics import thrust_n
from wingwatch.simulation.layout import AILERON_LIMIT, ELEVATOR_LIMIT, MASS, parameter_row
from wingwatch.simulation.route import route_bank
from wingwatch.simulation.trim import TrimPoint

__all__ = ["AUTOPILOT", "BANK_LIMIT_RAD", "MEMORY", "ORDERS", "autopilot", "autopilot_row", "hands_off"]

PITCH_RAD_S = 1.5
ALTITUDE_RAD_S = 0.35
AIRSPEED_RAD_S = 0.4
BANK_RAD_S = 1.5
HEADING_RAD_S = 0.3
INTEGRAL_RATIO = 5.0
"""Each integral acts this many times slower than its loop."""
APPROACH_RAD_S = 0.2
"""How a demand nears its target once its rate is no longer limited."""
AIRSPEED_RATE_M_S2 = 0.4
CLIMB_RAD, STEEPEST_DESCENT_RAD = 0.1, 0.2
"""Steepest path demanded, either way; and down where thrust lacks."""
DROOP = 0.08
"""Share of the airspeed demand that is given up before altitude is."""
OVERRULE = 2.0
"""Path that thrust which lacks costs, over what it would cost at a steady airspeed: so that airspeed comes back."""
PITCH_LIMIT_RAD = 0.25
MOST_TRAVEL_RAD = 1.0
"""Commanded to a surface whose file states no limit; else that limit. Integrals stop there too."""
BANK_LIMIT_RAD = 0.5
BANK_ERROR_RAD = 0.05
"""Most of the bank's error that its integral takes in: rolling into a turn is no error to be learned."""
THROTTLE_STEP = 0.01
_LEAST_COSINE = math.cos(BANK_LIMIT_RAD)

AUTOPILOT: tuple[str, ...] = (
    "pitch_gain", "airspeed_gain", "bank_gain",
    "pitch_trim", "elevator_trim", "aileron_trim", "rudder_trim", "throttle_trim",
    "alpha_by_lift", "elevator_by_lift", "alpha_by_load", "elevator_by_load",
    "airspeed_trim", "altitude_trim", "heading", "elevator_travel", "aileron_travel",
)  # fmt: skip
"""``_by_lift``: rad per relative increase of the lift coefficient; ``_by_load``: of the load factor, in a turn."""
(
    PITCH_GAIN, AIRSPEED_GAIN, BANK_GAIN,
    PITCH_TRIM, ELEVATOR_TRIM, AILERON_TRIM, RUDDER_TRIM, THROTTLE_TRIM,
    ALPHA_BY_LIFT, ELEVATOR_BY_LIFT, ALPHA_BY_LOAD, ELEVATOR_BY_LOAD,
    AIRSPEED_TRIM, ALTITUDE_TRIM, HEADING, ELEVATOR_TRAVEL, AILERON_TRAVEL,
) = range(len(AUTOPILOT))  # fmt: skip

MEMORY = 7
"""What it remembers, all zero at first: integrals of elevator (rad), of pitch demand (rad), of throttle and of
aileron (rad); the leg of its route; altitude (m) and airspeed (m/s) demanded, from the trim's."""
(_ELEVATOR_SUM, _PITCH_SUM, _THROTTLE_SUM, _AILERON_SUM, _LEG, _ALTITUDE_REF, _AIRSPEED_REF) = range(MEMORY)

ORDERS = 8
"""What it gives: elevator, aileron, rudder (rad), throttle, demands of bank and pitch (rad), airspeed (m/s), altitude
(m)."""


def autopilot_row(aircraft: Aircraft, condition: FlightCondition, point: TrimPoint) -> NDArray[np.float64]:
    """Gains and demands that hold a trim point, shape (len(AUTOPILOT),).

    Raises:
        AircraftDataError, TrimError: as ``linearised_derivatives``.
        ValueError: surfaces without power, on which no loop can be closed.
    """
    d = linearised_derivatives(aircraft, condition, SHORT_PERIOD)
    lateral = linearised_derivatives(aircraft, condition, LATERAL)
    steady_pitch_rate = -(d["m_eta"] * d["z_w"] - d["m_w"] * d["z_eta"]) / (
        d["z_w"] * d["m_q"] - d["m_w"] * d["z_q"]
    )
    steady_roll_rate = -lateral["l_xi"] / lateral["l_p"]
    row = parameter_row(aircraft)
    speed, density = condition.airspeed_true_m_s, condition.air_density_kg_m3
    slope = (
        thrust_n(row, point.throttle + THROTTLE_STEP, speed, density)
        - thrust_n(row, point.throttle - THROTTLE_STEP, speed, density)
    ) / (2.0 * THROTTLE_STEP)
    if not (steady_pitch_rate < 0.0 and steady_roll_rate < 0.0 and slope > 0.0):
        raise ValueError(
            f"aircraft {aircraft.name} cannot be flown by the autopilot at {speed:g} m/s: per unit, elevator "
            f"gives pitch rate {steady_pitch_rate:.3g} 1/s, aileron roll rate {steady_roll_rate:.3g} 1/s (both must be "
            f"negative) and throttle {slope:.3g} N (must be positive); check its coefficients and propulsion"
        )
    # a turn of load n: q = g/V (n - 1/n), near n = 1 twice g/V (n - 1); z_q of the concise form holds V besides
    level, turning = _steady_lift(d, 0.0, speed), _steady_lift(d, 2.0 * GRAVITY_M_S2 / speed, speed)
    return np.array([
        PITCH_RAD_S / -steady_pitch_rate, AIRSPEED_RAD_S * row[MASS] / slope, BANK_RAD_S / -steady_roll_rate,
        point.pitch_rad, point.elevator_rad, point.aileron_rad, point.rudder_rad, point.throttle,
        *level, *turning, speed, condition.altitude_m, 0.0,
        min(row[ELEVATOR_LIMIT], MOST_TRAVEL_RAD), min(row[AILERON_LIMIT], MOST_TRAVEL_RAD),
    ])  # fmt: skip


def hands_off(row: NDArray[np.float64]) -> NDArray[np.float64]:
    """The row of an autopilot that answers nothing: surfaces and throttle stay at the trim."""
    row = row.copy()
    row[[PITCH_GAIN, AIRSPEED_GAIN, BANK_GAIN]] = 0.0
    row[[ALPHA_BY_LIFT, ELEVATOR_BY_LIFT, ALPHA_BY_LOAD, ELEVATOR_BY_LOAD]] = 0.0
    return row


def _steady_lift(d: dict[str, float], pitch_rate: float, speed: float) -> tuple[float, float]:
    """Angle of attack and elevator (rad) that add one weight of lift at a steady pitch rate (rad/s)."""
    a = np.array([[d["z_w"], d["z_eta"]], [d["m_w"], d["m_eta"]]])
    b = np.array([-GRAVITY_M_S2 - (d["z_q"] - speed) * pitch_rate, -d["m_q"] * pitch_rate])
    w, eta = np.linalg.solve(a, b)
    return float(w) / speed, float(eta)


@helper
def _held(value, limit):  # type: ignore[no-untyped-def]
    return min(limit, max(-limit, value))


@helper
def _attitude(state):  # type: ignore[no-untyped-def]
    """Roll and pitch in rad and the cosine of roll."""
    q0, q1, q2, q3 = state[6], state[7], state[8], state[9]
    across, up = 2.0 * (q2 * q3 + q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2)
    pitch = math.asin(_held(2.0 * (q0 * q2 - q1 * q3), 1.0))
    size = math.sqrt(across * across + up * up)
    return math.atan2(across, up), pitch, up / size if size > 0.0 else 1.0


@helper
def _lateral(state, row, route, memory, speed):  # type: ignore[no-untyped-def]
    """Bank demanded in rad; the leg of a route advances."""
    q0, q1, q2, q3 = state[6], state[7], state[8], state[9]
    north_x, east_x = 1.0 - 2.0 * (q2 * q2 + q3 * q3), 2.0 * (q1 * q2 + q0 * q3)
    if route[0, 0] == 0.0:
        turn = row[HEADING] - math.atan2(east_x, north_x)
        turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
        return _held(HEADING_RAD_S * speed / GRAVITY_M_S2 * turn, BANK_LIMIT_RAD)
    u, v, w = state[3], state[4], state[5]
    north = north_x * u + 2.0 * (q1 * q2 - q0 * q3) * v + 2.0 * (q1 * q3 + q0 * q2) * w
    east = east_x * u + (1.0 - 2.0 * (q1 * q1 + q3 * q3)) * v + 2.0 * (q2 * q3 - q0 * q1) * w
    bank, leg = route_bank(route, int(memory[_LEG]), state[0], state[1], north, east)
    memory[_LEG] = leg
    return _held(bank, BANK_LIMIT_RAD)


@helper
def _energy(row, route, memory, airspeed, speed, dt, out):  # type: ignore[no-untyped-def]
    """Throttle into ``out``; the climb angle demanded in rad; demands and the throttle's integral advance."""
    altitude_to, airspeed_to = row[ALTITUDE_TRIM], row[AIRSPEED_TRIM]
    if route[0, 0] > 0.0:
        leg = int(memory[_LEG])
        altitude_to, airspeed_to = route[1 + leg, 6], route[1 + leg, 7]
    altitude = row[ALTITUDE_TRIM] + memory[_ALTITUDE_REF]
    climb = _held(APPROACH_RAD_S * (altitude_to - altitude) / speed, CLIMB_RAD)
    gain_speed = _held(APPROACH_RAD_S * (airspeed_to - speed), AIRSPEED_RATE_M_S2)
    gain, error = row[AIRSPEED_GAIN], speed - airspeed
    by_thrust = gain / AIRSPEED_RAD_S
    held = row[THROTTLE_TRIM] + memory[_THROTTLE_SUM] + gain * error + by_thrust * gain_speed
    droop = gain * DROOP * speed
    wanted = held + by_thrust * GRAVITY_M_S2 * climb
    lacking, spare = wanted - droop - 1.0, -wanted - droop
    if lacking > 0.0:
        climb = max(-STEEPEST_DESCENT_RAD, climb - OVERRULE * lacking / (by_thrust * GRAVITY_M_S2))
    elif spare > 0.0 and climb < 0.0:
        climb = min(0.0, climb + spare / (by_thrust * GRAVITY_M_S2))
        wanted = held + by_thrust * GRAVITY_M_S2 * climb
    out[3] = min(1.0, max(0.0, wanted))
    total = row[THROTTLE_TRIM] + memory[_THROTTLE_SUM] + dt * AIRSPEED_RAD_S / INTEGRAL_RATIO * gain * error
    memory[_THROTTLE_SUM] = min(1.0, max(0.0, total)) - row[THROTTLE_TRIM]
    memory[_ALTITUDE_REF] += dt * speed * climb
    memory[_AIRSPEED_REF] += dt * gain_speed
    out[6], out[7] = speed, altitude
    return climb


@helper
def autopilot(state, airspeed_read, gains, route, memory, dt, out):  # type: ignore[no-untyped-def]
    """Commands for the next ``dt`` seconds; the memory advances.

    Args:
        state: rigid-body state (13,).
        airspeed_read: what the airspeed sensor reads, m/s.
        gains: row of ``AUTOPILOT``.
        route: of ``route_rows``.
        memory: (MEMORY,), advanced; each integral stops at the limit of what it may command.
        dt: s.
        out: ``ORDERS``, (8,).
    """
    roll, pitch, cosine = _attitude(state)
    speed = gains[AIRSPEED_TRIM] + memory[_AIRSPEED_REF]
    slower = gains[AIRSPEED_TRIM] / speed
    bank = _lateral(state, gains, route, memory, speed)
    climb = _energy(gains, route, memory, airspeed_read, speed, dt, out)
    lift, load = slower * slower - 1.0, slower * slower * (1.0 / max(cosine, _LEAST_COSINE) - 1.0)
    correction = _held(ALTITUDE_RAD_S / speed * (out[7] + state[2]), PITCH_LIMIT_RAD)
    demand = gains[PITCH_TRIM] + gains[ALPHA_BY_LIFT] * lift + gains[ALPHA_BY_LOAD] * load
    demand += climb + _held(correction + memory[_PITCH_SUM], PITCH_LIMIT_RAD)
    elevator = slower * gains[PITCH_GAIN] * (pitch - demand)
    bank_gain = slower * gains[BANK_GAIN]
    aileron = bank_gain * (roll - bank)
    ahead = gains[ELEVATOR_TRIM] + gains[ELEVATOR_BY_LIFT] * lift + gains[ELEVATOR_BY_LOAD] * load
    elevator_travel, aileron_travel = gains[ELEVATOR_TRAVEL], gains[AILERON_TRAVEL]
    out[0] = _held(ahead + elevator + memory[_ELEVATOR_SUM], elevator_travel)
    out[1] = _held(gains[AILERON_TRIM] + aileron + memory[_AILERON_SUM], aileron_travel)
    out[2] = gains[RUDDER_TRIM]
    out[4], out[5] = bank, demand
    share = dt / INTEGRAL_RATIO
    memory[_ELEVATOR_SUM] = _held(memory[_ELEVATOR_SUM] + share * PITCH_RAD_S * elevator, elevator_travel)
    memory[_PITCH_SUM] = _held(memory[_PITCH_SUM] + share * ALTITUDE_RAD_S * correction, PITCH_LIMIT_RAD)
    aileron = bank_gain * _held(roll - bank, BANK_ERROR_RAD)
    memory[_AILERON_SUM] = _held(memory[_AILERON_SUM] + share * BANK_RAD_S * aileron, aileron_travel)
