"""When the state of which vehicle of a live fleet is saved, and how all go on at the start."""

import logging
from collections.abc import Callable, Iterator, Mapping
from functools import partial

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import Envelope
from wingwatch.monitor.fleet.context import FleetContext, Outgoing
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.fleet.resuming import Checkpoints, goes_on, resumed_vehicle, saved_vehicle
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.vehicle.checkpoint import CheckpointError, SavedVehicle

__all__ = ["FleetCheckpoints"]

_LOG = logging.getLogger(__name__)
_CHECKPOINTS_A_SECOND = 10  # of all vehicles together: half a megabyte each, and 3 ms of processor time
_SAVED_AT_ONCE = 2  # vehicles' states between two rounds of messages: 0.24 ms each


class FleetCheckpoints:
    """Saves the states of a fleet's vehicles, a few at a time.

    Args:
        context: of the fleet.
        checkpoints: where they are kept, or None: then nothing is saved.
    """

    def __init__(self, context: FleetContext, checkpoints: Checkpoints | None) -> None:
        self._context, self._checkpoints = context, checkpoints

    def save_some(self, ready: Mapping[VehicleKey, KnownVehicle]) -> None:
        """Hand over the states that are due, with the lock held: at once where an alert has changed."""
        checkpoints = self._checkpoints
        if checkpoints is None:
            return
        left, now_s = _SAVED_AT_ONCE, self._context.clock()
        among = len(self._context.vehicles) / _CHECKPOINTS_A_SECOND
        interval_s = max(self._context.settings.checkpoint_interval_s, among)
        for key, known in ready.items():
            saving, urgent = known.saving, known.saving.urgent
            due = saving.unsaved and now_s - saving.checkpoint_s >= interval_s
            if urgent or (due and left and checkpoints.has_room()):
                left -= not urgent
                saved = self._saved(key, known)
                if saved is not None:
                    checkpoints.keep(saved, urgent)

    def save_now(self, key: VehicleKey, known: KnownVehicle) -> None:
        """Hand over a vehicle's state at once, with the lock held."""
        known.saving.hurry()
        self.save_some({key: known})

    def unsaved(self) -> Iterator[SavedVehicle]:
        """States that have changed since they were saved, for whoever ends the service; one copied at a time."""
        with self._context.lock:
            everyone = list(self._context.vehicles.items())
        for key, known in everyone:
            with self._context.lock:
                saved = self._saved(key, known) if known.saving.unsaved else None
            if saved is not None:
                yield saved

    def _saved(self, key: VehicleKey, known: KnownVehicle) -> SavedVehicle | None:
        """A copy of the vehicle's state, with the lock held."""
        known.saving.note_saved(self._context.clock())
        try:
            return saved_vehicle(key, known, self._context.clock())
        except Exception as error:  # the watch goes on without
            self._context.count("checkpoint")
            self._context.event("problem", {"what": "checkpoint", "text": str(error)})
            return None

    def resume(
        self,
        find: Callable[[str], Aircraft],
        maker: MonitorMaker,
        reinstate: Callable[[VehicleKey, KnownVehicle], list[Outgoing]],
    ) -> None:
        """Every vehicle goes on from its checkpoint.

        Args:
            find: the aircraft of a name; raises ValueError with one sentence for an unknown one.
            maker: of monitors.
            reinstate: has the alerts of before in force again in a vehicle's monitor; called with the lock held.
        """
        if self._checkpoints is None:
            return
        envelopes = dict[tuple[str, str], Mapping[str, Envelope]]()
        for saved in self._checkpoints.load():
            self.resume_one(saved, find, maker, reinstate, envelopes)

    def resume_one(
        self,
        saved: SavedVehicle,
        find: Callable[[str], Aircraft],
        maker: MonitorMaker,
        reinstate: Callable[[VehicleKey, KnownVehicle], list[Outgoing]],
        envelopes: dict[tuple[str, str], Mapping[str, Envelope]],
    ) -> None:
        """One vehicle goes on from its checkpoint, if it can; what becomes of it is counted.

        Args:
            envelopes: expectations that have been read before, by type and configuration; read ones are added.
        """
        checkpoints, context, key = self._checkpoints, self._context, (saved.fleet, saved.vehicle)
        if checkpoints is None:
            return
        if not goes_on(saved, context.settings.judge):
            checkpoints.count("expired")
            return
        try:
            known = resumed_vehicle(saved, find, maker, partial(self._stored, envelopes))
        except Exception as error:  # one vehicle's checkpoint must not keep the service from starting
            if not isinstance(error, CheckpointError):
                _LOG.exception("the checkpoint of %s/%s led to a fault of the program", *key)
            text = f"the checkpoint of {key[0]}/{key[1]} is not used: {error}; the vehicle starts anew"
            checkpoints.count("refused", text)
            return
        known.messages.resume(saved.arrivals, saved.silent_s, context.clock())
        with context.lock:
            news = reinstate(key, known)
            if not context.vehicles.resume(key, known):
                checkpoints.count("refused", f"there is no place for {key[0]}/{key[1]}")
                return
        checkpoints.count("resumed")
        context.tell(key, news)

    def give_up(self, key: VehicleKey, known: KnownVehicle) -> None:
        """Hand over the last state of a vehicle that is watched elsewhere from now on, with the lock held."""
        if self._checkpoints is not None and (saved := self._saved(key, known)) is not None:
            self._checkpoints.keep(saved, urgent=True)

    def _stored(
        self, known: dict[tuple[str, str], Mapping[str, Envelope]], aircraft: Aircraft, configuration: str
    ) -> Mapping[str, Envelope]:
        """Expectations that the database has for a type, read once."""
        store, kind = self._context.store, (aircraft.name, configuration)
        if kind not in known:
            ask = partial(store.expectations, aircraft, configuration) if store is not None else dict
            known[kind] = self._context.guarded(ask) or {}
        return known[kind]
