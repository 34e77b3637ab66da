"""`simulate`: its file, its truth, its refusals, and the way of a flight through `estimate` and `monitor`."""

import argparse
import json
import math
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from cli_flights import run
from numpy.typing import NDArray

from wingwatch.aircraft import STRUCTURES, FlightCondition, load_aircraft
from wingwatch.cli import simulate_command
from wingwatch.cli.arguments import build_parser
from wingwatch.simulation import (
    FleetSimulation,
    Scenario,
    Turbulence,
    TurbulenceModel,
    doublet_schedule,
    simulate,
)
from wingwatch.telemetry import load_flight

AEROSONDE = ("simulate", "--aircraft", "aerosonde")


def test_a_flight_is_that_of_the_simulation_to_the_bit(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    aircraft = load_aircraft("aerosonde")
    doublets = (doublet_schedule(aircraft, FlightCondition(25.0, 1000.0)),)
    wanted = simulate(Scenario(aircraft, manoeuvres=doublets, turbulence="light", seed=3), 12.0, 25.0)
    for name in ("flight.csv", "flight.parquet"):
        out = tmp_path / name
        options = (
            "--seconds",
            12,
            "--rate",
            25,
            "--turbulence",
            "light",
            "--seed",
            3,
            "--out",
            out,
            "--json",
        )
        result = run(capsys, [*AEROSONDE, *options]).json
        assert (result["flight"], result["samples"], result["duration_s"]) == (str(out), 300, 12.0)
        assert (result["truth"], result["effects"], result["manoeuvres"]) == (None, [], ["doublet"])
        assert result["lost"] is False
        block = load_flight(out).block
        for column in wanted.present:
            np.testing.assert_array_equal(block.column(column), wanted.column(column), err_msg=column)


def test_the_truth_tells_trim_derivatives_windows_and_effects(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out, truth = tmp_path / "flight.parquet", tmp_path / "truth.json"
    effects = ("--effect", "icing:0.1@10+10", "--effect", "sensor_bias[pitch_rate_rad_s]:0.01@5")
    result = run(
        capsys, [*AEROSONDE, "--seconds", 40, *effects, "--out", out, "--truth", truth, "--json"]
    ).json
    assert [e["text"] for e in result["effects"]] == [
        "icing:0.1@10+10",
        "sensor_bias[pitch_rate_rad_s]:0.01@5",
    ]
    assert result["truth"] == str(truth)
    said: dict[str, Any] = json.loads(truth.read_text())
    assert said["seconds"] == 40.0
    assert len(said["windows"]) == 4
    assert said["trim"]["elevator_rad"] < 0.0
    before, after = (said[when]["derivatives"] for when in ("before", "after"))
    assert set(before) == set(STRUCTURES)
    # the published factor of the lift slope is -1.481 at severity 1 (wingwatch.aircraft.ICING_FACTORS)
    assert after["short_period"]["z_w"] / before["short_period"]["z_w"] == pytest.approx(
        1.0 - 0.148, abs=0.04
    )
    assert {e["name"]: e["size"] for e in said["windows"][-1]["effects"]} == {
        "icing": 0.1,
        "sensor_bias": 0.01,
    }


def test_an_estimate_of_a_simulated_flight_finds_its_truth(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out, truth = tmp_path / "flight.parquet", tmp_path / "truth.json"
    options = ("--seconds", 60, "--manoeuvre", "multisine", "--seed", 5)
    run(capsys, [*AEROSONDE, *options, "--out", out, "--truth", truth])
    derivatives = json.loads(truth.read_text())["before"]["derivatives"]["short_period"]
    found = run(capsys, ["estimate", out, "--aircraft", "aerosonde", "--json"]).json["estimators"]["ekf"]
    for symbol in ("z_w", "m_w", "m_eta"):
        row = found["short_period"]["derivatives"][symbol]
        assert row["outcome"] == "converged"
        # vanes and surfaces read between their samples and held commands: within 5 %, far above the stated error
        assert row["value"] == pytest.approx(derivatives[symbol], rel=0.05)
    watched = run(capsys, ["monitor", out, "--aircraft", "aerosonde", "--json"]).json
    assert watched["alerts"] == []
    assert watched["status"] == "healthy"


def test_a_patrol_turns_and_may_carry_doublets(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "patrol.parquet"
    options = ("--seconds", 60, "--wind", "5@270", "--noiseless", "--out", out, "--json")
    patrol = ("--manoeuvre", "patrol")
    plain = run(capsys, [*AEROSONDE, *patrol, *options]).json
    assert plain["manoeuvres"] == ["patrol"]
    assert plain["wind_m_s"] == pytest.approx([0.0, 5.0, 0.0], abs=1e-15)
    block = load_flight(out).block
    assert np.ptp(block.column("heading_rad")) > math.radians(80.0)
    assert np.ptp(block.column("rudder_command_rad")) == 0.0
    both = run(capsys, [*AEROSONDE, *patrol, "--manoeuvre", "doublet", *options]).json
    assert both["manoeuvres"] == ["patrol", "doublet"]
    assert np.ptp(load_flight(out).block.column("rudder_command_rad")) == pytest.approx(
        2.0 * math.radians(2.0)
    )


@pytest.mark.parametrize("manoeuvre", ["3211", "multisine", "none"])
def test_each_manoeuvre_moves_what_it_should(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, manoeuvre: str
) -> None:
    out = tmp_path / "flight.parquet"
    arguments = [*AEROSONDE, "--seconds", 30, "--manoeuvre", manoeuvre, "--noiseless", "--out", out, "--json"]
    result = run(capsys, arguments).json
    moves = np.ptp(load_flight(out).block.column("rudder_command_rad"))
    assert (moves > 0.05) == (manoeuvre != "none")
    assert set(result["relative_peak_factors"]) == (
        {"elevator", "aileron", "rudder"} if manoeuvre == "multisine" else set()
    )


def test_people_read_what_was_flown(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out, truth = tmp_path / "flight.csv", tmp_path / "truth.json"
    arguments = ["simulate", "--aircraft", "ultrastick25e", "--seconds", 2, "--out", out, "--truth", truth]
    ran = run(capsys, [*arguments, "--manoeuvre", "multisine", "--effect", "icing[tail]:0.1@1"])
    assert (ran.code, ran.err) == (0, "")
    for words in ("100 samples", "ultrastick25e at 17 m/s and 300 m", "icing[tail]:0.1@1", "peak factors"):
        assert words in ran.out
    assert "truth in" in ran.out


def test_a_flight_that_is_lost_ends_there_and_says_so(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Tumbling(FleetSimulation):
        """Leaves all numbers behind after 12 s."""

        def step(self, n_samples: int) -> NDArray[np.float64]:
            first = round(self.time_s * self.rate_hz)
            values = super().step(n_samples)
            values[:, max(0, 600 - first) :, 1:] = np.nan
            return values

    monkeypatch.setattr(simulate_command, "FleetSimulation", Tumbling)
    out, truth = tmp_path / "lost.parquet", tmp_path / "truth.json"
    command = [*AEROSONDE, "--seconds", 60, "--out", out, "--truth", truth]
    result = run(capsys, [*command, "--json"]).json
    assert (result["lost"], result["samples"], result["duration_s"]) == (True, 600, 12.0)
    block = load_flight(out).block
    assert len(block) == 600
    assert np.isfinite(block.column("pitch_demand_rad")).all()
    assert json.loads(truth.read_text())["seconds"] == 12.0
    assert "lost: after 12 s" in run(capsys, command).out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--aircraft", "concorde"), "concorde"),
        (("--aircraft", "jetstream31"), "--airspeed and --altitude"),
        (("--aircraft", "jetstream31", "--airspeed", 90, "--altitude", 1000), "[coefficients]"),
        (("--airspeed", 60), "60 m/s"),
        (("--airspeed", "nan"), "airspeed_true_m_s is nan"),
        (("--altitude", 19_000), "no level trim"),
        (("--seconds", 0), "--seconds 0"),
        (("--seconds", "inf"), "--seconds inf"),
        (("--seconds", 1e7), "at most 2000000"),
        (("--rate", 0.5), "--rate 0.5"),
        (("--seed", -1), "seed is -1"),
        (("--wind", "5"), "SPEED@FROM_DEG"),
        (("--wind=-5@90",), "SPEED@FROM_DEG"),
        (("--manoeuvre", "loop"), "'loop'"),
        (("--manoeuvre", "none", "--manoeuvre", "doublet"), "none beside doublet"),
        (("--effect", "rust:0.1@5"), "icing"),
        (("--effect", "icing:0.1"), "no start"),
        (("--effect", "icing:7@5"), "icing has size 7.0"),
        (("--out", "flight.mat"), ".csv or .parquet"),
        (("--out", "nowhere/flight.csv"), "no folder nowhere"),
        (("--truth", "nowhere/truth.json"), "no folder nowhere"),
        (("--truth", "flight.csv"), "own file"),
    ],
)
def test_what_cannot_be_flown_is_told_in_one_sentence(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: tuple[object, ...],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    given = [*AEROSONDE, "--seconds", 5, "--out", "flight.csv", *options]
    assert words in run(capsys, given).sentence
    assert list(tmp_path.iterdir()) == []


def test_the_choices_are_those_of_the_simulation() -> None:
    (commands,) = (a for a in build_parser("0")._actions if isinstance(a, argparse._SubParsersAction))
    choices = {a.dest: a.choices for a in commands.choices["simulate"]._actions}
    assert choices["turbulence"] == get_args(Turbulence)
    assert choices["turbulence_model"] == get_args(TurbulenceModel)
