"""The fleet's memory: what the monitor hands over comes back, and a database that fails holds nobody up."""

import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wingwatch.aircraft import STRUCTURES, load_aircraft
from wingwatch.baselines import (
    ActionRecord,
    AlertRecord,
    BaselineLedger,
    ChangeRecord,
    Database,
    DatabaseError,
    EstimateRecord,
    Lease,
    Reference,
    ReferenceKey,
    RefusedError,
    Selection,
    open_database,
)
from wingwatch.monitor import (
    ActionPlan,
    ActionRequest,
    AlertAction,
    AlertState,
    AlertView,
    CandidateView,
    EvidenceView,
    KeyReusedError,
    Shelving,
    VehicleMemory,
)
from wingwatch.monitor.detection.alerts import act
from wingwatch.service.store import DatabaseStore
from wingwatch.service.stored_alerts import alert_record, alert_view

ALERT = AlertView(
    id="a1", fleet="default", vehicle="uav1", kind="icing", cause="icing", level="warning",
    state=AlertState.ACTIVE, raised_s=80.5, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97,
    basis="a-priori", text="Icing.", evidence=(EvidenceView("z_w", -3.5, 0.1, -4.4, 0.2, 4.0),), note=("x: y",),
)  # fmt: skip
OF_A_SENSOR = replace(
    ALERT, id="a2", kind="sensor", cause="sensor_bias", channel="pitch_rate_rad_s", evidence=(),
    candidates=(CandidateView("sensor_bias", "pitch_rate_rad_s", 0.7), CandidateView("icing", None, 0.3)),
)  # fmt: skip
K = len(STRUCTURES["short_period"].derivatives)
ESTIMATE = EstimateRecord(
    "default", "uav1", 10.0, "short_period", "fourier", (1.0,) * K, (0.1,) * K, "converged",
    (25.0, 1000.0, 1.1, 0.05),
)  # fmt: skip
KEY_OF_UAV1 = ReferenceKey("default", "uav1", "aerosonde", "clean", "short_period")
PATIENCE_S = 60.0
AEROSONDE = load_aircraft("aerosonde")


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    with open_database(tmp_path / "w.db", busy_timeout_s=0.1) as opened:
        yield opened


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def recalled(store: DatabaseStore, vehicle: str) -> VehicleMemory:
    """What is kept of a vehicle, once it has been read."""
    found: list[VehicleMemory] = []

    def read() -> bool:
        memory = store.recall("default", vehicle, AEROSONDE, "clean")
        found.extend([] if memory is None else [memory])
        return bool(found)

    until(read)
    return found[0]


def reference(blocks: int) -> Reference:
    learned = Reference.empty(K)
    for _ in range(blocks):
        learned = learned.add(np.eye(K), np.ones(K), 10.0)
    return learned


def changes_of(store: DatabaseStore) -> list[ChangeRecord]:
    """Changes of the baseline, once there are some."""
    found: list[ChangeRecord] = []

    def noticed() -> bool:
        found.extend(store.baseline_changes())
        return bool(found)

    until(noticed)
    return found


def test_a_change_by_others_is_noticed_and_not_written_over(database: Database, tmp_path: Path) -> None:
    def learned() -> int:
        found = database.load_reference(KEY_OF_UAV1)
        return 0 if found is None else found.blocks

    with DatabaseStore(database, lambda: 100.0) as store:
        assert recalled(store, "uav1").change == 0
        store.save_references("default", "uav1", "aerosonde", "clean", {"short_period": reference(3)})
        until(lambda: learned() == 3)
        with open_database(tmp_path / "w.db") as other:
            change = ChangeRecord(
                50.0, "revert", "ada", "aerosonde", "clean", "the newest version", "default", "uav1"
            )
            BaselineLedger(other).revert(change, Selection("aerosonde", fleet="default", vehicle="uav1"))
        store.save_references("default", "uav1", "aerosonde", "clean", {"short_period": reference(4)})
        seen = changes_of(store)
        assert [c.text for c in seen] == ["the newest version"]
        until(lambda: store.waiting["memory"] == 0)
        assert learned() == 0  # what rests on what was there before is not written
        memory = recalled(store, "uav1")
        assert (dict(memory.references), memory.change) == ({}, seen[0].id)
        store.save_references("default", "uav1", "aerosonde", "clean", {"short_period": reference(1)})
        until(lambda: learned() == 1)
    with DatabaseStore(database, lambda: 120.0) as later:  # vehicles that go on may have been saved before it
        assert changes_of(later) == seen
    with DatabaseStore(database, lambda: 1e9) as much_later:
        assert recalled(much_later, "uav1").change == seen[0].id
        assert much_later.baseline_changes() == []


