"""Telemetry logs of ground stations: MAVLink packets, each behind the microseconds of the station's clock."""

import re
import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wingwatch.telemetry.logs.link_facts import (
    AUTOPILOTS,
    boot_s,
    is_vehicle,
    next_wrap_s,
    parameter_value,
    vehicle_word,
)
from wingwatch.telemetry.logs.log import AutopilotLog, LogError, Topic, topic_key

__all__ = ["is_tlog", "read_tlog"]

_STAMP_BYTES = 8
_EARLIEST_US, _LATEST_US = 946_684_800_000_000, 4_102_444_800_000_000  # the years 2000 and 2100
_MAGICS = (0xFD, 0xFE)
_OVERHEAD = {0xFD: 12, 0xFE: 8}
_SIGNATURE_BYTES = 13
_MOST_ATTEMPTS = 200_000  # packets begun in vain, after which the rest is taken for garbage

_BEGINNING = re.compile(rb"(?s)\x00[\x03-\x0e].{6}[\xfd\xfe]")
"""A stamp of this century, and what a packet begins with."""

_AUTOPILOT_COMPONENT = 1
_SERVOS = "SERVO_OUTPUT_RAW"


def is_tlog(data: bytes) -> bool:
    """Whether a file begins with a stamp of this century and a packet."""
    if len(data) <= _STAMP_BYTES:
        return False
    (stamp,) = struct.unpack_from(">Q", data)
    return _EARLIEST_US < stamp < _LATEST_US and data[_STAMP_BYTES] in _MAGICS


@dataclass(slots=True)
class _Rows:
    """Messages of one name: when they came, what the vehicle's clock said, their fields."""

    received_s: list[float] = field(default_factory=list)
    boot_s: list[float] = field(default_factory=list)
    columns: dict[str, list[float]] = field(default_factory=dict)

    def add(self, received_s: float, stamp_s: float, values: dict[str, float]) -> None:
        """One more message."""
        self.received_s.append(received_s)
        self.boot_s.append(stamp_s)
        for name, value in values.items():
            self.columns.setdefault(name, [np.nan] * (len(self.received_s) - 1)).append(value)
        for column in self.columns.values():
            if len(column) < len(self.received_s):
                column.append(np.nan)


def read_tlog(source: str, data: bytes) -> AutopilotLog:
    """A log from the bytes of a file that ``is_tlog``.

    Stamps are the vehicle's own where a message carries them; others are the station's, brought to the vehicle's clock.

    Raises:
        LogError: the library is not installed, or no packet of a vehicle can be read.
    """
    try:
        from pymavlink.dialects.v20 import ardupilotmega
    except ImportError:
        raise LogError(
            f"{source}: telemetry logs need pymavlink, which is not installed; install wingwatch with its extra logs"
        ) from None
    decoder = ardupilotmega.MAVLink(None)
    by_system: dict[int, dict[str, _Rows]] = {}
    parameters: dict[int, dict[str, tuple[float, int]]] = {}
    kinds: dict[int, Counter[tuple[int, int]]] = {}
    boots: dict[int, float] = {}
    lost = _Lost()
    for received_s, message in _packets(decoder, data, lost):
        system, name = message.get_srcSystem(), message.get_type()
        if message.get_srcComponent() != _AUTOPILOT_COMPONENT:
            continue  # gimbals and companions send attitudes of their own
        if name == "HEARTBEAT" and is_vehicle(message.type, message.autopilot):
            kinds.setdefault(system, Counter())[message.autopilot, message.type] += 1
        if name == "PARAM_VALUE":
            value = float(message.param_value), int(message.param_type)
            parameters.setdefault(system, {})[message.param_id] = value
            continue
        values = _numbers(message)
        stamp_s = boot_s(values.get("time_boot_ms"), values.get("time_usec"))
        if name == _SERVOS:
            stamp_s = next_wrap_s(stamp_s, boots.get(system, np.nan))
        elif np.isfinite(stamp_s):
            boots[system] = stamp_s
        key = topic_key(name, int(values.get("port", 0.0)) if name == _SERVOS else 0)
        by_system.setdefault(system, {}).setdefault(key, _Rows()).add(received_s, stamp_s, values)
    if not kinds:
        raise LogError(f"{source}: the telemetry log holds no heartbeat of a vehicle; record it with one")
    system = max(kinds, key=lambda one: kinds[one].total())
    autopilot, kind = kinds[system].most_common(1)[0][0]
    notes = lost.notes()
    if len(kinds) > 1:
        notes.append(f"{len(kinds)} vehicles are in the log, system {system} is read")
    topics = _topics(by_system.get(system, {}))
    name = AUTOPILOTS.get(autopilot, "")
    known = {key: parameter_value(*value, name) for key, value in parameters.get(system, {}).items()}
    return AutopilotLog(source, "tlog", name, vehicle_word(kind), name, topics, known, tuple(notes))


