"""What workers say to each other about vehicles that move: "release this one", and "that one is mine by now".

A question is a query under the owner's own key, answered with the vehicle's checkpoint. Zenoh's threads only hand over:
the keeper answers from its own thread, a little later.
"""

import json
import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol, Self

import zenoh

from wingwatch.baselines import VehicleName
from wingwatch.telemetry.keys import KeyNameError, check_name
from wingwatch.telemetry.worker_keys import worker_key

__all__ = ["Keeper", "ZenohMoves"]

_LOG = logging.getLogger(__name__)
_TIMEOUT_S = 2.0
_LONGEST_QUESTION = 1000
_KEEPS = b"keeps"
_RELEASED = b"released"


class Keeper(Protocol):
    """Answers (``wingwatch.service.workers.watch_keeping.WatchKeeper``); both methods return at once."""

    def release(self, vehicle: VehicleName, asker: str, answer: Callable[[bytes | None], None]) -> None:
        """Another worker asks for a vehicle."""
        ...

    def taken(self, vehicle: VehicleName, number: int) -> None:
        """Another worker has taken a vehicle under this number."""
        ...


class ZenohMoves:
    """Implements the keeper's ``MovesPort``; use it in a ``with`` statement, inside that of its session.

    Args:
        session: open.
        me: this worker's name.

    Attributes:
        strange: questions that are none of the contract's.
    """

    def __init__(self, session: zenoh.Session, me: str) -> None:
        self._session, self._me = session, me
        self._keeper: Keeper | None = None
        self._listening: list[Any] = []
        self.strange = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for declared in self._listening:
            declared.undeclare()
        self._listening = []

    def answer_from(self, keeper: Keeper) -> None:
        """From now on answer what other workers ask."""
        self._keeper = keeper
        for what, note in (("release", self._asked), ("taken", self._note_taken)):
            callback = zenoh.handlers.Callback(note, indirect=False)
            self._listening.append(self._session.declare_queryable(worker_key(self._me, what), callback))

    def ask(self, owner: str, vehicle: VehicleName, answered: Callable[[bytes | None], None]) -> None:
        """Ask a worker to release a vehicle; ``answered`` is called once."""
        answer = _Answer(answered)
        asked = self._question(vehicle, asker=self._me)
        # Dropping the last reference to a callback is how Zenoh says that no answer comes any more.
        handler: Any = zenoh.handlers.Callback(answer.reply, answer.none, indirect=False)
        try:
            self._session.get(worker_key(owner, "release"), handler, payload=asked, timeout=_TIMEOUT_S)
        except (zenoh.ZError, KeyNameError) as error:
            _LOG.debug("%s is not asked for %s: %s", owner, vehicle, error)
            answer.none()

    def tell(self, owner: str, vehicle: VehicleName, number: int) -> None:
        """Say to a worker that its lease has passed on; no answer is waited for."""
        announced = self._question(vehicle, number=number)
        with suppress(zenoh.ZError, KeyNameError):
            handler: Any = zenoh.handlers.Callback(lambda _: None, indirect=False)
            self._session.get(worker_key(owner, "taken"), handler, payload=announced, timeout=_TIMEOUT_S)

    @staticmethod
    def _question(vehicle: VehicleName, **more: str | int) -> bytes:
        return json.dumps({"fleet": vehicle[0], "vehicle": vehicle[1], **more}).encode()

    # -- in Zenoh's threads -------------------------------------------------------------------------

    def _asked(self, query: Any) -> None:
        try:
            question = _read(query)
            vehicle, asker = _vehicle(question), check_name("worker", str(question.get("asker")))
        except ValueError:
            self.strange += 1
            return
        key = str(query.key_expr)

        def answer(state: bytes | None) -> None:
            payload = _KEEPS if state is None else _RELEASED + state
            with suppress(zenoh.ZError):  # who asked has gone, or waits no longer
                query.reply(key, payload)
            query.drop()

        if self._keeper is not None:
            self._keeper.release(vehicle, asker, answer)

    def _note_taken(self, query: Any) -> None:
        try:
            question = _read(query)
            vehicle, number = _vehicle(question), question.get("number")
        except ValueError:
            self.strange += 1
            return
        if self._keeper is None or not isinstance(number, int) or isinstance(number, bool):
            self.strange += 1
            return
        self._keeper.taken(vehicle, number)


class _Answer:
    """Passes on the first answer, and nothing after it."""

    def __init__(self, answered: Callable[[bytes | None], None]) -> None:
        self._answered: Callable[[bytes | None], None] | None = answered
        self._lock = threading.Lock()

    def reply(self, reply: Any) -> None:
        """An answer came."""
        payload = b"" if reply.ok is None else reply.ok.payload.to_bytes()
        self._say(payload[len(_RELEASED) :] if payload.startswith(_RELEASED) else None)

    def none(self) -> None:
        """No further answer comes."""
        self._say(None)

    def _say(self, state: bytes | None) -> None:
        with self._lock:
            answered, self._answered = self._answered, None
        if answered is not None:
            answered(state)


def _read(query: Any) -> dict[str, Any]:
    """A question.

    Raises:
        ValueError: it is no object in JSON, or too long for one.
    """
    payload = b"" if query.payload is None else query.payload.to_bytes()
    if len(payload) > _LONGEST_QUESTION:
        raise ValueError("too long")
    question = json.loads(payload)
    if not isinstance(question, dict):
        raise ValueError("no object")
    return question


def _vehicle(question: dict[str, Any]) -> VehicleName:
    fleet, vehicle = str(question.get("fleet")), str(question.get("vehicle"))
    return check_name("fleet", fleet), check_name("vehicle", vehicle)
