"""Where the numbers of `wingwatch aircraft new` come from: dimensions, another aircraft, JSBSim, AVL."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

from wingwatch.aircraft import (
    Aircraft,
    Dimensions,
    FlightCondition,
    Geometry,
    aircraft_like,
    avl_coefficients,
    empirical_aircraft,
    jsbsim_aircraft,
    known_aircraft,
    load_aircraft,
    read_avl_mass,
    read_avl_run,
)
from wingwatch.operations.faults import CommandError

__all__ = ["Made", "made_aircraft"]

_SURFACES = ("elevator", "aileron", "rudder")
_TAIL = ("tail_area_m2", "tail_arm_m", "fin_area_m2", "fin_arm_m")
_WING = ("span_m", "area_m2", "chord_m")
_INERTIAS = ("inertia_x", "inertia_y", "inertia_z", "inertia_xz")
_AVL = ("mass_file", "length_unit_m", "control")


@dataclass(frozen=True, slots=True)
class Made:
    """An aircraft, what its derivatives rest on, and what was assumed."""

    aircraft: Aircraft
    basis: str
    notes: tuple[str, ...] = ()


def made_aircraft(arguments: argparse.Namespace) -> Made:
    """The aircraft that the options describe."""
    if arguments.from_avl is None:
        _without(arguments, _AVL, "goes with --from-avl alone")
    if arguments.from_jsbsim is not None:
        return _from_jsbsim(arguments)
    if arguments.from_avl is not None:
        return _from_avl(arguments)
    if arguments.like is not None:
        _without(arguments, ("static_margin",), "has no effect with --like, whose coefficients are kept")
        other = load_aircraft(arguments.like)
        known = _dimensions(arguments, other.geometry)
        return Made(aircraft_like(known, other), f"derivatives like {other.name}'s, with wide errors")
    made = empirical_aircraft(_dimensions(arguments), arguments.static_margin)
    return Made(made, "derivatives by empirical formulas, with wide errors")


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _without(arguments: argparse.Namespace, names: Sequence[str], why: str) -> None:
    for name in names:
        if getattr(arguments, name) not in (None, []):
            raise CommandError(f"{_option(name)} {why}; leave it out")


def _inertias(arguments: argparse.Namespace) -> tuple[float | None, float | None, float | None, float | None]:
    return arguments.inertia_x, arguments.inertia_y, arguments.inertia_z, arguments.inertia_xz


def _dimensions(arguments: argparse.Namespace, like: Geometry | None = None) -> Dimensions:
    """The dimensions that the options state; the wing is of the shape of another aircraft's where its area is not."""
    for option in ("span_m", "mass_kg", "area_m2"):
        if getattr(arguments, option) is None and (option != "area_m2" or like is None):
            raise CommandError(f"{_option(option)} is missing; give span, mass and wing area")
    area_m2, chord_m = arguments.area_m2, arguments.chord_m
    if area_m2 is None and like is not None:
        scale = arguments.span_m / like.span_m
        area_m2, chord_m = like.wing_area_m2 * scale**2, chord_m or like.mean_chord_m * scale
    geometry = Geometry(
        wing_area_m2=area_m2,
        span_m=arguments.span_m,
        mean_chord_m=chord_m or area_m2 / arguments.span_m,
        **{key: getattr(arguments, key) for key in _TAIL},
    )
    return Dimensions(
        arguments.name,
        geometry,
        arguments.mass_kg,
        _inertias(arguments),
        arguments.airspeed,
        arguments.altitude,
    )


def _from_jsbsim(arguments: argparse.Namespace) -> Made:
    path = arguments.from_jsbsim
    stated = ("mass_kg", "static_margin", *_WING, *_TAIL, *_INERTIAS)
    _without(arguments, stated, "has no effect with --from-jsbsim, whose file states it")
    if arguments.airspeed is None:
        raise CommandError(
            "--airspeed is missing; JSBSim's aircraft is linearised at a level trim, give its true airspeed"
        )
    condition = FlightCondition(arguments.airspeed, arguments.altitude)
    read, notes = jsbsim_aircraft(path, arguments.name, condition)
    mass, geometry = read.need_mass("a new aircraft"), read.need_geometry("a new aircraft")
    inertias = (mass.inertia_x_kg_m2, mass.inertia_y_kg_m2, mass.inertia_z_kg_m2, mass.inertia_xz_kg_m2)
    known = Dimensions(
        arguments.name, geometry, mass.mass_kg, inertias, arguments.airspeed, arguments.altitude
    )
    words = (
        f"JSBSim's aircraft {path.name}: coefficients by differences of JSBSim's own forces about level flight at "
        f"{arguments.airspeed:g} m/s and {arguments.altitude:g} m, without engine; errors are a handbook's."
    )
    made = known_aircraft(known, read.need_coefficients("a new aircraft"), words)
    return Made(made, f"derivatives of {path.name} at {arguments.airspeed:g} m/s", tuple(notes))


def _from_avl(arguments: argparse.Namespace) -> Made:
    path = arguments.from_avl
    _without(arguments, ("static_margin", *_WING), "has no effect with --from-avl, whose file states it")
    mass_file = None if arguments.mass_file is None else read_avl_mass(arguments.mass_file)
    unit = arguments.length_unit_m or (1.0 if mass_file is None else mass_file.length_unit_m)
    read = avl_coefficients(read_avl_run(path), unit, _controls(arguments.control))
    if mass_file is None:
        if arguments.mass_kg is None:
            raise CommandError("--mass-kg is missing; AVL's derivatives have no mass, give it or --mass-file")
        mass_kg, shift, inertias = arguments.mass_kg, 0.0, _inertias(arguments)
    else:
        _without(arguments, ("mass_kg", *_INERTIAS), "has no effect with --mass-file, which states it")
        mass_kg, inertias = mass_file.mass_kg, mass_file.inertia_kg_m2
        shift = mass_file.centre_m[0] - read.reference_x_m
    tail = {key: getattr(arguments, key) for key in _TAIL}
    geometry = Geometry.model_validate(read.geometry.model_dump() | tail)
    known = Dimensions(arguments.name, geometry, mass_kg, inertias, arguments.airspeed, arguments.altitude)
    words = (
        f"AVL's run case in {path.name}: stability derivatives turned into body axes, per rad, signs as here; "
        "errors are a handbook's."
    )
    made = known_aircraft(known, read.coefficients, words, shift, read.lift_coefficient)
    return Made(made, f"derivatives of {path.name}", read.notes)


def _controls(options: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for option in options:
        surface, equals, name = option.partition("=")
        if not equals or surface not in _SURFACES or not name:
            raise CommandError(
                f"--control {option}: write SURFACE=NAME, the surface one of {', '.join(_SURFACES)}"
            )
        found[surface] = name
    return found
