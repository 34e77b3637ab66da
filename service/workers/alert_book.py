"""The alerts of all workers' vehicles as a gateway knows them: read from the database, kept up to date by workers.

Workers say an alert once it is committed, so what they say is never older than what was read before. What is read again
takes the place of what was read; where a worker has said something since the reading began, that stands.
"""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from wingwatch.monitor import AlertGroupView, AlertState, AlertView
from wingwatch.monitor.fleet.groups import IcingGroups
from wingwatch.monitor.positions import Place

__all__ = ["AlertBook"]

_REPEATED = 100  # of the latest, and all that are not cleared, are said again at the start, as a worker does


class AlertBook:
    """Every method is thread-safe.

    Args:
        read: all alerts of the database, newest first; it may raise.
        changed: called with each version that is new here, oldest first.
        most: alerts that are kept; the oldest go.
    """

    def __init__(
        self,
        read: Callable[[], Sequence[AlertView]],
        changed: Callable[[AlertView], None],
        most: int = 10_000,
    ) -> None:
        self._read, self._changed, self._most = read, changed, most
        self._alerts: dict[str, AlertView] = {}  # newest last
        self._said: dict[str, None] = {}
        self._groups = IcingGroups()
        self._lock = threading.Lock()
        self._begun = False

    def look(self) -> None:
        """Read the database; whatever it raises."""
        with self._lock:
            self._said.clear()
        found = self._read()
        with self._lock:
            before, begun = self._alerts, self._begun
            read = {alert.id: self._newer(before.get(alert.id), alert) for alert in reversed(found)}
            said = {name: before[name] for name in self._said if name in before}
            self._alerts, self._begun = {**read, **said}, True
            self._forget()
            if begun:
                news = [one for name, one in self._alerts.items() if _differs(before.get(name), one)]
            else:
                news = [a for k, a in enumerate(found) if k < _REPEATED or a.state is not AlertState.CLEARED][
                    ::-1
                ]
        for alert in news:
            self._changed(alert)

    def _newer(self, before: AlertView | None, read: AlertView) -> AlertView:
        """What was read, with the diagnosis that its worker has said and the database does not keep."""
        return read if before is None else replace(read, diagnosis_id=before.diagnosis_id)

    def take(self, alerts: Sequence[AlertView]) -> None:
        """Versions that a worker says, oldest first."""
        news = []
        with self._lock:
            for alert in alerts:
                if _differs(self._alerts.get(alert.id), alert):
                    news.append(alert)
                self._alerts[alert.id] = alert
                self._said[alert.id] = None
            self._forget()
        for alert in news:
            self._changed(alert)

    def take_places(self, places: Mapping[str, tuple[int, Place]]) -> None:
        """Where and when alerts of icing were raised."""
        with self._lock:
            self._groups.take(places)

    def get(self, alert_id: str) -> AlertView | None:
        """One alert."""
        with self._lock:
            return self._alerts.get(alert_id)

    def newest_first(self) -> list[AlertView]:
        """All of them."""
        with self._lock:
            return list(reversed(self._alerts.values()))

    def groups(self) -> Sequence[AlertGroupView]:
        """Alerts in force that are one event, largest first."""
        with self._lock:
            return self._groups.groups(list(reversed(self._alerts.values())))

    def _forget(self) -> None:
        while len(self._alerts) > self._most:
            self._alerts.pop(next(iter(self._alerts)))


def _differs(before: AlertView | None, now: AlertView) -> bool:
    """Whether a version says something new; what came over the link has lists where others have tuples."""
    if before is None:
        return True
    names = ("state", "level", "cause", "channel", "text", "size", "probability", "cleared_s", "diagnosis_id")
    return len(before.note) != len(now.note) or any(
        getattr(before, name) != getattr(now, name) for name in names
    )
