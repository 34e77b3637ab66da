"""Webhooks against real HTTP servers on loopback: signed, tried again, given up, never led elsewhere."""

import base64
import hashlib
import hmac
import http.server
import re
import ssl
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from certificates import Authority, needs_openssl
from receivers import ICING, Bench, http_receiver

from wingwatch.notifications import (
    Channel,
    ChannelError,
    Clocks,
    Dispatcher,
    NotDeliveredError,
    Notice,
    Outbox,
    Patience,
    RefusedError,
    Selection,
    WebhookChannel,
    WebhookSettings,
)
from wingwatch.service.loops import Loop

SECRET = b"a secret of theirs and ours"


def webhook(url: str, **settings: Any) -> WebhookChannel:
    given = {
        "secret": SECRET,
        "receiver": "ops",
        "external_url": "http://wing",
        "timeout_s": 20.0,
        **settings,
    }
    return WebhookChannel(WebhookSettings(url, **given), lambda: 1_700_000_000.4)


@pytest.fixture
def notice(tmp_path: Path) -> Notice:
    bench = Bench(tmp_path / "unused.json")
    bench.hear()
    return bench.channel.taken[0]


@contextmanager
def delivering(channel: Channel, path: Path) -> Iterator[Dispatcher]:
    """A dispatcher in a thread of its own, whose waits are short."""
    dispatcher = Dispatcher(
        "hook", channel, Outbox(path), Selection(), Patience(first_s=0.01, most_s=0.02), Clocks()
    )
    loop = Loop("test", "the loop under test", dispatcher.run, dispatcher.wake)
    loop.start()
    try:
        yield dispatcher
    finally:
        dispatcher.stop()
        loop.join(20.0)


def until_said(dispatcher: Dispatcher, count: int) -> None:
    deadline = time.monotonic() + 20.0
    while dispatcher.counts["delivered"] < count:
        assert time.monotonic() < deadline, dispatcher.counts
        time.sleep(0.005)


def test_a_receiver_that_fails_twice_gets_everything_once_and_in_order(tmp_path: Path) -> None:
    with (
        http_receiver(503, 500, 200) as receiver,
        delivering(webhook(receiver.url), tmp_path / "o") as dispatcher,
    ):
        dispatcher.hear(lambda: ICING)
        dispatcher.hear(lambda: replace(ICING, level="critical"))
        until_said(dispatcher, 2)
        keys = [headers["Idempotency-Key"] for headers, _ in receiver.got]
        assert [a["alerts"][0]["annotations"]["steps"] for a in receiver.alerts()] == ["raised"] * 3 + [
            "level"
        ]
        assert keys[0] == keys[1] == keys[2] != keys[3]
        assert dispatcher.counts == {"delivered": 2, "retried": 2, "refused": 0, "expired": 0, "dropped": 0}


def test_the_signature_is_of_timestamp_and_body(notice: Notice) -> None:
    with http_receiver() as receiver:
        webhook(receiver.url).send(notice)
        webhook(receiver.url, secret=b"").send(notice)
    (headers, body), (unsigned, _) = receiver.got
    signed = headers["X-Wingwatch-Timestamp"].encode() + b"." + body
    assert (
        headers["X-Wingwatch-Signature"] == "sha256=" + hmac.new(SECRET, signed, hashlib.sha256).hexdigest()
    )
    assert headers["X-Wingwatch-Timestamp"] == "1700000000"
    assert headers["Content-Type"] == "application/json"
    assert not [name for name in unsigned if name.startswith("X-Wingwatch")]


def test_the_documents_own_example_verifies_a_call_once(notice: Notice) -> None:
    text = (Path(__file__).parents[2] / "docs" / "security.md").read_text()
    (example,) = re.findall(r"```python\n(import hashlib, hmac, time\n.*?)```", text, re.DOTALL)
    names: dict[str, Any] = {}
    exec(example, names)
    with http_receiver() as receiver:
        settings = WebhookSettings(receiver.url, SECRET, "ops", "http://wing")
        for clock in (time.time, time.time, lambda: time.time() - 400.0):
            WebhookChannel(settings, clock).send(notice)
    seen: set[str] = set()
    first, again, late = receiver.got
    headers, body = first
    assert not names["is_ours"](headers, body + b" ", SECRET, seen)
    assert not names["is_ours"](headers, body, b"another", seen)
    assert not names["is_ours"](*late, SECRET, seen)
    assert names["is_ours"](headers, body, SECRET, seen)
    assert not names["is_ours"](*again, SECRET, seen)


