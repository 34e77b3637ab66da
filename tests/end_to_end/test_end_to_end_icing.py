"""The whole chain: a flight that takes on ice streams through a real Zenoh session, and the alert stands over HTTP."""

from pathlib import Path

import zenoh
from live import fly, get, service_in, until, until_last

from wingwatch.simulation import demo_fleet, simulate
from wingwatch.telemetry import (
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
            until(lambda: bool(heard))
            subscriber.undeclare()  # type: ignore[no-untyped-call]
        check_alert(service_alerts := get(service, "/v1/alerts")["items"])
        assert get(service, "/v1/vehicles/icing")["state"] == "degraded"
        assert get(service, "/v1/vehicles/healthy")["active_alerts"] == []
        check_published(heard, service_alerts)
        check_answered(endpoint, service_alerts)


def check_alert(alerts: list[dict[str, object]]) -> None:
    """One alert: ice, in time, with size and evidence."""
    (alert,) = alerts
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


def check_published(heard: list[tuple[str, bytes, str]], alerts: list[dict[str, object]]) -> None:
    """The life of the alert went out on its key, the last state being that of REST."""
    assert {key for key, _, _ in heard} == {vehicle_key("default", "icing", "alerts")}
    _, payload, encoding = heard[-1]
    assert decode_service_object("alerts", payload, encoding) == alerts[0]


def check_answered(endpoint: str, alerts: list[dict[str, object]]) -> None:
    """The service's keys answer queries with the objects of REST."""
    with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
        replies = list(session.get("wingwatch/v1/default/icing/*", target=zenoh.QueryTarget.ALL))
    objects = {str(r.ok.key_expr).rsplit("/", 1)[1]: r.ok.payload.to_bytes() for r in replies if r.ok}
    assert set(objects) == {"derivatives", "status", "alerts"}
    assert decode_service_object("alerts", objects["alerts"], "application/json") == alerts[0]
    status = decode_service_object("status", objects["status"], "application/json")
    assert (status["vehicle"], status["state"]) == ("icing", "degraded")
    derivatives = decode_service_object("derivatives", objects["derivatives"], "application/json")
    assert derivatives["vehicle"] == "icing"
    assert set(derivatives["estimators"]) == {"fourier", "ekf"}
