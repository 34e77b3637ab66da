"""False alarms per hour, every one of them by its seed, and the operating curve over the threshold."""

import json
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.studies.detection import ORDER
from wingwatch.studies.fault_names import KINDS_OF_FAULT
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
_ONE_SIDED = 0.90
"""Confidence of two limits, so that the upper one alone holds at 95 %."""


@dataclass(frozen=True, slots=True)
class Rate:
    """False alarms of one group of flights.

    Attributes:
        by, group: column and its word, both empty for all; ``sensor fault`` and its name for flights whose sensors are
            at fault and whose aircraft is well, counted until an alarm first calls that icing or damage.
        at_most_per_hour: upper limit of the rate at 95 % confidence (exact, one-sided).
    """

    by: str
    group: str
    flights: int
    hours: float
    alarms: int
    per_hour: Interval
    at_most_per_hour: float


@dataclass(frozen=True, slots=True)
class FalseAlarm:
    """One false alarm, and the command that reproduces its flight.

    Attributes:
        channel: sensor, surface or throttle that it named; empty for the airframe.
        reason: what misled the monitor: ``derivative`` and ``z`` of the one that departed most when the alarm was
            raised; ``structure``, ``block_end_s`` and ``log10_probability`` of the least likely block of the minute
            before. Empty under a sensor fault.
    """

    seed: int
    time_s: float
    alert_kind: str
    cause: str
    channel: str
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

    Only the test of the derivatives has this threshold: alarms and detections are those of alerts about the airframe,
    without a channel. An alert asks for more than evidence: for a clear cause, confirmed by the filter. So the alarms
    at a threshold are at most the passages of the evidence; from the monitor's own threshold on they are at most the
    alarms that it gave and whose evidence passed. Both axes are bounds of that kind.

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
        wrong_s = rows.number("other_kind_delay_s")[chosen]
        wrong = np.isfinite(wrong_s)
        after = rows.number("flight_s")[chosen] - rows.number("onset_s")[chosen]
        hours = float(np.where(wrong, wrong_s, after).sum()) / 3600.0
        found.append(_rate_of("sensor fault", word, int(chosen.sum()), hours, int(wrong.sum())))
    return found


def _rate(rows: Rows, by: str, group: str, chosen: Flags) -> Rate:
    hours = float(np.nansum(rows.number("healthy_h")[chosen]))
    alarms = int(np.nansum(rows.number("false_alerts")[chosen]))
    return _rate_of(by, group, int(chosen.sum()), hours, alarms)


def _rate_of(by: str, group: str, flights: int, hours: float, alarms: int) -> Rate:
    at_most = poisson_rate(alarms, hours, _ONE_SIDED).high
    return Rate(by, group, flights, hours, alarms, poisson_rate(alarms, hours), at_most)


def every_false_alarm(rows: Rows, well: Flags, sensor_faults: Flags) -> list[FalseAlarm]:
    """Every false alarm in the order of seeds; with a sensor at fault, the first that calls it icing or damage."""
    found = []
    count = rows.number("false_alerts")
    alarmed = np.flatnonzero((well | sensor_faults) & (count > 0))
    texts = zip(rows.texts("false_causes", alarmed), rows.texts("false_reasons", alarmed), strict=True)
    for (row, causes), (_, reasons) in texts:
        found += [
            _alarm(rows, row, float(at_s), (kind, cause, channel or ""), reason)
            for (at_s, kind, cause, channel), reason in zip(
                json.loads(causes), json.loads(reasons), strict=True
            )
        ]
    wrong_s = rows.number("onset_s") + rows.number("other_kind_delay_s")
    wrong = np.flatnonzero(sensor_faults & np.isfinite(wrong_s))
    for row, alerts in rows.texts("alerts", wrong):
        found.append(_alarm(rows, row, float(wrong_s[row]), _airframe_name(alerts, float(wrong_s[row])), {}))
    return sorted(found, key=lambda alarm: (alarm.seed, alarm.time_s))


def _airframe_name(alerts: str, time_s: float) -> tuple[str, str, str]:
    """The name of icing or damage that an alert of a flight got at a time."""
    names = [n for a in json.loads(alerts) for n in a["names"] if n["kind"] in KINDS_OF_FAULT[:2]]
    if not names:
        return "", "", ""
    name = min(names, key=lambda n: abs(float(n["since_s"]) - time_s))
    return str(name["kind"]), str(name["cause"]), str(name["channel"] or "")


def _alarm(
    rows: Rows, row: int, time_s: float, name: tuple[str, str, str], reason: Mapping[str, str | float]
) -> FalseAlarm:
    onset = rows.number("onset_s")[row]
    before = not time_s >= onset
    return FalseAlarm(
        seed=int(rows.number("seed")[row]),
        time_s=time_s,
        alert_kind=name[0],
        cause=name[1],
        channel=name[2],
        aircraft=rows.text("aircraft", row),
        turbulence=rows.text("turbulence", row),
        excitation=rows.text("excitation", row),
        route=rows.text("route", row),
        sensor_fault="" if before else rows.text("effect", row),
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
    alarmed = rows.number("false_derivative_alerts")[well] > 0
    detected = np.isfinite(rows.number("derivatives_delay_s")[faulty])
    rates = exceedance_rates(alarm_evidence(before, alarmed, own), hours, thresholds, _ONE_SIDED)
    flights = int(faulty.sum())
    seen = [wilson(n, flights) for n in _passing(alarm_evidence(after, detected, own), thresholds)]
    alarms = float(np.nansum(rows.number("false_derivative_alerts")[well]))
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
