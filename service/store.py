"""The fleet's memory in the database, read and written behind the live path's back.

Whoever calls here never waits for the database: one thread reads, another writes. What is newer replaces what waits: of
an alert, a reference and a cell only the latest version counts, so these can wait for a database that is locked as long
as it takes. Every write may be repeated, for a reply can be lost; an entry that the database refuses while it works is
given up after five tries, and the others do not wait for it. Every queue is bounded; what finds no room is dropped and
counted.
"""

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Self

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import (
    AlertRecord,
    BaselineLedger,
    CandidateRecord,
    Cell,
    CellMemory,
    ChangeRecord,
    Database,
    DatabaseError,
    Envelope,
    EstimateRecord,
    EvidenceRecord,
    Reference,
    ReferenceKey,
    RefusedError,
    Retention,
)
from wingwatch.monitor import (
    ActionPlan,
    AlertState,
    AlertView,
    CandidateView,
    CellPlace,
    EvidenceView,
    Shelving,
    VehicleMemory,
)
from wingwatch.operations.baseline import stored_cells, stored_envelopes, stored_references
from wingwatch.service.action_queue import ActionQueue
from wingwatch.service.loops import Loop

__all__ = ["DatabaseStore", "alert_record", "alert_view", "kept_alerts"]

_LOG = logging.getLogger(__name__)
_PAGE = 1000
_MOST_ALERTS = 10_000
_MOST_ESTIMATES = 100_000
_MOST_MEMORY = 50_000  # references, and cells: several hundred vehicles' worth
_MOST_ASKED = 1000
_MOST_TRIES = 5
_RETRY_S = 1.0
_GATHER_S = 0.2  # a transaction costs as much as a hundred rows
_END_S = 10.0
_ESTIMATES_AT_ONCE = 5000
_PRUNE_EVERY_S = 30.0
_LOOK_EVERY_S = 2.0  # for changes of the baseline by others
_CHANGES_OF_S = 86_400.0  # at the start: vehicles that go on may have been saved before them
_PRUNE_AGAIN_S = 0.5

_Asked = tuple[str, str, str, str]
"""Fleet, vehicle, aircraft and configuration."""

_Kept = Callable[[AlertView], None]
"""Called with an alert once it is committed."""

_Job = tuple[dict[Any, Any], Any, Callable[[Any, Any], None]]
"""What waits, which of it, and how it is written."""


def _nobody(_: AlertView) -> None:
    """Nobody wants to hear of it."""


