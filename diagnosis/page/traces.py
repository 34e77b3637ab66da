"""The picture of the flight: measured, simulated and extended over each other, where they part most."""

import math
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.result import Diagnosis, Traces
from wingwatch.diagnosis.summary import by_misfit, display
from wingwatch.pages.picture import BOTTOM_PX, TOP_PX, Figure, axis_layout, plain_numbers

__all__ = ["EXCERPT_S", "excerpt_s", "trace_figure"]

Array = NDArray[np.float64]

EXCERPT_S = 20.0
"""Length of what is shown at first of a longer flight."""

_MOST_CHANNELS = 5
_MOST_POINTS = 6000
_ROW_PX, _TITLE_PX, _OVERVIEW_PX = 165, 26, 60


def trace_figure(diagnosis: Diagnosis) -> Figure | None:
    """A row per channel, those that are missed most first; a strip below shows the whole flight."""
    traces = diagnosis.traces if diagnosis.causes else replace(diagnosis.traces, mended={})
    channels = [c for c in by_misfit(diagnosis.misfit) if c in traces.measured][:_MOST_CHANNELS]
    if not channels or not np.isfinite(traces.time_s).any():
        return None
    shown = excerpt_s(traces, channels[0])
    rows = len(channels)
    height = TOP_PX + BOTTOM_PX + _ROW_PX * rows + (_OVERVIEW_PX if shown else 0)
    data: list[dict[str, Any]] = []
    shared: dict[str, list[float | None]] = {}
    layout: dict[str, Any] = {"annotations": [], "hovermode": "x"}
    for i, channel in enumerate(channels):
        top = 1.0 - i / rows - _TITLE_PX / (_ROW_PX * rows)
        axis = _suffix(i)
        layout[f"yaxis{axis}"] = axis_layout() | {"domain": [1.0 - (i + 1) / rows, top], "nticks": 5}
        layout[f"xaxis{axis}"] = _time_axis(i, rows, shown)
        layout["annotations"].append(_row_title(escape(display(channel).axis), top))
        kept = _kept(traces, channel, shown)
        data += _overlaid(traces, channel, i, kept)
        stamps = traces.time_s[kept]
        shared[f"t{i}"] = [None if math.isnan(t) else round(float(t), 3) for t in stamps]
    title = "Measured, simulated and extended" if traces.mended else "Measured and simulated"
    return Figure("traces", title, data, layout, height, shared)


def excerpt_s(traces: Traces, channel: str) -> tuple[float, float] | None:
    """The stamps between which a channel's residual is largest; None for a flight short enough to be shown whole."""
    known = np.isfinite(traces.time_s)
    stamps = traces.time_s[known]
    if stamps[-1] - stamps[0] <= 1.5 * EXCERPT_S or channel not in traces.simulated:
        return None
    squares = np.nan_to_num((traces.simulated[channel] - traces.measured[channel])[known]) ** 2
    total = np.concatenate([[0.0], np.cumsum(squares)])
    starts = np.arange(stamps[0], stamps[-1] - EXCERPT_S + 1e-9, 1.0)
    first, last = np.searchsorted(stamps, starts), np.searchsorted(stamps, starts + EXCERPT_S)
    best = float(starts[np.argmax(total[last] - total[first])])
    return best, best + EXCERPT_S


def _suffix(row: int) -> str:
    """Of plotly's axes: x, x2, x3."""
    return "" if row == 0 else str(row + 1)


def _time_axis(row: int, rows: int, shown: tuple[float, float] | None) -> dict[str, Any]:
    """All rows move together; the last one carries the ticks and the strip."""
    anchor = {"anchor": f"y{_suffix(row)}"}
    zoom = {} if shown is None else {"range": list(shown)}
    if row < rows - 1:
        return axis_layout() | anchor | zoom | {"showticklabels": False, "matches": f"x{_suffix(rows - 1)}"}
    strip = {
        "visible": True,
        "thickness": 0.05,
        "bgcolor": "$paper",
        "bordercolor": "$line",
        "borderwidth": 1,
    }
    return axis_layout("time, s") | anchor | zoom | ({} if shown is None else {"rangeslider": strip})


def _overlaid(traces: Traces, channel: str, row: int, kept: NDArray[np.intp]) -> list[dict[str, Any]]:
    """The lines of one channel."""
    axis = _suffix(row)
    return [
        {
            "type": "scatter", "mode": "lines", "name": name, "legendgroup": name, "showlegend": row == 0,
            "x": f"@t{row}", "y": plain_numbers(np.where(np.isfinite(traces.time_s), values, np.nan)[kept]),
            "line": line, "xaxis": f"x{axis}", "yaxis": f"y{axis}", "connectgaps": False,
        }
        for name, values, line in _lines(traces, channel)
    ]  # fmt: skip


def _lines(traces: Traces, channel: str) -> list[tuple[str, Array, dict[str, Any]]]:
    """Name, values in the shown unit, and look."""
    lines = (
        ("measured", traces.measured, {"color": "$ink", "width": 1.3}),
        ("as it stands", traces.simulated, {"color": "$before", "width": 1.6, "dash": "dot"}),
        ("extended", traces.mended, {"color": "$after", "width": 1.6}),
    )
    factor = display(channel).factor
    return [(name, factor * by[channel], line) for name, by, line in lines if channel in by]


def _kept(traces: Traces, channel: str, shown: tuple[float, float] | None) -> NDArray[np.intp]:
    """Which samples to draw: all of a short flight; else the excerpt's, the gaps', and each bucket's extremes."""
    time_s = traces.time_s
    if len(time_s) <= _MOST_POINTS:
        return np.arange(len(time_s))
    signals = [values for _, values, _ in _lines(traces, channel)]
    whole = ~np.isfinite(time_s)
    if shown is not None:
        whole |= (time_s >= shown[0]) & (time_s <= shown[1])
    extremes = _extremes(signals, _MOST_POINTS // (2 * len(signals)))
    return np.union1d(np.flatnonzero(whole), np.array(extremes, dtype=np.intp))


def _extremes(signals: Sequence[Array], buckets: int) -> list[int]:
    """Where in each bucket a signal is smallest and largest."""
    found = []
    for bucket in np.array_split(np.arange(len(signals[0])), buckets):
        for values in signals:
            part = values[bucket]
            if np.isfinite(part).any():
                found += [int(bucket[np.nanargmin(part)]), int(bucket[np.nanargmax(part)])]
    return found


def _row_title(text: str, y: float) -> dict[str, Any]:
    return {
        "text": f"<b>{text}</b>", "x": 0.0, "xref": "paper", "xanchor": "left", "y": y, "yref": "paper",
        "yanchor": "bottom", "showarrow": False, "font": {"color": "$ink", "size": 12.5},
    }  # fmt: skip
