"""Table readers: CSV, Parquet and MATLAB files, known by their first bytes, as named columns of numbers."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.parquet as pq
import scipy
from numpy.typing import NDArray

from wingwatch.telemetry.hdf5_columns import Hdf5Error, hdf5_columns

__all__ = ["RawTable", "TableError", "read_table"]

_PARQUET_MAGIC = b"PAR1"
_MATLAB_5_MAGIC = b"MATLAB 5.0 MAT-file"
_HDF5_MAGICS = (b"\x89HDF", b"MATLAB 7.3")
_FORMATS = "CSV, Parquet and MATLAB .mat (version 5 to 7.3)"
_DELIMITERS = ",;\t"
_MAX_BLOCK_BYTES = 2**31 - 1  # one block, so that a column has one type; the reader counts in 32 bits


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
    """

    columns: Mapping[str, NDArray[np.float64]]
    source: str
    format: str
    ignored: tuple[str, ...]
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


def read_table(path: Path) -> RawTable:
    """Every numeric column of a file.

    Raises:
        TableError: the file is missing, unreadable, empty, truncated, damaged or of no known format.
    """
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise TableError(f"{path}: there is no such file") from None
    except OSError as problem:
        raise TableError(f"{path}: cannot be read: {problem.strerror}") from None
    if not data.strip():
        raise TableError(f"{path}: the file is empty")
    if data.startswith(_PARQUET_MAGIC):
        return _read_parquet(str(path), data)
    if data.startswith(_MATLAB_5_MAGIC):
        return _read_matlab(str(path), data)
    if data.startswith(_HDF5_MAGICS):
        return _read_hdf5(str(path), data)
    if b"\0" in data[:4096]:
        raise TableError(f"{path}: the format is not known; {_FORMATS} can be read")
    return _read_csv(str(path), data)


def _read_csv(source: str, data: bytes) -> RawTable:
    text = data.removeprefix(b"\xef\xbb\xbf")
    encoding = "utf-8" if _is_utf8(text) else "latin-1"
    header = text.split(b"\n", 1)[0].decode(encoding).strip("\r")
    delimiter = max(_DELIMITERS, key=header.count)
    names = [name.strip().strip('"') for name in header.split(delimiter)]
    _check_header(source, names)
    short_rows: list[int] = []
    table = _parse_csv(source, text, encoding, delimiter, short_rows)
    if table.num_rows == 0:
        raise TableError(f"{source}: the file has a header and no rows")
    notes = [] if text.endswith(b"\n") else ["no line end after the last row: it may be cut short"]
    if short_rows:
        notes.append(f"{len(short_rows)} rows left out because they do not have {len(names)} fields")
    columns, ignored = _numeric(zip(names, table.columns, strict=True), notes)
    return _table(source, "csv", columns, ignored, notes)


def _is_utf8(text: bytes) -> bool:
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _check_header(source: str, names: list[str]) -> None:
    if all(_is_number(name) for name in names):
        raise TableError(f"{source}: the first line must name the columns, and it holds numbers only")
    if len(names) == 1:
        raise TableError(f"{source}: no table with commas, semicolons or tabs; {_FORMATS} can be read")
    name, times = Counter(names).most_common(1)[0]
    if times > 1:
        raise TableError(f"{source}: the column {name!r} stands {times} times; rename all but one")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _parse_csv(source: str, text: bytes, encoding: str, delimiter: str, short_rows: list[int]) -> Any:
    def skip(row: Any) -> str:
        short_rows.append(row.actual_columns)
        return "skip"

    try:
        return pacsv.read_csv(
            BytesIO(text),
            read_options=pacsv.ReadOptions(
                # a thread of the reader that outlived a refused file could abort the program at its end
                use_threads=False,
                encoding=encoding,
                block_size=min(len(text), _MAX_BLOCK_BYTES),
            ),
            parse_options=pacsv.ParseOptions(delimiter=delimiter, invalid_row_handler=skip),
        )
    except (pa.ArrowException, ValueError) as problem:
        raise TableError(f"{source}: cannot be read as CSV: {_first_line(problem)}") from None


def _read_parquet(source: str, data: bytes) -> RawTable:
    if len(data) < 12 or not data.endswith(_PARQUET_MAGIC):
        raise TableError(f"{source}: the Parquet file is truncated: it has no footer; copy it again")
    try:
        table = pq.read_table(BytesIO(data))
    except (pa.ArrowException, OSError, ValueError) as problem:
        raise TableError(f"{source}: the Parquet file is damaged: {_first_line(problem)}") from None
    if table.num_rows == 0:
        raise TableError(f"{source}: the Parquet file has no rows")
    name, times = Counter(table.column_names).most_common(1)[0] if table.column_names else ("", 0)
    if times > 1:
        raise TableError(f"{source}: the column {name!r} stands {times} times; rename all but one")
    notes: list[str] = []
    columns, ignored = _numeric(zip(table.column_names, table.columns, strict=True), notes)
    return _table(source, "parquet", columns, ignored, notes)


