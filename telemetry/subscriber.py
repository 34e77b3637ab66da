"""Receiving: messages of all vehicles wait, undecoded, in bounded queues for the service's loop.

Zenoh keeps what arrives in channels of its own, without this interpreter; every few milliseconds a thread takes over
what is there, checks the key and copies the bytes. A callback a message would stop whoever computes at every message.
Aircraft messages go before the samples that were taken over with them, for these may be the first of that vehicle.
"""

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Any, Self

import zenoh

from wingwatch.telemetry.keys import (
    EVERY_VEHICLE_ALIVE,
    KEY_ROOT,
    KeyNameError,
    parse_alive_key,
    parse_key,
    vehicle_key,
)
from wingwatch.telemetry.sensor_subscriptions import CHANNEL, SensorSubscriptions, waiting_in
from wingwatch.telemetry.vehicle_queues import InboundMessage, VehicleQueues

__all__ = ["SensorSubscriber"]

_LOG = logging.getLogger(__name__)

_GATHER_S = 0.004
"""Time between two looks at the channels: vehicles whose messages come within it can be advanced together."""

_GATHER_MANY_S = 0.016
"""The same after a look that found several: what a batch costs beside its samples is then shared by more of them."""

_GATHER_OWN_S = 0.05
"""The same where each vehicle has a channel: a look costs by vehicle, and a part of a fleet fills a batch more slowly.
With 40 vehicles on two workers it takes a third off what a sample costs in all."""

_MOST_ANNOUNCED, _MOST_ANNOUNCEMENT = 20_000, 2_000
"""Vehicles whose aircraft is remembered while another process watches them, and bytes of what one says of it."""

_SERVICES = "service"
"""In the place of a fleet: not vehicles live there."""

_END_S = 1.0


