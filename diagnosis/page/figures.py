"""The report's pictures as plotly figures: plain data, coloured by the page.

A colour is written ``$name`` for the page's CSS variable ``--name``, so that light, dark and print each have their own;
``@name`` stands for an array that several traces share.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.result import Diagnosis, Gain, Traces
from wingwatch.diagnosis.summary import by_misfit, display, label_title, number

__all__ = ["Figure", "gain_figure", "misfit_figure", "ranking_figure", "spectrum_figures", "trace_figure"]

Array = NDArray[np.float64]

_MOST_CHANNELS = 5
_MOST_SPECTRA = 6
_MOST_RANKED = 12
_MOST_POINTS = 6000
_TOP_PX, _BOTTOM_PX, _ROW_PX, _BAR_PX = 84, 52, 165, 30
_LABEL_WIDTH = 18


@dataclass(frozen=True, slots=True)
class Figure:
    """One picture.

    Attributes:
        name: of its element in the page.
        title: stands in the picture.
        data, layout: as plotly has them.
        height_px: it keeps, whatever its width.
        shared: arrays that traces name as ``@key``.
    """

    name: str
    title: str
    data: list[dict[str, Any]]
    layout: dict[str, Any]
    height_px: int
    shared: Mapping[str, list[float | None]] = field(default_factory=dict)

    @property
    def content(self) -> dict[str, Any]:
        """For JSON."""
        title = {
            "text": self.title, "x": 0.0, "xref": "container", "xanchor": "left", "y": 1.0, "yref": "container",
            "yanchor": "top", "pad": {"t": 8, "l": 4}, "font": {"size": 15},
        }  # fmt: skip
        legend = {
            "orientation": "h", "x": 0.0, "xref": "container", "y": 1.0 - 32.0 / self.height_px, "yref": "container",
            "yanchor": "top", "bgcolor": "rgba(0,0,0,0)",
        }  # fmt: skip
        frame = {
            "title": title, "legend": legend, "height": self.height_px, "showlegend": True,
            "margin": {"t": _TOP_PX, "b": _BOTTOM_PX, "l": 62, "r": 16},
            "font": {"color": "$ink", "size": 12}, "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)",
            "hoverlabel": {"bgcolor": "$card", "font": {"color": "$ink"}},
        }  # fmt: skip
        return {
            "name": self.name,
            "data": self.data,
            "layout": frame | self.layout,
            "shared": dict(self.shared),
        }


def trace_figure(diagnosis: Diagnosis) -> Figure | None:
    """Measured, simulated and mended over each other, a row per channel, those that are missed most first."""
    traces = diagnosis.traces
    channels = [c for c in by_misfit(diagnosis.misfit) if c in traces.measured][:_MOST_CHANNELS]
    if not channels or not np.isfinite(traces.time_s).any():
        return None
    rows = len(channels)
    height = _TOP_PX + _BOTTOM_PX + _ROW_PX * rows
    data: list[dict[str, Any]] = []
    shared: dict[str, list[float | None]] = {}
    layout: dict[str, Any] = {"annotations": [], "hovermode": "x"}
    for i, channel in enumerate(channels):
        top = 1.0 - i / rows
        gap = 26.0 / (_ROW_PX * rows)
        axis = "" if i == 0 else str(i + 1)
        layout[f"yaxis{axis}"] = _axis() | {"domain": [top - 1.0 / rows, top - gap], "nticks": 5}
        last = i == rows - 1
        layout[f"xaxis{axis}"] = (
            _axis("time, s" if last else "")
            | {"anchor": f"y{axis}", "showticklabels": last}
            | ({} if last else {"matches": f"x{rows}"})
        )
        layout["annotations"].append(_row_title(display(channel).axis, top - gap))
        added, stamps = _overlaid(traces, channel, i)
        data += added
        shared[f"t{i}"] = stamps
    title = "Measured and simulated" if not traces.mended else "Measured, simulated and extended"
    return Figure("traces", title, data, layout, height, shared)


def _overlaid(traces: Traces, channel: str, row: int) -> tuple[list[dict[str, Any]], list[float | None]]:
    """The lines of one channel and their stamps."""
    factor = display(channel).factor
    lines = (
        ("measured", traces.measured, {"color": "$ink", "width": 1.3}),
        ("simulated as it stands", traces.simulated, {"color": "$before", "width": 1.5, "dash": "dot"}),
        ("simulated, model extended", traces.mended, {"color": "$after", "width": 1.5}),
    )
    present = [(name, factor * by[channel], line) for name, by, line in lines if channel in by]
    kept = _thinned(traces.time_s, [values for _, values, _ in present])
    axis = "" if row == 0 else str(row + 1)
    data = [
        {
            "type": "scatter", "mode": "lines", "name": name, "legendgroup": name, "showlegend": row == 0,
            "x": f"@t{row}", "y": _numbers(np.where(np.isfinite(traces.time_s), values, np.nan)[kept]),
            "line": line, "xaxis": f"x{axis}", "yaxis": f"y{axis}", "connectgaps": False,
        }
        for name, values, line in present
    ]  # fmt: skip
    return data, [None if math.isnan(t) else round(float(t), 3) for t in traces.time_s[kept]]


def _thinned(time_s: Array, signals: Sequence[Array]) -> NDArray[np.intp]:
    """Which samples to draw: all, or of each bucket those at which a signal is smallest or largest, and the gaps."""
    if len(time_s) <= _MOST_POINTS:
        return np.arange(len(time_s))
    buckets = np.array_split(np.arange(len(time_s)), _MOST_POINTS // (2 * len(signals)))
    kept = {int(i) for i in np.flatnonzero(~np.isfinite(time_s))}
    for bucket in buckets:
        for values in signals:
            part = values[bucket]
            if np.isfinite(part).any():
                kept |= {int(bucket[np.nanargmin(part)]), int(bucket[np.nanargmax(part)])}
    return np.array(sorted(kept))


def misfit_figure(diagnosis: Diagnosis) -> Figure:
    """Theil's coefficient per channel, divided by its proportions, and what noise alone would make of it."""
    channels = by_misfit(diagnosis.misfit)[::-1]
    misfits = [diagnosis.misfit[c] for c in channels]
    labels = [_wrapped(display(c).name) for c in channels]
    parts = (
        ("bias", "$part1", [m.tic * m.bias for m in misfits]),
        ("variance", "$part2", [m.tic * m.variance for m in misfits]),
        ("covariance", "$part3", [m.tic * m.covariance for m in misfits]),
        ("not divided", "$quiet", [m.tic if math.isnan(m.covariance) else math.nan for m in misfits]),
    )
    data: list[dict[str, Any]] = [
        {"type": "bar", "orientation": "h", "name": name, "y": labels, "x": _numbers(values)}
        | {"marker": {"color": colour}, "hovertemplate": "%{x:.3f}"}
        for name, colour, values in parts
        if not all(map(math.isnan, values))
    ]
    noise = [m.tic * math.sqrt(max(m.noise_fraction, 0.0)) for m in misfits]
    if not all(map(math.isnan, noise)):
        marker = {"color": "$ink", "symbol": "diamond", "size": 9, "line": {"color": "$card", "width": 1}}
        data.append(
            {"type": "scatter", "mode": "markers", "name": "noise alone", "y": labels, "x": _numbers(noise)}
            | {"marker": marker}
        )
    layout = {
        "barmode": "stack",
        "bargap": 0.35,
        "xaxis": _axis("Theil's coefficient (0 the same, 1 nothing in common)") | {"rangemode": "tozero"},
        "yaxis": _category_axis(),
    }
    return Figure("misfit-picture", "Misfit by its kind", data, layout, _bars_height(len(channels)))


