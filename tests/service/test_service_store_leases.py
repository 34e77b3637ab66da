"""Where several workers share the database, what one found about a vehicle that another has by now is not stored."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wingwatch.aircraft import STRUCTURES
from wingwatch.baselines import (
    Cell,
    Database,
    DatabaseError,
    EstimateRecord,
    Lease,
    LeaseTable,
    Reference,
    ReferenceKey,
    open_database,
)
from wingwatch.monitor import ActionPlan, ActionRequest, AlertAction, AlertState, AlertView
from wingwatch.monitor.detection.alerts import act
from wingwatch.service.store import DatabaseStore
from wingwatch.service.stored_alerts import alert_record

UAV1, UAV2 = ("default", "uav1"), ("default", "uav2")
ALERT = AlertView(
    id="a1", fleet="default", vehicle="uav1", kind="icing", cause="icing", level="warning",
    state=AlertState.ACTIVE, raised_s=80.5, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97,
    basis="a-priori", text="Icing.", evidence=(), note=(),
)  # fmt: skip
OF_UAV2 = replace(ALERT, id="a2", vehicle="uav2")
K = len(STRUCTURES["short_period"].derivatives)
ESTIMATE = EstimateRecord(
    "default", "uav1", 10.0, "short_period", "fourier", (1.0,) * K, (0.1,) * K, "converged", (25.0, 1000.0, 1.1, 0.05)
)  # fmt: skip
KEY = ReferenceKey("default", "uav1", "aerosonde", "clean", "short_period")
LEARNED = Reference.empty(K).add(np.eye(K), np.ones(K), 10.0)


class Watched:
    """The leases of the vehicles that this worker believes to watch, and what the store reports as lost."""

    def __init__(self) -> None:
        self.held: dict[tuple[str, str], Lease] = {}
        self.reported: list[tuple[str, str, Lease]] = []

    def lease_of(self, fleet: str, vehicle: str) -> Lease | None:
        return self.held.get((fleet, vehicle))

    def lost(self, fleet: str, vehicle: str, lease: Lease) -> None:
        self.reported.append((fleet, vehicle, lease))


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    with open_database(tmp_path / "w.db", busy_timeout_s=0.5) as opened:
        yield opened


@pytest.fixture
def table(database: Database) -> LeaseTable:
    leases = LeaseTable(database, lease_s=600.0)
    for worker in ("a", "b"):
        leases.renew(worker)
    return leases


def hand_over(store: DatabaseStore, announced: list[str]) -> None:
    """Of uav1 an alert, a reference, a cell and an estimate; of uav2 an alert and an estimate."""
    for alert in (ALERT, OF_UAV2):
        store.save_alert(alert, lambda kept: announced.append(kept.id))
    store.save_references(*UAV1, "aerosonde", "clean", {"short_period": LEARNED})
    store.save_cells(*UAV1, "aerosonde", "clean", {("short_period", Cell(1, 2)): LEARNED})
    store.append_estimates([ESTIMATE, replace(ESTIMATE, vehicle="uav2")])


def stored(database: Database) -> list[str]:
    found = [alert.id for alert in reversed(database.alerts().items)]
    found += ["reference"] * (database.load_reference(KEY) is not None)
    found += ["cell"] * len(database.load_cells(KEY, 1.0))
    return found + [name for name in ("uav1", "uav2") for _ in database.estimate_history("default", name)]


def test_under_leases_that_hold_everything_is_stored(database: Database, table: LeaseTable) -> None:
    watched, announced = Watched(), list[str]()
    watched.held |= table.take("a", [UAV1, UAV2])
    with DatabaseStore(database, lambda: 1000.0, leases=watched) as store:
        hand_over(store, announced)
        assert store.wait_for([UAV1, UAV2], 60.0)
        assert announced == ["a1", "a2"]
    assert stored(database) == ["a1", "a2", "reference", "cell", "uav1", "uav2"]
    assert (store.counts["fenced"], watched.reported) == (0, [])


def test_what_waits_under_a_lost_lease_is_dropped_counted_and_reported(
    database: Database, table: LeaseTable
) -> None:
    """As by a worker that was frozen with news in its queues and wakes; its other vehicle goes on."""
    watched, announced = Watched(), list[str]()
    watched.held |= table.take("a", [UAV1, UAV2])
    store = DatabaseStore(database, lambda: 1000.0, leases=watched)  # its threads do not run yet
    hand_over(store, announced)
    table.give_up("a", [UAV1])
    table.take("b", [UAV1])
    with store:
        pass
    assert stored(database) == ["a2", "uav2"]
    assert announced == ["a2"]
    assert store.counts["fenced"] == 4
    assert (store.counts["refused"], store.counts["retries"], store.problem) == (0, 0, None)
    assert set(watched.reported) == {(*UAV1, Lease("a", 1))}


def test_estimates_alone_notice_a_lost_lease(database: Database, table: LeaseTable) -> None:
    watched = Watched()
    watched.held |= table.take("a", [UAV1, UAV2])
    store = DatabaseStore(database, lambda: 1000.0, leases=watched)
    store.append_estimates([ESTIMATE, replace(ESTIMATE, vehicle="uav2"), replace(ESTIMATE, time_s=11.0)])
    table.give_up("a", [UAV1])
    with store:
        pass
    assert stored(database) == ["uav2"]
    assert store.counts["fenced"] == 2
    assert watched.reported == [(*UAV1, Lease("a", 1))]


def test_what_was_found_in_an_earlier_watch_is_not_stored_under_a_later_lease(
    database: Database, table: LeaseTable
) -> None:
    """The vehicle was away in between and came back; what others wrote meanwhile stands."""
    watched, announced = Watched(), list[str]()
    watched.held |= table.take("a", [UAV1, UAV2])
    store = DatabaseStore(database, lambda: 1000.0, leases=watched)
    hand_over(store, announced)
    table.give_up("a", [UAV1])
    watched.held |= table.take("a", [UAV1])
    store.append_estimates([replace(ESTIMATE, time_s=12.0)])
    store.save_alert(replace(ALERT, id="new"))
    with store:
        pass
    assert stored(database) == ["a2", "new", "uav1", "uav2"]
    assert store.counts["fenced"] == 4
    assert [row.time_s for row in database.estimate_history(*UAV1)] == [12.0]


def test_of_a_vehicle_that_is_not_watched_nothing_is_taken(database: Database, table: LeaseTable) -> None:
    watched = Watched()
    watched.held |= table.take("a", [UAV2])
    with DatabaseStore(database, lambda: 1000.0, leases=watched) as store:
        hand_over(store, [])
    assert stored(database) == ["a2", "uav2"]
    assert store.counts["fenced"] == 4
    assert watched.reported == []


def test_what_is_dropped_with_its_vehicle_is_counted(database: Database, table: LeaseTable) -> None:
    watched = Watched()
    watched.held |= table.take("a", [UAV1, UAV2])
    store = DatabaseStore(database, lambda: 1000.0, leases=watched)
    hand_over(store, [])
    store.drop(*UAV1, watched.held[UAV1])
    assert not store._waiting.of_vehicles([UAV1])
    assert (store.waiting["alerts"], store.waiting["memory"], store.waiting["estimates"]) == (1, 0, 1)
    assert store.counts["fenced"] == 4


def test_nobody_waits_longer_than_his_patience_for_what_is_not_written(
    database: Database, table: LeaseTable
) -> None:
    store = DatabaseStore(database, lambda: 1000.0)
    store.save_alert(ALERT)
    assert not store.wait_for([UAV1], 0.01)
    assert store.wait_for([UAV2], 0.01)


# -- what people do -------------------------------------------------------------------------------


def plan(key: str = "k1") -> ActionPlan:
    request = ActionRequest("a1", AlertAction.ACKNOWLEDGE, "ann", "seen", key)
    return ActionPlan(
        request,
        lambda: act(ALERT, request.action, "ann", "seen"),
        lambda _: None,
        lambda: ALERT,
        lambda _: None,
    )


@pytest.mark.parametrize("known", [True, False])
def test_an_action_on_a_vehicle_that_has_moved_has_not_happened(
    known: bool, database: Database, table: LeaseTable
) -> None:
    """Whether or not this worker has noticed that."""
    watched = Watched()
    lease = table.take("a", [UAV1])[UAV1]
    database.save_alert(alert_record(ALERT, 1.0, 1.0), lease)
    if not known:
        watched.held[UAV1] = lease
    table.give_up("a", [UAV1])
    with DatabaseStore(database, lambda: 1000.0, leases=watched) as store:
        with pytest.raises(
            DatabaseError, match="default/uav1 has just passed to another worker; nothing has happened"
        ):
            store.carry_out(plan())
        assert store.counts["fenced"] == 1
    found = database.alert("a1")
    assert found is not None
    assert (found.state, database.action("k1")) == ("active", None)
    assert watched.reported == ([] if known else [(*UAV1, lease)])


def test_an_action_that_cannot_be_undone_any_more_holds_nothing_up(
    database: Database, table: LeaseTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was committed late, its caller had been refused, and by now the vehicle is another worker's."""
    monkeypatch.setattr("wingwatch.service.action_queue._PATIENCE_S", 0.2)
    save, thawed = Database.save_action, threading.Event()
    watched = Watched()
    watched.held |= table.take("a", [UAV1, UAV2])

    def frozen(self: Database, *given: object) -> None:
        thawed.wait(60.0)
        save(self, *given)  # type: ignore[arg-type]
        table.give_up("a", [UAV1])

    monkeypatch.setattr(Database, "save_action", frozen)
    with DatabaseStore(database, lambda: 1000.0, leases=watched) as store:
        with pytest.raises(DatabaseError, match="nothing has happened"):
            store.carry_out(plan())
        thawed.set()
        store.save_alert(OF_UAV2)
        assert store.wait_for([UAV2], 60.0)
        assert (store.waiting["actions"], store.counts["undone_actions"], store.counts["fenced"]) == (0, 0, 1)
    assert database.action("k1") is not None  # who repeats it under its key hears so


def test_a_worker_that_takes_a_vehicle_over_reads_its_alerts(database: Database, table: LeaseTable) -> None:
    with DatabaseStore(database, lambda: 1000.0) as store:
        store.save_alert(ALERT)
        store.save_alert(OF_UAV2)
        assert store.wait_for([UAV1, UAV2], 60.0)
        assert store.alerts_of(*UAV1) == [ALERT]
        assert store.alerts_of("other", "uav1") == []
