"""`condition`: what it finds in a simulated flight, what it writes, and its refusals."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_flights import run, without

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.simulation import (
    Route,
    Scenario,
    SensorDelay,
    SensorErrors,
    Waypoint,
    doublet_schedule,
    patrol,
    simulate,
)
from wingwatch.telemetry import SampleBlock, load_flight, write_flight

BIAS_RAD_S, DELAY_S = 0.01, 0.06
ALPHA = "angle_of_attack_rad"
FORCES = ("specific_force_x_m_s2", "specific_force_y_m_s2", "specific_force_z_m_s2")


@pytest.fixture(scope="module")
def flown() -> SampleBlock:
    aircraft, cruise = load_aircraft("aerosonde"), FlightCondition(25.0, 1000.0)
    scenario = Scenario(
        aircraft,
        manoeuvres=(doublet_schedule(aircraft, cruise),),
        route=patrol(aircraft, cruise),
        effects=(SensorDelay(DELAY_S, target=ALPHA),),
        sensor_errors=SensorErrors(bias={"pitch_rate_rad_s": BIAS_RAD_S}),
        seed=4,
    )
    return simulate(scenario, 60.0)


def by_name(rows: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {row["name"]: row for row in rows}


def test_injected_errors_are_found_and_taken_out(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, flown: SampleBlock
) -> None:
    source, out = tmp_path / "flight.parquet", tmp_path / "corrected.parquet"
    write_flight(flown, source)
    result = run(capsys, ["condition", source, "--aircraft", "aerosonde", "--out", out, "--json"]).json
    delay = next(row for row in result["delays"] if row["channel"] == ALPHA)
    assert abs(delay["value"] - DELAY_S) < 4.0 * delay["standard_error"] < 0.04
    assert delay["stated_s"] == 0.0
    assert delay["used_s"] == delay["value"]
    bias = by_name(result["sensors"])["bias of pitch_rate_rad_s"]
    assert bias["observable"]
    assert abs(bias["value"] - BIAS_RAD_S) < 4.0 * bias["standard_error"] < 0.002
    assert result["air"]["fit_for_estimating"] is True
    assert result["out"] == str(out)
    corrected = load_flight(out).block
    change = flown.column("pitch_rate_rad_s") - corrected.column("pitch_rate_rad_s")
    np.testing.assert_allclose(change, bias["value"], atol=1e-12)
    late = np.interp(flown.time_s + delay["value"], flown.time_s, flown.column(ALPHA))
    errors = by_name(result["sensors"])
    pair = errors[f"bias of {ALPHA}"], errors[f"scale of {ALPHA}"]
    offset, scale = (row["value"] if row["observable"] else 0.0 for row in pair)
    kept = np.isfinite(corrected.column(ALPHA))
    assert kept.sum() > len(flown) - 10
    np.testing.assert_allclose(
        corrected.column(ALPHA)[kept], ((late - offset) / (1.0 + scale))[kept], atol=1e-9
    )


def test_what_a_flight_cannot_tell_is_said_and_the_rest_is_given(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, flown: SampleBlock
) -> None:
    source = tmp_path / "no_vanes.csv"
    write_flight(without(SampleBlock(flown.values[:1000]), ALPHA, "sideslip_rad"), source)
    shown = run(capsys, ["condition", source, "--aircraft", "aerosonde"])
    assert shown.code == 0
    assert "turbulence needs a vane" in shown.out
    assert "bias of pitch_rate_rad_s" in shown.out
    assert "scale of angle_of_attack_rad" not in shown.out


@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("x.txt", "choose one of these suffixes"),
        ("absent/x.csv", "create it"),
        ("flight.csv", "another name"),
    ],
)
def test_a_table_that_could_not_be_written_is_refused_first(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, flown: SampleBlock, out: str, said: str
) -> None:
    source = tmp_path / "flight.csv"
    write_flight(SampleBlock(flown.values[:10]), source)
    assert (
        said
        in run(
            capsys, ["condition", source, "--aircraft", "aerosonde", "--out", tmp_path / out, "--json"]
        ).sentence
    )


SECOND_M = (0.31, 0.12, -0.06)
"""Place of a second triad; the first is at the centre of gravity."""


def test_a_second_triad_tells_its_place_and_the_centre(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, flown: SampleBlock
) -> None:
    aircraft, cruise = load_aircraft("aerosonde"), FlightCondition(25.0, 1000.0)
    sensors = aircraft.sensors.model_copy(update={"imu_position_m": SECOND_M})
    scenario = Scenario(
        aircraft.model_copy(update={"sensors": sensors}),
        manoeuvres=(doublet_schedule(aircraft, cruise),),
        route=patrol(aircraft, cruise),
        seed=4,
    )
    first, second = (simulate(s, 60.0) for s in (replace(scenario, aircraft=aircraft), scenario))
    rng = np.random.default_rng(5)
    other = np.stack([second.column(name) for name in FORCES], axis=1) + rng.normal(
        0.0, 0.05, (len(second), 3)
    )
    names = (*first.present, *(f"second_{name}" for name in FORCES))
    table = np.column_stack([*(first.column(n) for n in first.present), other])
    source, map_file = tmp_path / "flight.csv", tmp_path / "second.toml"
    np.savetxt(source, table, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
    rows = ["format = 1", "[channels]", 'time_s = { source = "time_s" }']
    map_file.write_text("\n".join([*rows, *(f'{n} = {{ source = "second_{n}" }}' for n in FORCES)]))
    arguments = ["condition", source, "--aircraft", "aerosonde", "--second-imu", map_file]
    centre = by_name(run(capsys, [*arguments, "--json"]).json["centre"])
    for axis, placed in zip("xyz", SECOND_M, strict=True):
        found = centre[f"separation {axis}"]
        assert found["observable"]
        assert abs(found["value"] - placed) < 4.0 * found["standard_error"] < 0.1
        middle = centre[f"centre {axis}"]
        assert abs(middle["value"]) < 4.0 * middle["standard_error"] or not middle["observable"]
    assert "separation x" in run(capsys, arguments).out


def test_trimmed_flight_at_several_airspeeds_tells_the_static_margin(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Within the error that the handbook gives the elevator's power, 15 %, and the elevator's own lift."""
    aircraft, source = load_aircraft("aerosonde"), tmp_path / "flight.parquet"
    legs = tuple(Waypoint(600.0 * (i + 1), 0.0, 1000.0, v) for i, v in enumerate((25.0, 20.5, 29.0, 22.0)))
    write_flight(simulate(Scenario(aircraft, seed=2, route=Route(legs, loops=False)), 100.0), source)
    found = run(capsys, ["condition", source, "--aircraft", "aerosonde", "--json"]).json
    margin = by_name(found["static"]["parameters"])["static margin"]
    coefficients = aircraft.need_coefficients("this test")
    truth = -coefficients.Cm.alpha / coefficients.CL.alpha
    assert margin["observable"]
    assert margin["unit"] == "chords"
    assert margin["standard_error"] == pytest.approx(0.15 * margin["value"], rel=0.2)
    assert abs(margin["value"] - truth) < 2.0 * margin["standard_error"]
    assert "static margin" in run(capsys, ["condition", source, "--aircraft", "aerosonde"]).out
