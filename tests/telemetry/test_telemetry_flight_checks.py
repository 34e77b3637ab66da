"""Stamps, rates and ranges of whole flights: mended where it is sure, else one sentence with the line to write."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from telemetry_flights import flight_columns
from test_telemetry_flight import write_columns

from wingwatch.telemetry import ChannelMap, FlightError, FlightTable, load_flight, parse_map

Array = NDArray[np.float64]


def noisy(rows: int = 400) -> dict[str, Array]:
    """A flight whose readings are new in every sample."""
    draw = np.random.default_rng(11)
    columns = flight_columns(rows)
    for name in ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"):
        columns[name] = columns[name] + 0.01 * draw.normal(size=rows)
    return columns


def load(path: Path, columns: dict[str, Any], rules: ChannelMap | None = None) -> FlightTable:
    write_columns(path / "flight.csv", columns)
    return load_flight(path / "flight.csv", rules)


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
@pytest.mark.parametrize("step_s", [0.0025, 0.02, 0.1])
def test_stamps_of_another_unit_are_named_with_the_line_that_mends_them(
    tmp_path: Path, unit: str, factor: float, step_s: float
) -> None:
    columns = noisy()
    del columns["time_s"]
    columns = {"t": np.round(5.0 + factor * step_s * np.arange(400)), **columns}
    plain = parse_map('format = 1\n[channels]\ntime_s = { source = "t" }')
    line = f'time_s = {{ source = "t", unit = "{unit}" }}'
    with pytest.raises(FlightError) as caught:
        load(tmp_path, columns, plain)
    assert line in str(caught.value)
    mended = load(tmp_path, columns, parse_map(f"format = 1\n[channels]\n{line}"))
    assert np.ptp(mended.block.time_s) == pytest.approx(399 * step_s, abs=1.1 / factor)


def test_seconds_that_a_map_calls_milliseconds_are_named(tmp_path: Path) -> None:
    rules = parse_map('format = 1\n[channels]\ntime_s = { source = "time_s", unit = "ms" }')
    with pytest.raises(
        FlightError, match=r'if time_s is in seconds, write time_s = \{ source = "time_s", unit = "s" \}'
    ):
        load(tmp_path, noisy(), rules)


@pytest.mark.parametrize("digits", [6, 9, 10])
def test_stamps_with_too_few_digits_do_not_resolve_the_samples(tmp_path: Path, digits: int) -> None:
    columns = noisy()
    columns["time_s"] = np.array([float(f"{v:.{digits}g}") for v in 1_766_147_454.0 + columns["time_s"]])
    with pytest.raises(FlightError, match="do not resolve the samples"):
        load(tmp_path, columns)


def test_repeated_rows_are_no_fault_of_the_clock(tmp_path: Path) -> None:
    columns = {name: np.repeat(column, 3) for name, column in noisy().items()}
    assert len(load(tmp_path, columns).block) == 1200


@pytest.mark.parametrize(
    ("period", "named"),
    [(2.0**32 * 1e-6, "32-bit microseconds"), (86400.0, "the time of day"), (65.536, "16-bit")],
)
def test_a_full_clock_that_begins_anew_is_counted_on(tmp_path: Path, period: float, named: str) -> None:
    columns = noisy()
    true_s = period - 4.0 + 0.02 * np.arange(400)
    flight = load(tmp_path, {**columns, "time_s": np.round(true_s % period, 6)})
    np.testing.assert_allclose(np.diff(flight.block.time_s), 0.02, atol=1e-5)
    assert any(named in note for note in flight.report.notes)


def test_a_clock_that_is_set_back_is_left_to_the_cleaner(tmp_path: Path) -> None:
    columns = noisy()
    columns["time_s"] = np.concatenate([100.0 + 0.02 * np.arange(200), 3.0 + 0.02 * np.arange(200)])
    flight = load(tmp_path, columns)
    np.testing.assert_array_equal(flight.block.time_s, columns["time_s"])
    assert flight.report.notes == ()


@pytest.mark.parametrize(("sensors", "apart_s"), [(2, 4e-5), (3, 1e-4), (2, 1e-3), (2, 0.0)])
def test_several_sensors_in_turn_are_named_with_the_filter_that_parts_them(
    tmp_path: Path, sensors: int, apart_s: float
) -> None:
    one = noisy()
    draw = np.random.default_rng(2)
    rows = 400 * sensors
    columns: dict[str, Array] = {name: np.repeat(column, sensors) for name, column in one.items()}
    number = np.tile(np.arange(float(sensors)), 400)
    columns["time_s"] = columns["time_s"] + apart_s * number
    columns["pitch_rate_rad_s"] = columns["pitch_rate_rad_s"] + 0.02 * draw.normal(size=rows)
    columns["instance"] = number
    with pytest.raises(FlightError, match=r'groups of .*filter = "instance == 0"'):
        load(tmp_path, columns)
    kept = load(tmp_path, columns, parse_map('format = 1\n[rows]\nfilter = "instance == 0"'))
    assert len(kept.block) == 400


class TestMixedRates:
    """One table of several topics, each row with one topic's columns."""

    def table(self, offsets: bool = True) -> tuple[dict[str, Array], dict[str, Array]]:
        steps = np.arange(1000)
        dense = {name: np.sin(0.002 * steps + k) for k, name in enumerate(flight_columns())}
        dense |= {"airspeed_true_m_s": 25.0 + dense["airspeed_true_m_s"], "time_s": 0.02 * steps}
        dense["elevator_command_rad"] = np.floor(steps / 100.0) / 100.0
        topics = [
            (tuple(n for n in dense if "rate" in n or "force" in n), 1, 0.0),
            (("roll_rad", "pitch_rad"), 2, 0.003 if offsets else 0.0),
            (("airspeed_true_m_s", "altitude_m"), 5, 0.007 if offsets else 0.0),
            (("elevator_command_rad",), 1, 0.001 if offsets else 0.0),
        ]
        pieces = []
        for names, every, lag_s in topics:
            part = np.full((len(steps[::every]), len(dense)), np.nan)
            for k, name in enumerate(dense):
                if name == "time_s":
                    part[:, k] = dense[name][::every] + lag_s
                elif name in names:
                    part[:, k] = dense[name][::every]
            pieces.append(part)
        rows = np.concatenate(pieces)
        rows = rows[np.argsort(rows[:, list(dense).index("time_s")], kind="stable")]
        return dense, {name: rows[:, k] for k, name in enumerate(dense)}

    @pytest.mark.parametrize("offsets", [True, False])
    def test_is_joined_at_the_stamps_of_the_rates(self, tmp_path: Path, offsets: bool) -> None:
        dense, sparse = self.table(offsets)
        flight = load(tmp_path, sparse)
        assert len(flight.block) == 1000
        np.testing.assert_array_equal(flight.block.column("yaw_rate_rad_s"), dense["yaw_rate_rad_s"])
        inner = slice(10, 980)
        shift = {"pitch_rad": 0.003, "airspeed_true_m_s": 0.007} if offsets else {}
        for name in ("pitch_rad", "airspeed_true_m_s"):
            lagged = np.interp(dense["time_s"], dense["time_s"] + shift.get(name, 0.0), dense[name])
            np.testing.assert_allclose(flight.block.column(name)[inner], lagged[inner], atol=1e-4)
        held = flight.block.column("elevator_command_rad")[inner]
        assert set(np.unique(held)) <= set(np.unique(dense["elevator_command_rad"]))
        assert any("joined at the stamps of pitch_rate_rad_s" in note for note in flight.report.notes)

    def test_takes_the_stamps_of_a_slower_vane_and_leaves_out_one_too_slow(self, tmp_path: Path) -> None:
        dense, sparse = self.table()
        vane = np.isfinite(sparse["airspeed_true_m_s"])
        with_vane = {**sparse, "angle_of_attack_rad": np.where(vane, 0.05, np.nan)}
        flight = load(tmp_path, with_vane)
        np.testing.assert_allclose(np.diff(flight.block.time_s), 0.1, atol=1e-9)
        filtered = flight.block.column("yaw_rate_rad_s")[2:-2]
        expected = np.interp(flight.block.time_s, dense["time_s"], dense["yaw_rate_rad_s"])[2:-2]
        np.testing.assert_allclose(filtered, expected, atol=2e-3)
        named = load(tmp_path, with_vane, parse_map('format = 1\nclock = "yaw_rate_rad_s"'))
        assert len(named.block) == 1000
        slow = np.flatnonzero(vane)[::4]
        flight = load(
            tmp_path, {**sparse, "sideslip_rad": np.where(np.isin(np.arange(vane.size), slow), 0.0, np.nan)}
        )
        assert "sideslip_rad" not in flight.block.present
        assert any("sideslip_rad has 2.5 Hz" in note for note in flight.report.notes)
        assert len(flight.block) == 1000

    def test_bridges_no_gap(self, tmp_path: Path) -> None:
        _, sparse = self.table()
        lost = (sparse["time_s"] > 8.0) & (sparse["time_s"] < 10.0)
        sparse["altitude_m"][lost] = np.nan
        block = load(tmp_path, sparse).block
        inside = (block.time_s > 8.1) & (block.time_s < 9.9)
        assert np.isnan(block.column("altitude_m")[inside]).all()

    def test_an_ordinary_table_with_dropouts_is_left_alone(self, tmp_path: Path) -> None:
        columns = noisy()
        columns["altitude_m"] = np.where(np.arange(400) % 3 == 0, np.nan, columns["altitude_m"])
        flight = load(tmp_path, columns)
        np.testing.assert_array_equal(flight.block.column("altitude_m"), columns["altitude_m"])
        assert flight.report.notes == ()


