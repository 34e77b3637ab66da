"""Time and memory of a study's report over many rows.

    .venv/bin/python benchmarks/study_report.py [--rows 100000] [--effects 4] [--keep FOLDER] [--json]

The table is drawn (``study_tables``), of several effects and with the block scores of 300 s flights, and written to a
file. A process of its own then reads it, sums it up and writes the page and the JSON; its wall time, processor time and
largest resident memory are printed, all from the start of its Python on.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pyarrow.parquet as pq
from saving import run_benchmark
from study_tables import Truth, drawn_table

from wingwatch.studies.report import report_json, write_report
from wingwatch.studies.summary import summarise

__all__ = ["measure"]

_ROW_GROUP = 10_000
EFFECTS = (
    "icing",
    "elevator_effectiveness",
    "aileron_effectiveness",
    "surface_stuck",
    "wing_damage",
    "cg_shift",
)


def measure(rows: int, effects: int, folder: Path) -> dict[str, float]:
    """Draw a table into a folder, and report on it in a process of its own."""
    truth = Truth(effects=EFFECTS[:effects], sensor_fault=0.1)
    pq.write_table(drawn_table(rows, 1, truth), folder / "study.parquet", row_group_size=_ROW_GROUP)
    command = [sys.executable, __file__, "--report-on", str(folder)]
    start = time.perf_counter()
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    wall_s = time.perf_counter() - start
    found: dict[str, float] = json.loads(done.stdout)
    return {"rows": float(rows), "wall_s": wall_s} | found


def _report_on(folder: Path) -> dict[str, float]:
    summary = summarise(folder / "study.parquet")
    write_report(summary, folder / "report.html")
    (folder / "report.json").write_text(report_json(summary), encoding="utf-8")
    used = resource.getrusage(resource.RUSAGE_SELF)
    return {
        "processor_s": used.ru_utime + used.ru_stime,
        "memory_mib": _largest_memory_mib(),
        "table_mib": (folder / "study.parquet").stat().st_size / 2.0**20,
        "page_mib": (folder / "report.html").stat().st_size / 2.0**20,
        "json_mib": (folder / "report.json").stat().st_size / 2.0**20,
    }


def _largest_memory_mib() -> float:
    """Of this program alone; what resource.getrusage has counts the parent's memory at the fork too."""
    (line,) = (s for s in Path("/proc/self/status").read_text().splitlines() if s.startswith("VmHWM:"))
    return float(line.split()[1]) / 1024.0


def main() -> int:
    parser = argparse.ArgumentParser(description="Time and memory of a study's report.")
    parser.add_argument("--rows", type=int, default=100_000, help="flights in the table, at least 1")
    parser.add_argument("--effects", type=int, default=4, help=f"different effects, 1 to {len(EFFECTS)}")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where table, page and JSON are kept")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of the lines")
    parser.add_argument("--report-on", type=Path, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.report_on is not None:
        print(json.dumps(_report_on(chosen.report_on)))
        return 0
    if chosen.rows < 1 or not 1 <= chosen.effects <= len(EFFECTS):
        parser.error(f"give at least 1 row and 1 to {len(EFFECTS)} effects")
    with tempfile.TemporaryDirectory() as passing:
        folder = chosen.keep or Path(passing)
        folder.mkdir(parents=True, exist_ok=True)
        found = measure(chosen.rows, chosen.effects, folder)
    if chosen.json:
        print(json.dumps(found))
    else:
        print("\n".join(f"{name:12}{value:12.1f}" for name, value in found.items()))
    return 0


if __name__ == "__main__":
    run_benchmark(main)
