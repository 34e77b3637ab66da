from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from wingwatch.telemetry import MapError, load_map, parse_map
from wingwatch.telemetry.expressions import ExpressionError, evaluate, evaluate_filter, named_columns
from wingwatch.telemetry.maps import apply_map, with_travel
from wingwatch.telemetry.units import UNITS

TABLE = {
    "a": np.array([1.0, 2.0, 4.0]),
    "b": np.array([3.0, 5.0, 7.0]),
    "mode": np.array([2.0, 1.0, np.nan]),
    "IMU[1].GyrY": np.array([0.1, 0.2, 0.3]),
    "actuator_outputs[0].output[2]": np.array([9.0, 8.0, 7.0]),
    "Roll rate (deg/s)": np.array([10.0, 20.0, 30.0]),
}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a", [1.0, 2.0, 4.0]),
        ("(b - a) / 2", [1.0, 1.5, 1.5]),
        ("-" * 299 + "a", [-1.0, -2.0, -4.0]),
        ("-a ** 2 + 1.5", [0.5, -2.5, -14.5]),
        ("2", [2.0, 2.0, 2.0]),
        ("IMU[1].GyrY * 10", [1.0, 2.0, 3.0]),
        ("actuator_outputs.output[2]", [9.0, 8.0, 7.0]),
        ("actuator_outputs[0].output[2] + a", [10.0, 10.0, 11.0]),
        ("Roll rate (deg/s)", [10.0, 20.0, 30.0]),
        ("'Roll rate (deg/s)' / 10", [1.0, 2.0, 3.0]),
    ],
)
def test_an_expression_is_arithmetic_on_columns(text: str, expected: list[float]) -> None:
    np.testing.assert_allclose(evaluate(text, TABLE), expected, rtol=4 * np.finfo(float).eps)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "a.__class__",
        "(lambda: 1)()",
        "[x for x in a]",
        "a if b else a",
        "a @ b",
        "a << 2",
        "a // 2",
        "True",
        "1j",
        "a[b]",
        "a[True]",
        "f'{a}'",
        "a;b",
        "a b",
        "",
        "(" * 250,
        "a" * 301,
        "1e999",
        "IMU[0].GyrY",
    ],
)
def test_anything_else_is_refused_in_one_sentence(text: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        evaluate(text, TABLE)
    assert "\n" not in str(caught.value)
    assert str(caught.value)


@given(st.text(max_size=40))
def test_no_text_does_more_than_be_refused(text: str) -> None:
    for read in (evaluate, evaluate_filter):
        with suppress(ExpressionError):
            assert read(text, TABLE).shape == (3,)


def test_a_missing_column_is_named_with_what_is_near() -> None:
    with pytest.raises(ExpressionError, match=r"no column 'IMU\[1\].GyrX'; did you mean 'IMU\[1\].GyrY'"):
        evaluate("IMU[1].GyrX", TABLE)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("mode == 2", [True, False, False]),
        ("mode != 2", [False, True, True]),
        ("not (a > 1)", [True, False, False]),
        ("1 < a <= 2 or b == 7", [False, True, True]),
        ("a >= 2 and b - a < 3.5", [False, True, True]),
    ],
)
def test_a_filter_compares(text: str, expected: list[bool]) -> None:
    assert evaluate_filter(text, TABLE).tolist() == expected


def test_a_filter_without_comparison_is_refused() -> None:
    with pytest.raises(ExpressionError, match="no condition"):
        evaluate_filter("mode", TABLE)


