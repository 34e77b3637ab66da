"""The port is taken first or refused in a sentence; an end is an end, whoever is still connected."""

import logging
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import httpx
import pytest
from api_fakes import VERSION, FakeMonitor, served, vehicle

from wingwatch.api import AddressError, HttpServer, PortInUse, beyond_loopback, create_app, listen

LONGEST_END_S = 3.0


def raw_stream(port: int) -> socket.socket:
    """An event stream that is open and never read from again."""
    connection = socket.create_connection(("127.0.0.1", port), timeout=5.0)
    connection.sendall(b"GET /v1/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    assert connection.recv(12) == b"HTTP/1.1 200"
    return connection


def test_a_port_in_use_is_told_before_anything_starts() -> None:
    with listen("127.0.0.1", 0) as held:
        port = held.getsockname()[1]
        with pytest.raises(PortInUse, match=f"port {port} on 127.0.0.1 is in use") as refused:
            listen("127.0.0.1", port)
        assert isinstance(refused.value, OSError)
        assert "--port" in str(refused.value)
    listen("127.0.0.1", port).close()


@pytest.mark.parametrize(
    ("host", "port", "words"),
    [
        ("no-such-host.invalid", 8000, "no-such-host.invalid"),
        ("192.0.2.1", 0, "no address of this machine"),
        ("127.0.0.1", 65_536, "65536"),
        ("127.0.0.1", -1, "-1"),
    ],
)
def test_an_address_that_cannot_be_had_is_told_in_a_sentence(host: str, port: int, words: str) -> None:
    with pytest.raises(AddressError, match=words) as refused:
        listen(host, port)
    assert "\n" not in str(refused.value)


def test_what_others_can_reach_is_known() -> None:
    for host, others in (("127.0.0.1", False), ("0.0.0.0", True)):
        with listen(host, 0) as held:
            assert beyond_loopback(held) is others


def test_the_server_knows_whether_it_runs() -> None:
    app = create_app(FakeMonitor(), dict, None, VERSION)
    server = HttpServer(app, listen("127.0.0.1", 0))
    assert server.problem == "the HTTP server is not running."
    with server:
        assert server.problem is None
        assert httpx.get(f"{server.url}/health/live").json()["version"] == VERSION
    assert server.problem == "the HTTP server is not running."
    with pytest.raises(httpx.ConnectError):
        httpx.get(f"{server.url}/health/live")


@pytest.mark.skipif(not socket.has_ipv6, reason="this Python has no IPv6")
def test_ipv6_loopback_is_served() -> None:
    try:
        held = listen("::1", 0)
    except AddressError:
        pytest.skip("this machine has no IPv6 loopback address")
    with HttpServer(create_app(FakeMonitor(), dict, None, VERSION), held) as server:
        assert server.url == f"http://[::1]:{server.port}"
        assert httpx.get(f"{server.url}/health/live").status_code == 200


def test_it_ends_in_time_with_listeners_that_read_and_listeners_that_do_not(
    caplog: pytest.LogCaptureFixture,
) -> None:
    monitor = FakeMonitor()
    with served(monitor) as (server, _):
        stalled = [raw_stream(server.port) for _ in range(3)]
        idle = socket.create_connection(("127.0.0.1", server.port), timeout=5.0)
        half = socket.create_connection(("127.0.0.1", server.port), timeout=5.0)
        half.sendall(b"POST /v1/alerts/a1/clear HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 50\r\n\r\n{")
        ended = threading.Event()
        opened = threading.Event()

        def listener() -> None:
            with httpx.stream("GET", f"{server.url}/v1/events", timeout=10.0) as answer:
                for _ in answer.iter_lines():
                    opened.set()
            ended.set()

        thread = threading.Thread(target=listener)
        thread.start()
        assert opened.wait(5.0)
        for _ in range(900):
            monitor.tell("derivatives", {"filler": "x" * 20_000})
        time.sleep(0.3)
        before = time.monotonic()
        server.stop()
        took = time.monotonic() - before
        thread.join(5.0)
    for connection in (*stalled, idle, half):
        connection.close()
    assert took < LONGEST_END_S
    assert [record for record in caplog.records if record.levelno >= logging.WARNING] == []
    assert ended.is_set(), "the listener that reads must see a proper end of its stream"


def test_an_open_stream_alone_ends_at_once() -> None:
    with served(FakeMonitor()) as (server, client):
        with client.stream("GET", "/v1/events") as answer:
            lines = answer.iter_lines()
            assert next(lines).startswith("retry:")
            before = time.monotonic()
            server.stop()
            rest = list(lines)
        took = time.monotonic() - before
    assert all(not line or line.startswith(":") for line in rest)
    assert took < 1.0  # tick 0.1 s, poll 0.1 s, uvicorn's own two pauses of 0.1 s; the grace is not used up


_PROGRAM = """
import sys
from api_fakes import FakeMonitor
from wingwatch.api import create_app, listen, serve
held = listen("127.0.0.1", 0)
print(held.getsockname()[1], flush=True)
serve(create_app(FakeMonitor(), dict, None, "1"), held)
print("tidied up", flush=True)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_program_in_time_and_lets_it_tidy_up(number: signal.Signals) -> None:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    program = subprocess.Popen(
        [sys.executable, "-c", _PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment
    )
    with program:
        assert program.stdout is not None
        port = int(program.stdout.readline())
        stream = raw_stream(port)
        before = time.monotonic()
        program.send_signal(number)
        out, errors = program.communicate(timeout=20)
        took = time.monotonic() - before
        stream.close()
    assert took < LONGEST_END_S
    assert out.decode().strip() == "tidied up"
    assert errors.decode() == ""
    assert program.returncode == 0


def test_requests_from_many_at_once_are_all_answered() -> None:
    monitor = FakeMonitor()
    monitor.views = [vehicle(f"v{n}") for n in range(50)]
    answers: list[int] = []
    with served(monitor) as (server, _):

        def ask() -> None:
            with httpx.Client(base_url=server.url, verify=False) as client:
                answers.extend(len(client.get("/v1/vehicles").json()["items"]) for _ in range(10))

        threads = [threading.Thread(target=ask) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert answers == [50] * 80
