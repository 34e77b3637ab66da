"""Who may speak under a vehicle's name: its first publisher, until it ends or falls silent."""

import logging
from copy import deepcopy

import pytest
from fleet_hall import FakeCheckpoints, FakeStore, Hall, fly_doublets, second

from wingwatch.monitor import AlertAction, VehicleState
from wingwatch.simulation import ElevatorEffectiveness
from wingwatch.telemetry import SampleBlock

FIRST, SECOND = 17, 4


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(24.0)


@pytest.fixture(scope="module")
def damaged() -> SampleBlock:
    return fly_doublets(130.0, ElevatorEffectiveness(0.5, 60.0))


@pytest.fixture(scope="module")
def flown(damaged: SampleBlock) -> tuple[FakeCheckpoints, FakeStore]:
    """What a service leaves that ends while an alert stands."""
    checkpoints = FakeCheckpoints()
    hall = Hall(checkpoints=checkpoints)
    hall.announce(stream=FIRST)
    for k in range(129):
        hall.clock.now_s += 1.0
        hall.sample(second(damaged, k), k, stream=FIRST)
    return checkpoints, FakeStore(earlier=tuple(hall.fleet.alerts()))


@pytest.fixture
def alarmed(flown: tuple[FakeCheckpoints, FakeStore]) -> Hall:
    """The service that goes on from there."""
    checkpoints, store = deepcopy(flown)
    hall = Hall(store=store, checkpoints=checkpoints)
    hall.announce(stream=FIRST)
    assert hall.view().state is VehicleState.DEGRADED
    return hall


@pytest.mark.parametrize("later_s", [0.0, 1000.0])
@pytest.mark.parametrize("streams", [(FIRST, SECOND), (None, None), (None, SECOND)])
def test_of_two_publishers_under_one_name_the_first_is_watched_alone(
    flight: SampleBlock, streams: tuple[int | None, int | None], later_s: float
) -> None:
    alone, both = Hall(), Hall()
    for hall in (alone, both):
        hall.announce()
        for k in range(20):
            hall.sample(second(flight, k), k, stream=streams[0])
            if hall is both and k >= 10:
                other = second(flight, k - 10)
                other.column("time_s")[:] += later_s
                hall.sample(SampleBlock(other.values.copy()), k - 10, stream=streams[1])
                other.column("time_s")[:] -= later_s
            hall.clock.now_s += 1.0
    assert both.derivatives() == alone.derivatives()
    refused = {name: n for name, n in both.view().counts.items() if name not in alone.view().counts}
    assert sum(refused.values()) == 10
    if streams[1] is not None or later_s:
        assert refused == {"messages_second_publisher": 10}


def test_a_second_publisher_is_reported_once_a_minute_and_shown_with_the_vehicle(
    flight: SampleBlock, caplog: pytest.LogCaptureFixture
) -> None:
    hall = Hall()
    hall.announce(stream=FIRST)
    with caplog.at_level(logging.WARNING):
        for k in range(20):
            hall.sample(second(flight, k), k, stream=FIRST)
            hall.sample(second(flight, k), k, stream=SECOND)
            hall.clock.now_s += 1.0
    assert caplog.text.count("messages of a second publisher of default/uav are refused") == 1
    assert "second publisher under this name" in hall.view().reason
    said = [e.data for e in hall.fleet.events(0) if e.kind == "problem"]
    assert [(one["what"], one["vehicle"]) for one in said] == [("second_publisher", "uav")]
    assert hall.fleet.intake["messages_second_publisher"] == 20
    hall.clock.now_s += 60.0
    assert "second publisher" not in hall.view().reason


def test_a_name_is_free_when_its_publisher_ends_or_has_been_silent(flight: SampleBlock) -> None:
    for ends in (True, False):
        hall = Hall()
        hall.announce(stream=FIRST)
        hall.sample(second(flight, 0), 0, stream=FIRST)
        hall.clock.now_s += 1.0 if ends else 4.9
        hall.sample(second(flight, 1), 0, stream=SECOND)
        assert hall.view().counts["messages_second_publisher"] == 1
        if ends:
            hall.leave()
        else:
            hall.clock.now_s += 0.2
        hall.sample(second(flight, 2), 1, stream=SECOND)
        assert hall.view().counts["publisher_restarts"] == 1
        assert hall.view().counts["accepted"] == 2 * 50


