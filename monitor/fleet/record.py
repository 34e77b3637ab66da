"""The record of each vehicle of a live fleet for pictures, as it is shown.

To be used with the fleet's lock held, but for ``expected_of``.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import STRUCTURES
from wingwatch.monitor.estimation.chain import condition_of
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.record_views import FlightRecordView

__all__ = ["expected_of", "record_of"]

Array = NDArray[np.float64]


def record_of(known: KnownVehicle, now_s: float) -> FlightRecordView:
    """What is kept; ``now_s`` is on the clock of the arrivals."""
    watch, link = known.watch, known.messages.link.view(now_s)
    if watch is None:
        return FlightRecordView((), None, {}, link)
    onsets_s = dict(watch.record.onsets_s)
    for alert in watch.monitor.active_alerts:
        onset_s = watch.monitor.onset_s(alert.id)
        if onset_s is not None and np.isfinite(onset_s):
            onsets_s[alert.id] = onset_s
    return FlightRecordView(watch.record.blocks, watch.monitor.judge.config.log_threshold, onsets_s, link)


def expected_of(
    known: KnownVehicle, structure: str, aircraft: Sequence[str], conditions: Array
) -> tuple[Array, Array] | None:
    """What is expected now of one structure at conditions that were flown; None where nothing is.

    Args:
        aircraft: name and configuration of the aircraft that was flown; of another than is watched now nothing is
            expected.
        conditions: (m, 4), as estimates have them.

    Returns:
        values and standard errors, (m, k) each, NaN where nothing is expected.
    """
    monitor = known.monitor
    if monitor is None or structure not in monitor.chain.envelopes:
        return None
    if tuple(aircraft) != (monitor.aircraft.name, monitor.configuration):
        return None
    found = [condition_of((a, b, c, d), monitor.configuration) for a, b, c, d in conditions.tolist()]
    k = len(STRUCTURES[structure].derivatives)
    value, error = np.full((len(found), k), np.nan), np.full((len(found), k), np.nan)
    there = [m for m, condition in enumerate(found) if condition is not None]
    if there:
        some = [condition for condition in found if condition is not None]
        value[there], error[there] = monitor.expectations(STRUCTURES[structure], some)
    return value, error
