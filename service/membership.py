"""Who watches beside this worker: live workers by their liveliness tokens, with capacity and load.

A token's key carries the worker's name and capacity, so whoever sees a worker knows its share at that instant. A worker
that leaves shows capacity 0 before it goes: it is still there to be asked, and in no vehicle's order any more. Loads
change all the time and are put under a key of their own.
"""

import threading
from collections.abc import Callable
from typing import Any, Self
from uuid import uuid4

import zenoh

from wingwatch.service.shares import Worker
from wingwatch.telemetry.keys import KeyNameError, check_name

__all__ = ["EVERY_LOAD", "EVERY_WORKER_ALIVE", "WORKERS_ROOT", "Membership", "new_worker_name", "worker_key"]

WORKERS_ROOT = "wingwatch/workers/v1"
"""Prefix of everything that workers and gateways say to each other."""

EVERY_WORKER_ALIVE = f"{WORKERS_ROOT}/alive/*/*"
"""Key expression of all workers' liveliness tokens: name and capacity."""

EVERY_LOAD = f"{WORKERS_ROOT}/*/load"

_MOST_WORKERS = 1000
_MOST_CAPACITY = 1_000_000
_LONGEST_LOAD = 32
_LONGEST_NAME = 63 - 9


def new_worker_name(name: str = "") -> str:
    """A name that no worker has had before: leases of an earlier start under the same name are not its own.

    Args:
        name: for people, in front; at most 54 characters.

    Raises:
        KeyNameError: it may not stand in a key.
    """
    if not name:
        return uuid4().hex
    if len(name) > _LONGEST_NAME:
        raise KeyNameError(f"worker {name!r} is too long a name: use at most {_LONGEST_NAME} characters")
    return f"{check_name('worker', name)}-{uuid4().hex[:8]}"


def worker_key(worker: str, what: str) -> str:
    """Key of one thing of one worker, such as ``wingwatch/workers/v1/w1/load``.

    Raises:
        KeyNameError: a name that may not stand in a key.
    """
    return f"{WORKERS_ROOT}/{check_name('worker', worker)}/{check_name('key', what)}"


class Membership:
    """Implements the keeper's ``MembersPort``; use it in a ``with`` statement, inside that of its session.

    Args:
        session: open.
        me: this worker's name.
        capacity: vehicles that it is meant for, at least 1.
        connected: whether the link to the router holds.

    Attributes:
        strange: tokens and loads that are none of the contract's.

    Raises:
        KeyNameError: a name that may not stand in a key.
        ValueError: a capacity out of range.
    """

    def __init__(self, session: zenoh.Session, me: str, capacity: int, connected: Callable[[], bool]) -> None:
        if not 1 <= capacity <= _MOST_CAPACITY:
            raise ValueError(
                f"the capacity is {capacity}; give a number of vehicles from 1 to {_MOST_CAPACITY}"
            )
        self._session, self._me, self._capacity, self._connected = (
            session,
            check_name("worker", me),
            capacity,
            connected,
        )
        self._tokens: dict[str, set[int]] = {}
        self._loads: dict[str, float] = {}
        self._lock = threading.Lock()
        self._mine: list[Any] = []
        self._subscribers: list[Any] = []
        self._leaving = False
        self.strange = 0

    def __enter__(self) -> Self:
        tokens = zenoh.handlers.Callback(self._note_token, indirect=False)
        loads = zenoh.handlers.Callback(self._note_load, indirect=False)
        self._subscribers = [
            self._session.liveliness().declare_subscriber(EVERY_WORKER_ALIVE, tokens, history=True),
            self._session.declare_subscriber(EVERY_LOAD, loads),
        ]
        return self

    def __exit__(self, *_: object) -> None:
        for declared in (*self._mine, *self._subscribers):
            declared.undeclare()
        self._mine, self._subscribers = [], []

    def linked(self) -> bool:
        """Whether this worker is on the network."""
        return self._connected()

    def workers(self) -> dict[str, Worker]:
        """All that are there, this one included where it is seen, with their loads as last announced."""
        with self._lock:
            return {
                # two tokens for a moment while a worker begins to leave: the smaller counts
                name: Worker(name, min(capacities), self._loads.get(name, 0.0))
                for name, capacities in self._tokens.items()
            }

    def appear(self) -> None:
        """Be seen by others; again changes nothing."""
        if not self._mine and not self._leaving:
            self._mine.append(self._token(self._capacity))

    def retire(self) -> None:
        """Be seen as a worker that leaves."""
        if self._leaving:
            return
        self._leaving = True
        former, self._mine = self._mine, [self._token(0)]
        for token in former:
            token.undeclare()

    def say_load(self, load: float) -> None:
        """Tell others how much there is to do; 1.0 is all that this worker can do. To be called about once a second."""
        self._session.put(worker_key(self._me, "load"), f"{load:.3f}")
        with self._lock:
            self._loads[self._me] = load

    def _token(self, capacity: int) -> Any:
        key = f"{WORKERS_ROOT}/alive/{self._me}/{capacity}"
        return self._session.liveliness().declare_token(key)

    # -- in Zenoh's threads -------------------------------------------------------------------------

    def _note_token(self, sample: Any) -> None:
        try:
            name, capacity = _parsed(str(sample.key_expr))
        except ValueError:
            self.strange += 1
            return
        with self._lock:
            known = self._tokens.get(name, set())
            if sample.kind == zenoh.SampleKind.PUT:
                if len(self._tokens) < _MOST_WORKERS:
                    self._tokens[name] = known | {capacity}
            elif known - {capacity}:
                self._tokens[name] = known - {capacity}
            else:
                self._tokens.pop(name, None)
                self._loads.pop(name, None)

    def _note_load(self, sample: Any) -> None:
        try:
            name = check_name("worker", str(sample.key_expr).split("/")[-2])
            load = float(sample.payload.to_bytes()[:_LONGEST_LOAD])
        except ValueError:
            self.strange += 1
            return
        with self._lock:
            if load >= 0.0 and name in self._tokens:  # NaN is refused
                self._loads[name] = load


def _parsed(key: str) -> tuple[str, int]:
    """Name and capacity of a token.

    Raises:
        ValueError: it is none of the contract's.
    """
    parts = key.split("/") if len(key) <= 256 else []
    if len(parts) != 6 or "/".join(parts[:4]) != f"{WORKERS_ROOT}/alive":
        raise KeyNameError(f"{key[:80]!r} is no key of a worker's token")
    capacity = int(parts[5]) if parts[5].isascii() and parts[5].isdigit() else -1
    if not 0 <= capacity <= _MOST_CAPACITY:
        raise KeyNameError(f"{key[:80]!r} is no key of a worker's token")
    return check_name("worker", parts[4]), capacity
