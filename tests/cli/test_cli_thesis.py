"""`thesis`: printed tables beside ours, the report, what it refuses, and that the document is what it makes."""

import re
from pathlib import Path

import numpy as np
import pytest
from cli_flights import ROOT, run

from wingwatch.aircraft import natural_frequency_and_damping, state_matrix
from wingwatch.studies.thesis.cases import case_of
from wingwatch.studies.thesis.printed import plants, printed_tables

DOCUMENT = ROOT / "docs" / "thesis.md"
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def section(text: str, table: str) -> str:
    """A table's part of a Markdown report."""
    start = text.index(f"## Table {table} ")
    end = text.find("\n## ", start + 1)
    return text[start : len(text) if end < 0 else end].strip()


def test_a_table_has_printed_and_own_figures(capsys: pytest.CaptureFixture[str]) -> None:
    result = run(capsys, ["thesis", "--table", "7.3", "--draws", "3", "--json"]).json
    (table,) = result["tables"]
    assert (table["plant"], table["kind"], table["cases"], table["repeated"]) == (
        "aerosonde_short_period",
        "derivatives",
        2,
        2,
    )
    rows = {(row["case"], row["name"]): row for row in table["quantities"]}
    assert len(rows) == 12
    pitch = rows["differentiated, noise", "m_q"]
    assert (pitch["true"], pitch["printed"], pitch["printed_error"]) == (-6.035, -2.110, 0.935)
    assert pitch["apart"] == pytest.approx(
        (pitch["ours"] - pitch["printed"]) / np.hypot(pitch["ours_error"], 0.935)
    )
    # twelve errors of a normal law: one in a hundred thousand such tables has one beyond five
    assert all(abs(row["ours"] - row["true"]) < 5.0 * row["ours_error"] for row in rows.values())


def test_what_cannot_be_repeated_says_why_and_is_counted(capsys: pytest.CaptureFixture[str]) -> None:
    result = run(capsys, ["thesis", "--table", "8.14", "--draws", "2", "--json"]).json
    (table,) = result["tables"]
    assert (table["cases"], table["repeated"]) == (2, 1)
    assert any(note.startswith("not repeated: the roll derivatives") for note in table["notes"])
    assert any("not public" in note for note in table["notes"])
    assert "Of their 2 cases 1 are repeated" in result["coverage"]
    assert [row["ours"] is None for row in table["quantities"]] == [False] * 5 + [True] * 5


def test_a_report_stands_alone(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    page = tmp_path / "thesis.html"
    asked = ["thesis", "--table", "9.6", "--figure", "9.15", "--draws", "2", "--report", str(page)]
    ran = run(capsys, asked)
    text = page.read_text()
    assert ran.code == 0
    assert "Table 9.6" in ran.out
    assert text.count("<svg viewBox") == 3
    assert "Figure 9.15" in text
    assert "://" not in text
    assert "<script" not in text


def test_the_document_is_what_the_command_makes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    made = tmp_path / "thesis.md"
    assert run(capsys, ["thesis", "--table", "8.13", "--report", str(made)]).code == 0
    here, there = section(made.read_text(), "8.13"), section(DOCUMENT.read_text(), "8.13")
    assert NUMBER.sub("0", here) == NUMBER.sub("0", there)
    made_now, written = (np.array(NUMBER.findall(text), dtype=float) for text in (here, there))
    np.testing.assert_allclose(
        made_now, written, rtol=0.02, atol=0.011
    )  # another processor may round another way


def test_the_document_has_every_table() -> None:
    text = DOCUMENT.read_text()
    assert [number for number in ("7.1", *printed_tables()) if f"## Table {number} " not in text] == []


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["--table", "7.12"], "--table 7.12: not a result table"),
        (["--figure", "2.1"], "--figure 2.1: not drawn here"),
        (["--draws", "1"], "--draws 1: give at least 2"),
        (["--table", "7.1", "--table", "7.2"], "--table 7.1 holds no estimates"),
        (["--report", "thesis.pdf"], "thesis.pdf"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(
    capsys: pytest.CaptureFixture[str], asked: list[str], said: str
) -> None:
    assert said in run(capsys, ["thesis", *asked]).sentence


def test_printed_pulses_are_those_of_the_printed_frequencies(capsys: pytest.CaptureFixture[str]) -> None:
    rows = run(capsys, ["thesis", "--table", "7.1", "--json"]).json["rows"]
    assert [row["pulse printed, s"] for row in rows] == ["0.2018", "0.3846"]
    assert all(abs(float(row["apart"].removesuffix(" %"))) < 0.05 for row in rows)


def test_what_lies_beyond_the_thesis_is_measured(capsys: pytest.CaptureFixture[str]) -> None:
    parts = {
        one["name"]: one["rows"]
        for one in run(capsys, ["thesis", "--beyond", "--draws", "6", "--json"]).json["beyond"]
    }
    short = [row for row in parts["beyond-errors"] if row["plant"] == "short period"]
    theirs, *ours = (float(row["truth in 95 %"].removesuffix(" %")) for row in short)
    assert theirs < 80.0 < min(ours)
    after = {
        row["estimator"]: row["4 s after"] for row in parts["beyond-damage"] if row["plant"] == "short period"
    }
    assert float(after["Fourier, online"].removesuffix(" %")) < 5.0
    assert float(after["thesis's recursion, factor 0.998"].removesuffix(" %")) > 10.0
    air = {
        row["estimator"]: row["median rms error"]
        for row in parts["beyond-air"]
        if row["plant"] == "short period"
    }
    assert float(air["Fourier, online"].removesuffix(" %")) < 5.0


def test_printed_tables_are_whole() -> None:
    tables = printed_tables()
    sizes = {"derivatives": 6, "fit": 5, "frequency": 3}
    assert len(tables) == 42
    for table in tables.values():
        for case in table.cases:
            assert case.values.shape == (sizes[table.kind],)
            assert (case.errors is not None) == (table.kind == "derivatives")
            assert case_of(table.plant, case.name).seconds > 0.0


def test_printed_frequencies_follow_from_printed_derivatives_but_for_one_plant() -> None:
    """The linearised Dutch roll of the Aerosonde is the exception, which its tables' notes say."""
    apart = {}
    for name, plant in plants().items():
        matrix = state_matrix(plant.structure, plant.by_symbol)
        natural, damping = natural_frequency_and_damping(plant.structure, matrix)
        apart[name] = max(abs(natural / plant.frequency[0] - 1.0), abs(damping / plant.frequency[2] - 1.0))
    assert {name for name, share in apart.items() if share > 0.01} == {"aerosonde_dutch_roll"}
