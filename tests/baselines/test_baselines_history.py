"""The history of estimates: flights, pages, thinning, limits, and what older versions kept."""

import json
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest
from alembic import command
from alembic.config import Config
from sqlalchemy import text

from wingwatch.baselines import Database, EstimateRecord, HistoryWanted, Retention, open_database
from wingwatch.baselines import connection as connection_module
from wingwatch.baselines.connection import VERSION_TABLE, connect, writing

HOUR_S = 3600.0
RETENTION = Retention(full_rate_s=HOUR_S, interval_s=10.0, keep_s=100.0 * HOUR_S, most_rows=10**6)


def estimate(
    time_s: float, vehicle: str = "uav1", estimator: str = "ekf", configuration: str = "clean"
) -> EstimateRecord:
    return EstimateRecord(
        "default", vehicle, time_s, "short_period", estimator, (time_s,) * 6, (0.1,) * 6, "converged",
        (25.0, 1000.0, 1.1, 0.05), "aerosonde", configuration, tuple(0.01 * k for k in range(15)),
    )  # fmt: skip


def fly(database: Database, from_s: float, to_s: float, at_s: float, vehicle: str = "uav1") -> None:
    """One instant a second, two estimates each."""
    seconds = range(int(from_s), int(to_s))
    rows = [(estimate(float(t), vehicle, e), at_s + t - from_s) for t in seconds for e in ("ekf", "fourier")]
    database.append_estimates([(replace(row, value=(at,) * 6), at) for row, at in rows])


def prune(database: Database, now_at_s: float, retention: Retention = RETENTION) -> int:
    steps = 1
    while database.prune_history(now_at_s, retention):
        steps += 1
        assert steps < 1000
    return steps


def rows_of(database: Database, vehicle: str = "uav1", **wanted: object) -> list[tuple[int, float, str]]:
    found = database.history_rows("default", vehicle, HistoryWanted(**wanted))  # type: ignore[arg-type]
    return [(r.flight, r.estimate.time_s, r.estimate.estimator) for r in found]


def test_an_estimate_comes_back_with_clock_flight_aircraft_configuration_and_covariance(
    database: Database,
) -> None:
    database.append_estimates([(estimate(1.0), 1000.5)])
    (row,) = database.history_rows("default", "uav1", HistoryWanted())
    assert (row.estimate, row.at_s) == (estimate(1.0), 1000.5)


def test_a_flight_ends_when_the_clock_goes_back_the_configuration_changes_or_silence_is_long(
    database: Database,
) -> None:
    flights = []
    for row, at_s in (
        (estimate(1.0), 0.0),
        (estimate(2.0), 500.0),
        (estimate(1.5), 501.0),  # the clock went back
        (estimate(3.0, configuration="flaps"), 502.0),
        (estimate(4.0, configuration="flaps"), 1200.0),  # silent for more than ten minutes
    ):
        database.append_estimates([(row, at_s)])
        flights.append(max(r.flight for r in database.history_rows("default", "uav1", HistoryWanted())))
    assert [f - flights[0] for f in flights] == [0, 0, 1, 2, 3]
    assert rows_of(database, flight=flights[2]) == [(flights[2], 1.5, "ekf")]
    assert rows_of(database, from_s=2.5) == [(flights[3], 3.0, "ekf"), (flights[4], 4.0, "ekf")]


def test_a_flight_goes_on_in_another_run_and_a_repeated_batch_changes_nothing(url: str) -> None:
    batch = [(estimate(float(t)), 1000.0 + t) for t in range(10)]
    with open_database(url) as database:
        database.append_estimates(batch)
    with open_database(url) as database:
        database.append_estimates(batch)  # the reply was lost
        database.append_estimates([(estimate(10.0), 1010.0)])
        found = rows_of(database)
    assert [t for _, t, _ in found] == [float(t) for t in range(11)]
    assert len({f for f, _, _ in found}) == 1


def test_pages_by_key_join_to_the_whole(database: Database) -> None:
    fly(database, 0, 30, 0.0)
    fly(database, 0, 30, 100.0)
    everything = rows_of(database)
    joined: list[tuple[int, float, str]] = []
    start = None
    while True:
        found = database.history_rows("default", "uav1", HistoryWanted(start=start, limit=8))
        keys = [(r.flight, r.estimate.time_s, r.estimate.estimator) for r in found]
        joined += keys if start is None else keys[1:]  # the start is included
        if len(found) < 8:
            break
        start = (*keys[-1], "short_period")
    assert joined == everything
    assert len(everything) == 120


