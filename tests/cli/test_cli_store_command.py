"""`wingwatch store`: a copy made while a service writes, a check that finds damage, history thinned at once."""

import json
import sqlite3
import threading
import time
from pathlib import Path

import pytest
from postgres_server import own_schema

from wingwatch.baselines import EstimateRecord, open_database
from wingwatch.cli.main import main

WHERE = "wingwatch.db"


def estimate(time_s: float) -> EstimateRecord:
    return EstimateRecord(
        "default",
        "uav1",
        time_s,
        "short_period",
        "ekf",
        (1.0,) * 6,
        (0.1,) * 6,
        "converged",
        (25.0, 0.0, 1.2, 0.0),
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    where = tmp_path / WHERE
    with open_database(where) as database:
        database.append_estimates([(estimate(float(t)), 1e9 + t) for t in range(100)])
    return where


def said(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict[str, object]]:
    code = main(["store", *arguments, "--json"])
    return code, json.loads(capsys.readouterr().out or "{}")


def test_a_copy_is_whole_though_a_service_writes(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ending = threading.Event()

    def writes() -> None:
        with open_database(path) as database:
            k = 100
            while not ending.is_set():
                database.append_estimates([(estimate(float(k)), 1e9 + k)])
                k += 1

    writer = threading.Thread(target=writes)
    writer.start()
    time.sleep(0.2)
    copy = path.with_name("copy.db")
    code, result = said(capsys, "backup", str(path), "--out", str(copy))
    ending.set()
    writer.join()
    assert (code, result) == (0, {"file": str(copy), "size_bytes": copy.stat().st_size})
    with open_database(copy) as database:
        assert len(database.estimate_history("default", "uav1")) >= 100
    assert sorted(p.name for p in path.parent.iterdir() if "part" in p.name) == []
    assert main(["store", "backup", str(path), "--out", str(copy)]) == 2
    assert "exists already" in capsys.readouterr().err


def test_a_check_says_what_is_kept_and_finds_damage(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, result = said(capsys, "check", str(path))
    assert (code, result["sound"], result["schema"]) == (0, True, result["newest"])
    rows = result["rows"]
    assert isinstance(rows, dict)
    assert (rows["estimate_history"], rows["flight"], rows["alert"]) == (100, 1, 0)
    with sqlite3.connect(path) as connection:
        connection.execute("DELETE FROM flight")
    connection.close()
    code, result = said(capsys, "check", str(path))
    assert (code, result["sound"]) == (2, False)
    assert "flight" in str(result["faults"])


def test_old_history_is_thinned_at_once(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, result = said(capsys, "prune", str(path), "--keep-days", "100000")
    assert (code, result) == (0, {"before": 100, "after": 10})
    code, result = said(capsys, "prune", str(path))
    assert (code, result) == (0, {"before": 10, "after": 0})


def test_what_cannot_be_done_is_said_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["store", "check", str(tmp_path / "none.db")]) == 2
    assert "there is no such file" in capsys.readouterr().err
    (tmp_path / "text.db").write_text("this is no database, and never was one\n" * 100)
    assert main(["store", "check", str(tmp_path / "text.db")]) == 2
    assert "is not an SQLite database" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["store", "prune", "x.db", "--keep-days", "0"])


def test_a_server_is_checked_and_not_copied(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with own_schema() as url:
        with open_database(url) as database:
            database.append_estimates([(estimate(1.0), 1e9)])
        code, result = said(capsys, "check", url)
        assert (code, result["sound"]) == (0, True)
        assert main(["store", "backup", url, "--out", str(tmp_path / "copy.db")]) == 2
        assert "pg_dump" in capsys.readouterr().err
