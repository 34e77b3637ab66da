"""The ring of a vehicle's latest samples: what it keeps, in which precision, in how much memory."""

import numpy as np
import pytest

from wingwatch.monitor import SampleRing
from wingwatch.monitor.fleet.member.sample_ring import KEPT_S
from wingwatch.telemetry import SampleBlock

NAMES = ("airspeed_true_m_s", "roll_rad")
EPOCH_S = 1.7e9


def samples(first: int, count: int, rate_hz: float) -> SampleBlock:
    numbers = np.arange(first, first + count, dtype=np.float64)
    return SampleBlock.from_columns(
        {"time_s": EPOCH_S + numbers / rate_hz, "airspeed_true_m_s": numbers, "roll_rad": 0.1 * numbers}
    )


@pytest.mark.parametrize(("rate_hz", "message"), [(50.0, 10), (10.0, 1), (50.0, 7), (25.0, 4000)])
def test_the_last_two_minutes_are_kept_in_their_order_with_stamps_to_the_bit(
    rate_hz: float, message: int
) -> None:
    ring, last = SampleRing(NAMES), 0
    for first in range(0, round(300.0 * rate_hz), message):
        ring.add(samples(first, message, rate_hz))
        last = first + message
    time_s, values = ring.latest()
    kept = np.arange(last - len(time_s), last)
    assert np.array_equal(time_s, EPOCH_S + kept / rate_hz)
    assert np.array_equal(values[:, 0], kept)
    assert values[:, 1] == pytest.approx(0.1 * kept, rel=1e-6)
    assert (len(time_s) - 1) / rate_hz == pytest.approx(KEPT_S, abs=1.5 / rate_hz)


def test_memory_is_bounded_at_any_rate() -> None:
    """12,000 rows of a double and a single a channel: 120 s at 100 Hz, and 12 s at 1000 Hz."""
    ring = SampleRing(NAMES)
    for first in range(0, 40_000, 1000):
        ring.add(samples(first, 1000, 1000.0))
    assert len(ring) == 12_000
    assert ring.nbytes == 12_000 * (8 + 2 * 4)
    assert ring.latest()[1][-1, 0] == 39_999.0


def test_slow_samples_take_little() -> None:
    ring = SampleRing(NAMES)
    for first in range(20_000):
        ring.add(samples(first, 1, 4.0))
    assert ring.nbytes <= 512 * 16


def test_a_message_longer_than_the_ring_leaves_its_end() -> None:
    ring = SampleRing(NAMES)
    ring.add(samples(0, 30_000, 1000.0))
    assert np.array_equal(ring.latest()[1][:, 0], np.arange(18_000, 30_000))


def test_an_empty_ring_has_nothing() -> None:
    time_s, values = SampleRing(NAMES).latest()
    assert time_s.shape == (0,)
    assert values.shape == (0, 2)
