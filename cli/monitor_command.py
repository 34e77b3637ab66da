"""`wingwatch monitor`: status and alerts of a recorded flight, or of many, one line each."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.aircraft import Convention, load_aircraft
from wingwatch.api import (
    AlertDocument,
    CouldSeeDocument,
    air_document,
    alert_document,
    could_see_documents,
)
from wingwatch.cli.alert_texts import candidate_text, plus_minus, smallest_size_text, spaced
from wingwatch.cli.flight_clocks import clocks_text, on_clock
from wingwatch.cli.flight_watch import Watched, load, watch
from wingwatch.cli.forgetting import forgetting_object
from wingwatch.cli.manoeuvres import Verdicts, manoeuvres_object, show_manoeuvres
from wingwatch.cli.many_flights import each_flight, end_of_many, flight_files, is_many, print_line
from wingwatch.cli.unusable import refuse_unusable
from wingwatch.monitor import MonitorStart, VehicleMemory
from wingwatch.operations.baseline import Baseline, read_baseline
from wingwatch.operations.convention import check_convention, in_convention
from wingwatch.operations.plausible import checked, for_json, show_doubts
from wingwatch.operations.progress import Progress, page, write_json
from wingwatch.telemetry import check_name, load_map
from wingwatch.telemetry.plausibility import Finding

__all__ = ["alerts_of", "judged", "run", "watched_object"]

_Rows = list[dict[str, Any]]
"""Evidence of one alert, a row a derivative."""

_ERRORS = ("standard_error", "expected", "expected_standard_error")
_LEVELS = ("watch", "warning", "critical")
_STATES = ("healthy", "stale", "not_observable", "unknown", "degraded")  # the best first


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    check_name("fleet", arguments.fleet), check_name("vehicle", arguments.vehicle)
    if len(arguments.flights) > 1 or is_many(arguments.flights):
        return _run_many(arguments)
    watched, findings = _watched(arguments.flights[0], arguments)
    found = alerts_of(watched, arguments.convention)
    if arguments.json:
        said = _said(watched, findings, arguments)
        write_json(watched_object(watched, *found) | said)
    else:
        console = page()
        _show(console, watched, *found)
        if arguments.forgetting is not None:
            console.print(forgetting_object(arguments.forgetting, watched.flight)["text"])
        if arguments.manoeuvres:
            show_manoeuvres(console, watched.manoeuvres)
        show_doubts(console, findings)
    return 0


def _run_many(arguments: argparse.Namespace) -> int:
    """One line a flight, the worst first."""
    check_convention(load_aircraft(arguments.aircraft), arguments.convention)
    if arguments.map is not None:
        load_map(arguments.map)
    results = each_flight(judged, flight_files(arguments.flights), arguments)
    results.sort(key=_badness, reverse=True)
    if arguments.json:
        write_json(results)
    else:
        console = page()
        for result in results:
            print_line(console, result.get("status", "not judged"), result, _line(result))
    return end_of_many(results)


def judged(flight: Path, arguments: argparse.Namespace) -> dict[str, Any]:
    """The JSON object of one of many flights."""
    watched, findings = _watched(flight, arguments)
    said = _said(watched, findings, arguments)
    return watched_object(watched, *alerts_of(watched, arguments.convention)) | said


def _said(watched: Watched, findings: Sequence[Finding], arguments: argparse.Namespace) -> dict[str, Any]:
    """What the object has beside that of ``watched_object``."""
    said: dict[str, Any] = {"convention": arguments.convention, "plausibility": for_json(findings)}
    if arguments.forgetting is not None:
        said["forgetting"] = forgetting_object(arguments.forgetting, watched.flight)
    if arguments.manoeuvres:
        said["manoeuvres"] = manoeuvres_object(watched.manoeuvres)
    return said


def _badness(result: Mapping[str, Any]) -> tuple[float, ...]:
    """By the worst alert still in force, then any alert, then what could not be judged, then the state."""
    if "error" in result:
        return (0.0, 1.0, 0.0)
    levels = [_LEVELS.index(a["level"]) + (0.5 if a["cleared_s"] is None else 0.0) for a in result["alerts"]]
    state = _STATES.index(result["status"]) if result["status"] in _STATES else 0
    return (1.0 + max(levels), float(len(levels)), float(state)) if levels else (0.0, 0.0, float(state))


def _line(result: Mapping[str, Any]) -> str:
    if "error" in result:
        return str(result["error"]).removeprefix(f"{result['flight']}: ")
    seen = f"{result['observable_s']:.0f} of {result['duration_s']:.0f} s observable"
    alerts = [f"{a['level']} at {a['raised_s']:.1f} s: {a['text']}" for a in result["alerts"]]
    doubts = [
        f"{one['channel']} {one['check']}" for one in result["plausibility"] if one["standing"] != "right"
    ]
    doubtful = f"; doubtful: {', '.join(doubts)}" if doubts else ""
    return f"{' '.join(alerts) or result['reason']} ({seen}{doubtful})"


def _watched(path: Path, arguments: argparse.Namespace) -> tuple[Watched, tuple[Finding, ...]]:
    flight, aircraft = load(path, arguments.map, arguments.aircraft)
    check_convention(aircraft, arguments.convention)
    findings = checked(flight, aircraft, arguments.accept_implausible)
    baseline = Baseline()
    if arguments.baseline is not None:
        baseline = read_baseline(arguments.baseline, arguments.fleet, arguments.vehicle, aircraft)
    verdicts = Verdicts()
    watched = watch(
        flight, aircraft, Progress(getattr(arguments, "progress", True)),
        fleet=arguments.fleet, vehicle=arguments.vehicle,
        start=MonitorStart(
            memory=VehicleMemory(baseline.references, baseline.envelopes), memory_s=arguments.forgetting
        ),
        listener=verdicts if arguments.manoeuvres else None,
    )  # fmt: skip
    refuse_unusable(watched)
    found = verdicts.end(watched.monitor) if arguments.manoeuvres else ()
    return replace(watched, manoeuvres=found), findings


def alerts_of(
    watched: Watched, convention: str
) -> tuple[list[AlertDocument], Mapping[str, _Rows], list[CouldSeeDocument]]:
    """Alerts, their evidence by id, and what the flight could have shown."""
    alerts = [alert_document(alert) for alert in watched.alerts]
    could_see = could_see_documents(watched.monitor.could_see())
    return alerts, {alert.id: _evidence(alert, watched, convention) for alert in alerts}, could_see


def _evidence(alert: AlertDocument, watched: Watched, convention: str) -> _Rows:
    """The alert's evidence in a convention; ``z`` is what the test saw, and stays."""
    rows: _Rows = [part.model_dump(mode="json") for part in alert.evidence]
    if convention == Convention.CONCISE or not rows:
        return rows
    monitor, parts = watched.monitor, {row["derivative"]: row for row in rows}
    condition = asdict(watched.conditions[alert.id])
    modes = {
        name: {
            "condition": condition,
            "derivatives": {
                s: {"value": parts[s]["estimate"], **{key: parts[s][key] for key in _ERRORS}}
                for s in coordinates.structure.derivatives
                if s in parts
            },
        }
        for name, coordinates in monitor.judge.coordinates.items()
    }
    made = in_convention({"": modes}, monitor.aircraft, convention, monitor.configuration)[""]
    for mode in made.values():
        for symbol, entry in mode["derivatives"].items():
            parts[symbol] |= {"estimate": entry.pop("value"), **entry}
    return rows


