"""The whole chain: a flight that takes on ice streams through a real Zenoh session, and the alert stands over HTTP."""

from pathlib import Path
from typing import Any

import zenoh
from live import fly, get, service_in, until, until_last

from wingwatch.service.service import Service
from wingwatch.simulation import demo_fleet, simulate
from wingwatch.telemetry import (
    ServiceStream,
    ZenohSettings,
    decode_service_object,
    open_session,
    vehicle_key,
)

SECONDS = 150.0
ICE_FROM_S = 60.0
ALERT_WITHIN_S = 60.0
SEVERITY = 0.15


def test_a_flight_into_ice_raises_the_alert_and_a_healthy_one_none(tmp_path: Path) -> None:
    flights = {s.name: simulate(s, SECONDS) for s in demo_fleet() if s.name in ("healthy", "icing")}
    with service_in(tmp_path) as (service, endpoint):
        heard: list[tuple[str, bytes, str]] = []
        with open_session(ZenohSettings.for_vehicle((endpoint,))) as listener:
            subscriber = listener.declare_subscriber(
                "wingwatch/v1/default/*/alerts",
                lambda s: heard.append((str(s.key_expr), s.payload.to_bytes(), str(s.encoding))),
            )
            for name, block in flights.items():
                fly(endpoint, name, block)
                until_last(service, name, block)
            until(lambda: heard != [] and published(heard) == answered(listener)["alerts"] == stored(service))
            subscriber.undeclare()  # type: ignore[no-untyped-call]
            answers = answered(listener)
        check_alert(answers["alerts"])
        assert get(service, "/v1/vehicles/icing")["state"] == "degraded"
        assert get(service, "/v1/vehicles/healthy")["active_alerts"] == []
        assert {key for key, _, _ in heard} == {vehicle_key("default", "icing", "alerts")}
        assert (answers["status"]["vehicle"], answers["status"]["state"]) == ("icing", "degraded")
        assert answers["derivatives"]["vehicle"] == "icing"
        assert set(answers["derivatives"]["estimators"]) == {"fourier", "ekf"}


def check_alert(alert: dict[str, Any]) -> None:
    """Ice, in time, with size and evidence."""
    assert (alert["vehicle"], alert["kind"], alert["cause"]) == ("icing", "icing", "icing")
    raised_s, size = alert["raised_s"], alert["size"]
    assert isinstance(raised_s, float)
    assert isinstance(size, dict)
    assert ICE_FROM_S < raised_s <= ICE_FROM_S + ALERT_WITHIN_S
    assert 0.0 < size["standard_error"] < size["value"]
    # The ice ramps up while it is measured and the clean derivatives are known to a few percent only.
    assert 0.5 * SEVERITY < size["value"] < 1.5 * SEVERITY
    evidence = alert["evidence"]
    assert isinstance(evidence, list)
    assert {"derivative", "estimate", "standard_error", "expected", "expected_standard_error", "z"} <= set(
        evidence[0]
    )
    assert abs(evidence[0]["z"]) > 3.0


def stored(service: Service) -> dict[str, Any] | None:
    """The only alert as REST gives it."""
    items = get(service, "/v1/alerts")["items"]
    return items[0] if len(items) == 1 else None


def published(heard: list[tuple[str, bytes, str]]) -> dict[str, Any]:
    """The last state of the alert that went out on its key."""
    _, payload, encoding = heard[-1]
    return decode_service_object("alerts", payload, encoding)


def answered(session: zenoh.Session) -> dict[str, Any]:
    """The objects with which the service's keys answer queries."""
    replies = list(session.get("wingwatch/v1/default/icing/*", target=zenoh.QueryTarget.ALL))
    found = {str(r.ok.key_expr).rsplit("/", 1)[1]: r.ok for r in replies if r.ok}
    streams: tuple[ServiceStream, ...] = ("derivatives", "status", "alerts")
    assert set(found) == set(streams)
    return {
        stream: decode_service_object(stream, found[stream].payload.to_bytes(), str(found[stream].encoding))
        for stream in streams
    }
