"""Rows of the baseline within a session: how an entry, a version and a cell are written, and what is read of them."""

from dataclasses import asdict, fields
from typing import Any

from sqlalchemy import Select, delete, select, update
from sqlalchemy.orm import Session

from wingwatch.baselines.cells import Cell
from wingwatch.baselines.records import (
    CellRecord,
    ChangeRecord,
    ExpectationRecord,
    ReferenceKey,
    ReferenceRecord,
)
from wingwatch.baselines.reference import Reference
from wingwatch.baselines.tables import CellRow, ChangeRow, ExpectationRow, ReferenceRow

__all__ = [
    "MAX_CELLS",
    "MAX_REFERENCE_HISTORY",
    "cell_record",
    "change_record",
    "expectation_record",
    "newest_reference",
    "of_key",
    "put_cell",
    "put_entry",
    "put_reference",
    "reference_record",
    "same_series",
    "taught",
]

MAX_REFERENCE_HISTORY = 1000
"""Most saved versions of one reference; the oldest go first."""

MAX_CELLS = 64
"""Most cells of the envelope that are remembered of one structure of a vehicle."""


def put_entry(session: Session, entry: ExpectationRecord, also: tuple[int, ...] = ()) -> ExpectationRow:
    """Store an entry; the current one at its point, and those of ``also``, become its history.

    A point is aircraft, configuration, structure, airspeed and altitude.
    """
    values = asdict(entry)
    values["value"], values["covariance"] = list(entry.value), [list(row) for row in entry.covariance]
    row = ExpectationRow(**values)
    current = (
        *same_series(entry.aircraft, entry.configuration, entry.structure),
        ExpectationRow.superseded_by.is_(None),
    )
    at_point = (
        ExpectationRow.airspeed_true_m_s == entry.airspeed_true_m_s,
        ExpectationRow.altitude_m == entry.altitude_m,
    )
    old = {*session.scalars(select(ExpectationRow.id).where(*current, *at_point))}
    if also:
        old |= {*session.scalars(select(ExpectationRow.id).where(*current, ExpectationRow.id.in_(also)))}
    # Only one entry of a point may be current at any moment, so the old one first points at itself.
    mine = ExpectationRow.id.in_(old)
    session.execute(update(ExpectationRow).where(mine).values(superseded_by=ExpectationRow.id))
    session.add(row)
    session.flush()
    session.execute(update(ExpectationRow).where(mine).values(superseded_by=row.id))
    return row


def put_reference(session: Session, version: ReferenceRecord) -> bool:
    """Store a new version and drop the oldest beyond ``MAX_REFERENCE_HISTORY``; the current one again changes nothing.

    What a change brings is another version also where its date or source alone is another.

    Returns:
        whether it was stored.
    """
    key = version.key
    stored = newest_reference(session, key)
    if stored is not None and taught(stored).to_dict() == version.reference.to_dict():
        named = (stored.updated_at_s, stored.source or "") == (version.updated_at_s, version.source)
        if version.change_id is None or named:
            return False
    session.add(
        ReferenceRow(
            **asdict(key),
            **version.reference.to_dict(),
            updated_at_s=version.updated_at_s,
            source=version.source or None,
            change_id=version.change_id,
            withdrawn_by=version.withdrawn_by,
        )
    )
    session.flush()
    oldest = _versions(key).with_only_columns(ReferenceRow.id).offset(MAX_REFERENCE_HISTORY - 1).limit(1)
    keep_from = session.scalar(oldest)
    if keep_from is not None:
        session.execute(delete(ReferenceRow).where(*of_key(ReferenceRow, key), ReferenceRow.id < keep_from))
    return True


def newest_reference(session: Session, key: ReferenceKey) -> ReferenceRow | None:
    """The version that counts; None if this vehicle has taught nothing yet."""
    standing = _versions(key).where(ReferenceRow.withdrawn_by.is_(None))
    return session.scalar(standing.limit(1))


def _versions(key: ReferenceKey) -> Select[ReferenceRow]:
    """All of one key, newest first."""
    return select(ReferenceRow).where(*of_key(ReferenceRow, key)).order_by(ReferenceRow.id.desc())


def put_cell(session: Session, cell: CellRecord) -> None:
    """Store what a cell taught in place of what was stored of it; those longest not flown go first."""
    of_vehicle = of_key(CellRow, cell.key)
    at = (CellRow.airspeed_cell == cell.cell.airspeed, CellRow.altitude_cell == cell.cell.altitude)
    values = {**cell.reference.to_dict(), "updated_at_s": cell.updated_at_s}
    row = session.scalar(select(CellRow).where(*of_vehicle, *at))
    if row is None:
        place = {"airspeed_cell": cell.cell.airspeed, "altitude_cell": cell.cell.altitude}
        session.add(CellRow(**asdict(cell.key), **place, **values))
    else:
        session.execute(update(CellRow).where(CellRow.id == row.id).values(values))
    session.flush()
    newest = (CellRow.updated_at_s.desc(), CellRow.id.desc())
    gone = session.scalars(select(CellRow.id).where(*of_vehicle).order_by(*newest).offset(MAX_CELLS)).all()
    session.execute(delete(CellRow).where(CellRow.id.in_(gone)))


def same_series(aircraft: str, configuration: str, structure: str) -> tuple[Any, ...]:
    """Conditions for the entries of one structure."""
    return (
        ExpectationRow.aircraft == aircraft,
        ExpectationRow.configuration == configuration,
        ExpectationRow.structure == structure,
    )


def of_key(table: type[ReferenceRow] | type[CellRow], key: ReferenceKey) -> tuple[Any, ...]:
    """Conditions for the rows of one vehicle's structure."""
    return tuple(getattr(table, f.name) == getattr(key, f.name) for f in fields(key))


def expectation_record(row: ExpectationRow) -> ExpectationRecord:
    """An entry as it is stored."""
    values = {f.name: getattr(row, f.name) for f in fields(ExpectationRecord)}
    values["value"] = tuple(row.value)
    values["covariance"] = tuple(tuple(r) for r in row.covariance)
    return ExpectationRecord(**values)


def reference_record(row: ReferenceRow) -> ReferenceRecord:
    """A version as it is stored."""
    return ReferenceRecord(
        _key_of(row), taught(row), row.updated_at_s, row.source or "", row.id, row.change_id, row.withdrawn_by
    )


def cell_record(row: CellRow) -> CellRecord:
    """A cell as it is stored."""
    cell = Cell(row.airspeed_cell, row.altitude_cell)
    return CellRecord(_key_of(row), cell, taught(row), row.updated_at_s)


def change_record(row: ChangeRow) -> ChangeRecord:
    """A change as it is stored."""
    return ChangeRecord(**{f.name: getattr(row, f.name) for f in fields(ChangeRecord)})


def taught(row: ReferenceRow | CellRow) -> Reference:
    """What flights taught."""
    names = ("information", "vector", "blocks", "seconds")
    return Reference.from_dict({n: getattr(row, n) for n in names})


def _key_of(row: ReferenceRow | CellRow) -> ReferenceKey:
    return ReferenceKey(**{f.name: getattr(row, f.name) for f in fields(ReferenceKey)})
