from pathlib import Path

import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st
from telemetry_flights import THOR75, THOR75_MAP, flight_block, flight_columns, same

from wingwatch.aircraft.atmosphere import isa_density_kg_m3
from wingwatch.aircraft.structures import DUTCH_ROLL, LATERAL, SHORT_PERIOD
from wingwatch.telemetry import (
    CHANNEL_NAMES,
    REQUIRED_CHANNELS,
    FlightError,
    MapError,
    SampleBlock,
    complete,
    derivations,
    load_flight,
    missing_for,
    parse_map,
    write_flight,
)


class TestCompletion:
    def test_true_airspeed_follows_from_indicated_and_altitude(self) -> None:
        columns = {"airspeed_indicated_m_s": [20.0], "altitude_m": [2000.0]}
        done = complete(SampleBlock.from_columns(columns))
        density = float(isa_density_kg_m3([2000.0])[0])
        assert done.column("air_density_kg_m3")[0] == density
        # a square root and a product, half an ulp each
        expected = 20.0 * np.sqrt(1.225 / density)
        assert done.column("airspeed_true_m_s")[0] == pytest.approx(expected, rel=4 * np.finfo(float).eps)

    def test_a_warm_day_is_thinner_than_standard_by_the_temperature_ratio(self) -> None:
        warm = {"altitude_m": [0.0], "outside_air_temperature_k": [308.15]}
        done = complete(SampleBlock.from_columns(warm))
        # ISO 2533 rounds its sea-level density to 1.225 from 101325 / (287.05287 * 288.15) = 1.22500002
        assert done.column("air_density_kg_m3")[0] == pytest.approx(1.225 * 288.15 / 308.15, rel=1e-7)

    def test_a_given_density_is_used(self) -> None:
        columns = {"airspeed_indicated_m_s": [20.0], "altitude_m": [0.0], "air_density_kg_m3": [1.225 / 4.0]}
        assert complete(SampleBlock.from_columns(columns)).column("airspeed_true_m_s")[0] == 40.0

    def test_the_aileron_is_half_of_right_minus_left_and_a_command_stands_in_for_a_position(self) -> None:
        columns = {"aileron_left_rad": [-0.1], "aileron_right_rad": [0.2], "elevator_command_rad": [0.05]}
        done = complete(SampleBlock.from_columns(columns))
        assert done.column("aileron_rad")[0] == (0.2 + 0.1) / 2.0
        assert done.column("elevator_rad")[0] == 0.05
        assert np.isnan(done.column("rudder_rad")[0])

    def test_what_is_given_is_never_touched(self) -> None:
        columns = {"elevator_rad": [np.nan, 0.1], "elevator_command_rad": [0.3, 0.3]}
        done = complete(SampleBlock.from_columns(columns), list(columns))
        np.testing.assert_array_equal(done.column("elevator_rad"), [np.nan, 0.1])

    def test_measured_halves_go_before_a_command(self) -> None:
        given_channels = ("aileron_left_rad", "aileron_right_rad", "aileron_command_rad")
        assert derivations(given_channels)["aileron_rad"] == ("aileron_left_rad", "aileron_right_rad")

    def test_impossible_sources_give_missing_values_without_a_warning(self) -> None:
        columns = {"airspeed_indicated_m_s": [20.0, 20.0, 20.0], "altitude_m": [1e9, np.nan, 0.0]}
        speed = complete(SampleBlock.from_columns(columns)).column("airspeed_true_m_s")
        assert np.isfinite(speed).tolist() == [False, False, True]
        negative = complete(SampleBlock.from_columns({**columns, "air_density_kg_m3": [-1.0, 0.0, 1.0]}))
        assert np.isfinite(negative.column("airspeed_true_m_s")).tolist() == [False, False, True]

    @given(st.lists(st.integers(1, 29), max_size=8), st.integers(0, 10_000))
    def test_each_row_is_completed_from_itself_whatever_the_pieces(self, cuts: list[int], seed: int) -> None:
        draw = np.random.default_rng(seed)
        columns = {
            "airspeed_indicated_m_s": draw.uniform(5.0, 40.0, 30),
            "altitude_m": draw.uniform(-100.0, 20_000.0, 30),
            "outside_air_temperature_k": draw.uniform(220.0, 310.0, 30),
            "aileron_left_rad": draw.normal(size=30),
            "aileron_right_rad": draw.normal(size=30),
            "rudder_command_rad": draw.normal(size=30),
        }
        for left_out in ((), ("outside_air_temperature_k",)):
            given_channels = [name for name in columns if name not in left_out]
            block = SampleBlock.from_columns({name: columns[name] for name in given_channels})
            pieces = np.split(block.values, sorted(set(cuts)))
            joined = SampleBlock.concatenate(
                [complete(SampleBlock(piece), given_channels) for piece in pieces]
            )
            assert same(joined, complete(block, given_channels))


