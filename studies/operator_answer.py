"""What an operator asks: from which size on a fault is seen in time, at a rate of false alarms that one can live with.

The study has the delay at the monitor's own threshold only. At a higher one, flights whose evidence passed it in time
bound what is seen in time from above, so the size is "at least"; at a lower one the size is "at most". The threshold is
that of the test of the derivatives: what relations between channels show does not go by it.
"""

import bisect
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wingwatch.studies.detection import ORDER
from wingwatch.studies.false_alarms import alarm_evidence
from wingwatch.studies.rows import Flags, Rows
from wingwatch.studies.statistics import Interval, exceedance_rates, fit_detection, poisson_rate

__all__ = ["ALLOWED_PER_HOUR", "PROBABILITY", "WITHIN_S", "Answer", "Threshold", "answers", "thresholds"]

Array = NDArray[np.float64]

PROBABILITY = 0.95
WITHIN_S = 30.0
ALLOWED_PER_HOUR = 0.01

_CONFIDENCE = 0.90
"""Two-sided, so that each limit holds at 95 %."""


@dataclass(frozen=True, slots=True)
class Threshold:
    """The threshold for one false alarm in 100 h, in one kind of air.

    Attributes:
        group: kind of air; empty for all.
        hours: healthy time that it rests on.
        own: the monitor's; own_per_hour: its false alarms about the airframe.
        vouched: smallest threshold whose rate of alarms (``OperatingCurve`` says which bound) is at most the allowed
            one at 95 % confidence; NaN where the hours are too few for any.
        estimate: smallest threshold whose estimated rate is at most the allowed one; NaN where the hours are fewer than
            those in which one alarm is allowed.
        hours_needed: healthy time without a single passage that would vouch for the allowed rate.
    """

    group: str
    hours: float
    own: float
    own_per_hour: Interval
    vouched: float
    estimate: float
    hours_needed: float


@dataclass(frozen=True, slots=True)
class Answer:
    """From which size on an effect is seen with 95 % probability within 30 s, in one condition.

    Attributes:
        aircraft, turbulence, excitation: of the condition; empty: all.
        largest: size that was flown.
        seen: fraction of the flights of the largest tenth of sizes that was seen in time.
        size: at the monitor's own threshold.
        threshold: for one false alarm in 100 h in this air; NaN where the data cannot vouch for any.
        size_at_threshold, relation: size there, and whether it is ``at least`` or ``at most`` that; empty: neither.
        fit_probability: of the curve, as in ``Detection``.
    """

    effect: str
    aircraft: str
    turbulence: str
    excitation: str
    flights: int
    largest: float
    seen: float
    size: Interval
    threshold: float
    size_at_threshold: Interval
    relation: Literal["", "at least", "at most"]
    fit_probability: float


def thresholds(rows: Rows, well: Flags) -> list[Threshold]:
    """For all air, and for each kind of it."""
    groups = {"": well} | rows.groups("turbulence", well, ORDER["turbulence"])
    return [_threshold(rows, group, chosen) for group, chosen in groups.items() if chosen.any()]


def _threshold(rows: Rows, group: str, well: Flags) -> Threshold:
    hours = np.nan_to_num(rows.number("healthy_h")[well])
    own = float(np.nanmedian(rows.number("threshold")[well]))
    peaks = alarm_evidence(
        rows.number("evidence_max_before")[well], rows.number("false_derivative_alerts")[well] > 0, own
    )
    found = peaks[np.isfinite(peaks)]
    steps = np.unique(np.concatenate([np.nextafter(found, np.inf), [0.0, own]]))

    def smallest(limit: Literal["rate", "high"]) -> float:
        def fits(step: float) -> bool:
            return bool(
                getattr(exceedance_rates(peaks, hours, [step], _CONFIDENCE), limit)[0] <= ALLOWED_PER_HOUR
            )

        place = bisect.bisect_left(steps.tolist(), True, key=fits)
        return float(steps[place]) if place < steps.size else math.nan

    total = float(hours.sum())
    alarms = float(np.nansum(rows.number("false_derivative_alerts")[well]))
    return Threshold(
        group=group,
        hours=total,
        own=own,
        own_per_hour=poisson_rate(alarms, total),
        vouched=smallest("high"),
        estimate=smallest("rate") if total * ALLOWED_PER_HOUR >= 1.0 else math.nan,
        hours_needed=-math.log(0.5 * (1.0 - _CONFIDENCE)) / ALLOWED_PER_HOUR,
    )


def answers(rows: Rows, effect: str, among: Flags, found: list[Threshold]) -> list[Answer]:
    """For all flights with an effect, for each word of a condition, and for each cell of air, excitation, aircraft."""
    by_air = {t.group: t for t in found}
    airs = rows.groups("turbulence", among, ORDER["turbulence"])
    excitations = rows.groups("excitation", among, ORDER["excitation"])
    aircraft = rows.groups("aircraft", among)
    cells = {("", "", ""): among}
    cells |= {(a, "", ""): f for a, f in aircraft.items()}
    cells |= {("", t, ""): f for t, f in airs.items()}
    cells |= {("", "", e): f for e, f in excitations.items()}
    for t, air in airs.items():
        cells |= {("", t, e): air & f for e, f in excitations.items()}
        for a, one in aircraft.items():
            cells |= {(a, t, e): air & one & f for e, f in excitations.items()}
    return [_answer(rows, effect, key, chosen, by_air) for key, chosen in cells.items() if chosen.any()]


def _answer(
    rows: Rows, effect: str, key: tuple[str, str, str], among: Flags, by_air: dict[str, Threshold]
) -> Answer:
    size = np.abs(rows.number("severity")[among])
    soon = rows.flag("detected")[among] & (rows.number("delay_s")[among] <= WITHIN_S)
    curve = fit_detection(size, soon)
    unknown = Interval(math.nan, math.nan, math.nan)
    own = curve.size_at(PROBABILITY) if curve else unknown
    air = by_air.get(key[1])
    threshold = air.vouched if air is not None else math.nan
    there, relation = own, ""
    if math.isnan(threshold):
        there = unknown
    elif air is not None and threshold > air.own:
        by_derivatives = rows.number("derivatives_delay_s")[among] <= WITHIN_S
        passed = by_derivatives & (rows.number("evidence_max_30_s")[among] >= threshold)
        higher = fit_detection(size, passed)
        there, relation = (higher.size_at(PROBABILITY) if higher else unknown), "at least"
    elif air is not None and threshold < air.own:
        relation = "at most"
    large = size >= np.quantile(size, 0.9)
    return Answer(
        effect=effect,
        aircraft=key[0],
        turbulence=key[1],
        excitation=key[2],
        flights=int(size.size),
        largest=float(size.max()),
        seen=float(soon[large].mean()),
        size=own,
        threshold=threshold,
        size_at_threshold=there,
        relation="at least" if relation == "at least" else "at most" if relation == "at most" else "",
        fit_probability=curve.fit_probability if curve else math.nan,
    )
