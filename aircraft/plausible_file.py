"""What is implausible in an aircraft file, before a flight is wasted on it: units, signs, inertias, trim, modes.

Usual ranges come from three places, never from one file alone. Where physics has a bound, it is that (signs of a stable
aeroplane, the triangle inequality of moments of inertia). Where a wrong unit moves a value by a factor f, a value is
unusual that lies more than sqrt(f) outside the library's aircraft: it is then nearer to the slip than to any of them.
Modes are held to the limits of MIL-F-8785C, the loosest level that has one.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from wingwatch.aircraft.aerodynamics import aspect_ratio
from wingwatch.aircraft.aircraft_file import Aircraft, Geometry, Mass
from wingwatch.aircraft.atmosphere import GRAVITY_M_S2
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.loading import library_names, load_aircraft
from wingwatch.aircraft.plausible_derivatives import (
    coefficient_findings,
    condition_findings,
    error_findings,
)
from wingwatch.aircraft.plausible_finding import FileFinding, unit_that_fits
from wingwatch.aircraft.plausible_flight import flight_findings

__all__ = ["FileCheck", "check_file", "radii_of_gyration"]

_AXES = "xyz"
_POUND_FT2 = 0.3048**2 * 0.45359237
_INERTIA_UNITS = {
    "kg cm2": 1e-4, "kg mm2": 1e-6, "g cm2": 1e-7, "lb ft2": _POUND_FT2, "lb in2": _POUND_FT2 / 144.0, "t m2": 1e3,
}  # fmt: skip
_SLIP_INERTIA = math.sqrt(1.0 / _POUND_FT2)
"""Factor of a radius of gyration where lb ft2 pass for kg m2: the smallest slip that is no aircraft's own figure."""
_MOST_RATIO = 1.05
"""Of the largest principal moment of inertia over the sum of the others: 1, and what swinging it leaves open."""
_FLIGHT_LINE = 47.0
"""W/S = 47 W^(1/3), N and m: what flies, from birds to airliners (Tennekes, The Simple Science of Flight, ch. 1)."""
_LINE_FACTOR = math.sqrt(1000.0 ** (2.0 / 3.0))
"""Half way, in the logarithm, to grams taken for kg: 1000 W is 1000^(2/3) off the line."""
_SURFACES = ("elevator", "aileron", "rudder")


@dataclass(frozen=True, slots=True)
class FileCheck:
    """What was found, and what could not be looked at.

    Attributes:
        findings: refusals first.
        not_checked: sentences: what could not be looked at, and what is missing for it.
    """

    findings: tuple[FileFinding, ...]
    not_checked: tuple[str, ...]

    @property
    def usable(self) -> bool:
        """Whether no finding is a refusal."""
        return all(f.standing == "warning" for f in self.findings)


def check_file(aircraft: Aircraft, condition: FlightCondition | None = None) -> FileCheck:
    """Look at everything that an aircraft file states.

    Args:
        aircraft: the file, loaded.
        condition: where level flight and modes of its coefficients are worked out; cruise of [envelope] if None.
    """
    found: list[FileFinding] = []
    missing: list[str] = []
    if aircraft.geometry is not None:
        found += _geometry(aircraft.geometry)
    if aircraft.mass is not None:
        found += _mass(aircraft.mass, aircraft.geometry)
    found += _fittings(aircraft)
    if aircraft.coefficients is None and not aircraft.conditions:
        text = (
            f"{aircraft.name} states neither [coefficients] nor [[conditions]]: no derivative can be expected of it; "
            "make a set with `wingwatch aircraft new`"
        )
        found.append(
            FileFinding("nothing_expected", "coefficients", math.nan, "", math.nan, math.nan, "refusal", text)
        )
    found += coefficient_findings(aircraft)
    found += condition_findings(aircraft)
    found += error_findings(aircraft)
    flown, left = flight_findings(aircraft, condition)
    found += flown
    missing += left
    if aircraft.geometry is None or aircraft.mass is None:
        missing.append("inertias and wing loading: the file lacks [geometry] or [mass]")
    found.sort(key=lambda f: f.standing != "refusal")
    return FileCheck(tuple(found), tuple(missing))


