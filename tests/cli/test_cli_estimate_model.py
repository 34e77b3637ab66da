"""Derivatives of one flight judged on another, drawn, and written as an aircraft file."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from wingwatch.aircraft import STRUCTURES, Provenance, load_aircraft
from wingwatch.cli.main import main
from wingwatch.simulation import demo_fleet, parse_effect, simulate
from wingwatch.telemetry import write_flight

SECONDS = 60.0


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Two healthy flights, and one with ice from its beginning."""
    folder = tmp_path_factory.mktemp("flights")
    healthy = next(s for s in demo_fleet() if s.name == "healthy")
    made = {
        "first": replace(healthy, seed=71),
        "second": replace(healthy, seed=72),
        "iced": replace(healthy, seed=73, effects=(parse_effect("icing:0.3@0"),)),
    }
    for name, scenario in made.items():
        write_flight(simulate(scenario, SECONDS), folder / f"{name}.parquet")
    return {name: folder / f"{name}.parquet" for name in made}


def estimate(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    assert main(["estimate", *map(str, arguments), "--aircraft", "aerosonde", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert isinstance(result, dict)
    return result


def test_derivatives_are_judged_on_another_flight(
    flights: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    own = estimate(capsys, flights["first"], "--validate", flights["second"])["validation"]
    iced = estimate(capsys, flights["iced"], "--validate", flights["second"])["validation"]
    assert own["flight"] == str(flights["second"])
    assert own["structures"].keys() == {"short_period", "lateral"}
    for structure, channel in (("short_period", "q"), ("lateral", "p"), ("lateral", "r")):
        right, wrong = (one["structures"][structure]["channels"][channel] for one in (own, iced))
        assert right["r_squared"] > 0.98
        assert (
            abs(right["r_squared"] - right["r_squared_expected"]) < 0.01
        )  # this aircraft is as its file says
        assert right["bias"] + right["variance"] + right["covariance"] == pytest.approx(1.0)
        assert 0.8 < right["over_noise"] < 2.0
        assert wrong["r_squared"] < right["r_squared"] - 0.01  # an iced aircraft flies otherwise
        assert wrong["over_noise"] > 1.5 * right["over_noise"]
    assert own["structures"]["short_period"]["manoeuvres"] >= 2


@pytest.mark.parametrize("estimator", ["fourier", "output-error"])
def test_a_saved_model_is_an_aircraft_with_identified_entries(
    flights: dict[str, Path], capsys: pytest.CaptureFixture[str], tmp_path: Path, estimator: str
) -> None:
    path = tmp_path / "heron-7.toml"
    result = estimate(capsys, flights["first"], "--estimator", estimator, "--save", path)
    assert result["saved"] == {"file": str(path), "left_out": []}
    aircraft = load_aircraft(path)
    assert aircraft.name == "heron-7"
    modes = result["estimators"][estimator]
    for name, mode in modes.items():
        (entry,) = aircraft.entries(STRUCTURES[name])
        assert entry.provenance is Provenance.IDENTIFIED
        assert "first.parquet" in entry.source
        assert entry.condition.airspeed_true_m_s == mode["condition"]["airspeed_true_m_s"]
        observed = {
            s: row for s, row in mode["derivatives"].items() if row["outcome"] in ("converged", "settling")
        }
        assert {s: entry.derivatives[s].value for s in observed} == {
            s: row["value"] for s, row in observed.items()
        }
        assert {s: entry.derivatives[s].standard_error for s in observed} == {
            s: row["standard_error"] for s, row in observed.items()
        }
    assert main(["monitor", str(flights["second"]), "--aircraft", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["alerts"] == []


def test_a_flight_that_tells_nothing_writes_no_file(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    quiet = next(s for s in demo_fleet() if s.name == "healthy")
    path, flight = tmp_path / "quiet.toml", tmp_path / "quiet.parquet"
    write_flight(simulate(replace(quiet, manoeuvres=(), turbulence="none"), SECONDS), flight)
    assert main(["estimate", str(flight), "--aircraft", "aerosonde", "--save", str(path)]) == 2
    assert "no structure of the flight could be saved" in capsys.readouterr().err
    assert not path.exists()


def test_the_picture_shows_the_manoeuvres(
    flights: dict[str, Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "fit.svg"
    arguments = ["estimate", str(flights["first"]), "--aircraft", "aerosonde", "--plot", str(path)]
    assert main([*arguments, "--validate", str(flights["second"])]) == 0
    said = capsys.readouterr().out
    assert "judged on" in said
    assert str(path) in said
    drawn = path.read_text(encoding="utf-8")
    assert drawn.lstrip().startswith("<?xml")
    assert drawn.count("axes_") >= 6


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (lambda folder: ["--save", folder / "My Plane.toml"], "is no name of an aircraft"),
        (lambda folder: ["--save", folder / "x.json"], "it is written as .toml"),
        (lambda folder: ["--plot", folder / "x.txt"], "it is written as .png"),
        (lambda folder: ["--validate", folder / "none.csv"], "there is no such file"),
        (lambda folder: ["--save", folder / "no" / "x.toml"], "there is no folder"),
    ],
)
def test_what_cannot_be_done_is_one_sentence(
    flights: dict[str, Path],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    options: Callable[[Path], list[object]],
    says: str,
) -> None:
    more = [str(one) for one in options(tmp_path)]
    assert main(["estimate", str(flights["first"]), "--aircraft", "aerosonde", *more]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_a_folder_takes_none_of_it(flights: dict[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    folder = flights["first"].parent
    assert main(["estimate", str(folder), "--aircraft", "aerosonde", "--save", "x.toml"]) == 2
    assert "is for one flight, and a folder is named" in capsys.readouterr().err
