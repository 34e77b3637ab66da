"""The live loop with a clock, a store and outputs made by hand, and messages as a vehicle would send them."""

from dataclasses import replace

import numpy as np
import pytest
from fleet_hall import OLD_ALERT, PIECE, FakeStore, Hall, fly_doublets, second

from wingwatch.aircraft import SHORT_PERIOD
from wingwatch.baselines import Reference
from wingwatch.monitor import (
    AlertAction,
    AlertState,
    AlertView,
    FleetSettings,
    JudgeConfig,
    Shelving,
    VehicleState,
)
from wingwatch.monitor.fleet.roster import KEPT_S
from wingwatch.simulation import ElevatorEffectiveness
from wingwatch.telemetry import JSON, PROTOBUF, MessageLimits, SampleBlock


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(100.0)


@pytest.fixture(scope="module")
def damaged() -> SampleBlock:
    return fly_doublets(110.0, ElevatorEffectiveness(0.6, 60.0))


@pytest.fixture
def hall() -> Hall:
    return Hall()


# -- who is it ------------------------------------------------------------------------------------


def test_a_vehicle_nobody_announced_is_counted_and_asked_for(hall: Hall, flight: SampleBlock) -> None:
    hall.fly(flight, 0, 2)
    view = hall.view()
    assert view.state is VehicleState.UNKNOWN
    assert view.counts == {"unannounced": 2 * PIECE}
    assert "has not announced its aircraft" in view.reason
    assert hall.outputs.asked == [("default", "uav")]  # twice within the interval: asked once
    hall.clock.now_s += FleetSettings().ask_interval_s
    hall.fly(flight, 2, 4)
    assert len(hall.outputs.asked) == 2
    hall.announce()
    hall.clock.now_s += 10.0
    hall.fly(flight, 4, 6)
    assert len(hall.outputs.asked) == 2
    assert hall.view().counts["accepted"] == 2 * PIECE
    assert hall.view().aircraft == "aerosonde"


def test_an_unknown_aircraft_is_named_in_the_reason(hall: Hall, flight: SampleBlock) -> None:
    hall.announce(aircraft="concorde")
    hall.fly(flight, 0, 1)
    view = hall.view()
    assert view.state is VehicleState.UNKNOWN
    assert view.reason == "aircraft concorde is not known; known are aerosonde, twin"
    assert view.counts["unknown_aircraft"] >= PIECE
    assert hall.outputs.asked == []  # it has said what it is
    hall.announce()
    hall.fly(flight, 1, 2)
    assert hall.view().counts["accepted"] == PIECE


def test_a_configuration_without_expectation_is_said_and_does_not_raise(
    hall: Hall, flight: SampleBlock
) -> None:
    hall.announce(configuration="flaps")
    hall.fly(flight, 0, 3)
    view = hall.view()
    assert view.state is VehicleState.NOT_OBSERVABLE
    assert view.basis is None
    assert "'flaps'" in view.basis_text


def test_an_aircraft_message_repeated_changes_nothing(flight: SampleBlock) -> None:
    once, often = Hall(), Hall()
    for hall in (once, often):
        hall.announce()
        hall.fly(flight, 0, 6)
    often.announce()
    assert often.derivatives() == once.derivatives()
    assert often.derivatives()["time_s"] > 5.0
    once.fly(flight, 6, 12)
    often.fly(flight, 6, 12)
    assert often.derivatives() == once.derivatives()
    assert often.store.asked == [("aerosonde", "clean")]


def test_another_configuration_starts_a_new_monitor(hall: Hall, flight: SampleBlock) -> None:
    hall.announce()
    hall.fly(flight, 0, 12)
    assert set(hall.derivatives()["estimators"]["fourier"]) >= {"short_period"}
    hall.announce(configuration="iced-wing-test")
    assert hall.derivatives()["estimators"] == {}  # nothing of the old one is shown for the new
    hall.announce()
    hall.fly(flight, 12, 13)
    assert hall.view().counts["accepted"] == PIECE
    assert "less than two seconds" in hall.view().reason


def test_each_monitor_of_a_vehicle_keeps_what_it_learned(flight: SampleBlock) -> None:
    hall = Hall(FleetSettings(judge=JudgeConfig(remembered_blocks=2)))
    hall.announce()
    hall.fly(flight, 0, 62)
    first = max(blocks for name, blocks in hall.store.learned if name == "aerosonde")
    hall.announce(aircraft="twin")
    hall.fly(flight, 62, 100)
    second_aircraft = [blocks for name, blocks in hall.store.learned if name == "twin"]
    assert second_aircraft
    assert second_aircraft[0] < first  # fewer than the first had, and kept all the same


