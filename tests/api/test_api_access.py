"""Who may ask and act: tokens with their scopes, hosts and origins, rates, and what is kept of an action."""

import logging
import socket
import ssl
from collections.abc import Generator, Mapping
from dataclasses import replace
from pathlib import Path

import httpx
import pytest
from api_fakes import FakeMonitor, alert, served, vehicle
from browser import chromium_path, open_page
from certificates import Authority, needs_openssl
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wingwatch.api import (
    AccessSettings,
    AppSettings,
    Caller,
    CertificateError,
    HttpServer,
    TokenScope,
    create_app,
    listen,
    read_certificate,
)
from wingwatch.api.rates import Rate, RateLimit

TOKENS = {"look": Caller("tower", TokenScope.READ), "act": Caller("lead", TokenScope.OPERATE)}
REQUIRED = AccessSettings(find=TOKENS.get, required=True)
READ, OPERATE = ({"Authorization": f"Bearer {token}"} for token in ("look", "act"))


def flying() -> FakeMonitor:
    monitor = FakeMonitor()
    monitor.views, monitor.raised = [vehicle("aero-2")], [alert(1)]
    return monitor


@pytest.fixture
def monitor() -> FakeMonitor:
    return flying()


@pytest.fixture
def client(monitor: FakeMonitor) -> Generator[httpx.Client]:
    with served(monitor, access=REQUIRED) as (_, connection):
        yield connection


def clear(client: httpx.Client, headers: Mapping[str, str] | None = None, **body: str) -> httpx.Response:
    return client.post("/v1/alerts/a1/clear", json=body or {"who": "ana"}, headers=headers)


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "127.0.0.1.evil.example:8000"},
        {"Host": "[evil"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://[evil"},
        {"Origin": ""},
        {"Origin": "http://127.0.0.1:1"},
    ],
)
def test_a_foreign_host_or_origin_may_neither_act_nor_read(
    monitor: FakeMonitor, headers: dict[str, str]
) -> None:
    before = monitor.alerts()
    with served(monitor) as (_, client):
        for answer in (clear(client, headers), client.get("/v1/status", headers=headers)):
            assert answer.status_code == (421 if "Host" in headers else 403)
            assert answer.headers["content-type"] == "application/problem+json"
        counts = client.get("/v1/status").json()["counters"]["access"]
    assert monitor.alerts() == before
    assert counts["foreign_host" if "Host" in headers else "foreign_origin"] == 2


def test_the_service_s_own_page_and_names_may_act(monitor: FakeMonitor) -> None:
    with served(monitor, access=AccessSettings(names=("Wing.example",))) as (server, client):
        own = {"Origin": f"http://127.0.0.1:{server.port}"}
        assert clear(client, own).status_code == 200
        for host in (f"localhost:{server.port}", "wing.example", "WING.EXAMPLE:443", "[::1]:80", "10.1.2.3"):
            assert client.get("/v1/status", headers={"Host": host}).status_code == 200
        through_proxy = {"Host": "wing.example", "Origin": "https://wing.example"}
        assert client.get("/v1/status", headers=through_proxy).status_code == 200


def test_without_a_token_nothing_is_read_and_nobody_acts(client: httpx.Client, monitor: FakeMonitor) -> None:
    for answer in (client.get("/v1/status"), client.get("/openapi.json"), clear(client)):
        assert answer.status_code == 401
        assert answer.headers["www-authenticate"] == "Bearer"
        assert "Authorization: Bearer" in answer.json()["detail"]
    assert client.get("/v1/events").status_code == 401
    assert monitor.raised == [alert(1)]


@pytest.mark.parametrize("header", ["Bearer other", "Bearer", "Basic bG9vazo=", "look"])
def test_a_wrong_token_is_refused_even_where_none_is_needed(header: str) -> None:
    for access in (REQUIRED, AccessSettings(find=TOKENS.get)):
        with served(flying(), access=access) as (_, client):
            answer = client.get("/v1/status", headers={"Authorization": header})
            assert answer.status_code == 401


def test_a_token_may_do_what_its_scope_says(client: httpx.Client, monitor: FakeMonitor) -> None:
    assert client.get("/v1/status", headers=READ).status_code == 200
    refused = clear(client, READ)
    assert refused.status_code == 403
    assert "'tower' may only read" in refused.json()["detail"]
    assert client.delete("/v1/diagnoses/d1", headers=READ).status_code == 403
    assert monitor.raised == [alert(1)]
    assert client.get("/v1/status", headers=OPERATE).status_code == 200
    assert clear(client, OPERATE).status_code == 200


