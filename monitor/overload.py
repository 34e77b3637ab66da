"""Which vehicles are not watched while there is more to compute than the machine can: whole ones, in a stated order.

A service that takes in samples more slowly than they arrive shows every vehicle as it was, later and later. Instead
some vehicles are left out, said to be so, and the others are watched in time.
"""

from collections.abc import Callable, Mapping, Sequence

from wingwatch.monitor.roster import VehicleKey

__all__ = ["LATE_S", "Overload"]

LATE_S = 2.0
"""Time that a message of a vehicle in time may wait."""

_CALM_S = 0.5
"""Where no message waits longer, there is room for a vehicle that was left out."""

_LATE_LOOKS = 4
"""Looks in a row at which messages are late and not about to be less so: a pause of the machine is no overload."""

_LOOKS_BETWEEN = 2
"""Looks between two times that vehicles are left out, for what the first did to show."""

_AT_ONCE = 20
"""One vehicle in so many is left out at once, but at least one."""

_PAUSE_S, _LONGEST_PAUSE_S = 10.0, 600.0
"""Time of calm before a vehicle is taken back; twice as long each time that this was too early."""

_FORGIVEN_S = 600.0
"""A vehicle taken back that long ago was not what was too much."""


class Overload:
    """Decides once a second which vehicles are left out.

    Attributes:
        left_out: these, in the order in which they were.
    """

    def __init__(self) -> None:
        self.left_out: list[VehicleKey] = []
        self._worst_s, self._late = 0.0, 0
        self._changed_s = self._returned_s = self._busy_s = float("-inf")
        self._pause_s = _PAUSE_S

    def look(
        self, now_s: float, lags_s: Mapping[VehicleKey, float], order: Callable[[], Sequence[VehicleKey]]
    ) -> list[VehicleKey]:
        """What changes now: vehicles to be left out, or one to be taken back; ``left_out`` says which.

        Args:
            now_s: monotonic seconds.
            lags_s: how long the oldest message of each watched vehicle has waited that sends in time.
            order: gives all that are watched, first those that are left out first.
        """
        worst_s, before_s = max(lags_s.values(), default=0.0), self._worst_s
        self._worst_s = worst_s
        self._late = self._late + 1 if worst_s > LATE_S and worst_s > before_s - _CALM_S else 0
        if self._late >= _LATE_LOOKS:
            return self._leave_out(now_s, order())
        if worst_s > _CALM_S:
            self._busy_s = now_s
        calm_s = now_s - max(self._busy_s, self._changed_s)
        if not self.left_out:
            self._pause_s = _PAUSE_S if calm_s > _LONGEST_PAUSE_S else self._pause_s
        elif calm_s >= self._pause_s:
            self._changed_s = self._returned_s = now_s
            return [self.left_out.pop()]
        return []

    def _leave_out(self, now_s: float, order: Sequence[VehicleKey]) -> list[VehicleKey]:
        if now_s - self._returned_s < _FORGIVEN_S:
            self._pause_s = min(2.0 * self._pause_s, _LONGEST_PAUSE_S)
        self._changed_s, self._late = now_s, _LATE_LOOKS - _LOOKS_BETWEEN
        gone = list(order[: max(1, len(order) // _AT_ONCE)])
        self.left_out += gone
        return gone
