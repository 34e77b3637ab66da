"""False alarms per hour, every one of them by its seed, and the operating curve over the threshold."""

import json
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.studies.detection import ORDER
from wingwatch.studies.rows import Flags, Rows
from wingwatch.studies.statistics import Interval, exceedance_rates, poisson_rate, wilson

__all__ = [
    "FalseAlarm",
    "OperatingCurve",
    "Rate",
    "alarm_evidence",
    "every_false_alarm",
    "false_alarm_rates",
    "operating_curves",
]

Array = NDArray[np.float64]

_RATE_COLUMNS = (
    "turbulence", "turbulence_model", "excitation", "route", "aircraft", "sensors", "surfaces", "expectation"
)  # fmt: skip
_CURVE_POINTS = 120
_PASSAGE_CONFIDENCE = 0.90
"""Of operating curves, so that their upper limit alone holds at 95 %."""


@dataclass(frozen=True, slots=True)
class Rate:
    """False alarms of one group of flights.

    Attributes:
        by, group: column and its word, both empty for all; ``sensor fault`` and its name for flights whose sensors are
            at fault and whose aircraft is well, counted until their first alarm.
    """

    by: str
    group: str
    flights: int
    hours: float
    alarms: int
    per_hour: Interval


@dataclass(frozen=True, slots=True)
class FalseAlarm:
    """One false alarm, and the command that reproduces its flight.

    Attributes:
        reason: what misled the monitor: ``derivative`` and ``z`` of the one that departed most when the alarm was
            raised; ``structure``, ``block_end_s`` and ``log10_probability`` of the least likely block of the minute
            before. Empty under a sensor fault.
    """

    seed: int
    time_s: float
    alert_kind: str
    cause: str
    aircraft: str
    turbulence: str
    excitation: str
    route: str
    sensor_fault: str
    evidence: float
    command: str
    reason: Mapping[str, str | float]


@dataclass(frozen=True, slots=True)
class OperatingCurve:
    """Detection and false alarms in one kind of air, were the threshold another.

    An alert asks for more than evidence: for a clear cause, confirmed by the filter. So the alarms at a threshold are
    at most the passages of the evidence; from the monitor's own threshold on they are at most the alarms that it gave
    and whose evidence passed. Both axes are bounds of that kind.

    Attributes:
        by, group: column and its word; both empty for all air.
        hours, faulty_flights: that it rests on.
        threshold: of the evidence (natural logarithm).
        per_hour, per_hour_low, per_hour_high: false alarms, at most; the limits hold at 95 % each.
        detected, detected_low, detected_high: fraction of faulty flights, at most.
        evidence_per_hour, evidence_detected: the same of the evidence alone.
        own_threshold, own_per_hour, own_detected: the monitor as it is.
    """

    by: str
    group: str
    hours: float
    faulty_flights: int
    threshold: list[float]
    per_hour: list[float]
    per_hour_low: list[float]
    per_hour_high: list[float]
    detected: list[float]
    detected_low: list[float]
    detected_high: list[float]
    evidence_per_hour: list[float]
    evidence_detected: list[float]
    own_threshold: float
    own_per_hour: Interval
    own_detected: Interval


def false_alarm_rates(rows: Rows, well: Flags, sensor_faults: Flags) -> list[Rate]:
    """Rates over all healthy time, then by kind of air and by whatever else the flights differ in.

    Args:
        well: flights whose healthy time counts; sensor_faults: healthy aircraft with a sensor at fault.
    """
    found = [_rate(rows, "", "", well)]
    for by in _RATE_COLUMNS:
        groups = rows.groups(by, well, ORDER.get(by, ()))
        if len(groups) > 1 or by == "turbulence":
            found += [_rate(rows, by, word, chosen) for word, chosen in groups.items()]
    for word, chosen in rows.groups("effect", sensor_faults).items():
        seen = rows.flag("detected")[chosen]
        after = rows.number("flight_s")[chosen] - rows.number("onset_s")[chosen]
        hours = float(np.where(seen, rows.number("delay_s")[chosen], after).sum()) / 3600.0
        rate = poisson_rate(int(seen.sum()), hours)
        found.append(Rate("sensor fault", word, int(chosen.sum()), hours, int(seen.sum()), rate))
    return found


def _rate(rows: Rows, by: str, group: str, chosen: Flags) -> Rate:
    hours = float(np.nansum(rows.number("healthy_h")[chosen]))
    alarms = int(np.nansum(rows.number("false_alerts")[chosen]))
    return Rate(by, group, int(chosen.sum()), hours, alarms, poisson_rate(alarms, hours))


