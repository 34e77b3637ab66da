"""`monitor --manoeuvres`: what each manoeuvre taught, what was poor in it, and what would help."""

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_flights import run
from numpy.typing import NDArray

RATE_HZ = 50


def doublets(seconds: float, *steps: tuple[float, float, float]) -> NDArray[np.float64]:
    """Deflection in rad: of each (start in s, width of one step in s, degrees) a doublet."""
    u = np.zeros(round(seconds * RATE_HZ))
    for start_s, width_s, degrees in steps:
        at, width = round(start_s * RATE_HZ), round(width_s * RATE_HZ)
        u[at : at + width] = math.radians(degrees)
        u[at + width : at + 2 * width] = -math.radians(degrees)
    return u


def flown(
    capsys: pytest.CaptureFixture[str], folder: Path, *more: str, **surfaces: NDArray[np.float64]
) -> Path:
    """A flight with these deflections from trim, by `simulate --input`."""
    inputs, out = folder / "input.csv", folder / "flight.parquet"
    with inputs.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time_s", *(f"{name}_rad" for name in surfaces)])
        for k, values in enumerate(zip(*surfaces.values(), strict=True)):
            rows.writerow([k / RATE_HZ, *values])
    seconds = len(next(iter(surfaces.values()))) / RATE_HZ
    command = ["simulate", "--aircraft", "aerosonde", "--seconds", seconds, "--input", inputs, "--seed", 1]
    assert run(capsys, [*command, *more, "--out", out]).code == 0
    return out


def judged(capsys: pytest.CaptureFixture[str], flight: Path) -> list[dict[str, Any]]:
    found = run(capsys, ["monitor", flight, "--aircraft", "aerosonde", "--manoeuvres", "--json"]).json
    manoeuvres: list[dict[str, Any]] = found["manoeuvres"]
    return manoeuvres


def test_a_good_doublet_a_slow_and_a_fast_one(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    elevator = doublets(28.0, (10.0, 0.2, 2.0), (15.0, 1.6, 2.0), (22.0, 0.04, 2.0))
    flight = flown(capsys, tmp_path, elevator=elevator)
    good, slow, fast = judged(capsys, flight)
    assert (good["number"], good["good"], good["poor"], good["inputs"]) == (1, True, [], [])
    assert good["begin_s"] == pytest.approx(10.0, abs=0.1)
    learned = {(one["estimator"], one["derivative"]): one for one in good["learned"]}
    assert {name for _, name in learned} == {"z_w", "z_q", "z_eta", "m_w", "m_q", "m_eta"}
    assert all(one["standard_error_after"] < one["standard_error_before"] for one in learned.values())
    assert learned["ekf", "m_q"]["unit"] == "1/s"
    assert [one["what"] for one in slow["poor"]] == ["too_slow"]
    assert {one["what"] for one in fast["poor"]} == {"too_small", "too_fast"}
    for one in (slow, fast):
        (help_,) = one["inputs"]
        assert (help_["surface"], help_["shape"]) == ("elevator_rad", "doublet")
        assert help_["width_s"] == pytest.approx(2.3 / 11.0, rel=0.25), (
            "2.3 over the short period's frequency"
        )
    for one in (good, slow, fast):
        assert 0.0 < one["known_s"] - one["end_s"] <= 2.0, "there and then"
    text = run(capsys, ["monitor", flight, "--aircraft", "aerosonde", "--manoeuvres"]).out
    assert "Good. 6 of 6 derivatives are known better" in text
    assert "Too slow: " in text
    assert "would help" in text


def test_two_surfaces_that_move_alike_and_one_that_hardly_moves(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    lateral = doublets(20.0, (5.0, 0.3, 6.0))
    flight = flown(
        capsys, tmp_path, aileron=lateral, rudder=lateral, elevator=doublets(20.0, (14.0, 0.2, 0.3))
    )
    alike, small = judged(capsys, flight)
    assert [one["what"] for one in alike["poor"]] == ["correlated_inputs"]
    assert {one["surface"] for one in alike["inputs"]} == {"aileron_rad", "rudder_rad"}
    assert "one after the other" in alike["text"]
    assert [one["what"] for one in small["poor"]] == ["too_small"]
    assert small["inputs"][0]["amplitude_rad"] > 2.0 * small["surfaces"]["elevator_rad"], (
        "as much more as is missing"
    )


def test_rough_air_is_said_and_a_manoeuvre_that_the_end_cuts_is_judged(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    flight = flown(
        capsys,
        tmp_path,
        "--turbulence",
        "moderate",
        elevator=doublets(25.0, (5.0, 0.2, 2.0), (24.5, 0.2, 2.0)),
    )
    last = judged(capsys, flight)[-1]
    assert "rough_air" in [one["what"] for one in last["poor"]]
    assert last["known_s"] == pytest.approx(25.0, abs=0.5), "movement went on until the end"


def test_a_flight_without_movement_has_no_manoeuvre(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    flight = flown(capsys, tmp_path, elevator=doublets(10.0))
    result = run(capsys, ["monitor", flight, "--aircraft", "aerosonde", "--manoeuvres"])
    assert "No manoeuvre" in result.out
    assert "manoeuvres" not in run(capsys, ["monitor", flight, "--aircraft", "aerosonde", "--json"]).json
