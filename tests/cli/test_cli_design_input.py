"""`design-input`: what it prints and writes, what it refuses, and that it agrees with the parts it is made of."""

import csv
import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
from cli_flights import Ran, run

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, load_aircraft
from wingwatch.cli.arguments import build_parser
from wingwatch.input_design import INPUT_KINDS

BASE = ("design-input", "--aircraft", "aerosonde")
DOUBLET = (*BASE, "--mode", "short_period", "--kind", "doublet")


@pytest.mark.parametrize("kind", INPUT_KINDS)
def test_every_kind_can_be_asked_for(kind: str) -> None:
    arguments = build_parser("0").parse_args([*BASE, "--mode", "dutch_roll", "--kind", kind])
    assert (arguments.kind, arguments.amplitude, arguments.rate, arguments.length) == (kind, 2.0, 50.0, None)


def test_the_result_has_design_promise_response_and_notes(capsys: pytest.CaptureFixture[str]) -> None:
    result = run(capsys, [*DOUBLET, "--json"]).json
    assert (result["aircraft"], result["modes"], result["kind"]) == ("aerosonde", ["short_period"], "doublet")
    # a cycle of the lowest frequency of the file's band, at its cruise
    assert (result["length_s"], result["rate_hz"], result["airspeed_true_m_s"]) == (10.0, 50.0, 25.0)
    elevator = result["surfaces"]["elevator"]
    assert elevator["step_s"] == pytest.approx(2.3 / elevator["natural_frequency_rad_s"], abs=0.01)
    assert elevator["energy_rad2_s"] == pytest.approx(math.radians(2.0) ** 2 * 2.0 * elevator["step_s"])
    assert elevator["band_hz"] == [0.1, 4.0]
    predicted = result["promise"]["short_period"]
    assert list(predicted) == list(SHORT_PERIOD.derivatives)
    assert predicted["m_q"]["unit"] == "1/s"
    assert all(0.0 < row["standard_error"] < abs(row["value"]) for row in predicted.values())
    assert len(result["time_s"]) == len(result["inputs_rad"]["elevator"]) == 500
    u = np.array(result["inputs_rad"]["elevator"])
    spectrum = result["spectrum"]
    mean_square = sum(spectrum["density_rad2_hz"]["elevator"]) / result["length_s"]
    assert mean_square == pytest.approx(np.mean(u**2))
    alpha = result["response"]["short_period"]["angle_of_attack_rad"]
    assert 0.0 < alpha["smallest"] < alpha["largest"] < 0.47
    assert any("signal-to-noise below 10" in note for note in result["notes"])


def test_half_the_amplitude_promises_twice_the_error(capsys: pytest.CaptureFixture[str]) -> None:
    errors = []
    for degrees in ("2", "1"):
        predicted = run(capsys, [*DOUBLET, "--amplitude", degrees, "--json"]).json["promise"]["short_period"]
        errors.append([row["standard_error"] for row in predicted.values()])
    np.testing.assert_allclose(errors[1], 2.0 * np.array(errors[0]), rtol=1e-6)


