import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from telemetry_flights import THOR75, THOR75_MAP, block_at, flight_block, same

from wingwatch.telemetry import (
    CHANNEL_INDEX,
    Cleaner,
    CleanerConfig,
    CleanerState,
    SampleBlock,
    load_flight,
    parse_map,
)

POSITION = {
    "velocity_north_m_s": -500.0,
    "velocity_east_m_s": 30.0,
    "velocity_down_m_s": 500.0,
    "latitude_deg": 90.0,
    "longitude_deg": -180.0,
}
"""Values at and within the limits."""


def cleaned_times(
    times_s: list[float], config: CleanerConfig | None = None
) -> tuple[list[float], dict[str, int]]:
    result = Cleaner(config).clean(block_at(times_s))
    return result.block.time_s.tolist(), result.report.counts


def test_a_sound_flight_passes_unchanged() -> None:
    block = flight_block(500)
    cleaner = Cleaner()
    result = cleaner.clean(block)
    assert same(result.block, block)
    assert result.report.counts == {"accepted": 500}
    assert cleaner.report.text == "500 samples accepted"


def test_the_accepted_rows_are_a_copy() -> None:
    block = flight_block(5)
    result = Cleaner().clean(block)
    block.values[:] = 0.0
    assert result.block.column("airspeed_true_m_s").min() > 20.0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("channel", ["time_s", "roll_rate_rad_s", "altitude_m"])
def test_a_required_value_that_is_not_finite_rejects_its_row_and_names_its_channel(
    channel: str, value: float
) -> None:
    block = flight_block(20)
    block.values[7, CHANNEL_INDEX[channel]] = value
    result = Cleaner().clean(block)
    assert same(result.block, SampleBlock(np.delete(block.values, 7, axis=0)))
    assert result.report.counts == {"accepted": 19, "non_finite": 1}
    assert result.report.by_channel == {channel: 1}
    assert channel in result.report.text


def test_a_receiver_slower_than_the_table_rejects_nothing() -> None:
    there = np.arange(20) % 5 == 0
    slow = {name: np.where(there, value, np.nan) for name, value in POSITION.items()}
    block = flight_block(20, **slow)
    result = Cleaner().clean(block)
    assert same(result.block, block)
    assert result.report.counts == {"accepted": 20}


@pytest.mark.parametrize(
    ("channel", "value"),
    [("velocity_north_m_s", 500.1), ("latitude_deg", -90.1), ("longitude_deg", 180.1)],
)
def test_a_position_that_is_none_rejects_its_row(channel: str, value: float) -> None:
    columns = {name: np.full(20, at) for name, at in POSITION.items()}
    columns[channel][7] = value
    result = Cleaner().clean(flight_block(20, **columns))
    assert result.report.counts == {"accepted": 19, "out_of_range": 1}
    assert result.report.by_channel == {channel: 1}


def test_an_optional_value_may_be_missing_but_not_impossible() -> None:
    elevator = np.zeros(20)
    elevator[[3, 4, 5, 6]] = [np.nan, np.inf, -3.0, 1.6]
    result = Cleaner().clean(flight_block(20, elevator_rad=elevator))
    assert result.report.counts == {"accepted": 18, "out_of_range": 2}
    assert result.report.by_channel == {"elevator_rad": 2}
    assert np.isnan(result.block.column("elevator_rad")[3])


def test_a_crash_spike_is_out_of_range() -> None:
    block = flight_block(20)
    block.values[19, CHANNEL_INDEX["specific_force_x_m_s2"]] = -400.0
    assert Cleaner().clean(block).report.counts == {"accepted": 19, "out_of_range": 1}


def test_duplicates_and_stragglers_are_rejected_not_sorted_in() -> None:
    times, counts = cleaned_times([1.0, 1.02, 1.02, 1.04, 1.03, 1.06])
    assert times == [1.0, 1.02, 1.04, 1.06]
    assert counts == {"accepted": 4, "duplicate": 1, "out_of_order": 1}


def test_a_gap_is_counted_and_kept() -> None:
    times, counts = cleaned_times([1.0, 1.5, 2.1, 2.12])
    assert times == [1.0, 1.5, 2.1, 2.12]
    assert counts == {"accepted": 4, "gap": 1}


@pytest.mark.parametrize("stray_s", [9000.0, -258.0])
def test_a_lone_stray_is_rejected(stray_s: float) -> None:
    times, counts = cleaned_times([1.0, 1.02, 1.02 + stray_s, 1.04, 1.06])
    assert times == [1.0, 1.02, 1.04, 1.06]
    assert counts == {"accepted": 4, "clock_jump": 1}


@pytest.mark.parametrize("jump_s", [9000.0, -258.0])
def test_a_new_clock_is_believed_after_three_samples_in_a_row(jump_s: float) -> None:
    before = [300.0, 300.02]
    after = [300.04 + jump_s + 0.02 * i for i in range(5)]
    times, counts = cleaned_times(before + after)
    assert times == before + after
    assert counts == {"accepted": 7, "clock_change": 1}


def test_two_samples_on_a_new_clock_are_not_enough() -> None:
    cleaner = Cleaner()
    first = cleaner.clean(block_at([300.0, 42.0, 42.02]))
    assert first.report.pending == 2
    second = cleaner.clean(block_at([300.02]))
    assert second.block.time_s.tolist() == [300.02]
    assert cleaner.report.counts == {"accepted": 2, "clock_jump": 2}


