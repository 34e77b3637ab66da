"""Where each number stands in the arrays of the compiled kernels, and how an aircraft file fills them.

One row a vehicle: its rigid-body state (``STATE``), its three surfaces (``SURFACES``) and its parameters
(``PARAMETERS``): everything about the aircraft that an effect may change in flight.
"""

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import GRAVITY_M_S2, Actuator, Aircraft, ConstantThrust, coefficient_names

__all__ = ["COEFFICIENTS", "PARAMETERS", "STATE", "SURFACES", "parameter_row"]

STATE: tuple[str, ...] = (
    "north_m", "east_m", "down_m", "u_m_s", "v_m_s", "w_m_s", "q0", "q1", "q2", "q3", "p_rad_s", "q_rad_s", "r_rad_s",
)  # fmt: skip
"""Rigid-body state: position over the flat earth (down is minus altitude), inertial velocity in body axes,
quaternion from body to earth axes with the scalar first, angular rates in body axes."""

SURFACES: tuple[str, ...] = ("elevator", "aileron", "rudder")

COEFFICIENTS: tuple[str, ...] = (
    "CL_zero", "CL_alpha", "CL_q", "CL_alphadot", "CL_elevator",
    "CD_min", "CD_CL_at_min", "CD_oswald", "CD_elevator", "CD_aileron", "CD_rudder",
    "CY_beta", "CY_p", "CY_r", "CY_aileron", "CY_rudder",
    "Cl_beta", "Cl_p", "Cl_r", "Cl_aileron", "Cl_rudder",
    "Cm_zero", "Cm_alpha", "Cm_q", "Cm_alphadot", "Cm_elevator",
    "Cn_beta", "Cn_p", "Cn_r", "Cn_aileron", "Cn_rudder",
)  # fmt: skip
"""``aircraft.coefficient_names()``, spelled out so that kernels can name them; the head of ``PARAMETERS``."""

if coefficient_names() != COEFFICIENTS:  # a term of the aircraft file that the kernels do not know
    raise ImportError(
        f"simulation knows coefficients {COEFFICIENTS}, the aircraft file has {coefficient_names()}"
    )

_FURTHER: tuple[str, ...] = (
    # aerodynamics of an aircraft that is no longer symmetric or linear; none of it in an aircraft file
    "CY_zero", "Cl_zero", "Cl_alpha", "Cn_zero", "Cn_alpha",
    "CL_alpha_square", "Cm_alpha_square", "alpha_reference",
    "ice_wing", "ice_tail", "ice_left_less_right",
    "wind_axes", "stall_sharpness", "stall_angle_rad",
    # reference dimensions
    "area_m2", "span_m", "chord_m",
    # mass: products of inertia as in the tensor's off-diagonal with a minus; c.g. from the reference point
    "mass_kg", "inertia_x", "inertia_y", "inertia_z", "inertia_xz", "inertia_xy", "inertia_yz",
    "cg_x_m", "cg_y_m", "cg_z_m",
    # propulsion
    "electric", "thrust_max_n", "diameter_m", "thrust_0", "thrust_1", "thrust_2", "torque_0", "torque_1", "torque_2",
    "motor_constant", "torque_constant", "resistance_ohm", "no_load_current_a", "voltage_max_v",
    "thrust_share", "thrust_line_z_m", "slipstream_share",
    # actuators
    "elevator_bandwidth", "aileron_bandwidth", "rudder_bandwidth",
    "elevator_rate_limit", "aileron_rate_limit", "rudder_rate_limit",
    "elevator_limit", "aileron_limit", "rudder_limit",
    "elevator_backlash", "aileron_backlash", "rudder_backlash",
    "elevator_dead_band", "aileron_dead_band", "rudder_dead_band",
    "elevator_offset", "aileron_offset", "rudder_offset",
    "elevator_stuck", "aileron_stuck", "rudder_stuck",
    "elevator_stuck_at", "aileron_stuck_at", "rudder_stuck_at",
    # sensors' places, from the reference point; what the autopilot's airspeed reads; how strong the gusts are
    "imu_x_m", "imu_y_m", "imu_z_m", "vane_x_m", "vane_y_m", "vane_z_m",
    "airspeed_reading", "gust_gain", "gust_sigma",
)  # fmt: skip

