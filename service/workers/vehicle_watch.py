"""The vehicles that a worker watches: taken over, given up and dropped as its keeper says (``WatchPort``).

A vehicle is taken over from the checkpoint that came with its release, else from the newest in the folder, and without
either from what the database keeps: its alerts are read there in any case. It is given up with its state written. What
it sends while it is asked for waits here: what its last worker has taken in as well is dropped by its number.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Protocol

from wingwatch.baselines import Lease, VehicleName
from wingwatch.monitor import AlertView, SavedVehicle

__all__ = ["VehicleWatch", "WatchParts"]

_MOST_HEARD = 20_000
_PATIENCE_S = 1.0
_LOOK_S = 0.01
_EXPECTED_S = 4.0  # an answer comes within two; what waits longer would hold up the link


class WatchedMonitor(Protocol):
    """What is needed of the fleet's monitor."""

    def take_over(
        self, fleet: str, vehicle: str, saved: SavedVehicle | None, alerts: Sequence[AlertView]
    ) -> None:
        """A vehicle is watched here from now on."""
        ...

    def knows(self, fleet: str, vehicle: str) -> bool:
        """Whether a vehicle is watched here."""
        ...


class WatchedSubscriber(Protocol):
    """What is needed of the subscriber."""

    def watch(self, fleet: str, vehicle: str) -> None:
        """Take its messages from now on, those first that have waited."""
        ...

    def prepare(self, fleet: str, vehicle: str) -> None:
        """Have its samples wait for a moment."""
        ...

    def cancel(self, fleet: str, vehicle: str) -> None:
        """What was prepared is not wanted."""
        ...

    def leave(self, fleet: str, vehicle: str) -> None:
        """Take its messages no longer, behind all that have come."""
        ...

    def drop(self, fleet: str, vehicle: str) -> None:
        """Take its messages no longer, nor those that wait."""
        ...


class WatchedCheckpoints(Protocol):
    """What is needed of the folder of checkpoints."""

    @property
    def idle(self) -> bool:
        """Whether every state that was handed over is written, or given up."""
        ...

    def read(self, fleet: str, vehicle: str) -> SavedVehicle | None:
        """One vehicle's."""
        ...

    def decoded(self, data: bytes, where: str) -> SavedVehicle | None:
        """One that came as bytes."""
        ...

    def begin_hand_over(self, vehicles: Collection[VehicleName]) -> None:
        """Keep what is written of these for ``handed_over``."""
        ...

    def handed_over(self, vehicles: Collection[VehicleName]) -> Mapping[VehicleName, bytes]:
        """The last states of these."""
        ...

    def drop(self, fleet: str, vehicle: str) -> None:
        """Write nothing that waits of a vehicle."""
        ...


class WatchedStore(Protocol):
    """What is needed of the store."""

    def alerts_of(self, fleet: str, vehicle: str) -> Sequence[AlertView]:
        """A vehicle's alerts, newest first."""
        ...

    def wait_for(self, vehicles: Collection[VehicleName], patience_s: float) -> bool:
        """Wait until nothing of these waits to be written."""
        ...

    def drop(self, fleet: str, vehicle: str, lease: Lease) -> None:
        """Drop what waits of a vehicle under this lease."""
        ...


class WatchParts(Protocol):
    """A watch (``wingwatch.service.watch.Watch``), as far as it is needed."""

    @property
    def monitor(self) -> WatchedMonitor:
        """Of the fleet."""
        ...

    @property
    def subscriber(self) -> WatchedSubscriber:
        """What takes messages."""
        ...

    @property
    def checkpoints(self) -> WatchedCheckpoints:
        """Where states are kept."""
        ...

    @property
    def store(self) -> WatchedStore:
        """Of the database."""
        ...


