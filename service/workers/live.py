"""Which workers are there, with their capacities, by their liveliness tokens."""

import threading
from collections.abc import Callable
from typing import Any, Self

import zenoh

from wingwatch.telemetry.keys import KeyNameError
from wingwatch.telemetry.worker_keys import EVERY_TOKEN, parse_token_key

__all__ = ["LiveWorkers"]

_MOST = 1000


class LiveWorkers:
    """Follows the tokens of all workers; use it in a ``with`` statement, inside that of its session.

    A process that is killed loses its token at once, one that is frozen after its link's lease of ten seconds.

    Args:
        session: open.
        changed: called in Zenoh's thread after a worker has come or gone, or its capacity has changed; it returns at
            once.

    Attributes:
        strange: tokens that are none of the contract's, or beyond 1000 workers.
    """

    def __init__(self, session: zenoh.Session, changed: Callable[[], object] = lambda: None) -> None:
        self._session, self._changed = session, changed
        self._tokens: dict[str, set[float]] = {}
        self._lock = threading.Lock()
        self._subscriber: Any = None
        self.strange = 0

    def __enter__(self) -> Self:
        heard = zenoh.handlers.Callback(self._heard, indirect=False)
        self._subscriber = self._session.liveliness().declare_subscriber(EVERY_TOKEN, heard, history=True)
        return self

    def __exit__(self, *_: object) -> None:
        self._subscriber.undeclare()

    @property
    def names(self) -> tuple[str, ...]:
        """Of those that are there, in the order in which they came."""
        with self._lock:
            return tuple(self._tokens)

    @property
    def capacities(self) -> dict[str, float]:
        """By name; of two tokens, while a worker shows another capacity, the smaller counts."""
        with self._lock:
            return {name: min(capacities) for name, capacities in self._tokens.items()}

    def _heard(self, token: Any) -> None:
        try:
            name, capacity = parse_token_key(str(token.key_expr))
        except KeyNameError:
            self.strange += 1
            return
        with self._lock:
            shown = self._tokens.get(name, set())
            shown = shown - {capacity} if token.kind == zenoh.SampleKind.DELETE else shown | {capacity}
            if not shown:
                self._tokens.pop(name, None)
            elif name in self._tokens or len(self._tokens) < _MOST:
                self._tokens[name] = shown
            else:
                self.strange += 1
                return
        self._changed()
