"""Alerts of a live fleet: stored before they are announced, in force across restarts, acted on by persons."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from wingwatch.monitor.detection.alert_finding import AlertFinding
from wingwatch.monitor.fleet.context import FleetContext, Outgoing
from wingwatch.monitor.fleet.groups import IcingGroups
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.resuming import agreed
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.ports import ActionPlan, ActionRequest, Store
from wingwatch.monitor.positions import Place
from wingwatch.monitor.views import AlertGroupView, AlertState, AlertView

__all__ = ["FleetAlerts"]

_REPEATED = 100  # of the latest alerts, and all that are not cleared, are announced again at the start


class FleetAlerts:
    """What becomes of alerts between monitors, store and operators.

    With the fleet's lock held, but for ``carry_out``, ``repeat`` and what the store calls.

    Args:
        context: of the fleet.
        save_now: has the state of a vehicle saved at once.
    """

    def __init__(self, context: FleetContext, save_now: Callable[[VehicleKey, KnownVehicle], None]) -> None:
        self._context, self._save_now = context, save_now
        self._read, self._groups = False, IcingGroups()
        self._earlier: dict[VehicleKey, list[AlertView]] = {}

    # -- across restarts -----------------------------------------------------------------------

    def read_earlier(self, patience_s: float) -> Sequence[AlertView]:
        """Read the alerts of earlier runs, once; a read that failed is no empty one, and is tried again.

        Returns those to be announced again, oldest first: an earlier run may have ended before it announced them.
        """
        store, ledger = self._context.store, self._context.ledger
        if store is None or self._read:
            return ()
        found: Sequence[AlertView] | None = self._context.guarded(lambda: store.alerts(patience_s))
        if found is None:
            return ()
        ledger.add_earlier(found)
        self._read = True
        for alert in reversed(found):
            if alert.state is not AlertState.CLEARED:
                self._earlier.setdefault((alert.fleet, alert.vehicle), []).append(alert)
        for key, known in self._context.vehicles.items():
            if known.monitor is not None:
                self.reinstate_earlier(key, known)
        again = [a for k, a in enumerate(found) if k < _REPEATED or a.state is not AlertState.CLEARED]
        return again[::-1]

    def repeat(self, alerts: Sequence[AlertView]) -> None:
        """Announce alerts again."""
        for alert in alerts:
            self._context.tell((alert.fleet, alert.vehicle), [_of_alert(alert)])

    def reinstate_earlier(self, key: VehicleKey, known: KnownVehicle) -> list[Outgoing]:
        """Alerts that were in force before the restart are so again in the vehicle's monitor; what is announced."""
        monitor, earlier = known.monitor, self._earlier.pop(key, [])
        if monitor is None:
            return []
        ledger = self._context.ledger
        newest = [ledger.newest(alert.id) for alert in earlier]
        in_force = [alert for alert in newest if alert is not None and alert.state is not AlertState.CLEARED]
        stored = {alert.id: ledger.newest(alert.id) for alert in monitor.active_alerts}
        news: list[Outgoing] = []
        for missing in agreed(monitor, stored, in_force):
            ledger.drop(missing.id)  # what the checkpoint has is newer
            kept, announced = self.keep(missing)
            monitor.take_over(kept)
            news += announced
        return news

    def take(self, key: VehicleKey, alerts: Sequence[AlertView]) -> None:
        """A vehicle's alerts as the database has them, newest first: those in force are its monitor's from now on."""
        self._context.ledger.take(alerts)
        in_force = [alert for alert in reversed(alerts) if alert.state is not AlertState.CLEARED]
        self._earlier.pop(key, None)
        if in_force:
            self._earlier[key] = in_force

    # -- from the monitors ---------------------------------------------------------------------

    def keep(self, alert: AlertView) -> tuple[AlertView, list[Outgoing]]:
        """Hand a new version by a monitor to the store, which says when it may be announced.

        Returns:
            the version that counts, with what people have done to the alert: the monitor is to take it over; and what
            may be announced at once.
        """
        return self._keep(self._context.ledger.merge(alert))

    def diagnosed(self, alert_id: str, finding: AlertFinding) -> list[Outgoing] | None:
        """A diagnosis says something about an alert; returns what may be announced now, None for an unknown alert."""
        changed = self._context.ledger.diagnosed(alert_id, finding)
        if changed is None:
            return None
        kept, news = self._keep(changed)
        self._tell_monitor(kept)
        return news

    def _keep(self, kept: AlertView) -> tuple[AlertView, list[Outgoing]]:
        self._note_place(kept)
        if self._context.store is None:
            self._context.ledger.note_taken_over(kept.id)
            self._show(kept)
            return kept, [_of_alert(kept)]
        self._hand_over()
        return kept, []

    def groups(self) -> Sequence[AlertGroupView]:
        """Alerts in force that are one event, largest first."""
        return self._groups.groups(self._context.ledger.all_shown())

    def places(self) -> Mapping[str, tuple[int, Place]]:
        """Where and when alerts of icing were raised (``IcingGroups.places``)."""
        return self._groups.places

    def _note_place(self, alert: AlertView) -> None:
        """Where the vehicle is, and when by the wall its alert was raised: vehicles' own clocks differ."""
        known = self._context.vehicles.get((alert.fleet, alert.vehicle))
        monitor = None if known is None else known.monitor
        now_s = None if monitor is None else monitor.last_sample_time_s
        if monitor is not None and now_s is not None:
            at_s = self._context.wall_clock() - max(0.0, now_s - alert.raised_s)
            self._groups.note(alert, monitor.position, at_s)

    def look_again(self) -> None:
        """Alerts whose time on the shelf is over are active again; what the store did not take is handed over."""
        for alert in self._context.ledger.come_back(self._context.wall_clock()):
            self._tell_monitor(alert)
        self._hand_over()

    def _hand_over(self) -> None:
        """Hand over what the store has not taken over yet."""
        store, ledger = self._context.store, self._context.ledger
        if store is None:
            return
        for alert in ledger.unsaved:
            if self._context.guarded(partial(_saved, store, alert, self._kept)):
                ledger.note_taken_over(alert.id)

    def _kept(self, alert: AlertView) -> None:
        """In the store's thread: this version is committed, so it may be announced."""
        with self._context.lock:
            self._show(alert)
        self.repeat([alert])

    def _show(self, alert: AlertView) -> None:
        self._context.ledger.commit(alert)
        self._context.event(
            "alert",
            {"id": alert.id, "fleet": alert.fleet, "vehicle": alert.vehicle, "state": str(alert.state),
             "kind": alert.kind, "cause": alert.cause, "level": alert.level, "text": alert.text},
        )  # fmt: skip

    def _tell_monitor(self, alert: AlertView) -> None:
        """Somebody else than the vehicle's monitor has changed its alert, which takes that over."""
        known = self._context.vehicles.get((alert.fleet, alert.vehicle))
        if known is not None and known.monitor is not None:
            known.monitor.take_over(alert)

    # -- by persons ----------------------------------------------------------------------------

    def carry_out(self, request: ActionRequest) -> AlertView | None:
        """Carry out a person's action; returns once the store has committed it, None for an unknown alert.

        Raises:
            ValueError: it makes no sense; ``KeyReusedError`` where its key belongs to another one.
            DatabaseError: it has not been committed in time, and has not happened.
        """
        store, ledger = self._context.store, self._context.ledger
        with self._context.lock:
            shown = ledger.shown(request.alert_id)
        if shown is None:
            return None
        change, taken = partial(self._changed, request), partial(self._acted, request)
        if store is None:
            taken(change())
        else:
            store.carry_out(ActionPlan(request, change, taken, partial(self._newest, shown), self._rewritten))
        with self._context.lock:
            return ledger.shown(request.alert_id) or shown

    def _changed(self, request: ActionRequest) -> AlertView:
        with self._context.lock:
            return self._context.ledger.changed(request, self._last_sample_time_s)

    def _last_sample_time_s(self, alert: AlertView) -> float | None:
        known = self._context.vehicles.get((alert.fleet, alert.vehicle))
        return None if known is None or known.monitor is None else known.monitor.last_sample_time_s

    def _acted(self, request: ActionRequest, changed: AlertView) -> None:
        """The action is committed: it counts from now on, and is announced."""
        ledger, key = self._context.ledger, (changed.fleet, changed.vehicle)
        with self._context.lock:
            merged = ledger.acted(changed)
            self._show(changed)
            self._tell_monitor(merged)
            known = self._context.vehicles.get(key)
            if known is not None and known.monitor is not None:
                self._save_now(key, known)
            if merged != changed and self._context.store is not None:  # the monitor has gone on meanwhile
                ledger.note_unsaved(merged.id)
                self._hand_over()
        self.repeat([changed])

    def _newest(self, shown: AlertView) -> AlertView:
        with self._context.lock:
            return self._context.ledger.newest(shown.id) or shown

    def _rewritten(self, newest: AlertView) -> None:
        """An action was undone by writing the newest version, which may be newer than the one that was announced."""
        with self._context.lock:
            announced = self._context.ledger.shown(newest.id) == newest
        if not announced:
            self._kept(newest)


def _of_alert(alert: AlertView) -> Outgoing:
    return "alerts", lambda: alert


def _saved(store: Store, alert: AlertView, kept: Callable[[AlertView], None]) -> bool:
    store.save_alert(alert, kept)
    return True
