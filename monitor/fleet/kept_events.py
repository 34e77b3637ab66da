"""Events that are kept for listeners who come back: what happened, and of what is replaced only the newest."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

from wingwatch.monitor.views import Event

__all__ = ["KeptEvents"]

_REPLACED = frozenset({"derivatives"})
"""Kinds that say that a vehicle has something newer: once there is a later one, an earlier one says nothing."""


class KeptEvents:
    """Numbered from 1, the oldest forgotten where more than ``most`` are kept. Its owner's lock guards it.

    Args:
        most: bound; a kind that is replaced takes one place a vehicle.

    Attributes:
        newest: number of the last event; 0 before the first.
        forgotten: how many were forgotten for want of room; those that were replaced do not count.
        complete_after: who has seen this number or a later one has missed nothing but what was replaced.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: dict[Hashable, Event] = {}  # in the order of their numbers
        self.newest = self.forgotten = self.complete_after = 0

    def add(self, kind: str, data: Mapping[str, Any]) -> int:
        """Keep an event; its number."""
        self.newest += 1
        key: Hashable = self.newest
        if kind in _REPLACED:
            key = kind, data.get("fleet"), data.get("vehicle")
            self._kept.pop(key, None)
        self._kept[key] = Event(self.newest, kind, data)
        if len(self._kept) > self._most:
            oldest = self._kept.pop(next(iter(self._kept)))
            self.forgotten += 1
            self.complete_after = oldest.id
        return self.newest

    def after(self, number: int) -> Sequence[Event]:
        """Events with a number above ``number``, oldest first; the work is that of those alone."""
        found = []
        for event in reversed(self._kept.values()):
            if event.id <= number:
                break
            found.append(event)
        return found[::-1]
