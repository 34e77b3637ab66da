"""Which relations an aircraft and its channels allow, and the numbers that they need of its file."""

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, ConstantThrust, body_coefficients
from wingwatch.aircraft.aerodynamics import aspect_ratio
from wingwatch.monitor.detection.redundancy.airframe import ATTACHED_RAD
from wingwatch.monitor.detection.redundancy.layout import (
    AIRSPEED,
    ALPHA,
    AXIAL,
    BETA,
    COLUMNS,
    EAST,
    HEADING,
    LIFT,
    NORTH,
    PITCH,
    PITCHING,
    RELATIONS,
    ROLL,
    ROLLING,
    SIDE,
    YAWING,
    parameter_index,
)
from wingwatch.monitor.detection.redundancy.samples import Model

__all__ = ["changed", "least_drift", "model_of"]

Array = NDArray[np.float64]

_SURFACES = ("elevator", "aileron", "rudder")
_SERVO = (2.0 * np.pi * 5.0, 10.0, 1.6)
"""Bandwidth in rad/s, rate limit in rad/s and position limit in rad of a servo that the file does not describe."""
_GUST_M_S, _GUST_LENGTH_M, _SPEED_M_S = 1.5, 200.0, 25.0
"""Moderate air at low altitude; airspeed of an aircraft that states none."""
_GYRO_NOISE, _ACCELEROMETER_NOISE, _VANE_NOISE = 0.003, 0.05, 0.0035
"""rad/s, m/s2 and rad, where the file states none."""
_SAMPLE_S = 0.02
"""From one sample to the next where noise and gusts of moments are weighed; the flight's own variance follows."""
_ATTACHED_RAD = np.linspace(*ATTACHED_RAD, 29)
"""Angles of attack over which the axial coefficient is a polynomial of the normal one."""


def model_of(
    aircraft: Aircraft, present: Collection[str], kinds: Mapping[str, str]
) -> tuple[Model, dict[str, str]]:
    """The model, and by relation that cannot be used the reason.

    Args:
        aircraft: its file.
        present: channels that the samples carry after completion.
        kinds: of the surfaces; one that is known by its command alone has no position to compare.
    """
    active = np.zeros(len(RELATIONS), dtype=np.bool_)
    absent: dict[str, str] = {}
    airframe, lacking = _airframe(aircraft, present)
    needs = _needs(airframe[12] > 0.0)
    for i, relation in enumerate(RELATIONS):
        missing = [c for c in needs[i] if c not in present]
        own = relation.channels[0]
        if missing:
            absent[relation.name] = f"missing {', '.join(missing)}"
        elif i < len(_SURFACES) and kinds.get(own, "position") == "command":
            absent[relation.name] = f"{own} is known by its command alone"
        elif lacking and (i == AXIAL or i >= LIFT or (i in (AIRSPEED, NORTH, EAST) and airframe[12] == 0.0)):
            absent[relation.name] = lacking
        elif i == AXIAL and aircraft.propulsion is None:
            absent[relation.name] = f"aircraft {aircraft.name} states no [propulsion]"
        else:
            active[i] = True
    noise = [max(aircraft.noise_std(r.channels[0]) or r.noise_std, r.least_noise_std) for r in RELATIONS]
    leak = np.array([r.leak_s for r in RELATIONS])
    gyros = np.square(
        [aircraft.noise_std(f"{axis}_rate_rad_s") or _GYRO_NOISE for axis in ("roll", "pitch", "yaw")]
    )
    along = (aircraft.noise_std("specific_force_x_m_s2") or _ACCELEROMETER_NOISE) ** 2
    commanded = np.array([kinds.get(f"{s}_rad", "position") == "command" for s in _SURFACES])
    terms = _Terms(np.zeros(6), np.zeros((5, COLUMNS)), np.zeros((5, COLUMNS)), np.zeros(3))
    if not lacking:
        terms = _terms(aircraft)
        noise[LIFT:], leak[LIFT:] = _noise_of_terms(aircraft, terms, np.sqrt(gyros))
    return Model(
        active,
        np.square(noise),
        gyros,
        along,
        leak,
        _servos(aircraft),
        airframe,
        _propulsion(aircraft),
        *terms,
        commanded,
    ), absent


