"""`wingwatch monitor`: status and alerts of a recorded flight."""

import argparse
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.api import AlertDocument, air_document, alert_document
from wingwatch.cli.baseline import Baseline, read_baseline
from wingwatch.cli.flight_watch import Watched, load, watch
from wingwatch.cli.progress import Progress, page, write_json
from wingwatch.telemetry import check_name

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    fleet, vehicle = check_name("fleet", arguments.fleet), check_name("vehicle", arguments.vehicle)
    flight, aircraft = load(arguments.flight, arguments.map, arguments.aircraft)
    baseline = Baseline()
    if arguments.baseline is not None:
        baseline = read_baseline(arguments.baseline, fleet, vehicle, aircraft)
    watched = watch(
        flight, aircraft, Progress(), fleet=fleet, vehicle=vehicle,
        references=baseline.references, envelopes=baseline.envelopes,
    )  # fmt: skip
    alerts = [alert_document(alert) for alert in watched.alerts]
    if arguments.json:
        write_json(_result(watched, alerts))
    else:
        _show(page(), watched, alerts)
    return 0


def _result(watched: Watched, alerts: list[AlertDocument]) -> dict[str, Any]:
    monitor = watched.monitor
    return {
        "duration_s": watched.duration_s,
        "observable_s": monitor.observable_s,
        "status": str(monitor.state),
        "reason": monitor.reason,
        "basis": monitor.basis,
        "basis_text": monitor.basis_text,
        "alerts": [alert.model_dump(mode="json") for alert in alerts],
        "air": air_document(monitor.air).model_dump(mode="json") if monitor.air else None,
        "cleaning": watched.cleaning,
    }


def _show(console: Console, watched: Watched, alerts: list[AlertDocument]) -> None:
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
        until = "" if alert.cleared_s is None else f", cleared at {alert.cleared_s:.1f} s"
        console.print(
            f"[bold]{alert.level} {alert.id}[/] raised at {alert.raised_s:.1f} s{until}: {escape(alert.text)}"
        )
        console.print(_evidence(alert))


def _evidence(alert: AlertDocument) -> Table:
    table = Table()
    for name in ("derivative", "estimate", "expected", "z"):
        table.add_column(name, justify="left" if name == "derivative" else "right")
    for part in alert.evidence:
        table.add_row(
            part.derivative,
            f"{part.estimate:.4g} ± {part.standard_error:.2g}",
            f"{part.expected:.4g} ± {part.expected_standard_error:.2g}",
            f"{part.z:.1f}",
        )
    return table
