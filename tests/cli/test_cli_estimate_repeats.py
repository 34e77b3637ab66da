"""Repeats of a manoeuvre: their scatter beside the standard errors that each states."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_flights import Ran, run

from wingwatch.diagnosis.repeats import repeated_derivative
from wingwatch.simulation import demo_fleet, parse_effect, simulate
from wingwatch.telemetry import write_flight

SECONDS = 90.0


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Five doublets of the elevator: a healthy aircraft, and one whose elevator loses a quarter after the third."""
    folder = tmp_path_factory.mktemp("flights")
    healthy = next(s for s in demo_fleet() if s.name == "healthy")
    lost = (parse_effect("elevator_effectiveness:0.25@55"),)
    made = {"healthy": replace(healthy, seed=81), "changed": replace(healthy, seed=82, effects=lost)}
    for name, scenario in made.items():
        write_flight(simulate(scenario, SECONDS), folder / f"{name}.parquet")
    return {name: folder / f"{name}.parquet" for name in made}


def repeats(capsys: pytest.CaptureFixture[str], flight: Path, *options: str) -> Ran:
    command = ["estimate", flight, "--aircraft", "aerosonde", "--repeats", "--structure", "short_period"]
    return run(capsys, [*command, *options])


def elevator(result: dict[str, Any]) -> dict[str, Any]:
    (group,) = result["repeats"]
    assert (group["structure"], group["surfaces"]) == ("short_period", ["elevator_rad"])
    assert isinstance(group, dict)
    return group


def test_stated_errors_that_hold_are_not_contradicted(
    flights: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    group = elevator(repeats(capsys, flights["healthy"], "--json").json)
    assert len(group["manoeuvres"]) == 5
    for row in group["derivatives"].values():
        assert not row["contradicts"]
        values = np.array(row["values"])
        assert row["mean"] == pytest.approx(values.mean())
        assert row["scatter"] == pytest.approx(values.std(ddof=1))
        low, high = row["ratio_interval_95"]
        assert low < row["ratio"] < high
    assert group["derivatives"].keys() >= {"z_w", "m_w", "m_q", "m_eta"}
    assert abs(group["derivatives"]["m_eta"]["mean"] + 31.6) < 1.0  # of this aircraft's file
    assert group["text"] == ["The scatter of no derivative contradicts the stated errors."]


def test_a_derivative_that_changes_between_repeats_contradicts_them(
    flights: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    ran = repeats(capsys, flights["changed"])
    assert ran.code == 0
    assert "The scatter of no derivative" not in ran.out
    (sentence,) = [line for line in ran.out.splitlines() if "scatters" in line]
    assert sentence.startswith("m_eta scatters ")
    assert (
        "a change after manoeuvre 7, " in sentence
    )  # the third of the elevator, each followed by two others
    assert sum(" ! " in line for line in ran.out.splitlines()) == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--estimator", "ekf"], "--estimator ekf remembers earlier manoeuvres"),
        (["--save", "x.toml"], "--save x.toml is of one estimate"),
        (["--convention", "british"], "--convention british: repeats are compared in concise derivatives"),
    ],
)
def test_options_that_say_nothing_of_repeats_are_refused(
    capsys: pytest.CaptureFixture[str], options: Sequence[str], said: str
) -> None:
    assert said in repeats(capsys, Path("no.csv"), *options).sentence


def test_the_interval_of_the_ratio_covers_one_where_the_errors_hold() -> None:
    draw = np.random.default_rng(4)
    covered = 0
    for _ in range(400):
        errors = draw.uniform(0.7, 1.4, 6)
        low, high = repeated_derivative((1, 2, 3, 4, 5, 6), draw.normal(3.0, errors), errors).ratio_interval
        covered += low <= 1.0 <= high
    assert abs(covered / 400 - 0.95) < 0.045  # four standard errors of a proportion of 400
