"""The alerts of one vehicle as one: those about its airframe, those by its relations, and those that come back.

A cause and part that has returned to normal and comes back within ``REPEAT_S`` opens the alert that it had again: an
operator sees one alert that says how often, in the place of a chain of new ones (ISA-18.2 calls that chattering). One
that a person has cleared is not opened again: what persists is raised anew.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from wingwatch.monitor.detection.alerts import AlertBook, BookState, raised_again
from wingwatch.monitor.detection.redundancy import VehicleRelations
from wingwatch.monitor.views import LEVELS, AlertState, AlertView

__all__ = ["REPEAT_S", "AlertMemory", "VehicleAlerts"]

REPEAT_S = 300.0
"""Sample time from which the same cause and part is a new alert."""
_MOST_REMEMBERED = 20


@dataclass(slots=True)
class AlertMemory:
    """What is remembered of one vehicle.

    Attributes:
        in_force: ids of alerts that were raised and not cleared.
        over: alerts that have returned to normal, newest last, as they were then.
    """

    in_force: list[str] = field(default_factory=list)
    over: list[AlertView] = field(default_factory=list)


class VehicleAlerts:
    """Alerts of one vehicle.

    Args:
        book: of its airframe; relations: with the book of their own.

    Attributes:
        memory: saved with the books' own.
    """

    def __init__(self, book: AlertBook, relations: VehicleRelations) -> None:
        self._book, self._relations = book, relations
        self.memory = AlertMemory()

    @property
    def active(self) -> list[AlertView]:
        """All in force, worst first."""
        found = [*self._relations.book.active, *([self._book.active] if self._book.active else [])]
        return sorted(found, key=lambda alert: -LEVELS.index(alert.level))

    @property
    def alarmed(self) -> bool:
        """Whether an alert is in force."""
        return self._book.active is not None or bool(self._relations.book.active)

    def onset_s(self, alert_id: str) -> float | None:
        """Stamp at which the fault of an alert in force began, as far as it is known."""
        if self._book.active is not None and self._book.active.id == alert_id:
            return self._book.onset_s
        return self._relations.onset_s(alert_id)

    def announced(self, versions: Sequence[AlertView]) -> list[AlertView]:
        """Versions as the books made them, in order, under the name of the alert that comes back with them."""
        opened: dict[str, AlertView] = {}
        return [self._announced(version, opened) for version in versions]

    def restore(self, memory: AlertMemory) -> None:
        """Go on from where another one stopped."""
        self.memory = memory

    def reinstate(self, alert: AlertView, onset_s: float) -> None:
        """An alert that was in force before a restart is so again.

        Args:
            onset_s: of a change of the airframe.
        """
        if alert.channel is not None:
            self._relations.reinstate(alert)
        else:
            self._book.restore(BookState(alert, onset_s, 0, 0))
        if alert.id not in self.memory.in_force:
            self.memory.in_force.append(alert.id)

    def take_over(self, alert: AlertView, now_s: float) -> None:
        """What was done to an alert in force counts; one that was cleared is followed no longer."""
        if alert.state is AlertState.CLEARED:
            self._forget(alert.id)
        if self._book.active is None or self._book.active.id != alert.id:
            self._relations.take_over(alert, now_s)
        elif alert.state is AlertState.CLEARED:
            self._book.dismiss()
        else:
            self._book.take_over(alert)

    def dismiss_airframe(self) -> None:
        """The alert about the airframe was cleared after the state was saved."""
        if self._book.active is not None:
            self._forget(self._book.active.id)
        self._book.dismiss()

    def _forget(self, alert_id: str) -> None:
        if alert_id in self.memory.in_force:
            self.memory.in_force.remove(alert_id)

    def _announced(self, version: AlertView, opened: dict[str, AlertView]) -> AlertView:
        """One version.

        Args:
            opened: by name that the book gave it, the alert that was opened again; versions that follow were made
                before the book knew of it.
        """
        memory = self.memory
        if version.id in opened:
            again = opened[version.id]
            state = again.state if version.state is AlertState.ACTIVE else version.state
            note = (*again.note, *version.note)
            version = replace(version, id=again.id, state=state, note=note, shelving=again.shelving)
        elif version.id not in memory.in_force and version.state is not AlertState.CLEARED:
            earlier = self._earlier(version)
            if earlier is not None:
                version, name = _opened_again(version, earlier), version.id
                opened[name] = version
                self._rename(name, version)
            memory.in_force.append(version.id)
        if version.state is AlertState.CLEARED:
            self._forget(version.id)
            memory.over = [*memory.over, version][-_MOST_REMEMBERED:]
        return version

    def _earlier(self, alert: AlertView) -> AlertView | None:
        """The alert of the same cause and part that was over a short time ago, taken out of memory."""
        memory = self.memory
        memory.over = [one for one in memory.over if 0.0 <= _since(one, alert) < REPEAT_S]
        for one in reversed(memory.over):
            if _is_same(one, alert):
                memory.over.remove(one)
                return one
        return None

    def _rename(self, name: str, alert: AlertView) -> None:
        """The book follows the alert under the name that it had."""
        self._book.rename(name, alert)
        self._relations.book.rename(name, alert)


def _is_same(over: AlertView, alert: AlertView) -> bool:
    """Whether both are of one cause and part; a part whose fault has not been named yet is the same part."""
    named = over.cause == alert.cause or (
        alert.channel is not None and "unknown" in (over.cause, alert.cause)
    )
    return named and over.channel == alert.channel


def _since(over: AlertView, alert: AlertView) -> float:
    return alert.raised_s - (over.raised_s if over.cleared_s is None else over.cleared_s)


def _opened_again(alert: AlertView, earlier: AlertView) -> AlertView:
    """It is unacknowledged, for it is news; one that was shelved stays so until its time is over or it grows."""
    state = alert.state if earlier.shelving is None else AlertState.SHELVED
    note = (*raised_again(earlier.note), *alert.note)
    return replace(alert, id=earlier.id, state=state, note=note, shelving=earlier.shelving)
