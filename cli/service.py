"""The service: HTTP, database, Zenoh and the fleet's monitor wired together, started and ended in order."""

import logging
import os
import shutil
import socket
import ssl
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import zenoh
from threadpoolctl import threadpool_limits

from wingwatch import __version__
from wingwatch.api import (
    AccessSettings,
    AppSettings,
    HttpServer,
    beyond_loopback,
    create_app,
    listen,
    read_certificate,
)
from wingwatch.baselines import open_database
from wingwatch.cli.checkpoints import CheckpointFolder
from wingwatch.cli.database_probe import DatabaseProbe
from wingwatch.cli.diagnosis_jobs import DiagnosisJobs
from wingwatch.cli.hangar import Hangar
from wingwatch.cli.kernel_steps import AT_FIRST_USE, LIVE
from wingwatch.cli.kernels import KernelCompiler, KernelError, Preparation
from wingwatch.cli.link_settings import link_security
from wingwatch.cli.outputs import ZenohOutputs
from wingwatch.cli.patient import PatientHistory
from wingwatch.cli.settings import ServeSettings
from wingwatch.cli.store import DatabaseStore
from wingwatch.cli.tokens import TokenFile, TokenRegister
from wingwatch.monitor import FleetMonitor, FleetSettings
from wingwatch.telemetry import SensorSubscriber, ZenohSettings, open_session

__all__ = ["Parts", "Pump", "Service", "running_service"]

_LOG = logging.getLogger(__name__)
_GATHERED = 16  # messages; REST waits while so many are taken in
_TICK_S = 1.0
_IDLE_S = 0.2
_STOP_S = 1.0
_DATABASE_PATIENCE_S = 1.0
_MOST_QUEUED_S = 5.0
_MOST_BEHIND_S = 60.0
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


@dataclass(frozen=True, slots=True)
class Parts:
    """What a service consists of, each of them started and ended elsewhere."""

    http: HttpServer
    monitor: FleetMonitor
    probe: DatabaseProbe
    store: DatabaseStore
    checkpoints: CheckpointFolder
    session: zenoh.Session
    link: ZenohSettings
    subscriber: SensorSubscriber
    outputs: ZenohOutputs
    pump: Pump
    tokens: TokenRegister
    diagnoses: DiagnosisJobs


class Service:
    """What runs: its address, its monitor, and whether all of it works."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    @property
    def monitor(self) -> FleetMonitor:
        """Of the fleet."""
        return self._parts.monitor

    @property
    def pump(self) -> Pump:
        """What takes messages in."""
        return self._parts.pump

    @property
    def url(self) -> str:
        """Of the status page."""
        return self._parts.http.url

    @property
    def port(self) -> int:
        """Of HTTP."""
        return self._parts.http.port

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Of Zenoh: those listened on, or the routers connected to."""
        return self._parts.link.listen or self._parts.link.connect

    def readiness(self) -> Mapping[str, str | None]:
        """Per part None, or its problem in one sentence."""
        return {
            "zenoh": self._zenoh_problem(),
            "messages": self._messages_problem(),
            "database": self._database_problem(),
            "checkpoints": self._parts.checkpoints.problem,
            "http": self._parts.http.problem,
            "tokens": self._parts.tokens.problem,
            "estimators": self.pump.problem,
            "diagnoses": None if self._parts.diagnoses.alive else "the loop that runs diagnoses has ended.",
        }

    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """What each part dropped or failed on."""
        return {
            "messages": self._parts.subscriber.counts,
            "monitor": self.monitor.problems,
            "loop": {"faults": self.pump.faults},
            "store": self._parts.store.counts,
            "checkpoints": self._parts.checkpoints.counts,
            "outputs": dict(self._parts.outputs.dropped),
            "connections": self._parts.http.counts,
        }

    def _zenoh_problem(self) -> str | None:
        if self._parts.session.is_closed():
            return "the Zenoh session is closed."
        if not _connected(self._parts.session, self._parts.link):
            return f"the connection to {' '.join(self._parts.link.connect)} is lost; it is tried again."
        return None if self._parts.outputs.alive else "the loop that publishes has ended."

    def _messages_problem(self) -> str | None:
        waiting_s = self._parts.subscriber.waiting_s
        if waiting_s <= _MOST_QUEUED_S:
            return None
        return f"messages wait for {waiting_s:.0f} s before they are taken in; what is shown is as old."

    def _database_problem(self) -> str | None:
        store = self._parts.store
        if not store.alive:
            return "the loop that reads or writes the database has ended."
        if store.behind_s > _MOST_BEHIND_S:
            return f"entries have waited for {store.behind_s:.0f} s to be written."
        if (problem := self._parts.probe.problem()) is not None:
            return problem
        return None if store.problem is None else f"{store.problem}."


