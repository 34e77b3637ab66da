"""Derivatives and modes over time, the fit by manoeuvre, and the table at the end."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import MODEL_DERIVATIVES, ModeQuantity
from wingwatch.cli.alert_texts import spaced
from wingwatch.cli.report_page.content import FlightContent
from wingwatch.cli.report_page.course import ESTIMATOR_NAMES, ModeCourse
from wingwatch.cli.report_page.flight_sections import key
from wingwatch.pages.chart import Band, Chart, Line, Mark, chart_html, grid
from wingwatch.pages.markup import paragraph, section, table
from wingwatch.pages.texts import number, with_error

__all__ = ["derivatives_section", "modes_section", "table_section"]

Array = NDArray[np.float64]

TWO_SIDED_95 = 1.96
KINDS = {"fourier": "after", "ekf": "before"}
_SHOWN = ("converged", "settling")


def derivatives_section(c: FlightContent) -> str:
    """Section 4."""
    parts = [
        paragraph(
            "Lines are estimates, bands their 95 % intervals. A line begins where the derivative becomes "
            "observable, and has a gap where it is not. All are referred to one airspeed and density, "
            "so what changes is the aircraft; the table at the end has them where they were measured. What is expected "
            "is the aircraft file's until enough has been learned of this very aircraft."
        ),
        key(
            ("after", "Fourier estimator"), ("before", "filter (ekf)"), ("quiet", "expected, 95 %"),
            *((("mark", "an alert was raised"),) if c.alerts else ()),
        ),
    ]  # fmt: skip
    for name, courses in c.course.modes.items():
        symbols = next(iter(courses.values())).structure.derivatives
        airspeed, _, density, _ = next(iter(courses.values())).usual_condition
        parts.append(f"<h3>{spaced(name).capitalize()}</h3>")
        parts.append(
            paragraph(
                f"At {number(airspeed)} m/s and {number(density)} kg/m³, the flight's median.", "legend"
            )
        )
        parts.append(grid(_derivative_chart(c, courses, symbol) for symbol in symbols))
    return section("derivatives", "4. Derivatives over time", *parts)


def _derivative_chart(c: FlightContent, courses: Mapping[str, ModeCourse], symbol: str) -> str:
    """One derivative by both estimators, over what is expected."""
    known = MODEL_DERIVATIVES[symbol]
    lines, bands, ends = [], [], []
    first = next(iter(courses.values()))
    time_s = np.array(first.time_s)
    condition = first.usual_condition
    found = first.referred(symbol, condition)
    expected, spread = found["expected"], TWO_SIDED_95 * found["expected_standard_error"]
    low, high = expected - spread, expected + spread
    bands.append(Band(time_s, low, high, "quiet"))
    lines.append(Line(time_s, expected, "quiet"))
    ends.append(expected)
    for estimator, course in courses.items():
        at_s = np.array(course.time_s)
        shown = np.array([outcome in _SHOWN for outcome in course.outcomes(symbol)])
        found = course.referred(symbol, condition)
        value = np.where(shown, found["value"], np.nan)
        error = TWO_SIDED_95 * found["standard_error"]
        bands.append(Band(at_s, value - error, value + error, KINDS[estimator]))
        lines.append(Line(at_s, value, KINDS[estimator]))
        late = slice(len(at_s) // 10, None)
        ends += [(value - error)[late], (value + error)[late]]
    chart = Chart(
        symbol, known.unit, lines, bands, tuple(Mark(a.raised_s) for a in c.alerts), c.span_s,
        _limits(ends, (low, high)),
        described=known.meaning,
    )  # fmt: skip
    return chart_html(chart)


def _limits(columns: Sequence[Array], around: Sequence[Array] = ()) -> tuple[float, float] | None:
    """What nearly all of the columns span, for a first interval that is ten times wider must not flatten the rest.

    What lies ``around`` is shown as far as it leaves them a third of the height.
    """
    values = np.concatenate(columns)
    values = values[np.isfinite(values)]
    if not values.size:
        return None
    low, high = np.percentile(values, (3.0, 97.0))
    size = high - low
    wide = np.concatenate([(low, high), *around])
    wide = wide[np.isfinite(wide)]
    return float(max(low - size, wide.min())), float(min(high + size, wide.max()))


def modes_section(c: FlightContent) -> str:
    """Section 5."""
    rows = []
    for structure, courses in c.quantities.items():
        for estimator, quantities in courses.items():
            outcome = c.derivatives["estimators"][estimator][structure]["outcome"]
            names = dict.fromkeys(q.mode for q in quantities)
            rows += [
                _mode_row(estimator, mode, [q for q in quantities if q.mode == mode], outcome)
                for mode in names
            ]
    rows.sort(key=lambda row: row[0])
    if not rows:
        return section("modes", "5. Modes", paragraph("No mode is known at the end of the flight."))
    charts = [
        _quantity_chart(c, name, courses, quantity, title, unit)
        for name, courses in c.course.modes.items()
        for quantity, title, unit in (
            ("natural_frequency_rad_s", "natural frequency", "rad/s"),
            ("damping_ratio", "damping ratio", ""),
        )
    ]
    return section(
        "modes", "5. Modes",
        table(("mode", "estimator", "natural frequency, rad/s", "damping ratio", "time constant, s", "outcome"), rows),
        paragraph(
            "At the end of the flight, with standard errors. A negative damping ratio or time constant is a "
            "divergence.",
            "legend",
        ),
        grid(charts),
    )  # fmt: skip


def _mode_row(estimator: str, mode: str, quantities: Sequence[ModeQuantity], outcome: str) -> tuple[str, ...]:
    def text(*names: str) -> str:
        found = [q for q in quantities if q.name in names and math.isfinite(q.value)]
        return " and ".join(with_error(q.value, q.standard_error) for q in found) or "-"

    return (
        spaced(mode), ESTIMATOR_NAMES[estimator], text("natural_frequency_rad_s"), text("damping_ratio"),
        text("time_constant_s", "time_constant_1_s", "time_constant_2_s"), spaced(outcome),
    )  # fmt: skip


def _quantity_chart(
    c: FlightContent, name: str, courses: Mapping[str, ModeCourse], quantity: str, title: str, unit: str
) -> str:
    """Frequency or damping over time, where the mode is at least settling."""
    lines, bands, ends = [], [], []
    for estimator, course in courses.items():
        shown = np.array([one["outcome"] in _SHOWN for one in course.objects])
        value = np.where(shown, course.quantity(quantity), np.nan)
        error = TWO_SIDED_95 * course.quantity(f"{quantity}_standard_error")
        at_s = np.array(course.time_s)
        lines.append(Line(at_s, value, KINDS[estimator]))
        bands.append(Band(at_s, value - error, value + error, KINDS[estimator]))
        ends += [value - error, value + error]
    which = "Dutch roll" if name in ("lateral", "dutch_roll") else spaced(name).capitalize()
    marks = tuple(Mark(a.raised_s) for a in c.alerts)
    return chart_html(Chart(f"{which}: {title}", unit, lines, bands, marks, c.span_s, _limits(ends)))


def table_section(c: FlightContent) -> str:
    """The table at the end."""
    parts = []
    estimators = c.derivatives["estimators"]
    structures = dict.fromkeys(name for modes in estimators.values() for name in modes)
    for structure in structures:
        rows = [
            _row(symbol, estimator, row)
            for symbol in next(iter(estimators.values()))[structure]["derivatives"]
            for estimator in estimators
            for row in [estimators[estimator][structure]["derivatives"][symbol]]
        ]
        head = (
            "derivative",
            "estimator",
            "value",
            "standard error",
            "expected",
            "its standard error",
            "unit",
            "outcome",
        )
        parts += [
            f"<h3>{spaced(structure).capitalize()}</h3>",
            f'<div class="symbols">{table(head, rows)}</div>',
        ]
    return section("table", "Derivatives at the end of the flight", *parts, _meanings(c))


def _row(symbol: str, estimator: str, row: Mapping[str, Any]) -> tuple[str, ...]:
    numbers = (row.get(k) for k in ("value", "standard_error", "expected", "expected_standard_error"))
    value, error, expected, spread = (math.nan if n is None else float(n) for n in numbers)
    return (
        symbol, ESTIMATOR_NAMES[estimator], number(value, 4), number(error, 2), number(expected, 4), number(spread, 2),
        str(row["unit"]), spaced(row["outcome"]),
    )  # fmt: skip


def _meanings(c: FlightContent) -> str:
    symbols = dict.fromkeys(
        s for m in c.course.modes.values() for x in m.values() for s in x.structure.derivatives
    )
    said = "; ".join(f"{s}: {MODEL_DERIVATIVES[s].meaning}" for s in symbols)
    return paragraph(f"{said}.", "legend")
