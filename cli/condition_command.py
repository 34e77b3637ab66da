"""`wingwatch condition`: what a recorded flight says of its sensors, its air and its trims."""

import argparse
import math
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.cli.flight_watch import load
from wingwatch.diagnosis.condition_report import Conditioned, condition
from wingwatch.diagnosis.static_derivatives import StaticDerivatives
from wingwatch.operations.faults import CommandError
from wingwatch.operations.plausible import findings_of, for_json
from wingwatch.operations.progress import Progress, page, write_json
from wingwatch.telemetry import write_flight
from wingwatch.telemetry.conditioning import AirQuality, Parameter
from wingwatch.telemetry.plausibility import Finding, Verdict

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    out: Path | None = arguments.out
    if out is not None:
        _check_out(out, arguments.flight)
    flight, aircraft = load(arguments.flight, arguments.map, arguments.aircraft)
    found = condition(flight, aircraft, arguments.second_imu, Progress().track)
    if not found.samples:
        raise CommandError(f"{flight.source}: the cleaner accepted no sample ({found.cleaning_text})")
    if found.is_empty:
        raise CommandError(f"{flight.source}: nothing could be found out: {'; '.join(found.notes)}")
    if out is not None and found.corrected is not None:
        write_flight(found.corrected, out)
    findings = findings_of(flight, aircraft)
    if arguments.json:
        write_json(_result(found, out) | {"plausibility": for_json(findings)})
    else:
        console = page()
        _show(console, found, flight.source, aircraft.name, out)
        _show_findings(console, findings)
    return 0


def _check_out(out: Path, flight: Path) -> None:
    """Refuse before the work what could not be written after it."""
    if out.suffix.lower() not in (".csv", ".parquet"):
        raise CommandError(
            f"--out {out}: a flight is written as .csv or .parquet; choose one of these suffixes"
        )
    if not out.parent.is_dir():
        raise CommandError(f"--out {out}: there is no folder {out.parent}; create it")
    if out.resolve() == flight.resolve():
        raise CommandError(f"--out {out} is the flight's own file; give another name")


def _parameter(p: Parameter) -> dict[str, Any]:
    return {
        "name": p.name, "value": p.value, "standard_error": p.standard_error, "unit": p.unit,
        "observable": p.observable, "reason": p.reason,
    }  # fmt: skip


def _result(found: Conditioned, out: Path | None) -> dict[str, Any]:
    path, air = found.path, found.air
    return {
        "samples": found.samples,
        "delays": [
            {**_parameter(row.found), "channel": row.channel, "stated_s": row.stated_s, "used_s": row.used_s}
            for row in found.delays
        ],
        "servos": [_parameter(p) for p in found.servos],
        "air": None if air is None else _air_object(air),
        "sensors": [] if path is None else [_parameter(p) for p in path.parameters],
        "hardly_told_apart": [] if path is None else [list(pair) for pair in path.confounded],
        "fit": {} if path is None else dict(path.fit),
        "compatible": None if path is None else path.compatible,
        "static": None if found.static is None else _static_object(found.static, found.margin),
        "centre": [_parameter(p) for p in found.centre],
        "notes": found.notes,
        "out": None if out is None else str(out),
    }


def _air_object(air: AirQuality) -> dict[str, Any]:
    return {
        "gusts": [_parameter(p) for p in (*air.sigma, *air.in_band)],
        "share": list(air.share),
        "fit_for_estimating": air.fit_for_estimating,
        "text": air.text,
    }


def _static_object(static: StaticDerivatives, margin: Parameter | None) -> dict[str, Any]:
    return {
        "segments": static.segments,
        "airspeed_m_s": static.airspeed_m_s,
        "misfit": list(static.misfit),
        "parameters": [_parameter(p) for p in _static_parameters(static, margin)],
    }


