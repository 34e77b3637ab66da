"""Coefficients, derivatives and their stated errors that are unlike an aeroplane's: signs, sizes, degrees."""

import math
from collections.abc import Iterator, Mapping
from functools import cache

from wingwatch.aircraft.aerodynamics import aspect_ratio
from wingwatch.aircraft.aircraft_file import Aircraft, ConditionEntry, Provenance
from wingwatch.aircraft.coefficients import Coefficients
from wingwatch.aircraft.empirical import ERRORS_BY_TAIL, wing_lift_slope
from wingwatch.aircraft.loading import library_names, load_aircraft
from wingwatch.aircraft.plausible_finding import DEGREES, FileFinding
from wingwatch.aircraft.uncertainty import coefficient_standard_error
from wingwatch.aircraft.vocabulary import DERIVATIVES

__all__ = ["coefficient_findings", "condition_findings", "error_findings"]

_SLIP = math.sqrt(DEGREES)
"""Further than this from every aircraft of the library a coefficient is nearer to one in the wrong unit of angle."""
_LEAST_ERROR = 0.01
"""Of a derivative; sizes are known to a percent at best
(docs/decisions/0058-sizes-are-stated-to-a-percent-at-best.md)."""
_SLOPE_ERRORS = 3.0
"""Standard errors of lifting-line theory that a lift slope may be off it."""

_SIGNED: Mapping[str, tuple[int, str]] = {
    "Cm_alpha": (-1, "it diverges in pitch; is the centre of gravity too far aft, or nose up counted negative?"),
    "Cn_beta": (1, "the aircraft turns away from the wind; is sideslip counted from the left, or nose left positive?"),
    "Cl_beta": (-1, "sideslip rolls it into the wind (anhedral); is that so, or is a sign turned?"),
    "CY_beta": (-1, "side force drives it into the wind; is sideslip counted from the left?"),
    "Cl_p": (-1, "roll is not damped; below the stall every wing damps it"),
    "Cm_q": (-1, "pitch rate is not damped; is nose up counted negative?"),
    "Cn_r": (-1, "yaw rate is not damped; is nose left counted positive?"),
    "Cm_elevator": (-1, "trailing edge down must pitch the nose down; turn the signs of all coefficients by elevator"),
    "Cl_aileron": (-1, "the right trailing edge down must roll left; turn the signs of all coefficients by aileron"),
    "Cn_rudder": (-1, "the trailing edge left must yaw left; turn the signs of all coefficients by rudder"),
}  # fmt: skip
"""Sign of a stable aeroplane in this project's convention, and what another sign means."""
_KINEMATIC: Mapping[str, int] = {"z_q": 1, "y_r": -1}
_KINEMATIC_RANGE = (0.7, 1.3)
"""z_q and -y_r over the forward velocity: 1 but for mean chord or span times a derivative over the mass."""
_STATIC_MARGIN_KEY = "static margin, -Cm.alpha / CL.alpha less cg_shift_m over the chord"


@cache
def _library() -> Mapping[str, tuple[float, float]]:
    """Smallest and largest size of each coefficient that an aircraft of the library states, of those that are not 0."""
    sizes: dict[str, list[float]] = {}
    for name in library_names():
        c = load_aircraft(name).coefficients
        for key, value in c.items() if c is not None else ():
            if value != 0.0:
                sizes.setdefault(key, []).append(abs(value))
    return {key: (min(values), max(values)) for key, values in sizes.items()}


def coefficient_findings(aircraft: Aircraft) -> Iterator[FileFinding]:
    """Signs and sizes of [coefficients], each in its place."""
    c = aircraft.coefficients
    if c is None:
        return
    yield from _stability(aircraft, c)
    for name, value in c.items():
        key = "coefficients." + name.replace("_", ".", 1)
        if name in ("CL_alpha", "CD_oswald") or name.endswith(("_zero", "_CL_at_min")) or value == 0.0:
            continue
        sign, meaning = _SIGNED.get(name, (0, ""))
        least, most = (
            x * f for x, f in zip(_library().get(name, (0.0, math.inf)), (1 / _SLIP, _SLIP), strict=True)
        )
        if name not in _SIGNED and name != "CD_min":
            least = 0.0  # weak: often printed as next to nothing
        if sign and value * sign < 0.0:
            text = f"{key} is {value:.4g}, usual is {'above' if sign > 0 else 'below'} 0: {meaning}"
            low, high = (0.0, math.inf) if sign > 0 else (-math.inf, 0.0)
            yield FileFinding(f"sign_of_{name}", key, value, "", low, high, "warning", text)
        elif not least <= abs(value) <= most:
            yield _size(name, key, value, (least, most))


def _size(name: str, key: str, value: float, usual: tuple[float, float]) -> FileFinding:
    least, most = usual
    low, high = (least, most) if value > 0.0 else (-most, -least)
    do = f"check it; the library's aircraft reach from {least * _SLIP:.3g} to {most / _SLIP:.3g} in size"
    if least <= abs(value) * DEGREES <= most:
        do = f"it looks as if it were per degree; times {DEGREES:.4g} it is {value * DEGREES:.4g} per rad"
    elif least <= abs(value) / DEGREES <= most:
        do = f"it looks as if it had been converted twice; over {DEGREES:.4g} it is {value / DEGREES:.4g} per rad"
    if name in ("Cm_q", "Cn_r") and abs(value) < least:
        do += ", but an aircraft without a tail has little"
    text = f"{key} is {value:.4g}, usual is {low:.3g} to {high:.3g}: {do}"
    return FileFinding(f"size_of_{name}", key, value, "", low, high, "warning", text)


