"""The report's pictures beside that of the flight: misfit, spectra, ranking of causes, gain."""

import math
from html import escape
from typing import Any

import numpy as np

from wingwatch.diagnosis.result import Diagnosis, Gain
from wingwatch.diagnosis.summary import by_misfit, display, label_title
from wingwatch.pages.picture import BOTTOM_PX, TOP_PX, Figure, axis_layout, plain_numbers
from wingwatch.pages.texts import number

__all__ = ["gain_figure", "misfit_figure", "ranking_figure", "spectrum_figures"]

_MOST_SPECTRA = 6
_MOST_RANKED = 12
_BAR_PX = 30
_LABEL_WIDTH = 18


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
        {"type": "bar", "orientation": "h", "name": name, "y": labels, "x": plain_numbers(values)}
        | {"marker": {"color": colour}, "hovertemplate": "%{x:.3f}"}
        for name, colour, values in parts
        if not all(map(math.isnan, values))
    ]
    noise = [m.tic * math.sqrt(max(m.noise_fraction, 0.0)) for m in misfits]
    if not all(map(math.isnan, noise)):
        marker = {"color": "$ink", "symbol": "diamond", "size": 9, "line": {"color": "$card", "width": 1}}
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": "noise alone",
                "y": labels,
                "x": plain_numbers(noise),
            }
            | {"marker": marker}
        )
    layout = {
        "barmode": "stack",
        "bargap": 0.35,
        "xaxis": axis_layout("Theil's coefficient") | {"rangemode": "tozero"},
        "yaxis": __category_axis(),
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
            ("as it stands", {"color": "$before", "width": 2, "dash": "dot"}),
            ("extended", {"color": "$after", "width": 2}),
            ("noise", {"color": "$quiet", "width": 2, "dash": "dash"}),
        )
        data = [
            {"type": "scatter", "mode": "lines", "name": name, "line": line}
            | {"x": plain_numbers(hz[used]), "y": plain_numbers(shown.factor**2 * power[used])}
            for (name, line), power in zip(lines, spectra[channel], strict=True)
            if np.isfinite(power[used]).any() and (diagnosis.causes or name != "extended")
        ]
        unit = f"({shown.unit})²" if "/" in shown.unit else f"{shown.unit}²" if shown.unit else "1"
        layout = {
            "xaxis": axis_layout("frequency, Hz") | {"type": "log"},
            "yaxis": axis_layout(f"power, {unit}/Hz")
            | {"type": "log", "exponentformat": "power", "dtick": 1},
            "margin": {"t": TOP_PX, "b": BOTTOM_PX, "l": 70, "r": 10},
        }
        title = f"Residual of {escape(shown.name)}"
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
                | {"y": [_wrapped(label_title(row[0]), 24) for row in rows], "x": plain_numbers(r[1] for r in rows)}
                | {"text": [number(row[1]) for row in rows], "textposition": "outside", "cliponaxis": False}
                | {"textfont": {"color": "$ink"}, "hoverinfo": "skip"}
            )  # fmt: skip
    order = [_wrapped(label_title(row[0]), 24) for row in ranked]
    layout = {
        "barmode": "overlay",
        "bargap": 0.35,
        "xaxis": axis_layout("log-likelihood gained") | {"rangemode": "tozero", "tickangle": 0, "nticks": 4},
        "yaxis": __category_axis() | {"categoryorder": "array", "categoryarray": order},
        "margin": {"t": TOP_PX, "b": BOTTOM_PX, "l": 62, "r": 52},
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
        "array": plain_numbers(100.0 * (i.high - i.value) for i in changes),
        "arrayminus": plain_numbers(100.0 * (i.value - i.low) for i in changes),
    }  # fmt: skip
    data: list[dict[str, Any]] = [
        {"type": "scatter", "mode": "markers", "name": "change, 95 % interval", "error_x": bars}
        | {"y": [_wrapped(display(c).name) for c in channels], "x": plain_numbers(100.0 * i.value for i in changes)}
        | {"marker": {"color": "$after", "size": 10}}
    ]  # fmt: skip
    layout = {
        "xaxis": axis_layout("change of the rms residual, %") | {"zeroline": True, "zerolinecolor": "$ink"},
        "yaxis": __category_axis(),
    }
    return Figure("gain-picture", f"Gain on {escape(gain.source)}", data, layout, _bars_height(len(channels)))


def __category_axis() -> dict[str, Any]:
    return {"type": "category", "automargin": True, "linecolor": "$soft", "ticks": "", "showgrid": False}


def _bars_height(rows: int) -> int:
    return TOP_PX + BOTTOM_PX + 16 + _BAR_PX * max(rows, 2)


def _wrapped(text: str, width: int = _LABEL_WIDTH) -> str:
    """In lines of about so many letters, so that a phone has room for more than the labels."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "<br>".join(map(escape, lines))
