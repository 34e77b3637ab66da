"""Level trim, and the concise derivatives that an aircraft file's coefficients imply there.

The coefficients' partial derivatives are taken by a complex step, exact to rounding, of the very function
that defines the file (``aerodynamics.body_coefficients``).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from wingwatch.aircraft.aerodynamics import (
    BodyCoefficients,
    aspect_ratio,
    body_coefficients,
    drag_coefficient,
    lift_coefficient,
)
from wingwatch.aircraft.aircraft_file import Aircraft, AircraftDataError
from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.coefficients import Coefficients
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.conventions import Convention, convert
from wingwatch.aircraft.structures import LATERAL, SHORT_PERIOD, ModeStructure

__all__ = ["Trim", "TrimError", "linearised_at", "linearised_derivatives", "trim", "trimmed"]

_LOWEST_ALPHA_RAD, _HIGHEST_ALPHA_RAD = -0.35, 0.6
_STEP = 1e-20
"""Imaginary step: no difference is formed, so it may be as small as it likes."""


class TrimError(ValueError):
    """No steady level flight exists at the condition; the sentence says what would make it possible."""


@dataclass(frozen=True, slots=True)
class Trim:
    """Steady level flight.

    Attributes:
        angle_of_attack_rad: of x body.
        elevator_rad: deflection that zeroes the pitching moment.
        thrust_n: along x body, through the centre of gravity.
        lift_coefficient: CL there, elevator included.
        drag_coefficient: CD there, elevator included.
    """

    angle_of_attack_rad: float
    elevator_rad: float
    thrust_n: float
    lift_coefficient: float
    drag_coefficient: float


def _clean_coefficients(aircraft: Aircraft, condition: FlightCondition, purpose: str) -> Coefficients:
    coefficients = aircraft.need_coefficients(purpose)
    if condition.configuration != "clean":
        raise AircraftDataError(
            f"aircraft {aircraft.name}'s [coefficients] are those of configuration clean, not of "
            f"{condition.configuration!r}; state derivatives for it under [[conditions]]"
        )
    return coefficients


def trim(aircraft: Aircraft, condition: FlightCondition) -> Trim:
    """Steady, level, wings-level flight: pitching moment zero, weight carried by lift and inclined thrust.

    With thrust along x body, T cosα = D and L + T sinα = m g, hence L + D tanα = m g; the elevator follows
    from Cm = 0. The root on the branch of rising lift is taken. The condition's own angle of attack is not
    used.

    Raises:
        AircraftDataError: the file lacks [coefficients], [geometry] or [mass], or the configuration is
            another.
        TrimError: the wing cannot carry the weight at that airspeed and density.
    """
    c = _clean_coefficients(aircraft, condition, "a level trim")
    geometry, mass = aircraft.need_geometry("a level trim"), aircraft.need_mass("a level trim")
    aspect = aspect_ratio(geometry.span_m, geometry.wing_area_m2)
    pressure_area = condition.dynamic_pressure_pa * geometry.wing_area_m2
    needed = mass.mass_kg * GRAVITY_M_S2 / pressure_area

    def elevator(alpha: float) -> float:
        return -(c.Cm.zero + c.Cm.alpha * alpha) / c.Cm.elevator

    def excess(alpha: float) -> float:
        eta = elevator(alpha)
        lift = lift_coefficient(c, alpha, elevator=eta).real
        drag = drag_coefficient(c, aspect, alpha, elevator=eta).real
        return float(lift + drag * math.tan(alpha) - needed)

    grid = np.linspace(_LOWEST_ALPHA_RAD, _HIGHEST_ALPHA_RAD, 96)
    surplus = [excess(float(a)) for a in grid]
    first = next((i for i in range(1, len(grid)) if surplus[i - 1] <= 0.0 < surplus[i]), None)
    if first is None:
        raise TrimError(
            f"{aircraft.name} has no level trim at {condition.airspeed_true_m_s:g} m/s and "
            f"{condition.air_density_kg_m3:.4g} kg/m3: it needs a lift coefficient of {needed:.3g}, "
            f"its wing gives {min(surplus) + needed:.3g} to {max(surplus) + needed:.3g}; "
            "choose another airspeed or altitude"
        )
    alpha = float(brentq(excess, float(grid[first - 1]), float(grid[first]), xtol=1e-14, rtol=1e-14))
    eta = elevator(alpha)
    lift = float(lift_coefficient(c, alpha, elevator=eta).real)
    drag = float(drag_coefficient(c, aspect, alpha, elevator=eta).real)
    return Trim(alpha, eta, drag * pressure_area / math.cos(alpha), lift, drag)


def trimmed(aircraft: Aircraft, condition: FlightCondition) -> FlightCondition:
    """The condition with the angle of attack of its level trim; raises as ``trim``."""
    return replace(condition, angle_of_attack_rad=trim(aircraft, condition).angle_of_attack_rad)


def _partials(evaluate: Callable[[complex], BodyCoefficients]) -> BodyCoefficients:
    """Derivatives of all six coefficients with respect to the argument, at zero, by a complex step."""
    stepped = evaluate(complex(0.0, _STEP))
    return BodyCoefficients(*(value.imag / _STEP for value in stepped))


def _longitudinal(c: Coefficients, aspect: float, at: Trim) -> dict[str, float]:
    """American derivatives by w/V at constant forward speed, q c/2V and elevator, in body axes."""
    alpha, eta = at.angle_of_attack_rad, at.elevator_rad
    still = body_coefficients(c, aspect, alpha, surfaces=(eta, 0.0, 0.0))
    by_alpha = _partials(lambda d: body_coefficients(c, aspect, alpha + d, surfaces=(eta, 0.0, 0.0)))
    by_q = _partials(lambda d: body_coefficients(c, aspect, alpha, rates=(0.0, d, 0.0)))
    even = c.with_value("CD_elevator", 0.0)
    by_eta = _partials(lambda d: body_coefficients(even, aspect, alpha, surfaces=(eta + d, 0.0, 0.0)))
    cos, twice_sin = math.cos(alpha), 2.0 * math.sin(alpha)
    return {
        "z_w": float(cos * by_alpha.CZ.real + twice_sin * still.CZ.real),
        "z_q": float(by_q.CZ.real),
        "z_eta": float(by_eta.CZ.real),
        "m_w": float(cos * by_alpha.Cm.real + twice_sin * still.Cm.real),
        "m_q": float(by_q.Cm.real),
        "m_eta": float(by_eta.Cm.real),
    }


def _lateral(c: Coefficients, aspect: float, at: Trim) -> dict[str, float]:
    """American derivatives by v/V, p b/2V, r b/2V, aileron and rudder, in body axes."""
    alpha, eta = at.angle_of_attack_rad, at.elevator_rad
    level = (eta, 0.0, 0.0)
    columns = {
        "v": _partials(lambda d: body_coefficients(c, aspect, alpha, beta=d, surfaces=level)),
        "p": _partials(lambda d: body_coefficients(c, aspect, alpha, rates=(d, 0.0, 0.0))),
        "r": _partials(lambda d: body_coefficients(c, aspect, alpha, rates=(0.0, 0.0, d))),
        "xi": _partials(lambda d: body_coefficients(c, aspect, alpha, surfaces=(eta, d, 0.0))),
        "zeta": _partials(lambda d: body_coefficients(c, aspect, alpha, surfaces=(eta, 0.0, d))),
    }
    rows = {"y": "CY", "l": "Cl", "n": "Cn"}
    return {
        f"{row}_{index}": float(getattr(column, name).real)
        for row, name in rows.items()
        for index, column in columns.items()
    }


def linearised_at(
    aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure, at: Trim
) -> dict[str, float]:
    """Concise derivatives at a trim that is already known; else as ``linearised_derivatives``."""
    c = _clean_coefficients(aircraft, condition, "linearisation")
    geometry = aircraft.need_geometry("linearisation")
    aspect = aspect_ratio(geometry.span_m, geometry.wing_area_m2)
    longitudinal = structure == SHORT_PERIOD
    full = SHORT_PERIOD if longitudinal else LATERAL
    concise = convert(
        _longitudinal(c, aspect, at) if longitudinal else _lateral(c, aspect, at),
        aircraft=aircraft,
        condition=replace(condition, angle_of_attack_rad=at.angle_of_attack_rad),
        structure=full,
        source=Convention.AMERICAN,
        target=Convention.CONCISE,
    )
    return {symbol: concise[symbol] for symbol in structure.derivatives}


def linearised_derivatives(
    aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure
) -> dict[str, float]:
    """Concise derivatives in body axes from [coefficients], at the level trim of a condition.

    Lift, drag and side force are turned into body axes at the trim's angle of attack, alphadot terms enter
    through the mass matrix (thesis table B.4), roll and yaw are coupled through Ixz. The condition's own
    angle of attack is not used: the result belongs to ``trimmed(aircraft, condition)``. Thrust adds
    nothing, for it acts along x body through the centre of gravity and is taken constant. The elevator's
    own drag is even in its deflection and has no linear part; its slope beside neutral, sinα CD_elevator or
    about 1 % of z_eta, is left out.

    Raises:
        AircraftDataError: the file lacks [coefficients], [geometry] or [mass], or the configuration is
            another.
        TrimError: there is no level flight at that condition.
    """
    return linearised_at(aircraft, condition, structure, trim(aircraft, condition))