def _geometry(g: Geometry) -> Iterator[FileFinding]:
    aspect = aspect_ratio(g.span_m, g.wing_area_m2)
    do = "is the span in m (not ft, cm or half of it) and the area in m2?"
    yield from _each(
        FileFinding.outside(
            "aspect_ratio", "geometry.span_m squared over wing_area_m2", aspect, (1.5, 45.0), do
        )
    )
    chord = g.mean_chord_m * g.span_m / g.wing_area_m2
    do = "mean chord, span and area do not go together; the mean chord is about wing_area_m2 / span_m, all in m"
    # The aerodynamic mean chord of a straight taper is at most 4/3 of area over span (pointed tip).
    yield from _each(
        FileFinding.outside(
            "mean_chord", "geometry.mean_chord_m over area/span", chord, (0.75, 4.0 / 3.0 + 0.1), do
        )
    )
    for key in ("tail_area_m2", "fin_area_m2"):
        value = getattr(g, key)
        if value is not None:
            do = f"{key} is not smaller than the wing; give m2"
            yield from _each(
                FileFinding.outside(
                    "tail_area", f"geometry.{key} over wing_area_m2", value / g.wing_area_m2, (0.01, 0.99), do
                )
            )


def radii_of_gyration(mass: Mass, span_m: float) -> tuple[float, float, float]:
    """sqrt(I/m) about x, y and z over the span, none with a unit."""
    inertias = (mass.inertia_x_kg_m2, mass.inertia_y_kg_m2, mass.inertia_z_kg_m2)
    return tuple(math.sqrt(i / mass.mass_kg) / span_m for i in inertias)  # type: ignore[return-value]


@cache
def _usual_radii() -> tuple[tuple[float, float], ...]:
    """Smallest and largest radius of gyration over span of the library, each the root of the slip further out."""
    every = []
    for name in library_names():
        one = load_aircraft(name)
        if one.mass is not None and one.geometry is not None:
            every.append(radii_of_gyration(one.mass, one.geometry.span_m))
    further = math.sqrt(_SLIP_INERTIA)
    return tuple((min(axis) / further, max(axis) * further) for axis in zip(*every, strict=True))


def _mass(mass: Mass, geometry: Geometry | None) -> Iterator[FileFinding]:
    tensor = np.diag([mass.inertia_x_kg_m2, mass.inertia_y_kg_m2, mass.inertia_z_kg_m2])
    tensor[0, 2] = tensor[2, 0] = -mass.inertia_xz_kg_m2
    small, middle, large = np.linalg.eigvalsh(tensor).tolist()
    ratio = large / (small + middle)
    if ratio > _MOST_RATIO:
        text = (
            f"the largest principal moment of inertia is {ratio:.3g} times the sum of the other two, and no body has "
            "more than 1: one of inertia_x, _y, _z_kg_m2 is in another unit, exchanged or wrong"
        )
        yield FileFinding("inertia_triangle", "mass", ratio, "", -math.inf, 1.0, "refusal", text)
    if geometry is None:
        return
    weight = mass.mass_kg * GRAVITY_M_S2
    line = _FLIGHT_LINE * weight ** (1.0 / 3.0)
    loading = weight / geometry.wing_area_m2
    usual = line / _LINE_FACTOR, line * _LINE_FACTOR
    do = "is mass_kg in kg (not g or lb) and wing_area_m2 in m2?"
    yield from _each(
        FileFinding.outside("wing_loading", "weight over wing_area_m2", loading, usual, do, "N/m2")
    )
    for axis, radius, bounds in zip(
        _AXES, radii_of_gyration(mass, geometry.span_m), _usual_radii(), strict=True
    ):
        inertia = getattr(mass, f"inertia_{axis}_kg_m2")
        scale = mass.mass_kg * geometry.span_m**2
        unit = unit_that_fits(inertia, (bounds[0] ** 2 * scale, bounds[1] ** 2 * scale), _INERTIA_UNITS)
        do = f"inertia_{axis}_kg_m2 of {inertia:.4g} does not go with mass and span; give kg m2"
        do += f" (as it stands it looks like {unit})" if unit else ""
        yield from _each(
            FileFinding.outside(
                f"radius_of_gyration_{axis}", f"radius of gyration about {axis} over span", radius, bounds, do
            )
        )


def _fittings(aircraft: Aircraft) -> Iterator[FileFinding]:
    """Limits and noise that look like degrees."""
    quarter = math.pi / 2.0
    for surface in _SURFACES:
        actuator = getattr(aircraft.actuators, surface)
        if actuator is None or actuator.position_limit_rad is None:
            continue
        key = f"actuators.{surface}.position_limit_rad"
        do = "no surface turns that far; give rad, not degrees"
        yield from _each(
            FileFinding.outside(
                "surface_travel", key, actuator.position_limit_rad, (0.01, quarter), do, "rad"
            )
        )
    for column, noise in aircraft.sensors.noise_std.items():
        if not column.endswith(("_rad", "_rad_s")):
            continue
        do = "no sensor of use is that noisy; give rad or rad/s, not degrees"
        yield from _each(
            FileFinding.outside(
                "sensor_noise", f"sensors.noise_std.{column}", noise, (0.0, 0.2), do, "rad or rad/s"
            )
        )


def _each(finding: FileFinding | None) -> Iterator[FileFinding]:
    if finding is not None:
        yield finding
