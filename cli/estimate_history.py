"""Every estimate of a flight over time, beside what was expected at that moment, as a CSV or Parquet file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from wingwatch.estimators import Estimate
from wingwatch.monitor import Report, VehicleMonitor
from wingwatch.operations.convention import in_convention
from wingwatch.operations.faults import CommandError

__all__ = ["COLUMNS", "HistoryWriter"]

COLUMNS: dict[str, pa.DataType] = {
    "time_s": pa.float64(),
    "estimator": pa.string(),
    "structure": pa.string(),
    "derivative": pa.string(),
    "value": pa.float64(),
    "standard_error": pa.float64(),
    "unit": pa.string(),
    "outcome": pa.string(),
    "expected": pa.float64(),
    "expected_standard_error": pa.float64(),
}
"""One row a derivative; the first eight are those of the REST history. Empty where nothing is known."""

_CONDITION = ("airspeed_true_m_s", "altitude_m", "air_density_kg_m3", "angle_of_attack_rad")


class HistoryWriter:
    """Listens to a flight being watched and writes the file at its end.

    Args:
        path: ends in ``.csv`` or ``.parquet``.
        estimator: only this one; both where None.
        convention: of values, errors and expectations.

    Raises:
        CommandError: another suffix, or a folder that does not exist.
    """

    def __init__(self, path: Path, estimator: str | None = None, convention: str = "concise") -> None:
        if path.suffix.lower() not in (".csv", ".parquet"):
            raise CommandError(f"--history {path}: give a name that ends in .csv or .parquet")
        if not path.parent.is_dir():
            raise CommandError(f"--history {path}: the folder {path.parent} does not exist; make it first")
        self._path = path
        self._estimator = estimator
        self._convention = convention
        self._rows: list[tuple[object, ...]] = []

    def __call__(self, monitor: VehicleMonitor, report: Report) -> None:
        """Take the estimates of the solutions that a piece of the flight led to."""
        for solution in report.solutions:
            for mode in solution.modes.values():
                for estimate in mode.estimates:
                    if self._estimator in (None, estimate.estimator):
                        self._take(monitor, estimate, mode.condition, solution.time_s)

    def close(self) -> None:
        """Write the file.

        Raises:
            CommandError: it cannot be written.
        """
        columns = list(zip(*self._rows, strict=True)) or [() for _ in COLUMNS]
        table = pa.table(
            [pa.array(values, kind) for values, kind in zip(columns, COLUMNS.values(), strict=True)],
            names=list(COLUMNS),
        )
        try:
            if self._path.suffix.lower() == ".csv":
                pacsv.write_csv(table, self._path)
            else:
                pq.write_table(table, self._path)
        except OSError as error:
            reason = error.strerror or "it cannot be written"
            raise CommandError(f"--history {self._path}: {reason.lower()}; choose another path") from error

    def _take(
        self, monitor: VehicleMonitor, estimate: Estimate, latest: Sequence[float], time_s: float
    ) -> None:
        """Rows of one estimate; ``latest`` is the condition where it has none of its own yet."""
        name = estimate.structure.name
        at = estimate.condition if np.isfinite(estimate.condition[:2]).all() else latest
        if not np.isfinite(at[:2]).all():
            return
        mode = monitor.mode_object(estimate) | {"condition": dict(zip(_CONDITION, at, strict=True))}
        made = in_convention({"": {name: mode}}, monitor.aircraft, self._convention, monitor.configuration)
        for symbol, row in made[""][name]["derivatives"].items():
            self._rows.append((
                time_s, estimate.estimator, name, symbol, _known(row["value"]), _known(row["standard_error"]),
                row["unit"], row["outcome"], _known(row.get("expected")), _known(row.get("expected_standard_error")),
            ))  # fmt: skip


def _known(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None
