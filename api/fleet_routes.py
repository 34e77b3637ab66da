"""Routes about vehicles: the fleet's status, one vehicle, its derivatives and their history."""

from collections.abc import Sequence
from functools import partial
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Header, Query, Response
from pydantic import BaseModel, ConfigDict, Field

from wingwatch.aircraft import Convention
from wingwatch.api import history
from wingwatch.api.answers import json_answer
from wingwatch.api.conventions import convert_estimators
from wingwatch.api.door import Door
from wingwatch.api.fleet_rows import FleetDocument, fleet_row, state_counts
from wingwatch.api.groups import groups_of
from wingwatch.api.manoeuvre_schemas import ManoeuvreList, manoeuvre_document
from wingwatch.api.problems import ProblemError, printable
from wingwatch.api.schemas import (
    AlertDocument,
    DerivativesDocument,
    HistoryList,
    Name,
    StatusDocument,
    VehicleDocument,
    VehicleList,
    alert_document,
    group_document,
    kernels_document,
    status_document,
    vehicle_document,
)
from wingwatch.api.worker_schemas import WorkerList, worker_document
from wingwatch.baselines import HistoryWanted
from wingwatch.monitor.views import AlertGroupView, AlertState, ManoeuvreView, VehicleView

__all__ = ["fleet_router"]

_HISTORY_FORMS: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "JSON is paged, CSV and Parquet are whole.",
        "content": {
            history.CSV_MEDIA_TYPE: {"schema": {"type": "string"}},
            history.PARQUET_MEDIA_TYPE: {"schema": {"type": "string", "format": "binary"}},
        },
    }
}


