"""The columns of a study's table as arrays, and groups of its rows."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

__all__ = ["Rows"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]

_BATCH = 2000
_LONG = ("block_scores", "expectation_error", "icing_factors", "alerts")
"""Columns whose texts are most of a study's file."""


class Rows:
    """A study's rows, column by column.

    Args:
        columns: a pyarrow table, or an array a column, or the study's file, of which long texts are then never in
            memory all at once; names and types are those of ``table.COLUMNS``.
        aircraft: what the grid's names of aircraft are shown as: own aircraft are paths there.
    """

    def __init__(
        self, columns: pa.Table | Mapping[str, Any] | Path, aircraft: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        self._file = columns if isinstance(columns, Path) else None
        if isinstance(columns, Path):
            short = [name for name in pq.read_schema(columns).names if name not in _LONG]
            columns = pq.read_table(columns, columns=short)
        table = columns if isinstance(columns, pa.Table) else pa.table(dict(columns))
        self._columns = _renamed(table, aircraft) if aircraft else table
        self._words: dict[str, tuple[NDArray[np.object_], NDArray[np.int64]]] = {}
        self._numbers: dict[str, Array] = {}

    def __len__(self) -> int:
        return int(self._columns.num_rows)

    def number(self, name: str) -> Array:
        """A column of numbers; NaN where it has none."""
        if name not in self._numbers:
            column = self._columns[name].cast(pa.float64())
            self._numbers[name] = np.asarray(column.to_numpy(), dtype=np.float64)
        return self._numbers[name]

    def flag(self, name: str) -> Flags:
        """A column of truths."""
        return np.asarray(self._columns[name].to_numpy(zero_copy_only=False), dtype=np.bool_)

    def words(self, name: str) -> NDArray[np.object_]:
        """A column of texts, of which few differ; rows share the texts."""
        known, codes = self._coded(name)
        return known[codes]

    def text(self, name: str, row: int) -> str:
        """One text of a column."""
        return str(self._columns[name][int(row)].as_py() or "")

    def texts(self, name: str, rows: Indices) -> Iterator[tuple[int, str]]:
        """Texts of a column at rows in their order; few of them are in memory at once."""
        last = 0
        for batch in self._batches(name):
            first, last = last, last + len(batch)
            part = rows[np.searchsorted(rows, first) : np.searchsorted(rows, last)]
            yield from zip(part.tolist(), batch.take(pa.array(part - first)).to_pylist(), strict=True)

    def _batches(self, name: str) -> Iterator[pa.Array]:
        if self._file is not None and name in _LONG:
            with pq.ParquetFile(self._file) as file:
                for batch in file.iter_batches(_BATCH, columns=[name], use_threads=False):
                    yield batch.column(0)
        else:
            for batch in self._columns.select([name]).to_batches(_BATCH):
                yield batch.column(0)

    def groups(self, name: str, among: Flags, order: Sequence[str] = ()) -> dict[str, Flags]:
        """Rows by a column's words: known ones in their order, then the others by the alphabet."""
        known, codes = self._coded(name)
        present = {str(known[k]): int(k) for k in np.unique(codes[among])}
        names = [w for w in order if w in present] + sorted(w for w in present if w not in order)
        return {w: among & (codes == present[w]) for w in names}

    def _coded(self, name: str) -> tuple[NDArray[np.object_], NDArray[np.int64]]:
        if name not in self._words:
            coded = self._columns[name].cast(pa.string()).fill_null("").combine_chunks().dictionary_encode()
            if isinstance(coded, pa.ChunkedArray):
                coded = coded.unify_dictionaries().combine_chunks()
            known = np.array([*coded.dictionary.to_pylist(), ""], dtype=object)
            self._words[name] = known, np.asarray(coded.indices.to_numpy(), dtype=np.int64)
        return self._words[name]


def _renamed(table: pa.Table, names: Mapping[str, str]) -> pa.Table:
    """The table with other names of aircraft."""
    place = table.column_names.index("aircraft")
    column = table.column(place).to_pylist()
    return table.set_column(
        place, "aircraft", pa.array([names.get(name, name) for name in column], pa.string())
    )
