"""`wingwatch bridge mavlink`: vehicles of a MAVLink stream into Zenoh, as vehicles publish themselves."""

import argparse
import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from threading import Event
from typing import Any

import zenoh

from wingwatch.aircraft import load_aircraft
from wingwatch.cli.bridge_report import bridge_object, bridge_sentences
from wingwatch.cli.ending import asked_to_end
from wingwatch.operations.faults import CommandError, say
from wingwatch.operations.progress import write_json
from wingwatch.operations.surface_travel import surface_travel
from wingwatch.service.announced_aircraft import announced
from wingwatch.service.link_settings import security_of
from wingwatch.telemetry import AircraftMessage, FlightPublisher, ZenohSettings, check_name, open_session
from wingwatch.telemetry.mavlink import LinkReceiver, LinkRequests, MavlinkConnection, Piece, open_connection

__all__ = ["run"]

_STEP_S = 0.25
_REPORT_S = 10.0
_GATHER_S = 0.008
"""Pause between reads: a packet's time of arrival is known to so much, and many cost little more than one."""
_SAMPLES_A_MESSAGE = 50
_AT_ONCE = 1e9  # rate of samples whose moment has come
_MOST_SYSTEM = 255


@dataclass(frozen=True, slots=True)
class _Vehicles:
    """Who is to be published.

    Attributes:
        names: by system number; None is the first one that sends.
        aircraft: what each announces, by its name.
        travel_rad: deflections at full travel by channel, by its name.
    """

    names: Mapping[int | None, str]
    aircraft: Mapping[str, AircraftMessage]
    travel_rad: Mapping[str, Mapping[str, float]]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    fleet = check_name("fleet", arguments.fleet)
    vehicles = _vehicles(arguments.vehicle, arguments.aircraft)
    if arguments.listen_only and arguments.request_rates is not None:
        raise CommandError("--request-rates asks the vehicle, and --listen-only sends nothing: leave one out")
    receiver = LinkReceiver(vehicles.names, vehicles.travel_rad, patient=True)
    security = security_of(arguments, os.environ)
    with (
        asked_to_end() as end,
        open_connection(arguments.connect, arguments.baud) as link,
        open_session(ZenohSettings.for_vehicle((arguments.router,), security)) as session,
        Bridge(link, receiver, session, fleet, vehicles.aircraft) as bridge,
    ):
        say(f"{link.notation} is open; Ctrl-C ends")
        requests = None if arguments.listen_only else LinkRequests(link.send, arguments.request_rates)
        _follow(bridge, requests, arguments.json, end)
    return 0


def _follow(bridge: "Bridge", requests: LinkRequests | None, json: bool, end: Event) -> None:
    """Until the end is asked for."""
    due_s = time.monotonic() + _REPORT_S
    while not end.is_set():
        bridge.step(requests)
        if time.monotonic() >= due_s:
            due_s += _REPORT_S
            if json:
                write_json(bridge.report())
            elif sys.stderr.isatty():
                for sentence in bridge_sentences(bridge.report()):
                    say(sentence)
    bridge.finish()
    if json:
        write_json(bridge.report() | {"ended": True})
    else:
        print("\n".join(bridge_sentences(bridge.report())))


