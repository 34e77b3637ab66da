"""`wingwatch diagnose`: what a simulation gets wrong against a measured flight, why, and the model extended."""

import argparse
import datetime
from pathlib import Path

from wingwatch.aircraft import aircraft_toml, load_aircraft, parse_aircraft
from wingwatch.cli.diagnose_page import show
from wingwatch.diagnosis import Diagnosis, as_json, write_report
from wingwatch.diagnosis.summary import cause_title, parameter_text
from wingwatch.operations.diagnosing import diagnose_file
from wingwatch.operations.faults import CommandError, say
from wingwatch.operations.output_files import check_output
from wingwatch.operations.plausible import for_json
from wingwatch.operations.progress import Progress, page, write_json
from wingwatch.pages.texts import probability_text
from wingwatch.pages.whole_file import write_whole

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    _check(arguments)
    aircraft = load_aircraft(arguments.aircraft)
    with Progress().follow() as progress:
        found, findings = diagnose_file(
            arguments.flight, aircraft, arguments.map, arguments.validate, progress,
            validate_map=arguments.validate_map, accepted=arguments.accept_implausible,
        )  # fmt: skip
        if arguments.report is not None:
            progress("writing the report", 1.0)
            write_report(found, arguments.report)
    model = _write_model(found, arguments.model)
    if arguments.json:
        files = {"report": _name(arguments.report), "model_file": _name(model)}
        write_json(as_json(found) | files | {"plausibility": for_json(findings)})
        return 0
    console = page()
    show(console, found)
    for what, path in (("report", arguments.report), ("extended aircraft file", model)):
        if path is not None:
            console.print(f"{what} in {path}", markup=False)
    return 0


def _check(arguments: argparse.Namespace) -> None:
    """Refuse before the work what could not be written after it."""
    if arguments.validate_map is not None and arguments.validate is None:
        raise CommandError("--validate-map is of the flight of --validate; give that too")
    read = (arguments.flight, arguments.map, arguments.validate, arguments.validate_map)
    inputs = [path for path in read if path is not None]
    inputs.append(Path(arguments.aircraft))
    for option, out, suffixes in (
        ("--report", arguments.report, (".html", ".htm")),
        ("--model", arguments.model, (".toml",)),
    ):
        check_output(option, out, suffixes)
        if out is not None and any(out.resolve() == path.resolve() for path in inputs):
            raise CommandError(f"{option} {out} is a file that is read; give another name")


def _write_model(found: Diagnosis, path: Path | None) -> Path | None:
    """The extended aircraft file, where there is one to offer and a place for it; the path if it was written."""
    if path is None:
        return None
    if found.model is None:
        say(f"--model: no extended model is offered, so {path} was not written")
        return None
    today = datetime.datetime.now(datetime.UTC).date()
    text = aircraft_toml(found.model, _provenance(found, today))
    parse_aircraft(text.encode(), str(path))  # what is handed out can be read
    write_whole(path, text)
    return path


def _provenance(found: Diagnosis, today: datetime.date) -> str:
    """What the file rests on: flight, date, causes with values and standard errors."""
    lines = [
        f"Aircraft {found.aircraft.name}, extended by `wingwatch diagnose` on {today.isoformat()}.",
        f"Flight: {found.source}, {found.seconds:.0f} s in {found.windows} windows.",
        "Causes, with standard errors:",
    ]
    for cause in found.causes:
        lines.append(f"- {cause_title(cause)}, probability {probability_text(cause.probability)}")
        lines += [f"    {parameter_text(name, p)}" for name, p in cause.parameters.items()]
        if cause.indistinguishable_from:
            lines.append(f"    not distinguished from: {', '.join(cause.indistinguishable_from)}")
    if found.gain is not None:
        lines.append(f"Judged on {found.gain.source}.")
    lines.append("Causes that an aircraft file cannot state, such as a sensor's bias, are not in it.")
    return "\n".join(" ".join(line.split("\n")) for line in lines)


def _name(path: Path | None) -> str | None:
    return None if path is None else str(path)
