"""What the fleet needs from outside: where its memory is kept, and where its news go."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import CellMemory, Envelope, EstimateRecord, Reference
from wingwatch.monitor.cell_memory import CellPlace
from wingwatch.monitor.views import AlertView, VehicleView
from wingwatch.telemetry import ServiceStream

__all__ = ["News", "Outputs", "Store", "VehicleMemory"]

News = Mapping[str, Any] | VehicleView | AlertView
"""Derivatives, a vehicle's status, or an alert."""


@dataclass(frozen=True, slots=True)
class VehicleMemory:
    """What is kept of a vehicle; empty where nothing is.

    Attributes:
        references: what its earlier flights taught, by structure.
        envelopes: expectations that take the place of its aircraft file's, by structure.
        cells: what cells of the envelope taught, with their age.
    """

    references: Mapping[str, Reference] = field(default_factory=dict)
    envelopes: Mapping[str, Envelope] = field(default_factory=dict)
    cells: Mapping[CellPlace, CellMemory] = field(default_factory=dict)


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

    def save_alert(self, alert: AlertView) -> None:
        """Keep an alert; one with the same id is replaced."""
        ...

    def append_estimates(self, rows: Sequence[EstimateRecord]) -> None:
        """Keep estimates for history."""
        ...

    def alerts(self) -> Sequence[AlertView]:
        """Alerts of earlier runs, newest first."""
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