class VehicleWatch:
    """Implements the keeper's ``WatchPort``, once it is begun.

    Args:
        forget: called with vehicles that gave way to others here.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        forget: Callable[[Collection[VehicleName]], object] = lambda _: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._forget, self._clock = forget, clock
        self._parts: WatchParts | None = None
        self._heard: dict[VehicleName, None] = {}
        self._watched: set[VehicleName] = set()
        self._expected: dict[VehicleName, float] = {}
        self._forgotten: deque[VehicleName] = deque()
        self._lock = threading.Lock()

    def begin(self, parts: WatchParts) -> None:
        """Vehicles can be watched from now on."""
        self._parts = parts

    # -- in any thread ------------------------------------------------------------------------------

    def heard(self, fleet: str, vehicle: str) -> None:
        """A vehicle is there; returns at once."""
        if (fleet, vehicle) in self._heard:
            return
        with self._lock:
            if len(self._heard) >= _MOST_HEARD:
                return
            self._heard[fleet, vehicle] = None

    def watches(self, fleet: str, vehicle: str) -> bool:
        """Whether a vehicle has been taken over, and neither given up nor dropped."""
        return (fleet, vehicle) in self._watched

    def expect(self, vehicle: VehicleName) -> None:
        """Another worker is asked for a vehicle: what it sends meanwhile waits here, for a few seconds."""
        self._begun().subscriber.prepare(*vehicle)
        self._expected[vehicle] = self._clock()

    def forgotten(self, vehicle: VehicleName) -> None:
        """The monitor has made room for another one; returns at once."""
        self._forgotten.append(vehicle)

    # -- in the keeper's thread -----------------------------------------------------------------------

    def known(self) -> Collection[VehicleName]:
        """Vehicles that send or are announced."""
        with self._lock:
            return tuple(self._heard)

    def start(self, vehicle: VehicleName, lease: Lease, state: bytes | None) -> None:
        """Watch a vehicle from now on.

        Raises:
            DatabaseError: its alerts cannot be read.
            RuntimeError: samples of its former watch here are still being taken in.
        """
        parts = self._begun()
        if not self._wait(lambda: not parts.monitor.knows(*vehicle), _PATIENCE_S):
            raise RuntimeError("its former watch here has not ended yet")
        alerts = parts.store.alerts_of(*vehicle)
        saved = parts.checkpoints.decoded(state, "that came with its release") if state else None
        try:
            parts.monitor.take_over(*vehicle, saved or parts.checkpoints.read(*vehicle), alerts)
            parts.subscriber.watch(*vehicle)
        except Exception:
            parts.subscriber.drop(*vehicle)
            raise
        self._watched.add(vehicle)
        self._expected.pop(vehicle, None)
        self.heard(*vehicle)  # it may be known here from its lease alone

    def stop(self, vehicles: Sequence[VehicleName]) -> Mapping[VehicleName, bytes]:
        """Watch these no longer, and give their checkpoints; what waits of them is written, within a second."""
        parts, until_s = self._begun(), self._clock() + _PATIENCE_S
        parts.checkpoints.begin_hand_over(vehicles)
        self._watched -= set(vehicles)
        for vehicle in vehicles:
            parts.subscriber.leave(*vehicle)
        if not self._wait(lambda: not any(parts.monitor.knows(*one) for one in vehicles), _PATIENCE_S):
            for vehicle in vehicles:
                if parts.monitor.knows(*vehicle):  # too much waits of it: its next worker begins without that
                    parts.subscriber.drop(*vehicle)
        self._wait(lambda: parts.checkpoints.idle, until_s - self._clock())
        parts.store.wait_for(vehicles, max(0.0, until_s - self._clock()))
        return parts.checkpoints.handed_over(vehicles)

    def drop(self, vehicle: VehicleName, lease: Lease) -> None:
        """The vehicle is another worker's already: watch it no longer, and keep nothing of what waits."""
        parts = self._begun()
        self._watched.discard(vehicle)
        parts.subscriber.drop(*vehicle)
        parts.store.drop(*vehicle, lease)
        parts.checkpoints.drop(*vehicle)

    def tidy(self) -> None:
        """Give up what the monitor has made room for (a name that sends again is a new one), and what did not come."""
        late = [one for one, at_s in self._expected.items() if self._clock() - at_s > _EXPECTED_S]
        for vehicle in late:
            self._expected.pop(vehicle)
            self._begun().subscriber.cancel(*vehicle)
        gone: list[VehicleName] = []
        while self._forgotten:
            gone.append(self._forgotten.popleft())
        for vehicle in gone:
            self._watched.discard(vehicle)
            self._begun().subscriber.drop(*vehicle)
            with self._lock:
                self._heard.pop(vehicle, None)
        if gone:
            self._forget(gone)

    def _begun(self) -> WatchParts:
        if self._parts is None:
            raise RuntimeError("the watch has not begun")
        return self._parts

    def _wait(self, condition: Callable[[], bool], patience_s: float) -> bool:
        until_s = self._clock() + patience_s
        while not (held := condition()) and self._clock() < until_s:
            time.sleep(_LOOK_S)
        return held
