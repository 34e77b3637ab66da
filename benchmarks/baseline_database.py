"""How long `wingwatch baseline` takes: what is shown of a year of history, what whole flights teach, files to and fro.

A year: every vehicle has as many versions of what it taught as its flights leave, or as many as are kept, and 64 cells
of each structure; the type has its expectations on the monitor's grid.

Run: python benchmarks/baseline_database.py [--vehicles 50] [--flights 10000] [--learned 3] [--minutes 10] [--seed 1]
"""

import argparse
import contextlib
import io
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from saving import run_benchmark
from sqlalchemy import insert

from wingwatch.aircraft import STRUCTURES, FlightCondition, load_aircraft
from wingwatch.baselines import (
    BaselineLedger,
    Cell,
    CellRecord,
    Database,
    ExpectationRecord,
    Reference,
    ReferenceKey,
    apriori_envelope,
    open_database,
)
from wingwatch.baselines.baseline_rows import MAX_CELLS, MAX_REFERENCE_HISTORY, put_cell
from wingwatch.baselines.tables import ReferenceRow
from wingwatch.cli.main import main as wingwatch
from wingwatch.operations.baseline_objects import Asked, list_object, show_object
from wingwatch.simulation import Scenario, doublet_schedule, simulate
from wingwatch.telemetry import write_flight

AEROSONDE = load_aircraft("aerosonde")
COMPARED = ("short_period", "lateral")
BLOCKS_A_FLIGHT = 42
"""That join what a vehicle taught in ten minutes: sixty blocks without the eighteen that are remembered."""
ASKED = 5
COMMAND = "from wingwatch.cli.main import main; raise SystemExit(main())"


def year(database: Database, vehicles: int, flights: int, generator: np.random.Generator) -> int:
    """Write a year of history; how many versions it has."""
    for structure in STRUCTURES.values():
        for point in apriori_envelope(AEROSONDE, structure).points:
            database.put_expectation(ExpectationRecord.of("aerosonde", point, 1.7e9))
    each = min(MAX_REFERENCE_HISTORY, BLOCKS_A_FLIGHT * flights // vehicles)
    for vehicle in range(vehicles):
        for name in COMPARED:
            k = len(STRUCTURES[name].derivatives)
            factor = generator.normal(size=(k, 2 * k))
            taught = Reference(factor @ factor.T, generator.normal(size=k), 1, 10.0)
            key = ReferenceKey("default", f"uav{vehicle}", "aerosonde", "clean", name)
            with database.writing() as session:
                rows = [_version(key, taught, number) for number in range(each)]
                session.execute(insert(ReferenceRow), rows)
                for cell in range(MAX_CELLS):
                    put_cell(session, CellRecord(key, Cell(cell % 8 + 18, cell // 8), taught, 1.7e9 + cell))
    return each * vehicles * len(COMPARED)


def _version(key: ReferenceKey, taught: Reference, number: int) -> dict[str, object]:
    return {
        **{name: getattr(key, name) for name in ReferenceKey.__dataclass_fields__},
        **taught.to_dict(),
        "blocks": number + 1,
        "seconds": 10.0 * (number + 1),
        "updated_at_s": 1.7e9 + 10.0 * number,
    }


def median_s(question: Callable[[], object]) -> float:
    """Median of a few askings."""
    took = []
    for _ in range(ASKED):
        began = time.perf_counter()
        question()
        took.append(time.perf_counter() - began)
    return float(np.median(took))


def command_s(*arguments: str) -> tuple[float, float]:
    """Wall-clock and processor time of a command in a process of its own, its start included."""
    before = _children_s()
    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", COMMAND, *arguments], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began, _children_s() - before


def _children_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def show_a_year(folder: Path, vehicles: int, flights: int, seed: int) -> None:
    """`list` and `show` of a year of history."""
    path = folder / "year.db"
    with open_database(path) as database:
        versions = year(database, vehicles, flights, np.random.default_rng(seed))
        size = sum(Path(f"{path}{end}").stat().st_size for end in ("", "-wal"))
        print(f"{flights} flights of {vehicles} vehicles: {versions} versions, {size / 1e9:.2f} GB")
        asked = Asked(AEROSONDE, vehicle=f"uav{vehicles // 2}")
        print(f"list: {1e3 * median_s(lambda: list_object(database)):.0f} ms")
        first = time.perf_counter()
        show_object(database, asked, 1.8e9)
        first = time.perf_counter() - first
        later = median_s(lambda: show_object(database, asked, 1.8e9))
        print(f"show: {1e3 * first:.0f} ms the first time, then {1e3 * later:.0f} ms")
    started = command_s("--version")
    for action in (("list",), ("show", "--aircraft", "aerosonde", "--vehicle", asked.vehicle or "")):
        wall, processor = command_s("baseline", action[0], str(path), *action[1:])
        print(
            f"the command `baseline {action[0]}`: {wall:.2f} s, {processor:.2f} s of processor time, "
            f"of which {started[1]:.2f} s are a Python without anything"
        )


def learn_flights(folder: Path, flights: int, minutes: float, seed: int) -> Path:
    """`learn` of flights with doublets in still air."""
    paths = []
    schedule = doublet_schedule(AEROSONDE, FlightCondition(25.0, 1000.0), np.deg2rad(2.0))
    for k in range(flights):
        path = folder / f"flight{k}.parquet"
        scenario = Scenario(AEROSONDE, manoeuvres=(schedule,), seed=seed + k)
        write_flight(simulate(scenario, 60.0 * minutes), path)
        paths.append(str(path))
    where = folder / "learned.db"
    rest = ("--aircraft", "aerosonde", "--vehicle", "uav1")
    wall, processor = command_s("baseline", "learn", str(where), *paths, *rest)
    print(
        f"learn of {flights} flights of {minutes:g} minutes: {wall:.1f} s, {processor:.1f} s of processor time; "
        f"ten of them by this: {10.0 * wall / flights:.0f} s, {10.0 * processor / flights:.0f} s"
    )
    return where


def to_and_fro(folder: Path, where: Path, other: str) -> None:
    """`export`, `import` into another database, `export` again."""
    first, second = folder / "first.json", folder / "second.json"
    for command in (
        ["import", str(where), "--aircraft", "aerosonde"],
        ["export", str(where), "--out", str(first)],
        ["import", other, "--file", str(first)],
        ["export", other, "--out", str(second)],
    ):
        with contextlib.redirect_stdout(io.StringIO()):
            assert wingwatch(["baseline", *command]) == 0, command
    with open_database(other) as database:
        content = BaselineLedger(database).content()
    equal = first.read_bytes() == second.read_bytes()
    counts = (
        f"{len(content.entries)} entries, {len(content.references)} references, {len(content.cells)} cells"
    )
    print(f"export | import | export of {counts}: {'equal to the bit' if equal else 'NOT EQUAL'}")


def main() -> None:
    """Write, ask, learn, and say what it took."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--vehicles", type=int, default=50)
    parser.add_argument("--flights", type=int, default=10_000)
    parser.add_argument("--learned", type=int, default=3, help="flights that are learned from")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--other", help="database to import into, URL or path (default: a temporary SQLite file)"
    )
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        show_a_year(folder, arguments.vehicles, arguments.flights, arguments.seed)
        where = learn_flights(folder, arguments.learned, arguments.minutes, arguments.seed)
        to_and_fro(folder, where, arguments.other or str(folder / "other.db"))


if __name__ == "__main__":
    run_benchmark(main)
