"""Flights out of autopilot logs: what is measured and what is not, when it flew, and what real logs do to a reader."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flown_logs import (
    GROUND_S,
    START_S,
    TRAVEL_RAD,
    ardupilot_log,
    flown,
    on_the_ground_first,
    pressure_pa,
    px4_log,
)
from numpy.typing import NDArray
from written_logs import Flash, FlashTopic, Ulog

from wingwatch.telemetry import Cleaner, FlightError, FlightTable, LogError, MapError, load_flight, parse_map
from wingwatch.telemetry.logs import log_table, map_text, read_autopilot_log

Array = NDArray[Any]
Columns = Mapping[str, Array]

TRAVEL = dict.fromkeys(("elevator_rad", "aileron_rad", "rudder_rad"), TRAVEL_RAD)
SECONDS = 30.0
TAKE_OFF_S = START_S + GROUND_S
MARGIN_S = 1.0  # cut off after take-off


def columns(**changes: Array) -> dict[str, Array]:
    return {**on_the_ground_first(flown(SECONDS)), **changes}


def load(path: Path, made: Ulog | Flash, channel_map: str | None = None) -> FlightTable:
    path.write_bytes(made.encode())
    return load_flight(path, None if channel_map is None else parse_map(channel_map), TRAVEL)


def changed(made: Flash, name: str, rows: Callable[[tuple[object, ...]], tuple[object, ...]]) -> Flash:
    """With the rows of one type changed."""
    return replace(
        made,
        topics=[
            replace(t, rows=[rows(tuple(r)) for r in t.rows]) if t.name == name else t for t in made.topics
        ],
    )


def without(made: Flash, *names: str) -> list[FlashTopic]:
    return [t for t in made.topics if t.name not in names]


BOTH = pytest.mark.parametrize(("suffix", "log"), [("ulg", px4_log), ("bin", ardupilot_log)])


@BOTH
def test_a_flight_is_what_flew(tmp_path: Path, suffix: str, log: Callable[[Columns], Ulog | Flash]) -> None:
    """Every channel agrees with the truth that was logged, within the format's digits and the slower topics' chords."""
    truth = flown(SECONDS, noise=False)
    flight = load(tmp_path / f"a.{suffix}", log(on_the_ground_first(truth)))
    rows = np.searchsorted(flight.block.time_s, TAKE_OFF_S + truth.time_s[50:-50] - 0.001)
    np.testing.assert_allclose(flight.block.time_s[rows], TAKE_OFF_S + truth.time_s[50:-50], atol=1e-6)
    held = (
        0.11 * float(np.abs(np.diff(truth.column("airspeed_true_m_s"))).max()) * 50.0
    )  # until the next reading
    limits = {
        "rate": 1e-7, "specific": 1e-6, "roll": 2e-3, "pitch": 1e-3, "heading": 1e-3, "airspeed": held,
        "altitude": 5e-3, "velocity": 0.06, "latitude": 1e-7, "longitude": 5e-7, "throttle": 6e-4,
        "elevator": 7e-4, "aileron": 6e-4, "rudder": 4e-4,
    }  # fmt: skip
    checked = set()
    for name in flight.block.present:
        surface = name.split("_")[0]
        of = f"{surface}_command_rad" if surface in ("elevator", "aileron", "rudder") else name
        if of not in truth.present or name == "time_s":
            continue
        kind = "rate" if "_rate_" in name else name.split("_")[0]
        if kind in limits:
            error = np.abs(flight.block.column(name)[rows] - truth.column(of)[50:-50])
            assert np.nanmax(error) < limits[kind], name
            assert np.isfinite(error).mean() > 0.95, name
            checked.add(kind)
    assert checked == set(limits)


@BOTH
def test_rates_of_channels_are_their_own(
    tmp_path: Path, suffix: str, log: Callable[..., Ulog | Flash]
) -> None:
    flight = load(tmp_path / f"a.{suffix}", log(columns(), 5))
    rates = flight.report.rates_hz
    assert rates["pitch_rate_rad_s"] == pytest.approx(50.0)
    assert rates["elevator_rad"] == pytest.approx(10.0)
    assert rates["airspeed_indicated_m_s"] == pytest.approx(10.0)
    assert rates["latitude_deg"] == pytest.approx(5.0)
    assert any("commands, logged at 10 Hz" in note for note in flight.report.notes)


@BOTH
def test_altitude_is_absolute_and_the_sensors_own_heat_is_no_weather(
    tmp_path: Path, suffix: str, log: Callable[[Columns], Ulog | Flash]
) -> None:
    flight = load(tmp_path / f"a.{suffix}", log(columns()))
    assert np.nanmedian(flight.block.column("altitude_m")) == pytest.approx(
        1000.0, abs=1.0
    )  # BARO.Alt says 120
    assert "outside_air_temperature_k" not in flight.block.present
    assert np.nanmedian(flight.block.column("air_density_kg_m3")) == pytest.approx(1.1116, rel=1e-3)


def test_the_receiver_has_the_altitude_where_no_pressure_is_logged(tmp_path: Path) -> None:
    made = ardupilot_log(columns())
    flight = load(tmp_path / "a.bin", replace(made, topics=without(made, "BARO")))
    assert np.nanmedian(flight.block.column("altitude_m")) == pytest.approx(1000.0, abs=1.0)


def test_px4_true_airspeed_by_a_hot_sensor_is_not_taken(tmp_path: Path) -> None:
    """The log's true airspeed is 10 % off, made with the sensor's own temperature; the calibrated one is right."""
    flight = load(tmp_path / "a.ulg", px4_log(columns()))
    truth = flown(SECONDS).column("airspeed_true_m_s")
    assert np.nanmedian(flight.block.column("airspeed_true_m_s")) == pytest.approx(np.median(truth), rel=3e-3)


class TestAirspeed:
    def test_a_dead_pitot_is_absent_and_the_synthetic_airspeed_is_derived(self, tmp_path: Path) -> None:
        made = changed(ardupilot_log(columns()), "ARSP", lambda r: (*r[:2], 0.0, *r[3:]))
        air = columns()["airspeed_true_m_s"] * 0.95
        stamps = [round(s * 1e6) for s in columns()["time_s"][::5]]
        tuning = FlashTopic(
            "CTUN",
            "Qfh",
            "TimeUS,As,ThO",
            list(zip(stamps, air[::5].tolist(), [50] * len(stamps), strict=True)),
        )
        flight = load(tmp_path / "a.bin", replace(made, topics=[*made.topics, tuning]))
        assert flight.quality["airspeed_indicated_m_s"] == "derived"
        assert "ARSP[0].Airspeed reads exactly 0 throughout and is taken for absent" in flight.report.notes
        assert any("derived by the autopilot (CTUN.As), not measured" in note for note in flight.report.notes)

    def test_no_airspeed_at_all_is_a_sentence(self, tmp_path: Path) -> None:
        made = ardupilot_log(columns())
        with pytest.raises(FlightError, match="no values for airspeed_true_m_s"):
            load(tmp_path / "a.bin", replace(made, topics=without(made, "ARSP")))

    def test_a_dead_pitot_alone_is_named_in_the_sentence(self, tmp_path: Path) -> None:
        made = changed(ardupilot_log(columns()), "ARSP", lambda r: (*r[:2], 0.0, *r[3:]))
        with pytest.raises(
            FlightError, match=r"no values for airspeed.*ARSP\[0\].Airspeed reads exactly 0 throughout"
        ):
            load(tmp_path / "a.bin", made)

    def test_a_pitot_that_fails_in_flight_does_not_end_the_flight(self, tmp_path: Path) -> None:
        failed = columns()
        failed["airspeed_true_m_s"] = np.where(
            failed["time_s"] > TAKE_OFF_S + 15.0, 0.0, failed["airspeed_true_m_s"]
        )
        flight = load(tmp_path / "a.ulg", px4_log(failed))
        assert flight.block.time_s[-1] == pytest.approx(TAKE_OFF_S + SECONDS, abs=1.5)

    def test_px4_ground_speed_minus_wind_is_derived(self, tmp_path: Path) -> None:
        made = px4_log(columns())
        for topic in made.topics:
            if topic.name == "airspeed_validated":
                kind, name, values = topic.fields[2]
                topic.fields = [*topic.fields[:2], (kind, name, np.zeros_like(values))]
        flight = load(tmp_path / "a.ulg", made)
        assert flight.quality["airspeed_indicated_m_s"] == "derived"
        assert load(tmp_path / "b.ulg", px4_log(columns())).quality["airspeed_indicated_m_s"] == "measured"

    def test_an_airspeed_once_a_second_is_bridged_and_faster_channels_are_not(self, tmp_path: Path) -> None:
        made = ardupilot_log(columns())
        slow = [replace(t, rows=t.rows[::10]) if t.name == "ARSP" else t for t in made.topics]
        flight = load(tmp_path / "a.bin", replace(made, topics=slow))
        assert flight.report.rates_hz["airspeed_indicated_m_s"] == pytest.approx(1.0)
        assert np.isfinite(flight.block.column("airspeed_true_m_s")).mean() > 0.95


def test_an_estimators_incidence_is_no_vane(tmp_path: Path) -> None:
    made = ardupilot_log(columns())
    stamps = [round(s * 1e6) for s in columns()["time_s"][::5]]
    estimated = FlashTopic("AOA", "Qff", "TimeUS,AOA,SSA", [(s, 3.0, 0.5) for s in stamps])
    flight = load(tmp_path / "a.bin", replace(made, topics=[*made.topics, estimated]))
    assert not {"angle_of_attack_rad", "sideslip_rad"} & set(flight.block.present)


def test_the_lowest_instance_that_works_is_read(tmp_path: Path) -> None:
    """The second IMU reads seven times too much; with the first one unhealthy it is still the one that is left."""
    truth = flown(SECONDS).column("pitch_rate_rad_s")[60:]
    first = load(tmp_path / "a.bin", ardupilot_log(columns())).block.column("pitch_rate_rad_s")
    assert np.abs(first).max() == pytest.approx(np.abs(truth).max(), rel=1e-6)
    ill = changed(ardupilot_log(columns()), "IMU", lambda r: (*r[:8], 0, r[9]) if r[1] == 0 else r)
    second = load(tmp_path / "b.bin", ill).block.column("pitch_rate_rad_s")
    assert np.abs(second).max() == pytest.approx(7.0 * np.abs(truth).max(), rel=1e-6)


def test_a_map_chooses_another_instance_and_another_clock(tmp_path: Path) -> None:
    text = 'format = 1\nclock = "roll_rad"\n[channels]\n' + "\n".join(
        f'{name} = {{ source = "{source}" }}'
        for name, source in {
            "roll_rate_rad_s": "IMU[1].GyrX / 7", "pitch_rate_rad_s": "IMU[1].GyrY / 7",
            "yaw_rate_rad_s": "IMU[1].GyrZ / 7", "specific_force_x_m_s2": "IMU.AccX",
            "specific_force_y_m_s2": "IMU.AccY", "specific_force_z_m_s2": "IMU.AccZ",
            "airspeed_indicated_m_s": "ARSP.Airspeed", "altitude_m": "GPS.Alt",
        }.items()
    )  # fmt: skip
    text += '\nroll_rad = { source = "ATT.Roll", unit = "deg" }\npitch_rad = { source = "ATT.Pitch", unit = "deg" }\n'
    text += (
        'elevator_rad = { source = "RCOU.C2", unit = "pwm", neutral = 1480, span = 450, kind = "command" }'
    )
    flight = load(tmp_path / "a.bin", ardupilot_log(columns()), text)
    assert np.median(np.diff(flight.block.time_s)) == pytest.approx(0.04)
    truth = flown(SECONDS).column("pitch_rate_rad_s")
    assert np.abs(flight.block.column("pitch_rate_rad_s")).max() <= np.abs(truth).max() * 1.000001
    assert "elevator_rad" in flight.block.present
    with pytest.raises(MapError, match=r"the log has no column 'IMU\[0\].GyroY'; it has IMU\[0\].GyrX"):
        load(tmp_path / "a.bin", ardupilot_log(columns()), text.replace("IMU[1].GyrY / 7", "IMU.GyroY"))
    with pytest.raises(MapError, match="a clock of its own"):
        load(tmp_path / "a.bin", ardupilot_log(columns()), text + '\ntime_s = { source = "IMU.GyrX" }')


def test_columns_of_several_topics_meet_in_an_expression(tmp_path: Path) -> None:
    base = 'format = 1\n[channels]\npitch_rate_rad_s = { source = "IMU.GyrY" }\n'
    names = (
        "roll_rate_rad_s",
        "yaw_rate_rad_s",
        *(f"specific_force_{a}_m_s2" for a in "xyz"),
        "roll_rad",
        "pitch_rad",
    )
    base += "\n".join(f'{name} = {{ source = "IMU.GyrX" }}' for name in names)
    text = (
        base
        + '\naltitude_m = { source = "GPS.Alt + 0 * IMU.GyrX" }'
        + '\nairspeed_true_m_s = { source = "ARSP.Airspeed + IMU.GyrX" }'
    )
    flight = load(tmp_path / "a.bin", ardupilot_log(columns()), text)
    assert np.nanmedian(flight.block.column("altitude_m")) == pytest.approx(1000.0, abs=1.0)
    assert flight.report.rates_hz["altitude_m"] == pytest.approx(50.0)


class TestTime:
    def test_repeated_stray_and_late_stamps_are_dropped_and_counted(self, tmp_path: Path) -> None:
        made = ardupilot_log(columns())
        stray = iter(range(10**9))

        def spoil(row: tuple[object, ...]) -> tuple[object, ...]:
            number = next(stray)
            return (int(9e12), *row[1:]) if number == 1800 else row

        flight = load(tmp_path / "a.bin", changed(made, "IMU", spoil))
        assert any("stamped far off" in note and "IMU[0] 1" in note for note in flight.report.notes)
        report = Cleaner().clean(flight.block).report
        assert set(report.rejected) <= {"non_finite"}

    def test_a_jump_of_the_clock_cuts_and_the_longest_run_is_read(self, tmp_path: Path) -> None:
        """The clock jumps back by 258 s in the middle of the flight, in every topic."""
        made = px4_log(columns(time_s=columns()["time_s"] + 400.0))
        jump = int(442e6 + 10e6)
        topics = [
            replace(t, time_us=[us if us < jump else us - 258_000_000 for us in t.time_us])
            for t in made.topics
        ]
        for topic in topics:
            topic.fields = [
                (k, n, np.array(topic.time_us) if n == "timestamp_sample" else v) for k, n, v in topic.fields
            ]
        flight = load(tmp_path / "a.ulg", replace(made, topics=topics))
        assert (np.diff(flight.block.time_s) > 0.0).all()
        assert flight.block.time_s[-1] - flight.block.time_s[0] == pytest.approx(20.0, abs=0.2)
        assert flight.block.time_s[0] == pytest.approx(452.0 - 258.0, abs=0.2)
        assert any("the clock jumped 1 times" in note for note in flight.report.notes)

    def test_a_topic_on_another_clock_is_left_out_and_said(self, tmp_path: Path) -> None:
        made = changed(ardupilot_log(columns()), "GPS", lambda r: (int(r[0]) + 1_300_000_000_000_000, *r[1:]))  # type: ignore[call-overload]
        flight = load(tmp_path / "a.bin", made)
        assert "latitude_deg" not in flight.block.present
        assert any(
            note.startswith("latitude_deg left out: GPS[0] has no reading during")
            for note in flight.report.notes
        )

    def test_a_gap_is_no_flight_that_was_seen(self, tmp_path: Path) -> None:
        made = ardupilot_log(columns())
        start, end = (TAKE_OFF_S + 8.0) * 1e6, (TAKE_OFF_S + 9.5) * 1e6
        cut = [
            replace(t, rows=[r for r in t.rows if t.name != "ATT" or not start < int(r[0]) < end])  # type: ignore[call-overload]
            for t in made.topics
        ]
        flight = load(tmp_path / "a.bin", replace(made, topics=cut))
        inside = (flight.block.time_s > start / 1e6 + 0.1) & (flight.block.time_s < end / 1e6 - 0.1)
        assert np.isnan(flight.block.column("roll_rad")[inside]).all()
        assert np.isfinite(flight.block.column("roll_rate_rad_s")[inside]).all()

    def test_a_fast_gyro_is_filtered_and_sampled_at_a_hundred_hertz(self, tmp_path: Path) -> None:
        slow = columns()
        time_s = np.arange(slow["time_s"][0], slow["time_s"][-1], 0.0025)
        fast = {n: np.interp(time_s, slow["time_s"], v) for n, v in slow.items()}
        fast["time_s"] = time_s
        fast["pitch_rate_rad_s"] = fast["pitch_rate_rad_s"] + 0.5 * np.sin(2.0 * np.pi * 103.0 * time_s)
        flight = load(tmp_path / "a.ulg", px4_log(fast))
        assert np.median(np.diff(flight.block.time_s)) == pytest.approx(0.01)
        assert flight.report.rates_hz["pitch_rate_rad_s"] == pytest.approx(400.0, rel=0.01)
        truth = np.interp(flight.block.time_s, slow["time_s"], slow["pitch_rate_rad_s"])
        steady = (flight.block.time_s > TAKE_OFF_S + 1.0) & (flight.block.time_s < TAKE_OFF_S + SECONDS - 1.0)
        assert np.std((flight.block.column("pitch_rate_rad_s") - truth)[steady]) < 0.01  # 0.35 unfiltered
        assert any("has 400 Hz: low-pass filtered" in note for note in flight.report.notes)


class TestAirborne:
    @BOTH
    def test_time_on_the_ground_is_left_out_and_counted(
        self, tmp_path: Path, suffix: str, log: Callable[[Columns], Ulog | Flash]
    ) -> None:
        flight = load(tmp_path / f"a.{suffix}", log(columns()))
        assert flight.block.time_s[0] == pytest.approx(TAKE_OFF_S + MARGIN_S, abs=0.2)
        left = flight.report.rows_read - flight.report.rows_kept
        assert left == pytest.approx((GROUND_S + MARGIN_S) * 50, abs=10)
        assert any(note == f"{left} rows before and after are left out" for note in flight.report.notes)

    def test_an_aircraft_that_never_flew_is_a_sentence(self, tmp_path: Path) -> None:
        still = {n: np.tile(v[:100], 20) for n, v in columns().items()} | {
            "time_s": 30.0 + 0.02 * np.arange(2000)
        }
        still["airspeed_true_m_s"] = np.random.default_rng(1).normal(0.0, 1.5, 2000)  # wind on a pitot
        with pytest.raises(LogError, match=r"never airborne in this log \(speed at most \d m/s"):
            load(tmp_path / "a.bin", ardupilot_log(still))

    def test_a_take_off_that_never_was_is_no_flight(self, tmp_path: Path) -> None:
        """The aircraft runs at flying speed along the field for 10 s and stops; the wheels never leave it."""
        run = on_the_ground_first(flown(10.0))
        run["altitude_m"] = np.full(run["time_s"].size, 880.0) + np.random.default_rng(2).normal(
            0, 0.3, run["time_s"].size
        )
        with pytest.raises(LogError, match="never airborne"):
            load(tmp_path / "a.bin", ardupilot_log(run))

    def test_what_comes_after_a_crash_is_no_flight(self, tmp_path: Path) -> None:
        crashed = columns()
        crash = TAKE_OFF_S + 22.0
        after = crashed["time_s"] >= crash
        crashed["specific_force_z_m_s2"] = np.where(
            np.abs(crashed["time_s"] - crash) < 0.03, 259.0, crashed["specific_force_z_m_s2"]
        )
        crashed["airspeed_true_m_s"] = np.where(
            crashed["time_s"] > crash + 4.0, 0.0, crashed["airspeed_true_m_s"]
        )
        crashed["altitude_m"] = np.where(after, 880.0, crashed["altitude_m"])
        flight = load(tmp_path / "a.bin", ardupilot_log(crashed))
        assert flight.block.time_s[-1] < crash
        assert flight.block.time_s[-1] > crash - MARGIN_S - 0.2

    def test_of_two_flights_the_longer_is_read_and_the_other_is_said(self, tmp_path: Path) -> None:
        first, second = on_the_ground_first(flown(15.0)), on_the_ground_first(flown(SECONDS))
        both = {n: np.concatenate((first[n], second[n])) for n in first}
        both["time_s"] = 30.0 + 0.02 * np.arange(both["time_s"].size)
        flight = load(tmp_path / "a.ulg", px4_log(both))
        assert flight.block.time_s[-1] - flight.block.time_s[0] == pytest.approx(SECONDS - MARGIN_S, abs=0.2)
        assert any(re.match(r"also airborne from 4[23]\.\d to 5[56]\.", note) for note in flight.report.notes)

    def test_the_maps_window_has_the_last_word(self, tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(ardupilot_log(columns()).encode())
        rules = log_table(read_autopilot_log(path), None, TRAVEL).rules
        text = map_text(rules).replace("[channels]", "[rows]\nfrom_s = 31.0\nto_s = 50.0\n[channels]")
        flight = load_flight(path, parse_map(text), TRAVEL)
        assert (flight.block.time_s[0], flight.block.time_s[-1]) == pytest.approx((31.0, 50.0))
        filtered = map_text(rules).replace("[channels]", '[rows]\nfilter = "ARSP.Airspeed > 5"\n[channels]')
        assert len(load_flight(path, parse_map(filtered), TRAVEL).block) == pytest.approx(
            (SECONDS - MARGIN_S) * 50, abs=10
        )


@pytest.mark.parametrize("suffix", ["ulg", "bin"])
def test_a_multicopter_is_one_sentence(tmp_path: Path, suffix: str) -> None:
    made = px4_log(columns()) if suffix == "ulg" else ardupilot_log(columns())
    made = (
        replace(made, parameters={"MAV_TYPE": 2})
        if isinstance(made, Ulog)
        else replace(made, firmware="ArduCopter V4.5.7")
    )
    with pytest.raises(LogError, match="this is a multicopter's log"):
        load(tmp_path / f"a.{suffix}", made)


def test_a_log_without_rates_names_what_is_missing(tmp_path: Path) -> None:
    made = ardupilot_log(columns())
    with pytest.raises(FlightError, match="no values for roll_rate_rad_s, pitch_rate_rad_s"):
        load(tmp_path / "a.bin", replace(made, topics=without(made, "IMU")))


def test_pressure_of_the_tests_is_the_standard_atmospheres() -> None:
    assert pressure_pa(np.array([0.0, 1000.0])) == pytest.approx([101325.0, 89874.6], rel=1e-5)
