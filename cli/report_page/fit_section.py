"""Measured against predicted motion, by manoeuvre."""

import math
from collections.abc import Sequence

import numpy as np

from wingwatch.cli.alert_texts import spaced
from wingwatch.cli.report_page.content import FlightContent
from wingwatch.cli.report_page.course import ESTIMATOR_NAMES, IN_SENTENCES
from wingwatch.cli.report_page.flight_sections import key
from wingwatch.diagnosis.predicted_motion import MotionChannel, PredictedManoeuvre
from wingwatch.pages.chart import Chart, Line, chart_html, grid
from wingwatch.pages.markup import items, paragraph, section, table
from wingwatch.pages.texts import number

__all__ = ["fit_section"]

_ROWS = 12
"""Manoeuvres in the table of a mode; of more, those in which the surface moved most."""

_CHANNELS = {
    "w": ("normal velocity", "m/s", 1.0),
    "v": ("lateral velocity", "m/s", 1.0),
    "p": ("roll rate", "deg/s", math.degrees(1.0)),
    "q": ("pitch rate", "deg/s", math.degrees(1.0)),
    "r": ("yaw rate", "deg/s", math.degrees(1.0)),
    "a_z": ("normal specific force", "m/s²", 1.0),
    "a_y": ("lateral specific force", "m/s²", 1.0),
}


def fit_section(c: FlightContent) -> str:
    """Section 6."""
    names = dict.fromkeys(one.structure for one in c.manoeuvres)
    parts = [_of_mode([one for one in c.manoeuvres if one.structure == name]) for name in names]
    said = paragraph(
        "The linear model flies open loop through still air by the measured surfaces, with the derivatives known at "
        "the end of the manoeuvre; one that was not observable is taken as expected. R2 is the part of the measured "
        "variation that the model follows: 100 % is perfect, below 0 is worse than no model. Gusts "
        "lower it, and so does the sensor's noise: what is left over that noise is 1 where the fit is perfect."
    )
    left = items(f"{spaced(note[:1].upper() + note[1:])}." for note in c.not_predicted)
    if not parts:
        return section(
            "fit", "6. Measured and predicted motion", paragraph("No manoeuvre could be predicted."), left
        )
    colours = key(("ink", "measured"), ("after", "by the estimates"), ("quiet", "as expected"))
    return section("fit", "6. Measured and predicted motion", said, colours, *parts, left)


def _of_mode(manoeuvres: Sequence[PredictedManoeuvre]) -> str:
    largest = sorted(manoeuvres, key=lambda one: -one.moved_rad)[:_ROWS]
    kept = sorted(largest, key=lambda one: one.time_s[0])
    head = ["manoeuvre", "surface, rms", "estimator"]
    channels = [channel.name for channel in kept[0].channels]
    for name in channels:
        head += [f"{_named(name)}, R2 (as expected)", "left over noise"]
    rows = [_row(one, channels) for one in kept]
    chosen = list(dict.fromkeys((0, len(kept) // 2, len(kept) - 1)))
    charts = "".join(_charts(kept[k]) for k in chosen)
    more = len(manoeuvres) - len(kept)
    left = paragraph(f"and {more} more in which the surfaces moved less", "legend") if more > 0 else ""
    title = spaced(manoeuvres[0].structure).capitalize()
    return f'<h3>{title}</h3>{charts}<div class="symbols">{table(head, rows)}</div>{left}'


def _charts(one: PredictedManoeuvre) -> str:
    said = f"{_when(one)}, derivatives by the {IN_SENTENCES.get(one.estimator, one.estimator)}"
    return paragraph(said, "legend") + grid(_chart(one, channel) for channel in one.channels)


def _named(name: str) -> str:
    return _CHANNELS.get(name, (name, "", 1.0))[0]


def _row(one: PredictedManoeuvre, channels: Sequence[str]) -> tuple[str, ...]:
    found = {channel.name: channel for channel in one.channels}
    cells = []
    for name in channels:
        channel = found.get(name)
        cells += ["-", "-"] if channel is None else _cells(channel)
    moved = f"{math.degrees(one.moved_rad):.1f} deg"
    return (_when(one), moved, ESTIMATOR_NAMES.get(one.estimator, one.estimator), *cells)


def _cells(channel: MotionChannel) -> list[str]:
    both = f"{_percent(channel.r_squared)} ({_percent(channel.r_squared_expected)})"
    return [both, number(channel.over_noise, 2)]


def _percent(part: float) -> str:
    if not math.isfinite(part):
        return "-"
    return "below 0" if part < 0.0 else f"{100.0 * part:.1f} %"


def _when(one: PredictedManoeuvre) -> str:
    return f"{one.time_s[0]:.0f} to {one.time_s[-1]:.0f} s"


def _chart(one: PredictedManoeuvre, channel: MotionChannel) -> str:
    name, unit, factor = _CHANNELS.get(channel.name, (channel.name, "", 1.0))
    measured = factor * channel.measured
    lines = [
        Line(one.time_s, measured, "ink"),
        Line(one.time_s, factor * channel.expected, "quiet"),
        Line(one.time_s, factor * channel.estimated, "after"),
    ]
    room = 0.4 * (float(measured.max()) - float(measured.min())) or 1.0
    known = [line.y[np.isfinite(line.y)] for line in lines]
    ends = [(float(y.min()), float(y.max())) for y in known if y.size]
    low = max(min(a for a, _ in ends), float(measured.min()) - room)
    high = min(max(b for _, b in ends), float(measured.max()) + room)
    said = f"{unit}, R2 {_percent(channel.r_squared)}".removeprefix(", ")
    return chart_html(Chart(name.capitalize(), said, lines, y_range=(low, high)))