class TestLoading:
    @pytest.mark.parametrize("suffix", [".csv", ".parquet"])
    def test_a_flight_comes_back_to_the_bit(self, tmp_path: Path, suffix: str) -> None:
        draw = np.random.default_rng(3)
        strange = np.where(
            np.arange(50) % 7 == 0, np.nan, draw.normal(size=50) * 10.0 ** draw.integers(-300, 0, 50)
        )
        block = flight_block(50, elevator_rad=strange, rudder_rad=draw.normal(size=50))
        block = complete(block)
        write_flight(block, tmp_path / f"flight{suffix}")
        flight = load_flight(tmp_path / f"flight{suffix}")
        np.testing.assert_array_equal(flight.block.values, block.values)
        assert flight.kinds == {"elevator_rad": "position", "rudder_rad": "position"}
        assert flight.report.rows_read == flight.report.rows_kept == 50

    def test_commands_indicated_airspeed_and_the_map_say_kind_and_quality(self, tmp_path: Path) -> None:
        columns = flight_columns(20)
        columns["airspeed_indicated_m_s"] = columns.pop("airspeed_true_m_s")
        columns |= {"elevator_command_rad": np.full(20, 0.1), "de": np.full(20, 5.0), "extra": np.zeros(20)}
        write_columns(tmp_path / "flight.csv", columns)
        rules = parse_map(
            'format = 1\n[channels]\nrudder_rad = { source = "de", unit = "deg", kind = "command" }\n'
            'altitude_m = { source = "altitude_m", quality = "derived" }'
        )
        flight = load_flight(tmp_path / "flight.csv", rules)
        assert flight.kinds == {"elevator_rad": "command", "rudder_rad": "command"}
        assert flight.block.column("elevator_rad").tolist() == [0.1] * 20
        assert flight.block.column("rudder_command_rad")[0] == pytest.approx(np.deg2rad(5.0))
        assert flight.quality["airspeed_true_m_s"] == "derived"
        assert flight.quality["altitude_m"] == "derived"
        assert flight.quality["pitch_rad"] == "measured"
        assert flight.report.unused == ("extra",)
        assert "extra" in flight.report.text
        assert "elevator_rad" not in flight.wire_columns
        assert "elevator_command_rad" in flight.wire_columns

    def test_missing_channels_are_named_together_with_what_they_could_come_from(self, tmp_path: Path) -> None:
        columns = flight_columns(20)
        for name in ("airspeed_true_m_s", "pitch_rate_rad_s"):
            del columns[name]
        columns["pitch_rate_deg_s"] = np.ones(20)
        write_columns(tmp_path / "flight.csv", columns)
        with pytest.raises(FlightError) as caught:
            load_flight(tmp_path / "flight.csv")
        text = str(caught.value)
        assert "airspeed_true_m_s (or airspeed_indicated_m_s), pitch_rate_rad_s" in text
        assert "does pitch_rate_rad_s come from pitch_rate_deg_s?" in text

    def test_a_required_channel_without_a_single_value_is_missing(self, tmp_path: Path) -> None:
        write_columns(tmp_path / "flight.csv", {**flight_columns(20), "roll_rad": np.full(20, np.nan)})
        with pytest.raises(FlightError, match="no values for roll_rad"):
            load_flight(tmp_path / "flight.csv")

    def test_a_window_without_rows_is_said(self, tmp_path: Path) -> None:
        write_columns(tmp_path / "flight.csv", flight_columns(20))
        with pytest.raises(FlightError, match="none of the 20 rows"):
            load_flight(tmp_path / "flight.csv", parse_map("format = 1\n[rows]\nfrom_s = 1e6"))

    def test_a_map_may_be_a_file(self, tmp_path: Path) -> None:
        write_columns(tmp_path / "flight.csv", flight_columns(20))
        (tmp_path / "map.toml").write_text("format = 1\n[rows]\nto_s = 10.1\n")
        assert len(load_flight(tmp_path / "flight.csv", tmp_path / "map.toml").block) == 6
        with pytest.raises(MapError, match="no such channel map"):
            load_flight(tmp_path / "flight.csv", tmp_path / "none.toml")

    def test_a_flight_is_written_as_csv_or_parquet_only(self, tmp_path: Path) -> None:
        with pytest.raises(FlightError, match=r"\.csv or \.parquet"):
            write_flight(flight_block(), tmp_path / "flight.mat")
        with pytest.raises(FlightError, match="no samples"):
            write_flight(SampleBlock.concatenate([]), tmp_path / "flight.csv")
        with pytest.raises(FlightError, match="cannot be written"):
            write_flight(flight_block(), tmp_path / "nowhere" / "flight.csv")


