"""How messages arrive: rate, gaps and delays of the last ten minutes."""

import math

import numpy as np
import pytest

from wingwatch.monitor.fleet.member.link_watch import KEPT_SECONDS, LinkWatch


def stream(watch: LinkWatch, from_s: float, to_s: float, delay_s: float = 0.1, at_s: float = 1000.0) -> None:
    """Messages of ten samples at 50 Hz; the link takes a while."""
    for k in range(round(from_s * 5), round(to_s * 5)):
        time_s = np.array([0.2 * k + 0.02 * n for n in range(10)])
        watch.note(time_s, at_s + time_s[-1] + delay_s)


def test_a_steady_link_has_its_rate_its_step_and_neither_gaps_nor_delays() -> None:
    watch = LinkWatch()
    assert watch.view(1000.0).rate_hz is None
    stream(watch, 0.0, 30.0)
    found = watch.view(1030.0)
    assert found.rate_hz == pytest.approx(50.0, rel=0.05)
    assert found.step_s == pytest.approx(0.02)
    assert (found.gaps, found.longest_gap_s) == (0, 0.0)
    assert found.longest_delay_s == pytest.approx(0.0, abs=1e-9)
    assert found.silent_s == pytest.approx(0.0, abs=0.2)
    assert sum(second.samples for second in found.seconds) == 1500


def test_a_gap_is_counted_and_a_late_message_is_late_beside_the_fastest() -> None:
    watch = LinkWatch()
    stream(watch, 0.0, 10.0)
    stream(watch, 12.0, 20.0)
    stream(watch, 20.0, 21.0, delay_s=0.6)
    found = watch.view(1022.0)
    assert found.gaps == 1
    assert found.longest_gap_s == pytest.approx(2.02)
    assert found.longest_delay_s == pytest.approx(0.5)
    assert found.delay_s == pytest.approx(0.0, abs=1e-9)


def test_silence_ends_the_rate() -> None:
    watch = LinkWatch()
    stream(watch, 0.0, 10.0)
    found = watch.view(1100.0)
    assert found.rate_hz == 0.0
    assert found.silent_s == pytest.approx(90.1, abs=0.3)


def test_only_ten_minutes_are_kept_oldest_first() -> None:
    watch = LinkWatch()
    stream(watch, 0.0, 650.0)
    seconds = watch.view(1650.2).seconds
    assert len(seconds) == KEPT_SECONDS
    times = [second.time_s for second in seconds]
    assert times == sorted(times)
    assert times[-1] == pytest.approx(649.98)


@pytest.mark.parametrize("stamp_s", [math.nan, math.inf, -math.inf])
def test_stamps_that_are_none_are_passed_over(stamp_s: float) -> None:
    watch = LinkWatch()
    watch.note(np.array([stamp_s]), 1000.0)
    watch.note(np.array([]), 1000.0)
    assert watch.view(1001.0).rate_hz is None


def test_a_clock_that_is_set_back_makes_no_gap() -> None:
    watch = LinkWatch()
    stream(watch, 100.0, 110.0)
    stream(watch, 0.0, 10.0, at_s=1110.0)
    assert watch.view(1120.2).gaps == 0
