"""What leases cost: renewing, looking, taking, writing under them, and deciding, by the size of the fleet.

    .venv/bin/python benchmarks/leases.py [--vehicles 400 10000 100000] [--of-worker 250] [--database URL_OR_PATH]

One worker of many is timed. Its vehicles are ``--of-worker``, all others are held by workers of as many each. Processor
time of this process and wall clock, median of the repetitions, in milliseconds; a database server's own time is in the
wall clock alone.
"""

import argparse
import itertools
import statistics
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from saving import run_benchmark
from sqlalchemy import delete, insert

from wingwatch.baselines import (
    AlertRecord,
    Database,
    EstimateRecord,
    Lease,
    LeaseTable,
    VehicleName,
    open_database,
)
from wingwatch.baselines.tables import VehicleLeaseRow, WorkerLeaseRow
from wingwatch.service.workers.shares import Shares, Situation, Worker

REPETITIONS = 9
NEXT_S = itertools.count(100.0, 100.0)
"""Vehicles' clock: each batch of estimates is later than the last."""
ESTIMATES = 1000
ALERT = AlertRecord(
    id="a1", fleet="default", vehicle="uav0", kind="icing", cause="icing", level="warning", state="active",
    raised_s=61.0, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97, basis="a-priori", text="Ice.",
    evidence=(), created_at_s=1.0, updated_at_s=1.0,
)  # fmt: skip


def fleet_of(vehicles: int) -> list[VehicleName]:
    """Names of so many vehicles."""
    return [("default", f"uav{k}") for k in range(vehicles)]


def fill(database: Database, table: LeaseTable, vehicles: int, of_worker: int) -> dict[VehicleName, Lease]:
    """A fleet that is shared out; the leases of the first worker."""
    fleet = fleet_of(vehicles)
    owners = [f"w{k // of_worker}" for k in range(vehicles)]
    for owner in dict.fromkeys(owners):
        table.renew(owner)
    rows = [
        {"fleet": f, "vehicle": v, "owner": o, "number": 1} for (f, v), o in zip(fleet, owners, strict=True)
    ]
    with database.writing() as session:
        session.execute(insert(VehicleLeaseRow), rows)
    return {name: Lease("w0", 1) for name in fleet[:of_worker]}


def row(what: str, act: Callable[[], object], before: Callable[[], object] = lambda: None) -> None:
    """Time a call, several times, and print."""
    walls, processors = [], []
    for _ in range(REPETITIONS):
        before()
        began, spent = time.perf_counter(), time.process_time()
        act()
        walls.append(time.perf_counter() - began)
        processors.append(time.process_time() - spent)
    wall, processor = (1000.0 * statistics.median(times) for times in (walls, processors))
    print(f"  {what:62s} {wall:9.2f} {processor:9.2f}")


def estimates(of_worker: int, first_s: float) -> list[tuple[EstimateRecord, float]]:
    """A batch of history of all vehicles of a worker."""
    return [
        (
            EstimateRecord(
                "default", f"uav{k % of_worker}", first_s + k // of_worker, "short_period", "fourier", (1.0,) * 6,
                (0.1,) * 6, "converged", (25.0, 1000.0, 1.1, 0.05),
            ),
            1000.0,
        )
        for k in range(ESTIMATES)
    ]  # fmt: skip


def time_database(database: Database, vehicles: int, of_worker: int) -> None:
    """Rows of one size of fleet."""
    table = LeaseTable(database, lease_s=3600.0)
    mine = fill(database, table, vehicles, of_worker)

    def appended(leases: dict[VehicleName, Lease]) -> None:
        database.append_estimates(estimates(of_worker, next(NEXT_S)), leases)

    def free() -> None:
        for owner in ("w0", dead):
            table.give_up(owner, theirs)

    dead = f"w{(vehicles - 1) // of_worker}"
    theirs = [name for name, holder in table.look(dead, False).vehicles.items() if holder.owner == dead]
    print(f"{vehicles} vehicles, {of_worker} a worker: {'wall':>45s} {'processor':>9s}")
    row("renew", lambda: table.renew("w0"))
    row("look at the own and the free", lambda: table.look("w0", everything=False))
    row("look at everything", lambda: table.look("w0"))
    row(
        f"take all {len(theirs)} of a worker that is dead",
        lambda: table.take("w0", theirs),
        free,
    )
    row("write an alert", lambda: database.save_alert(ALERT))
    row("  under a lease", lambda: database.save_alert(ALERT, mine["default", "uav0"]))
    row(f"write {ESTIMATES} estimates", lambda: appended({}))
    row(f"  under {len(mine)} leases", lambda: appended(mine))
    with database.writing() as session:
        session.execute(delete(VehicleLeaseRow))
        session.execute(delete(WorkerLeaseRow))


def time_deciding(vehicles: int, of_worker: int) -> None:
    """Rows of one size of fleet."""
    workers = {f"w{k}": Worker(f"w{k}", 250.0) for k in range(max(2, vehicles // of_worker))}
    fleet, shares = fleet_of(vehicles), Shares()
    now = Situation("w0", workers, {}, fleet)
    joined = Situation("w0", workers | {"joins": Worker("joins", 250.0)}, {}, fleet)
    row("order of every vehicle, at the start", lambda: Shares().decide(now))
    row("  after a worker has joined", lambda: shares.decide(joined), lambda: shares.decide(now))
    row("  after a worker has left", lambda: shares.decide(now), lambda: shares.decide(joined))
    row("decide, once a second", lambda: shares.decide(now))


def main() -> None:
    """Time the leases and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--vehicles", type=int, nargs="+", default=[400, 10_000, 100_000])
    parser.add_argument("--of-worker", type=int, default=250)
    parser.add_argument(
        "--decide-up-to", type=int, default=10_000, help="vehicles of which orders are computed"
    )
    parser.add_argument("--database", help="an empty one; SQLite in a temporary folder without")
    arguments = parser.parse_args()
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        where = arguments.database or Path(folder) / "w.db"
        database = stack.enter_context(open_database(where))
        print("PostgreSQL" if "postgresql" in str(where) else "SQLite")
        for vehicles in arguments.vehicles:
            time_database(database, vehicles, arguments.of_worker)
            if vehicles <= arguments.decide_up_to:
                time_deciding(vehicles, arguments.of_worker)


if __name__ == "__main__":
    run_benchmark(main)
