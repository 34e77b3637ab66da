"""Which causes compete to explain a change, and what may be wrong with the reference all the time."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import coefficient_standard_error
from wingwatch.diagnosis.candidate import Candidate, Subject
from wingwatch.diagnosis.causes import candidates, coefficients_of, of_motion
from wingwatch.diagnosis.causes.derivative import COEFFICIENT

__all__ = ["competing", "reference_errors", "reference_spread"]

Array = NDArray[np.float64]

_IN_FLIGHT = (
    "actuator_lag", "aileron_effectiveness", "airspeed_error", "cg_shift", "elevator_effectiveness", "icing",
    "mass_inertia", "rudder_effectiveness", "sensor_bias", "sensor_delay", "sensor_scale", "surface_offset",
    "surface_stuck", "thrust_loss", "wing_damage",
)  # fmt: skip
"""Causes that can befall an aircraft in flight. The others say what a file describes wrongly at all times."""

_SEVERAL_CHANNELS = ("inertial", "imu", "vanes")
"""Targets of ``sensor_delay`` that are no channel: what a file states wrongly, not what fails in flight."""


def competing(subject: Subject) -> list[Candidate]:
    """Causes that may have begun in flight, as far as this aircraft and its channels show them."""
    return [c for c in candidates(subject) if c.name in _IN_FLIGHT and c.target not in _SEVERAL_CHANNELS]


def reference_errors(subject: Subject) -> list[Candidate]:
    """What the simulation may have wrong before and after: every coefficient, and constant errors of sensors."""
    biases = [c for c in candidates(subject) if c.name == "sensor_bias"]
    return [*coefficients_of(subject), *biases]


def reference_spread(subject: Subject, errors: list[Candidate]) -> Array:
    """Standard deviation of each of ``reference_errors`` beforehand, as the aircraft file states it, (errors,)."""
    return np.array([_spread(subject, one) for one in errors])


def _spread(subject: Subject, one: Candidate) -> float:
    parameter = one.parameters[0]
    if subject.stated.coefficients is None or not of_motion(one):
        return parameter.spread
    name = "Cm_q" if one.name == "pitch_damping" else COEFFICIENT[one.target]
    stated = coefficient_standard_error(subject.stated.coefficients, name)
    changed = subject.model.copy()
    one.change(changed, np.ones(1))
    unit = float(np.abs(changed.row - subject.model.row).max())
    return max(stated / unit, parameter.least) if unit > 0.0 else parameter.spread
