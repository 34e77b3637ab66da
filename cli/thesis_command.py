"""`wingwatch thesis`: result tables and figures of the thesis beside what wingwatch says on the same plants."""

import argparse
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.operations.faults import CommandError
from wingwatch.operations.output_files import check_output
from wingwatch.operations.progress import Progress, page, write_json
from wingwatch.studies.thesis.beyond import beyond_sections
from wingwatch.studies.thesis.figures import FIGURES, Drawn, drawn
from wingwatch.studies.thesis.printed import printed_pulses, printed_tables
from wingwatch.studies.thesis.report import (
    Section,
    coverage_sentence,
    pulses_section,
    sections_of,
    summary_section,
    table_section,
    write_report,
)
from wingwatch.studies.thesis.shown import Grid, number, with_error
from wingwatch.studies.thesis.tables import Compared, compared

__all__ = ["run"]

_SUFFIXES = (".html", ".htm", ".md")
_IN_THE_REPORT = (
    "7.3",
    "7.6",
    "7.11",
    "7.12",
    "9.3",
    "9.6",
    "9.9",
    "9.12",
    "9.14",
    "9.15",
    "9.18",
    "9.20",
    "9.24",
)
_ROWS_OF_A_TRACE = 12


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    _check(arguments)
    if printed_pulses().number in arguments.table:
        return _show_pulses(arguments)
    part = arguments.figure or (arguments.beyond and arguments.report is None)
    numbers = arguments.table or ([] if part else list(printed_tables()))
    found = [
        compared(printed_tables()[one], arguments.draws)
        for one in Progress(not arguments.json).track(numbers, "tables")
    ]
    more = beyond_sections(arguments.draws) if arguments.beyond or _whole(arguments) else []
    figures = [drawn(one) for one in arguments.figure or (_IN_THE_REPORT if _whole(arguments) else ())]
    if arguments.report is not None:
        write_report(sections_of(found, figures, more), _about(arguments), arguments.report)
    if arguments.json:
        write_json(_as_json(found, figures, more, arguments.draws))
    else:
        console = page()
        _show(console, found, figures if arguments.figure else [], full=bool(arguments.table))
        for section in more:
            _print(console, section)
    return 0


def _whole(arguments: argparse.Namespace) -> bool:
    """Whether a report of everything is asked for."""
    return arguments.report is not None and not arguments.table and not arguments.figure


def _check(arguments: argparse.Namespace) -> None:
    """Refuse what is not there before any work."""
    known = [*printed_tables(), printed_pulses().number]
    for one in arguments.table:
        if one not in known:
            raise CommandError(
                f"--table {one}: not a result table of the thesis's chapters 7 to 9; give one of "
                f"{', '.join(sorted(known, key=_order))}"
            )
    for one in arguments.figure:
        if one not in FIGURES:
            raise CommandError(f"--figure {one}: not drawn here; give one of {', '.join(FIGURES)}")
    if printed_pulses().number in arguments.table and (
        len(arguments.table) > 1 or arguments.figure or arguments.report is not None
    ):
        raise CommandError(
            f"--table {printed_pulses().number} holds no estimates; ask for it alone, or leave --table out for a report"
        )
    if arguments.draws < 2:
        raise CommandError(f"--draws {arguments.draws}: give at least 2, a scatter needs them")
    check_output("--report", arguments.report, _SUFFIXES)


def _order(one: str) -> tuple[int, ...]:
    return tuple(map(int, one.split(".")))


def _about(arguments: argparse.Namespace) -> str:
    asked = "".join(
        f" --{option} {one}" for option in ("table", "figure") for one in getattr(arguments, option)
    ) + (" --beyond" if arguments.beyond else "")
    return (
        f"Made by: wingwatch thesis{asked} --draws {arguments.draws} --report {arguments.report.name} (seeds 0 to "
        f"{arguments.draws - 1})"
    )


def _show_pulses(arguments: argparse.Namespace) -> int:
    if arguments.json:
        write_json({"table": printed_pulses().number, "rows": _rows(pulses_section().grid)})
    else:
        _print(page(), pulses_section())
    return 0


def _show(console: Console, found: Sequence[Compared], figures: Sequence[Drawn], *, full: bool) -> None:
    if full:
        for one in found:
            _print(console, table_section(one))
    elif found:
        _print(console, summary_section(found))
    for figure in figures:
        _print(console, _trace_section(figure))


def _trace_section(found: Drawn) -> Section:
    """Curves as a few rows, for a terminal."""
    first = found.traces[0]
    step = max(1, math.ceil(first.time_s.size / _ROWS_OF_A_TRACE))
    picked = [*range(step - 1, first.time_s.size, step)]
    head = ["s", *(f"{t.name} {t.unit}".strip() for t in found.traces)]
    rows = [[number(float(first.time_s[k])), *(_point(found, k))] for k in picked]
    if any(t.printed is not None for t in found.traces):
        rows.append(["true", *(number(t.true) for t in found.traces)])
        rows.append(["printed at the end", *(number(t.printed) for t in found.traces)])
    return Section(
        f"figure-{found.figure.number}",
        found.figure.title,
        (),
        Grid(tuple(head), tuple(tuple(row) for row in rows)),
    )


def _point(found: Drawn, k: int) -> list[str]:
    cells = []
    for trace in found.traces:
        error = None if trace.standard_error is None else float(trace.standard_error[k])
        value = with_error(float(trace.value[k]), error)
        if trace.measured is not None:
            value = f"{number(float(trace.measured[k]))} (model {value})"
        cells.append(value)
    return cells


def _print(console: Console, one: Section) -> None:
    console.print(f"[bold]{escape(one.title)}[/]", soft_wrap=True)
    for text in one.texts:
        console.print(escape(text), soft_wrap=True)
    if one.grid is not None:
        table = Table(*map(escape, one.grid.head), box=SIMPLE_HEAD, pad_edge=False)
        for row in one.grid.rows:
            table.add_row(*map(escape, row))
        console.print(table)
    for note in one.notes:
        console.print(f"{note[:1].upper()}{note[1:]}.", style="dim", soft_wrap=True, markup=False)


def _rows(grid: Grid | None) -> list[dict[str, str]]:
    return [] if grid is None else [dict(zip(grid.head, row, strict=True)) for row in grid.rows]


def _as_json(
    found: Sequence[Compared], figures: Sequence[Drawn], more: Sequence[Section], draws: int
) -> dict[str, Any]:
    return {
        "draws": draws,
        "coverage": coverage_sentence(found) if found else None,
        "tables": [
            {
                "number": one.table.number,
                "section": one.table.section,
                "plant": one.table.plant.name,
                "kind": one.table.kind,
                "about": one.table.about,
                "cases": len(one.cases),
                "repeated": one.repeated,
                "notes": list(one.notes),
                "quantities": [asdict(quantity) for quantity in one.quantities],
            }
            for one in found
        ],
        "figures": [
            {
                "number": one.figure.number,
                "plant": one.figure.plant,
                "case": one.figure.case,
                "traces": [asdict(trace) for trace in one.traces],
            }
            for one in figures
        ],
        "beyond": [
            {"name": one.name, "title": one.title, "text": " ".join(one.texts), "rows": _rows(one.grid)}
            for one in more
        ],
    }