def every_false_alarm(rows: Rows, well: Flags, sensor_faults: Flags) -> list[FalseAlarm]:
    """Every false alarm in the order of seeds; with a sensor at fault, the first of each flight."""
    found = []
    count = rows.number("false_alerts")
    alarmed = np.flatnonzero((well | sensor_faults) & (count > 0))
    texts = zip(rows.texts("false_causes", alarmed), rows.texts("false_reasons", alarmed), strict=True)
    for (row, causes), (_, reasons) in texts:
        found += [
            _alarm(rows, row, float(at), str(kind), str(cause), reason)
            for (at, kind, cause), reason in zip(json.loads(causes), json.loads(reasons), strict=True)
        ]
    for row in np.flatnonzero(sensor_faults & rows.flag("detected")).tolist():
        said = rows.text("said_kind", row), rows.text("said_cause", row)
        found.append(_alarm(rows, row, float(rows.number("detected_s")[row]), *said, {}))
    return sorted(found, key=lambda alarm: (alarm.seed, alarm.time_s))


def _alarm(
    rows: Rows, row: int, time_s: float, kind: str, cause: str, reason: Mapping[str, str | float]
) -> FalseAlarm:
    onset = rows.number("onset_s")[row]
    before = not time_s >= onset
    sensor_fault = rows.text("effect", row) if rows.text("kind", row) == "healthy" and not before else ""
    return FalseAlarm(
        seed=int(rows.number("seed")[row]),
        time_s=time_s,
        alert_kind=kind,
        cause=cause,
        aircraft=rows.text("aircraft", row),
        turbulence=rows.text("turbulence", row),
        excitation=rows.text("excitation", row),
        route=rows.text("route", row),
        sensor_fault=sensor_fault,
        evidence=float(rows.number("evidence_max_before" if before else "evidence_max")[row]),
        command=rows.text("command", row),
        reason=reason,
    )


def alarm_evidence(evidence: Array, alarmed: Flags, own: float) -> Array:
    """Largest evidence of each flight that an alarm at any threshold can have had: below the monitor's own one where
    it gave none."""
    silent = np.fmin(evidence, np.nextafter(own, -np.inf))
    return np.where(alarmed, np.nan_to_num(evidence, nan=np.inf), silent)


def operating_curves(rows: Rows, well: Flags, faulty: Flags) -> list[OperatingCurve]:
    """Over all air, and in each kind of it."""
    groups = {("", ""): well | faulty}
    by_air = rows.groups("turbulence", well | faulty, ORDER["turbulence"])
    if len(by_air) > 1:
        groups |= {("turbulence", word): chosen for word, chosen in by_air.items()}
    curves = [_operating_curve(rows, *key, chosen & well, chosen & faulty) for key, chosen in groups.items()]
    return [c for c in curves if c is not None]


def _operating_curve(rows: Rows, by: str, group: str, well: Flags, faulty: Flags) -> OperatingCurve | None:
    hours = np.nan_to_num(rows.number("healthy_h")[well])
    before, after = rows.number("evidence_max_before")[well], rows.number("evidence_max")[faulty]
    evidence = np.concatenate([before, after])
    evidence = evidence[np.isfinite(evidence)]
    if not evidence.size or not hours.sum() > 0.0:
        return None
    own = float(np.nanmedian(rows.number("threshold")[well | faulty]))
    highest_well = float(np.max(before[np.isfinite(before)], initial=0.0))
    thresholds = np.linspace(0.0, max(3.0 * own, 1.05 * highest_well), _CURVE_POINTS)
    thresholds = np.unique(np.append(thresholds, own))
    alarmed, detected = rows.number("false_alerts")[well] > 0, rows.flag("detected")[faulty]
    rates = exceedance_rates(alarm_evidence(before, alarmed, own), hours, thresholds, _PASSAGE_CONFIDENCE)
    flights = int(faulty.sum())
    seen = [wilson(n, flights) for n in _passing(alarm_evidence(after, detected, own), thresholds)]
    alarms = float(np.nansum(rows.number("false_alerts")[well]))
    return OperatingCurve(
        by=by,
        group=group,
        hours=float(hours.sum()),
        faulty_flights=flights,
        threshold=thresholds.tolist(),
        per_hour=rates.rate.tolist(),
        per_hour_low=rates.low.tolist(),
        per_hour_high=rates.high.tolist(),
        detected=[s.value for s in seen],
        detected_low=[s.low for s in seen],
        detected_high=[s.high for s in seen],
        evidence_per_hour=exceedance_rates(before, hours, thresholds).rate.tolist(),
        evidence_detected=[n / max(flights, 1) for n in _passing(after, thresholds)],
        own_threshold=own,
        own_per_hour=poisson_rate(alarms, float(hours.sum())),
        own_detected=wilson(int(detected.sum()), flights),
    )


def _passing(evidence: Array, thresholds: Array) -> list[int]:
    """How many reach each threshold."""
    ordered = np.sort(np.nan_to_num(evidence, nan=-np.inf, posinf=np.inf))
    return [int(n) for n in ordered.size - np.searchsorted(ordered, thresholds, side="left")]