def test_the_file_is_the_deflections_of_all_surfaces(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "input.csv"
    modes = ("--mode", "short_period", "--mode", "lateral", "--kind", "multisine")
    result = run(capsys, [*BASE, *modes, "--rate", "25", "--out", out, "--json"]).json
    with out.open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["time_s", "elevator_rad", "aileron_rad", "rudder_rad"]
    table = np.array(rows, dtype=np.float64)
    assert table.shape == (250, 4)
    np.testing.assert_array_equal(table[:, 0], result["time_s"])
    for i, name in enumerate(("elevator", "aileron", "rudder")):
        np.testing.assert_array_equal(table[:, i + 1], result["inputs_rad"][name])
    assert list(result["promise"]["lateral"]) == list(LATERAL.derivatives)
    frequencies = [set(s["frequencies_hz"]) for s in result["surfaces"].values()]
    assert not set.intersection(*frequencies)
    assert all(len(f) > 10 for f in frequencies)


def test_condition_and_length_are_those_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--airspeed", "30", "--altitude", "500", "--length", "6")
    result = run(capsys, [*DOUBLET, *options, "--json"]).json
    assert (result["airspeed_true_m_s"], result["altitude_m"], result["length_s"]) == (30.0, 500.0, 6.0)
    slow = run(capsys, [*DOUBLET, "--json"]).json["promise"]["short_period"]
    # rho V^2 makes the elevator stronger
    assert result["promise"]["short_period"]["m_eta"]["value"] < 1.4 * slow["m_eta"]["value"] < 0.0


def test_a_person_reads_errors_response_and_notes(capsys: pytest.CaptureFixture[str]) -> None:
    ran = run(capsys, DOUBLET)
    assert ran.code == 0
    assert all(f"│ {symbol} " in ran.out for symbol in SHORT_PERIOD.derivatives)
    words = (
        "2.3 / omega_n",
        "relative peak factor 0.71",
        "response: angle of attack",
        "note: signal-to-noise",
    )
    assert all(word in ran.out for word in words)


def test_compared_are_all_kinds_at_one_amplitude_and_one_energy(capsys: pytest.CaptureFixture[str]) -> None:
    asked = (*BASE, "--mode", "dutch_roll", "--compare")
    kinds = run(capsys, [*asked, "--json"]).json["kinds"]
    assert list(kinds) == list(INPUT_KINDS)
    errors = {k: v["promise"]["dutch_roll"]["n_zeta"]["standard_error"] for k, v in kinds.items()}
    # more energy where the mode answers tells more
    assert errors["multisine"] < errors["3211"] < errors["doublet"] < errors["impulse"]
    printed = run(capsys, asked).out
    assert "at the same amplitude" in printed
    assert "at the energy of the doublet" in printed
    assert printed.count("n_zeta") == 2


def test_the_plot_is_a_picture(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    picture = tmp_path / "input.png"
    ran = run(capsys, [*DOUBLET, "--plot", picture])
    assert ran.code == 0
    assert picture.read_bytes().startswith(b"\x89PNG\r\n")
    vector = tmp_path / "input.svg"
    assert run(capsys, [*DOUBLET, "--plot", vector]).code == 0
    text = vector.read_text()
    assert "<svg" in text


def test_without_matplotlib_the_plot_is_refused_at_once(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name == "matplotlib" else find(name, *rest)
    )
    out = tmp_path / "input.csv"
    ran = run(capsys, [*DOUBLET, "--plot", tmp_path / "input.png", "--out", out])
    assert "install wingwatch[plot]" in ran.sentence
    assert not out.exists()
    assert run(capsys, DOUBLET).code == 0


def refused(capsys: pytest.CaptureFixture[str], *options: object) -> Ran:
    return run(capsys, ["design-input", *options])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--aircraft", "aerosonde", "--kind", "doublet"), "--mode"),
        (("--aircraft", "aerosonde", "--mode", "short_period"), "--kind is missing"),
        (("--aircraft", "aerosonde", "--mode", "loop", "--kind", "step"), "'loop'"),
        (("--aircraft", "aerosonde", "--mode", "spiral", "--kind", "doublet"), "give --kind step"),
        (
            ("--aircraft", "aerosonde", "--mode", "spiral", "--compare"),
            "--compare: what gives the spiral no bank",
        ),
        (
            ("--aircraft", "aerosonde", "--mode", "spiral", "--mode", "dutch_roll", "--kind", "step"),
            "the rudder",
        ),
        (("--aircraft", "aerosonde", "--mode", "short_period", "--kind", "triplet"), "'triplet'"),
        (
            ("--aircraft", "aerosonde", "--mode", "short_period", "--kind", "3211", "--compare"),
            "leave out --kind",
        ),
        (
            ("--aircraft", "aerosonde", "--mode", "dutch_roll", "--mode", "lateral", "--kind", "step"),
            "both move the rudder",
        ),
        (
            ("--aircraft", "jetstream31", "--mode", "short_period", "--kind", "step"),
            "no noise of angle_of_attack",
        ),
        (
            ("--aircraft", "jetstream31", "--mode", "short_period", "--kind", "step", "--airspeed", "50"),
            "only for 87.4 m/s at 1853 m",
        ),
        (("--aircraft", "jetstream31", "--mode", "lateral", "--kind", "step"), "no derivatives of lateral"),
        (("--aircraft", "nothing", "--mode", "lateral", "--kind", "step"), "nothing"),
    ],
)
def test_bad_usage_is_told_in_one_sentence(
    capsys: pytest.CaptureFixture[str], options: tuple[str, ...], says: str
) -> None:
    assert says in refused(capsys, *options).sentence


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--amplitude", "0"), "--amplitude 0: give more than 0"),
        (("--amplitude", "nan"), "--amplitude nan"),
        (("--length", "0.1"), "more than its 0.1 s of the record"),
        (("--length", "-1"), "length of -1 s"),
        (("--rate", "0"), "rate of 0 Hz"),
        (("--rate", "2"), "shorter than half a sample"),
        (("--airspeed", "5"), "5 m/s"),
        (("--airspeed", "-5"), "airspeed_true_m_s is -5"),
        (("--out", "input.txt"), "is written as .csv"),
        (("--plot", "input.jpg"), "is written as .png, .pdf, .svg"),
        (("--out", "nowhere/input.csv"), "there is no folder nowhere"),
    ],
)
def test_what_cannot_be_designed_is_told_in_one_sentence(
    capsys: pytest.CaptureFixture[str], options: tuple[str, ...], says: str
) -> None:
    assert says in run(capsys, [*DOUBLET, *options]).sentence