def spectrum_figures(diagnosis: Diagnosis) -> list[Figure]:
    """Per channel the residual's power before and after, and of the noise that no model explains."""
    hz, spectra = diagnosis.traces.residual_hz, diagnosis.traces.spectra
    used = hz > 0.0
    figures = []
    for channel in [c for c in by_misfit(diagnosis.misfit) if c in spectra][:_MOST_SPECTRA]:
        shown = display(channel)
        lines = (
            ("before", {"color": "$before", "width": 2, "dash": "dot"}),
            ("extended", {"color": "$after", "width": 2}),
            ("noise", {"color": "$quiet", "width": 2, "dash": "dash"}),
        )
        data = [
            {"type": "scatter", "mode": "lines", "name": name, "line": line}
            | {"x": _numbers(hz[used]), "y": _numbers(shown.factor**2 * power[used])}
            for (name, line), power in zip(lines, spectra[channel], strict=True)
            if np.isfinite(power[used]).any()
        ]
        unit = f"({shown.unit})²/Hz" if shown.unit else "1/Hz"
        layout = {
            "xaxis": _axis("frequency, Hz") | {"type": "log"},
            "yaxis": _axis(f"power of the residual, {unit}") | {"type": "log", "exponentformat": "power"},
            "margin": {"t": _TOP_PX, "b": _BOTTOM_PX, "l": 70, "r": 10},
        }
        title = f"Residual of {shown.name}"
        figures.append(Figure(f"spectrum-{channel}", title, data, layout, 330))
    return figures


