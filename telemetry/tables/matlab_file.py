"""MATLAB files up to version 7: vectors, matrices, structs, arrays of structs."""

from collections import Counter
from collections.abc import Iterator, Sequence
from io import BytesIO
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.telemetry.tables.raw_table import RawTable, TableError, first_line, make_table
from wingwatch.telemetry.units import unit_in_brackets

__all__ = ["MATLAB_5_MAGIC", "read_matlab", "table_of"]

MATLAB_5_MAGIC = b"MATLAB 5.0 MAT-file"

Array = NDArray[np.float64]

_DEPTH = 6
_MOST_PARTS = 16
"""An array of more structs than this, whose fields are no longer than this, has one row a struct."""
_MOST_COLUMNS = 4096
_TABLE_ADVICE = "save it as numbers, with s = table2struct(t, 'ToScalar', true) and save(..., '-struct', 's')"


def read_matlab(source: str, data: bytes) -> RawTable:
    """Every vector of numbers of the common length, by its own name where that is the only one.

    A matrix of samples by channels is one column a channel, ``fdata[0]`` first; so are fields of several columns. A
    list of as many names gives the columns these names, too. An array of structs is one row a struct where its fields
    are scalars, and ``log[0].field`` where they are vectors.

    Raises:
        TableError: the file is truncated or damaged, or holds no vector of numbers.
    """
    file: Any = BytesIO(data)
    try:
        variables = scipy.io.loadmat(file, struct_as_record=True, chars_as_strings=True)
    except Exception as problem:  # a damaged file makes the reader raise almost anything
        raise TableError(
            f"{source}: the MATLAB file is truncated or damaged ({first_line(problem)}); copy it again"
        ) from None
    kept = {name: value for name, value in variables.items() if not name.startswith("__")}
    opaque = any(_is_opaque(value) for value in variables.values()) or "__function_workspace__" in variables
    return table_of(source, [leaf for name, value in kept.items() for leaf in _leaves(name, value)], opaque)


def table_of(
    source: str, leaves: Sequence[tuple[str, Any]], opaque: bool = False, what: str = "MATLAB"
) -> RawTable:
    """The table of what a file holds, by full names such as ``log.imu.q``.

    Args:
        source: the file.
        leaves: arrays and other values.
        opaque: whether the file has objects that cannot be read.
        what: kind of the file.

    Raises:
        TableError: no vector of numbers is among them.
    """
    found = _Found()
    fields = Counter(name.rpartition(".")[2] for name, _ in leaves)
    for name, value in leaves:
        field = name.rpartition(".")[2]
        found.take(field if fields[field] == 1 else name, value)
    rows = found.rows()
    if rows is None:
        advice = f": it holds a table or another object; {_TABLE_ADVICE}" if opaque else ""
        raise TableError(
            f"{source}: the {what} file holds no vector of numbers, alone or in a struct{advice}"
        )
    columns = found.columns(rows)
    notes = [f"a table or another object of the file is not read: {_TABLE_ADVICE}"] if opaque else []
    notes += found.name_columns(columns, rows)
    units = {name: unit for name in columns if (unit := unit_in_brackets(name)) is not None}
    return make_table(source, "matlab", columns, found.ignored, notes, units)


