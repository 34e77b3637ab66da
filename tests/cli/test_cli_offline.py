"""`estimate` and `monitor` on simulated flights, and every kind of bad input."""

import json
from pathlib import Path

import numpy as np
import pyarrow.csv as pacsv
import pyarrow.parquet as pq
import pytest
from cli_flights import demo_block, run, with_column, without

from wingwatch.aircraft import SHORT_PERIOD, STRUCTURES, FlightCondition, load_aircraft
from wingwatch.baselines import (
    Envelope,
    Expectation,
    ExpectationRecord,
    apriori_envelope,
    open_database,
)
from wingwatch.telemetry import write_flight

HEALTHY_S, ICING_S, ELEVATOR_S = 60.0, 150.0, 150.0
CONTRACT_ALERT = {
    "id", "kind", "cause", "level", "raised_s", "cleared_s", "size", "probability", "evidence", "text"
}  # fmt: skip


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flights") / "healthy.parquet"
    write_flight(demo_block("healthy", HEALTHY_S), path)
    return path


def test_estimate_gives_the_contracts_object(capsys: pytest.CaptureFixture[str], healthy: Path) -> None:
    result = run(capsys, ["estimate", healthy, "--aircraft", "aerosonde", "--json"]).json
    assert set(result["estimators"]) == {"fourier", "ekf"}
    for modes in result["estimators"].values():
        assert set(modes) == {"short_period", "lateral"}
        for name, mode in modes.items():
            assert list(mode["derivatives"]) == list(STRUCTURES[name].derivatives)
            assert {"outcome", "natural_frequency_rad_s", "damping_ratio"} <= set(mode)
            assert {"natural_frequency_rad_s_standard_error", "damping_ratio_standard_error"} <= set(mode)
            for row in mode["derivatives"].values():
                assert {"value", "standard_error", "unit", "outcome", "expected"} <= set(row)
    assert result["time_s"] == demo_block("healthy", HEALTHY_S).time_s[-1]
    assert result["basis"] == "a-priori"
    assert result["cleaning"]["rows_read"] == result["cleaning"]["accepted"] == HEALTHY_S * 50
    assert result["not_estimated"] == {"dutch_roll": "part of the lateral structure"}


def test_one_estimator_is_the_same_as_its_part_of_both(
    capsys: pytest.CaptureFixture[str], healthy: Path
) -> None:
    both = run(capsys, ["estimate", healthy, "--aircraft", "aerosonde", "--json"]).json
    for name in ("fourier", "ekf"):
        one = run(
            capsys, ["estimate", healthy, "--aircraft", "aerosonde", "--json", "--estimator", name]
        ).json
        assert one["estimators"] == {name: both["estimators"][name]}


def test_a_csv_and_a_parquet_file_of_one_flight_agree_to_the_bit(
    capsys: pytest.CaptureFixture[str], healthy: Path, tmp_path: Path
) -> None:
    text = tmp_path / "healthy.csv"
    write_flight(demo_block("healthy", HEALTHY_S), text)
    runs = [run(capsys, ["estimate", p, "--aircraft", "aerosonde", "--json"]).json for p in (text, healthy)]
    assert runs[0]["estimators"] == runs[1]["estimators"]


def test_the_table_for_people_has_every_derivative(capsys: pytest.CaptureFixture[str], healthy: Path) -> None:
    ran = run(capsys, ["estimate", healthy, "--aircraft", "aerosonde"])
    assert ran.code == 0
    assert ran.err == ""
    for structure in STRUCTURES.values():
        assert structure.name in ran.out
        assert all(f" {symbol} " in ran.out for symbol in structure.derivatives)
    assert " ± " in ran.out
    assert "converged" in ran.out
    assert "3000 samples accepted" in ran.out


