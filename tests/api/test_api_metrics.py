"""``/metrics``: what Prometheus reads, every counter of the status among it, and no vehicle's name."""

from collections.abc import Mapping

import httpx
import pytest
from api_fakes import VERSION, FakeMonitor, alert, served, vehicle
from prometheus_client import REGISTRY
from prometheus_client.openmetrics.parser import text_string_to_metric_families as parse_openmetrics
from prometheus_client.parser import text_string_to_metric_families

from wingwatch.api import (
    AccessSettings,
    Caller,
    DelayView,
    QueueView,
    ServiceFigures,
    TokenScope,
)
from wingwatch.monitor.views import AlertState, VehicleState

Labels = frozenset[tuple[str, str]]
FIGURES = ServiceFigures(
    settings="0123456789ab",
    delay=DelayView((0.01, 0.1), (5, 3, 2), 1.5),
    queues={"messages": QueueView(7, 0.25), "checkpoints": QueueView(2)},
    links={"client": 3, "peer": 0, "router": 1},
    processor_s={"estimate": 12.5},
    connections=4,
)


def samples(text: str) -> Mapping[tuple[str, Labels], float]:
    """Every sample by its name and labels."""
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def value(text: str, metric: str, **labels: str) -> float:
    return samples(text)[metric, frozenset(labels.items())]


def scraped(client: httpx.Client) -> str:
    answer = client.get("/metrics")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
    return answer.text


def flying() -> FakeMonitor:
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1"), vehicle("aero-2", VehicleState.DEGRADED), vehicle("aero-3")]
    monitor.raised = [alert(1), alert(2, level="critical"), alert(3, state=AlertState.CLEARED)]
    monitor.counts = {
        "accepted": 90, "duplicate": 4, "too_slow": 5, "gap": 1, "message_malformed": 2, "messages_late": 3,
        "publisher_restarts": 6, "unused_mass": 7, "faults": 8,
    }  # fmt: skip
    monitor.solutions = 11
    return monitor


def test_the_fleet_is_shown_by_state_and_reason() -> None:
    with served(flying()) as (_, client):
        text = scraped(client)
    assert value(text, "wingwatch_vehicles", state="healthy") == 2
    assert value(text, "wingwatch_vehicles", state="degraded") == 1
    assert value(text, "wingwatch_vehicles", state="stale") == 0
    assert value(text, "wingwatch_alerts", state="active", level="warning") == 1
    assert value(text, "wingwatch_alerts", state="active", level="critical") == 1
    assert value(text, "wingwatch_alerts", state="cleared", level="warning") == 1
    assert value(text, "wingwatch_samples_accepted_total") == 90
    assert value(text, "wingwatch_samples_unused_total", reason="duplicate") == 4
    assert value(text, "wingwatch_samples_unused_total", reason="too_slow") == 5
    assert value(text, "wingwatch_samples_unused_total", reason="non_finite") == 0
    assert value(text, "wingwatch_sample_events_total", kind="gap") == 1
    assert value(text, "wingwatch_messages_rejected_total", reason="malformed") == 2
    assert value(text, "wingwatch_messages_out_of_sequence_total", kind="late") == 3
    assert value(text, "wingwatch_publisher_restarts_total") == 6
    assert value(text, "wingwatch_loadings_unused_total", kind="mass") == 7
    assert value(text, "wingwatch_solutions_total") == 11


def test_the_service_s_own_figures_are_shown() -> None:
    checks = {"zenoh": None, "database": "it is locked."}
    with served(FakeMonitor(), figures=FIGURES, checks=checks) as (_, client):
        text = scraped(client)
    build = next(labels for name, labels in samples(text) if name == "wingwatch_build_info")
    assert {("version", VERSION), ("settings", "0123456789ab")} < build
    delays = [value(text, "wingwatch_message_delay_seconds_bucket", le=le) for le in ("0.01", "0.1", "+Inf")]
    assert delays == [5, 8, 10]
    assert value(text, "wingwatch_message_delay_seconds_count") == 10
    assert value(text, "wingwatch_message_delay_seconds_sum") == 1.5
    assert value(text, "wingwatch_queue_length", queue="messages") == 7
    assert value(text, "wingwatch_queue_age_seconds", queue="messages") == 0.25
    assert ("wingwatch_queue_age_seconds", frozenset({("queue", "checkpoints")})) not in samples(text)
    assert value(text, "wingwatch_zenoh_links", kind="client") == 3
    assert value(text, "wingwatch_processor_seconds_total", stage="estimate") == 12.5
    assert value(text, "wingwatch_http_connections") == 4
    assert value(text, "wingwatch_part_failing", part="database") == 1
    assert value(text, "wingwatch_part_failing", part="zenoh") == 0
    assert value(text, "process_open_fds") > 0
    assert value(text, "process_cpu_seconds_total") > 0


