"""A vehicle's clock as its messages show it: its offset to the receiver's, restarts, jumps, readings far off."""

from collections import deque
from enum import Enum
from math import inf, nan

__all__ = ["BootClock", "Stamp"]

_BACK_S = 1.0  # as for logs: a shorter step back is a late message, a longer one a clock that began anew
_AHEAD_S = 1.0  # no packet comes before it was sent
_HELD_S = 30.0  # nor does a link hold one back for longer than this
_OTHER_S = 3600.0  # as for logs: a step forward this long is another clock
_AGREEING = 4  # readings that agree with one another are a clock; fewer are readings far off, as for logs
_BUCKET_S = 60.0
_MOST_TRIPS = 10
_SAME_CLOCK_S = 5.0


class Stamp(Enum):
    """What a stamp means for the reading that carries it."""

    GOOD = "good"
    DOUBTFUL = "doubtful"
    """Far from the clock so far; the next ones decide."""
    RESTART = "restart"
    """The clock began anew a few readings ago: the doubtful ones before it are of the new one."""
    JUMP = "jump"
    """The clock leapt ahead a few readings ago and went on."""


class BootClock:
    """Follows one vehicle's clock.

    The offset is that of the link's quickest packet of the last one to two minutes, so that clocks may drift apart. It
    holds the smallest delay of the link; round trips (TIMESYNC) tell the two apart.

    Attributes:
        restarts: how often it began anew.
        jumps: how often it leapt ahead.
        off: readings far from it, which were dropped.
        newest_s: newest stamp, NaN before the first.
    """

    def __init__(self) -> None:
        self.restarts, self.jumps, self.off = 0, 0, 0
        self.newest_s = nan
        self._begin()

    def _begin(self) -> None:
        self._smallest, self._before, self._since_s = inf, inf, nan
        self._doubtful: list[tuple[float, float]] = []
        self._trips: deque[tuple[float, float]] = deque(maxlen=_MOST_TRIPS)

    @property
    def offset_s(self) -> float:
        """Receiver's clock minus the vehicle's, by the quickest packet; inf before the first."""
        return min(self._smallest, self._before)

    @property
    def true_offset_s(self) -> float:
        """The same without the link's delay, by the quickest round trip; NaN without one of this clock."""
        trip = min(self._trips, default=None)
        if trip is None or not abs(trip[1] - self.offset_s) < _SAME_CLOCK_S:
            return nan
        return trip[1]

    def stamped(self, boot_s: float, received_s: float) -> Stamp:
        """What a reading's stamp says of the clock."""
        delay = received_s - boot_s
        offset = self.offset_s
        if offset == inf or (-_AHEAD_S < delay - offset < _HELD_S and boot_s > self.newest_s - _BACK_S):
            if self._doubtful:
                self.off += len(self._doubtful)
                self._doubtful.clear()
            self._take(boot_s, received_s)
            return Stamp.GOOD
        if self._doubtful and not abs(delay - self._doubtful[-1][1] + self._doubtful[-1][0]) < _AHEAD_S:
            self.off += len(self._doubtful)
            self._doubtful.clear()
        self._doubtful.append((boot_s, received_s))
        if len(self._doubtful) < _AGREEING:
            return Stamp.DOUBTFUL
        return self._settle()

    def placed(self, received_s: float) -> float:
        """The stamp of a message without one: when the link's quickest packet would have been sent."""
        return received_s - self.offset_s

    def round_trip(self, sent_s: float, received_s: float, vehicle_s: float) -> None:
        """An answer to TIMESYNC: when the question left, when the answer came, what the vehicle's clock said."""
        self._trips.append((received_s - sent_s, 0.5 * (sent_s + received_s) - vehicle_s))

    def _settle(self) -> Stamp:
        """The doubtful readings are the clock."""
        doubtful, before_s = self._doubtful, self.newest_s
        ahead = 0.0 < doubtful[0][0] - before_s < _OTHER_S and doubtful[0][1] - doubtful[0][0] < self.offset_s
        self._begin()
        self.newest_s = nan
        for boot_s, received_s in doubtful:
            self._take(boot_s, received_s)
        if ahead:
            self.jumps += 1
            return Stamp.JUMP
        self.restarts += 1
        return Stamp.RESTART

    def _take(self, boot_s: float, received_s: float) -> None:
        if not received_s - self._since_s < _BUCKET_S:
            self._before, self._smallest, self._since_s = self._smallest, inf, received_s
        self._smallest = min(self._smallest, received_s - boot_s)
        if not boot_s <= self.newest_s:
            self.newest_s = boot_s
