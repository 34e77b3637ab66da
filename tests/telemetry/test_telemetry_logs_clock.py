"""Several rates and clocks brought to one: stamps put right, filtered, held or interpolated, no gap bridged."""

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.telemetry.logs.sampling import (
    Readings,
    decimated,
    low_passed,
    rate_hz,
    sampled,
    without_repeats,
)
from wingwatch.telemetry.logs.stamps import clock_runs

Array = NDArray[np.float64]


def steps(number: int, step_s: float = 1.0) -> Array:
    return np.linspace(0.0, step_s * (number - 1), number)


STEADY = 10.0 + steps(500, 0.02)


def kept(time_s: Array) -> Array:
    runs = clock_runs(time_s).runs
    assert len(runs) == 1
    return time_s[runs[0]]


class TestStamps:
    def test_good_stamps_are_one_run(self) -> None:
        found = clock_runs(STEADY)
        assert (len(found.runs), found.repeated, found.late, found.off_clock, found.jumps) == (1, 0, 0, 0, 0)
        assert kept(STEADY).tolist() == STEADY.tolist()

    def test_repeated_stamps_are_dropped_and_counted(self) -> None:
        stamps = np.repeat(STEADY, 2)
        assert clock_runs(stamps).repeated == 500
        assert kept(stamps).tolist() == STEADY.tolist()

    @pytest.mark.parametrize("off", [1e6, 4000.0, 0.0, -50.0])
    def test_a_single_stamp_far_off_is_dropped_and_counted(self, off: float) -> None:
        stamps = STEADY.copy()
        stamps[250] = off
        assert clock_runs(stamps).off_clock == 1
        assert kept(stamps).tolist() == np.delete(STEADY, 250).tolist()

    def test_a_jump_back_cuts_and_nothing_is_sorted(self) -> None:
        stamps = np.concatenate((STEADY, STEADY[300:] - 5.0, STEADY + 300.0))
        found = clock_runs(stamps)
        assert found.jumps == 1
        assert [run.size for run in found.runs] == [500, 700]
        assert all((np.diff(stamps[run]) > 0.0).all() for run in found.runs)
        assert found.runs[1][0] == 500

    def test_a_reading_slightly_older_than_the_one_before_is_dropped(self) -> None:
        stamps = STEADY.copy()
        stamps[100] = stamps[99] - 0.005
        found = clock_runs(stamps)
        assert (found.late, found.jumps) == (1, 0)
        assert kept(stamps).tolist() == np.delete(STEADY, 100).tolist()

    def test_a_header_long_before_the_data_and_gaps_stay_one_run(self) -> None:
        stamps = np.concatenate(([0.0], STEADY + 100.0, STEADY + 111.5, STEADY + 140.0))
        assert clock_runs(stamps).jumps == 0
        assert kept(stamps).size == 1501

    def test_a_slow_topic_is_not_taken_for_jumps(self) -> None:
        stamps = steps(50, 2.0)
        assert kept(stamps).size == 50

    def test_another_clock_is_another_run(self) -> None:
        stamps = np.concatenate((STEADY, STEADY + 1.3e9))
        assert [run.size for run in clock_runs(stamps).runs] == [500, 500]

    def test_stamps_that_are_no_numbers_are_in_no_run(self) -> None:
        assert clock_runs(np.array([np.nan, 1.0, 2.0, np.inf])).off_clock == 2
        assert clock_runs(np.zeros(0)).runs == ()


def sine(time_s: Array, hz: float) -> Array:
    return np.sin(2.0 * np.pi * hz * time_s)


