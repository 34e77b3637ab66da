"""What flew and when, and what its sensors and the air were like."""

import datetime
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import SURFACES
from wingwatch.cli.flight_clocks import clocks_text
from wingwatch.cli.report_page.content import FlightContent
from wingwatch.diagnosis.summary import display
from wingwatch.pages.chart import Chart, Line, Mark, chart_html, grid
from wingwatch.pages.markup import items, paragraph, section, table
from wingwatch.pages.texts import number, percent, with_error
from wingwatch.telemetry import MAX_GAP_S
from wingwatch.telemetry.conditioning import Parameter

__all__ = ["flown_section", "key", "sensors_section", "surface_charts", "time_chart"]

Array = NDArray[np.float64]

_EARTH_M = 6_371_000.0
_UNIX_S = 1e9
"""Stamps above it are seconds since 1970."""


def key(*entries: tuple[str, str]) -> str:
    """What colours mean."""
    spans = "".join(f'<span><i class="{kind}"></i>{text}</span>' for kind, text in entries)
    return f'<p class="key">{spans}</p>'


def time_chart(c: FlightContent, title: str, unit: str, lines: Sequence[Line]) -> str:
    """A chart over the whole flight, with its alerts."""
    marks = tuple(Mark(alert.raised_s) for alert in c.alerts)
    return chart_html(Chart(title, unit, tuple(lines), marks=marks, x_range=c.span_s))


def flown_section(c: FlightContent) -> str:
    """Section 1."""
    clean = c.clean
    steps = np.diff(clean.time_s)
    steps = steps[steps > 0.0]
    rate = 1.0 / float(np.median(steps)) if steps.size else math.nan
    rows = [
        ("file", c.name),
        ("aircraft", c.aircraft.name),
        ("when", _when(c)),
        ("duration", f"{c.watched.duration_s:.1f} s"),
        ("samples", f"{len(clean)} accepted of {c.flight.report.rows_read} rows, {number(rate)} Hz"),
        ("observable", f"{c.watched.monitor.observable_s:.0f} s"),
    ]
    charts = [
        _channel_chart(c, "altitude_m", "Height above mean sea level", "m"),
        _channel_chart(c, "airspeed_true_m_s", "True airspeed", "m/s"),
    ]
    track, lacking = _track(c)
    return section(
        "flight", "1. What flew, and when", table(("", ""), rows), grid([track, *filter(None, charts)]),
        paragraph(lacking, "legend"), paragraph(clocks_text(c.watched.clocks), "legend"), _mark_key(c),
    )  # fmt: skip


def _mark_key(c: FlightContent) -> str:
    return key(("mark", "an alert was raised")) if c.alerts else ""


def _when(c: FlightContent) -> str:
    start, end = c.span_s
    if start < _UNIX_S:
        return f"stamps {start:.1f} to {end:.1f} s"
    first, last = (datetime.datetime.fromtimestamp(t, datetime.UTC) for t in (start, end))
    return f"{first:%Y-%m-%d %H:%M:%S} to {last:%H:%M:%S} UTC, if its stamps are seconds since 1970"


def _channel_chart(c: FlightContent, channel: str, title: str, unit: str, factor: float = 1.0) -> str:
    if channel not in c.clean.present:
        return ""
    line = Line(*_broken(c.clean.time_s, factor * c.clean.column(channel)))
    return time_chart(c, title, unit, [line])


def _broken(time_s: Array, y: Array) -> tuple[Array, Array]:
    """The line without bridges over gaps and from one clock to the next."""
    steps = np.diff(time_s)
    at = np.flatnonzero((steps <= 0.0) | (steps > MAX_GAP_S)) + 1
    return np.insert(time_s, at, np.nan), np.insert(y, at, np.nan)


