"""Past estimates as a table of derivatives, in JSON (paged), CSV or Parquet (whole)."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from http import HTTPStatus
from typing import NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq
from fastapi import Response

from wingwatch.aircraft.structures import STRUCTURES
from wingwatch.aircraft.vocabulary import DERIVATIVES
from wingwatch.api.answers import json_answer
from wingwatch.api.encoding import quantity
from wingwatch.api.paging import decode_cursor, encode_cursor
from wingwatch.api.problems import ProblemError, printable
from wingwatch.api.schemas import HistoryItem, HistoryList
from wingwatch.baselines import HistoryRow, HistoryWanted

__all__ = [
    "CSV_MEDIA_TYPE",
    "PARQUET_MEDIA_TYPE",
    "answer_history",
    "negotiate",
    "parse_names",
]

JSON_MEDIA_TYPE = "application/json"
CSV_MEDIA_TYPE = "text/csv"
PARQUET_MEDIA_TYPE = "application/vnd.apache.parquet"

_ROWS_AT_ONCE = 5000

_OFFERED = (JSON_MEDIA_TYPE, CSV_MEDIA_TYPE, PARQUET_MEDIA_TYPE)


class _Item(NamedTuple):
    """The fields of ``HistoryItem``; a hundred thousand of them must be cheap."""

    time_s: float
    estimator: str
    structure: str
    derivative: str
    value: float | None
    standard_error: float | None
    unit: str
    outcome: str
    recorded_at_s: float | None
    flight: int
    aircraft: str | None
    configuration: str | None


_NUMBERS = {"time_s", "value", "standard_error", "recorded_at_s"}
_SCHEMA = pa.schema(
    [
        (name, pa.float64() if name in _NUMBERS else pa.int64() if name == "flight" else pa.string())
        for name in _Item._fields
    ]
)


def negotiate(accept: str | None) -> str:
    """The media type that an ``Accept`` header likes best; JSON where it leaves the choice.

    Raises:
        ProblemError: 406 where it accepts none of JSON, CSV and Parquet.
    """
    if not accept:
        return JSON_MEDIA_TYPE
    wishes = [_wish(part) for part in accept.split(",")]
    weights = {offered: _weight(offered, wishes) for offered in _OFFERED}
    best = max(_OFFERED, key=lambda offered: weights[offered])
    if weights[best] <= 0.0:
        raise ProblemError(
            HTTPStatus.NOT_ACCEPTABLE,
            f"Accept {printable(accept)} asks for nothing offered here; offered are {', '.join(_OFFERED)}.",
        )
    return best


def parse_names(names: str | None) -> frozenset[str] | None:
    """Derivative symbols from a comma-separated list; None for all.

    Raises:
        ProblemError: 422 for a symbol that is no derivative.
    """
    if names is None:
        return None
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    for name in wanted:
        if name not in DERIVATIVES:
            raise ProblemError(
                HTTPStatus.UNPROCESSABLE_ENTITY,
                f"The query parameter names holds {printable(name)}, which is no derivative; known are "
                f"{', '.join(DERIVATIVES)}.",
            )
    return frozenset(wanted)


def answer_history(
    read: Callable[[HistoryWanted], Sequence[HistoryRow]],
    wanted: HistoryWanted,
    names: frozenset[str] | None,
    media_type: str,
    limit: int,
    cursor: str | None,
) -> Response:
    """Rows of the named derivatives, ordered by flight, time, estimator, structure and the structure's own order.

    Only JSON is paged; CSV and Parquet hold everything.

    Args:
        read: a part of the vehicle's history.
        wanted: which flight and which time.

    Raises:
        ProblemError: 422 for a cursor of another list.
    """
    if names is not None:
        structures = (n for n, structure in STRUCTURES.items() if names & set(structure.derivatives))
        wanted = replace(wanted, structures=tuple(structures))
    if media_type == CSV_MEDIA_TYPE:
        return _download(_csv(_items(_all(read, wanted), names)), f"{CSV_MEDIA_TYPE}; charset=utf-8")
    if media_type == PARQUET_MEDIA_TYPE:
        return _download(_parquet(list(_items(_all(read, wanted), names))), PARQUET_MEDIA_TYPE)
    return json_answer(_page(read, wanted, names, limit, cursor))


_RowKey = tuple[int, float, str, str]


def _row_key(row: HistoryRow) -> _RowKey:
    return (row.flight, row.estimate.time_s, row.estimate.estimator, row.estimate.structure)


def _all(
    read: Callable[[HistoryWanted], Sequence[HistoryRow]], wanted: HistoryWanted
) -> Iterator[HistoryRow]:
    """Everything, read a piece at a time: no question keeps the database for long."""
    last: _RowKey | None = None
    while True:
        rows = read(replace(wanted, start=last, limit=_ROWS_AT_ONCE))
        yield from (row for row in rows if last is None or _row_key(row) > last)
        if len(rows) < _ROWS_AT_ONCE:
            return
        last = _row_key(rows[-1])


def _items(rows: Iterable[HistoryRow], names: frozenset[str] | None) -> Iterator[_Item]:
    for row in rows:
        estimate = row.estimate
        symbols = STRUCTURES[estimate.structure].derivatives
        for symbol, value, error in zip(symbols, estimate.value, estimate.standard_error, strict=True):
            if names is None or symbol in names:
                yield _Item(
                    estimate.time_s,
                    estimate.estimator,
                    estimate.structure,
                    symbol,
                    quantity(value),
                    quantity(error),
                    DERIVATIVES[symbol].unit,
                    estimate.outcome,
                    row.at_s,
                    row.flight,
                    estimate.aircraft or None,
                    estimate.configuration or None,
                )


def _item_key(item: _Item) -> tuple[int, float, str, str, int]:
    order = STRUCTURES[item.structure].derivatives.index(item.derivative)
    return (item.flight, item.time_s, item.estimator, item.structure, order)


def _page(
    read: Callable[[HistoryWanted], Sequence[HistoryRow]],
    wanted: HistoryWanted,
    names: frozenset[str] | None,
    limit: int,
    cursor: str | None,
) -> HistoryList:
    """Each row holds at least one of the named derivatives, so ``limit`` rows and two more are enough."""
    after = None if cursor is None else decode_cursor(cursor, (int, float, str, str, int))
    start = None if after is None else (after[0], after[1], after[2], after[3])
    rows = read(replace(wanted, start=start, limit=limit + 2))
    found = [item for item in _items(rows, names) if after is None or _item_key(item) > after]
    more = encode_cursor(_item_key(found[limit - 1])) if len(found) > limit else None
    return HistoryList(items=[HistoryItem(**item._asdict()) for item in found[:limit]], next=more)


def _csv(items: Iterable[_Item]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(_Item._fields)
    writer.writerows(items)
    return text.getvalue().encode()


def _parquet(items: Sequence[_Item]) -> bytes:
    columns = zip(*items, strict=True) if items else [()] * len(_Item._fields)
    table = pa.table(dict(zip(_Item._fields, map(list, columns), strict=True)), schema=_SCHEMA)
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    return bytes(sink.getvalue())


def _download(body: bytes, media_type: str) -> Response:
    return Response(body, media_type=media_type, headers={"Cache-Control": "no-store", "Vary": "Accept"})


def _wish(part: str) -> tuple[str, float]:
    media_range, *parameters = (piece.strip().lower() for piece in part.split(";"))
    weight = next((p.removeprefix("q=") for p in parameters if p.startswith("q=")), "1")
    try:
        return media_range, min(max(float(weight), 0.0), 1.0)
    except ValueError:
        return media_range, 0.0


def _weight(offered: str, wishes: Sequence[tuple[str, float]]) -> float:
    """The weight of the most specific range that covers the offer (RFC 9110, section 12.5.1)."""
    ranges: Mapping[str, float] = dict(wishes)
    covering = (offered, offered.split("/")[0] + "/*", "*/*")
    return next((ranges[r] for r in covering if r in ranges), 0.0)
