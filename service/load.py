"""How much of its time a loop works."""

from collections import deque
from collections.abc import Callable

__all__ = ["LoadMeter"]

_SECONDS = 10


class LoadMeter:
    """The part of the last ten seconds in which a loop was at work. One thread notes, any may read.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._busy_s = 0.0
        self._since_s: float | None = None
        self._marks: deque[tuple[float, float]] = deque([(clock(), 0.0)], maxlen=_SECONDS + 1)

    def begin(self) -> None:
        """Work begins."""
        self._since_s = self._clock()

    def end(self) -> None:
        """Work has ended."""
        now_s = self._clock()
        self._busy_s += now_s - (now_s if self._since_s is None else self._since_s)
        self._since_s = None
        if now_s - self._marks[-1][0] >= 1.0:
            self._marks.append((now_s, self._busy_s))

    @property
    def load(self) -> float:
        """From 0, always idle, to 1, never."""
        now_s, since_s = self._clock(), self._since_s
        (first_s, before_s) = self._marks[0]
        busy_s = self._busy_s - before_s + (0.0 if since_s is None else now_s - since_s)
        return min(1.0, busy_s / (now_s - first_s)) if now_s > first_s else 0.0
