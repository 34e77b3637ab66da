"""Surfaces against what they do: a positive deflection gives a negative response of its own axis (thesis 4.2.2).

    dq/dt = m_w W + m_q q + m_eta eta      dp/dt = l_p p + l_xi xi      dr/dt = n_v v + n_r r + n_zeta zeta

integrated over a span. Without manoeuvres the autopilot's reaction to gusts could pass for a response of the other
sign; what counts is therefore a good part of what the aircraft file says, many standard errors, and a good part of the
motion. A surface that is shown late seems turned where the mode is quick, so it is tried at several delays.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.telemetry.plausibility.finding import Finding, Verdict
from wingwatch.telemetry.plausibility.lines import Lines
from wingwatch.telemetry.plausibility.spans import Fit, Spans, regress

__all__ = ["response_findings"]

Array = NDArray[np.float64]

_SPAN_S = 0.1
_EXPLAINED, _TIMES, _SIZE = 0.3, 8.0, 0.3
_LAGS_S = (-0.05, 0.0, 0.05, 0.1, 0.15, 0.2)
_RIVAL = 0.7
"""Fraction of what is explained at the best delay from which on another delay may be the right one."""


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
    columns: Mapping[str, Array],
    right: Collection[str],
    kinds: Mapping[str, str],
    aircraft: Aircraft,
    lines: Lines,
) -> list[Finding]:
    """Signs of the surfaces whose rates are known to be right.

    Args:
        columns: finite, (n,) each.
        right: rates that fit the attitude.
        kinds: ``position`` or ``command`` of the surfaces.
        aircraft: whose effectiveness is known.
        lines: writes lines of the map.
    """
    spans = Spans.of(columns["time_s"], _SPAN_S)
    found: list[Finding] = []
    for axis in _AXES:
        if axis.surface not in columns or axis.rate not in right:
            continue
        expected = _expected(axis, columns, aircraft)
        if expected < 0.0:
            found += _judged(axis, expected, columns, kinds, spans, lines)
    return found


def _judged(
    axis: _Axis,
    expected: float,
    columns: Mapping[str, Array],
    kinds: Mapping[str, str],
    spans: Spans,
    lines: Lines,
) -> list[Finding]:
    fits = [fit for lag_s in _LAGS_S if (fit := _fit(axis, columns, spans, lag_s)) is not None]
    if not fits:
        return []
    fit = max(fits, key=lambda one: one.explained)
    rivals = [one for one in fits if one.explained > _RIVAL * fit.explained]
    if len({float(np.sign(one.value[0])) for one in rivals}) > 1:
        return []
    value, error = float(fit.value[0]), float(fit.standard_error[0])
    if abs(value) < _TIMES * error or abs(value) < _SIZE * abs(expected) or fit.explained < _EXPLAINED:
        return []
    said = f"{axis.symbol} by a first regression is {value:.3g} ± {error:.1g} 1/s2 ({expected:.3g} expected)"
    measured = (axis.surface, "response", value, error, "1/s2")
    if value < 0.0:
        return [Finding(Verdict.RIGHT, *measured, said)]
    channel = _channel(axis.surface, kinds, lines)
    text = f"{said}: the sign of {channel} is turned"
    return [Finding(Verdict.REFUSAL, *measured, text, lines.turned(channel))]


def _fit(axis: _Axis, columns: Mapping[str, Array], spans: Spans, lag_s: float) -> Fit | None:
    """The regression with the surface as it is shown ``lag_s`` later."""
    time_s, surface = columns["time_s"], columns[axis.surface]
    earlier = surface if lag_s == 0.0 else np.interp(time_s + lag_s, time_s, surface)
    parts = [spans.integral(earlier), spans.integral(columns[axis.rate]), spans.length_s]
    parts += [spans.integral(columns[name]) for name in axis.beside if name in columns]
    fit = regress(spans.change(columns[axis.rate]), parts, spans.groups)
    return fit if fit is not None and np.isfinite(fit.value[0]) else None


def _channel(surface: str, kinds: Mapping[str, str], lines: Lines) -> str:
    """The channel that the user gave: a surface known by its command may stand in the map under either name."""
    command = surface.removesuffix("_rad") + "_command_rad"
    return command if kinds.get(surface) == "command" and surface not in lines.entries else surface


def _expected(axis: _Axis, columns: Mapping[str, Array], aircraft: Aircraft) -> float:
    """The surface's effectiveness at the flight's airspeed, in 1/s2; 0 where the file does not say it."""
    mass, geometry, coefficients = aircraft.mass, aircraft.geometry, aircraft.coefficients
    if mass is None or geometry is None or coefficients is None:
        stated = [
            c.derivatives[axis.symbol].value for c in aircraft.conditions if axis.symbol in c.derivatives
        ]
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
