"""What cannot be judged ends with exit code 2 and the likely cause; clocks and missing surfaces are named."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cli_flights import ROOT, demo_block, run, without
from numpy.typing import NDArray

from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, read_table, write_flight

CALL = ["--aircraft", "aerosonde"]
Values = NDArray[np.float64]


def slow(values: Values) -> Values:
    return values[::50]


def single(values: Values) -> Values:
    return values[:1]


def milliseconds(values: Values) -> Values:
    values[:, 0] = np.round(1000.0 * values[:, 0])
    return values


def test_a_wing_whose_file_has_no_rudder_is_compared_in_roll_and_yaw(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    text = (ROOT / "aircraft" / "library" / "aerosonde.toml").read_text()
    for effect in ("rudder = 0.19", "rudder = 0.0024", "rudder = -0.069"):
        assert effect in text
        text = text.replace(effect, "rudder = 0.0")
    (tmp_path / "wing.toml").write_text(text)
    call = ["--aircraft", tmp_path / "wing.toml"]
    flight = tmp_path / "flight.csv"
    run(capsys, ["simulate", *call, "--seconds", "60", "--seed", "3", "--out", flight])
    table = read_table(flight)
    block = SampleBlock.from_columns({n: c for n, c in table.columns.items() if "rudder" not in n})
    write_flight(block, flight)
    result = run(capsys, ["estimate", flight, *call, "--json"]).json
    rows = result["estimators"]["fourier"]["lateral"]["derivatives"]
    assert {rows[symbol]["outcome"] for symbol in ("l_p", "l_xi", "n_v", "n_r")} == {"converged"}
    assert rows["n_v"]["value"] == pytest.approx(0.686, abs=4.0 * rows["n_v"]["standard_error"])
    ran = run(capsys, ["monitor", flight, *call, "--json"])
    assert ran.json["alerts"] == []
    assert ran.err == ""


def vane_in_degrees(values: Values) -> Values:
    values[:, CHANNEL_INDEX["angle_of_attack_rad"]] *= 180.0 / np.pi
    return values


def no_row_whole(values: Values) -> Values:
    values[::2, CHANNEL_INDEX["altitude_m"]] = np.nan
    values[1::2, CHANNEL_INDEX["pitch_rate_rad_s"]] = np.nan
    return values[:20]


def dead_pitot(values: Values) -> Values:
    values[:, CHANNEL_INDEX["airspeed_true_m_s"]] = 0.0
    return values


@pytest.mark.parametrize("command", ["estimate", "monitor"])
@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (slow, "one sample in 1 s is too slow"),
        (single, "too short a flight"),
        (milliseconds, 'time_s = { source = "time_s", unit = "ms" }'),
        (vane_in_degrees, 'angle_of_attack_rad = { source = "angle_of_attack_rad", unit = "deg" }'),
        (dead_pitot, "the airspeed is below 1 m/s in flight"),
    ],
)
def test_nothing_judged_is_no_success(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    command: str,
    spoil: Callable[[Values], Values],
    said: str,
) -> None:
    write_flight(SampleBlock(spoil(demo_block("healthy", 20.0).values.copy())), tmp_path / "flight.csv")
    for options in ([], ["--json"]):
        sentence = run(capsys, [command, tmp_path / "flight.csv", *CALL, *options]).sentence
        assert said in sentence
        assert "flight.csv" in sentence


@pytest.mark.parametrize("spoil", [slow, single])
def test_condition_says_so_too(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, spoil: Callable[[Values], Values]
) -> None:
    write_flight(SampleBlock(spoil(demo_block("healthy", 20.0).values.copy())), tmp_path / "flight.csv")
    assert "nothing could be found out" in run(capsys, ["condition", tmp_path / "flight.csv", *CALL]).sentence


def test_a_dead_pitot_is_no_fault_of_the_program(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    write_flight(SampleBlock(dead_pitot(demo_block("healthy", 20.0).values.copy())), tmp_path / "flight.csv")
    ran = run(capsys, ["condition", tmp_path / "flight.csv", *CALL])
    assert ran.code in (0, 2)
    assert "internal error" not in ran.err


def test_an_absurd_last_stamp_makes_no_flight_of_a_century(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    values = demo_block("healthy", 20.0).values.copy()
    values[-1, 0] = 3.9e9
    write_flight(SampleBlock(values), tmp_path / "flight.csv")
    result = run(capsys, ["monitor", tmp_path / "flight.csv", *CALL, "--json"]).json
    assert result["duration_s"] == pytest.approx(19.96)
    assert len(result["clocks"]) == 1


def test_two_clocks_are_two(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    values = demo_block("healthy", 20.0).values.copy()
    values[:, 0] += 500.0
    values[500:, 0] -= 505.0
    write_flight(SampleBlock(values), tmp_path / "flight.csv")
    ran = run(capsys, ["monitor", tmp_path / "flight.csv", *CALL])
    assert (
        "The file has 2 clocks: the first from 500.0 to 510.0 s (500 samples); the second from 5.0" in ran.out
    )
    result = run(capsys, ["monitor", tmp_path / "flight.csv", *CALL, "--json"]).json
    assert result["duration_s"] == pytest.approx(19.96)
    assert [clock["samples"] for clock in result["clocks"]] == [500, 500]


def test_without_a_rudder_the_roll_is_estimated_and_nothing_said_of_the_rudder(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    block = demo_block("healthy", 40.0)
    write_flight(block, tmp_path / "whole.csv")
    write_flight(without(block, "rudder_rad", "rudder_command_rad"), tmp_path / "wing.csv")
    result = run(capsys, ["estimate", tmp_path / "wing.csv", *CALL, "--json"]).json
    assert result["not_estimated"]["y_zeta, l_zeta, n_zeta"] == "the flight has no rudder"
    for modes in result["estimators"].values():
        rows = modes["lateral"]["derivatives"]
        for symbol in ("y_zeta", "l_zeta", "n_zeta"):
            assert rows[symbol]["outcome"] == "not_observable"
            assert rows[symbol]["value"] is None
        for symbol in ("l_p", "l_xi"):
            row = rows[symbol]
            assert row["outcome"] in ("converged", "settling")
            assert abs(row["value"] - {"l_p": -20.2, "l_xi": -114.7}[symbol]) < 4.0 * row["standard_error"]
        # the demonstration's rudder moves, and nothing says how
        assert {rows[symbol]["outcome"] for symbol in ("n_v", "n_r", "y_v")} <= {"rejected", "not_observable"}
        assert "y derivatives take up what it did" in modes["lateral"]["reason"]
        assert modes["lateral"]["reason"].startswith("the flight has no rudder")
    watched = run(capsys, ["monitor", tmp_path / "wing.csv", *CALL, "--json"]).json
    assert watched["alerts"] == []
    assert "rudder" not in watched["reason"]
    assert not any("rudder" in f"{row['cause']} {row['input']}" for row in watched["could_see"])
    assert run(capsys, ["estimate", tmp_path / "wing.csv", *CALL, "--convention", "american"]).code == 0
    other = run(capsys, ["estimate", tmp_path / "whole.csv", *CALL, "--json"]).json
    assert other["not_estimated"] == {"dutch_roll": "part of the lateral structure"}
