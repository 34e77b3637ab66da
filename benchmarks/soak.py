"""The demo's three vehicles in real time for half an hour, while connections, readers, router and publishers misbehave.

The service, a client of a router, runs in a process of its own as ``wingwatch serve`` runs it; so does the router. In
turns come a flood of connections that say nothing or half a request, readers of events and of a large answer that never
read, a router that ends and starts again, and publishers that do so. All the while a person reads all vehicles and
alerts each second. In the end it is said how much memory the service holds beside what it held after the first part,
which threads are gone, and how often a vehicle was shown ``stale`` though its samples arrived, or ``healthy`` though it
had an alert in force or sent nothing.

Run: python benchmarks/soak.py [--minutes 30] [--seed 0]
"""

import argparse
import socket
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

import httpx
import numpy as np
from loopback import free_endpoint
from saving import run_benchmark
from service_child import Insight, ServiceChild, beside, own_process
from service_process import RATE_HZ, SAMPLES, Flights, RestClient, prepare_kernels, wait_until

from wingwatch.service.settings import ServeSettings
from wingwatch.simulation import demo_fleet
from wingwatch.telemetry import LinkError, ZenohSettings, open_session

PATIENCE_S, LOOK_S = 60.0, 1.0
STRANGER = "127.0.0.2"
"""Whence floods come: the service tells its clients apart by their addresses."""
SILENT, HALF, READERS = 300, 300, 40
"""Connections that say nothing, that say half a request, and that never read their answer."""
HELD_S, ROUTER_GONE_S, PUBLISHER_GONE_S = 8.0, 1.0, 1.0
STALE_S, SETTLED_S = 5.0, 12.0
"""After so long without samples a vehicle is stale; so long after its samples come again it must not be. A client that
has lost its router tries to reach it again every half second, and a lost connection is noticed at once."""
WARM_UP = 0.2
"""Part of the run after which memory must not grow."""
GROWTH, LEAST_MINUTES = 0.05, 10.0
"""By how much it may, and how long a run has to be to say so: the vehicles' windows fill for some minutes."""


def route(endpoint: str, asked: Connection) -> None:
    """A router, until the connection closes."""
    with open_session(ZenohSettings(mode="router", listen=(endpoint,))):
        asked.send(True)
        with suppress(EOFError, ConnectionError):
            asked.recv()


class Router:
    """A router in a process of its own that can be ended and started again; use it in a ``with`` statement."""

    def __init__(self, endpoint: str) -> None:
        self._endpoint, self._stack = endpoint, ExitStack()

    def __enter__(self) -> "Router":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        """Start it and wait for it."""
        connection = self._stack.enter_context(beside(route, self._endpoint))
        if not connection.poll(PATIENCE_S):
            raise TimeoutError("the router does not start")
        connection.recv()

    def stop(self) -> None:
        """End it."""
        self._stack.close()


class Publishers:
    """The vehicles in real time, in a thread; use it in a ``with`` statement.

    Attributes:
        sending_since_s: when the vehicles last began to send, in monotonic seconds; None while they do not.
        silent_since_s: when they last ended.
    """

    def __init__(self, endpoint: str) -> None:
        self._endpoint = endpoint
        self._flights = Flights(demo_fleet(), 1)
        self._end, self._again = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="publishers", daemon=True)
        self.sending_since_s: float | None = None
        self.silent_since_s = time.monotonic()
        self.sent = 0

    def __enter__(self) -> "Publishers":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def restart(self) -> None:
        """End the publishers; they start again soon, with numbers from 0 and another stream."""
        self._again.set()

    def _run(self) -> None:
        while not self._end.is_set():
            with suppress(LinkError):  # the router is away
                self._publish()
            self.sending_since_s, self.silent_since_s = None, time.monotonic()
            self._end.wait(PUBLISHER_GONE_S)
            self._flights.stream, self._flights.number = self._flights.stream + 1, 0

    def _publish(self) -> None:
        with open_session(ZenohSettings.for_vehicle((self._endpoint,))) as session:
            self._again.clear()
            self._flights.announce(session)
            self.sending_since_s = due_s = time.monotonic()
            while not (self._end.is_set() or self._again.is_set()):
                time.sleep(max(0.0, due_s - time.monotonic()))
                self._flights.send(session)
                self.sent += len(self._flights.names)
                due_s = max(due_s + SAMPLES / RATE_HZ, time.monotonic() - 1.0)