def test_the_library_aircraft_with_sensors_all_have_promises(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("aerosonde-a", "twinotter", "ultrastick25e"):
        assert load_aircraft(name).sensors.noise_std
        for mode in ("short_period", "lateral"):
            asked = ("design-input", "--aircraft", name, "--mode", mode, "--kind", "3211", "--json")
            predicted = run(capsys, asked).json["promise"][mode]
            assert all(row["standard_error"] > 0.0 for row in predicted.values()), (name, mode)


def test_widths_are_of_the_mode_as_the_aircraft_flies_it(capsys: pytest.CaptureFixture[str]) -> None:
    result = run(capsys, [*BASE, "--mode", "dutch_roll", "--kind", "doublet", "--json"]).json
    rudder = result["surfaces"]["rudder"]
    # thesis table 7.1: 5.98 rad/s and 0.3846 s; this file's aircraft has 5.71 in six degrees of freedom
    assert rudder["natural_frequency_rad_s"] == pytest.approx(5.71, abs=0.01)
    assert rudder["step_s"] == 0.4
    assert "at 4.21 rad/s in the model of 2 states" in result["notes"][0]


def test_a_spiral_is_banked_and_let_go(capsys: pytest.CaptureFixture[str]) -> None:
    result = run(capsys, [*BASE, "--mode", "spiral", "--kind", "step", "--json"]).json
    row = result["promise"]["spiral"]["phi_zeta"]
    banked_rad = abs(row["value"]) * math.radians(2.0) * result["surfaces"]["rudder"]["step_s"]
    assert math.degrees(banked_rad) == pytest.approx(10.0, abs=0.1)
    assert 0.0 > result["response"]["spiral"]["roll_rad"]["smallest"] > -0.35
    assert any("the bank doubles in 10.4 s" in note for note in result["notes"])
    assert any("--autopilot off" in note for note in result["notes"])


def test_a_phugoid_flown_hands_off_is_estimated_as_promised(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out, flight = tmp_path / "input.csv", tmp_path / "flight.csv"
    design = run(capsys, [*BASE, "--mode", "phugoid", "--kind", "step", "--out", out, "--json"]).json
    flown = ["simulate", "--aircraft", "aerosonde", "--input", out, "--autopilot", "off", "--seconds", "38"]
    assert run(capsys, [*flown, "--seed", "4", "--out", flight, "--json"]).json["autopilot"] == "off"
    asked = [
        "estimate",
        flight,
        "--aircraft",
        "aerosonde",
        "--estimator",
        "output-error",
        "--structure",
        "phugoid",
    ]
    predicted = run(capsys, [*asked, "--json"]).json["estimators"]["output-error"]["phugoid"]["derivatives"]
    for symbol, row in design["promise"]["phugoid"].items():
        assert predicted[symbol]["outcome"] == "converged"
        assert 0.5 < predicted[symbol]["standard_error"] / row["standard_error"] < 2.0
        # the mode's own model leaves out that w and q do not follow at once
        assert abs(predicted[symbol]["value"] / row["value"] - 1.0) < 0.3
