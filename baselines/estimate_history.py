"""The history of estimates: by vehicle, flight and time; at full rate for a while, thinned afterwards, bounded."""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

from sqlalchemy import Table, bindparam, delete, func, insert, select, tuple_, update
from sqlalchemy.orm import Session

from wingwatch.baselines.connection import inserting
from wingwatch.baselines.records import EstimateRecord, HistoryRow, HistoryWanted, Retention
from wingwatch.baselines.tables import FlightRow, HistoryEntry

__all__ = ["OpenFlight", "append", "entries_of", "flights_of", "page", "prune"]

SILENCE_S = 600.0
"""Wall-clock silence after which a vehicle's samples are of another flight."""

_INSTANTS = 500  # that are looked at or dropped in one transaction: alerts wait for it
_IN_ONE_STATEMENT = 500
_LEAST_S = 600.0  # wall clock that is thinned at once

_Owner = tuple[str, str]


@dataclass(slots=True)
class OpenFlight:
    """The flight that a vehicle's estimates belong to now."""

    id: int
    aircraft: str
    configuration: str
    last_at_s: float
    last_time_s: float

    def goes_on(self, row: EstimateRecord, at_s: float) -> bool:
        """Whether an estimate is of this flight."""
        return (
            (row.aircraft, row.configuration) == (self.aircraft, self.configuration)
            and row.time_s >= self.last_time_s
            and at_s - self.last_at_s <= SILENCE_S
        )


def append(
    session: Session, rows: Sequence[tuple[EstimateRecord, float]], known: dict[_Owner, OpenFlight]
) -> dict[_Owner, OpenFlight]:
    """Store estimates with their wall clock (seconds since 1970); the same again changes nothing.

    Returns the flights as they stand once this is committed.
    """
    flights: dict[_Owner, OpenFlight] = {}
    entries: list[dict[str, Any]] = []
    counts: dict[int, int] = {}
    for row, at_s in rows:
        owner = row.fleet, row.vehicle
        flight = flights.get(owner)
        if flight is None:
            before = known.get(owner) or _last_flight(session, owner)
            flight = None if before is None else OpenFlight(*(getattr(before, n) for n in _OPEN))
        if flight is None or not (flight.goes_on(row, at_s) or _is_there(session, flight, row)):
            flight = _begin(session, row, at_s)
        flight.last_at_s, flight.last_time_s = at_s, max(flight.last_time_s, row.time_s)
        flights[owner] = flight
        counts[flight.id] = counts.get(flight.id, 0) + 1
        entries.append(_entry(flight.id, row, at_s))
    # The table itself: through the mapped class every row costs twice as much.
    session.execute(inserting(session)(HistoryEntry.__table__).on_conflict_do_nothing(), entries)
    _count(session, list(flights.values()), counts)
    return flights


def _count(session: Session, flights: Sequence[OpenFlight], counts: dict[int, int]) -> None:
    """Where each flight stands, and how many rows have come of it: a statement each for all flights together."""
    table = cast(Table, FlightRow.__table__)
    here = table.c.id == bindparam("flight")
    went_on: dict[str, Any] = {"last_at_s": bindparam("at_s"), "last_time_s": bindparam("time_s")}
    session.connection().execute(
        update(table).where(here).values(went_on),
        [{"flight": f.id, "at_s": f.last_at_s, "time_s": f.last_time_s} for f in flights],
    )
    session.connection().execute(
        update(table).where(here).values(rows=table.c.rows + bindparam("more")),
        [{"flight": flight_id, "more": more} for flight_id, more in counts.items()],
    )


def page(session: Session, fleet: str, vehicle: str, wanted: HistoryWanted) -> tuple[HistoryRow, ...]:
    """Kept estimates by flight, time, estimator and structure."""
    flights = flights_of(fleet, vehicle, wanted)
    found: list[HistoryRow] = []
    for flight in session.scalars(flights.order_by(FlightRow.id)):
        left = None if wanted.limit is None else wanted.limit - len(found)
        if left == 0:
            break
        entries = session.scalars(entries_of(flight.id, wanted).limit(left))
        found += [_row(flight, entry) for entry in entries]
    return tuple(found)


