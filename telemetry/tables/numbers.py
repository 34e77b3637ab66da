"""Columns of Arrow as numbers: numbers, text that holds numbers, dates, times of day and durations."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from wingwatch.telemetry.tables.stamps import Stamps, stamps_in_text

__all__ = ["Numbers", "is_number", "numbers_of"]

Array = NDArray[np.float64]

_THOUSANDS_POINTS = re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d+")
_THOUSANDS_COMMAS = re.compile(r"[+-]?\d{1,3}(,\d{3})+(\.\d*)?")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_FORTRAN = re.compile(r"([+-]?\d*\.?\d+|[+-]?\d+\.)[dD]([+-]?\d+)")
_PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
_DAY_S = 86_400.0


@dataclass(slots=True)
class Numbers:
    """What was made of the columns of a table.

    Attributes:
        columns: name and numbers, in the order of the table; a name may come twice.
        ignored: columns that hold no numbers, with the reason.
        notes: what was lost or doubtful, one clause each.
        stamps: columns that were dates, times of day or durations.
    """

    columns: list[tuple[str, Array]] = field(default_factory=list)
    ignored: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    stamps: list[str] = field(default_factory=list)


def is_number(text: str) -> bool:
    """Whether Python reads the text as a number; ``nan`` and ``inf`` are numbers."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def numbers_of(named: Iterable[tuple[str, Any]], decimal_comma: bool = False) -> Numbers:
    """Arrow columns as float64.

    Text that is mostly numbers keeps them, and says how many cells are none. A stamp counts seconds (``Stamps``).

    Args:
        named: names and columns.
        decimal_comma: whether the table is one of decimal commas, so that ``1,234`` is a little more than one.
    """
    found = Numbers()
    without_number: list[str] = []
    for name, column in named:
        kind = column.type
        if pa.types.is_dictionary(kind):
            column = column.cast(kind.value_type)
            kind = column.type
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            cells = [None if cell is None else cell.strip() for cell in column.to_pylist()]
            numbers, good, bad = _numbers_in_text(cells, decimal_comma)
            if good >= max(bad, 1):
                found.columns.append((name, numbers))
                if _is_ambiguous(cells):
                    meant = "decimal" if decimal_comma else "those of thousands"
                    found.notes.append(f"commas in {name} are taken for {meant}")
                without_number += [f"{name} {bad}"] if bad else []
            elif (stamps := stamps_in_text(cells)) is not None:
                _take_stamps(found, name, stamps)
            else:
                found.ignored.append(f"{name} (text)")
        elif pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
            cast = pc.cast(column, pa.float64(), safe=False)
            found.columns.append((name, np.array(cast.to_numpy(), dtype=np.float64)))
        elif pa.types.is_decimal(kind):
            found.columns.append((name, np.array(pc.cast(column, pa.float64()).to_numpy(), dtype=np.float64)))
        elif (times := _times(column)) is not None:
            _take_stamps(found, name, times)
        elif (parts := _parts(name, column)) is not None:
            found.columns += parts
        else:
            found.ignored.append(f"{name} ({'empty' if pa.types.is_null(kind) else kind})")
    if without_number:
        found.notes.append(f"cells that hold no number: {', '.join(without_number)}")
    return found


def _take_stamps(found: Numbers, name: str, stamps: Stamps) -> None:
    found.columns.append((name, stamps.seconds))
    found.stamps.append(name)
    if stamps.since:
        found.notes.append(f"{name} counts seconds from {stamps.since}")


def _numbers_in_text(cells: list[str | None], decimal_comma: bool) -> tuple[Array, int, int]:
    """Numbers, how many cells hold one, and how many hold anything else."""
    thousands = not decimal_comma and not any(c and _only_decimal(c) for c in cells)
    values = [_number(cell, thousands) if cell else None for cell in cells]
    good = sum(value is not None for value in values)
    numbers = np.array([np.nan if value is None else value for value in values], dtype=np.float64)
    return numbers, good, sum(map(bool, cells)) - good


def _only_decimal(cell: str) -> bool:
    """Whether a comma in the cell can be nothing but a decimal one."""
    return "," in cell and not _THOUSANDS_COMMAS.fullmatch(cell)


def _is_ambiguous(cells: list[str | None]) -> bool:
    """Whether every comma could stand before thousands as well as before decimals."""
    held = [cell for cell in cells if cell and "," in cell]
    whole = all(re.fullmatch(r"[+-]?[1-9]\d{0,2},\d{3}", cell) for cell in held)
    return bool(held) and whole


def _number(cell: str, thousands: bool) -> float | None:
    """A cell's number; None where it holds none."""
    if is_number(cell):
        return float(cell)
    if thousands and _THOUSANDS_COMMAS.fullmatch(cell):
        return float(cell.replace(",", ""))
    if _THOUSANDS_POINTS.fullmatch(cell):
        return float(cell.replace(".", "").replace(",", "."))
    if _DECIMAL_COMMA.fullmatch(cell):
        return float(cell.replace(",", "."))
    fortran = _FORTRAN.fullmatch(cell)
    return float(f"{fortran[1]}e{fortran[2]}") if fortran else None


def _times(column: Any) -> Stamps | None:
    """Seconds of a column that Arrow knows to be time: exact differences, before they become floats."""
    kind = column.type
    if pa.types.is_timestamp(kind):
        ticks, known = _ticks(column)
        if not known.any():
            return None
        first = int(ticks[known][0])
        seconds = np.where(known, (ticks - first) / _PER_SECOND[kind.unit], np.nan)
        nanoseconds = first * (10**9 // round(_PER_SECOND[kind.unit]))
        return Stamps(seconds, f"{np.datetime64(nanoseconds, 'ns')}"[:23] + ("Z" if kind.tz else ""))
    if pa.types.is_duration(kind) or pa.types.is_time(kind):
        ticks, known = _ticks(column)
        return Stamps(np.where(known, ticks / _PER_SECOND[kind.unit], np.nan), "")
    if pa.types.is_date(kind):
        ticks, known = _ticks(column.cast(pa.date32()))
        if not known.any():
            return None
        first = int(ticks[known][0])
        return Stamps(np.where(known, (ticks - first) * _DAY_S, np.nan), f"{np.datetime64(first, 'D')}")
    return None


def _ticks(column: Any) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """A time's whole numbers, 0 where there is none; and where there is one."""
    whole = column.cast(pa.int32()) if column.type.bit_width == 32 else column
    whole = whole.cast(pa.int64())
    known = np.asarray(whole.is_valid().to_numpy(), dtype=np.bool_)
    return np.asarray(whole.fill_null(0).to_numpy(), dtype=np.int64), known


def _parts(name: str, column: Any) -> list[tuple[str, Array]] | None:
    """The columns of a column of vectors, ``name[0]`` first; None where its cells are not equally long."""
    kind = column.type
    lists = pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    if not lists or not (pa.types.is_floating(kind.value_type) or pa.types.is_integer(kind.value_type)):
        return None
    whole = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    lengths = pc.unique(pc.list_value_length(whole)).to_pylist()
    if whole.null_count or len(lengths) != 1 or not 0 < lengths[0] <= 64:
        return None
    flat = pc.cast(whole.flatten(), pa.float64(), safe=False).to_numpy(zero_copy_only=False)
    matrix = np.array(flat, dtype=np.float64).reshape(len(whole), lengths[0])
    return [(f"{name}[{k}]", np.ascontiguousarray(matrix[:, k])) for k in range(lengths[0])]
