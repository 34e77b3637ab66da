"""Dates and times of day in text, as seconds."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = ["Stamps", "is_stamp", "stamps_in_text"]

_DATE = r"(?P<a>\d{1,4})(?P<between>[-/.])(?P<b>\d{1,2})(?P=between)(?P<c>\d{2,4})"
_TIME = r"(?P<hour>\d{1,2}):(?P<minute>\d{2})(?::(?P<second>\d{2}))?(?P<fraction>[.,]\d+)?"
_HALF = r"(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
_ZONE = r"\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2}|[+-]\d{2})?"
_STAMP = re.compile(rf"(?:{_DATE})?(?:(?(a)(?:\s*T\s*|\s+|;))(?:{_TIME}{_HALF}{_ZONE}))?")
_ORDERS = ("ymd", "dmy", "mdy")
_DAY_S = 86_400.0


@dataclass(frozen=True, slots=True)
class Stamps:
    """A column of stamps.

    Attributes:
        seconds: shape (rows,): of a date from ``since`` on, of a time of day from midnight, NaN without a stamp.
        since: the first stamp, where seconds are counted from it.
    """

    seconds: NDArray[np.float64]
    since: str


def is_stamp(text: str) -> bool:
    """Whether the text is a date, a time of day, or both."""
    return bool(text) and _STAMP.fullmatch(text.strip()) is not None


def stamps_in_text(cells: Sequence[str | None]) -> Stamps | None:
    """Stamps such as ``2026-03-04T10:30:25.020Z``, ``04.03.2026 10:30:25,02`` or ``10:30:25.02 PM``.

    A stamp without a zone counts as UTC; minutes and seconds with a fraction (``30:25.02``) are a time, too. Whether
    a day or a month comes first follows from the dates: of two readings that are possible, the one that spans less.

    Returns:
        None where less than half of the cells that hold anything are stamps.
    """
    found = [_STAMP.fullmatch(cell.strip()) if cell else None for cell in cells]
    stamps = [match for match in found if match is not None]
    if 2 * len(stamps) < sum(map(bool, cells)) or not stamps:
        return None
    if not all(match["a"] for match in stamps):
        if any(match["a"] for match in stamps):
            return None
        return Stamps(np.array([np.nan if m is None else _time_s(m) for m in found]), "")
    order = _order(stamps)
    if order is None:
        return None
    days = np.array([np.nan if m is None else float(_day(m, order).toordinal()) for m in found])
    times = np.array([0.0 if m is None or m["hour"] is None else _time_s(m) for m in found])
    first = int(np.argmax(np.isfinite(days)))
    since = datetime.fromordinal(int(days[first])).replace(tzinfo=UTC) + timedelta(seconds=times[first])
    text = since.isoformat(timespec="milliseconds").replace("+00:00", "")
    seconds = (days - days[first]) * _DAY_S + (times - times[first])
    zoned = stamps[0]["zone"] is not None
    return Stamps(seconds, text.removesuffix("T00:00:00.000") + ("Z" if zoned else ""))


def _time_s(match: re.Match[str]) -> float:
    """Seconds since midnight, UTC where the stamp has a zone."""
    fraction = float(match["fraction"].replace(",", ".")) if match["fraction"] else 0.0
    hour, minute = int(match["hour"]), int(match["minute"])
    if match["second"] is None and match["fraction"]:
        return 60.0 * hour + minute + fraction
    if match["half"]:
        hour = hour % 12 + (12 if match["half"] in "pP" else 0)
    whole = 3600 * hour + 60 * minute + int(match["second"] or 0) - _zone_s(match["zone"])
    return whole + fraction


def _zone_s(zone: str | None) -> int:
    if zone is None or not zone[1:3].isdigit():
        return 0
    digits = zone[1:].replace(":", "").ljust(4, "0")
    seconds = 3600 * int(digits[:2]) + 60 * int(digits[2:])
    return -seconds if zone[0] == "-" else seconds


def _day(match: re.Match[str], order: str) -> date:
    parts = dict(zip(order, (int(match[k]) for k in "abc"), strict=True))
    year = parts["y"] + (2000 if parts["y"] < 100 else 0)
    return date(year, parts["m"], parts["d"])


def _order(stamps: Sequence[re.Match[str]]) -> str | None:
    """Order of year, month and day that every stamp allows and that makes the least of the span."""
    spans: dict[str, int] = {}
    unlike = {m.group("a", "b", "c"): m for m in stamps}.values()
    for order in _ORDERS:
        if any(len(m["c"] if order == "ymd" else m["a"]) > 2 and len(m["a"]) != len(m["c"]) for m in unlike):
            continue  # four digits are the year
        try:
            days = [_day(m, order).toordinal() for m in unlike]
        except ValueError:
            continue
        spans[order] = sum(abs(after - before) for before, after in pairwise(days))
    return min(spans, key=lambda order: spans[order]) if spans else None
