"""The pictures of a study's report."""

import math
from collections.abc import Sequence
from html import escape
from typing import Any

from wingwatch.pages.picture import BOTTOM_PX, TOP_PX, Figure, axis_layout, plain_numbers
from wingwatch.studies.calibration import Exceedance, Scatter
from wingwatch.studies.detection import Delays, Detection
from wingwatch.studies.false_alarms import OperatingCurve, Rate
from wingwatch.studies.faults import FaultRow
from wingwatch.studies.naming import Confusion, Sizes
from wingwatch.studies.operator_answer import Answer
from wingwatch.studies.page.texts import column_text, effect_text, group_text, size_axis

__all__ = [
    "answer_figure",
    "confusion_figure",
    "delay_figure",
    "detection_figure",
    "exceedance_figure",
    "faults_figure",
    "operating_figure",
    "rate_figure",
    "scatter_figure",
    "size_figure",
    "threshold_figure",
]

_COLOURS = 6
_HEIGHT_PX = 400
_ROW_PX = 34
_DASHES = ("solid", "dash", "dot", "dashdot")
_SYMBOLS = ("circle", "square", "diamond", "triangle-up", "cross", "x")


def _colour(k: int) -> str:
    return f"$s{k % _COLOURS + 1}"


def _errors(
    values: Sequence[float], low: Sequence[float], high: Sequence[float], colour: str
) -> dict[str, Any]:
    return {
        "type": "data", "symmetric": False, "color": colour, "thickness": 1.4, "width": 4,
        "array": plain_numbers(h - v for v, h in zip(values, high, strict=True)),
        "arrayminus": plain_numbers(v - lo for v, lo in zip(values, low, strict=True)),
    }  # fmt: skip


def _line(name: str, x: Sequence[float], y: Sequence[float], colour: str, **more: Any) -> dict[str, Any]:
    dash = more.pop("dash", "solid")
    return {
        "type": "scatter", "mode": "lines", "name": name, "x": plain_numbers(x), "y": plain_numbers(y),
        "line": {"color": colour, "width": 2, "dash": dash} | more.pop("line", {}),
    } | more  # fmt: skip


def _band(x: Sequence[float], low: Sequence[float], high: Sequence[float], colour: str) -> dict[str, Any]:
    return {
        "type": "scatter", "mode": "lines", "fill": "toself", "fillcolor": f"{colour}band", "line": {"width": 0},
        "x": plain_numbers([*x, *reversed(x)]), "y": plain_numbers([*high, *reversed(low)]),
        "hoverinfo": "skip", "showlegend": False,
    }  # fmt: skip


def answer_figure(name: str, answers: Sequence[Answer], words: Sequence[str]) -> Figure:
    """Size that is noticed with 95 % probability within 30 s, by condition; open: no flown size is."""
    largest = max(a.largest for a in answers)
    known = [(word, a) for word, a in zip(words, answers, strict=True) if a.size.low > 0.0]
    inside = [(word, a) for word, a in known if a.size.value <= a.largest]
    beyond = [(word, a) for word, a in known if a.size.value > a.largest]
    data = []
    if inside:
        values, low = [a.size.value for _, a in inside], [a.size.low for _, a in inside]
        bars = _errors(values, low, [min(a.size.high, 1.2 * largest) for _, a in inside], "$s1")
        rows = [_wrapped(word) for word, _ in inside]
        data.append(_dots("95 % within 30 s, 95 % interval", rows, values, bars, "$s1"))
    if beyond:
        ends = [a.largest for _, a in beyond]
        bars = _errors(ends, [min(a.size.low, a.largest) for _, a in beyond], ends, "$s2")
        rows = [_wrapped(word) for word, _ in beyond]
        data.append(_dots("larger than what was flown", rows, ends, bars, "$s2", "triangle-right-open"))
    layout = {
        "xaxis": axis_layout(size_axis(answers[0].effect)) | {"range": [0.0, 1.15 * largest]},
        "yaxis": _category_axis()
        | {"categoryorder": "array", "categoryarray": [_wrapped(word) for word in words][::-1]},
    }
    title = f"{_capital(effect_text(answers[0].effect))}: smallest size noticed in time"
    return Figure(name, escape(title), data, layout, _rows_height(len(answers)))


