"""Steady flight of the six-degree-of-freedom aircraft: level, climbing, banked, with or without effects acting."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from wingwatch.aircraft import GRAVITY_M_S2, Aircraft, FlightCondition, TrimError
from wingwatch.aircraft import trim as level_trim
from wingwatch.simulation.dynamics import derivatives, quaternion, thrust_n
from wingwatch.simulation.effects import Effect
from wingwatch.simulation.layout import (
    ELEVATOR_LIMIT,
    ELEVATOR_STUCK,
    ELEVATOR_STUCK_AT,
    MASS,
    STATE,
    SURFACES,
)
from wingwatch.simulation.timeline import base_row, timeline

__all__ = ["TrimPoint", "body_jacobian", "trim", "trim_row"]

_NOTHING = 1e-15
"""Below rounding of any unknown: a symmetric flight is left exactly symmetric."""
_RESIDUAL = 1e-8
"""Largest acceleration left, m/s2 or rad/s2: a millionth of what any sensor here would show."""
_MOTIONS = [3, 4, 5, 10, 11, 12]
"""Velocity and rates in the rigid-body state."""
_ALPHA, _BETA, _BANK, _TURN, _ELEVATOR, _THROTTLE = 0, 1, 2, 3, 4, 7
_STEP = 1e-4


@dataclass(frozen=True, slots=True)
class TrimPoint:
    """A steady flight.

    Attributes:
        state: rigid-body state, shape (13,), in still air at the origin, heading north.
        angle_of_attack_rad: there.
        pitch_rad: attitude.
        bank_rad: attitude.
        turn_rate_rad_s: rate of heading.
        elevator_rad: deflection.
        aileron_rad: deflection.
        rudder_rad: deflection.
        throttle: 0 to 1.
        residual: largest of the six accelerations left, m/s2 or rad/s2.
        sideslip_rad: there.
    """

    state: NDArray[np.float64]
    angle_of_attack_rad: float
    pitch_rad: float
    bank_rad: float
    turn_rate_rad_s: float
    elevator_rad: float
    aileron_rad: float
    rudder_rad: float
    throttle: float
    residual: float
    sideslip_rad: float = 0.0

    @property
    def surfaces_rad(self) -> NDArray[np.float64]:
        """Elevator, aileron and rudder, shape (3,)."""
        return np.array([self.elevator_rad, self.aileron_rad, self.rudder_rad])


def _pitch_for(alpha: float, beta: float, climb_rad: float, bank_rad: float) -> float:
    """Pitch attitude of a climb (Stevens and Lewis, Aircraft Control and Simulation, section 3.4): sin(climb) =
    a sin(theta) - b cos(theta), a = cos(alpha) cos(beta), b = sin(bank) sin(beta) + cos(bank) sin(alpha) cos(beta)."""
    a = math.cos(alpha) * math.cos(beta)
    b = math.sin(bank_rad) * math.sin(beta) + math.cos(bank_rad) * math.sin(alpha) * math.cos(beta)
    return math.asin(min(1.0, max(-1.0, math.sin(climb_rad) / math.hypot(a, b)))) + math.atan2(b, a)


def _state(condition: FlightCondition, climb_rad: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
    alpha, beta, bank, turn = (float(x[i]) for i in (_ALPHA, _BETA, _BANK, _TURN))
    pitch = _pitch_for(alpha, beta, climb_rad, bank)
    speed = condition.airspeed_true_m_s
    state = np.zeros(len(STATE))
    state[2] = -condition.altitude_m
    state[3] = speed * math.cos(alpha) * math.cos(beta)
    state[4], state[5] = speed * math.sin(beta), speed * math.sin(alpha) * math.cos(beta)
    state[6:10] = quaternion(bank, pitch, 0.0)
    state[10] = -turn * math.sin(pitch)
    state[11] = turn * math.cos(pitch) * math.sin(bank)
    state[12] = turn * math.cos(pitch) * math.cos(bank)
    return state


def _free(row: NDArray[np.float64], bank_rad: float) -> list[int]:
    """Which unknowns are solved for; a surface that is stuck somewhere is none.

    Wings level, the flight is straight: sideslip, aileron and rudder, then bank and turn for what is stuck. In a
    bank the turn is free and there is no sideslip unless something is stuck.
    """
    stuck = [
        row[ELEVATOR_STUCK + j] > 0.0 and not math.isnan(row[ELEVATOR_STUCK_AT + j])
        for j in range(len(SURFACES))
    ]
    aileron, rudder = _ELEVATOR + 1, _ELEVATOR + 2
    order = [_BETA, aileron, rudder, _BANK, _TURN] if bank_rad == 0.0 else [_TURN, aileron, rudder, _BETA]
    lateral = [i for i in order if not (i in (aileron, rudder) and stuck[i - _ELEVATOR])][:3]
    return [_ALPHA, *([] if stuck[0] else [_ELEVATOR]), _THROTTLE, *lateral]


def trim(
    aircraft: Aircraft,
    condition: FlightCondition,
    climb_rad: float = 0.0,
    bank_rad: float = 0.0,
    effects: Sequence[Effect] = (),
    time_s: float = 0.0,
) -> TrimPoint:
    """Steady flight in still standard air: straight with the wings level, or a turn without sideslip.

    Solves the six accelerations of ``dynamics.derivatives`` to zero for angle of attack, elevator and throttle, and for
    sideslip (in a bank: turn rate), aileron and rudder. Where effects leave the aileron or the rudder stuck
    somewhere, the bank (in a bank: the sideslip) takes its place; a surface stuck where it is counts as free.

    Args:
        aircraft: with [coefficients], [geometry] and [mass].
        condition: airspeed and altitude; its density and angle of attack are not used.
        climb_rad: angle of the path above the horizon.
        bank_rad: bank; a turn follows.
        effects: what is wrong with the aircraft.
        time_s: when, for effects that grow.

    Raises:
        AircraftDataError: the file lacks one of those tables.
        TrimError: no such flight, within the throttle's 0 to 1 and the surfaces' travel.
    """
    row = timeline(aircraft, condition, effects, base_row(aircraft, condition)).at(time_s)
    return trim_row(aircraft, condition, row, climb_rad, bank_rad)


def trim_row(
    aircraft: Aircraft,
    condition: FlightCondition,
    row: NDArray[np.float64],
    climb_rad: float = 0.0,
    bank_rad: float = 0.0,
) -> TrimPoint:
    """As ``trim``, of an aircraft whose parameters (``layout.PARAMETERS``) are known."""
    what = (
        f"{aircraft.name} has no steady flight at {condition.airspeed_true_m_s:g} m/s, {condition.altitude_m:g} m, "
        f"climb {climb_rad:g} rad, bank {bank_rad:g} rad"
    )
    free = _free(row, bank_rad)
    if len(free) < len(_MOTIONS):
        raise TrimError(f"{what}: too many of its surfaces are stuck; choose a time before they are")
    x = _first_guess(aircraft, condition, climb_rad, bank_rad, row)
    force, rates = np.empty(3), np.empty(len(STATE))

    def accelerations(unknown: NDArray[np.float64]) -> NDArray[np.float64]:
        x[free] = unknown
        state = _state(condition, climb_rad, x)
        derivatives(state, x[4:7], x[_THROTTLE], row, force, rates)
        return rates[_MOTIONS].copy()

    found = np.asarray(root(accelerations, x[free].copy(), tol=1e-13).x, dtype=np.float64)
    found[np.abs(found) < _NOTHING] = 0.0
    residual = float(np.abs(accelerations(found)).max())
    _check(what, x, row, residual)
    alpha, beta, bank = float(x[_ALPHA]), float(x[_BETA]), float(x[_BANK])
    return TrimPoint(
        _state(condition, climb_rad, x), alpha, _pitch_for(alpha, beta, climb_rad, bank), bank, float(x[_TURN]),
        float(x[4]), float(x[5]), float(x[6]), float(x[_THROTTLE]), residual, beta,
    )  # fmt: skip


def _check(what: str, x: NDArray[np.float64], row: NDArray[np.float64], residual: float) -> None:
    if not residual < _RESIDUAL:
        raise TrimError(
            f"{what}: {residual:.3g} m/s2 stay unbalanced; choose another airspeed, climb or bank"
        )
    if not 0.0 <= x[_THROTTLE] <= 1.0:
        raise TrimError(
            f"{what}: it needs throttle {x[_THROTTLE]:.3g}, allowed is 0 to 1; choose another airspeed or climb"
        )
    limits = row[ELEVATOR_LIMIT : ELEVATOR_LIMIT + len(SURFACES)]
    for name, value, limit in zip(SURFACES, x[4:7], limits, strict=True):
        if abs(value) > limit:
            raise TrimError(
                f"{what}: it needs {name} {value:.3g} rad, allowed is {limit:g}; choose another airspeed"
            )


def _first_guess(
    aircraft: Aircraft,
    condition: FlightCondition,
    climb_rad: float,
    bank_rad: float,
    row: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Angle of attack, sideslip, bank, turn rate, three surfaces (stuck ones where they are) and throttle."""
    level = level_trim(aircraft, FlightCondition(condition.airspeed_true_m_s, condition.altitude_m))
    thrust = level.thrust_n + row[MASS] * GRAVITY_M_S2 * math.sin(climb_rad)
    settings = np.linspace(0.0, 1.0, 101)
    speed, density = condition.airspeed_true_m_s, condition.air_density_kg_m3
    gives = np.array([thrust_n(row, s, speed, density) for s in settings])
    throttle = float(settings[np.argmin(np.abs(gives - thrust))])
    turn_rate = GRAVITY_M_S2 * math.tan(bank_rad) / speed
    x = np.array(
        [level.angle_of_attack_rad, 0.0, bank_rad, turn_rate, level.elevator_rad, 0.0, 0.0, throttle]
    )
    for j in range(len(SURFACES)):
        place = row[ELEVATOR_STUCK_AT + j]
        if row[ELEVATOR_STUCK + j] > 0.0 and not math.isnan(place):
            x[_ELEVATOR + j] = place
    return x


def body_jacobian(row: NDArray[np.float64], point: TrimPoint) -> NDArray[np.float64]:
    """How velocity and rates (u, v, w, p, q, r) change with themselves at a trim, all else held, shape (6, 6), 1/s."""
    force, rates = np.empty(3), np.empty(len(STATE))
    out = np.empty((len(_MOTIONS), len(_MOTIONS)))
    for j, index in enumerate(_MOTIONS):
        sides = []
        for sign in (1.0, -1.0):
            state = point.state.copy()
            state[index] += sign * _STEP
            derivatives(state, point.surfaces_rad, point.throttle, row, force, rates)
            sides.append(rates[_MOTIONS].copy())
        out[:, j] = (sides[0] - sides[1]) / (2.0 * _STEP)
    return out