def test_what_is_old_is_thinned_also_of_silent_vehicles_and_once(database: Database) -> None:
    fly(database, 0, 100, 0.0, "silent")
    fly(database, 0, 100, 10 * HOUR_S)
    prune(database, 10 * HOUR_S + 200.0)
    thinned = [(t, e) for _, t, e in rows_of(database, "silent")]
    assert thinned == [(10.0 * k, e) for k in range(10) for e in ("ekf", "fourier")]
    assert len(rows_of(database)) == 200  # full rate
    assert prune(database, 10 * HOUR_S + 300.0) == 1
    prune(database, 12 * HOUR_S)
    assert [t for _, t, e in rows_of(database) if e == "ekf"] == [10.0 * k for k in range(10)]


def test_a_flight_that_goes_on_is_thinned_piece_by_piece(database: Database) -> None:
    for k in range(6):
        fly(database, 1800 * k, 1800 * (k + 1), 1800.0 * k)
        prune(database, 1800.0 * (k + 1))
    times = [t for _, t, e in rows_of(database) if e == "ekf"]
    old = [t for t in times if t < 3 * 1800.0]
    assert old == [10.0 * k for k in range(540)]
    assert len([t for t in times if t >= 10_800.0 - HOUR_S]) == int(HOUR_S)


def test_flights_beyond_their_age_go_and_alerts_stay(database: Database) -> None:
    fly(database, 0, 50, 0.0, "silent")
    fly(database, 0, 50, 99 * HOUR_S)
    prune(database, 101 * HOUR_S)
    assert rows_of(database, "silent") == []
    assert rows_of(database) != []


def test_beyond_the_size_the_oldest_flights_go(database: Database) -> None:
    for k in range(4):
        fly(database, 0, 50, 1000.0 * k)
    prune(database, 4000.0, replace(RETENTION, most_rows=250))
    assert len({f for f, _, _ in rows_of(database)}) == 2
    prune(database, 3060.0, replace(RETENTION, most_rows=50))  # the flight that goes on gives way, too
    assert rows_of(database) == []
    fly(database, 50, 60, 3070.0)
    assert len(rows_of(database)) == 20


def older(where: str, revision: str) -> None:
    """A database as an older version made it."""
    engine = connect(where, 1.0)
    folder = str(connection_module._MIGRATIONS)
    with writing(engine).begin() as connection:
        config = Config(attributes={"connection": connection, "version_table": VERSION_TABLE})
        config.set_main_option("script_location", folder)
        command.upgrade(config, revision)
        for time_s, vehicle in ((1.0, "uav1"), (2.0, "uav1"), (0.5, "uav1"), (2.0, "uav2"), (2.0, "uav2")):
            values = {
                "time_s": time_s, "vehicle": vehicle, "value": json.dumps(["NaN", 0.1, 1.0, 2.0, 3.0, time_s]),
                "error": json.dumps(["Infinity", 0.1, 0.1, 0.1, 0.1, 1 / 3]), "condition": "[25.0, 1000.0, 1.1, 0.05]",
            }  # fmt: skip
            connection.execute(
                text(
                    "INSERT INTO estimate_record (fleet, vehicle, time_s, structure, estimator, value, standard_error, "
                    "outcome, condition) VALUES ('default', :vehicle, :time_s, 'short_period', 'ekf', :value, :error, "
                    "'settling', :condition)"
                ),
                values,
            )
    engine.dispose()


@pytest.mark.parametrize("revision", ["0001", "0002", "0003"])
def test_the_history_of_older_versions_goes_over(url: str, revision: str) -> None:
    older(url, revision)
    with open_database(url) as database:
        found = database.history_rows("default", "uav1", HistoryWanted())
        assert [r.estimate.time_s for r in found] == [1.0, 2.0, 0.5]
        assert [r.flight - found[0].flight for r in found] == [0, 0, 1]
        assert {r.at_s for r in found} == {None}
        estimate = found[0].estimate
        assert (estimate.value[1:], estimate.standard_error[0], estimate.covariance) == (
            (0.1, 1.0, 2.0, 3.0, 1.0),
            float("inf"),
            (),
        )
        assert len(rows_of(database, "uav2")) == 1  # kept twice by the older version
        fly(database, 0, 10, 4e9)
        prune(database, 4e9 + 20.0, replace(RETENTION, keep_s=4e9))
        assert len(rows_of(database)) == 2 + 20  # 1.0 and 2.0 are of one interval


def test_an_sqlite_row_is_small(tmp_path: Path) -> None:
    """Twelve megabytes an hour of one vehicle was the older form's: three modes, two estimators, once a second."""
    with open_database(tmp_path / "w.db") as database:
        fly(database, 0, 5000, 0.0)
    with sqlite3.connect(tmp_path / "w.db") as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    assert (tmp_path / "w.db").stat().st_size / 10_000 < 400
