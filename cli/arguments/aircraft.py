"""Arguments of `wingwatch aircraft`: aircraft files from what people have."""

import argparse

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
        "--altitude", type=float, metavar="M", help="altitude (default: that of cruise, else 0)"
    )
