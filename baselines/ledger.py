"""The baseline as people look into it and change it: all of it at once, and every change in one transaction.

A change writes a row of ``baseline_change`` beside what it changes. A running service looks for such rows, so nothing
changes behind its back (docs/decisions/0096-changes-of-the-baseline.md).
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from sqlalchemy import Select, func, select
from sqlalchemy.orm import Session

from wingwatch.baselines.baseline_rows import (
    cell_record,
    change_record,
    expectation_record,
    newest_reference,
    of_key,
    put_entry,
    put_reference,
    reference_record,
    same_series,
    taught,
)
from wingwatch.baselines.connection import one_writer
from wingwatch.baselines.database import Database
from wingwatch.baselines.records import (
    CellRecord,
    ChangeRecord,
    ExpectationRecord,
    ReferenceKey,
    ReferenceRecord,
    SeriesOverview,
    TaughtOverview,
)
from wingwatch.baselines.reference import Reference
from wingwatch.baselines.reverting import (
    Reverted,
    Selection,
    entries_of,
    place_of,
    put_cell_of_change,
    put_change,
    remove_entries,
    remove_vehicle,
    revert_entries,
    revert_vehicle,
    scope_of,
    versions_of,
)
from wingwatch.baselines.tables import CellRow, ChangeRow, ExpectationRow, ReferenceRow

__all__ = ["BaselineContent", "BaselineLedger", "Reverted", "Selection", "Teaching"]


@dataclass(frozen=True, slots=True)
class BaselineContent:
    """Entries, versions of references and cells."""

    entries: tuple[ExpectationRecord, ...] = ()
    references: tuple[ReferenceRecord, ...] = ()
    cells: tuple[CellRecord, ...] = ()


@dataclass(frozen=True, slots=True)
class Teaching:
    """What further flights teach.

    Attributes:
        entries: of expectations, each with the ids of current entries whose place it takes.
        learned: by key, what is added to the version that counts.
        source: the flights, for the reader.
        cells: each with when the row was changed that it was learned on; None where there was none. Where the row has
            been changed since, the newer one stays.
    """

    entries: Sequence[tuple[ExpectationRecord, tuple[int, ...]]] = ()
    learned: Sequence[tuple[ReferenceKey, Reference]] = ()
    source: str = ""
    cells: Sequence[tuple[CellRecord, float | None]] = ()


class BaselineLedger:
    """Reads and changes the baseline of an open database. Every method may raise ``DatabaseError``."""

    def __init__(self, database: Database) -> None:
        self._database = database

    # -- reading ----------------------------------------------------------------------------------

    def series(self) -> tuple[SeriesOverview, ...]:
        """How many entries there are, by aircraft, configuration and structure."""
        name = (ExpectationRow.aircraft, ExpectationRow.configuration, ExpectationRow.structure)
        current = ExpectationRow.superseded_by.is_(None)
        query = select(
            *name, ExpectationRow.provenance, current, func.count(), func.max(ExpectationRow.created_at_s)
        ).group_by(*name, ExpectationRow.provenance, current)
        found: dict[tuple[str, str, str], SeriesOverview] = {}
        with self._database.reading() as session:
            for aircraft, configuration, structure, provenance, now, count, newest_s in session.execute(
                query
            ):
                key = (aircraft, configuration, structure)
                one = found.get(key) or SeriesOverview(*key, {}, 0, None)
                if now:
                    one = replace(
                        one,
                        entries={**one.entries, provenance: count},
                        newest_at_s=max(newest_s, one.newest_at_s or newest_s),
                    )
                else:
                    one = replace(one, superseded=one.superseded + count)
                found[key] = one
        return tuple(found[key] for key in sorted(found))

    def taught(self, aircraft: str | None = None) -> tuple[TaughtOverview, ...]:
        """What each vehicle's flights taught, by vehicle, aircraft, configuration and structure."""
        counts: dict[ReferenceKey, tuple[int, float]] = {}
        with self._database.reading() as session:
            key = tuple(getattr(CellRow, name) for name in ReferenceKey.__dataclass_fields__)
            cells = select(*key, func.count(), func.max(CellRow.updated_at_s)).group_by(*key)
            if aircraft is not None:
                cells = cells.where(CellRow.aircraft == aircraft)
            for *names, count, updated_s in session.execute(cells):
                counts[ReferenceKey(*names)] = (count, updated_s)
            found = {}
            for row in _newest(session, aircraft):
                record = reference_record(row)
                found[record.key] = (record.reference.blocks, record.reference.seconds, record.updated_at_s)
        made = []
        for one in {**found, **counts}:
            blocks, seconds, at_s = found.get(one, (0, 0.0, 0.0))
            number, updated_s = counts.get(one, (0, at_s))
            made.append(TaughtOverview(one, blocks, seconds, number, max(at_s, updated_s)))
        return tuple(sorted(made, key=lambda t: tuple(asdict(t.key).values())))

    def content(self, aircraft: str | None = None) -> BaselineContent:
        """All that counts: current entries, newest versions of references, and cells, each by name and place."""
        entries = _of_aircraft(select(ExpectationRow), ExpectationRow, aircraft)
        entries = entries.where(ExpectationRow.superseded_by.is_(None))
        cells = _of_aircraft(select(CellRow), CellRow, aircraft)
        with self._database.reading() as session:
            found = (
                map(expectation_record, session.scalars(entries)),
                map(reference_record, _newest(session, aircraft)),
                map(cell_record, session.scalars(cells)),
            )
            return BaselineContent(
                tuple(sorted(found[0], key=_place_of_entry)),
                tuple(sorted(found[1], key=lambda one: _names(one.key))),
                tuple(sorted(found[2], key=lambda one: (*_names(one.key), one.cell))),
            )

    def cells(self, key: ReferenceKey) -> tuple[CellRecord, ...]:
        """What cells of the envelope taught of one vehicle's structure, by cell."""
        order = (CellRow.airspeed_cell, CellRow.altitude_cell)
        with self._database.reading() as session:
            rows = session.scalars(select(CellRow).where(*of_key(CellRow, key)).order_by(*order))
            return tuple(map(cell_record, rows))

    def newest_version(self, key: ReferenceKey) -> ReferenceRecord | None:
        """The version of a reference that counts; None where there is none."""
        with self._database.reading() as session:
            row = newest_reference(session, key)
            return None if row is None else reference_record(row)

    def sources(self, selection: Selection) -> tuple[str, ...]:
        """Where what counts comes from: of a vehicle's versions that stand, or of an aircraft's current entries."""
        with self._database.reading() as session:
            if selection.vehicle is None:
                current = (*entries_of(selection), ExpectationRow.superseded_by.is_(None))
                return tuple(session.scalars(select(ExpectationRow.source).where(*current)))
            standing = (*versions_of(ReferenceRow, selection), ReferenceRow.withdrawn_by.is_(None))
            found = session.scalars(select(ReferenceRow.source).where(*standing))
            return tuple(one for one in found if one)

    def all_sources(self, selection: Selection) -> tuple[str, ...]:
        """Where what counts of all vehicles of an aircraft comes from."""
        standing = (
            ReferenceRow.aircraft == selection.aircraft,
            ReferenceRow.configuration == selection.configuration,
            ReferenceRow.withdrawn_by.is_(None),
            ReferenceRow.source.is_not(None),
        )
        with self._database.reading() as session:
            return tuple(one or "" for one in session.scalars(select(ReferenceRow.source).where(*standing)))

    def changes(self, after: int = 0, aircraft: str | None = None) -> tuple[ChangeRecord, ...]:
        """Changes with an id above ``after``, oldest first."""
        query = _of_aircraft(select(ChangeRow), ChangeRow, aircraft).where(ChangeRow.id > after)
        with self._database.reading() as session:
            return tuple(map(change_record, session.scalars(query.order_by(ChangeRow.id))))

    def newest_change(self) -> int:
        """Id of the newest change; 0 before the first."""
        with self._database.reading() as session:
            return session.scalar(select(func.max(ChangeRow.id))) or 0

    # -- changing ---------------------------------------------------------------------------------

    def teach(self, change: ChangeRecord, teaching: Teaching) -> None:
        """Store what flights taught: all of it or nothing."""
        with self._database.writing() as session:
            one_writer(session.connection())
            row = put_change(session, change)
            for entry, also in teaching.entries:
                put_entry(session, replace(entry, change_id=row.id), also)
            for key, learned in teaching.learned:
                newest = newest_reference(session, key)
                total = learned if newest is None else taught(newest).plus(learned)
                put_reference(
                    session, ReferenceRecord(key, total, change.at_s, teaching.source, change_id=row.id)
                )
            for cell, seen_s in teaching.cells:
                known = session.scalar(select(CellRow).where(*place_of(cell)))
                if (None if known is None else known.updated_at_s) == seen_s:
                    put_cell_of_change(session, row, cell, known)

    def put(self, changes: Sequence[ChangeRecord], content: BaselineContent) -> int:
        """Store content of elsewhere, each aircraft's and vehicle's under a change of its own: all of it or nothing.

        What is there already to the bit is not stored again. Entries that count supersede those at their points.

        Returns:
            how many entries, versions and cells were stored.
        """
        with self._database.writing() as session:
            one_writer(session.connection())
            rows = {scope_of(c): put_change(session, c) for c in changes}
            stored = 0
            for entry in content.entries:
                if not _is_current(session, entry):
                    put_entry(session, replace(entry, id=None, change_id=rows[scope_of(entry)].id))
                    stored += 1
            for version in content.references:
                of = rows[scope_of(version.key)].id
                stored += put_reference(session, replace(version, change_id=of, withdrawn_by=None))
            for cell in content.cells:
                known = session.scalar(select(CellRow).where(*place_of(cell)))
                if known is None or not _same_cell(known, cell):
                    put_cell_of_change(session, rows[scope_of(cell.key)], cell, known)
                    stored += 1
            return stored

    def revert(self, change: ChangeRecord, selection: Selection, *, keep: bool = True) -> Reverted:
        """Take back the newest version: what it took the place of counts again.

        Of an aircraft the newest change's entries, or one entry. Of a vehicle the newest version of each structure, or
        all after ``selection.version``.

        Args:
            keep: whether it is done; else the answer only says what would be.

        Raises:
            ValueError: there is nothing to take back.
        """
        with self._database.writing() as session:
            one_writer(session.connection())
            row = put_change(session, change)
            if selection.vehicle is None:
                found = revert_entries(session, selection)
            else:
                found = revert_vehicle(session, selection, row.id)
            if not keep:
                session.rollback()
            return found

    def remove(self, change: ChangeRecord, selection: Selection, *, keep: bool = True) -> Reverted:
        """Remove entries with their history, or all that a vehicle taught.

        Args:
            keep: as for ``revert``.

        Raises:
            ValueError: there is none of it.
        """
        with self._database.writing() as session:
            one_writer(session.connection())
            put_change(session, change)
            act = remove_entries if selection.vehicle is None else remove_vehicle
            found = act(session, selection)
            if not keep:
                session.rollback()
            return found


