"""Taking vehicles over from other workers and giving them up, as who watches which changes.

A vehicle that is taken over goes on from its last checkpoint, if there is one in the folder, with its alerts as the
database has them. One that is given up is no longer subscribed, its last state is saved, and no more is said of it. Who
takes over subscribes first and asks then: what both get is in the state already, and is dropped by its number.
"""

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, Self

from wingwatch.baselines import DatabaseError
from wingwatch.monitor import AlertView, SavedVehicle
from wingwatch.service.loops import Loop
from wingwatch.service.workers.ownership import Ownership

__all__ = ["MovesPorts", "VehicleMoves"]

Key = tuple[str, str]
"""Fleet and name of a vehicle."""

_LOG = logging.getLogger(__name__)
_LOOK_S = 1.0
_JOIN_S = 1.0
_PATIENCE_S = 5.0
_MOST_HEARD = 20_000
_RELEASED_S = 2.0
_AT_ONCE = 10
"""Vehicles taken over between two looks at who watches which."""


class MovingMonitor(Protocol):
    """What is needed of the fleet's monitor."""

    def take_over(
        self, fleet: str, vehicle: str, saved: SavedVehicle | None, alerts: Sequence[AlertView]
    ) -> None:
        """A vehicle is watched here from now on."""
        ...

    def knows(self, fleet: str, vehicle: str) -> bool:
        """Whether a vehicle is watched here."""
        ...


class MovingSubscriber(Protocol):
    """What is needed of the subscriber."""

    def prepare(self, fleet: str, vehicle: str) -> None:
        """Have its samples wait for a moment."""
        ...

    def cancel(self, fleet: str, vehicle: str) -> None:
        """What was prepared is not wanted."""
        ...

    def watch(self, fleet: str, vehicle: str) -> None:
        """Take its messages from now on, those first that have waited."""
        ...

    def leave(self, fleet: str, vehicle: str) -> None:
        """Take its messages no longer."""
        ...


class MovesPorts:
    """What vehicles are moved between.

    Args:
        monitor, subscriber: of this worker.
        checkpoint: a vehicle's last one, None without.
        alerts: a vehicle's, newest first; DatabaseError where they cannot be read.
        release: has others give vehicles up, if they have them; it returns once their states are written, or after a
            bounded time.
    """

    def __init__(
        self,
        monitor: MovingMonitor,
        subscriber: MovingSubscriber,
        checkpoint: Callable[[str, str], SavedVehicle | None],
        alerts: Callable[[str, str], Sequence[AlertView]],
        release: Callable[[Sequence[Key]], None] = lambda _: None,
    ) -> None:
        self.monitor, self.subscriber, self.checkpoint, self.alerts = monitor, subscriber, checkpoint, alerts
        self.release = release


