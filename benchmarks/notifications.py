"""How soon people hear of an alert: from its commit until a STATUSTEXT and a webhook have arrived, on loopback.

A whole service with its database on the disk runs in this process; alerts of as many vehicles are handed to its
ledger one at a time, at drawn moments, as a vehicle's monitor hands them over. A commit counts when the database's
method has returned, a text when all of its chunks have arrived, a webhook when its body has; ``announced`` is when the
monitor hands the alert to the channels, which waits for the samples in hand. With ``--vehicles`` so many simulated
aircraft are watched at 50 Hz meanwhile, which takes the interpreter and the disk as a fleet does.

Run: python benchmarks/notifications.py [--alerts 50] [--vehicles 0] [--seed 1]
"""

import argparse
import http.server
import json
import random
import socket
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from loopback import free_endpoint
from pymavlink.dialects.v20 import common
from rich.console import Console
from rich.table import Table
from saving import run_benchmark

from wingwatch.api import KernelsView
from wingwatch.baselines import AlertRecord, Database, Lease
from wingwatch.cli.simulated_fleet import SimulatedFleet
from wingwatch.monitor import AlertState, AlertView
from wingwatch.service.kernel_steps import AFTER_DEMO, DEMO
from wingwatch.service.kernels import KernelCompiler
from wingwatch.service.notifications import Notifications
from wingwatch.service.notify_settings import NotifyTable
from wingwatch.service.service import Service, running_service
from wingwatch.service.settings import ServeSettings
from wingwatch.simulation import demo_fleet

PATIENCE_S = 60.0
LEAST_S, MOST_S = 0.05, 0.25
"""Between two alerts."""
SETTLE_S = 20.0
"""Of flight before the first alert, where aircraft fly: both estimators of each are at work then."""


class Times:
    """When each alert was committed and received, monotonic seconds."""

    def __init__(self) -> None:
        self.committed: dict[str, float] = {}
        self.received: dict[str, dict[str, float]] = {"announced": {}, "STATUSTEXT": {}, "webhook": {}}
        self._news = threading.Condition()

    def note(self, way: str, vehicle: str) -> None:
        """The alert of a vehicle has arrived."""
        with self._news:
            self.received[way].setdefault(vehicle, time.monotonic())
            self._news.notify_all()

    def await_all(self, vehicle: str) -> None:
        """Wait until it has arrived on all ways."""
        with self._news:
            if not self._news.wait_for(
                lambda: all(vehicle in got for got in self.received.values()), PATIENCE_S
            ):
                raise SystemExit(f"the alert of {vehicle} has not arrived within {PATIENCE_S:.0f} s")

    def delays_s(self, way: str) -> list[float]:
        """From commit to reception."""
        return [at_s - self.committed[vehicle] for vehicle, at_s in self.received[way].items()]


@contextmanager
def station(times: Times) -> Iterator[int]:
    """A ground control station; gives its port."""
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.bind(("127.0.0.1", 0))
    reader = common.MAVLink(None)

    def read() -> None:
        texts: dict[int, str] = {}
        while True:
            try:
                packet = opened.recv(1000)
            except OSError:
                return
            for message in reader.parse_buffer(packet) or ():
                if message.get_type() == "STATUSTEXT":
                    texts[message.id] = texts.get(message.id, "") + message.text
                    if len(message.text) < 50:
                        times.note("STATUSTEXT", texts.pop(message.id).split()[1].rstrip(":"))

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    yield opened.getsockname()[1]
    opened.close()


