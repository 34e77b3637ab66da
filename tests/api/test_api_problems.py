"""Whatever is asked, the answer is what was asked for or a problem document with one clear sentence."""

import json
from collections.abc import Generator, Mapping, Sequence
from typing import Any

import httpx
import pytest
from api_fakes import FakeHistory, FakeMonitor, alert, derivative, past, served, vehicle
from hypothesis import given, settings
from hypothesis import strategies as st
from openapi_check import misfits

from wingwatch.baselines import DatabaseError, HistoryRow, HistoryWanted
from wingwatch.monitor.views import AlertState, AlertView, VehicleView


class FaultyMonitor(FakeMonitor):
    """Fails on what no route foresees, where the test asks for it."""

    broken = False

    def vehicles(self) -> Sequence[VehicleView]:
        if self.broken:
            raise RuntimeError("secret of the inside")
        return super().vehicles()


@pytest.fixture(scope="module")
def monitor() -> FaultyMonitor:
    filled = FaultyMonitor()
    filled.views = [
        vehicle("aero-1"),
        vehicle("quiet", aircraft=None),
        vehicle("odd", aircraft="../../etc/passwd"),
    ]
    modes = {"short_period": {"outcome": "converged", "derivatives": {"m_q": derivative(-6.0, 0.1)}}}
    for name in ("aero-1", "quiet", "odd"):
        filled.current[("default", name)] = {"time_s": 1.0, "estimators": {"fourier": modes}}
    filled.raised = [alert(1), alert(2, state=AlertState.CLEARED)]
    return filled


@pytest.fixture(scope="module")
def client(monitor: FaultyMonitor) -> Generator[httpx.Client]:
    history = FakeHistory([past(1.0, "ekf", "dutch_roll", [1.0] * 6, [0.1] * 6)])
    with served(monitor, history) as (_, connection):
        yield connection