def test_history_ends_where_the_estimate_stands(
    capsys: pytest.CaptureFixture[str], healthy: Path, tmp_path: Path
) -> None:
    for name, read in (("h.csv", pacsv.read_csv), ("h.parquet", pq.read_table)):
        out = tmp_path / name
        command = ["estimate", healthy, "--aircraft", "aerosonde", "--json", "--estimator", "fourier"]
        result = run(capsys, [*command, "--history", out]).json
        rows = read(out).to_pylist()
        times = np.array([row["time_s"] for row in rows])
        assert np.all(np.diff(times) >= 0.0)
        per_solution = sum(len(STRUCTURES[name].derivatives) for name in ("short_period", "lateral"))
        assert len(rows) == per_solution * len(np.unique(times))
        assert {row["estimator"] for row in rows} == {"fourier"}
        last = [row for row in rows if row["time_s"] == times[-1]]
        assert len(last) == per_solution
        for row in last:  # the Fourier estimator stands at its last solution
            now = result["estimators"]["fourier"][row["structure"]]["derivatives"][row["derivative"]]
            assert row["value"] == pytest.approx(now["value"], rel=1e-15)
            assert row["standard_error"] == pytest.approx(now["standard_error"], rel=1e-15)
            assert row["unit"] == now["unit"]
            assert row["expected"] is not None


@pytest.mark.parametrize(
    ("vehicle", "seconds", "onset_s", "kind", "cause"),
    [
        ("icing", ICING_S, 60.0, "icing", "icing"),
        ("elevator", ELEVATOR_S, 90.0, "damage", "elevator_effectiveness"),
    ],
)
def test_monitor_raises_the_right_alert_within_a_minute(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    vehicle: str,
    seconds: float,
    onset_s: float,
    kind: str,
    cause: str,
) -> None:
    path = tmp_path / "flight.parquet"
    write_flight(demo_block(vehicle, seconds), path)
    result = run(capsys, ["monitor", path, "--aircraft", "aerosonde", "--json"]).json
    assert result["status"] == "degraded"
    assert result["duration_s"] == pytest.approx(seconds - 0.02)
    assert 0.0 < result["observable_s"] <= seconds
    (alert,) = result["alerts"]
    assert set(alert) >= CONTRACT_ALERT
    assert (alert["id"], alert["kind"], alert["cause"]) == ("alert-1", kind, cause)
    assert onset_s < alert["raised_s"] <= onset_s + 60.0
    assert alert["size"]["standard_error"] > 0.0
    assert alert["evidence"]
    again = run(capsys, ["monitor", path, "--aircraft", "aerosonde", "--json"]).json
    assert again == result
    shown = run(capsys, ["monitor", path, "--aircraft", "aerosonde"])
    assert "degraded" in shown.out
    assert "alert-1" in shown.out
    assert alert["evidence"][0]["derivative"] in shown.out


def test_monitor_is_silent_on_a_healthy_flight(capsys: pytest.CaptureFixture[str], healthy: Path) -> None:
    result = run(capsys, ["monitor", healthy, "--aircraft", "aerosonde", "--json"]).json
    assert result["alerts"] == []
    assert result["status"] in ("healthy", "not_observable")
    assert "No alert." in run(capsys, ["monitor", healthy, "--aircraft", "aerosonde"]).out


def test_monitor_compares_with_the_databases_expectations_where_it_has_some(
    capsys: pytest.CaptureFixture[str], healthy: Path, tmp_path: Path
) -> None:
    """Entries identified in flight take the place of the aircraft file's numbers, and the basis says so."""
    aircraft = load_aircraft("aerosonde")
    database = tmp_path / "baseline.db"
    condition = FlightCondition(25.0, 1000.0)
    with open_database(database) as opened:
        for structure in STRUCTURES.values():
            prior = apriori_envelope(aircraft, structure).lookup(condition)
            assert isinstance(prior, Expectation)
            entry = ExpectationRecord.of("aerosonde", prior, created_at_s=0.0)
            identified = {name: getattr(entry, name) for name in ExpectationRecord.__dataclass_fields__}
            opened.put_expectation(ExpectationRecord(**{**identified, "provenance": "identified"}))
    command = ["monitor", healthy, "--aircraft", "aerosonde", "--json"]
    assert run(capsys, command).json["basis"] == "a-priori"
    result = run(capsys, [*command, "--baseline", database]).json
    assert result["basis"] == "identified"
    assert "identified" in result["basis_text"]


