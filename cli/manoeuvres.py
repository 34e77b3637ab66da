"""Verdicts on the manoeuvres of a recorded flight, as text and as JSON."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from wingwatch.api import manoeuvre_document
from wingwatch.monitor import LearnedView, ManoeuvreView, Report, VehicleMonitor, verdict

__all__ = ["Verdicts", "manoeuvres_object", "show_manoeuvres"]


@dataclass(slots=True)
class Verdicts:
    """Judges each manoeuvre as soon as it is over; a listener of ``flight_watch.watch``."""

    found: list[ManoeuvreView] = field(default_factory=list)

    def __call__(self, monitor: VehicleMonitor, report: Report) -> None:
        """After a piece of the flight."""
        for flown in report.manoeuvres:
            self.found.append(verdict(monitor, flown, len(self.found) + 1))

    def end(self, monitor: VehicleMonitor) -> tuple[ManoeuvreView, ...]:
        """All verdicts; a manoeuvre that the end of the flight cut is the last one."""
        if (flown := monitor.end_manoeuvre()) is not None:
            self.found.append(verdict(monitor, flown, len(self.found) + 1))
        return tuple(self.found)


def manoeuvres_object(views: Sequence[ManoeuvreView]) -> list[dict[str, Any]]:
    """The objects of ``GET /v1/vehicles/{vehicle}/manoeuvres``, in the order of the flight."""
    return [manoeuvre_document(view).model_dump(mode="json") for view in views]


def show_manoeuvres(console: Console, views: Sequence[ManoeuvreView]) -> None:
    """Each verdict, and a table of the standard errors before and after."""
    if not views:
        console.print("No manoeuvre: no surface moved beyond its usual way.")
        return
    console.print("Manoeuvres")
    for view in views:
        moved = ", ".join(
            f"{column.removesuffix('_rad')} {math.degrees(size):.2g} degrees"
            for column, size in view.surfaces.items()
        )
        console.print(
            f"[bold]{view.number}[/]  {view.begin_s:.1f} to {view.end_s:.1f} s, {moved}: {escape(view.text)}",
            soft_wrap=True,
        )
        if view.learned:
            console.print(_table(view.learned))


def _table(learned: Sequence[LearnedView]) -> Table:
    estimators = list(dict.fromkeys(one.estimator for one in learned))
    table = Table("derivative")
    for name in estimators:
        table.add_column(f"{name} before", justify="right")
        table.add_column("after", justify="right")
    rows = {(one.structure, one.derivative): {} for one in learned}  # type: dict[tuple[str, str], dict[str, LearnedView]]
    for one in learned:
        rows[one.structure, one.derivative][one.estimator] = one
    for (_, symbol), by_estimator in rows.items():
        cells = [
            text
            for name in estimators
            for text in (
                (_error(by_estimator[name].before), _error(by_estimator[name].after))
                if name in by_estimator
                else ("-", "-")
            )
        ]
        table.add_row(symbol, *cells)
    return table


def _error(value: float | None) -> str:
    return f"{value:.2g}" if value is not None and math.isfinite(value) else "-"
