"""`wingwatch estimate`: derivatives of a recorded flight."""

import argparse
from collections.abc import Mapping
from math import isfinite, nan
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.cli.estimate_history import HistoryWriter
from wingwatch.cli.flight_watch import Watched, load, watch
from wingwatch.cli.progress import Progress, page, write_json

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    history = None if arguments.history is None else HistoryWriter(arguments.history, arguments.estimator)
    flight, aircraft = load(arguments.flight, arguments.map, arguments.aircraft)
    watched = watch(flight, aircraft, Progress(), listener=history)
    if history is not None:
        history.close()
    result = _result(watched, arguments.estimator)
    if arguments.json:
        write_json(result)
    else:
        _show(page(), result, watched)
    return 0


def _result(watched: Watched, estimator: str | None) -> dict[str, Any]:
    """The contract's object, of one estimator or of all."""
    result = {**watched.monitor.derivatives(), "cleaning": watched.cleaning}
    if estimator is not None:
        result["estimators"] = {estimator: result["estimators"][estimator]}
    return result


def _show(console: Console, result: Mapping[str, Any], watched: Watched) -> None:
    console.print(f"[bold]{escape(watched.flight.source)}[/]  aircraft {watched.monitor.aircraft.name}")
    console.print(escape(watched.cleaning_text), style="dim")
    for structure in watched.monitor.chain.structures:
        console.print(_table(structure.name, result["estimators"]))
        for name, modes in result["estimators"].items():
            console.print(f"  {name}: {escape(_mode_line(modes[structure.name]))}", style="dim")
    for name, why in result["not_estimated"].items():
        console.print(f"{name} is not estimated: {escape(why)}")
    console.print(escape(watched.monitor.basis_text))


def _table(structure: str, estimators: Mapping[str, Any]) -> Table:
    """Value ± standard error of each derivative by each estimator, beside what is expected."""
    table = Table(title=structure, title_justify="left", title_style="bold")
    table.add_column("derivative")
    table.add_column("unit")
    for name in estimators:
        table.add_column(name, justify="right")
        table.add_column("outcome")
    table.add_column("expected", justify="right")
    modes = [modes[structure]["derivatives"] for modes in estimators.values()]
    for symbol, first in modes[0].items():
        cells = [symbol, first["unit"]]
        for rows in modes:
            row = rows[symbol]
            cells += [_number(row["value"], row["standard_error"]), row["outcome"].replace("_", " ")]
        # What is expected hangs on the condition, which both estimators share to within a sample or two.
        cells.append(_number(first.get("expected"), first.get("expected_standard_error")))
        table.add_row(*cells)
    return table


def _number(value: float | None, error: float | None) -> str:
    if value is None or error is None or not (isfinite(value) and isfinite(error)):
        return "-"
    return f"{value:.4g} ± {error:.2g}"


def _mode_line(mode: Mapping[str, Any]) -> str:
    """Outcome, frequency and damping of one mode by one estimator."""
    parts = [mode["outcome"].replace("_", " ")]
    if mode.get("reason"):
        parts.append(mode["reason"])
    if isfinite(mode["natural_frequency_rad_s"] or nan):
        parts.append(
            f"natural frequency {mode['natural_frequency_rad_s']:.3g} rad/s, "
            f"damping ratio {mode['damping_ratio']:.3g}"
        )
    return "; ".join(parts)
