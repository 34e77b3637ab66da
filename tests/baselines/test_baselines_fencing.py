"""What is written under a lease is written while the lease holds, and never after another has taken the vehicle."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from wingwatch.baselines import (
    ActionRecord,
    AlertRecord,
    Cell,
    Database,
    EstimateRecord,
    HistoryWanted,
    Lease,
    LeaseLostError,
    LeaseTable,
    Reference,
    ReferenceKey,
)
from wingwatch.baselines import database as database_module

UAV1, UAV2 = ("default", "uav1"), ("default", "uav2")
ALERT = AlertRecord(
    id="a1", fleet="default", vehicle="uav1", kind="icing", cause="icing", level="warning", state="active",
    raised_s=61.0, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97, basis="a-priori", text="Ice.",
    evidence=(), created_at_s=1.0, updated_at_s=1.0,
)  # fmt: skip
ACTION = ActionRecord("k1", "a1", "acknowledge", "ann", "", 1.0)
KEY = ReferenceKey("default", "uav1", "aerosonde", "clean", "short_period")
LEARNED = Reference.empty(6).add(np.eye(6), np.ones(6), 10.0)
CELL = Cell(1, 2)
ESTIMATE = EstimateRecord(
    "default", "uav1", 10.0, "short_period", "fourier", (1.0,) * 6, (0.1,) * 6, "converged", (25.0, 1000.0, 1.1, 0.05)
)  # fmt: skip

WRITES: dict[str, Callable[[Database, Lease], object]] = {
    "alert": lambda database, lease: database.save_alert(ALERT, lease),
    "action": lambda database, lease: database.save_action(ALERT, ACTION, lease),
    "undone action": lambda database, lease: database.void_action("k1", ALERT, lease),
    "reference": lambda database, lease: database.save_reference(KEY, LEARNED, 1.0, lease=lease),
    "cell": lambda database, lease: database.save_cell(KEY, CELL, LEARNED, 1.0, lease=lease),
    "estimates": lambda database, lease: database.append_estimates([(ESTIMATE, 1.0)], {UAV1: lease}),
}


@pytest.fixture
def leases(database: Database) -> LeaseTable:
    table = LeaseTable(database, lease_s=60.0)
    for worker in ("a", "b"):
        table.renew(worker)
    return table


def kept(database: Database) -> str:
    stored = (
        database.alerts(),
        database.action("k1"),
        database.reference_history(KEY),
        database.load_cells(KEY, 1.0),
        database.estimate_history(*UAV1),
    )
    return repr(stored)  # arrays are compared element by element elsewhere


@pytest.mark.parametrize("what", WRITES)
def test_under_a_lease_that_holds_it_is_written_and_afterwards_refused(
    what: str, database: Database, leases: LeaseTable
) -> None:
    held = leases.take("a", [UAV1])[UAV1]
    if what == "undone action":
        database.save_action(ALERT, ACTION, held)
    WRITES[what](database, held)
    written = kept(database)
    leases.give_up("a", [UAV1])
    later = leases.take("b", [UAV1])[UAV1]
    for lost in (held, replace(later, number=1), replace(held, number=2)):
        with pytest.raises(LeaseLostError) as refused:
            WRITES[what](database, lost)
        assert refused.value.vehicles == (UAV1,)
        assert str(refused.value) == (
            "the lease of default/uav1 has passed to another worker; "
            "what this one still had to write of it is dropped"
        )
    assert kept(database) == written


def test_what_was_given_up_is_not_written_though_nobody_has_taken_it(
    database: Database, leases: LeaseTable
) -> None:
    held = leases.take("a", [UAV1])[UAV1]
    leases.give_up("a", [UAV1])
    with pytest.raises(LeaseLostError):
        database.save_alert(ALERT, held)
    assert database.alert("a1") is None


def test_without_a_lease_nothing_is_checked(database: Database, leases: LeaseTable) -> None:
    leases.take("a", [UAV1])
    database.save_alert(ALERT)
    database.append_estimates([(ESTIMATE, 1.0)])
    assert database.alert("a1") == ALERT
    assert database.estimate_history(*UAV1) == (ESTIMATE,)


def test_estimates_of_several_vehicles_are_written_together_or_not(
    database: Database, leases: LeaseTable
) -> None:
    """Whose lease is lost is named, so the others' can be written."""
    held = leases.take("a", [UAV1, UAV2])
    leases.give_up("a", [UAV2])
    rows = [(ESTIMATE, 1.0), (replace(ESTIMATE, vehicle="uav2"), 1.0)]
    with pytest.raises(LeaseLostError) as refused:
        database.append_estimates(rows, held)
    assert refused.value.vehicles == (UAV2,)
    assert database.estimate_history(*UAV1) == ()
    database.append_estimates(rows[:1], {UAV1: held[UAV1]})
    assert database.estimate_history(*UAV1) == (ESTIMATE,)


def test_a_vehicle_that_comes_back_goes_on_in_the_flight_that_others_began(
    database: Database, leases: LeaseTable, url: str
) -> None:
    """What this program remembers of its flight is of before."""
    held = leases.take("a", [UAV1])
    database.append_estimates([(ESTIMATE, 1.0)], held)
    with database_module.open_database(url) as other:
        leases.give_up("a", [UAV1])
        other.append_estimates([(replace(ESTIMATE, time_s=1.0), 2.0)], leases.take("b", [UAV1]))
        leases.give_up("b", [UAV1])
    database.append_estimates([(replace(ESTIMATE, time_s=11.0), 3.0)], leases.take("a", [UAV1]))
    rows = database.history_rows(*UAV1, HistoryWanted())
    flights = {row.estimate.time_s: row.flight for row in rows}
    assert flights[11.0] == flights[1.0] != flights[10.0]


def test_no_vehicle_changes_hands_between_check_and_commit(
    database: Database, leases: LeaseTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever takes it waits for the write; so the newcomer reads everything that was written before."""
    held = leases.take("a", [UAV1])[UAV1]
    checked, goes_on, seen = threading.Event(), threading.Event(), []
    put = database_module._put_alert

    def slowly(session: object, alert: AlertRecord) -> None:
        checked.set()
        goes_on.wait(20.0)
        put(session, alert)  # type: ignore[arg-type]

    monkeypatch.setattr(database_module, "_put_alert", slowly)

    def change_hands() -> None:
        leases.give_up("a", [UAV1])
        leases.take("b", [UAV1])
        seen.append(database.alert("a1"))

    with ThreadPoolExecutor(2) as pool:
        written = pool.submit(database.save_alert, ALERT, held)
        assert checked.wait(20.0)
        moved = pool.submit(change_hands)
        with pytest.raises(TimeoutError):
            moved.result(0.2)
        goes_on.set()
        written.result(20.0)
        moved.result(20.0)
    assert seen == [ALERT]
