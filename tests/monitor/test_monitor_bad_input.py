"""Whatever a stranger sends costs a bounded time, is counted, and harms no other vehicle."""

import time

import numpy as np
import pytest
from fleet_hall import Hall, fly_doublets, second
from numpy.typing import ArrayLike

from wingwatch.aircraft import load_aircraft
from wingwatch.api import vehicle_document
from wingwatch.api.answers import json_answer
from wingwatch.monitor import FleetSettings, VehicleMonitor, VehicleState
from wingwatch.monitor.estimation.solution_times import LEAST_ROWS
from wingwatch.simulation import ElevatorEffectiveness
from wingwatch.telemetry import CHANNELS, SampleBlock

AEROSONDE = load_aircraft("aerosonde")


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(30.0)


@pytest.fixture
def hall() -> Hall:
    hall = Hall()
    hall.announce()
    return hall


def having(block: SampleBlock, **columns: ArrayLike) -> SampleBlock:
    """The block with other columns."""
    return SampleBlock.from_columns({n: block.column(n) for n in block.present} | columns)


def at(block: SampleBlock, time_s: ArrayLike) -> SampleBlock:
    """The block with other stamps."""
    return having(block, time_s=time_s)


# -- the clock ------------------------------------------------------------------------------------


def test_stamps_that_no_clock_shows_are_refused_at_once(hall: Hall, flight: SampleBlock) -> None:
    """At 9e15 s half a second is less than what a stamp resolves: counting up by halves never arrives."""
    hall.fly(flight, 0, 3)
    far = at(second(flight, 3), 9e15 + 2.0 * np.arange(50))
    began = time.monotonic()
    hall.sample(far, 3)
    assert time.monotonic() - began < 1.0
    assert hall.view().counts["message_bad_value"] == 1
    hall.fly(flight, 4, 6)
    assert hall.view().last_sample_time_s == pytest.approx(6.0 - 0.02)


def test_the_next_solution_is_found_directly_wherever_the_clock_stands(flight: SampleBlock) -> None:
    """The loop over samples alone: even what should have been refused before cannot hold it up."""
    monitor = VehicleMonitor(AEROSONDE, "f", "v", flight.present, {}, new_id=lambda: "1")
    state = monitor.chain.init()
    for begin_s, step_s in ((9e15, 2.0), (-9e15, 4.0), (1e300, 1e290), (4e9, 0.02)):
        far = at(second(flight, 0), begin_s + step_s * np.arange(50))
        assert len(list(monitor.chain.advance(state, far))) <= len(far)


def test_solutions_stay_on_their_grid_after_a_short_gap(flight: SampleBlock) -> None:
    monitor = VehicleMonitor(AEROSONDE, "f", "v", flight.present, {}, new_id=lambda: "1")
    state = monitor.chain.init()
    rows = flight.values[np.r_[0:105, 260:400]]
    times = [solution.time_s for solution in monitor.chain.advance(state, SampleBlock(rows))]
    begin_s = flight.time_s[0]
    grid = (np.array(times) - begin_s) % 0.5
    late = np.minimum(grid, 0.5 - grid)
    assert np.count_nonzero(late > 1e-6) == 1  # the first sample after the gap, then the grid again


@pytest.mark.parametrize("step_s", [0.02, 0.05, 0.1, 0.12, 0.25, 0.49, 0.5, 1.0, 4.9])
def test_the_cost_of_a_message_goes_with_its_samples(flight: SampleBlock, step_s: float) -> None:
    """A solution costs a thousand samples; stamps half a second apart once asked for one each."""
    monitor = VehicleMonitor(AEROSONDE, "f", "v", flight.present, {}, new_id=lambda: "1")
    block = SampleBlock(flight.values[:300])
    report = monitor.feed(at(block, step_s * np.arange(300)))
    assert len(report.solutions) <= 300 // LEAST_ROWS
    if step_s <= 0.1:  # none is missing where the samples suffice
        assert len(report.solutions) == pytest.approx(300 * step_s / 0.5, abs=2)
    if step_s >= 0.5:
        assert not report.solutions


# -- numbers --------------------------------------------------------------------------------------


