"""A service that ended at any instant: every vehicle goes on, its alert with it, and what does not fit is said."""

import itertools
from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import pytest
from fleet_hall import (
    AEROSONDE,
    AIRCRAFT_FILES,
    PIECE,
    FakeCheckpoints,
    FakeStore,
    Hall,
    fly_doublets,
    second,
)

from wingwatch.monitor import AlertAction, AlertState, AlertView, FleetSettings, VehicleState
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.member.message_watch import MessageWatch
from wingwatch.monitor.fleet.member.recalled_memory import RecalledMemory
from wingwatch.monitor.fleet.member.saving import Saving
from wingwatch.monitor.fleet.member.states import Basis, Said, Watched
from wingwatch.monitor.vehicle.checkpoint import SavedVehicle
from wingwatch.monitor.views import Shelving
from wingwatch.simulation import ElevatorEffectiveness
from wingwatch.telemetry import SampleBlock

FAULT_S, KILLED_S, SECONDS, LONG_S = 60, 120, 150, 420
"""An elevator loses effect; the service ends; most tests end; late enough for all blocks to have been learned."""


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(LONG_S, ElevatorEffectiveness(0.6, FAULT_S))


def learned(hall: Hall) -> int:
    """Blocks that the reference rests on."""
    return max((blocks for _, blocks in hall.store.learned), default=0)


def expected_m_eta(hall: Hall) -> float:
    return float(hall.derivatives()["estimators"]["ekf"]["short_period"]["derivatives"]["m_eta"]["expected"])


def in_force(hall: Hall) -> AlertView | None:
    """The alert as the vehicle's monitor has it."""
    known = hall.fleet._vehicles.get(("default", "uav"))
    assert known is not None
    active = [] if known.monitor is None else known.monitor.active_alerts
    return active[0] if active else None


def flown(hall: Hall, flight: SampleBlock, from_s: int, to_s: int) -> None:
    """A second of samples each second of the wall clock."""
    for k in range(from_s, to_s):
        hall.clock.now_s += 1.0
        hall.sample(second(flight, k), k, stream=1)


@pytest.fixture(scope="module")
def killed(flight: SampleBlock) -> tuple[dict[tuple[str, str], bytes], tuple[AlertView, ...], float]:
    """Checkpoints, alerts and what is expected of the elevator, of a service that ended while an alert stood."""
    checkpoints = FakeCheckpoints()
    hall = Hall(checkpoints=checkpoints)
    hall.announce()
    flown(hall, flight, 0, KILLED_S)
    assert hall.view().state is VehicleState.DEGRADED
    return dict(checkpoints.files), tuple(hall.fleet.alerts()), expected_m_eta(hall)


@pytest.fixture
def checkpoints(killed: Any) -> FakeCheckpoints:
    return FakeCheckpoints(dict(killed[0]))


@pytest.fixture
def store(killed: Any) -> FakeStore:
    return FakeStore(earlier=killed[1])


def test_an_alert_stands_through_a_restart_and_is_followed_again(
    flight: SampleBlock, killed: Any, checkpoints: FakeCheckpoints, store: FakeStore
) -> None:
    hall = Hall(store=store, checkpoints=checkpoints)
    first = hall.view()
    assert (first.state, first.active_alerts) == (VehicleState.DEGRADED, (killed[1][0].id,))
    assert checkpoints.counts == {"resumed": 1}
    flown(hall, flight, KILLED_S + 2, LONG_S)
    assert hall.view().state is VehicleState.DEGRADED
    assert [alert.id for alert in hall.fleet.alerts()] == [killed[1][0].id]
    assert 0 < learned(hall) <= FAULT_S // 10
    assert expected_m_eta(hall) == pytest.approx(killed[2], rel=0.05)
    counts = hall.view().counts
    assert counts["accepted"] > 6000
    assert counts["messages_lost"] >= 2
    assert "publisher_restarts" not in counts


def test_the_resumed_run_says_what_the_uninterrupted_one_says(flight: SampleBlock) -> None:
    """To the bit, where no sample was lost."""
    whole, kept = Hall(), FakeCheckpoints()
    whole.announce()
    flown(whole, flight, 0, 100)
    hall = Hall(FleetSettings(checkpoint_interval_s=0.0), checkpoints=kept)
    hall.announce()
    for start in range(0, 100, 13):
        flown(hall, flight, start, min(start + 13, 100))
        hall = Hall(FleetSettings(checkpoint_interval_s=0.0), FakeStore(earlier=hall.fleet.alerts()), kept)
    assert hall.derivatives() == whole.derivatives()
    assert [replace(a, id="") for a in hall.fleet.alerts()] == [
        replace(a, id="") for a in whole.fleet.alerts()
    ]


