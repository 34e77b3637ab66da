"""Text tables: comma, semicolon, tab or blanks between columns, whatever stands above them."""

import re
from collections.abc import Sequence
from io import BytesIO
from typing import Any

import pyarrow as pa
import pyarrow.csv as pacsv

from wingwatch.telemetry.tables.layout import BLANKS, Layout, LayoutError, find_layout
from wingwatch.telemetry.tables.numbers import numbers_of
from wingwatch.telemetry.tables.raw_table import RawTable, TableError, first_line, make_table, one_of_each
from wingwatch.telemetry.units import unit_in_brackets

__all__ = ["is_text", "read_csv"]

_MAX_BLOCK_BYTES = 2**31 - 1  # one block, so that a column has one type; the reader counts in 32 bits
_SAMPLE_LINES = 400
_UTF8_MARK = b"\xef\xbb\xbf"
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
_COMMA_IN_NUMBER = re.compile(rb"(?:^|[;\t ])[+-]?\d*,\d+(?=$|[;\t \n])", re.MULTILINE)
_POINT_IN_NUMBER = re.compile(rb"(?:^|[;\t ])[+-]?\d*\.\d+(?=$|[;\t \n])", re.MULTILINE)
_FORMATS = "CSV, Parquet and MATLAB .mat (version 5 to 7)"


def is_text(data: bytes) -> bool:
    """Whether the bytes are text: without NULs, or UTF-16."""
    return b"\0" not in data[:4096] or _utf16(data[:4096]) is not None


def read_csv(source: str, data: bytes) -> RawTable:
    """A text table.

    Args:
        source: what sentences call the file.
        data: its bytes; UTF-8, UTF-16 or Latin-1, any line end.

    Raises:
        TableError: no table, or one without rows or numbers.
    """
    text = _plain(data)
    encoding = "utf-8" if _is_utf8(text) else "latin-1"
    lines = _first_lines(text, encoding)
    try:
        layout = find_layout(lines)
    except LayoutError as problem:
        advice = f"; {_FORMATS} can be read" if "no table" in str(problem) else ""
        raise TableError(f"{source}: {problem}{advice}") from None
    body = _after_lines(text, layout.first_line)
    if not body.strip():
        raise TableError(f"{source}: the file has a header and no rows; give one with samples")
    notes = [] if text.endswith(b"\n") else ["no line end after the last row: it may be cut short"]
    notes += layout.skipped
    if not layout.named:
        notes.append(f"no line names the columns: they are called 1 to {len(layout.names)}")
    if layout.delimiter == BLANKS:
        body = _tabbed(body)
    comma = layout.delimiter != "," and _has_decimal_commas(body)
    table = _parse(source, body, encoding, layout, notes)
    if table.num_rows == 0:
        raise TableError(f"{source}: the file has a header and no rows; give one with samples")
    found = numbers_of(zip(layout.names, table.columns, strict=True), comma)
    columns, doubled = one_of_each(found.columns)
    units = dict(zip(layout.names, layout.units, strict=False)) if layout.units else _bracketed(layout.names)
    return make_table(
        source, "csv", columns, found.ignored, [*notes, *found.notes],
        {name: unit for name, unit in units.items() if unit and name not in found.stamps}, doubled, found.stamps,
    )  # fmt: skip


def _bracketed(names: Sequence[str]) -> dict[str, str]:
    return {name: unit for name in names if (unit := unit_in_brackets(name)) is not None}


def _plain(data: bytes) -> bytes:
    """UTF-8 or Latin-1 without a mark, lines ending with one LF."""
    text = data.removeprefix(_UTF8_MARK)
    if (encoding := _utf16(data)) is not None:
        text = data.decode(encoding, "replace").removeprefix("\ufeff").encode()
    if b"\r" in text:
        text = re.sub(rb"\r+\n|\r", b"\n", text)
    return text


def _utf16(data: bytes) -> str | None:
    """The encoding of UTF-16 text, with or without its mark; None for anything else."""
    if data.startswith(_UTF16_MARKS):
        return "utf-16"
    head = data[:4096]
    half = len(head) // 2
    if half < 4:
        return None
    for encoding, low, high in (("utf-16-le", head[0::2], head[1::2]), ("utf-16-be", head[1::2], head[0::2])):
        if high.count(0) > 0.9 * half and b"\0" not in low:
            return encoding
    return None


def _is_utf8(text: bytes) -> bool:
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _first_lines(text: bytes, encoding: str) -> list[str]:
    parts = text.split(b"\n", _SAMPLE_LINES)
    return [line.decode(encoding, "replace") for line in parts[:_SAMPLE_LINES]]


def _after_lines(text: bytes, lines: int) -> bytes:
    parts = text.split(b"\n", lines)
    return parts[lines] if len(parts) > lines else b""


def _tabbed(body: bytes) -> bytes:
    """One tab for each run of blanks between fields."""
    return re.sub(rb"[ \t]+", b"\t", re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", body))


def _has_decimal_commas(body: bytes) -> bool:
    """Whether numbers of the table have decimal commas, and none a decimal point."""
    return _COMMA_IN_NUMBER.search(body) is not None and _POINT_IN_NUMBER.search(body) is None


def _parse(source: str, body: bytes, encoding: str, layout: Layout, notes: list[str]) -> Any:
    """The rows; those with other fields than the names are left out and counted, but for empty ones at the end."""
    delimiter = "\t" if layout.delimiter == BLANKS else layout.delimiter
    count = len(layout.names)
    table, unlike = _parse_once(source, body, encoding, delimiter, count)
    if any(longer and text.rstrip().endswith(delimiter.strip() or "\t") for longer, text in unlike):
        table, unlike = _parse_once(source, _without_ends(body, delimiter, count), encoding, delimiter, count)
    if unlike:
        notes.append(f"{len(unlike)} rows left out because they do not have {count} fields")
    return table


def _without_ends(body: bytes, delimiter: str, count: int) -> bytes:
    """Rows without the empty fields that delimiters too many leave at their ends."""
    mark = delimiter.encode()
    rows = []
    for row in body.split(b"\n"):
        excess = row.count(mark) - (count - 1)
        kept = row.rstrip(b" ") if excess > 0 else row
        while excess > 0 and kept.endswith(mark):
            kept, excess = kept[:-1].rstrip(b" "), excess - 1
        rows.append(kept)
    return b"\n".join(rows)


def _parse_once(
    source: str, body: bytes, encoding: str, delimiter: str, count: int
) -> tuple[Any, list[tuple[bool, str]]]:
    """The table, and of each row that was left out whether it is longer, and its text."""
    unlike: list[tuple[bool, str]] = []

    def skip(row: Any) -> str:
        unlike.append((row.actual_columns > row.expected_columns, row.text or ""))
        return "skip"

    try:
        table = pacsv.read_csv(
            BytesIO(body),
            read_options=pacsv.ReadOptions(
                # a thread of the reader that outlived a refused file could abort the program at its end
                use_threads=False,
                encoding=encoding,
                block_size=min(len(body), _MAX_BLOCK_BYTES),
                column_names=[str(k) for k in range(count)],
            ),
            parse_options=pacsv.ParseOptions(delimiter=delimiter, invalid_row_handler=skip),
        )
    except (pa.ArrowException, ValueError) as problem:
        raise TableError(f"{source}: cannot be read as CSV: {first_line(problem)}") from None
    return table, unlike
