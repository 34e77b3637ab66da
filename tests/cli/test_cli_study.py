"""`study`: arguments, refusals with exit code 2, one result, and one flight flown again."""

import json
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from cli_flights import run

from wingwatch.cli import study_command
from wingwatch.studies import read_study
from wingwatch.studies.run import Answer, Task, fly_task
from wingwatch.telemetry import load_flight

GRID = """
seconds = 40.0
aircraft = "aerosonde"
condition = "cruise"
excitation = "doublet"
onset_s = 20.0
"""


class _InThisProcess:
    def __init__(self, workers: int) -> None:
        self.workers = workers

    def answers(self, tasks: Sequence[Task], end: threading.Event) -> Iterator[Answer]:
        for task in tasks:
            yield fly_task(task)


class _Interrupted(_InThisProcess):
    def answers(self, tasks: Sequence[Task], end: threading.Event) -> Iterator[Answer]:
        end.set()
        yield from ()


@pytest.fixture
def grid(tmp_path: Path) -> Path:
    path = tmp_path / "grid.toml"
    path.write_text(GRID, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ((), "needs --out"),
        (("--out", "a.csv"), "a study is written as Parquet"),
        (("--out", "nowhere/a.parquet"), "there is no folder nowhere"),
        (("--out", "a.parquet", "--flights", "0"), "--flights 0: give at least one"),
        (("--out", "a.parquet", "--flights", "2", "--hours", "1"), "leave one out"),
        (("--out", "a.parquet", "--hours", "-1"), "give a positive number of hours"),
        (("--out", "a.parquet", "--seed", "-1"), "give a number from 0"),
        (("--out", "a.parquet", "--workers", "0"), "--workers 0: give at least one"),
        (("--out", "a.parquet", "--report", "a.txt"), "written as .html or .htm"),
        (("--out", "a.parquet", "--workers", "2", "--scheduler", "tcp://a:1"), "leave one out"),
        (("--out", "a.parquet", "--config", "nowhere.toml"), "no such file"),
    ],
)
def test_refusals_are_one_sentence_and_code_2(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...],
    said: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    result = run(capsys, ["study", "icing", *options])
    assert result.code == 2
    assert said in result.err
    assert result.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_the_default_grid_is_shown_as_a_grid_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    text = run(capsys, ["study", "damage", "--show-config"]).out
    assert "[[effects]]" in text
    assert 'name = "wing_damage"' in text


def test_a_study_is_flown_and_one_of_its_flights_again(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, grid: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study_command, "LocalWorkers", _InThisProcess)
    out = tmp_path / "icing.parquet"
    options = ["study", "icing", "--config", grid, "--out", out, "--flights", 2, "--seed", 5]
    result = run(capsys, [*options, "--json"]).json
    assert (result["flights"], result["failed"], result["effects"], result["kind"]) == (2, 0, 2, "icing")
    rows = read_study(out).table.to_pylist()
    assert [row["seed"] for row in rows] == [5, 6]
    flight = tmp_path / "flight.parquet"
    again = run(capsys, ["study", "replay", out, "--seed", 6, "--out", flight, "--json"]).json
    assert again["row"]["command"] == rows[1]["command"] == "wingwatch study replay icing.parquet --seed 6"
    for name in ("severity", "evidence_max", "information", "block_scores", "observed_s"):
        assert again["row"][name] == rows[1][name]
    assert json.loads(rows[1]["icing_factors"]) == again["plan"]["icing_factors"]
    assert len(load_flight(flight).block) == 2000
    refused = run(capsys, ["study", "replay", out, "--seed", 7])
    assert (refused.code, "has flights 5 to 6" in refused.err) == (2, True)
    assert run(capsys, [*options, "--resume"]).code == 2
    report = tmp_path / "report.html"
    shown = run(capsys, ["study", "show", out, out, "--report", report])
    assert (shown.code, "4 simulated flights" in shown.out) == (0, True)
    assert "wingwatch study replay icing.parquet --seed 6" in report.read_text(encoding="utf-8")
    assert run(capsys, ["study", "show", out, "--json"]).json["flown"]["flights"] == 2
    assert run(capsys, ["study", "show", flight]).code == 2


def test_all_studies_are_flown_in_one_go_and_those_that_are_done_are_left(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study_command, "LocalWorkers", _InThisProcess)
    path = tmp_path / "short.toml"
    path.write_text(
        'seconds = 20.0\naircraft = "aerosonde"\nexcitation = "none"\nonset_s = 10.0\n', encoding="utf-8"
    )
    out, report = tmp_path / "studies", tmp_path / "all.html"
    options = [
        "study",
        "all",
        "--out",
        out,
        "--config",
        path,
        "--flights",
        1,
        "--hours",
        0.005,
        "--workers",
        1,
    ]
    flown = run(capsys, [*options, "--report", report, "--json"]).json["flown"]
    assert [(study["kind"], study["flights"]) for study in flown] == [
        ("icing", 1), ("damage", 1), ("sensor", 1), ("healthy", 1),
    ]  # fmt: skip
    text = report.read_text(encoding="utf-8")
    assert "Study: damage, healthy, icing, sensor" in text
    (out / "sensor.parquet").unlink()
    again = run(capsys, [*options, "--resume", "--json"]).json["flown"]
    assert [study["kind"] for study in again] == ["sensor"]
    shown = run(capsys, [*options, "--resume"])
    assert (shown.code, "Of 1 flights with sensor faults" in shown.out) == (0, True)
    other = run(capsys, [*options, "--resume", "--seed", 5])
    assert (other.code, "is a finished study of another grid, seed" in other.err) == (2, True)


def test_ctrl_c_leaves_what_can_be_resumed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, grid: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study_command, "LocalWorkers", _Interrupted)
    out = tmp_path / "icing.parquet"
    result = run(capsys, ["study", "icing", "--config", grid, "--out", out, "--flights", 2])
    assert result.code == 130
    assert "0 of 2 flights are kept" in result.err
    assert (tmp_path / "icing.parquet.parts" / "study.json").exists()
