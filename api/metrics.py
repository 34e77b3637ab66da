"""The service in numbers for Prometheus: ``/metrics``, made anew at each question from what is counted anyway.

Every counter of ``/v1/status`` is among them. Labels take a few fixed values, and names of workers: no vehicle, token
or address is named, so the number of series does not grow with the fleet.
"""

import platform
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from itertools import accumulate
from typing import Annotated, Any

from fastapi import APIRouter, Header, Response
from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    InfoMetricFamily,
    Metric,
)
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.openmetrics import exposition as openmetrics
from prometheus_client.registry import Collector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wingwatch.api.door import Door
from wingwatch.api.ports import ServiceFigures, WorkerView
from wingwatch.monitor.views import AlertState, FleetFigures, VehicleState

__all__ = ["RequestCounts", "ServiceMetrics", "metrics_router"]

_METHODS = ("GET", "HEAD", "OPTIONS", "POST", "PUT", "DELETE")
_ALWAYS = {(method, status): 0 for method in ("GET", "POST") for status in ("200", "500", "503")}
"""Answers that are shown before there are any: a series that appears with 1 shows no increase."""
_OPENMETRICS = "application/openmetrics-text"
_OPENMETRICS_LATEST = f"{_OPENMETRICS}; version=1.0.0; charset=utf-8"
_LEVELS = ("watch", "warning", "critical")

_COUNTERS: Mapping[str, tuple[str, str, str]] = {
    "messages": ("messages_dropped", "reason", "Messages that were dropped before they were looked at."),
    "intake": ("messages_handled", "result", "Messages that the monitor got, by what became of them."),
    "monitor": ("monitor_problems", "kind", "What went wrong with the watch, or was forgotten."),
    "loop": ("loop_problems", "kind", "Faults of the program outside a vehicle's samples."),
    "store": (
        "store_problems",
        "kind",
        "Reads and writes of the database that failed, and what was dropped.",
    ),
    "checkpoints": ("checkpoints", "result", "Saved states of vehicles, by what became of them."),
    "alert_diagnoses": ("alert_diagnoses", "result", "Alerts by what became of their diagnosis."),
    "recording": ("recording", "result", "What was recorded, and what was not."),
    "notifications": ("notifications", "result", "Notices to people, by what became of them."),
    "outputs": ("outputs_dropped", "kind", "What was not published over Zenoh."),
    "links": ("zenoh_refused", "kind", "What Zenoh's access rules refused, where the service keeps them."),
    "access": ("http_requests_refused", "reason", "Requests that were refused before they reached a route."),
    "connections": ("http_connections_closed", "reason", "HTTP connections that the service closed."),
    "events": ("event_streams_closed", "reason", "Event streams that the service ended."),
    "workers": (
        "worker_link",
        "kind",
        "Workers that were started again, and answers of workers that did not come.",
    ),
}
"""Of each part in ``counters`` of ``/v1/status`` the metric, the label for its counters, and what it says."""

_OF_VEHICLES: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "messages_rejected": (
        "reason",
        "Messages that hold no samples that can be used.",
        ("malformed", "wrong_type", "bad_value", "missing_time", "unequal_lengths", "too_large", "too_many_samples",
         "unknown_column", "unknown_field", "unsupported_encoding", "left_out"),
    ),
    "messages_out_of_sequence": (
        "kind",
        "Numbers of messages that did not come in time, and messages dropped for their number.",
        ("lost", "late", "repeated", "stray", "second_publisher"),
    ),
    "samples_unused": (
        "reason",
        "Samples that were not estimated from.",
        ("non_finite", "out_of_range", "duplicate", "out_of_order", "clock_jump", "too_slow", "stalled", "unaligned",
         "unannounced", "unknown_aircraft", "dropped_waiting"),
    ),
    "sample_events": ("kind", "Gaps in the samples, and clocks that were set.", ("gap", "clock_change")),
    "loadings_unused": ("kind", "Announced loadings that were not used.", ("mass", "cg_shift")),
}  # fmt: skip
"""Of each metric about vehicles' messages and samples the label, what it says, and the values that are always there."""

_SEEDED: Mapping[str, tuple[str, ...]] = {
    "links": ("refused_writes", "unknown_subjects", "foreign_alerts"),
    "intake": (
        "sensors", "aircraft", "messages_late", "messages_repeated", "messages_stray",
        "messages_second_publisher", "unannounced",
        "unknown_aircraft", "too_many_vehicles", "faults",
        *(f"message_{reason}" for reason in _OF_VEHICLES["messages_rejected"][2]),
    ),
    "monitor": (
        "faults", "store", "checkpoint", "vehicles_forgotten", "too_many_vehicles", "events_forgotten",
        "alerts_forgotten",
    ),
}  # fmt: skip
"""Counters that their part leaves out while they are 0; a series that appears with 1 shows no increase."""


