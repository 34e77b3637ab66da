"""A lock that whoever works without a pause cannot keep to himself."""

import threading

__all__ = ["FairLock"]


class FairLock:
    """A lock whose holder may take it again; who lets it go and asks at once comes after those who wait.

    With a plain lock the thread that takes samples in, which asks again within microseconds, overtakes whoever has
    been woken for it: answers then wait for many rounds instead of one.
    """

    def __init__(self) -> None:
        self._turn = threading.Lock()
        self._held = threading.Lock()
        self._owner: int | None = None
        self._depth = 0

    def __enter__(self) -> None:
        me = threading.get_ident()
        if self._owner != me:
            with self._turn:  # held by who is next until the lock is his
                self._held.acquire()
            self._owner = me
        self._depth += 1

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._owner = None
            self._held.release()
