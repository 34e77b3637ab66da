"""What the routes answer, held against the OpenAPI description that the service itself publishes."""

import json
import math
from collections.abc import Generator
from dataclasses import replace
from typing import Any

import httpx
import pytest
from api_fakes import (
    COMPILING,
    ICED,
    VERSION,
    FakeHistory,
    FakeMonitor,
    alert,
    derivative,
    past,
    served,
    vehicle,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from openapi_check import answer_schema, misfits

from wingwatch.api import encode_json
from wingwatch.baselines import DatabaseError
from wingwatch.monitor.positions import Position
from wingwatch.monitor.record_views import BlockRecord, FlightRecordView, LinkSecond, LinkView, ModeRecord
from wingwatch.monitor.views import (
    AlertState,
    CandidateView,
    CouldSeeView,
    HelpfulInputView,
    KeyReusedError,
    LearnedView,
    ManoeuvreView,
    PoorView,
    Shelving,
    VehicleState,
)

ESTIMATORS: dict[str, Any] = {
    "fourier": {
        "short_period": {
            "outcome": "converged",
            "derivatives": {
                "m_q": derivative(-6.035, 0.1, expected=-6.1, expected_standard_error=0.3, basis="a-priori"),
                "m_w": derivative(math.nan, math.inf),
            },
            "natural_frequency_rad_s": 10.4,
            "damping_ratio": 0.62,
            "damping_ratio_standard_error": 0.03,
            "reason": "",
        }
    },
    "ekf": {"short_period": {"outcome": "settling", "derivatives": {"m_q": derivative(-6.2, 0.4)}}},
}
COULD_SEE = (
    CouldSeeView("sensor_bias", "pitch_rate_rad_s", 0.0125, "rad/s"),
    CouldSeeView("icing", None, None, "", "a doublet of the elevator"),
)
RECORD = FlightRecordView(
    (
        BlockRecord(0.0, 10.0, {"short_period": {"fourier": ModeRecord(31.5, 0.9, 2.1)}}, None, ("lateral",)),
        BlockRecord(10.0, 20.0, {"short_period": {"ekf": ModeRecord(None, None, None)}}, -math.inf, ()),
    ),
    12.8,
    {"a1": 60.0},
    LinkView(50.0, 0.02, 1, 1.5, 0.004, 0.3, 0.1, (LinkSecond(-math.inf, 50, 5, 0.02, math.nan),)),
)


def fleet() -> FakeMonitor:
    monitor = FakeMonitor()
    monitor.views = [
        vehicle("aero-2", VehicleState.DEGRADED, active_alerts=("a3", "a1")),
        vehicle("aero-1", could_see=COULD_SEE),
        vehicle("aero-1", VehicleState.UNKNOWN, fleet="north", worst=None, aircraft=None, condition={}),
    ]
    monitor.records = {("default", "aero-2"): RECORD}
    monitor.current = {
        ("default", "aero-1"): {"time_s": 118.48, "estimators": ESTIMATORS},
        ("north", "aero-1"): {"time_s": None, "estimators": {}},
    }
    monitor.raised = [
        alert(4, vehicle="aero-1", fleet="north", kind="unexplained", cause="unknown", size=math.nan),
        alert(3),
        alert(2, state=AlertState.CLEARED, cleared_s=90.0),
        alert(1, kind="damage", cause="elevator_effectiveness", state=AlertState.ACKNOWLEDGED),
        alert(
            0,
            kind="sensor",
            cause="sensor_bias",
            channel="pitch_rate_rad_s",
            evidence=(),
            candidates=(
                CandidateView("sensor_bias", "pitch_rate_rad_s", 0.75),
                CandidateView("icing", None, math.nan),
            ),
        ),
    ]
    return monitor


@pytest.fixture
def client() -> Generator[httpx.Client]:
    history = FakeHistory([past(1.0, "ekf", "dutch_roll", [1.0] * 6, [0.1] * 6)])
    with served(fleet(), history) as (_, connection):
        yield connection


def get(client: httpx.Client, path: str) -> Any:
    answer = client.get(path)
    assert answer.status_code == 200, answer.text
    return answer.json()


@pytest.mark.parametrize(
    ("path", "described"),
    [
        ("/v1/status", "/v1/status"),
        ("/v1/fleet", "/v1/fleet"),
        ("/v1/vehicles", "/v1/vehicles"),
        ("/v1/vehicles/aero-1", "/v1/vehicles/{vehicle}"),
        ("/v1/vehicles/aero-1?fleet=north", "/v1/vehicles/{vehicle}"),
        ("/v1/vehicles/aero-1/derivatives", "/v1/vehicles/{vehicle}/derivatives"),
        ("/v1/vehicles/aero-1/manoeuvres", "/v1/vehicles/{vehicle}/manoeuvres"),
        ("/v1/vehicles/aero-1/derivatives?fleet=north", "/v1/vehicles/{vehicle}/derivatives"),
        ("/v1/vehicles/aero-1/derivatives/history", "/v1/vehicles/{vehicle}/derivatives/history"),
        ("/v1/vehicles/aero-1/derivatives/series", "/v1/vehicles/{vehicle}/derivatives/series"),
        ("/v1/vehicles/aero-1/flights", "/v1/vehicles/{vehicle}/flights"),
        ("/v1/vehicles/aero-2/evidence", "/v1/vehicles/{vehicle}/evidence"),
        ("/v1/vehicles/aero-2/telemetry", "/v1/vehicles/{vehicle}/telemetry"),
        ("/v1/alerts", "/v1/alerts"),
        ("/v1/alerts?limit=1", "/v1/alerts"),
        ("/v1/alerts/a4", "/v1/alerts/{alert_id}"),
        ("/v1/alerts/a0", "/v1/alerts/{alert_id}"),
        ("/health/live", "/health/live"),
        ("/health/ready", "/health/ready"),
    ],
)
def test_every_answer_is_what_openapi_says(client: httpx.Client, path: str, described: str) -> None:
    description = get(client, "/openapi.json")
    assert misfits(get(client, path), answer_schema(description, described), description) == []


def test_evidence_has_onsets_and_what_is_not_known_is_null(client: httpx.Client) -> None:
    found = get(client, "/v1/vehicles/aero-2/evidence")
    assert [one["statistic"] for one in found["blocks"]] == [None, None]
    assert found["blocks"][0]["modes"] == {
        "short_period": {"fourier": {"information_bit": 31.5, "innovation": 0.9, "limit": 2.1}}
    }
    assert {one["id"]: one["onset_s"] for one in found["marks"]} == {
        "a3": None,
        "a2": None,
        "a1": 60.0,
        "a0": None,
    }
    telemetry = get(client, "/v1/vehicles/aero-2/telemetry")
    assert (telemetry["rate_hz"], telemetry["counts"]["accepted"]) == (50.0, 5924)
    assert telemetry["seconds"][0]["time_s"] is None
    assert client.get("/v1/vehicles/nobody/evidence").status_code == 404
    assert client.get("/v1/vehicles/nobody/telemetry").status_code == 404


def test_every_promised_path_is_described_with_its_errors(client: httpx.Client) -> None:
    description = get(client, "/openapi.json")
    actions = ("acknowledge", "shelve", "unshelve", "clear")
    assert set(description["paths"]) == {
        "/v1/status",
        "/v1/fleet",
        "/v1/fleet/workers",
        "/v1/vehicles",
        "/v1/vehicles/{vehicle}/manoeuvres",
        "/v1/vehicles/{vehicle}",
        "/v1/vehicles/{vehicle}/derivatives",
        "/v1/vehicles/{vehicle}/derivatives/history",
        "/v1/vehicles/{vehicle}/derivatives/history.csv",
        "/v1/vehicles/{vehicle}/derivatives/series",
        "/v1/vehicles/{vehicle}/evidence",
        "/v1/vehicles/{vehicle}/flights",
        "/v1/vehicles/{vehicle}/telemetry",
        "/v1/alerts",
        "/v1/alerts/{alert_id}",
        *(f"/v1/alerts/{{alert_id}}/{action}" for action in actions),
        "/v1/events",
        "/v1/diagnoses",
        "/v1/diagnoses/{diagnosis_id}",
        "/v1/diagnoses/{diagnosis_id}/events",
        "/v1/diagnoses/{diagnosis_id}/report",
        "/v1/baselines",
        "/v1/baselines/{aircraft}",
        "/v1/baselines/{aircraft}/history",
        "/v1/baselines/{aircraft}/revert",
        "/v1/studies",
        "/v1/studies/{name}/report",
        "/v1/session",
        "/health/live",
        "/health/ready",
        "/metrics",
    }
    for operations in description["paths"].values():
        for operation in operations.values():
            assert operation["summary"]
            for status, answer in operation["responses"].items():
                assert status[0] == "2" or list(answer["content"]) == ["application/problem+json"]
    assert "HTTPValidationError" not in description["components"]["schemas"]


def test_the_check_of_answers_can_fail(client: httpx.Client) -> None:
    description = get(client, "/openapi.json")
    schema = answer_schema(description, "/v1/status")
    status = get(client, "/v1/status")
    assert misfits({**status, "extra": 1}, schema, description) == ["$: extra is not described"]
    status["vehicles"][1]["state"] = "fine"
    del status["alerts"][0]["size"]["value"]
    status["version"] = None
    assert len(misfits(status, schema, description)) == 3


def test_status_carries_the_counters_of_every_part() -> None:
    counters = {"messages": {"received": 2**53 - 1, "overflow": 0}, "monitor": {"faults": 3}}
    with served(fleet(), counters=counters) as (_, client):
        shown = get(client, "/v1/status")["counters"]
        assert {part: shown.pop(part) for part in counters} == counters
        assert {part: set(shown[part].values()) for part in shown} == {"access": {0}, "events": {0}}


def test_status_says_what_is_being_compiled_while_it_is() -> None:
    with served(fleet(), kernels=lambda: COMPILING) as (_, client):
        kernels = get(client, "/v1/status")["kernels"]
        described = client.get("/openapi.json").json()
    assert kernels == {
        "text": COMPILING.text,
        "parts": [
            {"name": "the tail", "state": "compiled", "first": True},
            {"name": "the wings", "state": "compiling", "first": True},
            {"name": "the paint", "state": "waiting", "first": False},
        ],
        "elapsed_s": 12.3,
        "remaining_s": 40,
    }
    assert "KernelsDocument" in described["components"]["schemas"]
    with served(fleet()) as (_, client):
        assert get(client, "/v1/status")["kernels"] is None


def test_status_is_worst_first_with_counts_and_standing_alerts(client: httpx.Client) -> None:
    status = get(client, "/v1/status")
    assert status["version"] == VERSION
    assert [(v["fleet"], v["vehicle"]) for v in status["vehicles"]] == [
        ("default", "aero-2"),
        ("default", "aero-1"),
        ("north", "aero-1"),
    ]
    assert status["counts"] == {"healthy": 1, "degraded": 1, "not_observable": 0, "stale": 0, "unknown": 1}
    assert [a["id"] for a in status["alerts"]] == ["a4", "a3", "a1", "a0"]
    only = get(client, "/v1/status?fleet=north")
    assert [v["fleet"] for v in only["vehicles"]] == ["north"]
    assert [a["id"] for a in only["alerts"]] == ["a4"]


def test_vehicle_carries_state_worst_derivative_and_basis(client: httpx.Client) -> None:
    shown = get(client, "/v1/vehicles/aero-2")
    assert shown["state"] == "degraded"
    assert shown["last_sample_time_s"] == 118.48
    assert shown["basis"] == "a-priori"
    assert shown["active_alerts"] == ["a3", "a1"]
    assert shown["worst"] == {
        "estimator": "fourier",
        "structure": "short_period",
        "derivative": "m_q",
        "z": -1.25,
        "unit": "1/s",
        "meaning": "pitch acceleration due to pitch rate",
    }
    assert get(client, "/v1/vehicles/aero-1?fleet=north")["worst"] is None
    assert shown["could_see"] == []
    assert get(client, "/v1/vehicles/aero-1")["could_see"] == [
        {
            "cause": "sensor_bias",
            "channel": "pitch_rate_rad_s",
            "smallest_size": 0.0125,
            "unit": "rad/s",
            "input": "",
        },
        {
            "cause": "icing",
            "channel": None,
            "smallest_size": None,
            "unit": "",
            "input": "a doublet of the elevator",
        },
    ]
    assert shown["unseen_surfaces"] == []
    assert shown["proposed_input"] is None
    listed = get(client, "/v1/vehicles")
    assert {tuple(item["could_see"]) for item in listed["items"]} == {()}, "dear, and asked for one at a time"
    assert listed["next"] is None
    assert listed["items"][0] == shown


def test_the_last_manoeuvres_of_a_vehicle_newest_first() -> None:
    learned = (
        LearnedView("ekf", "short_period", "m_q", None, 0.5),
        LearnedView("ekf", "short_period", "m_w", math.inf, 0.25),
    )
    poor = (PoorView("too_slow", "too slow: 75 % of it lies below 0.8 Hz"),)
    inputs = (HelpfulInputView("elevator_rad", "doublet", 0.0625, 0.25),)
    first = ManoeuvreView(
        1, 10.0, 11.0, 12.5, {"elevator_rad": 0.0625}, False, learned, poor, inputs, "Poor. It was slow."
    )
    monitor = fleet()
    monitor.flown["default", "aero-1"] = (replace(first, number=2, good=True, poor=(), inputs=()), first)
    with served(monitor) as (_, client):
        listed = get(client, "/v1/vehicles/aero-1/manoeuvres")
        assert [one["number"] for one in listed["items"]] == [2, 1]
        assert listed["next"] is None
        shown = listed["items"][1]
        assert (shown["begin_s"], shown["end_s"], shown["known_s"]) == (10.0, 11.0, 12.5)
        assert (shown["good"], shown["text"]) == (False, "Poor. It was slow.")
        assert shown["surfaces"] == {"elevator_rad": 0.0625}
        assert [one["standard_error_before"] for one in shown["learned"]] == [None, None]
        assert shown["learned"][0]["unit"] == "1/s"
        assert shown["poor"] == [{"what": "too_slow", "text": poor[0].text}]
        assert shown["inputs"] == [
            {"surface": "elevator_rad", "shape": "doublet", "amplitude_rad": 0.0625, "width_s": 0.25}
        ]
        assert get(client, "/v1/vehicles/aero-2/manoeuvres")["items"] == []
        assert client.get("/v1/vehicles/nobody/manoeuvres").status_code == 404
        described = client.get("/openapi.json").json()["paths"]["/v1/vehicles/{vehicle}/manoeuvres"]
        assert "get" in described


def test_derivatives_pass_through_unchanged_and_unknown_ones_are_null(client: httpx.Client) -> None:
    shown = get(client, "/v1/vehicles/aero-1/derivatives")
    assert (shown["fleet"], shown["vehicle"], shown["time_s"]) == ("default", "aero-1", 118.48)
    mode = shown["estimators"]["fourier"]["short_period"]
    assert mode["derivatives"]["m_q"] == ESTIMATORS["fourier"]["short_period"]["derivatives"]["m_q"]
    assert mode["derivatives"]["m_w"]["value"] is None
    assert mode["derivatives"]["m_w"]["standard_error"] is None
    assert (mode["damping_ratio"], mode["damping_ratio_standard_error"]) == (0.62, 0.03)
    only = get(client, "/v1/vehicles/aero-1/derivatives?estimator=ekf")
    assert list(only["estimators"]) == ["ekf"]


def test_alert_carries_size_and_evidence_with_standard_errors(client: httpx.Client) -> None:
    shown = get(client, "/v1/alerts/a3")
    assert shown["size"] == {"value": 0.0625, "standard_error": 0.0078125}
    assert shown["evidence"] == [
        {
            "derivative": "m_eta",
            "estimate": ICED.estimate,
            "standard_error": ICED.standard_error,
            "expected": ICED.expected,
            "expected_standard_error": ICED.expected_standard_error,
            "z": ICED.z,
            "unit": "1/s2",
            "meaning": "pitch acceleration due to elevator",
        }
    ]
    assert shown["state"] == "active"
    assert (shown["channel"], shown["candidates"]) == (None, [])
    assert get(client, "/v1/alerts/a4")["size"]["value"] is None


def test_alert_of_a_sensor_names_it_and_what_else_is_possible(client: httpx.Client) -> None:
    shown = get(client, "/v1/alerts/a0")
    assert (shown["kind"], shown["channel"], shown["evidence"]) == ("sensor", "pitch_rate_rad_s", [])
    assert shown["candidates"] == [
        {"cause": "sensor_bias", "channel": "pitch_rate_rad_s", "probability": 0.75},
        {"cause": "icing", "channel": None, "probability": None},
    ]


@pytest.mark.parametrize(
    ("query", "ids"),
    [
        ("", ["a4", "a3", "a2", "a1", "a0"]),
        ("state=cleared", ["a2"]),
        ("state=acknowledged", ["a1"]),
        ("vehicle=aero-1", ["a4"]),
        ("fleet=default", ["a3", "a2", "a1", "a0"]),
        ("kind=damage", ["a1"]),
        ("since=73", ["a4", "a3"]),
        ("since=73.0000001", ["a4"]),
        ("kind=icing&state=active", ["a3"]),
        ("kind=sensor", ["a0"]),
        ("channel=pitch_rate_rad_s", ["a0"]),
        ("channel=pitch_rate_rad_s&state=cleared", []),
        ("channel=throttle", []),
        ("cause=elevator_effectiveness", ["a1"]),
        ("level=watch", []),
        ("since=71&until=73", ["a3", "a2", "a1"]),
    ],
)
def test_alerts_are_filtered(client: httpx.Client, query: str, ids: list[str]) -> None:
    page = get(client, f"/v1/alerts?{query}")
    assert [a["id"] for a in page["items"]] == ids
    assert page["next"] is None


def test_pages_give_every_alert_once_though_new_ones_arrive_and_states_change() -> None:
    monitor = FakeMonitor()
    monitor.raised = [alert(n) for n in range(9, 0, -1)]
    with served(monitor) as (_, client):
        seen: list[str] = []
        path = "/v1/alerts?state=active&limit=4"
        cursor: str | None = ""
        while cursor is not None:
            page = get(client, path + (f"&cursor={cursor}" if cursor else ""))
            seen += [a["id"] for a in page["items"]]
            cursor = page["next"]
            monitor.raised.insert(0, alert(90 + len(seen)))
            if len(seen) == 4:
                client.post(f"/v1/alerts/{seen[-1]}/clear", json={"who": "ana"})
    assert seen == [f"a{n}" for n in range(9, 0, -1)]


@pytest.mark.parametrize(
    ("action", "state"),
    [("acknowledge", "acknowledged"), ("shelve", "shelved"), ("unshelve", "active"), ("clear", "cleared")],
)
def test_a_person_acts_on_an_alert(client: httpx.Client, action: str, state: str) -> None:
    answer = client.post(f"/v1/alerts/a3/{action}", json={"who": " Ana ", "note": "seen"})
    assert answer.status_code == 200
    assert answer.json()["state"] == state
    assert answer.json()["notes"] == [f"{action} by Ana: seen"]
    assert get(client, "/v1/alerts/a3")["state"] == state
    description = get(client, "/openapi.json")
    schema = answer_schema(description, f"/v1/alerts/{{alert_id}}/{action}", "post")
    assert misfits(answer.json(), schema, description) == []


def test_an_action_carries_its_request_key() -> None:
    monitor = FakeMonitor()
    monitor.raised = [alert(1)]
    with served(monitor) as (_, client):

        def act(key: str) -> httpx.Response:
            headers = {"Idempotency-Key": key}
            return client.post("/v1/alerts/a1/acknowledge", json={"who": "ana"}, headers=headers)

        assert act("5f0c-1").status_code == 200
        assert monitor.keys == ["5f0c-1"]
        assert act("a key").status_code == act("k" * 201).status_code == 422
        monitor.store_fault = KeyReusedError("this Idempotency-Key belongs to another action")
        answer = act("5f0c-1")
        assert (answer.status_code, answer.json()["detail"]) == (422, f"{monitor.store_fault}.")
        monitor.store_fault = DatabaseError("the database has not taken the action; nothing has happened")
        answer = act("5f0c-2")
        assert answer.status_code == 503
        assert "nothing has happened" in answer.json()["detail"]


def test_an_alert_is_shelved_for_a_while() -> None:
    monitor = FakeMonitor()
    monitor.raised = [replace(alert(1), shelving=Shelving(1.7e9, "warning", 0.1))]
    with served(monitor) as (_, client):
        assert get(client, "/v1/alerts/a1")["shelved_until_at_s"] == 1.7e9
        for body in ({}, {"minutes": 5}, {"minutes": 0}, {"minutes": 1441}):
            client.post("/v1/alerts/a1/shelve", json={"who": "ana", **body})
    assert monitor.shelved_s == [3600.0, 300.0]


def test_ready_names_what_does_not_work() -> None:
    checks = {"zenoh": None, "database": "the database is read-only; make its folder writable.", "http": None}
    with served(FakeMonitor(), checks=checks) as (_, client):
        answer = client.get("/health/ready")
        assert answer.status_code == 503
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["checks"] == checks
        assert answer.json()["detail"] == "database: the database is read-only; make its folder writable."
        assert client.get("/health/live").json() == {"live": True, "version": VERSION}
    with served(FakeMonitor()) as (_, client):
        assert client.get("/health/ready").json()["ready"] is True


def test_status_names_the_parts_that_do_not_work() -> None:
    checks = {"zenoh": None, "database": "it is locked.", "http": None}
    with served(FakeMonitor(), checks=checks) as (_, client):
        assert get(client, "/v1/status")["problems"] == {"database": "it is locked."}
    with served(FakeMonitor()) as (_, client):
        assert get(client, "/v1/status")["problems"] == {}


def test_no_page_loads_anything_from_elsewhere(client: httpx.Client) -> None:
    assert client.get("/redoc").status_code == 404
    assert "https://" not in client.get("/docs").text


@settings(max_examples=300, deadline=None)
@given(st.floats(allow_nan=True, allow_infinity=True))
def test_a_float_survives_json_to_the_last_bit(value: float) -> None:
    back = json.loads(encode_json({"x": value}))["x"]
    if math.isfinite(value):
        assert math.copysign(1.0, back) == math.copysign(1.0, value)
        assert float(back).hex() == value.hex()
    else:
        assert back is None


@settings(max_examples=60, deadline=None)
@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_a_derivative_reaches_the_caller_to_the_last_bit(exact: Any, value: float) -> None:
    monitor, client = exact
    modes = {"short_period": {"outcome": "converged", "derivatives": {"m_q": derivative(value, value)}}}
    monitor.current = {("default", "aero-1"): {"time_s": value, "estimators": {"fourier": modes}}}
    shown = get(client, "/v1/vehicles/aero-1/derivatives")
    entry = shown["estimators"]["fourier"]["short_period"]["derivatives"]["m_q"]
    assert [float(x).hex() for x in (entry["value"], entry["standard_error"], shown["time_s"])] == [
        value.hex()
    ] * 3


@pytest.fixture(scope="module")
def exact() -> Generator[tuple[FakeMonitor, httpx.Client]]:
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-1")]
    with served(monitor) as (_, connection):
        yield monitor, connection


def test_rows_of_the_fleet_say_where_it_is_and_how_old_their_samples_are() -> None:
    monitor = fleet()
    monitor.views[0] = replace(monitor.views[0], position=Position(50.25, 10.5, 900.0), sample_age_s=0.5)
    with served(monitor) as (_, client):
        answer = get(client, "/v1/fleet")
        first, second, north = answer["vehicles"]
        assert [first[key] for key in ("latitude_deg", "longitude_deg", "sample_age_s", "airspeed_true_m_s")] == [
            50.25, 10.5, 0.5, 25.0,
        ]  # fmt: skip
        assert (second["latitude_deg"], second["sample_age_s"], north["worst"]) == (None, None, None)
        assert [alert["id"] for alert in answer["alerts"]] == ["a4", "a3", "a1", "a0"]
        assert answer["counts"]["degraded"] == 1
        assert "could_see" not in first
        only = get(client, "/v1/fleet?fleet=north")
        assert [row["fleet"] for row in only["vehicles"]] == ["north"]
        assert [alert["id"] for alert in only["alerts"]] == ["a4"]
