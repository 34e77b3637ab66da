"""Processor time that pictures of one vehicle over time take, and what the record for them costs.

A flight is written as the service writes it, two estimators of two structures twice a second, and asked for as the page
does: as rows, as columns, thinned, and the latest second. Then the record of arrivals and blocks is fed and weighed.

Run: python benchmarks/history_series.py [--hours 3]
"""

import argparse
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from saving import run_benchmark

from wingwatch.aircraft import STRUCTURES
from wingwatch.api.series import series_of
from wingwatch.baselines import Database, EstimateRecord, HistoryWanted, open_database
from wingwatch.monitor import VehicleMonitor
from wingwatch.monitor.fleet.member.link_watch import KEPT_SECONDS, LinkWatch
from wingwatch.monitor.record_views import BlockRecord, ModeRecord
from wingwatch.monitor.vehicle.flight_record import KEPT_BLOCKS, FlightRecord
from wingwatch.simulation import demo_fleet, simulate
from wingwatch.telemetry import SampleBlock, complete

OWNER = ("default", "uav")
MODES = ("short_period", "lateral")
BOTH = ("ekf", "fourier")
STEP_S = 0.5
AT_ONCE_S = 60.0
POINTS = 1200
AT_S = 1.8e9
PIECE = 50  # samples, a second


def write(database: Database, hours: float) -> int:
    """One flight; returns how many estimates it has."""
    rng = np.random.default_rng(1)
    number = 0
    for start_s in np.arange(0.0, hours * 3600.0, AT_ONCE_S):
        rows = []
        for time_s in np.arange(start_s, start_s + AT_ONCE_S, STEP_S):
            for estimator in BOTH:
                for name in MODES:
                    k = len(STRUCTURES[name].derivatives)
                    value = tuple((-4.0 + 0.1 * rng.normal(size=k)).tolist())
                    row = EstimateRecord(
                        *OWNER, float(time_s), name, estimator, value, (0.1,) * k, "converged",
                        (25.0, 1000.0, 1.11, 0.06), "aerosonde", "clean", (0.001,) * (k * (k - 1) // 2),
                    )  # fmt: skip
                    rows.append((row, AT_S + float(time_s)))
        database.append_estimates(rows)
        number += len(rows)
    return number


def timed(what: str, ask: Callable[[], int], times: int = 3) -> None:
    """The best of some tries, and what of it a thing takes."""
    best, number = np.inf, 0
    for _ in range(times):
        began = time.process_time()
        number = ask()
        best = min(best, time.process_time() - began)
    print(f"{what:58s} {1e3 * best:9.1f} ms   {number:7d} {1e6 * best / max(number, 1):8.2f} us each")


def ask_history(database: Database, hours: float) -> None:
    """The page's questions."""
    read = partial(database.history_columns, *OWNER)
    one = HistoryWanted(structures=("short_period",))

    def nothing(*_: object) -> None:
        return None

    def thinned(wanted: HistoryWanted, names: frozenset[str] | None, points: int) -> int:
        found = series_of(read, nothing, wanted, names, points)
        return sum(len(series.time_s) for series in found)

    late = HistoryWanted(from_s=hours * 3600.0 - 1.0)
    part = HistoryWanted(from_s=1800.0, to_s=2400.0, structures=("short_period",))
    timed("estimates of one structure as rows", lambda: len(database.history_rows(*OWNER, one)))
    timed("the same as columns", lambda: sum(len(c.time_s) for c in read(one)[0]))
    timed(
        f"one derivative of the whole flight, {POINTS} points",
        lambda: thinned(one, frozenset({"m_q"}), POINTS),
    )
    timed("one derivative of ten minutes", lambda: thinned(part, frozenset({"m_q"}), POINTS))
    timed("all derivatives of the whole flight, 240 points", lambda: thinned(HistoryWanted(), None, 240))
    timed("all derivatives of the latest second", lambda: thinned(late, None, POINTS))


def weigh_record() -> None:
    """Time and memory of what is kept of a vehicle in memory."""
    stamps = [0.2 * k + 0.02 * np.arange(10.0) for k in range(KEPT_SECONDS * 5)]
    spent = _fill(LinkWatch(), stamps)
    tracemalloc.start()
    link = LinkWatch()
    _fill(link, stamps)
    print(
        f"a message of ten samples noted: {1e6 * spent / len(stamps):.1f} us; {_grown() / 1e3:.0f} kB for ten minutes"
    )
    record = FlightRecord()
    for k in range(KEPT_BLOCKS):
        modes = {n: {e: ModeRecord(0.1 * k, 0.2 * k, 0.3 * k) for e in BOTH} for n in MODES}
        record.note_blocks([BlockRecord(10.0 * k, 10.0 * k + 10.0, modes, 0.4 * k, ())])
    print(f"an hour of blocks: {_grown() / 1e3:.0f} kB with the arrivals")
    tracemalloc.stop()


def watch_record(seconds: float = 130.0) -> None:
    """What the record of blocks takes of the time of a vehicle that is watched; the demonstration's flight into ice."""
    scenario = next(one for one in demo_fleet() if one.name == "icing")
    samples = complete(simulate(scenario, seconds))
    monitor = VehicleMonitor(scenario.aircraft, "f", "v", samples.present, {}, new_id=lambda: "1")
    monitor.feed(SampleBlock(samples.values[:PIECE]))
    blocks, spent_s, began_s = 0, 0.0, time.process_time()
    for start in range(PIECE, len(samples), PIECE):
        for solution in monitor.feed(SampleBlock(samples.values[start : start + PIECE])).solutions:
            before_s = time.process_time()
            blocks += monitor.block_record(solution) is not None
            spent_s += time.process_time() - before_s
    whole_s = time.process_time() - began_s
    print(
        f"a block recorded: {1e3 * spent_s / blocks:.2f} ms, {100 * spent_s / whole_s:.1f} % of the vehicle's time"
    )


def _fill(link: LinkWatch, stamps: list[np.ndarray]) -> float:
    """Returns the seconds that it took."""
    began = time.process_time()
    for k, time_s in enumerate(stamps):
        link.note(time_s, 1000.0 + 0.2 * k)
    return time.process_time() - began


def _grown() -> int:
    return tracemalloc.get_traced_memory()[0]


def main() -> None:
    """Print every figure."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--hours", type=float, default=3.0)
    hours = arguments.parse_args().hours
    with tempfile.TemporaryDirectory() as folder, open_database(Path(folder) / "history.db") as database:
        print(f"{write(database, hours)} estimates of {hours:g} h")
        ask_history(database, hours)
    weigh_record()
    watch_record()


if __name__ == "__main__":
    run_benchmark(main)
