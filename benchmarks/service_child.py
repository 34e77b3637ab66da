"""The service as ``wingwatch serve`` runs it, in a process of its own that answers what only that process knows."""

import os
import resource
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any
from unittest import mock

from latency import timed_receive_all

from wingwatch.cli.serve_command import allow_open_files
from wingwatch.monitor import AlertState, AlertView, FleetMonitor
from wingwatch.service.service import running_service
from wingwatch.service.settings import ServeSettings

COMPILE_S, PATIENCE_S = 300.0, 90.0
ALERT = AlertView(
    id="", fleet="default", vehicle="healthy", kind="icing", cause="icing", level="warning", state=AlertState.ACTIVE,
    raised_s=1.0, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.97, basis="a-priori",
    text="Raised by the benchmark.", evidence=(),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Insight:
    """What the process knows of itself.

    Attributes:
        inside_s: of each message since the last question, from its arrival to the state that rests on it.
        threads: names of Python's threads that run.
        resident_bytes: memory that the process holds.
        counters: what each part of the service has dropped or failed on.
    """

    inside_s: list[float]
    threads: list[str]
    resident_bytes: int
    counters: dict[str, dict[str, int]]


class ServiceChild:
    """The other process.

    Attributes:
        port: of REST; pid: the process's id.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        found = connection.recv() if connection.poll(COMPILE_S + PATIENCE_S) else None
        if found is None:
            raise TimeoutError(f"the service was not ready within {COMPILE_S:g} s; run it again")
        self.port: int = found[0]
        self.pid: int = found[1]

    def raise_alert(self, name: str) -> None:
        """Have an alert of this id raised, as a vehicle's monitor raises one."""
        self._connection.send(name)

    def look(self) -> Insight:
        """What the process knows now.

        Raises:
            TimeoutError: it says nothing.
        """
        self._connection.send(None)
        if not self._connection.poll(PATIENCE_S):
            raise TimeoutError(f"the service said nothing for {PATIENCE_S:g} s")
        found: Insight = self._connection.recv()
        return found


@contextmanager
def own_process(settings: ServeSettings) -> Iterator[ServiceChild]:
    """The service until the ``with`` statement ends.

    Raises:
        TimeoutError: it is not ready in time.
    """
    with beside(_serve, settings) as connection:
        yield ServiceChild(connection)


@contextmanager
def beside(work: Callable[..., None], *arguments: Any) -> Iterator[Connection]:
    """A process that does some work and the connection to it, its last argument, at whose end it ends."""
    context = get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=work, args=(*arguments, there), daemon=True)
    process.start()
    there.close()
    try:
        yield here
    finally:
        here.close()
        process.join(PATIENCE_S)
        if process.is_alive():
            process.kill()
            process.join()


def _serve(settings: ServeSettings, asked: Connection) -> None:
    """The service: an id that is received is raised as an alert, None is answered."""
    inside_s: list[float] = []
    allow_open_files()
    with (
        mock.patch.object(FleetMonitor, "receive_all", timed_receive_all(inside_s)),
        running_service(settings) as service,
    ):
        asked.send((service.port, os.getpid()) if service.ingest.wait(COMPILE_S) else None)
        while True:
            try:
                wanted = asked.recv()
            except EOFError:
                return
            if wanted is not None:
                with service.monitor._lock:
                    service.monitor._alerts.keep(replace(ALERT, id=wanted))
                continue
            taken, inside_s[:] = list(inside_s), []
            counters = {part: dict(counts) for part, counts in service.counters().items()}
            asked.send(Insight(taken, _threads(), _resident_bytes(), counters))


def _threads() -> list[str]:
    return sorted(thread.name for thread in threading.enumerate())


def _resident_bytes() -> int:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize()
