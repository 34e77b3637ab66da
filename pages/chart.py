"""Line charts as plain SVG in the page: no script, colours of the style sheet, sharp on a phone and on paper.

A chart is as wide as a phone; a page sets several beside each other (``grid``) instead of stretching one, so that its
text keeps its size.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = ["Band", "Chart", "Line", "Mark", "Strip", "chart_html", "grid", "strips_html", "thinned"]

Array = NDArray[np.float64]

WIDTH, HEIGHT = 340, 165
_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 8, 6, 24
_ROW, _LABEL = 15, 52
_MOST_POINTS = 320

_LONG = 1e5
"""From so many seconds on, as of a clock since 1970, an axis counts from its own start."""


@dataclass(frozen=True, slots=True)
class Line:
    """A line; where ``y`` is NaN it is broken. ``kind`` is a class of ``chart.css``."""

    x: Array
    y: Array
    kind: str = "ink"


@dataclass(frozen=True, slots=True)
class Band:
    """What lies between two lines."""

    x: Array
    low: Array
    high: Array
    kind: str


@dataclass(frozen=True, slots=True)
class Mark:
    """An instant, as a line from top to bottom."""

    x: float
    kind: str = "mark"


@dataclass(frozen=True, slots=True)
class Chart:
    """One picture.

    Attributes:
        title, unit: above it.
        x_range: shared by the charts of a flight; its own data where None.
        y_range: its own data where None.
        x_unit: below the axis.
        square: whether both axes have one scale, as a map has.
        described: what a reader who cannot see it should know.
    """

    title: str
    unit: str = ""
    lines: Sequence[Line] = ()
    bands: Sequence[Band] = ()
    marks: Sequence[Mark] = ()
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    x_unit: str = "s"
    square: bool = False
    described: str = ""


@dataclass(frozen=True, slots=True)
class Strip:
    """A row of coloured spans: its name, and by lane (from, to, kind)."""

    name: str
    lanes: Sequence[Sequence[tuple[float, float, str]]] = field(default=())


def thinned(x: Array, y: Array, points: int = _MOST_POINTS) -> tuple[Array, Array]:
    """At most twice so many points that keep every peak: the least and the largest of each piece, in their order."""
    n = x.size
    if n <= 2 * points:
        return x, y
    edges = np.linspace(0, n, points + 1).astype(int)
    chosen: list[int] = []
    for a, b in pairwise(edges.tolist()):
        piece = y[a:b]
        known = np.flatnonzero(np.isfinite(piece))
        if known.size == 0:
            chosen.append(a)  # the line is broken here
            continue
        ends = {int(known[np.argmin(piece[known])]), int(known[np.argmax(piece[known])])}
        chosen += [a + k for k in sorted(ends)]
    return x[chosen], y[chosen]


def grid(charts: Iterable[str]) -> str:
    """Charts beside each other, as many as there is room for; nothing without any."""
    inside = "".join(charts)
    return f'<div class="charts">{inside}</div>' if inside else ""


def chart_html(chart: Chart) -> str:
    """The chart as a figure."""
    height = WIDTH - _LEFT - _RIGHT + _TOP + _BOTTOM if chart.square else HEIGHT
    x, y = _ranges(chart)
    plot = (WIDTH - _LEFT - _RIGHT, height - _TOP - _BOTTOM)
    frame = _Frame(x, y, plot)
    inside = [*(frame.band(b) for b in chart.bands), *(frame.mark(m) for m in chart.marks)]
    inside += [frame.line(one) for one in chart.lines]
    unit = f' <span class="soft">{escape(chart.unit)}</span>' if chart.unit else ""
    said = escape(" ".join(part for part in (chart.title + ".", chart.described) if part), quote=True)
    return (
        f'<figure class="chart"><p class="name">{escape(chart.title)}{unit}</p>'
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{said}">'
        f'<g transform="translate({_LEFT},{_TOP})">{frame.axes(chart.x_unit)}'
        f'<svg width="{plot[0]}" height="{plot[1]}">{"".join(inside)}</svg></g></svg></figure>'
    )


def strips_html(
    title: str, strips: Sequence[Strip], x_range: tuple[float, float], described: str = ""
) -> str:
    """Rows of coloured spans over one axis."""
    height = _ROW * len(strips)
    frame = _Frame(x_range, (0.0, 1.0), (WIDTH - _LABEL - _RIGHT, height))
    rows = []
    for k, strip in enumerate(strips):
        rows.append(f'<text class="end" x="-6" y="{_ROW * k + 12}">{escape(strip.name)}</text>')
        thick = (_ROW - 4) / max(len(strip.lanes), 1)
        for lane, spans in enumerate(strip.lanes):
            for start, end, kind in spans:
                a, b = frame.x(start), frame.x(end)
                rows.append(
                    f'<rect class="{kind}" x="{a:.1f}" y="{_ROW * k + 2 + lane * thick:.1f}" '
                    f'width="{max(b - a, 0.5):.1f}" height="{thick - 1:.1f}"/>'
                )
    said = escape(" ".join((title + ".", described)).strip(), quote=True)
    return (
        f'<figure class="chart"><p class="name">{escape(title)}</p>'
        f'<svg viewBox="0 0 {WIDTH} {height + _BOTTOM + _TOP}" role="img" aria-label="{said}">'
        f'<g transform="translate({_LABEL},{_TOP})">{frame.x_axis("s")}{"".join(rows)}</g></svg></figure>'
    )


class _Frame:
    """From data to the plot's pixels."""

    def __init__(self, x: tuple[float, float], y: tuple[float, float], size: tuple[int, int]) -> None:
        self._x, self._y, self._size = x, y, size

    def x(self, value: float) -> float:
        """Of one value."""
        return (value - self._x[0]) / (self._x[1] - self._x[0]) * self._size[0]

    def axes(self, x_unit: str) -> str:
        """Grid lines and their numbers."""
        parts = []
        for value in _ticks(*self._y, 4):
            y = (self._y[1] - value) / (self._y[1] - self._y[0]) * self._size[1]
            parts.append(f'<path class="rule" d="M0 {y:.1f}H{self._size[0]}"/>')
            parts.append(f'<text class="end" x="-6" y="{y + 4:.1f}">{_text(value)}</text>')
        return "".join(parts) + self.x_axis(x_unit)

    def x_axis(self, unit: str) -> str:
        """The lower axis."""
        width, height = self._size
        parts = []
        first = self._x[0] if abs(self._x[0]) >= _LONG else 0.0
        for value in _ticks(self._x[0] - first, self._x[1] - first, 4):
            x = self.x(first + value)
            parts.append(f'<path class="rule" d="M{x:.1f} 0V{height}"/>')
            if x < width - (80 if first else 26) or not unit:
                parts.append(f'<text class="mid" x="{x:.1f}" y="{height + 17}">{_text(value)}</text>')
        said = f"{unit} from start" if first else unit
        parts.append(f'<text class="end" x="{width}" y="{height + 17}">{escape(said)}</text>')
        return "".join(parts)

    def line(self, line: Line) -> str:
        """A path that is broken where the line is."""
        return f'<path class="line {line.kind}" d="{"".join(self._pieces(*thinned(line.x, line.y)))}"/>'

    def band(self, band: Band) -> str:
        """Closed paths, one a piece without a break."""
        known = np.isfinite(band.low) & np.isfinite(band.high)
        parts = []
        for run in _runs(known):
            x = np.concatenate((band.x[run], band.x[run][::-1]))
            y = np.concatenate((band.low[run], band.high[run][::-1]))
            parts += [*self._pieces(x, y), "Z"]
        return f'<path class="band {band.kind}" d="{"".join(parts)}"/>' if parts else ""

    def mark(self, mark: Mark) -> str:
        """A line from top to bottom."""
        return f'<path class="line {mark.kind}" d="M{self.x(mark.x):.1f} 0V{self._size[1]}"/>'

    def _pieces(self, x: Array, y: Array) -> list[str]:
        width, height = self._size
        across = (x - self._x[0]) / (self._x[1] - self._x[0]) * width
        down = (self._y[1] - y) / (self._y[1] - self._y[0]) * height
        down = np.clip(down, -height, 2.0 * height)  # what lies far outside needs no long numbers
        parts = []
        for run in _runs(np.isfinite(across) & np.isfinite(down)):
            points = [
                f"{a:.1f} {b:.1f}" for a, b in zip(across[run].tolist(), down[run].tolist(), strict=True)
            ]
            parts.append("M" + "L".join(points if len(points) > 1 else points * 2))
        return parts