@dataclass
class Findings:
    """What was seen.

    Attributes:
        memory: resident bytes by monotonic second.
        threads: names at the warm-up's end, by how often; gone: those that were not there in the end.
        wrong: by vehicle, state and why, how often; unanswered: questions that were not answered within 15 s.
        answers_s: time of each question.
        disturbances: by kind, how often.
    """

    memory: list[tuple[float, int]] = field(default_factory=list)
    threads: Counter[str] = field(default_factory=Counter)
    gone: list[str] = field(default_factory=list)
    wrong: Counter[str] = field(default_factory=Counter)
    unanswered: int = 0
    answers_s: list[float] = field(default_factory=list)
    disturbances: Counter[str] = field(default_factory=Counter)
    alerts: set[str] = field(default_factory=set)
    ready: bool = False
    last: Insight | None = None


class Watcher:
    """A person who reads all vehicles and alerts each second.

    Attributes:
        lost_s: when the service's way to the vehicles was last cut, and restored_s: when it was last given back.
    """

    def __init__(
        self, client: RestClient, publishers: Publishers, findings: Findings, note: Callable[[], None]
    ) -> None:
        self._client, self._publishers, self._findings, self._note = client, publishers, findings, note
        self.lost_s = self.restored_s = time.monotonic()

    def look(self) -> None:
        """Read, and note what is wrong."""
        self._note()
        found, begin_s = self._findings, time.monotonic()
        try:
            vehicles, alerts = self._client.items("/v1/vehicles"), self._client.items("/v1/alerts?limit=500")
        except httpx.HTTPError:
            found.unanswered += 1
            return
        now_s = time.monotonic()
        found.answers_s.append(now_s - begin_s)
        found.alerts |= {alert["id"] for alert in alerts}
        alarmed = {alert["vehicle"] for alert in alerts if alert["state"] != "cleared"}
        since_s = self._publishers.sending_since_s
        settled = since_s is not None and begin_s - max(since_s, self.restored_s) > SETTLED_S
        silent = since_s is None and now_s - self._publishers.silent_since_s > STALE_S + 2.0 * LOOK_S
        for vehicle in vehicles:
            name, state = vehicle["vehicle"], vehicle["state"]
            if state == "stale" and settled and self.lost_s <= self.restored_s:
                found.wrong[f"{name} stale though its samples arrive"] += 1
            if state == "healthy" and name in alarmed:
                found.wrong[f"{name} healthy with an alert in force"] += 1
            if state == "healthy" and silent:
                found.wrong[f"{name} healthy though it sends nothing"] += 1


class Disturber:
    """What goes wrong in turns.

    Args:
        port: of REST.
    """

    def __init__(self, port: int, router: Router, publishers: Publishers, watcher: Watcher) -> None:
        self._port, self._router = port, router
        self._publishers, self._watcher = publishers, watcher
        self.kinds: dict[str, Callable[[], None]] = {
            "connection flood": self._flood,
            "slow readers": self._slow_readers,
            "router restart": self._restart_router,
            "publisher restart": publishers.restart,
        }

    def _flood(self) -> None:
        with self._connections(SILENT), self._connections(HALF) as half:
            for one in half:
                with suppress(OSError):
                    one.sendall(b"GET /v1/vehicles HTTP/1.1\r\nHost: 127.0.0.1\r\nX-")
            self._wait(HELD_S)

    def _slow_readers(self) -> None:
        with self._connections(READERS) as readers:
            for k, one in enumerate(readers):
                path = "/v1/events" if k % 2 else "/openapi.json"
                request = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode()
                with suppress(OSError):
                    one.sendall(request * (1 if k % 2 else 20))
            self._wait(HELD_S)

    def _restart_router(self) -> None:
        self._watcher.lost_s = float("inf")
        self._router.stop()
        self._wait(ROUTER_GONE_S)
        self._router.start()
        self._watcher.lost_s = self._watcher.restored_s = time.monotonic()

    def _wait(self, seconds: float) -> None:
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self._watcher.look()
            time.sleep(LOOK_S)

    @contextmanager
    def _connections(self, number: int) -> Iterator[list[socket.socket]]:
        """So many to REST from a stranger's address; those that are refused are left out."""
        with ExitStack() as stack:
            opened = []
            for _ in range(number):
                with suppress(OSError):
                    one = socket.create_connection(("127.0.0.1", self._port), 2.0, (STRANGER, 0))
                    opened.append(stack.enter_context(one))
            yield opened


