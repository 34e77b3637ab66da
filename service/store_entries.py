"""What waits to be written: of an alert, a reference and a cell the newest version alone, of estimates all; bounded."""

import threading
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from wingwatch.baselines import (
    Cell,
    CellMemory,
    ChangeRecord,
    Database,
    EstimateRecord,
    Lease,
    Reference,
    ReferenceKey,
    VehicleName,
)
from wingwatch.monitor import AlertView, CellPlace
from wingwatch.service.stored_alerts import alert_record
from wingwatch.service.vehicle_leases import Fence

__all__ = [
    "AlertEntry",
    "CellEntry",
    "Entry",
    "EstimateEntry",
    "Kept",
    "ReferenceEntry",
    "WaitingEntries",
    "series_of",
]

MOST_ALERTS = 10_000
MOST_ESTIMATES = 100_000
MOST_MEMORY = 50_000  # references, and cells: several hundred vehicles' worth

Kept = Callable[[AlertView], None]
"""Called with an alert once it is committed."""

Series = tuple[str, str, str, str]
"""Fleet, vehicle, aircraft and configuration."""


@dataclass(frozen=True, slots=True, eq=False)
class AlertEntry:
    """An alert that waits."""

    alert: AlertView
    kept: Kept
    lease: Lease | None

    @property
    def name(self) -> VehicleName:
        """Whose it is."""
        return self.alert.fleet, self.alert.vehicle

    def write(self, database: Database, now_at_s: float) -> None:
        """Store it."""
        database.save_alert(alert_record(self.alert, now_at_s, now_at_s), self.lease)


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceEntry:
    """A reference that waits; ``after``: the change of the baseline that it rests on."""

    key: ReferenceKey
    reference: Reference
    after: int | None
    lease: Lease | None

    @property
    def name(self) -> VehicleName:
        """Whose it is."""
        return self.key.fleet, self.key.vehicle

    def write(self, database: Database, now_at_s: float) -> None:
        """Store it."""
        database.save_reference(self.key, self.reference, now_at_s, self.after, self.lease)


@dataclass(frozen=True, slots=True, eq=False)
class CellEntry:
    """What a cell taught, that waits."""

    key: ReferenceKey
    cell: Cell
    reference: Reference
    learned_s: float
    after: int | None
    lease: Lease | None

    @property
    def name(self) -> VehicleName:
        """Whose it is."""
        return self.key.fleet, self.key.vehicle

    def write(self, database: Database, _: float) -> None:
        """Store it."""
        database.save_cell(self.key, self.cell, self.reference, self.learned_s, self.after, self.lease)


Entry = AlertEntry | ReferenceEntry | CellEntry


class EstimateEntry(NamedTuple):
    """An estimate that waits, with its wall clock."""

    row: EstimateRecord
    at_s: float
    lease: Lease | None

    @property
    def name(self) -> VehicleName:
        """Whose it is."""
        return self.row.fleet, self.row.vehicle


