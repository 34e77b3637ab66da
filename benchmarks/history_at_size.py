"""How long questions to the history of estimates take in a large database, and how large it is.

Rows are written as the service writes them: by vehicle and flight, two estimators of three structures once a second.
Then pages are asked for as REST does: the first row of a vehicle, a row deep in it, the newest flight's, one name's.

Run: python benchmarks/history_at_size.py [--rows 10000000] [--database URL_OR_PATH]
"""

import argparse
import random
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from saving import run_benchmark
from sqlalchemy import text

from wingwatch.baselines import Database, EstimateRecord, HistoryWanted, Retention, open_database

VEHICLES = 20
FLIGHT_S = 3600
STRUCTURES = ("short_period", "dutch_roll", "roll")
WIDTH = {"short_period": 6, "dutch_roll": 6, "roll": 2}
AT_ONCE = 600
ASKED = 200
FIRST_AT_S = 1.7e9
COPY_FLIGHT = """
INSERT INTO flight (fleet, vehicle, aircraft, configuration, began_at_s, last_at_s, first_time_s, last_time_s, rows,
                    thinned_time_s, thinned_at_s)
SELECT fleet, :vehicle, aircraft, configuration, began_at_s + :at_s, last_at_s + :at_s, first_time_s, last_time_s, rows,
       NULL, thinned_at_s + :at_s FROM flight ORDER BY id LIMIT 1
RETURNING id
"""
COPY_ROWS = """
INSERT INTO estimate_history (flight_id, time_s, estimator, structure, at_s, outcome, numbers)
SELECT :new, time_s, estimator, structure, at_s + :at_s, outcome, numbers FROM estimate_history
WHERE flight_id = (SELECT min(id) FROM flight)
"""


def write(database: Database, rows: int) -> float:
    """Flights of an hour, all vehicles in turns; returns how many rows a second the service's own way writes.

    The first flight is written as the service writes it, the others are copies of it, which takes a tenth of the time.
    """
    first = min(rows, 6 * FLIGHT_S)
    began = time.perf_counter()
    for start in range(0, first // 6, AT_ONCE // 6):
        batch = [
            (_estimate("uav0", float(t), name, structure), FIRST_AT_S + t)
            for t in range(start, start + AT_ONCE // 6)
            for name in ("ekf", "fourier")
            for structure in STRUCTURES
        ]
        database.append_estimates(batch)
    rate = first / (time.perf_counter() - began)
    for flight in range(1, rows // first):
        at_s = 2.0 * FLIGHT_S * (flight // VEHICLES)
        with database._write_engine.begin() as connection:
            given = {"vehicle": f"uav{flight % VEHICLES}", "at_s": at_s}
            new = connection.execute(text(COPY_FLIGHT), given).scalar_one()
            connection.execute(text(COPY_ROWS), {"new": new, "at_s": at_s})
    return rate


def _estimate(vehicle: str, time_s: float, estimator: str, structure: str) -> EstimateRecord:
    k = WIDTH[structure]
    return EstimateRecord(
        "default", vehicle, time_s, structure, estimator, (0.1 * time_s,) * k, (0.1,) * k, "converged",
        (25.0, 1000.0, 1.1, 0.05), "aerosonde", "clean", (0.01,) * (k * (k - 1) // 2),
    )  # fmt: skip


def timed(question: Callable[[], object], times: int = ASKED) -> tuple[float, float]:
    """Median and 99th percentile, ms."""
    took: list[float] = []
    for _ in range(times):
        began = time.perf_counter()
        question()
        took.append(1e3 * (time.perf_counter() - began))
    took.sort()
    return took[len(took) // 2], took[len(took) * 99 // 100]


def questions(database: Database) -> dict[str, Callable[[], object]]:
    """What is asked, by name."""
    draw = random.Random(1)
    flights = [
        row.flight for row in database.history_rows("default", "uav0", HistoryWanted(from_s=0.0, to_s=0.0))
    ]

    def ask(**wanted: object) -> Callable[[], object]:
        given = HistoryWanted(**wanted)  # type: ignore[arg-type]
        return lambda: database.history_rows("default", f"uav{draw.randrange(VEHICLES)}", given)

    def deep() -> object:
        start = (draw.choice(flights), float(draw.randrange(FLIGHT_S)), "ekf", "dutch_roll")
        return database.history_rows("default", "uav0", HistoryWanted(start=start, limit=3))

    return {
        "limit=1": ask(limit=3),
        "limit=1, one name": ask(limit=3, structures=("roll",)),
        "limit=1 from 3000 s on": ask(limit=3, from_s=3000.0),
        "limit=1 at a cursor": deep,
        "limit=1000": ask(limit=1002),
        "limit=1, no such vehicle": lambda: database.history_rows("north", "nobody", HistoryWanted(limit=3)),
    }


def main() -> None:
    """Write, ask, thin, and say what it took."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--database", help="URL or path (default: a temporary SQLite file)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        where = arguments.database or str(Path(folder) / "history.db")
        with open_database(where) as database:
            rate = write(database, arguments.rows)
            kept = database.history_size()
            print(f"{kept} rows, written at {rate:.0f} a second")
            if "://" not in where:
                size = sum(Path(f"{where}{end}").stat().st_size for end in ("", "-wal"))
                print(f"{size / kept:.0f} bytes a row, {size / 1e9:.2f} GB")
            for name, question in questions(database).items():
                median, late = timed(question)
                print(f"{name}: {median:.2f} ms in the median, {late:.2f} ms at 99 %")
            now_s = 1.7e9 + 2.0 * FLIGHT_S * arguments.rows
            retention = Retention(keep_s=float("inf"), most_rows=arguments.rows + 1)
            median, late = timed(lambda: database.prune_history(now_s, retention))
            print(f"one step of thinning: {median:.0f} ms in the median, {late:.0f} ms at 99 %")


if __name__ == "__main__":
    run_benchmark(main)
