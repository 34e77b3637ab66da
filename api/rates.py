"""How often one client may ask: a bucket of permissions that fills at a steady rate."""

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["Rate", "RateLimit"]

_MOST_CLIENTS = 10_000


@dataclass(frozen=True, slots=True)
class Rate:
    """What is permitted: ``burst`` at once, and ``per_s`` in the long run."""

    per_s: float
    burst: int


class RateLimit:
    """One rate, kept for every client on its own; the client that asked longest ago is forgotten first.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, rate: Rate, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate = rate
        self._clock = clock
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def take(self, client: str) -> float:
        """Use one permission; the seconds until there is one, 0 where there was."""
        now_s = self._clock()
        left = self._filled(client, now_s)
        permitted = left >= 1.0
        self._left[client] = (left - 1.0 if permitted else left, now_s)
        self._left.move_to_end(client)
        while len(self._left) > _MOST_CLIENTS:
            self._left.popitem(last=False)
        return 0.0 if permitted else (1.0 - left) / self._rate.per_s

    def _filled(self, client: str, now_s: float) -> float:
        left, then_s = self._left.get(client, (float(self._rate.burst), now_s))
        return min(float(self._rate.burst), left + (now_s - then_s) * self._rate.per_s)