def test_samples_that_wait_for_their_turn_are_saved(flight: SampleBlock) -> None:
    """They are counted as taken in, so nobody else would know that they are missing."""
    kept, store = FakeCheckpoints(), FakeStore()
    settings = FleetSettings(checkpoint_interval_s=0.0)
    hall, left = Hall(settings, store, kept), 0
    hall.announce()
    for sequence, start in enumerate(range(0, 40, 4)):
        hall.clock.reading_s = 0.01  # longer than what is taken in at once
        hall.sample(SampleBlock(flight.values[start * PIECE : (start + 4) * PIECE]), sequence, stream=1)
        left += hall.fleet.behind
        hall = Hall(settings, FakeStore(earlier=hall.fleet.alerts()), kept)
    while hall.fleet.behind:
        hall.fleet.receive_all([])
    whole = Hall()
    whole.announce()
    flown(whole, flight, 0, 40)
    assert left == 10
    assert hall.derivatives() == whole.derivatives()
    assert hall.view().counts["accepted"] == 40 * PIECE
    assert "messages_lost" not in hall.view().counts


def test_without_a_checkpoint_the_alert_in_the_database_is_followed(
    flight: SampleBlock, killed: Any, store: FakeStore
) -> None:
    hall = Hall(store=store)
    hall.announce()
    flown(hall, flight, KILLED_S, LONG_S)
    assert (hall.view().state, hall.view().active_alerts) == (VehicleState.DEGRADED, (killed[1][0].id,))
    assert learned(hall) == 0


def test_what_a_person_did_last_counts(
    flight: SampleBlock, killed: Any, checkpoints: FakeCheckpoints, store: FakeStore
) -> None:
    alert = killed[1][0]
    seen = replace(alert, state=AlertState.ACKNOWLEDGED, note=("me: acknowledge",))
    hall = Hall(store=FakeStore(earlier=(seen,)), checkpoints=FakeCheckpoints(dict(checkpoints.files)))
    flown(hall, flight, KILLED_S, KILLED_S + 25)
    assert hall.fleet.alerts()[0].state is AlertState.ACKNOWLEDGED
    assert "me: acknowledge" in hall.fleet.alerts()[0].note
    kept = FakeCheckpoints(dict(checkpoints.files))
    acted = Hall(store=FakeStore(earlier=killed[1]), checkpoints=kept)
    flown(acted, flight, KILLED_S, KILLED_S + 1)
    acted.fleet.act_on_alert(alert.id, AlertAction.SHELVE, "me", "")
    hall = Hall(store=FakeStore(earlier=killed[1]), checkpoints=kept)  # the database did not get it
    assert (hall.fleet.alerts()[0].state, hall.fleet.alerts()[0].note) == (
        AlertState.SHELVED,
        ("me: shelve",),
    )
    assert [a.state for a in hall.store.alerts_kept] == [AlertState.SHELVED]
    gone = replace(alert, state=AlertState.CLEARED, note=("me: clear",))
    hall = Hall(store=FakeStore(earlier=(gone,)), checkpoints=checkpoints)
    assert hall.view().active_alerts == ()
    assert hall.view().state is not VehicleState.HEALTHY


def test_what_a_person_does_changes_nothing_of_what_the_monitor_has_found(flight: SampleBlock) -> None:
    """The version that is announced, and acted on, may be older than the monitor's own."""
    quiet, busy = Hall(), Hall()
    turns = itertools.cycle((AlertAction.ACKNOWLEDGE, AlertAction.SHELVE, AlertAction.UNSHELVE))
    quiet.announce()
    busy.announce()
    for k in range(SECONDS + 50):
        flown(quiet, flight, k, k + 1)
        flown(busy, flight, k, k + 1)
        for alert in busy.fleet.alerts():
            busy.fleet.act_on_alert(alert.id, next(turns), "me", "")
        found = [
            replace(a, state=AlertState.ACTIVE, note=(), shelving=None)
            for a in map(in_force, (quiet, busy))
            if a
        ]
        assert found[:1] == found[1:], k
    assert in_force(busy) is not None


def test_a_shelved_alert_comes_back_though_the_checkpoint_is_older(
    killed: Any, checkpoints: FakeCheckpoints
) -> None:
    until_s = 5000.0
    shelved = replace(
        killed[1][0],
        state=AlertState.SHELVED,
        note=("me: shelve",),
        shelving=Shelving(until_s, "critical", 9.0),
    )
    hall = Hall(store=FakeStore(earlier=(shelved,)), checkpoints=checkpoints)
    known = in_force(hall)
    assert known is not None
    with hall.fleet._lock:
        hall.fleet._alerts.keep(replace(known, size=known.size + 0.01))  # as the monitor goes on with it
    assert [alert.state for alert in hall.fleet.alerts()] == [AlertState.SHELVED]
    hall.clock.now_s = until_s
    hall.fleet.tick()
    assert [alert.state for alert in hall.fleet.alerts()] == [AlertState.ACTIVE]


