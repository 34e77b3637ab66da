"""Arguments of `wingwatch aircraft`: aircraft files from what people have."""

import argparse
import math
from pathlib import Path

from wingwatch.cli.arguments.common import Commands, add_command, add_commands
from wingwatch.cli.arguments.values import positive

__all__ = ["add_aircraft"]

_EXAMPLES = """\
wingwatch aircraft list
  wingwatch aircraft check my_aircraft.toml
  wingwatch aircraft new kite --span-m 2.1 --mass-kg 3.4 --area-m2 0.55 --airspeed 18 --out kite.toml
  wingwatch aircraft new kite --span-m 2.1 --mass-kg 3.4 --area-m2 0.55 --like ultrastick25e --out kite.toml
  wingwatch aircraft new kite --from-avl kite.st --mass-file kite.mass --airspeed 18 --out kite.toml
  wingwatch aircraft new skyhawk --from-jsbsim c172p.xml --airspeed 55 --altitude 1000 --out skyhawk.toml
  wingwatch aircraft export kite.toml --to jsbsim --out kite.xml"""


def add_aircraft(commands: Commands) -> None:
    """``wingwatch aircraft``."""
    does = "aircraft files: write one from what you have, check it, hand it on"
    actions = add_commands(commands, "aircraft", does, _EXAMPLES, "action")
    add_command(actions, "list", "the aircraft of the library", "wingwatch aircraft list")
    show = add_command(
        actions, "show", "what an aircraft file says, in short", "wingwatch aircraft show ultrastick25e"
    )
    _add_file(show)
    check = add_command(
        actions,
        "check",
        "what is implausible in an aircraft file: units, signs, inertias, level flight, modes",
        "wingwatch aircraft check my_aircraft.toml",
    )
    _add_file(check)
    _add_condition(check)
    _add_new(
        add_command(
            actions,
            "new",
            "write an aircraft file from what you have",
            "wingwatch aircraft new kite --span-m 2.1 --mass-kg 3.4 --area-m2 0.55 --airspeed 15 --out kite.toml",
        )
    )
    _add_export(
        add_command(
            actions,
            "export",
            "hand an aircraft file on, with standard errors as JSON or as an aircraft that JSBSim flies",
            "wingwatch aircraft export my_aircraft.toml --to jsbsim --out my_aircraft.xml",
        )
    )


def _add_export(parser: argparse.ArgumentParser) -> None:
    _add_file(parser)
    add = parser.add_argument
    add("--to", choices=("json", "jsbsim"), required=True, help="JSON, or JSBSim's XML")
    add("--out", type=Path, required=True, metavar="FILE", help="the file to write, .json or .xml")
    _add_condition(parser)


def _add_new(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("name", metavar="NAME", help="of the aircraft: letters a to z, digits, - and _")
    add("--out", type=Path, required=True, metavar="FILE.toml", help="the aircraft file")
    for name, what in _DIMENSIONS.items():
        add(f"--{name}", type=positive, metavar="X", help=what)
    add(
        "--static-margin",
        type=_number,
        metavar="X",
        help="neutral point behind the centre of gravity over the chord",
    )
    for axes in ("x", "y", "z"):
        add(f"--inertia-{axes}", type=positive, metavar="KG_M2", help=f"moment of inertia about {axes}")
    add("--inertia-xz", type=_number, metavar="KG_M2", help="product of inertia, the integral of x z dm")
    add(
        "--airspeed",
        type=positive,
        metavar="M_S",
        help="usual true airspeed (default: at a lift coefficient of 0.5)",
    )
    add("--altitude", type=_number, default=0.0, metavar="M", help="usual altitude (default: %(default)g)")
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--like", metavar="A", help="an aircraft of the library, or a file, that it is like")
    source.add_argument(
        "--from-jsbsim",
        type=Path,
        metavar="FILE.xml",
        help="an aircraft of JSBSim, at the trim of --airspeed",
    )
    source.add_argument("--from-avl", type=Path, metavar="FILE.st", help="what AVL's command ST wrote")
    add(
        "--mass-file",
        type=Path,
        metavar="FILE.mass",
        help="AVL's mass file: mass, inertias, centre of gravity",
    )
    add(
        "--length-unit-m",
        type=positive,
        metavar="M",
        help="unit of AVL's geometry (default: Lunit of the mass file, else 1)",
    )
    add(
        "--control",
        action="append",
        default=[],
        metavar="SURFACE=NAME",
        help="AVL's control variable of elevator, aileron or rudder where its name does not say it; may be repeated",
    )


_DIMENSIONS = {
    "span-m": "wing span, m",
    "mass-kg": "mass of the whole aircraft, kg",
    "area-m2": "wing area, m2 (default with --like: by the square of the span)",
    "chord-m": "mean chord, m (default: area over span)",
    "tail-area-m2": "area of the tail plane, m2",
    "tail-arm-m": "its quarter chord behind the centre of gravity, m",
    "fin-area-m2": "area of the fin, m2",
    "fin-arm-m": "its quarter chord behind the centre of gravity, m (default: that of the tail)",
}


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not allowed: give a number")
    return value


def _add_file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="A", help="path of an aircraft file, or name in the library")


def _add_condition(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--airspeed",
        type=positive,
        metavar="M_S",
        help="true airspeed (default: cruise of the file's [envelope])",
    )
    parser.add_argument(
        "--altitude", type=_number, metavar="M", help="altitude (default: that of cruise, else 0)"
    )
