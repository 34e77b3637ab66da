"""The commands of the baseline database."""

import argparse
from collections.abc import Callable
from pathlib import Path

from wingwatch.cli.arguments.common import (
    Commands,
    add_accept_implausible,
    add_aircraft_and_map,
    add_command,
    add_commands,
    add_convention,
)
from wingwatch.cli.arguments.values import condition, version_id

__all__ = ["add_baseline"]

_EXAMPLES = {
    "list": "wingwatch baseline list data/wingwatch.db",
    "show": "wingwatch baseline show data/wingwatch.db --aircraft aerosonde --vehicle uav1 --at 27,1000",
    "history": "wingwatch baseline history data/wingwatch.db --aircraft aerosonde --vehicle uav1",
    "import": "wingwatch baseline import data/wingwatch.db --aircraft identified.toml",
    "export": "wingwatch baseline export data/wingwatch.db --aircraft aerosonde --out aerosonde.json",
    "predict": "wingwatch baseline predict --aircraft kite.toml --at 18,200",
    "learn": "wingwatch baseline learn data/wingwatch.db monday.csv tuesday.csv --aircraft aerosonde --vehicle uav1",
    "revert": "wingwatch baseline revert data/wingwatch.db --aircraft aerosonde --vehicle uav1 --yes",
    "delete": "wingwatch baseline delete data/wingwatch.db --aircraft aerosonde --vehicle uav1 --yes",
}

_DOES = {
    "list": "aircraft, configurations and vehicles of which the database knows something",
    "show": "what is expected of an aircraft now, and beside it what a vehicle's flights have taught",
    "history": "every entry there ever was, what superseded it, every kept version of what a vehicle taught, and who "
    "changed what",
    "import": "put the expectations of an aircraft file, or what export wrote, into the database; each supersedes the "
    "entry at its point",
    "export": "write what counts into a file that imports again to the bit",
    "predict": "what the empirical tables (thesis B.1, B.2) make of an aircraft's dimensions, beside its file's own "
    "numbers",
    "learn": "learn from healthy flights, offline: what a vehicle's flights taught, or as expectations of the type",
    "revert": "take back the newest version; what it took the place of counts again",
    "delete": "remove expectations with their history, or all that a vehicle taught",
}


def add_baseline(commands: Commands) -> None:
    """``wingwatch baseline``."""
    does = "the baseline database: what is expected of an aircraft, by whom, since when"
    actions = add_commands(commands, "baseline", does, "\n  ".join(_EXAMPLES.values()), "action")
    for name, what in _DOES.items():
        one = add_command(actions, name, what, _EXAMPLES[name])
        optional = name == "predict"  # which only looks, unless it is to store
        one.add_argument(
            "database",
            metavar="DB",
            nargs="?" if optional else None,
            help="database of a service (file or URL)" + ("; with --save alone" if optional else ""),
        )
        _ADD[name](one)


def _add_list(one: argparse.ArgumentParser) -> None:
    one.add_argument("--aircraft", metavar="A", help="only of this aircraft (name); of all without")


def _add_show(one: argparse.ArgumentParser) -> None:
    _add_history(one)
    add = one.add_argument
    add(
        "--at",
        type=condition,
        metavar="AIRSPEED,ALTITUDE",
        help="the flight condition that expectation and flights are set side by side at, m/s and m (default: cruise)",
    )
    add(
        "--plot",
        type=Path,
        metavar="FILE",
        help="picture of one derivative over airspeed and altitude (extra plot)",
    )
    add("--derivative", metavar="SYMBOL", default="m_w", help="of the picture (default: %(default)s)")


def _add_history(one: argparse.ArgumentParser) -> None:
    _add_aircraft(one)
    add_convention(one)
    one.add_argument("--configuration", default="clean", help="of the aircraft (default: %(default)s)")
    _add_vehicle(one, "whose flights' teaching to show (default: nobody's)")


def _add_import(one: argparse.ArgumentParser) -> None:
    one.add_argument(
        "--aircraft",
        metavar="A",
        help="name in the library, or path of an aircraft file; with --file the name that all of it must be of",
    )
    one.add_argument("--file", type=Path, metavar="FILE", help="what wingwatch baseline export wrote")


def _add_export(one: argparse.ArgumentParser) -> None:
    _add_list(one)
    one.add_argument("--out", type=Path, required=True, metavar="FILE", help="the file, .json")


def _add_predict(one: argparse.ArgumentParser) -> None:
    _add_aircraft(one)
    add_convention(one)
    add = one.add_argument
    add(
        "--at",
        type=condition,
        metavar="AIRSPEED,ALTITUDE",
        help="the flight condition, m/s and m (default: cruise)",
    )
    add(
        "--static-margin",
        type=float,
        metavar="SHARE",
        help="neutral point behind the centre of gravity over the mean chord (default: a typical aircraft's)",
    )
    add("--save", action="store_true", help="put it into DB as a-priori expectations")
    add("--anyway", action="store_true", help="also where the aircraft file states numbers of its own")


def _add_learn(one: argparse.ArgumentParser) -> None:
    one.add_argument(
        "flights", metavar="FLIGHT", type=Path, nargs="+", help="flight files, healthy by your declaration"
    )
    add_aircraft_and_map(one)
    one.add_argument("--configuration", default="clean", help="of the aircraft (default: %(default)s)")
    _add_vehicle(one, "who flew them; without, they become expectations of the type")
    add_accept_implausible(one)
    one.add_argument(
        "--anyway", action="store_true", help="learn from a flight although the monitor raises an alert in it"
    )


def _add_revert(one: argparse.ArgumentParser) -> None:
    _add_delete(one)
    one.add_argument(
        "--to",
        type=version_id,
        metavar="VERSION",
        help="the version of what the vehicle taught that is to count again, 0 for none (default: the one before)",
    )


def _add_delete(one: argparse.ArgumentParser) -> None:
    add = one.add_argument
    add(
        "--aircraft",
        required=True,
        metavar="A",
        help="name under which entries stand, or path of an aircraft file",
    )
    add("--configuration", default="clean", help="of the aircraft (default: %(default)s)")
    add("--structure", choices=("short_period", "dutch_roll", "lateral"), help="only of this one")
    add("--entry", type=version_id, metavar="ID", help="only this expectation")
    _add_vehicle(one, "what this vehicle's flights taught, in place of expectations of the type")
    add(
        "--yes",
        action="store_true",
        help="do it; without, the command says what it would do, and ends with 2",
    )


def _add_vehicle(one: argparse.ArgumentParser, what: str) -> None:
    one.add_argument("--fleet", default="default", help="of the vehicle (default: %(default)s)")
    one.add_argument("--vehicle", metavar="ID", help=what)


def _add_aircraft(one: argparse.ArgumentParser) -> None:
    one.add_argument(
        "--aircraft", required=True, metavar="A", help="name in the library, or path of an aircraft file"
    )


_ADD: dict[str, Callable[[argparse.ArgumentParser], None]] = {
    "list": _add_list,
    "show": _add_show,
    "history": _add_history,
    "import": _add_import,
    "export": _add_export,
    "predict": _add_predict,
    "learn": _add_learn,
    "revert": _add_revert,
    "delete": _add_delete,
}
