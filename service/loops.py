"""Threads of the service that work until they are asked to end, and begin again where a fault ends them before."""

import logging
import threading
import time
from collections.abc import Callable

__all__ = ["Loop"]

_LOG = logging.getLogger(__name__)
_PAUSE_S = 1.0
_SHOWN_S = 60.0
"""Time for which a fault is shown after it happened."""


class Loop:
    """A thread that does its work until that returns. Where it raises, the fault is logged and the work begins again.

    Args:
        name: of the thread; processor time is counted by it.
        what: as messages call it.
        work: returns when it is asked to end; it must be able to begin again at any time.
        wake: has the work look at what waits; called before it begins again.
        clock: monotonic seconds.

    Attributes:
        restarts: how often the work began again.
    """

    def __init__(
        self,
        name: str,
        what: str,
        work: Callable[[], None],
        wake: Callable[[], object] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._what, self._work, self._wake, self._clock = what, work, wake, clock
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._left = threading.Event()
        self._fault, self._fault_s = "", float("-inf")
        self.restarts = 0

    def start(self) -> None:
        """Begin; returns at once."""
        self._thread.start()

    def join(self, timeout_s: float) -> None:
        """Wait for the end of the work, which somebody else has asked for; it does not begin again."""
        self._left.set()
        self._thread.join(timeout_s)

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    @property
    def problem(self) -> str | None:
        """None while it works, else in one sentence that it has ended, or failed within the last minute."""
        if not self.alive:
            return f"{self._what} has ended."
        if self._clock() - self._fault_s <= _SHOWN_S:
            return f"{self._what} failed with {self._fault} and was started again."
        return None

    def _run(self) -> None:
        while True:
            try:
                return self._work()
            except Exception as error:  # the service must not go on without it
                self._fault, self._fault_s = f"{type(error).__name__}: {error}"[:200], self._clock()
                _LOG.exception("%s failed; it is started again", self._what)
            if self._left.wait(_PAUSE_S):
                return None
            self.restarts += 1
            self._wake()
