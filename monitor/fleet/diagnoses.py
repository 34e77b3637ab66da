"""What a diagnosis needs of a live fleet, and what it brings: the last minutes of a vehicle, an alert's update."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.monitor.fleet.context import FleetContext
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.member.sample_ring import SampleRing
from wingwatch.monitor.vehicle.vehicle_monitor import surface_kinds
from wingwatch.monitor.views import AlertState, AlertView
from wingwatch.telemetry import SampleBlock

__all__ = ["AlertFlight", "FleetRings", "alert_flight"]

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


class FleetRings:
    """Keeps the latest samples of every vehicle that is watched, and looks now and then whether they can be.

    Args:
        names: channels that are kept; without any nothing is.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)

    def add(self, known: KnownVehicle, block: SampleBlock) -> None:
        """Samples that its monitor has taken in."""
        if not self._names:
            return
        if known.ring is None:
            present = set(block.present)
            known.ring = SampleRing([name for name in self._names if name in present])
        known.ring.add(block)

    def look(self, known: KnownVehicle) -> None:
        """Check the channels of a vehicle against one another where it is time for that."""
        now_s = None if known.monitor is None else known.monitor.last_sample_time_s
        if known.ring is None or known.loading is None or now_s is None:
            return
        if known.contradictions.due(now_s):
            known.contradictions.look(known.ring, known.loading.aircraft, surface_kinds(known.given))


def alert_flight(context: FleetContext, alert_id: str) -> AlertFlight | None:
    """The last minutes of the vehicle of an alert; None where the alert is not in force or nothing is kept.

    With the fleet's lock held.
    """
    alert = context.ledger.own(alert_id)
    if alert is None or alert.state is AlertState.CLEARED:
        return None
    known = context.vehicles.get((alert.fleet, alert.vehicle))
    if known is None or known.monitor is None or known.ring is None or known.loading is None:
        return None
    onset_s = known.monitor.onset_s(alert_id)
    if onset_s is None or not math.isfinite(onset_s):
        onset_s = alert.raised_s - _CONTRADICTION_S
    time_s, values = known.ring.latest()
    return AlertFlight(
        alert, onset_s, known.loading.aircraft, surface_kinds(known.given), known.ring.names, time_s, values
    )
