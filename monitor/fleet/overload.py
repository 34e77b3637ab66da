"""More to compute than the machine can: whole vehicles are left out, and taken back, in a stated order."""

import logging
from collections.abc import Mapping, Sequence

from wingwatch.monitor.fleet.context import FleetContext
from wingwatch.monitor.fleet.left_out import Overload
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.views import VehicleState

__all__ = ["FleetOverload"]

_LOG = logging.getLogger(__name__)
_WATCHED_FOR_NOTHING = (VehicleState.UNKNOWN, VehicleState.NOT_OBSERVABLE)


class FleetOverload:
    """Leaves vehicles of a fleet out. To be used with the fleet's lock held.

    First go those that send faster than they fly (replays), then those of which nothing can be said, then healthy ones,
    then those of which a change is suspected, at last those with an alert; of equals the one that is furthest behind.
    """

    def __init__(self, context: FleetContext) -> None:
        self._context = context
        self._overload = Overload()

    @property
    def left_out(self) -> int:
        """How many vehicles are not watched."""
        return len(self._overload.left_out)

    def look(self, lags_s: Mapping[VehicleKey, float]) -> None:
        """To be called once a second.

        Args:
            lags_s: how long the oldest message of each vehicle has waited.
        """
        overload, vehicles = self._overload, self._context.vehicles
        overload.forget({key for key in overload.left_out if vehicles.get(key) is None})
        watched = {key: known for key, known in vehicles.items() if known.watch and not known.left_out}
        in_time = {
            key: lag_s
            for key, lag_s in lags_s.items()
            if key in watched and not watched[key].messages.pace.ahead
        }

        def order() -> Sequence[VehicleKey]:
            return sorted(watched, key=lambda key: (_rank(watched[key]), -lags_s.get(key, 0.0), key))

        changed = overload.look(self._context.clock(), in_time, order)
        for key in changed:
            known = vehicles.get(key)
            if known is not None:
                self._set(key, known, key in overload.left_out)
        if changed:
            self._say(changed[0] in overload.left_out, len(changed), len(watched))

    def _set(self, key: VehicleKey, known: KnownVehicle, left_out: bool) -> None:
        if left_out:
            known.leave_out()
        else:
            known.take_back()
        what = "not watched" if left_out else "watched again"
        text = f"degraded service: {key[0]}/{key[1]} is {what}"
        data = {"what": "capacity", "fleet": key[0], "vehicle": key[1], "text": text}
        self._context.event("problem", data)
        _LOG.warning("%s", text, extra={"vehicle": f"{key[0]}/{key[1]}"})

    def _say(self, left_out: bool, changed: int, watched: int) -> None:
        if left_out:
            _LOG.warning(
                "degraded service: messages wait too long, so %d of %d watched vehicles are left out; %d are in all",
                changed, watched, self.left_out,
            )  # fmt: skip


def _rank(known: KnownVehicle) -> int:
    """Who is left out first: the lowest."""
    if known.alarmed:
        return 4
    if known.suspected:
        return 3
    if known.messages.pace.ahead:
        return 0
    monitor = known.monitor
    if monitor is None or (monitor.state in _WATCHED_FOR_NOTHING and not monitor.says_something):
        return 1
    return 2
