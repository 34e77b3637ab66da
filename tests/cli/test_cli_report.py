"""`report`: the page says what `monitor`, `estimate` and `condition` say, stands alone, and does with what there is."""

import re
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_flights import demo_block, run, without

from wingwatch.aircraft import load_aircraft
from wingwatch.cli.alert_texts import spaced
from wingwatch.cli.report_page.content import collect
from wingwatch.cli.report_page.report_page import report_html
from wingwatch.operations.progress import Progress
from wingwatch.pages.texts import number
from wingwatch.telemetry import SampleBlock, load_flight, write_flight

HEALTHY_S, ICING_S = 62.0, 130.0
SECTIONS = ("flight", "outcome", "excited", "derivatives", "modes", "fit", "sensors", "table")


class Read(HTMLParser):
    """A page's sections in order, its tables by row, and whatever it would load or run."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.sections: list[str] = []
        self.rows: list[list[str]] = []
        self.loads: list[str] = []
        self.charts = 0
        self._cell = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag == "section":
            self.sections.append(str(given["id"]))
        if tag in ("script", "link", "img", "iframe", "object") or {"src", "href", "srcset", "style"} & set(
            given
        ):
            self.loads.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self._cell = True
            self.rows[-1].append("")
        self.charts += tag == "figure"

    def handle_endtag(self, tag: str) -> None:
        if tag in ("td", "th"):
            self._cell = False

    def handle_data(self, data: str) -> None:
        if self._cell:
            self.rows[-1][-1] += data


def reported(capsys: pytest.CaptureFixture[str], flight: Path, *more: object) -> tuple[dict[str, Any], str]:
    """The JSON and the page."""
    out = flight.with_suffix(".html")
    result = run(capsys, ["report", flight, "--aircraft", "aerosonde", "--out", out, "--json", *more]).json
    text = out.read_text(encoding="utf-8")
    assert result["report"] == str(out)
    assert result["bytes"] == len(text.encode()) < 2_000_000
    return result, text


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "healthy.parquet"
    write_flight(demo_block("healthy", HEALTHY_S), path)
    return path


def test_the_page_says_what_the_other_commands_say(capsys: pytest.CaptureFixture[str], healthy: Path) -> None:
    result, text = reported(capsys, healthy)
    estimated = run(capsys, ["estimate", healthy, "--aircraft", "aerosonde", "--json"]).json
    watched = run(capsys, ["monitor", healthy, "--aircraft", "aerosonde", "--json"]).json
    assert result["estimators"] == estimated["estimators"]
    same = ("status", "reason", "alerts", "could_see", "observable_s", "duration_s")
    assert {k: result[k] for k in same} == {k: watched[k] for k in same}
    page = Read(text)
    rows = {tuple(row[:2]): row for row in page.rows}
    for name, said in (("fourier", "Fourier"), ("ekf", "filter")):
        for mode in estimated["estimators"][name].values():
            for symbol, row in mode["derivatives"].items():
                shown = [number(row["value"], 4), number(row["standard_error"], 2)]
                assert rows[symbol, said][2:4] == shown
                assert rows[symbol, said][-1] == spaced(row["outcome"])
    assert "No alert" in text
    assert f"{watched['observable_s']:.0f} of {watched['duration_s']:.0f} s were observable" in text


@pytest.fixture(scope="module")
def made(healthy: Path) -> tuple[list[dict[str, Any]], str]:
    """The fit of each manoeuvre and the page, worked out once."""
    content = collect(load_flight(healthy), load_aircraft("aerosonde"), Progress(False))
    fit = [
        {
            "structure": m.structure,
            "from_s": m.time_s[0],
            "to_s": m.time_s[-1],
            "channels": {c.name: c for c in m.channels},
        }
        for m in content.manoeuvres
    ]
    return fit, report_html(content)


def test_the_page_stands_alone_and_in_order(made: tuple[list[dict[str, Any]], str]) -> None:
    _, text = made
    page = Read(text)
    assert tuple(page.sections) == SECTIONS
    assert not page.loads
    assert not re.findall(r"https?:|url\(|@import", text)
    assert "default-src 'none'" in unescape(text)
    assert "script-src" not in text
    assert page.charts > 30
    assert "nan" not in "".join(re.findall(r' d="[^"]*"', text))


def test_the_motion_of_a_healthy_aircraft_is_predicted_to_its_noise(
    made: tuple[list[dict[str, Any]], str],
) -> None:
    fit, _ = made
    assert {one["structure"] for one in fit} == {"short_period", "lateral"}
    for one in fit:
        assert one["to_s"] > one["from_s"]
        for name in ("q", "p", "r"):
            if name in one["channels"]:
                assert one["channels"][name].r_squared > 0.95
                assert 0.8 < one["channels"][name].over_noise < 2.0


def test_ice_is_on_the_page_with_its_evidence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    flight = tmp_path / "iced.parquet"
    write_flight(demo_block("icing", ICING_S), flight)
    result, text = reported(capsys, flight)
    alert = result["alerts"][0]
    assert alert["kind"] == "icing"
    assert "<h1>Warning: Icing of severity" in text
    assert f"raised at {alert['raised_s']:.1f} s" in text
    assert f"{alert['evidence'][0]['z']:.1f}" in [row[3] for row in Read(text).rows if len(row) == 5]
    assert 'class="line mark"' in text
    pitching = [one for one in result["fit"] if one["structure"] == "short_period"]
    before = [one["channels"]["q"] for one in pitching if one["to_s"] < 60.0]
    after = [one["channels"]["q"] for one in pitching if one["from_s"] > 90.0]
    assert min(q["r_squared_expected"] for q in before) > 0.9
    assert max(q["r_squared_expected"] - q["r_squared"] for q in after) < 0.0


def test_a_flight_without_vanes_position_and_rudder(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    flight = tmp_path / "poor.csv"
    vanes, position = ("angle_of_attack_rad", "sideslip_rad"), ("latitude_deg", "longitude_deg")
    speeds = tuple(f"velocity_{axis}_m_s" for axis in ("north", "east", "down"))
    lacking = (*vanes, *position, *speeds, "rudder_rad", "rudder_command_rad")
    write_flight(without(demo_block("healthy", HEALTHY_S), *lacking), flight)
    result, text = reported(capsys, flight)
    assert "No track: the flight has no latitude and longitude" in text
    assert "turbulence needs a vane" in text
    assert "Rudder, position" not in text
    assert {one["structure"] for one in result["fit"]} == {"short_period", "lateral"}
    assert all("w" not in one["channels"] and "v" not in one["channels"] for one in result["fit"])


def test_gaps_and_bad_rows_are_counted(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    flight = tmp_path / "gaps.csv"
    block = demo_block("healthy", HEALTHY_S)
    values = block.values.copy()
    values[500, 3] = np.nan
    write_flight(SampleBlock(np.delete(values, slice(1000, 1100), axis=0)), flight)
    _, text = reported(capsys, flight)
    assert "1 gap of more than 0.5 s, the longest 2.02 s" in text
    assert "1 without a finite value" in text


@pytest.mark.parametrize(
    ("out", "said"),
    [("x.txt", ".html or .htm"), ("absent/x.html", "create it"), ("flight.html", "a file that is read")],
)
def test_a_page_that_could_not_be_written_is_refused_first(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, out: str, said: str
) -> None:
    flight = tmp_path / "flight.html"
    flight.write_text("time_s\n1\n")
    arguments = ["report", flight, "--aircraft", "aerosonde", "--out", tmp_path / out]
    assert said in run(capsys, arguments).sentence


@pytest.mark.parametrize("text", ["", "not a table", "time_s,airspeed_true_m_s\n1,2\n"])
def test_a_flight_that_cannot_be_read_is_a_sentence(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str
) -> None:
    flight, out = tmp_path / "flight.csv", tmp_path / "page.html"
    flight.write_text(text)
    assert "flight.csv" in run(capsys, ["report", flight, "--aircraft", "aerosonde", "--out", out]).sentence
    assert not out.exists()


def test_a_flight_too_short_to_judge_is_a_sentence(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    flight, out = tmp_path / "flight.csv", tmp_path / "page.html"
    write_flight(SampleBlock(demo_block("healthy", HEALTHY_S).values[:10]), flight)
    said = run(capsys, ["report", flight, "--aircraft", "aerosonde", "--out", out]).sentence
    assert "nothing could be judged" in said
    assert not out.exists()
