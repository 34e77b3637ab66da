"""The thread that brings messages from the subscriber to the monitor, and sees to what is due every second."""

import gc
import logging
import threading
import time
from collections.abc import Callable, Sequence

from wingwatch.monitor import FleetMonitor
from wingwatch.service.delays import DelayHistogram
from wingwatch.service.kernels import KernelError, Preparation
from wingwatch.service.load import LoadMeter
from wingwatch.service.loops import Loop
from wingwatch.telemetry import InboundMessage, SensorSubscriber

__all__ = ["IngestLoop"]

_LOG = logging.getLogger(__name__)
_GATHERED = 64  # messages; the more together, the less each costs, and REST waits while they are taken in
_TICK_S = 1.0
_IDLE_S = 0.2
_STOP_S = 1.0
_LOADING = "The numerical kernels are being loaded."


class IngestLoop:
    """The thread that brings messages from the subscriber to the monitor, once the kernels are there.

    Args:
        preparation: waited for first; messages that arrive meanwhile stay in the subscriber's queue.
        record: called with messages before the monitor is; it returns at once.

    Attributes:
        faults: messages on which the monitor failed; that is a fault of the program, and the watch goes on.
        delays: of messages, from their arrival until they were taken in.
        loop: does it.
    """

    def __init__(
        self,
        subscriber: SensorSubscriber,
        monitor: FleetMonitor,
        arrived: threading.Event,
        preparation: Preparation,
        clock: Callable[[], float] = time.monotonic,
        record: Callable[[Sequence[InboundMessage]], None] | None = None,
    ) -> None:
        self._record = record
        self._subscriber = subscriber
        self._monitor = monitor
        self._arrived = arrived
        self._preparation = preparation
        self._clock = clock
        self._ending = False
        self._prepared = threading.Event()
        self._fault: str | None = None
        self.loop = Loop("wingwatch-pump", "the loop that takes messages in", self._run, clock=clock)
        self.faults = 0
        self.delays = DelayHistogram()
        self._since_s: float | None = None
        self._meter = LoadMeter(clock)

    @property
    def load(self) -> float:
        """Part of the last ten seconds in which messages were taken in."""
        return self._meter.load

    @property
    def problem(self) -> str | None:
        """None while messages are taken in, else why not."""
        if self._fault is not None:
            return self._fault
        if not self._prepared.is_set():
            view = self._preparation.view()
            return _LOADING if view is None else view.text
        return self.loop.problem

    @property
    def in_hand_s(self) -> float:
        """How long the messages in hand have been in hand; 0 where there are none."""
        since_s = self._since_s
        return 0.0 if since_s is None else self._clock() - since_s

    def wait(self, timeout_s: float) -> bool:
        """Wait until messages are taken in; whether they are."""
        return self._prepared.wait(timeout_s)

    def start(self) -> None:
        """Begin; returns at once."""
        self.loop.start()

    def stop(self) -> None:
        """End after the messages in hand. Loading kernels cannot be interrupted and is left behind."""
        self._ending = True
        self._preparation.stop()
        self._arrived.set()
        self.loop.join(_STOP_S)

    def _run(self) -> None:
        try:
            if not self._preparation.prepare():
                return
        except KernelError as error:
            _LOG.error("%s", error)
            self._fault = f"{error}."
            return
        except Exception as error:
            _LOG.exception("the kernels cannot be loaded")
            self._fault = f"The numerical kernels cannot be loaded: {type(error).__name__}: {error}."
            return
        if not self._prepared.is_set():
            gc.collect()
            gc.freeze()  # what stays for good: to look through all of it stops every thread for a fifth of a second
        self._prepared.set()
        next_tick_s = self._clock()
        while not self._ending:
            self._arrived.wait(_IDLE_S)
            self._arrived.clear()
            self._meter.begin()
            full = True
            while full and not self._ending:
                messages = self._subscriber.drain(_GATHERED, self._monitor.full)
                self._since_s = self._clock()
                if self._record is not None:
                    self._record(messages)
                self._safely(self._monitor.receive_all, messages)
                self._since_s, now_s = None, self._clock()
                for message in messages:
                    self.delays.add(now_s - message.received_s)
                next_tick_s = self._tick(next_tick_s)
                full = len(messages) == _GATHERED or self._monitor.behind
            self._meter.end()

    def _tick(self, due_s: float) -> float:
        now_s = self._clock()
        if now_s < due_s:
            return due_s
        self._safely(self._monitor.relieve, self._subscriber.ages())
        self._safely(self._monitor.tick)
        return now_s + _TICK_S

    def _safely(self, action: Callable[..., None], *arguments: object) -> None:
        try:
            action(*arguments)
        except Exception:  # one vehicle's fault must not end the watch over the others
            self.faults += 1
            if self.faults <= 10:
                _LOG.exception("a message led to a fault of the program")