def course(minutes: float, seed: int) -> Findings:
    """The whole run."""
    findings, rng = Findings(), np.random.default_rng(seed)
    endpoint = free_endpoint()
    with (
        tempfile.TemporaryDirectory() as folder,
        Router(endpoint) as router,
        own_process(ServeSettings(port=0, connect=(endpoint,), listen=(), data=Path(folder))) as service,
        Publishers(endpoint) as publishers,
    ):
        client = RestClient(service.port)
        begin_s = time.monotonic()
        watcher = Watcher(
            client, publishers, findings, lambda: note(findings, service, begin_s, 60.0 * minutes * WARM_UP)
        )
        if not np.isfinite(wait_until(lambda: len(client.items("/v1/vehicles")) == 3, PATIENCE_S)):
            raise TimeoutError("the vehicles do not arrive")
        disturber = Disturber(service.port, router, publishers, watcher)
        pause_s = min(10.0, 60.0 * minutes / 20.0)
        order: list[str] = []
        while (passed := (time.monotonic() - begin_s) / (60.0 * minutes)) < 1.0:
            if not order:
                order = [str(kind) for kind in rng.permutation(list(disturber.kinds))]
            kind = order.pop()
            disturber.kinds[kind]()
            findings.disturbances[kind] += 1
            until_s = time.monotonic() + pause_s
            while time.monotonic() < until_s:
                watcher.look()
                time.sleep(LOOK_S)
            print(f"\r{60.0 * minutes * passed:.0f} s", end="", file=sys.stderr, flush=True)
        wait_until(lambda: client.http.get("/health/ready").status_code == 200, PATIENCE_S)
        findings.ready = client.http.get("/health/ready").status_code == 200
        watcher.look()
    print(file=sys.stderr)
    return findings


def note(findings: Findings, service: ServiceChild, begin_s: float, warm_s: float) -> None:
    """Memory and threads of the service as of now; those of the first time after the warm-up must stay."""
    found = findings.last = service.look()
    findings.memory.append((time.monotonic() - begin_s, found.resident_bytes))
    lasting = Counter(name for name in found.threads if name.startswith("wingwatch-"))
    if not findings.threads and findings.memory[-1][0] >= warm_s:
        findings.threads = lasting
    findings.gone = sorted((findings.threads - lasting).elements())


def growth(findings: Findings, minutes: float) -> tuple[float, float]:
    """Median memory after the warm-up and at the end, MiB, each over a tenth of the readings."""
    times_s, sizes = (np.array(column) for column in zip(*findings.memory, strict=True))
    part = times_s / (60.0 * minutes)
    after = sizes[part >= min(WARM_UP, part.max())][: max(1, len(sizes) // 10)]
    last = sizes[-max(1, len(sizes) // 10) :]
    return float(np.median(after)) / 2**20, float(np.median(last)) / 2**20


def show(findings: Findings, minutes: float) -> bool:
    """Print what was found; whether all of it is as it should be."""
    after, last = growth(findings, minutes)
    kinds = ", ".join(f"{kind} {n}" for kind, n in sorted(findings.disturbances.items()))
    p50, p99 = np.percentile(1e3 * np.array(findings.answers_s), [50.0, 99.0])
    print(f"{minutes:g} minutes, 3 vehicles at {RATE_HZ:g} Hz; disturbances: {kinds}")
    print(f"memory after {100.0 * WARM_UP:.0f} % of the run: {after:.1f} MiB, in the end: {last:.1f} MiB "
          f"({100.0 * (last / after - 1.0):+.1f} %)")  # fmt: skip
    print(f"threads: {findings.threads.total()}, lost: {', '.join(findings.gone) or 'none'}")
    print(f"questions answered: {len(findings.answers_s)} (p50 {p50:.0f} ms, p99 {p99:.0f} ms), not: "
          f"{findings.unanswered}")  # fmt: skip
    print(f"vehicles in a wrong state: {sum(findings.wrong.values())}, alerts: {len(findings.alerts)}, ready in the "
          f"end: {'yes' if findings.ready else 'no'}")  # fmt: skip
    for text, times in findings.wrong.items():
        print(f"    WRONG: {text}, {times} times")
    if findings.last is not None:
        counters = {
            f"{part}: {name}": n for part, c in findings.last.counters.items() for name, n in c.items() if n
        }
        print("counters: " + ", ".join(f"{name} {n}" for name, n in counters.items()))
    flat = minutes < LEAST_MINUTES or last <= (1.0 + GROWTH) * after
    return flat and findings.ready and not (findings.wrong or findings.gone)


def main() -> None:
    parser = argparse.ArgumentParser(description="Half an hour of disturbances.")
    parser.add_argument("--minutes", type=float, default=30.0, help="0.5 to 1440")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    if not 0.5 <= arguments.minutes <= 1440.0:
        parser.error(f"--minutes is {arguments.minutes}; give 0.5 to 1440")
    prepare_kernels()
    sys.exit(not show(course(arguments.minutes, arguments.seed), arguments.minutes))


if __name__ == "__main__":
    run_benchmark(main)
