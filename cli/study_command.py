"""`wingwatch study`: thousands of simulated flights through the monitor, and one of them flown again."""

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar
from rich.table import Table

from wingwatch.cli.ending import asked_to_end
from wingwatch.operations.faults import CommandError, say
from wingwatch.operations.output_files import check_output
from wingwatch.operations.progress import page, write_json
from wingwatch.studies import KINDS, Kind, StudyError, StudySettings, draw_plan, load_fleet, load_grid
from wingwatch.studies.flight import FlightMaker
from wingwatch.studies.grid import default_text
from wingwatch.studies.journal import settings_of
from wingwatch.studies.local_workers import LocalWorkers
from wingwatch.studies.page.captions import about, headline, honesty
from wingwatch.studies.page.faults import (
    SHORT_HEAD,
    SHORT_LEGEND,
    fault_sentences,
    fault_title,
    short_cells,
)
from wingwatch.studies.report import write_report
from wingwatch.studies.run import Progress, Workers, run_study
from wingwatch.studies.summary import Summary, as_json, summarise
from wingwatch.studies.table import read_settings, read_study, shown_aircraft
from wingwatch.studies.versions import code_version, settings_version
from wingwatch.telemetry import write_flight

__all__ = ["run"]

_INTERRUPTED = 130
_LINE_S = 60.0
"""Between two lines of progress where there is no terminal."""
_PAGE_SUFFIXES = (".html", ".htm")
_FLIGHT_SUFFIXES = (".csv", ".parquet")


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    return _COMMANDS[arguments.study](arguments)


def _fly(arguments: argparse.Namespace) -> int:
    if arguments.show_config:
        sys.stdout.write(default_text(arguments.study))
        return 0
    if arguments.out is None:
        raise CommandError("a study needs --out STUDY.parquet, the table to write")
    if arguments.flights is not None and arguments.hours is not None:
        raise CommandError("--flights and --hours both say how many; leave one out")
    settings = _settings(arguments.study, arguments, arguments.flights, arguments.hours)
    check_output("--report", arguments.report, _PAGE_SUFFIXES)
    progress = _flown(settings, arguments.out, arguments)
    if progress is None:
        return _INTERRUPTED
    if arguments.report is not None:
        write_report(summarise(arguments.out, shown_aircraft([settings])), arguments.report)
    if arguments.json:
        write_json(_result(arguments.out, settings, progress))
    else:
        console = page()
        console.print(f"[bold]{escape(str(arguments.out))}[/]  {progress.flights} flights: {progress.text}")
    return 0


def _fly_all(arguments: argparse.Namespace) -> int:
    check_output("--report", arguments.report, _PAGE_SUFFIXES)
    studies = [
        _settings(kind, arguments, None, arguments.hours)
        if kind == "healthy"
        else _settings(kind, arguments, arguments.flights, None)
        for kind in KINDS
    ]
    arguments.out.mkdir(exist_ok=True)
    tables, results = [arguments.out / f"{kind}.parquet" for kind in KINDS], []
    for settings, table in zip(studies, tables, strict=True):
        if arguments.resume and table.exists():
            _check_finished(table, settings)
            continue
        if not arguments.json:
            say(f"{table}: {settings.flights} flights")
        progress = _flown(settings, table, arguments)
        if progress is None:
            return _INTERRUPTED
        results.append(_result(table, settings, progress))
    summary = _summary(tables)
    if arguments.report is not None:
        write_report(summary, arguments.report)
    if arguments.json:
        write_json({"flown": results})
    else:
        _print_summary(summary)
    return 0


def _check_finished(table: Path, settings: StudySettings) -> None:
    """Refuse a finished study that is not the one asked for."""
    if read_settings(table) != settings:
        raise StudyError(
            f"{table} is a finished study of another grid, seed, number of flights, aircraft or version; give another "
            "folder, or delete it"
        )


def _flown(settings: StudySettings, out: Path, arguments: argparse.Namespace) -> Progress | None:
    """Fly a study to its end; None where it was interrupted, which is then said."""
    with asked_to_end() as end, _shown(arguments.json) as show:
        progress = run_study(settings, out, _workers(arguments), resume=arguments.resume, end=end, show=show)
    if progress.done < progress.flights:
        say(
            f"interrupted: {progress.done} of {progress.flights} flights are kept; the same command with --resume "
            "goes on from there"
        )
        return None
    return progress


def _settings(
    kind: Kind, arguments: argparse.Namespace, flights: int | None, hours: float | None
) -> StudySettings:
    """What is to be flown, all of it checked before anything flies."""
    grid = load_grid(kind, arguments.config)
    flights = grid.flights if flights is None else flights
    if hours is not None:
        if not (math.isfinite(hours) and hours > 0.0):
            raise CommandError(f"--hours {hours:g}: give a positive number of hours")
        flights = math.ceil(hours * 3600.0 / grid.seconds)
    if flights < 1:
        raise CommandError(f"--flights {flights}: give at least one")
    if arguments.seed < 0:
        raise CommandError(f"--seed {arguments.seed}: give a number from 0")
    return StudySettings(
        kind, grid, arguments.seed, flights, load_fleet(grid), code_version(), settings_version()
    )


