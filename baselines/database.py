"""The baseline database: expectations, references, alerts and the history of estimates.

SQLite by default, PostgreSQL by URL, the same schema. A ``Database`` may be used by any number of threads:
one engine, and a session of its own for each call.
"""

import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields, replace
from typing import Any

from sqlalchemy import Engine, delete, func, insert, select
from sqlalchemy.orm import Session

from wingwatch.baselines import estimate_history, history_columns
from wingwatch.baselines.baseline_rows import (
    expectation_record,
    newest_reference,
    of_key,
    put_cell,
    put_entry,
    put_reference,
    reference_record,
    same_series,
    taught,
)
from wingwatch.baselines.cells import Cell, CellMemory
from wingwatch.baselines.connection import (
    DatabaseError,
    RefusedError,
    check_answers,
    connect,
    inserting,
    one_writer,
    sentences,
    sqlite_file,
    upgrade,
    writing,
)
from wingwatch.baselines.fencing import Lease, LeaseLostError, VehicleName, check_leases
from wingwatch.baselines.flight_history import FlightRecord, HistoryColumns, HistoryKey
from wingwatch.baselines.records import (
    ActionRecord,
    AlertPage,
    AlertRecord,
    CandidateRecord,
    CellRecord,
    EstimateRecord,
    EvidenceRecord,
    ExpectationRecord,
    HistoryRow,
    HistoryWanted,
    ReferenceKey,
    ReferenceRecord,
    Retention,
)
from wingwatch.baselines.reference import Reference
from wingwatch.baselines.tables import (
    ActionRow,
    AlertRow,
    CellRow,
    ChangeRow,
    ExpectationRow,
    HistoryEntry,
    ReferenceRow,
)

__all__ = ["Database", "DatabaseError", "LeaseLostError", "RefusedError", "open_database"]

MAX_PAGE = 1000
"""Most alerts on one page."""

_OWNER = ("fleet", "vehicle", "aircraft", "configuration")

_MOST_FLIGHTS = 10_000
"""Vehicles whose present flight is remembered; that of another is read."""


def open_database(
    where: str | os.PathLike[str],
    *,
    busy_timeout_s: float = 5.0,
) -> "Database":
    """Open a database, creating and upgrading its schema.

    Args:
        where: path of an SQLite file, or a URL ``sqlite:///...`` or ``postgresql://...``.
        busy_timeout_s: how long a call waits for another program's lock.

    Raises:
        DatabaseError: locked, read-only, of a newer schema, not a database, damaged, or out of reach.
        ValueError: a timeout that is not positive.
    """
    if busy_timeout_s <= 0.0:
        raise ValueError(f"busy_timeout_s must be positive, got {busy_timeout_s}")
    engine = connect(where, busy_timeout_s)
    try:
        upgrade(engine)
        return Database(engine)
    except BaseException:
        engine.dispose()
        raise


