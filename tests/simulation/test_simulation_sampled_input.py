"""Inputs given by their samples: flown as they are, designed or recorded."""

import json
from pathlib import Path

import numpy as np
import pytest

from wingwatch.cli.main import main
from wingwatch.simulation import Sampled
from wingwatch.simulation.manoeuvres import excitation, excitation_rows
from wingwatch.telemetry import SampleBlock, load_flight, read_table, write_flight

STEP_S = 0.02


def flown(manoeuvre: Sampled, times_s: np.ndarray) -> np.ndarray:
    rows = excitation_rows([manoeuvre])
    out = np.zeros(3)
    made = []
    for at_s in times_s:
        excitation(rows, len(rows), at_s, out)
        made.append(out.copy())
    return np.array(made)


def test_each_sample_is_held_until_the_next() -> None:
    draw = np.random.default_rng(3)
    values = np.repeat(draw.uniform(-0.1, 0.1, 40), draw.integers(1, 5, 40))
    values[10:14] = 0.0
    times = STEP_S * np.arange(len(values))
    one = Sampled("aileron", tuple(times.tolist()), tuple(values.tolist()), STEP_S)
    asked = np.concatenate([times + 0.3 * STEP_S, [times[-1] + 1.5 * STEP_S]])
    found = flown(one, asked)
    np.testing.assert_array_equal(found[:-1, 1], values)
    np.testing.assert_array_equal(found[:, [0, 2]], 0.0)
    assert found[-1, 1] == 0.0  # after its end the surface is the autopilot's alone
    assert len(one.rows()) < len(values) / 4


@pytest.mark.parametrize(
    ("times", "values", "says"),
    [
        ((0.0, 0.1), (0.1,), "give one deflection a time"),
        ((0.0, 0.0), (0.1, 0.2), "do not ascend"),
        ((0.0, 0.1), (0.1, float("nan")), "less than pi/2"),
        ((0.0, 0.1), (0.1, 2.0), "less than pi/2"),
    ],
)
def test_what_cannot_be_flown_says_so(times: tuple[float, ...], values: tuple[float, ...], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Sampled("rudder", times, values, STEP_S)


@pytest.mark.parametrize("kind", ["logarithmic-sweep", "impulse", "1123"])
def test_every_designed_input_can_be_flown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    designed, out = tmp_path / "input.csv", tmp_path / "flight.parquet"
    design = [
        "design-input",
        "--aircraft",
        "aerosonde",
        "--mode",
        "short_period",
        "--kind",
        kind,
    ]
    assert main([*design, "--out", str(designed)]) == 0
    flight = [
        "simulate",
        "--aircraft",
        "aerosonde",
        "--input",
        str(designed),
        "--out",
        str(out),
        "--noiseless",
    ]
    capsys.readouterr()
    assert main([*flight, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["input"] == str(designed)
    assert result["manoeuvres"] == []
    wanted = read_table(designed).columns
    table = load_flight(out).block
    without = tmp_path / "without.parquet"
    plain = ["simulate", "--aircraft", "aerosonde", "--manoeuvre", "none", "--out", str(without)]
    assert main([*plain, "--noiseless"]) == 0
    added = table.column("elevator_command_rad")[:3000] - load_flight(without).block.column(
        "elevator_command_rad"
    )
    first = int(np.flatnonzero(wanted["elevator_rad"])[0])
    row = int(np.searchsorted(table.time_s - table.time_s[0], wanted["time_s"][first] - 1e-9))
    np.testing.assert_array_equal(added[:row], 0.0)
    assert added[row] == pytest.approx(
        wanted["elevator_rad"][first], rel=1e-6
    )  # before the autopilot answers
    assert result["duration_s"] >= max(60.0, wanted["time_s"][-1] + 9.0)


def test_the_surfaces_of_a_recorded_flight_are_flown_about_their_trim(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    times = STEP_S * np.arange(1000)
    elevator = -0.08 + np.where((times > 5.0) & (times < 6.0), 0.03, 0.0)
    path, out = tmp_path / "recorded.csv", tmp_path / "flight.csv"
    block = SampleBlock.from_columns(
        {"time_s": 100.0 + times, "airspeed_true_m_s": np.full(1000, 25.0), "elevator_rad": elevator}
    )
    write_flight(block, path)
    arguments = ["--aircraft", "aerosonde", "--input", str(path), "--out", str(out), "--seconds", "20"]
    assert main(["simulate", *arguments, "--noiseless"]) == 0
    flight = load_flight(out).block
    command = flight.column("elevator_command_rad")
    before, during = command[200:240].mean(), command[252:256].mean()
    assert during - before == pytest.approx(0.03, abs=0.01)
    assert abs(before - flight.column("elevator_command_rad")[0]) < 0.005  # the flight's own trim


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t,elevator_rad\n0,0\n1,0.1\n", "it has no column time_s"),
        ("time_s,flap_rad\n0,0\n1,0.1\n", "it moves no surface"),
        ("time_s,elevator_rad\n0,0\n1,5\n", "less than pi/2"),
        ("time_s,elevator_rad\n0,0\n0,0.1\n", "do not ascend"),
    ],
)
def test_a_file_that_is_no_input_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, says: str
) -> None:
    path = tmp_path / "input.csv"
    path.write_text(text)
    arguments = ["--aircraft", "aerosonde", "--input", str(path), "--out", str(tmp_path / "out.csv")]
    assert main(["simulate", *arguments]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
