"""Aircraft files from dimensions: by the empirical tables, or like an aircraft whose coefficients are known.

An aircraft like another keeps its non-dimensional coefficients and its ratios of inertia: radii of gyration go with the
span, so I = I' (m/m') (b/b')^2, as for bodies of one shape whose mass is spread alike. It flies at the same lift
coefficient, so at V = V' sqrt((m/S) / (m'/S')), the same angle of attack.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from wingwatch.aircraft.aircraft_file import (
    Aircraft,
    AircraftDataError,
    ConstantThrust,
    EnvelopeLimits,
    Geometry,
    Mass,
    Sensors,
)
from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.coefficients import Coefficients
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.empirical import (
    INERTIA_ERRORS,
    LIKENESS_ERRORS,
    LIKENESS_FLOORS,
    LIKENESS_INERTIA_ERRORS,
    RADII_OVER_SPAN,
    empirical_coefficients,
    to_digits,
    with_inertia_errors,
    with_tied_errors,
)
from wingwatch.aircraft.linearisation import TrimError, trim
from wingwatch.aircraft.loading import load_aircraft

__all__ = [
    "Dimensions",
    "aircraft_like",
    "empirical_aircraft",
    "known_aircraft",
    "envelope_about",
    "scaled_inertias",
    "with_thrust",
]

CRUISE_LIFT_COEFFICIENT = 0.5
"""Of level flight where no airspeed is stated: between best glide and fast cruise of a straight wing."""
_SLOW_LIFT_COEFFICIENT = 1.0
_FAST = 1.4
_HEIGHT_M = 3000.0
_USUAL = "aerosonde"
"""Of the library: whose sensor noise and servos are taken where none are known, assumptions there, too."""
_THRUST_TO_DRAG = 2.0
"""Full throttle over the drag of cruise, where no engine is known: an assumption."""


@dataclass(frozen=True, slots=True)
class Dimensions:
    """What the maker of an aircraft knows of it.

    Attributes:
        name: of the file.
        geometry: wing, and tail and fin where they are known.
        mass_kg: of the whole aircraft.
        inertias_kg_m2: x, y, z, xz; None for what is not known.
        airspeed_true_m_s: usual airspeed; None where it is not known.
        altitude_m: usual altitude.
    """

    name: str
    geometry: Geometry
    mass_kg: float
    inertias_kg_m2: tuple[float | None, float | None, float | None, float | None] = (None, None, None, None)
    airspeed_true_m_s: float | None = None
    altitude_m: float = 0.0


def scaled_inertias(known: Dimensions, from_mass: Mass | None = None, from_span_m: float = 1.0) -> Mass:
    """[mass] with the stated moments of inertia; the others by radii of gyration over the span.

    Args:
        known: dimensions, and what is stated.
        from_mass: whose radii of gyration are taken; the mean of known aircraft (``RADII_OVER_SPAN``) if None.
        from_span_m: span of that aircraft.

    Raises:
        AircraftDataError: moments of inertia that no body has.
    """
    b2 = known.geometry.span_m**2
    if from_mass is None:
        guess = [to_digits(known.mass_kg * b2 * RADII_OVER_SPAN[axis] ** 2) for axis in "xyz"] + [0.0]
    else:
        factor = known.mass_kg / from_mass.mass_kg * b2 / from_span_m**2
        own = ("inertia_x_kg_m2", "inertia_y_kg_m2", "inertia_z_kg_m2", "inertia_xz_kg_m2")
        guess = [factor * getattr(from_mass, key) for key in own]
    x, y, z, xz = (g if v is None else v for v, g in zip(known.inertias_kg_m2, guess, strict=True))
    if xz * xz >= x * z:
        raise AircraftDataError(
            f"an inertia_xz of {xz:g} kg m2 does not go with inertia_x of {x:g} and inertia_z of {z:g}: its square "
            "must be below their product; state all of them"
        )
    return Mass(
        mass_kg=known.mass_kg, inertia_x_kg_m2=x, inertia_y_kg_m2=y, inertia_z_kg_m2=z, inertia_xz_kg_m2=xz
    )


def _pressure_airspeed(known: Dimensions, lift_coefficient: float) -> float:
    """Airspeed at which the weight needs a lift coefficient."""
    density = FlightCondition(1.0, known.altitude_m).air_density_kg_m3
    loading = known.mass_kg * GRAVITY_M_S2 / known.geometry.wing_area_m2
    return math.sqrt(2.0 * loading / (density * lift_coefficient))


def envelope_about(known: Dimensions, airspeed_m_s: float) -> EnvelopeLimits:
    """From a lift coefficient of 1 to 1.4 times cruise, from the ground or below to 3000 m above the usual altitude.

    Raises:
        AircraftDataError: a cruise slower than that lift coefficient allows.
    """
    slowest = _pressure_airspeed(known, _SLOW_LIFT_COEFFICIENT)
    if airspeed_m_s <= slowest:
        raise AircraftDataError(
            f"at {airspeed_m_s:g} m/s a mass of {known.mass_kg:g} kg on {known.geometry.wing_area_m2:g} m2 needs a "
            f"lift coefficient of {(slowest / airspeed_m_s) ** 2:.3g}, near a stall or beyond; give an airspeed above "
            f"{slowest:.3g} m/s, or check mass and wing area"
        )
    return EnvelopeLimits(
        airspeed_true_m_s=(round(slowest, 2), round(_FAST * airspeed_m_s, 2)),
        altitude_m=(min(0.0, known.altitude_m), known.altitude_m + _HEIGHT_M),
        cruise_airspeed_true_m_s=airspeed_m_s,
        cruise_altitude_m=known.altitude_m,
    )


def with_thrust(aircraft: Aircraft) -> Aircraft:
    """The aircraft with a constant thrust of twice its drag in cruise, where it states no [propulsion]."""
    if aircraft.propulsion is not None or aircraft.envelope is None:
        return aircraft
    thrust = trim(aircraft, aircraft.envelope.cruise).thrust_n
    engine = ConstantThrust(kind="constant_thrust", thrust_max_n=to_digits(_THRUST_TO_DRAG * thrust))
    return aircraft.model_copy(update={"propulsion": engine})


def empirical_aircraft(known: Dimensions, static_margin: float | None = None) -> Aircraft:
    """An aircraft by thesis tables B.1 and B.2, with measured errors (``empirical``).

    Args:
        known: its dimensions.
        static_margin: neutral point behind the centre of gravity over the mean chord; typical if None.

    Raises:
        AircraftDataError: dimensions that no level flight or no body has.
    """
    airspeed = known.airspeed_true_m_s or round(_pressure_airspeed(known, CRUISE_LIFT_COEFFICIENT), 1)
    lift = CRUISE_LIFT_COEFFICIENT * (_pressure_airspeed(known, CRUISE_LIFT_COEFFICIENT) / airspeed) ** 2
    usual = load_aircraft(_USUAL)
    made = Aircraft(
        format=1,
        name=known.name,
        description=(
            "Coefficients from dimensions by the empirical formulas of Jameson (2013), tables B.1 and B.2; rolling "
            "moments by lifting-line theory; the rest means of known aircraft. Errors: scatter of known aircraft about "
            f"the same formulas. {_inertia_words(known)} Sensor noise and servos are "
            f"those of the library's {_USUAL}, thrust is twice the drag of cruise: assumptions, state your own."
        ),
        geometry=known.geometry,
        mass=scaled_inertias(known),
        sensors=usual.sensors,
        actuators=usual.actuators,
        envelope=envelope_about(known, airspeed),
        coefficients=with_inertia_errors(
            empirical_coefficients(known.geometry, lift, static_margin), _unstated(known, INERTIA_ERRORS)
        ),
    )
    return _flyable(made)


def known_aircraft(
    known: Dimensions,
    coefficients: Coefficients,
    description: str,
    cg_shift_m: float = 0.0,
    lift: float | None = None,
) -> Aircraft:
    """An aircraft whose coefficients another program has worked out.

    Args:
        known: its dimensions; moments of inertia that are not stated go by radii of gyration, and their errors into
            those of the moments.
        coefficients: [coefficients]; their errors are those of ``uncertainty``.
        description: where they come from.
        cg_shift_m: how far aft of the coefficients' point the centre of gravity lies.
        lift: lift coefficient of level flight where ``known`` states no airspeed.

    Raises:
        AircraftDataError: dimensions that no level flight or no body has.
    """
    airspeed = known.airspeed_true_m_s or round(_pressure_airspeed(known, lift or CRUISE_LIFT_COEFFICIENT), 1)
    usual = load_aircraft(_USUAL)
    made = Aircraft(
        format=1,
        name=known.name,
        description=(
            f"{description} {_inertia_words(known)} Sensor noise and servos are those of the library's {_USUAL}, "
            "thrust is twice the drag of cruise: assumptions, state your own."
        ),
        geometry=known.geometry,
        mass=scaled_inertias(known).model_copy(update={"cg_shift_m": cg_shift_m}),
        sensors=usual.sensors,
        actuators=usual.actuators,
        envelope=envelope_about(known, airspeed),
        coefficients=with_inertia_errors(coefficients, _unstated(known, INERTIA_ERRORS)),
    )
    return _flyable(made)


def aircraft_like(known: Dimensions, other: Aircraft) -> Aircraft:
    """An aircraft with another's coefficients, sensors, actuators and ratios of inertia.

    Raises:
        AircraftDataError: the other states no [coefficients], [geometry] or [mass], or the dimensions are of no
            level flight or no body.
    """
    purpose = "an aircraft like it"
    coefficients, mass, geometry = (
        other.need_coefficients(purpose), other.need_mass(purpose), other.need_geometry(purpose),
    )  # fmt: skip
    airspeed = known.airspeed_true_m_s
    if airspeed is None and other.envelope is not None:
        loading = known.mass_kg / known.geometry.wing_area_m2 / (mass.mass_kg / geometry.wing_area_m2)
        density = (
            other.envelope.cruise.air_density_kg_m3 / FlightCondition(1.0, known.altitude_m).air_density_kg_m3
        )
        airspeed = round(other.envelope.cruise.airspeed_true_m_s * math.sqrt(loading * density), 1)
    airspeed = airspeed or round(_pressure_airspeed(known, CRUISE_LIFT_COEFFICIENT), 1)
    length = known.geometry.span_m / geometry.span_m
    places = {
        key: tuple(length * x for x in getattr(other.sensors, key))
        for key in ("imu_position_m", "vane_position_m")
    }
    table = scaled_inertias(known, mass, geometry.span_m)
    made = Aircraft(
        format=1,
        name=known.name,
        description=(
            f"Coefficients, sensors and actuators of {other.name}, for other dimensions: coefficients keep, moments of "
            "inertia go with the mass and the square of the span. Errors: what two known aircraft differ by. Thrust is "
            "twice the drag of cruise, an assumption."
        ),
        geometry=known.geometry,
        mass=table.model_copy(update={"cg_shift_m": mass.cg_shift_m * length}),
        sensors=Sensors.model_validate(other.sensors.model_dump() | places),
        actuators=other.actuators,
        envelope=envelope_about(known, airspeed),
        coefficients=with_inertia_errors(
            _as_different(coefficients), _unstated(known, LIKENESS_INERTIA_ERRORS)
        ),
    )
    return _flyable(made)


def _unstated(known: Dimensions, errors: Mapping[str, float]) -> dict[str, float]:
    """Errors of the moments of inertia that are not stated."""
    return {
        axis: errors[axis] for axis, value in zip("xyz", known.inertias_kg_m2, strict=False) if value is None
    }


def _as_different(coefficients: Coefficients) -> Coefficients:
    """With the errors of what two aircraft differ by."""
    errors = {"relative_standard_error": with_tied_errors(LIKENESS_ERRORS)}
    floors = {"standard_error_floor": {"default": 0.0, **LIKENESS_FLOORS}}
    return Coefficients.model_validate(coefficients.model_dump() | errors | floors)


def _inertia_words(known: Dimensions) -> str:
    stated = [
        axis
        for axis, value in zip(("x", "y", "z", "xz"), known.inertias_kg_m2, strict=True)
        if value is not None
    ]
    if len(stated) == 4:
        return "Moments of inertia as stated."
    of = ", ".join(f"{RADII_OVER_SPAN[axis]:g}" for axis in "xyz")
    rest = (
        f"Moments of inertia by radii of gyration of {of} of the span about x, y, z, means of known aircraft"
    )
    return f"{rest}; stated are those of {', '.join(stated)}." if stated else f"{rest}."


def _flyable(aircraft: Aircraft) -> Aircraft:
    try:
        return with_thrust(aircraft)
    except TrimError as error:
        raise AircraftDataError(f"these dimensions have no level flight: {error}") from None
