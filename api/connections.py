"""Connections of the HTTP server: bounded in number and in how long they keep it waiting."""

import asyncio
from collections import Counter
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

__all__ = ["BoundedConnection", "Connections"]

_HEAD_S = 10.0
_STALL_S = 30.0
_LEAST_TAKEN_BYTES = 30_000  # in ``_STALL_S``: slower than any link that is still of use


class Connections:
    """Those of one server. Used in the server's thread; the counts may be read in any.

    Where as many are open as may be, a new one takes the place of another that keeps the server waiting: of the address
    that has most such, the one that has done so longest. Only where all are being answered is the new one closed.

    Args:
        most: that may be open at once.
        head_s: within which the head of a request must be whole, from the connection's beginning or the answer before.
        stall_s: after which an answer is given up whose reader takes nearly nothing.
    """

    def __init__(self, most: int = 512, head_s: float = _HEAD_S, stall_s: float = _STALL_S) -> None:
        self._most = most
        self.head_s = head_s
        self.stall_s = stall_s
        self._open: list[BoundedConnection] = []
        self.counts = dict.fromkeys(("gave_way", "refused", "late_head", "stalled_reader"), 0)

    @property
    def open(self) -> int:
        """Connections that are open."""
        return len(self._open)

    def add(self, connection: "BoundedConnection") -> None:
        """Take in a new connection, and make room for it where there is none."""
        if len(self._open) >= self._most:
            waiting = [one for one in self._open if one.waits_for_client]
            if not waiting:
                self.counts["refused"] += 1
                connection.transport.abort()
                return
            per_address = Counter(one.address for one in waiting)
            most = max(per_address.values())
            idle = min(
                (one for one in waiting if per_address[one.address] == most), key=lambda one: one.since_s
            )
            self.counts["gave_way"] += 1
            self.drop(idle)
            idle.transport.abort()
        self._open.append(connection)

    def drop(self, connection: "BoundedConnection") -> None:
        """It is closed; nothing happens if it is not among them."""
        if connection in self._open:
            self._open.remove(connection)


class BoundedConnection(H11Protocol):
    """Uvicorn's connection, given up when its client is too slow with a request's head or with reading an answer.

    Bodies have limits of their own (``BodyLimit``).
    """

    def __init__(self, all_connections: Connections, **of_uvicorn: Any) -> None:
        super().__init__(**of_uvicorn)
        self._all = all_connections
        self._late: asyncio.TimerHandle | None = None
        self._stalled: asyncio.TimerHandle | None = None
        self.since_s = self.loop.time()

    @property
    def address(self) -> str:
        """Of the client."""
        return self.client[0] if self.client else ""

    @property
    def waits_for_client(self) -> bool:
        """Whether there is nothing for the server to do before the client sends or reads something."""
        cycle = self.cycle
        return cycle is None or cycle.response_complete or cycle.more_body or self._stalled is not None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin, with a limit on the first request's head."""
        super().connection_made(transport)
        self._all.add(self)
        self._expect_head()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._all.drop(self)
        for timer in (self._late, self._stalled):
            if timer is not None:
                timer.cancel()
        super().connection_lost(exc)

    def handle_events(self) -> None:
        """Take in what has come; a head that is whole is late no more."""
        before = self.cycle
        super().handle_events()
        if self.cycle is not before and self._late is not None:
            self._late.cancel()
            self._late = None

    def on_response_complete(self) -> None:
        """An answer is done, and the next request's head is waited for."""
        self._expect_head()
        super().on_response_complete()

    def pause_writing(self) -> None:
        """The client does not read as fast as it is answered."""
        super().pause_writing()
        self._watch_reader(self.transport.get_write_buffer_size())

    def resume_writing(self) -> None:
        """The client has caught up."""
        super().resume_writing()
        if self._stalled is not None:
            self._stalled.cancel()
            self._stalled = None

    def _expect_head(self) -> None:
        self.since_s = self.loop.time()
        if self._late is not None:
            self._late.cancel()
        self._late = self.loop.call_later(self._all.head_s, self._give_up, "late_head")

    def _watch_reader(self, waiting_bytes: int) -> None:
        if self._stalled is None:
            self.since_s = self.loop.time()
        self._stalled = self.loop.call_later(self._all.stall_s, self._check_reader, waiting_bytes)

    def _check_reader(self, waited_bytes: int) -> None:
        waiting_bytes = self.transport.get_write_buffer_size()
        if waiting_bytes > waited_bytes - _LEAST_TAKEN_BYTES:
            self._give_up("stalled_reader")
        else:
            self._watch_reader(waiting_bytes)

    def _give_up(self, count: str) -> None:
        if not self.transport.is_closing():
            self._all.counts[count] += 1
        self.transport.abort()
