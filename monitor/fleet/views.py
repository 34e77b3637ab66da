"""A live fleet as operators see it: views of its vehicles, and the fleet in numbers."""

from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

from wingwatch.monitor.fleet.context import FleetContext, Outgoing
from wingwatch.monitor.fleet.member import shown
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.proposals import FleetProposals
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.vehicle.vehicle_monitor import VehicleMonitor, note_worst
from wingwatch.monitor.views import FleetFigures, VehicleState, VehicleView

__all__ = ["FleetViews", "worst_first"]

_SHOWN_AT_ONCE = 32  # vehicles, between which samples are taken in
_COUNTED_AT_ONCE = 500  # vehicles, likewise: 2 ms

_STATE_ORDER = (
    VehicleState.DEGRADED,
    VehicleState.STALE,
    VehicleState.UNKNOWN,
    VehicleState.NOT_OBSERVABLE,
    VehicleState.HEALTHY,
)
"""Worst first."""


def worst_first(views: Iterable[VehicleView]) -> list[VehicleView]:
    """Vehicles by state, the worst first, then by name."""
    return sorted(views, key=lambda v: (_STATE_ORDER.index(v.state), v.fleet, v.vehicle))


class FleetViews:
    """Makes views, a few vehicles at a time; what takes long is worked out without the fleet's lock.

    Args:
        context: of the fleet; its lock need not be held.
        proposals: of inputs.
    """

    def __init__(self, context: FleetContext, proposals: FleetProposals) -> None:
        self._context, self._proposals = context, proposals

    def all(self) -> list[VehicleView]:
        """All known vehicles, worst state first."""
        with self._context.lock:
            everyone = list(self._context.vehicles.items())
        views: list[VehicleView] = []
        for start in range(0, len(everyone), _SHOWN_AT_ONCE):
            views += self._together(everyone[start : start + _SHOWN_AT_ONCE])
        return worst_first(views)

    def brief(self) -> list[VehicleView]:
        """All known vehicles without what is worked out for a view: state, reason, alerts, counts, age of samples."""
        with self._context.lock:
            everyone = list(self._context.vehicles.items())
        views: list[VehicleView] = []
        for start in range(0, len(everyone), _COUNTED_AT_ONCE):
            with self._context.lock:
                views += [self._brief(*one) for one in everyone[start : start + _COUNTED_AT_ONCE]]
        return views

    def _brief(self, key: VehicleKey, known: KnownVehicle) -> VehicleView:
        context = self._context
        now_s = context.clock()
        state, reason = shown.standing(known, now_s, context.settings.stale_s)
        monitor, received_s = known.monitor, known.messages.received_s
        view = shown.bare_view(known, key, state, reason or ("" if monitor is None else monitor.reason))
        ids = () if monitor is None else [alert.id for alert in monitor.active_alerts]
        return replace(
            view,
            active_alerts=tuple(name for name in ids if name in context.ledger.ids),
            last_sample_time_s=None if monitor is None else monitor.last_sample_time_s,
            sample_age_s=None if received_s is None else max(now_s - received_s, 0.0),
        )

    def one(self, key: VehicleKey, known: KnownVehicle) -> VehicleView:
        """One vehicle, with what its flight could have shown: most of the work of a view, and of its bytes."""
        return self._together([(key, known)], whole=True)[0]

    def status(self, key: VehicleKey, known: KnownVehicle) -> Outgoing:
        """The news of a vehicle's status."""
        return "status", partial(self.one, key, known)

    def news_of_state(self, key: VehicleKey, known: KnownVehicle, now_s: float) -> list[Outgoing]:
        """Its status, where its state is another one than was published last; with the fleet's lock held."""
        state, _ = shown.standing(known, now_s, self._context.settings.stale_s)
        if not known.show(state):
            return []
        self._context.event("status", {"fleet": key[0], "vehicle": key[1], "state": str(state)})
        return [self.status(key, known)]

    def _together(
        self, some: Sequence[tuple[VehicleKey, KnownVehicle]], whole: bool = False
    ) -> list[VehicleView]:
        monitors = [known.monitor for _, known in some if known.monitor is not None]
        self._prepare(monitors)
        with self._context.lock:
            return [self._shown(key, known, whole) for key, known in some]

    def _prepare(self, monitors: Sequence[VehicleMonitor]) -> None:
        """Work out what takes milliseconds a vehicle, and what the monitors remember then.

        What fails is tried again where the vehicle is shown, and a fault is noted there.
        """
        measured = []
        try:
            note_worst(monitors)
        except Exception:
            for monitor in monitors:
                with suppress(Exception):
                    monitor.worst()
        for monitor in monitors:
            with suppress(Exception):
                if (pending := monitor.pending_air) is not None:
                    measured.append((pending, pending.measure()))
        if measured:
            with self._context.lock:
                for pending, air in measured:
                    pending.keep(air)

    def _shown(self, key: VehicleKey, known: KnownVehicle, whole: bool) -> VehicleView:
        context = self._context
        try:
            view = shown.view(known, key, context.clock(), context.settings.stale_s, context.ledger.ids)
            view = replace(view, proposed_input=self._proposals.current(key, known))
            return replace(view, could_see=known.monitor.could_see()) if whole and known.monitor else view
        except Exception as error:  # one vehicle that cannot be shown must not hide the others
            context.note_fault(*key, known, error)
            return shown.bare_view(known, key, VehicleState.UNKNOWN, shown.fault_text(known))

    def figures(self, solutions: int, left_out: int) -> FleetFigures:
        """The fleet in numbers.

        Args:
            solutions: how many there have been.
            left_out: how many vehicles are not watched, because the machine is overloaded.
        """
        context, states = self._context, Counter[VehicleState]()
        with context.lock:
            everyone, counts = [known for _, known in context.vehicles.items()], dict(context.vehicles.gone)
            alerts = context.ledger.all_shown()
            waiting = self._tally(everyone[:_COUNTED_AT_ONCE], states, counts)
        for start in range(_COUNTED_AT_ONCE, len(everyone), _COUNTED_AT_ONCE):
            with context.lock:
                waiting += self._tally(everyone[start : start + _COUNTED_AT_ONCE], states, counts)
        of_alerts = Counter((alert.state, alert.level) for alert in alerts)
        return FleetFigures(states, of_alerts, counts, solutions, waiting, left_out)

    def _tally(
        self, some: Sequence[KnownVehicle], states: Counter[VehicleState], counts: dict[str, int]
    ) -> int:
        """Add the states and counts of some vehicles; returns how many of their messages wait."""
        now_s = self._context.clock()
        for known in some:
            states[shown.standing(known, now_s, self._context.settings.stale_s)[0]] += 1
            known.add_counts(counts)
        return sum(known.waiting for known in some)
