"""The angle of attack of steady flight where an aircraft file of derivatives does not state it: that of the record.

A derivative such as y_p = W + ... holds at a steady flight's W = V sin(alpha). A condition without
``angle_of_attack_rad`` would be at alpha = 0, and W of the flight would pass for an error of the derivative.
"""

import numpy as np

from wingwatch.aircraft import Aircraft, ConditionEntry
from wingwatch.diagnosis.measured import OUTPUTS, MeasuredFlight

__all__ = ["steady_angle_rad", "unstated", "with_steady_angle"]

_AIRSPEED, _PITCH, _VANE = (
    OUTPUTS.index(name) for name in ("airspeed_true_m_s", "pitch_rad", "angle_of_attack_rad")
)


def unstated(entry: ConditionEntry) -> bool:
    """Whether a condition leaves out its angle of attack."""
    return "angle_of_attack_rad" not in entry.model_fields_set


def steady_angle_rad(flight: MeasuredFlight) -> tuple[float, str]:
    """Median angle of attack of a flight's windows, rad, and what it is from, in words.

    That of the vane; where there is none, of pitch angle less climb angle, the climb by the altitude of each window.
    """
    rows = np.concatenate([np.arange(w.start, w.stop) for w in flight.windows])
    vane = flight.outputs[rows, _VANE]
    vane = vane[np.isfinite(vane)]
    if vane.size:
        return float(np.median(vane)), "median of the vane"
    pitch, speed = flight.outputs[rows, _PITCH], flight.outputs[rows, _AIRSPEED]
    climbs = [
        np.full(
            w.stop - w.start,
            np.polyfit(np.arange(w.stop - w.start), flight.altitude_m[w.start : w.stop], 1)[0],
        )
        for w in flight.windows
    ]
    climb_m_s = np.concatenate(climbs) / flight.dt_s
    angle = pitch - np.arcsin(np.clip(climb_m_s / speed, -1.0, 1.0))
    return float(np.median(angle[np.isfinite(angle)])), "median of pitch less climb angle"


def with_steady_angle(aircraft: Aircraft, flight: MeasuredFlight) -> Aircraft:
    """The aircraft with the flight's angle of attack in conditions that state none; itself where all do."""
    if aircraft.coefficients is not None or not any(map(unstated, aircraft.conditions)):
        return aircraft
    angle, _ = steady_angle_rad(flight)
    conditions = tuple(
        entry.model_copy(update={"angle_of_attack_rad": angle}) if unstated(entry) else entry
        for entry in aircraft.conditions
    )
    return aircraft.model_copy(update={"conditions": conditions})
