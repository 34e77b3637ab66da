"""`baseline learn`: healthy flights teach a vehicle or become expectations of the type; no flight counts twice."""

from pathlib import Path

import numpy as np
import pytest
from cli_flights import demo_block, run

from wingwatch.aircraft import load_aircraft
from wingwatch.baselines import BaselineLedger, CellMemory, Reference, ReferenceKey, open_database
from wingwatch.cli.flight_watch import load, watch
from wingwatch.monitor import CellPlace, MonitorStart, VehicleMemory
from wingwatch.monitor.detection.blocks import FOURIER
from wingwatch.operations.progress import Progress
from wingwatch.telemetry import SampleBlock, write_flight

TYPE = ["--aircraft", "aerosonde"]
OWN = [*TYPE, "--vehicle", "uav1"]
KEY = ReferenceKey("default", "uav1", "aerosonde", "clean", "short_period")


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two parts of a healthy flight, and one that takes on ice."""
    folder, healthy = tmp_path_factory.mktemp("flights"), demo_block("healthy", 120.0)
    later = healthy.time_s >= 60.0
    parts = {
        "monday.parquet": SampleBlock(healthy.values[~later]),
        "tuesday.parquet": SampleBlock(healthy.values[later]),
        "iced.parquet": demo_block("icing", 90.0),
    }
    for name, block in parts.items():
        write_flight(block, folder / name)
    return [folder / name for name in parts]


def test_a_vehicle_is_taught_as_the_live_monitor_would(
    capsys: pytest.CaptureFixture[str], flights: list[Path], tmp_path: Path
) -> None:
    path, aircraft = tmp_path / "w.db", load_aircraft("aerosonde")
    learned = run(capsys, ["baseline", "learn", path, *flights[:2], *OWN, "--json"]).json
    # By hand: each flight watched with what the one before it left, and what is remembered at its end joined.
    references: dict[str, Reference] = {}
    cells: dict[CellPlace, CellMemory] = {}
    for flight in flights[:2]:
        table, _ = load(flight, None, "aerosonde")
        start = MonitorStart(memory=VehicleMemory(references, {}, cells))
        monitor = watch(table, aircraft, Progress(False), start=start).monitor
        references = dict(monitor.references)
        for block in monitor.saved().judge.blocks:
            for name, mode in block.modes.items():
                j, h = mode.evidence.information[FOURIER], mode.evidence.vector[FOURIER]
                if np.trace(j) > 0.0:
                    references[name] = references[name].add(j, h, 10.0)
        cells = {place: CellMemory(r, 0.0) for place, r in monitor.cells.take_changed().items()}
    with open_database(path) as opened:
        ledger = BaselineLedger(opened)
        for name in ("short_period", "lateral"):
            kept = ledger.newest_version(ReferenceKey("default", "uav1", "aerosonde", "clean", name))
            assert kept is not None
            assert kept.reference.blocks == references[name].blocks == learned["learned"][name]["blocks"]
            np.testing.assert_allclose(kept.reference.information, references[name].information, rtol=1e-9)
            np.testing.assert_allclose(kept.reference.vector, references[name].vector, rtol=1e-9, atol=1e-9)
            assert "monday.parquet (" in kept.source
            assert "Fourier estimator" in kept.source
        assert ledger.cells(KEY)
        assert opened.expectations("aerosonde", "clean", "short_period") == ()
    watched = run(capsys, ["monitor", flights[0], *OWN, "--baseline", path, "--json"]).json
    assert watched["basis"] == "empirical"
    again = run(capsys, ["baseline", "learn", path, flights[1], *OWN]).sentence
    assert "was learned from this flight already" in again
    assert "was learned from" in run(capsys, ["baseline", "learn", path, flights[0], *TYPE]).sentence
    assert run(capsys, ["baseline", "revert", path, *OWN, "--yes"]).code == 0
    with open_database(path) as opened:
        assert opened.load_reference(KEY) is None
        assert BaselineLedger(opened).cells(KEY) == ()


def test_expectations_of_the_type_grow_cell_by_cell_and_are_taken_back(
    capsys: pytest.CaptureFixture[str], flights: list[Path], tmp_path: Path
) -> None:
    path = tmp_path / "w.db"
    first = run(capsys, ["baseline", "learn", path, flights[0], *TYPE, "--json"]).json
    assert {one["structure"] for one in first["entries"]} == {"short_period", "lateral"}
    with open_database(path) as opened:
        (alone,) = opened.expectations("aerosonde", "clean", "short_period")
    second = run(capsys, ["baseline", "learn", path, flights[1], *TYPE, "--json"]).json
    assert [alone.id] in [one["supersedes"] for one in second["entries"]]
    with open_database(path) as opened:
        (both,) = opened.expectations("aerosonde", "clean", "short_period")
    assert "monday.parquet" in both.source
    assert "tuesday.parquet" in both.source
    found, covariance = both.expectation, np.array(both.covariance)
    assert np.count_nonzero(covariance - np.diag(np.diagonal(covariance))) > 0
    assert found.standard_error[3] < alone.expectation.standard_error[3]  # m_w
    assert found.standard_error[3] > 0.03 * abs(found.value[3]) * 0.9  # 3 % from visit to visit
    watched = run(capsys, ["monitor", flights[0], *TYPE, "--baseline", path, "--json"]).json
    assert (watched["basis"], watched["alerts"]) == ("identified", [])
    assert run(capsys, ["baseline", "revert", path, *TYPE, "--yes"]).code == 0
    with open_database(path) as opened:
        assert opened.expectations("aerosonde", "clean", "short_period") == (alone,)


def test_a_flight_with_an_alert_teaches_nothing_unless_told_to(
    capsys: pytest.CaptureFixture[str], flights: list[Path], tmp_path: Path
) -> None:
    path = tmp_path / "w.db"
    said = run(capsys, ["baseline", "learn", path, flights[0], flights[2], *OWN]).sentence
    assert f"{flights[2]}: the monitor raises a" in said
    assert "--anyway" in said
    with open_database(path) as opened:
        assert BaselineLedger(opened).taught() == ()
        assert BaselineLedger(opened).changes() == ()
    result = run(capsys, ["baseline", "learn", path, flights[2], *OWN, "--anyway", "--json"]).json
    assert result["flights"][0]["alerts"]
    assert "same flight" in run(capsys, ["baseline", "learn", path, flights[0], flights[0], *OWN]).sentence
