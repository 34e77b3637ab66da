"""The service seen from outside: its metrics are those that the documents list, and readiness sees every thread."""

import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import httpx
import pytest
import zenoh
from cli_services import service_in
from prometheus_client.parser import text_string_to_metric_families

from wingwatch.monitor import AlertView
from wingwatch.service.checkpoints import CheckpointFolder
from wingwatch.service.delays import DelayHistogram
from wingwatch.service.outputs import ZenohOutputs
from wingwatch.service.processor_time import STAGES, ProcessorTimes
from wingwatch.service.service import Service
from wingwatch.telemetry import ZenohSettings, open_session, vehicle_key

PATIENCE_S = 60.0
DOCUMENT = Path(__file__).parents[2] / "docs" / "service.md"


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def metrics(service: Service) -> Mapping[str, Mapping[tuple[str, ...], float]]:
    """Values by metric, then by the labels' values; buckets of histograms left out."""
    answer = httpx.get(f"{service.url}/metrics", timeout=10.0).raise_for_status()
    found: dict[str, dict[tuple[str, ...], float]] = {}
    for family in text_string_to_metric_families(answer.text):
        for sample in family.samples:
            if not sample.name.endswith("_bucket"):
                found.setdefault(sample.name, {})[tuple(sample.labels.values())] = sample.value
    return found


def listed() -> set[str]:
    """Metrics in the table of the documents."""
    rows = re.findall(r"^\| (`(?:wingwatch|process)_[^|]+) \|", DOCUMENT.read_text(), re.MULTILINE)
    return {name for row in rows for name in re.findall(r"`(\w+)(?:\{[^`]*\})?`", row)}


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with service_in(tmp_path) as running:
        yield running


def test_the_documents_list_every_metric_and_no_other(service: Service) -> None:
    shown = {re.sub(r"_(sum|count)$", "", name) for name in metrics(service)}
    assert shown == listed()


def test_every_counter_of_the_status_is_a_metric(service: Service) -> None:
    status = httpx.get(f"{service.url}/v1/status").json()["counters"]
    values = {labels for by_labels in metrics(service).values() for labels in by_labels}
    for part, counts in status.items():
        for count in counts:
            assert (count,) in values or count == "received", f"{part} {count}"


def test_messages_and_links_are_counted(service: Service) -> None:
    assert metrics(service)["wingwatch_zenoh_links"] == {("client",): 0, ("peer",): 0, ("router",): 0}
    with open_session(ZenohSettings.for_vehicle(service.endpoints)) as session:
        session.put(vehicle_key("default", "uav1", "sensors"), b"{}")
        until(lambda: metrics(service)["wingwatch_messages_received_total"][()] == 1)
        shown = metrics(service)
        assert shown["wingwatch_zenoh_links"]["client",] == 1
    assert shown["wingwatch_queue_length"]["messages",] == 1  # its kernels wait for ever
    assert shown["wingwatch_queue_age_seconds"]["messages",] > 0.0
    assert shown["wingwatch_message_delay_seconds_count"][()] == 0
    assert shown["wingwatch_part_failing"]["estimators",] == 1
    assert shown["wingwatch_part_failing"]["database",] == 0
    assert shown["wingwatch_http_requests_total"]["GET", "200"] >= 2
    assert shown["wingwatch_http_connections"][()] >= 1
    assert shown["wingwatch_processor_seconds_total"]["http",] > 0.0
    assert set(shown["wingwatch_processor_seconds_total"]) == {(stage,) for stage in STAGES.values()}


def problem(service: Service, part: str) -> str:
    """What readiness says of a part, empty where it works; the same is on the status, and in the metrics."""
    answer = httpx.get(f"{service.url}/health/ready", timeout=10.0)
    assert answer.status_code == 503  # the estimators wait in any case
    said = answer.json()["checks"][part] or ""
    assert (f"{part}: {said}" in answer.json()["detail"]) is bool(said)
    return said


