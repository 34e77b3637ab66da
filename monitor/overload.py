"""Which vehicles are not watched while there is more to compute than the machine can: whole ones, in a stated order.

A service that takes in samples more slowly than they arrive shows every vehicle as it was, later and later. Instead
some vehicles are left out, said to be so, and the others are watched in time.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence

from wingwatch.monitor.roster import VehicleKey

__all__ = ["LATE_S", "Overload"]

LATE_S = 2.0
"""Time that a message of a vehicle in time may wait."""

_CALM_S = 0.5
"""Where no message waits longer, there is room for a vehicle that was left out."""

_SOON_S = 10.0
"""Time in which messages that are late are to be in time again; as they wait less and less, they will be."""

_LATE_LOOKS = 4
"""Looks in a row at which messages are late and will not soon be in time: a pause of the machine is no overload."""

_LOOKS_BETWEEN = 2
"""Looks between two times that vehicles are left out, for what the first did to show."""

_AT_ONCE = 20
"""One vehicle in so many is left out at once, but at least one, and half of what is too much; taken back is one in so
many at most."""

_PAUSE_S, _LONGEST_PAUSE_S = 10.0, 600.0
"""Time of calm before vehicles are taken back; twice as long each time that this was too early."""

_FORGIVEN_S = 600.0
"""A vehicle taken back that long ago was not what was too much."""


class Overload:
    """Decides once a second which vehicles are left out.

    Attributes:
        left_out: these, in the order in which they were.
    """

    def __init__(self) -> None:
        self.left_out: list[VehicleKey] = []
        self._looks: deque[tuple[float, float]] = deque(maxlen=_LATE_LOOKS + 1)
        self._late, self._returning = 0, _AT_ONCE
        self._too_much = 1.0
        self._changed_s = self._returned_s = self._busy_s = float("-inf")
        self._pause_s = _PAUSE_S

    def look(
        self, now_s: float, lags_s: Mapping[VehicleKey, float], order: Callable[[], Sequence[VehicleKey]]
    ) -> list[VehicleKey]:
        """What changes now: vehicles to be left out, or to be taken back; ``left_out`` says which.

        Args:
            now_s: monotonic seconds.
            lags_s: how long the oldest message of each watched vehicle has waited that sends in time.
            order: gives all that are watched, first those that are left out first.
        """
        worst_s = max(lags_s.values(), default=0.0)
        self._looks.append((now_s, worst_s))
        growth = self._growth()
        late = worst_s > LATE_S and worst_s - LATE_S > -growth * _SOON_S
        self._late = self._late + 1 if late else 0
        self._too_much = min(growth, self._too_much) if self._late > 1 else growth
        if self._late >= _LATE_LOOKS:
            return self._leave_out(now_s, order())
        if worst_s > _CALM_S:
            self._busy_s = now_s
        calm_s = now_s - max(self._busy_s, self._changed_s)
        if not self.left_out:
            if calm_s > _LONGEST_PAUSE_S:
                self._pause_s, self._returning = _PAUSE_S, _AT_ONCE
        elif calm_s >= self._pause_s:
            return self._take_back(now_s, len(order()))
        return []

    def _growth(self) -> float:
        """Seconds that messages wait longer, a second: the part of what comes that is too much, where all is computed
        in turn."""
        (first_s, before_s), (last_s, now_s) = self._looks[0], self._looks[-1]
        return (now_s - before_s) / (last_s - first_s) if last_s > first_s else 0.0

    def _leave_out(self, now_s: float, order: Sequence[VehicleKey]) -> list[VehicleKey]:
        if now_s - self._returned_s < _FORGIVEN_S:
            self._pause_s = min(2.0 * self._pause_s, _LONGEST_PAUSE_S)
            self._returning *= 2
        self._changed_s, self._returned_s = now_s, float("-inf")
        share = max(0.5 * self._too_much, 1.0 / _AT_ONCE)
        self._late, self._too_much = _LATE_LOOKS - _LOOKS_BETWEEN, 1.0
        gone = list(order[: max(1, int(share * len(order)))])
        self.left_out += gone
        return gone

    def _take_back(self, now_s: float, watched: int) -> list[VehicleKey]:
        """The last ones that were left out; half as many each time that this was too early, else twice as many."""
        if self._returned_s > float("-inf"):
            self._returning = max(self._returning // 2, _AT_ONCE)
        self._changed_s = self._returned_s = now_s
        stay = max(len(self.left_out) - max(1, watched // self._returning), 0)
        back = self.left_out[stay:]
        del self.left_out[stay:]
        return back
