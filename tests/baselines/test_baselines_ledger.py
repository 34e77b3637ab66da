"""Changes of the baseline: all or nothing, noted, and taken back to what was there before, on both databases."""

from dataclasses import replace

import numpy as np
import pytest
from test_baselines_database import KEY, entry

from wingwatch.baselines import (
    BaselineContent,
    BaselineLedger,
    Cell,
    CellRecord,
    ChangeRecord,
    Database,
    Reference,
    ReferenceKey,
    ReferenceRecord,
    RefusedError,
    Selection,
    Teaching,
)

TYPE = Selection("aerosonde")
OWN = replace(TYPE, fleet="default", vehicle="uav-1")
HERE, THERE = Cell(23, 1), Cell(24, 1)


def change(action: str = "learn", vehicle: str | None = None, at_s: float = 1000.0) -> ChangeRecord:
    fleet = None if vehicle is None else "default"
    return ChangeRecord(at_s, action, "ada", "aerosonde", "clean", "three flights", fleet, vehicle)


def taught(blocks: int) -> Reference:
    return Reference(np.eye(6) / 3.0 * blocks, np.ones(6) * blocks, blocks, 10.0 * blocks)


def current(database: Database) -> list[tuple[float, float]]:
    return [
        (e.airspeed_true_m_s, e.value[0]) for e in database.expectations("aerosonde", "clean", "short_period")
    ]


def test_a_change_of_entries_is_taken_back_whole(database: Database) -> None:
    ledger = BaselineLedger(database)
    old = database.put_expectation(entry(value=(1.0,) * 6))
    assert old.id is not None
    moved, beside = (
        entry(value=(2.0,) * 6, airspeed_true_m_s=26.0),
        entry(value=(3.0,) * 6, airspeed_true_m_s=30.0),
    )
    ledger.teach(change(), Teaching(entries=[(moved, (old.id,)), (beside, ())]))
    assert current(database) == [(26.0, 2.0), (30.0, 3.0)]
    would = ledger.revert(change("revert"), TYPE, keep=False)
    assert current(database) == [(26.0, 2.0), (30.0, 3.0)]
    assert ledger.revert(change("revert"), TYPE) == would
    assert current(database) == [(25.1, 1.0)]
    assert would.restored == (old.id,)
    assert [c.action for c in ledger.changes()] == ["learn", "revert"]
    assert ledger.revert(change("revert"), TYPE).withdrawn == (old.id,)
    assert current(database) == []
    with pytest.raises(ValueError, match="has no entry of aircraft aerosonde"):
        ledger.revert(change("revert"), TYPE)
    assert ledger.newest_change() == ledger.changes()[-1].id
    assert len(ledger.changes()) == 3  # what could not be done is not noted


def test_one_entry_is_taken_back_and_another_at_its_point_stays(database: Database) -> None:
    ledger = BaselineLedger(database)
    old = database.put_expectation(entry(value=(1.0,) * 6))
    assert old.id is not None
    new = entry(value=(2.0,) * 6, airspeed_true_m_s=26.0)
    ledger.teach(change(), Teaching(entries=[(new, (old.id,))]))
    (learned,) = database.expectations("aerosonde", "clean", "short_period")
    database.put_expectation(entry(value=(3.0,) * 6))  # where the old one stood
    found = ledger.revert(change("revert"), replace(TYPE, entry=learned.id))
    assert (found.withdrawn, found.restored) == ((learned.id,), ())
    assert current(database) == [(25.1, 3.0)]


def test_what_a_vehicle_was_taught_is_taken_back_with_its_cells(database: Database) -> None:
    ledger = BaselineLedger(database)
    database.save_reference(KEY, taught(3), 100.0)
    database.save_cell(KEY, HERE, taught(3), 100.0)
    cells = [
        (CellRecord(KEY, HERE, taught(5), 1000.0), 100.0),
        (CellRecord(KEY, THERE, taught(2), 1000.0), None),
        (CellRecord(KEY, Cell(25, 1), taught(2), 1000.0), 7.0),  # changed since: it is not there any more
    ]
    ledger.teach(change(vehicle="uav-1"), Teaching(learned=[(KEY, taught(4))], source="a (1f)", cells=cells))
    newest = ledger.newest_version(KEY)
    assert newest is not None
    assert newest.reference.to_dict() == taught(3).plus(taught(4)).to_dict()
    assert newest.source == "a (1f)"
    assert ledger.sources(OWN) == ledger.all_sources(TYPE) == ("a (1f)",)
    assert {c.cell: c.reference.blocks for c in ledger.cells(KEY)} == {HERE: 5, THERE: 2}
    found = ledger.revert(change("revert", "uav-1", 2000.0), OWN)
    assert (found.withdrawn, found.cells) == ((newest.id,), 2)
    again = database.load_reference(KEY)
    assert again is not None
    assert again.to_dict() == taught(3).to_dict()
    assert [(c.cell, c.reference.to_dict(), c.updated_at_s) for c in ledger.cells(KEY)] == [
        (HERE, taught(3).to_dict(), 100.0)
    ]
    assert ledger.sources(OWN) == ()
    assert [v.withdrawn_by is None for v in database.reference_history(KEY)] == [True, False]