@pytest.mark.parametrize("stream", [None, 17])
def test_a_late_message_is_counted_and_changes_nothing(flight: SampleBlock, stream: int | None) -> None:
    """A batch eight seconds late is no new clock: with it and without it the estimates are the same."""
    halls = [Hall(), Hall()]
    for late, hall in enumerate(halls):
        hall.announce()
        for k in range(30):
            if k != 12:
                hall.sample(second(flight, k), k, stream=stream)
            if k == 20 and late:
                hall.sample(second(flight, 12), 12, stream=stream)
    without, with_late = halls
    assert with_late.derivatives() == without.derivatives()
    assert with_late.view().counts == {**without.view().counts, "messages_late": 1}
    assert "clock_change" not in with_late.view().counts


def test_a_publisher_started_again_is_followed_at_once_where_it_says_so(flight: SampleBlock) -> None:
    hall = Hall()
    hall.announce()
    for stream in (17, 4):
        for k in range(10):
            hall.sample(second(flight, k), k, stream=stream)
        hall.leave()
    counts = hall.view().counts
    assert counts["accepted"] == 2 * 10 * 50
    assert (counts["publisher_restarts"], counts["clock_change"]) == (1, 1)


def test_a_publisher_started_again_without_a_stream_is_followed_once_messages_agree(
    flight: SampleBlock,
) -> None:
    hall = Hall()
    hall.announce()
    for _ in range(2):
        for k in range(10):
            hall.sample(second(flight, k), k)
        hall.clock.now_s += 5.0
    counts = hall.view().counts
    assert counts["accepted"] == (10 + 8) * 50
    assert (counts["publisher_restarts"], counts["messages_repeated"]) == (1, 2)


def test_numbers_that_no_publisher_reaches_leave_counts_that_json_carries(
    hall: Hall, flight: SampleBlock
) -> None:
    hall.sample(second(flight, 0), 0)
    hall.sample(second(flight, 1), 2**64 - 1)
    hall.sample(second(flight, 2), 2**64 - 1)
    hall.sample(second(flight, 3), 1)
    counts = hall.view().counts
    assert counts["messages_stray"] == 2
    assert "messages_lost" not in counts
    assert json_answer(vehicle_document(hall.view())).status_code == 200


# -- faults ---------------------------------------------------------------------------------------


