"""The flights that went worst, and why: what to look at first."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.studies.naming import said_rightly
from wingwatch.studies.rows import Flags, Rows
from wingwatch.studies.statistics import Interval, quickest_delay_s, wilson

__all__ = ["Misses", "WorstFlight", "misses", "worst_flights"]

Array = NDArray[np.float64]

_MOST = 10


@dataclass(frozen=True, slots=True)
class WorstFlight:
    """One flight.

    Attributes:
        kind: ``missed``, ``late``, ``misnamed`` or ``missized``; why: in a sentence.
        condition: what flew, in which air, how excited; effect: what was wrong, how much, from when on.
        command: reproduces it.
    """

    kind: str
    seed: int
    why: str
    condition: str
    effect: str
    command: str


@dataclass(frozen=True, slots=True)
class Misses:
    """Flights of one effect of which nothing was said, by whether anyone could have said it.

    Attributes:
        beyond_reach: fraction of them in which less information had arrived than the threshold asks for, and the
            evidence stayed below it.
        held_back: fraction in which the evidence passed the threshold after the onset, and no alert followed.
    """

    effect: str
    flights: int
    beyond_reach: Interval
    held_back: Interval


def misses(rows: Rows, faulty: Flags) -> list[Misses]:
    """A row an effect that was ever missed and whose information is known."""
    missed = faulty & ~rows.flag("detected") & np.isfinite(rows.number("information"))
    threshold = rows.number("threshold")
    passed = rows.number("evidence_max") > threshold
    short = (rows.number("information") < threshold) & ~passed
    found = []
    for effect, chosen in rows.groups("effect", missed).items():
        flights = int(chosen.sum())
        shares = (wilson(int((chosen & why).sum()), flights) for why in (short, passed))
        found.append(Misses(effect, flights, *shares))
    return found


def worst_flights(rows: Rows, faulty: Flags, false_alarm_interval_s: float) -> list[WorstFlight]:
    """Up to ten of each kind, the worst first."""
    seen = rows.flag("detected")
    information = np.nan_to_num(rows.number("information"), nan=-1.0)
    bound = quickest_delay_s(false_alarm_interval_s, rows.number("information_rate_per_s"))
    with np.errstate(divide="ignore", invalid="ignore"):
        over = np.where(np.isfinite(bound) & (bound > 0.0), rows.number("delay_s") / bound, np.nan)
        z = (rows.number("size") - rows.number("severity")) / rows.number("size_standard_error")
    said, rightly = rows.words("said_cause"), said_rightly(rows)
    found = [
        _flight(rows, row, "missed", _why_missed(rows, row)) for row in _most(faulty & ~seen, information)
    ]
    for row in _most(faulty & seen & np.isfinite(over), over):
        why = f"said after {rows.number('delay_s')[row]:.0f} s, the bound is {bound[row]:.1f} s"
        found.append(_flight(rows, row, "late", why))
    for row in _most(faulty & seen & ~rightly, np.nan_to_num(rows.number("said_probability"))):
        part = f" of {channel}" if (channel := rows.text("said_channel", row)) else ""
        why = f"called {said[row] or 'unknown'}{part} with probability {rows.number('said_probability')[row]:.2f}"
        found.append(_flight(rows, row, "misnamed", why))
    for row in _most(faulty & (np.abs(z) > 2.0), np.abs(z)):
        size, error = rows.number("size")[row], rows.number("size_standard_error")[row]
        why = f"size stated as {size:.3g} ± {error:.2g}, off by {abs(z[row]):.1f} standard errors"
        found.append(_flight(rows, row, "missized", why))
    return found


def _most(among: Flags, measure: Array) -> list[int]:
    chosen = np.flatnonzero(among)
    order = np.argsort(-measure[chosen], kind="stable")
    return [int(row) for row in chosen[order][:_MOST]]


def _why_missed(rows: Rows, row: int) -> str:
    information, threshold = rows.number("information")[row], rows.number("threshold")[row]
    evidence = rows.number("evidence_max")[row]
    if math.isnan(information):
        return f"nothing said; evidence reached {evidence:.1f} of {threshold:.1f}"
    enough = "more" if information >= threshold else "less"
    return (
        f"nothing said; information of {information:.1f} arrived, {enough} than the threshold of {threshold:.1f}, "
        f"and evidence reached {evidence:.1f}"
    )


def _flight(rows: Rows, row: int, kind: str, why: str) -> WorstFlight:
    words = [
        rows.text(name, row)
        for name in ("aircraft", "turbulence", "excitation", "route", "sensors", "surfaces")
    ]
    labels = ("", "turbulence ", "excitation ", "route ", "", "surface ")
    condition = ", ".join(
        f"{label}{word.replace('_', ' ')}" for label, word in zip(labels, words, strict=True)
    )
    target = rows.text("target", row)
    severity = rows.number("severity")[row]
    size = "where it was" if math.isnan(severity) else f"{severity:.3g}"
    effect = (
        f"{rows.text('effect', row)}{f' ({target})' if target else ''} {size} "
        f"from {rows.number('onset_s')[row]:.0f} s"
    )
    seed = int(rows.number("seed")[row])
    return WorstFlight(kind, seed, why, condition, effect, rows.text("command", row))