def detection_figure(name: str, groups: Sequence[Detection]) -> Figure:
    """Probability of detection against size: fitted curves with bands, and classes of flights."""
    data: list[dict[str, Any]] = []
    for k, group in enumerate(groups):
        colour, words = _colour(k), _legend(group.by, group.group)
        if group.curve is not None:
            c = group.curve
            data.append(_band(c.size, c.low, c.high, colour) | {"legendgroup": words})
            line = _line(
                words, c.size, c.probability, colour, dash=_DASHES[k % len(_DASHES)], legendgroup=words
            )
            data.append(line)
        values = [c.detected.value for c in group.classes]
        bars = _errors(
            values, [c.detected.low for c in group.classes], [c.detected.high for c in group.classes], colour
        )
        data.append(
            {"type": "scatter", "mode": "markers", "name": words, "legendgroup": words, "error_y": bars}
            | {"x": plain_numbers(c.size for c in group.classes), "y": plain_numbers(values)}
            | {"marker": {"color": colour, "size": 7, "symbol": _SYMBOLS[k % len(_SYMBOLS)]}}
            | {"showlegend": group.curve is None}
        )
    effect = groups[0].effect
    layout = {
        "xaxis": axis_layout(size_axis(effect)) | {"rangemode": "tozero"},
        "yaxis": axis_layout("probability of detection") | {"range": [-0.03, 1.03]},
        "shapes": [_level("y", 0.95)],
    }
    return Figure(name, _title(effect, "detection", groups[0].by), data, layout, _HEIGHT_PX)


def delay_figure(name: str, groups: Sequence[Delays]) -> Figure:
    """Fraction of flights noticed over the time since onset, beside that of the bound."""
    data: list[dict[str, Any]] = []
    times_s = [t for g in groups for t in (*g.time_s, *g.bound_time_s) if 0.0 < t < math.inf]
    ends = max(min(times_s, default=1.0), 0.01), max(times_s, default=100.0)
    log_range = {"type": "log", "nticks": 8, "range": [math.log10(end) for end in ends]}
    for k, group in enumerate(groups):
        colour, words = _colour(k), _legend(group.by, group.group)
        if group.time_s:
            start = max(group.time_s[0] * 0.999, 1e-3)
            times, fractions = [start, *group.time_s], [0.0, *group.fraction]
            data.append(_line(words, times, fractions, colour, line={"shape": "hv"}, legendgroup=words))
        steps = [(k + 1) / len(group.bound_time_s) for k in range(len(group.bound_time_s))]
        finite = [
            (t, f) for t, f in zip(group.bound_time_s, steps, strict=True) if math.isfinite(t) and t > 0.0
        ]
        if finite:
            x, y = zip(*finite, strict=True)
            data.append(
                _line(f"{words}: bound", x, y, colour, dash="dot", legendgroup=words)
                | {"showlegend": len(groups) == 1}
            )
    layout = {
        "xaxis": axis_layout("time since onset, s") | log_range,
        "yaxis": axis_layout("fraction of flights noticed") | {"range": [-0.03, 1.03]},
        "shapes": [_level("x", 30.0)],
    }
    return Figure(
        name, _title(groups[0].effect, "delay and its bound (dotted)", groups[0].by), data, layout, _HEIGHT_PX
    )


def rate_figure(name: str, rates: Sequence[Rate]) -> Figure:
    """False alarms per 100 h of each group."""
    known = [r for r in rates if math.isfinite(r.per_hour.value)][::-1]
    values = [100.0 * r.per_hour.value for r in known]
    bars = _errors(
        values, [100.0 * r.per_hour.low for r in known], [100.0 * r.per_hour.high for r in known], "$s1"
    )
    data = [
        _dots(
            "rate, 95 % interval", [_wrapped(group_text(r.by, r.group)) for r in known], values, bars, "$s1"
        ),
    ]
    ends = [4.0, 1.5 * max(values, default=0.0)] + [300.0 * r.per_hour.high for r in known if not r.by]
    layout = {
        "xaxis": axis_layout("false alarms per 100 h") | {"range": [-0.02 * max(ends), max(ends)]},
        "yaxis": _category_axis(),
        "shapes": [_level("x", 1.0) | {"name": "one in 100 h", "showlegend": True}],
    }
    return Figure(name, "False alarms", data, layout, _rows_height(len(known)))


