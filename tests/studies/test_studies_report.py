"""A study's report stands alone: whole, without anything from elsewhere, and safe whatever a table's texts hold."""

import importlib
import json
import re
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from browser import Page, chromium_path, open_page
from study_tables import Truth, drawn_table

from wingwatch.studies.report import report_html, report_json, write_report
from wingwatch.studies.summary import Summary, summarise

NASTY = "</script><script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">&amp;"
SECTIONS = [
    "faults",
    "answer",
    "detection",
    "delays",
    "false-alarms",
    "operating",
    "sizes",
    "naming",
    "worst",
    "calibration",
]


@pytest.fixture(scope="module")
def summary() -> Summary:
    return summarise(drawn_table(1500, 1, Truth(effects=("icing", "wing_damage"), sensor_fault=0.1)))


def own(html: str) -> str:
    """The page without plotly's script."""
    return re.sub(r"<script>/\*\*?.*?</script>", "", html, count=1, flags=re.DOTALL)


def figures(html: str) -> list[dict[str, Any]]:
    match = re.search(r'<script type="application/json" id="figures">(.*?)</script>', html, re.DOTALL)
    assert match is not None
    found: list[dict[str, Any]] = json.loads(match.group(1))
    return found


def resolved(value: Any) -> Any:
    """Colours put in, as the page's script does."""
    if isinstance(value, str) and value.startswith("$"):
        return "#123456"
    if isinstance(value, dict):
        return {key: resolved(v) for key, v in value.items()}
    return [resolved(v) for v in value] if isinstance(value, list) else value


def test_the_answer_stands_first_and_every_section_follows(summary: Summary) -> None:
    html = own(report_html(summary))
    assert re.findall(r'<section id="([a-z-]+)"', html) == SECTIONS
    assert html.index("is noticed with 95 % probability within 30 s") < html.index("<section")
    assert "false alarms in" in html[: html.index("<section")]


def test_every_picture_has_title_axes_legend_and_a_sentence(summary: Summary) -> None:
    graph: Any = importlib.import_module("plotly.graph_objects")
    html = report_html(summary)
    drawn = figures(html)
    assert len({f["name"] for f in drawn}) == len(drawn) >= 12
    for figure in drawn:
        layout = resolved(figure["layout"])
        graph.Figure(data=resolved(figure["data"]), layout=layout)
        assert layout["title"]["text"]
        assert layout["xaxis"]["title"]["text"]
        assert layout["yaxis"].get("title") or layout["yaxis"]["type"] == "category"
        assert layout["showlegend"] or figure["data"][0]["type"] == "heatmap"
        assert re.search(rf'id="{figure["name"]}".*?<figcaption>[^<]{{20,}}</figcaption>', html, re.DOTALL)


def test_nothing_is_loaded_from_elsewhere(summary: Summary) -> None:
    html = report_html(summary)
    assert "default-src &#x27;none&#x27;" in html
    assert not re.findall(r"(?:src|href)\s*=|https?://|@import|url\(", own(html))


def test_every_false_alarm_and_worst_flight_opens_to_its_command(summary: Summary) -> None:
    html = report_html(summary)
    for seed in [a.seed for a in summary.false_alarms] + [w.seed for w in summary.worst]:
        assert f"<code>wingwatch study replay STUDY.parquet --seed {seed}</code></details>" in html
    time_s = next(a.time_s for a in summary.false_alarms if a.reason)
    assert (
        f"m_q off by +4.0 standard errors; least likely block: short period to {time_s:.0f} s, probability 1e-05"
        in html
    )


def test_texts_of_a_table_never_become_markup() -> None:
    table = drawn_table(400, 2)
    for name in (
        "aircraft",
        "command",
        "said_cause",
        "target",
        "effect",
        "turbulence",
        "code_version",
        "route",
    ):
        texts = [f"{NASTY}{text}" if text else "" for text in table[name].to_pylist()]
        table = table.set_column(table.schema.get_field_index(name), name, pa.array(texts))
    html = report_html(summarise(table))
    assert "<img" not in own(html)
    assert own(html).count("</script>") == 2  # the data's and our own
    assert figures(html)


@pytest.mark.parametrize("flights", [0, 1, 12])
def test_hardly_a_flight_still_makes_a_page(flights: int) -> None:
    assert "<h1>" in report_html(summarise(drawn_table(flights, 3)))


def test_too_few_hours_are_said_to_be_too_few() -> None:
    html = own(report_html(summarise(drawn_table(300, 4))))
    assert "healthy hours cannot vouch for one false alarm in 100 h" in html
    healthy = own(report_html(summarise(drawn_table(300, 5, Truth(healthy=1.0, false_per_hour=0.0)))))
    assert "<h1>No false alarm in 25 h of healthy flight, a rate of 0 (0 to 15) in 100 h.</h1>" in healthy


def test_the_same_figures_as_json(summary: Summary, tmp_path: Path) -> None:
    found = json.loads(report_json(summary))
    assert found["flown"]["flights"] == 1500
    assert len(found["false_alarms"]) == len(summary.false_alarms)
    path = tmp_path / "report.html"
    write_report(summary, path)
    assert path.read_text(encoding="utf-8") == report_html(summary)
    with pytest.raises(OSError, match=r"report\.html"):
        write_report(summary, tmp_path / "absent" / "report.html")


# in a browser

DRAWN = "[...document.querySelectorAll('.picture')].every((p) => p.querySelector('.main-svg'))"
TITLE_COLOUR = "getComputedStyle(document.querySelector('.gtitle')).fill"
needs_browser = pytest.mark.skipif(
    chromium_path() is None,
    reason="the report needs a browser, and this machine has no Chromium: install the package chromium",
)


@pytest.fixture
def page(summary: Summary, tmp_path: Path) -> Generator[Page]:
    path = tmp_path / "report.html"
    write_report(summary, path)
    with open_page(path.as_uri()) as opened:
        opened.look(1100, 900)
        opened.wait(f"document.querySelectorAll('.picture').length > 0 && {DRAWN}", 60.0)
        yield opened


@needs_browser
def test_a_browser_draws_every_picture_without_a_complaint(page: Page) -> None:
    assert page.console == []
    assert page.ask("performance.getEntriesByType('resource').length") == 0
    light = page.ask(TITLE_COLOUR)
    page.look(1100, 900, "dark")
    page.wait(f"{TITLE_COLOUR} !== {light!r}")
    for width in (340, 720):
        page.look(width, 900, mobile=width < 500)
        page.wait("document.querySelector('.main-svg').clientWidth <= innerWidth")
        assert page.ask("document.documentElement.scrollWidth") <= width


@needs_browser
def test_a_click_opens_the_command_of_a_flight(page: Page) -> None:
    line = "document.querySelector('#worst details')"
    assert page.ask(f"{line}.querySelector('code').checkVisibility()") is False
    page.ask(f"{line}.querySelector('summary').click()")
    assert page.ask(f"{line}.querySelector('code').checkVisibility()") is True
    assert page.ask(f"{line}.querySelector('code').innerText").startswith("wingwatch study replay")