def write_columns(path: Path, columns: dict[str, np.ndarray]) -> None:
    rows = zip(*columns.values(), strict=True)
    lines = [
        ",".join(columns),
        *(",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in rows),
    ]
    path.write_text("\n".join(lines) + "\n")


def test_a_mode_says_what_it_lacks() -> None:
    present = set(REQUIRED_CHANNELS)
    assert missing_for(SHORT_PERIOD, present) == ("elevator_rad",)
    assert missing_for(DUTCH_ROLL, present | {"aileron_rad"}) == ("rudder_rad",)
    assert missing_for(LATERAL, present) == ("aileron_rad", "rudder_rad")
    assert missing_for(LATERAL, CHANNEL_NAMES) == ()
    assert missing_for(SHORT_PERIOD, set(CHANNEL_NAMES) - {"altitude_m"}) == ("altitude_m",)


@pytest.mark.skipif(not THOR75.exists(), reason="the recorded flight thor75 is not beside the repository")
class TestThor75:
    def test_the_map_brings_the_real_flight_to_the_flight_table(self) -> None:
        flight = load_flight(THOR75, parse_map(THOR75_MAP))
        raw = scipy.io.loadmat(THOR75, squeeze_me=True)["flight_data"]
        time_s, mode = raw["time"].item(), raw["mode"].item()
        kept = (mode == 2) & (time_s >= 235.0) & (time_s <= 532.0)
        assert flight.report.rows_read == 34_812
        assert len(flight.block) == np.count_nonzero(kept)
        np.testing.assert_array_equal(flight.block.time_s, time_s[kept])
        np.testing.assert_array_equal(flight.block.column("pitch_rate_rad_s"), raw["q"].item()[kept])
        aileron = (raw["da_r"].item()[kept] - raw["da_l"].item()[kept]) / 2
        np.testing.assert_array_equal(flight.block.column("aileron_rad"), aileron)
        assert set(flight.kinds.values()) == {"command"}
        assert missing_for(LATERAL, flight.block.present) == ()
        assert missing_for(SHORT_PERIOD, flight.block.present) == ()
        ratio = flight.block.column("airspeed_true_m_s") / raw["ias"].item()[kept]
        density = isa_density_kg_m3(raw["h"].item()[kept])
        np.testing.assert_allclose(ratio, np.sqrt(1.225 / density), rtol=8 * np.finfo(float).eps)

    def test_without_a_map_it_is_refused_with_every_missing_channel_named(self) -> None:
        with pytest.raises(FlightError) as caught:
            load_flight(THOR75)
        assert all(name in str(caught.value) for name in REQUIRED_CHANNELS)


def test_a_position_that_is_its_command_to_the_bit_is_no_reading(tmp_path: Path) -> None:
    block = SampleBlock.from_columns(
        {
            **{name: np.linspace(1.0, 2.0, 50) for name in REQUIRED_CHANNELS},
            "time_s": 0.02 * np.arange(50),
            "elevator_rad": np.sin(np.arange(50.0)) / 10.0,
            "elevator_command_rad": np.sin(np.arange(50.0)) / 10.0,
            "aileron_rad": np.sin(np.arange(50.0)) / 11.0,
            "aileron_command_rad": np.sin(np.arange(50.0)) / 10.0,
            "rudder_rad": np.zeros(50),
            "rudder_command_rad": np.zeros(50),
        }
    )
    path = tmp_path / "flight.csv"
    write_flight(block, path)
    flight = load_flight(path)
    assert flight.kinds["elevator_rad"] == "command"
    assert flight.kinds["aileron_rad"] == "position"
    assert flight.kinds["rudder_rad"] == "position"  # one that rests says nothing either way
    assert "elevator_rad" not in flight.wire_columns
    assert "elevator_rad is its command to the bit, and taken for that" in flight.report.notes
