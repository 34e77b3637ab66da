"""Seen from outside: a service that falls behind, lost a thread or has a frozen database is not ready; its log."""

import io
import json
import logging
import re
import resource
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import httpx
import pytest
from cli_services import service_in

from wingwatch.baselines import Database, DatabaseError, EstimateRecord
from wingwatch.cli.serve_command import allow_open_files
from wingwatch.monitor import FleetMonitor
from wingwatch.service.database_probe import DatabaseProbe
from wingwatch.service.logs import JsonLines, TextLines, configure_logs
from wingwatch.service.service import Service
from wingwatch.service.store import DatabaseStore
from wingwatch.telemetry import ZenohSettings, open_session, vehicle_key

PATIENCE_S = 60.0
ESTIMATE = EstimateRecord(
    "default", "uav1", 1.0, "short_period", "ekf", (1.0,) * 6, (0.1,) * 6, "converged", (25.0, 0.0, 1.2, 0.0)
)


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def problem(service: Service, part: str) -> str:
    """What readiness says of a part; empty where it works."""
    answer = httpx.get(f"{service.url}/health/ready", timeout=10.0)
    assert answer.status_code == 503  # the estimators wait in any case
    return answer.json()["checks"][part] or ""


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with service_in(tmp_path) as running:
        yield running