def changed(model: Model, parameters: Array) -> Model:
    """The model of an aircraft whose forces and moments differ from the file's.

    A column takes incidence and surfaces from earlier than z does (``airframe.py``): a parameter far from zero leaves a
    part of itself in every manoeuvre, and more of the same fault would explain it.

    Args:
        parameters: what they differ by, (relations, COLUMNS).
    """
    coefficients = model.coefficients + model.units * parameters[LIFT:]
    airframe = model.airframe.copy()
    airframe[4] *= 1.0 + parameters[AXIAL, parameter_index(AXIAL, "drag")]
    airframe[5] += parameters[AXIAL, parameter_index(AXIAL, "lift's axial part")]
    airframe[6] *= 1.0 + parameters[AXIAL, parameter_index(AXIAL, "induced drag")]
    return model._replace(coefficients=coefficients, airframe=airframe)


class _Terms(NamedTuple):
    """``dimensions``, ``coefficients``, ``units`` and ``damping`` of ``Model``."""

    dimensions: Array
    coefficients: Array
    units: Array
    damping: Array


def _terms(aircraft: Aircraft) -> _Terms:
    c, mass, geometry = aircraft.coefficients, aircraft.mass, aircraft.geometry
    assert c is not None
    assert mass is not None
    assert geometry is not None
    aspect = aspect_ratio(geometry.span_m, geometry.wing_area_m2)
    normal = [-float(body_coefficients(c, aspect, float(a)).CZ.real) for a in _ATTACHED_RAD]
    slope, zero = np.polyfit(_ATTACHED_RAD, normal, 1)
    found = np.zeros((5, COLUMNS))
    found[0, :5] = zero, slope, c.CL.q, c.CL.elevator, c.CL.alphadot
    for i, t in ((SIDE, c.CY), (ROLLING, c.Cl), (YAWING, c.Cn)):
        found[i - LIFT] = 0.0, t.beta, t.p, t.r, t.aileron, t.rudder
    found[PITCHING - LIFT, :5] = c.Cm.zero, c.Cm.alpha, c.Cm.q, c.Cm.elevator, c.Cm.alphadot
    units = found.copy()
    for i, offset in ((LIFT, 1), (SIDE, 1), (ROLLING, 4), (PITCHING, 3), (YAWING, 5)):
        units[i - LIFT, 0] = found[i - LIFT, offset]
    dimensions = np.array([
        geometry.span_m, geometry.mean_chord_m, mass.inertia_x_kg_m2, mass.inertia_y_kg_m2, mass.inertia_z_kg_m2,
        mass.inertia_xz_kg_m2,
    ])  # fmt: skip
    speed = _cruise(aircraft)[0]
    damping = (
        0.5
        / speed
        * np.abs([c.Cl.p * geometry.span_m, c.Cm.q * geometry.mean_chord_m, c.Cn.r * geometry.span_m])
    )
    return _Terms(dimensions, found, units, damping)


def _cruise(aircraft: Aircraft) -> tuple[float, float]:
    """Airspeed in m/s and density in kg/m3 at which noise and gusts are weighed."""
    if aircraft.envelope is None:
        return _SPEED_M_S, 1.225
    cruise = aircraft.envelope.cruise
    return cruise.airspeed_true_m_s, cruise.air_density_kg_m3


def _pressures(aircraft: Aircraft, terms: _Terms) -> Array:
    """What a coefficient of 1 makes, by relation from ``LIFT`` on, (5,): m/s2, m/s2, rad/s2."""
    assert aircraft.mass is not None
    assert aircraft.geometry is not None
    speed, density = _cruise(aircraft)
    force = 0.5 * density * speed**2 * aircraft.geometry.wing_area_m2
    span, chord, jx, jy, jz, _ = terms.dimensions
    per_kg = force / aircraft.mass.mass_kg
    return np.array([per_kg, per_kg, force * span / jx, force * chord / jy, force * span / jz])


