"""How long a service takes from its start to its first answer, and what of that is resuming, by number of vehicles.

Each vehicle has a checkpoint: the state of one simulated flight of two minutes, under as many names. The service is
``wingwatch serve`` in a process of its own, which finds its kernels compiled. Said are the time from the start of the
process to the first answer with all vehicles and to samples being taken in, and the time from the first checkpoint read
to the last vehicle resumed, as the service logs it.

Run: python benchmarks/resume.py [--vehicles 3 200] [--starts 5]
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path

import numpy as np
from loopback import free_endpoint, free_port
from saving import run_benchmark
from service_process import (
    FLEET,
    RATE_HZ,
    SAMPLES,
    RestClient,
    prepare_kernels,
    processor_time_s,
    resumed_in,
    serving,
)

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor import FleetMonitor, FleetPorts, SavedVehicle
from wingwatch.service.checkpoints import CheckpointFolder
from wingwatch.service.settings import ServeSettings
from wingwatch.simulation import FleetSimulation, demo_fleet
from wingwatch.telemetry import PROTOBUF, AircraftMessage, SampleBlock, encode_aircraft, encode_sensors

FLIGHT_S = 120.0


@dataclass
class Times:
    """Of each start, s: to the first answer with all vehicles, to samples taken in, of resuming alone; ``spent`` is the
    processor time of the same."""

    shown_s: list[float] = field(default_factory=list)
    shown_spent_s: list[float] = field(default_factory=list)
    ready_s: list[float] = field(default_factory=list)
    ready_spent_s: list[float] = field(default_factory=list)
    resumed_s: list[float] = field(default_factory=list)
    resumed_spent_s: list[float] = field(default_factory=list)


class _InHand(CheckpointFolder):
    """A folder from which nothing is read, and to which nothing is written meanwhile."""

    def has_room(self) -> bool:
        """Never."""
        return False


def saved_flight(folder: Path) -> SavedVehicle:
    """The state of one vehicle after a simulated flight, as a service saves it."""
    numbers = count()
    fleet = FleetMonitor(
        load_aircraft,
        time.monotonic,
        lambda: str(next(numbers)),
        FleetPorts(checkpoints=_InHand(folder, time.time)),
    )
    flight = FleetSimulation(demo_fleet()[:1], RATE_HZ)
    announced = encode_aircraft(AircraftMessage(aircraft="aerosonde"))
    fleet.receive(FLEET, "v", "aircraft", announced, PROTOBUF)
    for k in range(round(FLIGHT_S * RATE_HZ) // SAMPLES):
        message = encode_sensors(k, SampleBlock(flight.step(SAMPLES)[0]))
        fleet.receive(FLEET, "v", "sensors", message, PROTOBUF)
        fleet.vehicles()  # somebody looks, as a subscriber of a vehicle's status does
    return next(iter(fleet.unsaved()))


def course(vehicles: int, starts: int, flight: SavedVehicle) -> Times:
    """So many starts with so many vehicles, each from the same checkpoints."""
    times = Times()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        checkpoints = CheckpointFolder(ServeSettings(data=folder).checkpoints, time.time)
        for k in range(vehicles):
            checkpoints.write(replace(flight, vehicle=f"v{k}"))
        for _ in range(starts):
            port = free_port()
            client = RestClient(port)
            begin_s = time.monotonic()
            with serving(folder, port, ("--listen", free_endpoint())) as process:
                times.shown_s.append(client.wait("/v1/vehicles", process) - begin_s)
                times.shown_spent_s.append(processor_time_s(process.pid))
                if len(client.items("/v1/vehicles")) != vehicles:
                    raise SystemExit("not every vehicle was resumed")
                times.ready_s.append(client.wait("/health/ready", process) - begin_s)
                times.ready_spent_s.append(processor_time_s(process.pid))
        for took_s, spent_s in resumed_in(folder / "log.txt"):
            times.resumed_s.append(took_s)
            times.resumed_spent_s.append(spent_s)
    return times


def _row(name: str, values_s: Sequence[float]) -> None:
    print(f"  {name:<60}{np.median(values_s):8.2f}{min(values_s):8.2f}{max(values_s):8.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description="How long a service takes to go on where it was.")
    parser.add_argument("--vehicles", type=int, nargs="+", default=[3, 200], help="numbers to try, 1 to 5000")
    parser.add_argument("--starts", type=int, default=5, help="of each number, 1 to 1000")
    arguments = parser.parse_args()
    if not all(1 <= n <= 5000 for n in arguments.vehicles):
        parser.error(f"--vehicles are {arguments.vehicles}; give 1 to 5000 each")
    if not 1 <= arguments.starts <= 1000:
        parser.error(f"--starts is {arguments.starts}; give 1 to 1000")
    prepare_kernels()
    with tempfile.TemporaryDirectory() as folder:
        flight = saved_flight(Path(folder))
    print(f"{arguments.starts} starts each; seconds")
    print(f"  {'':<60}{'p50':>8}{'least':>8}{'most':>8}")
    for vehicles in arguments.vehicles:
        times = course(vehicles, arguments.starts, flight)
        print(f"{vehicles} vehicles")
        _row("from the first checkpoint read to the last vehicle resumed", times.resumed_s)
        _row("    processor time", times.resumed_spent_s)
        _row("from start to the first answer with all vehicles", times.shown_s)
        _row("    processor time", times.shown_spent_s)
        _row("from start to samples taken in", times.ready_s)
        _row("    processor time", times.ready_spent_s)


if __name__ == "__main__":
    run_benchmark(main)
