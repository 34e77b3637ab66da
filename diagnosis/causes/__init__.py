"""Causes that compete to explain a misfit: one file a cause, named as in the vocabulary of causes."""

from wingwatch.diagnosis.candidate import Candidate, Subject
from wingwatch.diagnosis.causes import (
    actuator_backlash,
    actuator_lag,
    actuator_rate_limit,
    aileron_effectiveness,
    airspeed_error,
    cg_shift,
    derivative,
    downwash_lag,
    elevator_effectiveness,
    icing,
    incidence_nonlinearity,
    mass_inertia,
    pitch_damping,
    roll_yaw_coupling,
    rudder_effectiveness,
    sensor_bias,
    sensor_delay,
    sensor_position,
    sensor_scale,
    surface_offset,
    surface_stuck,
    thrust_effect,
    thrust_loss,
    vane_upwash,
    wing_damage,
)

__all__ = ["CAUSES", "candidates", "coefficients_of", "of_motion", "of_sensors"]

CAUSES = (
    actuator_backlash,
    actuator_lag,
    actuator_rate_limit,
    aileron_effectiveness,
    airspeed_error,
    cg_shift,
    derivative,
    downwash_lag,
    elevator_effectiveness,
    icing,
    incidence_nonlinearity,
    mass_inertia,
    pitch_damping,
    roll_yaw_coupling,
    rudder_effectiveness,
    sensor_bias,
    sensor_delay,
    sensor_position,
    sensor_scale,
    surface_offset,
    surface_stuck,
    thrust_effect,
    thrust_loss,
    vane_upwash,
    wing_damage,
)


def candidates(subject: Subject) -> list[Candidate]:
    """Every cause that this aircraft and flight can have."""
    return [candidate for cause in CAUSES for candidate in cause.candidates(subject)]


def coefficients_of(subject: Subject) -> list[Candidate]:
    """Every coefficient that the simulation has: derivatives, then constants and thrust."""
    return [c for cause in (derivative, pitch_damping, thrust_loss) for c in cause.candidates(subject)]


def of_motion(coefficient: Candidate) -> bool:
    """Whether one of ``coefficients_of`` is a derivative, not a constant of steady flight."""
    return coefficient.name == "pitch_damping" or coefficient.target in derivative.COEFFICIENT


def of_sensors(cause: Candidate) -> bool:
    """Whether a cause is how something is measured, not how the aircraft flies."""
    return cause.name.startswith("sensor_") or cause.name in ("vane_upwash", "airspeed_error")
