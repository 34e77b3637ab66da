"""The service: HTTP, database, Zenoh and the fleet's monitor wired together, started and ended in order."""

import logging
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from uuid import uuid4

import zenoh
from threadpoolctl import threadpool_limits

from wingwatch import __version__
from wingwatch.api import HttpServer, create_app, listen
from wingwatch.baselines import Database, DatabaseError, open_database
from wingwatch.cli.diagnosis_jobs import DiagnosisJobs
from wingwatch.cli.hangar import Hangar
from wingwatch.cli.kernel_steps import AT_FIRST_USE, LIVE
from wingwatch.cli.kernels import KernelCompiler, KernelError, Preparation
from wingwatch.cli.outputs import ZenohOutputs
from wingwatch.cli.settings import ServeSettings
from wingwatch.cli.store import DatabaseStore
from wingwatch.monitor import FleetMonitor, FleetSettings
from wingwatch.telemetry import SensorSubscriber, ZenohSettings, open_session

__all__ = ["Pump", "Service", "running_service"]

_LOG = logging.getLogger(__name__)
_GATHERED = 16  # messages; REST waits while so many are taken in
_TICK_S = 1.0
_IDLE_S = 0.2
_STOP_S = 1.0
_DATABASE_PATIENCE_S = 1.0
_LOADING = "The numerical kernels are being loaded."
_SWITCH_S = 0.0005  # each message that arrives waits so long for the interpreter while the pump is busy


