"""Level trim, and the concise derivatives that an aircraft file's coefficients imply there.

The coefficients' partial derivatives are taken by a complex step, exact to rounding, of the very function
that defines the file (``aerodynamics.body_coefficients``).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from wingwatch.aircraft.aerodynamics import (
    BodyCoefficients,
    aspect_ratio,
    body_coefficients,
    drag_coefficient,
    lift_coefficient,
)
from wingwatch.aircraft.aircraft_file import Aircraft, AircraftDataError
from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.bracketed_root import bracketed_root
from wingwatch.aircraft.centre_of_gravity import about_centre
from wingwatch.aircraft.coefficients import Coefficients
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.conventions import Convention, convert
from wingwatch.aircraft.state_space import change_form, state_space
from wingwatch.aircraft.structures import (
    DUTCH_ROLL,
    DUTCH_ROLL_BETA,
    LATERAL,
    LATERAL_FULL,
    LONGITUDINAL,
    LONGITUDINAL_THROTTLE,
    PHUGOID,
    SHORT_PERIOD,
    SHORT_PERIOD_ALPHA,
    SPIRAL,
    ModeStructure,
)
from wingwatch.aircraft.thrust import thrust_slopes

__all__ = [
    "Trim",
    "TrimError",
    "derived_from",
    "linearised_at",
    "linearised_derivatives",
    "reduced",
    "trim",
    "trimmed",
]

_DERIVED: Mapping[ModeStructure, ModeStructure] = {
    SHORT_PERIOD_ALPHA: SHORT_PERIOD,
    DUTCH_ROLL_BETA: DUTCH_ROLL,
    PHUGOID: LONGITUDINAL,
    SPIRAL: LATERAL_FULL,
}

_LOWEST_ALPHA_RAD, _HIGHEST_ALPHA_RAD = -0.35, 0.6
_ELEVATOR_STEPS = 8
"""Of Newton's method for a shifted centre of gravity; only the elevator's small drag makes it more than one."""
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
    from Cm = 0 about the centre of gravity. The root on the branch of rising lift is taken. The condition's own
    angle of attack is not used.

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

    aft = mass.cg_shift_m / geometry.mean_chord_m

    def elevator(alpha: float) -> float:
        eta = -(c.Cm.zero + c.Cm.alpha * alpha) / c.Cm.elevator
        if aft == 0.0:
            return eta
        slope = c.Cm.elevator + aft * c.CL.elevator * math.cos(alpha)
        for _ in range(_ELEVATOR_STEPS):
            at = body_coefficients(c, aspect, alpha, surfaces=(eta, 0.0, 0.0))
            eta -= float((at.Cm - aft * at.CZ).real) / slope
        return eta

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
    alpha = bracketed_root(excess, float(grid[first - 1]), float(grid[first]))
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


def _full_longitudinal(
    aircraft: Aircraft, condition: FlightCondition, c: Coefficients, aspect: float, at: Trim, throttle: bool
) -> dict[str, float]:
    """``_longitudinal`` with what the full motion has beyond it: its x row, its u column, thrust and throttle.

    By u/V at constant w the slope is 2 cosα C - sinα dC/dα; thrust adds its own slopes along x, and about y where its
    line is off the centre of gravity. The drag of a deflected elevator counts, with its slope on the trim's side.
    """
    alpha, eta = at.angle_of_attack_rad, at.elevator_rad
    still = body_coefficients(c, aspect, alpha, surfaces=(eta, 0.0, 0.0))
    by_alpha = _partials(lambda d: body_coefficients(c, aspect, alpha + d, surfaces=(eta, 0.0, 0.0)))
    by_q = _partials(lambda d: body_coefficients(c, aspect, alpha, rates=(0.0, d, 0.0)))
    even = c.with_value("CD_elevator", 0.0) if eta == 0.0 else c
    by_eta = _partials(lambda d: body_coefficients(even, aspect, alpha, surfaces=(eta + d, 0.0, 0.0)))
    cos, sin = math.cos(alpha), math.sin(alpha)
    speed, throttles, arm = _thrust_coefficients(aircraft, condition, at, throttle)
    out = _longitudinal(c, aspect, at)
    out["m_w"] += sin * speed * arm
    out |= {
        f"{row}_u": float(2.0 * cos * getattr(still, name).real - sin * getattr(by_alpha, name).real)
        for row, name in {"x": "CX", "z": "CZ", "m": "Cm"}.items()
    }
    out["x_u"] += cos * speed
    out["m_u"] += cos * speed * arm
    out |= {
        "x_w": float(cos * by_alpha.CX.real + 2.0 * sin * still.CX.real) + sin * speed,
        "x_q": float(by_q.CX.real),
        "x_eta": float(by_eta.CX.real),
        "z_eta": float(by_eta.CZ.real),
    }
    return out | ({"x_tau": throttles, "z_tau": 0.0, "m_tau": throttles * arm} if throttle else {})


def _thrust_coefficients(
    aircraft: Aircraft, condition: FlightCondition, at: Trim, throttle: bool
) -> tuple[float, float, float]:
    """Slopes of thrust over ½ρV²S by V/V and by throttle, and the arm over the mean chord."""
    propulsion, geometry = aircraft.propulsion, aircraft.need_geometry("linearisation")
    if propulsion is None:
        if throttle:
            raise AircraftDataError(
                f"aircraft {aircraft.name} states no [propulsion], which derivatives by throttle need; "
                "add that table to its file"
            )
        return 0.0, 0.0, 0.0
    speed, density = condition.airspeed_true_m_s, condition.air_density_kg_m3
    slopes = thrust_slopes(propulsion, at.thrust_n, speed, density)
    if slopes is None:
        raise TrimError(
            f"{aircraft.name} has no level flight at {speed:g} m/s and {density:.4g} kg/m3: it needs a thrust of "
            f"{at.thrust_n:.3g} N, which no throttle of 0 to 1 gives; choose another airspeed or altitude"
        )
    force = condition.dynamic_pressure_pa * geometry.wing_area_m2
    arm = propulsion.thrust_line_z_m / geometry.mean_chord_m
    return slopes.by_airspeed * speed / force, slopes.by_throttle / force, arm


def derived_from(structure: ModeStructure) -> ModeStructure | None:
    """The structure that another is a form or a reduction of (``reduced``), None for one that stands for itself."""
    return _DERIVED.get(structure)


def reduced(
    values: Mapping[str, float],
    structure: ModeStructure,
    condition: FlightCondition,
    aircraft: Aircraft | None = None,
    climb_rad: float = 0.0,
) -> dict[str, float]:
    """Derivatives of a form or reduction from those of the structure it is derived from (``derived_from``).

    Phugoid and spiral keep some states of the full motion; the fast ones follow at once, their rates zero (Cook, Flight
    Dynamics Principles, sections 6.3 and 7.3): with k kept and f fast, A = A_kk - A_kf A_ff^-1 A_fk, so for B.

    Args:
        values: concise derivatives of ``derived_from(structure)``.
        structure: short period with alpha, Dutch roll with beta, phugoid or spiral.
        condition: airspeed and angle of attack count.
        aircraft: for its alphadot terms, where it has any.
        climb_rad: angle of the path above the horizon.

    Raises:
        ValueError: the structure is no form or reduction of another.
        KeyError: a derivative is absent.
    """
    full = _DERIVED.get(structure)
    if full is None:
        raise ValueError(
            f"{structure.name} is no form or reduction of another structure; linearise it itself"
        )
    if structure not in (PHUGOID, SPIRAL):
        return change_form(values, full, structure, condition)
    a, b = state_space(full, values, condition, aircraft, climb_rad)
    kept = [full.all_states.index(s) for s in structure.states]
    fast = [i for i, s in enumerate(full.all_states) if s not in (*structure.states, "psi")]
    inputs = [full.inputs.index(s) for s in structure.inputs]
    both = np.hstack((a[:, kept], b[:, inputs]))
    rows = both[kept] - a[np.ix_(kept, fast)] @ np.linalg.solve(a[np.ix_(fast, fast)], both[fast])
    return dict(zip(structure.derivatives, rows.ravel().tolist(), strict=True))


def linearised_at(
    aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure, at: Trim
) -> dict[str, float]:
    """Concise derivatives at a trim that is already known; else as ``linearised_derivatives``."""
    here = replace(condition, angle_of_attack_rad=at.angle_of_attack_rad)
    source = derived_from(structure)
    if source is not None:
        return reduced(linearised_at(aircraft, condition, source, at), structure, here, aircraft)
    c = _clean_coefficients(aircraft, condition, "linearisation")
    geometry = aircraft.need_geometry("linearisation")
    aspect = aspect_ratio(geometry.span_m, geometry.wing_area_m2)
    throttle = "tau" in structure.inputs
    if structure == SHORT_PERIOD:
        full, american = SHORT_PERIOD, _longitudinal(c, aspect, at)
    elif "x" in structure.equations:
        full = LONGITUDINAL_THROTTLE if throttle else LONGITUDINAL
        american = _full_longitudinal(aircraft, condition, c, aspect, at, throttle)
    else:
        full, american = LATERAL, _lateral(c, aspect, at)

    def converted(values: Mapping[str, float], source: Convention, target: Convention) -> dict[str, float]:
        return convert(
            values, aircraft=aircraft, condition=here, structure=full, source=source, target=target
        )

    dimensional = converted(american, Convention.AMERICAN, Convention.DIMENSIONAL)
    moved = about_centre(dimensional, full, aircraft.cg_shift_m)
    concise = converted(moved, Convention.DIMENSIONAL, Convention.CONCISE)
    return {symbol: concise[symbol] for symbol in structure.derivatives}


def linearised_derivatives(
    aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure
) -> dict[str, float]:
    """Concise derivatives in body axes from [coefficients], at the level trim of a condition.

    Lift, drag and side force are turned into body axes at the trim's angle of attack, alphadot terms enter
    through the mass matrix (thesis table B.4), roll and yaw are coupled through Ixz. The condition's own
    angle of attack is not used: the result belongs to ``trimmed(aircraft, condition)``. Thrust acts along x body: the
    short period and the lateral motions have nothing of it, the full longitudinal motion its slopes by airspeed and
    throttle (a slipstream over the tail is left out; without [propulsion] thrust is constant). The elevator's own
    drag is even in its deflection; the full motion has its slope on the trim's side of neutral, the short period
    leaves it out of z_eta, where it is sinα CD_elevator or about 1 %. In the alphadot terms the short period holds
    du/dt at zero, the full motion does not.

    Raises:
        AircraftDataError: the file lacks [coefficients], [geometry] or [mass], or [propulsion] where there is a
            throttle, or the configuration is another.
        TrimError: there is no level flight at that condition.
    """
    return linearised_at(aircraft, condition, structure, trim(aircraft, condition))
