"""The last seconds of one topic of a live link, as readings on the vehicle's clock."""

from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.logs.log import Topic
from wingwatch.telemetry.mavlink.dialect import Layout

__all__ = ["TopicBuffer"]

Array = NDArray[np.float64]

_SAME_S = 1e-6  # as for logs
_MOST_WAITING = 4096
_MOST_KEPT = 4096


class TopicBuffer:
    """Messages of one name and instance; what is older than asked for is forgotten.

    Args:
        layout: of the message.
        instance: of it.

    Attributes:
        repeated: readings dropped because they carry the stamp of the one before.
        late: readings dropped because they are older than the one before.
        overflow: readings dropped because nobody took those before them.
        total: readings that counted.
    """

    def __init__(self, layout: Layout, instance: int) -> None:
        self.layout, self.instance = layout, instance
        self.repeated, self.late, self.overflow, self.total = 0, 0, 0, 0
        self.newest_s = -inf
        self._payloads: list[bytes] = []
        self._stamps: list[float] = []
        self._data = b""
        self._time_s: Array = np.zeros(0)

    def add(self, stamp_s: float, payload: bytes) -> None:
        """One more message."""
        step = stamp_s - self.newest_s
        if step <= _SAME_S:
            if step >= -_SAME_S:
                self.repeated += 1
            else:
                self.late += 1
            return
        if len(self._payloads) >= _MOST_WAITING:
            self.overflow += 1
            return
        self.newest_s = stamp_s
        self.total += 1
        self._payloads.append(payload)
        self._stamps.append(stamp_s)

    def since(self, from_s: float) -> tuple[Array, NDArray[Any]]:
        """Stamps and payloads from a time on; what is older is forgotten."""
        if self._payloads:
            self._data = b"".join((self._data, *self._payloads))
            self._time_s = np.concatenate((self._time_s, self._stamps))
            self._payloads, self._stamps = [], []
        first = max(int(np.searchsorted(self._time_s, from_s)), self._time_s.size - _MOST_KEPT)
        if first > 0:
            self._data, self._time_s = self._data[first * self.layout.size :], self._time_s[first:]
        return self._time_s, np.frombuffer(self._data, dtype=self.layout.dtype)

    def topic(self, from_s: float) -> Topic:
        """The same as a log's topic, every field of it."""
        return self.topic_of(*self.since(from_s))

    def topic_of(self, time_s: Array, rows: NDArray[Any]) -> Topic:
        """Some of the payloads as a log's topic."""
        fields: dict[str, Array] = {}
        for name in rows.dtype.names or ():
            column = rows[name]
            if column.ndim == 2:
                fields |= {f"{name}[{k}]": column[:, k].astype(np.float64) for k in range(column.shape[1])}
            elif column.dtype.kind != "S":
                fields[name] = column.astype(np.float64)
        return Topic(self.layout.name, self.instance, time_s, fields)
