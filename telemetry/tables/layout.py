"""Where the table stands in a text: delimiter, the line of names, the row of units, the first row of numbers.

A log may begin with lines about the instrument, name its columns in a comment, put units above or below the names, or
name nothing at all. What a line is follows from the rows after it.
"""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from wingwatch.telemetry.tables.numbers import is_number
from wingwatch.telemetry.tables.stamps import is_stamp
from wingwatch.telemetry.units import known_unit

__all__ = ["BLANKS", "Layout", "LayoutError", "find_layout", "split_line"]

BLANKS = " "
"""The delimiter of columns that stand apart by blanks or tabs, one or more."""

_DELIMITERS = (",", ";", "\t", "|")
_COMMENT = re.compile(r"\s*(?:#|%|//|!|\*)+\s*")
_COMMA_NUMBER = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_NUMBER_LIKE = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)[dD][+-]?\d+|[+-]?\d{1,3}(?:\.\d{3})*,\d+")
_LINES = 400
_UNITS_FRACTION, _UNITS_ABOVE = 0.6, 0.3
"""Fractions of units among the fields of a line: from which on it names no columns, and from which on a line above the
names gives their units."""


class LayoutError(ValueError):
    """A text in which no table is found; one clause."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the table stands.

    Attributes:
        delimiter: between fields; ``BLANKS`` for any number of blanks or tabs.
        names: of the columns; numbers from 1 where no line names them.
        named: whether a line names them.
        units: text of the row of units, one a column, empty where there is none.
        first_line: index of the first line of the rows, counting from 0.
        skipped: lines between the names and the rows that were neither, one clause each.
    """

    delimiter: str
    names: tuple[str, ...]
    named: bool
    units: tuple[str, ...]
    first_line: int
    skipped: tuple[str, ...]