class DatabaseStore:
    """Implements the monitor's ``Store``; use it in a ``with`` statement, inside that of its database.

    Args:
        database: open; it stays open at the end.
        wall_clock: seconds since 1970-01-01 UTC, for the entries' own dates.
        retention: how long the history of estimates is kept; it is thinned and dropped in small steps between writes.
    """

    def __init__(
        self, database: Database, wall_clock: Callable[[], float], retention: Retention | None = None
    ) -> None:
        self._database = database
        self._wall_clock = wall_clock
        self._alerts: dict[str, tuple[AlertView, _Kept]] = {}
        self._references: dict[ReferenceKey, tuple[Reference, int | None]] = {}
        self._cells: dict[tuple[ReferenceKey, Cell], tuple[Reference, float, int | None]] = {}
        self._ledger = BaselineLedger(database)
        self._changes: list[ChangeRecord] = []
        self._noticed: int | None = None
        self._taken: int | None = None
        self._estimates: list[tuple[EstimateRecord, float]] = []
        self._retention = retention
        self._pruned_s = float("-inf")
        self._lock = threading.Lock()
        self._news = threading.Event()
        self._end = threading.Event()
        self._asked: dict[_Asked, Aircraft] = {}
        self._recalled: dict[_Asked, VehicleMemory] = {}
        self._question = threading.Event()
        self.loops = (
            Loop("wingwatch-store", "the loop that writes the database", self._run, self._news.set),
            Loop("wingwatch-recall", "the loop that reads the database", self._answer, self._question.set),
        )
        self._earlier: Sequence[AlertView] | None = None
        self._earlier_read = threading.Event()
        self._actions = ActionQueue(database, self._record, wall_clock, self._news.set, self._supersede)
        self._tries: dict[Any, int] = {}
        self._since_s: float | None = None
        self._counts = dict.fromkeys(
            ("failed_reads", "retries", "refused", "dropped_estimates", "dropped_alerts", "dropped_memory"), 0
        )
        self.write_problem: str | None = None
        self.read_problem: str | None = None

    def __enter__(self) -> Self:
        for loop in self.loops:
            loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write what waits, once, and end; a database that does not answer is not waited for longer than 10 s."""
        self._end.set()
        self._news.set()
        self._question.set()
        until_s = time.monotonic() + _END_S
        for loop in self.loops:
            loop.join(max(0.0, until_s - time.monotonic()))

    @property
    def problem(self) -> str | None:
        """Why entries are not written, or what is kept not read; None while both work."""
        return self.write_problem or self.read_problem

    @property
    def behind_s(self) -> float:
        """How long entries have waited without all of them being written; 0 where none wait."""
        since_s = self._since_s
        return 0.0 if since_s is None else time.monotonic() - since_s

    @property
    def counts(self) -> dict[str, int]:
        """Reads that failed, writes tried again, entries refused for good, what found no room, and people's actions
        that were not taken in time."""
        actions = self._actions
        with self._lock:
            return self._counts | {"withdrawn_actions": actions.withdrawn, "undone_actions": actions.undone}

    @property
    def waiting(self) -> dict[str, int]:
        """How much waits: alerts, what flights taught, estimates and people's actions to be written, and vehicles whose
        memory is to be read."""
        return {
            "alerts": len(self._alerts),
            "memory": len(self._references) + len(self._cells),
            "estimates": len(self._estimates),
            "actions": self._actions.length,
            "recalls": len(self._asked),
        }

    # -- what the monitor asks --------------------------------------------------------------------

    def recall(
        self, fleet: str, vehicle: str, aircraft: Aircraft, configuration: str
    ) -> VehicleMemory | None:
        """What is kept of a vehicle, what waits to be written included; None while it is being read."""
        asked = (fleet, vehicle, aircraft.name, configuration)
        with self._lock:
            found = self._recalled.pop(asked, None)
            if found is None and len(self._asked) < _MOST_ASKED:
                self._asked.setdefault(asked, aircraft)
        if found is None:
            self._question.set()
        return found

    def alerts(self, patience_s: float = _END_S) -> Sequence[AlertView] | None:
        """Alerts of earlier runs, newest first (at most ten thousand); None where they have not been read in time."""
        if not self._earlier_read.is_set():
            self._question.set()
            self._earlier_read.wait(patience_s)
        return self._earlier

    def expectations(self, aircraft: Aircraft, configuration: str) -> Mapping[str, Envelope]:
        """Expectations of a type that the database has; it is read at once."""
        return stored_envelopes(self._database, aircraft, configuration)

    def baseline_changes(self) -> Sequence[ChangeRecord]:
        """Changes that others made to the baseline since the last call.

        What waits to be written of the vehicles that they concern is dropped, and what is being written is refused by
        the database: it rests on what was before.
        """
        with self._lock:
            found, self._changes = self._changes, []
            if found:
                self._taken = found[-1].id
            for change in found:
                for key in [k for k in self._references if change.concerns(*_owner(k))]:
                    self._references.pop(key)
                for place in [p for p in self._cells if change.concerns(*_owner(p[0]))]:
                    self._cells.pop(place)
        return found

    def save_references(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str, references: Mapping[str, Reference]
    ) -> None:
        """Keep what the vehicle's flights taught."""
        with self._lock:
            for structure, reference in references.items():
                key = ReferenceKey(fleet, vehicle, aircraft, configuration, structure)
                self._keep(self._references, key, (reference, self._taken))
        self._news.set()

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
                self._keep(self._cells, (key, cell), (reference, learned_s, self._taken))
        self._news.set()

    def save_alert(self, alert: AlertView, kept: _Kept = _nobody) -> None:
        """Keep an alert; one with the same id is replaced, and ``kept`` is called for the newest alone."""
        with self._lock:
            self._wait()
            self._alerts[alert.id] = alert, kept
            while len(self._alerts) > _MOST_ALERTS:
                self._alerts.pop(next(iter(self._alerts)))
                self._counts["dropped_alerts"] += 1
        self._news.set()

    def carry_out(self, plan: ActionPlan) -> None:
        """Carry out a person's action; returns once it is committed and taken (``ActionQueue.carry_out``)."""
        self._actions.carry_out(plan)

    def append_estimates(self, rows: Sequence[EstimateRecord]) -> None:
        """Keep estimates for history, as far as there is room in the queue."""
        with self._lock:
            self._wait()
            room, now_s = _MOST_ESTIMATES - len(self._estimates), self._wall_clock()
            self._estimates += [(row, now_s) for row in rows[:room]]
            self._counts["dropped_estimates"] += max(0, len(rows) - room)
        self._news.set()

    def _wait(self) -> None:
        """Something waits from now on; the lock is held."""
        if self._since_s is None:
            self._since_s = time.monotonic()

    def _keep(self, waiting: dict[Any, Any], key: Any, entry: Any) -> None:
        """Let an entry wait in place of an older one; the lock is held."""
        self._wait()
        waiting[key] = entry
        while len(waiting) > _MOST_MEMORY:
            waiting.pop(next(iter(waiting)))
            self._counts["dropped_memory"] += 1

    # -- the thread that reads --------------------------------------------------------------------

    def _answer(self) -> None:
        """Read for everybody who asked; a read that fails is tried again, and never passes for an empty one."""
        while not self._end.is_set():
            self._question.wait(_LOOK_EVERY_S)
            self._question.clear()
            if self._end.is_set():
                return
            self._look()
            with self._lock:
                asked = list(self._asked.items())
            if not self._read_earlier():
                continue
            for key, aircraft in asked:
                if self._end.is_set():
                    return
                try:
                    found = self._read(key, aircraft)
                except Exception as error:  # whatever a database raises must not end this thread
                    self._not_read(error)
                    break
                self.read_problem = None
                with self._lock:
                    self._asked.pop(key)
                    self._recalled[key] = found
                    while len(self._recalled) > _MOST_ASKED:
                        self._recalled.pop(next(iter(self._recalled)))

    def _look(self) -> None:
        """Notice changes of the baseline; a database that does not answer is asked again later."""
        try:
            if self._noticed is None:
                newest = self._ledger.newest_change()
                since_s = self._wall_clock() - _CHANGES_OF_S
                found = [c for c in self._ledger.changes(0) if c.at_s >= since_s]
                self._taken = newest if not found else (found[0].id or 1) - 1
            else:
                newest, found = self._noticed, list(self._ledger.changes(self._noticed))
        except Exception as error:  # whatever a database raises must not end this thread
            _LOG.debug("changes of the baseline not read: %s", _sentence(error))
            return
        if found:
            newest = max(newest, found[-1].id or 0)
            with self._lock:
                self._changes += found
                self._recalled.clear()  # read before the change
            _LOG.info("the baseline was changed: %s", "; ".join(c.text for c in found[-3:]))
        self._noticed = newest

    def _read_earlier(self) -> bool:
        """Alerts of earlier runs, once; whether they have been read."""
        if self._earlier is None:
            try:
                self._earlier = kept_alerts(self._database)
            except Exception as error:
                self._not_read(error)
                return False
            self.read_problem = None
            self._earlier_read.set()
        return True

    def _not_read(self, error: Exception) -> None:
        with self._lock:
            self._counts["failed_reads"] += 1
        problem = _sentence(error)
        if problem != self.read_problem:
            _LOG.warning("not read: %s", problem)
        self.read_problem = problem
        self._end.wait(_RETRY_S)
        self._question.set()

    def _read(self, asked: _Asked, aircraft: Aircraft) -> VehicleMemory:
        # What waits is looked at before the database: what is written in between is then seen there or here.
        now_s = self._wall_clock()
        with self._lock:
            references = {k.structure: r for k, (r, _) in self._references.items() if _owner(k) == asked}
            cells = {
                (k.structure, cell): CellMemory(reference, max(0.0, now_s - learned_s))
                for (k, cell), (reference, learned_s, _) in self._cells.items()
                if _owner(k) == asked
            }
        return VehicleMemory(
            stored_references(self._database, *asked) | references,
            stored_envelopes(self._database, aircraft, asked[3]),
            stored_cells(self._database, *asked, now_s) | cells,
            self._noticed or 0,
        )

    # -- the thread that writes -------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            self._news.wait(_PRUNE_EVERY_S if self._retention is not None else None)
            ending = self._end.wait(0.0 if self._actions.waiting else _GATHER_S)
            self._news.clear()
            written = self._write()
            if ending:
                return
            if not written:
                self._end.wait(_RETRY_S)
                self._news.set()

    def _write(self) -> bool:
        """Write everything that waits; whether nothing of it has to be tried again."""
        with self._lock:
            jobs: list[_Job] = [
                *((self._alerts, key, self._write_alert) for key in self._alerts),
                *((self._references, key, self._write_reference) for key in self._references),
                *((self._cells, key, self._write_cell) for key in self._cells),
            ]
            estimates, self._estimates = self._estimates, []
        problem = self._act()
        down = problem is not None
        for waiting, key, write in jobs:
            if down:
                break  # the others would fare no better
            try:
                self._carry_out(waiting, key, write)
            except Exception as error:  # whatever a database raises must not end this thread
                problem, down = self._again(waiting, key, error), not _of_the_entry(error)
            if self._actions.waiting and not down and (fault := self._act()) is not None:
                problem, down = fault, True
        if not down and (fault := self._write_estimates(estimates)) is not None:
            problem, down = fault, True
        if down:
            self._keep_estimates(estimates)
        else:
            self._prune()
        with self._lock:
            if problem is None:
                waits = self._alerts or self._references or self._cells or self._estimates
                self._since_s = time.monotonic() if waits else None
        self._say(problem)
        return problem is None

    def _write_estimates(self, estimates: list[tuple[EstimateRecord, float]]) -> str | None:
        """Why the database does not take them, None where it has or never will; those written are removed."""
        while estimates:
            try:
                self._database.append_estimates(estimates[:_ESTIMATES_AT_ONCE])
            except Exception as error:
                if not _of_the_entry(error):
                    return _sentence(error)
                with self._lock:
                    self._counts["dropped_estimates"] += len(estimates[:_ESTIMATES_AT_ONCE])
                _LOG.error("history not stored: %s", _sentence(error))
            del estimates[:_ESTIMATES_AT_ONCE]
            if self._actions.waiting and (fault := self._act()) is not None:
                return fault
        return None

    def _keep_estimates(self, estimates: list[tuple[EstimateRecord, float]]) -> None:
        """What was not written waits on, before what has come since, as far as there is room."""
        with self._lock:
            room = max(0, _MOST_ESTIMATES - len(self._estimates))
            self._counts["dropped_estimates"] += max(0, len(estimates) - room)
            self._estimates = estimates[:room] + self._estimates

    def _prune(self) -> None:
        """A small step of thinning and dropping the history, where it is time for one."""
        if self._retention is None or time.monotonic() - self._pruned_s < _PRUNE_EVERY_S:
            return
        try:
            more = self._database.prune_history(self._wall_clock(), self._retention)
        except Exception as error:
            _LOG.warning("history not thinned: %s", _sentence(error))
            more = False
        self._pruned_s = time.monotonic() - (_PRUNE_EVERY_S - _PRUNE_AGAIN_S if more else 0.0)

    def _carry_out(self, waiting: dict[Any, Any], key: Any, write: Callable[[Any, Any], None]) -> None:
        """Write one entry; it waits no longer unless something newer has taken its place."""
        entry: Any = waiting.get(key)
        if entry is None:
            return
        write(key, entry)
        with self._lock:
            self._tries.pop(key, None)
            if waiting.get(key) is entry:
                waiting.pop(key)
        if waiting is self._alerts:
            alert, kept = entry
            self._announced(alert, kept)

    def _announced(self, alert: AlertView, kept: _Kept) -> None:
        try:
            kept(alert)
        except Exception:  # it is stored, and the thread goes on
            _LOG.exception("alert %s could not be announced", alert.id)

    def _act(self) -> str | None:
        """Carry out what people have asked for; why the database does not take it, None where it does."""
        try:
            self._actions.work()
        except Exception as error:
            return _sentence(error)
        return None

    def _supersede(self, alert_id: str) -> None:
        """A newer version of the alert has been written than the one that may wait."""
        with self._lock:
            self._alerts.pop(alert_id, None)

    def _record(self, alert: AlertView) -> AlertRecord:
        now_s = self._wall_clock()
        return alert_record(alert, now_s, now_s)

    def _again(self, waiting: dict[Any, Any], key: Any, error: Exception) -> str:
        """What happens to an entry that was not written: it waits on, unless the database refuses just this one."""
        with self._lock:
            self._counts["retries"] += 1
            entry = waiting.pop(key, None)
            tries = self._tries.get(key, 0) + _of_the_entry(error)
            if tries >= _MOST_TRIES:
                self._tries.pop(key, None)
                self._counts["refused"] += 1
                _LOG.error("not stored, and given up after %d tries: %s", tries, _sentence(error))
            elif entry is not None:
                waiting[key] = entry  # last: the others need not wait for it
                if tries:
                    self._tries[key] = tries
        return _sentence(error)

    def _say(self, problem: str | None) -> None:
        if problem is not None and problem != self.write_problem:
            _LOG.warning("not stored: %s", problem)
        self.write_problem = problem

    def _write_alert(self, _: str, entry: tuple[AlertView, _Kept]) -> None:
        self._database.save_alert(self._record(entry[0]))

    def _write_reference(self, key: ReferenceKey, entry: tuple[Reference, int | None]) -> None:
        self._database.save_reference(key, entry[0], self._wall_clock(), entry[1])

    def _write_cell(
        self, place: tuple[ReferenceKey, Cell], entry: tuple[Reference, float, int | None]
    ) -> None:
        reference, learned_s, after = entry
        self._database.save_cell(*place, reference, learned_s, after)


