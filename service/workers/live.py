"""Which workers live, by their liveliness tokens."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

import zenoh

from wingwatch.api import WorkerSilentError
from wingwatch.telemetry.keys import KeyNameError
from wingwatch.telemetry.worker_keys import WorkerToken, every_worker, parse_token_key

__all__ = ["Capacities", "LiveWorkers"]

_MOST = 256
_ASK_AGAIN_S = 5.0


class LiveWorkers:
    """Follows a token of all workers; use it in a ``with`` statement, inside that of its session.

    A process that is killed loses its token at once, one that is frozen after its link's lease of ten seconds.

    Args:
        session: open.
        token: which.
        changed: called in Zenoh's thread after a worker has come or gone; it returns at once.

    Attributes:
        refused: tokens beyond 256 workers, and under names that are none.
    """

    def __init__(self, session: zenoh.Session, token: WorkerToken, changed: Callable[[], object]) -> None:
        self._session, self._kind, self._changed = session, token, changed
        self._names: dict[str, None] = {}
        self._lock = threading.Lock()
        self._subscriber: Any = None
        self.refused = 0

    def __enter__(self) -> Self:
        heard = zenoh.handlers.Callback(self._heard, indirect=False)
        self._subscriber = self._session.liveliness().declare_subscriber(
            every_worker(self._kind), heard, history=True
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._subscriber.undeclare()

    @property
    def names(self) -> tuple[str, ...]:
        """Of those that live, in the order in which they came."""
        with self._lock:
            return tuple(self._names)

    def _heard(self, token: Any) -> None:
        try:
            name = parse_token_key(self._kind, str(token.key_expr))
        except KeyNameError:
            self.refused += 1
            return
        with self._lock:
            if token.kind == zenoh.SampleKind.DELETE:
                self._names.pop(name, None)
            elif len(self._names) < _MOST or name in self._names:
                self._names[name] = None
            else:
                self.refused += 1
                return
        self._changed()


class Capacities:
    """What each of the live workers takes beside others: asked once of each. To be used by one thread.

    Args:
        own: name and capacity of this worker.
        live: names of those that live.
        ask: a worker's by its name; WorkerSilentError where it does not answer, and then 1 counts for a while.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        own: tuple[str, float],
        live: Callable[[], Sequence[str]],
        ask: Callable[[str], float],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._live, self._ask, self._clock = live, ask, clock
        self._known: dict[str, float] = dict((own,))
        self._again_s: dict[str, float] = {}

    def look(self) -> Mapping[str, float]:
        """By name; it may ask."""
        live, now_s = self._live(), self._clock()
        for name in live:
            if name not in self._known and now_s >= self._again_s.get(name, now_s):
                try:
                    self._known[name] = self._ask(name)
                except WorkerSilentError:
                    self._again_s[name] = now_s + _ASK_AGAIN_S
        return {name: self._known.get(name, 1.0) for name in live}
