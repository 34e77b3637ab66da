"""The history of estimates as columns: the same numbers as its rows, in pieces as a whole, flight by flight."""

from pathlib import Path

import numpy as np
from test_baselines_history import estimate, fly

from wingwatch.baselines import Database, HistoryKey, HistoryWanted, open_database


def test_columns_are_the_rows_by_estimator_and_structure(database: Database) -> None:
    fly(database, 0.0, 20.0, 1000.0)
    wanted = HistoryWanted(3.0, 11.0)
    rows = [row.estimate for row in database.history_rows("default", "uav1", wanted)]
    columns, last = database.history_columns("default", "uav1", wanted)
    assert last is None
    assert {(one.estimator, one.structure) for one in columns} == {
        ("ekf", "short_period"),
        ("fourier", "short_period"),
    }
    for one in columns:
        mine = [row for row in rows if row.estimator == one.estimator]
        np.testing.assert_array_equal(one.time_s, [row.time_s for row in mine])
        np.testing.assert_array_equal(one.value, [row.value for row in mine])
        np.testing.assert_array_equal(one.standard_error, [row.standard_error for row in mine])
        np.testing.assert_array_equal(one.condition, [row.condition for row in mine])
        assert one.outcomes == tuple(row.outcome for row in mine)
        assert (one.aircraft, one.configuration) == ("aerosonde", "clean")


def test_pieces_go_on_from_the_last_row(database: Database) -> None:
    fly(database, 0.0, 10.0, 1000.0)
    seen: list[tuple[float, str]] = []
    start: HistoryKey | None = None
    while True:
        columns, last = database.history_columns("default", "uav1", HistoryWanted(start=start, limit=7))
        seen += [(t, one.estimator) for one in columns for t in one.time_s.tolist()]
        if last is None:
            break
        assert last != start
        start = last
    assert sorted(set(seen)) == [(float(t), e) for t in range(10) for e in ("ekf", "fourier")]


def test_flights_are_listed_newest_first(tmp_path: Path) -> None:
    with open_database(tmp_path / "h.db") as database:
        fly(database, 0.0, 10.0, 1000.0)
        fly(database, 0.0, 5.0, 90_000.0)
        database.append_estimates([(estimate(1.0, "another"), 90_000.0)])
        newest, oldest = database.flights("default", "uav1")
        assert newest.id > oldest.id
        assert (newest.first_time_s, newest.last_time_s, newest.estimates) == (0.0, 4.0, 10)
        assert (oldest.last_time_s, oldest.began_at_s, oldest.estimates) == (9.0, 1000.0, 20)