class _Found:
    """Vectors, matrices and lists of names of a file."""

    def __init__(self) -> None:
        self.ignored: list[str] = []
        self._vectors: dict[str, Array] = {}
        self._matrices: dict[str, Array] = {}
        self._names: dict[str, list[str]] = {}

    def take(self, name: str, value: Any) -> None:
        """Sort a leaf in."""
        words = _words(value)
        if words is not None:
            self._names[name] = words
            self.ignored.append(f"{name} (no numbers)")
        elif not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
            self.ignored.append(f"{name} (no numbers)")
        elif value.size <= 1:
            self.ignored.append(f"{name} (scalar)")
        elif value.size == max(value.shape):
            self._vectors[name] = np.array(value.reshape(-1), dtype=np.float64)
        elif (flat := value.squeeze()).ndim == 2:
            self._matrices[name] = np.array(flat, dtype=np.float64)
        else:
            self.ignored.append(f"{name} (matrix {' x '.join(map(str, value.shape))})")

    def rows(self) -> int | None:
        """The length that most vectors have, or that of a matrix which holds more than these; None without any."""
        votes = Counter(len(vector) for vector in self._vectors.values())
        usual = votes.most_common(1)[0][0] if votes else 0
        held = {usual: usual * votes[usual]} if votes else {}
        for matrix in self._matrices.values():
            rows = max(matrix.shape)
            held[rows] = held.get(rows, 0) + matrix.size
        return max(held, key=lambda n: held[n]) if held else None

    def columns(self, rows: int) -> dict[str, Array]:
        """Columns of that length; the rest is named among what is ignored."""
        columns: dict[str, Array] = {}
        for name, vector in self._vectors.items():
            if len(vector) == rows:
                columns[name] = vector
            else:
                self.ignored.append(f"{name} ({len(vector)} values)")
        for name, matrix in self._matrices.items():
            along = matrix if matrix.shape[0] == rows else matrix.T
            if along.shape[0] != rows or along.shape[1] > _MOST_COLUMNS:
                self.ignored.append(f"{name} (matrix {matrix.shape[0]} x {matrix.shape[1]})")
                continue
            columns |= {f"{name}[{k}]": np.ascontiguousarray(along[:, k]) for k in range(along.shape[1])}
        return columns

    def name_columns(self, columns: dict[str, Array], rows: int) -> list[str]:
        """Columns by a list of names in the file, where one matrix has as many; what was done, one clause each."""
        notes = []
        for label, words in self._names.items():
            fit = [n for n, m in self._matrices.items() if sorted(m.shape) == sorted((rows, len(words)))]
            if len(fit) != 1 or len(words) < 2 or len(set(words)) != len(words) or set(words) & set(columns):
                continue
            columns |= {word: columns[f"{fit[0]}[{k}]"] for k, word in enumerate(words)}
            notes.append(f"columns of {fit[0]} have the names that {label} lists")
        return notes


def _leaves(name: str, value: Any, depth: int = 0) -> Iterator[tuple[str, Any]]:
    """A variable, or what structs hold, down to what is none."""
    if not (isinstance(value, np.ndarray) and value.dtype.names is not None) or depth >= _DEPTH:
        yield name, value
        return
    elements = value.reshape(-1)
    for field in value.dtype.names:
        held = [element[field] for element in elements]
        sizes = {part.shape for part in held if isinstance(part, np.ndarray)}
        simple = all(isinstance(part, np.ndarray) and part.dtype.kind in "biuf" for part in held)
        if len(held) == 1:
            yield from _leaves(f"{name}.{field}", held[0], depth + 1)
        elif simple and len(sizes) == 1 and 0 < held[0].size <= _MOST_PARTS < len(held):
            yield f"{name}.{field}", np.stack([part.reshape(-1) for part in held])
        else:
            for k, part in enumerate(held[:_MOST_COLUMNS]):
                yield from _leaves(f"{name}[{k}].{field}", part, depth + 1)


def _words(value: Any) -> list[str] | None:
    """A list of names: a cell array of text, or the rows of a matrix of characters."""
    if not isinstance(value, np.ndarray):
        return None
    if value.dtype.kind == "U" and value.size > 1:
        return [str(word).strip() for word in value.reshape(-1)]
    if value.dtype == object and value.size > 1:
        cells = [cell.reshape(-1) if isinstance(cell, np.ndarray) else cell for cell in value.reshape(-1)]
        words = [cell[0] if isinstance(cell, np.ndarray) and cell.size == 1 else cell for cell in cells]
        if all(isinstance(word, str) for word in words):
            return [str(word).strip() for word in words]
    return None


def _is_opaque(value: Any) -> bool:
    return type(value).__name__ == "MatlabOpaque" or (
        isinstance(value, np.ndarray) and value.dtype.names is not None and "s2" in value.dtype.names
    )
