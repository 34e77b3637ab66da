"""Where each number stands in the arrays of the compiled kernels, and how an aircraft file fills them.

One row a vehicle: its parameters (``VEHICLE``), its coefficients (``COEFFICIENTS``, those of the aircraft file in
their own order), its rigid-body state (``STATE``), its three surfaces (``SURFACES``).
"""

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import GRAVITY_M_S2, Aircraft, coefficient_names
from wingwatch.aircraft.aircraft_file import Actuator

__all__ = ["COEFFICIENTS", "STATE", "SURFACES", "VEHICLE", "coefficient_row", "vehicle_row"]

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
"""Columns of the coefficient array: ``aircraft.coefficient_names()``, spelled out so that kernels can name them."""

if coefficient_names() != COEFFICIENTS:  # a term of the aircraft file that the kernels do not know
    raise ImportError(
        f"simulation knows coefficients {COEFFICIENTS}, the aircraft file has {coefficient_names()}"
    )

(
    CL_ZERO, CL_ALPHA, CL_Q, CL_ALPHADOT, CL_ELEVATOR,
    CD_MIN, CD_CL_AT_MIN, CD_OSWALD, CD_ELEVATOR, CD_AILERON, CD_RUDDER,
    CY_BETA, CY_P, CY_R, CY_AILERON, CY_RUDDER,
    ROLL_BETA, ROLL_P, ROLL_R, ROLL_AILERON, ROLL_RUDDER,
    CM_ZERO, CM_ALPHA, CM_Q, CM_ALPHADOT, CM_ELEVATOR,
    CN_BETA, CN_P, CN_R, CN_AILERON, CN_RUDDER,
) = range(len(COEFFICIENTS))  # fmt: skip

VEHICLE: tuple[str, ...] = (
    "mass_kg", "inertia_x", "inertia_y", "inertia_z", "inertia_xz",
    "area_m2", "span_m", "chord_m", "wind_axes",
    "stall_sharpness", "stall_angle_rad",
    "electric", "thrust_max_n", "diameter_m", "thrust_0", "thrust_1", "thrust_2", "torque_0", "torque_1", "torque_2",
    "motor_constant", "torque_constant", "resistance_ohm", "no_load_current_a", "voltage_max_v",
    "imu_x_m", "imu_y_m", "imu_z_m", "vane_x_m", "vane_y_m", "vane_z_m",
    "elevator_bandwidth", "aileron_bandwidth", "rudder_bandwidth",
    "elevator_rate_limit", "aileron_rate_limit", "rudder_rate_limit",
    "elevator_limit", "aileron_limit", "rudder_limit",
)  # fmt: skip
"""Columns of the vehicle array; bandwidths in rad/s, infinite for a surface without actuator."""

(
    MASS, INERTIA_X, INERTIA_Y, INERTIA_Z, INERTIA_XZ,
    AREA, SPAN, CHORD, WIND_AXES,
    STALL_SHARPNESS, STALL_ANGLE,
    ELECTRIC, THRUST_MAX, DIAMETER, THRUST_0, THRUST_1, THRUST_2, TORQUE_0, TORQUE_1, TORQUE_2,
    MOTOR_CONSTANT, TORQUE_CONSTANT, RESISTANCE, NO_LOAD_CURRENT, VOLTAGE_MAX,
    IMU_X, IMU_Y, IMU_Z, VANE_X, VANE_Y, VANE_Z,
    BANDWIDTH, _, _, RATE_LIMIT, _, _, POSITION_LIMIT, _, _,
) = range(len(VEHICLE))  # fmt: skip

THRUST_TO_WEIGHT = 0.6
"""Full throttle of an aircraft whose file has no [propulsion], over its weight: an assumption."""

_PURPOSE = "simulation"


def coefficient_row(aircraft: Aircraft) -> NDArray[np.float64]:
    """The file's coefficients, shape (len(COEFFICIENTS),); AircraftDataError where the file has none."""
    return np.array([value for _, value in aircraft.need_coefficients(_PURPOSE).items()])


def vehicle_row(aircraft: Aircraft) -> NDArray[np.float64]:
    """The file's geometry, mass, propulsion, sensor places and actuators, shape (len(VEHICLE),).

    Raises:
        AircraftDataError: the file lacks [geometry], [mass] or [coefficients].
    """
    mass, geometry = aircraft.need_mass(_PURPOSE), aircraft.need_geometry(_PURPOSE)
    coefficients = aircraft.need_coefficients(_PURPOSE)
    stall = coefficients.stall
    actuators = [getattr(aircraft.actuators, name) for name in SURFACES]
    return np.array([
        mass.mass_kg, mass.inertia_x_kg_m2, mass.inertia_y_kg_m2, mass.inertia_z_kg_m2, mass.inertia_xz_kg_m2,
        geometry.wing_area_m2, geometry.span_m, geometry.mean_chord_m, float(coefficients.force_axes == "wind"),
        0.0 if stall is None else stall.sharpness, 0.0 if stall is None else stall.angle_rad,
        *_propulsion(aircraft, mass.mass_kg),
        *aircraft.sensors.imu_position_m, *aircraft.sensors.vane_position_m,
        *(_bandwidth_rad_s(a) for a in actuators),
        *(_limit(None if a is None else a.rate_limit_rad_s) for a in actuators),
        *(_limit(None if a is None else a.position_limit_rad) for a in actuators),
    ])  # fmt: skip


def _propulsion(aircraft: Aircraft, mass_kg: float) -> tuple[float, ...]:
    """From ``electric`` to ``voltage_max_v``; without [propulsion] thrust is throttle times a constant."""
    p = aircraft.propulsion
    if p is None:
        return (0.0, THRUST_TO_WEIGHT * mass_kg * GRAVITY_M_S2, *([1.0] * 12))
    return (
        1.0, 0.0, p.propeller_diameter_m, *p.thrust_coefficients, *p.torque_coefficients,
        p.motor_constant_v_s_rad, p.torque_constant_n_m_a, p.resistance_ohm, p.no_load_current_a, p.voltage_max_v,
    )  # fmt: skip


def _bandwidth_rad_s(actuator: Actuator | None) -> float:
    return math.inf if actuator is None else 2.0 * math.pi * actuator.bandwidth_hz


def _limit(value: float | None) -> float:
    return math.inf if value is None else value
