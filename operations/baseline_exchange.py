"""`wingwatch baseline export` and `import`: expectations and what vehicles taught, from files and into them."""

import argparse
import time
from typing import Any

from rich.markup import escape

from wingwatch.aircraft import STRUCTURES, Aircraft, load_aircraft
from wingwatch.baselines import (
    BaselineContent,
    BaselineLedger,
    ChangeRecord,
    Expectation,
    ExpectationRecord,
    apriori_envelope,
    open_database,
)
from wingwatch.operations.baseline import check_exists
from wingwatch.operations.baseline_files import read_content, write_content
from wingwatch.operations.baseline_pages import many
from wingwatch.operations.baseline_revert import Done, who
from wingwatch.operations.faults import CommandError
from wingwatch.operations.output_files import check_output
from wingwatch.operations.progress import page

__all__ = ["changes_of", "export", "import_", "imported_object"]


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
    counts = imported_object(content)
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
        result = imported_object(content)
        said = f"{_counted(result)} are in {arguments.database}"
    with open_database(arguments.database) as database:
        changes = changes_of(content, now_s, who(), f"imported from {source}")
        stored = BaselineLedger(database).put(changes, content)
    result["stored"] = stored
    known = "" if stored else "; all of it was there already"
    return result, lambda: page().print(escape(said + known))


def _stated(aircraft: Aircraft) -> list[Expectation]:
    """The expectations that an aircraft file gives: of its conditions, else of its coefficients on the monitor's grid.

    Raises:
        CommandError: it gives none.
    """
    stated = [
        (structure, configuration)
        for structure in STRUCTURES.values()
        for configuration in dict.fromkeys(c.configuration for c in aircraft.conditions)
        if aircraft.entries(structure, configuration)
    ]
    try:
        envelopes = [
            apriori_envelope(aircraft, structure, configuration)
            for structure, configuration in stated or [(s, "clean") for s in STRUCTURES.values()]
        ]
    except ValueError as error:
        raise CommandError(f"aircraft {aircraft.name}: {error}") from None
    points = [point for envelope in envelopes for point in envelope.points]
    if not points:
        raise CommandError(envelopes[0].absent)
    return points


def changes_of(content: BaselineContent, at_s: float, by: str, text: str) -> list[ChangeRecord]:
    """A change for each aircraft and each vehicle that content is of, made by somebody."""
    owners: dict[tuple[str, str, str | None, str | None], None] = {}
    for entry in content.entries:
        owners[entry.aircraft, entry.configuration, None, None] = None
    for key in (*(one.key for one in content.references), *(one.key for one in content.cells)):
        owners[key.aircraft, key.configuration, key.fleet, key.vehicle] = None
    return [
        ChangeRecord(at_s, "import", by, aircraft, configuration, text, fleet, vehicle)
        for aircraft, configuration, fleet, vehicle in owners
    ]


def imported_object(content: BaselineContent) -> dict[str, Any]:
    """How many entries, references and cells content has, for JSON."""
    kinds = {"entries": content.entries, "references": content.references, "cells": content.cells}
    return {name: len(kind) for name, kind in kinds.items()}


def _counted(counts: dict[str, Any]) -> str:
    entries = f"{counts['entries']} {'entry' if counts['entries'] == 1 else 'entries'}"
    return f"{entries}, {many(counts['references'], 'reference')} and {many(counts['cells'], 'cell')}"
