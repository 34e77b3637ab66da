"""The actions of `wingwatch baseline` that change the database, each in one transaction."""

import argparse
import getpass
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.markup import escape

from wingwatch.aircraft import STRUCTURES, Aircraft, load_aircraft
from wingwatch.baselines import (
    BaselineContent,
    BaselineLedger,
    CellRecord,
    ChangeRecord,
    Database,
    Expectation,
    ExpectationRecord,
    Reverted,
    Selection,
    Teaching,
    apriori_envelope,
    open_database,
)
from wingwatch.cli.baseline import check_exists, stored_cells, stored_envelopes, stored_references
from wingwatch.cli.baseline_files import read_content, write_content
from wingwatch.cli.baseline_learning import LEARNED, Lesson, Student, digest_of, identified_entries
from wingwatch.cli.faults import CommandError
from wingwatch.cli.flight_watch import OFFLINE
from wingwatch.cli.output_files import check_output
from wingwatch.cli.plausible import checked
from wingwatch.cli.progress import Progress, page
from wingwatch.cli.surface_travel import surface_travel
from wingwatch.monitor import MonitorStart, VehicleMemory
from wingwatch.telemetry import check_name, load_flight

__all__ = ["export", "import_", "learn", "remove", "revert"]

Done = tuple[dict[str, Any], Callable[[], None]]
"""What an action did, and what prints it for a person."""


def export(arguments: argparse.Namespace) -> Done:
    """Write what counts into a file."""
    check_exists("DB", arguments.database)
    check_output("--out", arguments.out, (".json",))
    with open_database(arguments.database) as database:
        content = BaselineLedger(database).content(arguments.aircraft)
    if not (content.entries or content.references or content.cells):
        of = "" if arguments.aircraft is None else f" of aircraft {arguments.aircraft}"
        raise CommandError(f"{arguments.database}: the baseline has nothing{of}; there is nothing to export")
    write_content(content, arguments.out)
    counts = _counts(content)
    said = f"{_counted(counts)} are in {arguments.out}"
    return counts, lambda: page().print(escape(said))


def import_(arguments: argparse.Namespace) -> Done:
    """Put the expectations of an aircraft file, or what ``export`` wrote, into the database."""
    now_s = time.time()
    if arguments.file is None:
        if arguments.aircraft is None:
            raise CommandError(
                "nothing to import: give --aircraft FILE.toml, or --file with what export wrote"
            )
        aircraft = load_aircraft(arguments.aircraft)
        entries = tuple(ExpectationRecord.of(aircraft.name, point, now_s) for point in _stated(aircraft))
        content, source = BaselineContent(entries), f"the file of aircraft {aircraft.name}"
        result: dict[str, Any] = {"aircraft": aircraft.name, "imported": len(entries)}
        said = f"{len(entries)} entries of {aircraft.name} are in {arguments.database}"
    else:
        content, source = read_content(arguments.file, arguments.aircraft), arguments.file.name
        result = _counts(content)
        said = f"{_counted(result)} are in {arguments.database}"
    with open_database(arguments.database) as database:
        stored = BaselineLedger(database).put(changes_of(content, now_s, f"imported from {source}"), content)
    result["stored"] = stored
    known = "" if stored else "; all of it was there already"
    return result, lambda: page().print(escape(said + known))


def _stated(aircraft: Aircraft) -> list[Expectation]:
    """The expectations that an aircraft file gives: of its conditions, else of its coefficients on the monitor's grid.

    Raises:
        CommandError: it gives none.
    """
    points: list[Expectation] = []
    reasons = {}
    for structure in STRUCTURES.values():
        for configuration in dict.fromkeys((*(c.configuration for c in aircraft.conditions), "clean")):
            envelope = apriori_envelope(aircraft, structure, configuration)
            points += envelope.points
            if not envelope.points:
                reasons[structure.name] = envelope.absent
    if not points:
        raise CommandError(next(iter(reasons.values())))
    return points


def changes_of(content: BaselineContent, at_s: float, text: str) -> list[ChangeRecord]:
    """A change for each aircraft and each vehicle that content is of."""
    owners: dict[tuple[str, str, str | None, str | None], None] = {}
    for entry in content.entries:
        owners[entry.aircraft, entry.configuration, None, None] = None
    for key in (*(one.key for one in content.references), *(one.key for one in content.cells)):
        owners[key.aircraft, key.configuration, key.fleet, key.vehicle] = None
    return [
        ChangeRecord(at_s, "import", who(), aircraft, configuration, text, fleet, vehicle)
        for aircraft, configuration, fleet, vehicle in owners
    ]


