"""How many vehicles one service watches live: n publishers' worth of messages over Zenoh on loopback, by n.

The service runs in a process of its own as ``wingwatch serve`` runs it, with a folder and ports of its own; a second
process sends, every other vehicle in JSON, and a third asks REST ten times a second. The vehicles fly in turns at most
32 simulated flights with doublets in light turbulence. Of each n it is said what was lost on the way, how far the state
behind REST is behind what was sent at the end, how long REST took meanwhile, the service's processor time a
vehicle-sample by thread, and its memory. Times are of a machine that also sends and asks. ``--stages`` tells what the
thread that takes messages in spends its time on; that costs it a twentieth of it.

``--workers 1 2`` compares the service itself with a gateway and two processes that watch; processor time and memory are
of all of them.

Run: python benchmarks/live_fleet.py [--vehicles 3 15] [--seconds 30] [--samples-per-message 10] [--over 0] [--stages]
       [--stored] [--workers 1 2]
"""

import argparse
import functools
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any
from unittest import mock

import httpx
import numpy as np
from fleet_usage import Usage, all_ready, usage_of_service, usage_of_workers
from loopback import free_endpoint
from saving import run_benchmark
from service_child import beside

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, Provenance, load_aircraft
from wingwatch.baselines import ExpectationRecord, apriori_envelope, open_database
from wingwatch.estimators import EkfEstimator, FourierEstimator, Signals, Validity
from wingwatch.monitor import FleetMonitor, VehicleMonitor
from wingwatch.monitor.detection.judge import Judge
from wingwatch.monitor.fleet import sample_way
from wingwatch.service.service import Service, running_service
from wingwatch.service.settings import ServeSettings
from wingwatch.service.workers.gateway import Gateway, running_gateway
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule
from wingwatch.telemetry import (
    JSON,
    PROTOBUF,
    AircraftMessage,
    SampleBlock,
    ZenohSettings,
    encode_aircraft,
    encode_sensors,
    open_session,
    vehicle_key,
)

RATE_HZ = 50.0
FLIGHTS = 32
"""Different flights; further vehicles repeat them."""
COMPILE_S, PATIENCE_S, ARRIVE_S = 300.0, 30.0, 2.5
EACH_S = 0.01
"""Between announcements and first samples, for each vehicle: workers take them over one after the other."""
ASK_EVERY_S, FLEET_EVERY_S = 0.1, 2.0
INGEST = "wingwatch-pump"
THREADS = (
    INGEST,
    "wingwatch-subscriber",
    "wingwatch-http",
    "wingwatch-outputs",
    "wingwatch-store",
    "wingwatch-recall",
    "wingwatch-checkpoints",
)
STAGES: dict[str, tuple[tuple[Any, str], ...]] = {
    "decoding": ((sample_way, "decode_sensors"),),
    "cleaning": ((VehicleMonitor, "prepared"),),
    "signals": ((Signals, "update"), (Signals, "high_passed")),
    "Fourier estimator": ((FourierEstimator, "update"), (FourierEstimator, "solve")),
    "filter": ((EkfEstimator, "update"), (EkfEstimator, "solve"), (EkfEstimator, "release")),
    "estimates": ((FourierEstimator, "validities"), (EkfEstimator, "validities"), (Validity, "estimate")),
    "test for changes": ((Judge, "consider"),),
    "news": ((VehicleMonitor, "derivatives"), (VehicleMonitor, "view")),
    "all else": ((FleetMonitor, "receive_all"), (FleetMonitor, "tick")),
}
"""What is timed; time within a stage that another one takes is the other's."""