def watched_object(
    watched: Watched,
    alerts: list[AlertDocument],
    evidence: Mapping[str, _Rows],
    could_see: list[CouldSeeDocument],
) -> dict[str, Any]:
    """The JSON object of a flight, of what ``alerts_of`` gives."""
    monitor = watched.monitor
    return {
        "duration_s": watched.duration_s,
        "observable_s": monitor.observable_s,
        "clocks": [asdict(clock) for clock in watched.clocks],
        "status": str(monitor.state),
        "reason": monitor.reason,
        "basis": monitor.basis,
        "basis_text": monitor.basis_text,
        "alerts": [
            alert.model_dump(mode="json")
            | {"evidence": evidence[alert.id], "clock": watched.clock_numbers.get(alert.id, 0)}
            for alert in alerts
        ],
        "could_see": [one.model_dump(mode="json") for one in could_see],
        "air": air_document(monitor.air).model_dump(mode="json") if monitor.air else None,
        "cleaning": watched.cleaning,
    }


def _show(
    console: Console,
    watched: Watched,
    alerts: list[AlertDocument],
    evidence: Mapping[str, _Rows],
    could_see: list[CouldSeeDocument],
) -> None:
    monitor = watched.monitor
    console.print(f"[bold]{escape(watched.flight.source)}[/]  aircraft {monitor.aircraft.name}")
    console.print(escape(watched.cleaning_text), style="dim")
    console.print(
        f"[bold]{str(monitor.state).replace('_', ' ')}[/]: {escape(monitor.reason)} "
        f"({monitor.observable_s:.0f} of {watched.duration_s:.0f} s observable)"
    )
    console.print(escape(monitor.basis_text))
    if monitor.air is not None:
        console.print(f"At the end {escape(monitor.air.text)}.")
    if not alerts:
        console.print("No alert.")
    if said := clocks_text(watched.clocks):
        console.print(said)
    for alert in alerts:
        clock = on_clock(watched.clock_numbers.get(alert.id, 0)) if len(watched.clocks) > 1 else ""
        _show_alert(console, alert, evidence[alert.id], clock)
    if could_see:
        console.print("What this flight could have shown")
        console.print(_could_see_table(could_see))


def _show_alert(console: Console, alert: AlertDocument, evidence: _Rows, clock: str = "") -> None:
    part = "" if alert.channel is None else f" ({escape(alert.channel)})"
    until = "" if alert.cleared_s is None else f", cleared at {alert.cleared_s:.1f} s"
    console.print(
        f"[bold]{alert.level} {alert.id}[/]{part} raised at {alert.raised_s:.1f} s{clock}{until}: {escape(alert.text)}"
    )
    if alert.candidates:
        console.print(f"Possible causes: {escape('; '.join(map(candidate_text, alert.candidates)))}")
    if evidence:
        console.print(_table(evidence))


def _could_see_table(could_see: list[CouldSeeDocument]) -> Table:
    table = Table()
    for name in ("cause", "part", "smallest size", "input that would help"):
        table.add_column(name, justify="right" if name == "smallest size" else "left")
    for one in could_see:
        seen = smallest_size_text(one)
        table.add_row(
            spaced(one.cause), escape(one.channel or "airframe"), escape(seen), escape(one.input or "-")
        )
    return table


def _table(evidence: _Rows) -> Table:
    table = Table()
    for name in ("derivative", "estimate", "expected", "z"):
        table.add_column(name, justify="left" if name == "derivative" else "right")
    for part in evidence:
        table.add_row(
            part.get("name", part["derivative"]),
            plus_minus(part["estimate"], part["standard_error"]),
            plus_minus(part["expected"], part["expected_standard_error"]),
            "-" if part["z"] is None else f"{part['z']:.1f}",
        )
    return table