class VehicleMoves:
    """Follows who watches which, once it has begun; use it in a ``with`` statement.

    Args:
        ownership: says which vehicles are this worker's.
        clock: monotonic seconds.

    Attributes:
        loop: takes over and gives up.
    """

    def __init__(self, ownership: Ownership, clock: Callable[[], float] = time.monotonic) -> None:
        self._ownership, self._clock = ownership, clock
        self._ports: MovesPorts | None = None
        self._leaving = False
        self._released_s: dict[Key, float] = {}
        self._unread_s: dict[Key, float] = {}
        self._heard: dict[Key, None] = {}
        self._own: set[Key] = set()
        self._lock = threading.Lock()
        self._counts = {"taken": 0, "given": 0, "failed": 0}
        self._changed, self._ending = threading.Event(), threading.Event()
        self.loop = Loop("wingwatch-moves", "the loop that takes vehicles over", self._run, self._changed.set)

    def begin(self, ports: MovesPorts) -> None:
        """Take over and give up from now on."""
        self._ports = ports
        self.loop.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._changed.set()
        if self.loop.alive:
            self.loop.join(_JOIN_S)

    @property
    def counts(self) -> Mapping[str, int]:
        """Vehicles ``taken`` over, those included that nobody had watched before, and ``given`` up; ``failed``: times
        that one could not be taken over."""
        with self._lock:
            return dict(self._counts)

    def owns(self, fleet: str, vehicle: str) -> bool:
        """Whether a vehicle has been taken over and not given up."""
        return (fleet, vehicle) in self._own

    def heard(self, fleet: str, vehicle: str) -> None:
        """A vehicle is there; returns at once."""
        key = fleet, vehicle
        if key in self._heard:
            return
        with self._lock:
            if len(self._heard) >= _MOST_HEARD:
                return
            self._heard[key] = None
        self._ownership.heard(fleet, vehicle)
        self._changed.set()

    def look_again(self) -> None:
        """Who watches which may have changed; returns at once."""
        self._changed.set()

    def give_up_all(self) -> None:
        """Take nothing over from now on, and give up everything; returns at once."""
        self._leaving = True
        self._changed.set()

    def turn(self) -> bool:
        """Give up what is another's, and take over some of what is this worker's; whether there is more to take."""
        ports = self._ports
        if ports is None:
            return False
        with self._lock:
            everyone = list(self._heard)
        now_s = self._clock()
        self._released_s = {k: at_s for k, at_s in self._released_s.items() if now_s - at_s < _RELEASED_S}
        owned = set() if self._leaving else self._ownership.owned(everyone)
        owned -= self._released_s.keys()
        for key in set(self._own) - owned:
            self._give(ports, key)
        fresh = [key for key in everyone if key in owned and key not in self._own]
        for key in fresh[:_AT_ONCE]:
            ports.subscriber.prepare(*key)
        if fresh:
            ports.release(fresh[:_AT_ONCE])
        for key in fresh[:_AT_ONCE]:
            try:
                self._take(ports, *key)
            except Exception:  # one vehicle's fault must not keep the others from being watched
                self._heard[key] = self._heard.pop(key)
                ports.subscriber.cancel(*key)
                self._count("failed")
                _LOG.exception("%s/%s cannot be taken over; it is tried again", *key)
        return len(fresh) > _AT_ONCE

    def release(self, vehicles: Sequence[Key]) -> None:
        """Give vehicles up that another worker wants to take over, and take none of them for two seconds."""
        ports, now_s = self._ports, self._clock()
        if ports is None:
            return
        for key in vehicles:
            with self._lock:
                owned = key in self._own
                if owned:
                    self._released_s[key] = now_s
            if owned:
                self._give(ports, key)

    def _give(self, ports: MovesPorts, key: Key) -> None:
        with self._lock:
            if key not in self._own:
                return
            self._own.discard(key)
        ports.subscriber.leave(*key)
        self._count("given")

    def _take(self, ports: MovesPorts, fleet: str, vehicle: str) -> None:
        alerts = self._alerts(ports, fleet, vehicle)
        if alerts is None:
            ports.subscriber.cancel(fleet, vehicle)
            return
        ports.monitor.take_over(fleet, vehicle, ports.checkpoint(fleet, vehicle), alerts)
        ports.subscriber.watch(fleet, vehicle)
        with self._lock:
            self._own.add((fleet, vehicle))
        self._count("taken")

    def _alerts(self, ports: MovesPorts, fleet: str, vehicle: str) -> Sequence[AlertView] | None:
        """As the database has them; None while it does not answer, and none once it has not for five seconds."""
        key = fleet, vehicle
        try:
            found = ports.alerts(fleet, vehicle)
        except DatabaseError as error:
            since_s = self._unread_s.setdefault(key, self._clock())
            if self._clock() - since_s < _PATIENCE_S:
                return None
            _LOG.warning("%s/%s is watched without its earlier alerts: %s", fleet, vehicle, error)
            found = ()
        self._unread_s.pop(key, None)
        return found

    def _count(self, what: str) -> None:
        with self._lock:
            self._counts[what] += 1

    def _run(self) -> None:
        while not self._ending.is_set():
            more = self.turn()
            self._changed.wait(0.0 if more else _LOOK_S)
            self._changed.clear()
