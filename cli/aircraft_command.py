"""`wingwatch aircraft`: aircraft files written from what people have, checked, and handed on."""

import argparse
from typing import Any

from rich.markup import escape
from rich.table import Table

from wingwatch.aircraft import (
    STRUCTURES,
    Aircraft,
    FlightCondition,
    check_file,
    library_names,
    load_aircraft,
)
from wingwatch.cli.aircraft_check import check_object, say_check
from wingwatch.cli.aircraft_export import export_aircraft
from wingwatch.cli.aircraft_new import new_aircraft
from wingwatch.operations.faults import CommandError
from wingwatch.operations.progress import page, write_json

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    return {"list": _list, "show": _show, "check": _check, "new": new_aircraft, "export": export_aircraft}[
        arguments.action
    ](arguments)


def _list(arguments: argparse.Namespace) -> int:
    found = [_summary(load_aircraft(name)) for name in library_names()]
    if arguments.json:
        write_json({"aircraft": found})
        return 0
    table = Table("aircraft", "mass, kg", "span, m", "cruise, m/s", "derivatives from")
    for one in found:
        cells = (
            "-" if one[key] is None else f"{one[key]:g}" for key in ("mass_kg", "span_m", "airspeed_true_m_s")
        )
        table.add_row(escape(one["name"]), *cells, one["derivatives_from"])
    page().print(table)
    return 0


def _summary(aircraft: Aircraft) -> dict[str, Any]:
    stated = [c.airspeed_true_m_s for c in aircraft.conditions[:1]]
    cruise = aircraft.envelope.cruise.airspeed_true_m_s if aircraft.envelope else None
    return {
        "name": aircraft.name,
        "description": aircraft.description.strip(),
        "mass_kg": None if aircraft.mass is None else aircraft.mass.mass_kg,
        "span_m": None if aircraft.geometry is None else aircraft.geometry.span_m,
        "wing_area_m2": None if aircraft.geometry is None else aircraft.geometry.wing_area_m2,
        "airspeed_true_m_s": cruise or (stated[0] if stated else None),
        "conditions": len(aircraft.conditions),
        "derivatives_from": "coefficients" if aircraft.coefficients else "conditions",
    }


def _show(arguments: argparse.Namespace) -> int:
    aircraft = load_aircraft(arguments.file)
    summary = _summary(aircraft)
    summary["structures"] = [
        s.name for s in STRUCTURES.values() if aircraft.coefficients or aircraft.entries(s)
    ]
    if arguments.json:
        write_json(summary)
        return 0
    console = page()
    console.print(escape(f"{aircraft.name}  {summary['description']}"))
    for key in ("mass_kg", "span_m", "wing_area_m2", "airspeed_true_m_s"):
        if summary[key] is not None:
            console.print(f"{key} = {summary[key]:g}")
    console.print(
        f"derivatives from {summary['derivatives_from']}: {', '.join(summary['structures']) or 'none'}"
    )
    return 0


def _check(arguments: argparse.Namespace) -> int:
    aircraft = load_aircraft(arguments.file)
    found = check_file(aircraft, _asked(arguments))
    if arguments.json:
        write_json(check_object(aircraft, found))
    else:
        say_check(page(), aircraft, found)
    if not found.usable:
        raise CommandError(
            f"{aircraft.name}: {next(f.text for f in found.findings if f.standing == 'refusal')}"
        )
    return 0


def _asked(arguments: argparse.Namespace) -> FlightCondition | None:
    if arguments.airspeed is None:
        if arguments.altitude is not None:
            raise CommandError("--altitude is given without --airspeed; give both")
        return None
    return FlightCondition(arguments.airspeed, arguments.altitude or 0.0)
