"""Workers that one command starts as processes of their own, starts again where they die, and ends with itself.

A child reads its settings from its standard input, which stays open: it ends where that is closed, and so also where
this process is killed.
"""

import contextlib
import logging
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from threading import Event
from typing import Self

from wingwatch.service.loops import Loop
from wingwatch.service.notify_settings import NotifyTable
from wingwatch.service.settings import ServeSettings
from wingwatch.telemetry import ZenohSettings

__all__ = ["WorkerChildren", "child_settings"]

_LOG = logging.getLogger(__name__)
_COMMAND = (sys.executable, "-m", "wingwatch.service.workers.child")
_LOOK_S = 0.1
_END_S = 2.5
_SHOWN_S = 60.0
_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.5, 30.0
_GOOD_S = 10.0
"""A child that ran for so long is started again at once."""
_ANY = re.compile(r"^(?P<kind>[a-z]+)/(?P<host>0\.0\.0\.0|\[::\]):")


@dataclass(slots=True)
class _Child:
    """One place for a worker.

    Attributes:
        process: that runs; None while it waits for its turn.
        again_s: when it is started again; pause_s: how long it waits the next time.
    """

    number: int
    process: "subprocess.Popen[bytes] | None" = None
    began_s: float = 0.0
    again_s: float = 0.0
    pause_s: float = _FIRST_PAUSE_S
    said: str = ""
    ended_s: float = field(default=float("-inf"))


class WorkerChildren:
    """Keeps some workers running; use it in a ``with`` statement.

    Args:
        settings: of the command that starts them.
        link: of that command: what they connect to.
        count: how many.
        command: of one.
        clock: monotonic seconds.

    Attributes:
        restarts: how often a worker was started again.
        loop: looks after them.
    """

    def __init__(
        self,
        settings: ServeSettings,
        link: ZenohSettings,
        count: int,
        command: Sequence[str] = _COMMAND,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._settings, self._link, self._command, self._clock = settings, link, tuple(command), clock
        self._children = [_Child(number) for number in range(1, count + 1)]
        self._ending = Event()
        self.restarts = 0
        self.loop = Loop("wingwatch-children", "the loop that looks after workers", self._run)

    def __enter__(self) -> Self:
        self.loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Ask all to end, and kill those that have not within 2.5 s."""
        self._ending.set()
        self.loop.join(1.0)
        running = [child.process for child in self._children if child.process is not None]
        for process in running:
            _ask_to_end(process)
        until_s = self._clock() + _END_S
        for process in running:
            try:
                process.wait(max(0.0, until_s - self._clock()))
            except subprocess.TimeoutExpired:
                _LOG.warning("worker process %d has not ended within %g s and is killed", process.pid, _END_S)
                process.kill()
                process.wait()

    @property
    def pids(self) -> list[int]:
        """Of the processes that run."""
        return [child.process.pid for child in self._children if child.process is not None]

    @property
    def problem(self) -> str | None:
        """Which have ended within the last minute, in a sentence; None where none have."""
        now_s = self._clock()
        found = [child.said for child in self._children if now_s - child.ended_s <= _SHOWN_S]
        return " ".join(found) or self.loop.problem

    def _run(self) -> None:
        while not self._ending.is_set():
            for child in self._children:
                self._look(child)
            self._ending.wait(_LOOK_S)

    def _look(self, child: _Child) -> None:
        now_s = self._clock()
        if child.process is not None:
            code = child.process.poll()
            if code is None:
                return
            self._say_ended(child, child.process, code, now_s)
            child.process = None
        if now_s >= child.again_s and not self._ending.is_set():
            self.restarts += child.said != ""
            child.began_s, child.process = now_s, self._started(child.number)

    def _say_ended(self, child: _Child, process: "subprocess.Popen[bytes]", code: int, now_s: float) -> None:
        ran_s = now_s - child.began_s
        child.pause_s = _FIRST_PAUSE_S if ran_s >= _GOOD_S else min(2.0 * child.pause_s, _LONGEST_PAUSE_S)
        child.again_s = now_s if ran_s >= _GOOD_S else now_s + child.pause_s
        child.ended_s = now_s
        how = f"was ended by signal {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        child.said = f"worker process {process.pid} (number {child.number}) {how}; it is started again."
        _LOG.warning("%s", child.said.rstrip("."))
        with contextlib.suppress(OSError):
            if process.stdin is not None:
                process.stdin.close()

    def _started(self, number: int) -> "subprocess.Popen[bytes]":
        settings = child_settings(self._settings, self._link, number)
        # A session of its own: Ctrl-C is for whoever started it, which ends it in order.
        process = subprocess.Popen(
            self._command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True
        )
        assert process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            process.stdin.write(settings.model_dump_json().encode() + b"\n")
            process.stdin.flush()
        return process


def child_settings(settings: ServeSettings, link: ZenohSettings, number: int) -> ServeSettings:
    """What a worker of a command is given: it connects to that command, or to the same routers.

    Args:
        number: of the worker; its recordings have a folder by it.
    """
    connect = tuple(_reachable(endpoint) for endpoint in link.listen[:1]) or link.connect
    return settings.model_copy(
        update={
            "listen": (),
            "connect": connect,
            "notify": NotifyTable(),
            "workers": 1,
            "worker_name": f"w{number}",
            "record": None if settings.record is None else settings.record / f"worker-{number}",
            "data": settings.data.resolve(),
            "documents": None,
        }
    )


def _reachable(endpoint: str) -> str:
    """An endpoint that listens on every address, as it is reached from this machine."""
    found = _ANY.match(endpoint)
    if found is None:
        return endpoint
    host = "127.0.0.1" if found["host"] == "0.0.0.0" else "[::1]"
    return f"{found['kind']}/{host}:{endpoint[found.end() :]}"


def _ask_to_end(process: "subprocess.Popen[bytes]") -> None:
    with contextlib.suppress(OSError):
        os.kill(process.pid, signal.SIGTERM)
    with contextlib.suppress(OSError):
        if process.stdin is not None:
            process.stdin.close()
