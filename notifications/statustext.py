"""Notices as MAVLink's STATUSTEXT, to QGroundControl, Mission Planner and the like (extra ``logs``).

Source: MAVLink's common messages, STATUSTEXT (253) and HEARTBEAT (0). A text above 50 characters goes in chunks that
share an ``id``; a chunk with a null in it is the last.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from wingwatch.notifications.channel import ChannelError, NotDeliveredError
from wingwatch.notifications.mavlink_port import MavlinkPort
from wingwatch.notifications.notice import Notice, Step
from wingwatch.notifications.wording import short_text

__all__ = ["ONBOARD_COMPUTER", "StatustextChannel", "StatustextSettings", "chunks"]

_LOG = logging.getLogger(__name__)
ONBOARD_COMPUTER = 191
"""MAV_COMP_ID_ONBOARD_COMPUTER."""
_CHUNK = 50
_MOST_CHUNKS = 6
_BEAT_S = 1.0
_MOST_REPEATS = 64
_CRITICAL, _WARNING, _NOTICE, _INFO = 2, 4, 5, 6
_ONBOARD_CONTROLLER, _NO_AUTOPILOT, _ACTIVE = 18, 8, 4
"""MAV_TYPE_ONBOARD_CONTROLLER, MAV_AUTOPILOT_INVALID, MAV_STATE_ACTIVE."""


@dataclass(frozen=True, slots=True)
class StatustextSettings:
    """Where texts go, and as whose.

    Attributes:
        connect: as ``MavlinkPort`` takes it.
        systems: MAVLink's system ids (1 to 255) of vehicles, by ``vehicle`` or ``fleet/vehicle``.
        system: of vehicles that are not among them; their texts name the vehicle.
        component: of what sends.
    """

    connect: str
    systems: Mapping[str, int] = field(default_factory=dict)
    system: int = 1
    component: int = ONBOARD_COMPUTER


class StatustextChannel:
    """Sends texts, each once more a second later since UDP loses, and a heartbeat a second for each system.

    Args:
        settings: of it.

    Raises:
        ChannelError: pymavlink is not installed, or ``connect`` cannot be used.
    """

    keeps_first = False  # an alert is to be on the pilot's screen before a slow disk has it

    def __init__(self, settings: StatustextSettings) -> None:
        try:
            from pymavlink.dialects.v20 import common
        except ImportError:
            raise ChannelError(
                "pymavlink is not installed; install wingwatch with its extra logs (pip install 'wingwatch[logs]')"
            ) from None
        self._settings, self._port, self.place = settings, MavlinkPort(settings.connect), settings.connect
        systems = sorted({*settings.systems.values(), settings.system})
        component = settings.component
        self._links: dict[int, Any] = {
            system: common.MAVLink(None, srcSystem=system, srcComponent=component) for system in systems
        }
        self._lock, self._ended = threading.Lock(), threading.Event()
        self._again: deque[tuple[float, Callable[[], list[bytes]]]] = deque(maxlen=_MOST_REPEATS)
        self._number = 0
        self._beats = threading.Thread(target=self._beat, name="wingwatch-notify", daemon=True)
        self._beats.start()

    def send(self, notice: Notice) -> None:
        """Send a text; it has arrived for all that UDP says. A test goes to every system that is named."""
        alert, settings = notice.alert, self._settings
        system = settings.systems.get(
            f"{alert['fleet']}/{alert['vehicle']}", settings.systems.get(alert["vehicle"])
        )
        text = chunks(short_text(notice, "" if system is not None else str(alert["vehicle"])))
        sources = sorted({*settings.systems.values()}) if notice.test else ()
        with self._lock:
            self._number = self._number % 0xFFFF + 1
            number = self._number if len(text) > 1 else 0
            for source in sources or (system or settings.system,):
                packets = partial(self._packets, source, _severity(notice), text, number)
                try:
                    self._port.send(*packets())
                except OSError as error:
                    raise NotDeliveredError((error.strerror or type(error).__name__).lower()) from None
                self._again.append((time.monotonic() + _BEAT_S, packets))

    def close(self) -> None:
        """Send what is to be sent once more now, and end the heartbeat."""
        self._ended.set()
        self._beats.join(2.0 * _BEAT_S)
        with self._lock:
            self._repeat(float("inf"))
            self._port.close()

    def _packets(self, system: int, severity: int, text: list[bytes], number: int) -> list[bytes]:
        link = self._links[system]
        return [
            _packed(link, link.statustext_encode(severity, chunk, number, sequence))
            for sequence, chunk in enumerate(text)
        ]

    def _beat(self) -> None:
        """Until the end: a station knows the component by its heartbeat."""
        while not self._ended.is_set():
            with self._lock:
                self._repeat(time.monotonic())
                self._safely(self._heartbeats)
            self._ended.wait(_BEAT_S)

    def _heartbeats(self) -> list[bytes]:
        kind = _ONBOARD_CONTROLLER, _NO_AUTOPILOT, 0, 0, _ACTIVE
        return [_packed(link, link.heartbeat_encode(*kind)) for link in self._links.values()]

    def _repeat(self, until_s: float) -> None:
        while self._again and self._again[0][0] <= until_s:
            self._safely(self._again.popleft()[1])

    def _safely(self, packets: Callable[[], list[bytes]]) -> None:
        """What a station that is not there misses is not sent again: only a notice's first text says that it failed."""
        try:
            self._port.send(*packets())
        except OSError as error:
            _LOG.debug("%s: %s", self.place, error)
        except Exception:  # the heartbeat must not end; notices say what fails in them
            _LOG.debug("%s: a packet cannot be made", self.place, exc_info=True)


def chunks(text: str) -> list[bytes]:
    """A text in ASCII as chunks of 50 characters at most; the last of several has room for the null that ends it.

    A text that is too long for six is cut.
    """
    whole = text.encode("ascii", "replace")
    if len(whole) <= _CHUNK:
        return [whole]
    most = _MOST_CHUNKS * _CHUNK - 1
    if len(whole) > most:
        whole = whole[: most - 3] + b"..."
    return [whole[start : start + _CHUNK] for start in range(0, len(whole) + 1, _CHUNK)]


def _severity(notice: Notice) -> int:
    """MAV_SEVERITY: of the level where an alert is raised or has changed, NOTICE where it is cleared, else INFO."""
    if notice.test or Step.CLEARED in notice.steps:
        return _NOTICE
    if {Step.RAISED, Step.LEVEL, Step.CAUSE}.isdisjoint(notice.steps):
        return _INFO
    return {"critical": _CRITICAL, "warning": _WARNING}.get(notice.alert["level"], _NOTICE)


def _packed(link: Any, message: Any) -> bytes:
    """A message as it goes over the wire, with the next number of its sender."""
    packet = bytes(message.pack(link))
    link.seq = (link.seq + 1) % 256
    return packet
