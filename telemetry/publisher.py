"""Publishing: a flight into Zenoh as a vehicle sends it, in real time or as fast as the receiver takes it."""

import secrets
import time
from collections.abc import Callable, Iterator, Sequence
from threading import Lock
from types import TracebackType
from typing import Any, Self

import numpy as np
import zenoh

from wingwatch.telemetry.keys import alive_key, vehicle_key
from wingwatch.telemetry.messages import PROTOBUF, AircraftMessage, encode_aircraft, encode_sensors
from wingwatch.telemetry.sample import SampleBlock
from wingwatch.telemetry.zenoh_link import LinkError

__all__ = ["FlightPublisher"]

_MAX_SAMPLES_PER_MESSAGE = 200  # every channel of 200 samples is 48 kB, below the receiver's 64 kB
_STREAM_BITS = 53  # what JSON carries exactly
_LONGEST_PAUSE_S = 10.0
_LOOK_AGAIN_S = 0.01


class FlightPublisher:
    """One vehicle on the network; use it in a ``with`` statement.

    It holds the vehicle's liveliness token, answers queries for the aircraft, and counts its messages from 0
    under a random stream number of its own.

    Args:
        session: an open session.
        fleet: name of the fleet.
        vehicle: name of the vehicle.
        aircraft: what the vehicle is.
        samples_per_message: samples in one message; fewer are quicker to arrive, more are cheaper.
        clock: monotonic seconds.
        sleep: waits that many seconds.

    Raises:
        KeyNameError: a name that may not stand in a key.
        ValueError: more samples in one message than fit, or none.
    """

    def __init__(
        self,
        session: zenoh.Session,
        fleet: str,
        vehicle: str,
        aircraft: AircraftMessage,
        *,
        samples_per_message: int = 10,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        if not 1 <= samples_per_message <= _MAX_SAMPLES_PER_MESSAGE:
            raise ValueError(
                f"samples_per_message is {samples_per_message}: choose 1 to {_MAX_SAMPLES_PER_MESSAGE}"
            )
        self._session = session
        self._sensors_key = vehicle_key(fleet, vehicle, "sensors")
        self._aircraft_key = vehicle_key(fleet, vehicle, "aircraft")
        self._samples_per_message = samples_per_message
        self._clock = clock
        self._sleep = sleep
        self._sequence = 0
        # Drawn, not read from a clock: one without a battery starts at the same time whenever it starts.
        self._stream = secrets.randbits(_STREAM_BITS)
        self._lock = Lock()
        self._aircraft_payload = self._encoded(aircraft)
        self._sensors = session.declare_publisher(
            self._sensors_key, encoding=PROTOBUF, congestion_control=zenoh.CongestionControl.DROP
        )
        self._queryable: Any = session.declare_queryable(self._aircraft_key, self._answer)
        self._token: Any = session.liveliness().declare_token(alive_key(fleet, vehicle))
        self._announced = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Takes the vehicle off the network; the session stays open."""
        self._token.undeclare()
        self._queryable.undeclare()
        self._sensors.undeclare()  # type: ignore[no-untyped-call]

    @property
    def sequence(self) -> int:
        """Number of the next sensors message."""
        return self._sequence

    def announce(self, aircraft: AircraftMessage) -> None:
        """Says what the vehicle is, now and to whoever asks later: for a change of load or configuration."""
        with self._lock:
            self._aircraft_payload = self._encoded(aircraft)
        self._put_aircraft()

    def wait_for_receiver(self, timeout_s: float) -> bool:
        """Waits until somebody subscribes this vehicle's sensors; whether somebody does."""
        deadline = self._clock() + timeout_s
        while not self._has_receiver():
            if self._clock() >= deadline:
                return False
            self._sleep(_LOOK_AGAIN_S)
        return True

    def publish(
        self,
        block: SampleBlock,
        rate: float | None = 1.0,
        *,
        columns: Sequence[str] | None = None,
        receiver_timeout_s: float = 5.0,
    ) -> int:
        """Sends samples in order and returns when all of them are handed over; the number of messages.

        Args:
            block: the samples; stamps need not be clean.
            rate: speed relative to the stamps (1.0 is real time): messages are dropped where the network is
                congested, as a flying vehicle must. None is as fast as the receiver takes them: nothing is
                dropped, and somebody must listen.
            columns: channels to send (``FlightTable.wire_columns``); those present in the block if not given.
            receiver_timeout_s: how long to wait for somebody to listen before the first message.

        Raises:
            LinkError: ``rate`` is None, and nobody listens or the link breaks on the way.
            ValueError: a rate that is not positive.
        """
        if rate is not None and not (rate > 0.0 and np.isfinite(rate)):
            raise ValueError(f"rate is {rate}: choose a number above 0, or none for as fast as possible")
        self._begin(rate is None, receiver_timeout_s)
        names = block.present if columns is None else columns
        first = self._sequence
        if rate is None:
            self._publish_all(block, names)
        else:
            self._publish_in_time(block, names, rate)
        return self._sequence - first

    def _publish_all(self, block: SampleBlock, names: Sequence[str]) -> None:
        with self._session.info.declare_transport_events_listener() as events:
            for _, piece in self._pieces(block):
                self._put(self._sensors_key, self._next_payload(piece, names))
                if _link_was_lost(events):
                    break
            else:
                if self._has_receiver():
                    return
        raise LinkError(
            f"the link to the subscriber of {self._sensors_key} broke at message {self._sequence}: "
            "samples are lost; publish the flight again"
        )

    def _publish_in_time(self, block: SampleBlock, names: Sequence[str], rate: float) -> None:
        start_s = self._clock()
        for due_s, piece in self._pieces(block):
            self._pause_until(start_s + due_s / rate)
            self._sensors.put(self._next_payload(piece, names))

    def _encoded(self, aircraft: AircraftMessage) -> bytes:
        return encode_aircraft(aircraft.model_copy(update={"stream": self._stream}))

    def _next_payload(self, piece: SampleBlock, names: Sequence[str]) -> bytes:
        payload = encode_sensors(self._sequence, piece, PROTOBUF, names, self._stream)
        self._sequence += 1
        return payload

    def _begin(self, must_be_heard: bool, timeout_s: float) -> None:
        """Announces the vehicle once somebody subscribes; later looks only where somebody must."""
        if self._announced and not must_be_heard:
            return
        if not self.wait_for_receiver(timeout_s) and must_be_heard:
            raise LinkError(
                f"nobody subscribes to {self._sensors_key} within {timeout_s:g} s; start the service first"
            )
        if not self._announced:
            self._put_aircraft()

    def _pieces(self, block: SampleBlock) -> Iterator[tuple[float, SampleBlock]]:
        """Samples of each message, with the time after the first sample at which its last one is there."""
        with np.errstate(invalid="ignore", over="ignore"):
            steps = np.diff(block.time_s, prepend=block.time_s[:1])
        due_s = np.cumsum(np.clip(np.nan_to_num(steps, nan=0.0), 0.0, _LONGEST_PAUSE_S))
        for start in range(0, len(block), self._samples_per_message):
            rows = block.values[start : start + self._samples_per_message]
            yield float(due_s[start + len(rows) - 1]), SampleBlock(rows)

    def _pause_until(self, due_s: float) -> None:
        wait_s = due_s - self._clock()
        if wait_s > 0.0:
            self._sleep(wait_s)

    def _put(self, key: str, payload: bytes) -> None:
        """Hands a payload over for certain, waiting where the network is congested."""
        self._session.put(key, payload, encoding=PROTOBUF, congestion_control=zenoh.CongestionControl.BLOCK)

    def _put_aircraft(self) -> None:
        with self._lock:
            payload = self._aircraft_payload
        self._put(self._aircraft_key, payload)
        self._announced = True

    def _has_receiver(self) -> bool:
        status: Any = self._sensors.matching_status
        return bool(status.matching)

    def _answer(self, query: Any) -> None:
        with query:
            with self._lock:
                payload = self._aircraft_payload
            query.reply(self._aircraft_key, payload, encoding=PROTOBUF)


def _link_was_lost(events: Any) -> bool:
    """Whether a connection towards the receivers has closed: what was on its way is gone, silently."""
    while (event := events.try_recv()) is not None:
        if event.kind == zenoh.SampleKind.DELETE and event.transport.whatami != zenoh.WhatAmI.CLIENT:
            return True
    return False
