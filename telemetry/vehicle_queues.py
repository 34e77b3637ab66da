"""Messages that wait, a queue for each vehicle, taken in turn: one vehicle's backlog delays nobody else."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

__all__ = ["InboundMessage", "VehicleQueues"]

Key = tuple[str, str]

_MOST_NAMES = 10_000
"""Queues beyond which a full house has no room for the first message of a further vehicle."""


@dataclass(frozen=True, slots=True)
class InboundMessage:
    """One message as it came in.

    Attributes:
        fleet: from its key.
        vehicle: from its key.
        stream: ``sensors`` or ``aircraft``; ``left`` where the vehicle's liveliness token has gone; ``given_up`` where
            another process watches it from now on.
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


class VehicleQueues:
    """Bounded queues, one for each vehicle of which messages wait. To be used with a lock of the caller's held.

    Where there is no room left, the vehicle of which most wait loses its newest message: those of others find room
    whatever it sends.

    Args:
        capacity: most messages, of all vehicles together.
        capacity_bytes: most bytes of payloads, likewise.

    Attributes:
        refused: messages that found no room; gave_way: messages that were dropped again for another vehicle's.
    """

    def __init__(self, capacity: int, capacity_bytes: int) -> None:
        self._capacity, self._capacity_bytes = capacity, capacity_bytes
        self._queues: dict[Key, deque[InboundMessage]] = {}
        self._bytes: dict[Key, int] = {}
        self._turn: deque[Key] = deque()
        self._length = self._total_bytes = 0
        self.refused = self.gave_way = 0

    def __len__(self) -> int:
        return self._length

    def add(self, message: InboundMessage) -> bool:
        """Keep a message; whether there was room for it."""
        key, size = (message.fleet, message.vehicle), len(message.payload)
        while self._length >= self._capacity or self._total_bytes + size > self._capacity_bytes:
            if not self._make_room(key):
                self.refused += 1
                return False
        if key not in self._queues:
            self._queues[key], self._bytes[key] = deque(), 0
            self._turn.append(key)
        self._queues[key].append(message)
        self._count(key, 1, size)
        return True

    def take(self, most: int, enough: Callable[[str, str], bool] | None = None) -> list[InboundMessage]:
        """The oldest messages of the vehicles whose turn it is, one of each in a round.

        Args:
            most: how many.
            enough: whether no more is to be taken of a vehicle (fleet, name) now; what waits of it stays.
        """
        taken: list[InboundMessage] = []
        held_back: list[Key] = []
        while self._turn and len(taken) < most:
            key = self._turn.popleft()
            if enough is not None and enough(*key):
                held_back.append(key)
                continue
            taken.append(self._queues[key].popleft())
            self._count(key, -1, -len(taken[-1].payload))
            if self._queues[key]:
                self._turn.append(key)
            else:
                self._close(key)
        self._turn.extend(held_back)
        return taken

    def ages(self, now_s: float) -> Mapping[Key, float]:
        """How long the oldest message of each vehicle has waited, by fleet and name."""
        return {key: now_s - queue[0].received_s for key, queue in self._queues.items()}

    def _make_room(self, key: Key) -> bool:
        """Drop the newest message of the vehicle of which most wait; False where that is the one that wants room."""
        if not self._queues or (key not in self._queues and len(self._queues) > _MOST_NAMES):
            return False
        full = self._length >= self._capacity
        own = len(self._queues.get(key, ())) if full else self._bytes.get(key, 0)
        if own * len(self._queues) >= (self._length if full else self._total_bytes):
            return False  # it has more than its part, so none has to be looked for that has most
        if full:
            largest = max(self._queues, key=lambda one: len(self._queues[one]))
        else:
            largest = max(self._bytes, key=self._bytes.__getitem__)
        gone = self._queues[largest].pop()
        self._count(largest, -1, -len(gone.payload))
        if not self._queues[largest]:
            self._close(largest)
            self._turn.remove(largest)
        self.gave_way += 1
        return True

    def _close(self, key: Key) -> None:
        del self._queues[key], self._bytes[key]

    def _count(self, key: Key, messages: int, size: int) -> None:
        self._length += messages
        self._total_bytes += size
        self._bytes[key] += size
