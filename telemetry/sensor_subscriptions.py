"""Which sensors are subscribed: those of every vehicle by one key expression, or of some vehicles, each by its key.

Zenoh fills a channel for each subscription; one thread looks into all of them. That costs 3 us a message more than one
channel for all. A callback for all would cost as little, and stop whoever computes at every message
(``docs/decisions/0118-workers-and-gateways.md``).
"""

import threading
from typing import Any

import zenoh

from wingwatch.telemetry.keys import KEY_ROOT, vehicle_key

__all__ = ["CHANNEL", "SensorSubscriptions", "waiting_in"]

CHANNEL = 16_384
"""Messages that a channel of all vehicles takes; a link whose channel is full waits."""
_OF_ONE = 1024


class SensorSubscriptions:
    """Subscriptions of sensors; ``prepare``, ``watch`` and ``leave`` may be called in any thread.

    Args:
        session: open.
        every: whether all vehicles' are subscribed; else only those that are watched.
    """

    def __init__(self, session: zenoh.Session, every: bool) -> None:
        self._session, self._every = session, every
        self._lock = threading.Lock()
        self._own: dict[tuple[str, str], Any] = {}
        self._prepared: dict[tuple[str, str], Any] = {}
        self._channels: tuple[Any, ...] = ()
        if every:
            channel: Any = zenoh.handlers.FifoChannel(CHANNEL)
            self._channels = (session.declare_subscriber(f"{KEY_ROOT}/*/*/sensors", channel),)

    def wants(self, fleet: str, vehicle: str) -> bool:
        """Whether a vehicle's are subscribed."""
        return self._every or (fleet, vehicle) in self._own

    def prepare(self, fleet: str, vehicle: str) -> None:
        """Have a vehicle's messages wait from now on, for a moment: ``watch`` or ``cancel`` follows at once."""
        if self.wants(fleet, vehicle) or (fleet, vehicle) in self._prepared:
            return
        channel: Any = zenoh.handlers.FifoChannel(_OF_ONE)
        subscriber = self._session.declare_subscriber(vehicle_key(fleet, vehicle, "sensors"), channel)
        with self._lock:
            self._prepared[fleet, vehicle] = subscriber

    def watch(self, fleet: str, vehicle: str) -> None:
        """Give a vehicle's messages from now on, those first that have waited."""
        self.prepare(fleet, vehicle)
        with self._lock:
            prepared = self._prepared.pop((fleet, vehicle), None)
            if prepared is not None:
                self._own[fleet, vehicle] = prepared
                self._channels = tuple(self._own.values())

    def cancel(self, fleet: str, vehicle: str) -> None:
        """What was prepared is not wanted."""
        with self._lock:
            gone = self._prepared.pop((fleet, vehicle), None)
        if gone is not None:
            gone.undeclare()

    def last_of(self, fleet: str, vehicle: str) -> list[zenoh.Sample]:
        """What waits of one vehicle."""
        channel = self._own.get((fleet, vehicle))
        return [] if channel is None else waiting_in(channel)

    def leave(self, fleet: str, vehicle: str) -> None:
        """Subscribe a vehicle's no longer; what its channel holds is lost."""
        with self._lock:
            gone = self._own.pop((fleet, vehicle), None)
            if gone is None:
                return
            self._channels = tuple(self._own.values())
        gone.undeclare()

    def waiting(self) -> list[zenoh.Sample]:
        """All that the channels hold now."""
        return [sample for channel in self._channels for sample in waiting_in(channel)]

    def close(self) -> None:
        """End all subscriptions."""
        with self._lock:
            channels, self._channels = (*self._channels, *self._prepared.values()), ()
            self._own.clear()
            self._prepared.clear()
        for channel in channels:
            channel.undeclare()


def waiting_in(channel: Any) -> list[zenoh.Sample]:
    """All that a channel holds now, not more than it can hold."""
    taken: list[zenoh.Sample] = []
    while len(taken) < CHANNEL and (sample := channel.try_recv()) is not None:
        taken.append(sample)
    return taken
