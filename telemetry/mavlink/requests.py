"""What is asked of vehicles: the parameters of their surfaces, the time, and, where it is wanted, message rates."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from wingwatch.telemetry.mavlink.dialect import library
from wingwatch.telemetry.mavlink.receiver import LinkReceiver, LinkSystem
from wingwatch.telemetry.mavlink.vehicle import LinkVehicle

__all__ = ["LinkRequests", "wanted_parameters"]

_OWN_SYSTEM, _OWN_COMPONENT = 245, 191
"""A companion computer's: no ground station's number, whose heartbeats would hold off a vehicle's failsafe."""

_AUTOPILOT = 1
_BEAT_S, _SYNC_S, _ASK_S, _RATES_S = 1.0, 5.0, 0.5, 10.0
_AT_ONCE = 10
_MOST_TIMES = 6
_MOST_WAITING = 16
_OUTPUTS = 16
_SET_INTERVAL = 511
_SLOW_HZ = 5.0
_FAST = ("ATTITUDE", "SERVO_OUTPUT_RAW", "VFR_HUD")
_IMU = {"px4": "HIGHRES_IMU"}
_SLOW = ("SCALED_PRESSURE", "GLOBAL_POSITION_INT")
_ARDUPILOT_SURFACES = frozenset((4, 19, 21, 24, 25, 70, 77, 78, 79, 80))


def wanted_parameters(autopilot: str, known: Mapping[str, float]) -> Iterator[str]:
    """Parameters that surfaces are made by, and that are not known yet, in the order in which they are of use.

    Args:
        autopilot: ``px4`` or ``ardupilot``.
        known: values so far; what an output is for says which others of it are wanted.
    """
    names = _ardupilot(known) if autopilot == "ardupilot" else _px4(known) if autopilot == "px4" else ()
    return (name for name in names if name not in known)


def _ardupilot(known: Mapping[str, float]) -> Iterator[str]:
    for number in range(1, _OUTPUTS + 1):
        yield f"SERVO{number}_FUNCTION"
    for number in range(1, _OUTPUTS + 1):
        if known.get(f"SERVO{number}_FUNCTION") in _ARDUPILOT_SURFACES:
            yield from (f"SERVO{number}_{end}" for end in ("MIN", "TRIM", "MAX", "REVERSED"))


def _px4(known: Mapping[str, float]) -> Iterator[str]:
    yield "CA_SV_CS_COUNT"
    for number in range(min(int(known.get("CA_SV_CS_COUNT", 0)), _OUTPUTS)):
        yield from (f"CA_SV_CS{number}_{end}" for end in ("TYPE", "TRQ_R", "TRQ_P", "TRQ_Y"))
    yield "PWM_MAIN_REV"
    for number in range(1, 9):
        yield f"PWM_MAIN_FUNC{number}"
        if 200 < known.get(f"PWM_MAIN_FUNC{number}", 0) <= 200 + _OUTPUTS:
            yield from (f"PWM_MAIN_{end}{number}" for end in ("MIN", "MAX"))


@dataclass(slots=True)
class _Asked:
    """What a vehicle was asked so far."""

    times: dict[str, int] = field(default_factory=dict)
    next_s: float = 0.0
    sync_s: float = 0.0
    rates_s: float = 0.0
    rates_left: int = _MOST_TIMES
    stream: int = 1


