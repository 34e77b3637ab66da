"""Whatever a stranger sends costs a bounded time, is counted, and harms no other vehicle."""

import time

import numpy as np
import pytest
from fleet_hall import Hall, fly_doublets, second
from numpy.typing import ArrayLike

from wingwatch.aircraft import load_aircraft
from wingwatch.api import vehicle_document
from wingwatch.api.encoding import json_answer
from wingwatch.monitor import VehicleMonitor
from wingwatch.telemetry import SampleBlock

AEROSONDE = load_aircraft("aerosonde")


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(30.0)


@pytest.fixture
def hall() -> Hall:
    hall = Hall()
    hall.announce()
    return hall


def at(block: SampleBlock, time_s: ArrayLike) -> SampleBlock:
    """The block with other stamps."""
    return SampleBlock.from_columns({n: block.column(n) for n in block.present} | {"time_s": time_s})


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
    counts = hall.view().counts
    assert counts["accepted"] == 2 * 10 * 50
    assert (counts["publisher_restarts"], counts["clock_change"]) == (1, 1)


def test_a_publisher_started_again_without_a_stream_is_followed_once_messages_agree(
    flight: SampleBlock,
) -> None:
    hall = Hall()
    hall.announce()
    for k in (*range(10), *range(10)):
        hall.sample(second(flight, k), k)
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
