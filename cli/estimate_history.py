"""Every estimate of a flight over time, beside what was expected at that moment, as a CSV or Parquet file."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from wingwatch.aircraft import DERIVATIVES, FlightCondition
from wingwatch.baselines import OutOfEnvelope
from wingwatch.cli.faults import CommandError
from wingwatch.estimators import Estimate
from wingwatch.monitor import Report, VehicleMonitor

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


class HistoryWriter:
    """Listens to a flight being watched and writes the file at its end.

    Args:
        path: ends in ``.csv`` or ``.parquet``.
        estimator: only this one; both where None.

    Raises:
        CommandError: another suffix, or a folder that does not exist.
    """

    def __init__(self, path: Path, estimator: str | None = None) -> None:
        if path.suffix.lower() not in (".csv", ".parquet"):
            raise CommandError(f"--history {path}: give a name that ends in .csv or .parquet")
        if not path.parent.is_dir():
            raise CommandError(f"--history {path}: the folder {path.parent} does not exist; make it first")
        self._path = path
        self._estimator = estimator
        self._rows: list[tuple[object, ...]] = []

    def __call__(self, monitor: VehicleMonitor, report: Report) -> None:
        """Take the estimates of the solutions that a piece of the flight led to."""
        for solution in report.solutions:
            for mode in solution.modes.values():
                for estimate in (mode.fourier, mode.ekf):
                    if self._estimator in (None, estimate.estimator):
                        self._take(monitor, estimate, solution.time_s)

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

    def _take(self, monitor: VehicleMonitor, estimate: Estimate, time_s: float) -> None:
        k = len(estimate.structure.derivatives)
        expected, spread = _expected(monitor, estimate) or ((np.nan,) * k, (np.nan,) * k)
        columns = (estimate.value, estimate.standard_error, estimate.outcomes, expected, spread)
        for symbol, value, error, outcome, mean, std in zip(
            estimate.structure.derivatives, *columns, strict=True
        ):
            unit = DERIVATIVES[symbol].unit
            where = (time_s, estimate.estimator, estimate.structure.name, symbol)
            self._rows.append(
                (*where, _known(value), _known(error), unit, str(outcome), _known(mean), _known(std))
            )


def _expected(
    monitor: VehicleMonitor, estimate: Estimate
) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    airspeed, altitude, density, alpha = (float(x) for x in estimate.condition)
    if not (np.isfinite(airspeed) and airspeed > 0.0 and np.isfinite(density)):
        return None
    condition = FlightCondition(
        airspeed, altitude, density, monitor.configuration, alpha if np.isfinite(alpha) else 0.0
    )
    found = monitor.expectation(estimate.structure, condition)
    if isinstance(found, OutOfEnvelope):
        return None
    return tuple(found.value.tolist()), tuple(found.standard_error.tolist())


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
