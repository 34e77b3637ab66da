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
from wingwatch.simulation.effects import Effect, coefficients_under
from wingwatch.simulation.layout import STATE, vehicle_row

__all__ = ["TrimPoint", "trim"]

_STILL_AIR = np.zeros(3)
_NO_GUST = np.zeros(6)
_NOTHING = 1e-15
"""Below rounding of any unknown: a symmetric flight is left exactly symmetric."""
_RESIDUAL = 1e-8
"""Largest acceleration left, m/s2 or rad/s2: a millionth of what any sensor here would show."""


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

    @property
    def surfaces_rad(self) -> NDArray[np.float64]:
        """Elevator, aileron and rudder, shape (3,)."""
        return np.array([self.elevator_rad, self.aileron_rad, self.rudder_rad])


def _pitch_for(alpha: float, climb_rad: float, bank_rad: float) -> float:
    """Pitch attitude of a climb without sideslip (Stevens and Lewis, Aircraft Control and Simulation, section 3.4):
    sin(climb) = a sin(theta) - b cos(theta), a = cos(alpha), b = sin(alpha) cos(bank)."""
    a, b, s = math.cos(alpha), math.sin(alpha) * math.cos(bank_rad), math.sin(climb_rad)
    return math.asin(s / math.hypot(a, b)) + math.atan2(b, a)


def _state(
    condition: FlightCondition, alpha: float, climb_rad: float, bank_rad: float, turn_rate_rad_s: float
) -> NDArray[np.float64]:
    pitch = _pitch_for(alpha, climb_rad, bank_rad)
    speed = condition.airspeed_true_m_s
    state = np.zeros(len(STATE))
    state[2] = -condition.altitude_m
    state[3], state[5] = speed * math.cos(alpha), speed * math.sin(alpha)
    state[6:10] = quaternion(bank_rad, pitch, 0.0)
    state[10] = -turn_rate_rad_s * math.sin(pitch)
    state[11] = turn_rate_rad_s * math.cos(pitch) * math.sin(bank_rad)
    state[12] = turn_rate_rad_s * math.cos(pitch) * math.cos(bank_rad)
    return state


def trim(
    aircraft: Aircraft,
    condition: FlightCondition,
    climb_rad: float = 0.0,
    bank_rad: float = 0.0,
    effects: Sequence[Effect] = (),
    time_s: float = 0.0,
) -> TrimPoint:
    """Steady flight without sideslip in still standard air.

    Solves the six accelerations of ``dynamics.derivatives`` to zero for angle of attack, turn rate, elevator, aileron,
    rudder and throttle.

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
    vehicle = vehicle_row(aircraft)
    coefficients = coefficients_under(aircraft, effects, time_s)
    air, load, rates = np.empty(6), np.empty(8), np.empty(len(STATE))

    def accelerations(x: NDArray[np.float64]) -> NDArray[np.float64]:
        state = _state(condition, float(x[0]), climb_rad, bank_rad, float(x[1]))
        derivatives(state, x[2:5], x[5], _STILL_AIR, _NO_GUST, vehicle, coefficients, air, load, rates)
        return rates[[3, 4, 5, 10, 11, 12]].copy()

    solution = root(accelerations, _first_guess(aircraft, condition, climb_rad, bank_rad, vehicle), tol=1e-13)
    x = np.asarray(solution.x, dtype=np.float64)
    x[np.abs(x) < _NOTHING] = 0.0
    residual = float(np.abs(accelerations(x)).max())
    what = (
        f"{aircraft.name} has no steady flight at {condition.airspeed_true_m_s:g} m/s, {condition.altitude_m:g} m, "
        f"climb {climb_rad:g} rad, bank {bank_rad:g} rad"
    )
    if not residual < _RESIDUAL:
        raise TrimError(
            f"{what}: {residual:.3g} m/s2 stay unbalanced; choose another airspeed, climb or bank"
        )
    if not 0.0 <= x[5] <= 1.0:
        raise TrimError(
            f"{what}: it needs throttle {x[5]:.3g}, allowed is 0 to 1; choose another airspeed or climb"
        )
    for name, value, limit in zip(("elevator", "aileron", "rudder"), x[2:5], vehicle[-3:], strict=True):
        if abs(value) > limit:
            raise TrimError(
                f"{what}: it needs {name} {value:.3g} rad, allowed is {limit:g}; choose another airspeed"
            )
    alpha, turn_rate = float(x[0]), float(x[1])
    return TrimPoint(
        _state(condition, alpha, climb_rad, bank_rad, turn_rate), alpha, _pitch_for(alpha, climb_rad, bank_rad),
        bank_rad, turn_rate, float(x[2]), float(x[3]), float(x[4]), float(x[5]), residual,
    )  # fmt: skip


def _first_guess(
    aircraft: Aircraft,
    condition: FlightCondition,
    climb_rad: float,
    bank_rad: float,
    vehicle: NDArray[np.float64],
) -> NDArray[np.float64]:
    level = level_trim(aircraft, FlightCondition(condition.airspeed_true_m_s, condition.altitude_m))
    thrust = level.thrust_n + vehicle[0] * GRAVITY_M_S2 * math.sin(climb_rad)
    settings = np.linspace(0.0, 1.0, 101)
    speed, density = condition.airspeed_true_m_s, condition.air_density_kg_m3
    gives = np.array([thrust_n(vehicle, s, speed, density) for s in settings])
    throttle = float(settings[np.argmin(np.abs(gives - thrust))])
    turn_rate = GRAVITY_M_S2 * math.tan(bank_rad) / speed
    return np.array([level.angle_of_attack_rad, turn_rate, level.elevator_rad, 0.0, 0.0, throttle])
