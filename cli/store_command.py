"""`wingwatch store`: the database is copied, checked, and its history thinned."""

import argparse
import time
from dataclasses import asdict
from typing import Any

from wingwatch.baselines import Retention, open_database
from wingwatch.baselines.upkeep import backup, check
from wingwatch.operations.baseline import check_exists
from wingwatch.operations.progress import write_json

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> int:
    """Carry out the command."""
    check_exists("DB", arguments.database)
    actions = {"backup": _backup, "check": _check, "prune": _prune}
    result, sentence, code = actions[arguments.action](arguments)
    if arguments.json:
        write_json(result)
    else:
        print(sentence)
    return code


def _backup(arguments: argparse.Namespace) -> tuple[dict[str, Any], str, int]:
    size = backup(arguments.database, arguments.out)
    return (
        {"file": str(arguments.out), "size_bytes": size},
        f"{arguments.out}: {size / 1e6:.1f} MB, checked",
        0,
    )


def _check(arguments: argparse.Namespace) -> tuple[dict[str, Any], str, int]:
    report = check(arguments.database)
    result = asdict(report) | {"sound": not report.faults}
    lines = [
        f"schema {report.schema or 'none'}, newest {report.newest}; {report.size_bytes / 1e6:.1f} MB",
        *(f"{name}: {rows} rows" for name, rows in report.rows.items()),
        "The database is sound."
        if not report.faults
        else f"The database is damaged: {'; '.join(report.faults)}.",
    ]
    return result, "\n".join(lines), 0 if not report.faults else 2


def _prune(arguments: argparse.Namespace) -> tuple[dict[str, Any], str, int]:
    retention = Retention(
        full_rate_s=3600.0 * arguments.full_rate_hours,
        interval_s=arguments.interval_s,
        keep_s=86_400.0 * arguments.keep_days,
        most_rows=arguments.most_rows,
    )
    with open_database(arguments.database) as database:
        before = database.history_size()
        while database.prune_history(time.time(), retention):
            time.sleep(0.0)  # a running service writes in between
        after = database.history_size()
    text = f"{before} estimates before, {after} after; an SQLite file keeps its size and uses the room again"
    return {"before": before, "after": after}, text, 0