def test_a_flood_of_names_is_bounded_and_the_longest_silent_give_way(
    flight: SampleBlock, caplog: pytest.LogCaptureFixture
) -> None:
    hall = Hall(FleetSettings(max_vehicles=3))
    for k in range(10):
        hall.sample(second(flight, 0), 0, vehicle=f"uav{k}")
    assert [v.vehicle for v in hall.fleet.vehicles()] == ["uav7", "uav8", "uav9"]
    assert hall.fleet.problems == {"vehicles_forgotten": 7}
    assert hall.fleet.derivatives("default", "uav0") is None
    hall.fleet.tick()
    hall.fleet.tick()
    assert caplog.text.count("7 vehicles were forgotten") == 1


def test_invented_names_shut_out_no_aircraft_and_push_out_none(flight: SampleBlock) -> None:
    hall = Hall(FleetSettings(max_vehicles=5))
    for name in ("real1", "real2"):
        hall.announce(name)
        hall.sample(second(flight, 0), 0, vehicle=name)
    for k in range(20):
        hall.clock.now_s += 1.0
        hall.sample(second(flight, 0), 0, vehicle=f"junk{k}")
    hall.announce("later")
    hall.sample(second(flight, 0), 0, vehicle="later")
    assert {v.vehicle for v in hall.fleet.vehicles()} == {"real1", "real2", "later", "junk18", "junk19"}
    assert hall.view("later").counts["accepted"] == hall.view("real1").counts["accepted"] == PIECE


def test_where_all_are_known_the_newcomer_waits_until_one_has_been_silent_for_long(
    flight: SampleBlock,
) -> None:
    hall = Hall(FleetSettings(max_vehicles=2))
    for name in ("one", "two", "three"):
        hall.announce(name)
        hall.clock.now_s += 1.0
    assert {v.vehicle for v in hall.fleet.vehicles()} == {"one", "two"}
    assert hall.fleet.problems == {"too_many_vehicles": 1}
    hall.clock.now_s += KEPT_S - 1.5
    hall.announce("three")
    assert {v.vehicle for v in hall.fleet.vehicles()} == {"two", "three"}


def test_a_vehicle_with_an_alert_never_gives_way(flight: SampleBlock) -> None:
    hall = Hall(FleetSettings(max_vehicles=2), FakeStore(earlier=(OLD_ALERT,)))
    hall.sample(second(flight, 0), 0, vehicle=OLD_ALERT.vehicle)
    for k in range(5):
        hall.sample(second(flight, 0), 0, vehicle=f"junk{k}")
    assert {v.vehicle for v in hall.fleet.vehicles()} == {OLD_ALERT.vehicle, "junk4"}


def test_questions_for_aircraft_are_bounded(flight: SampleBlock) -> None:
    hall = Hall()
    for k in range(300):
        hall.sample(second(flight, 0), 0, vehicle=f"junk{k}")
    assert len(hall.outputs.asked) == 100
    hall.fleet.tick()
    hall.sample(second(flight, 1), 1, vehicle="junk200")
    assert hall.outputs.asked[-1] == ("default", "junk200")


# -- what messages may hold -----------------------------------------------------------------------


def test_bad_messages_are_counted_by_reason_and_the_rest_goes_on(flight: SampleBlock) -> None:
    clean, pestered = Hall(), Hall()
    for hall in (clean, pestered):
        hall.announce()
        hall.fly(flight, 0, 6)
    pestered.raw(b"{")
    pestered.raw(b"\xff\xff\xff", PROTOBUF)
    pestered.raw(b'{"sequence": 6, "columns": {"time_s": [6.0], "moon_phase": [0.5]}}')
    pestered.raw(b" " * (MessageLimits().max_bytes + 1))
    pestered.raw(b'{"aircraft": "no/path"}', stream="aircraft")
    for hall in (clean, pestered):
        hall.fly(flight, 6, 12)
    assert pestered.derivatives() == clean.derivatives()
    expected = {
        "message_malformed": 2,
        "message_unknown_column": 1,
        "message_too_large": 1,
        "message_bad_value": 1,
    }
    counts = pestered.view().counts
    assert {k: n for k, n in counts.items() if k.startswith("message_")} == expected
    assert {k: n for k, n in counts.items() if k not in expected} == clean.view().counts