@pytest.mark.parametrize(
    ("channel", "unit", "value", "si"),
    [
        ("pitch_rad", "deg", 180.0, np.pi),
        ("pitch_rate_rad_s", "deg/s", 90.0, np.pi / 2),
        ("airspeed_true_m_s", "kt", 1.0, 1852.0 / 3600.0),
        ("airspeed_true_m_s", "km/h", 36.0, 10.0),
        ("airspeed_true_m_s", "ft/min", 60.0, 0.3048),
        ("altitude_m", "ft", 1000.0, 304.8),
        ("specific_force_z_m_s2", "g", -1.0, -9.80665),
        ("time_s", "us", 2e6, 2.0),
        ("outside_air_temperature_k", "degC", 15.0, 288.15),
        ("outside_air_temperature_k", "degF", 59.0, 288.15),
        ("throttle", "%", 70.0, 0.7),
        ("velocity_down_m_s", "cm/s", -150.0, -1.5),
        ("latitude_deg", "deg", 47.25, 47.25),
        ("longitude_deg", "rad", -np.pi / 2, -90.0),
    ],
)
def test_units_convert(channel: str, unit: str, value: float, si: float) -> None:
    text = f'format = 1\n[channels]\n{channel} = {{ source = "x", unit = "{unit}" }}'
    mapped = apply_map(parse_map(text), {"time_s": np.array([0.0]), "x": np.array([value])})
    assert mapped.columns[channel][0] == pytest.approx(si, rel=1e-14)


def test_every_unit_has_a_finite_positive_factor() -> None:
    assert all(np.isfinite(unit.factor) and unit.factor > 0.0 for unit in UNITS.values())


def test_scale_and_offset_act_in_the_channels_unit_after_conversion() -> None:
    text = """
    format = 1
    [channels.elevator_rad]
    source = "servo"
    unit = "pwm"
    neutral = 1520
    span = 400
    full_deflection_rad = 0.4
    scale = -1
    offset = 0.01
    """
    mapped = apply_map(parse_map(text), {"time_s": np.zeros(2), "servo": np.array([1520.0, 1920.0])})
    np.testing.assert_allclose(mapped.columns["elevator_rad"], [0.01, -0.39], rtol=1e-14)


def test_an_unmapped_channel_passes_and_an_entry_overrides_it() -> None:
    table = {"time_s": np.arange(3.0), "pitch_rad": np.ones(3), "roll_rad": np.ones(3), "x": np.full(3, 0.5)}
    mapped = apply_map(parse_map('format = 1\n[channels]\nroll_rad = { source = "x" }'), table)
    assert mapped.columns["pitch_rad"].tolist() == [1.0, 1.0, 1.0]
    assert mapped.columns["roll_rad"].tolist() == [0.5, 0.5, 0.5]
    assert "x" not in mapped.columns


def test_the_window_and_the_filter_keep_rows_by_the_mapped_clock() -> None:
    text = """
    format = 1
    [rows]
    from_s = 0.002
    to_s = 0.003
    filter = "mode == 2"
    [channels]
    time_s = { source = "ms", unit = "ms" }
    """
    table = {"ms": np.array([1.0, 2.0, 3.0, 4.0]), "mode": np.array([2.0, 2.0, 1.0, 2.0])}
    assert apply_map(parse_map(text), table).keep.tolist() == [False, True, False, False]