def test_an_action_is_kept_under_the_token_s_name(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "wingwatch"):
        for body, who in (
            ({"note": "seen"}, "lead"),
            ({"who": "lead"}, "lead"),
            ({"who": "ana"}, "lead, for ana"),
        ):
            monitor = flying()
            with served(monitor, access=REQUIRED) as (_, client):
                assert clear(client, OPERATE, **body).json()["notes"] == [
                    f"clear by {who}: {body.get('note', '')}"
                ]
            assert f"clear of alert a1 by {who}" in caplog.text
    (first, *_) = [record for record in caplog.records if "clear of alert" in record.message]
    assert first.__dict__["vehicle"] == "default/aero-2"


def test_without_a_token_who_is_required_as_before(monitor: FakeMonitor) -> None:
    with served(monitor) as (_, client):
        answer = client.post("/v1/alerts/a1/clear", json={"note": "x"})
        assert answer.status_code == 422
        assert answer.json()["errors"] == [
            {"where": "body.who", "message": "the body's field who is required"}
        ]


def test_what_holds_no_data_is_open_and_readiness_keeps_its_reasons(monitor: FakeMonitor) -> None:
    checks = {"database": "secret.db is locked."}
    with served(monitor, access=REQUIRED, checks=checks) as (_, client):
        for path in (
            "/",
            "/alerts",
            "/vehicles/aero-2",
            "/docs",
            "/pages/main.js",
            "/health/live",
            "/v1/session",
        ):
            assert client.get(path).status_code == 200
        answer = client.get("/health/ready")
        assert answer.status_code == 503
        assert "secret.db" not in answer.text
        assert client.get("/health/ready", headers=READ).json()["checks"] == checks


def test_a_refusal_of_a_large_upload_reaches_its_client(client: httpx.Client) -> None:
    headers = {"content-type": "application/octet-stream", **READ}
    body = b"x" * (4 << 20)
    assert client.post("/v1/diagnoses?aircraft=a", content=body, headers=headers).status_code == 403
    assert client.post("/v1/diagnoses?aircraft=a", content=body).status_code == 401


def test_guesses_are_slowed_down_logged_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    access = replace(REQUIRED, guessing=Rate(per_s=0.01, burst=3))
    with served(FakeMonitor(), access=access) as (_, client):
        guess = {"Authorization": "Bearer guess"}
        got = [client.get("/v1/status", headers=guess).status_code for _ in range(5)]
        assert got == [401, 401, 401, 429, 429]
        entry = client.post("/v1/session", json={"token": "guess"})
        assert entry.status_code == 429
        assert int(entry.headers["retry-after"]) >= 60
        # whoever shares the address and has a token is not locked out
        assert client.get("/v1/status", headers=READ).status_code == 200
    assert caplog.text.count("refused 127.0.0.1 (wrong_token") == 3
    assert "guess" not in caplog.text.replace("guessing", "")


def test_one_client_s_flood_does_not_shut_out_another() -> None:
    access = replace(REQUIRED, reading=Rate(per_s=0.01, burst=3), acting=Rate(per_s=0.01, burst=1))
    with served(flying(), access=access) as (_, client):
        got = [client.get("/v1/vehicles", headers=READ).status_code for _ in range(4)]
        assert got == [200, 200, 200, 429]
        assert clear(client, OPERATE).status_code == 200
        assert clear(client, OPERATE).status_code == 429
        counts = client.get("/v1/status", headers=OPERATE).json()["counters"]["access"]
        assert counts["too_often"] == 2


def test_on_loopback_a_program_may_ask_as_often_as_it_likes() -> None:
    few = Rate(per_s=0.01, burst=1)
    with served(flying(), access=AccessSettings(reading=few, acting=few)) as (_, client):
        assert {client.get("/v1/vehicles").status_code for _ in range(5)} == {200}


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    name=st.sampled_from(["Host", "Origin", "Authorization", "Cookie", "Last-Event-ID", "X-Forwarded-For"]),
    value=st.text(
        st.characters(min_codepoint=0x21, max_codepoint=0xFF, exclude_characters="\x7f"), max_size=60
    ),
)
def test_no_header_opens_the_service_or_brings_it_down(client: httpx.Client, name: str, value: str) -> None:
    answer = client.get("/v1/vehicles", headers={name.encode(): value.encode("latin-1")})
    assert answer.status_code in {400, 401, 403, 421, 429}


def test_a_bucket_fills_at_its_rate_and_knows_a_bounded_number_of_clients() -> None:
    now_s = 0.0
    limit = RateLimit(Rate(per_s=2.0, burst=3), lambda: now_s)
    assert [limit.take("a") for _ in range(4)] == [0.0, 0.0, 0.0, 0.5]
    now_s = 0.5
    assert [limit.take("a"), limit.take("a"), limit.take("a")] == [0.0, 0.5, 0.5]
    now_s = 100.0
    assert [limit.take("a") for _ in range(4)] == [0.0, 0.0, 0.0, 0.5]
    for number in range(20_000):
        limit.take(str(number))
    assert len(limit._left) == 10_000


