"""What was said of each effect: its name and its size, beside the truth."""

import json
import math
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.studies.detection import condition_groups
from wingwatch.studies.fault_names import names_rightly
from wingwatch.studies.rows import Flags, Rows
from wingwatch.studies.statistics import Interval, wilson

__all__ = ["NOTHING", "UNKNOWN_CAUSE", "Confusion", "Sizes", "confusion", "said_rightly", "sizes"]

Array = NDArray[np.float64]

NOTHING, UNKNOWN_CAUSE = "nothing", "unknown"

_MOST_POINTS = 600
_Z = 1.959964


@dataclass(frozen=True, slots=True)
class Confusion:
    """Flights with one effect, by what was said of them.

    Attributes:
        effect: true one; ``nothing`` for healthy flights.
        well: nothing is wrong.
        said: number of flights by cause, ``unknown`` and ``nothing`` among them.
        named: fraction of the flights of which something was said in which cause and part were named rightly; where
            nothing is wrong, the fraction of which nothing was said.
    """

    effect: str
    well: bool
    flights: int
    said: dict[str, int]
    named: Interval


@dataclass(frozen=True, slots=True)
class Sizes:
    """Estimated against true size of flights that were noticed and named rightly, in one group.

    Attributes:
        covered: fraction whose true size lies in the stated 95 % interval.
        median_error, rms_error: of the estimate, in the size's unit; scatter: rms error over stated standard error.
        true, estimated, standard_error: up to 600 of them, for drawing.
    """

    effect: str
    by: str
    group: str
    flights: int
    covered: Interval
    median_error: float
    rms_error: float
    scatter: float
    true: list[float]
    estimated: list[float]
    standard_error: list[float]


def said_rightly(rows: Rows) -> Flags:
    """Flights of which the alert that counts as what was said names cause and part rightly."""
    words = [rows.words(name).tolist() for name in ("effect", "target", "said_cause", "said_channel")]
    names = list(zip(*words, strict=True))
    right = {name: names_rightly(*name) for name in set(names)}
    return rows.flag("detected") & np.array([right[name] for name in names], dtype=np.bool_)


def confusion(rows: Rows, faults: Flags, healthy: Flags) -> list[Confusion]:
    """A row an effect of aircraft or sensor, the healthy flights last."""
    rightly = said_rightly(rows)
    seen = rows.flag("detected")
    said = np.where(seen, rows.words("said_cause"), NOTHING)
    said = np.where(seen & (said == ""), UNKNOWN_CAUSE, said)
    found = []
    for effect, chosen in rows.groups("effect", faults).items():
        counts = Counter(said[chosen].tolist())
        something = int(chosen.sum()) - counts[NOTHING]
        named = wilson(int((chosen & rightly).sum()), something)
        found.append(Confusion(effect, False, int(chosen.sum()), _ordered(counts), named))
    if healthy.any():
        found.append(_quiet(NOTHING, _first_causes(rows, healthy)))
    return found


def _quiet(effect: str, counts: Counter[str]) -> Confusion:
    """Flights of a healthy aircraft: saying nothing is right."""
    return Confusion(effect, True, counts.total(), _ordered(counts), wilson(counts[NOTHING], counts.total()))


def _first_causes(rows: Rows, healthy: Flags) -> Counter[str]:
    alarmed = healthy & (rows.number("false_alerts") > 0)
    counts = Counter({NOTHING: int(healthy.sum() - alarmed.sum())})
    for _, text in rows.texts("false_causes", np.flatnonzero(alarmed)):
        causes = json.loads(text or "[]")
        counts[str(causes[0][2]) if causes else UNKNOWN_CAUSE] += 1
    return counts


def _ordered(counts: Counter[str]) -> dict[str, int]:
    """Causes by the alphabet, then ``unknown`` and ``nothing``."""
    causes = sorted(c for c in counts if c not in (UNKNOWN_CAUSE, NOTHING))
    return {c: counts[c] for c in (*causes, UNKNOWN_CAUSE, NOTHING)}


def sizes(rows: Rows, faulty: Flags) -> list[Sizes]:
    """For each effect that was ever named: all its flights, then those of each condition."""
    right = faulty & np.isfinite(rows.number("right_delay_s")) & np.isfinite(rows.number("severity"))
    right &= np.isfinite(rows.number("size")) & (rows.number("size_standard_error") > 0.0)
    found = []
    for effect, chosen in rows.groups("effect", right).items():
        found += [_sizes(rows, effect, by, group, part) for by, group, part in condition_groups(rows, chosen)]
    return found


def _sizes(rows: Rows, effect: str, by: str, group: str, chosen: Flags) -> Sizes:
    true, said = rows.number("severity")[chosen], rows.number("size")[chosen]
    error, stated = said - true, rows.number("size_standard_error")[chosen]
    z = error / stated
    kept = np.arange(true.size) if by == "" else np.arange(0)
    if kept.size > _MOST_POINTS:
        kept = np.linspace(0, true.size - 1, _MOST_POINTS).astype(np.intp)
    return Sizes(
        effect=effect,
        by=by,
        group=group,
        flights=int(true.size),
        covered=wilson(int((np.abs(z) <= _Z).sum()), true.size),
        median_error=float(np.median(error)),
        rms_error=math.sqrt(float(np.mean(error**2))),
        scatter=math.sqrt(float(np.mean(z**2))),
        true=true[kept].tolist(),
        estimated=said[kept].tolist(),
        standard_error=stated[kept].tolist(),
    )
