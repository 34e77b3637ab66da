"""What a scrape of ``/metrics`` costs, by the number of vehicles: its time, and what taking samples in waits for it.

A fleet with a monitor for each vehicle stands behind the application in one process; ten samples a message, sixteen
messages at a time as the service takes them in, without a pause between, so the lock is held nearly always. Another
thread scrapes. Both are timed with the other at rest and with the other at work; times are of a machine that does both,
and ``/health/live`` says what any answer takes on it.

Run: python benchmarks/metrics.py [--vehicles 10 1000] [--scrapes 50]
"""

import argparse
import sys
import threading
import time
from collections.abc import Callable, Sequence
from itertools import cycle

import httpx
import numpy as np
from saving import run_benchmark

from wingwatch.aircraft import load_aircraft
from wingwatch.api import HttpServer, create_app, listen
from wingwatch.monitor import FleetMonitor
from wingwatch.simulation import Scenario, doublet_schedule, simulate
from wingwatch.telemetry import (
    PROTOBUF,
    AircraftMessage,
    InboundMessage,
    SampleBlock,
    encode_aircraft,
    encode_sensors,
)

A_MESSAGE, TOGETHER = 10, 16
SECONDS = 40.0
FIRST_MESSAGES = 11
"""Messages a vehicle before anything is timed: two seconds and a little, so that each has a solution."""


class Flow:
    """Messages of n vehicles in turns, the same flight by all of them."""

    def __init__(self, vehicles: int) -> None:
        aircraft = load_aircraft("aerosonde")
        assert aircraft.envelope is not None
        doublets = doublet_schedule(aircraft, aircraft.envelope.cruise)
        self._flight = simulate(Scenario(aircraft, manoeuvres=(doublets,), seed=1), SECONDS).values
        self._numbers = cycle(range(vehicles))
        self._vehicles = vehicles
        self._sent = 0
        self.fleet = FleetMonitor(lambda _: aircraft, time.monotonic, lambda: "a1")
        for k in range(vehicles):
            announced = encode_aircraft(AircraftMessage(aircraft="aerosonde"))
            self.fleet.receive("default", f"uav{k}", "aircraft", announced, PROTOBUF)
        for _ in range(-(-FIRST_MESSAGES * vehicles // TOGETHER)):
            self.take_in()

    def take_in(self) -> float:
        """The next messages; how long that took, s, without their making."""
        messages = [self._message() for _ in range(TOGETHER)]
        began_s = time.perf_counter()
        self.fleet.receive_all(messages)
        return time.perf_counter() - began_s

    def _message(self) -> InboundMessage:
        turn, vehicle = self._sent // self._vehicles, next(self._numbers)
        self._sent += 1
        rows = self._flight[np.arange(A_MESSAGE) + turn * A_MESSAGE % (len(self._flight) - A_MESSAGE)].copy()
        rows[:, 0] = 0.02 * (turn * A_MESSAGE + np.arange(A_MESSAGE))
        payload = encode_sensors(turn, SampleBlock(rows), PROTOBUF, stream=1)
        return InboundMessage("default", f"uav{vehicle}", "sensors", payload, PROTOBUF, time.monotonic())


def percentiles(times_s: Sequence[float]) -> str:
    """Median, 99 % and longest, ms."""
    median, late, longest = 1e3 * np.percentile(times_s, (50, 99, 100))
    return f"{median:8.1f} {late:8.1f} {longest:8.1f}"


def timed(scrape: Callable[[], float], times: int) -> list[float]:
    """So many scrapes, ten a second: ten to a hundred and fifty times as often as Prometheus asks."""
    found = []
    for _ in range(times):
        found.append(scrape())
        time.sleep(0.1)
    return found


def measure(vehicles: int, scrapes: int) -> None:
    """Print a line for each of the two, at rest and at work."""
    flow = Flow(vehicles)
    app = create_app(flow.fleet, dict, None, "0")
    with HttpServer(app, listen("127.0.0.1", 0)) as server, httpx.Client(base_url=server.url) as client:
        size = 0

        def bare() -> float:
            began_s = time.perf_counter()
            client.get("/health/live").raise_for_status()
            return time.perf_counter() - began_s

        def scrape() -> float:
            nonlocal size
            began_s = time.perf_counter()
            size = len(client.get("/metrics").raise_for_status().content)
            return time.perf_counter() - began_s

        timed(scrape, 3)
        alone = [flow.take_in() for _ in range(200)]
        nothing = timed(bare, scrapes)
        began_s = time.process_time()
        at_rest = timed(scrape, scrapes)
        scrape_ms = 1e3 * (time.process_time() - began_s) / scrapes
        ended, busy = threading.Event(), list[float]()

        def take_in() -> None:
            while not ended.is_set():
                busy.append(flow.take_in())

        thread = threading.Thread(target=take_in)
        thread.start()
        at_work = timed(scrape, scrapes)
        ended.set()
        thread.join()
        began_s = time.thread_time()
        for _ in range(20):
            flow.fleet.figures()
        own_ms = 1e3 * (time.thread_time() - began_s) / 20
    print(
        f"{vehicles} vehicles, {size} bytes; processor time {scrape_ms:.1f} ms a scrape with its client, "
        f"{own_ms:.2f} ms of it the fleet's figures"
    )
    print(f"  /health/live, nothing taken in   {percentiles(nothing)}")
    print(f"  a scrape, nothing taken in       {percentiles(at_rest)}")
    print(f"  a scrape, samples taken in       {percentiles(at_work)}")
    print(f"  sixteen messages, no scrape      {percentiles(alone)}")
    print(f"  sixteen messages, ten scrapes/s  {percentiles(busy)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--vehicles", type=int, nargs="+", default=[10, 1000])
    parser.add_argument("--scrapes", type=int, default=50)
    options = parser.parse_args()
    sys.setswitchinterval(0.0005)  # as the service has it
    print(f"{'ms':>34} {'median':>8} {'99 %':>8} {'longest':>8}")
    for vehicles in options.vehicles:
        measure(vehicles, options.scrapes)


if __name__ == "__main__":
    run_benchmark(main)