def test_an_alert_survives_the_way_into_the_database_and_back() -> None:
    assert alert_view(alert_record(ALERT, 1.0, 2.0)) == ALERT
    shelved = replace(ALERT, state=AlertState.SHELVED, shelving=Shelving(1.7e9, "warning", 0.1))
    assert alert_view(alert_record(shelved, 1.0, 2.0)) == shelved
    assert alert_view(alert_record(OF_A_SENSOR, 1.0, 2.0)) == OF_A_SENSOR
    assert (alert_record(ALERT, 1.0, 2.0).created_at_s, alert_record(ALERT, 1.0, 2.0).updated_at_s) == (
        1.0,
        2.0,
    )


def test_everything_handed_over_is_there_after_the_end(database: Database) -> None:
    with DatabaseStore(database, lambda: 1000.0) as store:
        store.save_alert(ALERT)
        store.save_alert(OF_A_SENSOR)
        store.save_references("default", "uav1", "aerosonde", "clean", {"short_period": reference(2)})
        store.append_estimates([ESTIMATE])
    with DatabaseStore(database, lambda: 2000.0) as later:
        assert later.alerts() == [OF_A_SENSOR, ALERT]
        learned = recalled(later, "uav1").references
        assert {name: r.blocks for name, r in learned.items()} == {"short_period": 2}
        assert recalled(later, "uav2") == VehicleMemory()
    assert database.estimate_history("default", "uav1") == (ESTIMATE,)


def test_an_alert_of_an_earlier_run_is_changed_not_stored_twice(database: Database) -> None:
    with DatabaseStore(database, lambda: 1000.0) as store:
        store.save_alert(ALERT)
    with DatabaseStore(database, lambda: 2000.0) as later:
        later.alerts()
        later.save_alert(replace(ALERT, state=AlertState.CLEARED, cleared_s=90.0))
    stored = database.alert("a1")
    assert stored is not None
    assert (stored.state, stored.created_at_s, stored.updated_at_s) == ("cleared", 1000.0, 2000.0)
    assert len(database.alerts().items) == 1


