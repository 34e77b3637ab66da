"""Attitude against the rates: its slope by them is 1 where both are in rad and positive the same way.

    roll' = p + tan(theta) (q sin(phi) + r cos(phi))      pitch' = q cos(phi) - r sin(phi)
    heading' = (r cos(phi) + q sin(phi)) / cos(theta)

Each is integrated over a span; the other axis has a coefficient of its own, so that its unit does not matter. A rate
that comes late shows its change over the span, with the lag as coefficient.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.telemetry.plausibility.finding import Finding, Verdict
from wingwatch.telemetry.plausibility.lines import Lines
from wingwatch.telemetry.plausibility.spans import Spans, regress

__all__ = ["attitude_findings"]

Array = NDArray[np.float64]

_SPAN_S = 0.4
_DEG = 180.0 / np.pi
_NEAR = 1.3
"""Factor by which a slope may be off one of those that stand for a unit or a sign."""
_OFF = 1.6
"""Factor from 1 from which on a slope that stands for nothing is doubtful."""
_KNOWN = 0.1
"""Largest standard error relative to the slope where something is decided."""
_EXPLAINED = 0.1
_LATE_S = 0.03
_TIMES = 6.0
_ALIKE, _UNLIKE = 0.8, 0.2
"""Fractions of an attitude's changes that another rate explains and its own one does not, where axes are exchanged."""

_PATH_S, _LEAST_SPANS, _TOGETHER = 4.0, 8, 0.5
"""Spans in which the path flown says which of attitude and rate has the wrong sign, and the correlation that does."""

_RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
_PAIRS = (("roll_rad", _RATES[0]), ("pitch_rad", _RATES[1]), ("heading_rad", _RATES[2]))


@dataclass(frozen=True, slots=True)
class _Slope:
    """One attitude against its rate."""

    attitude: str
    rate: str
    slope: float
    error: float
    lag_s: float
    lag_error_s: float
    explained: float


def attitude_findings(
    columns: Mapping[str, Array], lines: Lines, stated_delay_s: Mapping[str, float]
) -> list[Finding]:
    """Unit, sign, axis and lag of the rates.

    Args:
        columns: finite, (n,) each, roll and heading unwrapped; ``heading_rad`` may be missing.
        lines: writes lines of the map.
        stated_delay_s: by channel, what the aircraft file states.
    """
    spans = Spans.of(columns["time_s"], _SPAN_S)
    found: list[Finding] = []
    for attitude, rate in _PAIRS:
        if attitude not in columns:
            continue
        if other := _exchanged(columns, spans, attitude, rate):
            text = f"{attitude} follows {other} and not {rate}: two axes are exchanged"
            line = lines.from_source_of(rate, other)
            found.append(Finding(Verdict.REFUSAL, rate, "axis", np.nan, np.nan, "", text, line))
            continue
        slope = _slope(columns, spans, attitude, rate)
        if slope is not None:
            found += _judged(slope, columns, lines, stated_delay_s)
    if "heading_rad" not in columns and (slope := _slope(columns, spans, "pitch_rad", _RATES[2])) is not None:
        only_unit = replace(slope, lag_error_s=np.inf)
        found += [
            one
            for one in _judged(only_unit, columns, lines, stated_delay_s)
            if one.channel == _RATES[2] and one.standing is not Verdict.WARNING
        ]
    return found


def _regressors(columns: Mapping[str, Array], attitude: str) -> tuple[Array, Array]:
    """What an attitude's rate is made of: by its own rate, and by the others."""
    p, q, r = (columns[name] for name in _RATES)
    sin, cos = np.sin(columns["roll_rad"]), np.cos(columns["roll_rad"])
    if attitude == "roll_rad":
        return p, np.tan(columns["pitch_rad"]) * (q * sin + r * cos)
    if attitude == "pitch_rad":
        return q * cos, -r * sin
    return r * cos / np.cos(columns["pitch_rad"]), q * sin / np.cos(columns["pitch_rad"])


def _slope(columns: Mapping[str, Array], spans: Spans, attitude: str, rate: str) -> _Slope | None:
    own, others = _regressors(columns, attitude)
    # in turns pitch says of the yaw rate what heading would
    if attitude == "pitch_rad" and rate == _RATES[2]:
        own, others = others, own
    parts = [spans.integral(own), spans.change(own), spans.integral(others), spans.length_s]
    fit = regress(spans.change(columns[attitude]), parts, spans.groups)
    if fit is None or not np.isfinite(fit.value[:2]).all() or fit.value[0] == 0.0:
        return None
    slope = float(fit.value[0])
    lag, lag_error = -fit.value[1] / slope, fit.standard_error[1] / abs(slope)
    return _Slope(
        attitude, rate, slope, float(fit.standard_error[0]), float(lag), float(lag_error), fit.explained
    )


