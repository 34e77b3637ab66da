"""`wingwatch report`: what a recorded flight came to, as one page for a colleague."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from wingwatch.cli.flight_watch import load
from wingwatch.cli.monitor_command import watched_object
from wingwatch.cli.report_page.content import FlightContent, collect
from wingwatch.cli.report_page.outcome_sections import headline
from wingwatch.cli.report_page.report_page import report_html
from wingwatch.operations.faults import CommandError
from wingwatch.operations.output_files import check_output
from wingwatch.operations.plausible import checked, for_json, show_doubts
from wingwatch.operations.progress import Progress, page, write_json
from wingwatch.pages.whole_file import write_whole
from wingwatch.telemetry.plausibility import Verdict

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    out: Path = arguments.out
    check_output("--out", out, (".html", ".htm"))
    inputs = [
        path for path in (arguments.flight, arguments.map, Path(arguments.aircraft)) if path is not None
    ]
    if any(out.resolve() == path.resolve() for path in inputs):
        raise CommandError(f"--out {out} is a file that is read; give another name")
    flight, aircraft = load(arguments.flight, arguments.map, arguments.aircraft)
    findings = checked(flight, aircraft, arguments.accept_implausible)
    doubts = tuple(one.sentence for one in findings if one.standing is not Verdict.RIGHT)
    flight = replace(flight, report=replace(flight.report, notes=(*flight.report.notes, *doubts)))
    content = collect(flight, aircraft, Progress())
    text = report_html(content)
    write_whole(out, text)
    if arguments.json:
        write_json(_result(content, out, len(text.encode())) | {"plausibility": for_json(findings)})
        return 0
    console = page()
    answer, lead = headline(content)
    console.print(answer, style="bold", markup=False)
    console.print(lead, markup=False)
    show_doubts(console, findings)
    console.print(f"report in {out}", markup=False)
    return 0


def _result(content: FlightContent, out: Path, size: int) -> dict[str, Any]:
    """What ``monitor`` and ``estimate`` give, and the fit of each manoeuvre."""
    found = watched_object(content.watched, content.alerts, content.evidence, content.could_see)
    fit = [
        {
            "structure": one.structure, "from_s": float(one.time_s[0]), "to_s": float(one.time_s[-1]),
            "estimator": one.estimator, "surface_rms_rad": one.moved_rad,
            "channels": {
                channel.name: {
                    "r_squared": channel.r_squared, "tic": channel.tic,
                    "r_squared_expected": channel.r_squared_expected, "left_over_noise": channel.over_noise,
                }
                for channel in one.channels
            },
        }
        for one in content.manoeuvres
    ]  # fmt: skip
    return found | dict(content.derivatives) | {"fit": fit, "report": str(out), "bytes": size}