def learn(arguments: argparse.Namespace) -> Done:
    """Teach the database flights that somebody declares healthy."""
    aircraft = load_aircraft(arguments.aircraft)
    fleet = check_name("fleet", arguments.fleet)
    vehicle = None if arguments.vehicle is None else check_name("vehicle", arguments.vehicle)
    selection = Selection(aircraft.name, arguments.configuration, fleet=fleet, vehicle=vehicle)
    digests = _distinct(arguments.flights)
    with open_database(arguments.database) as database:
        ledger = BaselineLedger(database)
        _refuse_known(ledger, selection, digests)
        now_s = time.time()
        seen_s = _cells_seen(ledger, selection)
        student = Student(aircraft, _start(database, aircraft, selection, now_s), fleet, vehicle or OFFLINE)
        lessons = [_lesson(student, path, aircraft, arguments) for path in arguments.flights]
        if not student.learned:
            raise CommandError(
                "the flights taught nothing: no block of them excited anything in air fit for it; fly inputs such as "
                "doublets of every surface"
            )
        said = ", ".join(f"{one.name} ({one.digest})" for one in lessons)
        blocks = sum(one.blocks for one in lessons)
        source = f"{LEARNED} {_many(len(lessons), 'flight')}, {_many(blocks, 'block')}: {said}"
        change = ChangeRecord(
            time.time(), "learn", who(), aircraft.name, arguments.configuration, source,
            None if vehicle is None else fleet, vehicle,
        )  # fmt: skip
        teaching, lacking = _teaching(ledger, student, selection, aircraft, source, change.at_s, seen_s)
        ledger.teach(change, teaching)
    result = _learned(student, lessons, selection, teaching, lacking)
    return result, lambda: _print_learned(result)


def _distinct(paths: Sequence[Path]) -> dict[str, Path]:
    """The flights by what they hold.

    Raises:
        CommandError: two of them are the same.
    """
    found: dict[str, Path] = {}
    for path in paths:
        digest = digest_of(path)
        if digest in found:
            raise CommandError(f"{path}: it is the same flight as {found[digest]}; name each flight once")
        found[digest] = path
    return found


def _refuse_known(ledger: BaselineLedger, selection: Selection, digests: dict[str, Path]) -> None:
    """No flight counts twice: not in one place, and not as the vehicle's own and as the type's it is held against.

    Raises:
        CommandError: a flight has been learned from.
    """
    of_type = Selection(selection.aircraft, selection.configuration)
    known = [*ledger.sources(of_type)]
    known += ledger.sources(selection) if selection.vehicle is not None else ledger.all_sources(of_type)
    for digest, path in digests.items():
        if any(f"({digest})" in source for source in known):
            raise CommandError(
                f"{path}: the baseline of {selection.aircraft} was learned from this flight already, and no flight "
                "counts twice; leave it out, or take that back with `wingwatch baseline revert`"
            )


def _cells_seen(ledger: BaselineLedger, selection: Selection) -> dict[tuple[str, Any], float]:
    """When each cell of the vehicle was changed last."""
    if selection.vehicle is None:
        return {}
    return {
        (name, one.cell): one.updated_at_s for name in STRUCTURES for one in ledger.cells(selection.key(name))
    }


def _start(database: Database, aircraft: Aircraft, selection: Selection, now_s: float) -> MonitorStart:
    """What the first flight begins with: the type's expectations, and what the vehicle has taught before."""
    configuration = selection.configuration
    envelopes = stored_envelopes(database, aircraft, configuration)
    if selection.vehicle is None or selection.fleet is None:
        return MonitorStart(configuration, VehicleMemory(envelopes=envelopes))
    asked = selection.fleet, selection.vehicle, aircraft.name, configuration
    references = stored_references(database, *asked)
    return MonitorStart(
        configuration, VehicleMemory(references, envelopes, stored_cells(database, *asked, now_s))
    )


def _lesson(student: Student, path: Path, aircraft: Aircraft, arguments: argparse.Namespace) -> Lesson:
    flight = load_flight(path, arguments.map, surface_travel(aircraft))
    checked(flight, aircraft, arguments.accept_implausible)
    return student.learn(path, flight, Progress(), arguments.anyway)


def _teaching(
    ledger: BaselineLedger,
    student: Student,
    selection: Selection,
    aircraft: Aircraft,
    source: str,
    at_s: float,
    seen_s: dict[tuple[str, Any], float],
) -> tuple[Teaching, dict[str, str]]:
    """What is to be stored, of a vehicle or as expectations of the type; and what is lacking."""
    if selection.vehicle is None:
        current = [
            one
            for one in ledger.content(aircraft.name).entries
            if one.configuration == selection.configuration
        ]
        entries, lacking = identified_entries(student, aircraft, current, source, at_s)
        if not entries:
            raise CommandError("; ".join(f"{name}: {why}" for name, why in lacking.items()))
        return Teaching(entries=entries), lacking
    learned = [(selection.key(name), one) for name, one in student.learned.items()]
    cells = [
        (CellRecord(selection.key(name), cell, reference, at_s), seen_s.get((name, cell)))
        for (name, cell), reference in student.cells.items()
    ]
    return Teaching(learned=learned, source=source, cells=cells), {}


