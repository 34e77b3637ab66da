"""`wingwatch baseline`: what the baseline database expects of an aircraft, since when, and what its flights taught."""

import argparse
import time
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.aircraft import DERIVATIVES, STRUCTURES, Aircraft, load_aircraft
from wingwatch.baselines import (
    Database,
    Expectation,
    ExpectationRecord,
    ReferenceKey,
    apriori_envelope,
    open_database,
)
from wingwatch.cli.baseline import check_exists
from wingwatch.cli.convention import check_convention, in_convention
from wingwatch.cli.faults import CommandError
from wingwatch.cli.progress import page, write_json
from wingwatch.telemetry import check_name

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    aircraft = load_aircraft(arguments.aircraft)
    if arguments.action == "import":
        result = _import(arguments.database, aircraft)
    else:
        check_convention(aircraft, arguments.convention)
        check_exists("DB", arguments.database)
        with open_database(arguments.database) as database:
            result = _kept(database, aircraft, arguments)
    if arguments.json:
        write_json(result)
    elif arguments.action == "import":
        page().print(
            f"{result['imported']} entries of {escape(aircraft.name)} are in {escape(arguments.database)}"
        )
    else:
        _show(page(), result)
    return 0


def _import(where: str, aircraft: Aircraft) -> dict[str, Any]:
    """Put the [[conditions]] of an aircraft file into the database, which is made where there is none."""
    points: list[Expectation] = []
    for structure in STRUCTURES.values():
        for configuration in dict.fromkeys(c.configuration for c in aircraft.conditions):
            if aircraft.entries(structure, configuration):
                points += apriori_envelope(aircraft, structure, configuration).points
    if not points:
        raise CommandError(
            f"aircraft {aircraft.name} states no [[conditions]] with all derivatives of {', '.join(STRUCTURES)}; "
            "give a file that states some"
        )
    now_s = time.time()
    with open_database(where) as database:
        for point in points:
            database.put_expectation(ExpectationRecord.of(aircraft.name, point, now_s))
    return {"aircraft": aircraft.name, "imported": len(points)}


def _kept(database: Database, aircraft: Aircraft, arguments: argparse.Namespace) -> dict[str, Any]:
    """Entries by structure, and what a vehicle's flights taught where one is named."""
    configuration, past = arguments.configuration, arguments.action == "history"
    look = database.history if past else database.expectations
    structures = {
        name: [
            _entry(record, aircraft, arguments.convention)
            for record in look(aircraft.name, configuration, name)
        ]
        for name in STRUCTURES
    }
    result = {
        "aircraft": aircraft.name,
        "configuration": configuration,
        "convention": arguments.convention,
        "structures": structures,
    }
    if arguments.vehicle is None:
        return result
    fleet, vehicle = check_name("fleet", arguments.fleet), check_name("vehicle", arguments.vehicle)
    taught = {}
    for name in STRUCTURES:
        versions = database.reference_history(
            ReferenceKey(fleet, vehicle, aircraft.name, configuration, name)
        )
        taught[name] = [
            {"updated_at_s": v.updated_at_s, "blocks": v.reference.blocks, "seconds": v.reference.seconds}
            for v in (versions if past else versions[-1:])
        ]
    return result | {"fleet": fleet, "vehicle": vehicle, "references": taught}


def _entry(record: ExpectationRecord, aircraft: Aircraft, convention: str) -> dict[str, Any]:
    expectation = record.expectation
    symbols, name = expectation.structure.derivatives, expectation.structure.name
    errors = expectation.standard_error.tolist()
    rows = {
        symbol: {"value": value, "standard_error": error, "unit": DERIVATIVES[symbol].unit}
        for symbol, value, error in zip(symbols, record.value, errors, strict=True)
    }
    mode = {"condition": asdict(expectation.condition), "derivatives": rows}
    made = in_convention({"": {name: mode}}, aircraft, convention, record.configuration)[""][name]
    kept = {
        key: getattr(record, key) for key in ("id", "superseded_by", "provenance", "source", "created_at_s")
    }
    return {**made, **kept}


def _show(console: Console, result: dict[str, Any]) -> None:
    console.print(f"[bold]{result['aircraft']}[/] in configuration {escape(result['configuration'])}")
    for name, entries in result["structures"].items():
        if not entries:
            console.print(f"{name}: the database has no entries; the aircraft file counts")
        for entry in entries:
            console.print(_table(name, entry))
    for name, versions in result.get("references", {}).items():
        console.print(f"{name}, taught by {result['fleet']}/{result['vehicle']}: {_taught(versions)}")


def _table(name: str, entry: dict[str, Any]) -> Table:
    at = entry["condition"]
    until = "" if entry["superseded_by"] is None else f", superseded by {entry['superseded_by']}"
    title = (
        f"{name} at {at['airspeed_true_m_s']:g} m/s, {at['altitude_m']:g} m: {entry['provenance']}, "
        f"entry {entry['id']} of {_date(entry['created_at_s'])}{until}"
    )
    table = Table(title=title, title_justify="left", title_style="bold", caption=escape(entry["source"]))
    for column in ("derivative", "unit", "expected"):
        table.add_column(column, justify="right" if column == "expected" else "left")
    for symbol, row in entry["derivatives"].items():
        table.add_row(
            row.get("name", symbol), row["unit"], f"{row['value']:.4g} ± {row['standard_error']:.2g}"
        )
    return table


def _taught(versions: Sequence[dict[str, Any]]) -> str:
    parts = [f"{v['blocks']} blocks, {v['seconds']:.0f} s ({_date(v['updated_at_s'])})" for v in versions]
    return "; ".join(parts) or "nothing yet"


def _date(at_s: float) -> str:
    return datetime.fromtimestamp(at_s, UTC).strftime("%Y-%m-%d %H:%M UTC")