def test_a_vehicle_over_which_the_program_fails_is_not_healthy(
    flight: SampleBlock, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    hall = Hall()
    for name in ("uav", "other"):
        hall.announce(name)
        for k in range(20):
            hall.sample(second(flight, k), k, vehicle=name)
    before = hall.view().state
    assert before in (VehicleState.HEALTHY, VehicleState.NOT_OBSERVABLE)

    prepared = VehicleMonitor.prepared

    def failing(monitor: VehicleMonitor, block: SampleBlock) -> object:
        if monitor.vehicle == "uav":
            raise ZeroDivisionError("a fault of the program")
        return prepared(monitor, block)

    with monkeypatch.context() as patched:
        patched.setattr(VehicleMonitor, "prepared", failing)
        for k in range(20, 25):
            hall.sample(second(flight, k), k)
            hall.sample(second(flight, k), k, vehicle="other")
        hall.fleet.tick()
    view = hall.view()
    assert view.state is VehicleState.UNKNOWN
    assert view.reason == "the program failed on its samples 5 times, last with " + (
        "ZeroDivisionError: a fault of the program"
    )
    assert view.counts["faults"] == hall.fleet.problems["faults"] == 5
    assert VehicleState.UNKNOWN in hall.outputs.states()[-2:]
    assert "samples of default/uav" in caplog.text
    assert hall.view("other").state in (VehicleState.HEALTHY, VehicleState.NOT_OBSERVABLE)
    hall.sample(second(flight, 25), 25)
    assert hall.view().state is VehicleState.UNKNOWN  # one message that works does not make it healthy
    hall.clock.now_s += 31.0
    hall.sample(second(flight, 26), 26)
    assert hall.view().state in (VehicleState.HEALTHY, VehicleState.NOT_OBSERVABLE)
    assert hall.view().counts["faults"] == 5


def test_an_alert_stands_through_faults_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    damaged = fly_doublets(110.0, ElevatorEffectiveness(0.6, 60.0))
    hall = Hall()
    hall.announce()
    hall.fly(damaged, 0, 108)
    monkeypatch.setattr(VehicleMonitor, "prepared", lambda *_: 1 / 0)
    hall.fly(damaged, 108, 110)
    assert hall.view().state is VehicleState.DEGRADED
    assert "Meanwhile the program failed on its samples 2 times" in hall.view().reason


def test_samples_do_not_pile_up_for_a_monitor_that_cannot_be_made(
    hall: Hall, flight: SampleBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wingwatch.monitor.fleet.monitors.VehicleMonitor", lambda *_, **__: 1 / 0)
    hall.fly(flight, 0, 3)
    assert (hall.view().state, hall.view().counts["faults"]) == (VehicleState.UNKNOWN, 3)
    monkeypatch.undo()
    hall.clock.now_s += 31.0
    hall.fly(flight, 3, 5)
    assert hall.view().counts["accepted"] == 2 * 50


def test_a_vehicle_that_cannot_be_shown_hides_no_other(
    hall: Hall, flight: SampleBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    hall.fly(flight, 0, 2)
    hall.sample(second(flight, 0), 0, vehicle="other")
    monkeypatch.setattr(VehicleMonitor, "view", lambda *_: 1 / 0)
    assert {v.vehicle: v.state for v in hall.fleet.vehicles()} == dict.fromkeys(
        ("other", "uav"), VehicleState.UNKNOWN
    )
    assert "ZeroDivisionError" in hall.view().reason


def test_a_vehicle_whose_messages_are_all_late_is_stale_and_says_why(hall: Hall, flight: SampleBlock) -> None:
    hall.fly(flight, 0, 12)
    hall.clock.now_s += FleetSettings().stale_s + 0.1
    hall.sample(second(flight, 3), 3)
    assert hall.view().state is VehicleState.STALE
    assert hall.view().reason == "messages arrive, but none that can be used: see the counts"


# -- values ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("airspeed_m_s", [-5.0, -0.2, 0.0, 0.9])
def test_on_the_ground_estimation_waits(hall: Hall, flight: SampleBlock, airspeed_m_s: float) -> None:
    """An airspeed sensor at rest reads a little below zero as often as above."""
    rng = np.random.default_rng(2)
    for k in range(12):
        noise = rng.normal(0.0, 0.02, 50)
        rest = {"airspeed_true_m_s": airspeed_m_s + noise, "velocity_north_m_s": noise}
        hall.sample(having(second(flight, k), **rest), k)
    view = hall.view()
    assert view.state is VehicleState.NOT_OBSERVABLE
    assert view.reason == (
        "on the ground: the airspeed has been below 6.05 m/s and not above 9.68 since (the stall speed is 12.1); "
        "estimation and alerts wait"
    )
    assert (view.counts["accepted"], view.counts["too_slow"]) == (600, 600)
    assert "faults" not in view.counts
    hall.leave()
    hall.fly(at(flight, flight.time_s + 12.0), 12, 16)
    assert hall.view().counts["too_slow"] == 600
    assert hall.view().last_sample_time_s is not None


def test_after_landing_a_vehicle_is_no_longer_healthy() -> None:
    flight = fly_doublets(45.0)
    monitor = VehicleMonitor(AEROSONDE, "f", "v", flight.present, {}, new_id=lambda: "1")
    monitor.feed(flight)
    in_flight = monitor.state
    taxiing = np.full(len(flight), -0.1)
    monitor.feed(having(flight, time_s=flight.time_s + 60.0, airspeed_true_m_s=taxiing))
    assert (in_flight, monitor.state) == (VehicleState.HEALTHY, VehicleState.NOT_OBSERVABLE)


@pytest.mark.parametrize("seed", range(6))
def test_no_value_that_a_sensor_may_report_is_a_fault(flight: SampleBlock, seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = {}
    for channel in CHANNELS:
        if channel.name in flight.present and channel.name != "time_s" and rng.random() < 0.6:
            ends = np.where(rng.random(len(flight)) < 0.5, channel.low, channel.high)
            anything = rng.uniform(channel.low, channel.high, len(flight))
            columns[channel.name] = (ends, anything, 0.0 * ends + channel.low)[rng.integers(3)]
    hall = Hall()
    hall.announce()
    hall.fly(having(flight, **columns), 0, 30)
    view = hall.view()
    assert "faults" not in view.counts
    assert view.counts["accepted"] == len(flight)
    hall.derivatives()