class LinkRequests:
    """Sends a heartbeat, TIMESYNC, PARAM_REQUEST_READ and SET_MESSAGE_INTERVAL when they are due.

    Args:
        send: hands bytes to a source of the link, None for a link that has one peer.
        rates_hz: rate to ask for; None leaves the vehicle's own.
    """

    def __init__(self, send: Callable[[bytes, object], None], rates_hz: float | None = None) -> None:
        self._send = send
        self._rates_hz = rates_hz
        self._dialect = library()
        self._writer = self._dialect.MAVLink(None, srcSystem=_OWN_SYSTEM, srcComponent=_OWN_COMPONENT)
        self._asked: dict[int, _Asked] = {}
        self._waiting: dict[int, float] = {}
        self._beat_s = float("-inf")

    def step(self, receiver: LinkReceiver, now_s: float) -> None:
        """What is due now; answers to TIMESYNC are taken in."""
        self._take_round_trips(receiver, now_s)
        beat = now_s - self._beat_s >= _BEAT_S
        if beat:
            self._beat_s = now_s
            if not receiver.systems:
                self._put(self._heartbeat(), None)
        for system in receiver.systems.values():
            if beat:
                self._put(self._heartbeat(), system.source)
            self._ask(system, now_s)

    def _heartbeat(self) -> Any:
        dialect = self._dialect
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_ONBOARD_CONTROLLER, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
        )

    def _put(self, message: Any, source: object) -> None:
        data = bytes(message.pack(self._writer))
        self._writer.seq = (self._writer.seq + 1) % 256
        self._send(data, source)

    def _ask(self, system: LinkSystem, now_s: float) -> None:
        asked = self._asked.setdefault(system.number, _Asked())
        if asked.stream != system.vehicle.streams:  # started anew: it has forgotten its rates
            asked = self._asked[system.number] = _Asked(stream=system.vehicle.streams)
        if now_s - asked.sync_s >= _SYNC_S:
            asked.sync_s = now_s
            stamp_ns = round(now_s * 1e9)
            while len(self._waiting) >= _MOST_WAITING * max(1, len(self._asked)):
                del self._waiting[next(iter(self._waiting))]
            self._waiting[stamp_ns] = now_s
            self._put(self._dialect.MAVLink_timesync_message(0, stamp_ns), system.source)
        if now_s >= asked.next_s:
            asked.next_s = now_s + _ASK_S
            for name in self._next_parameters(system.vehicle, asked):
                asked.times[name] = asked.times.get(name, 0) + 1
                self._put(self._parameter(system.number, name), system.source)
        if self._rates_hz is not None and asked.rates_left and now_s - asked.rates_s >= _RATES_S:
            asked.rates_s, asked.rates_left = now_s, asked.rates_left - 1
            for message in self._rates(system, self._rates_hz):
                self._put(message, system.source)

    def _next_parameters(self, vehicle: LinkVehicle, asked: _Asked) -> list[str]:
        found = []
        for name in wanted_parameters(vehicle.heartbeat.autopilot, vehicle.parameters):
            if asked.times.get(name, 0) < _MOST_TIMES:
                found.append(name)
            if len(found) == _AT_ONCE:
                break
        return found

    def _parameter(self, number: int, name: str) -> Any:
        return self._dialect.MAVLink_param_request_read_message(number, _AUTOPILOT, name.encode(), -1)

    def _rates(self, system: LinkSystem, rate_hz: float) -> Iterator[Any]:
        imu = _IMU.get(system.vehicle.heartbeat.autopilot, "RAW_IMU")
        wanted = dict.fromkeys((*_FAST, imu), rate_hz) | {name: min(rate_hz, _SLOW_HZ) for name in _SLOW}
        for name, rate in wanted.items():
            number = getattr(self._dialect, f"MAVLINK_MSG_ID_{name}")
            yield self._dialect.MAVLink_command_long_message(
                system.number, _AUTOPILOT, _SET_INTERVAL, 0, number, 1e6 / rate, 0, 0, 0, 0, 0
            )

    def _take_round_trips(self, receiver: LinkReceiver, now_s: float) -> None:
        for trip in receiver.round_trips:
            sent_s = self._waiting.pop(trip.asked_ns, None)
            if sent_s is not None and trip.system in receiver.systems:
                clock = receiver.systems[trip.system].vehicle.clock
                clock.round_trip(sent_s, min(now_s, trip.received_s), trip.vehicle_ns / 1e9)
        receiver.round_trips.clear()
