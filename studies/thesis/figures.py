"""Figures of the thesis, redrawn with what wingwatch says on the same plants.

The thesis prints curves, not their values: what stands beside ours is the last value, which its tables print.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from wingwatch.pages.chart import Band, Chart, Line
from wingwatch.simulation import linear_response
from wingwatch.studies.thesis.cases import case_of, flight_of, outcome
from wingwatch.studies.thesis.methods import online_estimator, online_trace
from wingwatch.studies.thesis.printed import plants, printed_tables
from wingwatch.studies.thesis.records import RATE_HZ, measured
from wingwatch.studies.thesis.tables import Z_95

__all__ = ["FIGURES", "Drawn", "Figure", "Trace", "charts", "drawn"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure of the thesis.

    Attributes:
        number: in the thesis.
        plant, case: which.
        equation: of traces 0 for force and 1 for moment derivatives; None for the two states over time.
    """

    number: str
    plant: str
    case: str
    equation: int | None

    @property
    def title(self) -> str:
        """In words."""
        what = (
            "states over time"
            if self.equation is None
            else ("force", "moment")[self.equation] + " derivatives"
        )
        return f"Figure {self.number}: {plants()[self.plant].title}, {self.case}, {what}"


def _traces() -> list[Figure]:
    found = []
    for plant, first in (("aerosonde_short_period", 2), ("aerosonde_dutch_roll", 8)):
        flags = ("clean", "noise", "noise, Jetstream input")
        found += [
            Figure(f"9.{first + 3 * equation + k}", plant, f"online 0.998, {flag}", equation)
            for equation in (0, 1)
            for k, flag in enumerate(flags)
        ]
    for plant, first in (("jetstream_short_period", 14), ("jetstream_dutch_roll", 20)):
        found += [
            Figure(f"9.{first + 2 * k + equation}", plant, f"online {factor}", equation)
            for k, factor in enumerate(("0.998", "0.9998", "1"))
            for equation in (0, 1)
        ]
    return found


_STATES = (
    ("7.2", "aerosonde_short_period", "differentiated, clean"),
    ("7.3", "aerosonde_short_period", "differentiated, noise"),
    ("7.5", "aerosonde_dutch_roll", "differentiated, clean"),
    ("7.6", "aerosonde_dutch_roll", "differentiated, noise"),
    ("7.11", "jetstream_short_period", "differentiated, delayed"),
    ("7.12", "jetstream_short_period", "differentiated, aligned"),
    ("7.15", "jetstream_dutch_roll", "differentiated, aligned"),
    ("8.4", "aerosonde_short_period", "to 4 Hz, noise"),
    ("8.8", "aerosonde_dutch_roll", "to 4 Hz, noise"),
    ("8.11", "jetstream_short_period", "to 4 Hz, delayed"),
    ("8.12", "jetstream_short_period", "to 4 Hz, aligned"),
    ("8.17", "jetstream_dutch_roll", "to 4 Hz, aligned"),
)

FIGURES: dict[str, Figure] = {
    figure.number: figure for figure in (*(Figure(*one, None) for one in _STATES), *_traces())
}
"""By number, in the thesis's order."""


@dataclass(frozen=True, slots=True)
class Trace:
    """One curve.

    Attributes:
        name, unit: of the quantity.
        time_s, value: ours, (n,).
        standard_error: stated, (n,); None where none is.
        measured: what was measured, (n,); None where it is not measured.
        true: of the plant; None where it is not a constant.
        printed: the thesis's last value; None where its tables have none.
    """

    name: str
    unit: str
    time_s: Array
    value: Array
    standard_error: Array | None
    measured: Array | None
    true: float | None
    printed: float | None


@dataclass(frozen=True, slots=True)
class Drawn:
    """A figure with its curves."""

    figure: Figure
    traces: tuple[Trace, ...]


@cache
def drawn(number: str) -> Drawn:
    """The figure from the first draw of noise.

    Raises:
        KeyError: a figure that is not here.
    """
    figure = FIGURES[number]
    return Drawn(
        figure, _states(figure) if figure.equation is None else _derivatives(figure, figure.equation)
    )


def _states(figure: Figure) -> tuple[Trace, ...]:
    plant = plants()[figure.plant]
    case = case_of(plant, figure.case)
    flight = flight_of(case)
    record = measured(flight, 0 if case.noisy else None)
    value = outcome(figure.plant, figure.case, 1).value[0].tolist()
    by_symbol = dict(zip(plant.structure.derivatives, value, strict=True))
    predicted = linear_response(plant.structure, by_symbol, flight.surface, 1.0 / RATE_HZ)
    columns = [*zip(plant.structure.states, ("m/s", "rad/s"), record.states.T, predicted.T, strict=True)]
    return tuple(
        Trace(name, unit, record.rows[:, 0], ours, None, seen, None, None)
        for name, unit, seen, ours in columns
    )


def _derivatives(figure: Figure, equation: int) -> tuple[Trace, ...]:
    plant = plants()[figure.plant]
    case = case_of(plant, figure.case)
    record = measured(flight_of(case), 0 if case.noisy else None)
    forgetting = float(figure.case.partition(",")[0].removeprefix("online "))
    found = [*online_trace(online_estimator(plant, forgetting), record.rows)]
    time_s = np.array([t for t, _ in found])
    value = np.array([e.value for _, e in found])
    error = np.array([e.standard_error for _, e in found])
    printed = _last_printed(figure)
    return tuple(
        Trace(
            name, "", time_s, value[:, k], error[:, k], None, plant.derivatives[k],
            None if printed is None else float(printed[k]),
        )
        for k, name in enumerate(plant.structure.derivatives)
        if k // 3 == equation
    )  # fmt: skip


def _last_printed(figure: Figure) -> Array | None:
    for table in printed_tables().values():
        if table.kind == "derivatives" and table.plant.name == figure.plant:
            for case in table.cases:
                if case.name == figure.case:
                    return case.values
    return None


def charts(found: Drawn) -> list[Chart]:
    """A chart a curve: ours with its 95 % band where it is known to its own size, the truth, and the printed end."""
    return [_chart(trace) for trace in found.traces]


def _chart(trace: Trace) -> Chart:
    t = trace.time_s
    if trace.standard_error is None:
        lines = [Line(t, trace.value, "after")]
        if trace.measured is not None:
            lines.insert(0, Line(t, trace.measured, "quiet"))
        return Chart(
            trace.name, trace.unit, lines, described="Measured, and as the estimated model predicts it."
        )
    known = trace.standard_error < _known(trace)
    value = np.where(known, trace.value, math.nan)
    half = Z_95 * np.where(known, trace.standard_error, math.nan)
    lines = [Line(t, value, "after")]
    said = ["Our estimate with its 95 % interval"]
    if trace.true is not None:
        lines.append(Line(t[[0, -1]], np.full(2, trace.true), "ink"))
        said.append("the plant's value as a level line")
    if trace.printed is not None:
        end = t[-1] - 0.1 * (t[-1] - t[0])
        lines.append(Line(np.array([end, t[-1]]), np.full(2, trace.printed), "before"))
        said.append("the last value that the thesis prints as a short line at the end")
    return Chart(trace.name, trace.unit, lines, [Band(t, value - half, value + half, "after")],
                 described=", ".join(said) + ".")  # fmt: skip


def _known(trace: Trace) -> float:
    """A standard error from which on a derivative is drawn: its own size."""
    return max(abs(trace.true or 0.0), 1e-12) if trace.true is not None else math.inf