class Bridge:
    """Brings what comes over a link into Zenoh; use it in a ``with`` statement.

    Args:
        link: the MAVLink side.
        receiver: takes it apart.
        session: the Zenoh side.
        fleet: name of the fleet.
        aircraft: what each vehicle announces, by its name.
    """

    def __init__(
        self,
        link: MavlinkConnection,
        receiver: LinkReceiver,
        session: zenoh.Session,
        fleet: str,
        aircraft: Mapping[str, AircraftMessage],
    ) -> None:
        self._link, self._receiver, self._session = link, receiver, session
        self._fleet, self._aircraft = fleet, aircraft
        self._publishers: dict[str, FlightPublisher] = {}
        self._streams: dict[str, int] = {}
        self._messages: dict[str, int] = {}
        self._said: set[tuple[str, int]] = set()
        self._began_s = self._step_s = time.monotonic()

    def __enter__(self) -> "Bridge":
        return self

    def __exit__(self, *_: object) -> None:
        for publisher in self._publishers.values():
            publisher.close()

    def step(self, requests: LinkRequests | None = None) -> None:
        """Takes in what has come, and publishes what is due."""
        self._take_in(_STEP_S / 2.0)
        now_s = time.monotonic()
        if now_s < self._step_s:
            time.sleep(_GATHER_S)
            return
        self._step_s = max(self._step_s + _STEP_S, now_s)
        self._publish(now_s)
        if requests is not None:
            requests.step(self._receiver, now_s)
        self._say_once()

    def finish(self) -> None:
        """Takes in what waits, and publishes what is left."""
        self._take_in(0.0)
        self._publish(time.monotonic(), final=True)

    def report(self) -> dict[str, Any]:
        """Counters of all so far."""
        now_s = time.monotonic()
        return bridge_object(self._receiver, self._messages, self._began_s, now_s, self._link.interruptions)

    def _take_in(self, timeout_s: float) -> None:
        for arrival in self._link.read(timeout_s):
            self._receiver.feed(arrival.data, arrival.received_s, arrival.source)

    def _publish(self, now_s: float, final: bool = False) -> None:
        for system in self._receiver.systems.values():
            for piece in system.vehicle.step(now_s, final):
                self.put(system.vehicle.name, piece)

    def put(self, name: str, piece: Piece) -> None:
        """Publishes samples of a vehicle; another stream is another publisher."""
        if name in self._publishers and self._streams[name] != piece.stream:
            self._publishers.pop(
                name
            ).close()  # it leaves, so that its name is free for the vehicle started anew
        publisher = self._publishers.get(name)
        if publisher is None:
            publisher = self._publishers[name] = FlightPublisher(
                self._session, self._fleet, name, self._aircraft[name], samples_per_message=_SAMPLES_A_MESSAGE
            )
            self._streams[name] = piece.stream
        sent = publisher.publish(piece.block, _AT_ONCE, columns=piece.columns, receiver_timeout_s=0.0)
        self._messages[name] = self._messages.get(name, 0) + sent

    def _say_once(self) -> None:
        """Systems that send and are not published."""
        for number in self._receiver.others:
            if ("other", number) not in self._said:
                self._said.add(("other", number))
                say(f"system {number} sends and has no name; add --vehicle {number}=NAME to publish it")
        for number, system in self._receiver.systems.items():
            if system.vehicle.is_multicopter and ("multicopter", number) not in self._said:
                self._said.add(("multicopter", number))
                say(
                    f"system {number} ({system.vehicle.name}) is a multicopter and is not published: derivatives of "
                    "fixed-wing aircraft are estimated"
                )


def _vehicles(named: Sequence[str], aircraft: Sequence[str]) -> _Vehicles:
    names: dict[int | None, str] = {}
    for one in named:
        number, equals, name = one.rpartition("=")
        name = check_name("vehicle", name)
        if equals and not (number.isascii() and number.isdigit() and 1 <= int(number) <= _MOST_SYSTEM):
            raise CommandError(f"--vehicle {one}: {number!r} is no MAVLink system; systems are 1 to 255")
        key = int(number) if equals else None
        if key in names:
            what = f"system {key}" if equals else "the first system that sends"
            raise CommandError(
                f"--vehicle {one}: {what} is {names[key]!r} already; write --vehicle SYSTEM=NAME"
            )
        if name in names.values():
            raise CommandError(
                f"--vehicle {one}: two systems cannot both be {name!r}; give each a name of its own"
            )
        names[key] = name
    given: dict[str, str] = {}
    for one in aircraft:
        name, equals, value = one.partition("=")
        if not equals:
            name, value = "", one
        elif name not in names.values():
            raise CommandError(f"--aircraft {one}: no vehicle is called {name!r}; name it with --vehicle")
        if name in given:
            raise CommandError(
                f"--aircraft {one}: {name or 'every vehicle'} has {given[name]} already; give one"
            )
        given[name] = value
    for name in names.values():
        if name not in given and "" not in given:
            raise CommandError(f"vehicle {name!r} has no aircraft: add --aircraft {name}=A")
    chosen = {name: given.get(name, given.get("", "")) for name in names.values()}
    said = {value: AircraftMessage(aircraft=announced(value)) for value in dict.fromkeys(chosen.values())}
    travel = {value: surface_travel(load_aircraft(value)) for value in said}
    return _Vehicles(
        names, {n: said[v] for n, v in chosen.items()}, {n: travel[v] for n, v in chosen.items()}
    )
