"""Surfaces against what they do: a positive deflection gives a negative response of its own axis (thesis 4.2.2).

    dq/dt = m_w W + m_q q + m_eta eta      dp/dt = l_p p + l_xi xi      dr/dt = n_v v + n_r r + n_zeta zeta

integrated over a span. Without manoeuvres the autopilot's reaction to gusts could pass for a response of the other
sign; what counts is therefore as large as the aircraft file's, many standard errors, and most of the motion.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.telemetry.plausibility.finding import Finding, Standing
from wingwatch.telemetry.plausibility.lines import Lines
from wingwatch.telemetry.plausibility.spans import Spans, regress

__all__ = ["response_findings"]

Array = NDArray[np.float64]

_SPAN_S = 0.2
_EXPLAINED, _TIMES, _SIZE = 0.4, 10.0, 0.3


@dataclass(frozen=True, slots=True)
class _Axis:
    """One surface: its channel, the rate it acts on, and what else moves that rate."""

    surface: str
    rate: str
    symbol: str
    beside: tuple[str, ...]


_AXES = (
    _Axis("elevator_rad", "pitch_rate_rad_s", "m_eta", ("angle_of_attack_rad",)),
    _Axis("aileron_rad", "roll_rate_rad_s", "l_xi", ("sideslip_rad", "yaw_rate_rad_s")),
    _Axis("rudder_rad", "yaw_rate_rad_s", "n_zeta", ("sideslip_rad", "roll_rate_rad_s", "aileron_rad")),
)


def response_findings(
    columns: Mapping[str, Array], kinds: Mapping[str, str], aircraft: Aircraft, lines: Lines
) -> list[Finding]:
    """Signs of the surfaces. The rates are right.

    Args:
        columns: finite, (n,) each.
        kinds: ``position`` or ``command`` of the surfaces.
        aircraft: whose effectiveness is known.
        lines: writes lines of the map.
    """
    spans = Spans.of(columns["time_s"], _SPAN_S)
    found: list[Finding] = []
    for axis in _AXES:
        if axis.surface not in columns:
            continue
        expected = _expected(axis, columns, aircraft)
        if expected < 0.0:
            found += _judged(axis, expected, columns, kinds, spans, lines)
    return found


def _judged(
    axis: _Axis, expected: float, columns: Mapping[str, Array], kinds: Mapping[str, str], spans: Spans, lines: Lines
) -> list[Finding]:
    parts = [spans.integral(columns[axis.surface]), spans.integral(columns[axis.rate]), spans.length_s]
    parts += [spans.integral(columns[name]) for name in axis.beside if name in columns]
    fit = regress(spans.change(columns[axis.rate]), parts, spans.groups)
    if fit is None or not np.isfinite(fit.value[0]):
        return []
    value, error = float(fit.value[0]), float(fit.standard_error[0])
    if abs(value) < _TIMES * error or abs(value) < _SIZE * abs(expected) or fit.explained < _EXPLAINED:
        return []
    said = f"{axis.symbol} by a first regression is {value:.3g} ± {error:.1g} 1/s2 ({expected:.3g} expected)"
    measured = (axis.surface, "response", value, error, "1/s2")
    if value < 0.0:
        return [Finding(Standing.RIGHT, *measured, said)]
    channel = _channel(axis.surface, kinds, lines)
    text = f"{said}: the sign of {channel} is turned"
    return [Finding(Standing.REFUSAL, *measured, text, lines.turned(channel))]


def _channel(surface: str, kinds: Mapping[str, str], lines: Lines) -> str:
    """The channel that the user gave: a surface known by its command may stand in the map under either name."""
    command = surface.removesuffix("_rad") + "_command_rad"
    return command if kinds.get(surface) == "command" and surface not in lines.entries else surface


def _expected(axis: _Axis, columns: Mapping[str, Array], aircraft: Aircraft) -> float:
    """The surface's effectiveness at the flight's airspeed, in 1/s2; 0 where the file does not say it."""
    mass, geometry, coefficients = aircraft.mass, aircraft.geometry, aircraft.coefficients
    if mass is None or geometry is None or coefficients is None:
        stated = [c.derivatives[axis.symbol].value for c in aircraft.conditions if axis.symbol in c.derivatives]
        return float(np.median(stated)) if stated else 0.0
    coefficient, length, inertia = {
        "m_eta": (coefficients.Cm.elevator, geometry.mean_chord_m, mass.inertia_y_kg_m2),
        "l_xi": (coefficients.Cl.aileron, geometry.span_m, mass.inertia_x_kg_m2),
        "n_zeta": (coefficients.Cn.rudder, geometry.span_m, mass.inertia_z_kg_m2),
    }[axis.symbol]
    density = columns.get("air_density_kg_m3")
    rho = 1.225 if density is None else float(np.median(density))
    pressure = 0.5 * rho * float(np.median(columns["airspeed_true_m_s"] ** 2))
    return float(pressure * geometry.wing_area_m2 * length * coefficient / inertia)