def test_a_link_that_is_lost_for_a_moment_gives_the_name_to_nobody(flight: SampleBlock) -> None:
    hall = Hall()
    hall.announce(stream=FIRST)
    hall.sample(second(flight, 0), 0, stream=FIRST)
    hall.leave()
    hall.clock.now_s += 2.0
    hall.sample(second(flight, 2), 2, stream=FIRST)
    hall.sample(second(flight, 3), 0, stream=SECOND)
    assert hall.view().counts["messages_second_publisher"] == 1


def test_who_ends_that_was_never_heard_of_is_nobody() -> None:
    hall = Hall()
    hall.leave("nobody")
    assert hall.fleet.vehicles() == []
    assert hall.fleet.intake == {"received": 0}


def test_a_forged_announcement_is_refused_while_the_owner_is_heard_of(flight: SampleBlock) -> None:
    hall = Hall()
    hall.announce(stream=FIRST)
    for k in range(12):
        hall.sample(second(flight, k), k, stream=FIRST)
    before = hall.derivatives()
    hall.announce(aircraft="twin", stream=SECOND)
    hall.announce(aircraft="twin")  # the owner says its stream, so one without is another's
    assert hall.view().aircraft == "aerosonde"
    assert hall.derivatives() == before
    assert hall.view().counts["messages_second_publisher"] == 2


def test_the_announcement_of_a_publisher_that_had_to_wait_counts_when_it_takes_over(
    flight: SampleBlock,
) -> None:
    hall = Hall()
    hall.announce(stream=FIRST)
    hall.sample(second(flight, 0), 0, stream=FIRST)
    hall.announce(aircraft="twin", stream=SECOND)
    hall.sample(second(flight, 0), 0, stream=SECOND)
    hall.clock.now_s += 6.0
    hall.sample(second(flight, 6), 1, stream=SECOND)
    assert hall.view().aircraft == "twin"


def test_who_takes_a_name_over_is_asked_what_it_is(flight: SampleBlock) -> None:
    hall = Hall()
    hall.announce(stream=FIRST)
    hall.sample(second(flight, 0), 0, stream=FIRST)
    asked = len(hall.outputs.asked)
    assert asked == 0  # it has said it
    hall.clock.now_s += 6.0
    hall.sample(second(flight, 6), 0, stream=SECOND)
    assert hall.outputs.asked[asked:] == [("default", "uav")]


@pytest.mark.parametrize("other", [{"aircraft": "twin"}, {"configuration": "flaps"}, {"aircraft": "none"}])
def test_an_announcement_ends_no_alert(damaged: SampleBlock, alarmed: Hall, other: dict[str, str]) -> None:
    """Also that of the vehicle's own publisher, and of a forger who cannot be distinguished from it."""
    hall = alarmed
    hall.announce(**other, stream=FIRST)
    hall.sample(second(damaged, 129), 129, stream=FIRST)
    view = hall.view()
    assert view.state is VehicleState.DEGRADED
    assert view.active_alerts
    assert (view.aircraft, view.configuration) == ("aerosonde", "clean")
    assert "counts once its alert is cleared" in view.basis_text
    hall.fleet.act_on_alert(view.active_alerts[0], AlertAction.CLEAR, "pilot", "another aircraft")
    hall.sample(second(damaged, 129), 130, stream=FIRST)
    hall.sample(second(damaged, 129), 131, stream=FIRST)
    after = hall.view()
    assert (after.aircraft, after.configuration) == (
        other.get("aircraft", "aerosonde"), other.get("configuration", "clean"),
    )  # fmt: skip


def test_an_announcement_that_is_taken_back_changes_nothing(damaged: SampleBlock, alarmed: Hall) -> None:
    hall = alarmed
    hall.sample(second(damaged, 129), 129, stream=FIRST)
    hall.announce(aircraft="twin", stream=FIRST)
    hall.announce(stream=FIRST)
    assert "counts once its alert is cleared" not in hall.view().basis_text
