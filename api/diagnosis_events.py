"""How far one diagnosis is, as server-sent events (HTML standard, section 9.2)."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from http import HTTPStatus

from starlette.concurrency import run_in_threadpool

from wingwatch.api.encoding import encode_json
from wingwatch.api.ports import DiagnosisState, DiagnosisView
from wingwatch.api.problems import ProblemError

__all__ = ["DiagnosisStreams"]

_LOOK_S = 0.25
_KEEP_ALIVE_S = 10.0
_OPEN = (DiagnosisState.QUEUED, DiagnosisState.RUNNING)


class DiagnosisStreams:
    """Every open stream of progress: bounded in number, each ends with its diagnosis.

    Args:
        over: whether all are to end, for the service stops.
        most: streams that may be open at once.
        clock: monotonic seconds.
    """

    def __init__(
        self, over: Callable[[], bool], most: int = 16, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._over = over
        self._most = most
        self._clock = clock
        self._open = 0

    def follow(
        self,
        look: Callable[[], DiagnosisView | None],
        document: Callable[[DiagnosisView], object],
        holds: Callable[[], bool],
    ) -> AsyncIterator[bytes]:
        """A new stream: an event ``diagnosis`` now and at each change, the last one says how it ended.

        Args:
            look: the diagnosis, None where it was forgotten.
            document: of a diagnosis, as an event carries it.
            holds: whether the listener may still listen.

        Raises:
            ProblemError: 503 where as many streams are open as may be.
        """
        if self._open >= self._most:
            raise ProblemError(
                HTTPStatus.SERVICE_UNAVAILABLE,
                f"{self._open} diagnoses are followed already, the limit; ask /v1/diagnoses/{{id}} from time to time.",
            )
        return self._stream(look, document, holds)

    async def _stream(
        self,
        look: Callable[[], DiagnosisView | None],
        document: Callable[[DiagnosisView], object],
        holds: Callable[[], bool],
    ) -> AsyncIterator[bytes]:
        self._open += 1
        try:
            yield b"retry: 2000\n\n"
            sent, quiet_since = b"", self._clock()
            while not self._over() and holds():
                view = await run_in_threadpool(look)
                if view is None:
                    return
                now = b"event: diagnosis\ndata: %s\n\n" % encode_json(document(view))
                if now != sent:
                    sent, quiet_since = now, self._clock()
                    yield now
                elif self._clock() - quiet_since >= _KEEP_ALIVE_S:
                    quiet_since = self._clock()
                    yield b": still here\n\n"
                if view.state not in _OPEN:
                    return
                await asyncio.sleep(_LOOK_S)
        finally:
            self._open -= 1