def test_json_and_protobuf_lead_to_the_same(flight: SampleBlock) -> None:
    one, other = Hall(), Hall()
    for hall, encoding in ((one, PROTOBUF), (other, JSON)):
        hall.announce()
        for k in range(6):
            hall.sample(second(flight, k), k, encoding=encoding)
    assert one.derivatives() == other.derivatives()


def test_gaps_in_the_numbering_are_losses_and_a_restart_is_none(hall: Hall, flight: SampleBlock) -> None:
    hall.announce()
    hall.sample(second(flight, 0), 0)
    hall.sample(second(flight, 1), 1)
    assert "messages_lost" not in hall.view().counts
    hall.sample(second(flight, 4), 4)
    assert hall.view().counts["messages_lost"] == 2
    hall.clock.now_s += 5.0
    hall.sample(second(flight, 5), 0)  # the publisher was started again
    hall.sample(second(flight, 6), 1)
    assert hall.view().counts["messages_lost"] == 2
    hall.sample(second(flight, 8), 3)
    assert hall.view().counts["messages_lost"] == 3


# -- memory ----------------------------------------------------------------------------------------


def test_a_failing_store_is_counted_and_watching_goes_on(damaged: SampleBlock) -> None:
    sound, broken = Hall(), Hall(FleetSettings(recall_patience_s=0.0), FakeStore(broken=True))
    assert broken.fleet.problems == {"store": 1}  # alerts of earlier runs
    for hall in (sound, broken):
        hall.announce()
        hall.fly(damaged, 0, 110)
    assert broken.derivatives() == sound.derivatives()
    assert broken.view().state is sound.view().state is VehicleState.DEGRADED
    assert broken.fleet.alerts() == []  # what is not stored is not announced
    # references and envelopes once, then history every second and the alert
    assert broken.fleet.problems["store"] > 100
    said = [e.data["text"] for e in broken.fleet.events(0) if e.kind == "problem"]
    assert set(said) == {"database is locked"}
    assert sound.fleet.problems == {}
    broken.store.broken = False
    broken.fleet.tick()  # what was not taken is handed over again
    assert broken.fleet.alerts() == sound.fleet.alerts() != []


def test_what_has_not_been_read_is_not_taken_for_nothing_and_not_written_over(flight: SampleBlock) -> None:
    """One read that failed made 500 blocks into the two of that flight."""
    k = len(SHORT_PERIOD.derivatives)
    earlier = Reference(1e3 * np.eye(k), np.zeros(k), blocks=500, seconds=5000.0)
    settings = FleetSettings(judge=JudgeConfig(remembered_blocks=2))
    hall = Hall(settings, FakeStore(unread=True, known={"short_period": earlier}))
    hall.announce()
    hall.fly(flight, 0, 1)
    assert hall.view().reason == "its earlier flights are being read from the database"
    hall.clock.now_s += settings.recall_patience_s
    hall.fly(flight, 1, 80)
    assert hall.view().counts["accepted"] == 80 * PIECE  # those that waited among them
    assert "have not been read yet" in hall.view().basis_text
    assert (hall.store.learned, hall.store.cells_kept) == ([], {})
    before = hall.derivatives()["estimators"]["ekf"]["short_period"]["derivatives"]["m_q"]["value"]
    hall.store.unread = False
    hall.fleet.tick()
    after = hall.derivatives()["estimators"]["ekf"]["short_period"]["derivatives"]["m_q"]["value"]
    assert after == before  # estimates go on
    assert "have not been read yet" not in hall.view().basis_text
    hall.fly(flight, 80, 100)
    assert hall.store.learned
    assert hall.store.learned[-1][1] > 500
    assert hall.store.cells_kept


def test_samples_wait_for_what_is_kept_and_then_lead_to_the_same(flight: SampleBlock) -> None:
    at_once, waited = Hall(), Hall(store=FakeStore(unread=True))
    for hall in (at_once, waited):
        hall.announce()
        hall.fly(flight, 0, 12)
    assert waited.derivatives()["time_s"] is None
    waited.store.unread = False
    waited.fleet.tick()
    assert waited.derivatives() == at_once.derivatives()
    assert waited.view().counts == at_once.view().counts