def test_an_alert_that_the_database_never_got_is_told_and_kept(
    killed: Any, checkpoints: FakeCheckpoints
) -> None:
    hall = Hall(store=FakeStore(), checkpoints=checkpoints)
    assert [alert.id for alert in hall.store.alerts_kept] == [killed[1][0].id]
    assert [stream for stream, _ in hall.outputs.said] == ["alerts"]
    hall.fleet.act_on_alert(killed[1][0].id, AlertAction.CLEAR, "me", "repaired")
    assert hall.view().active_alerts == ()


def test_an_alert_that_was_raised_after_the_checkpoint_is_followed(
    flight: SampleBlock, killed: Any, store: FakeStore
) -> None:
    kept = FakeCheckpoints()
    hall = Hall(checkpoints=kept)
    hall.announce()
    flown(hall, flight, 0, FAULT_S)
    assert hall.fleet.alerts() == []
    hall = Hall(store=store, checkpoints=FakeCheckpoints(dict(kept.files)))
    assert (hall.view().state, hall.view().active_alerts) == (VehicleState.DEGRADED, (killed[1][0].id,))
    flown(hall, flight, FAULT_S + 3, SECONDS)
    assert [alert.id for alert in hall.fleet.alerts()] == [killed[1][0].id]
    assert hall.view().state is VehicleState.DEGRADED


def test_after_long_silence_a_flight_is_new_unless_an_alert_stands(
    flight: SampleBlock, checkpoints: FakeCheckpoints, store: FakeStore
) -> None:
    checkpoints.away_s = 1e6
    hall = Hall(store=store, checkpoints=checkpoints)
    assert hall.view().state is VehicleState.DEGRADED
    healthy = FakeCheckpoints()
    hall = Hall(checkpoints=healthy)
    hall.announce()
    flown(hall, flight, 0, 20)
    healthy.away_s = 3500.0
    assert [v.state for v in Hall(checkpoints=healthy).fleet.vehicles()] == [VehicleState.STALE]
    healthy.away_s = 3601.0
    assert Hall(checkpoints=healthy).fleet.vehicles() == []
    assert healthy.counts == {"resumed": 1, "expired": 1}


