"""The report stands alone: whole, without anything from elsewhere, and safe whatever a file's texts hold."""

import dataclasses
import importlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnosis_examples import AGREES, FOUND, NOTHING_FOUND

from wingwatch.diagnosis import Diagnosis, NotSeparable, Traces, write_report
from wingwatch.diagnosis.page.traces import EXCERPT_S, excerpt_s
from wingwatch.diagnosis.report import report_html

NASTY = "</script><script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">&amp;"
ALL = pytest.mark.parametrize("diagnosis", [FOUND, NOTHING_FOUND, AGREES], ids=["found", "nothing", "agrees"])
SECTIONS = ("flight", "misfit", "spectra", "ranking", "causes", "inseparable", "gain", "derivatives",
            "unexplained", "notes")  # fmt: skip


def own(html: str) -> str:
    """The page without plotly's script."""
    return re.sub(r"<script>/\*\*?.*?</script>", "", html, count=1, flags=re.DOTALL)


def figures(html: str) -> list[dict[str, Any]]:
    match = re.search(r'<script type="application/json" id="figures">(.*?)</script>', html, re.DOTALL)
    assert match is not None
    found: list[dict[str, Any]] = json.loads(match.group(1))
    return found


def resolved(value: Any, shared: dict[str, Any]) -> Any:
    """Colours and shared arrays put in, as the page's script does."""
    if isinstance(value, str) and value.startswith("$"):
        return "#123456"
    if isinstance(value, str) and value.startswith("@"):
        return shared[value[1:]]
    if isinstance(value, dict):
        return {key: resolved(v, shared) for key, v in value.items()}
    return [resolved(v, shared) for v in value] if isinstance(value, list) else value


@ALL
def test_the_page_has_its_answer_first_and_its_sections_in_order(diagnosis: Diagnosis) -> None:
    html = own(report_html(diagnosis))
    present = re.findall(r'<section id="([a-z]+)"', html)
    assert present == [name for name in SECTIONS if name in present]
    assert {"flight", "misfit", "causes", "gain", "unexplained"} <= set(present)
    assert html.index("<h1>The simulation of aerosonde") < html.index("<section")


def test_everything_that_was_found_is_said() -> None:
    html = own(report_html(FOUND))
    assert set(re.findall(r'<section id="([a-z]+)"', html)) == set(SECTIONS)
    for words in (
        "0.301 ± 0.012", "0.0603 ± 0.0019", "derivative m_eta", "elevator doublets at two airspeeds", "-131.5",
        "a scaled inertia", "74 % smaller (66 to 79)", "thrust line not stated", "no noise is stated", "17 %",
    ):  # fmt: skip
        assert words in html


@ALL
def test_every_picture_is_valid_and_has_title_axes_and_a_sentence(diagnosis: Diagnosis) -> None:
    graph: Any = importlib.import_module("plotly.graph_objects")
    html = report_html(diagnosis)
    drawn = figures(html)
    assert len(drawn) >= 4
    for figure in drawn:
        content = resolved(figure, figure["shared"])
        graph.Figure(data=content["data"], layout=content["layout"])
        assert content["layout"]["title"]["text"]
        assert any(axis.get("title") for key, axis in content["layout"].items() if key.startswith("xaxis"))
        assert f'id="{figure["name"]}" role="img" aria-label="' in html


@ALL
def test_nothing_is_loaded_from_elsewhere(diagnosis: Diagnosis) -> None:
    html = report_html(diagnosis)
    assert "default-src &#x27;none&#x27;" in html
    rest = own(html)
    assert len(rest) < len(html) - 1_000_000
    assert not re.findall(r"(?:src|href)\s*=|https?://|@import|url\(", rest)


def test_texts_of_files_never_become_markup() -> None:
    hostile = dataclasses.replace(
        FOUND,
        source=NASTY,
        causes=tuple(
            dataclasses.replace(
                c, text=NASTY, separating_manoeuvre=NASTY, indistinguishable_from=(NASTY,), name=NASTY
            )
            for c in FOUND.causes
        ),
        ranking=((NASTY, 1.0, 0.5),),
        unexplained=NASTY,
        not_separable=(NotSeparable((NASTY,), NASTY),),
        notes=(NASTY,),
        misfit={**FOUND.misfit, NASTY: FOUND.misfit["roll_rate_rad_s"]},
    )
    html = own(report_html(hostile))
    assert "<img" not in html
    assert html.count("</script>") == 2  # the data's and our own
    assert figures(report_html(hostile))


def test_without_a_cause_nothing_is_drawn_as_extended() -> None:
    for diagnosis, drawn in ((FOUND, True), (NOTHING_FOUND, False)):
        names = {trace.get("name") for figure in figures(report_html(diagnosis)) for trace in figure["data"]}
        assert {"measured", "as it stands", "noise"} <= names
        assert ("extended" in names) is drawn


def test_a_picture_without_data_is_left_out() -> None:
    nothing = Traces(np.array([np.nan]), {}, {}, {}, np.array([]), {})
    drawn = figures(report_html(dataclasses.replace(AGREES, traces=nothing)))
    assert [figure["name"] for figure in drawn] == ["misfit-picture"]


def test_a_long_flight_is_thinned_but_not_where_it_is_shown() -> None:
    n = 200_000
    t = 0.02 * np.arange(n, dtype=np.float64)
    signal = np.sin(t).astype(np.float64)
    signal[150_001] = 50.0
    traces = Traces(t, {"pitch_rate_rad_s": signal}, {"pitch_rate_rad_s": np.sin(t)}, {}, np.array([]), {})
    long = dataclasses.replace(
        NOTHING_FOUND,
        traces=traces,
        misfit={"pitch_rate_rad_s": FOUND.misfit["pitch_rate_rad_s"]},
    )
    shown = excerpt_s(traces, "pitch_rate_rad_s")
    assert shown is not None
    assert shown[0] <= t[150_001] <= shown[1] == shown[0] + EXCERPT_S
    html = report_html(long)
    assert len(own(html)) < 1_000_000
    (stamps,) = figures(html)[0]["shared"].values()
    assert sum(shown[0] <= stamp <= shown[1] for stamp in stamps) >= 50 * EXCERPT_S


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "report.html"
    path.write_text("before")

    def interrupted(self: Path, target: Path) -> Path:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_report(AGREES, path)
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]
    assert path.read_text() == "before"


def test_a_place_that_cannot_be_written_names_the_file(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"report\.html") as refused:
        write_report(AGREES, tmp_path / "absent" / "report.html")
    assert refused.value.filename == str(tmp_path / "absent" / "report.html")
