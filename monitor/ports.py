"""What the fleet needs from outside: where its memory is kept, and where its news go."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import CellMemory, Envelope, EstimateRecord, Reference
from wingwatch.monitor.cell_memory import CellPlace
from wingwatch.monitor.views import AlertView, VehicleView

__all__ = ["Outputs", "Store"]


class Store(Protocol):
    """Where a fleet's memory is kept; every method may raise and is then counted, never fatal."""

    def references(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str
    ) -> Mapping[str, Reference]:
        """What earlier flights of the vehicle taught, by structure."""
        ...

    def envelopes(self, aircraft: Aircraft, configuration: str) -> Mapping[str, Envelope]:
        """Expectations that are kept for an aircraft, by structure; they take the place of its file's."""
        ...

    def save_references(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str, references: Mapping[str, Reference]
    ) -> None:
        """Keep what the vehicle's flights taught."""
        ...

    def cells(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str
    ) -> Mapping[CellPlace, CellMemory]:
        """What cells of the envelope taught, with their age."""
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


class Outputs(Protocol):
    """Where news goes; called without the fleet's lock held."""

    def announce(
        self, fleet: str, vehicle: str, stream: str, value: Mapping[str, Any] | VehicleView | AlertView
    ) -> None:
        """``stream`` is ``derivatives``, ``status`` or ``alerts``."""
        ...

    def ask_aircraft(self, fleet: str, vehicle: str) -> None:
        """A vehicle sends samples but never said what aircraft it is: query it."""
        ...
