"""What a diagnosis needs of a live fleet, and what it brings: the last minutes of a vehicle, an alert's update."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.monitor.fleet.context import FleetContext
from wingwatch.monitor.vehicle.vehicle_monitor import surface_kinds
from wingwatch.monitor.views import AlertState, AlertView

__all__ = ["AlertFlight", "alert_flight"]

_CONTRADICTION_S = 3.0
"""An alert by redundancy is raised so long after its onset at most (``redundancy.book``)."""


@dataclass(frozen=True, slots=True)
class AlertFlight:
    """The last minutes of a vehicle with an alert.

    Attributes:
        alert: as its monitor has it.
        onset_s: about when the change began, by the vehicle's clock.
        aircraft: as it is loaded; kinds: of its surface columns.
        names: channels; time_s: (samples,); values: (samples, channels).
    """

    alert: AlertView
    onset_s: float
    aircraft: Aircraft
    kinds: Mapping[str, str]
    names: tuple[str, ...]
    time_s: NDArray[np.float64]
    values: NDArray[np.float32]


def alert_flight(context: FleetContext, alert_id: str) -> AlertFlight | None:
    """The last minutes of the vehicle of an alert; None where the alert is not in force or nothing is kept.

    With the fleet's lock held.
    """
    alert = context.ledger.own(alert_id)
    if alert is None or alert.state is AlertState.CLEARED:
        return None
    known = context.vehicles.get((alert.fleet, alert.vehicle))
    watch = None if known is None else known.watch
    if watch is None or watch.ring is None:
        return None
    onset_s = watch.monitor.onset_s(alert_id)
    if onset_s is None or not math.isfinite(onset_s):
        onset_s = alert.raised_s - _CONTRADICTION_S
    time_s, values = watch.ring.latest()
    aircraft, kinds = watch.basis.loading.aircraft, surface_kinds(watch.given)
    return AlertFlight(alert, onset_s, aircraft, kinds, watch.ring.names, time_s, values)
