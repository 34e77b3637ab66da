"""Folders and several files: one line a flight, the worst first, and none stops the others."""

import json
from pathlib import Path
from typing import Any

import pytest
from cli_flights import demo_block, run

from wingwatch.telemetry import SampleBlock, write_flight

CALL = ["--aircraft", "aerosonde"]


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two flights, one of them below, one in milliseconds, and what is no flight."""
    folder = tmp_path_factory.mktemp("logs")
    (folder / "below").mkdir()
    healthy = demo_block("healthy", 12.0)
    write_flight(healthy, folder / "one.csv")
    write_flight(demo_block("healthy", 10.0), folder / "below" / "two.parquet")
    values = healthy.values.copy()
    values[:, 0] *= 1000.0
    write_flight(SampleBlock(values), folder / "milliseconds.csv")
    (folder / "map.toml").write_text("format = 1\n")
    (folder / ".hidden.csv").write_text("no,flight\n")
    return folder


def listed(out: str) -> list[dict[str, Any]]:
    assert out.count("\n") == 1
    value = json.loads(out)
    assert isinstance(value, list)
    return value


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_folder_is_monitored_one_line_a_flight(
    capsys: pytest.CaptureFixture[str], logs: Path, jobs: int
) -> None:
    ran = run(capsys, ["monitor", logs, *CALL, "--jobs", jobs])
    lines = ran.out.splitlines()
    assert len(lines) == 3
    assert lines[0].startswith("not judged")
    assert "milliseconds.csv" in lines[0]
    assert 'unit = "ms"' in lines[0]
    assert {line.split(": ")[0].split("/")[-1] for line in lines[1:]} == {"one.csv", "two.parquet"}
    assert all("s observable)" in line for line in lines[1:])
    assert ran.code == 2
    assert ran.err == "wingwatch: error: 1 of 3 flights could not be judged; their lines say why\n"


def test_the_list_holds_what_each_flight_gives_alone(capsys: pytest.CaptureFixture[str], logs: Path) -> None:
    files = [logs / "one.csv", logs / "below" / "two.parquet"]
    ran = run(capsys, ["monitor", *files, *CALL, "--json", "--jobs", "1"])
    assert ran.code == 0
    assert ran.err == ""
    found = {Path(one.pop("flight")).name: one for one in listed(ran.out)}
    for file in files:
        assert found[file.name] == run(capsys, ["monitor", file, *CALL, "--json"]).json


def test_a_folder_is_estimated_flight_by_flight(capsys: pytest.CaptureFixture[str], logs: Path) -> None:
    ran = run(capsys, ["estimate", logs, *CALL, "--json", "--jobs", "1"])
    assert ran.code == 2
    found = {Path(one["flight"]).name: one for one in listed(ran.out)}
    assert set(found) == {"one.csv", "two.parquet", "milliseconds.csv"}
    assert set(found["milliseconds.csv"]) == {"flight", "error"}
    alone = run(capsys, ["estimate", logs / "one.csv", *CALL, "--json"]).json
    assert found["one.csv"] == {"flight": str(logs / "one.csv"), **alone}
    lines = run(capsys, ["estimate", logs, *CALL, "--jobs", "1"]).out.splitlines()
    assert len(lines) == 3
    assert sum("standard errors" in line and "expected" in line for line in lines) == 2


def test_the_worst_is_first() -> None:
    from wingwatch.cli.monitor_command import _badness

    def flight(status: str, *alerts: tuple[str, float | None]) -> dict[str, Any]:
        return {
            "status": status,
            "alerts": [{"level": level, "cleared_s": cleared} for level, cleared in alerts],
        }

    order = [
        flight("degraded", ("watch", None), ("critical", None)),
        flight("healthy", ("critical", 80.0)),
        flight("degraded", ("warning", None)),
        flight("healthy", ("watch", 12.0)),
        {"error": "no such file"},
        flight("unknown"),
        flight("not_observable"),
        flight("healthy"),
    ]
    mixed = order[::2] + order[1::2]
    assert sorted(mixed, key=_badness, reverse=True) == order


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["monitor", "EMPTY", "--aircraft", "aerosonde"], "no flight in this folder"),
        (["estimate", "EMPTY", "--aircraft", "aerosonde"], "no flight in this folder"),
        (["monitor", "LOGS", "--aircraft", "nothing"], "nothing"),
        (["monitor", "LOGS", "--aircraft", "aerosonde", "--map", "none.toml"], "no such channel map"),
        (["estimate", "LOGS", "--aircraft", "aerosonde", "--history", "h.csv"], "is for one flight"),
        (["monitor", "LOGS", "--aircraft", "aerosonde", "--jobs", "0"], "whole number from 1"),
    ],
)
def test_what_is_wrong_for_all_is_said_once(
    capsys: pytest.CaptureFixture[str], logs: Path, tmp_path: Path, arguments: list[str], said: str
) -> None:
    places = {"LOGS": logs, "EMPTY": tmp_path}
    assert said in run(capsys, [places.get(a, a) for a in arguments]).sentence
