"""`condition`: what it finds in a simulated flight, what it writes, and its refusals."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_flights import run, without

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.simulation import (
    Scenario,
    SensorDelay,
    SensorErrors,
    doublet_schedule,
    patrol,
    simulate,
)
from wingwatch.telemetry import SampleBlock, load_flight, write_flight

BIAS_RAD_S, DELAY_S = 0.01, 0.06
ALPHA = "angle_of_attack_rad"


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
    told = errors[f"bias of {ALPHA}"], errors[f"scale of {ALPHA}"]
    offset, scale = (row["value"] if row["observable"] else 0.0 for row in told)
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
    assert "gusts show in vanes only" in shown.out
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