def _runs(known: NDArray[np.bool_]) -> list[slice]:
    """Pieces in which all is known."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], known.astype(np.int8), [0]))))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _ranges(chart: Chart) -> tuple[tuple[float, float], tuple[float, float]]:
    xs = [one.x for one in chart.lines]
    ys = [*(one.y for one in chart.lines), *(v for b in chart.bands for v in (b.low, b.high))]
    x = _padded(chart.x_range or _extent(xs), 0.0)
    y = _padded(chart.y_range or _extent(ys), 0.06)
    if chart.square:
        half = 0.53 * max(x[1] - x[0], y[1] - y[0])
        x, y = ((0.5 * (a + b) - half, 0.5 * (a + b) + half) for a, b in (x, y))
    return x, y


def _extent(columns: Sequence[Array]) -> tuple[float, float]:
    known = [column[np.isfinite(column)] for column in columns]
    values = np.concatenate(known) if known else np.zeros(0)
    return (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)


def _padded(ends: tuple[float, float], part: float) -> tuple[float, float]:
    low, high = ends
    size = max(abs(low), abs(high))
    room = part * (high - low)
    if high - low <= 1e-12 * size or size == 0.0:
        room = max(0.05 * size, 1e-3)
    return low - room, high + room


def _ticks(low: float, high: float, about: int) -> list[float]:
    """Round numbers within the ends."""
    rough = (high - low) / about
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(s * power for s in (1.0, 2.0, 5.0, 10.0) if s * power >= 0.999 * rough)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [k * step for k in range(first, last + 1)]


def _text(value: float) -> str:
    return f"{value:.10g}" if 1e-4 <= abs(value) < 1e7 else f"{value:.3g}"
