"""Who watches beside this worker: live workers by their liveliness tokens, with capacity and load.

A token's key carries the worker's name and capacity, so whoever sees a worker knows its share at that instant. A worker
that is not ready yet, or that leaves, shows capacity 0: it is there to be asked, and in no vehicle's order. Loads
change all the time and are put under a key of their own.
"""

import threading
from collections.abc import Callable
from typing import Any, Self

import zenoh

from wingwatch.service.workers.live import LiveWorkers
from wingwatch.service.workers.shares import Worker
from wingwatch.telemetry.keys import check_name
from wingwatch.telemetry.worker_keys import (
    EVERY_LOAD,
    LEAST_CAPACITY,
    MOST_CAPACITY,
    check_worker,
    token_key,
    worker_key,
)

__all__ = ["Membership"]

_LONGEST_LOAD = 32


class Membership:
    """Implements the keeper's ``MembersPort``; use it in a ``with`` statement, inside that of its session.

    Args:
        session: open.
        me: this worker's name.
        capacity: what it takes beside others, from 0.001 to 1000.
        connected: whether the link to the router holds.
        ready: whether it can take messages in; beside others that can, it takes nothing before.
        changed: as for ``LiveWorkers``.

    Raises:
        KeyNameError: a name that may not stand in a key.
        ValueError: a capacity out of range.
    """

    def __init__(
        self,
        session: zenoh.Session,
        me: str,
        capacity: float,
        connected: Callable[[], bool],
        ready: Callable[[], bool] = lambda: True,
        changed: Callable[[], object] = lambda: None,
    ) -> None:
        if not LEAST_CAPACITY <= capacity <= MOST_CAPACITY:
            raise ValueError(
                f"the capacity is {capacity:g}; give a number from {LEAST_CAPACITY:g} to {MOST_CAPACITY:g}"
            )
        self._session, self._me, self._capacity = session, check_worker(me), capacity
        self._connected, self._ready = connected, ready
        self._live = LiveWorkers(session, changed)
        self._loads: dict[str, float] = {}
        self._lock = threading.Lock()
        self._shown: float | None = None
        self._token: Any = None
        self._subscriber: Any = None
        self._leaving = False
        self._strange = 0

    def __enter__(self) -> Self:
        loads = zenoh.handlers.Callback(self._note_load, indirect=False)
        self._live.__enter__()
        self._subscriber = self._session.declare_subscriber(EVERY_LOAD, loads)
        self._show(0.0)
        return self

    def __exit__(self, *_: object) -> None:
        for declared in (self._token, self._subscriber):
            declared.undeclare()
        self._live.__exit__()

    @property
    def strange(self) -> int:
        """Tokens and loads that are none of the contract's."""
        return self._strange + self._live.strange

    def linked(self) -> bool:
        """Whether this worker is on the network."""
        return self._connected()

    def workers(self) -> dict[str, Worker]:
        """All that are there, this one included where it is seen, with their loads as last announced."""
        capacities = self._live.capacities
        with self._lock:
            self._loads = {name: load for name, load in self._loads.items() if name in capacities}
            return {
                name: Worker(name, capacity, self._loads.get(name, 0.0))
                for name, capacity in capacities.items()
            }

    def appear(self) -> None:
        """Be seen as one that watches, once it is ready, or where no other does; again changes nothing."""
        if not self._leaving and (self._ready() or not self._others_watch()):
            self._show(self._capacity)

    def _others_watch(self) -> bool:
        return any(capacity > 0.0 for name, capacity in self._live.capacities.items() if name != self._me)

    def retire(self) -> None:
        """Be seen as a worker that leaves."""
        self._leaving = True
        self._show(0.0)

    def say_load(self, load: float) -> None:
        """Tell others how much there is to do; 1.0 is all that this worker can do. To be called about once a second."""
        self._session.put(worker_key(self._me, "load"), f"{load:.3f}")
        with self._lock:
            self._loads[self._me] = load

    def _show(self, capacity: float) -> None:
        if capacity == self._shown:
            return
        former, self._shown = self._token, capacity
        self._token = self._session.liveliness().declare_token(token_key(self._me, capacity))
        if former is not None:
            former.undeclare()

    def _note_load(self, sample: Any) -> None:
        """In Zenoh's thread."""
        try:
            name = check_name("worker", str(sample.key_expr).split("/")[-2])
            load = float(sample.payload.to_bytes()[:_LONGEST_LOAD])
        except ValueError:
            self._strange += 1
            return
        if load >= 0.0 and name in self._live.names:  # NaN is refused
            with self._lock:
                self._loads[name] = load