def threshold_figure(name: str, curve: OperatingCurve) -> Figure:
    """Detection and false alarms over the threshold, one above the other."""
    x = curve.threshold
    data = [
        _band(x, curve.detected_low, curve.detected_high, "$s1"),
        _line("alerts", x, curve.detected, "$s1", legendgroup="alerts"),
        _line("evidence alone", x, curve.evidence_detected, "$s2", dash="dash", legendgroup="evidence"),
    ]
    top = max((r for r in curve.per_hour_high + curve.evidence_per_hour if math.isfinite(r)), default=1.0)
    low = 0.1
    rate = {"yaxis": "y2", "showlegend": False}
    data += [
        _band(
            x,
            [max(100.0 * v, low) for v in curve.per_hour_low],
            [100.0 * v for v in curve.per_hour_high],
            "$s1",
        )
        | {"yaxis": "y2"},
        _line("alerts", x, [100.0 * v or math.nan for v in curve.per_hour], "$s1", legendgroup="alerts")
        | rate,
        _line(
            "evidence alone", x, [100.0 * v or math.nan for v in curve.evidence_per_hour], "$s2", dash="dash"
        )
        | rate
        | {"legendgroup": "evidence"},
    ]
    own = {"type": "line", "xref": "x", "yref": "paper", "x0": curve.own_threshold, "x1": curve.own_threshold}
    layout = {
        "xaxis": axis_layout("threshold of the log evidence (vertical line: the monitor's own)") | {"anchor": "y2"},
        "yaxis": axis_layout("fraction detected") | {"domain": [0.54, 1.0], "range": [-0.03, 1.03]},
        "yaxis2": axis_layout("false alarms per 100 h")
        | {"domain": [0.0, 0.46], "type": "log", "range": [math.log10(low), math.log10(max(100.0 * top, 10.0))]},
        "shapes": [
            own | {"y0": 0.0, "y1": 1.0, "line": {"color": "$ink", "width": 1}},
            _level("y", 1.0) | {"yref": "y2"},
        ],
    }  # fmt: skip
    return Figure(name, "Detection and false alarms over the threshold", data, layout, 540)


def operating_figure(name: str, curves: Sequence[OperatingCurve]) -> Figure:
    """Detection against false alarms, a line per kind of air; the markers are the monitor as it is."""
    data = []
    for k, curve in enumerate(curves):
        words, colour = _legend(curve.by, curve.group), _colour(k)
        passed = [k for k, rate in enumerate(curve.evidence_per_hour) if rate > 0.0 and math.isfinite(rate)]
        rates = [100.0 * curve.evidence_per_hour[k] for k in passed]
        line = _line(words, rates, [curve.evidence_detected[k] for k in passed], colour, legendgroup=words)
        data.append(
            line
            | {"customdata": plain_numbers(curve.threshold[k] for k in passed)}
            | {"hovertemplate": "threshold %{customdata:.1f}: %{y:.2f} at %{x:.2g} per 100 h"}
        )
        own, seen = curve.own_per_hour, curve.own_detected
        at = own.value if own.value > 0.0 else own.high
        marker = {"color": colour, "size": 11, "symbol": "circle" if own.value > 0.0 else "triangle-left"}
        data.append(
            {"type": "scatter", "mode": "markers", "name": words, "legendgroup": words, "showlegend": False}
            | {"x": plain_numbers([100.0 * at]), "y": plain_numbers([seen.value]), "marker": marker}
            | {"error_x": _errors([100.0 * at], [100.0 * own.low], [100.0 * own.high], colour)}
            | {"error_y": _errors([seen.value], [seen.low], [seen.high], colour)}
        )
    layout = {
        "xaxis": axis_layout("false alarms per 100 h")
        | {"type": "log", "nticks": 6, "range": [-1.0, _top(curves)]},
        "yaxis": axis_layout("fraction detected") | {"range": [-0.03, 1.03]},
        "shapes": [_level("x", 1.0)],
    }
    return Figure(name, "Operating curve: evidence (lines) and alerts (markers)", data, layout, _HEIGHT_PX)


