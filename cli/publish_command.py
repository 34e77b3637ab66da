"""`wingwatch publish`: a flight into Zenoh, as a vehicle sends it."""

import argparse
import os
import time
from collections.abc import Callable

import zenoh

from wingwatch.aircraft import load_aircraft
from wingwatch.operations.faults import say
from wingwatch.operations.plausible import findings_of
from wingwatch.operations.progress import Progress, write_json
from wingwatch.operations.surface_travel import surface_travel
from wingwatch.service.announced_aircraft import announced
from wingwatch.service.link_settings import security_of
from wingwatch.telemetry import (
    AircraftMessage,
    FlightPublisher,
    FlightTable,
    ZenohSettings,
    check_name,
    load_flight,
    open_session,
)
from wingwatch.telemetry.plausibility import Verdict

__all__ = ["run"]

_SAMPLES_A_MESSAGE = 10
_LISTENER_S = 3.0


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    fleet, vehicle = check_name("fleet", arguments.fleet), check_name("vehicle", arguments.vehicle)
    aircraft = AircraftMessage(aircraft=announced(arguments.aircraft))
    known = load_aircraft(arguments.aircraft)
    flight = load_flight(arguments.flight, arguments.map, surface_travel(known))
    for finding in findings_of(flight, known):
        if finding.standing is not Verdict.RIGHT:
            say(f"{flight.source}: {finding.sentence}")
    security = security_of(arguments, os.environ)
    began_s = time.monotonic()
    with (
        open_session(ZenohSettings.for_vehicle((arguments.connect,), security)) as session,
        Progress().count(len(flight.block), f"publishing {vehicle}") as show,
    ):
        messages = _publish(session, fleet, vehicle, aircraft, flight, arguments.rate, show)
    seconds = time.monotonic() - began_s
    result = {
        "fleet": fleet,
        "vehicle": vehicle,
        "samples": len(flight.block),
        "messages": messages,
        "seconds": seconds,
        "columns": list(flight.wire_columns),
    }
    if arguments.json:
        write_json(result)
    else:
        print(f"{len(flight.block)} samples in {messages} messages handed over in {seconds:.1f} s")
    return 0


def _publish(
    session: zenoh.Session, fleet: str, vehicle: str, aircraft: AircraftMessage, flight: FlightTable,
    rate: float | None, show: Callable[[int], None],
) -> int:  # fmt: skip
    """Send it all; the number of messages."""

    def sleep(seconds: float) -> None:
        show(publisher.sequence * _SAMPLES_A_MESSAGE)
        time.sleep(seconds)

    with FlightPublisher(
        session, fleet, vehicle, aircraft, samples_per_message=_SAMPLES_A_MESSAGE, sleep=sleep
    ) as publisher:
        if rate is not None and not publisher.wait_for_receiver(_LISTENER_S):
            say(f"nobody subscribes to {vehicle} yet; samples are lost until a service does")
        return publisher.publish(flight.block, rate, columns=flight.wire_columns)