def test_a_locked_database_holds_nobody_up_and_loses_no_alert(database: Database, tmp_path: Path) -> None:
    with DatabaseStore(database, lambda: 1000.0) as store:
        other = sqlite3.connect(tmp_path / "w.db", isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        began = time.monotonic()
        store.save_alert(ALERT)
        store.save_references("default", "uav1", "aerosonde", "clean", {"short_period": reference(1)})
        store.append_estimates([ESTIMATE])
        handed_over_s = time.monotonic() - began
        until(lambda: store.problem is not None)
        assert store.problem is not None
        assert "locked" in store.problem
        assert store.counts["dropped_estimates"] == 0
        store.save_alert(replace(ALERT, level="critical"))
        assert recalled(store, "uav1").references["short_period"].blocks == 1  # though it is not written yet
        other.execute("ROLLBACK")
        other.close()
        until(lambda: store.problem is None)
    assert handed_over_s < 0.1  # the database's own patience, which the caller did not have to share
    stored = database.alert("a1")
    assert stored is not None
    assert stored.level == "critical"
    assert database.estimate_history("default", "uav1") == (ESTIMATE,)  # history waits, too


def test_an_alert_is_told_when_it_is_committed_and_not_before(database: Database, tmp_path: Path) -> None:
    announced: list[AlertView] = []

    def kept(alert: AlertView) -> None:
        stored = database.alert(alert.id)
        assert stored is not None
        assert alert_view(stored) == alert
        announced.append(alert)

    with DatabaseStore(database, lambda: 1000.0) as store:
        with locked(tmp_path):
            store.save_alert(ALERT, kept)
            until(lambda: store.problem is not None)
            assert announced == []
            store.save_alert(replace(ALERT, level="critical"), kept)
        until(lambda: announced != [])
    assert announced == [replace(ALERT, level="critical")]


# -- what people do -------------------------------------------------------------------------------


class Plan:
    """An action on ``ALERT``; what became of it is noted."""

    def __init__(self, key: str | None = None, action: AlertAction = AlertAction.ACKNOWLEDGE) -> None:
        self.alert, self.took = ALERT, 0
        self.rewrote: list[AlertView] = []
        request = ActionRequest("a1", action, "ann", "seen", key)
        self.plan = ActionPlan(request, self._change, self._taken, lambda: self.alert, self.rewrote.append)

    def _change(self) -> AlertView:
        return act(self.alert, self.plan.request.action, "ann", "seen")

    def _taken(self, changed: AlertView) -> None:
        self.alert, self.took = changed, self.took + 1


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    other = sqlite3.connect(folder / "w.db", isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    try:
        yield
    finally:
        other.execute("ROLLBACK")
        other.close()


def state_of(database: Database) -> str:
    stored = database.alert("a1")
    assert stored is not None
    return stored.state


def stored_alert(store: DatabaseStore) -> None:
    kept = threading.Event()
    store.save_alert(ALERT, lambda _: kept.set())
    assert kept.wait(PATIENCE_S)


def test_an_action_is_answered_once_it_is_committed(database: Database) -> None:
    with DatabaseStore(database, lambda: 1000.0) as store:
        stored_alert(store)
        one = Plan("k1")
        store.carry_out(one.plan)
        assert state_of(database) == "acknowledged"
        assert one.took == 1
        action = database.action("k1")
        assert action == ActionRecord("k1", "a1", "acknowledge", "ann", "seen", 1000.0)


def test_a_repeated_request_is_carried_out_once(database: Database) -> None:
    """Also by another run of the service; and a key that belongs to another action is refused."""
    with DatabaseStore(database, lambda: 1000.0) as store:
        stored_alert(store)
        store.carry_out(Plan("k1").plan)
    with DatabaseStore(database, lambda: 2000.0) as store:
        again = Plan("k1")
        store.carry_out(again.plan)
        assert again.took == 0
        with pytest.raises(KeyReusedError):
            store.carry_out(Plan("k1", AlertAction.CLEAR).plan)
    stored = database.alert("a1")
    assert stored is not None
    assert stored.note == ("x: y", "ann: acknowledge (seen)")


def test_what_makes_no_sense_is_refused_and_holds_nothing_up(database: Database) -> None:
    with DatabaseStore(database, lambda: 1000.0) as store:
        stored_alert(store)
        with pytest.raises(ValueError, match="unshelve applies to alerts that are shelved"):
            store.carry_out(Plan(action=AlertAction.UNSHELVE).plan)
        store.carry_out(Plan().plan)
    assert state_of(database) == "acknowledged"


def test_an_action_that_the_database_does_not_take_in_time_has_not_happened(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wingwatch.service.action_queue._PATIENCE_S", 0.5)
    monkeypatch.setattr("wingwatch.service.store_writer._RETRY_S", 0.05)
    with DatabaseStore(database, lambda: 1000.0) as store:
        stored_alert(store)
        plan = Plan("k1")
        with locked(tmp_path):
            began = time.monotonic()
            with pytest.raises(DatabaseError, match="nothing has happened"):
                store.carry_out(plan.plan)
            assert time.monotonic() - began < 2.0
        until(lambda: store.problem is None)
        assert (plan.took, state_of(database), database.action("k1")) == (0, "active", None)
        store.carry_out(plan.plan)
        assert (plan.took, state_of(database)) == (1, "acknowledged")
    assert store.counts["withdrawn_actions"] == 1


def test_an_action_whose_reply_was_lost_is_found_and_answered(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    save, lost = Database.save_action, [1]

    def without_reply(self: Database, alert: AlertRecord, action: ActionRecord, lease: Lease | None) -> None:
        save(self, alert, action, lease)
        if lost:
            lost.pop()
            raise DatabaseError("the database cannot be reached")

    monkeypatch.setattr(Database, "save_action", without_reply)
    monkeypatch.setattr("wingwatch.service.store_writer._RETRY_S", 0.01)
    with DatabaseStore(database, lambda: 1000.0) as store:
        stored_alert(store)
        plan = Plan()
        store.carry_out(plan.plan)
    assert plan.took == 1
    assert state_of(database) == "acknowledged"


def test_an_action_that_was_committed_after_its_caller_had_been_told_no_is_undone(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by a server that is frozen with the commit in its hands and goes on later."""
    save, thawed = Database.save_action, threading.Event()

    def frozen(self: Database, alert: AlertRecord, action: ActionRecord, lease: Lease | None) -> None:
        thawed.wait(PATIENCE_S)
        save(self, alert, action, lease)

    monkeypatch.setattr(Database, "save_action", frozen)
    monkeypatch.setattr("wingwatch.service.action_queue._PATIENCE_S", 0.3)
    with DatabaseStore(database, lambda: 1000.0) as store:
        stored_alert(store)
        plan = Plan("k1")
        with pytest.raises(DatabaseError, match="nothing has happened"):
            store.carry_out(plan.plan)
        thawed.set()
        until(lambda: store.counts["undone_actions"] == 1)
        assert (plan.took, state_of(database), database.action("k1")) == (0, "active", None)
        assert plan.rewrote == [ALERT]


def test_actions_that_wait_are_bounded(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wingwatch.service.action_queue._MOST_WAITING", 0)
    with (
        DatabaseStore(database, lambda: 1000.0) as store,
        pytest.raises(DatabaseError, match="too many actions"),
    ):
        store.carry_out(Plan().plan)


def test_what_waits_is_bounded_and_what_is_dropped_is_counted(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wingwatch.service.store_entries.MOST_ESTIMATES", 3)
    store = DatabaseStore(database, lambda: 0.0)  # its thread does not run yet
    store.append_estimates([replace(ESTIMATE, time_s=float(k)) for k in range(5)])
    assert store.counts["dropped_estimates"] == 2
    with store:
        pass
    assert len(database.estimate_history("default", "uav1")) == 3


def test_an_insert_whose_reply_was_lost_is_repeated_once_and_holds_nothing_up(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The entry is there, and nobody has been answered: the second time finds it, and all the rest is stored too."""
    save = Database.save_alert
    lost: list[AlertRecord] = []

    def without_reply(self: Database, alert: AlertRecord, lease: Lease | None) -> None:
        save(self, alert, lease)
        if not lost:
            lost.append(alert)
            raise DatabaseError(
                "the database cannot be reached (server closed the connection); start the server"
            )

    monkeypatch.setattr(Database, "save_alert", without_reply)
    monkeypatch.setattr("wingwatch.service.store_writer._RETRY_S", 0.01)
    with DatabaseStore(database, lambda: 1000.0) as store:
        store.save_alert(ALERT)
        until(lambda: bool(lost) and store.problem is None)
        store.save_references("default", "uav1", "aerosonde", "clean", {"short_period": reference(1)})
        store.append_estimates([ESTIMATE])
    assert [a.id for a in database.alerts().items] == ["a1"]
    assert database.estimate_history("default", "uav1") == (ESTIMATE,)
    assert (store.counts["retries"], store.counts["refused"]) == (1, 0)


def test_an_entry_that_the_database_refuses_is_given_up_and_the_others_do_not_wait(
    database: Database, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    save = Database.save_alert

    def refusing(self: Database, alert: AlertRecord, lease: Lease | None) -> None:
        if alert.id == "bad":
            raise RefusedError("the database cannot hold that entry")
        save(self, alert, lease)

    monkeypatch.setattr(Database, "save_alert", refusing)
    monkeypatch.setattr("wingwatch.service.store_writer._RETRY_S", 0.01)
    with DatabaseStore(database, lambda: 1000.0) as store:
        store.save_alert(replace(ALERT, id="bad"))
        store.save_alert(ALERT)
        store.append_estimates([ESTIMATE])
        until(lambda: store.counts["refused"] == 1 and store.problem is None)
    assert [a.id for a in database.alerts().items] == ["a1"]
    assert database.estimate_history("default", "uav1") == (ESTIMATE,)
    assert store.counts == {
        "failed_reads": 0, "retries": 5, "refused": 1, "dropped_estimates": 0, "dropped_alerts": 0, "dropped_memory": 0,
        "withdrawn_actions": 0, "undone_actions": 0, "fenced": 0,
    }  # fmt: skip
    assert "given up after 5 tries" in caplog.text


def test_a_read_that_fails_is_no_empty_one_and_is_tried_again(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wingwatch.service.store_reader._RETRY_S", 0.01)
    load, faults = Database.load_reference, [3]

    def failing(self: Database, key: ReferenceKey) -> Reference | None:
        if faults[0]:
            faults[0] -= 1
            raise DatabaseError("the database took too long to answer")
        return load(self, key)

    with DatabaseStore(database, lambda: 1000.0) as store:
        store.save_references("default", "uav1", "aerosonde", "clean", {"short_period": reference(500)})
    monkeypatch.setattr(Database, "load_reference", failing)
    with DatabaseStore(database, lambda: 1000.0) as store:
        assert store.recall("default", "uav1", AEROSONDE, "clean") is None
        assert recalled(store, "uav1").references["short_period"].blocks == 500
        assert store.counts["failed_reads"] == 3
        assert store.problem is None


def test_a_database_that_does_not_answer_holds_nobody_up(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a frozen server does: neither an answer nor an error."""
    thawed = threading.Event()
    monkeypatch.setattr(Database, "load_reference", lambda *_: thawed.wait(PATIENCE_S) and None)
    monkeypatch.setattr("wingwatch.service.store._END_S", 0.1)
    with DatabaseStore(database, lambda: 1000.0) as store:
        began = time.monotonic()
        for k in range(5):
            assert store.recall("default", f"uav{k}", AEROSONDE, "clean") is None
        took_s = time.monotonic() - began
    ended_s = time.monotonic() - began
    thawed.set()
    assert took_s < 0.1
    assert ended_s < 1.0
