"""Units that logs use, and their way to the unit of a flight-table channel: SI, for latitude and longitude degrees."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

from wingwatch.aircraft.atmosphere import GRAVITY_M_S2

__all__ = ["Unit", "SERVO_UNITS", "UNITS", "allowed_units", "known_unit", "unit_in_brackets", "units_of"]


@dataclass(frozen=True, slots=True)
class Unit:
    """``SI value = factor * value + offset``.

    Attributes:
        si: the channel's unit it converts to, as ``Channel.unit`` prints it.
        factor: exact by definition of the unit, or the standard's value.
        offset: in the SI unit; other than 0 only for temperatures.
    """

    si: str
    factor: float
    offset: float = 0.0


_FOOT_M = 0.3048
_NAUTICAL_MILE_M = 1852.0
_STATUTE_MILE_M = 1609.344
_DEGREE_RAD = pi / 180.0
_SLUG_PER_FT3_KG_M3 = 14.593902937 / _FOOT_M**3

UNITS: Mapping[str, Unit] = {
    "s": Unit("s", 1.0),
    "ms": Unit("s", 1e-3),
    "us": Unit("s", 1e-6),
    "ns": Unit("s", 1e-9),
    "min": Unit("s", 60.0),
    "m/s": Unit("m/s", 1.0),
    "cm/s": Unit("m/s", 0.01),
    "km/h": Unit("m/s", 1.0 / 3.6),
    "kt": Unit("m/s", _NAUTICAL_MILE_M / 3600.0),
    "mph": Unit("m/s", _STATUTE_MILE_M / 3600.0),
    "ft/s": Unit("m/s", _FOOT_M),
    "ft/min": Unit("m/s", _FOOT_M / 60.0),
    "rad/s": Unit("rad/s", 1.0),
    "deg/s": Unit("rad/s", _DEGREE_RAD),
    "m/s2": Unit("m/s2", 1.0),
    "g": Unit("m/s2", GRAVITY_M_S2),
    "ft/s2": Unit("m/s2", _FOOT_M),
    "rad": Unit("rad", 1.0),
    "deg": Unit("rad", _DEGREE_RAD),
    "m": Unit("m", 1.0),
    "km": Unit("m", 1000.0),
    "cm": Unit("m", 0.01),
    "mm": Unit("m", 0.001),
    "ft": Unit("m", _FOOT_M),
    "kg/m3": Unit("kg/m3", 1.0),
    "g/cm3": Unit("kg/m3", 1000.0),
    "slug/ft3": Unit("kg/m3", _SLUG_PER_FT3_KG_M3),
    "K": Unit("K", 1.0),
    "degC": Unit("K", 1.0, 273.15),
    "degF": Unit("K", 5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0),
    "1": Unit("", 1.0),
    "%": Unit("", 0.01),
}
"""Every unit with a fixed way to SI, by the name a channel map writes."""

_OF_DEGREES: Mapping[str, Unit] = {"deg": Unit("deg", 1.0), "rad": Unit("deg", 1.0 / _DEGREE_RAD)}
"""Units of latitude and longitude, which the flight table has in degrees."""

SERVO_UNITS = ("norm", "pwm")
"""Servo signals: their way to an angle is the aircraft's own (neutral, span, deflection at full travel)."""


def units_of(si: str) -> Mapping[str, Unit]:
    """The units with a fixed way to a channel's unit, by name."""
    return _OF_DEGREES if si == "deg" else {name: unit for name, unit in UNITS.items() if unit.si == si}


def allowed_units(si: str) -> tuple[str, ...]:
    """Names of the units that convert to a channel's unit, servo signals among them for angles and fractions."""
    return tuple(units_of(si)) + (SERVO_UNITS if si in ("rad", "") else ())


_SPELLINGS: Mapping[str, tuple[str, ...]] = {
    "s": ("sec", "secs", "second", "seconds"),
    "ms": ("msec", "millisecond", "milliseconds"),
    "us": ("µs", "μs", "usec", "microsecond", "microseconds"),
    "ns": ("nsec", "nanosecond", "nanoseconds"),
    "min": ("minute", "minutes"),
    "m/s": ("mps", "m s-1", "m s^-1", "meter/s", "meters/s", "m/sec"),
    "cm/s": ("cm/sec",),
    "km/h": ("kph", "kmh", "km/hr"),
    "kt": ("kts", "kn", "knot", "knots"),
    "mph": ("mi/h",),
    "ft/s": ("fps", "ft/sec"),
    "ft/min": ("fpm",),
    "rad/s": ("rad/sec", "rad s-1", "rad s^-1", "rads/s", "rps"),
    "deg/s": ("°/s", "º/s", "deg/sec", "degs/s", "dps", "degree/s", "degrees/s", "deg s-1", "°/sec"),
    "m/s2": ("m/s^2", "m/s²", "m/s/s", "m/s**2", "mps2", "m/sec^2", "m s-2", "m s^-2"),
    "g": ("gs", "g's", "gee"),
    "ft/s2": ("ft/s^2", "ft/s²", "ft/s/s", "fps2"),
    "rad": ("radian", "radians", "rads"),
    "deg": ("°", "º", "degs", "degree", "degrees"),
    "m": ("meter", "meters", "metre", "metres"),
    "km": ("kilometer", "kilometers", "kilometre", "kilometres"),
    "ft": ("feet", "foot", "ft msl", "ft baro"),
    "kg/m3": ("kg/m^3", "kg/m³"),
    "g/cm3": ("g/cm^3", "g/cm³"),
    "slug/ft3": ("slug/ft^3", "slug/ft³", "slugs/ft3"),
    "degC": ("°c", "ºc", "c", "deg c", "celsius"),
    "degF": ("°f", "ºf", "f", "deg f", "fahrenheit"),
    "K": ("kelvin",),
    "%": ("percent", "pct"),
    "pwm": ("usec pwm", "pwm us"),
}
"""Other spellings in logs, in small letters."""

_BY_SPELLING = {spelling: name for name, spellings in _SPELLINGS.items() for spelling in spellings} | {
    name.lower(): name for name in (*UNITS, "norm", "pwm")
}
_BRACKETS = re.compile(r"\S.*?\s*[(\[]\s*([^()\[\]]+?)\s*[)\]]")


def known_unit(text: str) -> str | None:
    """The name of a unit by what a log writes: ``deg/s`` for ``[°/s]``; None where it is none that is known."""
    bare = text.strip().strip("[](){}").strip()
    return bare if bare in UNITS else _BY_SPELLING.get(" ".join(bare.lower().split()))


def unit_in_brackets(name: str) -> str | None:
    """The unit that a column's name ends with, as in ``gyro x [deg/s]``; a number in brackets is an index."""
    match = _BRACKETS.fullmatch(name)
    if match is None or match[1].isdigit():
        return None
    return known_unit(match[1])
