"""From a sample handed to Zenoh to the derivative that rests on it, over REST: 3 vehicles at 50 Hz, real sessions.

The service runs in this process as ``wingwatch serve`` runs it; vehicles and the client that asks are a process of
their own with one clock for both. Asked is one vehicle, over one kept connection, the next question right after an
answer: a sample that lands just after a question was taken waits for the next, so asking adds up to one answer's time,
and loads the service as no user would. Of the service alone: from a message's arrival to its state being updated.

Run: python benchmarks/latency.py [--seconds S]
"""

import argparse
import multiprocessing
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import httpx
import numpy as np
from loopback import free_endpoint
from saving import run_benchmark

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor import FleetMonitor
from wingwatch.service.service import running_service
from wingwatch.service.settings import ServeSettings
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule
from wingwatch.telemetry import (
    AircraftMessage,
    FlightPublisher,
    InboundMessage,
    SampleBlock,
    ZenohSettings,
    open_session,
)

VEHICLES, RATE_HZ, SETTLE_S = 3, 50.0, 15.0
COMPILE_S, PATIENCE_S = 240.0, 10.0
AT_ONCE = 1e9
"""Rate of a message whose moment has come: the pace is kept here."""


@dataclass(frozen=True, slots=True)
class Course:
    """What the client process found, in seconds.

    Attributes:
        delays: of each message of the vehicle asked, from being handed over to the first answer that rests on it.
        answers: time of each question and its answer.
        unanswered: messages that no answer ever rested on.
    """

    delays: list[float]
    answers: list[float]
    unanswered: int


def timed_receive_all(delays_s: list[float]) -> Callable[[FleetMonitor, Sequence[InboundMessage]], None]:
    """A stand-in that notes how long messages of sensors were inside the service: from their being taken over to the
    state that rests on them."""
    receive_all = FleetMonitor.receive_all

    def timing(self: FleetMonitor, messages: Sequence[InboundMessage]) -> None:
        receive_all(self, messages)
        now_s = time.monotonic()
        delays_s.extend(now_s - m.received_s for m in messages if m.stream == "sensors")

    return timing


def fly(endpoint: str, samples: int, seconds: float, handed: "deque[tuple[float, float]]") -> None:
    """Three vehicles in real time, one after the other within a message's period; notes the first one's messages."""
    aircraft = load_aircraft("aerosonde")
    plain = Scenario(aircraft)
    manoeuvre = doublet_schedule(aircraft, plain.condition)
    simulation = FleetSimulation(
        [Scenario(aircraft, manoeuvres=(manoeuvre,), seed=i) for i in range(VEHICLES)], RATE_HZ
    )
    values = simulation.step(round((SETTLE_S + seconds) * RATE_HZ))
    period_s = samples / RATE_HZ
    with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
        publishers = [
            FlightPublisher(
                session,
                "default",
                f"v{i}",
                AircraftMessage(aircraft="aerosonde"),
                samples_per_message=samples,
            )
            for i in range(VEHICLES)
        ]
        begin_s = time.monotonic()
        for k in range(0, values.shape[1] - samples + 1, samples):
            for i, publisher in enumerate(publishers):
                due_s = begin_s + period_s * (k / samples + i / VEHICLES)
                time.sleep(max(0.0, due_s - time.monotonic()))
                block = SampleBlock(values[i, k : k + samples])
                if i == 0:
                    handed.append((float(block.time_s[-1]), time.monotonic()))
                publisher.publish(block, AT_ONCE)
        time.sleep(PATIENCE_S / 10.0)
        for publisher in publishers:
            publisher.close()


def ask(url: str, endpoint: str, samples: int, seconds: float) -> Course:
    """Fly, and ask for the first vehicle's derivatives all the while."""
    handed: deque[tuple[float, float]] = deque()
    flight = threading.Thread(target=fly, args=(endpoint, samples, seconds, handed), daemon=True)
    waiting: deque[tuple[float, float]] = deque()
    delays: list[float] = []
    answers: list[float] = []
    with httpx.Client(timeout=PATIENCE_S) as client:
        flight.start()
        while flight.is_alive():
            asked_s = time.monotonic()
            reply = client.get(f"{url}/v1/vehicles/v0/derivatives")
            now_s = time.monotonic()
            while handed:
                waiting.append(handed.popleft())
            if reply.status_code == 404:
                continue
            reply.raise_for_status()
            current_s = reply.json()["time_s"]
            if current_s is not None and current_s >= SETTLE_S:
                answers.append(now_s - asked_s)
            while waiting and current_s is not None and waiting[0][0] <= current_s:
                stamp_s, put_s = waiting.popleft()
                if stamp_s >= SETTLE_S:
                    delays.append(now_s - put_s)
    return Course(delays, answers, len(waiting) + len(handed))


def course(samples: int, seconds: float) -> tuple[Course, list[float]]:
    """One run with messages of so many samples against a service of its own."""
    inside: list[float] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch.object(FleetMonitor, "receive_all", timed_receive_all(inside)),
    ):
        endpoint = free_endpoint()
        settings = ServeSettings(port=0, listen=(endpoint,), data=Path(folder))
        with running_service(settings) as service:
            if not service.ingest.wait(COMPILE_S):
                raise TimeoutError(f"the kernels were not compiled within {COMPILE_S:g} s; run it again")
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                found = pool.apply(ask, (service.url, endpoint, samples, seconds))
    settled = round(SETTLE_S * RATE_HZ) // samples * VEHICLES
    return found, inside[settled:]


def _row(label: str, delays_s: Sequence[float]) -> None:
    milliseconds = 1e3 * np.array(delays_s)
    p50, p99 = np.percentile(milliseconds, [50.0, 99.0])
    print(f"  {label:<52}{p50:10.1f}{p99:10.1f}{milliseconds.max():10.1f}{milliseconds.size:10d}")


def main() -> None:
    parser = argparse.ArgumentParser(description="Latency from a sample to its derivative over REST.")
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="measured, after 15 s of settling; at least 1"
    )
    seconds = parser.parse_args().seconds
    if not seconds >= 1.0:
        parser.error(f"--seconds is {seconds}; give at least 1")
    print(f"{VEHICLES} vehicles at {RATE_HZ:g} Hz for {seconds:g} s; milliseconds")
    print(f"  {'':<52}{'p50':>10}{'p99':>10}{'largest':>10}{'number':>10}")
    for samples in (10, 1):
        found, inside = course(samples, seconds)
        if not found.delays or not inside:
            raise SystemExit("no answer ever rested on a sample that was sent; is loopback blocked?")
        print(f"messages of {samples} sample{'s' if samples > 1 else ''}, {found.unanswered} never answered")
        _row("handed to Zenoh until the first answer with it", found.delays)
        _row("one question and its answer", found.answers)
        _row("inside: message's arrival until the state has it", inside)


if __name__ == "__main__":
    run_benchmark(main)