def test_another_aircraft_file_refuses_the_checkpoint_and_keeps_the_alert(
    flight: SampleBlock, killed: Any, checkpoints: FakeCheckpoints, store: FakeStore,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    heavier = AEROSONDE.model_copy(update={"mass": AEROSONDE.mass.model_copy(update={"mass_kg": 14.0})})  # type: ignore[union-attr]
    monkeypatch.setitem(AIRCRAFT_FILES, "aerosonde", heavier)
    hall = Hall(store=store, checkpoints=checkpoints)
    assert hall.fleet.vehicles() == []
    assert checkpoints.counts == {"refused": 1}
    assert checkpoints.said == [
        "the checkpoint of default/uav is not used: it was saved under another aircraft file, baseline or setting; "
        "the vehicle starts anew"
    ]
    hall.announce()
    flown(hall, flight, KILLED_S, KILLED_S + 5)
    assert hall.view().active_alerts == (killed[1][0].id,)
    monkeypatch.setattr("fleet_hall.AIRCRAFT_FILES", {})
    Hall(checkpoints=checkpoints)
    assert "is not known" in checkpoints.said[-1]


def test_states_are_saved_every_few_seconds_and_with_news_of_an_alert(flight: SampleBlock) -> None:
    checkpoints = FakeCheckpoints()
    hall = Hall(checkpoints=checkpoints)
    hall.announce()
    flown(hall, flight, 0, 21)
    assert checkpoints.handed_over == [("uav", False)] * 5
    checkpoints.room = False
    flown(hall, flight, 21, KILLED_S)
    announced = sum(alert_event.kind == "alert" for alert_event in hall.fleet.events(0))
    assert checkpoints.handed_over[5:] == [("uav", True)] * announced
    alert = hall.fleet.alerts()[0]
    hall.fleet.act_on_alert(alert.id, AlertAction.ACKNOWLEDGE, "me", "")
    assert checkpoints.handed_over[5:] == [("uav", True)] * (announced + 1)
    flown(hall, flight, KILLED_S, KILLED_S + 1)
    assert [saved.vehicle for saved in hall.fleet.unsaved()] == ["uav"]
    assert list(hall.fleet.unsaved()) == []
    checkpoints.room = True
    flown(hall, flight, KILLED_S + 1, KILLED_S + 2)
    hall.clock.now_s += 5.0
    hall.fleet.tick()  # a vehicle that fell silent
    assert checkpoints.handed_over[-1] == ("uav", False)


@pytest.mark.filterwarnings("ignore")
def test_a_state_that_a_fault_may_have_damaged_is_not_saved(
    flight: SampleBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkpoints = FakeCheckpoints()
    hall = Hall(FleetSettings(checkpoint_interval_s=0.0), checkpoints=checkpoints)
    hall.announce()
    flown(hall, flight, 0, 3)
    saved = len(checkpoints.handed_over)
    with monkeypatch.context() as patch:
        patch.setattr(
            "wingwatch.monitor.vehicle.vehicle_monitor.VehicleMonitor.judge_solution", lambda *_: 1 / 0
        )
        flown(hall, flight, 3, 5)
    flown(hall, flight, 5, 8)
    assert len(checkpoints.handed_over) == saved
    hall.clock.now_s += 30.0
    flown(hall, flight, 8, 9)
    assert len(checkpoints.handed_over) > saved


def test_a_clock_that_is_set_back_does_not_let_an_alert_teach_the_reference(
    flight: SampleBlock, killed: Any, checkpoints: FakeCheckpoints, store: FakeStore
) -> None:
    hall = Hall(store=store, checkpoints=checkpoints)
    again = SampleBlock(flight.values[(FAULT_S + 10) * 50 :].copy())
    again.values[:, 0] -= again.values[0, 0]
    for k in range(LONG_S - FAULT_S - 10):
        hall.clock.now_s += 1.0
        hall.sample(second(again, k), k, stream=2)
    view = hall.view()
    assert view.state is VehicleState.DEGRADED
    assert view.counts["clock_change"] == 1
    assert learned(hall) <= FAULT_S // 10
    assert expected_m_eta(hall) == pytest.approx(killed[2], rel=0.05)


def test_a_fault_over_one_checkpoint_keeps_nobody_from_starting(
    killed: Any, checkpoints: FakeCheckpoints, store: FakeStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wingwatch.monitor.vehicle.vehicle_monitor.VehicleMonitor.restore", lambda *_: 1 / 0)
    hall = Hall(store=store, checkpoints=checkpoints)
    assert hall.fleet.vehicles() == []
    assert checkpoints.counts == {"refused": 1}
    assert "division by zero; the vehicle starts anew" in checkpoints.said[0]


def names(kind: Any) -> Iterator[str]:
    return (f"{kind.__name__}.{f.name}" for f in fields(kind))


def test_no_field_of_a_vehicle_is_forgotten() -> None:
    """What the live loop knows of a vehicle is saved, follows from what is saved, or is of this run alone."""
    saved_as = {
        "Said.message": "message", "Basis.message": "watched_as", "Watched.samples": "waiting",
        "Watched.monitor": "monitor", "Watched.given": "given", "Watched.settings": "settings",
        "RecalledMemory.read": "recalled", "RecalledMemory.late": "late", "KnownVehicle.counts": "counts",
        "MessageWatch.sequence": "arrivals", "MessageWatch.received_s": "silent_s", "Saving.history_s": "history_s",
    }  # fmt: skip
    follows = {"Said.aircraft", "Said.loading", "Basis.loading"}
    of_this_run = {
        "KnownVehicle.fault", "KnownVehicle.shown", "KnownVehicle.published_s", "KnownVehicle.manoeuvres_flown",
        "MessageWatch.owner", "MessageWatch.pace", "MessageWatch.link", "MessageWatch.heard_s",
        "MessageWatch.refused_s", "MessageWatch.asked_s", "Saving.checkpoint_s", "Saving.unsaved", "Saving.urgent",
        "Watched.deferred", "Watched.ring", "Watched.contradictions", "Watched.record", "Watched.manoeuvres",
        "RecalledMemory.change", "RecalledMemory.renewal", "RecalledMemory.renewed", "RecalledMemory.saved_blocks",
    }  # fmt: skip
    parts = {"KnownVehicle.state", "KnownVehicle.messages", "KnownVehicle.saving"}
    parts |= {"Watched.said", "Watched.basis", "Watched.memory"}
    kinds = (KnownVehicle, MessageWatch, Saving, Said, Basis, Watched, RecalledMemory)
    assert {name for kind in kinds for name in names(kind)} == {*saved_as, *follows, *of_this_run, *parts}
    assert set(saved_as.values()) | {"fleet", "vehicle"} == {f.name for f in fields(SavedVehicle)}
