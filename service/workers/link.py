"""Questions to workers over Zenoh: each answered or given up within a time."""

from collections.abc import Callable
from typing import Any

import zenoh

from wingwatch.api import WorkerSilentError
from wingwatch.telemetry.worker_keys import worker_key

__all__ = ["PATIENCE_S", "WorkerLink"]

PATIENCE_S = 2.0
"""For an answer that a worker has at hand."""


class WorkerLink:
    """Asks workers by their names.

    Args:
        session: open.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session

    def ask(self, worker: str, question: str, payload: bytes, patience_s: float = PATIENCE_S) -> bytes:
        """The answer; waits for it.

        Raises:
            WorkerSilentError: there is none within the patience.
        """
        found: list[bytes] = []
        try:
            replies: Any = self._session.get(
                worker_key(worker, question), payload=payload, timeout=patience_s
            )
            found += [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]
        except zenoh.ZError as error:
            raise WorkerSilentError(f"worker {worker} cannot be asked: {error}; try again") from None
        if not found:
            raise WorkerSilentError(f"worker {worker} has not answered within {patience_s:g} s; try again")
        return found[0]

    def send(
        self, worker: str, question: str, payload: bytes, answered: Callable[[bytes | None], object]
    ) -> None:
        """Ask and return at once.

        Args:
            answered: called once, in Zenoh's thread, with the answer, or with None where there is none within
                ``PATIENCE_S``; it returns at once.

        Raises:
            zenoh.ZError: the session is closed.
        """
        found: list[bytes] = []

        def arrived(reply: Any) -> None:
            if reply.ok is not None and not found:
                found.append(reply.ok.payload.to_bytes())

        def over() -> None:
            answered(found[0] if found else None)

        handler = zenoh.handlers.Callback(arrived, over, indirect=False)
        self._session.get(worker_key(worker, question), handler, payload=payload, timeout=PATIENCE_S)
