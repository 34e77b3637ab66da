"""`wingwatch baseline revert` and `delete`: versions taken back, entries and teaching removed."""

import argparse
import getpass
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from rich.markup import escape

from wingwatch.aircraft import load_aircraft
from wingwatch.baselines import BaselineLedger, ChangeRecord, Reverted, Selection, open_database
from wingwatch.operations.baseline import check_exists
from wingwatch.operations.baseline_pages import many
from wingwatch.operations.faults import CommandError
from wingwatch.operations.progress import page
from wingwatch.telemetry import check_name

__all__ = ["Done", "remove", "revert", "revert_text", "reverted_object", "who"]

Done = tuple[dict[str, Any], Callable[[], None]]
"""What an action did, and what prints it for a person."""


def revert(arguments: argparse.Namespace) -> Done:
    """Take back the newest version."""
    selection = _selected(arguments)
    found = _changed(arguments, "revert", selection, revert_text(selection))
    return reverted_object(found, selection), lambda: page().print(escape(reverted_text(found, selection)))


def remove(arguments: argparse.Namespace) -> Done:
    """Remove entries or what a vehicle taught."""
    selection = _selected(arguments)
    found = _changed(arguments, "delete", selection, "removed")
    result = reverted_object(found, selection) | {"restored": []}
    what = "versions" if selection.vehicle is not None else "entries"
    said = f"removed: {_ids(what, found.withdrawn)}" + (f", {found.cells} cells" if found.cells else "")
    return result, lambda: page().print(escape(said))


def _selected(arguments: argparse.Namespace) -> Selection:
    aircraft = aircraft_name(arguments.aircraft)
    fleet = check_name("fleet", arguments.fleet)
    vehicle = None if arguments.vehicle is None else check_name("vehicle", arguments.vehicle)
    version = getattr(arguments, "to", None)
    if version is not None and vehicle is None:
        raise CommandError("--to names a version of what a vehicle taught; add --vehicle, or take --entry")
    if arguments.entry is not None and vehicle is not None:
        raise CommandError("--entry names an expectation of the type; leave out --vehicle, or take --to")
    check_exists("DB", arguments.database)
    return Selection(
        aircraft, arguments.configuration, arguments.structure, fleet, vehicle, arguments.entry, version
    )


def aircraft_name(given: str) -> str:
    """The name that entries stand under: that of a file's aircraft, else what is given.

    An aircraft that is no longer in the library may still have a baseline.
    """
    return load_aircraft(given).name if given.endswith(".toml") else given


def _changed(arguments: argparse.Namespace, action: str, selection: Selection, text: str) -> Reverted:
    """Carry out a change, which takes ``--yes``.

    Raises:
        CommandError: without it, or there is nothing to change.
    """
    fleet = None if selection.vehicle is None else selection.fleet
    change = ChangeRecord(
        time.time(),
        action,
        who(),
        selection.aircraft,
        selection.configuration,
        text,
        fleet,
        selection.vehicle,
    )
    with open_database(arguments.database) as database:
        ledger = BaselineLedger(database)
        act = ledger.revert if action == "revert" else ledger.remove
        try:
            if not arguments.yes:
                found = act(change, selection, keep=False)
                what = "versions" if selection.vehicle is not None else "entries"
                raise CommandError(
                    f"this would {'take back' if action == 'revert' else 'remove'} {_ids(what, found.withdrawn)} "
                    f"of {selection.owner}; add --yes to do it"
                )
            return act(change, selection)
        except ValueError as error:
            raise CommandError(str(error)) from None


def revert_text(selection: Selection) -> str:
    """What is asked for, for the note of the change."""
    if selection.entry is not None:
        return f"entry {selection.entry} taken back"
    if selection.version is not None:
        return f"back to version {selection.version}" if selection.version else "all versions taken back"
    return "the newest version taken back"


def reverted_object(found: Reverted, selection: Selection) -> dict[str, Any]:
    """What was taken back and what counts again, for JSON."""
    return {"aircraft": selection.aircraft, "configuration": selection.configuration, **asdict(found)}


def reverted_text(found: Reverted, selection: Selection) -> str:
    """What was taken back and what counts again, for a person."""
    what = "versions" if selection.vehicle is not None else "entries"
    again = f"{_ids(what, found.restored)} count again" if found.restored else "nothing counts in their place"
    cells = f"; {many(found.cells, 'cell')} of the envelope as before" if found.cells else ""
    return f"taken back: {_ids(what, found.withdrawn)}; {again}{cells}"


def _ids(what: str, ids: Sequence[int]) -> str:
    if len(ids) == 1:
        return f"{'entry' if what == 'entries' else 'version'} {ids[0]}"
    shown = ", ".join(map(str, ids[:5])) + (", ..." if len(ids) > 5 else "")
    return f"{len(ids)} {what}" + (f" ({shown})" if ids else "")


def who() -> str:
    """The user of this machine who asks; empty where that is not known."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""
