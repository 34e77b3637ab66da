"""``--convention``: the same derivatives in other words, on every command that prints some."""

from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from cli_flights import demo_block, run

from wingwatch.aircraft import (
    MODEL_STRUCTURES,
    Convention,
    FlightCondition,
    convert,
    convert_standard_errors,
    display_name,
    load_aircraft,
    unit,
)
from wingwatch.cli.arguments import build_parser
from wingwatch.telemetry import write_flight

AEROSONDE = load_aircraft("aerosonde")
SECONDS = 40.0


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flights") / "healthy.parquet"
    write_flight(demo_block("healthy", SECONDS), path)
    return path


def converted(name: str, mode: dict[str, Any], key: str, target: Convention) -> dict[str, float]:
    """One column of a concise mode as ``wingwatch.aircraft`` converts it."""
    change = convert_standard_errors if key.endswith("standard_error") else convert
    values = {symbol: row[key] for symbol, row in mode["derivatives"].items()}
    at = FlightCondition(**mode["condition"])
    return change(
        values, aircraft=AEROSONDE, condition=at, structure=MODEL_STRUCTURES[name],
        source=Convention.CONCISE, target=target,
    )  # fmt: skip


def test_the_words_are_those_of_rest() -> None:
    parser = build_parser("0")
    commands = {
        "estimate": ["f.csv", "--aircraft", "a"],
        "monitor": ["f.csv", "--aircraft", "a"],
        "design-input": ["--aircraft", "a", "--mode", "lateral"],
    }
    for command, rest in commands.items():
        assert parser.parse_args([command, *rest]).convention == "concise"
        for convention in Convention:
            asked = parser.parse_args([command, *rest, "--convention", str(convention)])
            assert asked.convention == str(convention)
        with pytest.raises(SystemExit):
            parser.parse_args([command, *rest, "--convention", "french"])


@pytest.mark.parametrize("target", [Convention.DIMENSIONAL, Convention.AMERICAN])
def test_estimates_and_their_history(
    capsys: pytest.CaptureFixture[str], flight: Path, tmp_path: Path, target: Convention
) -> None:
    command = ["estimate", flight, "--aircraft", "aerosonde", "--json"]
    concise = run(capsys, command).json
    history = tmp_path / "h.parquet"
    result = run(capsys, [*command, "--convention", str(target), "--history", history]).json
    assert (concise["convention"], result["convention"]) == ("concise", str(target))
    for estimator, modes in concise["estimators"].items():
        for name, mode in modes.items():
            shown = result["estimators"][estimator][name]
            for key in ("value", "standard_error", "expected", "expected_standard_error"):
                wanted = converted(name, mode, key, target)
                assert {s: row[key] for s, row in shown["derivatives"].items()} == wanted
            for symbol, row in shown["derivatives"].items():
                assert (row["unit"], row["name"]) == (unit(symbol, target), display_name(symbol, target))
            assert shown["natural_frequency_rad_s"] == mode["natural_frequency_rad_s"]
    rows = pq.read_table(history).to_pylist()
    last = [r for r in rows if r["time_s"] == rows[-1]["time_s"] and r["estimator"] == "fourier"]
    assert len(last) == 6 + 15
    for row in last:
        now = result["estimators"]["fourier"][row["structure"]]["derivatives"][row["derivative"]]
        assert row["value"] == pytest.approx(now["value"], rel=1e-12)
        assert row["expected"] == pytest.approx(now["expected"], rel=1e-12)
        assert row["unit"] == now["unit"]
    shown_to_people = run(
        capsys, ["estimate", flight, "--aircraft", "aerosonde", "--convention", str(target)]
    ).out
    assert f" {display_name('m_q', target)} " in shown_to_people
    assert " m_q " not in shown_to_people


