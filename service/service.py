"""The service: HTTP in front of a watch, in one process, started and ended in order."""

import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

from wingwatch import __version__
from wingwatch.api import AppSettings, HttpServer, ServiceFigures, create_app
from wingwatch.monitor import FleetMonitor
from wingwatch.operations.study_folder import StudyFolder
from wingwatch.service.aircraft_registry import AircraftRegistry
from wingwatch.service.doors import door_of, notifications_of
from wingwatch.service.health import Health, Parts
from wingwatch.service.ingest import IngestLoop
from wingwatch.service.kernels import Preparation
from wingwatch.service.notifications import NotifyingOutputs
from wingwatch.service.patient import PatientHistory
from wingwatch.service.patient_baselines import PatientBaselines
from wingwatch.service.settings import ServeSettings
from wingwatch.service.watch import WatchPlan, begin_watch, waiting_for

__all__ = ["Parts", "IngestLoop", "Service", "running_service"]


class Service:
    """What runs: its address, its monitor, and whether all of it works."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._health = Health(parts)

    @property
    def monitor(self) -> FleetMonitor:
        """Of the fleet."""
        return self._parts.watch.monitor

    @property
    def ingest(self) -> IngestLoop:
        """What takes messages in."""
        return self._parts.watch.ingest

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
        return self._parts.watch.link.listen or self._parts.watch.link.connect

    @property
    def waits_for(self) -> str | None:
        """Why no samples are taken in; None once they are."""
        return self.ingest.problem

    @property
    def starting(self) -> bool:
        """Whether samples are, or will be taken in."""
        return self.ingest.loop.alive

    def wait(self, timeout_s: float) -> bool:
        """Wait until samples are taken in; whether they are."""
        return self.ingest.wait(timeout_s)

    def readiness(self) -> Mapping[str, str | None]:
        """Per part None, or its problem in one sentence; the database is asked, for two seconds at most."""
        return self._health.readiness()

    def problems(self) -> Mapping[str, str | None]:
        """The same at once: the database is not asked."""
        return self._health.problems()

    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """What each part dropped or failed on."""
        return self._health.counters()

    def figures(self) -> ServiceFigures:
        """The service in numbers, beside its counters."""
        return self._health.figures()


def _remove_memory(settings: ServeSettings) -> None:
    """Remove the SQLite file with what belongs to it, and the checkpoints."""
    for suffix in ("", "-wal", "-shm"):
        Path(f"{settings.where}{suffix}").unlink(missing_ok=True)
    shutil.rmtree(settings.checkpoints, ignore_errors=True)


@contextmanager
def running_service(
    settings: ServeSettings,
    *,
    preparation: Preparation | None = None,
    wall_clock: Callable[[], float] = time.time,
    fresh: bool = False,
    refusals: Mapping[str, int] | None = None,
) -> Iterator[Service]:
    """Start a service and end it on the way out.

    The HTTP port is taken first. Requests are answered, and messages wait, while ``preparation`` goes on.

    Args:
        preparation: done before messages are taken in; without, the kernels of the live path are loaded, and compiled
            where this machine has not done so yet.
        wall_clock: seconds since 1970-01-01 UTC, for the database's entries.
        fresh: remove the SQLite file of ``settings`` and the checkpoints first, once the port is ours.
        refusals: counts of what access rules refuse, where they are kept and read (``noticed_refusals``).

    Raises:
        AddressError, CertificateError, DatabaseError, LinkError, LinkSecurityError, AircraftFileError,
            CommandError: one sentence each.
    """
    with ExitStack() as stack:
        listening, tokens, access, tls = door_of(stack, settings)
        registry = AircraftRegistry(settings.aircraft)
        if fresh:
            _remove_memory(settings)
        notifications = notifications_of(stack, settings, listening, wall_clock)
        plan = WatchPlan(preparation, wall_clock, lambda outputs: NotifyingOutputs(outputs, notifications))
        watch = begin_watch(stack, settings, registry, plan)
        asked = AppSettings(
            access=access, aircraft=registry.find, diagnoses=watch.diagnoses, kernels=watch.preparation.view,
            counters=lambda: service.counters(), figures=lambda: service.figures(),
            problems=lambda: service.problems(), database_problem=lambda: waiting_for(watch.store),
            baselines=PatientBaselines(watch.database, wall_clock), documents=settings.documents,
            studies=None if settings.studies is None else StudyFolder(settings.studies),
            workers=lambda: [watch.as_worker("inside", settings.capacity)],
        )  # fmt: skip
        history = PatientHistory(watch.database)
        app = create_app(watch.monitor, lambda: service.readiness(), history, __version__, asked)
        http = HttpServer(app, listening, tls=tls)
        service: Service = Service(Parts(http, watch, tokens, notifications, refusals or {}))
        notifications.begin(watch.monitor)
        stack.callback(watch.ingest.stop)
        watch.ingest.start()
        stack.enter_context(http)
        yield service