def _noise_of_terms(aircraft: Aircraft, terms: _Terms, gyros: Array) -> tuple[Array, Array]:
    """Standard deviation of z's noise and tau of forces and moments, (5,) each.

    A moment's z has the noise of two readings of a gyro; all have those of surfaces and of incidence, 0.7 of a vane's
    as its relation filters it. Gusts that roll, pitch and yaw last for 4 b/(pi V) (Dryden's of MIL-F-8785C).
    """
    pressures, speed = _pressures(aircraft, terms), _cruise(aircraft)[0]
    alpha, beta = (aircraft.noise_std(n) or _VANE_NOISE for n in ("angle_of_attack_rad", "sideslip_rad"))
    surfaces = [aircraft.noise_std(f"{s}_rad") or 0.001 for s in _SURFACES]
    accelerometer = [aircraft.noise_std(f"specific_force_{a}_m_s2") or _ACCELEROMETER_NOISE for a in "zy"]
    noise = np.zeros(5)
    for i in range(LIFT, YAWING + 1):
        c = terms.coefficients[i - LIFT] * pressures[i - LIFT]
        of_surfaces = (
            c[3] * surfaces[0] if i in (LIFT, PITCHING) else np.hypot(c[4] * surfaces[1], c[5] * surfaces[2])
        )
        made = np.hypot(0.7 * c[1] * (alpha if i in (LIFT, PITCHING) else beta), of_surfaces)
        own = accelerometer[i - LIFT] if i < ROLLING else np.sqrt(2.0) * gyros[i - ROLLING]
        noise[i - LIFT] = np.hypot(own, made * (1.0 if i < ROLLING else _SAMPLE_S))
    leak = np.full(5, 4.0 * terms.dimensions[0] / (np.pi * speed))
    leak[:2] = 1.0
    return noise, leak


def least_drift(aircraft: Aircraft, model: Model) -> Array:
    """By relation the least drift, (relations,): gusts of moderate air may set in at any time.

    Dryden's longitudinal gusts of standard deviation sigma grow as a random walk of variance 2 sigma^2 V/L a second.
    """
    found = np.zeros(len(RELATIONS))
    cruise = aircraft.envelope.cruise if aircraft.envelope else None
    speed = cruise.airspeed_true_m_s if cruise else _SPEED_M_S
    gusts = 2.0 * _GUST_M_S**2 * speed / _GUST_LENGTH_M
    for i in (AIRSPEED, NORTH, EAST):
        found[i] = gusts / model.noise_variance[i]
    for i in (ALPHA, BETA):
        found[i] = gusts / speed**2 / model.noise_variance[i]
    if model.active[ROLLING] or model.active[PITCHING]:
        found[ROLLING:] = _rolling_air(aircraft, model)
    return found


def _rolling_air(aircraft: Aircraft, model: Model) -> Array:
    """Least drift of the moments, (3,).

    Rates of gusts have the variances 0.8 sigma^2/L (pi L/(4 b))^(1/3) pi^2/(8 b) of roll and 3 pi sigma^2/(8 L b) of
    pitch and yaw (MIL-F-8785C's spectra over all frequencies), and act as the aircraft's own rates do.
    """
    terms = _Terms(model.dimensions, model.coefficients, model.units, model.damping)
    pressures, span = _pressures(aircraft, terms), float(terms.dimensions[0])
    roll = 0.8 * _GUST_M_S**2 / _GUST_LENGTH_M * (np.pi * _GUST_LENGTH_M / (4.0 * span)) ** (1.0 / 3.0)
    roll *= np.pi**2 / (8.0 * span)
    other = 3.0 * np.pi * _GUST_M_S**2 / (8.0 * _GUST_LENGTH_M * span)
    felt = (pressures[2:] * terms.damping * _SAMPLE_S) ** 2 * np.array([roll, other, other])
    return np.asarray(2.0 * felt / model.leak_s[ROLLING:] / model.noise_variance[ROLLING:])