@pytest.mark.parametrize("status", [400, 401, 404, 410, 422])
def test_a_refusal_is_for_ever(notice: Notice, status: int) -> None:
    with http_receiver(status) as receiver, pytest.raises(RefusedError, match=f"answered {status}"):
        webhook(receiver.url).send(notice)


def retry_after(handler: http.server.BaseHTTPRequestHandler) -> None:
    handler.send_response(429)
    handler.send_header("Retry-After", "7")
    handler.end_headers()


@pytest.mark.parametrize(("answer", "wish"), [(408, None), (500, None), (503, None), (retry_after, 7.0)])
def test_other_failures_are_for_now(notice: Notice, answer: Any, wish: float | None) -> None:
    with http_receiver(answer) as receiver, pytest.raises(NotDeliveredError) as failure:
        webhook(receiver.url).send(notice)
    assert failure.value.again_after_s == wish


def test_a_redirect_is_not_followed(notice: Notice) -> None:
    with http_receiver() as elsewhere:

        def lead_away(handler: http.server.BaseHTTPRequestHandler) -> None:
            handler.send_response(307)
            handler.send_header("Location", elsewhere.url)
            handler.end_headers()

        with http_receiver(lead_away) as receiver, pytest.raises(RefusedError, match="a redirect"):
            webhook(receiver.url).send(notice)
        assert elsewhere.got == []


def hang(_: http.server.BaseHTTPRequestHandler) -> None:
    threading.Event().wait(5.0)


def drip(handler: http.server.BaseHTTPRequestHandler) -> None:
    """A byte of a header that never ends, again and again: each read is quick."""
    handler.wfile.write(b"HTTP/1.1 200 OK\r\nX-Slow: ")
    for _ in range(500):
        handler.wfile.write(b"a")
        handler.wfile.flush()
        time.sleep(0.01)


def nonsense(handler: http.server.BaseHTTPRequestHandler) -> None:
    handler.wfile.write(b"SSH-2.0-OpenSSH_9.6\r\n")


@pytest.mark.parametrize(
    ("answer", "why"),
    [(hang, "no answer in time"), (drip, "no answer in time"), (nonsense, "no answer that HTTP")],
)
def test_a_receiver_that_hangs_drips_or_speaks_something_else_is_left(
    notice: Notice, answer: Any, why: str
) -> None:
    began_s = time.monotonic()
    with http_receiver(answer) as receiver, pytest.raises(NotDeliveredError, match=why):
        webhook(receiver.url, timeout_s=0.2).send(notice)
    assert time.monotonic() - began_s < 4.0


def test_nobody_there_is_said_without_the_address(notice: Notice) -> None:
    with http_receiver() as receiver:
        url = receiver.url
    channel = webhook(f"{url}/T0KEN?key=T0KEN".replace("://", "://ann:T0KEN@"))
    with pytest.raises(NotDeliveredError, match=r"^connection refused$"):
        channel.send(notice)
    assert channel.place == "http://127.0.0.1"
    assert "T0KEN" not in repr(channel._settings)


def test_a_user_in_the_address_is_sent_as_one(notice: Notice) -> None:
    with http_receiver() as receiver:
        webhook(receiver.url.replace("://", "://ann:p%40ss@") + "/a?b=c").send(notice)
    headers, _ = receiver.got[0]
    assert base64.b64decode(headers["Authorization"].removeprefix("Basic ")) == b"ann:p@ss"


@pytest.mark.parametrize(
    "url",
    [
        "ftp://host/T0KEN",
        "T0KEN",
        "https:///T0KEN",
        "http://host:port/T0KEN",
        "https://host/T0 KEN",
        "file:///T0KEN",
    ],
)
def test_an_address_of_another_form_is_refused_without_showing_it(url: str) -> None:
    with pytest.raises(ChannelError) as failure:
        webhook(url)
    assert "T0KEN" not in str(failure.value)


@needs_openssl
def test_certificates_are_verified(notice: Notice, tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    made = authority.sign("receiver")
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(made.certificate, made.private_key)
    with http_receiver(context=context) as receiver:
        with pytest.raises(NotDeliveredError, match="its certificate is not accepted"):
            webhook(receiver.url).send(notice)
        webhook(receiver.url, authority=authority.certificate).send(notice)
        assert len(receiver.got) == 1
    with pytest.raises(ChannelError, match="no certificates"):
        webhook("https://localhost", authority=made.private_key)
