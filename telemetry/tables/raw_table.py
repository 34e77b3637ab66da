"""A table as its file has it: named columns of numbers, and what is known of them."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["RawTable", "TableError", "first_line", "make_table", "one_of_each"]

Array = NDArray[np.float64]


class TableError(ValueError):
    """A file that cannot be read as a table; one sentence naming the file, what is wrong and what to do."""


@dataclass(frozen=True, slots=True)
class RawTable:
    """A table as its file has it, before any map.

    Attributes:
        columns: numeric columns by name, shape (rows,), float64; a cell without a number is NaN.
        source: the file.
        format: ``csv``, ``parquet`` or ``matlab``.
        ignored: columns that are no vector of numbers of the table's length, each with the reason.
        notes: what was lost or doubtful while reading, one clause each.
        units: by column, the unit as the file writes it (a row of units, or brackets in the column's name).
        doubled: names that several unlike columns share; none of them is in ``columns``.
        stamps: columns that the file has as a date, a time of day or a duration; they are in seconds.
    """

    columns: Mapping[str, Array]
    source: str
    format: str
    ignored: tuple[str, ...]
    notes: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    doubled: tuple[str, ...] = ()
    stamps: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


def make_table(
    source: str,
    form: str,
    columns: Mapping[str, Array],
    ignored: Sequence[str],
    notes: Sequence[str],
    units: Mapping[str, str] | None = None,
    doubled: Sequence[str] = (),
    stamps: Sequence[str] = (),
) -> RawTable:
    """The table of what a reader found.

    Raises:
        TableError: there is no column of numbers.
    """
    if not columns and not doubled:
        raise TableError(f"{source}: no column holds numbers; give a table of samples")
    known = {name: unit for name, unit in (units or {}).items() if name in columns}
    return RawTable(columns, source, form, tuple(ignored), tuple(notes), known, tuple(doubled), tuple(stamps))


def one_of_each(named: Iterable[tuple[str, Array]]) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Columns by name, and the names that unlike columns share; of equal columns the first one counts."""
    found = list(named)
    times = Counter(name for name, _ in found)
    columns: dict[str, Array] = {}
    doubled: dict[str, None] = {}
    for name, column in found:
        if name in columns and not np.array_equal(columns[name], column, equal_nan=True):
            doubled[name] = None
        columns.setdefault(name, column)
    assert all(times[name] > 1 for name in doubled)
    return {name: column for name, column in columns.items() if name not in doubled}, tuple(doubled)


def first_line(problem: Exception) -> str:
    """What another library says, as a clause."""
    return str(problem).strip().split("\n", 1)[0].rstrip(".") or type(problem).__name__
