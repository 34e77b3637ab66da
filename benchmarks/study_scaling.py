"""What a study costs with one worker and with two: wall clock, processor time of the flights, and equal rows.

    .venv/bin/python benchmarks/study_scaling.py [--flights 64] [--seconds 300] [--workers 1 2] [--json]

The flights are those of the default icing study, from seed 0 on, in tasks of 16 (at 300 s). Each number of workers
flies all of them in processes of its own, whose start is part of the wall clock. Where other programs want the
processors too, the wall clock says little.
"""

import argparse
import json
import os
import tempfile
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from saving import run_benchmark

from wingwatch.studies import StudySettings, load_fleet, load_grid, read_study
from wingwatch.studies.local_workers import LocalWorkers
from wingwatch.studies.run import run_study
from wingwatch.studies.versions import code_version, settings_version

__all__ = ["Cost", "measure"]

_TIMINGS = ("wall_s", "processor_s", "command")


@dataclass(frozen=True, slots=True)
class Cost:
    """Of one run.

    Attributes:
        watched_h: hours of flight that were flown and watched.
        wall_s: of the whole run; processor_s: of the flights alone, all workers together.
        load: processes that wanted to run when it began, this benchmark's not among them.
    """

    workers: int
    watched_h: float
    wall_s: float
    processor_s: float
    load: float


def measure(flights: int, seconds: float, workers: tuple[int, ...], folder: Path) -> tuple[list[Cost], bool]:
    """Fly the same study with each number of workers; costs, and whether all rows were the same to the bit."""
    grid = load_grid("icing", None).model_copy(update={"seconds": seconds})
    settings = StudySettings("icing", grid, 0, flights, load_fleet(grid), code_version(), settings_version())
    costs: list[Cost] = []
    seen: list[list[str]] = []
    for number in workers:
        out, load, began_s = folder / f"{number}.parquet", os.getloadavg()[0], time.perf_counter()
        run_study(
            settings,
            out,
            LocalWorkers(number),
            resume=False,
            end=threading.Event(),
            show=lambda progress: None,
        )
        wall_s = time.perf_counter() - began_s
        rows = read_study(out).table.to_pylist()
        seen.append([repr({k: v for k, v in row.items() if k not in _TIMINGS}) for row in rows])
        watched_h = sum(row["flight_s"] for row in rows) / 3600.0
        costs.append(Cost(number, watched_h, wall_s, sum(row["processor_s"] for row in rows), load))
    return costs, all(one == seen[0] for one in seen)


def main() -> None:
    parser = argparse.ArgumentParser(description="A study with one worker and with two.")
    parser.add_argument("--flights", type=int, default=64)
    parser.add_argument("--seconds", type=float, default=300.0, help="of a flight")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        costs, same = measure(arguments.flights, arguments.seconds, tuple(arguments.workers), Path(name))
    if arguments.json:
        print(json.dumps({"costs": [asdict(cost) for cost in costs], "same": same}))
        return
    print(
        f"{'workers':>8}{'watched, h':>12}{'wall, s':>10}{'processor, s':>14}{'an hour, s':>12}{'load before':>13}"
    )
    for cost in costs:
        print(
            f"{cost.workers:8d}{cost.watched_h:12.2f}{cost.wall_s:10.0f}{cost.processor_s:14.0f}"
            f"{cost.processor_s / cost.watched_h:12.1f}{cost.load:13.1f}"
        )
    print(f"rows the same to the bit: {'yes' if same else 'no'}")


if __name__ == "__main__":
    run_benchmark(main)