def _connected(session: zenoh.Session, link: ZenohSettings) -> bool:
    """Whether a client has its router."""
    info = session.info
    return link.mode != "client" or bool([*info.routers_zid(), *info.peers_zid()])


def _waiting_for(store: DatabaseStore) -> str | None:
    """Why entries wait for the database, without asking it."""
    if store.problem is not None:
        return f"{store.problem}."
    if store.behind_s <= _MOST_QUEUED_S:
        return None
    return f"the database has taken no entry for {store.behind_s:.0f} s."


def _remove_memory(settings: ServeSettings) -> None:
    """Remove the SQLite file with what belongs to it, and the checkpoints."""
    for suffix in ("", "-wal", "-shm"):
        Path(f"{settings.where}{suffix}").unlink(missing_ok=True)
    shutil.rmtree(settings.checkpoints, ignore_errors=True)


def _tls(settings: ServeSettings) -> ssl.SSLContext | None:
    """What TLS is offered with, where a certificate is set."""
    if settings.certificate is None or settings.private_key is None:
        return None
    return read_certificate(settings.certificate, settings.private_key)


def _resume(monitor: FleetMonitor, checkpoints: CheckpointFolder) -> None:
    """At the start: every vehicle goes on from its checkpoint; says how long that took."""
    began_s, spent_s = time.monotonic(), time.thread_time()
    monitor.resume()
    if resumed := checkpoints.counts["resumed"]:
        took = resumed, time.monotonic() - began_s, time.thread_time() - spent_s
        _LOG.info("%d vehicles resumed in %.3f s, of which %.3f s are processor time", *took)


def _save(monitor: FleetMonitor, checkpoints: CheckpointFolder) -> None:
    """At the end: what has changed since the last checkpoints."""
    for saved in monitor.unsaved():
        checkpoints.write(saved)


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
        fresh: remove the SQLite file of ``settings`` and the checkpoints first, once the port is ours.

    Raises:
        AddressError, CertificateError, DatabaseError, LinkError, LinkSecurityError, AircraftFileError,
            CommandError: one sentence each.
    """
    with ExitStack() as stack:
        listening = listen(settings.host, settings.port)
        stack.callback(listening.close)
        tokens = TokenRegister(TokenFile(settings.data))
        access = _access(settings, listening, tokens)
        tls = _tls(settings)
        hangar = Hangar(settings.aircraft)
        if fresh:
            _remove_memory(settings)
        database = stack.enter_context(open_database(settings.where, busy_timeout_s=_DATABASE_PATIENCE_S))
        store = stack.enter_context(DatabaseStore(database, wall_clock, settings.history.retention))
        checkpoints = stack.enter_context(CheckpointFolder(settings.checkpoints, wall_clock))
        security = link_security(settings.zenoh, os.environ)
        link = ZenohSettings.for_service(settings.listen, settings.connect, security)
        session = stack.enter_context(open_session(link))
        outputs = stack.enter_context(ZenohOutputs(session, lambda: _connected(session, link)))
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
            wall_clock,
            checkpoints,
        )
        _resume(monitor, checkpoints)
        stack.callback(_save, monitor, checkpoints)
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
            PatientHistory(database),
            __version__,
            AppSettings(
                access=access,
                aircraft=hangar.find,
                diagnoses=diagnoses,
                counters=lambda: service.counters(),
                kernels=preparation.view,
                database_problem=lambda: _waiting_for(store),
            ),
        )
        http = HttpServer(app, listening, tls=tls)
        parts = Parts(
            http=http, monitor=monitor, probe=DatabaseProbe(database.check), store=store, checkpoints=checkpoints,
            session=session, link=link, subscriber=subscriber, outputs=outputs, pump=pump, tokens=tokens,
            diagnoses=diagnoses,
        )  # fmt: skip
        service: Service = Service(parts)
        stack.callback(pump.stop)
        pump.start()
        stack.enter_context(http)
        yield service


def _access(settings: ServeSettings, listening: socket.socket, tokens: TokenRegister) -> AccessSettings:
    """Who may do what at the address that is listened on.

    Raises:
        CommandError: tokens are required there, and there is none.
    """
    others = beyond_loopback(listening)
    if others or settings.require_token:
        tokens.require_some()
    if others and settings.certificate is None:
        _LOG.warning(
            "listening on %s without TLS: tokens and answers can be read on the way; give --certificate and "
            "--private-key unless something in front of the service offers TLS",
            listening.getsockname()[0],
        )
    return AccessSettings(
        find=tokens.find,
        required=others or settings.require_token,
        names=(settings.host, *settings.name),
    )
