"""Faults by kind and part, in sentences, a picture and tables."""

import math
from collections.abc import Sequence
from html import escape

from wingwatch.pages.document import Pictures
from wingwatch.pages.markup import paragraph, section, table
from wingwatch.pages.picture import Figure
from wingwatch.pages.texts import number
from wingwatch.studies.faults import WITHIN_S, FaultRow
from wingwatch.studies.page.figures import faults_figure
from wingwatch.studies.page.texts import effect_text, group_text, percent_text
from wingwatch.studies.statistics import Interval
from wingwatch.studies.summary import Summary

__all__ = ["SHORT_HEAD", "SHORT_LEGEND", "fault_section", "fault_sentences", "fault_title", "short_cells"]

_OTHERS = {
    "icing": "called damage or a sensor fault",
    "damage": "called icing or a sensor fault",
    "sensor": "called icing or damage",
}
_NAMES = {"icing": "ice", "damage": "damage", "sensor": "sensor faults"}
_SOON_HEAD = (
    "flights", "how many", "alert before the onset", *(f"within {s:g} s" for s in WITHIN_S), "by the end", "median, s",
)  # fmt: skip
_NAMED_HEAD = (
    "flights", "right at first", "right or a candidate", "right at the end", "another kind", "sized",
    "size in its 95 % interval",
)  # fmt: skip
SHORT_HEAD = (
    "flights", "n", "early", *(f"{s:g} s" for s in WITHIN_S), "end", "median", "right", "set", "last", "other", "sized",
    "held",
)  # fmt: skip
"""Of both tables for a terminal, without intervals."""
SHORT_LEGEND = (
    "Percent of n flights. early: an alert before the onset; 3 s to end: noticed within; median: of what was noticed, "
    "s. Of the noticed, right: named rightly by the first alert; set: or among its candidates; last: an alert in force "
    "at the end is right. other: named as a fault of another kind. held: of the sized, those whose 95 % interval has "
    "the true size."
)
_LEGEND = (
    "In percent with Wilson's 95 % interval. Noticed: an alert of any cause after the onset; median: of the noticed. "
    "Right: cause and part, of an airframe's fault the cause; every kind of ice is icing. At first: the first alert "
    "after the onset, as it was raised; a candidate: the fault is one of the causes that it calls possible; at the "
    "end: an alert in force when the flight ends. These three are of the flights in which the fault was noticed. "
    "Another kind: of all flights, those in which an alert called an airframe's fault a sensor's or the other way "
    "round, or ice damage. Sized: flights in which the fault was named rightly, with a size."
)
_SHOWN_BY = ("", "effect", "part", "fault")


def fault_title(kind: str) -> str:
    """Above the tables of one kind."""
    name = _NAMES[kind]
    return f"{name[:1].upper()}{name[1:]}"


def fault_sentences(s: Summary) -> list[str]:
    """A sentence for each kind of fault that was flown."""
    return [_sentence(row) for row in s.faults if not row.by]


def _sentence(row: FaultRow) -> str:
    seen = (
        f"Of {row.flights} flights with {_NAMES[row.kind]} {percent_text(row.within['10'])} are noticed within 10 s "
        f"and {percent_text(row.seen)} by the end"
    )
    if math.isnan(row.median_s):
        return f"{seen}."
    return (
        f"{seen}, half of these within {number(row.median_s, 2)} s; of the noticed {percent_text(row.first_right)} are "
        f"named rightly at first, {percent_text(row.first_in_set)} rightly or among what is called possible; "
        f"{percent_text(row.other_kind)} of all are {_OTHERS[row.kind]}."
    )


def short_cells(row: FaultRow) -> list[str]:
    """One row of a table under ``SHORT_HEAD``."""
    shares = [row.early, *row.within.values(), row.seen]
    named = [row.first_right, row.first_in_set, row.right_at_end, row.other_kind]
    return [
        _group_text(row), str(row.flights), *(_short(i) for i in shares), number(row.median_s, 2),
        *(_short(i) for i in named), str(row.sized), _short(row.covered),
    ]  # fmt: skip


def _short(share: Interval) -> str:
    return number(round(100.0 * share.value), 3) if math.isfinite(share.value) else "-"


def _tables(rows: Sequence[FaultRow]) -> str:
    """How soon faults were noticed, and what they were called."""
    soon = (
        [_group_text(r), str(r.flights), _range(r.early), *map(_range, r.within.values()), _range(r.seen),
         number(r.median_s, 2)]
        for r in rows
    )  # fmt: skip
    named = (
        [_group_text(r), *map(_range, (r.first_right, r.first_in_set, r.right_at_end, r.other_kind)), str(r.sized),
         _range(r.covered)]
        for r in rows
    )  # fmt: skip
    return table(_SOON_HEAD, soon) + table(_NAMED_HEAD, named)


def _range(share: Interval) -> str:
    """ "50 (46-55)", in percent: many columns have to stand side by side."""
    if math.isnan(share.value):
        return "-"
    value, low, high = (100.0 * x for x in (share.value, share.low, share.high))
    return f"{value:.0f} ({low:.0f}-{high:.0f})"


def _group_text(row: FaultRow) -> str:
    if row.by == "effect":
        return effect_text(row.group)
    if row.by == "fault":
        effect, _, part = row.group.partition(" ")
        return f"{effect_text(effect)}: {_channel_text(part)}"
    return row.group if row.by == "part" else group_text(row.by, row.group)


def _channel_text(channel: str) -> str:
    for unit in ("_rad_s", "_m_s2", "_m_s", "_rad"):
        channel = channel.removesuffix(unit)
    return channel.replace("_", " ")


def fault_section(s: Summary, pictures: Pictures) -> str:
    """All kinds, each with a picture and its tables; nothing where no fault was flown."""
    if not s.faults:
        return ""
    parts = []
    for kind in dict.fromkeys(row.kind for row in s.faults):
        mine = [row for row in s.faults if row.kind == kind]
        shown = [row for row in mine if row.by in _SHOWN_BY]
        rest = [row for row in mine if row.by not in _SHOWN_BY]
        parts += [
            f"<h3>{escape(fault_title(kind))}</h3>",
            pictures.place(_figure(kind, [row for row in shown if row.by != "fault"]), _sentence(mine[0])),
            _tables(shown),
            _folded(_tables(rest)) if rest else "",
        ]
    return section("faults", "Every fault: seen, named, sized", *parts, paragraph(_LEGEND, "legend"))


def _figure(kind: str, rows: Sequence[FaultRow]) -> Figure:
    words = [f"{_group_text(row)} ({row.flights})" for row in rows]
    return faults_figure(f"faults-{kind}", f"{fault_title(kind)}: noticed, and named rightly", rows, words)


def _folded(content: str) -> str:
    return f"<details><summary>By conditions of flight</summary>{content}</details>"