def _static_parameters(static: StaticDerivatives, margin: Parameter | None) -> tuple[Parameter, ...]:
    return (
        static.elevator_slope, static.elevator_at_zero, static.moment_ratio, static.normal_force_slope,
        static.normal_force_at_zero, static.elevator_against_normal_force,
        *(() if margin is None else (margin,)),
    )  # fmt: skip


def _show(console: Console, found: Conditioned, source: str, aircraft: str, out: Path | None) -> None:
    console.print(f"[bold]{escape(source)}[/]  aircraft {aircraft}")
    console.print(escape(found.cleaning_text), style="dim")
    if found.delays:
        console.print(_delays(found))
    if found.servos:
        console.print(_table("surfaces behind their commands", found.servos))
    if found.air is not None:
        console.print(_table("gusts", (*found.air.sigma, *found.air.in_band)))
        console.print(f"  {escape(found.air.text)}")
    if found.path is not None:
        console.print(_table("errors of sensors", found.path.parameters))
        for one, other in found.path.confounded:
            console.print(f"  hardly distinguished: {one} and {other}", style="dim")
        ratio, worst = max((ratio, name) for name, ratio in found.path.fit.items())
        verdict = "one rigid body's motion" if found.path.compatible else "not one rigid body's motion"
        console.print(
            f"  the readings are {verdict}: what is left is up to {ratio:.2g} times the noise ({worst})"
        )
    if found.static is not None:
        rows = _static_parameters(found.static, found.margin)
        console.print(_table(f"trimmed flight, {found.static.segments} segments", rows))
    if found.centre:
        console.print(_table("second accelerometers, centre of gravity", found.centre))
    for note in found.notes:
        console.print(escape(note))
    if out is not None:
        console.print(f"corrected flight in {escape(str(out))}")


def _show_findings(console: Console, findings: tuple[Finding, ...]) -> None:
    """Every channel that can be judged by the others, and the lines that would mend what is not right."""
    if not findings:
        return
    table = _titled("channels against one another", ("channel", "check", "found", "unit", ""))
    for one in findings:
        found = f"{one.measured:.4g} ± {one.standard_error:.2g}" if math.isfinite(one.measured) else "-"
        table.add_row(one.channel, one.check, found, one.unit, str(one.standing))
    console.print(table)
    for one in findings:
        if one.standing is not Verdict.RIGHT:
            console.print(f"  {escape(one.sentence)}", soft_wrap=True)


def _delays(found: Conditioned) -> Table:
    """Delays behind the gyros beside those of the aircraft file."""
    last = ("",) if any(row.found.reason for row in found.delays) else ()
    table = _titled("delays behind the gyros, s", ("channel", "found", "aircraft file", "taken", *last))
    for row in found.delays:
        stated, taken = f"{row.stated_s:.3f}", f"{row.used_s:.3f}"
        table.add_row(
            row.channel, _number(row.found), stated, taken, *_why(row.found), style=_style(row.found)
        )
    return table


def _table(title: str, parameters: tuple[Parameter, ...]) -> Table:
    last = ("",) if any(p.reason for p in parameters) else ()
    table = _titled(title, ("what", "found", "unit", *last))
    for p in parameters:
        table.add_row(p.name, _number(p), p.unit, *_why(p), style=_style(p))
    return table


def _titled(title: str, columns: tuple[str, ...]) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold")
    for name in columns:
        table.add_column(name, justify="right" if name in ("found", "aircraft file", "taken") else "left")
    return table


def _why(p: Parameter) -> tuple[str, ...]:
    """The reason's cell, where there is one."""
    return (escape(p.reason),) if p.reason else ()


def _style(p: Parameter) -> str | None:
    return None if p.observable else "dim"


def _number(p: Parameter) -> str:
    if not (p.observable and math.isfinite(p.value) and math.isfinite(p.standard_error)):
        return "-"
    # as many digits as the error gives a meaning to, two of its own
    places = min(max(1 - math.floor(math.log10(p.standard_error)), 0), 9) if p.standard_error > 0.0 else 4
    return f"{p.value:.{places}f} ± {p.standard_error:.2g}"