def test_a_whole_flights_interval_keeps_its_width(capsys: pytest.CaptureFixture[str], flight: Path) -> None:
    command = ["estimate", flight, "--aircraft", "aerosonde", "--json", "--estimator", "equation-error"]
    structure = ["--structure", "short_period"]
    concise, british = (
        run(capsys, [*command, *structure, "--convention", c]).json["estimators"]["equation-error"][
            "short_period"
        ]
        for c in ("concise", "british")
    )
    assert british["fit"] == concise["fit"]
    values = converted("short_period", concise, "value", Convention.BRITISH)
    for symbol, row in british["derivatives"].items():
        before = concise["derivatives"][symbol]
        low, high = row["interval_95"]
        assert 0.5 * (low + high) == pytest.approx(values[symbol], rel=1e-9)
        scale = row["standard_error"] / before["standard_error"]
        assert high - low == pytest.approx(
            scale * (before["interval_95"][1] - before["interval_95"][0]), rel=1e-9
        )


def test_evidence_of_an_alert(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "elevator.parquet"
    write_flight(demo_block("elevator", 130.0), path)
    command = ["monitor", path, "--aircraft", "aerosonde", "--json"]
    concise = run(capsys, command).json
    newtons = run(capsys, [*command, "--convention", "dimensional"]).json
    assert newtons["convention"] == "dimensional"
    (before,), (after,) = concise["alerts"], newtons["alerts"]
    assert {k: v for k, v in after.items() if k != "evidence"} == {
        k: v for k, v in before.items() if k != "evidence"
    }
    mass = AEROSONDE.need_mass("the test")
    by_row = {"z": mass.mass_kg, "m": mass.inertia_y_kg_m2}
    seen = 0
    for a, b in zip(before["evidence"], after["evidence"], strict=True):
        assert (a["derivative"], a["z"]) == (b["derivative"], b["z"])
        if a["derivative"] in ("z_w", "z_eta", "m_w", "m_q", "m_eta"):
            scale = by_row[a["derivative"][0]]
            for key in ("estimate", "standard_error", "expected", "expected_standard_error"):
                assert b[key] == pytest.approx(scale * a[key], rel=1e-9)
            assert b["unit"] == unit(a["derivative"], Convention.DIMENSIONAL)
            assert b["name"] == a["derivative"].capitalize()
            seen += 1
    assert seen >= 2
    for_people = run(capsys, ["monitor", path, "--aircraft", "aerosonde", "--convention", "american"]).out
    assert " Cm_de " in for_people
    assert " m_eta " not in for_people


def test_promised_errors(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["design-input", "--aircraft", "aerosonde", "--mode", "lateral", "--kind", "doublet"]
    concise, american = (
        run(capsys, [*command, "--json", "--convention", c]).json["promise"]["lateral"]
        for c in ("concise", "american")
    )
    assert american["y_v"]["name"] == "CY_beta"
    assert american["y_v"]["unit"] == ""
    ratio = american["y_v"]["value"] / concise["y_v"]["value"]
    assert american["y_v"]["standard_error"] == pytest.approx(
        ratio * concise["y_v"]["standard_error"], rel=1e-12
    )
    c = AEROSONDE.need_coefficients("the test")
    assert american["l_p"]["value"] == pytest.approx(
        c.Cl.p, rel=0.02
    )  # body axes, and roll moves w by sin(alpha)
    assert " Cl_p " in run(capsys, [*command, "--convention", "american"]).out
    compared = ["design-input", "--aircraft", "aerosonde", "--mode", "lateral", "--compare"]
    assert " Cl_p " in run(capsys, [*compared, "--convention", "american"]).out


def test_what_the_file_does_not_say_is_refused(capsys: pytest.CaptureFixture[str], flight: Path) -> None:
    for command in (
        ["estimate", flight, "--aircraft", "jetstream31"],
        ["monitor", flight, "--aircraft", "jetstream31"],
        ["design-input", "--aircraft", "jetstream31", "--mode", "short_period", "--kind", "doublet"],
    ):
        sentence = run(capsys, [*command, "--convention", "american"]).sentence
        assert "--convention american: aircraft jetstream31 states no [" in sentence