def test_threads_that_ended_are_named_on_ready_status_and_metrics(service: Service) -> None:
    parts = service._parts.watch
    assert problem(service, "messages") == problem(service, "checkpoints") == ""
    parts.subscriber._ending.set()
    until(lambda: problem(service, "messages") == "the loop that takes messages over from Zenoh has ended.")
    parts.checkpoints._end = True
    parts.checkpoints._news.set()
    until(lambda: problem(service, "checkpoints") == "the loop that saves vehicles' states has ended.")
    said = httpx.get(f"{service.url}/v1/status").json()["problems"]
    assert {"messages", "checkpoints", "estimators"} <= set(said)
    assert "database" not in said
    failing = metrics(service)["wingwatch_part_failing"]
    assert (failing["messages",], failing["checkpoints",], failing["database",]) == (1, 1, 0)


def test_messages_in_hand_for_too_long_are_named_until_they_are_done(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    ingest = service.ingest
    monkeypatch.setattr(ingest, "_since_s", time.monotonic() - 4.0)
    assert problem(service, "messages") == ""
    monkeypatch.setattr(ingest, "_since_s", time.monotonic() - 6.0)
    assert problem(service, "messages").startswith("messages wait for 6 s before")
    monkeypatch.setattr(ingest, "_since_s", None)
    assert problem(service, "messages") == ""


def test_a_database_that_fails_is_on_the_status_and_heals(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = service._parts.watch.store
    monkeypatch.setattr(store._writer, "problem", "the database is full")
    said = httpx.get(f"{service.url}/v1/status").json()
    assert said["problems"]["database"] == said["database"] == "the database is full."
    assert problem(service, "database") == "the database is full."
    monkeypatch.setattr(store._writer, "problem", None)
    assert "database" not in httpx.get(f"{service.url}/v1/status").json()["problems"]
    assert problem(service, "database") == ""


def test_alerts_that_wait_to_be_published_have_an_age() -> None:
    alert = cast(AlertView, SimpleNamespace())
    linked = [False]
    matching = SimpleNamespace(matching_status=SimpleNamespace(matching=False))
    session = SimpleNamespace(declare_publisher=lambda _key: matching, put=lambda *_a, **_k: None)
    with ZenohOutputs(cast(zenoh.Session, session), lambda: linked[0]) as outputs:
        assert (outputs.alerts_wait_s, outputs.waiting["alerts"]) == (0.0, 0)
        outputs.announce("default", "uav1", "alerts", lambda: alert)
        until(lambda: outputs.alerts_wait_s > 0.2)
        assert outputs.waiting["alerts"] == 1
        linked[0] = True
        until(lambda: outputs.alerts_wait_s == 0.0)
        assert outputs.waiting["alerts"] == 0


def test_delays_fall_into_their_classes() -> None:
    delays = DelayHistogram((0.01, 0.1))
    for delay_s in (0.01, 0.011, 0.1, 5.0, -1.0):
        delays.add(delay_s)
    view = delays.view()
    assert view.counts == (2, 2, 1)
    assert view.total_s == pytest.approx(5.121)
    assert DelayHistogram().view().counts == (0,) * 13


def test_processor_time_goes_to_the_thread_s_stage_and_stays_when_it_ends() -> None:
    times, end = ProcessorTimes(), threading.Event()

    def work() -> None:
        while not end.is_set():
            sum(range(1000))

    thread = threading.Thread(target=work, name="wingwatch-recall")
    before = times.by_stage()["recall"]
    thread.start()
    until(lambda: times.by_stage()["recall"] > before + 0.05)
    last = times.by_stage()["recall"]
    end.set()
    thread.join()
    assert times.by_stage()["recall"] == times.by_stage()["recall"] >= last
    assert set(times.by_stage()) == set(STAGES.values())


def test_a_system_that_does_not_count_it_has_none(tmp_path: Path) -> None:
    thread = threading.Thread(target=time.sleep, args=(0.2,), name="wingwatch-http")
    thread.start()
    assert set(ProcessorTimes(tmp_path).by_stage().values()) == {0.0}
    thread.join()


def test_a_folder_that_is_not_used_yet_waits_for_nothing(tmp_path: Path) -> None:
    folder = CheckpointFolder(tmp_path, time.time)
    assert (folder.waiting, folder.problem, folder.loop.alive) == (0, None, False)


def test_a_service_in_order_says_so(service: Service) -> None:
    problems: dict[str, Any] = {part: said for part, said in service.problems().items() if said is not None}
    assert set(problems) == {"estimators"}
    assert set(service.problems()) == {*service.readiness(), "notifications", "recording"}
    assert service.monitor.figures().solutions == 0
