"""The event stream: the monitor's events as server-sent events (HTML standard, section 9.2)."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from http import HTTPStatus

from wingwatch.api.encoding import encode_json
from wingwatch.api.problems import ProblemError, printable
from wingwatch.monitor.views import Event, MonitorPort

__all__ = ["EventStreams"]

_POLL_S = 0.1
_LONGEST_ID = 18


class EventStreams:
    """Every open stream of one application: bounded in number, ended together.

    Args:
        monitor: where the events come from.
        keep_alive_s: a comment is sent after this much silence, so that proxies keep the connection.
        most: streams that may be open at once.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        monitor: MonitorPort,
        keep_alive_s: float = 10.0,
        most: int = 64,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._monitor = monitor
        self._keep_alive_s = keep_alive_s
        self._most = most
        self._clock = clock
        self._open = 0
        self._closing = False

    def close(self) -> None:
        """End every open stream within a tenth of a second and refuse new ones. Callable from any thread."""
        self._closing = True

    def admit(self, last_event_id: str | None) -> AsyncIterator[bytes]:
        """A new stream that goes on after the event that the listener saw last.

        Raises:
            ProblemError: 422 for an id that none of our events has, 503 when no further stream is served.
        """
        after = None if last_event_id is None else _event_id(last_event_id)
        if self._closing or self._open >= self._most:
            why = "is stopping" if self._closing else f"already serves {self._most} event streams, its limit"
            raise ProblemError(
                HTTPStatus.SERVICE_UNAVAILABLE, f"The service {why}; poll /v1/status, or try again later."
            )
        return self._stream(after)

    async def _stream(self, last_seen: int | None) -> AsyncIterator[bytes]:
        self._open += 1
        try:
            newest = max((event.id for event in self._monitor.events(-1)), default=-1)
            yield b"retry: 2000\n: events of wingwatch\n\n"
            after = newest if last_seen is None else last_seen
            if after > newest:
                yield _resync("the service was started anew since")
                after = newest
            quiet_since = self._clock()
            while not self._closing:
                fresh = self._monitor.events(after)
                if fresh:
                    if 0 <= after < fresh[0].id - 1:
                        yield _resync("events in between are no longer kept")
                    after, quiet_since = fresh[-1].id, self._clock()
                    yield b"".join(_frame(event) for event in fresh)
                elif self._clock() - quiet_since >= self._keep_alive_s:
                    quiet_since = self._clock()
                    yield b": still here\n\n"
                await asyncio.sleep(_POLL_S)
        finally:
            self._open -= 1


def _resync(why: str) -> bytes:
    """Tells a listener that it missed something; it carries no id, so that a reconnect does not go back."""
    return b"event: resync\ndata: " + encode_json({"reason": f"{why}; read the state again"}) + b"\n\n"


def _frame(event: Event) -> bytes:
    return b"id: %d\nevent: %s\ndata: %s\n\n" % (event.id, event.kind.encode(), encode_json(event.data))


def _event_id(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= _LONGEST_ID):
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY,
            f"The header Last-Event-ID {printable(text)} is no event's id; give a number from an `id:` line.",
        )
    return int(text)
