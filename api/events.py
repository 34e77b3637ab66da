"""The event stream: the monitor's events as server-sent events (HTML standard, section 9.2)."""

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from http import HTTPStatus

from wingwatch.api.encoding import encode_json
from wingwatch.api.problems import ProblemError, printable
from wingwatch.monitor.views import Event, MonitorPort

__all__ = ["EventStreams", "Listener"]

_POLL_S = 0.1
_LONGEST_ID = 18
_ASK_AGAIN_S = 5.0


def _always() -> bool:
    return True


@dataclass(eq=False, slots=True)
class Listener:
    """Who listens to one stream.

    Attributes:
        client: its token's name or its address.
        holds: whether it may still listen; asked every 5 s.
        took_s: when it last took something off our hands.
        over: whether its stream is to end.
    """

    client: str = ""
    holds: Callable[[], bool] = _always
    took_s: float = 0.0
    over: bool = False


class EventStreams:
    """Every open stream of one application: bounded in number, ended together.

    Where as many are open as may be, a new one takes the place of another: of the client that has most streams, the one
    that has longest taken nothing. Its listener comes back with the id that it saw last, and misses nothing.

    Args:
        monitor: where the events come from.
        keep_alive_s: a comment is sent after this much silence, so that proxies keep the connection.
        most: streams that may be open at once.
        clock: monotonic seconds.
        start: added to the monitor's event numbers. It differs at each start of the service, so that an id of an
            earlier one is recognised.
    """

    def __init__(
        self,
        monitor: MonitorPort,
        keep_alive_s: float = 10.0,
        most: int = 64,
        clock: Callable[[], float] = time.monotonic,
        start: int = 0,
    ) -> None:
        self._monitor = monitor
        self._keep_alive_s = keep_alive_s
        self._most = most
        self._clock = clock
        self._start = start
        self._open: list[Listener] = []
        self._closing = False
        self.counts = {"gave_way": 0}

    @property
    def open(self) -> int:
        """Streams that are open."""
        return len(self._open)

    @property
    def closing(self) -> bool:
        """Whether the service stops."""
        return self._closing

    def close(self) -> None:
        """End every open stream within a tenth of a second and refuse new ones. Callable from any thread."""
        self._closing = True

    def admit(
        self,
        last_event_id: str | None,
        listener: Listener | None = None,
        wanted: Callable[[Event], bool] = lambda _: True,
    ) -> AsyncIterator[bytes]:
        """A new stream that goes on after the event that the listener saw last.

        Args:
            wanted: whether the listener wants an event.

        Raises:
            ProblemError: 422 for an id that none of our events has, 503 when the service is stopping.
        """
        after = None if last_event_id is None else _event_id(last_event_id)
        if self._closing:
            raise ProblemError(
                HTTPStatus.SERVICE_UNAVAILABLE,
                "The service is stopping; poll /v1/status, or try again later.",
            )
        return self._stream(after, listener or Listener(), wanted)

    async def _stream(
        self, last_seen: int | None, listener: Listener, wanted: Callable[[Event], bool]
    ) -> AsyncIterator[bytes]:
        self._make_room()
        self._open.append(listener)
        listener.took_s = asked_s = self._clock()
        try:
            newest = max((event.id for event in self._monitor.events(-1)), default=-1)
            yield b"retry: 2000\n: events of wingwatch\n\n"
            after = newest if last_seen is None else last_seen - self._start
            if not 0 <= after <= newest and last_seen is not None:
                yield _resync("the service was started anew since")
                after = newest
            quiet_since = self._clock()
            while not (self._closing or listener.over):
                listener.took_s = now_s = self._clock()
                if now_s - asked_s >= _ASK_AGAIN_S:
                    asked_s = now_s
                    listener.over = not listener.holds()
                fresh = self._monitor.events(after)
                if fresh:
                    if (
                        0 <= after < self._monitor.events_complete_after()
                    ):  # asked after the events: never too low
                        yield _resync("events in between are no longer kept")
                    after = fresh[-1].id
                    fresh = [event for event in fresh if wanted(event)]
                if fresh:
                    quiet_since = now_s
                    yield b"".join(_frame(event, self._start) for event in fresh)
                elif now_s - quiet_since >= self._keep_alive_s:
                    quiet_since = now_s
                    yield b": still here\n\n"
                await asyncio.sleep(_POLL_S)
        finally:
            if listener in self._open:
                self._open.remove(listener)

    def _make_room(self) -> None:
        """End a stream where as many are open as may be; it counts no longer, though it may take a moment to end."""
        if len(self._open) < self._most:
            return
        streams = Counter(listener.client for listener in self._open)
        most = max(streams.values())
        idle = min((one for one in self._open if streams[one.client] == most), key=lambda one: one.took_s)
        idle.over = True
        self._open.remove(idle)
        self.counts["gave_way"] += 1


def _resync(why: str) -> bytes:
    """Tells a listener that it missed something; it carries no id, so that a reconnect does not go back."""
    return b"event: resync\ndata: " + encode_json({"reason": f"{why}; read the state again"}) + b"\n\n"


def _frame(event: Event, start: int) -> bytes:
    return b"id: %d\nevent: %s\ndata: %s\n\n" % (
        start + event.id,
        event.kind.encode(),
        encode_json(event.data),
    )


def _event_id(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= _LONGEST_ID):
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY,
            f"The header Last-Event-ID {printable(text)} is no event's id; give a number from an `id:` line.",
        )
    return int(text)