PARAMETERS: tuple[str, ...] = COEFFICIENTS + _FURTHER
"""Columns of a parameter row.

- ``Cl_alpha``, ``Cn_alpha`` and the lateral ``_zero``: moments and side force of a wing that is not alike left
  and right;
- ``CL_alpha_square``, ``Cm_alpha_square``: per rad^2, of the angle of attack less ``alpha_reference``;
- ``ice_*``: severities of the non-linear icing model (wing, tail, left wing less right wing);
- ``cg_*_m``: where the centre of gravity is, from the point that the aircraft file's coefficients refer to (its clean
  centre of gravity, unless [mass] states a ``cg_shift_m``), body axes; forces keep their reference point, so their
  moments change with it;
- ``thrust_share``: thrust over what the throttle would give; ``thrust_line_z_m``: thrust line below the
  reference point; ``slipstream_share``: share of the tail that the propeller's slipstream blows on;
- bandwidths in rad/s, infinite for a surface without actuator; backlash and dead band are full widths in rad;
  ``_offset`` is the deflection at zero command; ``_stuck`` 1 for a surface that stays at ``_stuck_at`` (NaN:
  where it is);
- ``airspeed_reading``: airspeed that the autopilot reads over the true one; ``gust_gain``: of the turbulence, 0 for
  still air; ``gust_sigma``: root mean square of its vertical gust at gain 1, m/s (0: the scenario has no filter).
"""

INDEX: dict[str, int] = {name: i for i, name in enumerate(PARAMETERS)}

(
    CL_ZERO, CL_ALPHA, CL_Q, CL_ALPHADOT, CL_ELEVATOR,
    CD_MIN, CD_CL_AT_MIN, CD_OSWALD, CD_ELEVATOR, CD_AILERON, CD_RUDDER,
    CY_BETA, CY_P, CY_R, CY_AILERON, CY_RUDDER,
    ROLL_BETA, ROLL_P, ROLL_R, ROLL_AILERON, ROLL_RUDDER,
    CM_ZERO, CM_ALPHA, CM_Q, CM_ALPHADOT, CM_ELEVATOR,
    CN_BETA, CN_P, CN_R, CN_AILERON, CN_RUDDER,
    CY_ZERO, ROLL_ZERO, ROLL_ALPHA, CN_ZERO, CN_ALPHA,
    CL_ALPHA_SQUARE, CM_ALPHA_SQUARE, ALPHA_REFERENCE,
    ICE_WING, ICE_TAIL, ICE_LEFT_LESS_RIGHT,
    WIND_AXES, STALL_SHARPNESS, STALL_ANGLE,
    AREA, SPAN, CHORD,
    MASS, INERTIA_X, INERTIA_Y, INERTIA_Z, INERTIA_XZ, INERTIA_XY, INERTIA_YZ,
    CG_X, CG_Y, CG_Z,
    ELECTRIC, THRUST_MAX, DIAMETER, THRUST_0, THRUST_1, THRUST_2, TORQUE_0, TORQUE_1, TORQUE_2,
    MOTOR_CONSTANT, TORQUE_CONSTANT, RESISTANCE, NO_LOAD_CURRENT, VOLTAGE_MAX,
    THRUST_SHARE, THRUST_LINE_Z, SLIPSTREAM_SHARE,
    ELEVATOR_BANDWIDTH, AILERON_BANDWIDTH, RUDDER_BANDWIDTH,
    ELEVATOR_RATE_LIMIT, AILERON_RATE_LIMIT, RUDDER_RATE_LIMIT,
    ELEVATOR_LIMIT, AILERON_LIMIT, RUDDER_LIMIT,
    ELEVATOR_BACKLASH, AILERON_BACKLASH, RUDDER_BACKLASH,
    ELEVATOR_DEAD_BAND, AILERON_DEAD_BAND, RUDDER_DEAD_BAND,
    ELEVATOR_OFFSET, AILERON_OFFSET, RUDDER_OFFSET,
    ELEVATOR_STUCK, AILERON_STUCK, RUDDER_STUCK,
    ELEVATOR_STUCK_AT, AILERON_STUCK_AT, RUDDER_STUCK_AT,
    IMU_X, IMU_Y, IMU_Z, VANE_X, VANE_Y, VANE_Z,
    AIRSPEED_READING, GUST_GAIN, GUST_SIGMA,
) = range(len(PARAMETERS))  # fmt: skip