def test_versions_are_taken_back_to_one_by_its_number(database: Database) -> None:
    ledger = BaselineLedger(database)
    lateral = replace(KEY, structure="lateral")
    for blocks in (1, 2, 3):
        database.save_reference(KEY, taught(blocks), float(blocks))
        size = 15
        database.save_reference(lateral, Reference(np.eye(size), np.ones(size), blocks, 10.0), blocks + 0.5)
    first = database.reference_history(KEY)[0]
    ledger.revert(change("revert", "uav-1"), replace(OWN, version=first.id))
    assert [(t.key.structure, t.blocks) for t in ledger.taught()] == [("short_period", 1)]
    with pytest.raises(ValueError, match="is the newest already"):
        ledger.revert(change("revert", "uav-1"), replace(OWN, version=first.id))
    with pytest.raises(ValueError, match="no version 999 that stands"):
        ledger.revert(change("revert", "uav-1"), replace(OWN, version=999))
    ledger.revert(change("revert", "uav-1"), replace(OWN, version=0))
    assert database.load_reference(KEY) is None


def test_what_a_service_learned_on_what_was_changed_is_not_stored(database: Database) -> None:
    ledger = BaselineLedger(database)
    before = ledger.newest_change()
    database.save_reference(KEY, taught(3), 100.0, before)
    ledger.revert(change("revert", "uav-1"), OWN)
    database.save_reference(KEY, taught(4), 200.0, before)
    database.save_cell(KEY, HERE, taught(4), 200.0, before)
    assert database.load_reference(KEY) is None
    assert ledger.cells(KEY) == ()
    database.save_reference(replace(KEY, vehicle="uav-2"), taught(4), 200.0, before)  # another vehicle's is
    database.save_reference(KEY, taught(4), 300.0, ledger.newest_change())
    assert [(t.key.vehicle, t.blocks) for t in ledger.taught("aerosonde")] == [("uav-1", 4), ("uav-2", 4)]


def test_removing_leaves_nothing_of_it_and_all_else(database: Database) -> None:
    ledger = BaselineLedger(database)
    for value in (1.0, 2.0, 3.0):
        database.put_expectation(entry(value=(value,) * 6))
    second = database.history("aerosonde", "clean", "short_period")[1]
    ledger.remove(change("delete"), replace(TYPE, entry=second.id))
    first, third = database.history("aerosonde", "clean", "short_period")
    assert (first.superseded_by, third.superseded_by) == (first.id, None)
    database.save_reference(KEY, taught(3), 100.0)
    database.save_cell(KEY, HERE, taught(3), 100.0)
    ledger.remove(change("delete"), TYPE)
    assert database.history("aerosonde", "clean", "short_period") == ()
    assert ledger.remove(change("delete", "uav-1"), OWN).cells == 1
    with pytest.raises(ValueError, match="taught nothing"):
        ledger.remove(change("delete", "uav-1"), OWN)
    assert (ledger.taught(), ledger.series()) == ((), ())


def test_content_of_elsewhere_is_stored_whole_or_not_at_all(database: Database) -> None:
    ledger = BaselineLedger(database)
    with pytest.raises(RefusedError):
        ledger.put([change("import")], BaselineContent(entries=(entry(), entry(structure=None))))
    assert ledger.content() == BaselineContent()
    assert ledger.changes() == ()
    assert ledger.put([change("import")], BaselineContent(entries=(entry(),))) == 1
    assert ledger.put([change("import")], BaselineContent(entries=(entry(),))) == 0
    version = ReferenceRecord(KEY, taught(3), 100.0, "a (1f)")
    for brought, stored in ((version, 1), (version, 0), (replace(version, updated_at_s=200.0), 1)):
        assert ledger.put([change("import", "uav-1")], BaselineContent(references=(brought,))) == stored
    (one,) = ledger.series()
    assert (one.entries, one.superseded) == ({"identified": 1}, 0)


def test_keys_of_vehicles_are_listed_in_order(database: Database) -> None:
    ledger = BaselineLedger(database)
    for vehicle in ("b", "a"):
        key = ReferenceKey("default", vehicle, "aerosonde", "clean", "short_period")
        database.save_reference(key, taught(1), 5.0)
        database.save_cell(key, HERE, taught(1), 6.0)
    found = [(t.key.vehicle, t.blocks, t.cells, t.updated_at_s) for t in ledger.taught()]
    assert found == [("a", 1, 1, 6.0), ("b", 1, 1, 6.0)]