def problem(client: httpx.Client, answer: httpx.Response, status: int) -> Mapping[str, Any]:
    """The answer as a problem document of this status, held against the description."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document: Mapping[str, Any] = answer.json()
    description = client.get("/openapi.json").json()
    assert misfits(document, description["components"]["schemas"]["Problem"], description) == []
    assert document["status"] == status
    assert document["type"] == "about:blank"
    assert document["detail"].endswith(".")
    assert "\n" not in document["detail"]
    return document


@pytest.mark.parametrize(
    ("path", "status", "words"),
    [
        ("/v1/nowhere", 404, ["/v1/nowhere", "/openapi.json"]),
        ("/v1/status/", 404, ["/v1/status/"]),
        ("/v1/vehicles/nobody", 404, ["'nobody'", "'default'", "/v1/vehicles"]),
        ("/v1/vehicles/aero-1?fleet=south", 404, ["'south'"]),
        ("/v1/vehicles/nobody/derivatives", 404, ["'nobody'"]),
        ("/v1/vehicles/nobody/derivatives/history", 404, ["'nobody'"]),
        ("/v1/vehicles/AERO", 422, ["vehicle", "'AERO'", "[a-z0-9]"]),
        ("/v1/vehicles/aero-1?fleet=No%20One", 422, ["fleet", "'No One'"]),
        ("/v1/vehicles/aero-1?flet=x", 422, ["query parameter flet", "not known"]),
        ("/v1/vehicles/aero-1/derivatives?estimator=kalman", 422, ["estimator", "'kalman'", "fourier"]),
        (
            "/v1/vehicles/aero-1/derivatives?convention=french",
            422,
            ["'french'", "concise", "dimensional", "british", "american"],
        ),
        ("/v1/vehicles/quiet/derivatives?convention=british", 422, ["'quiet'", "announced"]),
        ("/v1/vehicles/odd/derivatives?convention=british", 422, ["../../etc/passwd", "library"]),
        (
            "/v1/vehicles/aero-1/derivatives/history?from=now",
            422,
            ["query parameter from", "number", "'now'"],
        ),
        ("/v1/vehicles/aero-1/derivatives/history?from=nan", 422, ["query parameter from", "finite"]),
        ("/v1/vehicles/aero-1/derivatives/history?from=5&to=4", 422, ["from=5.0", "to=4.0"]),
        ("/v1/vehicles/aero-1/derivatives/history?names=m_q,m_x", 422, ["'m_x'", "m_eta"]),
        ("/v1/vehicles/aero-1/derivatives/history?cursor=AAAA", 422, ["cursor", "'AAAA'"]),
        ("/v1/alerts?state=open", 422, ["'open'", "active", "shelved"]),
        ("/v1/alerts?kind=ice", 422, ["'ice'", "icing"]),
        ("/v1/alerts?channel=pitch_rate", 422, ["channel", "'pitch_rate'", "column", "pitch_rate_rad_s"]),
        ("/v1/alerts?since=yesterday", 422, ["since", "'yesterday'"]),
        ("/v1/alerts?limit=0", 422, ["limit", "greater than or equal to 1", "'0'"]),
        ("/v1/alerts?limit=1001", 422, ["limit", "1000"]),
        ("/v1/alerts?limit=ten&state=open", 422, ["and 1 more"]),
        ("/v1/alerts?cursor=%C3%BC", 422, ["cursor"]),
        ("/v1/alerts?cursor=WzFd", 422, ["cursor", "'WzFd'"]),
        ("/v1/alerts/none", 404, ["'none'", "/v1/alerts"]),
        ("/redoc", 404, ["/redoc"]),
    ],
)
def test_what_cannot_be_answered_says_why(
    client: httpx.Client, path: str, status: int, words: list[str]
) -> None:
    document = problem(client, client.get(path), status)
    assert [word for word in words if word not in document["detail"]] == []
    assert document["instance"] == path.split("?")[0]


def test_a_database_that_cannot_answer_is_a_problem_in_its_own_sentence(monitor: FaultyMonitor) -> None:
    class Locked(FakeHistory):
        def history_rows(self, fleet: str, vehicle: str, wanted: HistoryWanted) -> Sequence[HistoryRow]:
            raise DatabaseError("database wingwatch.db is locked by another program; end it or wait")

    with served(monitor, Locked([])) as (_, connection):
        answer = connection.get("/v1/vehicles/aero-1/derivatives/history")
        document = problem(connection, answer, 503)
    assert document["detail"] == "database wingwatch.db is locked by another program; end it or wait."


def test_every_fault_of_a_request_is_listed(client: httpx.Client) -> None:
    document = problem(client, client.get("/v1/alerts?limit=ten&state=open"), 422)
    assert {error["where"] for error in document["errors"]} == {"query.limit", "query.state"}


@pytest.mark.parametrize(
    ("content", "status", "words"),
    [
        (b"", 422, ["JSON body is required"]),
        (b"{", 422, ["no JSON", "character 1"]),
        (b"[]", 422, ["body"]),
        (b"{}", 422, ["who", "required"]),
        (b'{"who": ""}', 422, ["who", "at least 1"]),
        (b'{"who": "   "}', 422, ["who", "at least 1"]),
        (b'{"who": 7}', 422, ["who", "string", "7"]),
        (b'{"who": "a\\u0007b"}', 422, ["who", "a\\x07b"]),
        (b'{"who": "\\ud800"}', 422, ["who"]),
        (b'{"\\ud800": "x", "who": "a"}', 422, ["\\ud800"]),
        (b'{"who": "a", "note": "' + b"x" * 1001 + b'"}', 422, ["note", "1000"]),
        (b'{"who": "a", "when": 1}', 422, ["when", "not known"]),
        (b'{"who": "\xff"}', 400, ["UTF-8"]),
        (b'{"who": "' + b"x" * 70_000 + b'"}', 413, ["64 kB"]),
    ],
)
def test_a_bad_body_is_refused(client: httpx.Client, content: bytes, status: int, words: list[str]) -> None:
    headers = {"content-type": "application/json"}
    answer = client.post("/v1/alerts/a1/acknowledge", content=content, headers=headers)
    document = problem(client, answer, status)
    assert [word for word in words if word not in document["detail"]] == []
    assert len(document["detail"]) < 400


def test_a_body_too_large_is_refused_though_its_length_is_not_announced(client: httpx.Client) -> None:
    def pieces() -> Generator[bytes]:
        yield b'{"who": "'
        for _ in range(20):
            yield b"x" * 10_000
        yield b'"}'

    headers = {"content-type": "application/json"}
    answer = client.post("/v1/alerts/a1/acknowledge", content=pieces(), headers=headers)
    assert "64 kB" in problem(client, answer, 413)["detail"]


def test_a_form_of_another_site_cannot_act(client: httpx.Client, monitor: FaultyMonitor) -> None:
    before = monitor.alerts()
    body = b'{"who": "mallory", "note": ""}'
    for kind in ("text/plain", "application/x-www-form-urlencoded", None):
        headers = {} if kind is None else {"content-type": kind}
        problem(client, client.post("/v1/alerts/a1/clear", content=body, headers=headers), 422)
    assert monitor.alerts() == before


def test_an_action_that_makes_no_sense_or_has_no_alert_is_refused(client: httpx.Client) -> None:
    refused = problem(client, client.post("/v1/alerts/a2/shelve", json={"who": "ana"}), 409)
    assert refused["detail"] == "alert a2 is cleared; nothing more can be done to it."
    problem(client, client.post("/v1/alerts/a77/shelve", json={"who": "ana"}), 404)
    problem(client, client.post("/v1/alerts/a1/delete", json={"who": "ana"}), 404)


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "TRACE", "BREW"])
def test_a_method_not_offered_names_those_that_are(client: httpx.Client, method: str) -> None:
    answer = client.request(method, "/v1/status")
    document = problem(client, answer, 405)
    assert answer.headers["allow"] == "GET"
    assert method in document["detail"]
    assert "GET" in document["detail"]


def test_a_fault_of_our_own_is_a_problem_and_keeps_its_secrets(
    client: httpx.Client, monitor: FaultyMonitor, caplog: pytest.LogCaptureFixture
) -> None:
    monitor.broken = True
    try:
        answer = client.get("/v1/status")
    finally:
        monitor.broken = False
    problem(client, answer, 500)
    assert "secret" not in answer.text
    assert "secret of the inside" in caplog.text
    assert "content-security-policy" in answer.headers
    assert client.get("/v1/status").status_code == 200


@settings(max_examples=150, deadline=None)
@given(
    name=st.text(min_size=1, max_size=80), tail=st.sampled_from(["", "/derivatives", "/derivatives/history"])
)
def test_no_vehicle_id_brings_the_service_down(client: httpx.Client, name: str, tail: str) -> None:
    path = "/v1/vehicles/" + _quoted(name) + tail
    answer = client.get(path)
    if answer.status_code == 200:
        assert name in {"aero-1", "quiet", "odd"} or name in {".", ".."}
    else:
        assert answer.status_code in {404, 422}
        assert answer.headers["content-type"] == "application/problem+json"
        assert json.loads(answer.content)["detail"].isprintable()


@settings(max_examples=150, deadline=None)
@given(name=st.text(min_size=1, max_size=300), action=st.sampled_from(["", "/acknowledge", "/clear"]))
def test_no_alert_id_brings_the_service_down(client: httpx.Client, name: str, action: str) -> None:
    path = "/v1/alerts/" + _quoted("x" + name) + action
    answer = client.post(path, json={"who": "ana"}) if action else client.get(path)
    assert answer.status_code in {404, 405, 422}
    assert answer.headers["content-type"] == "application/problem+json"
    assert json.loads(answer.content)["detail"].isprintable()


@settings(max_examples=150, deadline=None)
@given(
    key=st.sampled_from(["state", "vehicle", "fleet", "kind", "since", "limit", "cursor", "other"]),
    value=st.text(max_size=60),
)
def test_no_query_brings_the_service_down(client: httpx.Client, key: str, value: str) -> None:
    answer = client.get("/v1/alerts?" + key + "=" + _quoted(value))
    assert answer.status_code in {200, 422}
    if answer.status_code == 422:
        assert answer.headers["content-type"] == "application/problem+json"


def _quoted(text: str) -> str:
    return "".join(f"%{byte:02x}" for byte in text.encode("utf-8", "surrogatepass"))


def test_views_are_untouched_by_reading(client: httpx.Client, monitor: FaultyMonitor) -> None:
    before: Sequence[AlertView] = monitor.alerts()
    for path in ("/v1/alerts", "/v1/status", "/v1/alerts/a1"):
        assert client.get(path).status_code == 200
    assert monitor.alerts() == before


def test_a_method_that_is_not_offered_names_all_that_are() -> None:
    with served(FakeMonitor()) as (_, client):
        reply = client.options("/v1/session")
        assert (reply.status_code, reply.headers["allow"]) == (405, "DELETE, GET, POST")
        assert reply.json()["detail"] == "'OPTIONS' is not offered at '/v1/session'; use DELETE, GET, POST."