class Database:
    """An open database; made by ``open_database``, ended by ``close`` or a ``with`` block.

    Every method raises ``DatabaseError`` with one sentence where the database cannot do it. What is written under a
    lease is refused with ``LeaseLostError`` where the lease no longer holds; without a lease nothing is checked.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._write_engine = writing(engine)
        self._durable_engine = writing(engine, durable=True)
        self._closed = False
        path = sqlite_file(engine)
        self._inode = path.stat().st_ino if path else None
        self._lock = threading.Lock()
        self._flights: dict[VehicleName, tuple[Lease | None, estimate_history.OpenFlight]] = {}

    def __enter__(self) -> "Database":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give back every connection; the object is of no use afterwards."""
        self._closed = True
        self._engine.dispose()

    def check(self) -> None:
        """Does the database still answer, and would it still take a write? Nothing is written.

        Raises:
            DatabaseError: if not, saying why.
        """
        with self._open():
            check_answers(self._engine, self._inode)

    def put_expectation(self, entry: ExpectationRecord) -> ExpectationRecord:
        """Store an entry; the current one at the same point (if any) becomes its history.

        A point is aircraft, configuration, structure, airspeed and altitude.

        Returns:
            the entry as stored, with its id.

        Raises:
            ValueError: an entry that already has an id.
        """
        if entry.id is not None or entry.superseded_by is not None:
            raise ValueError(f"expectation {entry.id} is already stored; put a new entry to supersede it")
        with self.writing() as session:
            one_writer(session.connection())
            return replace(entry, id=put_entry(session, entry).id)

    def expectations(
        self, aircraft: str, configuration: str, structure: str
    ) -> tuple[ExpectationRecord, ...]:
        """The current entries, by airspeed, then altitude."""
        query = (
            select(ExpectationRow)
            .where(*same_series(aircraft, configuration, structure), ExpectationRow.superseded_by.is_(None))
            .order_by(ExpectationRow.airspeed_true_m_s, ExpectationRow.altitude_m)
        )
        with self.reading() as session:
            return tuple(expectation_record(row) for row in session.scalars(query))

    def history(self, aircraft: str, configuration: str, structure: str) -> tuple[ExpectationRecord, ...]:
        """Every entry ever stored, oldest first; each says what superseded it."""
        query = (
            select(ExpectationRow)
            .where(*same_series(aircraft, configuration, structure))
            .order_by(ExpectationRow.id)
        )
        with self.reading() as session:
            return tuple(expectation_record(row) for row in session.scalars(query))

    def save_reference(
        self,
        key: ReferenceKey,
        reference: Reference,
        updated_at_s: float,
        after: int | None = None,
        lease: Lease | None = None,
    ) -> None:
        """Store a new version; the last ``MAX_REFERENCE_HISTORY`` versions stay as its history.

        The newest version again changes nothing: whoever does not know whether it was stored may repeat it.

        Args:
            after: the change of the baseline that the reference rests on. Where what the vehicle taught has been
                changed since, nothing is stored: the change would be undone.
        """
        with self.writing() as session:
            _fence(session, key, lease)
            if _superseded(session, key, after):
                return
            put_reference(session, ReferenceRecord(key, reference, updated_at_s))

    def load_reference(self, key: ReferenceKey) -> Reference | None:
        """The newest version; None if this aircraft has taught nothing yet."""
        with self.reading() as session:
            row = newest_reference(session, key)
            return None if row is None else reference_record(row).reference

    def reference_history(self, key: ReferenceKey) -> tuple[ReferenceRecord, ...]:
        """Every kept version, oldest first."""
        query = select(ReferenceRow).where(*of_key(ReferenceRow, key)).order_by(ReferenceRow.id)
        with self.reading() as session:
            return tuple(reference_record(row) for row in session.scalars(query))

    def save_cell(
        self,
        key: ReferenceKey,
        cell: Cell,
        memory: Reference,
        updated_at_s: float,
        after: int | None = None,
        lease: Lease | None = None,
    ) -> None:
        """Store what a cell of the envelope taught, in place of what was stored of it; ``after`` as for a reference.

        A vehicle keeps ``MAX_CELLS`` of a structure; those longest not flown go first.
        """
        with self.writing() as session:
            _fence(session, key, lease)
            one_writer(session.connection())
            if _superseded(session, key, after):
                return
            put_cell(session, CellRecord(key, cell, memory, updated_at_s))

    def load_cells(self, key: ReferenceKey, now_at_s: float) -> dict[Cell, CellMemory]:
        """What every cell of a vehicle's structure taught, with its age at ``now_at_s``."""
        query = select(CellRow).where(*of_key(CellRow, key))
        with self.reading() as session:
            return {
                Cell(row.airspeed_cell, row.altitude_cell): CellMemory(
                    taught(row), max(0.0, now_at_s - row.updated_at_s)
                )
                for row in session.scalars(query)
            }

    def save_alert(self, alert: AlertRecord, lease: Lease | None = None) -> None:
        """Store an alert in place of what was stored under its id; the date of its first version stays.

        The same again changes nothing: whoever does not know whether it was stored may repeat it.
        """
        with self.writing(durable=True) as session:
            _fence(session, alert, lease)
            _put_alert(session, alert)

    def save_action(self, alert: AlertRecord, action: ActionRecord, lease: Lease | None = None) -> None:
        """Store an alert as a person's action left it, and the action: both or neither.

        Raises:
            RefusedError: an action of that key is stored already.
        """
        with self.writing(durable=True) as session:
            _fence(session, alert, lease)
            session.execute(insert(ActionRow).values(asdict(action)))
            _put_alert(session, alert)

    def action(self, key: str) -> ActionRecord | None:
        """The action that a request of that key led to; None if there was none."""
        with self.reading() as session:
            row = session.get(ActionRow, key)
            if row is None:
                return None
            return ActionRecord(**{f.name: getattr(row, f.name) for f in fields(ActionRecord)})

    def void_action(self, key: str, alert: AlertRecord, lease: Lease | None = None) -> bool:
        """Undo an action: forget it, and store the alert as it stands without it; whether it was stored."""
        with self.writing(durable=True) as session:
            _fence(session, alert, lease)
            found = session.scalar(delete(ActionRow).where(ActionRow.key == key).returning(ActionRow.key))
            if found is not None:
                _put_alert(session, alert)
            return found is not None

    def forget_actions(self, before_at_s: float) -> None:
        """Drop the keys of older requests; what they did to alerts stays."""
        with self.writing() as session:
            session.execute(delete(ActionRow).where(ActionRow.at_s < before_at_s))

    def alert(self, alert_id: str) -> AlertRecord | None:
        """One alert; None if unknown."""
        with self.reading() as session:
            row = session.scalar(select(AlertRow).where(AlertRow.id == alert_id))
            return None if row is None else _alert(row)

    def alerts(
        self,
        *,
        state: str | None = None,
        vehicle: str | None = None,
        fleet: str | None = None,
        kind: str | None = None,
        since_s: float | None = None,
        limit: int = 100,
        cursor: str | None = None,
    ) -> AlertPage:
        """Alerts that match every filter given, newest first.

        Args:
            since_s: raised at this sample time or later.
            limit: at most this many, 1 to ``MAX_PAGE``.
            cursor: ``next`` of the page before.

        Raises:
            ValueError: a limit out of range or a cursor that no page gave.
        """
        if not 1 <= limit <= MAX_PAGE:
            raise ValueError(f"limit is {limit}; give 1 to {MAX_PAGE}")
        query = select(AlertRow).order_by(AlertRow.serial.desc()).limit(limit + 1)
        wanted = {"state": state, "vehicle": vehicle, "fleet": fleet, "kind": kind}
        for name, value in wanted.items():
            if value is not None:
                query = query.where(getattr(AlertRow, name) == value)
        if since_s is not None:
            query = query.where(AlertRow.raised_s >= since_s)
        if cursor is not None:
            query = query.where(AlertRow.serial < _serial(cursor))
        with self.reading() as session:
            rows = session.scalars(query).all()
        following = f"{rows[limit - 1].serial:x}" if len(rows) > limit else None
        return AlertPage(tuple(_alert(row) for row in rows[:limit]), following)

    def append_estimates(
        self,
        rows: Sequence[tuple[EstimateRecord, float]],
        leases: Mapping[VehicleName, Lease] | None = None,
    ) -> None:
        """Store estimates in one go, all or none; the same again changes nothing.

        A vehicle's flight ends when its clock goes back, its aircraft or configuration changes, or nothing has come of
        it for ten minutes.

        Args:
            rows: each with its wall clock, seconds since 1970-01-01 UTC.
            leases: of the vehicles that are written under one.
        """
        if not rows:
            return
        leases = leases or {}
        with self._lock:  # a flight seen under another lease may not be the vehicle's last any more
            known = {name: f for name, (lease, f) in self._flights.items() if lease == leases.get(name)}
        with self.writing() as session:
            check_leases(session, leases)
            flights = estimate_history.append(session, rows, known)
        with self._lock:
            self._flights.update({name: (leases.get(name), flight) for name, flight in flights.items()})
            while len(self._flights) > _MOST_FLIGHTS:
                self._flights.pop(next(iter(self._flights)))

    def history_rows(self, fleet: str, vehicle: str, wanted: HistoryWanted) -> tuple[HistoryRow, ...]:
        """A part of a vehicle's history, by flight, time, estimator and structure."""
        with self.reading() as session:
            return estimate_history.page(session, fleet, vehicle, wanted)

    def history_columns(
        self, fleet: str, vehicle: str, wanted: HistoryWanted
    ) -> tuple[tuple[HistoryColumns, ...], HistoryKey | None]:
        """The same as columns, and the key of the last row where ``wanted.limit`` rows were read."""
        with self.reading() as session:
            return history_columns.columns(session, fleet, vehicle, wanted)

    def flights(self, fleet: str, vehicle: str) -> tuple[FlightRecord, ...]:
        """Flights of a vehicle of which estimates are kept, the newest first."""
        with self.reading() as session:
            return history_columns.flights(session, fleet, vehicle)

    def estimate_history(
        self,
        fleet: str,
        vehicle: str,
        from_s: float | None = None,
        to_s: float | None = None,
        *,
        limit: int | None = None,
    ) -> tuple[EstimateRecord, ...]:
        """Kept estimates of one vehicle with from_s <= time_s <= to_s, by flight and time (at most ``limit``)."""
        wanted = HistoryWanted(from_s, to_s, limit=limit)
        return tuple(row.estimate for row in self.history_rows(fleet, vehicle, wanted))

    def history_size(self) -> int:
        """Estimates that are kept."""
        with self.reading() as session:
            return session.scalar(select(func.count()).select_from(HistoryEntry)) or 0

    def prune_history(self, now_at_s: float, retention: Retention) -> bool:
        """One small step of thinning and dropping what is old or too much; whether more may be due."""
        with self.writing() as session:
            more = estimate_history.prune(session, now_at_s, retention)
        with self._lock:
            self._flights.clear()  # one of them may have been dropped
        return more

    @contextmanager
    def _open(self) -> Iterator[None]:
        if self._closed:
            raise DatabaseError("the database is closed; open it again")
        with sentences(self._engine):
            yield

    @contextmanager
    def reading(self) -> Iterator[Session]:
        """A session that reads, for the database's own modules."""
        with self._open(), Session(self._engine, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def writing(self, durable: bool = False) -> Iterator[Session]:
        """A session in one transaction, committed at the end of the block, for the database's own modules."""
        engine = self._durable_engine if durable else self._write_engine
        with self._open(), Session(engine) as session, session.begin():
            yield session


def _fence(session: Session, of: ReferenceKey | AlertRecord, lease: Lease | None) -> None:
    """Make sure that the lease of a vehicle holds, where one is given."""
    if lease is not None:
        check_leases(session, {(of.fleet, of.vehicle): lease})


def _superseded(session: Session, key: ReferenceKey, after: int | None) -> bool:
    """Whether what the vehicle taught has been changed since a change; no further one comes before this is stored."""
    if after is None:
        return False
    one_writer(session.connection())
    later = select(ChangeRow.id).where(
        ChangeRow.id > after,
        *(getattr(ChangeRow, name) == getattr(key, name) for name in _OWNER),
    )
    return session.scalar(later.limit(1)) is not None


def _put_alert(session: Session, alert: AlertRecord) -> None:
    values = _plain(alert)
    newer = {name: value for name, value in values.items() if name not in ("id", "created_at_s")}
    row = inserting(session)(AlertRow).values(values)
    session.execute(row.on_conflict_do_update(index_elements=[AlertRow.id], set_=newer))


def _plain(record: AlertRecord) -> dict[str, Any]:
    """A record's fields as a row's values; sequences as lists."""
    values = asdict(record)
    return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}


def _serial(cursor: str) -> int:
    try:
        serial = int(cursor, 16)
    except ValueError:
        serial = -1
    if not 0 <= serial < 2**63:
        raise ValueError(f"cursor {cursor!r:.40} is not one that a page gave; start without a cursor")
    return serial


def _alert(row: AlertRow) -> AlertRecord:
    values = {f.name: getattr(row, f.name) for f in fields(AlertRecord)}
    values["evidence"] = tuple(EvidenceRecord(**e) for e in row.evidence)
    values["note"] = tuple(row.note)
    values["candidates"] = tuple(CandidateRecord(**c) for c in row.candidates or ())
    return AlertRecord(**values)
