"""The fleet's memory in the database, read and written behind the live path's back.

Whoever calls here never waits for the database: one thread reads (``store_reader``), another writes (``store_writer``).
What is newer replaces what waits (``store_entries``): of an alert, a reference and a cell only the latest version
counts, so these can wait for a database that is locked as long as it takes. Every queue is bounded; what finds no room
is dropped and counted. Where several workers share the database each entry is written under the lease that its vehicle
was watched under when it was made (``vehicle_leases``).
"""

import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Self

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import (
    ChangeRecord,
    Database,
    Envelope,
    EstimateRecord,
    Lease,
    Reference,
    Retention,
    VehicleName,
)
from wingwatch.monitor import ActionPlan, AlertView, CellPlace, VehicleMemory
from wingwatch.operations.baseline import stored_envelopes
from wingwatch.service.store_entries import Kept, WaitingEntries
from wingwatch.service.store_reader import StoreReader
from wingwatch.service.store_writer import StoreWriter
from wingwatch.service.stored_alerts import alert_view
from wingwatch.service.vehicle_leases import Fence, VehicleLeases

__all__ = ["DatabaseStore"]

_END_S = 10.0
_MOST_OF_VEHICLE = 1000


def _nobody(_: AlertView) -> None:
    """Nobody wants to hear of it."""


class DatabaseStore:
    """Implements the monitor's ``Store``; use it in a ``with`` statement, inside that of its database.

    Args:
        database: open; it stays open at the end.
        wall_clock: seconds since 1970-01-01 UTC, for the entries' own dates.
        retention: how long the history of estimates is kept; it is thinned and dropped in small steps between writes.
        leases: of the vehicles that this worker watches; None where it watches all and nobody else writes.
    """

    def __init__(
        self,
        database: Database,
        wall_clock: Callable[[], float],
        retention: Retention | None = None,
        leases: VehicleLeases | None = None,
    ) -> None:
        self._database = database
        self._fence = Fence(leases)
        self._end, news = threading.Event(), threading.Event()
        self._waiting = WaitingEntries(wall_clock, self._fence, news.set)
        self._writer = StoreWriter(
            database, self._waiting, self._fence, wall_clock, retention, self._end, news
        )
        self._reader = StoreReader(database, self._waiting, wall_clock, self._end)
        self.loops = (self._writer.loop, self._reader.loop)

    def __enter__(self) -> Self:
        for loop in self.loops:
            loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write what waits, once, and end; a database that does not answer is not waited for longer than 10 s."""
        self._end.set()
        self._writer.news.set()
        self._reader.question.set()
        until_s = time.monotonic() + _END_S
        for loop in self.loops:
            loop.join(max(0.0, until_s - time.monotonic()))

    @property
    def problem(self) -> str | None:
        """Why entries are not written, or what is kept not read; None while both work."""
        return self._writer.problem or self._reader.problem

    @property
    def behind_s(self) -> float:
        """How long entries have waited without all of them being written; 0 where none wait."""
        return self._waiting.behind_s

    @property
    def counts(self) -> dict[str, int]:
        """Reads that failed, writes tried again, entries refused for good, what found no room, people's actions that
        were not taken in time, and entries dropped because another worker has the vehicle."""
        of_reader = {"failed_reads": self._reader.failed, "fenced": self._fence.fenced}
        return self._writer.counts | self._waiting.dropped | of_reader

    @property
    def waiting(self) -> dict[str, int]:
        """How much waits: alerts, what flights taught, estimates and people's actions to be written, and vehicles whose
        memory is to be read."""
        waiting = self._waiting
        return {
            "alerts": len(waiting.alerts),
            "memory": len(waiting.references) + len(waiting.cells),
            "estimates": len(waiting.estimates),
            "actions": self._writer.actions,
            "recalls": self._reader.asked,
        }

    # -- what the monitor asks --------------------------------------------------------------------

    def recall(
        self, fleet: str, vehicle: str, aircraft: Aircraft, configuration: str
    ) -> VehicleMemory | None:
        """What is kept of a vehicle, what waits to be written included; None while it is being read."""
        return self._reader.recall((fleet, vehicle, aircraft.name, configuration), aircraft)

    def alerts(self, patience_s: float = _END_S) -> Sequence[AlertView] | None:
        """Alerts of earlier runs, newest first (at most ten thousand); None where they have not been read in time."""
        return self._reader.earlier_alerts(patience_s)

    def expectations(self, aircraft: Aircraft, configuration: str) -> Mapping[str, Envelope]:
        """Expectations of a type that the database has; it is read at once."""
        return stored_envelopes(self._database, aircraft, configuration)

    def baseline_changes(self) -> Sequence[ChangeRecord]:
        """Changes that others made to the baseline since the last call.

        What waits to be written of the vehicles that they concern is dropped, and what is being written is refused by
        the database: it rests on what was before.
        """
        found = self._reader.changes()
        self._waiting.rest_on_earlier(found)
        return found

    def save_references(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str, references: Mapping[str, Reference]
    ) -> None:
        """Keep what the vehicle's flights taught."""
        self._waiting.add_references((fleet, vehicle, aircraft, configuration), references)

    def save_cells(
        self,
        fleet: str,
        vehicle: str,
        aircraft: str,
        configuration: str,
        cells: Mapping[CellPlace, Reference],
    ) -> None:
        """Keep what cells of the envelope taught."""
        self._waiting.add_cells((fleet, vehicle, aircraft, configuration), cells)

    def save_alert(self, alert: AlertView, kept: Kept = _nobody) -> None:
        """Keep an alert; one with the same id is replaced, and ``kept`` is called for the newest alone."""
        self._waiting.add_alert(alert, kept)

    def carry_out(self, plan: ActionPlan) -> None:
        """Carry out a person's action; returns once it is committed and taken (``ActionQueue.carry_out``)."""
        self._writer.carry_out(plan)

    def append_estimates(self, rows: Sequence[EstimateRecord]) -> None:
        """Keep estimates for history, as far as there is room in the queue."""
        self._waiting.add_estimates(rows)

    # -- where several workers share the fleet ------------------------------------------------------

    def alerts_of(self, fleet: str, vehicle: str) -> Sequence[AlertView]:
        """A vehicle's alerts, newest first (at most a thousand), for a worker that takes it over; read at once.

        Raises:
            DatabaseError: they cannot be read.
        """
        page = self._database.alerts(fleet=fleet, vehicle=vehicle, limit=_MOST_OF_VEHICLE)
        return [alert_view(record) for record in page.items]

    def wait_for(self, vehicles: Collection[VehicleName], patience_s: float) -> bool:
        """Wait until nothing of these vehicles waits to be written; whether that came in time."""
        return self._writer.wait_for(vehicles, patience_s)

    def drop(self, fleet: str, vehicle: str, lease: Lease) -> None:
        """The vehicle is not watched under this lease any more: what waits of it is dropped and counted."""
        self._fence.count(self._waiting.drop({(fleet, vehicle): lease}))
        self._reader.forget((fleet, vehicle))
