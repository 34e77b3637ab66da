"""`wingwatch baseline`: what the baseline database expects of an aircraft, since when, and what its flights taught."""

import argparse
import re
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

from wingwatch.aircraft import load_aircraft
from wingwatch.baselines import open_database
from wingwatch.operations.baseline import check_exists
from wingwatch.operations.baseline_objects import Asked, history_object, list_object, show_object
from wingwatch.operations.baseline_pages import print_history, print_list, print_show
from wingwatch.operations.convention import check_convention
from wingwatch.operations.faults import CommandError
from wingwatch.operations.output_files import check_output
from wingwatch.operations.progress import page, write_json

__all__ = ["run"]

_Action = Callable[[argparse.Namespace], tuple[dict[str, Any], Callable[[], None]]]
"""What an action found, and what prints it for a person."""


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    act = _READING.get(arguments.action)
    if act is None:
        module, name = _CHANGING[arguments.action]  # what reads alone loads no more than it needs
        act = getattr(import_module(f"wingwatch.{module}"), name)
    result, show = act(arguments)
    if arguments.json:
        write_json(result)
    else:
        show()
    return 0


def _list(arguments: argparse.Namespace) -> tuple[dict[str, Any], Callable[[], None]]:
    check_exists("DB", arguments.database)
    with open_database(arguments.database) as database:
        result = list_object(database, arguments.aircraft)
    return result, lambda: print_list(page(), result)


def _show(arguments: argparse.Namespace) -> tuple[dict[str, Any], Callable[[], None]]:
    asked = _asked(arguments)
    plot = None if arguments.plot is None else import_module("wingwatch.cli.baseline_plot")
    if plot is not None:
        import_module("wingwatch.cli.design_input_plot").need_matplotlib()
        plot.structure_with(arguments.derivative)
        check_output("--plot", arguments.plot, (".png", ".pdf", ".svg"))
    with open_database(arguments.database) as database:
        if plot is not None:
            of = asked.aircraft.name if asked.vehicle is None else f"{asked.fleet}/{asked.vehicle}"
            surface = plot.surface_of(database, asked, arguments.derivative)
            plot.draw_surface(surface, f"expected of {of}", arguments.plot)
        try:
            result = show_object(database, asked, time.time())
        except ValueError as error:
            raise CommandError(f"--at: {error}") from None
    return result, lambda: print_show(page(), result)


def _history(arguments: argparse.Namespace) -> tuple[dict[str, Any], Callable[[], None]]:
    asked = _asked(arguments)
    with open_database(arguments.database) as database:
        result = history_object(database, asked)
    return result, lambda: print_history(page(), result)


def _asked(arguments: argparse.Namespace) -> Asked:
    aircraft = load_aircraft(arguments.aircraft)
    check_convention(aircraft, arguments.convention)
    fleet = _named("fleet", arguments.fleet)
    vehicle = None if arguments.vehicle is None else _named("vehicle", arguments.vehicle)
    check_exists("DB", arguments.database)
    at = getattr(arguments, "at", None)
    return Asked(aircraft, arguments.configuration, arguments.convention, fleet, vehicle, at)


def _named(kind: str, name: str) -> str:
    """A name that keys allow; a good one is seen without Zenoh."""
    if re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,62}", name):
        return name
    check_name = import_module("wingwatch.telemetry").check_name
    return str(check_name(kind, name))


_READING: dict[str, _Action] = {"list": _list, "show": _show, "history": _history}

_CHANGING = {
    "import": ("operations.baseline_exchange", "import_"),
    "export": ("operations.baseline_exchange", "export"),
    "predict": ("cli.baseline_predict", "predict"),
    "learn": ("cli.baseline_learn", "learn"),
    "revert": ("operations.baseline_revert", "revert"),
    "delete": ("operations.baseline_revert", "remove"),
}
"""Module and function by the name on the command line."""