def metrics_router(door: Door, requests: Mapping[tuple[str, str], int]) -> APIRouter:
    """The route ``/metrics``.

    Args:
        requests: how many were answered, by method and status.
    """
    router = APIRouter(tags=["health"])
    registry = CollectorRegistry(auto_describe=False)
    registry.register(ServiceMetrics(door, requests))
    ProcessCollector(registry=registry)
    described: dict[int | str, dict[str, Any]] = {
        200: {
            "description": "The text format of Prometheus, or OpenMetrics where it is asked for.",
            "content": {
                "text/plain": {"schema": {"type": "string"}},
                _OPENMETRICS: {"schema": {"type": "string"}},
            },
        }
    }

    @router.get("/metrics", response_class=Response, responses=described, summary="Figures for Prometheus")
    def metrics(accept: Annotated[str | None, Header(max_length=1000)] = None) -> Response:
        if _OPENMETRICS in (accept or ""):
            content: bytes = openmetrics.generate_latest(registry)  # type: ignore[no-untyped-call]
            media_type = _OPENMETRICS_LATEST
        else:
            content, media_type = generate_latest(registry), CONTENT_TYPE_PLAIN_0_0_4
        return Response(content, headers={"Cache-Control": "no-store", "Content-Type": media_type})

    return router


class RequestCounts:
    """ASGI wrapper: counts answers by method and status.

    Args:
        counts: counted into, by (method, status); a method that is offered nowhere counts as ``other``.
    """

    def __init__(self, app: ASGIApp, counts: MutableMapping[tuple[str, str], int]) -> None:
        self._app = app
        self._counts = counts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer through the wrapped application."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        method = scope["method"] if scope["method"] in _METHODS else "other"

        async def send_counted(message: Message) -> None:
            if message["type"] == "http.response.start":
                key = method, str(message["status"])
                self._counts[key] = self._counts.get(key, 0) + 1
            await send(message)

        await self._app(scope, receive, send_counted)


class ServiceMetrics(Collector):
    """What ``/metrics`` says beside the process's own figures."""

    def __init__(self, door: Door, requests: Mapping[tuple[str, str], int]) -> None:
        self._door = door
        self._requests = requests

    def collect(self) -> Iterator[Metric]:
        """All metrics, as they are now."""
        door, figures = self._door, self._door.figures()
        build = {"version": door.version, "settings": figures.settings, "python": platform.python_version()}
        yield InfoMetricFamily("wingwatch_build", "What runs.", build)
        yield from _of_fleet(door.monitor.figures())
        yield from _of_counters(door.counters())
        yield from _of_service(figures)
        yield _gauges("part_failing", "part", "1 where a part of the service does not work.", {
            part: float(problem is not None) for part, problem in door.problems().items()
        })  # fmt: skip
        yield from _of_workers(door.workers())
        yield _gauge("event_streams", "Event streams that are open.", door.streams.open)
        requests = CounterMetricFamily(
            "wingwatch_http_requests", "Requests that were answered.", labels=("method", "status")
        )
        for key, times in sorted((_ALWAYS | dict(self._requests)).items()):
            requests.add_metric(key, times)
        yield requests


def _of_workers(workers: Sequence[WorkerView]) -> Iterator[Metric]:
    """By worker: there are as many as were started, and no vehicle is named."""
    gauges: tuple[tuple[str, str, Callable[[WorkerView], float]], ...] = (
        ("worker_load", "Part of the last ten seconds in which a worker took messages in.", lambda w: w.load),
        ("worker_capacity", "What a worker takes beside others.", lambda w: w.capacity),
        ("worker_vehicles", "Vehicles that a worker watches.", lambda w: w.vehicles),
        ("worker_vehicles_left_out", "Of these, those that it leaves out.", lambda w: w.left_out),
        ("worker_behind_seconds", "How long a worker's oldest message has waited.", lambda w: w.behind_s),
        ("worker_silent_seconds", "For how long a worker has not answered.", lambda w: w.silent_s),
    )
    for name, text, value in gauges:
        yield _gauges(name, "worker", text, {worker.name: value(worker) for worker in workers})
    moves = CounterMetricFamily(
        "wingwatch_worker_moves", "Vehicles that a worker took over and gave up.", labels=("worker", "kind")
    )
    for worker in workers:
        for kind, times in worker.moves.items():
            moves.add_metric((worker.name, kind), times)
    yield moves