def _exchanged(columns: Mapping[str, Array], spans: Spans, attitude: str, rate: str) -> str:
    """The rate that an attitude follows in place of its own; empty where it follows its own or none."""
    change = spans.change(columns[attitude])
    explained = {}
    for name in _RATES:
        fit = regress(change, [spans.integral(columns[name]), spans.length_s], spans.groups)
        explained[name] = 0.0 if fit is None else fit.explained
    best = max(explained, key=lambda name: explained[name])
    return best if explained[best] > _ALIKE and explained[rate] < _UNLIKE else ""


def _judged(
    s: _Slope, columns: Mapping[str, Array], lines: Lines, stated_s: Mapping[str, float]
) -> list[Finding]:
    known = s.error < _KNOWN * abs(s.slope) and s.explained > _EXPLAINED
    if not known:
        return []
    said = f"slope of {s.attitude} by {s.rate} is {s.slope:.3g} ± {s.error:.1g} (1 is right)"
    size, sign = abs(s.slope), np.sign(s.slope)
    turned = sign < 0.0
    measured = (s.slope, s.error, "")
    refused = (Verdict.REFUSAL, "slope")
    if _close(size, 1.0 / _DEG):
        line = lines.in_unit(s.rate, "deg/s", float(sign))
        text = f"{said}: {s.rate} is in deg/s" + (" and its sign is turned" if turned else "")
        return [Finding(refused[0], s.rate, refused[1], *measured, text, line)]
    if _close(size, _DEG):
        in_degrees = lines.entry(s.rate).unit == "deg/s"
        channel, unit = (s.rate, "rad/s") if in_degrees else (s.attitude, "deg")
        text = f"{said}: {channel} is in {unit}" + (" and its sign is turned" if turned else "")
        return [
            Finding(
                refused[0], channel, refused[1], *measured, text, lines.in_unit(channel, unit, float(sign))
            )
        ]
    if turned and size < _OFF and size > 1.0 / _OFF:
        channel = _turned(columns, s)
        doubt = "" if channel else f", or that of {s.attitude}: the flight does not say which"
        channel = channel or s.rate
        text = f"{said}: the sign of {channel} is turned{doubt}"
        return [Finding(refused[0], channel, refused[1], *measured, text, lines.turned(channel))]
    if turned or not 1.0 / _OFF < size < _OFF:
        return [Finding(Verdict.WARNING, s.rate, "slope", *measured, f"{said}: they do not fit")]
    return [Finding(Verdict.RIGHT, s.rate, "slope", *measured, said), *_lag(s, lines, stated_s)]


def _lag(s: _Slope, lines: Lines, stated_s: Mapping[str, float]) -> list[Finding]:
    """An attitude that comes later than its rate, or earlier."""
    lag_s = s.lag_s - stated_s.get(s.attitude, 0.0) + stated_s.get(s.rate, 0.0)
    if abs(lag_s) < _LATE_S or abs(lag_s) < _TIMES * s.lag_error_s:
        return []
    late, other = (s.attitude, s.rate) if lag_s > 0.0 else (s.rate, s.attitude)
    text = (
        f"{late} comes {1e3 * abs(lag_s):.0f} ± {1e3 * s.lag_error_s:.0f} ms later than {other} "
        "(a low-pass filter, or a delay)"
    )
    line = lines.earlier(late, abs(lag_s))
    return [Finding(Verdict.WARNING, late, "lag", abs(lag_s), s.lag_error_s, "s", text, line)]


def _close(size: float, wanted: float) -> bool:
    return 1.0 / _NEAR < size / wanted < _NEAR


def _turned(columns: Mapping[str, Array], s: _Slope) -> str:
    """Which of attitude and rate has the wrong sign, by the path flown: an aircraft turns to where it banks, and its
    path bends as it pitches, -V q = a_z + g cos(theta) cos(phi). Empty where the flight does not say."""
    spans = Spans.of(columns["time_s"], _PATH_S)
    if len(spans.first) < _LEAST_SPANS:
        return ""
    if s.attitude == "pitch_rad" and s.rate == _RATES[2]:
        return s.rate
    if s.attitude == "pitch_rad":
        weight = GRAVITY_M_S2 * np.cos(columns["pitch_rad"]) * np.cos(columns["roll_rad"])
        bent = -spans.integral(columns["specific_force_z_m_s2"] + weight)
        together = _correlation(spans.integral(columns["pitch_rate_rad_s"]), bent)
        rate_is_right, attitude_is_right = together > _TOGETHER, together < -_TOGETHER
    else:
        bank, turn = spans.integral(np.sin(columns["roll_rad"])), spans.integral(columns["yaw_rate_rad_s"])
        together = _correlation(bank, turn)
        fits, contradicts = together > _TOGETHER, together < -_TOGETHER
        by_yaw = s.attitude == "heading_rad"
        rate_is_right, attitude_is_right = (fits, contradicts) if by_yaw else (contradicts, fits)
    return s.attitude if rate_is_right else s.rate if attitude_is_right else ""


def _correlation(one: Array, other: Array) -> float:
    spread = float(np.std(one) * np.std(other))
    return float(np.mean((one - one.mean()) * (other - other.mean())) / spread) if spread > 0.0 else 0.0