def _workers(arguments: argparse.Namespace) -> Workers:
    if arguments.scheduler is not None:
        if arguments.workers is not None:
            raise CommandError(
                "--workers are processes of this machine, and --scheduler has others fly; leave one out"
            )
        from wingwatch.studies.dask_workers import DaskWorkers

        return DaskWorkers(arguments.scheduler)
    workers = len(os.sched_getaffinity(0)) if arguments.workers is None else arguments.workers
    if workers < 1:
        raise CommandError(f"--workers {workers}: give at least one")
    return LocalWorkers(workers)


@contextmanager
def _shown(quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Shows progress on standard error: a bar on a terminal, else a line a minute; nothing beside a JSON result."""
    console = Console(stderr=True)
    if quiet:
        yield lambda progress: None
    elif console.is_terminal:
        columns = (BarColumn(), TextColumn("{task.description}"))
        with Bar(*columns, console=console, transient=True) as bar:
            task = bar.add_task("flying the first flights", total=None)
            yield lambda p: bar.update(task, completed=p.done, total=p.flights, description=_line(p))
    else:
        yield _Lines().show


class _Lines:
    """One line a minute."""

    def __init__(self) -> None:
        self._next_s = -math.inf

    def show(self, progress: Progress) -> None:
        """Say how far it is, if a minute has passed or it is done."""
        now_s = time.monotonic()
        if now_s >= self._next_s or progress.done == progress.flights:
            self._next_s = now_s + _LINE_S
            say(_line(progress))


def _line(progress: Progress) -> str:
    left = f", {_duration(progress.left_s)} left" if progress.left_s else ""
    return f"{progress.done} of {progress.flights} flights{left}: {progress.text}"


def _duration(seconds: float) -> str:
    return f"{seconds / 60.0:.0f} min" if seconds >= 90.0 else f"{seconds:.0f} s"


def _result(out: Path, settings: StudySettings, progress: Progress) -> dict[str, Any]:
    return {
        "study": str(out),
        "kind": settings.kind,
        "flights": progress.flights,
        "first_seed": settings.first_seed,
        "failed": progress.failed,
        "effects": progress.faulty,
        "noticed": progress.noticed,
        "healthy_h": progress.healthy_h,
        "false_alerts": progress.false_alerts,
        "elapsed_s": progress.elapsed_s,
        "code_version": settings.code_version,
        "settings_version": settings.settings_version,
    }


def _replay(arguments: argparse.Namespace) -> int:
    settings = settings_of(arguments.table)
    last = settings.first_seed + settings.flights - 1
    if not settings.first_seed <= arguments.seed <= last:
        raise CommandError(
            f"--seed {arguments.seed}: {arguments.table} has flights {settings.first_seed} to {last}"
        )
    if arguments.out is not None and arguments.out.suffix.lower() not in _FLIGHT_SUFFIXES:
        raise CommandError(
            f"--out {arguments.out}: a flight is written as .csv or .parquet; choose one of these suffixes"
        )
    if settings.code_version != code_version():
        say(
            f"the study was flown by version {settings.code_version}, this is {code_version()}: rows may differ"
        )
    plan = draw_plan(settings.kind, settings.grid, arguments.seed, settings.aircraft)
    maker = FlightMaker(settings.aircraft)
    if arguments.out is not None:
        write_flight(maker.samples(plan), arguments.out)
    row = maker.rows([plan], f"wingwatch study replay {arguments.table.name} --seed {{seed}}")[0]
    if arguments.json:
        write_json({"plan": json.loads(plan.as_json()), "row": row})
        return 0
    console = page()
    console.print(f"[bold]{escape(str(arguments.table))}[/]  flight {arguments.seed}")
    for title, values in (("drawn", json.loads(plan.as_json())), ("row", row)):
        console.print(f"[bold]{title}[/]")
        for name, value in values.items():
            console.print(f"  {name}: {escape(str(value))}", soft_wrap=True)
    return 0


def _show(arguments: argparse.Namespace) -> int:
    check_output("--report", arguments.report, _PAGE_SUFFIXES)
    summary = _summary(arguments.tables)
    if arguments.report is not None:
        write_report(summary, arguments.report)
    if arguments.json:
        write_json(as_json(summary))
        return 0
    _print_summary(summary)
    return 0


def _summary(tables: Sequence[Path]) -> Summary:
    """What finished studies say together."""
    names = shown_aircraft([read_settings(table) for table in tables])
    if len(tables) == 1:
        return summarise(tables[0], names)
    rows = [read_study(table).table.replace_schema_metadata(None) for table in tables]
    return summarise(pa.concat_tables(rows), names)


def _print_summary(summary: Summary) -> None:
    """The answer in sentences, and what was seen of each fault in a table."""
    console = page()
    said = [*headline(summary), *fault_sentences(summary), honesty(summary.block_scatter), about(summary)]
    for sentence in dict.fromkeys(filter(None, said)):
        console.print(escape(sentence), soft_wrap=True)
    for kind in dict.fromkeys(row.kind for row in summary.faults):
        table = Table(
            *SHORT_HEAD, title=fault_title(kind), title_justify="left", box=SIMPLE_HEAD, pad_edge=False
        )
        for column in table.columns[1:]:
            column.justify = "right"
        for row in summary.faults:
            if row.kind == kind:
                table.add_row(*map(escape, short_cells(row)))
        console.print(table)
    if summary.faults:
        console.print(SHORT_LEGEND, soft_wrap=True)


_COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "icing": _fly,
    "damage": _fly,
    "sensor": _fly,
    "healthy": _fly,
    "all": _fly_all,
    "replay": _replay,
    "show": _show,
}
