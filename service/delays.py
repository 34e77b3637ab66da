"""How long messages take through the service, as a histogram: one search in a short list a message."""

from bisect import bisect_left
from collections.abc import Sequence

from wingwatch.api import DelayView

__all__ = ["DelayHistogram"]

LIMITS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 60.0)


class DelayHistogram:
    """Delays by size. One thread adds, any may look.

    Args:
        limits_s: upper limits of the classes, ascending; one class without a limit comes after them.
    """

    def __init__(self, limits_s: Sequence[float] = LIMITS_S) -> None:
        self._limits_s = tuple(limits_s)
        self._counts = [0] * (len(self._limits_s) + 1)
        self._total_s = 0.0

    def add(self, delay_s: float) -> None:
        """One more; a negative one, of a clock that was set back, counts as 0."""
        delay_s = max(0.0, delay_s)
        self._counts[bisect_left(self._limits_s, delay_s)] += 1
        self._total_s += delay_s

    def view(self) -> DelayView:
        """As it is now."""
        return DelayView(self._limits_s, tuple(self._counts), self._total_s)