def test_a_browser_logs_in_and_out_and_its_cookie_is_no_script_s(client: httpx.Client) -> None:
    assert client.get("/v1/session").json() == {"name": None, "scope": None, "required": True}
    assert client.post("/v1/session", json={"token": "other"}).status_code == 401
    answer = client.post("/v1/session", json={"token": " act "})
    assert answer.json() == {"name": "lead", "scope": "operate", "required": True}
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert "Secure" not in cookie
    behind_proxy = {"Host": "127.0.0.1", "Origin": "https://127.0.0.1"}
    again = client.post("/v1/session", json={"token": "act"}, headers=behind_proxy)
    assert "Secure" in again.headers["set-cookie"]
    client.post("/v1/session", json={"token": "act"})
    assert client.get("/v1/status").status_code == 200
    assert clear(client, note="seen").json()["notes"] == ["clear by lead: seen"]
    assert client.delete("/v1/session").json()["name"] is None
    assert client.get("/v1/status").status_code == 401


def test_a_cookie_of_a_withdrawn_token_is_worth_nothing_and_harms_nobody() -> None:
    tokens = dict(TOKENS)
    for required, status in ((True, 401), (False, 200)):
        tokens["act"] = TOKENS["act"]
        access = AccessSettings(find=tokens.get, required=required)
        with served(flying(), access=access) as (_, client):
            client.post("/v1/session", json={"token": "act"})
            del tokens["act"]
            assert client.get("/v1/status").status_code == status
            assert client.get("/v1/session").json()["name"] is None
            assert client.get("/").status_code == 200


@pytest.mark.skipif(chromium_path() is None, reason="the pages need a browser: install the package chromium")
def test_the_page_asks_for_a_token_and_then_shows_the_fleet(monitor: FakeMonitor) -> None:
    with served(monitor, access=REQUIRED) as (server, _), open_page(server.url) as page:
        page.wait("document.getElementById('login')?.hidden === false")
        assert page.ask("document.querySelectorAll('.rows > .row').length") == 0
        fill = "document.getElementById('token').value = {!r}; document.getElementById('token').focus()"
        page.ask(fill.format("wrong"))
        page.key("Enter")
        page.wait("document.getElementById('login-problem').textContent.includes('none of this service')")
        page.ask(fill.format("act"))
        page.key("Enter")
        page.wait("document.querySelectorAll('.rows > .row').length === 1")
        page.wait("document.getElementById('link').dataset.link === 'live'")
        assert page.ask("document.getElementById('login').hidden")
        assert page.ask("document.getElementById('who').textContent") == "Logged in as lead (operate)."
        assert page.ask("document.cookie") == ""
        assert page.ask("document.getElementById('token').value") == ""
        page.ask("document.getElementById('logout').click()")
        page.wait("document.getElementById('login')?.hidden === false")
        assert page.ask("document.querySelectorAll('.rows > .row').length") == 0


@needs_openssl
def test_over_tls_answers_and_cookies_are_safe_and_a_silent_handshake_ends(tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    tls = read_certificate(*authority.sign("service"))
    access = AccessSettings(find=TOKENS.get)
    app = create_app(flying(), dict, None, "1", AppSettings(access=access))
    trust = ssl.create_default_context(cafile=str(authority.certificate))
    with HttpServer(app, listen("127.0.0.1", 0), tls=tls) as server:
        assert server.url == f"https://127.0.0.1:{server.port}"
        with socket.create_connection(("127.0.0.1", server.port), timeout=10.0) as silent:
            with httpx.Client(base_url=server.url, verify=trust) as client:
                assert client.get("/v1/status").status_code == 200
                entered = client.post("/v1/session", json={"token": "act"})
                assert "Secure" in entered.headers["set-cookie"]
            assert silent.recv(1) == b""
        with pytest.raises(httpx.RemoteProtocolError):
            httpx.get(server.url.replace("https", "http"))


@needs_openssl
def test_certificate_files_that_will_not_do_are_told_in_a_sentence(tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    one, other = authority.sign("one"), authority.sign("other")
    wrong = tmp_path / "text.pem"
    wrong.write_text("no certificate")
    for certificate, key, words in (
        (one.certificate, other.private_key, "belong together"),
        (wrong, one.private_key, "belong together"),
        (tmp_path / "none.pem", one.private_key, "none.pem: no such file"),
    ):
        with pytest.raises(CertificateError, match=words) as refused:
            read_certificate(certificate, key)
        assert "\n" not in str(refused.value)
