"""Recording and replay: what recording costs the loop that takes messages in, and whether a replay is equal to the bit.

So many vehicles fly simulated flights with doublets, every third one with ice from the first third on. Their messages
go, as a service's do, through a monitor with a database, as fast as they are computed: without a recorder, with one,
without. Said are the processor time of the loop that takes messages in with and without, the recorder's own, the size
of the recording, how many messages mcap's own reader finds in it, and what of estimates and alerts comes again in the
replay.

Run: python benchmarks/recording.py [--vehicles 20] [--minutes 30] [--seed 1] [--keep DIR]
"""

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from saving import run_benchmark

from wingwatch.aircraft import load_aircraft
from wingwatch.baselines import open_database
from wingwatch.cli.replaying import Agreement, Replay
from wingwatch.monitor import FleetMonitor, FleetPorts
from wingwatch.service.processor_time import ProcessorTimes
from wingwatch.service.recorded_ports import RecordedStore
from wingwatch.service.recorder import Recorder
from wingwatch.service.store import DatabaseStore
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule, parse_effect
from wingwatch.telemetry import (
    PROTOBUF,
    AircraftMessage,
    InboundMessage,
    SampleBlock,
    encode_aircraft,
    encode_sensors,
)
from wingwatch.telemetry.recording.reading import open_recording

RATE_HZ, SAMPLES = 50.0, 10
FLEET = "default"


@dataclass(frozen=True, slots=True)
class Cost:
    """Processor time of one run in s: of the loop that takes messages in, and of the thread that records."""

    loop_s: float
    recorder_s: float
    bytes_written: int


def scenarios(vehicles: int, seconds: float, seed: int) -> list[Scenario]:
    """Flights of that many vehicles."""
    aircraft = load_aircraft("aerosonde")
    manoeuvre = doublet_schedule(aircraft, Scenario(aircraft).condition)
    ice = parse_effect(f"icing:0.2@{seconds / 3.0:g}+30")
    return [
        Scenario(
            aircraft, manoeuvres=(manoeuvre,), effects=(ice,) if k % 3 == 0 else (), turbulence="light",
            seed=seed + k, name=f"v{k}",
        )
        for k in range(vehicles)
    ]  # fmt: skip


def messages(flights: Sequence[Scenario], seconds: float) -> Iterator[list[InboundMessage]]:
    """What the vehicles send, message by message of all of them."""
    announced = encode_aircraft(AircraftMessage(aircraft="aerosonde"))
    yield [InboundMessage(FLEET, one.name, "aircraft", announced, PROTOBUF, 0.0) for one in flights]
    simulation = FleetSimulation(flights, RATE_HZ)
    for k in range(round(seconds * RATE_HZ) // SAMPLES):
        at_s = (k + 1) * SAMPLES / RATE_HZ
        yield [
            InboundMessage(FLEET, one.name, "sensors", encode_sensors(k, SampleBlock(rows)), PROTOBUF, at_s)
            for one, rows in zip(flights, simulation.step(SAMPLES), strict=True)
        ]


def fly(flights: Sequence[Scenario], seconds: float, folder: Path, record: Path | None) -> Cost:
    """All of it through a monitor, with a recorder or without."""
    now_s = [0.0]
    times = ProcessorTimes()
    numbers = iter(range(1_000_000))
    with ExitStack() as stack:
        database = stack.enter_context(open_database(str(folder / "memory.db")))
        store = stack.enter_context(DatabaseStore(database, lambda: now_s[0]))
        recorder = None if record is None else Recorder(record, clock=lambda: now_s[0])
        if recorder is not None:
            stack.enter_context(recorder)
        ports = FleetPorts(store if recorder is None else RecordedStore(store, recorder))
        monitor = FleetMonitor(load_aircraft, lambda: now_s[0], lambda: f"a{next(numbers)}", ports)
        loop_s = 0.0
        for batch in messages(flights, seconds):
            now_s[0] = batch[0].received_s
            before_s = time.thread_time()
            if recorder is not None:
                recorder.messages(batch)
            monitor.receive_all(batch)
            while monitor.behind or monitor.held:
                monitor.receive_all(())
                monitor.tick()
            loop_s += time.thread_time() - before_s
            while recorder is not None and recorder.waiting > 1000:
                time.sleep(0.01)
        spent_s = times.by_stage()["record"]
    size = 0 if record is None else sum(path.stat().st_size for path in record.iterdir())
    return Cost(loop_s, spent_s, size)


def report(with_it: Cost, before: Cost, after: Cost, vehicle_samples: float) -> list[str]:
    """Costs in words."""
    each_us = 1e6 / vehicle_samples
    without_s = 0.5 * (before.loop_s + after.loop_s)
    more = with_it.loop_s / without_s - 1.0
    return [
        f"loop that takes messages in: {with_it.loop_s * each_us:.1f} us a vehicle-sample with recording, "
        f"{before.loop_s * each_us:.1f} and {after.loop_s * each_us:.1f} us without ({100.0 * more:+.1f} %)",
        f"thread that records: {with_it.recorder_s * each_us:.2f} us a vehicle-sample "
        f"({100.0 * with_it.recorder_s / without_s:.1f} % of the loop)",
        f"recording: {with_it.bytes_written / 1e6:.1f} MB, "
        f"{with_it.bytes_written / vehicle_samples:.0f} bytes a vehicle-sample",
    ]


def read_by_mcap(folder: Path) -> int:
    """Messages that mcap's own reader finds through the files' indices."""
    from mcap.reader import make_reader

    found = 0
    for path in sorted(folder.glob("*.mcap")):
        with path.open("rb") as stream:
            found += sum(1 for _ in make_reader(stream).iter_messages(log_time_order=False))
    return found


def replayed(folder: Path) -> tuple[Agreement, float]:
    """What came of the recording again, and how long that took in s."""
    replay = Replay(open_recording([folder]), load_aircraft)
    began_s = time.monotonic()
    for _ in replay.seconds():
        pass
    return replay.agreement(), time.monotonic() - began_s


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for the recording; it is removed without")
    arguments = parser.parse_args()
    seconds = 60.0 * arguments.minutes
    flights = scenarios(arguments.vehicles, seconds, arguments.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        record = arguments.keep or folder / "recording"
        fly(flights[:1], 5.0, made(folder / "first"), None)  # loads the kernels
        before = fly(flights, seconds, made(folder / "before"), None)
        with_it = fly(flights, seconds, made(folder / "with"), record)
        after = fly(flights, seconds, made(folder / "after"), None)
        print(
            f"{arguments.vehicles} vehicles, {arguments.minutes:g} minutes at {RATE_HZ:g} Hz, seed {arguments.seed}"
        )
        print("\n".join(report(with_it, before, after, arguments.vehicles * seconds * RATE_HZ)))
        print(f"mcap's own reader finds {read_by_mcap(record)} messages")
        agreement, took_s = replayed(record)
        print(
            f"replayed in {took_s:.0f} s: estimates {agreement.estimates_equal} of {agreement.estimates} "
            f"the same to the bit, alerts {agreement.alerts_equal} of {agreement.alerts}, "
            f"further alerts {agreement.further_alerts}"
        )


def made(folder: Path) -> Path:
    """The folder, made."""
    folder.mkdir()
    return folder


if __name__ == "__main__":
    run_benchmark(main)
