"""The application: every route, its errors as problem documents, and the status page."""

from collections.abc import Callable, Mapping
from typing import Any

from fastapi import FastAPI

from wingwatch.aircraft import Aircraft, library_names, load_aircraft
from wingwatch.api.alert_routes import alert_router
from wingwatch.api.diagnosis_routes import LARGEST_FLIGHT_BYTES, diagnosis_router
from wingwatch.api.door import Door
from wingwatch.api.events import EventStreams
from wingwatch.api.fleet_routes import fleet_router
from wingwatch.api.guards import BodyLimit, SafetyHeaders
from wingwatch.api.page_files import pages_router
from wingwatch.api.ports import DiagnosisPort, HistoryPort, KernelsView
from wingwatch.api.problems import PROBLEM_RESPONSES, install_problem_handlers
from wingwatch.api.schemas import Problem
from wingwatch.api.service_routes import event_router, health_router
from wingwatch.monitor.views import MonitorPort

__all__ = ["create_app"]


def create_app(
    monitor: MonitorPort,
    readiness: Callable[[], Mapping[str, str | None]],
    history: HistoryPort | None,
    version: str,
    *,
    aircraft: Callable[[str], Aircraft] | None = None,
    diagnoses: DiagnosisPort | None = None,
    counters: Callable[[], Mapping[str, Mapping[str, int]]] = dict,
    kernels: Callable[[], KernelsView | None] = lambda: None,
    keep_alive_s: float = 10.0,
) -> FastAPI:
    """The REST application over a monitor.

    Args:
        monitor: asked for everything that is shown.
        readiness: per part of the service None, or its problem in one sentence; asked at ``/health/ready``.
        history: past estimates; None where none are kept.
        version: the service's version, shown on the status.
        aircraft: an aircraft by its announced name (ValueError with one sentence where there is none), for
            conventions other than concise; the library without.
        diagnoses: jobs that diagnose uploaded flights; None where none are taken.
        counters: of the service, by part, shown on the status.
        kernels: the compilation of the numerical kernels, shown on the status; None when there is none.
        keep_alive_s: silence after which an event stream carries a comment.

    Returns:
        an application whose ``state.close_streams()`` ends every event stream; ``HttpServer`` calls it.
    """
    streams = EventStreams(monitor, keep_alive_s)
    door = Door(
        monitor,
        readiness,
        history,
        version,
        aircraft or _library_aircraft,
        streams,
        counters,
        diagnoses,
        kernels,
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
    for router in (fleet_router(door), alert_router(door), event_router(door), diagnosis_router(door)):
        app.include_router(router, prefix="/v1", responses=PROBLEM_RESPONSES)
    app.include_router(health_router(door), responses=PROBLEM_RESPONSES)
    app.include_router(pages_router())
    app.add_middleware(BodyLimit, larger={"/v1/diagnoses": LARGEST_FLIGHT_BYTES})
    install_problem_handlers(app)
    app.add_middleware(SafetyHeaders)
    _describe_problems(app)
    return app


def _library_aircraft(name: str) -> Aircraft:
    """Only the library: a name that came over the network must not open a file."""
    if name not in library_names():
        raise ValueError(f"aircraft {name!r} is not in the library, which has {', '.join(library_names())}")
    return load_aircraft(name)


def _describe_problems(app: FastAPI) -> None:
    """Put the problem document among the schemas of ``/openapi.json``, which every operation refers to."""
    describe = app.openapi

    def openapi() -> dict[str, Any]:
        description = describe()
        schema = Problem.model_json_schema(mode="serialization", ref_template="#/components/schemas/{model}")
        schemas = description.setdefault("components", {}).setdefault("schemas", {})
        schemas.update(schema.pop("$defs", {}))
        schemas["Problem"] = schema
        return description

    app.openapi = openapi  # type: ignore[method-assign]