@pytest.mark.parametrize(
    ("name", "values", "unit"),
    [
        ("angle_of_attack_rad", (3.0, 1.0), "deg"),
        ("sideslip_rad", (0.0, 4.0), "deg"),
        ("elevator_rad", (-4.0, 3.0), "deg"),
        ("outside_air_temperature_k", (15.0, 1.0), "degC"),
        ("throttle", (55.0, 10.0), "%"),
        ("yaw_rate_rad_s", (0.0, 90.0), "deg/s"),
    ],
)
def test_readings_in_another_unit_are_named_with_it(
    tmp_path: Path, name: str, values: tuple[float, float], unit: str
) -> None:
    columns = noisy()
    columns[name] = values[0] + values[1] * np.random.default_rng(1).normal(size=400)
    with pytest.raises(FlightError) as caught:
        load(tmp_path, columns)
    line = f'{name} = {{ source = "{name}", unit = "{unit}" }}'
    assert f"{name} runs from" in str(caught.value)
    assert line in str(caught.value)
    found = load(tmp_path, columns, parse_map(f"format = 1\n[channels]\n{line}"))
    assert np.isfinite(found.block.column(name)).all()


def test_a_few_glitches_and_one_placeholder_refuse_nothing(tmp_path: Path) -> None:
    columns = noisy()
    columns["angle_of_attack_rad"] = np.where(np.arange(400) % 50 == 7, 99.0, 0.05)
    columns["outside_air_temperature_k"] = np.full(400, -9999.0)
    flight = load(tmp_path, columns)
    assert "outside_air_temperature_k" not in flight.block.present
    assert flight.report.notes == (
        "outside_air_temperature_k is -9999 throughout, which stands for no reading: left out",
    )


