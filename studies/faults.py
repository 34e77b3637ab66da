"""Faults by kind and part: how many are seen, how soon, under which name, and how honest their sizes are."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wingwatch.studies.detection import ORDER
from wingwatch.studies.fault_names import KINDS_OF_FAULT, PARTS, kind_of, parts_of
from wingwatch.studies.rows import Flags, Rows
from wingwatch.studies.statistics import Interval, wilson

__all__ = ["WITHIN_S", "FaultRow", "fault_rows"]

WITHIN_S = (3.0, 5.0, 10.0, 30.0)

_CONDITIONS = ("turbulence", "excitation", "aircraft", "route", "sensors", "surfaces", "expectation")
_Z = 1.959964


@dataclass(frozen=True, slots=True)
class FaultRow:
    """One group of flights with a fault.

    Attributes:
        kind: ``icing``, ``damage`` or ``sensor``: the kind of alert that is right.
        by, group: what the group has in common: ``effect``, ``part`` (its channels), ``fault`` (effect and channel or
            target), or a condition; both empty for all faults of the kind.
        early: flights with an alert before the onset.
        seen: flights with an alert of any cause after the onset; within: so many seconds after it (the keys).
        median_s: of the delays of what was seen.
        first_right: of the seen, those whose first alert named cause and part rightly as it was raised; first_in_set:
            or had them among its candidates; right_at_end: those of which an alert in force at the end does.
        other_kind: of all flights, those in which an alert after the onset named a fault of another kind.
        covered: of ``sized`` flights that were named rightly with a size, those whose stated 95 % interval has it.
    """

    kind: str
    by: str
    group: str
    flights: int
    early: Interval
    seen: Interval
    within: dict[str, Interval]
    median_s: float
    first_right: Interval
    first_in_set: Interval
    right_at_end: Interval
    other_kind: Interval
    sized: int
    covered: Interval


def fault_rows(rows: Rows, faults: Flags) -> list[FaultRow]:
    """Rows of each kind of fault: all, by effect, by part, by both, then by the conditions of flight.

    Args:
        faults: flights in which anything was wrong, of aircraft or sensor.
    """
    effects = rows.words("effect")
    kinds = np.array([kind_of(e) if e else "" for e in effects.tolist()], dtype=object)
    found = []
    for kind in KINDS_OF_FAULT:
        among = faults & (kinds == kind)
        if among.any():
            found += [_row(rows, kind, by, group, part) for by, group, part in _groups(rows, among)]
    return found


def _groups(rows: Rows, among: Flags) -> Iterator[tuple[str, str, Flags]]:
    yield "", "", among
    by_effect = rows.groups("effect", among)
    if len(by_effect) > 1:
        for effect, chosen in by_effect.items():
            yield "effect", effect, chosen
    channels = rows.words("channel")
    parts = np.array([parts_of(c) for c in channels.tolist()], dtype=object)
    known = [p for p in (*PARTS, "airframe") if (among & (parts == p)).any()]
    known += sorted(set(parts[among].tolist()) - set(known))
    if len(known) > 1:
        for part in known:
            yield "part", part, among & (parts == part)
    for effect, chosen in by_effect.items():
        what = "channel" if (channels[chosen] != "").all() else "target"
        targets = rows.groups(what, chosen)
        if len(targets) > 1:
            for target, some in targets.items():
                yield "fault", f"{effect} {target}", some
    for by in _CONDITIONS:
        groups = rows.groups(by, among, ORDER.get(by, ()))
        if len(groups) > 1:
            for word, chosen in groups.items():
                yield by, word, chosen


def _row(rows: Rows, kind: str, by: str, group: str, chosen: Flags) -> FaultRow:
    flights = int(chosen.sum())
    seen = chosen & rows.flag("detected")
    noticed = int(seen.sum())
    delays = rows.number("delay_s")[seen]
    size, error = rows.number("size"), rows.number("size_standard_error")
    sized = chosen & np.isfinite(rows.number("right_delay_s")) & np.isfinite(size) & (error > 0.0)
    z = (size[sized] - rows.number("severity")[sized]) / error[sized]
    z = z[np.isfinite(z)]  # of what is stuck where it was there is no size

    def of_seen(column: str) -> Interval:
        return wilson(int((seen & rows.flag(column)).sum()), noticed)

    return FaultRow(
        kind=kind,
        by=by,
        group=group,
        flights=flights,
        early=wilson(int((chosen & (rows.number("false_alerts") > 0)).sum()), flights),
        seen=wilson(noticed, flights),
        within={f"{s:g}": wilson(int((delays <= s).sum()), flights) for s in WITHIN_S},
        median_s=float(np.median(delays)) if noticed else math.nan,
        first_right=of_seen("first_right"),
        first_in_set=of_seen("first_in_set"),
        right_at_end=of_seen("right_at_end"),
        other_kind=wilson(int((chosen & np.isfinite(rows.number("other_kind_delay_s"))).sum()), flights),
        sized=int(z.size),
        covered=wilson(int((np.abs(z) <= _Z).sum()), z.size),
    )
