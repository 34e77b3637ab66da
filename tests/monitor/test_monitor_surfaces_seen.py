"""Nothing healthy is said of a surface that never moved, and what has shown itself stays so."""

import itertools
from dataclasses import replace
from typing import Any

import pytest
from redundancy_flights import AEROSONDE, CONDITION, flown, monitor_of, watched

from wingwatch.aircraft import DUTCH_ROLL, LATERAL, SHORT_PERIOD
from wingwatch.monitor import AlertState, VehicleMonitor, VehicleState, surface_kinds
from wingwatch.monitor.detection.redundancy import Hypothesis
from wingwatch.monitor.detection.redundancy.hypotheses import HYPOTHESES
from wingwatch.monitor.detection.surfaces_seen import LOOK_S, SurfacesSeen, SurfaceWatch
from wingwatch.simulation import Scenario, doublet_schedule, simulate
from wingwatch.telemetry import SampleBlock, complete

ALL = ("elevator_rad", "aileron_rad", "rudder_rad")
RELATIONS = [h for h in HYPOTHESES if h.cause == "surface_stuck"]
NOTHING: dict[str, float | None] = {}


def unseen(state: SurfacesSeen) -> list[str]:
    return list(state.unseen)


def stuck(*columns: str, size: float = 1.0) -> list[tuple[Hypothesis, float | None]]:
    """What relations could have seen."""
    return [(h, size if h.channel in columns else None) for h in RELATIONS]


def test_a_surface_has_shown_itself_by_its_relation_or_by_the_loss_of_all_its_effect() -> None:
    watch = SurfaceWatch(ALL, (SHORT_PERIOD, LATERAL), RELATIONS)
    state = watch.init()
    watch.look(state, 0.0, {"elevator_effectiveness": 1.1, "rudder_effectiveness": None}, stuck())
    assert unseen(state) == list(ALL), "a loss of more than all there is"
    watch.look(state, 10.0, {"elevator_effectiveness": 0.9}, stuck("aileron_rad", size=0.4))
    assert unseen(state) == ["rudder_rad"]
    watch.look(state, 20.0, {"elevator_effectiveness": None}, stuck())
    assert unseen(state) == ["rudder_rad"], "it does not come and go"
    assert watch.text(state) == (
        "a stuck rudder would not have been noticed yet: it has hardly moved since the start of the flight; "
        "a doublet of the rudder would help"
    )
    watch.look(state, 30.0, NOTHING, stuck("rudder_rad"))
    assert (unseen(state), watch.text(state)) == ([], "")


def test_it_is_looked_at_after_each_block_until_all_is_seen_and_after_a_clock_was_set_back() -> None:
    watch = SurfaceWatch(("elevator_rad",), (SHORT_PERIOD,), RELATIONS)
    state = watch.init()
    assert watch.due(state, 100.0, None)
    watch.look(state, 100.0, NOTHING, stuck())
    assert [watch.due(state, s, None) for s in (100.5, 100.0 + LOOK_S, 3.0)] == [False, True, True]
    assert [watch.due(state, 103.0, block_s) for block_s in (99.0, 102.0, 150.0)] == [False, True, False]
    watch.look(state, 110.0, NOTHING, stuck("elevator_rad"))
    assert not watch.due(state, 200.0, 199.0)


def test_a_surface_that_nothing_could_show_says_what_to_send() -> None:
    watch = SurfaceWatch(ALL, (SHORT_PERIOD,), [h for h in RELATIONS if h.channel == "aileron_rad"])
    assert watch.text(watch.init()) == (
        "a stuck elevator or aileron would not have been noticed yet: it has hardly moved since the start of the "
        "flight; a doublet of the elevator and a doublet of the aileron would help; a stuck rudder cannot be noticed "
        "by the channels that are sent: give its command beside its position, or vanes"
    )
    assert SurfaceWatch(("elevator_rad",), (DUTCH_ROLL,), ()).surfaces == ("elevator_rad",)


def test_after_a_fault_that_a_person_cleared_only_what_comes_later_counts() -> None:
    watch = SurfaceWatch(ALL, (SHORT_PERIOD, LATERAL), RELATIONS)
    state = watch.init()
    watch.look(state, 0.0, NOTHING, stuck(*ALL))
    watch.forget(state, "elevator_rad", 200.0)
    watch.forget(state, "throttle", 200.0)
    watch.look(state, 199.0, NOTHING, stuck(*ALL))
    assert unseen(state) == ["elevator_rad"]
    watch.look(state, 200.0, NOTHING, stuck(*ALL))
    assert unseen(state) == []


def test_a_flight_with_doublets_is_healthy_from_its_second_round_on_and_stays_so() -> None:
    monitor, block = monitor_of(flown(seconds=75.0))
    states = []
    for start in range(0, len(block), 25):
        monitor.feed(SampleBlock(block.values[start : start + 25]))
        states.append(monitor.state)
    first = states.index(VehicleState.HEALTHY)
    assert 20.0 < 0.5 * first <= 45.0, "the doublets are at 5 and 25 s, of the rudder at 13 and 33"
    assert set(states[first:]) == {VehicleState.HEALTHY}
    assert states[:first].count(VehicleState.NOT_OBSERVABLE) >= first - 4


def elevator_and_aileron_only(seconds: float) -> SampleBlock:
    schedule = doublet_schedule(AEROSONDE, CONDITION)
    two: Any = {name: getattr(schedule, name)[:2] for name in vars_of(schedule)}
    return simulate(Scenario(AEROSONDE, manoeuvres=(replace(schedule, **two),), seed=5), seconds)


def vars_of(schedule: Any) -> list[str]:
    """Names of what a schedule has by surface."""
    return [name for name in schedule.__dataclass_fields__ if isinstance(getattr(schedule, name), tuple)]


def test_a_rudder_that_never_moved_is_named_with_the_input_that_would_help() -> None:
    flight = elevator_and_aileron_only(60.0)
    block, ids = complete(flight), itertools.count()
    kinds = surface_kinds(flight.present)
    monitor = VehicleMonitor(AEROSONDE, "f", "v", block.present, kinds, new_id=lambda: str(next(ids)))
    monitor.feed(block)
    assert monitor.state is VehicleState.NOT_OBSERVABLE
    assert monitor.unseen_surfaces == ("rudder_rad",)
    assert "a doublet of the rudder would help" in monitor.reason
    assert monitor.view().unseen_surfaces == ("rudder_rad",)


@pytest.mark.parametrize("hidden", [("rudder_rad",), ("rudder_command_rad",)])
def test_a_surface_whose_position_or_command_alone_is_sent_shows_itself_by_its_effect(
    hidden: tuple[str, ...],
) -> None:
    monitor, _ = watched(flown(seconds=75.0), hidden=hidden)
    assert monitor.state is VehicleState.HEALTHY


def test_a_stuck_rudder_whose_alert_a_person_clears_is_not_healthy_again() -> None:
    monitor, alerts = watched(flown("surface_stuck[rudder]:0.03@50", seconds=75.0))
    assert {(a.cause, a.channel) for a in alerts} == {("surface_stuck", "rudder_rad")}
    monitor.take_over(replace(alerts[-1], state=AlertState.CLEARED))
    assert not monitor.alarmed
    assert monitor.unseen_surfaces == ("rudder_rad",)
    _, block = monitor_of(flown("surface_stuck[rudder]:0.03@50", seconds=80.0))
    monitor.feed(SampleBlock(block.values[75 * 50 :]))
    assert monitor.state is not VehicleState.HEALTHY