class SensorSubscriber:
    """Subscribes what all vehicles say they are, and the sensors of all or of some; use it in a ``with`` statement.

    All vehicles are asked for their aircraft at the start, and any one by ``ask_aircraft``, so it does not matter who
    started first.

    Args:
        session: an open session.
        clock: seconds, for the time of arrival.
        on_arrival: called after messages came, from another thread; it must return at once (set an event).
        capacity: most messages waiting; where more come, the vehicle of which most wait loses them, counted as
            ``overflow``.
        capacity_bytes: most bytes waiting; likewise.
        max_message_bytes: longest payload kept whole.
        heard: called, in any thread, with fleet and name of each vehicle that says its aircraft or shows that it lives.
            Where it is given, nothing is taken of a vehicle before ``watch`` is called for it.
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
        heard: Callable[[str, str], None] | None = None,
    ) -> None:
        self._session = session
        self._clock = clock
        self._on_arrival = on_arrival
        self._keep_bytes = max_message_bytes + 1
        self._waiting = VehicleQueues(capacity, capacity_bytes)
        self._counts = {"received": 0, "bad_key": 0}
        self._lock = Lock()
        self._heard = heard
        self._moving, self._leaving = Lock(), dict[tuple[str, str], None]()
        self._announced: dict[tuple[str, str], InboundMessage] = {}
        self._aircraft: Any = session.declare_subscriber(
            f"{KEY_ROOT}/*/*/aircraft", zenoh.handlers.FifoChannel(CHANNEL)
        )
        self._sensors = SensorSubscriptions(session, every=heard is None)
        tokens: Any = zenoh.handlers.FifoChannel(CHANNEL)
        self._tokens: Any = session.liveliness().declare_subscriber(
            EVERY_VEHICLE_ALIVE, tokens, history=heard is not None
        )
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
        self._sensors.close()
        for subscriber in (self._aircraft, self._tokens):
            subscriber.undeclare()

    @property
    def counts(self) -> dict[str, int]:
        """Messages ``received``, of these dropped again for another vehicle's (``gave_way``); not received for a full
        queue (``overflow``) or under a ``bad_key``."""
        with self._lock:
            return {**self._counts, "overflow": self._waiting.refused, "gave_way": self._waiting.gave_way}

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
        return max(self.ages().values(), default=0.0)

    def ages(self) -> Mapping[tuple[str, str], float]:
        """How long the oldest waiting message of each vehicle has waited, by fleet and name."""
        with self._lock:
            return self._waiting.ages(self._clock())

    def drain(self, max_items: int, full: Collection[tuple[str, str]] = ()) -> list[InboundMessage]:
        """The oldest waiting messages of the vehicles whose turn it is; never waits. Called from one thread only.

        Args:
            max_items: how many.
            full: vehicles, by fleet and name, of which no more is to be taken now; what waits of them stays.
        """
        with self._lock:
            return self._waiting.take(max_items, full)

    def ask_aircraft(self, fleet: str, vehicle: str) -> None:
        """Ask a vehicle what aircraft it is; the answer comes as a message. Never called in Zenoh's thread."""
        self._ask(vehicle_key(fleet, vehicle, "aircraft"))

    def prepare(self, fleet: str, vehicle: str) -> None:
        """Have a vehicle's samples wait in Zenoh for a moment: ``watch`` or ``cancel`` follows at once."""
        self._sensors.prepare(fleet, vehicle)

    def cancel(self, fleet: str, vehicle: str) -> None:
        """What was prepared for a vehicle is not wanted."""
        self._sensors.cancel(fleet, vehicle)

    def watch(self, fleet: str, vehicle: str) -> None:
        """Take a vehicle's messages from now on, beginning with what it has said of its aircraft."""
        with self._moving:
            self._leaving.pop((fleet, vehicle), None)
            if self._sensors.wants(fleet, vehicle):
                return
            with self._lock:
                announced = self._announced.get((fleet, vehicle))
                if announced is not None and self._waiting.add(replace(announced, received_s=self._clock())):
                    self._counts["received"] += 1
            self._sensors.watch(fleet, vehicle)
        if announced is None:
            self.ask_aircraft(fleet, vehicle)
        elif self._on_arrival is not None:
            self._on_arrival()

    def leave(self, fleet: str, vehicle: str) -> None:
        """Take a vehicle's messages no longer, soon: behind all that have come ``given_up`` is the last one."""
        with self._moving:
            self._leaving[fleet, vehicle] = None

    def drop(self, fleet: str, vehicle: str) -> None:
        """Take a vehicle's messages no longer, nor those that wait: ``dropped`` is the last one."""
        if self._heard is None:
            return
        with self._moving:
            self._leaving.pop((fleet, vehicle), None)
            self._sensors.cancel(fleet, vehicle)
            self._sensors.leave(fleet, vehicle)
            with self._lock:
                self._waiting.drop((fleet, vehicle))
                self._waiting.add(InboundMessage(fleet, vehicle, "dropped", b"", "", self._clock()))
        if self._on_arrival is not None:
            self._on_arrival()

    def _leave(self) -> None:
        with self._moving:
            for fleet, vehicle in self._leaving:
                if not self._sensors.wants(fleet, vehicle):
                    continue
                for sample in self._sensors.last_of(fleet, vehicle):
                    self._arrived(sample)
                self._sensors.leave(fleet, vehicle)
                with self._lock:
                    self._waiting.add(InboundMessage(fleet, vehicle, "given_up", b"", "", self._clock()))
            self._leaving.clear()
        if self._on_arrival is not None:
            self._on_arrival()

    def announcements(self) -> Sequence[InboundMessage]:
        """What each vehicle has said last of its aircraft, watched or not."""
        with self._lock:
            return tuple(self._announced.values())

    def take_announcements(self, messages: Sequence[InboundMessage]) -> None:
        """What vehicles have said to others, for those that have said nothing here."""
        for message in messages:
            if (message.fleet, message.vehicle) not in self._announced:
                self._queue(message)

    def _run(self) -> None:
        few_s, many_s = (_GATHER_S, _GATHER_MANY_S) if self._heard is None else (_GATHER_OWN_S, _GATHER_OWN_S)
        wait_s = few_s
        while not self._ending.wait(wait_s):
            try:
                wait_s = many_s if self._take_over() > 1 else few_s
            except zenoh.ZError:
                return  # the session is closed: nothing more comes
            except Exception:  # no message may end the service of all others
                _LOG.exception("messages could not be taken over")

    def _take_over(self) -> int:
        """Queue what the channels hold; how many messages that were."""
        samples = self._sensors.waiting()  # first: whatever was announced before them is there by now
        announced = waiting_in(self._aircraft)
        for token in waiting_in(self._tokens):  # likewise: who leaves makes room for whoever sent these
            self._seen(token)
        news = announced + samples
        for sample in news:
            self._arrived(sample)
        if news and self._on_arrival is not None:
            self._on_arrival()
        if self._leaving:
            self._leave()
        return len(news)

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

    def _seen(self, token: zenoh.Sample) -> None:
        try:
            fleet, vehicle = parse_alive_key(str(token.key_expr))
        except KeyNameError:
            return
        if token.kind != zenoh.SampleKind.DELETE:
            if self._heard is not None and fleet != _SERVICES:
                self._heard(fleet, vehicle)
        elif self._sensors.wants(fleet, vehicle):
            message = InboundMessage(fleet, vehicle, "left", b"", "", self._clock())
            with self._lock:
                self._waiting.add(message)

    def _queue(self, message: InboundMessage) -> None:
        if self._heard is not None and not self._is_watched(message):
            return
        with self._lock:
            if self._waiting.add(message):
                self._counts["received"] += 1

    def _is_watched(self, message: InboundMessage) -> bool:
        """Whether a message is taken; of a vehicle that is not watched its aircraft is remembered for whoever will."""
        owner = message.fleet, message.vehicle
        if message.stream == "aircraft":
            with self._lock:
                room = owner in self._announced or len(self._announced) < _MOST_ANNOUNCED
                if room and len(message.payload) <= _MOST_ANNOUNCEMENT:
                    self._announced[owner] = message
            if self._heard is not None:
                self._heard(*owner)
        return self._sensors.wants(*owner)

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
