"""`estimate` with the estimators that take a flight, or several, whole."""

import math
from pathlib import Path

import numpy as np
import pytest
from cli_flights import demo_block, run, with_column, without

from wingwatch.aircraft import MODEL_STRUCTURES, STRUCTURES
from wingwatch.cli.arguments import build_parser
from wingwatch.diagnosis.offline_estimates import OFFLINE_ESTIMATORS
from wingwatch.estimators import FORMS
from wingwatch.telemetry import write_flight

FLIGHT_S = 40.0


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flights") / "healthy.parquet"
    write_flight(demo_block("healthy", FLIGHT_S), path)
    return path


@pytest.mark.parametrize("name", OFFLINE_ESTIMATORS)
def test_an_estimator_of_whole_flights_gives_fit_and_intervals(
    capsys: pytest.CaptureFixture[str], flight: Path, name: str
) -> None:
    command = ["estimate", flight, "--aircraft", "aerosonde", "--estimator", name]
    # the filter takes half a minute for the lateral structure, which the estimators' tests have
    chosen = ("short_period",) if name == "filter-error" else tuple(STRUCTURES)
    command += [word for s in chosen for word in ("--structure", s)]
    result = run(capsys, [*command, "--json"]).json
    assert set(result["estimators"]) == {name}
    modes = result["estimators"][name]
    assert set(modes) == set(chosen)
    for mode, structure in ((modes[s], STRUCTURES[s]) for s in modes):
        assert list(mode["derivatives"]) == list(structure.derivatives)
        fit = mode["fit"]
        for symbol, row in mode["derivatives"].items():
            assert {"value", "standard_error", "unit", "outcome", "expected"} <= set(row)
            if row["value"] is not None:
                low, high = row["interval_95"]
                assert low < row["value"] < high
                assert fit["correlation"][symbol][symbol] == pytest.approx(1.0)
        for channel in fit["channels"].values():
            shares = [channel[share] for share in ("bias", "variance", "covariance")]
            assert sum(shares) == pytest.approx(1.0)
            assert channel["r_squared"] <= 1.0
        assert set(fit["standard_error_coloured"]) == set(structure.derivatives)
        named = {q["mode"] for q in mode["modes"]}
        assert named >= set(structure.oscillations) or name == "frequency-equation-error"
    shown = run(capsys, command).out
    for words in ("95 % interval", "R2", "Theil", "natural frequency"):
        assert words in shown


@pytest.mark.parametrize("structure", list(MODEL_STRUCTURES))
def test_every_structure_can_be_estimated_from_a_flight(
    capsys: pytest.CaptureFixture[str], flight: Path, structure: str
) -> None:
    command = ["estimate", flight, "--aircraft", "aerosonde", "--estimator", "output-error"]
    result = run(capsys, [*command, "--structure", structure, "--json"]).json
    (mode,) = result["estimators"]["output-error"].values()
    assert list(mode["derivatives"]) == list(MODEL_STRUCTURES[structure].derivatives)
    assert result["not_estimated"] == {}
    assert mode["fit"]["samples"] > 0.9 * FLIGHT_S * 50.0


def test_forms_with_angles_are_those_with_velocities(
    capsys: pytest.CaptureFixture[str], flight: Path
) -> None:
    command = ["estimate", flight, "--aircraft", "aerosonde", "--estimator", "equation-error", "--json"]
    chosen = ["--structure", "short_period", "--structure", "short_period_alpha"]
    modes = run(capsys, [*command, *chosen]).json["estimators"]["equation-error"]
    plain, angled = modes["short_period"], modes["short_period_alpha"]
    condition = plain["condition"]
    speed = condition["airspeed_true_m_s"] / math.cos(condition["angle_of_attack_rad"])
    for key in ("value", "standard_error"):
        assert angled["derivatives"]["m_alpha"][key] == pytest.approx(
            speed * plain["derivatives"]["m_w"][key]
        )
        assert angled["derivatives"]["m_q"][key] == pytest.approx(plain["derivatives"]["m_q"][key])
    assert angled["natural_frequency_rad_s"] == pytest.approx(plain["natural_frequency_rad_s"])