def _needs(vane: bool) -> dict[int, tuple[str, ...]]:
    attitude = ("roll_rad", "pitch_rad")
    lift = () if vane else ("air_density_kg_m3",)
    return {
        **{k: (f"{s}_rad", f"{s}_command_rad") for k, s in enumerate(_SURFACES)},
        ROLL: attitude,
        PITCH: attitude,
        HEADING: (*attitude, "heading_rad"),
        AIRSPEED: (*attitude, *lift),
        ALPHA: (*attitude, "angle_of_attack_rad"),
        BETA: (*attitude, "sideslip_rad"),
        AXIAL: ("throttle", "air_density_kg_m3"),
        NORTH: (*attitude, *lift, "heading_rad", "velocity_north_m_s"),
        EAST: (*attitude, *lift, "heading_rad", "velocity_east_m_s"),
        LIFT: ("air_density_kg_m3", "angle_of_attack_rad", "elevator_rad"),
        SIDE: ("air_density_kg_m3", "sideslip_rad", "aileron_rad", "rudder_rad"),
        ROLLING: ("air_density_kg_m3", "aileron_rad", "rudder_rad"),
        PITCHING: ("air_density_kg_m3", "elevator_rad"),
        YAWING: ("air_density_kg_m3", "aileron_rad", "rudder_rad"),
    }


def _airframe(aircraft: Aircraft, present: Collection[str]) -> tuple[Array, str]:
    """``Model.airframe``, and why lift and axial force are not known; empty where they are."""
    row = np.zeros(14)
    row[0], row[1], row[3] = 1.0, 1.0, 1.0
    lacking = ""
    if aircraft.mass is None or aircraft.geometry is None or aircraft.coefficients is None:
        lacking = f"aircraft {aircraft.name} states no [mass], [geometry] or [coefficients]"
    else:
        aspect = aspect_ratio(aircraft.geometry.span_m, aircraft.geometry.wing_area_m2)
        found = [body_coefficients(aircraft.coefficients, aspect, float(a)) for a in _ATTACHED_RAD]
        normal = np.array([-float(c.CZ.real) for c in found])
        axial = np.array([-float(c.CX.real) for c in found])
        slope, zero = np.polyfit(_ATTACHED_RAD, normal, 1)
        square, linear, least = np.polyfit(normal, axial, 2)
        row[:7] = aircraft.mass.mass_kg, aircraft.geometry.wing_area_m2, zero, slope, least, linear, square
    vane, imu = aircraft.sensors.vane_position_m, aircraft.sensors.imu_position_m
    row[7:12] = vane[0], vane[2], *imu
    row[12], row[13] = float("angle_of_attack_rad" in present), float("sideslip_rad" in present)
    return row, lacking


def _servos(aircraft: Aircraft) -> Array:
    rows = []
    for surface in _SURFACES:
        servo = getattr(aircraft.actuators, surface)
        if servo is None:
            rows.append(_SERVO)
            continue
        rows.append((
            2.0 * np.pi * servo.bandwidth_hz, servo.rate_limit_rad_s or 1e9, servo.position_limit_rad or 1e9,
        ))  # fmt: skip
    return np.array(rows)


def _propulsion(aircraft: Aircraft) -> Array:
    row = np.zeros(14)
    p = aircraft.propulsion
    if p is None:
        return row
    if isinstance(p, ConstantThrust):
        row[1] = p.thrust_max_n
        return row
    row[:] = (
        1.0, 0.0, p.propeller_diameter_m, *p.thrust_coefficients, *p.torque_coefficients, p.motor_constant_v_s_rad,
        p.torque_constant_n_m_a, p.resistance_ohm, p.no_load_current_a, p.voltage_max_v,
    )  # fmt: skip
    return row
