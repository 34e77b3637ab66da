"""Rows: what is said of a flight whose truth is known."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from scipy.stats import chi2
from study_flights import GRID, small_grid, untimed

from wingwatch.monitor import AlertState, AlertView, EvidenceView
from wingwatch.studies import COLUMNS, FlightPlan, draw_plan, load_fleet, load_grid
from wingwatch.studies.flight import FlightMaker
from wingwatch.studies.flight_rows import _reason
from wingwatch.studies.table import rows_table
from wingwatch.studies.watched_flight import ScoredBlock

COMMAND = "wingwatch study replay test.parquet --seed {seed}"


@pytest.fixture(scope="module")
def flights(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[FlightMaker, list[FlightPlan], list[dict[str, Any]]]:
    """Strong ice at 20 s, weak ice without vanes, no ice, and a flight that no aircraft can fly."""
    grid = small_grid(tmp_path_factory.mktemp("grid"))
    fleet = load_fleet(grid)
    plan = replace(draw_plan("icing", grid, 1, fleet), target="all", severity=0.35, seconds=60.0)
    blind = replace(plan, seed=2, sensors="no_vanes", surfaces="commands", expectation="exact")
    healthy = replace(
        plan, kind="healthy", seed=3, effect="", target="", severity=None, onset_s=None, ramp_s=None
    )
    impossible = replace(plan, seed=4, airspeed_true_m_s=5.0)
    plans = [plan, blind, healthy, impossible]
    maker = FlightMaker(fleet)
    return maker, plans, maker.rows(plans, COMMAND)


def test_rows_have_the_columns(flights: tuple[FlightMaker, list[FlightPlan], list[dict[str, Any]]]) -> None:
    rows = flights[2]
    assert all(list(row) == list(COLUMNS) for row in rows)
    assert rows_table(rows).num_rows == 4
    assert [row["seed"] for row in rows] == [1, 2, 3, 4]
    assert rows[0]["command"] == "wingwatch study replay test.parquet --seed 1"


def test_a_flight_is_the_same_alone_and_among_others(
    flights: tuple[FlightMaker, list[FlightPlan], list[dict[str, Any]]],
) -> None:
    maker, plans, rows = flights
    assert untimed(maker.rows(plans[:1], COMMAND)) == untimed(rows[:1])


def test_strong_ice_is_noticed_and_its_information_counted(
    flights: tuple[FlightMaker, list[FlightPlan], list[dict[str, Any]]],
) -> None:
    row = flights[2][0]
    assert row["failed"] == ""
    assert row["detected"]
    assert row["delay_s"] == row["detected_s"] - 20.0
    assert row["evidence_max"] > row["threshold"]
    assert row["healthy_h"] == 20.0 / 3600.0
    assert row["information"] > 10.0
    assert row["information_rate_per_s"] > 0.0
    assert math.isnan(row["bayes_factor_max"])
    assert set(json.loads(row["icing_factors"])) >= {"CL_alpha", "Cm_elevator"}
    scores = json.loads(row["block_scores"])
    assert set(scores) == {"short_period", "lateral"}
    assert all(len(score) == 3 and score[2] <= 15 for blocks in scores.values() for score in blocks)


def test_without_vanes_no_derivative_is_compared(
    flights: tuple[FlightMaker, list[FlightPlan], list[dict[str, Any]]],
) -> None:
    row = flights[2][1]
    assert (row["failed"], row["observed_s"], row["block_scores"]) == ("", 0.0, "{}")
    assert row["said_cause"] in ("", None, "unknown"), "what drag alone shows has no name"
    assert row["expectation_error"] == ""


def test_a_healthy_flight_has_no_onset_and_a_bayes_factor(
    flights: tuple[FlightMaker, list[FlightPlan], list[dict[str, Any]]],
) -> None:
    row = flights[2][2]
    assert (row["failed"], row["false_alerts"], row["false_causes"]) == ("", 0, "[]")
    assert row["false_reasons"] == "[]"
    assert row["healthy_h"] == 60.0 / 3600.0
    assert 0.0 < row["bayes_factor_max"] < 100.0
    assert math.isnan(row["onset_s"])
    assert math.isnan(row["information"])


def test_a_false_alarm_is_listed_with_what_misled_the_monitor() -> None:
    evidence = [EvidenceView(name, 0.0, 1.0, 0.0, 1.0, z) for name, z in (("m_q", 2.0), ("l_p", -4.0))]
    alert = AlertView(
        id="1", fleet="f", vehicle="v", kind="unexplained", cause="unknown", level="watch", state=AlertState.ACTIVE,
        raised_s=100.0, cleared_s=None, size=0.0, size_standard_error=0.0, probability=1.0, basis="a-priori", text="",
        evidence=evidence,
    )  # fmt: skip
    blocks = [
        ScoredBlock("lateral", 40.0, 200.0, 10.0),  # more than a minute before
        ScoredBlock("lateral", 90.0, chi2.isf(1e-6, 10.0), 10.0),
        ScoredBlock("short_period", 100.0, 6.0, 6.0),
        ScoredBlock("short_period", 110.0, 200.0, 6.0),  # later
    ]
    found = _reason(alert, blocks)
    assert found.pop("log10_probability") == pytest.approx(-6.0)
    assert found == {"derivative": "l_p", "z": -4.0, "structure": "lateral", "block_end_s": 90.0}
    assert _reason(alert, blocks[:1]) == {"derivative": "l_p", "z": -4.0}


def test_a_flight_that_cannot_be_flown_says_why_and_stops_no_other(
    flights: tuple[FlightMaker, list[FlightPlan], list[dict[str, Any]]],
) -> None:
    row = flights[2][3]
    assert "5 m/s" in row["failed"]
    assert "\n" not in row["failed"]
    assert row["flight_s"] == 0.0


def test_a_sensor_fault_is_named_with_its_channel_and_its_whole_history(tmp_path: Path) -> None:
    effects = "[[effects]]\nname = 'airspeed_error'\nsize = 0.15\n"
    path = tmp_path / "long.toml"
    path.write_text(
        GRID.replace("40.0", "60.0").replace("onset_s = 20.0", "onset_s = 45.0") + effects, encoding="utf-8"
    )
    grid = load_grid("sensor", path)
    fleet = load_fleet(grid)
    row = FlightMaker(fleet).rows([draw_plan("sensor", grid, 0, fleet)], COMMAND)[0]
    assert (row["failed"], row["effect"], row["channel"]) == ("", "airspeed_error", "airspeed_true_m_s")
    assert (row["first_kind"], row["first_cause"], row["first_channel"]) == (
        "sensor", "airspeed_error", "airspeed_true_m_s",
    )  # fmt: skip
    assert (row["first_right"], row["first_in_set"], row["right_at_end"]) == (True, True, True)
    assert row["delay_s"] == row["right_delay_s"] < 5.0
    assert math.isnan(row["derivatives_delay_s"])
    assert math.isnan(row["other_kind_delay_s"])
    history = json.loads(row["alerts"])
    assert history[0]["raised_s"] == row["detected_s"]
    assert history[0]["names"][-1]["size"] == row["size"]
    assert abs(row["size"] - 0.15) < 5.0 * row["size_standard_error"]


def test_slow_telemetry_of_commands_alone_is_flown_and_written_down(tmp_path: Path) -> None:
    effects = "[[effects]]\nname = 'surface_stuck'\ntarget = 'elevator'\nsize = 'here'\n"
    slow = GRID.replace('"vanes"', '"no_vanes"').replace('"positions"', '"commands"')
    path = tmp_path / "slow.toml"
    path.write_text(f"rate_hz = 10.0\n{slow}{effects}", encoding="utf-8")
    grid = load_grid("damage", path)
    fleet = load_fleet(grid)
    row = FlightMaker(fleet).rows([draw_plan("damage", grid, 0, fleet)], COMMAND)[0]
    assert (row["failed"], row["flight_s"], row["channel"]) == ("", 40.0, "elevator_rad")
    assert math.isnan(row["severity"])
    assert (row["sensors"], row["surfaces"]) == ("no_vanes", "commands")
    assert row["detected"] == (len(json.loads(row["alerts"])) > row["false_alerts"])


def test_a_grid_of_another_kind_of_effect_keeps_its_unit(tmp_path: Path) -> None:
    more = "\n[[effects]]\nname = 'cg_shift'\nsize = 0.1\nin_chords = true\n"
    grid = small_grid(tmp_path, "damage", more)
    fleet = load_fleet(grid)
    plan = draw_plan("damage", grid, 0, fleet)
    assert plan.severity == pytest.approx(0.1 * fleet["aerosonde"].need_geometry("a test").mean_chord_m)