def test_every_counter_of_the_status_is_among_them_whatever_its_part() -> None:
    counters = {
        "messages": {"received": 101, "overflow": 102},
        "monitor": {"faults": 103},
        "store": {"retries": 104},
        "brakes": {"squeals": 105},
    }
    with served(FakeMonitor(), counters=counters) as (_, client):
        text = scraped(client)
        status = client.get("/v1/status").json()["counters"]
    shown = samples(text)
    assert set(status) == {*counters, "access", "events"}
    for part in counters:
        for count, times in status[part].items():
            named = [
                labels for (name, labels), number in shown.items() if number == times and "_total" in name
            ]
            assert len(named) == 1, f"{part} {count}"
            assert count == "received" or count in dict(named[0]).values()
    assert value(text, "wingwatch_brakes_total", kind="squeals") == 105
    assert value(text, "wingwatch_messages_received_total") == 101
    assert value(text, "wingwatch_messages_dropped_total", reason="overflow") == 102
    assert value(text, "wingwatch_monitor_problems_total", kind="too_many_vehicles") == 0
    assert value(text, "wingwatch_http_requests_refused_total", reason="no_token") == 0
    assert value(text, "wingwatch_event_streams_closed_total", reason="gave_way") == 0


def test_answers_are_counted_by_method_and_status() -> None:
    with served(flying()) as (_, client):
        for path in ("/v1/status", "/v1/status", "/v1/vehicles/nobody"):
            client.get(path)
        client.get("/v1/status", headers={"Host": "evil.example"})
        client.request("BREW", "/v1/status")
        client.request("KETTLE", "/v1/status")
        text = scraped(client)
    requests = {
        labels: n for (name, labels), n in samples(text).items() if name == "wingwatch_http_requests_total"
    }
    assert {tuple(sorted(dict(labels).values())): n for labels, n in requests.items() if n} == {
        ("200", "GET"): 2, ("404", "GET"): 1, ("421", "GET"): 1, ("405", "other"): 2,
    }  # fmt: skip
    assert value(text, "wingwatch_http_requests_total", method="POST", status="500") == 0
    assert value(text, "wingwatch_http_requests_refused_total", reason="foreign_host") == 1


def test_no_vehicle_is_named_and_a_large_fleet_has_as_many_series() -> None:
    small, large = flying(), flying()
    large.views = [vehicle(f"secret-{k}", fleet=f"f{k}") for k in range(1000)]
    texts = []
    for monitor in (small, large):
        with served(monitor, figures=FIGURES) as (_, client):
            texts.append(scraped(client))
    assert samples(texts[0]).keys() == samples(texts[1]).keys()
    assert "secret" not in texts[1]
    assert len(samples(texts[1])) < 200


def test_names_follow_the_conventions() -> None:
    with served(flying(), figures=FIGURES) as (_, client):
        families = list(text_string_to_metric_families(scraped(client)))
    assert len(families) > 25
    for family in families:
        assert family.documentation
        assert family.name.startswith(("wingwatch_", "process_"))
        assert not family.name.endswith(("_ms", "_s", "_count"))
        if family.type == "counter" and family.name.startswith("wingwatch_"):
            assert all(sample.name.endswith("_total") for sample in family.samples)


@pytest.mark.parametrize(
    "accept", ["application/openmetrics-text; version=1.0.0", "text/html, application/openmetrics-text;q=0.5"]
)
def test_openmetrics_is_given_where_it_is_asked_for(accept: str) -> None:
    with served(flying(), figures=FIGURES) as (_, client):
        answer = client.get("/metrics", headers={"Accept": accept})
    assert answer.headers["content-type"].startswith("application/openmetrics-text; version=1.0.0")
    parsed = parse_openmetrics(answer.text)  # type: ignore[no-untyped-call]
    found = {family.name: family for family in parsed}
    assert found["wingwatch_samples_accepted"].samples[0].value == 90


@pytest.mark.parametrize(
    "accept", ["", "*/*", "text/plain; version=abc", "text/plain;version=;;", "application/json"]
)
def test_any_other_accept_is_given_the_text_format(accept: str) -> None:
    with served(flying()) as (_, client):
        answer = client.get("/metrics", headers={"Accept": accept})
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")


def test_where_tokens_are_required_it_takes_one_that_may_read() -> None:
    access = AccessSettings(find={"look": Caller("prometheus", TokenScope.READ)}.get, required=True)
    with served(flying(), access=access) as (_, client):
        refused = client.get("/metrics")
        assert refused.status_code == 401
        assert "wingwatch_" not in refused.text
        assert client.get("/metrics", headers={"Authorization": "Bearer other"}).status_code == 401
        answer = client.get("/metrics", headers={"Authorization": "Bearer look"})
        assert answer.status_code == 200
        assert value(answer.text, "wingwatch_http_requests_refused_total", reason="no_token") == 1


def test_applications_share_no_registry() -> None:
    before = {family.name for family in REGISTRY.collect()}
    with served(flying()) as (_, one), served(FakeMonitor()) as (_, other):
        assert value(scraped(one), "wingwatch_solutions_total") == 11
        assert value(scraped(other), "wingwatch_solutions_total") == 0
    assert {family.name for family in REGISTRY.collect()} == before
    assert not any(name.startswith("wingwatch") for name in before)