class _Query(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class FleetQuery(_Query):
    """Which fleets."""

    fleet: Name | None = Field(default=None, description="only this fleet; all without")


class VehicleQuery(_Query):
    """Which fleet the path's vehicle belongs to."""

    fleet: Name = "default"


class DerivativesQuery(VehicleQuery):
    """Which estimator and convention."""

    estimator: str | None = Field(default=None, max_length=63, description="only this estimator; all without")
    convention: Convention = Convention.CONCISE


class HistoryQuery(VehicleQuery):
    """Which part of the history."""

    from_s: float | None = Field(default=None, alias="from", allow_inf_nan=False, description="s, inclusive")
    to_s: float | None = Field(default=None, alias="to", allow_inf_nan=False, description="s, inclusive")
    names: str | None = Field(
        default=None, max_length=500, description="comma-separated symbols; all without"
    )
    flight: int | None = Field(default=None, ge=0, le=2**53, description="only this flight; all without")
    limit: int = Field(default=1000, ge=1, le=10_000, description="items a JSON page")
    cursor: str | None = Field(default=None, max_length=500, description="`next` of the page before")


def fleet_router(door: Door) -> APIRouter:
    """The routes ``/status``, ``/fleet`` and ``/vehicles...``.

    Whatever is about all vehicles is made in a thread: it takes longer than a question about one should wait.
    """
    router = APIRouter(tags=["vehicles"])

    @router.get("/status", response_model=StatusDocument, summary="The fleet at a glance, worst first")
    def status(query: Annotated[FleetQuery, Query()]) -> Response:
        return json_answer(_status(door, query.fleet))

    @router.get("/fleet", response_model=FleetDocument, summary="The fleet in short rows, worst first")
    def fleet(query: Annotated[FleetQuery, Query()]) -> Response:
        return json_answer(_fleet(door, query.fleet))

    @router.get("/fleet/workers", response_model=WorkerList, summary="Processes that watch vehicles")
    async def workers() -> Response:
        return json_answer(WorkerList(items=[worker_document(view) for view in door.workers()]))

    @router.get("/vehicles", response_model=VehicleList, summary="All vehicles, worst first")
    def vehicles(query: Annotated[FleetQuery, Query()]) -> Response:
        return json_answer(VehicleList(items=[vehicle_document(v) for v in _vehicles(door, query.fleet)]))

    @router.get("/vehicles/{vehicle}", response_model=VehicleDocument, summary="One vehicle")
    async def vehicle(vehicle: Name, query: Annotated[VehicleQuery, Query()]) -> Response:
        return json_answer(vehicle_document(await door.asked(lambda: door.vehicle(query.fleet, vehicle))))

    @router.get(
        "/vehicles/{vehicle}/derivatives", response_model=DerivativesDocument, summary="Current derivatives"
    )
    async def derivatives(vehicle: Name, query: Annotated[DerivativesQuery, Query()]) -> Response:
        return json_answer(await door.asked(lambda: _derivatives(door, vehicle, query)))

    @router.get(
        "/vehicles/{vehicle}/manoeuvres", response_model=ManoeuvreList, summary="Its last ten manoeuvres"
    )
    async def manoeuvres(vehicle: Name, query: Annotated[VehicleQuery, Query()]) -> Response:
        found = await door.asked(lambda: _manoeuvres(door, query.fleet, vehicle))
        return json_answer(ManoeuvreList(items=[manoeuvre_document(view) for view in found]))

    @router.get(
        "/vehicles/{vehicle}/derivatives/history",
        response_model=HistoryList,
        responses=_HISTORY_FORMS,
        summary="Past derivatives",
    )
    def past(
        vehicle: Name,
        query: Annotated[HistoryQuery, Query()],
        accept: Annotated[str | None, Header(max_length=1000)] = None,
    ) -> Response:
        return _history(door, vehicle, query, accept)

    return router


def _manoeuvres(door: Door, fleet: str, vehicle: str) -> Sequence[ManoeuvreView]:
    found = door.monitor.manoeuvres(fleet, vehicle)
    if found is None:
        door.vehicle(fleet, vehicle)
    return found or ()


def _vehicles(door: Door, fleet: str | None) -> list[VehicleView]:
    return [view for view in door.monitor.vehicles() if fleet is None or view.fleet == fleet]


def _status(door: Door, fleet: str | None) -> StatusDocument:
    vehicles = [vehicle_document(view) for view in _vehicles(door, fleet)]
    groups = groups_of(door.monitor.alert_groups(), fleet)
    return status_document(
        door.version,
        vehicles,
        _alerts(door, fleet, groups),
        door.counters(),
        door.kernels(),
        door.database_problem(),
        _problems(door),
        groups,
    )


def _fleet(door: Door, fleet: str | None) -> FleetDocument:
    vehicles, kernels = _vehicles(door, fleet), door.kernels()
    groups = groups_of(door.monitor.alert_groups(), fleet)
    return FleetDocument(
        version=door.version,
        counts=dict(state_counts(vehicles)),
        vehicles=[fleet_row(view) for view in vehicles],
        alerts=_alerts(door, fleet, groups),
        groups=[group_document(group) for group in groups],
        kernels=None if kernels is None else kernels_document(kernels),
        database=door.database_problem(),
        problems=_problems(door),
    )


def _alerts(door: Door, fleet: str | None, groups: Sequence[AlertGroupView]) -> list[AlertDocument]:
    """Those in force, newest first."""
    return [
        alert_document(view, groups)
        for view in door.monitor.alerts()
        if view.state != AlertState.CLEARED and (fleet is None or view.fleet == fleet)
    ]


def _problems(door: Door) -> dict[str, str]:
    """Of the parts of the service that do not work."""
    return {part: problem for part, problem in door.problems().items() if problem is not None}


def _derivatives(door: Door, vehicle: str, query: DerivativesQuery) -> DerivativesDocument:
    current = door.monitor.derivatives(query.fleet, vehicle)
    if current is None:
        door.vehicle(query.fleet, vehicle)
        current = {"time_s": None, "estimators": {}}
    estimators: dict[str, Any] = dict(current["estimators"])
    if query.estimator is not None:
        if query.estimator not in estimators:
            known = ", ".join(estimators) or "none yet"
            raise ProblemError(
                HTTPStatus.UNPROCESSABLE_ENTITY,
                f"The query parameter estimator {printable(query.estimator)} is unknown; "
                f"this vehicle has: {known}.",
            )
        estimators = {query.estimator: estimators[query.estimator]}
    if query.convention is not Convention.CONCISE:
        view = door.vehicle(query.fleet, vehicle)
        estimators = convert_estimators(estimators, view, query.convention, door.aircraft)
    owner = {"fleet": query.fleet, "vehicle": vehicle, "convention": str(query.convention)}
    return DerivativesDocument.model_validate({**current, **owner, "estimators": estimators})


def _history(door: Door, vehicle: str, query: HistoryQuery, accept: str | None) -> Response:
    media_type = history.negotiate(accept)
    names = history.parse_names(query.names)
    if query.from_s is not None and query.to_s is not None and query.from_s > query.to_s:
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY,
            f"The query parameter from={query.from_s} lies after to={query.to_s}; exchange them.",
        )
    door.vehicle(query.fleet, vehicle)
    if door.history is None:
        raise ProblemError(
            HTTPStatus.NOT_FOUND, "This service keeps no history; start it with a data folder or a database."
        )
    read = partial(door.history.history_rows, query.fleet, vehicle)
    wanted = HistoryWanted(query.from_s, query.to_s, query.flight)
    return history.answer_history(read, wanted, names, media_type, query.limit, query.cursor)
