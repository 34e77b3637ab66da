"""How surely and how soon faults are noticed, group by group."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.studies.rows import Flags, Rows
from wingwatch.studies.statistics import (
    Interval,
    fit_detection,
    noticed_fraction,
    quickest_delay_s,
    time_to_notice,
    wilson,
)

__all__ = [
    "CONDITIONS",
    "ORDER",
    "Delays",
    "Detection",
    "DetectionCurvePoints",
    "SizeClass",
    "condition_groups",
    "delays",
    "detection",
]

Array = NDArray[np.float64]

ORDER: dict[str, tuple[str, ...]] = {
    "turbulence": ("none", "light", "moderate", "severe", "changing"),
    "excitation": ("doublet", "3211", "multisine", "autopilot", "none"),
}
"""Columns whose words have an order."""

CONDITIONS = (
    "turbulence", "excitation", "aircraft", "target", "route", "turbulence_model", "sensors", "surfaces", "expectation"
)  # fmt: skip
"""Columns by which flights are distinguished; the first four have a picture."""

_CURVE_POINTS = 60
_DELAY_POINTS = 120
_BOUND_POINTS = 40
_MOST_CLASSES = 10
_FEWEST_IN_CLASS = 10
_FEWEST_FOR_A_SIZE = 3
_FRACTIONS = (0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True, slots=True)
class SizeClass:
    """Flights of neighbouring sizes: mean size and its range, how many, fraction noticed."""

    size: float
    smallest: float
    largest: float
    flights: int
    detected: Interval


@dataclass(frozen=True, slots=True)
class DetectionCurvePoints:
    """The fitted curve with its band, for drawing: sizes, probability, lower and upper edge."""

    size: list[float]
    probability: list[float]
    low: list[float]
    high: list[float]


@dataclass(frozen=True, slots=True)
class Detection:
    """Detection of one effect in one group of flights.

    Attributes:
        by, group: column and its word; both empty for all flights with the effect.
        detected: fraction noticed at any time before the flight's end; within: in the first 30 s.
        median_information: of the log likelihood ratio that had arrived.
        classes, curve: against size; curve is None where the flights do not suffice.
        size_50, size_95: noticed with these probabilities before the flight's end.
        fit_probability: of so large a distance of the classes from the curve; a small one says that the curve is not
            of the flights' form.
    """

    effect: str
    by: str
    group: str
    flights: int
    detected: Interval
    within: Interval
    median_information: float
    classes: list[SizeClass]
    curve: DetectionCurvePoints | None
    size_50: Interval
    size_95: Interval
    fit_probability: float


@dataclass(frozen=True, slots=True)
class Delays:
    """Delays of one effect in one group of flights, beside the quickest that there can be.

    Attributes:
        seconds: time by which a fraction of flights was noticed, keyed by the fraction; inf: not by the end.
        bound_s: the same of the bound of each flight, at its own information rate.
        over_bound: the median of delay over bound.
        time_s, fraction, low, high: noticed over time with its limits.
        bound_time_s: by when the bound allows it for equally spaced fractions of the flights.
    """

    effect: str
    by: str
    group: str
    flights: int
    seconds: dict[str, Interval]
    bound_s: dict[str, float]
    over_bound: Interval
    time_s: list[float]
    fraction: list[float]
    low: list[float]
    high: list[float]
    bound_time_s: list[float]


def condition_groups(rows: Rows, among: Flags) -> list[tuple[str, str, Flags]]:
    """All of the rows, then those of each word of each column in which they differ."""
    found: list[tuple[str, str, Flags]] = [("", "", among)]
    for by in CONDITIONS:
        groups = rows.groups(by, among, ORDER.get(by, ()))
        if len(groups) > 1:
            found += [(by, word, chosen) for word, chosen in groups.items()]
    return found


def detection(rows: Rows, effect: str, by: str, group: str, among: Flags, within_s: float) -> Detection:
    """What was noticed in a group of faulty flights."""
    size = np.abs(rows.number("severity")[among])
    seen = rows.flag("detected")[among]
    soon = seen & (rows.number("delay_s")[among] <= within_s)
    sized = np.isfinite(size)  # where a surface is stuck where it was, there is none
    curve = fit_detection(size, seen)
    information = rows.number("information")[among]
    known = information[np.isfinite(information)]
    points = None
    if curve is not None:
        x = np.geomspace(curve.smallest, curve.largest, _CURVE_POINTS)
        points = DetectionCurvePoints(x.tolist(), *(edge.tolist() for edge in curve.probability(x)))
    unknown = Interval(math.nan, math.nan, math.nan)
    return Detection(
        effect=effect,
        by=by,
        group=group,
        flights=int(size.size),
        detected=wilson(int(seen.sum()), size.size),
        within=wilson(int(soon.sum()), size.size),
        median_information=float(np.median(known)) if known.size else math.nan,
        classes=_classes(size[sized], seen[sized]),
        curve=points,
        size_50=curve.size_at(0.5) if curve else unknown,
        size_95=curve.size_at(0.95) if curve else unknown,
        fit_probability=curve.fit_probability if curve else math.nan,
    )


def _classes(size: Array, seen: Flags) -> list[SizeClass]:
    """Each size that was flown, or classes of equally many flights where there are more sizes than classes."""
    order = np.argsort(size, kind="stable")
    distinct = np.unique(size)
    if distinct.size <= _MOST_CLASSES and _FEWEST_FOR_A_SIZE * distinct.size <= size.size:
        parts = [np.flatnonzero(size == s) for s in distinct]
    else:
        parts = np.array_split(order, max(1, min(_MOST_CLASSES, size.size // _FEWEST_IN_CLASS)))
    return [
        SizeClass(
            float(size[p].mean()),
            float(size[p].min()),
            float(size[p].max()),
            int(p.size),
            wilson(int(seen[p].sum()), p.size),
        )
        for p in parts
        if p.size
    ]


def delays(
    rows: Rows, effect: str, by: str, group: str, among: Flags, false_alarm_interval_s: float
) -> Delays:
    """When a group of faulty flights was noticed.

    Args:
        false_alarm_interval_s: mean time between false alarms of the bound.
    """
    delay = np.where(rows.flag("detected")[among], rows.number("delay_s")[among], np.nan)
    watched = rows.number("flight_s")[among] - rows.number("onset_s")[among]
    bound = quickest_delay_s(false_alarm_interval_s, rows.number("information_rate_per_s")[among])
    known = np.isfinite(bound) & (bound > 0.0)
    times, fraction, low, high = noticed_fraction(delay, watched)
    kept = np.unique(np.linspace(0, times.size - 1, min(_DELAY_POINTS, times.size)).astype(np.intp))
    stated = bound[~np.isnan(bound)]
    return Delays(
        effect=effect,
        by=by,
        group=group,
        flights=int(delay.size),
        seconds={f"{f:g}": time_to_notice(delay, watched, f) for f in _FRACTIONS},
        bound_s={f"{f:g}": _quantile(stated, f) for f in _FRACTIONS},
        over_bound=time_to_notice(delay[known] / bound[known], watched[known] / bound[known], 0.5),
        time_s=times[kept].tolist(),
        fraction=fraction[kept].tolist(),
        low=low[kept].tolist(),
        high=high[kept].tolist(),
        bound_time_s=[_quantile(stated, (k + 1) / _BOUND_POINTS) for k in range(_BOUND_POINTS)],
    )


def _quantile(values: Array, fraction: float) -> float:
    """A value that was there, so that inf needs no arithmetic."""
    return float(np.sort(values)[math.ceil(fraction * values.size) - 1]) if values.size else math.nan