def _owner(key: ReferenceKey) -> _Asked:
    return key.fleet, key.vehicle, key.aircraft, key.configuration


def _of_the_entry(error: Exception) -> bool:
    """Whether the entry is at fault, and not the database."""
    return isinstance(error, RefusedError) or not isinstance(error, DatabaseError)


def _sentence(error: Exception) -> str:
    return str(error) if isinstance(error, DatabaseError) else f"{type(error).__name__}: {error}"


def kept_alerts(database: Database) -> list[AlertView]:
    """The newest alerts of a database, newest first."""
    records: list[AlertRecord] = []
    cursor: str | None = None
    while len(records) < _MOST_ALERTS:
        page = database.alerts(limit=_PAGE, cursor=cursor)
        records += page.items
        cursor = page.next
        if cursor is None:
            break
    return [alert_view(record) for record in records]


def alert_record(alert: AlertView, created_at_s: float, updated_at_s: float) -> AlertRecord:
    """An alert as it is stored."""
    values = {name: getattr(alert, name) for name in AlertView.__dataclass_fields__}
    values.pop("diagnosis_id")  # its report ends with the service
    values["state"] = str(alert.state)
    values["evidence"] = tuple(EvidenceRecord(**asdict(part)) for part in alert.evidence)
    values["note"] = tuple(alert.note)
    values["shelving"] = None if alert.shelving is None else asdict(alert.shelving)
    values["candidates"] = tuple(CandidateRecord(**asdict(one)) for one in alert.candidates)
    return AlertRecord(**values, created_at_s=created_at_s, updated_at_s=updated_at_s)


def alert_view(record: AlertRecord) -> AlertView:
    """A stored alert as the monitor shows it."""
    values = {
        name: getattr(record, name) for name in AlertView.__dataclass_fields__ if name != "diagnosis_id"
    }
    values["state"] = AlertState(record.state)
    values["evidence"] = tuple(EvidenceView(**asdict(part)) for part in record.evidence)
    values["note"] = tuple(record.note)
    values["shelving"] = None if record.shelving is None else Shelving(**record.shelving)  # type: ignore[arg-type]
    values["candidates"] = tuple(CandidateView(**asdict(one)) for one in record.candidates)
    return AlertView(**values)
