"""The report's charts: peaks survive thinning, gaps stay gaps, names are escaped."""

import re

import numpy as np
import pytest

from wingwatch.pages.chart import Band, Chart, Line, Mark, Strip, chart_html, grid, strips_html, thinned
from wingwatch.pages.document import document

TIME_S = np.linspace(0.0, 600.0, 30_001)


def paths(html: str, kind: str) -> list[str]:
    return re.findall(rf'class="{kind}" d="([^"]*)"', html)


def test_thinning_keeps_every_peak_and_the_order() -> None:
    y = np.sin(TIME_S)
    y[12_345], y[20_001] = 9.0, -9.0
    x, kept = thinned(TIME_S, y)
    assert x.size < 700
    assert (np.diff(x) > 0.0).all()
    assert {9.0, -9.0} <= set(kept)
    short = thinned(TIME_S[:100], y[:100])
    assert short[0].size == 100


def test_a_gap_is_no_line() -> None:
    y = np.where((TIME_S > 200.0) & (TIME_S < 300.0), np.nan, TIME_S)
    html = chart_html(
        Chart("rising", lines=[Line(TIME_S, y)], bands=[Band(TIME_S, y - 1.0, y + 1.0, "after")])
    )
    assert [path.count("M") for path in paths(html, "line ink")] == [2]
    assert [path.count("Z") for path in paths(html, "band after")] == [2]


@pytest.mark.parametrize("value", [0.0, 3.0, -1e-9, 1e9, np.nan])
def test_a_level_line_and_no_line_have_axes(value: float) -> None:
    html = chart_html(Chart("level", lines=[Line(TIME_S[:50], np.full(50, value))]))
    assert "nan" not in html
    assert "inf" not in html
    assert "<text" in html


def test_a_clock_since_1970_is_counted_from_the_start() -> None:
    html = chart_html(Chart("y", lines=[Line(1.7e9 + TIME_S[:6000], TIME_S[:6000])]))
    assert "s from start" in html
    assert ">50<" in html
    assert "e+09" not in html


def test_a_map_has_one_scale() -> None:
    html = chart_html(Chart("way", lines=[Line(np.array([0.0, 100.0]), np.array([0.0, 10.0]))], square=True))
    ((x0, y0), (x1, y1)) = [tuple(map(float, p.split())) for p in paths(html, "line ink")[0][1:].split("L")]
    assert (x1 - x0) / (y0 - y1) == pytest.approx(10.0, rel=0.02)


def test_what_comes_from_a_flight_is_escaped() -> None:
    html = chart_html(Chart("<b>", "<i>", [Line(TIME_S[:5], TIME_S[:5])], marks=[Mark(2.0)], x_unit="<u>"))
    html += strips_html("<b>", [Strip("<i>", [[(0.0, 1.0, "good")]])], (0.0, 2.0))
    assert not re.findall("<[biu]>", html)
    assert grid([]) == ""


def test_spans_lie_where_they_belong() -> None:
    html = strips_html("m", [Strip("m_q", [[(0.0, 5.0, "none"), (5.0, 10.0, "good")]])], (0.0, 10.0))
    (none, good) = (
        re.search(rf'class="{kind}" x="([\d.]+)" .*?width="([\d.]+)"', html) for kind in ("none", "good")
    )
    assert none is not None
    assert good is not None
    assert float(none[2]) == float(good[1]) == float(good[2])


def test_a_page_without_pictures_of_plotly_runs_nothing() -> None:
    page = document(title="t", kind="k", answer="a", lead="", about="", body="<p>b</p>", style="")
    assert "<script" not in page
    assert "script-src" not in page
    assert len(page) < 20_000
