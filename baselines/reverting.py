"""Changes of the baseline within a session: how they are noted, taken back, and what is removed."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from sqlalchemy import delete, select, update
from sqlalchemy.orm import Session

from wingwatch.baselines.baseline_rows import cell_record, of_key, put_cell, taught
from wingwatch.baselines.records import CellRecord, ChangeRecord, ReferenceKey
from wingwatch.baselines.reference import Reference
from wingwatch.baselines.tables import CellRow, ChangeRow, ExpectationRow, ReferenceRow

__all__ = [
    "Reverted",
    "Selection",
    "entries_of",
    "place_of",
    "put_cell_of_change",
    "put_change",
    "remove_entries",
    "remove_vehicle",
    "revert_entries",
    "revert_vehicle",
    "scope_of",
    "versions_of",
]

MAX_CHANGES = 10_000
"""Most changes that are kept; the oldest go first."""


@dataclass(frozen=True, slots=True)
class Selection:
    """Which part of the baseline; what is None is not narrowed.

    Attributes:
        entry: one entry by its id.
        version: the version of a reference that is to count again, 0 for none of them.
    """

    aircraft: str
    configuration: str = "clean"
    structure: str | None = None
    fleet: str | None = None
    vehicle: str | None = None
    entry: int | None = None
    version: int | None = None

    def key(self, structure: str) -> ReferenceKey:
        """Of what the vehicle taught of a structure."""
        return ReferenceKey(
            self.fleet or "default", self.vehicle or "", self.aircraft, self.configuration, structure
        )

    @property
    def owner(self) -> str:
        """Whose it is, for a person."""
        if self.vehicle is None:
            return f"aircraft {self.aircraft} ({self.configuration})"
        return f"vehicle {self.fleet}/{self.vehicle}"


@dataclass(frozen=True, slots=True)
class Reverted:
    """What was taken back, and what counts again.

    Attributes:
        withdrawn, restored: ids of entries, or of versions where it is about a vehicle.
        cells: cells of the envelope that were restored or forgotten.
    """

    withdrawn: tuple[int, ...] = field(default=())
    restored: tuple[int, ...] = field(default=())
    cells: int = 0


def scope_of(one: Any) -> tuple[str, str, str | None, str | None]:
    """What a change, an entry or a key is about: aircraft, configuration, fleet and vehicle."""
    return one.aircraft, one.configuration, getattr(one, "fleet", None), getattr(one, "vehicle", None)


def put_change(session: Session, change: ChangeRecord) -> ChangeRow:
    """Note a change; the oldest beyond ``MAX_CHANGES`` go."""
    row = ChangeRow(**asdict(change))
    session.add(row)
    session.flush()
    session.execute(delete(ChangeRow).where(ChangeRow.id <= row.id - MAX_CHANGES))
    return row


def put_cell_of_change(session: Session, change: ChangeRow, cell: CellRecord, known: CellRow | None) -> None:
    """Store a cell, and note with the change what was there."""
    before = None if known is None else {**taught(known).to_dict(), "updated_at_s": known.updated_at_s}
    noted = {
        "structure": cell.key.structure,
        "cell": [cell.cell.airspeed, cell.cell.altitude],
        "written_at_s": cell.updated_at_s,
        "before": before,
    }
    change.cells_before = [*(change.cells_before or ()), noted]
    put_cell(session, cell)


def place_of(cell: CellRecord) -> tuple[Any, ...]:
    """Conditions for the row of a cell."""
    at = (CellRow.airspeed_cell == cell.cell.airspeed, CellRow.altitude_cell == cell.cell.altitude)
    return (*of_key(CellRow, cell.key), *at)


def entries_of(selection: Selection) -> tuple[Any, ...]:
    """Conditions for the entries of a selection."""
    found = [
        ExpectationRow.aircraft == selection.aircraft,
        ExpectationRow.configuration == selection.configuration,
    ]
    if selection.structure is not None:
        found.append(ExpectationRow.structure == selection.structure)
    if selection.entry is not None:
        found.append(ExpectationRow.id == selection.entry)
    return tuple(found)


def versions_of(
    table: type[ReferenceRow] | type[CellRow] | type[ChangeRow], selection: Selection
) -> tuple[Any, ...]:
    """Conditions for what a selection's vehicle taught."""
    found = [
        table.aircraft == selection.aircraft,
        table.configuration == selection.configuration,
        table.fleet == selection.fleet,
        table.vehicle == selection.vehicle,
    ]
    if selection.structure is not None and table is not ChangeRow:
        found.append(table.structure == selection.structure)  # type: ignore[union-attr]
    return tuple(found)


def revert_entries(session: Session, selection: Selection) -> Reverted:
    """Take back the entries of the newest change, or one entry; what they took the place of counts again."""
    query = select(ExpectationRow).where(*entries_of(selection), ExpectationRow.superseded_by.is_(None))
    current = session.scalars(query.order_by(ExpectationRow.id.desc())).all()
    if not current:
        raise ValueError(_no_entries(selection))
    newest = current[0]
    gone = [
        row
        for row in current
        if row.change_id == newest.change_id
        and (newest.change_id is not None or row.created_at_s == newest.created_at_s)
    ]
    back: list[ExpectationRow] = []
    for row in gone:
        earlier = session.scalars(
            select(ExpectationRow)
            .where(ExpectationRow.superseded_by == row.id, ExpectationRow.id < row.id)
            .order_by(ExpectationRow.id)
        ).all()
        row.superseded_by = earlier[-1].id if earlier else row.id
        back += earlier
    session.flush()
    restored = []
    for row in back:
        there = session.scalar(
            select(ExpectationRow.id).where(
                ExpectationRow.aircraft == row.aircraft,
                ExpectationRow.configuration == row.configuration,
                ExpectationRow.structure == row.structure,
                ExpectationRow.airspeed_true_m_s == row.airspeed_true_m_s,
                ExpectationRow.altitude_m == row.altitude_m,
                ExpectationRow.superseded_by.is_(None),
            )
        )
        row.superseded_by = there  # another entry may have come to its point since
        session.flush()
        if there is None:
            restored.append(row.id)
    return Reverted(tuple(sorted(row.id for row in gone)), tuple(sorted(restored)))