def _names(key: ReferenceKey) -> tuple[str, ...]:
    return key.aircraft, key.configuration, key.fleet, key.vehicle, key.structure


def _place_of_entry(one: ExpectationRecord) -> tuple[str, str, str, float, float]:
    return one.aircraft, one.configuration, one.structure, one.airspeed_true_m_s, one.altitude_m


def _newest(session: Session, aircraft: str | None) -> list[ReferenceRow]:
    """The versions that count. Keys are read from the index alone, for rows are large and there are many versions."""
    key = tuple(getattr(ReferenceRow, name) for name in ReferenceKey.__dataclass_fields__)
    keys = session.execute(_of_aircraft(select(*key).distinct(), ReferenceRow, aircraft))
    rows = (newest_reference(session, ReferenceKey(*names)) for names in keys)
    return [row for row in rows if row is not None]


def _of_aircraft(query: Select[Any], table: Any, aircraft: str | None) -> Select[Any]:
    return query if aircraft is None else query.where(table.aircraft == aircraft)


def _same_cell(known: CellRow, cell: CellRecord) -> bool:
    return known.updated_at_s == cell.updated_at_s and taught(known).to_dict() == cell.reference.to_dict()


def _is_current(session: Session, entry: ExpectationRecord) -> bool:
    """Whether the entry at that point is this one to the bit."""
    found = session.scalar(
        select(ExpectationRow).where(
            *same_series(entry.aircraft, entry.configuration, entry.structure),
            ExpectationRow.superseded_by.is_(None),
            ExpectationRow.airspeed_true_m_s == entry.airspeed_true_m_s,
            ExpectationRow.altitude_m == entry.altitude_m,
        )
    )
    same = replace(entry, id=None, superseded_by=None, change_id=None)
    return found is not None and replace(expectation_record(found), id=None, change_id=None) == same
