"""Flights whose channels contradict each other: refused with the line, accepted when asked, said by each command."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_flights import demo_block, run
from diagnosis_examples import FOUND
from numpy.typing import NDArray

from wingwatch import diagnosis
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, write_flight

CALL = ["--aircraft", "aerosonde"]
RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
SURFACES = ("elevator_rad", "aileron_rad", "rudder_rad")
WAY_ON = "--accept-implausible"


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    """Sixty seconds with doublets, its rates in deg/s."""
    return written(tmp_path, 180.0 / np.pi, RATES)


def written(folder: Path, factor: float, names: tuple[str, ...]) -> Path:
    values = demo_block("healthy", 60.0).values.copy()
    for name in names:
        values[:, CHANNEL_INDEX[name]] *= factor
    write_flight(SampleBlock(values), folder / "flight.csv")
    return folder / "flight.csv"


def with_held_surfaces() -> NDArray[np.float64]:
    values = demo_block("healthy", 60.0).values.copy()
    for name in SURFACES:
        for channel in (name, name.replace("_rad", "_command_rad")):
            column = values[:, CHANNEL_INDEX[channel]]
            column[:] = np.repeat(column[::5], 5)[: len(column)]
    return values


@pytest.mark.parametrize("command", ["estimate", "monitor", "diagnose"])
def test_rates_in_degrees_are_refused_with_their_lines(
    capsys: pytest.CaptureFixture[str], flight: Path, command: str
) -> None:
    said = run(capsys, [command, flight, *CALL, "--json"]).sentence
    for name in ("roll_rate_rad_s", "yaw_rate_rad_s"):
        assert f'{name} = {{ source = "{name}", unit = "deg/s" }}' in said
    assert WAY_ON in said


@pytest.mark.parametrize("command", ["estimate", "monitor"])
def test_the_lines_that_are_given_mend_the_flight(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, flight: Path, command: str
) -> None:
    lines = "\n".join(f'{name} = {{ source = "{name}", unit = "deg/s" }}' for name in RATES)
    (tmp_path / "map.toml").write_text(f"format = 1\n[channels]\n{lines}\n")
    result = run(capsys, [command, flight, *CALL, "--map", tmp_path / "map.toml", "--json"]).json
    validities = {one["channel"]: one["standing"] for one in result["plausibility"]}
    assert validities["roll_rate_rad_s"] == "right"
    assert set(validities.values()) == {"right"}


@pytest.mark.parametrize("command", ["estimate", "monitor"])
def test_what_is_accepted_is_a_warning(
    capsys: pytest.CaptureFixture[str], flight: Path, command: str
) -> None:
    result: dict[str, Any] = run(capsys, [command, flight, *CALL, WAY_ON, "--json"]).json
    assert {one["standing"] for one in result["plausibility"] if one["check"] == "slope"} == {"refusal"}
    assert (
        "refusal: slope of roll_rad by roll_rate_rad_s" in run(capsys, [command, flight, *CALL, WAY_ON]).out
    )


def test_a_diagnosis_that_goes_on_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Whatever the numerics find, which are handed in."""
    monkeypatch.setattr(diagnosis, "diagnose", lambda *_, **__: FOUND)
    write_flight(SampleBlock(with_held_surfaces()[:1000]), tmp_path / "flight.csv")
    result = run(capsys, ["diagnose", tmp_path / "flight.csv", *CALL, WAY_ON, "--json"]).json
    assert any("10 Hz in a table of 50 Hz" in note for note in result["notes"])
    assert "refusal" in {one["standing"] for one in result["plausibility"]}


def test_one_of_a_folder_is_a_line_with_its_sentence(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, flight: Path
) -> None:
    write_flight(demo_block("healthy", 60.0), tmp_path / "right.csv")
    ran = run(capsys, ["monitor", tmp_path, *CALL, "--jobs", "1", "--json"])
    assert ran.code == 2
    errors = {Path(one["flight"]).name: one.get("error", "") for one in json.loads(ran.out)}
    assert "is in deg/s" in errors["flight.csv"]
    assert errors["right.csv"] == ""


def test_condition_shows_every_channel_and_goes_on(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    flight = written(tmp_path, -1.0, ("specific_force_z_m_s2",))
    ran = run(capsys, ["condition", flight, *CALL, "--json"])
    assert ran.code == 0
    validities = {(one["channel"], one["check"]): one["standing"] for one in ran.json["plausibility"]}
    assert validities["specific_force_z_m_s2", "gravity"] == "refusal"
    assert validities["roll_rate_rad_s", "slope"] == "right"
    assert "scale = -1" in run(capsys, ["condition", flight, *CALL]).out


def test_surfaces_that_are_held_are_thinned_by_the_line_that_is_given(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    write_flight(SampleBlock(with_held_surfaces()), tmp_path / "flight.csv")
    said = run(capsys, ["estimate", tmp_path / "flight.csv", *CALL]).sentence
    assert "10 Hz in a table of 50 Hz" in said
    assert 'write clock = "elevator_rad" into the channel map' in said
    (tmp_path / "map.toml").write_text('format = 1\nclock = "elevator_rad"\n')
    result = run(
        capsys, ["estimate", tmp_path / "flight.csv", *CALL, "--map", tmp_path / "map.toml", "--json"]
    ).json
    assert result["cleaning"]["accepted"] == 600
    rows = result["estimators"]["ekf"]["short_period"]["derivatives"]
    assert rows["m_w"]["value"] == pytest.approx(-3.5, abs=4.0 * rows["m_w"]["standard_error"])


def test_what_earlier_was_a_false_alert_or_silence_is_a_warning(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    values = demo_block("healthy", 60.0).values.copy()
    column = values[:, CHANNEL_INDEX["specific_force_z_m_s2"]]
    rows = slice(1500, 2000)
    column[rows] = np.clip(column[rows] + 25.0 * np.random.default_rng(7).normal(size=500), -16.0, 4.0)
    write_flight(SampleBlock(values), tmp_path / "flight.csv")
    result = run(capsys, ["monitor", tmp_path / "flight.csv", *CALL, "--json"]).json
    (warned,) = [one for one in result["plausibility"] if one["standing"] != "right"]
    assert (warned["check"], warned["channel"]) == ("clipped", "specific_force_z_m_s2")
