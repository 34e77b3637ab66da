"""Derivatives over time for pictures and tables: thinned so that extremes stay, or all of them as CSV."""

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import STRUCTURES
from wingwatch.aircraft.vocabulary import DERIVATIVES
from wingwatch.api.encoding import quantity
from wingwatch.api.record_schemas import SeriesOfDerivative
from wingwatch.baselines import HistoryColumns, HistoryKey, HistoryWanted

__all__ = ["Expect", "ReadColumns", "column_suffix", "csv_pieces", "read_all", "series_of", "thinned"]

Array = NDArray[np.float64]
Places = NDArray[np.int64]

ReadColumns = Callable[[HistoryWanted], tuple[Sequence[HistoryColumns], HistoryKey | None]]
"""A part of a vehicle's history."""

Expect = Callable[[str, tuple[str, str], Array], tuple[Array, Array] | None]
"""What is expected of a structure of an aircraft and configuration at conditions, (m, 4): values and errors, (m, k)."""

_ROWS_AT_ONCE = 20_000
"""About 0.1 s of the database's time."""

_POINTS_OF_BUCKET = 4


def thinned(time_s: Array, value: Array, points: int) -> Places:
    """Places of at most ``points`` values that draw the same line as all of them.

    The time is divided into equal buckets; of each the first and last point and those of the least and greatest value
    stay (M4, Jugel et al. 2014, doi:10.14778/2732951.2732953).

    Args:
        time_s: (n,), ascending.
        value: (n,), NaN where nothing is known.
        points: four at least.
    """
    n = len(time_s)
    if n <= points:
        return np.arange(n)
    buckets = max(1, points // _POINTS_OF_BUCKET)
    span_s = float(time_s[-1] - time_s[0])
    bucket = np.minimum(((time_s - time_s[0]) * (buckets / span_s)).astype(np.int64), buckets - 1)
    starts = np.flatnonzero(np.diff(bucket, prepend=-1))
    ends = np.append(starts[1:], n)
    kept = [starts, ends - 1]
    for extreme in (np.fmin, np.fmax):
        found = np.repeat(extreme.reduceat(value, starts), ends - starts)
        places = np.flatnonzero(value == found)
        _, first = np.unique(bucket[places], return_index=True)
        kept.append(places[first])
    return np.unique(np.concatenate(kept))


def read_all(read: ReadColumns, wanted: HistoryWanted) -> Iterator[Sequence[HistoryColumns]]:
    """All of it, a piece at a time: no question keeps the database for long."""
    start: HistoryKey | None = None
    while True:
        found, last = read(replace(wanted, start=start, limit=_ROWS_AT_ONCE))
        yield [_after(one, start) for one in found] if start is not None else found
        if last is None:
            return
        start = last


def _after(one: HistoryColumns, start: HistoryKey) -> HistoryColumns:
    """Without the row that the piece before has ended with."""
    flight, time_s, estimator, structure = start
    if (one.flight, one.estimator, one.structure) != (flight, estimator, structure):
        return one
    return _part(one, np.flatnonzero(one.time_s > time_s))


def _part(one: HistoryColumns, places: Places) -> HistoryColumns:
    return replace(
        one,
        time_s=one.time_s[places],
        value=one.value[places],
        standard_error=one.standard_error[places],
        condition=one.condition[places],
        outcomes=[one.outcomes[m] for m in places.tolist()],
    )


def _joined(parts: Sequence[HistoryColumns]) -> HistoryColumns:
    return replace(
        parts[0],
        time_s=np.concatenate([one.time_s for one in parts]),
        value=np.concatenate([one.value for one in parts]),
        standard_error=np.concatenate([one.standard_error for one in parts]),
        condition=np.concatenate([one.condition for one in parts]),
        outcomes=[outcome for one in parts for outcome in one.outcomes],
    )


def series_of(
    read: ReadColumns, expect: Expect, wanted: HistoryWanted, names: frozenset[str] | None, points: int
) -> list[SeriesOfDerivative]:
    """Series by estimator, structure and the structure's own order, of one flight.

    Args:
        expect: what is expected now.
        names: only these derivatives; all without.
        points: of each series at most.
    """
    parts: dict[tuple[str, str], list[HistoryColumns]] = {}
    for piece in read_all(read, wanted):
        for one in piece:
            if _is_known(one):
                parts.setdefault((one.estimator, one.structure), []).append(one)
    return [made for key in sorted(parts) for made in _series(_joined(parts[key]), expect, names, points)]


def _series(
    whole: HistoryColumns, expect: Expect, names: frozenset[str] | None, points: int
) -> Iterator[SeriesOfDerivative]:
    symbols = STRUCTURES[whole.structure].derivatives
    chosen = [k for k, symbol in enumerate(symbols) if names is None or symbol in names]
    places = {k: thinned(whole.time_s, whole.value[:, k], points) for k in chosen}
    if not chosen or not len(whole.time_s):
        return
    union = np.unique(np.concatenate(list(places.values())))
    expected, expected_error = _expected(_part(whole, union), expect)
    for k, kept in places.items():
        at = np.searchsorted(union, kept)
        yield SeriesOfDerivative(
            estimator=whole.estimator,
            structure=whole.structure,
            derivative=symbols[k],
            unit=DERIVATIVES[symbols[k]].unit,
            meaning=DERIVATIVES[symbols[k]].meaning,
            kept=len(whole.time_s),
            time_s=whole.time_s[kept].tolist(),
            value=_quantities(whole.value[kept, k]),
            standard_error=_quantities(whole.standard_error[kept, k]),
            outcome=[whole.outcomes[m] for m in kept.tolist()],
            expected=_quantities(expected[at, k]),
            expected_standard_error=_quantities(expected_error[at, k]),
        )


def _is_known(one: HistoryColumns) -> bool:
    """Whether it is of a structure as this program has it."""
    structure = STRUCTURES.get(one.structure)
    return structure is not None and one.value.shape[1] == len(structure.derivatives)


def _expected(some: HistoryColumns, expect: Expect) -> tuple[Array, Array]:
    found = expect(some.structure, (some.aircraft, some.configuration), some.condition)
    if found is None:
        return np.full_like(some.value, np.nan), np.full_like(some.value, np.nan)
    return found


def _quantities(values: Array) -> list[float | None]:
    return [quantity(value) for value in values.tolist()]


_HEAD = ("flight", "time_s", "estimator", "structure", "outcome", "airspeed_true_m_s", "altitude_m")
_KINDS = ("", "_standard_error", "_expected", "_expected_standard_error")


def column_suffix(unit: str) -> str:
    """A unit as the end of a column's name: ``1/(m s)`` becomes ``_per_m_s``; nothing for a number without one."""
    over, _, under = unit.partition("/")
    words = [*over.replace("1", "").split(), *(["per"] if over == "1" else []), *under.strip("()").split()]
    return "".join(f"_{word}" for word in words)


def csv_pieces(
    read: ReadColumns, expect: Expect, wanted: HistoryWanted, names: frozenset[str] | None
) -> Iterator[bytes]:
    """All estimates as CSV, a row each: of every derivative its value, its standard error and what is expected now.

    Columns of derivatives that an estimate's structure has not are empty.
    """
    symbols = [symbol for symbol in DERIVATIVES if names is None or symbol in names]
    symbols = [s for s in symbols if any(s in structure.derivatives for structure in STRUCTURES.values())]
    place = {symbol: len(_HEAD) + n * len(_KINDS) for n, symbol in enumerate(symbols)}
    head = [*_HEAD]
    for symbol in symbols:
        head += [f"{symbol}{kind}{column_suffix(DERIVATIVES[symbol].unit)}" for kind in _KINDS]
    yield _lines([head])
    for piece in read_all(read, wanted):
        rows = [row for one in piece for row in _rows(one, expect, place, len(head))]
        yield _lines(sorted(rows, key=lambda row: tuple(row[:4])))


def _rows(one: HistoryColumns, expect: Expect, place: dict[str, int], width: int) -> Iterator[list[Any]]:
    if not _is_known(one):
        return
    expected = _expected(one, expect)
    columns = (one.value, one.standard_error, *expected)
    known = [(k, place[s]) for k, s in enumerate(STRUCTURES[one.structure].derivatives) if s in place]
    if not known:
        return
    for m, time_s in enumerate(one.time_s.tolist()):
        speed, height = one.condition[m, :2].tolist()
        row: list[Any] = [one.flight, time_s, one.estimator, one.structure, one.outcomes[m]]
        row += [quantity(speed), quantity(height), *[None] * (width - len(_HEAD))]
        for k, at in known:
            row[at : at + len(_KINDS)] = [quantity(float(column[m, k])) for column in columns]
        yield row


def _lines(rows: Sequence[Sequence[Any]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\r\n").writerows(rows)
    return text.getvalue().encode()
