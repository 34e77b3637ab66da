"""The application: every route, its errors as problem documents, and the status page."""

import secrets
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fastapi import FastAPI

from wingwatch.aircraft import Aircraft, library_names, load_aircraft
from wingwatch.api.access import Access, AccessGuard, AccessSettings
from wingwatch.api.alert_routes import alert_router
from wingwatch.api.baseline_routes import BASELINE_SIZE, baseline_router
from wingwatch.api.diagnosis_routes import FLIGHT_SIZE, diagnosis_router
from wingwatch.api.door import Door
from wingwatch.api.events import EventStreams
from wingwatch.api.fleet_routes import fleet_router
from wingwatch.api.guards import BodyLimit, SafetyHeaders
from wingwatch.api.help_files import help_router
from wingwatch.api.metrics import RequestCounts, metrics_router
from wingwatch.api.page_files import pages_router
from wingwatch.api.ports import (
    BaselinePort,
    DiagnosisPort,
    HistoryPort,
    KernelsView,
    ServiceFigures,
    StudyPort,
    WorkerView,
)
from wingwatch.api.problems import PROBLEM_RESPONSES, install_problem_handlers
from wingwatch.api.schemas import Problem
from wingwatch.api.service_routes import event_router, health_router, session_router
from wingwatch.api.study_routes import study_router
from wingwatch.api.vehicle_routes import vehicle_router
from wingwatch.monitor.views import MonitorPort

__all__ = ["AppSettings", "create_app"]

_STARTS, _START_STEP = 9_000_000, 10**9  # ids of two starts are apart, and stay below 2^53


def _library_aircraft(name: str) -> Aircraft:
    """Only the library: a name that came over the network must not open a file."""
    if name not in library_names():
        raise ValueError(f"aircraft {name!r} is not in the library, which has {', '.join(library_names())}")
    return load_aircraft(name)


@dataclass(frozen=True, slots=True)
class AppSettings:
    """What an application may have beside a monitor.

    Attributes:
        access: who may do what; everybody, unless given.
        aircraft: an aircraft by its announced name (ValueError with one sentence where there is none), for
            conventions other than concise; the library unless given.
        diagnoses: jobs that diagnose uploaded flights; None where none are taken.
        counters: of the service, by part, shown on the status.
        kernels: the compilation of the numerical kernels, shown on the status; None when there is none.
        database_problem: why entries wait for the database, shown on the status; it returns at once.
        problems: of each part of the service None or its problem, shown on the status; it returns at once.
        figures: the service in numbers, for ``/metrics``; it returns at once.
        keep_alive_s: silence after which an event stream carries a comment.
        baselines: the baseline database; None where there is none.
        documents: folder of the documents' site, served at ``/help``; None where there is none.
        studies: finished ones; None where none are shown.
        workers: processes that watch vehicles, by name; it returns at once.
        waits: whether the monitor's answers about one vehicle take time, as those of another process do.
    """

    access: AccessSettings = field(default_factory=AccessSettings)
    aircraft: Callable[[str], Aircraft] = _library_aircraft
    diagnoses: DiagnosisPort | None = None
    counters: Callable[[], Mapping[str, Mapping[str, int]]] = dict
    kernels: Callable[[], KernelsView | None] = lambda: None
    database_problem: Callable[[], str | None] = lambda: None
    problems: Callable[[], Mapping[str, str | None]] = dict
    figures: Callable[[], ServiceFigures] = ServiceFigures
    keep_alive_s: float = 10.0
    baselines: BaselinePort | None = None
    documents: Path | None = None
    studies: StudyPort | None = None
    workers: Callable[[], Sequence[WorkerView]] = tuple
    waits: bool = False


def create_app(
    monitor: MonitorPort,
    readiness: Callable[[], Mapping[str, str | None]],
    history: HistoryPort | None,
    version: str,
    settings: AppSettings | None = None,
) -> FastAPI:
    """The REST application over a monitor.

    Args:
        monitor: asked for everything that is shown.
        readiness: per part of the service None, or its problem in one sentence; asked at ``/health/ready``.
        history: past estimates; None where none are kept.
        version: the service's version, shown on the status.

    Returns:
        an application whose ``state.close_streams()`` ends every event stream; ``HttpServer`` calls it.
    """
    settings = settings or AppSettings()
    streams = EventStreams(monitor, settings.keep_alive_s, start=_START_STEP * secrets.randbelow(_STARTS))
    access = Access(settings.access)

    def counters() -> Mapping[str, Mapping[str, int]]:
        return {**settings.counters(), "access": dict(access.counts), "events": dict(streams.counts)}

    door = Door(
        monitor,
        readiness,
        history,
        version,
        settings.aircraft,
        streams,
        counters,
        settings.diagnoses,
        settings.kernels,
        settings.database_problem,
        settings.problems,
        settings.figures,
        settings.baselines,
        settings.studies,
        settings.workers,
        settings.waits,
    )
    app = FastAPI(
        title="wingwatch",
        version=version,
        description="Health of aircraft through their stability and control derivatives. SI and radians.",
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
    )
    app.state.close_streams = streams.close
    routers = (fleet_router, alert_router, event_router, diagnosis_router, baseline_router, study_router)
    versioned = tuple(router(door) for router in (*routers, vehicle_router))
    for router in (*versioned, session_router(access)):
        app.include_router(router, prefix="/v1", responses=PROBLEM_RESPONSES)
    app.include_router(health_router(door), responses=PROBLEM_RESPONSES)
    requests: dict[tuple[str, str], int] = {}
    app.include_router(metrics_router(door, requests), responses=PROBLEM_RESPONSES)
    app.include_router(pages_router())
    app.include_router(help_router(settings.documents))
    app.add_middleware(BodyLimit, larger={"/v1/diagnoses": FLIGHT_SIZE, "/v1/baselines/": BASELINE_SIZE})
    app.add_middleware(AccessGuard, access=access)
    install_problem_handlers(app)
    app.add_middleware(SafetyHeaders)
    app.add_middleware(RequestCounts, counts=requests)
    _describe(app)
    return app


def _describe(app: FastAPI) -> None:
    """Add to ``/openapi.json`` the problem document, which every operation refers to, and the token."""
    describe = app.openapi

    def openapi() -> dict[str, Any]:
        description = describe()
        schema = Problem.model_json_schema(mode="serialization", ref_template="#/components/schemas/{model}")
        schemas = description.setdefault("components", {}).setdefault("schemas", {})
        schemas.update(schema.pop("$defs", {}))
        schemas["Problem"] = schema
        description["components"]["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
        description["security"] = [{}, {"token": []}]
        return description

    app.openapi = openapi  # type: ignore[method-assign]