def test_what_waits_is_bounded_over_all_vehicles(
    flight: SampleBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wingwatch.monitor.fleet.sample_way._MOST_HELD", 5)
    hall = Hall(store=FakeStore(unread=True))
    hall.announce()
    hall.fly(flight, 0, 12)
    assert hall.view().counts["accepted"] == 12 * PIECE


def test_history_is_kept_at_its_interval(flight: SampleBlock) -> None:
    hall = Hall(FleetSettings(history_interval_s=2.0))
    hall.announce()
    hall.fly(flight, 0, 20)
    times = sorted({r.time_s for r in hall.store.rows})
    assert np.all(np.diff(times) >= 2.0 - 1e-6)
    assert len(times) == pytest.approx(20.0 / 2.0, abs=1)
    assert {r.estimator for r in hall.store.rows} == {"fourier", "ekf"}


# -- time ------------------------------------------------------------------------------------------


def test_a_silent_vehicle_is_stale_and_comes_back(hall: Hall, flight: SampleBlock) -> None:
    hall.announce()
    hall.fly(flight, 0, 12)
    before = hall.view().state
    assert before in (VehicleState.HEALTHY, VehicleState.NOT_OBSERVABLE)
    hall.clock.now_s += FleetSettings().stale_s
    hall.fleet.tick()
    assert hall.view().state is before  # not yet
    hall.clock.now_s += 0.1
    hall.fleet.tick()
    assert hall.outputs.states()[-1] is VehicleState.STALE
    assert hall.view().state is VehicleState.STALE
    assert hall.view().reason == "no samples are arriving"
    hall.fly(flight, 12, 13)
    assert hall.view().state is not VehicleState.STALE
    assert hall.outputs.states()[-1] is hall.view().state
    stated = [e.data["state"] for e in hall.fleet.events(0) if e.kind == "status"]
    assert stated[-2:] == ["stale", str(hall.view().state)]


def test_an_unchanged_status_is_repeated_at_its_interval(hall: Hall, flight: SampleBlock) -> None:
    hall.announce()
    hall.fly(flight, 0, 3)
    hall.fleet.tick()
    said = len(hall.outputs.states())
    hall.fleet.tick()
    assert len(hall.outputs.states()) == said
    hall.clock.now_s += FleetSettings().status_interval_s
    hall.fleet.tick()
    assert len(hall.outputs.states()) == said + 1


def test_the_worst_vehicle_comes_first(hall: Hall, flight: SampleBlock) -> None:
    hall.announce("a-quiet-one")
    hall.announce("uav")
    hall.sample(second(flight, 0), 0)
    assert [v.vehicle for v in hall.fleet.vehicles()] == ["a-quiet-one", "uav"]
    hall.sample(second(flight, 0), 0, vehicle="a-quiet-one")
    hall.clock.now_s += 6.0
    hall.sample(second(flight, 1), 1, vehicle="a-quiet-one")
    assert [v.state for v in hall.fleet.vehicles()] == [VehicleState.STALE, VehicleState.NOT_OBSERVABLE]
    assert hall.fleet.vehicles()[0].vehicle == "uav"


# -- events ----------------------------------------------------------------------------------------


def test_events_grow_and_are_bounded(flight: SampleBlock) -> None:
    hall = Hall(FleetSettings(kept_events=2))
    hall.announce()
    hall.fly(flight, 0, 12)
    kept = hall.fleet.events(0)
    ids = [e.id for e in kept]
    assert len(ids) == 2
    assert ids == sorted(ids)
    assert [e.kind for e in kept].count("derivatives") == 1, "the newest takes the place of those before"
    assert hall.fleet.problems["events_forgotten"] >= 1
    assert 0 < hall.fleet.events_complete_after() < ids[0]
    assert [e.id for e in hall.fleet.events(ids[0])] == ids[1:]
    assert hall.fleet.events(ids[-1]) == []
    assert hall.fleet.events(ids[-1] + 1000) == []
    hall.fly(flight, 12, 14)
    news = hall.fleet.events(ids[-1])
    assert [e.kind for e in news if e.kind != "manoeuvre"] == ["derivatives"]
    assert all(e.id > ids[-1] for e in news)


def test_samples_that_wait_and_are_not_watched_are_counted(flight: SampleBlock) -> None:
    hall = Hall(store=FakeStore(unread=True))
    hall.announce()
    hall.fly(flight, 0, 2)
    assert "dropped_waiting" not in hall.view().counts
    hall.announce(aircraft="twin")
    assert hall.view().counts["dropped_waiting"] == 2 * PIECE


def test_alerts_beyond_those_kept_are_counted() -> None:
    older = replace(OLD_ALERT, id="older")
    hall = Hall(FleetSettings(kept_alerts=1), FakeStore(earlier=(OLD_ALERT, older)))
    hall.fleet.act_on_alert("old", AlertAction.ACKNOWLEDGE, "ann", "seen")
    assert [a.id for a in hall.fleet.alerts()] == ["old"]
    assert hall.fleet.problems["alerts_forgotten"] == 1


# -- alerts ----------------------------------------------------------------------------------------


def test_an_alert_is_kept_announced_and_obeys_people(damaged: SampleBlock) -> None:
    hall = Hall()
    hall.announce()
    hall.fly(damaged, 0, 108)
    (alert,) = hall.fleet.alerts()
    assert (alert.cause, alert.state) == ("elevator_effectiveness", AlertState.ACTIVE)
    assert hall.view().state is VehicleState.DEGRADED
    assert hall.view().active_alerts == (alert.id,)
    assert hall.store.alerts_kept[-1] == alert
    assert [v.id for _, v in hall.outputs.said if isinstance(v, AlertView)][-1] == alert.id
    assert hall.outputs.states()[-1] is VehicleState.DEGRADED

    acknowledged = hall.fleet.act_on_alert(alert.id, AlertAction.ACKNOWLEDGE, "ann", "seen")
    assert acknowledged is not None
    assert acknowledged.state is AlertState.ACKNOWLEDGED
    hall.fly(damaged, 108, 110)
    assert hall.fleet.alerts()[0].state is AlertState.ACKNOWLEDGED  # samples do not undo it
    cleared = hall.fleet.act_on_alert(alert.id, AlertAction.CLEAR, "bob", "repaired")
    assert cleared is not None
    assert cleared.cleared_s == pytest.approx(110.0 - 0.02)
    assert cleared.note == ("ann: acknowledge (seen)", "bob: clear (repaired)")
    assert hall.view().active_alerts == ()
    assert hall.store.alerts_kept[-1] == cleared
    assert hall.outputs.said[-1] == ("alerts", cleared)
    assert hall.fleet.events(0)[-1].data["state"] == "cleared"


def test_an_alert_is_told_once_it_is_committed_and_not_before(damaged: SampleBlock) -> None:
    hall = Hall(store=FakeStore(slow=True))
    hall.announce()
    hall.fly(damaged, 0, 108)
    assert hall.view().state is VehicleState.DEGRADED  # the fault shows at once
    assert hall.view().active_alerts == ()
    assert hall.fleet.alerts() == []
    assert [v for _, v in hall.outputs.said if isinstance(v, AlertView)] == []
    assert [e for e in hall.fleet.events(0) if e.kind == "alert"] == []
    assert hall.fleet.act_on_alert("a1", AlertAction.CLEAR, "ann", "") is None
    hall.store.commit()
    (alert,) = hall.fleet.alerts()
    assert alert == hall.store.alerts_kept[-1]
    assert hall.view().active_alerts == (alert.id,)
    assert [v for _, v in hall.outputs.said if isinstance(v, AlertView)][-1] == alert
    assert [e.data["id"] for e in hall.fleet.events(0) if e.kind == "alert"][-1] == alert.id


def test_what_the_monitor_finds_while_an_action_is_committed_is_not_lost(damaged: SampleBlock) -> None:
    hall = Hall()
    hall.announce()
    hall.fly(damaged, 0, 104)
    (before,) = hall.fleet.alerts()
    found = replace(before, level="critical", size=before.size + 1.0)

    def meanwhile() -> None:
        assert hall.fleet.alerts() == [before]  # nothing is announced before it is committed
        hall.fleet._alerts.keep(found)

    hall.store.meanwhile = meanwhile
    acted = hall.fleet.act_on_alert(before.id, AlertAction.ACKNOWLEDGE, "ann", "seen")
    assert acted is not None
    assert (acted.state, acted.level, acted.size) == (AlertState.ACKNOWLEDGED, "critical", found.size)
    assert acted.note == ("ann: acknowledge (seen)",)
    assert hall.store.alerts_kept[-1] == acted
    assert hall.fleet.alerts() == [acted]


def test_alerts_of_earlier_runs_that_could_not_be_read_are_read_later() -> None:
    hall = Hall(store=FakeStore(unread=True, earlier=(OLD_ALERT,)))
    assert hall.fleet.alerts() == []
    hall.store.unread = False
    hall.fleet.tick()
    assert hall.fleet.alerts() == [OLD_ALERT]
    assert hall.store.alerts_kept == []
    assert [v for _, v in hall.outputs.said if isinstance(v, AlertView)] == [OLD_ALERT]


def test_alerts_of_earlier_runs_are_announced_again_at_the_start() -> None:
    """The earlier run may have been killed between the commit and the announcement."""
    old = [replace(OLD_ALERT, id=f"c{k}", state=AlertState.CLEARED) for k in range(150)]
    hall = Hall(store=FakeStore(earlier=(*old, OLD_ALERT)))
    said = [v for _, v in hall.outputs.said if isinstance(v, AlertView)]
    assert [a.id for a in said] == ["old", *(f"c{k}" for k in range(99, -1, -1))]
    hall.fleet.tick()
    assert len([v for _, v in hall.outputs.said if isinstance(v, AlertView)]) == len(said)


def test_alerts_of_earlier_runs_can_be_shelved_and_cleared() -> None:
    newer = replace(OLD_ALERT, id="newer")
    hall = Hall(store=FakeStore(earlier=(newer, OLD_ALERT)))
    assert [a.id for a in hall.fleet.alerts()] == ["newer", "old"]
    act = hall.fleet.act_on_alert
    for action, state in (
        (AlertAction.SHELVE, AlertState.SHELVED),
        (AlertAction.UNSHELVE, AlertState.ACTIVE),
        (AlertAction.CLEAR, AlertState.CLEARED),
    ):
        changed = act("old", action, "ann", "")
        assert changed is not None
        assert changed.state is state
        assert hall.store.alerts_kept[-1] == changed
    assert [a.id for a in hall.fleet.alerts()] == ["newer", "old"]


def test_a_shelved_alert_comes_back_when_its_time_is_over() -> None:
    hall = Hall(store=FakeStore(earlier=(OLD_ALERT,)))
    shelved = hall.fleet.act_on_alert("old", AlertAction.SHELVE, "ann", "", shelve_s=600.0)
    assert shelved is not None
    assert shelved.shelving == Shelving(hall.clock.now_s + 600.0, "watch", 0.1)
    again = Hall(store=FakeStore(earlier=(shelved,)))  # also by another run
    for fleet in (hall, again):
        fleet.clock.now_s += 599.0
        fleet.fleet.tick()
        assert fleet.fleet.alerts()[0].state is AlertState.SHELVED
        fleet.clock.now_s += 1.0
        fleet.fleet.tick()
        (alert,) = fleet.fleet.alerts()
        assert (alert.state, alert.shelving) == (AlertState.ACTIVE, None)
        assert alert.note[-1] == "wingwatch: unshelve (its time is over)"
        assert fleet.store.alerts_kept[-1] == alert
        fleet.fleet.tick()
        assert fleet.fleet.alerts() == [alert]


@pytest.mark.parametrize(
    ("changes", "back"),
    [
        ({"size": 0.13}, False),
        ({"size": 0.15}, True),
        ({"level": "warning"}, True),
        ({"probability": 0.99}, False),
    ],
)
def test_a_shelved_alert_comes_back_when_the_fault_grows(changes: dict[str, object], back: bool) -> None:
    hall = Hall(store=FakeStore(earlier=(OLD_ALERT,)))
    shelved = hall.fleet.act_on_alert("old", AlertAction.SHELVE, "ann", "")
    assert shelved is not None
    hall.fleet._alerts.keep(replace(shelved, **changes))  # type: ignore[arg-type]
    (alert,) = hall.fleet.alerts()
    assert (alert.state is AlertState.ACTIVE) == back
    assert (alert.note[-1] == "wingwatch: unshelve (it has grown)") == back


def test_nonsense_about_alerts_is_refused() -> None:
    hall = Hall(store=FakeStore(earlier=(OLD_ALERT,)))
    assert hall.fleet.act_on_alert("nobody", AlertAction.CLEAR, "ann", "") is None
    with pytest.raises(ValueError, match="alert old is active; unshelve applies to alerts that are shelved"):
        hall.fleet.act_on_alert("old", AlertAction.UNSHELVE, "ann", "")
    assert hall.fleet.alerts() == [OLD_ALERT]
    assert hall.store.alerts_kept == []
