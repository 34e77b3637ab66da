"""The history of estimates as columns of numbers, for pictures: much cheaper than rows where there are many."""

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from sqlalchemy import LargeBinary, func
from sqlalchemy.orm import Session

from wingwatch.aircraft import STRUCTURES
from wingwatch.baselines.estimate_history import entries_of, flights_of
from wingwatch.baselines.flight_history import FlightRecord, HistoryColumns, HistoryKey
from wingwatch.baselines.records import HistoryWanted
from wingwatch.baselines.tables import FlightRow, HistoryEntry

__all__ = ["columns", "flights"]

_MOST_BYTES = 1 + 8 * (2 * max(len(one.derivatives) for one in STRUCTURES.values()) + 4)

_Key = tuple[int, str, str]


def flights(session: Session, fleet: str, vehicle: str) -> tuple[FlightRecord, ...]:
    """All flights of a vehicle of which estimates are kept, the newest first."""
    found = session.scalars(flights_of(fleet, vehicle, HistoryWanted()).order_by(FlightRow.id.desc()))
    return tuple(
        FlightRecord(
            one.id, one.aircraft, one.configuration, one.first_time_s, one.last_time_s, one.began_at_s,
            one.last_at_s, one.rows,
        )
        for one in found
    )  # fmt: skip


def columns(
    session: Session, fleet: str, vehicle: str, wanted: HistoryWanted
) -> tuple[tuple[HistoryColumns, ...], HistoryKey | None]:
    """Kept estimates by flight, estimator and structure.

    Returns:
        the columns, and the key of the last row where ``wanted.limit`` rows were read: there may be more from it on.
    """
    rows: dict[_Key, list[Any]] = {}
    owners: dict[int, FlightRow] = {}
    last: HistoryKey | None = None
    left = wanted.limit
    for flight in session.scalars(flights_of(fleet, vehicle, wanted).order_by(FlightRow.id)):
        if left == 0:
            break
        owners[flight.id] = flight
        read = 0
        for row in session.execute(_entries(flight.id, wanted, left)):
            rows.setdefault((flight.id, row.estimator, row.structure), []).append(row)
            read += 1
        if read:
            last = (flight.id, row.time_s, row.estimator, row.structure)
        left = None if left is None else left - read
    made = itertools.chain.from_iterable(_made(owners[key[0]], key, found) for key, found in rows.items())
    return tuple(made), last if left == 0 else None


def _entries(flight_id: int, wanted: HistoryWanted, limit: int | None) -> Any:
    """Plain columns, without the covariance: an object a row costs five times as much."""
    e = HistoryEntry
    numbers = func.substr(e.numbers, 1, _MOST_BYTES, type_=LargeBinary).label("numbers")
    return entries_of(flight_id, wanted, (e.time_s, e.estimator, e.structure, e.outcome, numbers)).limit(
        limit
    )


def _made(flight: FlightRow, key: _Key, rows: Sequence[Any]) -> Iterator[HistoryColumns]:
    """Rows of one structure by one estimator; of a program that had other derivatives in it they stand apart."""
    for size, alike in itertools.groupby(rows, key=lambda row: row.numbers[0]):
        some = list(alike)
        end = 1 + 8 * (2 * size + 4)
        joined = b"".join(row.numbers[1:end] for row in some)
        numbers = np.frombuffer(joined, dtype="<f8").reshape(len(some), 2 * size + 4).astype(np.float64)
        yield HistoryColumns(
            key[0], flight.aircraft, flight.configuration, key[2], key[1],
            np.array([row.time_s for row in some]), numbers[:, :size], numbers[:, size : 2 * size],
            numbers[:, 2 * size :], tuple(row.outcome for row in some),
        )  # fmt: skip
