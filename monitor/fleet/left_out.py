"""Which vehicles are not watched while there is more to compute than the machine can: whole ones, in a stated order.

A service that takes in samples more slowly than they arrive shows every vehicle as it was, later and later. Instead
some vehicles are left out, said to be so, and the others are watched in time.
"""

from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence

from wingwatch.monitor.fleet.roster import VehicleKey

__all__ = ["LATE_S", "Overload"]

LATE_S = 2.0
"""Time that a message of a vehicle in time may wait."""

_CALM_S = 1.0
"""Where no message waits longer, there is room for a vehicle that was left out."""

_SOON_S = 20.0
"""Time in which messages that are late are to be in time again, where they have not waited longer: what waited for a
start or through a pause of the machine is caught up with in less time than it waited, or there is too much."""

_LOOKS = 5
"""Looks in a row at messages that are late, none before the last change, by which it is said whether there is too much
to compute: a pause of the machine is no overload, nor is what comes once in a while and passes."""

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
        self._looks: deque[tuple[float, float]] = deque(maxlen=_LOOKS)
        self._returning = _AT_ONCE
        self._changed_s = self._returned_s = self._busy_s = float("-inf")
        self._pause_s = _PAUSE_S

    def forget(self, gone: Collection[VehicleKey]) -> None:
        """These vehicles are not remembered any longer."""
        self.left_out = [key for key in self.left_out if key not in gone]

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
        too_much = self._too_much()
        if too_much is not None:
            return self._leave_out(now_s, order(), too_much)
        if worst_s > _CALM_S:
            self._busy_s = now_s
        calm_s = now_s - max(self._busy_s, self._changed_s)
        if not self.left_out:
            if calm_s > _LONGEST_PAUSE_S:
                self._pause_s, self._returning = _PAUSE_S, _AT_ONCE
        elif calm_s >= self._pause_s:
            return self._take_back(now_s, len(order()))
        return []

    def _too_much(self) -> float | None:
        """Seconds that messages wait longer, a second: the part of what comes that is too much, where all is computed
        in turn. None where they are in time, or will be soon."""
        waits_s = [wait_s for _, wait_s in self._looks]
        if len(waits_s) < _LOOKS or min(waits_s) <= LATE_S:
            return None
        growth = (waits_s[-1] - waits_s[0]) / (self._looks[-1][0] - self._looks[0][0])
        return growth if waits_s[-1] - LATE_S > -growth * max(_SOON_S, waits_s[-1]) else None

    def _leave_out(self, now_s: float, order: Sequence[VehicleKey], too_much: float) -> list[VehicleKey]:
        if now_s - self._returned_s < _FORGIVEN_S:
            self._pause_s = min(2.0 * self._pause_s, _LONGEST_PAUSE_S)
            self._returning *= 2
        self._changed_s, self._returned_s = now_s, float("-inf")
        self._looks.clear()
        share = max(0.5 * too_much, 1.0 / _AT_ONCE)
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