@dataclass(slots=True)
class _Lost:
    """What of a file is no packet."""

    damaged: int = 0
    cut: bool = False

    def notes(self) -> list[str]:
        """One clause each."""
        notes = [f"{self.damaged} bytes are damaged, the packets in them are lost"] if self.damaged else []
        return [*notes, "the file ends within a packet: it is cut short"] if self.cut else notes


def _packets(decoder: Any, data: bytes, lost: _Lost) -> Iterator[tuple[float, Any]]:
    """Stamps in s and messages; what is none is counted and passed over."""
    at, attempts = 0, 0
    while at + _STAMP_BYTES + _OVERHEAD[0xFE] <= len(data):
        start = at + _STAMP_BYTES
        (stamp,) = struct.unpack_from(">Q", data, at)
        magic = data[start]
        if _EARLIEST_US < stamp < _LATEST_US and magic in _MAGICS:
            length = data[start + 1] + _OVERHEAD[magic]
            if magic == 0xFD and data[start + 2] & 1:
                length += _SIGNATURE_BYTES
            if start + length > len(data):
                lost.cut = True
                return
            attempts += 1
            message = _decoded(decoder, data[start : start + length])
            if message is not None:
                attempts = 0
                if message.get_type() != "BAD_DATA":
                    yield stamp / 1e6, message
                at = start + length
                continue
        if attempts > _MOST_ATTEMPTS:
            lost.damaged += len(data) - at
            return
        found = _BEGINNING.search(data, at + 1)
        after = len(data) if found is None else found.start()
        lost.damaged += after - at
        at = after
    lost.cut = lost.cut or at < len(data)


def _decoded(decoder: Any, packet: bytes) -> Any:
    """The message of a packet, None for damage; packets that the library does not know are passed as damage too."""
    try:
        return decoder.decode(bytearray(packet))
    except Exception:  # a damaged packet makes the library raise almost anything
        return None


def _numbers(message: Any) -> dict[str, float]:
    values: dict[str, float] = {}
    for name in message.get_fieldnames():
        value = getattr(message, name)
        if isinstance(value, int | float):
            values[name] = float(value)
        elif isinstance(value, list | tuple):
            values |= {f"{name}[{i}]": float(v) for i, v in enumerate(value) if isinstance(v, int | float)}
    return values


def _topics(rows: dict[str, _Rows]) -> dict[str, Topic]:
    """Each name a topic; stations' stamps become the vehicle's by the delay of the link's quickest packet."""
    delays = [
        np.array(one.received_s) - np.array(one.boot_s)
        for one in rows.values()
        if np.isfinite(one.boot_s).all()
    ]
    offset = min((float(delay.min()) for delay in delays if delay.size), default=0.0)
    topics = {}
    for key, one in rows.items():
        boot = np.array(one.boot_s)
        stamps = boot if np.isfinite(boot).all() else np.array(one.received_s) - offset
        fields = {name: np.array(column) for name, column in one.columns.items()}
        name, _, instance = key.removesuffix("]").partition("[")
        topics[key] = Topic(name, int(instance), stamps, fields)
    return topics