def test_duplicates_on_the_new_clock_do_not_keep_it_from_being_believed() -> None:
    doubled = [42.0, 42.0, 42.02, 42.02, 42.04, 42.04, 42.06]
    times, counts = cleaned_times([300.0, *doubled])
    assert times == [300.0, 42.0, 42.02, 42.04, 42.06]
    assert counts == {"accepted": 5, "duplicate": 3, "clock_change": 1}


def test_a_slow_stream_may_change_its_clock_too() -> None:
    times, counts = cleaned_times([300.0, 301.0, 42.0, 43.0, 44.0])
    assert times == [300.0, 301.0, 42.0, 43.0, 44.0]
    assert counts == {"accepted": 5, "gap": 3, "clock_change": 1}


def test_a_header_from_long_before_the_flight_costs_nothing_of_the_flight() -> None:
    flight = [8000.0 + 0.02 * i for i in range(6)]
    times, counts = cleaned_times([0.0, *flight])
    assert times == [0.0, *flight]
    assert counts == {"accepted": 7, "clock_change": 1}


def test_stamps_that_no_clock_shows_are_out_of_range() -> None:
    times, counts = cleaned_times([1.0, 9e15, 1.7e308, -1.7e308, 1.02])
    assert times == [1.0, 1.02]
    assert counts == {"accepted": 2, "out_of_range": 3}


def test_an_empty_block_is_nothing() -> None:
    assert Cleaner().clean(SampleBlock.concatenate([])).report.counts == {"accepted": 0}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"required": ("pitch",)}, "'pitch' is no flight-table channel"),
        ({"max_gap_s": 0.0}, "max_gap_s = 0.0"),
        ({"confirmations": 0}, "must be positive"),
    ],
)
def test_a_configuration_that_makes_no_sense_is_refused(changes: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        CleanerConfig(**changes)  # type: ignore[arg-type]


# Steps as real logs have them: sampling, duplicates, stragglers, gaps, jumps of the clock both ways.
STEPS = st.sampled_from(
    [0.02, 0.02, 0.02, 0.02, 0.02, 0.0, -0.02, 0.7, 2.0, -0.999, -1.0, -258.0, 258.0, 9000.0]
)


@st.composite
def streams(draw: st.DrawFn) -> SampleBlock:
    times = 500.0 + np.cumsum(np.array(draw(st.lists(STEPS, min_size=1, max_size=40))))
    block = block_at(times.tolist())
    for row in draw(st.lists(st.integers(0, len(times) - 1), max_size=4)):
        channel = draw(st.sampled_from(["time_s", "pitch_rad", "altitude_m"]))
        block.values[row, CHANNEL_INDEX[channel]] = draw(st.sampled_from([np.nan, np.inf, -1e6]))
    return block


@given(streams(), st.lists(st.integers(0, 40), max_size=10))
def test_the_pieces_do_not_matter(block: SampleBlock, cuts: list[int]) -> None:
    whole = Cleaner()
    expected = whole.clean(block)
    pieces = Cleaner()
    results = [pieces.clean(SampleBlock(piece)) for piece in np.split(block.values, sorted(cuts))]
    assert same(SampleBlock.concatenate([result.block for result in results]), expected.block)
    assert pieces.report == whole.report
    assert pieces.state.to_dict() == whole.state.to_dict()


@given(streams(), st.integers(0, 40))
def test_saved_and_restored_is_uninterrupted(block: SampleBlock, cut: int) -> None:
    expected = Cleaner().clean(block)
    first = Cleaner()
    before = first.clean(SampleBlock(block.values[:cut]))
    saved = json.loads(json.dumps(first.state.to_dict()))
    after = Cleaner(state=CleanerState.from_dict(saved)).clean(SampleBlock(block.values[cut:]))
    assert same(SampleBlock.concatenate([before.block, after.block]), expected.block)


@given(streams())
def test_every_row_is_accounted_for_and_none_is_changed_or_moved(block: SampleBlock) -> None:
    result = Cleaner().clean(block)
    report = result.report
    assert report.accepted + sum(report.rejected.values()) + report.pending == len(block)
    assert report.accepted == len(result.block)
    rows = iter(block.values)
    for accepted in result.block.values:
        assert any(accepted.tobytes() == row.tobytes() for row in rows)  # consumes rows: order is kept


@given(streams())
def test_time_never_stands_still_or_steps_back_a_little(block: SampleBlock) -> None:
    config = CleanerConfig()
    steps = np.diff(Cleaner(config).clean(block).block.time_s)
    assert np.all((steps > 0.0) | (steps <= -config.clock_jump_s))


def test_a_state_with_other_channels_is_refused() -> None:
    saved = Cleaner().state.to_dict()
    saved["channels"] = saved["channels"][:-1]
    with pytest.raises(ValueError, match="other channels"):
        CleanerState.from_dict(saved)


@pytest.mark.skipif(not THOR75.exists(), reason="the recorded flight thor75 is not beside the repository")
def test_the_real_flight_is_clean_and_in_pieces_the_same() -> None:
    block = load_flight(THOR75, parse_map(THOR75_MAP)).block
    whole = Cleaner().clean(block)
    assert whole.report.counts == {"accepted": len(block)}
    cleaner = Cleaner()
    pieces = [cleaner.clean(SampleBlock(piece)).block for piece in np.array_split(block.values, 997)]
    assert same(SampleBlock.concatenate(pieces), whole.block)
