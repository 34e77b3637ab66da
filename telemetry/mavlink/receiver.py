"""A MAVLink link taken apart: whose packets they are, which vehicle's, what was lost on the way."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan

import numpy as np

from wingwatch.telemetry.logs.link_facts import is_vehicle
from wingwatch.telemetry.mavlink.dialect import HEARTBEAT, TIMESYNC, layouts
from wingwatch.telemetry.mavlink.packets import Packet, PacketReader
from wingwatch.telemetry.mavlink.sequences import PacketSequence
from wingwatch.telemetry.mavlink.vehicle import LinkVehicle

__all__ = ["LinkReceiver", "LinkSystem", "RoundTrip"]

_AUTOPILOT = 1
_MOST_SOURCES = 64
_MOST_COMPONENTS = 16
_MOST_UNKNOWN = 16
_MOST_EARLY = 512  # packets before the first heartbeat, parameters among them


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """A vehicle's answer to TIMESYNC.

    Attributes:
        system: number of the vehicle's system.
        asked_ns: the question's own stamp, sent back.
        vehicle_ns: what the vehicle's clock said.
        received_s: when the answer came, on the receiver's clock.
    """

    system: int
    asked_ns: int
    vehicle_ns: int
    received_s: float


@dataclass(slots=True)
class LinkSystem:
    """One system that is published.

    Attributes:
        number: of the system.
        vehicle: its messages and samples.
        sequences: packets lost, by component.
        source: where its packets come from.
        restarts: of its clock, as counted last.
        heard_s: when its last packet came.
    """

    number: int
    vehicle: LinkVehicle
    sequences: dict[int, PacketSequence] = field(default_factory=dict)
    source: object = None
    restarts: int = 0
    heard_s: float = nan


class LinkReceiver:
    """Takes in bytes from any number of senders.

    Args:
        names: name of each system to be published, by its number; None stands for the first vehicle that sends.
        travel_rad: deflections at full travel by channel, by the vehicle's name.
        patient: whether a vehicle's surfaces are waited for before its first sample.

    Attributes:
        systems: those received that are published, by number.
        others: packets of vehicles that are not named, by system number.
        round_trips: answers to TIMESYNC, for whoever asked; taken out by them.

    Raises:
        LinkError: pymavlink is not installed.
    """

    def __init__(
        self,
        names: Mapping[int | None, str],
        travel_rad: Mapping[str, Mapping[str, float]],
        patient: bool = True,
    ) -> None:
        self._layouts = layouts()
        self._names = dict(names)
        self._travel_rad = travel_rad
        self._patient = patient
        self._readers: dict[object, PacketReader] = {}
        self._gone: dict[str, int] = {}
        self._early: dict[int, deque[tuple[Packet, float]]] = {}
        self.systems: dict[int, LinkSystem] = {}
        self.others: dict[int, int] = {}
        self.round_trips: list[RoundTrip] = []

    def feed(self, data: bytes, received_s: float, source: object = None) -> None:
        """Bytes that came together.

        Args:
            data: any bytes.
            received_s: when they came, on the receiver's clock.
            source: whose they are; packets may be cut anywhere between two of one source.
        """
        reader = self._readers.get(source)
        if reader is None:
            reader = self._reader(source)
        for packet in reader.feed(data):
            system = self.systems.get(packet.system)
            if system is None:
                system = self._new_system(packet)
                if system is None:
                    self._keep(packet, received_s)
                    continue
                for early, early_s in self._early.pop(packet.system, ()):
                    self._take(system, early, early_s)
            system.source, system.heard_s = source, received_s
            self._take(system, packet, received_s)

    def counts(self) -> dict[str, int]:
        """What came in, over all senders."""
        total = dict(self._gone)
        for reader in self._readers.values():
            for name, value in reader.counts.items():
                total[name] = total.get(name, 0) + value
        return total

    def waiting(self) -> tuple[str, ...]:
        """Names of vehicles without a message."""
        found = {one.vehicle.name for one in self.systems.values()}
        return tuple(name for name in self._names.values() if name not in found)

    def _reader(self, source: object) -> PacketReader:
        """A reader for another sender; the oldest is forgotten where there are too many."""
        if len(self._readers) >= _MOST_SOURCES:
            oldest = next(iter(self._readers))
            for name, value in self._readers.pop(oldest).counts.items():
                self._gone[name] = self._gone.get(name, 0) + value
        reader = self._readers[source] = PacketReader(self._layouts)
        return reader

    def _new_system(self, packet: Packet) -> LinkSystem | None:
        """The system of a first heartbeat of a vehicle; None for packets of anybody else, which are counted."""
        beats = (
            packet.layout is not None and packet.layout.name == HEARTBEAT and packet.component == _AUTOPILOT
        )
        if beats and packet.layout is not None:
            record = np.frombuffer(packet.payload, dtype=packet.layout.dtype)[0]
            beats = is_vehicle(int(record["type"]), int(record["autopilot"]))
        name = self._names.get(packet.system)
        if name is None and beats and None in self._names:
            name = self._names.pop(None)
            self._names[packet.system] = name
        if beats and name is not None:
            vehicle = LinkVehicle(name, self._travel_rad[name], self._patient)
            system = self.systems[packet.system] = LinkSystem(packet.system, vehicle)
            self.others.pop(packet.system, None)
            return system
        if beats or packet.system in self.others:
            self.others[packet.system] = self.others.get(packet.system, 0) + 1
        return None

    def _keep(self, packet: Packet, received_s: float) -> None:
        """What comes before the heartbeat that says what it is of."""
        awaited = packet.system in self._names or None in self._names
        if not awaited or packet.layout is None or packet.component != _AUTOPILOT:
            return
        if packet.system not in self._early and len(self._early) >= _MOST_UNKNOWN:
            del self._early[next(iter(self._early))]
        self._early.setdefault(packet.system, deque(maxlen=_MOST_EARLY)).append((packet, received_s))

    def _take(self, system: LinkSystem, packet: Packet, received_s: float) -> None:
        sequence = system.sequences.get(packet.component)
        if sequence is None:
            if len(system.sequences) >= _MOST_COMPONENTS:
                return
            sequence = system.sequences[packet.component] = PacketSequence()
        if not sequence.arrived(packet.sequence, packet.checksum):
            return
        layout = packet.layout
        if layout is None or not layout.wanted or packet.component != _AUTOPILOT:
            return
        if layout.name == TIMESYNC:
            record = np.frombuffer(packet.payload, dtype=layout.dtype)[0]
            if record["tc1"] != 0 and len(self.round_trips) < _MOST_SOURCES:
                self.round_trips.append(
                    RoundTrip(system.number, int(record["ts1"]), int(record["tc1"]), received_s)
                )
            return
        system.vehicle.accept(packet, received_s)
        restarts = system.vehicle.clock.restarts
        if restarts != system.restarts:
            system.restarts = restarts
            sequence.restarted()
