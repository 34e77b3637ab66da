"""The fleet's memory in the database, written behind the live path's back.

Reading happens at once; writing is left to one thread. What is newer replaces what waits: of an alert, a reference
and a cell only the latest version counts, so these can wait for a database that is locked as long as it takes.
Every queue is bounded; what finds no room is dropped and counted, and estimates also when the database refuses them.
"""

import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Self

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import (
    AlertRecord,
    Cell,
    CellMemory,
    Database,
    DatabaseError,
    Envelope,
    EstimateRecord,
    EvidenceRecord,
    Reference,
    ReferenceKey,
)
from wingwatch.cli.baseline import stored_cells, stored_envelopes, stored_references
from wingwatch.monitor import AlertState, AlertView, CellPlace, EvidenceView

__all__ = ["DatabaseStore", "alert_record", "alert_view"]

_LOG = logging.getLogger(__name__)
_PAGE = 1000
_MOST_ALERTS = 10_000
_MOST_ESTIMATES = 100_000
_RETRY_S = 1.0


class DatabaseStore:
    """Implements the monitor's ``Store``; use it in a ``with`` statement, inside that of its database.

    Args:
        database: open; it stays open at the end.
        wall_clock: seconds since 1970-01-01 UTC, for the entries' own dates.
    """

    def __init__(self, database: Database, wall_clock: Callable[[], float]) -> None:
        self._database = database
        self._wall_clock = wall_clock
        self._created_s: dict[str, float] = {}
        self._alerts: dict[str, AlertView] = {}
        self._references: dict[ReferenceKey, Reference] = {}
        self._cells: dict[tuple[ReferenceKey, Cell], tuple[Reference, float]] = {}
        self._estimates: list[EstimateRecord] = []
        self._lock = threading.Lock()
        self._news = threading.Event()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wingwatch-store", daemon=True)
        self._counts = {"dropped_estimates": 0, "dropped_alerts": 0}
        self.problem: str | None = None

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write what waits, once, and end."""
        self._end.set()
        self._news.set()
        self._thread.join()

    @property
    def counts(self) -> dict[str, int]:
        """What was dropped."""
        with self._lock:
            return dict(self._counts)

    # -- what the monitor asks --------------------------------------------------------------------

    def references(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str
    ) -> Mapping[str, Reference]:
        """What earlier flights of the vehicle taught, by structure; what waits to be written included."""
        found = stored_references(self._database, fleet, vehicle, aircraft, configuration)
        with self._lock:
            for key, reference in self._references.items():
                if (key.fleet, key.vehicle, key.aircraft, key.configuration) == (
                    fleet, vehicle, aircraft, configuration
                ):  # fmt: skip
                    found[key.structure] = reference
        return found

    def envelopes(self, aircraft: Aircraft, configuration: str) -> Mapping[str, Envelope]:
        """Expectations of the database, by structure."""
        return stored_envelopes(self._database, aircraft, configuration)

    def alerts(self) -> Sequence[AlertView]:
        """Alerts of earlier runs, newest first (at most ten thousand)."""
        records: list[AlertRecord] = []
        cursor: str | None = None
        while len(records) < _MOST_ALERTS:
            page = self._database.alerts(limit=_PAGE, cursor=cursor)
            records += page.items
            cursor = page.next
            if cursor is None:
                break
        self._created_s.update((record.id, record.created_at_s) for record in records)
        return [alert_view(record) for record in records]

    def save_references(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str, references: Mapping[str, Reference]
    ) -> None:
        """Keep what the vehicle's flights taught."""
        with self._lock:
            for structure, reference in references.items():
                key = ReferenceKey(fleet, vehicle, aircraft, configuration, structure)
                self._references[key] = reference
        self._news.set()

    def cells(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str
    ) -> Mapping[CellPlace, CellMemory]:
        """What cells of the envelope taught, with their age; what waits to be written included."""
        now_s = self._wall_clock()
        found = stored_cells(self._database, fleet, vehicle, aircraft, configuration, now_s)
        with self._lock:
            for (key, cell), (reference, learned_s) in self._cells.items():
                if (key.fleet, key.vehicle, key.aircraft, key.configuration) == (
                    fleet, vehicle, aircraft, configuration
                ):  # fmt: skip
                    found[key.structure, cell] = CellMemory(reference, max(0.0, now_s - learned_s))
        return found

    def save_cells(
        self,
        fleet: str,
        vehicle: str,
        aircraft: str,
        configuration: str,
        cells: Mapping[CellPlace, Reference],
    ) -> None:
        """Keep what cells of the envelope taught."""
        learned_s = self._wall_clock()
        with self._lock:
            for (structure, cell), reference in cells.items():
                key = ReferenceKey(fleet, vehicle, aircraft, configuration, structure)
                self._cells[key, cell] = (reference, learned_s)
        self._news.set()

    def save_alert(self, alert: AlertView) -> None:
        """Keep an alert; one with the same id is replaced."""
        with self._lock:
            self._alerts[alert.id] = alert
        self._news.set()

    def append_estimates(self, rows: Sequence[EstimateRecord]) -> None:
        """Keep estimates for history, as far as there is room in the queue."""
        with self._lock:
            room = _MOST_ESTIMATES - len(self._estimates)
            self._estimates += rows[:room]
            self._counts["dropped_estimates"] += max(0, len(rows) - room)
        self._news.set()

    # -- the thread that writes -------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            self._news.wait()
            ending = self._end.is_set()
            self._news.clear()
            written = self._write()
            if ending:
                return
            if not written:
                self._end.wait(_RETRY_S)
                self._news.set()

    def _write(self) -> bool:
        """Write everything that waits; whether the database took it."""
        with self._lock:
            alerts, self._alerts = self._alerts, {}
            references, self._references = self._references, {}
            cells, self._cells = self._cells, {}
            estimates, self._estimates = self._estimates, []
        try:
            while alerts:
                self._write_alert(next(iter(alerts.values())))
                alerts.pop(next(iter(alerts)))
            while references:
                key, reference = next(iter(references.items()))
                self._database.save_reference(key, reference, self._wall_clock())
                references.pop(key)
            while cells:
                place, (memory, learned_s) = next(iter(cells.items()))
                self._database.save_cell(*place, memory, learned_s)
                cells.pop(place)
            self._database.append_estimates(estimates)
        except Exception as error:  # whatever a database raises must not end this thread
            self._took_not(error, alerts, references, cells, len(estimates))
            return False
        self.problem = None
        return True

    def _took_not(
        self,
        error: Exception,
        alerts: dict[str, AlertView],
        references: dict[ReferenceKey, Reference],
        cells: dict[tuple[ReferenceKey, Cell], tuple[Reference, float]],
        estimates: int,
    ) -> None:
        """Put back what must not be lost, unless something newer waits there by now."""
        with self._lock:
            self._alerts = {**alerts, **self._alerts}
            while len(self._alerts) > _MOST_ALERTS:
                self._alerts.pop(next(iter(self._alerts)))
                self._counts["dropped_alerts"] += 1
            self._references = {**references, **self._references}
            self._cells = {**cells, **self._cells}
            self._counts["dropped_estimates"] += estimates
        sentence = str(error) if isinstance(error, DatabaseError) else f"{type(error).__name__}: {error}"
        if sentence != self.problem:
            _LOG.warning("not stored: %s", sentence)
        self.problem = sentence

    def _write_alert(self, alert: AlertView) -> None:
        now_s = self._wall_clock()
        created_s = self._created_s.get(alert.id)
        if created_s is None:
            self._database.insert_alert(alert_record(alert, now_s, now_s))
            self._created_s[alert.id] = now_s
            while len(self._created_s) > 2 * _MOST_ALERTS:
                self._created_s.pop(next(iter(self._created_s)))
        else:
            self._database.update_alert(alert_record(alert, created_s, now_s))


def alert_record(alert: AlertView, created_at_s: float, updated_at_s: float) -> AlertRecord:
    """An alert as it is stored."""
    values = {name: getattr(alert, name) for name in AlertView.__dataclass_fields__}
    values["state"] = str(alert.state)
    values["evidence"] = tuple(EvidenceRecord(**asdict(part)) for part in alert.evidence)
    values["note"] = tuple(alert.note)
    return AlertRecord(**values, created_at_s=created_at_s, updated_at_s=updated_at_s)


def alert_view(record: AlertRecord) -> AlertView:
    """A stored alert as the monitor shows it."""
    values = {name: getattr(record, name) for name in AlertView.__dataclass_fields__}
    values["state"] = AlertState(record.state)
    values["evidence"] = tuple(EvidenceView(**asdict(part)) for part in record.evidence)
    values["note"] = tuple(record.note)
    return AlertView(**values)
