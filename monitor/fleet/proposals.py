"""Inputs that are proposed to the vehicles of a fleet: seldom, in calm flight, and taken back when that ends."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from wingwatch.aircraft import FlightCondition
from wingwatch.monitor.fleet.context import FleetContext, Outgoing
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.member.shown import standing
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.vehicle.proposing import proposed_input
from wingwatch.monitor.vehicle.vehicle_monitor import VehicleMonitor
from wingwatch.monitor.views import ProposedInputView, VehicleState

__all__ = ["FleetProposals"]

LEAST_FLIGHT_S = 60.0
"""Of flight: before, what it shows by itself is not known yet."""
LOOK_S = 30.0
"""Wall-clock time between two looks at a vehicle; what it could have shown is worked out as often."""
_SHAPES = ("doublet", "3211")
"""Of a surface's first proposal, and of those that follow where it did not help: more of it is in the mode's band."""


@dataclass(frozen=True, slots=True)
class _Proposed:
    """The latest proposal to one vehicle.

    Attributes:
        latest: as it was made; at_s: by the wall clock.
        unseen: whether the surface had not shown itself by then.
        withdrawn: whether it was taken back.
    """

    latest: ProposedInputView
    at_s: float
    unseen: bool
    withdrawn: bool = False


class FleetProposals:
    """Decides when which vehicle is proposed what; to be used with the fleet's lock held.

    Args:
        context: of the fleet; nothing is proposed where its settings do not ask for it (``excite``).
        new_id: makes ids.
    """

    def __init__(self, context: FleetContext, new_id: Callable[[], str]) -> None:
        self._context, self._new_id = context, new_id
        self._proposed: dict[VehicleKey, _Proposed] = {}
        self._looked_s: dict[VehicleKey, float] = {}

    def look(self) -> list[tuple[VehicleKey, Outgoing]]:
        """About once a second: one vehicle is looked at, the one that was so longest ago, and proposals that are not to
        be flown any more are taken back."""
        if not self._context.settings.excite:
            return []
        everyone = dict(self._context.vehicles.items())
        self._proposed = {key: one for key, one in self._proposed.items() if key in everyone}
        self._looked_s = {key: at_s for key, at_s in self._looked_s.items() if key in everyone}
        news = [
            (key, _outgoing(back)) for key in self._proposed if (back := self._taken_back(key, everyone[key]))
        ]
        due = [key for key, known in everyone.items() if self._due(key, known)]
        if due:
            key = min(due, key=lambda one: self._looked_s.get(one, float("-inf")))
            self._looked_s[key] = self._context.clock()
            if (made := self._made(key, everyone[key])) is not None:
                news.append((key, _outgoing(made)))
        return news

    def current(self, key: VehicleKey, known: KnownVehicle) -> ProposedInputView | None:
        """What may be flown now; None where nothing may."""
        one, monitor = self._proposed.get(key), known.monitor
        now_s = None if monitor is None else monitor.last_sample_time_s
        if one is None or monitor is None or one.withdrawn or now_s is None:
            return None
        over = not one.latest.proposed_s <= now_s <= one.latest.valid_until_s
        done = one.unseen and one.latest.surface not in monitor.unseen_surfaces
        return None if over or done else one.latest

    def _due(self, key: VehicleKey, known: KnownVehicle) -> bool:
        """Whether the vehicle may be proposed something, as far as that costs nothing to say."""
        now_s, one, monitor = self._context.clock(), self._proposed.get(key), known.monitor
        if one is not None and now_s - one.at_s < self._context.settings.excite_interval_s:
            return False
        if monitor is None or now_s - self._looked_s.get(key, float("-inf")) < LOOK_S:
            return False
        return monitor.flown_s >= LEAST_FLIGHT_S

    def _made(self, key: VehicleKey, known: KnownVehicle) -> ProposedInputView | None:
        monitor = known.monitor
        if monitor is None or (condition := monitor.condition) is None or not self._may_be_flown(known):
            return None
        earlier = self._proposed.get(key)
        found = _first_try(monitor, condition, earlier, self._new_id)
        if found is not None:
            unseen = found.surface in monitor.unseen_surfaces
            self._proposed[key] = _Proposed(found, self._context.clock(), unseen)
        return found

    def _taken_back(self, key: VehicleKey, known: KnownVehicle) -> ProposedInputView | None:
        """The proposal, valid no longer, where it has just ceased to be sensible."""
        current = self.current(key, known)
        if current is None or self._may_be_flown(known):
            return None
        self._proposed[key] = replace(self._proposed[key], withdrawn=True)
        now_s = None if known.monitor is None else known.monitor.last_sample_time_s
        return replace(current, valid_until_s=current.proposed_s if now_s is None else now_s)

    def _may_be_flown(self, known: KnownVehicle) -> bool:
        """It sends, flies in calm air, and no alert is in force."""
        state, _ = standing(known, self._context.clock(), self._context.settings.stale_s)
        monitor = known.monitor
        if (
            monitor is None
            or monitor.alarmed
            or state not in (VehicleState.HEALTHY, VehicleState.NOT_OBSERVABLE)
        ):
            return False
        return not monitor.waits and not monitor.in_rough_air


def _first_try(
    monitor: VehicleMonitor,
    condition: FlightCondition,
    earlier: _Proposed | None,
    new_id: Callable[[], str],
) -> ProposedInputView | None:
    """A doublet; where its surface was proposed one before, what excites more."""
    found = proposed_input(monitor, condition, _SHAPES[0], new_id)
    if found is None or earlier is None or earlier.latest.surface != found.surface:
        return found
    return proposed_input(monitor, condition, _SHAPES[1], new_id) or found


def _outgoing(proposal: ProposedInputView) -> Outgoing:
    return "proposals", partial(_same, proposal)


def _same(proposal: ProposedInputView) -> ProposedInputView:
    return proposal