@dataclass(slots=True)
class Stopwatch:
    """Processor time of the thread that takes messages in, by stage, in seconds."""

    spent_s: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))
    _inner_s: list[float] = field(default_factory=list)

    def timed(self, stage: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """The function, its time taken in that thread."""

        @functools.wraps(work)
        def timing(*arguments: Any, **named: Any) -> Any:
            if threading.current_thread().name != INGEST:
                return work(*arguments, **named)
            self._inner_s.append(0.0)
            begin_s = time.thread_time()
            try:
                return work(*arguments, **named)
            finally:
                whole_s = time.thread_time() - begin_s
                self.spent_s[stage] += whole_s - self._inner_s.pop()
                if self._inner_s:
                    self._inner_s[-1] += whole_s

        return timing


@dataclass(frozen=True, slots=True)
class Course:
    """One run.

    Attributes:
        sent, lost: messages of sensors.
        behind_s: of each vehicle, its last sample sent beyond the last one that REST knows, as sending ends.
        answers_s: time of each question about one vehicle; fleet_s: about all.
        late_s: by how much the sending process missed the moment of a message, worst.
        stages_us, threads_us: processor time a vehicle-sample that was taken in, by stage (where asked for) and
            by thread; all_us: of the whole service.
        peak_bytes: of the service; vehicle_bytes: growth while it took in the vehicles, each.
        problems: what the service counted as dropped or failed.
    """

    vehicles: int
    sent: int
    lost: int
    behind_s: list[float]
    answers_s: list[float]
    fleet_s: list[float]
    late_s: float
    stages_us: dict[str, float]
    threads_us: dict[str, float]
    all_us: float
    peak_bytes: int
    vehicle_bytes: float
    problems: dict[str, int]


def serve(
    endpoint: str, folder: str, stages: bool, stored: bool, workers: int, diagnose: bool, asked: Connection
) -> None:
    """The service, until the connection closes; each thing received is answered with the usage so far.

    With several workers it is a gateway and that many processes; what each process has used stands in the place of
    threads then.
    """
    watch = Stopwatch()
    settings = ServeSettings(
        port=0, listen=(endpoint,), data=Path(folder), workers=workers, diagnose_alerts=diagnose
    )
    if stored:
        store_baseline(settings.where)
    with ExitStack() as stack:
        for stage, places in STAGES.items() if stages else ():
            for owner, name in places:
                stack.enter_context(mock.patch.object(owner, name, watch.timed(stage, getattr(owner, name))))
        running: Service | Gateway
        if workers == 1:
            service = running = stack.enter_context(running_service(settings))
            used = partial(usage_of_service, service, watch.spent_s)
        else:
            gateway = running = stack.enter_context(running_gateway(settings, workers=workers))
            used = partial(usage_of_workers, gateway)
        asked.send(running.url if all_ready(running, workers, COMPILE_S) else None)
        while True:
            try:
                asked.recv()
            except EOFError:
                return
            asked.send(used())


def store_baseline(where: str) -> None:
    """What the aircraft's file expects of both compared structures, as entries of the database that flights gave."""
    aircraft = load_aircraft("aerosonde")
    with open_database(where) as database:
        for structure in (SHORT_PERIOD, LATERAL):
            for point in apriori_envelope(aircraft, structure).points:
                flown = replace(point, provenance=Provenance.IDENTIFIED, source="identified in flight")
                database.put_expectation(ExpectationRecord.of(aircraft.name, flown, 0.0))


def payloads(vehicles: int, seconds: float, samples: int) -> list[list[bytes]]:
    """Messages of each vehicle, ready to send; odd ones in JSON."""
    aircraft = load_aircraft("aerosonde")
    manoeuvre = doublet_schedule(aircraft, Scenario(aircraft).condition)
    flights = min(vehicles, FLIGHTS)
    simulation = FleetSimulation(
        [Scenario(aircraft, manoeuvres=(manoeuvre,), turbulence="light", seed=i) for i in range(flights)], RATE_HZ
    )  # fmt: skip
    values = simulation.step(round(seconds * RATE_HZ))
    names = SampleBlock(values[0]).present
    made = []
    for i in range(flights):
        pieces = range(0, values.shape[1] - samples + 1, samples)
        encoding = JSON if i % 2 else PROTOBUF
        made.append(
            [encode_sensors(k // samples, SampleBlock(values[i, k : k + samples]), encoding, names, 1) for k in pieces]
        )  # fmt: skip
    return made


def waits(vehicles: int, over_s: float, samples: int) -> list[int]:
    """How many messages' periods each vehicle begins after the first, evenly over some seconds."""
    return [round(over_s * RATE_HZ / samples * i / vehicles) for i in range(vehicles)]


def send(
    endpoint: str, vehicles: int, seconds: float, samples: int, over_s: float, moments: Connection
) -> None:
    """All vehicles in real time, evenly within a message's period, the last one beginning ``over_s`` late.

    Says when it is ready, sends from the moment that it is given, says how many messages it sent and how late it ever
    was, and ends when the connection closes.
    """
    made = payloads(vehicles, seconds, samples)
    period_s = samples / RATE_HZ
    with open_session(ZenohSettings.for_vehicle((endpoint,))) as session:
        publishers = []
        for i in range(vehicles):
            session.put(
                vehicle_key("default", f"v{i}", "aircraft"), encode_aircraft(AircraftMessage(aircraft="aerosonde")),
                encoding=PROTOBUF,
            )  # fmt: skip
            publishers.append(
                session.declare_publisher(
                    vehicle_key("default", f"v{i}", "sensors"),
                    encoding=JSON if i % len(made) % 2 else PROTOBUF,
                )
            )
        moments.send(None)
        begin_s = moments.recv()
        late_s, sent, waiting = 0.0, 0, waits(vehicles, over_s, samples)
        for k in range(len(made[0])):
            for i, publisher in enumerate(publishers):
                if k < waiting[i]:
                    continue
                wait_s = begin_s + period_s * (k + (i + 1) / vehicles) - time.monotonic()
                if wait_s > 0.0:
                    time.sleep(wait_s)
                late_s = max(late_s, -wait_s)
                publisher.put(made[i % len(made)][k - waiting[i]])
                sent += 1
        moments.send((sent, late_s))
        moments.poll(PATIENCE_S)


def ask(url: str, vehicles: int, ended: Callable[[], bool]) -> tuple[list[float], list[float], int]:
    """Ask for one vehicle's derivatives by turns, and now and then for the fleet, until the end.

    Returns:
        seconds from each question's moment to its answer, of one vehicle and of the fleet, and how many were answered
        that the vehicle's worker does not answer.
    """
    one_s: list[float] = []
    unanswered = 0
    fleet_s: list[float] = []
    rng = np.random.default_rng(0)
    with httpx.Client(timeout=PATIENCE_S, base_url=url) as client:
        due_s = fleet_due_s = time.monotonic() + FLEET_EVERY_S
        while not ended():
            time.sleep(max(0.0, due_s - time.monotonic()))
            begin_s = time.monotonic()
            if begin_s >= fleet_due_s:
                client.get("/v1/status").raise_for_status()
                fleet_s.append(time.monotonic() - begin_s)
                fleet_due_s = begin_s + FLEET_EVERY_S
            begin_s = time.monotonic()
            answer = client.get(f"/v1/vehicles/v{rng.integers(vehicles)}/derivatives")
            unanswered += answer.status_code == httpx.codes.SERVICE_UNAVAILABLE
            if answer.status_code != httpx.codes.SERVICE_UNAVAILABLE:
                answer.raise_for_status()
            one_s.append(time.monotonic() - begin_s)
            due_s = begin_s + ASK_EVERY_S
    return one_s, fleet_s, unanswered


def behind(url: str, last_s: Sequence[float]) -> list[float]:
    """Seconds of each vehicle's flight that are sent and not yet in what REST answers.

    Args:
        last_s: stamp of the last sample that each vehicle has sent.
    """
    return [last_s[int(v["vehicle"][1:])] - (v["last_sample_time_s"] or 0.0) for v in _vehicles(url)]


def _vehicles(url: str) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = (
        httpx.get(f"{url}/v1/vehicles", timeout=PATIENCE_S).raise_for_status().json()["items"]
    )
    return items


def course(
    vehicles: int,
    seconds: float,
    samples: int = 10,
    over_s: float = 0.0,
    *,
    stages: bool = False,
    stored: bool = False,
    workers: int = 1,
    diagnose: bool = True,
) -> Course:
    """One run with so many vehicles against a service of its own, its stages timed or not, a baseline stored or not."""
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        endpoint = free_endpoint()
        service = stack.enter_context(beside(serve, endpoint, folder, stages, stored, workers, diagnose))
        url = _received(service, COMPILE_S + PATIENCE_S)
        if url is None:
            raise TimeoutError(f"the kernels were not compiled within {COMPILE_S:g} s; run it again")
        sender = stack.enter_context(beside(send, endpoint, vehicles, seconds, samples, over_s))
        _received(sender, COMPILE_S)
        before = _usage(service)
        sender.send(time.monotonic() + 0.5 + vehicles * EACH_S)
        answers_s, fleet_s, unanswered = ask(url, vehicles, sender.poll)
        sent, late_s = _received(sender, PATIENCE_S)
        messages = round(seconds * RATE_HZ) // samples
        late = behind(
            url,
            [((messages - wait) * samples - 1) / RATE_HZ for wait in waits(vehicles, over_s, samples)],
        )
        time.sleep(ARRIVE_S)
        after = _usage(service)
        taken = max(sum(v["counts"].get("accepted", 0) for v in _vehicles(url)), 1)
    announced = vehicles
    return Course(
        vehicles, sent, sent + announced - after.received, late, answers_s, fleet_s, late_s,
        _each_us(before.stages_s, after.stages_s, taken), _each_us(before.threads_s, after.threads_s, taken),
        1e6 * (after.processor_s - before.processor_s) / taken,
        after.peak_bytes, (after.resident_bytes - before.resident_bytes) / vehicles,
        after.problems | ({"REST: unanswered": unanswered} if unanswered else {}),
    )  # fmt: skip


def _each_us(before_s: dict[str, float], after_s: dict[str, float], samples: int) -> dict[str, float]:
    return {name: 1e6 * (spent_s - before_s.get(name, 0.0)) / samples for name, spent_s in after_s.items()}


def _received(connection: Connection, timeout_s: float) -> Any:
    if not connection.poll(timeout_s):
        raise TimeoutError(f"a process of the benchmark said nothing for {timeout_s:g} s")
    return connection.recv()


def _usage(service: Connection) -> Usage:
    service.send(None)
    usage: Usage = _received(service, PATIENCE_S)
    return usage


def _percentiles(seconds: Sequence[float], scale: float) -> str:
    if not seconds:
        return f"{'-':>9}{'-':>9}"
    p50, p99 = np.percentile(scale * np.array(seconds), [50.0, 99.0])
    return f"{p50:9.2f}{p99:9.2f}"


def report(run: Course) -> None:
    """Print one run."""
    print(
        f"{run.vehicles:8d}{run.sent:9d}{run.lost:7d}{_percentiles(run.behind_s, 1.0)}"
        f"{_percentiles(run.answers_s, 1e3)}{_percentiles(run.fleet_s, 1e3)}{run.all_us:9.0f}"
        f"{run.peak_bytes / 2**20:8.0f}{run.vehicle_bytes / 1024:9.0f}{run.late_s:8.2f}",
        flush=True,
    )


def main() -> None:
    arguments = parsed()
    print(
        f"vehicles at {RATE_HZ:g} Hz for {arguments.seconds:g} s, {arguments.samples_per_message} samples a message, "
        f"every other one in JSON, beginning over {arguments.over:g} s"
    )
    for workers in arguments.workers:
        watched(arguments, workers)


def watched(arguments: argparse.Namespace, workers: int) -> None:
    """All numbers of vehicles with so many workers, and the tables of them."""
    print(f"\n{'the service itself' if workers == 1 else f'a gateway and {workers} workers'}")
    groups = ("behind, s", "one vehicle, ms", "fleet, ms")
    print(
        f"{'':24}"
        + "".join(f"{name:>18}" for name in groups)
        + f"{'us a':>9}{'peak':>8}{'KiB a':>9}{'sent':>8}"
    )
    print(
        f"{'vehicles':>8}{'sent':>9}{'lost':>7}" + f"{'p50':>9}{'p99':>9}" * 3
        + f"{'sample':>9}{'MiB':>8}{'vehicle':>9}{'late, s':>8}"
    )  # fmt: skip
    runs = []
    for n in arguments.vehicles:
        runs.append(
            course(
                n, arguments.seconds, arguments.samples_per_message, arguments.over,
                stages=arguments.stages, stored=arguments.stored, workers=workers,
                diagnose=not arguments.no_diagnose_alerts,
            )
        )  # fmt: skip
        report(runs[-1])
    of_parts(runs, THREADS if workers == 1 else ("gateway", *(f"worker {k + 1}" for k in range(workers))))
    if arguments.stages:
        print(f"\nof these {INGEST} by stage")
        for stage in STAGES:
            print(f"{stage:>21}" + "".join(f"{run.stages_us[stage]:9.1f}" for run in runs))
    for run in runs:
        if run.problems:
            print(f"{run.vehicles} vehicles: " + ", ".join(f"{k} {n}" for k, n in run.problems.items()))


def of_parts(runs: Sequence[Course], parts: Sequence[str]) -> None:
    """Print what each thread, or each process, has cost."""
    print("\nprocessor time of the service, us a vehicle-sample")
    print(f"{'vehicles':>21}" + "".join(f"{run.vehicles:9d}" for run in runs))
    for part in parts:
        print(f"{part:>21}" + "".join(f"{run.threads_us.get(part, 0.0):9.1f}" for run in runs))
    rest = [run.all_us - sum(run.threads_us.get(part, 0.0) for part in parts) for run in runs]
    print(f"{'REST, Zenoh and else':>21}" + "".join(f"{us:9.1f}" for us in rest))


def parsed() -> argparse.Namespace:
    """The command's arguments, checked."""
    parser = argparse.ArgumentParser(description="How many vehicles one service watches live.")
    add = parser.add_argument
    add("--vehicles", type=int, nargs="+", default=[3, 15, 50, 150, 300], help="numbers to try")
    add("--seconds", type=float, default=30.0, help="of flight, in real time; at least 5")
    add("--samples-per-message", type=int, default=10, help="1 to 100")
    add("--over", type=float, default=0.0, help="seconds over which the vehicles begin, one after the other")
    add("--stages", action="store_true", help="time by stage as well, which costs a twentieth")
    add("--stored", action="store_true", help="with a baseline of the aircraft in the database")
    add("--workers", type=int, nargs="+", default=[1], help="processes that watch; 1: the service itself")
    add("--no-diagnose-alerts", action="store_true", help="do not look into alerts")
    arguments = parser.parse_args()
    if not all(1 <= n <= 16 for n in arguments.workers):
        parser.error(f"--workers are {arguments.workers}; give 1 to 16 each")
    if arguments.stages and arguments.workers != [1]:
        parser.error("--stages times the service itself; give it without --workers")
    if not 5.0 <= arguments.seconds <= 3600.0:
        parser.error(f"--seconds is {arguments.seconds}; give 5 to 3600")
    if not 0.0 <= arguments.over <= arguments.seconds - 5.0:
        longest_s = arguments.seconds - 5.0
        parser.error(f"--over is {arguments.over}; give 0 to 5 less than --seconds, {longest_s}")
    if not all(1 <= n <= 5000 for n in arguments.vehicles):
        parser.error(f"--vehicles are {arguments.vehicles}; give 1 to 5000 each")
    if not 1 <= arguments.samples_per_message <= 100:
        parser.error(f"--samples-per-message is {arguments.samples_per_message}; give 1 to 100")
    return arguments


if __name__ == "__main__":
    run_benchmark(main)
