"""`wingwatch monitor`: status and alerts of a recorded flight."""

import argparse
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.aircraft import Convention
from wingwatch.api import (
    AlertDocument,
    CandidateDocument,
    CouldSeeDocument,
    air_document,
    alert_document,
    could_see_documents,
)
from wingwatch.cli.baseline import Baseline, read_baseline
from wingwatch.cli.convention import check_convention, in_convention
from wingwatch.cli.flight_watch import Watched, load, watch
from wingwatch.cli.progress import Progress, page, write_json
from wingwatch.pages.texts import number, probability_text
from wingwatch.telemetry import check_name

__all__ = ["run"]

_Rows = list[dict[str, Any]]
"""Evidence of one alert, a row a derivative."""

_ERRORS = ("standard_error", "expected", "expected_standard_error")
_SIZELESS = ("surface_stuck", "sensor_freeze")  # there or not


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    fleet, vehicle = check_name("fleet", arguments.fleet), check_name("vehicle", arguments.vehicle)
    flight, aircraft = load(arguments.flight, arguments.map, arguments.aircraft)
    check_convention(aircraft, arguments.convention)
    baseline = Baseline()
    if arguments.baseline is not None:
        baseline = read_baseline(arguments.baseline, fleet, vehicle, aircraft)
    watched = watch(
        flight, aircraft, Progress(), fleet=fleet, vehicle=vehicle,
        references=baseline.references, envelopes=baseline.envelopes,
    )  # fmt: skip
    alerts = [alert_document(alert) for alert in watched.alerts]
    could_see = could_see_documents(watched.monitor.could_see())
    evidence = {alert.id: _evidence(alert, watched, arguments.convention) for alert in alerts}
    if arguments.json:
        write_json(_result(watched, alerts, evidence, could_see) | {"convention": arguments.convention})
    else:
        _show(page(), watched, alerts, evidence, could_see)
    return 0


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


def _result(
    watched: Watched,
    alerts: list[AlertDocument],
    evidence: Mapping[str, _Rows],
    could_see: list[CouldSeeDocument],
) -> dict[str, Any]:
    monitor = watched.monitor
    return {
        "duration_s": watched.duration_s,
        "observable_s": monitor.observable_s,
        "status": str(monitor.state),
        "reason": monitor.reason,
        "basis": monitor.basis,
        "basis_text": monitor.basis_text,
        "alerts": [alert.model_dump(mode="json") | {"evidence": evidence[alert.id]} for alert in alerts],
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
    for alert in alerts:
        _show_alert(console, alert, evidence[alert.id])
    if could_see:
        console.print("What this flight could have shown")
        console.print(_could_see_table(could_see))


def _show_alert(console: Console, alert: AlertDocument, evidence: _Rows) -> None:
    part = "" if alert.channel is None else f" ({escape(alert.channel)})"
    until = "" if alert.cleared_s is None else f", cleared at {alert.cleared_s:.1f} s"
    console.print(
        f"[bold]{alert.level} {alert.id}[/]{part} raised at {alert.raised_s:.1f} s{until}: {escape(alert.text)}"
    )
    if alert.candidates:
        console.print(f"Possible causes: {escape('; '.join(map(_candidate, alert.candidates)))}")
    if evidence:
        console.print(_table(evidence))


def _candidate(one: CandidateDocument) -> str:
    where = "" if one.channel is None else f" of {one.channel}"
    probability = math.nan if one.probability is None else one.probability
    return f"{_words(one.cause)}{where}, probability {probability_text(probability)}"


def _could_see_table(could_see: list[CouldSeeDocument]) -> Table:
    table = Table()
    for name in ("cause", "part", "smallest size", "input that would help"):
        table.add_column(name, justify="right" if name == "smallest size" else "left")
    for one in could_see:
        seen = _smallest_size(one)
        table.add_row(
            _words(one.cause), escape(one.channel or "airframe"), escape(seen), escape(one.input or "-")
        )
    return table


def _smallest_size(one: CouldSeeDocument) -> str:
    if one.smallest_size is None:
        return "not seen"
    return "seen" if one.cause in _SIZELESS else f"{number(one.smallest_size)} {one.unit}".rstrip()


def _table(evidence: _Rows) -> Table:
    table = Table()
    for name in ("derivative", "estimate", "expected", "z"):
        table.add_column(name, justify="left" if name == "derivative" else "right")
    for part in evidence:
        table.add_row(
            part.get("name", part["derivative"]),
            _number(part["estimate"], part["standard_error"]),
            _number(part["expected"], part["expected_standard_error"]),
            "-" if part["z"] is None else f"{part['z']:.1f}",
        )
    return table


def _number(value: float | None, error: float | None) -> str:
    return "-" if value is None or error is None else f"{value:.4g} ± {error:.2g}"


def _words(name: str) -> str:
    return name.replace("_", " ")
