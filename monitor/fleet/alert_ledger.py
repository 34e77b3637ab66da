"""The alerts of a fleet: what anyone hears of them is what the store has committed."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

from wingwatch.monitor.detection.alert_finding import AlertFinding, with_finding
from wingwatch.monitor.detection.alerts import act, raised_again
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.ports import ActionRequest
from wingwatch.monitor.views import LEVELS, AlertState, AlertView, Shelving

__all__ = ["AlertLedger"]


class AlertLedger:
    """Of each alert the newest version, and the newest that is committed. To be used with the fleet's lock held.

    Args:
        most: alerts that are kept; where there are more, the oldest cleared one goes, without such the oldest.

    Attributes:
        forgotten: alerts that went.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._newest: dict[str, AlertView] = {}
        self._committed: dict[str, AlertView] = {}
        self._own: dict[str, AlertView] = {}
        self._findings: dict[str, AlertFinding] = {}
        self._unsaved: dict[str, None] = {}
        self.forgotten = 0

    def add_earlier(self, alerts: Sequence[AlertView]) -> None:
        """Alerts of earlier runs, newest first; what is known of one already is newer."""
        earlier = {alert.id: alert for alert in reversed(alerts)}
        self._newest = earlier | self._newest
        self._committed = earlier | self._committed

    def merge(self, alert: AlertView) -> AlertView:
        """A new version by the monitor; returns it with what people have done to the alert."""
        before, own = self._newest.get(alert.id), alert
        self._own[alert.id] = own
        if before is not None and before.state is AlertState.CLEARED and alert.repeats > before.repeats:
            alert = replace(alert, note=raised_again(before.note))  # a person may have noted more since
        elif (
            before is not None and before.state is not AlertState.ACTIVE and alert.state is AlertState.ACTIVE
        ):
            alert = replace(alert, state=before.state, note=before.note, shelving=before.shelving)
        if (finding := self._findings.get(alert.id)) is not None:
            alert = with_finding(alert, own, finding)
        return self._becomes(alert)

    def diagnosed(self, alert_id: str, finding: AlertFinding) -> AlertView | None:
        """A new version with what a diagnosis has found; None for an alert that is not kept.

        A cleared alert gets the note alone. Versions by the monitor that say no more than the one which the diagnosis
        was begun with keep what it has found.
        """
        newest = self._newest.get(alert_id)
        if newest is None:
            return None
        if newest.state is AlertState.CLEARED:
            finding = replace(finding, correction=None)
        else:
            self._findings[alert_id] = finding
        own = self._own.get(alert_id, newest)
        return self._becomes(with_finding(replace(newest, note=(*newest.note, finding.note)), own, finding))

    def own(self, alert_id: str) -> AlertView | None:
        """The newest version as the vehicle's monitor has it, with the state that persons gave it."""
        newest, own = self._newest.get(alert_id), self._own.get(alert_id)
        return newest if newest is None or own is None else replace(own, state=newest.state)

    def _becomes(self, alert: AlertView) -> AlertView:
        if alert.state is AlertState.SHELVED and _has_grown(alert):
            alert = _back(alert, "it has grown")
        self._newest[alert.id] = alert
        self._unsaved[alert.id] = None
        self._forget()
        return alert

    def drop(self, alert_id: str) -> None:
        """What is kept of an alert is older than the version that comes next."""
        self._newest.pop(alert_id, None)

    def give_up(self, key: VehicleKey) -> None:
        """A vehicle is watched elsewhere from now on: its alerts stay as they were announced, and are not written."""
        for name in [n for n, a in self._newest.items() if (a.fleet, a.vehicle) == key]:
            self._own.pop(name, None)
            self._findings.pop(name, None)
            self._unsaved.pop(name, None)
            if name in self._committed:
                self._newest[name] = self._committed[name]
            else:
                self._newest.pop(name)

    def take(self, alerts: Sequence[AlertView]) -> None:
        """Alerts as the database has them, newest first, in the place of what is known here of each."""
        for alert in reversed(alerts):
            self._newest[alert.id] = self._committed[alert.id] = alert
        self._forget()

    def commit(self, alert: AlertView) -> None:
        """This version is committed."""
        self._committed[alert.id] = alert
        self._forget()

    def changed(self, request: ActionRequest, cleared_s: Callable[[AlertView], float | None]) -> AlertView:
        """The alert as a person's action leaves it; nothing happens yet.

        Raises:
            ValueError: the action makes no sense in the alert's state.
        """
        newest = self._newest.get(request.alert_id)
        if newest is None:
            raise ValueError(f"alert {request.alert_id} is old and no longer followed")
        alert = act(newest, request.action, request.who, request.note)
        shelving = Shelving(request.until_at_s, alert.level, alert.size)
        alert = replace(alert, shelving=shelving if alert.state is AlertState.SHELVED else None)
        return replace(alert, cleared_s=cleared_s(alert)) if alert.state is AlertState.CLEARED else alert

    def acted(self, changed: AlertView) -> AlertView:
        """The action is committed and announced; returns the newest version with it."""
        newest, merged = self._newest.get(changed.id), changed
        if newest is not None:
            merged = replace(newest, note=(*newest.note, changed.note[-1]))
            if newest.state is not AlertState.CLEARED:
                merged = replace(
                    merged, state=changed.state, cleared_s=changed.cleared_s, shelving=changed.shelving
                )
        self._newest[changed.id] = merged
        self.commit(changed)
        return merged

    def come_back(self, now_at_s: float) -> list[AlertView]:
        """Alerts whose time on the shelf is over; they are active again from now on."""
        over = [
            _back(alert, "its time is over")
            for alert in self._newest.values()
            if alert.state is AlertState.SHELVED
            and alert.shelving is not None
            and alert.shelving.until_at_s <= now_at_s
        ]
        for alert in over:
            self._newest[alert.id] = alert
            self._unsaved[alert.id] = None
        return over

    @property
    def unsaved(self) -> Sequence[AlertView]:
        """Newest versions that the store has not taken over, in the order in which they came to wait."""
        return [self._newest[name] for name in self._unsaved if name in self._newest]

    def note_unsaved(self, alert_id: str) -> None:
        """The store is to take over the newest version."""
        self._unsaved[alert_id] = None

    def note_taken_over(self, alert_id: str) -> None:
        """The store has taken over the newest version, or there is no store."""
        self._unsaved.pop(alert_id, None)

    def newest(self, alert_id: str) -> AlertView | None:
        """The newest version, committed or not; None for an alert that is not kept."""
        return self._newest.get(alert_id)

    def shown(self, alert_id: str) -> AlertView | None:
        """The newest committed version; None for an alert that is not known, or not yet to be announced."""
        return self._committed.get(alert_id)

    def all_shown(self) -> list[AlertView]:
        """All committed versions, newest alert first."""
        return list(reversed(self._committed.values()))

    @property
    def ids(self) -> Collection[str]:
        """Of all that may be announced."""
        return self._committed.keys()

    def stands(self, key: VehicleKey) -> bool:
        """Whether an alert of the vehicle is not cleared."""
        return any(
            (a.fleet, a.vehicle) == key and a.state is not AlertState.CLEARED for a in self._newest.values()
        )

    def _forget(self) -> None:
        while len(self._newest) > self._most:
            cleared = (name for name, a in self._newest.items() if a.state is AlertState.CLEARED)
            gone = next(cleared, None) or next(iter(self._newest))
            self._newest.pop(gone)
            self._committed.pop(gone, None)
            self._own.pop(gone, None)
            self._findings.pop(gone, None)
            self._unsaved.pop(gone, None)
            self.forgotten += 1


def _has_grown(alert: AlertView) -> bool:
    """Whether a shelved alert is more than it was then, by level or by two standard errors of its size."""
    then = alert.shelving
    if then is None:
        return False
    higher = LEVELS.index(alert.level) > LEVELS.index(then.level)
    return higher or alert.size > then.size + 2.0 * alert.size_standard_error


def _back(alert: AlertView, why: str) -> AlertView:
    note = (*alert.note, f"wingwatch: unshelve ({why})")
    return replace(alert, state=AlertState.ACTIVE, note=note, shelving=None)
