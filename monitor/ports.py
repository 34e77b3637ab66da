"""What the fleet needs from outside: where its memory is kept, and where its news go."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import CellMemory, ChangeRecord, Envelope, EstimateRecord, Reference
from wingwatch.monitor.detection.cell_memory import CellPlace
from wingwatch.monitor.views import AlertAction, AlertView, ProposedInputView, VehicleView
from wingwatch.telemetry import ServiceStream

__all__ = ["ActionPlan", "ActionRequest", "News", "Outputs", "Store", "VehicleMemory"]

News = Mapping[str, Any] | VehicleView | AlertView | ProposedInputView
"""Derivatives, a vehicle's status, an alert, or an input that is proposed."""


@dataclass(frozen=True, slots=True)
class VehicleMemory:
    """What is kept of a vehicle; empty where nothing is.

    Attributes:
        references: what its earlier flights taught, by structure.
        envelopes: expectations that take the place of its aircraft file's, by structure.
        cells: what cells of the envelope taught, with their age.
        change: id of the newest change of the baseline that is in it.
    """

    references: Mapping[str, Reference] = field(default_factory=dict)
    envelopes: Mapping[str, Envelope] = field(default_factory=dict)
    cells: Mapping[CellPlace, CellMemory] = field(default_factory=dict)
    change: int = 0


@dataclass(frozen=True, slots=True)
class ActionRequest:
    """What a person asks to be done to an alert.

    Attributes:
        key: of the request, the same when it is repeated; None where it has none.
        until_at_s: until when an alert is shelved, seconds since 1970-01-01 UTC.
    """

    alert_id: str
    action: AlertAction
    who: str
    note: str
    key: str | None = None
    until_at_s: float = float("inf")


@dataclass(frozen=True, slots=True)
class ActionPlan:
    """How an action is carried out; the functions are called in the store's thread.

    Attributes:
        change: gives the alert as the action leaves it; ValueError where it makes no sense.
        taken: called with that alert once it is committed, with the action.
        newest: gives the alert's newest version without the action.
        written: called with that version once it is committed in place of an action that was undone.
    """

    request: ActionRequest
    change: Callable[[], AlertView]
    taken: Callable[[AlertView], None]
    newest: Callable[[], AlertView]
    written: Callable[[AlertView], None]


class Store(Protocol):
    """Where a fleet's memory is kept; every method may raise and is then counted, never fatal."""

    def recall(
        self, fleet: str, vehicle: str, aircraft: Aircraft, configuration: str
    ) -> VehicleMemory | None:
        """What is kept of a vehicle; None while it has not been read, and then it is to be asked for again.

        Called with the fleet's lock held: it returns at once, whatever the state of the database. A read that failed
        is not an empty one.
        """
        ...

    def baseline_changes(self) -> Sequence[ChangeRecord]:
        """Changes that others made to the baseline since the last call; it returns at once.

        What waits to be saved of the vehicles that they concern is dropped: it rests on what was before.
        """
        ...

    def save_references(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str, references: Mapping[str, Reference]
    ) -> None:
        """Keep what the vehicle's flights taught."""
        ...

    def save_cells(
        self,
        fleet: str,
        vehicle: str,
        aircraft: str,
        configuration: str,
        cells: Mapping[CellPlace, Reference],
    ) -> None:
        """Keep what cells taught; each takes the place of what was kept of it."""
        ...

    def save_alert(self, alert: AlertView, kept: Callable[[AlertView], None]) -> None:
        """Keep an alert; one with the same id is replaced. It returns at once.

        Args:
            kept: called in any thread with the alert once it is committed; of several versions that wait only the
                newest is, and for that alone it is called.
        """
        ...

    def carry_out(self, plan: ActionPlan) -> None:
        """Carry out a person's action: returns once it is committed and taken, or was so under the same key before.

        Called without the fleet's lock held.

        Raises:
            ValueError: it makes no sense in the alert's state, or its key belongs to another one.
            DatabaseError: it has not been taken in a bounded time, and has not happened.
        """
        ...

    def append_estimates(self, rows: Sequence[EstimateRecord]) -> None:
        """Keep estimates for history."""
        ...

    def alerts(self, patience_s: float) -> Sequence[AlertView] | None:
        """Alerts of earlier runs, newest first; None where they have not been read within ``patience_s``.

        They are to be asked for again then. A read that failed is not an empty one.
        """
        ...

    def expectations(self, aircraft: Aircraft, configuration: str) -> Mapping[str, Envelope]:
        """Expectations that take the place of an aircraft file's, by structure.

        Called at the start only, before anybody waits: it may read the database.
        """
        ...


class Outputs(Protocol):
    """Where news goes; called without the fleet's lock held."""

    def announce(self, fleet: str, vehicle: str, stream: ServiceStream, news: Callable[[], News]) -> None:
        """There is something new under ``stream``.

        Args:
            news: gives it, in any thread; what nobody listens to need not be made.
        """
        ...

    def ask_aircraft(self, fleet: str, vehicle: str) -> None:
        """A vehicle sends samples but never said what aircraft it is: query it."""
        ...