@contextmanager
def hook(times: Times) -> Iterator[int]:
    """A webhook's receiver; gives its port."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            times.note("webhook", body["groupLabels"]["vehicle"])
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server.server_port
    server.shutdown()
    server.server_close()


@contextmanager
def noted(times: Times) -> Iterator[None]:
    """The database notes when it has an alert, the notifications when they hear of it."""
    save_plainly, hear_plainly = Database.save_alert, Notifications.hear

    def save(self: Database, alert: AlertRecord, lease: Lease | None = None) -> None:
        save_plainly(self, alert, lease)
        times.committed.setdefault(alert.vehicle, time.monotonic())

    def hear(self: Notifications, news: Callable[[], Any]) -> None:
        times.note("announced", news().vehicle)
        hear_plainly(self, news)

    Database.save_alert, Notifications.hear = save, hear  # type: ignore[method-assign]
    yield
    Database.save_alert, Notifications.hear = save_plainly, hear_plainly  # type: ignore[method-assign]


class Idle:
    """The preparation of a service that takes no samples in."""

    def __init__(self) -> None:
        self._end = threading.Event()

    def prepare(self) -> bool:
        """Nothing, until the end."""
        self._end.wait()
        return False

    def view(self) -> KernelsView | None:
        """There is nothing to say."""
        return None

    def stop(self) -> None:
        """The end."""
        self._end.set()


def alert_of(vehicle: str) -> AlertView:
    return AlertView(
        id=f"id-{vehicle}", fleet="default", vehicle=vehicle, kind="icing", cause="icing", level="warning",
        state=AlertState.ACTIVE, raised_s=80.5, cleared_s=None, size=0.16, size_standard_error=0.02, probability=0.97,
        basis="a-priori", text="Icing of severity 0.16 ± 0.02 (Twin Otter scale), since about 60 s. Leave the icing.",
        evidence=(),
    )  # fmt: skip


def raise_alerts(service: Service, times: Times, count: int, seed: int) -> None:
    draw, fleet = random.Random(seed), service.monitor
    for k in range(count):
        time.sleep(draw.uniform(LEAST_S, MOST_S))
        with fleet._lock:
            fleet._alerts.keep(alert_of(f"bench{k}"))
        times.await_all(f"bench{k}")


def measured(count: int, vehicles: int, seed: int) -> Times:
    """All alerts, one after the other."""
    times = Times()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        ports = stack.enter_context(station(times)), stack.enter_context(hook(times))
        stack.enter_context(noted(times))
        table = {
            "statustext": [{"connect": f"udpout:127.0.0.1:{ports[0]}"}],
            "webhook": [{"url": f"http://127.0.0.1:{ports[1]}/"}],
        }
        endpoint = free_endpoint()
        settings = ServeSettings(
            port=0,
            listen=(endpoint,),
            data=folder,
            notify=NotifyTable.model_validate(table),
            diagnose_alerts=False,
        )
        service = stack.enter_context(
            running_service(settings, preparation=KernelCompiler(DEMO, AFTER_DEMO) if vehicles else Idle())
        )
        if vehicles:
            while not service.ingest.wait(1.0):
                print(service.ingest.problem or "", file=sys.stderr)
            template = demo_fleet()[0]
            flown = [replace(template, seed=k + 1, name=f"uav{k}") for k in range(vehicles)]
            stack.enter_context(SimulatedFleet(flown, endpoint))
            time.sleep(SETTLE_S)
        raise_alerts(service, times, count, seed)
        if vehicles:
            accepted = service.monitor.figures().counts.get("accepted", 0)
            print(f"{accepted} samples were taken in meanwhile", file=sys.stderr)
    return times


def rows(times: Times) -> Mapping[str, Sequence[float]]:
    """By way in ms: median, nine in ten within, longest."""
    found = {}
    for way in times.received:
        delays = sorted(1000.0 * delay_s for delay_s in times.delays_s(way))
        found[way] = statistics.median(delays), delays[-(-9 * len(delays) // 10) - 1], delays[-1]
    return found


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--alerts", type=int, default=50)
    parser.add_argument(
        "--vehicles", type=int, default=0, help="simulated aircraft that are watched meanwhile"
    )
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(argv)
    if not 1 <= options.alerts <= 1000:
        parser.error(f"--alerts is {options.alerts}; give 1 to 1000")
    if not 0 <= options.vehicles <= 200:
        parser.error(f"--vehicles is {options.vehicles}; give 0 to 200")
    times = measured(options.alerts, options.vehicles, options.seed)
    title = f"{options.alerts} alerts, {options.vehicles} aircraft watched: ms from commit to reception"
    table = Table("way", "median", "nine in ten within", "longest", title=title)
    for way, figures in rows(times).items():
        table.add_row(way, *(f"{figure:.1f}" for figure in figures))
    Console().print(table)
    return 0


if __name__ == "__main__":
    run_benchmark(main)
