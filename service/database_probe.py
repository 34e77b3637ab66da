"""Asking a database whether it works, without waiting for one that never answers."""

import threading
import time
from collections.abc import Callable

from wingwatch.baselines import DatabaseError

__all__ = ["DatabaseProbe"]

_PATIENCE_S = 2.0


class DatabaseProbe:
    """One question at a time, in a thread of its own: a frozen server holds up one thread, and nobody who asks.

    Args:
        check: raises DatabaseError where the database does not work.
        patience_s: how long whoever asks waits for the answer.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        check: Callable[[], None],
        patience_s: float = _PATIENCE_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._check = check
        self._patience_s = patience_s
        self._clock = clock
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._asked_s = 0.0
        self._problem: str | None = None

    def problem(self) -> str | None:
        """None where the database works, else one sentence."""
        with self._lock:
            if self._thread is None or not self._thread.is_alive():
                self._asked_s = self._clock()
                self._thread = threading.Thread(target=self._ask, name="wingwatch-probe", daemon=True)
                self._thread.start()
            thread = self._thread
        thread.join(self._patience_s)
        if thread.is_alive():
            return f"the database has not answered for {self._clock() - self._asked_s:.0f} s."
        return self._problem

    def _ask(self) -> None:
        try:
            self._check()
        except DatabaseError as error:
            self._problem = f"{error}."
        except Exception as error:  # whatever a driver raises must not pass for an answer
            self._problem = f"the database cannot be asked: {type(error).__name__}: {error}."
        else:
            self._problem = None