class TestDelay:
    """A lagging source is read later, at most across the allowed gap."""

    TIME = 5.0 + 0.02 * np.arange(200.0)

    def undelayed(
        self, delay_s: float, extra: str = "", time: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        clock = self.TIME if time is None else time
        text = f"""
        format = 1
        [channels]
        angle_of_attack_rad = {{ source = "x", delay_s = {delay_s} {extra} }}
        """
        return apply_map(parse_map(text), {"time_s": clock, "x": self.seen(clock, delay_s)}).columns[
            "angle_of_attack_rad"
        ]

    @staticmethod
    def seen(clock: NDArray[np.float64], delay_s: float) -> NDArray[np.float64]:
        return 0.3 * (clock - delay_s)

    @pytest.mark.parametrize("delay_s", [0.06, 0.013, -0.04])
    def test_a_straight_line_is_shifted_back_exactly(self, delay_s: float) -> None:
        value = self.undelayed(delay_s)
        inside = np.isfinite(value)
        # linear interpolation of a line is exact but for rounding, and a stamp counts as met within 1e-6 s
        np.testing.assert_allclose(value[inside], 0.3 * self.TIME[inside], atol=0.3 * 1e-6)
        assert np.count_nonzero(~inside) == int(np.ceil(round(abs(delay_s) / 0.02, 6)))

    def test_a_command_is_held_not_interpolated(self) -> None:
        value = self.undelayed(0.013, ', kind = "command"')
        np.testing.assert_allclose(value[:-1], self.seen(self.TIME, 0.013)[:-1], rtol=1e-14)

    def test_a_command_delayed_by_whole_steps_lands_on_its_step_in_spite_of_rounding(self) -> None:
        value = self.undelayed(0.06, ', kind = "command"')
        np.testing.assert_allclose(value[:-3], self.seen(self.TIME, 0.06)[3:], rtol=1e-14)

    def test_nothing_is_bridged_over_a_gap(self) -> None:
        clock = np.concatenate([self.TIME[:100], self.TIME[100:] + 2.0])
        value = self.undelayed(0.013, time=clock)
        assert np.flatnonzero(np.isnan(value)).tolist() == [99, 199]

    def test_a_clock_that_jumps_back_joins_nothing(self) -> None:
        clock = np.concatenate([self.TIME[:100], self.TIME[:100] - 3.0])
        value = self.undelayed(0.013, time=clock)
        assert np.flatnonzero(np.isnan(value)).tolist() == [99, 199]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("format = 2", "format = 2"),
        ("", "format is missing"),
        ("format = 1\nformat = 1", "not valid TOML"),
        ("format = 1\nextra = 1", "extra is no key"),
        ("format = 1\n[rows]\nfrom = 1", "rows.from is no key"),
        ("format = 1\nclock = 'gyro'", "'gyro' is no flight-table channel"),
        ('format = 1\n[channels]\npitch_rate = { source = "q" }', "did you mean pitch_rate_rad_s?"),
        ('format = 1\n[channels]\npitch_rad = { sourc = "q" }', "channels.pitch_rad.source is missing"),
        (
            'format = 1\n[channels]\nelevator_rad = { source = "q", unit = "kt" }',
            "channel elevator_rad has unit 'kt'; allowed: rad, deg, norm, pwm",
        ),
        (
            'format = 1\n[channels]\naltitude_m = { source = "q", unit = "hPa" }',
            "channel altitude_m has unit 'hPa'; allowed: m, km, cm, mm, ft",
        ),
        (
            'format = 1\n[channels]\nlatitude_deg = { source = "q", unit = "norm" }',
            "channel latitude_deg has unit 'norm'; allowed: deg, rad",
        ),
        (
            'format = 1\n[channels]\nelevator_rad = { source = "q", unit = "pwm", full_deflection_rad = 1 }',
            "needs neutral and span",
        ),
        ('format = 1\n[channels]\npitch_rad = { source = "q", unit = "deg", span = 3 }', "has span"),
        ('format = 1\n[channels]\npitch_rad = { source = "q", scale = nan }', "channels.pitch_rad.scale"),
        (
            'format = 1\n[channels]\npitch_rad = { source = "q", delay_s = 11 }',
            "channels.pitch_rad.delay_s = 11",
        ),
        ('format = 1\n[channels]\ntime_s = { source = "q", delay_s = 1 }', "time_s cannot have a delay_s"),
        ('format = 1\n[channels]\npitch_rad = { source = "q", kind = "guess" }', "'guess'"),
    ],
)
def test_a_bad_map_is_one_sentence(text: str, said: str) -> None:
    with pytest.raises(MapError) as caught:
        parse_map(text, "my.toml")
    assert str(caught.value).startswith("my.toml: ")
    assert said in str(caught.value)


