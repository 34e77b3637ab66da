"""Lift against angle of attack and airspeed, yawing against sideslip.

Below the stall lift grows with the angle of attack, in gusts as in manoeuvres, of any aircraft; what it is at a given
airspeed and angle is the aircraft file's.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.telemetry.plausibility.airspeed_units import unit_of_airspeed
from wingwatch.telemetry.plausibility.finding import Finding, Verdict
from wingwatch.telemetry.plausibility.lines import Lines
from wingwatch.telemetry.plausibility.spans import Spans, regress

__all__ = ["lift_findings"]

Array = NDArray[np.float64]

_SPAN_S = 0.4
_ALPHA = "angle_of_attack_rad"
_EXPLAINED, _TIMES = 0.5, 10.0
_LIFT_ERROR = 0.1
"""Of the airspeed that lift needs, relative: angle of attack, lift coefficient and mass are known no better."""
_LIFT_NEAR = 0.2
_PARTS = 4
"""Parts of the flight that must need the same airspeed."""
_LEAST_LIFT = 0.1
_LEAST_SPEED = 0.2
"""Fraction of the median airspeed below which rows do not count."""


def lift_findings(columns: Mapping[str, Array], aircraft: Aircraft | None, lines: Lines) -> list[Finding]:
    """Sign of the vane of angle of attack, and, with an aircraft, unit of the airspeed.

    Args:
        columns: finite, (n,) each, vane and density among them.
        aircraft: whose lift is known, or None.
        lines: writes lines of the map.
    """
    if _ALPHA not in columns:
        return []
    speed = columns["airspeed_true_m_s"]
    usual = float(np.median(speed))
    if not usual > 1.0 or float(np.mean(speed < _LEAST_SPEED * usual)) > 0.01:
        return []
    pressure = (np.maximum(speed, _LEAST_SPEED * usual) / usual) ** 2
    spans = Spans.of(columns["time_s"], _SPAN_S)
    lift = spans.mean(-columns["specific_force_z_m_s2"] / pressure)
    alpha = spans.mean(columns[_ALPHA])
    found = _sign(lift, alpha, spans, lines)
    if any(one.standing is Verdict.REFUSAL for one in found) or aircraft is None:
        return found
    return [*found, *_airspeed(columns, aircraft, lines)]


def _sign(lift: Array, alpha: Array, spans: Spans, lines: Lines) -> list[Finding]:
    """In changes from one span to the next, so that slow errors of airspeed and bank do not count."""
    fit = regress(np.diff(lift), [np.diff(alpha)], spans.groups[1:])
    if fit is None or fit.explained < _EXPLAINED or abs(fit.value[0]) < _TIMES * fit.standard_error[0]:
        return []
    slope, error = float(fit.value[0]), float(fit.standard_error[0])
    said = f"specific force of the lift by {_ALPHA} is {slope:.3g} ± {error:.1g} m/s2 per rad"
    measured = (_ALPHA, "lift slope", slope, error, "m/s2/rad")
    if slope < 0.0:
        text = f"{said}: the sign of {_ALPHA} is turned"
        return [Finding(Verdict.REFUSAL, *measured, text, lines.turned(_ALPHA))]
    return [Finding(Verdict.RIGHT, *measured, said)]


def _airspeed(columns: Mapping[str, Array], aircraft: Aircraft, lines: Lines) -> list[Finding]:
    """The factor from the recorded airspeed to the one that carries the weight at this angle of attack."""
    mass, geometry, coefficients = aircraft.mass, aircraft.geometry, aircraft.coefficients
    density = columns.get("air_density_kg_m3")
    if mass is None or geometry is None or coefficients is None or density is None:
        return []
    lift = coefficients.CL.zero + coefficients.CL.alpha * columns[_ALPHA]
    carried = -columns["specific_force_z_m_s2"] * mass.mass_kg
    made = 0.5 * density * columns["airspeed_true_m_s"] ** 2 * geometry.wing_area_m2 * lift
    parts = [
        (float(np.median(one)), float(np.median(other)))
        for one, other in zip(np.array_split(carried, _PARTS), np.array_split(made, _PARTS), strict=True)
    ]
    if any(one <= 0.0 or other <= 0.0 for one, other in parts) or float(np.median(lift)) < _LEAST_LIFT:
        return []
    factors = np.sqrt([one / other for one, other in parts])
    factor = float(np.median(factors))
    if float(np.ptp(factors)) > 2.0 * _LIFT_ERROR * factor:  # a fault that came in flight is no unit
        return []
    return unit_of_airspeed(factor, _LIFT_ERROR * factor, "lift", lines, _LIFT_NEAR)