def revert_vehicle(session: Session, selection: Selection, change_id: int) -> Reverted:
    """Take back versions of a vehicle's references, and what cells were taught with them."""
    query = select(ReferenceRow).where(
        *versions_of(ReferenceRow, selection), ReferenceRow.withdrawn_by.is_(None)
    )
    standing = session.scalars(query.order_by(ReferenceRow.id.desc())).all()
    if not standing:
        raise ValueError(_no_vehicle(selection))
    gone = _after(standing, selection)
    if not gone:
        raise ValueError(f"version {selection.version} is the newest already; there is nothing to take back")
    for row in gone:
        row.withdrawn_by = change_id
    kept = [row for row in standing if row not in gone]
    newest = {row.structure: row for row in reversed(kept)}
    cells = 0
    for structure in {row.structure for row in gone}:
        since_s = newest[structure].updated_at_s if structure in newest else float("-inf")
        changes = {row.change_id for row in gone if row.structure == structure} - {None}
        cells += _revert_cells(session, selection, structure, since_s, {c for c in changes if c is not None})
    restored = (newest[s].id for s in {row.structure for row in gone} if s in newest)
    return Reverted(tuple(sorted(row.id for row in gone)), tuple(sorted(restored)), cells)


def _after(standing: Sequence[ReferenceRow], selection: Selection) -> list[ReferenceRow]:
    """Versions to be taken back, of all that stand, newest first."""
    if selection.version == 0:
        return list(standing)
    if selection.version is not None:
        wanted = next((row for row in standing if row.id == selection.version), None)
        if wanted is None:
            raise ValueError(
                f"vehicle {selection.fleet}/{selection.vehicle} has no version {selection.version} that stands; "
                "`wingwatch baseline history` lists its versions"
            )
        return [
            row
            for row in standing
            if (row.id > wanted.id and row.structure == wanted.structure)
            or (row.structure != wanted.structure and row.updated_at_s > wanted.updated_at_s)
        ]
    newest = standing[0]
    if newest.change_id is not None:
        return [row for row in standing if row.change_id == newest.change_id]
    first: dict[str, ReferenceRow] = {}
    for row in standing:
        first.setdefault(row.structure, row)
    return list(first.values())


def _revert_cells(
    session: Session, selection: Selection, structure: str, since_s: float, changes: set[int]
) -> int:
    """Cells taught later than what counts again: as they were before the changes, or forgotten; how many."""
    before: dict[tuple[int, int], dict[str, Any]] = {}
    for change in session.scalars(select(ChangeRow).where(ChangeRow.id.in_(changes)).order_by(ChangeRow.id)):
        for noted in change.cells_before or ():
            if noted["structure"] == structure:
                before.setdefault((noted["cell"][0], noted["cell"][1]), noted)
    query = select(CellRow).where(
        *versions_of(CellRow, selection), CellRow.structure == structure, CellRow.updated_at_s > since_s
    )
    rows = session.scalars(query).all()
    for row in rows:
        record = cell_record(row)
        session.delete(row)
        session.flush()
        earlier = before.get((row.airspeed_cell, row.altitude_cell), {}).get("before")
        if earlier is not None:
            at_s = earlier["updated_at_s"]
            memory = Reference.from_dict({k: v for k, v in earlier.items() if k != "updated_at_s"})
            put_cell(session, CellRecord(record.key, record.cell, memory, at_s))
    return len(rows)


def remove_entries(session: Session, selection: Selection) -> Reverted:
    """Remove entries, superseded ones too; an entry that one of them superseded is history still."""
    gone = session.scalars(select(ExpectationRow.id).where(*entries_of(selection))).all()
    if not gone:
        raise ValueError(_no_entries(selection))
    mine = ExpectationRow.superseded_by.in_(gone)
    session.execute(update(ExpectationRow).where(mine).values(superseded_by=ExpectationRow.id))
    session.execute(delete(ExpectationRow).where(ExpectationRow.id.in_(gone)))
    return Reverted(tuple(gone))


def remove_vehicle(session: Session, selection: Selection) -> Reverted:
    """Remove all versions and cells of a vehicle."""
    versions = session.scalars(select(ReferenceRow.id).where(*versions_of(ReferenceRow, selection))).all()
    cells = session.scalars(select(CellRow.id).where(*versions_of(CellRow, selection))).all()
    if not versions and not cells:
        raise ValueError(_no_vehicle(selection))
    session.execute(delete(ReferenceRow).where(*versions_of(ReferenceRow, selection)))
    session.execute(delete(CellRow).where(*versions_of(CellRow, selection)))
    return Reverted(tuple(versions), cells=len(cells))


def _no_entries(selection: Selection) -> str:
    of = "" if selection.structure is None else f" of {selection.structure}"
    what = f"no entry{of}" if selection.entry is None else f"no such entry {selection.entry}{of} that counts"
    return (
        f"the baseline has {what} of aircraft {selection.aircraft} in configuration {selection.configuration}; "
        "`wingwatch baseline list` says what it has"
    )


def _no_vehicle(selection: Selection) -> str:
    return (
        f"vehicle {selection.fleet}/{selection.vehicle} has taught nothing of aircraft {selection.aircraft} "
        f"in configuration {selection.configuration}; `wingwatch baseline list` names those that have"
    )