def _of_fleet(fleet: FleetFigures) -> Iterator[Metric]:
    vehicles = {str(state): fleet.vehicles.get(state, 0) for state in VehicleState}
    yield _gauges("vehicles", "state", "Vehicles that are remembered, by state.", vehicles)
    alerts = GaugeMetricFamily(
        "wingwatch_alerts", "Alerts that are kept in memory, by state and level.", labels=("state", "level")
    )
    for state in AlertState:
        for level in _LEVELS:
            alerts.add_metric((str(state), level), fleet.alerts.get((state, level), 0))
    yield alerts
    yield _gauge(
        "messages_held", "Messages that wait for what the database keeps of their vehicle.", fleet.waiting
    )
    yield _gauge(
        "vehicles_left_out", "Vehicles that are not watched, for there is more to compute.", fleet.left_out
    )
    yield _counter("solutions", "Half seconds of flight that were estimated and compared.", fleet.solutions)
    accepted = fleet.counts.get("accepted", 0)
    yield _counter("samples_accepted", "Samples that passed the cleaning.", accepted)
    restarts = fleet.counts.get("publisher_restarts", 0)
    yield _counter("publisher_restarts", "Publishers that were started anew.", restarts)
    found: dict[str, dict[str, float]] = {
        name: dict.fromkeys(of[2], 0.0) for name, of in _OF_VEHICLES.items()
    }
    for name, times in fleet.counts.items():
        if name not in ("accepted", "publisher_restarts", "faults"):  # faults are the monitor's, too
            metric, value = _sorted(name)
            found[metric][value] = times
    for metric, (label, text, _) in _OF_VEHICLES.items():
        yield _counters(metric, label, text, found[metric])


def _sorted(count: str) -> tuple[str, str]:
    """The metric that a vehicle's count belongs to, and the label's value."""
    for prefix, metric in (
        ("message_", "messages_rejected"),
        ("messages_", "messages_out_of_sequence"),
        ("unused_", "loadings_unused"),
    ):
        if count.startswith(prefix):
            return metric, count.removeprefix(prefix)
    return ("sample_events" if count in _OF_VEHICLES["sample_events"][2] else "samples_unused"), count


def _of_counters(counters: Mapping[str, Mapping[str, int]]) -> Iterator[Metric]:
    for part, counts in counters.items():
        values = dict.fromkeys(_SEEDED.get(part, ()), 0) | dict(counts)
        if part == "messages" and "received" in values:
            received = values.pop("received")
            yield _counter("messages_received", "Messages that were taken over from Zenoh.", received)
        if part == "intake":
            values.pop("received", None)  # it is the sum of the others
        metric, label, text = _COUNTERS.get(part, (part, "kind", f"Counters of {part}."))
        yield _counters(metric, label, text, values)


def _of_service(figures: ServiceFigures) -> Iterator[Metric]:
    delay = figures.delay
    limits = [*(f"{limit:g}" for limit in delay.limits_s), "+Inf"]
    buckets = list(zip(limits, accumulate(delay.counts), strict=True))
    yield HistogramMetricFamily(
        "wingwatch_message_delay_seconds",
        "From a message's arrival until its samples have been estimated from.",
        buckets=buckets,
        sum_value=delay.total_s,
    )
    lengths = {name: queue.length for name, queue in figures.queues.items()}
    yield _gauges("queue_length", "queue", "What waits, by queue.", lengths)
    ages = {name: queue.age_s for name, queue in figures.queues.items() if queue.age_s is not None}
    yield _gauges("queue_age_seconds", "queue", "For how long the oldest entry of a queue has waited.", ages)
    yield _gauges("zenoh_links", "kind", "Links of Zenoh, by kind of the other side.", figures.links)
    stages = "Processor time of the service's threads, by what they do."
    yield _counters("processor_seconds", "stage", stages, figures.processor_s)
    yield _gauge("http_connections", "HTTP connections that are open.", figures.connections)


def _counter(name: str, text: str, value: float) -> Metric:
    return CounterMetricFamily(f"wingwatch_{name}", text, value)


def _gauge(name: str, text: str, value: float) -> Metric:
    return GaugeMetricFamily(f"wingwatch_{name}", text, value)


def _counters(name: str, label: str, text: str, values: Mapping[str, float]) -> Metric:
    family = CounterMetricFamily(f"wingwatch_{name}", text, labels=(label,))
    for value, number in values.items():
        family.add_metric((value,), number)
    return family


def _gauges(name: str, label: str, text: str, values: Mapping[str, float]) -> Metric:
    family = GaugeMetricFamily(f"wingwatch_{name}", text, labels=(label,))
    for value, number in values.items():
        family.add_metric((value,), number)
    return family
