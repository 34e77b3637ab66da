"""`log`, and commands that take flights, on autopilots' logs: derivatives come out with the right signs and sizes."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_flights import run
from flown_logs import ardupilot_log, flown, on_the_ground_first, px4_log

from wingwatch.aircraft import load_aircraft

LOGS: dict[str, Callable[..., Any]] = {"ulg": px4_log, "bin": ardupilot_log}
SURFACES = ("elevator_rad", "aileron_rad", "rudder_rad")


@pytest.fixture(scope="module", params=sorted(LOGS))
def log(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("logs") / f"flight.{request.param}"
    path.write_bytes(LOGS[request.param](on_the_ground_first(flown(90.0)), 1).encode())
    return path


def test_derivatives_of_a_flight_come_back_out_of_its_log(
    capsys: pytest.CaptureFixture[str], log: Path
) -> None:
    """What was flown is the aircraft file itself, so its expectation is the truth."""
    result = run(capsys, ["estimate", log, "--aircraft", "aerosonde", "--json", "--estimator", "ekf"]).json
    modes = result["estimators"]["ekf"]
    beyond = []
    for mode, controls in (("short_period", ("m_eta",)), ("lateral", ("l_xi", "n_zeta"))):
        for name, row in modes[mode]["derivatives"].items():
            error = abs(row["value"] - row["expected"]) / row["standard_error"]
            assert error < 4.5, (mode, name, row)
            beyond.append(error > 2.0)
        for name in controls:
            row = modes[mode]["derivatives"][name]
            assert row["value"] < -5.0 * row["standard_error"], name  # a missed sign of a servo would turn it
    assert sum(beyond) <= 3
    assert result["cleaning"]["rates_hz"]["airspeed_indicated_m_s"] == pytest.approx(10.0)
    assert any(re.match(r"airborne from 4[23]\.", note) for note in result["cleaning"]["notes"])


def test_the_other_commands_take_the_log_too(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    watched = run(capsys, ["monitor", log, "--aircraft", "aerosonde", "--json"]).json
    assert watched["alerts"] == []
    assert watched["duration_s"] == pytest.approx(89.0, abs=0.2)
    assert run(capsys, ["condition", log, "--aircraft", "aerosonde", "--json"]).json["samples"] > 4000


def test_log_says_what_there_is(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    result = run(capsys, ["log", log, "--json"]).json
    assert result["vehicle"] == "fixed wing"
    assert result["duration_s"] == pytest.approx(102.0, abs=0.1)
    assert result["airborne_s"] == pytest.approx(89.0, abs=0.2)
    channels = {one["channel"]: one for one in result["channels"]}
    assert channels["pitch_rate_rad_s"]["quality"] == "measured"
    assert channels["pitch_rate_rad_s"]["rate_hz"] == pytest.approx(50.0)
    assert channels["airspeed_indicated_m_s"]["rate_hz"] == pytest.approx(10.0)
    assert {channels[name]["quality"] for name in SURFACES} == {"commanded"}
    assert {channels[name]["unit"] for name in SURFACES} == {"of full travel"}
    assert channels["altitude_m"]["high"] == pytest.approx(1000.0, abs=3.0)
    assert result["missing"] == ["angle_of_attack_rad", "sideslip_rad"]
    assert all(mode["can_be_estimated"] for mode in result["modes"].values())
    with_travel = run(capsys, ["log", log, "--aircraft", "aerosonde", "--json"]).json
    assert {one["unit"] for one in with_travel["channels"] if one["channel"] in SURFACES} == {"rad"}
    shown = run(capsys, ["log", log])
    assert shown.code == 0
    assert "short_period: can be estimated" in shown.out
    assert "surfaces are commands" in shown.out


@pytest.mark.parametrize("aircraft", [[], ["--aircraft", "aerosonde"]])
def test_the_written_map_reads_the_same_flight(
    capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path, aircraft: list[str]
) -> None:
    out = tmp_path / "map.toml"
    assert run(capsys, ["log", log, "--write-map", out, *aircraft, "--json"]).json["map"] == str(out)
    assert ("full_deflection_rad = 0.3927" in out.read_text()) == bool(aircraft)
    arguments = ["estimate", log, "--aircraft", "aerosonde", "--json", "--estimator", "fourier"]
    plain, mapped = run(capsys, arguments).json, run(capsys, [*arguments, "--map", out]).json
    assert plain["estimators"] == mapped["estimators"]
    assert plain["cleaning"]["rows_kept"] == mapped["cleaning"]["rows_kept"]


def test_bad_input_is_one_sentence(capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path) -> None:
    assert "no such file" in run(capsys, ["log", tmp_path / "none.ulg"]).sentence
    assert "choose such a suffix" in run(capsys, ["log", log, "--write-map", tmp_path / "map.txt"]).sentence
    (tmp_path / "table.csv").write_text("time_s,q\n0.0,0.1\n0.02,0.2\n")
    assert (
        "is a table"
        in run(capsys, ["log", tmp_path / "table.csv", "--write-map", tmp_path / "m.toml"]).sentence
    )
    assert load_aircraft("jetstream31").actuators.elevator is None
    assert "position_limit_rad under" in run(capsys, ["estimate", log, "--aircraft", "jetstream31"]).sentence


def test_a_table_is_described_too(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("time_s,pitch_rate_rad_s,gyro\n0.0,0.1,5\n0.02,0.2,6\n0.04,,7\n")
    result = run(capsys, ["log", path, "--json"]).json
    assert result["duration_s"] == pytest.approx(0.04)
    assert result["channels"][0]["channel"] == "pitch_rate_rad_s"
    assert result["channels"][0]["missing_rows"] == 1
    assert result["columns"] == [{"column": "gyro", "low": 5.0, "high": 7.0, "missing_rows": 0}]
    assert "roll_rate_rad_s" in result["missing"]
    assert not result["modes"]["short_period"]["can_be_estimated"]
    assert run(capsys, ["log", path]).code == 0


def test_a_log_without_a_flight_or_a_map_is_still_described(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.01, 500)
    rest = on_the_ground_first(flown(90.0))
    ground = {name: values[:500] + noise * (name != "time_s") for name, values in rest.items()}
    path = tmp_path / "ground.bin"
    path.write_bytes(ardupilot_log(ground).encode())
    assert "never airborne" in run(capsys, ["estimate", path, "--aircraft", "aerosonde"]).sentence
    result = run(capsys, ["log", path, "--json"]).json
    assert (result["airborne"], result["rows"]) == ([], 500)
    assert "it was never airborne" in result["notes"]
    other = px4_log(ground)
    other.infos = {"sys_name": "SomethingElse"}
    path.write_bytes(other.encode())
    result = run(capsys, ["log", path, "--json"]).json
    assert result["channels"] == []
    topics = {topic["name"]: topic for topic in result["topics"]}
    assert topics["vehicle_acceleration[0]"]["fields"] == ["timestamp_sample", "xyz[0]", "xyz[1]", "xyz[2]"]
    assert topics["vehicle_acceleration[0]"]["rate_hz"] == pytest.approx(50.0)
    assert run(capsys, ["log", path]).code == 0
    assert "no map is ready" in run(capsys, ["log", path, "--write-map", tmp_path / "m.toml"]).sentence


def test_a_multicopter_is_refused_by_every_command(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    made = ardupilot_log(on_the_ground_first(flown(90.0)))
    made.firmware = "ArduCopter V4.5.7"
    path = tmp_path / "copter.bin"
    path.write_bytes(made.encode())
    for command in (["log", path], ["estimate", path, "--aircraft", "aerosonde"]):
        assert "multicopter" in run(capsys, command).sentence
