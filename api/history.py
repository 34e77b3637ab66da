"""Past estimates as a table of derivatives, in JSON (paged), CSV or Parquet (whole)."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from http import HTTPStatus

import pyarrow as pa
import pyarrow.parquet as pq
from fastapi import Response

from wingwatch.aircraft.structures import STRUCTURES
from wingwatch.aircraft.vocabulary import DERIVATIVES
from wingwatch.api.encoding import json_answer, quantity
from wingwatch.api.paging import decode_cursor, encode_cursor
from wingwatch.api.ports import EstimateRow
from wingwatch.api.problems import ProblemError, printable
from wingwatch.api.schemas import HistoryItem, HistoryList

__all__ = [
    "CSV_MEDIA_TYPE",
    "PARQUET_MEDIA_TYPE",
    "answer_history",
    "history_items",
    "negotiate",
    "parse_names",
]

JSON_MEDIA_TYPE = "application/json"
CSV_MEDIA_TYPE = "text/csv"
PARQUET_MEDIA_TYPE = "application/vnd.apache.parquet"

_OFFERED = (JSON_MEDIA_TYPE, CSV_MEDIA_TYPE, PARQUET_MEDIA_TYPE)
_COLUMNS = tuple(HistoryItem.model_fields)
_SCHEMA = pa.schema(
    [
        (name, pa.float64() if name in ("time_s", "value", "standard_error") else pa.string())
        for name in _COLUMNS
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


def history_items(rows: Sequence[EstimateRow], names: frozenset[str] | None) -> list[HistoryItem]:
    """One item a derivative, ordered by time, estimator, structure and the structure's own order."""
    ordered = sorted(rows, key=lambda row: (row.time_s, row.estimator, row.structure))
    return [item for row in ordered for item in _items(row) if names is None or item.derivative in names]


def answer_history(items: Sequence[HistoryItem], media_type: str, limit: int, cursor: str | None) -> Response:
    """The answer in the negotiated form; only JSON is paged."""
    if media_type == CSV_MEDIA_TYPE:
        return _download(_csv(items), f"{CSV_MEDIA_TYPE}; charset=utf-8")
    if media_type == PARQUET_MEDIA_TYPE:
        return _download(_parquet(items), PARQUET_MEDIA_TYPE)
    return json_answer(_page(items, limit, cursor))


def _items(row: EstimateRow) -> Iterator[HistoryItem]:
    symbols = STRUCTURES[row.structure].derivatives
    for symbol, value, error in zip(symbols, row.value, row.standard_error, strict=True):
        yield HistoryItem(
            time_s=row.time_s,
            estimator=row.estimator,
            structure=row.structure,
            derivative=symbol,
            value=quantity(value),
            standard_error=quantity(error),
            unit=DERIVATIVES[symbol].unit,
            outcome=row.outcome,
        )


def _key(item: HistoryItem) -> tuple[float, str, str, int]:
    order = STRUCTURES[item.structure].derivatives.index(item.derivative)
    return (item.time_s, item.estimator, item.structure, order)


def _page(items: Sequence[HistoryItem], limit: int, cursor: str | None) -> HistoryList:
    if cursor is not None:
        after = decode_cursor(cursor, (float, str, str, int))
        items = [item for item in items if _key(item) > after]
    page = list(items[:limit])
    more = len(items) > limit
    return HistoryList(items=page, next=encode_cursor(_key(page[-1])) if more else None)


def _csv(items: Sequence[HistoryItem]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(_COLUMNS)
    writer.writerows([getattr(item, name) for name in _COLUMNS] for item in items)
    return text.getvalue().encode()


def _parquet(items: Sequence[HistoryItem]) -> bytes:
    table = pa.table({name: [getattr(item, name) for item in items] for name in _COLUMNS}, schema=_SCHEMA)
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
