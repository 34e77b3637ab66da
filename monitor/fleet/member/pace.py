"""How fast a vehicle's own clock runs beside ours: a recording that is replayed may wait, an aircraft may not."""

from dataclasses import dataclass
from math import isfinite, nan

__all__ = ["Pace"]

_LOOKED_AT_S = 10.0
"""Time of arrival after which the pace is found anew."""

_TWICE, _LUMP_S = 2.0, 5.0
"""Faster than twice real time is ahead; what a link held back for so long and sends at once is ahead for a while."""


@dataclass(slots=True)
class Pace:
    """The stamps of a vehicle's messages beside their arrivals.

    Attributes:
        from_stamp_s, from_arrival_s: where the present look began.
        ahead: whether it sends faster than it flies.
    """

    from_stamp_s: float = nan
    from_arrival_s: float = nan
    ahead: bool = False

    def note(self, stamp_s: float, arrival_s: float) -> None:
        """A message with this latest stamp arrived then."""
        if not isfinite(stamp_s):
            return
        flown_s, passed_s = stamp_s - self.from_stamp_s, arrival_s - self.from_arrival_s
        if flown_s - _TWICE * passed_s > _LUMP_S:
            self.ahead = True
        if not (0.0 <= passed_s <= _LOOKED_AT_S and flown_s >= 0.0):
            self.ahead = flown_s > _TWICE * passed_s > 0.0
            self.from_stamp_s, self.from_arrival_s = stamp_s, arrival_s