def flights_of(fleet: str, vehicle: str, wanted: HistoryWanted) -> Any:
    """The flights of a vehicle that a part of its history is of."""
    flights = select(FlightRow).where(FlightRow.fleet == fleet, FlightRow.vehicle == vehicle)
    if wanted.flight is not None:
        flights = flights.where(FlightRow.id == wanted.flight)
    if wanted.start is not None:
        flights = flights.where(FlightRow.id >= wanted.start[0])
    if wanted.from_s is not None:
        flights = flights.where(FlightRow.last_time_s >= wanted.from_s)
    if wanted.to_s is not None:
        flights = flights.where(FlightRow.first_time_s <= wanted.to_s)
    return flights


def prune(session: Session, now_at_s: float, retention: Retention) -> bool:
    """One step of thinning and dropping, small enough not to hold others up; whether more may be due."""
    aged = select(FlightRow).where(FlightRow.last_at_s < now_at_s - retention.keep_s)
    oldest = session.scalar(aged.order_by(FlightRow.last_at_s).limit(1))
    if oldest is None and (session.scalar(select(func.sum(FlightRow.rows))) or 0) > retention.most_rows:
        oldest = session.scalar(select(FlightRow).order_by(FlightRow.last_at_s, FlightRow.id).limit(1))
    if oldest is not None:
        _drop_oldest(session, oldest, now_at_s)
        return True
    until_s = now_at_s - retention.full_rate_s
    # A flight is done where it has been thinned to its end; another has at least ten minutes to be thinned.
    due = select(FlightRow).where(
        (FlightRow.thinned_at_s <= until_s - _LEAST_S) & (FlightRow.thinned_at_s < FlightRow.last_at_s)
    )
    flight = session.scalar(due.order_by(FlightRow.thinned_at_s).limit(1))
    if flight is None:
        return False
    _thin(session, flight, until_s, retention.interval_s)
    return True


_OPEN = ("id", "aircraft", "configuration", "last_at_s", "last_time_s")


def _last_flight(session: Session, owner: _Owner) -> FlightRow | None:
    query = select(FlightRow).where(FlightRow.fleet == owner[0], FlightRow.vehicle == owner[1])
    return session.scalar(query.order_by(FlightRow.id.desc()).limit(1))


def _begin(session: Session, row: EstimateRecord, at_s: float) -> OpenFlight:
    values = {
        "fleet": row.fleet, "vehicle": row.vehicle, "aircraft": row.aircraft, "configuration": row.configuration,
        "began_at_s": at_s, "last_at_s": at_s, "first_time_s": row.time_s, "last_time_s": row.time_s, "rows": 0,
        "thinned_at_s": at_s,
    }  # fmt: skip
    new_id = session.scalars(insert(FlightRow).values(values).returning(FlightRow.id)).one()
    return OpenFlight(new_id, row.aircraft, row.configuration, at_s, row.time_s)


def _is_there(session: Session, flight: OpenFlight, row: EstimateRecord) -> bool:
    """Whether this very estimate is stored: its batch is written again, because the reply was lost."""
    key = (flight.id, row.time_s, row.estimator, row.structure)
    entry = session.get(HistoryEntry, key)
    return entry is not None and entry.numbers == _packed(row)


def _entry(flight_id: int, row: EstimateRecord, at_s: float) -> dict[str, Any]:
    return {
        "flight_id": flight_id, "time_s": row.time_s, "estimator": row.estimator, "structure": row.structure,
        "at_s": at_s, "outcome": row.outcome, "numbers": _packed(row),
    }  # fmt: skip