def test_what_is_missing_for_one_mode_leaves_the_others(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "no_lateral_surface.csv"
    lateral = [f"{surface}{end}" for surface in ("aileron", "rudder") for end in ("_rad", "_command_rad")]
    write_flight(without(demo_block("healthy", 20.0), *lateral), path)
    result = run(capsys, ["estimate", path, "--aircraft", "aerosonde", "--json"]).json
    assert set(result["estimators"]["fourier"]) == {SHORT_PERIOD.name}
    assert result["not_estimated"] == {
        "lateral": "missing aileron_rad, rudder_rad",
        "dutch_roll": "missing rudder_rad",
    }
    assert (
        "dutch_roll is not estimated: missing rudder_rad"
        in run(capsys, ["estimate", path, "--aircraft", "aerosonde"]).out
    )


def test_without_a_vane_modes_are_estimated_and_say_so(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "no_vane.csv"
    write_flight(without(demo_block("healthy", 20.0), "sideslip_rad"), path)
    result = run(capsys, ["estimate", path, "--aircraft", "aerosonde", "--json"]).json
    assert result["not_estimated"] == {"dutch_roll": "part of the lateral structure"}
    for modes in result["estimators"].values():
        assert modes["lateral"]["reason"].startswith("reconstructed, no vane")
        assert not modes[SHORT_PERIOD.name]["reason"].startswith("reconstructed")
    outcomes = {row["outcome"] for row in result["estimators"]["fourier"]["lateral"]["derivatives"].values()}
    assert outcomes <= {"rejected", "not_observable"}
    assert "reconstructed, no vane" in run(capsys, ["estimate", path, "--aircraft", "aerosonde"]).out


def test_samples_that_cannot_be_used_are_counted_in_the_result(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    block = demo_block("healthy", 20.0)
    time_s, rate = block.time_s.copy(), block.column("pitch_rate_rad_s").copy()
    time_s[200] = time_s[199]  # twice the same stamp
    time_s[300] = time_s[299] - 0.01  # back a little
    rate[400:403] = np.nan
    rate[500] = 1000.0
    spoilt = with_column(with_column(block, "time_s", time_s), "pitch_rate_rad_s", rate)
    path = tmp_path / "spoilt.parquet"
    write_flight(spoilt, path)
    cleaning = run(capsys, ["estimate", path, "--aircraft", "aerosonde", "--json"]).json["cleaning"]
    counted = {"duplicate": 1, "out_of_order": 1, "non_finite": 3, "out_of_range": 1}
    assert {name: cleaning[name] for name in counted} == counted
    assert cleaning["accepted"] == len(block) - sum(counted.values())
    assert cleaning["by_channel"] == {"pitch_rate_rad_s": 4}
    assert "3 without a finite value" in run(capsys, ["monitor", path, "--aircraft", "aerosonde"]).out


MAP_HEAD = "format = 1\n[channels]\n"


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        ('pitch_rate_rad_s = { source = "q_gyro" }', "q_gyro"),
        ('pitch_rate_rad_s = { source = "pitch_rate_rad_s", unit = "kt" }', "'kt'"),
        ('pitch_speed = { source = "pitch_rate_rad_s" }', "pitch_speed"),
        ("pitch_rate_rad_s = {", "TOML"),
    ],
)
def test_a_wrong_map_is_told_in_one_sentence(
    capsys: pytest.CaptureFixture[str], healthy: Path, tmp_path: Path, channels: str, words: str
) -> None:
    channel_map = tmp_path / "map.toml"
    channel_map.write_text(MAP_HEAD + channels)
    for command in ("estimate", "monitor"):
        ran = run(capsys, [command, healthy, "--aircraft", "aerosonde", "--map", channel_map])
        assert words in ran.sentence


def test_a_flight_that_cannot_be_used_is_told_in_one_sentence(
    capsys: pytest.CaptureFixture[str], healthy: Path, tmp_path: Path
) -> None:
    block = demo_block("healthy", 20.0)
    truncated, empty, text = tmp_path / "cut.parquet", tmp_path / "empty.csv", tmp_path / "notes.txt"
    truncated.write_bytes(healthy.read_bytes()[:-100])
    empty.write_bytes(b"")
    text.write_bytes(bytes(range(256)) * 8)
    rateless = tmp_path / "rateless.csv"
    write_flight(without(block, "pitch_rate_rad_s"), rateless)
    modeless = tmp_path / "modeless.csv"
    surfaces = [f"{s}_{kind}" for s in ("elevator", "aileron", "rudder") for kind in ("rad", "command_rad")]
    write_flight(without(block, *surfaces), modeless)
    cases = {
        tmp_path / "absent.csv": "absent.csv",
        truncated: "cut.parquet",
        empty: "empty",
        text: "notes.txt",
        rateless: "pitch_rate_rad_s",
        modeless: "elevator_rad",
    }
    for path, words in cases.items():
        for command in ("estimate", "monitor"):
            assert words in run(capsys, [command, path, "--aircraft", "aerosonde", "--json"]).sentence


def test_an_aircraft_that_cannot_be_used_is_told_in_one_sentence(
    capsys: pytest.CaptureFixture[str], healthy: Path, tmp_path: Path
) -> None:
    wrong = tmp_path / "wrong.toml"
    wrong.write_text('format = 1\nname = "x"\n[mass]\nmass_kg = -1\n')
    for aircraft, words in {
        "concorde": "concorde",
        str(tmp_path / "none.toml"): "none.toml",
        str(wrong): "mass_kg",
    }.items():
        assert words in run(capsys, ["monitor", healthy, "--aircraft", aircraft]).sentence
    bare = tmp_path / "bare.toml"
    bare.write_text('format = 1\nname = "bare"\n')
    assert "no mode can be estimated" in run(capsys, ["estimate", healthy, "--aircraft", bare]).sentence


def test_where_the_history_cannot_go_is_told_before_the_work(
    capsys: pytest.CaptureFixture[str], healthy: Path, tmp_path: Path
) -> None:
    command = ["estimate", healthy, "--aircraft", "aerosonde", "--history"]
    assert ".parquet" in run(capsys, [*command, tmp_path / "h.xlsx"]).sentence
    assert "does not exist" in run(capsys, [*command, tmp_path / "no" / "h.csv"]).sentence
    taken = tmp_path / "taken.csv"
    taken.mkdir()
    assert "taken.csv" in run(capsys, [*command, taken]).sentence


def test_a_baseline_that_cannot_be_used_is_told_in_one_sentence(
    capsys: pytest.CaptureFixture[str], healthy: Path, tmp_path: Path
) -> None:
    command = ["monitor", healthy, "--aircraft", "aerosonde", "--baseline"]
    absent = tmp_path / "absent.db"
    assert "absent.db" in run(capsys, [*command, absent]).sentence
    assert not absent.exists()
    assert "SQLite" in run(capsys, [*command, healthy]).sentence
    assert "mysql" in run(capsys, [*command, "mysql://somewhere/x"]).sentence
    ran = run(capsys, [*command, healthy, "--vehicle", "UAV 1"])
    assert "'UAV 1'" in ran.sentence


def test_what_earlier_flights_taught_is_read_from_the_database(tmp_path: Path) -> None:
    """A stored envelope answers as the one it was stored from, and only where it stands."""
    from wingwatch.operations.baseline import stored_envelopes

    aircraft = load_aircraft("aerosonde")
    envelope = apriori_envelope(aircraft, SHORT_PERIOD)
    with open_database(tmp_path / "b.db") as database:
        for point in envelope.points:
            database.put_expectation(ExpectationRecord.of(aircraft.name, point, created_at_s=0.0))
        stored = stored_envelopes(database, aircraft, "clean")
        assert stored_envelopes(database, aircraft, "flaps") == {}
    assert set(stored) == {SHORT_PERIOD.name}
    where = FlightCondition(26.3, 777.0)
    one, other = envelope.lookup(where), stored[SHORT_PERIOD.name].lookup(where)
    assert isinstance(one, Expectation)
    assert isinstance(other, Expectation)
    assert one.value.tolist() == other.value.tolist()
    assert one.covariance.tolist() == other.covariance.tolist()
    assert isinstance(stored[SHORT_PERIOD.name], Envelope)
    assert stored[SHORT_PERIOD.name].limits == envelope.limits


def test_json_has_null_for_what_is_not_known(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """One second is not enough for the Fourier estimator; JSON knows neither NaN nor infinity."""
    path = tmp_path / "short.csv"
    write_flight(demo_block("healthy", 1.0), path)
    ran = run(capsys, ["estimate", path, "--aircraft", "aerosonde", "--json"])
    assert ran.code == 0

    def refuse(constant: str) -> float:
        raise AssertionError(f"{constant} is no JSON")

    result = json.loads(ran.out, parse_constant=refuse)
    mode = result["estimators"]["fourier"]["short_period"]
    assert mode["outcome"] == "not_observable"
    assert mode["derivatives"]["z_w"]["value"] is None
    assert mode["natural_frequency_rad_s"] is None
    assert "nan" not in run(capsys, ["estimate", path, "--aircraft", "aerosonde"]).out.split()
