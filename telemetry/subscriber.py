"""Receiving: messages of all vehicles wait, undecoded, in a bounded queue for the service's loop.

Zenoh keeps what arrives in channels of its own, without this interpreter; every few milliseconds a thread takes over
what is there, checks the key and copies the bytes. A callback a message would stop whoever computes at every message.
Aircraft messages go before the samples that were taken over with them, for these may be the first of that vehicle.
"""

import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Any, Self

import zenoh

from wingwatch.telemetry.keys import KEY_ROOT, KeyNameError, parse_key, vehicle_key

__all__ = ["InboundMessage", "SensorSubscriber"]

_LOG = logging.getLogger(__name__)

_GATHER_S = 0.004
"""Time between two looks at the channels: vehicles whose messages come within it can be advanced together."""

_CHANNEL = 16_384
"""Messages that a channel takes; a link whose channel is full waits."""

_END_S = 1.0


@dataclass(frozen=True, slots=True)
class InboundMessage:
    """One message as it came in.

    Attributes:
        fleet: from its key.
        vehicle: from its key.
        stream: ``sensors`` or ``aircraft``.
        payload: its bytes; of a payload above the limit only so many that decoding says ``too_large``.
        encoding: Zenoh's encoding, as text.
        received_s: the subscriber's clock when it was taken over, a few milliseconds after its arrival.
    """

    fleet: str
    vehicle: str
    stream: str
    payload: bytes
    encoding: str
    received_s: float


class SensorSubscriber:
    """Subscribes the sensors and aircraft streams of every vehicle; use it in a ``with`` statement.

    All vehicles are asked for their aircraft at the start, and any one by ``ask_aircraft``, so it does not matter who
    started first.

    Args:
        session: an open session.
        clock: seconds, for the time of arrival.
        on_arrival: called after messages came, from another thread; it must return at once (set an event).
        capacity: most messages waiting; more are dropped and counted as ``overflow``.
        capacity_bytes: most bytes waiting; likewise.
        max_message_bytes: longest payload kept whole.
    """

    def __init__(
        self,
        session: zenoh.Session,
        clock: Callable[[], float],
        on_arrival: Callable[[], None] | None = None,
        *,
        capacity: int = 100_000,
        capacity_bytes: int = 268_435_456,
        max_message_bytes: int = 65_536,
    ) -> None:
        self._session = session
        self._clock = clock
        self._on_arrival = on_arrival
        self._capacity = capacity
        self._capacity_bytes = capacity_bytes
        self._keep_bytes = max_message_bytes + 1
        self._waiting: deque[InboundMessage] = deque()
        self._waiting_bytes = 0
        self._counts = {"received": 0, "overflow": 0, "bad_key": 0}
        self._lock = Lock()
        self._subscribers = [
            session.declare_subscriber(f"{KEY_ROOT}/*/*/{stream}", zenoh.handlers.FifoChannel(_CHANNEL))
            for stream in ("aircraft", "sensors")
        ]
        self._ending = Event()
        self._thread = Thread(target=self._run, name="wingwatch-subscriber", daemon=True)
        self._thread.start()
        self._ask(f"{KEY_ROOT}/*/*/aircraft")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the subscription; what waits can still be drained."""
        self._ending.set()
        self._thread.join(_END_S)
        while self._subscribers:
            self._subscribers.pop().undeclare()  # type: ignore[no-untyped-call]

    @property
    def counts(self) -> dict[str, int]:
        """Messages ``received``, dropped from a full queue (``overflow``), and under a ``bad_key``."""
        with self._lock:
            return dict(self._counts)

    @property
    def alive(self) -> bool:
        """Whether the thread that takes messages over runs; it ends with the session."""
        return self._thread.is_alive()

    @property
    def waiting(self) -> int:
        """Messages in the queue now."""
        return len(self._waiting)

    @property
    def waiting_s(self) -> float:
        """How long the oldest message has waited; 0 where none waits."""
        with self._lock:
            return self._clock() - self._waiting[0].received_s if self._waiting else 0.0

    def drain(self, max_items: int) -> list[InboundMessage]:
        """The oldest waiting messages, in the order of arrival; never waits. Called from one thread only."""
        with self._lock:
            taken = [self._waiting.popleft() for _ in range(min(max_items, len(self._waiting)))]
            self._waiting_bytes -= sum(len(message.payload) for message in taken)
        return taken

    def ask_aircraft(self, fleet: str, vehicle: str) -> None:
        """Ask a vehicle what aircraft it is; the answer comes as a message. Never called in Zenoh's thread."""
        self._ask(vehicle_key(fleet, vehicle, "aircraft"))

    def _run(self) -> None:
        while not self._ending.wait(_GATHER_S):
            try:
                self._take_over()
            except zenoh.ZError:
                return  # the session is closed: nothing more comes
            except Exception:  # no message may end the service of all others
                _LOG.exception("messages could not be taken over")

    def _take_over(self) -> None:
        aircraft, sensors = self._subscribers
        samples = _waiting(sensors)  # first: whatever was announced before them is there by now
        news = _waiting(aircraft) + samples
        for sample in news:
            self._arrived(sample)
        if news and self._on_arrival is not None:
            self._on_arrival()

    def _arrived(self, sample: zenoh.Sample) -> None:
        if sample.kind != zenoh.SampleKind.PUT:
            return
        try:
            key = parse_key(str(sample.key_expr))
        except KeyNameError:
            self._count("bad_key")
            return
        payload = sample.payload.to_bytes()[: self._keep_bytes]
        message = InboundMessage(
            key.fleet, key.vehicle, key.leaf, payload, str(sample.encoding), self._clock()
        )
        self._queue(message)

    def _queue(self, message: InboundMessage) -> None:
        with self._lock:
            full = len(self._waiting) >= self._capacity
            if full or self._waiting_bytes + len(message.payload) > self._capacity_bytes:
                self._counts["overflow"] += 1
                return
            self._counts["received"] += 1
            self._waiting_bytes += len(message.payload)
            self._waiting.append(message)

    def _count(self, name: str) -> None:
        with self._lock:
            self._counts[name] += 1

    def _ask(self, key: str) -> None:
        self._session.get(key, self._answered, target=zenoh.QueryTarget.ALL)

    def _answered(self, reply: Any) -> None:
        if reply.ok is not None:
            self._arrived(reply.ok)
            if self._on_arrival is not None:
                self._on_arrival()


def _waiting(channel: Any) -> list[zenoh.Sample]:
    """All that a channel holds now, not more than it can hold."""
    taken: list[zenoh.Sample] = []
    while len(taken) < _CHANNEL and (sample := channel.try_recv()) is not None:
        taken.append(sample)
    return taken