def _stability(aircraft: Aircraft, c: Coefficients) -> Iterator[FileFinding]:
    geometry = aircraft.geometry
    if geometry is None:
        return
    margin = -c.Cm.alpha / c.CL.alpha - aircraft.cg_shift_m / geometry.mean_chord_m
    if margin <= 0.0 and c.Cm.alpha < 0.0:
        do = "the centre of gravity is behind the neutral point"
        text = f"{_STATIC_MARGIN_KEY}, is {margin:.3g}, usual is above 0: {do}"
        yield FileFinding("static_margin", "mass.cg_shift_m", margin, "", 0.0, math.inf, "warning", text)
    aspect = aspect_ratio(geometry.span_m, geometry.wing_area_m2)
    expected, spread = wing_lift_slope(aspect), _SLOPE_ERRORS * ERRORS_BY_TAIL[False]["CL_alpha"]
    do = f"lifting-line theory gives {expected:.3g} for an aspect ratio of {aspect:.3g}"
    if abs(c.CL.alpha * DEGREES / expected - 1.0) <= spread:
        do += f"; it looks as if it were per degree, {c.CL.alpha * DEGREES:.3g} per rad"
    usual = (max(0.0, 1.0 - spread) * expected, (1.0 + spread) * expected)
    found = FileFinding.outside("lift_slope", "coefficients.CL.alpha", c.CL.alpha, usual, do)
    if found is not None:
        yield found


def condition_findings(aircraft: Aircraft) -> Iterator[FileFinding]:
    """Signs of the derivatives of [[conditions]], and the kinematic part of z_q and y_r."""
    for i, entry in enumerate(aircraft.conditions):
        for symbol, derivative in entry.derivatives.items():
            key, unit = f"conditions.{i}.derivatives.{symbol}", _unit(symbol)
            sign = DERIVATIVES[symbol].sign if symbol in DERIVATIVES else 0
            if sign and derivative.value * sign < 0.0:
                bound = "above" if sign > 0 else "below"
                text = (
                    f"{key} is {derivative.value:.4g} {unit}, usual is {bound} 0: {_meaning(symbol)} "
                    "(docs/conventions.md)"
                )
                low, high = (0.0, math.inf) if sign > 0 else (-math.inf, 0.0)
                yield FileFinding(
                    f"sign_of_{symbol}", key, derivative.value, unit, low, high, "warning", text
                )
            if symbol in _KINEMATIC:
                yield from _kinematic(entry, symbol, key)


def _unit(symbol: str) -> str:
    return DERIVATIVES[symbol].unit if symbol in DERIVATIVES else ""


def _meaning(symbol: str) -> str:
    surface = {"eta": "elevator", "xi": "aileron", "zeta": "rudder"}.get(symbol.split("_")[1])
    if surface is not None:
        return (
            f"a positive {surface} gives a negative response; turn the signs of all derivatives by {surface}"
        )
    return "unstable or undamped, or a turned sign"


def _kinematic(entry: ConditionEntry, symbol: str, key: str) -> Iterator[FileFinding]:
    forward = _KINEMATIC[symbol] * entry.condition.forward_velocity_m_s
    ratio = entry.derivatives[symbol].value / forward
    do = f"it holds the forward velocity of {forward:.4g} m/s itself; is airspeed_true_m_s in m/s, true, not indicated?"
    found = FileFinding.outside(
        "kinematic_part", f"{key} over the forward velocity", ratio, _KINEMATIC_RANGE, do
    )
    if found is not None:
        yield found


def error_findings(aircraft: Aircraft) -> Iterator[FileFinding]:
    """Standard errors that claim to know what nobody knows before a flight."""
    c = aircraft.coefficients
    for name, value in c.items() if c is not None else ():
        error = 0.0 if c is None else coefficient_standard_error(c, name)
        if value != 0.0 and error < _LEAST_ERROR * abs(value):
            key = f"coefficients.relative_standard_error.{name}"
            yield _too_sure(key, error / abs(value))
    for i, entry in enumerate(aircraft.conditions):
        for symbol, derivative in entry.derivatives.items():
            if entry.provenance is Provenance.IDENTIFIED or symbol in _KINEMATIC or derivative.value == 0.0:
                continue
            if derivative.standard_error < _LEAST_ERROR * abs(derivative.value):
                ratio = derivative.standard_error / abs(derivative.value)
                yield _too_sure(f"conditions.{i}.derivatives.{symbol}.standard_error", ratio)


def _too_sure(key: str, ratio: float) -> FileFinding:
    do = "nothing is known that well before a flight, and every flight would look damaged; state an honest error"
    text = f"{key} is {ratio:.3g} of the value, usual is at least {_LEAST_ERROR:g}: {do}"
    return FileFinding("standard_error", key, ratio, "", _LEAST_ERROR, math.inf, "warning", text)
