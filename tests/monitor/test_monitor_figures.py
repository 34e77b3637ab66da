"""The fleet in numbers: sums that never fall, whatever becomes of a vehicle, and states as they are shown."""

from collections import Counter
from collections.abc import Mapping

import pytest
from fleet_hall import OLD_ALERT, PIECE, FakeCheckpoints, FakeStore, Hall, fly_doublets, second

from wingwatch.monitor import AlertState, FleetSettings, JudgeConfig, VehicleState, default_settings
from wingwatch.telemetry import SampleBlock


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(12.0)


def counts(hall: Hall) -> Mapping[str, int]:
    """Without zeros."""
    return {name: times for name, times in hall.fleet.figures().counts.items() if times}


def test_an_empty_fleet_has_no_vehicle() -> None:
    figures = Hall().fleet.figures()
    assert (dict(figures.vehicles), dict(figures.alerts), dict(figures.counts)) == ({}, {}, {})
    assert (figures.solutions, figures.waiting) == (0, 0)


def test_states_samples_solutions_and_alerts_are_counted(flight: SampleBlock) -> None:
    hall = Hall(store=FakeStore(earlier=[OLD_ALERT]))
    hall.announce()
    hall.fly(flight, 0, 12)
    hall.announce("other")
    hall.sample(second(flight, 0), 0, "stranger")
    hall.raw(b"{")
    figures = hall.fleet.figures()
    shown = Counter(view.state for view in hall.fleet.vehicles())
    assert figures.vehicles == shown == {VehicleState.NOT_OBSERVABLE: 1, VehicleState.UNKNOWN: 2}
    assert figures.alerts == {(AlertState.ACTIVE, "watch"): 1}
    assert counts(hall) == {"accepted": 12 * PIECE, "unannounced": PIECE, "message_malformed": 1}
    assert 15 <= figures.solutions <= 24  # two a second, from the second second on
    hall.clock.now_s += 60.0
    assert hall.fleet.figures().vehicles[VehicleState.STALE] == 1


def test_sums_go_on_where_a_vehicle_is_watched_anew_and_where_it_is_forgotten(flight: SampleBlock) -> None:
    hall = Hall(FleetSettings(max_vehicles=2))
    hall.announce()
    hall.fly(flight, 0, 4)
    hall.announce(aircraft="twin")
    hall.fly(flight, 4, 6)
    assert hall.view().counts["accepted"] == 2 * PIECE  # of the new monitor
    assert counts(hall) == {"accepted": 6 * PIECE}
    for k in range(5):
        hall.sample(second(flight, 0), 0, vehicle=f"uav{k}")
    assert len(hall.fleet.vehicles()) == 2
    assert counts(hall) == {"accepted": 6 * PIECE, "unannounced": 5 * PIECE}


def test_what_was_counted_before_a_restart_is_not_counted_again(flight: SampleBlock) -> None:
    kept = FakeCheckpoints()
    hall = Hall(FleetSettings(checkpoint_interval_s=0.0), checkpoints=kept)
    hall.announce()
    for k in range(5):
        hall.clock.now_s += 1.0
        hall.sample(second(flight, k), k, stream=1)
    again = Hall(checkpoints=kept)
    assert again.view().counts["accepted"] == 5 * PIECE
    assert counts(again) == {}
    again.sample(second(flight, 5), 5, stream=1)
    assert counts(again) == {"accepted": PIECE}


def test_messages_that_wait_for_the_database_are_counted(flight: SampleBlock) -> None:
    hall = Hall(store=FakeStore(unread=True))
    hall.announce()
    hall.fly(flight, 0, 2)
    assert hall.fleet.figures().waiting == 2
    hall.clock.now_s += 10.0
    hall.fleet.tick()
    assert hall.fleet.figures().waiting == 0


def test_the_settings_have_a_fingerprint_that_changes_with_them(monkeypatch: pytest.MonkeyPatch) -> None:
    before = default_settings()
    assert len(before) == 12
    assert before == default_settings.__wrapped__()
    monkeypatch.setattr(JudgeConfig.__dataclass_fields__["block_s"], "default", 11.0)
    assert default_settings.__wrapped__() != before
