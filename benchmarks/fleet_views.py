"""What views of a fleet and its status messages cost, with and without the rows of ``could_see``, in one run.

Vehicles fly in turns at most 8 simulated flights with doublets in light turbulence. Before, every view had the rows,
and so had every status message; both ways are measured side by side on the same monitors. Times are of the processor.

Run: python benchmarks/fleet_views.py [--vehicles 100] [--seconds 60] [--seed 1]
"""

import argparse
import statistics
import time
from collections.abc import Callable, Sequence
from itertools import count

from saving import run_benchmark

from wingwatch.aircraft import load_aircraft
from wingwatch.api import vehicle_document
from wingwatch.monitor import FleetMonitor, VehicleMonitor, VehicleView
from wingwatch.simulation import Scenario, doublet_schedule, simulate
from wingwatch.telemetry import (
    PROTOBUF,
    AircraftMessage,
    SampleBlock,
    encode_aircraft,
    encode_sensors,
    encode_service_object,
)

FLIGHTS, REPEATED, PIECE = 8, 5, 50
STATUS_S, ROWS_S = 5.0, 30.0
"""A status is published every five seconds, the rows are worked out anew every thirty."""


def fleet_of(vehicles: int, seconds: float, seed: int) -> FleetMonitor:
    """A fleet that has flown for so long."""
    aircraft, ids = load_aircraft("aerosonde"), count()
    assert aircraft.envelope is not None
    doublets = doublet_schedule(aircraft, aircraft.envelope.cruise)
    flights = [
        simulate(Scenario(aircraft, manoeuvres=(doublets,), turbulence="light", seed=seed + k), seconds)
        for k in range(min(FLIGHTS, vehicles))
    ]
    fleet = FleetMonitor(lambda _: aircraft, time.monotonic, lambda: str(next(ids)))
    for v in range(vehicles):
        announced = encode_aircraft(AircraftMessage(aircraft="aerosonde"))
        fleet.receive("default", f"v{v}", "aircraft", announced, PROTOBUF)
    for k in range(round(seconds * 50.0) // PIECE):
        for v in range(vehicles):
            piece = SampleBlock(flights[v % len(flights)].values[k * PIECE : (k + 1) * PIECE])
            fleet.receive("default", f"v{v}", "sensors", encode_sensors(k, piece), PROTOBUF)
    return fleet


def monitors_of(fleet: FleetMonitor) -> list[VehicleMonitor]:
    """Of all vehicles."""
    return [known.monitor for _, known in fleet._vehicles.items() if known.monitor is not None]


def timed_ms(work: Callable[[], object]) -> float:
    """Median of some runs."""
    times = []
    for _ in range(REPEATED):
        begin_s = time.process_time()
        work()
        times.append(1e3 * (time.process_time() - begin_s))
    return statistics.median(times)


def as_json(views: Sequence[VehicleView]) -> int:
    """Bytes of the objects that REST gives."""
    documents = [vehicle_document(view).model_dump(mode="json") for view in views]
    return sum(len(encode_service_object("status", document)) for document in documents)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vehicles", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    if not 1 <= given.vehicles <= 5000:
        parser.error(f"--vehicles {given.vehicles}: give 1 to 5000")
    if not 20.0 <= given.seconds <= 3600.0:
        parser.error(f"--seconds {given.seconds}: give 20 to 3600; before, there is nothing to be seen")
    begin_s = time.process_time()
    fleet = fleet_of(given.vehicles, given.seconds, given.seed)
    fed_s = time.process_time() - begin_s
    samples = given.vehicles * given.seconds * 50.0
    keys = [("default", f"v{v}") for v in range(given.vehicles)]

    def whole() -> list[VehicleView]:
        return [view for key in keys if (view := fleet.vehicle(*key)) is not None]

    fleet.vehicles()  # the worst derivative and the air are worked out by whoever asks first
    begin_s = time.process_time()
    rows = [len(monitor.could_see()) for monitor in monitors_of(fleet)]
    first_ms = 1e3 * (time.process_time() - begin_s)
    print(
        f"{given.vehicles} vehicles, {given.seconds:g} s flown at {1e6 * fed_s / samples:.0f} us a vehicle-sample"
    )
    print(f"rows of could_see: {max(rows)} a vehicle, worked out in {first_ms / len(rows):.2f} ms each")
    without, all_rows = fleet.vehicles(), whole()
    print(f"{'':34s}{'without rows':>14s}{'with rows':>12s}")
    print(f"{'views of all, ms':34s}{timed_ms(fleet.vehicles):14.1f}{timed_ms(whole):12.1f}")
    print(
        f"{'objects and JSON of all, ms':34s}{timed_ms(lambda: as_json(without)):14.1f}"
        f"{timed_ms(lambda: as_json(all_rows)):12.1f}"
    )
    print(f"{'JSON of all, kB':34s}{as_json(without) / 1e3:14.1f}{as_json(all_rows) / 1e3:12.1f}")
    document = vehicle_document(all_rows[0]).model_dump(mode="json")
    bare = {name: value for name, value in document.items() if name != "could_see"}
    sizes = [(len(encode_service_object("status", d)), len(encode_service_object("status", d, PROTOBUF)))
             for d in (bare, document)]  # fmt: skip
    for k, name in enumerate(("status message, JSON, bytes", "the same in protobuf, bytes")):
        print(f"{name:34s}{sizes[0][k]:14d}{sizes[1][k]:12d}")
    mean = sizes[0][0] + STATUS_S / ROWS_S * (sizes[1][0] - sizes[0][0])
    print(f"mean status message where rows change every {ROWS_S:g} s: {mean:.0f} bytes of JSON")
    monitor = monitors_of(fleet)[0]
    look_ms = timed_ms(lambda: monitor.judge.smallest_seen(monitor._judge_state)) + timed_ms(
        monitor._relations.could_see
    )
    print(f"a look at a vehicle's surfaces, every 10 s until all have moved: {look_ms:.2f} ms, "
          f"{1e3 * look_ms / 500.0:.1f} us a vehicle-sample")  # fmt: skip


if __name__ == "__main__":
    run_benchmark(main)