def test_messages_that_wait_too_long_are_told(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    assert problem(service, "messages") == ""
    with open_session(ZenohSettings.for_vehicle(service.endpoints)) as session:
        session.put(vehicle_key("default", "uav1", "sensors"), b"{}")
        until(lambda: service.counters()["messages"]["received"] == 1)
    assert problem(service, "messages") == ""  # not yet
    monkeypatch.setattr("wingwatch.service.watch_health._MOST_QUEUED_S", 0.3)
    until(lambda: "messages wait for" in problem(service, "messages"))


@pytest.mark.parametrize(("vehicles", "said"), [(1, "1 vehicle is"), (12, "12 vehicles are")])
def test_vehicles_that_are_left_out_are_told(
    service: Service, monkeypatch: pytest.MonkeyPatch, vehicles: int, said: str
) -> None:
    assert problem(service, "capacity") == ""
    monkeypatch.setattr(FleetMonitor, "left_out", vehicles)
    assert problem(service, "capacity").startswith(f"degraded service: {said} not watched")
    status = httpx.get(f"{service.url}/v1/status").json()
    assert status["problems"]["capacity"] == problem(service, "capacity")


def test_a_thread_that_ended_is_told(service: Service) -> None:
    for part in ("zenoh", "database", "diagnoses"):
        assert problem(service, part) == ""
    parts = service._parts.watch
    parts.outputs._ending = True
    parts.outputs._news.set()
    until(lambda: problem(service, "zenoh") == "the loop that publishes has ended.")
    parts.store._end.set()
    parts.store._writer.news.set()
    until(lambda: problem(service, "database").startswith("the loop that writes the database has"))
    with parts.diagnoses._changed:
        parts.diagnoses._ending = True
        parts.diagnoses._changed.notify_all()
    until(lambda: problem(service, "diagnoses") == "the loop that runs diagnoses has ended.")


def test_every_part_shows_its_counters(service: Service) -> None:
    counters = httpx.get(f"{service.url}/v1/status").json()["counters"]
    assert set(counters) == {
        "messages", "intake", "monitor", "loop", "store", "checkpoints", "outputs", "links", "connections", "access",
        "events", "alert_diagnoses", "recording", "notifications",
    }  # fmt: skip


def test_a_write_that_hangs_is_told_after_a_minute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = threading.Event()

    def frozen(_database: Database, *_entries: object) -> None:
        answer.wait(PATIENCE_S)

    monkeypatch.setattr(Database, "append_estimates", frozen)
    with service_in(tmp_path) as service:
        store = service._parts.watch.store
        assert store.behind_s == 0.0
        store.append_estimates([ESTIMATE])
        assert problem(service, "database") == ""
        monkeypatch.setattr("wingwatch.service.watch_health._MOST_BEHIND_S", 0.5)
        until(lambda: "to be written" in problem(service, "database"))
        answer.set()
        until(lambda: store.behind_s == 0.0)
        assert problem(service, "database") == ""


def test_entries_that_are_refused_for_now_count_as_waiting() -> None:
    down = [True]

    def append(_rows: object, _leases: object) -> None:
        if down[0]:
            raise DatabaseError("locked")

    database = cast(Database, SimpleNamespace(append_estimates=append))
    with DatabaseStore(database, time.time) as store:
        store.append_estimates([ESTIMATE])
        until(lambda: store.problem == "locked")
        assert store.behind_s > 0.0
        down[0] = False
        until(lambda: store.behind_s == 0.0)


def test_a_frozen_database_holds_up_one_thread_and_nobody_who_asks() -> None:
    answer = threading.Event()
    probe = DatabaseProbe(lambda: cast(None, answer.wait(PATIENCE_S)), patience_s=0.1)
    before = {thread.name for thread in threading.enumerate()}
    for _ in range(5):
        began = time.monotonic()
        assert "has not answered for" in (probe.problem() or "")
        assert time.monotonic() - began < 1.0
    asking = [t for t in threading.enumerate() if t.name == "wingwatch-probe" and t.is_alive()]
    assert len(asking) == 1
    assert "wingwatch-probe" not in before
    answer.set()
    until(lambda: probe.problem() is None)


@pytest.mark.parametrize(
    ("error", "words"), [(DatabaseError("it is full"), "it is full."), (OSError("gone"), "OSError: gone.")]
)
def test_a_database_that_fails_is_told_and_one_that_works_again_too(error: Exception, words: str) -> None:
    faults = [error]

    def check() -> None:
        if faults:
            raise faults.pop()

    probe = DatabaseProbe(check)
    assert (probe.problem() or "").endswith(words)
    assert probe.problem() is None


def test_a_service_may_have_as_many_files_as_the_system_permits() -> None:
    """Links and connections above the usual 1024 would otherwise leave the database none."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(soft, 512), hard))
        allow_open_files()
        assert resource.getrlimit(resource.RLIMIT_NOFILE) == (min(hard, 65_536), hard)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def logged(formatter: logging.Formatter, text: str, error: bool = False, **extra: Any) -> str:
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)
    handler.setFormatter(formatter)
    logger = logging.Logger("wingwatch.test")
    logger.addHandler(handler)
    try:
        raise ValueError("two\nlines")
    except ValueError:
        logger.warning(text, exc_info=error, extra=extra)
    return stream.getvalue()


TIME = r"20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z"


def test_a_line_of_text_has_time_level_and_vehicle() -> None:
    assert re_matches(
        rf"{TIME} WARNING \[north/uav1\] Ice\.\n", logged(TextLines(), "Ice.", vehicle="north/uav1")
    )
    assert re_matches(rf"{TIME} WARNING Ice\.\n", logged(TextLines(), "Ice."))
    forged = logged(TextLines(), "name a\n2026-01-01T00:00:00.000Z ERROR all is lost\x1b[2J")
    assert forged.count("\n") == 1
    assert "\x1b" not in forged
    assert "ValueError: two" in logged(TextLines(), "x", error=True)


def test_a_line_of_json_has_them_too() -> None:
    line = json.loads(logged(JsonLines(), "Ice\n.", vehicle="north/uav1"))
    assert re_matches(TIME, line.pop("time"))
    assert line == {
        "level": "WARNING", "logger": "wingwatch.test", "message": "Ice\\n.", "vehicle": "north/uav1",
    }  # fmt: skip
    text = logged(JsonLines(), "x", error=True)
    assert text.count("\n") == 1
    assert json.loads(text)["exception"].endswith("ValueError: two\nlines")


def re_matches(pattern: str, text: str) -> bool:
    return re.fullmatch(pattern, text) is not None


@pytest.fixture
def levels() -> Iterator[None]:
    """Puts the levels of the process's log back as they were."""
    loggers = [logging.getLogger(), logging.getLogger("wingwatch")]
    before = [logger.level for logger in loggers]
    yield
    for logger, level in zip(loggers, before, strict=True):
        logger.setLevel(level)


@pytest.mark.usefixtures("levels")
def test_of_our_own_information_is_logged_of_others_warnings(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.getLogger(), "handlers", [])
    configure_logs("json")
    logging.getLogger("wingwatch.cli").info("ours")
    logging.getLogger("uvicorn").info("theirs")
    logging.getLogger("uvicorn").warning("their warning")
    said = [json.loads(line)["message"] for line in capsys.readouterr().err.splitlines()]
    assert said == ["ours", "their warning"]


def test_a_loop_that_fails_is_started_again_and_goes_on(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, fails = service._parts.watch.store, iter([OSError("no more threads")])
    writing = store._writer._write

    def written() -> bool:
        for error in fails:
            raise error
        return writing()

    monkeypatch.setattr(store._writer, "_write", written)
    store.append_estimates([ESTIMATE])
    until(lambda: "failed with OSError: no more threads and was started" in problem(service, "database"))
    until(lambda: service.counters()["loop"]["restarts_store"] == 1)
    until(lambda: store.behind_s == 0.0)
    assert next(fails, None) is None
