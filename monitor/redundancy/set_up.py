"""Which relations an aircraft and its channels allow, and the numbers that they need of its file."""

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, ConstantThrust, body_coefficients
from wingwatch.aircraft.aerodynamics import aspect_ratio
from wingwatch.monitor.redundancy.layout import (
    AIRSPEED,
    ALPHA,
    AXIAL,
    BETA,
    EAST,
    HEADING,
    NORTH,
    PITCH,
    RELATIONS,
    ROLL,
)
from wingwatch.monitor.redundancy.samples import Model

__all__ = ["least_drift", "model_of"]

Array = NDArray[np.float64]

_SURFACES = ("elevator", "aileron", "rudder")
_SERVO = (2.0 * np.pi * 5.0, 10.0, 1.6)
"""Bandwidth in rad/s, rate limit in rad/s and position limit in rad of a servo that the file does not describe."""
_GUST_M_S, _GUST_LENGTH_M, _SPEED_M_S = 1.5, 200.0, 25.0
"""Moderate air at low altitude; airspeed of an aircraft that states none."""
_GYRO_NOISE, _ACCELEROMETER_NOISE = 0.003, 0.05
"""rad/s and m/s2, where the file states none."""
_ATTACHED_RAD = np.radians(np.linspace(-4.0, 10.0, 29))
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
        elif i in (AIRSPEED, NORTH, EAST, AXIAL) and lacking and (i == AXIAL or airframe[12] == 0.0):
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
    return Model(
        active, np.square(noise), gyros, along, leak, _servos(aircraft), airframe, _propulsion(aircraft)
    ), absent


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
    return found


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