def test_a_quaternion_gives_its_angles_and_other_calls_are_refused() -> None:
    roll, pitch, heading = 0.3, -0.4, 2.5
    half = [np.exp(0.5j * angle) for angle in (heading, pitch, roll)]
    (ch, sh), (cp, sp), (cr, sr) = ((h.real, h.imag) for h in half)
    elements = (
        cr * cp * ch + sr * sp * sh, sr * cp * ch - cr * sp * sh, cr * sp * ch + sr * cp * sh,
        cr * cp * sh - sr * sp * ch,
    )  # fmt: skip
    for sign in (1.0, -1.0):  # a quaternion and its negative are one attitude
        table = {f"att[0].q[{i}]": np.full(2, sign * value) for i, value in enumerate(elements)}
        for name, angle in (("roll", roll), ("pitch", pitch), ("heading", heading)):
            np.testing.assert_allclose(evaluate(f"euler_{name}(att.q)", table), angle, atol=1e-12)
    assert evaluate("2 * sin(a) + cos(0)", {"a": np.array([0.0, 1.0])})[1] == pytest.approx(
        2 * np.sin(1.0) + 1.0
    )
    assert named_columns("euler_roll(att.q) + IMU.GyrX * sin(b)") == (
        "att[0].q[0]", "att[0].q[1]", "att[0].q[2]", "att[0].q[3]", "IMU[0].GyrX", "b"
    )  # fmt: skip
    for text in ("open(a)", "sin(a, a)", "sin(a=a)", "a.real(a)", "sin(sin)", "euler_roll(a + a)"):
        with pytest.raises(ExpressionError):
            evaluate(text, {"a": np.zeros(2)})


def test_a_servo_signal_takes_the_travel_of_its_aircraft_where_the_map_states_none() -> None:
    table = {"time_s": np.arange(3.0), "e": np.array([-1.0, 0.0, 0.5]), "a": np.array([0.1, 0.2, 0.3])}
    text = 'format = 1\n[channels]\nelevator_rad = { source = "e", unit = "norm" }\n'
    stated = parse_map(text + 'aileron_rad = { source = "a", unit = "norm", full_deflection_rad = 0.3 }')
    with pytest.raises(
        MapError, match=r"channel elevator_rad in norm needs full_deflection_rad: .*actuators.elev"
    ):
        apply_map(stated, table)
    full = with_travel(stated, {"elevator_rad": 0.4, "aileron_rad": 0.9})
    columns = apply_map(full, table).columns
    assert columns["elevator_rad"].tolist() == [-0.4, 0.0, 0.2]
    np.testing.assert_allclose(columns["aileron_rad"], [0.03, 0.06, 0.09])
    command = parse_map('format = 1\n[channels]\nrudder_command_rad = { source = "e", unit = "norm" }')
    np.testing.assert_allclose(
        apply_map(with_travel(command, {"rudder_rad": 0.5}), table).columns["rudder_command_rad"],
        [-0.5, 0.0, 0.25],
    )


def test_a_map_that_does_not_fit_its_table_says_which_channel_and_column() -> None:
    table = {"time": np.zeros(2), "pitch": np.zeros(2)}
    bad = parse_map('format = 1\n[channels]\ntime_s = { source = "time" }\npitch_rad = { source = "ptch" }')
    with pytest.raises(MapError, match=r"channel pitch_rad: .*'ptch'; did you mean 'pitch'\?"):
        apply_map(bad, table)
    with pytest.raises(MapError, match="no time_s"):
        apply_map(parse_map("format = 1"), table)
    rows = parse_map('format = 1\n[rows]\nfilter = "mode == 2"\n[channels]\ntime_s = { source = "time" }')
    with pytest.raises(MapError, match=r"rows.filter: .*'mode'"):
        apply_map(rows, table)
    clock = parse_map('format = 1\nclock = "roll_rad"\n[channels]\ntime_s = { source = "time" }')
    with pytest.raises(MapError, match="clock roll_rad"):
        apply_map(clock, table)


def test_a_map_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"none.toml: there is no such channel map"):
        load_map(tmp_path / "none.toml")
    with pytest.raises(MapError, match="cannot be read"):
        load_map(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b"format = 1 # \xb0")
    with pytest.raises(MapError, match="no UTF-8 text"):
        load_map(tmp_path / "latin.toml")