class WaitingEntries:
    """The queues between those who hand over and the thread that writes; any thread may call.

    Args:
        wall_clock: seconds since 1970-01-01 UTC.
        fence: gives each entry the lease under which it is made.
        news: called when something has come.

    Attributes:
        taken: the change of the baseline that the monitor has taken in.
        lock: of the queues.
    """

    def __init__(self, wall_clock: Callable[[], float], fence: Fence, news: Callable[[], None]) -> None:
        self._wall_clock, self._fence, self._news = wall_clock, fence, news
        self.lock = threading.Lock()
        self.alerts: dict[str, AlertEntry] = {}
        self.references: dict[ReferenceKey, ReferenceEntry] = {}
        self.cells: dict[tuple[ReferenceKey, Cell], CellEntry] = {}
        self.estimates: list[EstimateEntry] = []
        self._in_hand: list[EstimateEntry] = []
        self.taken: int | None = None
        self._since_s: float | None = None
        self.dropped = dict.fromkeys(("dropped_estimates", "dropped_alerts", "dropped_memory"), 0)

    @property
    def behind_s(self) -> float:
        """How long entries have waited without all of them being written; 0 where none wait."""
        since_s = self._since_s
        return 0.0 if since_s is None else time.monotonic() - since_s

    # -- handed over --------------------------------------------------------------------------------

    def add_alert(self, alert: AlertView, kept: Kept) -> None:
        """Keep an alert in the place of an older version."""
        admitted, lease = self._fence.admits(alert.fleet, alert.vehicle)
        if admitted:
            with self.lock:
                self._put(
                    self.alerts, {alert.id: AlertEntry(alert, kept, lease)}, MOST_ALERTS, "dropped_alerts"
                )
            self._news()

    def add_references(self, series: Series, references: Mapping[str, Reference]) -> None:
        """Keep what flights taught, by structure."""
        admitted, lease = self._fence.admits(*series[:2])
        if not admitted:
            return
        with self.lock:
            keys = {ReferenceKey(*series, structure): one for structure, one in references.items()}
            new = {key: ReferenceEntry(key, one, self.taken, lease) for key, one in keys.items()}
            self._put(self.references, new, MOST_MEMORY, "dropped_memory")
        self._news()

    def add_cells(self, series: Series, cells: Mapping[CellPlace, Reference]) -> None:
        """Keep what cells of the envelope taught."""
        admitted, lease = self._fence.admits(*series[:2])
        if not admitted:
            return
        learned_s = self._wall_clock()
        with self.lock:
            new: dict[tuple[ReferenceKey, Cell], CellEntry] = {}
            for (structure, cell), one in cells.items():
                key = ReferenceKey(*series, structure)
                new[key, cell] = CellEntry(key, cell, one, learned_s, self.taken, lease)
            self._put(self.cells, new, MOST_MEMORY, "dropped_memory")
        self._news()

    def add_estimates(self, rows: Sequence[EstimateRecord]) -> None:
        """Keep estimates, as far as there is room."""
        now_s = self._wall_clock()
        stamped = ((row, *self._fence.admits(row.fleet, row.vehicle)) for row in rows)
        entries = [EstimateEntry(row, now_s, lease) for row, admitted, lease in stamped if admitted]
        if not entries:
            return
        with self.lock:
            self._begin()
            room = MOST_ESTIMATES - len(self.estimates)
            self.estimates += entries[:room]
            self.dropped["dropped_estimates"] += max(0, len(entries) - room)
        self._news()

    def _begin(self) -> None:
        """Something waits from now on; the lock is held."""
        if self._since_s is None:
            self._since_s = time.monotonic()

    def _put(self, waiting: dict[Any, Any], new: Mapping[Any, Entry], most: int, dropped: str) -> None:
        self._begin()
        for key, entry in new.items():
            waiting[key] = entry
            while len(waiting) > most:
                waiting.pop(next(iter(waiting)))
                self.dropped[dropped] += 1

    # -- taken back -----------------------------------------------------------------------------------

    def supersede(self, alert_id: str) -> None:
        """A newer version of the alert has been written than the one that may wait."""
        with self.lock:
            self.alerts.pop(alert_id, None)

    def rest_on_earlier(self, changes: Iterable[ChangeRecord]) -> None:
        """Drop what waits of vehicles whose baseline others have changed."""
        with self.lock:
            for change in changes:
                self.taken = change.id
                for key in [k for k in self.references if change.concerns(*series_of(k))]:
                    self.references.pop(key)
                for place in [p for p in self.cells if change.concerns(*series_of(p[0]))]:
                    self.cells.pop(place)

    def drop(self, lost: Mapping[VehicleName, Lease | None]) -> int:
        """Drop what waits of vehicles under these leases or older ones; how much that was."""

        def is_lost(entry: Entry | EstimateEntry) -> bool:
            lease, of = entry.lease, lost.get(entry.name)
            return lease is not None and of is not None and lease.number <= of.number

        count = 0
        with self.lock:
            queues: tuple[dict[Any, Any], ...] = (self.alerts, self.references, self.cells)
            for waiting in queues:
                gone = [key for key, entry in waiting.items() if is_lost(entry)]
                count += len(gone)
                for key in gone:
                    waiting.pop(key)
            still = [entry for entry in self.estimates if not is_lost(entry)]
            count += len(self.estimates) - len(still)
            self.estimates = still
        return count

    # -- read and written -------------------------------------------------------------------------------

    def memory_of(self, series: Series) -> tuple[dict[str, Reference], dict[tuple[str, Cell], CellMemory]]:
        """References by structure, and cells, that wait."""
        now_s = self._wall_clock()
        with self.lock:
            references = {
                k.structure: e.reference for k, e in self.references.items() if series_of(k) == series
            }
            cells = {
                (k.structure, cell): CellMemory(e.reference, max(0.0, now_s - e.learned_s))
                for (k, cell), e in self.cells.items()
                if series_of(k) == series
            }
        return references, cells

    def of_vehicles(self, names: Collection[VehicleName]) -> bool:
        """Whether anything of these vehicles waits or is being written."""
        wanted = set(names)
        with self.lock:
            entries: list[Entry | EstimateEntry] = [*self.alerts.values(), *self.references.values()]
            entries += [*self.cells.values(), *self.estimates, *self._in_hand]
            return any(entry.name in wanted for entry in entries)

    def take_estimates(self) -> list[EstimateEntry]:
        """All estimates that wait, and what a caller that failed has not given back; the caller's until then."""
        with self.lock:
            self._in_hand, self.estimates = self._in_hand + self.estimates, []
            return self._in_hand

    def give_back(self, estimates: Sequence[EstimateEntry]) -> None:
        """What was not written waits on, before what has come since, as far as there is room."""
        with self.lock:
            room = max(0, MOST_ESTIMATES - len(self.estimates))
            self.dropped["dropped_estimates"] += max(0, len(estimates) - room)
            self.estimates = [*estimates[:room], *self.estimates]
            self._in_hand = []

    def drop_estimates(self, count: int) -> None:
        """So many more were dropped."""
        with self.lock:
            self.dropped["dropped_estimates"] += count

    def all_written(self) -> None:
        """Everything that waited at the begin of this turn has been written."""
        with self.lock:
            waits = self.alerts or self.references or self.cells or self.estimates
            self._since_s = time.monotonic() if waits else None


def series_of(key: ReferenceKey) -> Series:
    """Whose reference it is."""
    return key.fleet, key.vehicle, key.aircraft, key.configuration