def _track(c: FlightContent) -> tuple[str, str]:
    """The way over the ground, or why there is none."""
    names = ("latitude_deg", "longitude_deg")
    if not set(names) <= set(c.clean.present):
        return (
            "",
            "No track: the flight has no latitude and longitude, and none is made up from heading and airspeed.",
        )
    latitude, longitude = (c.clean.column(name) for name in names)
    known = np.isfinite(latitude) & np.isfinite(longitude)
    latitude, longitude = np.radians(latitude[known]), np.unwrap(np.radians(longitude[known]))
    north = _EARTH_M * (latitude - latitude[0])
    east = _EARTH_M * (longitude - longitude[0]) * math.cos(float(latitude.mean()))
    every = max(1, north.size // 1500)
    chart = Chart(
        "Track from the first position", "m, north is up",
        (Line(east[::every], north[::every]), Line(east[:1], north[:1], "dots")),
        x_unit="m", square=True, described="The dot is the start.",
    )  # fmt: skip
    return chart_html(chart), ""


def surface_charts(c: FlightContent) -> str:
    """Surfaces over time, commands where no position was recorded."""
    charts = []
    for surface in SURFACES:
        channel = f"{surface}_rad"
        what = "commanded" if c.flight.kinds.get(channel) == "command" else "position"
        title = f"{surface.capitalize()}, {what}"
        charts.append(_channel_chart(c, channel, title, "deg", math.degrees(1.0)))
    return grid(filter(None, charts))


def sensors_section(c: FlightContent) -> str:
    """Section 7."""
    return section(
        "sensors", "7. Sensors and air", paragraph(_air(c)), "<h3>Samples</h3>", items(_cleaning(c)),
        _channels(c), *_conditioned(c),
    )  # fmt: skip


def _air(c: FlightContent) -> str:
    found = c.conditioned.air if c.conditioned is not None else None
    if found is None:
        return "The turbulence is not known: turbulence needs a vane."
    parts = [
        f"{p.name} {with_error(p.value, p.standard_error)} {p.unit} (rms)"
        for p in found.sigma
        if p.observable
    ]
    text = found.text[0].upper() + found.text[1:]
    return f"{text}. {'; '.join(parts).capitalize()}{'.' if parts else ''}"


def _cleaning(c: FlightContent) -> list[str]:
    steps = np.diff(c.clean.time_s)
    gaps = steps[steps > MAX_GAP_S]
    lines = [f"{part[0].upper()}{part[1:]}." for part in c.watched.cleaning_text.split("; ") if part]
    if gaps.size:
        which = f"{gaps.size} gap{'s' if gaps.size > 1 else ''} of more than {MAX_GAP_S:g} s"
        lines.append(f"{which}, the longest {gaps.max():.3g} s; nothing is bridged over them.")
    else:
        lines.append(f"No gap of more than {MAX_GAP_S:g} s.")
    return lines


def _channels(c: FlightContent) -> str:
    """Every channel: whether it was measured, how often it has a new reading, and its range."""
    rows = []
    span = max(c.watched.duration_s, 1e-9)
    for name in c.clean.present:
        if name == "time_s":
            continue
        column = c.clean.column(name)
        known = column[np.isfinite(column)]
        shown, factor = display(name), display(name).factor
        rate = c.flight.report.rates_hz.get(name, np.count_nonzero(np.diff(known)) / span)
        kind = (
            "commanded" if c.flight.kinds.get(name) == "command" else c.flight.quality.get(name, "measured")
        )
        ends = f"{number(factor * float(known.min()))} to {number(factor * float(known.max()))} {shown.unit}".rstrip()
        rows.append((shown.name, kind, f"{number(rate)} Hz", percent(known.size / column.size), ends))
    return table(("channel", "quality", "new readings", "present", "range"), rows)


def _conditioned(c: FlightContent) -> list[str]:
    found = c.conditioned
    if found is None:
        return [paragraph(f"Delays and biases are not known: {'; '.join(c.notes)}.", "legend")]
    parts = []
    if found.delays:
        rows = [
            (
                display(row.channel).name,
                _parameter(row.found),
                f"{row.stated_s:.3f}",
                f"{row.used_s:.3f}",
                row.found.reason,
            )
            for row in found.delays
        ]
        parts += [
            "<h3>Delays behind the gyros, s</h3>",
            table(("channel", "found", "aircraft file", "taken", ""), rows),
        ]
    if found.servos:
        parts += ["<h3>Surfaces behind their commands</h3>", _parameters(found.servos)]
    if found.path is not None:
        verdict = "The readings are" if found.path.compatible else "The readings are not"
        ratio, worst = max((ratio, name) for name, ratio in found.path.fit.items())
        parts += ["<h3>Biases and scale errors</h3>", _parameters(found.path.parameters)]
        parts.append(
            paragraph(
                f"{verdict} one rigid body's motion: what is left is up to {ratio:.2g} times the noise "
                f"({display(worst).name}).",
                "legend",
            )
        )
    return [*parts, items(f"{note[0].upper()}{note[1:]}." for note in found.notes)]


def _parameters(rows: Sequence[Parameter]) -> str:
    return table(
        ("", "found", "unit", ""), [(_parameter_name(p.name), _parameter(p), p.unit, p.reason) for p in rows]
    )


def _parameter_name(name: str) -> str:
    what, of, channel = name.partition(" of ")
    return f"{what} of {display(channel).name}" if of else name.replace("_", " ")


def _parameter(p: Parameter) -> str:
    return with_error(p.value, p.standard_error) if p.observable else "-"