def _learned(
    student: Student,
    lessons: Sequence[Lesson],
    selection: Selection,
    teaching: Teaching,
    lacking: dict[str, str],
) -> dict[str, Any]:
    of_vehicle = {} if selection.vehicle is None else {"fleet": selection.fleet, "vehicle": selection.vehicle}
    return {
        "aircraft": selection.aircraft,
        "configuration": selection.configuration,
        **of_vehicle,
        "flights": [asdict(one) for one in lessons],
        "learned": {
            name: {"blocks": one.blocks, "seconds": one.seconds} for name, one in student.learned.items()
        },
        "cells": len(teaching.cells),
        "entries": [
            {
                "structure": one.structure,
                "condition": asdict(one.expectation.condition),
                "supersedes": list(ids),
            }
            for one, ids in teaching.entries
        ],
        "not_identified": lacking,
    }


def _print_learned(result: dict[str, Any]) -> None:
    console = page()
    for one in result["flights"]:
        alerts = f"; accepted with {_many(len(one['alerts']), 'alert')}" if one["alerts"] else ""
        said = f"{one['name']}: {_many(one['blocks'], 'block')}, {one['seconds']:.0f} s{alerts}"
        console.print(escape(said))
    for one in result["entries"]:
        at = one["condition"]
        where = f"{at['airspeed_true_m_s']:.4g} m/s, {at['altitude_m']:.4g} m"
        console.print(f"{one['structure']}: identified at {where}")
    for name, why in result["not_identified"].items():
        console.print(escape(f"{name}: not identified: {why}"))
    if "vehicle" in result:
        of = f"{result['fleet']}/{result['vehicle']}"
        for name, one in result["learned"].items():
            console.print(f"{name}: {one['blocks']} blocks, {one['seconds']:.0f} s more of {of}")


def revert(arguments: argparse.Namespace) -> Done:
    """Take back the newest version."""
    selection = _selected(arguments)
    found = _changed(arguments, "revert", selection, _revert_text(selection))
    return _reverted(found, selection), lambda: page().print(escape(reverted_text(found, selection)))


def remove(arguments: argparse.Namespace) -> Done:
    """Remove entries or what a vehicle taught."""
    selection = _selected(arguments)
    found = _changed(arguments, "delete", selection, "removed")
    result = _reverted(found, selection) | {"restored": []}
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


def _revert_text(selection: Selection) -> str:
    if selection.entry is not None:
        return f"entry {selection.entry} taken back"
    if selection.version is not None:
        return f"back to version {selection.version}" if selection.version else "all versions taken back"
    return "the newest version taken back"


def _reverted(found: Reverted, selection: Selection) -> dict[str, Any]:
    return {"aircraft": selection.aircraft, "configuration": selection.configuration, **asdict(found)}


def reverted_text(found: Reverted, selection: Selection) -> str:
    """What was taken back and what counts again, for a person."""
    what = "versions" if selection.vehicle is not None else "entries"
    again = f"{_ids(what, found.restored)} count again" if found.restored else "nothing counts in their place"
    cells = f"; {_many(found.cells, 'cell')} of the envelope as before" if found.cells else ""
    return f"taken back: {_ids(what, found.withdrawn)}; {again}{cells}"


def _ids(what: str, ids: Sequence[int]) -> str:
    if len(ids) == 1:
        return f"{'entry' if what == 'entries' else 'version'} {ids[0]}"
    shown = ", ".join(map(str, ids[:5])) + (", ..." if len(ids) > 5 else "")
    return f"{len(ids)} {what}" + (f" ({shown})" if ids else "")


def _counts(content: BaselineContent) -> dict[str, Any]:
    kinds = {"entries": content.entries, "references": content.references, "cells": content.cells}
    return {name: len(kind) for name, kind in kinds.items()}


def _counted(counts: dict[str, Any]) -> str:
    entries = f"{counts['entries']} {'entry' if counts['entries'] == 1 else 'entries'}"
    return f"{entries}, {_many(counts['references'], 'reference')} and {_many(counts['cells'], 'cell')}"


def _many(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def who() -> str:
    """The user of this machine who asks; empty where that is not known."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""
