"""Ctrl-C and SIGTERM end service and demo within three seconds, whoever is still connected; alerts outlive it."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from live import COMPILE_S, fly, get, service_in, until, until_last
from loopback import free_endpoint

from wingwatch.service.service import Service
from wingwatch.simulation import demo_fleet, simulate

LONGEST_END_S = 3.0
EXIT_AFTER_S = 20.0


class Running:
    """A command in a process of its own."""

    def __init__(self, *arguments: object, **environment: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "wingwatch.cli.main", *map(str, arguments), "--json"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1", **environment},
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        assert line, self.process.communicate()[1]
        self.address = json.loads(line)
        self.url = str(self.address["url"])

    def wait_ready(self) -> None:
        until(lambda: httpx.get(f"{self.url}/health/ready", timeout=10.0).status_code == 200, COMPILE_S)

    def end(self, number: signal.Signals) -> tuple[int, float, str]:
        """Exit code, seconds it took, standard error."""
        began = time.monotonic()
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=EXIT_AFTER_S)
        assert out == ""  # the one JSON line was all
        return self.process.returncode, time.monotonic() - began, err


@pytest.fixture
def processes() -> Iterator[list[Running]]:
    started: list[Running] = []
    yield started
    for running in started:
        if running.process.poll() is None:
            running.process.kill()
            running.process.communicate()


def open_stream(url: str) -> socket.socket:
    """An event stream whose head has been read and which stays open."""
    host, port = url.removeprefix("http://").split(":")
    connection = socket.create_connection((host, int(port)), timeout=10.0)
    connection.sendall(b"GET /v1/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    assert connection.recv(12) == b"HTTP/1.1 200"
    return connection


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("command", ["serve", "demo"])
def test_an_end_is_an_end_with_a_stream_open(
    tmp_path: Path, processes: list[Running], command: str, number: signal.Signals
) -> None:
    """The demo's database is its own and fresh as well; that of a service in the same folder stays."""
    if command == "demo":
        (tmp_path / "demo.db").write_bytes(b"left over from a demo that was killed")
        (tmp_path / "wingwatch.db").write_bytes(b"not the demo's")
    running = Running(command, "--port", 0, "--listen", "tcp/127.0.0.1:0", "--data", tmp_path)
    processes.append(running)
    if command == "demo":
        assert httpx.get(f"{running.url}/v1/alerts", timeout=10.0).json()["items"] == []
    running.wait_ready()
    with open_stream(running.url), httpx.Client() as browser:
        assert browser.get(f"{running.url}/v1/status").status_code == 200  # stays connected
        if command == "demo":
            names = {"healthy", "icing", "elevator"}
            until(
                lambda: (
                    names == {v["vehicle"] for v in browser.get(f"{running.url}/v1/vehicles").json()["items"]}
                )
            )
        code, took_s, err = running.end(number)
    assert code == 0
    assert took_s < LONGEST_END_S
    assert "Traceback" not in err
    if command == "demo":
        assert (tmp_path / "wingwatch.db").read_bytes() == b"not the demo's"
        assert (tmp_path / "demo.db").read_bytes().startswith(b"SQLite format 3")


@pytest.mark.parametrize("command", ["serve", "demo"])
def test_a_fresh_machine_answers_at_once_and_can_be_ended_while_it_compiles(
    tmp_path: Path, processes: list[Running], command: str
) -> None:
    """Nothing is compiled in the process that answers, and no process outlives it."""
    began = time.monotonic()
    arguments = (command, "--port", 0, "--listen", free_endpoint(), "--data", tmp_path)
    running = Running(*arguments, NUMBA_CACHE_DIR=str(tmp_path / "compiled"))
    processes.append(running)
    assert httpx.get(running.url, timeout=10.0).status_code == 200

    def compilation() -> dict[str, Any]:
        kernels = httpx.get(f"{running.url}/v1/status", timeout=10.0).json()["kernels"]
        return kernels or {"text": "", "parts": []}

    until(lambda: any(part["state"] == "compiling" for part in compilation()["parts"]))
    progress = compilation()
    assert "are being compiled" in progress["text"]
    assert progress["remaining_s"] > 0.0
    ready = httpx.get(f"{running.url}/health/ready", timeout=10.0)
    assert ready.status_code == 503
    assert "are being compiled" in ready.json()["checks"]["estimators"]
    asked = time.monotonic()
    assert httpx.get(f"{running.url}/v1/status", timeout=10.0).status_code == 200
    assert time.monotonic() - asked < 2.0
    assert asked - began < COMPILE_S
    children = [int(number) for number in children_of(running.process.pid)]
    assert children
    code, took_s, err = running.end(signal.SIGINT)
    assert code == 0
    assert took_s < LONGEST_END_S
    assert "Traceback" not in err
    until(lambda: not any(Path(f"/proc/{child}").exists() for child in children))


def children_of(process: int) -> list[str]:
    """Processes that a process has started and that still run."""
    return [
        number
        for thread in Path(f"/proc/{process}/task").iterdir()
        for number in (thread / "children").read_text().split()
    ]


def settled_alerts(service: Service) -> list[dict[str, Any]]:
    """The alerts when they have stood still for half a second: news of one is shown once it is committed."""
    seen: list[dict[str, Any]] = []
    since_s = time.monotonic()

    def stand_still() -> bool:
        nonlocal seen, since_s
        now = get(service, "/v1/alerts")["items"]
        if now != seen:
            seen, since_s = now, time.monotonic()
        return time.monotonic() - since_s > 0.5

    until(stand_still)
    return seen


def test_alerts_what_was_learned_and_history_outlive_the_service(tmp_path: Path) -> None:
    block = simulate(demo_fleet()[1], 120.0)
    with service_in(tmp_path) as (service, endpoint):
        fly(endpoint, "icing", block)
        until_last(service, "icing", block)
        until(lambda: bool(get(service, "/v1/vehicles/icing/derivatives/history?names=m_w")["items"]))
        before = settled_alerts(service)
        assert len(before) == 1
    with service_in(tmp_path) as (service, _endpoint):
        assert get(service, "/v1/alerts")["items"] == before
        act = f"{service.url}/v1/alerts/{before[0]['id']}/acknowledge"
        assert httpx.post(act, json={"who": "a tester"}, timeout=10.0).status_code == 200
    with service_in(tmp_path) as (service, _endpoint):
        (alert,) = get(service, "/v1/alerts")["items"]
        assert alert["state"] == "acknowledged"
        assert "a tester" in alert["notes"][0]