THRUST_TO_WEIGHT = 0.6
"""Full throttle of an aircraft whose file has no [propulsion], over its weight: an assumption."""

_PURPOSE = "simulation"


def parameter_row(aircraft: Aircraft) -> NDArray[np.float64]:
    """The aircraft as its file describes it, whole and clean, shape (len(PARAMETERS),).

    Raises:
        AircraftDataError: the file lacks [geometry], [mass] or [coefficients].
    """
    mass, geometry = aircraft.need_mass(_PURPOSE), aircraft.need_geometry(_PURPOSE)
    coefficients = aircraft.need_coefficients(_PURPOSE)
    stall = coefficients.stall
    values: dict[str, float] = dict(coefficients.items()) | {
        "wind_axes": float(coefficients.force_axes == "wind"),
        "stall_sharpness": 0.0 if stall is None else stall.sharpness,
        "stall_angle_rad": 0.0 if stall is None else stall.angle_rad,
        "area_m2": geometry.wing_area_m2, "span_m": geometry.span_m, "chord_m": geometry.mean_chord_m,
        "mass_kg": mass.mass_kg, "inertia_x": mass.inertia_x_kg_m2, "inertia_y": mass.inertia_y_kg_m2,
        "inertia_z": mass.inertia_z_kg_m2, "inertia_xz": mass.inertia_xz_kg_m2,
        "cg_x_m": -mass.cg_shift_m, "airspeed_reading": 1.0, "gust_gain": 1.0,
    }  # fmt: skip
    values |= _propulsion(aircraft, mass.mass_kg)
    for surface in SURFACES:
        values |= _actuator(surface, getattr(aircraft.actuators, surface))
    for place in ("imu", "vane"):
        position = getattr(aircraft.sensors, f"{place}_position_m")
        values |= {f"{place}_{axis}_m": position[i] for i, axis in enumerate("xyz")}
        values[f"{place}_x_m"] -= mass.cg_shift_m
    return np.array([values.get(name, 0.0) for name in PARAMETERS])


def _propulsion(aircraft: Aircraft, mass_kg: float) -> dict[str, float]:
    """Without [propulsion] thrust is throttle times a constant."""
    p = aircraft.propulsion
    values = {"thrust_share": 1.0}
    if p is None:
        return values | {"thrust_max_n": THRUST_TO_WEIGHT * mass_kg * GRAVITY_M_S2}
    values |= {"thrust_line_z_m": p.thrust_line_z_m, "slipstream_share": p.slipstream_share}
    if isinstance(p, ConstantThrust):
        return values | {"thrust_max_n": p.thrust_max_n, "diameter_m": p.propeller_diameter_m or 0.0}
    return values | {
        "electric": 1.0, "diameter_m": p.propeller_diameter_m,
        **{f"thrust_{i}": c for i, c in enumerate(p.thrust_coefficients)},
        **{f"torque_{i}": c for i, c in enumerate(p.torque_coefficients)},
        "motor_constant": p.motor_constant_v_s_rad, "torque_constant": p.torque_constant_n_m_a,
        "resistance_ohm": p.resistance_ohm, "no_load_current_a": p.no_load_current_a, "voltage_max_v": p.voltage_max_v,
    }  # fmt: skip


def _actuator(surface: str, actuator: Actuator | None) -> dict[str, float]:
    """An absent actuator follows at once, without limits."""
    if actuator is None:
        return {f"{surface}_{name}": math.inf for name in ("bandwidth", "rate_limit", "limit")}
    return {
        f"{surface}_bandwidth": 2.0 * math.pi * actuator.bandwidth_hz,
        f"{surface}_rate_limit": _limit(actuator.rate_limit_rad_s),
        f"{surface}_limit": _limit(actuator.position_limit_rad),
        f"{surface}_backlash": actuator.backlash_rad,
        f"{surface}_dead_band": actuator.dead_band_rad,
    }


def _limit(value: float | None) -> float:
    return math.inf if value is None else value