def size_figure(name: str, sizes: Sizes) -> Figure:
    """Estimated against true size with stated 95 % intervals."""
    half = [1.96 * e for e in sizes.standard_error]
    low = [s - h for s, h in zip(sizes.estimated, half, strict=True)]
    high = [s + h for s, h in zip(sizes.estimated, half, strict=True)]
    bottom, top = min(0.0, *sizes.true), max(0.0, *sizes.true)
    reach = max(top, -bottom)
    points = {"type": "scatter", "mode": "markers", "name": "estimate, stated 95 % interval"}
    data = [
        points
        | {"x": plain_numbers(sizes.true), "y": plain_numbers(sizes.estimated)}
        | {"error_y": _errors(sizes.estimated, low, high, "$s1band"), "marker": {"color": "$s1", "size": 5}},
        _line("right", [bottom, top], [bottom, top], "$ink", dash="dash"),
    ]
    shown = sorted(abs(s) for s in sizes.estimated)[math.ceil(0.98 * len(sizes.estimated)) - 1]
    edge = 1.2 * max(reach, min(shown, 2.0 * reach))
    layout = {
        "xaxis": axis_layout(f"true {size_axis(sizes.effect)}") | {"rangemode": "tozero"},
        "yaxis": axis_layout("estimated") | {"range": [-edge if bottom < 0.0 else -0.05 * reach, edge]},
    }
    return Figure(
        name, f"{_capital(effect_text(sizes.effect))}: estimated against true size", data, layout, _HEIGHT_PX
    )


def faults_figure(name: str, title: str, faults: Sequence[FaultRow], words: Sequence[str]) -> Figure:
    """Percent noticed within 10 s and by the end, and percent named rightly at first, by fault."""
    rows = [_wrapped(word, 26) for word in words][::-1]
    data = []
    for k, (what, found) in enumerate(
        (
            ("noticed within 10 s", [f.within["10"] for f in faults]),
            ("noticed by the end", [f.seen for f in faults]),
            ("of the noticed, right at first", [f.first_right for f in faults]),
        )
    ):
        values = [100.0 * i.value for i in found][::-1]
        low, high = [100.0 * i.low for i in found][::-1], [100.0 * i.high for i in found][::-1]
        bars = _errors(values, low, high, f"{_colour(k)}band")
        data.append(_dots(what, rows, values, bars, _colour(k), _SYMBOLS[k]))
    layout = {
        "xaxis": axis_layout("% of the flights") | {"range": [-3.0, 103.0]},
        "yaxis": _category_axis() | {"categoryorder": "array", "categoryarray": rows},
    }
    return Figure(name, escape(title), data, layout, _rows_height(len(rows)))


def confusion_figure(name: str, found: Sequence[Confusion]) -> Figure:
    """Percent of flights with each effect by what was said of them."""
    said = list(dict.fromkeys(cause for row in found for cause in row.said))
    said = [c for c in said if c not in ("unknown", "nothing")] + ["unknown", "nothing"]
    rows = [_wrapped(f"{_row_title(row.effect)} ({row.flights})") for row in found][::-1]
    part = [[100.0 * row.said.get(c, 0) / max(row.flights, 1) for c in said] for row in found][::-1]
    data: list[dict[str, Any]] = [
        {
            "type": "heatmap", "x": [_wrapped(effect_text(c), 10) for c in said], "y": rows,
            "z": [plain_numbers(values) for values in part], "zmin": 0, "zmax": 100, "xgap": 2, "ygap": 2,
            "colorscale": [[0, "$card"], [1, "$heat"]], "showscale": False, "name": "percent of flights",
            "text": [[f"{v:.0f}" if v else "" for v in values] for values in part],
            "texttemplate": "%{text}", "textfont": {"color": "$ink"}, "hovertemplate": "%{y} said %{x}: %{z:.1f} %",
        }
    ]  # fmt: skip
    layout = {
        "xaxis": _category_axis() | {"title": {"text": "said", "standoff": 8}, "side": "bottom"},
        "yaxis": _category_axis() | {"title": {"text": "true (flights)", "standoff": 8}},
        "showlegend": False,
        "margin": {"t": 50, "b": 80, "l": 62, "r": 16},
    }
    return Figure(name, "What was said, in % of the flights", data, layout, 130 + 14 + 44 * len(found))


