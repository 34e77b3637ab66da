"""`wingwatch baseline learn`: flights in, what they taught into the database."""

import argparse
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.markup import escape

from wingwatch.aircraft import STRUCTURES, Aircraft, load_aircraft
from wingwatch.baselines import (
    BaselineLedger,
    CellRecord,
    ChangeRecord,
    Database,
    Selection,
    Teaching,
    open_database,
)
from wingwatch.cli.baseline_learning import LEARNED, Lesson, Student, digest_of, identified_entries
from wingwatch.cli.flight_watch import OFFLINE
from wingwatch.monitor import MonitorStart, VehicleMemory
from wingwatch.operations.baseline import stored_cells, stored_envelopes, stored_references
from wingwatch.operations.baseline_pages import many
from wingwatch.operations.baseline_revert import Done, who
from wingwatch.operations.faults import CommandError
from wingwatch.operations.plausible import checked
from wingwatch.operations.progress import Progress, page
from wingwatch.operations.surface_travel import surface_travel
from wingwatch.service.kernel_wheel import take_or_say
from wingwatch.telemetry import check_name, load_flight

__all__ = ["learn"]


def learn(arguments: argparse.Namespace) -> Done:
    """Teach the database flights that somebody declares healthy."""
    aircraft = load_aircraft(arguments.aircraft)
    fleet = check_name("fleet", arguments.fleet)
    vehicle = None if arguments.vehicle is None else check_name("vehicle", arguments.vehicle)
    selection = Selection(aircraft.name, arguments.configuration, fleet=fleet, vehicle=vehicle)
    digests = _distinct(arguments.flights)
    take_or_say()
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
        counted = f"{many(len(lessons), 'flight')}, {many(blocks, 'block')}"
        source = f"{LEARNED} {counted}: {said}"
        change = ChangeRecord(
            time.time(), "learn", who(), aircraft.name, arguments.configuration, counted,
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
        alerts = f"; accepted with {many(len(one['alerts']), 'alert')}" if one["alerts"] else ""
        said = f"{one['name']}: {many(one['blocks'], 'block')}, {one['seconds']:.0f} s{alerts}"
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
