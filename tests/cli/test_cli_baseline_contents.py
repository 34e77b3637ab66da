"""`baseline`: expectation and flights side by side, pictures, and files that carry it all to the bit."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_flights import run
from postgres_server import own_schema

from wingwatch.aircraft import SHORT_PERIOD, Provenance, aircraft_toml, load_aircraft
from wingwatch.baselines import (
    BaselineLedger,
    Cell,
    Expectation,
    ExpectationRecord,
    Reference,
    ReferenceKey,
    american,
    apriori_envelope,
    empirical,
    open_database,
)
from wingwatch.cli.baseline_plot import surface_of
from wingwatch.diagnosis.candidate import updated
from wingwatch.operations.baseline_objects import Asked

AEROSONDE = load_aircraft("aerosonde")
KEY = ReferenceKey("default", "uav1", "aerosonde", "clean", "short_period")
A_PRIORI = apriori_envelope(AEROSONDE, SHORT_PERIOD)
SHOW = ["--aircraft", "aerosonde", "--vehicle", "uav1"]


def flown(at: Expectation, off: float, known: int = 6) -> Reference:
    """Flights that say a share more than is expected, of the first derivatives alone, with a tenth of the errors."""
    value, covariance = american(at.value, at.covariance, SHORT_PERIOD, AEROSONDE, at.condition)
    weights = np.zeros(6)
    weights[:known] = 100.0 / np.diagonal(covariance)[:known]
    return Reference(np.diag(weights), weights * value * (1.0 + off), 60, 600.0)


@pytest.fixture
def database(tmp_path: Path) -> Path:
    """A vehicle that has flown, an entry that is nasty to print, a cell."""
    path = tmp_path / "w.db"
    with open_database(path) as opened:
        middle = A_PRIORI.points[13]
        opened.save_reference(KEY, flown(middle, 0.1), 1e9 / 3.0)
        opened.save_cell(KEY, Cell(24, 1), flown(middle, -1.0 / 3.0), 2e9 / 3.0)
    return path


def test_expectation_and_flights_are_side_by_side(capsys: pytest.CaptureFixture[str], database: Path) -> None:
    at = A_PRIORI.points[13]
    where = f"{at.condition.airspeed_true_m_s!r},{at.condition.altitude_m!r}"
    result = run(capsys, ["baseline", "show", database, *SHOW, "--at", where, "--json"]).json
    side = result["at"]["structures"]["short_period"]
    after = empirical(at, flown(at, 0.1), AEROSONDE)
    for i, symbol in enumerate(SHORT_PERIOD.derivatives):
        row = side["derivatives"][symbol]
        assert row["stored"] is None
        assert row["a_priori"]["value"] == pytest.approx(at.value[i])
        assert row["a_priori"]["standard_error"] == pytest.approx(at.standard_error[i])
        assert row["flights"]["standard_error"] == pytest.approx(0.1 * at.standard_error[i])
        assert row["expected"]["value"] == pytest.approx(after.value[i])
        assert row["expected"]["standard_error"] == pytest.approx(after.standard_error[i])
        joint = math.hypot(at.standard_error[i], 0.1 * at.standard_error[i])
        assert row["z"] == pytest.approx((row["flights"]["value"] - at.value[i]) / joint)
    # The a-priori errors are independent, and so are these flights': the distance is the sum of squares.
    total = sum(row["z"] ** 2 for row in side["derivatives"].values())
    assert side["distance"]["squared"] == pytest.approx(total)
    assert (side["distance"]["freedom"], 0.0 < side["distance"]["probability"] < 1.0) == (6, True)
    assert all(
        row["flights"] is None for row in result["at"]["structures"]["lateral"]["derivatives"].values()
    )
    (cell,) = result["cells"]
    assert (cell["structure"], cell["blocks"], cell["seconds"]) == ("short_period", 60, 600.0)
    assert cell["age_s"] > 1e9
    people = run(capsys, ["baseline", "show", database, *SHOW]).out
    assert "joint errors" in people
    assert "6 directions" in people


def test_what_flights_leave_open_is_not_shown_as_known(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path, at = tmp_path / "w.db", A_PRIORI.points[13]
    with open_database(path) as opened:
        opened.save_reference(KEY, flown(at, 0.1, known=3), 1.0)
    result = run(capsys, ["baseline", "show", path, *SHOW, "--json", "--convention", "american"]).json
    side = result["at"]["structures"]["short_period"]
    known = {s: row["flights"] is not None for s, row in side["derivatives"].items()}
    assert list(known.values()) == [True] * 3 + [False] * 3
    assert [row["z"] is None for row in side["derivatives"].values()] == [False] * 3 + [True] * 3
    assert side["distance"]["freedom"] == 3
    assert side["derivatives"]["m_q"]["name"] == "Cm_q"


def test_beyond_the_envelope_nothing_is_expected_and_the_reason_is_said(
    capsys: pytest.CaptureFixture[str], database: Path
) -> None:
    result = run(capsys, ["baseline", "show", database, *SHOW, "--at", "90,1000", "--json"]).json
    side = result["at"]["structures"]["short_period"]
    assert "is outside the baseline" in side["a_priori"]["reason"]
    assert side["distance"] is None
    assert all(row["expected"] is None for row in side["derivatives"].values())


def test_a_picture_is_blank_where_nothing_is_expected(
    capsys: pytest.CaptureFixture[str], database: Path, tmp_path: Path
) -> None:
    picture = tmp_path / "m_q.png"
    command = ["baseline", "show", database, *SHOW, "--derivative", "m_q", "--plot"]
    assert run(capsys, [*command, picture]).code == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert ".png" in run(capsys, [*command, tmp_path / "m_q.txt"]).sentence
    command[-2] = "m_x"
    assert "no such derivative" in run(capsys, [*command, picture]).sentence
    with open_database(database) as opened:
        surface = surface_of(opened, Asked(AEROSONDE, vehicle="uav1"), "m_q")
    known = np.isfinite(surface.value)
    low, high = A_PRIORI.points[0].condition, A_PRIORI.points[-1].condition
    inside = (surface.airspeed_m_s >= low.airspeed_true_m_s) & (
        surface.airspeed_m_s <= high.airspeed_true_m_s
    )
    assert known.any()
    assert not known[:, ~inside].any()
    middle = known & np.isfinite(surface.by_file)
    assert (surface.value[middle] < surface.by_file[middle]).all()  # these flights say a tenth more of it


def test_an_aircraft_of_coefficients_is_imported_as_the_monitor_has_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "w.db"
    assert run(capsys, ["baseline", "import", path, "--aircraft", "aerosonde", "--json"]).json["stored"] == 81
    with open_database(path) as opened:
        kept = [one.expectation for one in opened.expectations("aerosonde", "clean", "short_period")]
    stated = sorted(A_PRIORI.points, key=lambda p: (p.condition.airspeed_true_m_s, p.condition.altitude_m))
    assert [k.value.tolist() for k in kept] == [p.value.tolist() for p in stated]
    assert [k.covariance.tolist() for k in kept] == [p.covariance.tolist() for p in stated]
    listed = run(capsys, ["baseline", "list", path, "--json"]).json["aircraft"]
    assert listed[0]["structures"]["lateral"]["entries"] == {"a-priori": 27}
    again = run(capsys, ["baseline", "import", path, "--aircraft", "aerosonde", "--json"]).json
    assert again["stored"] == 81  # a new version: it has another date


def test_what_a_diagnosis_adds_to_a_file_of_derivatives_counts(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    jetstream = load_aircraft("jetstream31")
    stated = jetstream.conditions[0]
    found = updated(stated, provenance="identified", source="wingwatch diagnose")
    file, path = tmp_path / "extended.toml", tmp_path / "w.db"
    file.write_text(aircraft_toml(jetstream.model_copy(update={"conditions": (stated, found)})))
    assert run(capsys, ["baseline", "import", path, "--aircraft", file]).code == 0
    with open_database(path) as opened:
        kept = opened.expectations("jetstream31", "clean", "short_period")
    assert [(k.provenance, k.source) for k in kept] == [("identified", "wingwatch diagnose")]


@pytest.mark.parametrize("kind", ["sqlite", "postgres"])
def test_a_baseline_goes_from_one_database_to_another_to_the_bit(
    capsys: pytest.CaptureFixture[str], database: Path, tmp_path: Path, kind: str
) -> None:
    nasty = np.array([0.1, 1.0 / 3.0, -0.0, 5e-324, 1.7e308, math.pi])
    covariance = np.outer([1, 2, 3, 4, 5, 6], [1, 2, 3, 4, 5, 6]) / 3.0 + np.eye(6)
    covariance = 0.5 * (covariance + covariance.T)
    point = Expectation(
        SHORT_PERIOD, nasty, covariance, Provenance.IDENTIFIED, A_PRIORI.points[3].condition, 'ζ, "flight 7"'
    )
    with open_database(database) as opened:
        opened.put_expectation(ExpectationRecord.of("aerosonde", point, 1e9 + 0.1))
    first, second = tmp_path / "first.json", tmp_path / "second.json"
    assert run(capsys, ["baseline", "export", database, "--out", first, "--json"]).json == {
        "entries": 1, "references": 1, "cells": 1,
    }  # fmt: skip

    def there_and_back(other: str) -> None:
        command = ["baseline", "import", other, "--file", first, "--aircraft", "aerosonde", "--json"]
        assert run(capsys, command).json["stored"] == 3
        assert run(capsys, command).json["stored"] == 0
        assert run(capsys, ["baseline", "export", other, "--out", second]).code == 0

    if kind == "sqlite":
        there_and_back(str(tmp_path / "other.db"))
    else:
        with own_schema() as url:
            there_and_back(url)
    assert first.read_bytes() == second.read_bytes()


def spoiled(document: dict[str, Any], fault: str) -> str:
    """The file with one thing wrong, as text."""
    entry = document["references"][0]
    if fault == "half":
        text = json.dumps(document)
        return text[: len(text) // 2]
    if fault == "version":
        document["version"] = 2
    elif fault == "unit":
        document["units"]["m_w"] = "1/(ft s)"
    elif fault == "asymmetric":
        entry["information"][0][1] = 5.0
    elif fault == "shape":
        entry["vector"] = entry["vector"][:5]
    elif fault == "order":
        entry["derivatives"] = entry["derivatives"][::-1]
    elif fault == "structure":
        entry["structure"] = "phugoid_2"
    elif fault == "number":
        entry["seconds"] = "long"
    elif fault == "vehicle":
        entry["vehicle"] = "UAV 1"
    elif fault == "foreign":
        document = {"format": "something else"}
    return json.dumps(document)


FAULTS = {
    "half": "no whole file", "version": "version 2 of the format", "unit": "m_w is in 1/(ft s)",
    "asymmetric": "must be symmetric", "shape": "are needed", "order": "has derivatives", "number": "seconds",
    "structure": "phugoid_2", "vehicle": "UAV 1", "foreign": "was not written by", "none": "not of ultrastick25e",
}  # fmt: skip


@pytest.mark.parametrize("fault", list(FAULTS))
def test_a_file_that_is_wrong_gets_one_sentence_and_changes_nothing(
    capsys: pytest.CaptureFixture[str], database: Path, tmp_path: Path, fault: str
) -> None:
    file, other = tmp_path / "w.json", tmp_path / "other.db"
    assert run(capsys, ["baseline", "export", database, "--out", file]).code == 0
    file.write_text(spoiled(json.loads(file.read_text()), fault))
    command = ["baseline", "import", other, "--file", file]
    said = run(capsys, [*command, "--aircraft", "ultrastick25e"] if fault == "none" else command).sentence
    assert FAULTS[fault] in said
    assert str(file) in said
    assert not other.exists()


def test_what_would_be_taken_back_or_removed_takes_a_yes(
    capsys: pytest.CaptureFixture[str], database: Path
) -> None:
    for action in ("revert", "delete"):
        said = run(capsys, ["baseline", action, database, *SHOW]).sentence
        assert "version 1 of vehicle default/uav1; add --yes" in said
    with open_database(database) as opened:
        assert opened.load_reference(KEY) is not None
        assert BaselineLedger(opened).changes() == ()
    assert "--to" in run(capsys, ["baseline", "revert", database, *SHOW[:2], "--to", "1"]).sentence
    assert "--entry" in run(capsys, ["baseline", "revert", database, *SHOW, "--entry", "1"]).sentence
    assert "no entry" in run(capsys, ["baseline", "revert", database, *SHOW[:2]]).sentence
    assert run(capsys, ["baseline", "revert", database, *SHOW, "--yes"]).out.startswith(
        "taken back: version 1"
    )
    history = run(capsys, ["baseline", "history", database, *SHOW, "--json"]).json
    assert [c["action"] for c in history["changes"]] == ["revert"]
    assert history["references"]["short_period"][0]["withdrawn_by"] == history["changes"][0]["id"]
    assert run(capsys, ["baseline", "delete", database, *SHOW, "--yes"]).code == 0
    assert run(capsys, ["baseline", "list", database]).out.startswith("the database has no expectations")
    out = database.parent / "x.json"
    assert "nothing to export" in run(capsys, ["baseline", "export", database, "--out", out]).sentence