def ranking_figure(diagnosis: Diagnosis) -> Figure | None:
    """Log-likelihood that each cause gains alone, those found apart from those only tried."""
    ranked = [row for row in diagnosis.ranking if math.isfinite(row[1])][:_MOST_RANKED][::-1]
    if not ranked:
        return None
    found = {cause.label for cause in diagnosis.causes}
    data: list[dict[str, Any]] = []
    for name, colour, wanted in (("found", "$after", True), ("tried", "$quiet", False)):
        rows = [row for row in ranked if (row[0] in found) is wanted]
        if rows:
            data.append(
                {"type": "bar", "orientation": "h", "name": name, "marker": {"color": colour}}
                | {"y": [_wrapped(label_title(row[0]), 24) for row in rows], "x": _numbers(r[1] for r in rows)}
                | {"text": [number(row[1]) for row in rows], "textposition": "outside", "cliponaxis": False}
                | {"textfont": {"color": "$ink"}, "hoverinfo": "skip"}
            )  # fmt: skip
    order = [_wrapped(label_title(row[0]), 24) for row in ranked]
    layout = {
        "barmode": "overlay",
        "bargap": 0.35,
        "xaxis": _axis("log-likelihood gained by this cause alone") | {"rangemode": "tozero"},
        "yaxis": _category_axis() | {"categoryorder": "array", "categoryarray": order},
        "margin": {"t": _TOP_PX, "b": _BOTTOM_PX, "l": 62, "r": 52},
    }
    return Figure("ranking-picture", "How much each cause explains", data, layout, _bars_height(len(ranked)))


def gain_figure(gain: Gain) -> Figure | None:
    """Change of the rms residual on data left out, with 95 % intervals; left of zero is better."""
    channels = [c for c in by_misfit(gain.before) if c in gain.change][::-1]
    if not channels:
        return None
    changes = [gain.change[c] for c in channels]
    bars = {
        "type": "data", "symmetric": False, "thickness": 1.8, "width": 6, "color": "$after",
        "array": _numbers(100.0 * (i.high - i.value) for i in changes),
        "arrayminus": _numbers(100.0 * (i.value - i.low) for i in changes),
    }  # fmt: skip
    data: list[dict[str, Any]] = [
        {"type": "scatter", "mode": "markers", "name": "change, 95 % interval", "error_x": bars}
        | {"y": [_wrapped(display(c).name) for c in channels], "x": _numbers(100.0 * i.value for i in changes)}
        | {"marker": {"color": "$after", "size": 10}}
    ]  # fmt: skip
    layout = {
        "xaxis": _axis("change of the rms residual, %") | {"zeroline": True, "zerolinecolor": "$ink"},
        "yaxis": _category_axis(),
    }
    return Figure("gain-picture", f"Gain on {gain.source}", data, layout, _bars_height(len(channels)))


def _axis(title: str = "") -> dict[str, Any]:
    axis: dict[str, Any] = {"gridcolor": "$line", "zeroline": False, "linecolor": "$soft", "automargin": True}
    return axis | {"title": {"text": title, "standoff": 8}} if title else axis


def _category_axis() -> dict[str, Any]:
    return {"type": "category", "automargin": True, "linecolor": "$soft", "ticks": "", "showgrid": False}


def _row_title(text: str, y: float) -> dict[str, Any]:
    return {
        "text": f"<b>{text}</b>", "x": 0.0, "xref": "paper", "xanchor": "left", "y": y, "yref": "paper",
        "yanchor": "bottom", "showarrow": False, "font": {"color": "$ink", "size": 12.5},
    }  # fmt: skip


def _bars_height(rows: int) -> int:
    return _TOP_PX + _BOTTOM_PX + 16 + _BAR_PX * max(rows, 2)


def _wrapped(text: str, width: int = _LABEL_WIDTH) -> str:
    """In lines of about so many letters, so that a phone has room for more than the labels."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "<br>".join(lines)


def _numbers(values: Iterable[float]) -> list[float | None]:
    """Five digits are more than a picture shows; what is not known is None."""
    return [float(f"{v:.5g}") if math.isfinite(v) else None for v in values]
