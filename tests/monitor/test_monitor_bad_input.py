"""Whatever a stranger sends costs a bounded time, is counted, and harms no other vehicle."""

import time

import numpy as np
import pytest
from fleet_hall import Hall, fly_doublets, second
from numpy.typing import ArrayLike

from wingwatch.aircraft import load_aircraft
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