def _numeric(named: Any, notes: list[str]) -> tuple[dict[str, NDArray[np.float64]], list[str]]:
    """Arrow columns as float64; text that is mostly numbers keeps them, and says how many cells are none."""
    columns: dict[str, NDArray[np.float64]] = {}
    ignored: list[str] = []
    without_number: list[str] = []
    for name, column in named:
        kind = column.type
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            numbers, bad = _numbers_in_text(column)
            if 2 * bad > len(column):
                ignored.append(f"{name} (text)")
                continue
            columns[name] = numbers
            without_number.append(f"{name} {bad}")
        elif pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
            columns[name] = np.array(pc.cast(column, pa.float64(), safe=False).to_numpy(), dtype=np.float64)
        else:
            ignored.append(f"{name} ({'empty' if pa.types.is_null(kind) else kind})")
    if without_number:
        notes.append(f"cells that hold no number: {', '.join(without_number)}")
    return columns, ignored


def _numbers_in_text(column: Any) -> tuple[NDArray[np.float64], int]:
    cells = column.to_pylist()
    good = [cell is not None and _is_number(cell) for cell in cells]
    numbers = [float(cell) if ok else np.nan for cell, ok in zip(cells, good, strict=True)]
    return np.array(numbers, dtype=np.float64), len(cells) - sum(good)


def _read_matlab(source: str, data: bytes) -> RawTable:
    file: Any = BytesIO(data)
    try:
        variables = scipy.io.loadmat(file, struct_as_record=True, chars_as_strings=True)
    except Exception as problem:  # a damaged file makes the reader raise almost anything
        raise TableError(
            f"{source}: the MATLAB file is truncated or damaged ({_first_line(problem)}); copy it again"
        ) from None
    vectors: dict[str, NDArray[np.float64]] = {}
    ignored: list[str] = []
    leaves = [
        leaf
        for name, value in variables.items()
        if not name.startswith("__")
        for leaf in _leaves(name, value)
    ]
    fields = Counter(name.rpartition(".")[2] for name, _ in leaves)
    for name, value in leaves:
        field = name.rpartition(".")[2]
        _sort_vector(field if fields[field] == 1 else name, value, vectors, ignored)
    if not vectors:
        raise TableError(f"{source}: the MATLAB file holds no vector of numbers, alone or in a struct")
    rows = Counter(len(vector) for vector in vectors.values()).most_common(1)[0][0]
    columns = {name: vector for name, vector in vectors.items() if len(vector) == rows}
    ignored += [f"{name} ({len(v)} values)" for name, v in vectors.items() if len(v) != rows]
    return _table(source, "matlab", columns, ignored, [])


def _read_hdf5(source: str, data: bytes) -> RawTable:
    try:
        columns, ignored = hdf5_columns(data)
    except Hdf5Error as problem:
        raise TableError(f"{source}: {problem}") from None
    return _table(source, "matlab", columns, ignored, [])


def _leaves(name: str, value: Any) -> list[tuple[str, Any]]:
    """A variable, or the fields of a single struct."""
    if isinstance(value, np.ndarray) and value.dtype.names is not None and value.size == 1:
        return [(f"{name}.{field}", value[field].item()) for field in value.dtype.names]
    return [(name, value)]


def _sort_vector(name: str, value: Any, vectors: dict[str, NDArray[np.float64]], ignored: list[str]) -> None:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
        ignored.append(f"{name} (no numbers)")
    elif value.size <= 1:
        ignored.append(f"{name} (scalar)")
    elif value.size != max(value.shape):
        ignored.append(f"{name} (matrix {' x '.join(map(str, value.shape))})")
    else:
        vectors[name] = np.array(value.reshape(-1), dtype=np.float64)


def _table(
    source: str, form: str, columns: dict[str, NDArray[np.float64]], ignored: list[str], notes: list[str]
) -> RawTable:
    if not columns:
        raise TableError(f"{source}: no column holds numbers")
    return RawTable(columns, source, form, tuple(ignored), tuple(notes))


def _first_line(problem: Exception) -> str:
    return str(problem).strip().split("\n", 1)[0].rstrip(".") or type(problem).__name__