class TestQuaternion:
    """Attitude from a quaternion, scalar first, body to earth."""

    angles = np.random.default_rng(4).uniform((-3.0, -1.5, -3.0), (3.0, 1.5, 3.0), (50, 3)).T

    def quaternion(self) -> Array:
        (c1, c2, c3), (s1, s2, s3) = np.cos(self.angles / 2.0), np.sin(self.angles / 2.0)
        return np.array(
            [
                c1 * c2 * c3 + s1 * s2 * s3,
                s1 * c2 * c3 - c1 * s2 * s3,
                c1 * s2 * c3 + s1 * c2 * s3,
                c1 * c2 * s3 - s1 * s2 * c3,
            ]
        )

    @pytest.mark.parametrize(
        ("names", "argument"),
        [
            ([f"q[{k}]" for k in range(4)], "q"),
            ([f"vehicle_attitude[0].q[{k}]" for k in range(4)], "vehicle_attitude.q"),
            (["qw", "qx", "qy", "qz"], "qw, qx, qy, qz"),
            ([f"att q[{k}]" for k in range(4)], "'att q'"),
        ],
    )
    @pytest.mark.parametrize("length", [1.0, 32767.0])
    def test_gives_the_angles(self, tmp_path: Path, names: list[str], argument: str, length: float) -> None:
        columns = flight_columns(50)
        del columns["roll_rad"], columns["pitch_rad"]
        columns |= dict(zip(names, length * self.quaternion(), strict=True))
        entries = "\n".join(
            f'{angle}_rad = {{ source = "euler_{angle}({argument})" }}'
            for angle in ("roll", "pitch", "heading")
        )
        flight = load(tmp_path, columns, parse_map(f"format = 1\n[channels]\n{entries}"))
        for k, angle in enumerate(("roll", "pitch", "heading")):
            np.testing.assert_allclose(flight.block.column(f"{angle}_rad"), self.angles[k], atol=1e-7)
        assert flight.report.unused == ()

    @pytest.mark.parametrize(
        ("source", "said"),
        [
            ("euler_roll(q)", "needs the columns q[0], q[1], q[2], q[3], scalar first"),
            ("euler_roll(time_s, time_s)", "takes one quaternion"),
            ("exp(time_s)", "not allowed in an expression"),
        ],
    )
    def test_what_is_no_quaternion_is_said(self, tmp_path: Path, source: str, said: str) -> None:
        rules = parse_map(f'format = 1\n[channels]\nroll_rad = {{ source = "{source}" }}')
        with pytest.raises(ValueError, match="roll_rad") as caught:
            load(tmp_path, flight_columns(50), rules)
        assert said in str(caught.value)