class TestRates:
    def test_a_faster_channel_is_filtered_before_it_is_sampled(self) -> None:
        """A vibration above half of the table's rate would else appear as a slow motion that never was."""
        fast = steps(8000, 0.0025)  # 400 Hz
        stamps = decimated(fast, 100.0)
        assert rate_hz(stamps) == pytest.approx(100.0)
        vibration = Readings(fast, sine(fast, 97.0), False)
        assert np.abs(sampled(vibration, stamps, 0.5)).max() > 0.9  # unfiltered: 3 Hz of full size
        filtered = sampled(low_passed(vibration, 100.0), stamps, 0.5)
        assert np.abs(filtered[50:-50]).max() < 1e-3

    def test_the_filter_has_no_delay_and_leaves_motion_alone(self) -> None:
        fast = steps(8000, 0.0025)
        stamps = decimated(fast, 100.0)
        motion = sine(fast, 4.0)
        filtered = sampled(low_passed(Readings(fast, motion, False), 100.0), stamps, 0.5)
        np.testing.assert_allclose(filtered[50:-50], sine(stamps, 4.0)[50:-50], atol=1e-4)

    def test_nothing_is_filtered_across_a_gap(self) -> None:
        fast = np.concatenate((steps(4000, 0.0025), 30.0 + steps(4000, 0.0025)))
        values = np.concatenate((np.zeros(4000), np.ones(4000)))
        filtered = low_passed(Readings(fast, values, False), 100.0).values
        assert np.abs(filtered[:4000]).max() < 1e-9
        assert np.abs(filtered[4000:] - 1.0).max() < 1e-9

    def test_commands_are_neither_filtered_nor_interpolated(self) -> None:
        time_s = np.array([0.0, 0.1, 0.2])
        held = Readings(time_s, np.array([1.0, 2.0, 4.0]), True)
        assert low_passed(held, 1.0) is held
        assert sampled(held, np.array([0.0, 0.05, 0.1, 0.19, 0.25]), 0.5).tolist() == [
            1.0,
            1.0,
            2.0,
            2.0,
            4.0,
        ]

    def test_a_command_is_held_no_longer_than_the_gap(self) -> None:
        held = Readings(np.array([0.0, 2.0]), np.array([1.0, 2.0]), True)
        values = sampled(held, np.array([-0.1, 0.4, 0.6, 2.0]), 0.5)
        assert np.isnan(values).tolist() == [True, False, True, False]

    def test_a_state_is_interpolated_and_not_over_a_gap_nor_beyond_its_ends(self) -> None:
        state = Readings(np.array([0.0, 0.4, 1.4]), np.array([0.0, 4.0, 14.0]), False)
        values = sampled(state, np.array([-0.01, 0.0, 0.1, 0.4, 0.9, 1.4, 1.5]), 0.5)
        np.testing.assert_allclose(values, [np.nan, 0.0, 1.0, 4.0, np.nan, 14.0, np.nan])

    def test_a_heading_is_interpolated_the_shorter_way_round(self) -> None:
        degrees = np.radians(np.array([358.0, 2.0, 6.0]))
        heading = Readings(np.array([0.0, 0.2, 0.4]), degrees, False, 2.0 * np.pi)
        values = np.degrees(sampled(heading, np.array([0.1, 0.15, 0.3]), 0.5))
        np.testing.assert_allclose((values + 180.0) % 360.0 - 180.0, [0.0, 1.0, 4.0], atol=1e-9)

    def test_repeated_older_values_are_no_readings(self) -> None:
        """A topic that sends each value five times has a fifth of the rate, and no stairs."""
        time_s = steps(500, 0.02)
        slow = sine(np.repeat(time_s[::5], 5), 0.5)
        readings = without_repeats(Readings(time_s, slow, False), 0.5)
        assert rate_hz(readings.time_s) == pytest.approx(10.0)
        stamps = time_s[10:450]
        smooth = sampled(readings, stamps, 0.5)
        assert np.abs(smooth - sine(stamps, 0.5)).max() < 0.0125  # the chord of a sine
        assert np.abs(sampled(Readings(time_s, slow, False), stamps, 0.5) - sine(stamps, 0.5)).max() > 0.1

    def test_a_coarse_value_that_changes_now_and_then_keeps_its_readings(self) -> None:
        time_s = steps(2000, 0.02)
        coarse = np.round(20.0 * sine(time_s, 0.03)) / 20.0 + np.round(sine(time_s, 0.4) ** 31)
        assert np.mean(np.diff(coarse) != 0.0) < 0.3
        readings = Readings(time_s, coarse, False)
        assert without_repeats(readings, 0.5) is readings

    def test_a_value_that_rests_has_no_gap(self) -> None:
        time_s = steps(500, 0.02)
        values = np.where(time_s < 4.0, sine(time_s, 0.5), 0.3)
        values = np.repeat(values[::5], 5)
        readings = without_repeats(Readings(time_s, values, False), 0.5)
        assert np.diff(readings.time_s).max() <= 0.5 + 1e-9
        assert np.isfinite(sampled(readings, time_s[:-5], 0.5)).all()