class Pump:
    """The thread that brings messages from the subscriber to the monitor, once the kernels are there.

    Args:
        preparation: waited for first; messages that arrive meanwhile stay in the subscriber's queue.

    Attributes:
        faults: messages on which the monitor failed; that is a fault of the program, and the watch goes on.
    """

    def __init__(
        self,
        subscriber: SensorSubscriber,
        monitor: FleetMonitor,
        arrived: threading.Event,
        preparation: Preparation,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._subscriber = subscriber
        self._monitor = monitor
        self._arrived = arrived
        self._preparation = preparation
        self._clock = clock
        self._ending = False
        self._prepared = threading.Event()
        self._fault: str | None = None
        self._thread = threading.Thread(target=self._run, name="wingwatch-pump", daemon=True)
        self.faults = 0

    @property
    def problem(self) -> str | None:
        """None while messages are taken in, else why not."""
        if self._fault is not None:
            return self._fault
        if not self._prepared.is_set():
            view = self._preparation.view()
            return _LOADING if view is None else view.text
        return None if self._thread.is_alive() else "the loop that takes messages in has ended."

    @property
    def alive(self) -> bool:
        """Whether the thread still runs."""
        return self._thread.is_alive()

    def wait(self, timeout_s: float) -> bool:
        """Wait until messages are taken in; whether they are."""
        return self._prepared.wait(timeout_s)

    def start(self) -> None:
        """Begin; returns at once."""
        self._thread.start()

    def stop(self) -> None:
        """End after the messages in hand. Loading kernels cannot be interrupted and is left behind."""
        self._ending = True
        self._preparation.stop()
        self._arrived.set()
        self._thread.join(_STOP_S)

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
        self._prepared.set()
        next_tick_s = self._clock()
        while not self._ending:
            self._arrived.wait(_IDLE_S)
            self._arrived.clear()
            full = True
            while full and not self._ending:
                messages = self._subscriber.drain(_GATHERED)
                self._safely(self._monitor.receive_all, messages)
                next_tick_s = self._tick(next_tick_s)
                full = len(messages) == _GATHERED

    def _tick(self, due_s: float) -> float:
        now_s = self._clock()
        if now_s < due_s:
            return due_s
        self._safely(self._monitor.tick)
        return now_s + _TICK_S

    def _safely(self, action: Callable[..., None], *arguments: object) -> None:
        try:
            action(*arguments)
        except Exception:  # one vehicle's fault must not end the watch over the others
            self.faults += 1
            if self.faults <= 10:
                _LOG.exception("a message led to a fault of the program")


class Service:
    """What runs: its address, its monitor, and whether all of it works."""

    def __init__(
        self, http: HttpServer, monitor: FleetMonitor, database: Database, session: zenoh.Session, pump: Pump,
        store: DatabaseStore, settings: ZenohSettings, subscriber: SensorSubscriber,
        outputs: ZenohOutputs,
    ) -> None:  # fmt: skip
        self.monitor = monitor
        self.pump = pump
        self._http, self._database, self._session, self._store = http, database, session, store
        self._zenoh, self._subscriber, self._outputs = settings, subscriber, outputs

    @property
    def url(self) -> str:
        """Of the status page."""
        return self._http.url

    @property
    def port(self) -> int:
        """Of HTTP."""
        return self._http.port

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Of Zenoh: those listened on, or the routers connected to."""
        return self._zenoh.listen or self._zenoh.connect

    def readiness(self) -> Mapping[str, str | None]:
        """Per part None, or its problem in one sentence."""
        return {
            "zenoh": self._zenoh_problem(),
            "database": self._database_problem(),
            "http": self._http.problem,
            "estimators": self.pump.problem,
        }

    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """What each part dropped or failed on."""
        return {
            "messages": self._subscriber.counts,
            "monitor": self.monitor.problems,
            "loop": {"faults": self.pump.faults},
            "store": self._store.counts,
            "outputs": dict(self._outputs.dropped),
        }

    def _zenoh_problem(self) -> str | None:
        if self._session.is_closed():
            return "the Zenoh session is closed."
        if self._zenoh.mode == "client":
            info = self._session.info
            if not [*info.routers_zid(), *info.peers_zid()]:
                return f"the connection to {' '.join(self._zenoh.connect)} is lost; it is tried again."
        return None

    def _database_problem(self) -> str | None:
        try:
            self._database.check()
        except DatabaseError as error:
            return f"{error}."
        return None if self._store.problem is None else f"{self._store.problem}."


def _remove(database: Path) -> None:
    """An SQLite file and what belongs to it."""
    for suffix in ("", "-wal", "-shm"):
        Path(f"{database}{suffix}").unlink(missing_ok=True)


@contextmanager
def running_service(
    settings: ServeSettings,
    *,
    preparation: Preparation | None = None,
    wall_clock: Callable[[], float] = time.time,
    fresh: bool = False,
) -> Iterator[Service]:
    """Start a service and end it on the way out.

    The HTTP port is taken before anything else happens, and requests are answered while ``preparation`` goes on;
    messages that arrive meanwhile wait in the subscriber's queue.

    Args:
        preparation: done before messages are taken in; without, the kernels of the live path are loaded, and compiled
            where this machine has not done so yet.
        wall_clock: seconds since 1970-01-01 UTC, for the database's entries.
        fresh: remove the SQLite file of ``settings`` first, once the port is ours.

    Raises:
        AddressError, DatabaseError, LinkError, AircraftFileError, CommandError: one sentence each.
    """
    with ExitStack() as stack:
        listening = listen(settings.host, settings.port)
        stack.callback(listening.close)
        hangar = Hangar(settings.aircraft)
        if fresh:
            _remove(Path(settings.where))
        database = stack.enter_context(open_database(settings.where, busy_timeout_s=_DATABASE_PATIENCE_S))
        store = stack.enter_context(DatabaseStore(database, wall_clock))
        link = ZenohSettings.for_service(settings.listen, settings.connect)
        session = stack.enter_context(open_session(link))
        outputs = stack.enter_context(ZenohOutputs(session))
        stack.callback(sys.setswitchinterval, sys.getswitchinterval())
        sys.setswitchinterval(_SWITCH_S)
        # The matrices are small: a second thread only waits, spinning, on the core that the others need.
        stack.enter_context(threadpool_limits(1, "blas"))
        monitor = FleetMonitor(
            hangar.find,
            time.monotonic,
            lambda: uuid4().hex,
            store,
            outputs,
            FleetSettings(stale_s=settings.stale_s),
        )
        outputs.answer_from(monitor)
        arrived = threading.Event()
        subscriber = stack.enter_context(SensorSubscriber(session, time.monotonic, arrived.set))
        outputs.ask_through(subscriber.ask_aircraft)
        preparation = preparation or KernelCompiler(LIVE, AT_FIRST_USE)
        pump = Pump(subscriber, monitor, arrived, preparation)
        diagnoses = stack.enter_context(DiagnosisJobs(hangar.find))
        app = create_app(
            monitor,
            lambda: service.readiness(),
            database,
            __version__,
            aircraft=hangar.find,
            diagnoses=diagnoses,
            counters=lambda: service.counters(),
            kernels=preparation.view,
        )
        http = HttpServer(app, listening)
        service = Service(http, monitor, database, session, pump, store, link, subscriber, outputs)
        stack.callback(pump.stop)
        pump.start()
        stack.enter_context(http)
        yield service
