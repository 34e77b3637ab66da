"""`estimate --engine filterpy`: the same filter by another's class."""

import math
from pathlib import Path

import pytest
from cli_flights import demo_block, run

from wingwatch.telemetry import write_flight


def test_both_engines_say_the_same(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    flight = tmp_path / "flight.parquet"
    write_flight(demo_block("healthy", 10.0), flight)
    command = ["estimate", flight, "--aircraft", "aerosonde", "--estimator", "ekf", "--json"]
    ours = run(capsys, command).json["estimators"]["ekf"]
    theirs = run(capsys, [*command, "--engine", "filterpy"]).json["estimators"]["ekf"]
    assert ours.keys() == theirs.keys()
    for name, mode in ours.items():
        for symbol, row in mode["derivatives"].items():
            other = theirs[name]["derivatives"][symbol]
            for key in ("value", "standard_error"):
                assert math.isclose(row[key], other[key], rel_tol=1e-9, abs_tol=1e-9), (symbol, key)


def test_an_engine_is_of_the_filter_alone(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    command = ["estimate", tmp_path / "flight.csv", "--aircraft", "aerosonde", "--estimator", "output-error"]
    assert (
        "--engine filterpy is of the Kalman filter"
        in run(capsys, [*command, "--engine", "filterpy"]).sentence
    )
