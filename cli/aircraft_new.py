"""`wingwatch aircraft new`: an aircraft file from what people have, written and checked."""

import argparse
import re
from typing import Any

from rich.markup import escape

from wingwatch.aircraft import (
    Aircraft,
    AircraftDataError,
    Dimensions,
    Geometry,
    aircraft_like,
    aircraft_toml,
    check_file,
    empirical_aircraft,
    load_aircraft,
)
from wingwatch.cli.aircraft_check import check_object, say_check
from wingwatch.cli.faults import CommandError
from wingwatch.cli.output_files import check_output
from wingwatch.cli.progress import page, write_json
from wingwatch.pages.whole_file import write_whole

__all__ = ["new_aircraft"]

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,62}")


def new_aircraft(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    if not _NAME.fullmatch(arguments.name):
        raise CommandError(
            f"the name {arguments.name!r} is not allowed: give a to z, digits, - and _, starting with a letter or digit"
        )
    check_output("--out", arguments.out, (".toml",))
    made, basis, notes = _made(arguments)
    found = check_file(made)
    write_whole(arguments.out, aircraft_toml(made, _comment(arguments, notes)))
    result: dict[str, Any] = check_object(made, found)
    result |= {"file": str(arguments.out), "basis": basis, "notes": notes}
    if arguments.json:
        write_json(result)
        return 0
    console = page()
    console.print(escape(f"{arguments.out}  {made.name}: {basis}"), soft_wrap=True)
    for note in notes:
        console.print(escape(f"note: {note}"), soft_wrap=True)
    say_check(console, made, found)
    return 0


def _made(arguments: argparse.Namespace) -> tuple[Aircraft, str, list[str]]:
    """The aircraft, what its derivatives rest on, and what was assumed."""
    known = _dimensions(arguments)
    if arguments.like is not None:
        other = load_aircraft(arguments.like)
        if arguments.static_margin is not None:
            raise CommandError(
                "--static-margin has no effect with --like, whose coefficients are kept; leave it out"
            )
        return aircraft_like(known, other), f"derivatives like {other.name}'s, with wide errors", []
    made = empirical_aircraft(known, arguments.static_margin)
    return made, "derivatives by empirical formulas, with wide errors", []


def _dimensions(arguments: argparse.Namespace) -> Dimensions:
    for option in ("span_m", "mass_kg", "area_m2"):
        if getattr(arguments, option) is None:
            raise CommandError(f"--{option.replace('_', '-')} is missing; give span, mass and wing area")
    geometry = Geometry(
        wing_area_m2=arguments.area_m2,
        span_m=arguments.span_m,
        mean_chord_m=arguments.chord_m or arguments.area_m2 / arguments.span_m,
        tail_area_m2=arguments.tail_area_m2,
        tail_arm_m=arguments.tail_arm_m,
        fin_area_m2=arguments.fin_area_m2,
        fin_arm_m=arguments.fin_arm_m,
    )
    inertias = (arguments.inertia_x, arguments.inertia_y, arguments.inertia_z, arguments.inertia_xz)
    try:
        return Dimensions(
            arguments.name, geometry, arguments.mass_kg, inertias, arguments.airspeed, arguments.altitude
        )
    except AircraftDataError as error:
        raise CommandError(str(error)) from None


def _comment(arguments: argparse.Namespace, notes: list[str]) -> str:
    head = f"Written by `wingwatch aircraft new {arguments.name}`; `wingwatch aircraft check` says what is implausible."
    return "\n".join([head, *notes])