def scatter_figure(name: str, found: Sequence[Scatter]) -> Figure:
    """Scatter of healthy blocks over what was stated, per structure and stratum."""
    structures = list(dict.fromkeys(s.structure for s in found))
    labels = list(dict.fromkeys(_wrapped(group_text(s.by, s.group)) for s in found))[::-1]
    data = []
    for k, structure in enumerate(structures):
        rows = [s for s in found if s.structure == structure and math.isfinite(s.ratio.value)]
        values = [s.ratio.value for s in rows]
        bars = _errors(values, [s.ratio.low for s in rows], [s.ratio.high for s in rows], _colour(k))
        y = [_wrapped(group_text(s.by, s.group)) for s in rows]
        data.append(
            _dots(structure.replace("_", " "), y, values, bars, _colour(k), _SYMBOLS[k % len(_SYMBOLS)])
        )
    layout = {
        "xaxis": axis_layout("chi-square per degree of freedom (1: as stated)")
        | {"type": "log", "nticks": 6},
        "yaxis": _category_axis() | {"categoryorder": "array", "categoryarray": labels},
        "shapes": [_level("x", 1.0) | {"name": "as stated", "showlegend": True}],
    }
    return Figure(
        name, "Scatter of block evidence over its stated error", data, layout, _rows_height(len(labels))
    )


def exceedance_figure(name: str, found: Sequence[Exceedance]) -> Figure:
    """P(largest Bayes factor > c) on healthy flights beside 1/c."""
    data = []
    for k, group in enumerate(found):
        some = [i for i, fraction in enumerate(group.fraction) if fraction > 0.0]
        x, y = [group.factor[i] for i in some], [group.fraction[i] for i in some]
        bars = _errors(y, [group.low[i] for i in some], [group.high[i] for i in some], _colour(k))
        line = _line(_legend(group.by, group.group), x, y, _colour(k), mode="lines+markers", error_y=bars)
        data.append(line | {"marker": {"size": 7, "symbol": _SYMBOLS[k % len(_SYMBOLS)]}})
    factors = found[0].factor
    data.append(_line("1/c", factors, [1.0 / f for f in factors], "$ink", dash="dash"))
    layout = {
        "xaxis": axis_layout("Bayes factor c of a change against none") | {"type": "log", "dtick": 1},
        "yaxis": axis_layout("P(largest Bayes factor > c)")
        | {"type": "log", "range": [-4.3, 0.1], "dtick": 1, "exponentformat": "power"},
    }
    return Figure(name, "Bayes factors on healthy flights", data, layout, _HEIGHT_PX)


def _dots(
    name: str, y: Sequence[str], x: Sequence[float], bars: dict[str, Any], colour: str, symbol: str = "circle"
) -> dict[str, Any]:
    return {
        "type": "scatter", "mode": "markers", "name": name, "y": list(y), "x": plain_numbers(x), "error_x": bars,
        "marker": {"color": colour, "size": 8, "symbol": symbol},
    }  # fmt: skip


def _top(curves: Sequence[OperatingCurve]) -> float:
    """Decade that ends the axis of false alarms per 100 h."""
    rates = [
        100.0 * r for c in curves for r in (*c.evidence_per_hour, c.own_per_hour.high) if math.isfinite(r)
    ]
    return max(1.0, math.log10(1.2 * max(rates, default=1.0)))


def _level(axis: str, value: float) -> dict[str, Any]:
    """A thin dashed line across the picture."""
    line = {"color": "$quiet", "width": 1, "dash": "dash"}
    if axis == "x":
        return {
            "type": "line",
            "xref": "x",
            "yref": "paper",
            "x0": value,
            "x1": value,
            "y0": 0,
            "y1": 1,
            "line": line,
        }
    return {
        "type": "line",
        "xref": "paper",
        "yref": "y",
        "x0": 0,
        "x1": 1,
        "y0": value,
        "y1": value,
        "line": line,
    }


def _legend(by: str, group: str) -> str:
    return escape(group_text(by, group).removeprefix(f"{column_text(by)} ") if by else "all flights")


def _title(effect: str, what: str, by: str) -> str:
    return escape(f"{_capital(effect_text(effect))}: {what}" + (f" by {column_text(by)}" if by else ""))


def _row_title(effect: str) -> str:
    return "healthy" if effect == "nothing" else effect_text(effect)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _category_axis() -> dict[str, Any]:
    return {"type": "category", "automargin": True, "linecolor": "$soft", "ticks": "", "showgrid": False}


def _rows_height(rows: int) -> int:
    return TOP_PX + BOTTOM_PX + 16 + _ROW_PX * max(rows, 2)


def _wrapped(text: str, width: int = 18) -> str:
    """In lines of about so many letters, so that a phone has room for more than the labels."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "<br>".join(map(escape, lines))
