"""Connections: however many are silent or slow, somebody else is answered; and none stays for ever."""

import contextlib
import socket
import threading
import time
from collections.abc import Generator
from functools import partial
from http import HTTPStatus
from http.client import HTTPConnection

import pytest
from api_fakes import FakeMonitor, alert

from wingwatch.api import Connections, HttpServer, create_app, guards, listen


@contextlib.contextmanager
def serving(limits: Connections, monitor: FakeMonitor | None = None) -> Generator[HttpServer]:
    app = create_app(monitor or FakeMonitor(), dict, None, "1")
    with HttpServer(app, listen("127.0.0.1", 0), connections=limits) as server:
        yield server


@contextlib.contextmanager
def connected(server: HttpServer, count: int, text: bytes = b"") -> Generator[list[socket.socket]]:
    with contextlib.ExitStack() as stack:
        opened = []
        for _ in range(count):
            one = stack.enter_context(socket.create_connection(("127.0.0.1", server.port), timeout=5.0))
            one.sendall(text)
            opened.append(one)
        yield opened


ANSWER_S = 8.0
"""On a busy machine, and before the 10 s after which silent connections are ended anyway."""


def alive(server: HttpServer) -> bool:
    """Whether the service says so in time; by a plain client, since httpx first reads the machine's certificates."""
    asking = HTTPConnection("127.0.0.1", server.port, timeout=ANSWER_S)
    with contextlib.closing(asking):
        asking.request("GET", "/health/live")
        return asking.getresponse().status == HTTPStatus.OK


def has_ended(connection: socket.socket) -> bool:
    try:
        return connection.recv(65_536) == b""
    except ConnectionResetError:
        return True


BEGUN = {
    "silent": b"",
    "half a head": b"GET /v1/status HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ",
    "half a body": b"POST /v1/alerts/a1/clear HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 50\r\n\r\n{",
}


@pytest.mark.parametrize("text", BEGUN.values(), ids=BEGUN)
def test_512_connections_that_wait_do_not_take_health_down(text: bytes) -> None:
    with serving(Connections()) as server, connected(server, 600, text):
        for _ in range(5):
            assert alive(server)
        assert server.counts["gave_way"] >= 88
        assert server.counts["refused"] == 0


def test_who_has_waited_longest_gives_way() -> None:
    with serving(Connections(most=3)) as server, connected(server, 3) as held:
        time.sleep(0.1)
        assert alive(server)
        assert has_ended(held[0])
        held[2].sendall(b"GET /health/live HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert held[2].recv(12) == b"HTTP/1.1 200"


def test_where_all_are_being_answered_a_further_one_is_refused() -> None:
    stream = b"GET /v1/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    with serving(Connections(most=2)) as server, connected(server, 2, stream) as held:
        for one in held:
            assert one.recv(12) == b"HTTP/1.1 200"
        with connected(server, 1) as (late,):
            assert has_ended(late)
        assert server.counts["refused"] == 1


@pytest.mark.parametrize("name", ["silent", "half a head"])
def test_a_head_has_a_time_limit(name: str) -> None:
    with serving(Connections(head_s=0.3)) as server, connected(server, 1, BEGUN[name]) as (one,):
        assert has_ended(one)
        assert server.counts["late_head"] == 1


def test_the_head_of_a_later_request_has_one_too() -> None:
    text = b"GET /health/live HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    with serving(Connections(head_s=0.5)) as server, connected(server, 1, text) as (one,):
        answer = b""
        while b'"live"' not in answer:
            answer += one.recv(65_536)
        one.sendall(b"GET")
        assert has_ended(one)
        assert server.counts["late_head"] == 1


def test_a_body_has_a_time_limit_and_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guards, "BodySize", partial(guards.BodySize, most_s=0.3))
    monitor = FakeMonitor()
    monitor.raised = [alert(1)]
    with serving(Connections(), monitor) as server, connected(server, 1, BEGUN["half a body"]) as (one,):
        assert one.recv(65_536).startswith(b"HTTP/1.1 408")
    assert monitor.raised == [alert(1)]


def test_a_reader_that_takes_nothing_is_given_up_one_that_is_slow_is_not() -> None:
    monitor = FakeMonitor()
    text = b"GET /v1/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    over = threading.Event()

    def read_slowly(connection: socket.socket) -> None:
        while not over.is_set() and connection.recv(65_536):
            time.sleep(0.016)  # 4 MB/s: longer than two limits for the whole

    with serving(Connections(stall_s=2.0), monitor) as server, connected(server, 2, text) as (slow, stalled):
        for one in (slow, stalled):
            assert one.recv(12) == b"HTTP/1.1 200"
        slow.settimeout(60.0)  # a busy machine may say nothing for seconds
        reader = threading.Thread(target=read_slowly, args=(slow,))
        reader.start()
        for _ in range(900):
            monitor.tell("derivatives", {"filler": "x" * 20_000})
        deadline = time.monotonic() + 60.0
        while server.counts["stalled_reader"] == 0:
            assert time.monotonic() < deadline
            monitor.tell(
                "derivatives", {"filler": "x" * 20_000}
            )  # of a burst a busy server passes on the newest only
            time.sleep(0.02)
        time.sleep(2.0)
        assert reader.is_alive()
        assert server.counts["stalled_reader"] == 1
        over.set()
        monitor.tell("derivatives", {})
        reader.join()
