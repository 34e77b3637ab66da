"""The service's memory on its way to the monitor and back, recorded: what a replay must begin with and come to."""

from collections.abc import Callable, Mapping, Sequence

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import ChangeRecord, Envelope, EstimateRecord, Reference
from wingwatch.monitor import AlertView, SavedVehicle, encode_checkpoint
from wingwatch.monitor.detection.cell_memory import CellPlace
from wingwatch.monitor.fleet.resuming import Checkpoints
from wingwatch.monitor.ports import ActionPlan, VehicleMemory
from wingwatch.monitor.vehicle.checkpoint import Checkpoint
from wingwatch.service.recorded_memory import encode_earlier_alerts, encode_envelopes, encode_memory
from wingwatch.service.recorder import Recorder
from wingwatch.service.store import DatabaseStore

__all__ = ["RecordedCheckpoints", "RecordedStore"]


class RecordedStore:
    """The service's store; what it knew of a vehicle, and what the service made of that, is recorded on the way.

    Args:
        store: does the work.
        recorder: gets a copy.
    """

    def __init__(self, store: DatabaseStore, recorder: Recorder) -> None:
        self._store, self._recorder = store, recorder
        self._changed = False
        self._begun: set[str] = set()

    def baseline_changes(self) -> Sequence[ChangeRecord]:
        """Changes that others made to the baseline; a replay does not repeat them."""
        changes = self._store.baseline_changes()
        self._changed |= bool(changes)
        return changes

    def recall(
        self, fleet: str, vehicle: str, aircraft: Aircraft, configuration: str
    ) -> VehicleMemory | None:
        """What is kept of a vehicle."""
        memory = self._store.recall(fleet, vehicle, aircraft, configuration)
        if memory is not None:
            name = f"memory/{fleet}/{vehicle}/{aircraft.name}/{configuration}"
            if not (self._changed and name in self._begun):  # a replay begins with what the flight began with
                self._recorder.attach(name, encode_memory(memory))
            self._begun.add(name)
        return memory

    def expectations(self, aircraft: Aircraft, configuration: str) -> Mapping[str, Envelope]:
        """Expectations of a type that the database has."""
        envelopes = self._store.expectations(aircraft, configuration)
        self._recorder.attach(f"expectations/{aircraft.name}/{configuration}", encode_envelopes(envelopes))
        return envelopes

    def alerts(self, patience_s: float) -> Sequence[AlertView] | None:
        """Alerts of earlier runs."""
        earlier = self._store.alerts(patience_s)
        if earlier is not None:
            self._recorder.attach("alerts", encode_earlier_alerts(earlier))
        return earlier

    def save_references(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str, references: Mapping[str, Reference]
    ) -> None:
        """Keep what the vehicle's flights taught."""
        self._store.save_references(fleet, vehicle, aircraft, configuration, references)

    def save_cells(
        self,
        fleet: str,
        vehicle: str,
        aircraft: str,
        configuration: str,
        cells: Mapping[CellPlace, Reference],
    ) -> None:
        """Keep what cells taught."""
        self._store.save_cells(fleet, vehicle, aircraft, configuration, cells)

    def save_alert(self, alert: AlertView, kept: Callable[[AlertView], None]) -> None:
        """Keep an alert; it is recorded once it is committed."""

        def committed(alert: AlertView) -> None:
            self._recorder.alert(alert)
            kept(alert)

        self._store.save_alert(alert, committed)

    def carry_out(self, plan: ActionPlan) -> None:
        """Carry out a person's action."""
        self._store.carry_out(plan)

    def append_estimates(self, rows: Sequence[EstimateRecord]) -> None:
        """Keep estimates for history."""
        self._recorder.estimates(rows)
        self._store.append_estimates(rows)


class RecordedCheckpoints:
    """The service's checkpoints; those that it starts from are recorded.

    Args:
        checkpoints: do the work.
        recorder: gets a copy.
        wall_clock: seconds since 1970-01-01 UTC.
    """

    def __init__(self, checkpoints: Checkpoints, recorder: Recorder, wall_clock: Callable[[], float]) -> None:
        self._checkpoints, self._recorder, self._wall_clock = checkpoints, recorder, wall_clock

    def load(self) -> Sequence[SavedVehicle]:
        """All that can be read."""
        loaded = self._checkpoints.load()
        for k, saved in enumerate(loaded):
            state = encode_checkpoint(Checkpoint(self._wall_clock(), saved))
            self._recorder.attach(f"checkpoint/{k}", state)
        return loaded

    def has_room(self) -> bool:
        """Whether one more would be written soon."""
        return self._checkpoints.has_room()

    def keep(self, saved: SavedVehicle, urgent: bool) -> None:
        """Write this state."""
        self._checkpoints.keep(saved, urgent)

    def count(self, what: str, text: str = "") -> None:
        """What became of a checkpoint."""
        self._checkpoints.count(what, text)
