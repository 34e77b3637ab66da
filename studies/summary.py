"""What a study's table says, every figure with its interval; as an object and as JSON."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pyarrow as pa

from wingwatch.studies.calibration import Exceedance, Scatter, bayes_factor_exceedances, block_scatters
from wingwatch.studies.detection import Delays, Detection, condition_groups, delays, detection
from wingwatch.studies.false_alarms import (
    FalseAlarm,
    OperatingCurve,
    Rate,
    every_false_alarm,
    false_alarm_rates,
    operating_curves,
)
from wingwatch.studies.fault_names import SENSOR_EFFECTS
from wingwatch.studies.faults import FaultRow, fault_rows
from wingwatch.studies.naming import Confusion, Sizes, confusion, sizes
from wingwatch.studies.operator_answer import WITHIN_S, Answer, Threshold, answers, thresholds
from wingwatch.studies.rows import Flags, Rows
from wingwatch.studies.worst_flights import Misses, WorstFlight, misses, worst_flights

__all__ = ["FailedFlight", "Flown", "Summary", "as_json", "summarise"]

_MOST_FAILED = 100


@dataclass(frozen=True, slots=True)
class Flown:
    """What was flown.

    Attributes:
        flights: rows; failed, faulty, healthy, sensor_fault: of them.
        hours: simulated flight; healthy_hours: of it before any onset.
        observed_fraction: of the time, in which at least one structure was observable.
        processor_h: that it took.
    """

    kinds: list[str]
    aircraft: list[str]
    flights: int
    failed: int
    faulty: int
    healthy: int
    sensor_fault: int
    hours: float
    healthy_hours: float
    observed_fraction: float
    processor_h: float
    code_versions: list[str]
    settings_versions: list[str]


@dataclass(frozen=True, slots=True)
class FailedFlight:
    """A flight that could not be flown, and why."""

    seed: int
    reason: str
    command: str


@dataclass(frozen=True, slots=True)
class Summary:
    """All that is reported of a study.

    Attributes:
        false_alarm_interval_s: mean time between false alarms that the bound of quickest detection takes: the lower
            95 % limit of what was measured, which makes the bound a little too small rather than too large.
    """

    flown: Flown
    faults: list[FaultRow]
    thresholds: list[Threshold]
    answers: list[Answer]
    detection: list[Detection]
    false_alarm_interval_s: float
    delays: list[Delays]
    false_alarm_rates: list[Rate]
    false_alarms: list[FalseAlarm]
    operating_curves: list[OperatingCurve]
    sizes: list[Sizes]
    confusion: list[Confusion]
    misses: list[Misses]
    worst: list[WorstFlight]
    block_scatter: list[Scatter]
    bayes_factors: list[Exceedance]
    failed: list[FailedFlight]


def summarise(
    columns: pa.Table | Mapping[str, Any] | Path, aircraft: Mapping[str, str] = MappingProxyType({})
) -> Summary:
    """The summary of a study's table, or of several with the same columns, one after the other.

    Args:
        columns: a pyarrow table, or an array a column, as ``table.COLUMNS`` has them; or the study's file, which takes
            least memory.
        aircraft: what the grid's names of aircraft are shown as (``shown_aircraft``).
    """
    rows = Rows(columns, aircraft)
    flew = rows.words("failed") == ""
    no_effect = rows.words("effect") == ""
    faults = flew & ~no_effect
    sensor_faults = faults & np.isin(rows.words("effect").astype(str), SENSOR_EFFECTS)
    faulty = faults & ~sensor_faults
    well = flew & (rows.number("healthy_h") > 0.0)
    healthy = flew & no_effect
    rates = false_alarm_rates(rows, well, sensor_faults)
    interval_s = 3600.0 / rates[0].per_hour.high if rates[0].per_hour.high > 0.0 else math.nan
    found = thresholds(rows, well)
    detections, answered, late = [], [], []
    for effect, among in rows.groups("effect", faulty).items():
        answered += answers(rows, effect, among & np.isfinite(rows.number("severity")), found)
        for by, group, chosen in condition_groups(rows, among):
            detections.append(detection(rows, effect, by, group, chosen, WITHIN_S))
            late.append(delays(rows, effect, by, group, chosen, interval_s))
    return Summary(
        flown=_flown(rows, flew, faulty, healthy, sensor_faults, rates[0].hours),
        faults=fault_rows(rows, faults),
        thresholds=found,
        answers=answered,
        detection=detections,
        false_alarm_interval_s=interval_s,
        delays=late,
        false_alarm_rates=rates,
        false_alarms=every_false_alarm(rows, well, sensor_faults),
        operating_curves=operating_curves(rows, well, faulty) if faulty.any() else [],
        sizes=sizes(rows, faulty),
        confusion=confusion(rows, faults, healthy),
        misses=misses(rows, faulty),
        worst=worst_flights(rows, faults, interval_s),
        block_scatter=block_scatters(rows, well),
        bayes_factors=bayes_factor_exceedances(rows, healthy),
        failed=[
            FailedFlight(int(rows.number("seed")[row]), rows.text("failed", row), rows.text("command", row))
            for row in np.flatnonzero(~flew)[:_MOST_FAILED].tolist()
        ],
    )


def _flown(
    rows: Rows, flew: Flags, faulty: Flags, healthy: Flags, sensor_faults: Flags, healthy_hours: float
) -> Flown:
    seconds = float(np.nansum(rows.number("flight_s")[flew]))
    observed = float(np.nansum(rows.number("observed_s")[flew]))
    return Flown(
        kinds=sorted(set(rows.words("kind").tolist())),
        aircraft=sorted(set(rows.words("aircraft")[flew].tolist())),
        flights=len(rows),
        failed=int((~flew).sum()),
        faulty=int(faulty.sum()),
        healthy=int(healthy.sum()),
        sensor_fault=int(sensor_faults.sum()),
        hours=seconds / 3600.0,
        healthy_hours=healthy_hours,
        observed_fraction=observed / seconds if seconds > 0.0 else math.nan,
        processor_h=float(np.nansum(rows.number("processor_s"))) / 3600.0,
        code_versions=sorted(set(rows.words("code_version").tolist())),
        settings_versions=sorted(set(rows.words("settings_version").tolist())),
    )


def as_json(summary: Summary) -> dict[str, Any]:
    """The same figures as dicts, lists, texts, finite numbers and None; inf is written ``"inf"``."""
    found: dict[str, Any] = _plain(summary)
    return found


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else "inf" if value > 0.0 else "-inf"
    return value