def entries_of(flight_id: int, wanted: HistoryWanted, what: Sequence[Any] = (HistoryEntry,)) -> Any:
    """The estimates of a flight, in their order.

    Args:
        what: of each; all of it by default.
    """
    key = (HistoryEntry.time_s, HistoryEntry.estimator, HistoryEntry.structure)
    query = select(*what).where(HistoryEntry.flight_id == flight_id).order_by(*key)
    if wanted.from_s is not None:
        query = query.where(HistoryEntry.time_s >= wanted.from_s)
    if wanted.to_s is not None:
        query = query.where(HistoryEntry.time_s <= wanted.to_s)
    if wanted.structures is not None:
        query = query.where(HistoryEntry.structure.in_(wanted.structures))
    if wanted.start is not None and wanted.start[0] == flight_id:
        query = query.where(HistoryEntry.time_s >= wanted.start[1], tuple_(*key) >= tuple_(*wanted.start[1:]))
    return query


def _row(flight: FlightRow, entry: HistoryEntry) -> HistoryRow:
    value, error, covariance, condition = _unpacked(entry.numbers)
    estimate = EstimateRecord(
        flight.fleet, flight.vehicle, entry.time_s, entry.structure, entry.estimator, value, error, entry.outcome,
        condition, flight.aircraft, flight.configuration, covariance,
    )  # fmt: skip
    return HistoryRow(estimate, flight.id, entry.at_s)


def _packed(row: EstimateRecord) -> bytes:
    numbers = [*row.value, *row.standard_error, *row.condition, *row.covariance]
    return struct.pack(f"<B{len(numbers)}d", len(row.value), *numbers)


def _unpacked(
    stored: bytes,
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...], tuple[float, float, float, float]]:
    k = stored[0]
    numbers = struct.unpack(f"<{len(stored) // 8}d", stored[1:])
    airspeed, altitude, density, alpha = numbers[2 * k : 2 * k + 4]
    return numbers[:k], numbers[k : 2 * k], numbers[2 * k + 4 :], (airspeed, altitude, density, alpha)


def _thin(session: Session, flight: FlightRow, until_s: float, interval_s: float) -> None:
    """Of what is older than ``until_s`` keep the first instant of each interval of the vehicle's clock."""
    instants = select(HistoryEntry.time_s, func.max(HistoryEntry.at_s), func.count())
    instants = instants.where(HistoryEntry.flight_id == flight.id)
    if flight.thinned_time_s is not None:
        instants = instants.where(HistoryEntry.time_s > flight.thinned_time_s)
    found = session.execute(
        instants.group_by(HistoryEntry.time_s).order_by(HistoryEntry.time_s).limit(_INSTANTS)
    ).all()
    last = None if flight.thinned_time_s is None else math.floor(flight.thinned_time_s / interval_s)
    thinned_at_s = flight.last_at_s if len(found) < _INSTANTS else flight.thinned_at_s
    spare: list[float] = []
    for time_s, at_s, rows in found:
        if at_s is not None and at_s > until_s:
            thinned_at_s = until_s
            break
        interval = math.floor(time_s / interval_s)
        if interval == last:
            spare.append(time_s)
            flight.rows = max(0, flight.rows - rows)
        last, flight.thinned_time_s = interval, time_s
        thinned_at_s = max(thinned_at_s, at_s or thinned_at_s)
    flight.thinned_at_s = max(flight.thinned_at_s, thinned_at_s)
    for start in range(0, len(spare), _IN_ONE_STATEMENT):
        some = spare[start : start + _IN_ONE_STATEMENT]
        of_flight = (HistoryEntry.flight_id == flight.id, HistoryEntry.time_s.in_(some))
        session.execute(delete(HistoryEntry).where(*of_flight))


def _drop_oldest(session: Session, flight: FlightRow, now_at_s: float) -> None:
    first = select(HistoryEntry.time_s).where(HistoryEntry.flight_id == flight.id).distinct()
    times = session.scalars(first.order_by(HistoryEntry.time_s).limit(_INSTANTS)).all()
    count = func.count()
    if times:
        of_flight = (HistoryEntry.flight_id == flight.id, HistoryEntry.time_s <= times[-1])
        gone = session.scalar(select(count).select_from(HistoryEntry).where(*of_flight)) or 0
        session.execute(delete(HistoryEntry).where(*of_flight))
        flight.rows = max(0, flight.rows - gone)
        return
    flight.rows = 0
    if now_at_s - flight.last_at_s > SILENCE_S:
        session.delete(flight)
    else:
        flight.last_at_s = now_at_s
