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
    thrust_effect,
    thrust_loss,
    vane_upwash,
    wing_damage,
)

__all__ = ["CAUSES", "candidates"]

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
    thrust_effect,
    thrust_loss,
    vane_upwash,
    wing_damage,
)


def candidates(subject: Subject) -> list[Candidate]:
    """Every cause that this aircraft and flight can have."""
    return [candidate for cause in CAUSES for candidate in cause.candidates(subject)]