def split_line(line: str, delimiter: str) -> list[str]:
    """Fields of a line, without blanks around them and without quotes."""
    if delimiter == BLANKS:
        return line.split()
    try:
        cells = next(csv.reader([line.strip("\r\n")], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        cells = line.split(delimiter)
    return [cell.strip().strip('"') for cell in cells]


def find_layout(lines: Sequence[str]) -> Layout:
    """The layout of a text by its first lines.

    Args:
        lines: the first lines of the text.

    Raises:
        LayoutError: all of them are blank, no table of at least two columns is found, or its names do not fit its rows.
    """
    found = [i for i, line in enumerate(lines[:_LINES]) if line.strip()]
    if not found:
        raise LayoutError(f"no table: the first {_LINES} lines are blank")
    best, score = None, 0.0
    for delimiter in (*_DELIMITERS, BLANKS):
        rows = _Rows({i: split_line(lines[i], delimiter) for i in found}, delimiter, lines)
        if rows.score > score:
            best, score = rows, rows.score
    if best is None:
        return _without_rows(lines, found)
    return best.layout()


def _without_rows(lines: Sequence[str], found: Sequence[int]) -> Layout:
    """The first line names the columns of a table that holds no numbers, as far as is seen."""
    header = lines[found[0]]
    delimiter = max(_DELIMITERS, key=header.count)
    names = _trimmed(split_line(header, delimiter))
    if len(names) < 2:
        raise LayoutError("no table with commas, semicolons, tabs or blanks between its columns")
    return Layout(delimiter, tuple(names), True, (), found[0] + 1, ())


class _Rows:
    """The lines as fields by one delimiter."""

    def __init__(self, cells: dict[int, list[str]], delimiter: str, lines: Sequence[str]) -> None:
        self._cells, self._delimiter, self._lines = cells, delimiter, lines
        trimmed = {i: _trimmed(row) for i, row in cells.items()}
        numbers = {i: sum(map(self._is_value, row)) for i, row in trimmed.items()}
        body = {i: row for i, row in trimmed.items() if 2 * numbers[i] >= sum(map(bool, row)) and numbers[i]}
        body = body or {i: row for i, row in trimmed.items() if numbers[i]}
        votes = Counter(len(cells[i]) for i in body)
        headings = {len(row) for i, row in trimmed.items() if i not in body}
        self._count = max(votes, key=lambda n: (votes[n], n in headings, n), default=0)
        self._body = {i: row for i, row in body.items() if self._fits(cells[i])}
        self._numeric = self._numeric_columns()

    def _is_value(self, cell: str) -> bool:
        decimal = self._delimiter != "," and _COMMA_NUMBER.fullmatch(cell) is not None
        return decimal or is_number(cell) or _NUMBER_LIKE.fullmatch(cell) is not None or is_stamp(cell)

    def _fits(self, row: list[str]) -> bool:
        return len(row) == self._count

    def _numeric_columns(self) -> list[int]:
        """Columns that hold values in most rows that hold anything there."""
        found = []
        for k in range(self._count):
            held = [row[k] for row in self._body.values() if k < len(row) and row[k]]
            if held and 2 * sum(map(self._is_value, held)) >= len(held):
                found.append(k)
        return found

    @property
    def score(self) -> float:
        """How much of a table this is: columns of values less columns of anything else."""
        if self._count < 2 or not self._numeric:
            return 0.0
        held = {k for row in self._body.values() for k, cell in enumerate(row) if cell}
        named = {k for row in self._cells.values() if self._fits(row) for k, cell in enumerate(row) if cell}
        missing = self._count - len(named)  # no line has anything there, not even a name
        share = len(self._body) / max(len(self._cells), 1)
        preferred = 1.0 if self._delimiter != BLANKS else 0.99
        return preferred * share * (2 * len(self._numeric) - len(held) + 1e-3 * len(held) - 0.05 * missing)

    def layout(self) -> Layout:
        """The layout by this delimiter."""
        first = self._first_row()
        above = [i for i in self._cells if i < first]
        names_at, names = self._names(above)
        if names is None:
            self._refuse_unlike(above)
            count = max(len(_trimmed(row)) for row in self._body.values())
            numbered = tuple(str(k) for k in range(1, count + 1))
            return Layout(self._delimiter, numbered, False, (), first, ())
        units_at, units = self._units(above, names_at, len(names))
        skipped = tuple(
            f"line {i + 1} holds no numbers and is left out: {self._lines[i].strip()[:60]!r}"
            for i in above
            if i > names_at and i != units_at and not _COMMENT.match(self._lines[i])
        )
        return Layout(self._delimiter, tuple(names), True, units, first, skipped)

    def _first_row(self) -> int:
        """Index of the first line that holds values where the rows have them."""
        for place, (i, row) in enumerate(self._cells.items()):
            if not self._fits(row):
                continue
            held = [row[k] for k in self._numeric if row[k]]
            values = sum(map(self._is_value, held))
            if place == 0 and values < len(held):
                continue  # the first line of a table names its columns, even if some names are numbers
            if values and 2 * values >= len(held):
                return i
        return next(iter(self._body))

    def _names(self, above: Sequence[int]) -> tuple[int, list[str] | None]:
        """The line that names the columns: the first one of as many fields, before comments and rows of units."""
        plain = [(i, names) for i in above if (names := self._heading(i)) is not None]
        ranked = sorted(
            plain,
            key=lambda at: (
                _units_fraction(at[1]) >= _UNITS_FRACTION,
                any(map(self._is_value, at[1])),
                _COMMENT.match(self._lines[at[0]]) is not None,
                -at[0] if _COMMENT.match(self._lines[at[0]]) else at[0],
            ),
        )
        return ranked[0] if ranked else (-1, None)

    def _heading(self, i: int) -> list[str] | None:
        """Fields of a line that could name the columns."""
        line = self._lines[i]
        tried = [self._cells[i]]
        if (mark := _COMMENT.match(line)) is not None:
            bare = split_line(line[mark.end() :], self._delimiter)
            tried = [bare, self._cells[i]]
        least = max((len(_trimmed(row)) for row in self._body.values()), default=0)
        for cells in tried:
            names = _trimmed(cells)
            if len(cells) == self._count and len(names) < least:
                names = cells  # the last columns hold values and have no name
            if least <= len(names) <= self._count and len(names) >= 2 and not all(map(self._is_value, names)):
                return names
        return None

    def _units(self, above: Sequence[int], names_at: int, count: int) -> tuple[int, tuple[str, ...]]:
        """The row of units: below the names the one with the most units that are known, else one above them."""
        best: tuple[str, ...] = ()
        at, fraction = -1, 0.0
        for i in above:
            cells = self._heading(i)
            if i == names_at or cells is None:
                continue
            found = _units_fraction(cells) + (1.0 if i > names_at else 0.0)
            if _units_fraction(cells) and found > max(fraction, _UNITS_ABOVE):
                best, at, fraction = tuple((cells + [""] * count)[:count]), i, found
        return at, best

    def _refuse_unlike(self, above: Sequence[int]) -> None:
        """Names that are fewer or more than the fields of the rows.

        Raises:
            LayoutError: the line above the rows names another number of columns.
        """
        plain = [i for i in above if not _COMMENT.match(self._lines[i])]
        if not plain or self._delimiter == BLANKS:
            return
        names = _trimmed(self._cells[plain[-1]])
        if len(names) < 2 or any(map(self._is_value, names)):
            return
        said = f"line {plain[-1] + 1} names {len(names)} columns and the rows have {self._count} fields"
        if self._delimiter == "," and len(names) < self._count <= 2 * len(names):
            said += (
                ": with decimal commas the columns must be parted by semicolons or tabs; export the table so"
            )
        else:
            said += ": give each column one name"
        raise LayoutError(said)


def _trimmed(cells: list[str]) -> list[str]:
    """Without the empty fields at the end, which commas too many leave."""
    end = len(cells)
    while end and not cells[end - 1]:
        end -= 1
    return cells[:end]


def _units_fraction(cells: Sequence[str]) -> float:
    """How many of the fields that hold anything are units."""
    held = [cell for cell in cells if cell]
    return sum(known_unit(cell) is not None or cell.strip("[]()") in ("-", "") for cell in held) / max(
        len(held), 1
    )
