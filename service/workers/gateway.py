"""A gateway: REST, page, event stream, metrics and notifications for vehicles that workers watch.

It holds no estimator and loads no kernel. Several may run beside each other; one alone is given ``[notify]``.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import zenoh

from wingwatch import __version__
from wingwatch.api import AppSettings, HttpServer, ServiceFigures, create_app
from wingwatch.baselines import open_database
from wingwatch.monitor import AlertView
from wingwatch.operations.study_folder import StudyFolder
from wingwatch.service.aircraft_registry import AircraftRegistry
from wingwatch.service.database_probe import DatabaseProbe
from wingwatch.service.diagnosis_jobs import DiagnosisJobs
from wingwatch.service.doors import door_of, notifications_of
from wingwatch.service.notifications import Notifications
from wingwatch.service.patient import PatientHistory, PatientReader
from wingwatch.service.patient_baselines import PatientBaselines
from wingwatch.service.settings import ServeSettings
from wingwatch.service.stored_alerts import kept_alerts
from wingwatch.service.watch import DATABASE_PATIENCE_S, link_of
from wingwatch.service.workers.children import WorkerChildren
from wingwatch.service.workers.gateway_health import GatewayHealth, GatewayParts
from wingwatch.service.workers.gateway_parts import JoinedDiagnoses, kernels_of, worker_views
from wingwatch.service.workers.link import WorkerLink
from wingwatch.service.workers.live import LiveWorkers
from wingwatch.service.workers.remote_fleet import RemoteFleet
from wingwatch.service.workers.shares import Shares, Worker
from wingwatch.telemetry import ZenohSettings, open_session

__all__ = ["Gateway", "running_gateway"]

_LOOK_S = 0.2


class Gateway:
    """What runs: its address, the fleet as it sees it, and whether all of it works."""

    def __init__(self, parts: GatewayParts) -> None:
        self._parts = parts
        self._health = GatewayHealth(parts)

    @property
    def fleet(self) -> RemoteFleet:
        """As its workers show it."""
        return self._parts.fleet

    @property
    def children(self) -> WorkerChildren | None:
        """Workers that it has started; None where others do."""
        return self._parts.children

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

    @property
    def waits_for(self) -> str | None:
        """Why no samples are taken in yet; None once a worker takes them in."""
        return self._health.waits_for()

    @property
    def starting(self) -> bool:
        """A worker may always come."""
        return True

    def wait(self, timeout_s: float) -> bool:
        """Wait until a worker takes samples in; whether one does."""
        until_s = time.monotonic() + timeout_s
        while (waiting := self.waits_for) and time.monotonic() < until_s:
            time.sleep(min(_LOOK_S, timeout_s))
        return waiting is None

    def readiness(self) -> Mapping[str, str | None]:
        """Per part None, or its problem in one sentence; the database is asked, for two seconds at most."""
        return self._health.readiness()

    def problems(self) -> Mapping[str, str | None]:
        """The same at once, with the workers' own: the database is not asked."""
        return self._health.problems()

    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """What each part, here and in the workers, dropped or failed on."""
        return self._health.counters()

    def figures(self) -> ServiceFigures:
        """The service in numbers, beside its counters."""
        return self._health.figures()


@dataclass(frozen=True, slots=True)
class _Seen:
    """The fleet over a link."""

    session: zenoh.Session
    link: ZenohSettings
    fleet: RemoteFleet


@contextmanager
def running_gateway(
    settings: ServeSettings,
    *,
    workers: int = 0,
    wall_clock: Callable[[], float] = time.time,
    refusals: Mapping[str, int] | None = None,
) -> Iterator[Gateway]:
    """Start a gateway and end it on the way out.

    Args:
        workers: how many it starts itself, as processes that end with it.
        wall_clock: seconds since 1970-01-01 UTC.
        refusals: counts of what access rules refuse, where they are kept and read.

    Raises:
        AddressError, CertificateError, DatabaseError, LinkError, LinkSecurityError, AircraftFileError,
            CommandError: one sentence each.
    """
    with ExitStack() as stack:
        listening, tokens, access, tls = door_of(stack, settings)
        registry = AircraftRegistry(settings.aircraft)
        notifications = notifications_of(stack, settings, listening, wall_clock)
        database = stack.enter_context(open_database(settings.where, busy_timeout_s=DATABASE_PATIENCE_S))
        reader = PatientReader()
        seen = _seen(stack, settings, lambda: reader.ask(lambda: kept_alerts(database)), notifications)
        children = stack.enter_context(WorkerChildren(settings, seen.link, workers)) if workers else None
        jobs = stack.enter_context(DiagnosisJobs(registry.find))
        fleet = seen.fleet
        asked = AppSettings(
            access=access, aircraft=registry.find, diagnoses=JoinedDiagnoses(jobs, fleet),
            kernels=lambda: kernels_of(fleet.states()), counters=lambda: gateway.counters(),
            figures=lambda: gateway.figures(), problems=lambda: gateway.problems(),
            database_problem=lambda: fleet.read_problem, baselines=PatientBaselines(database, wall_clock),
            documents=settings.documents,
            studies=None if settings.studies is None else StudyFolder(settings.studies),
            workers=lambda: worker_views(fleet.states()), waits=True,
        )  # fmt: skip
        app = create_app(fleet, lambda: gateway.readiness(), PatientHistory(database), __version__, asked)
        http = HttpServer(app, listening, tls=tls)
        gateway: Gateway = Gateway(
            GatewayParts(
                http=http, session=seen.session, link=seen.link, fleet=fleet, probe=DatabaseProbe(database.check),
                tokens=tokens, notifications=notifications, diagnoses=jobs, children=children,
                refusals=refusals or {},
            )
        )  # fmt: skip
        notifications.begin(fleet)
        stack.enter_context(http)
        yield gateway


def _seen(
    stack: ExitStack,
    settings: ServeSettings,
    read_alerts: Callable[[], list[AlertView]],
    notifications: Notifications,
) -> _Seen:
    """The fleet, asked for over a link of our own."""
    link = link_of(settings)
    session = stack.enter_context(open_session(link))

    def heard(alert: AlertView) -> None:
        notifications.hear(lambda: alert)

    live: LiveWorkers

    def first(names: Sequence[str], of_fleet: str, vehicle: str) -> str:
        """Whoever of some workers would watch a vehicle that none watches."""
        capacities, states = live.capacities, fleet.states()
        there = {name: states[name][0] for name in names if name in states}
        loads = {name: 0.0 if state is None else state.view.load for name, state in there.items()}
        able = {n: Worker(n, capacities[n], loads[n]) for n in loads if capacities.get(n, 0.0) > 0.0}
        return Shares().target((of_fleet, vehicle), "", able) or names[0]

    fleet = RemoteFleet(WorkerLink(session), lambda: live.names, read_alerts, heard, first)
    live = stack.enter_context(LiveWorkers(session, fleet.look_again))
    stack.enter_context(fleet)
    return _Seen(session, link, fleet)
