"""Delays taken out of a stream: what leaves, when, and that the cuts change nothing."""

import numpy as np
import pytest

from wingwatch.telemetry import CHANNEL_INDEX, REQUIRED_CHANNELS, Aligner, SampleBlock, aligned_delays
from wingwatch.telemetry.conditioning import align

DELAYS = {
    "pitch_rate_rad_s": 0.05,
    "angle_of_attack_rad": 0.13,
    "heading_rad": 0.2,
    "elevator_command_rad": 0.03,
}
TIME = np.concatenate([0.02 * np.arange(200), 10.0 + 0.02 * np.arange(100)])


def flight() -> SampleBlock:
    """Slow sines and a heading that goes round, each channel late by its delay; vanes at a fifth of the rate; a gap."""
    rng = np.random.default_rng(5)
    columns = {name: 1.0 + 0.1 * rng.standard_normal(TIME.size) for name in REQUIRED_CHANNELS}
    columns["time_s"] = TIME
    columns["pitch_rate_rad_s"] = np.sin(TIME - 0.05)
    columns["heading_rad"] = np.arctan2(np.sin(2.0 * (TIME - 0.2)), np.cos(2.0 * (TIME - 0.2)))
    columns["angle_of_attack_rad"] = np.where(np.arange(TIME.size) % 5 == 0, np.sin(TIME - 0.13), np.nan)
    columns["elevator_command_rad"] = np.floor(TIME)
    return SampleBlock.from_columns(columns)


def aligned(block: SampleBlock, cuts: list[int]) -> SampleBlock:
    aligner = Aligner(DELAYS)
    pieces = np.split(block.values, cuts)
    return SampleBlock.concatenate([aligner.feed(SampleBlock(piece)) for piece in pieces])


def test_every_channel_is_of_the_stamps_instant() -> None:
    found = aligned(flight(), [])
    t = found.time_s
    np.testing.assert_allclose(found.column("pitch_rate_rad_s"), np.sin(t), atol=1e-4)
    heading = found.column("heading_rad")
    known = np.isfinite(heading)
    miss = np.angle(np.exp(1j * (heading[known] - 2.0 * t[known])))
    assert known.sum() > 250
    assert np.abs(miss).max() < 1e-9
    alpha = found.column("angle_of_attack_rad")
    there = np.isfinite(alpha)
    np.testing.assert_allclose(alpha[there], np.sin(t[there]), atol=2e-3)
    assert there.sum() > 45
    command = found.column("elevator_command_rad")
    assert set(command[np.isfinite(command)]) <= set(np.floor(TIME))


def test_cuts_change_nothing() -> None:
    whole = aligned(flight(), [])
    for cuts in (list(range(1, 300)), list(range(10, 300, 10)), [3, 199, 200, 201, 250]):
        np.testing.assert_array_equal(aligned(flight(), cuts).values, whole.values)


def test_a_stream_is_aligned_as_a_table_is() -> None:
    found, table = aligned(flight(), list(range(10, 300, 10))), align(flight(), DELAYS)
    rows = np.searchsorted(table.time_s, found.time_s)
    for name in DELAYS:
        one, other = found.column(name), table.column(name)[rows]
        both = np.isfinite(one) & np.isfinite(other)
        assert both.sum() > 40
        np.testing.assert_allclose(one[both], other[both], atol=1e-9)


def test_rows_leave_in_order_and_none_is_lost_but_for_ends() -> None:
    """What waits at the end of the stream, and what a gap cut off, are at most the largest delays."""
    found = aligned(flight(), list(range(10, 300, 10)))
    assert np.all(np.diff(found.time_s) > 0.0)
    before, after = found.time_s[found.time_s < 5.0], found.time_s[found.time_s > 5.0]
    assert before[-1] >= TIME[199] - 0.05 - 0.021
    assert after[0] == 10.0
    assert after[-1] >= TIME[-1] - 0.2 - 0.021


def test_rows_whose_later_readings_never_come_are_counted() -> None:
    """The last 0.05 s before a gap have no pitch rate, which every row needs; the heading's 0.2 s are not required."""
    aligner = Aligner({"pitch_rate_rad_s": 0.05})
    block = flight()
    out = aligner.feed(block)
    waiting = int(np.count_nonzero(block.time_s > out.time_s[-1]))
    assert aligner.dropped == len(block) - len(out) - waiting == 3


def test_without_delays_blocks_pass_untouched() -> None:
    block = flight()
    assert Aligner({"pitch_rate_rad_s": 0.0}).feed(block) is block


def test_a_vane_that_falls_silent_holds_nothing_back() -> None:
    values = flight().values[:200].copy()
    values[100:, CHANNEL_INDEX["angle_of_attack_rad"]] = np.nan
    found = Aligner(DELAYS).feed(SampleBlock(values))
    assert found.time_s[-1] >= TIME[199] - 0.2 - 0.021


def test_a_surface_known_by_its_command_has_the_commands_delay() -> None:
    stated = {"elevator_rad": 0.1, "elevator_command_rad": 0.02, "rudder_rad": 0.0, "aileron_rad": 0.05}
    kinds = {"elevator_rad": "command", "aileron_rad": "position"}
    assert aligned_delays(stated, kinds) == {
        "elevator_rad": 0.02, "elevator_command_rad": 0.02, "aileron_rad": 0.05,
    }  # fmt: skip


@pytest.mark.parametrize(
    "delays", [{"time_s": 0.1}, {"speed": 0.1}, {"roll_rad": -0.1}, {"roll_rad": np.nan}]
)
def test_delays_that_make_no_sense_are_refused(delays: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"delay|aligned"):
        Aligner(delays)