@pytest.mark.parametrize("form", FORMS)
def test_forms_of_the_force_equations_agree_within_their_errors(
    capsys: pytest.CaptureFixture[str], flight: Path, form: str
) -> None:
    command = ["estimate", flight, "--aircraft", "aerosonde", "--estimator", "output-error", "--json"]
    result = run(capsys, [*command, "--structure", "short_period", "--form", form]).json
    mode = result["estimators"]["output-error"]["short_period"]
    channels = set(mode["fit"]["channels"])
    assert ("a_z" in channels) == (form != "differentiated")
    assert ("w" in channels) == (form != "reconstructed")
    for symbol in ("z_w", "m_w", "m_q", "m_eta"):
        row = mode["derivatives"][symbol]
        assert abs(row["value"] - row["expected"]) < 6.0 * row["standard_error"] + 0.1 * abs(row["expected"])


def test_reconstruction_needs_no_vane(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "no_vanes.csv"
    write_flight(without(demo_block("healthy", 30.0), "angle_of_attack_rad", "sideslip_rad"), path)
    command = ["estimate", path, "--aircraft", "aerosonde", "--estimator", "frequency-equation-error"]
    result = run(capsys, [*command, "--form", "reconstructed", "--json"]).json
    assert set(result["estimators"]["frequency-equation-error"]) == set(STRUCTURES)
    assert "missing angle_of_attack_rad" in run(capsys, [*command, "--json"]).sentence


def test_two_flights_are_estimated_together(
    capsys: pytest.CaptureFixture[str], flight: Path, tmp_path: Path
) -> None:
    """Information adds; the second flight begins before the first one's end, on a clock of its own."""
    command = ["estimate", "--aircraft", "aerosonde", "--estimator", "output-error", "--json"]
    chosen = ["--structure", "short_period"]
    alone = run(capsys, [*command, *chosen, flight]).json["estimators"]["output-error"]["short_period"]
    block = demo_block("healthy", FLIGHT_S)
    other = tmp_path / "again.parquet"
    write_flight(with_column(block, "time_s", block.time_s - 7.0), other)
    both = run(capsys, [*command, *chosen, flight, other]).json["estimators"]["output-error"]["short_period"]
    assert both["fit"]["manoeuvres"] == 2 * alone["fit"]["manoeuvres"]
    assert both["fit"]["samples"] == 2 * alone["fit"]["samples"]
    for symbol, row in alone["derivatives"].items():
        twice = both["derivatives"][symbol]
        assert twice["value"] == pytest.approx(row["value"], abs=0.05 * row["standard_error"])
    ratios = [
        alone["fit"]["standard_error_white"][s] / both["fit"]["standard_error_white"][s]
        for s in alone["derivatives"]
    ]
    assert np.median(ratios) == pytest.approx(math.sqrt(2.0), rel=0.01)


def test_flights_that_do_not_go_together_are_told(
    capsys: pytest.CaptureFixture[str], flight: Path, tmp_path: Path
) -> None:
    commanded = tmp_path / "commanded.csv"
    write_flight(without(demo_block("healthy", 20.0), "elevator_rad"), commanded)
    command = ["estimate", flight, commanded, "--aircraft", "aerosonde", "--estimator", "output-error"]
    assert "elevator_rad is a position in" in run(capsys, command).sentence


def test_options_of_whole_flights_are_refused_to_the_live_estimators(
    capsys: pytest.CaptureFixture[str], flight: Path, tmp_path: Path
) -> None:
    command = ["estimate", flight, "--aircraft", "aerosonde"]
    assert "--structure is for" in run(capsys, [*command, "--structure", "roll"]).sentence
    assert "--form is for" in run(capsys, [*command, "--form", "differentiated"]).sentence
    history = [*command, "--estimator", "output-error", "--history", tmp_path / "h.csv"]
    assert "has no history" in run(capsys, history).sentence


def test_the_parser_knows_every_structure() -> None:
    for name in MODEL_STRUCTURES:
        given = build_parser("0").parse_args(["estimate", "f", "--aircraft", "a", "--structure", name])
        assert given.structure == [name]
