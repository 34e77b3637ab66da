"""Routes for pictures of one vehicle over time: flights, series, evidence of blocks, telemetry's health."""

import itertools
from collections.abc import Iterator
from functools import partial
from http import HTTPStatus
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Query, Response
from fastapi.responses import StreamingResponse
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from wingwatch.aircraft.structures import STRUCTURES
from wingwatch.api.door import Door
from wingwatch.api.encoding import json_answer
from wingwatch.api.history import CSV_MEDIA_TYPE, parse_names
from wingwatch.api.ports import HistoryPort
from wingwatch.api.problems import ProblemError
from wingwatch.api.record_schemas import (
    EvidenceSeriesDocument,
    FlightList,
    SeriesDocument,
    TelemetryDocument,
    evidence_document,
    flight_list,
    telemetry_document,
)
from wingwatch.api.schemas import Name
from wingwatch.api.series import csv_pieces, series_of
from wingwatch.baselines import HistoryWanted
from wingwatch.monitor.record_views import FlightRecordView

__all__ = ["vehicle_router"]

Array = NDArray[np.float64]

_CSV_FORM: dict[int | str, dict[str, Any]] = {
    200: {"description": "All of it.", "content": {CSV_MEDIA_TYPE: {"schema": {"type": "string"}}}}
}


class _Query(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    fleet: Name = "default"


class PartQuery(_Query):
    """Which part of a vehicle's history."""

    from_s: float | None = Field(default=None, alias="from", allow_inf_nan=False, description="s, inclusive")
    to_s: float | None = Field(default=None, alias="to", allow_inf_nan=False, description="s, inclusive")
    names: str | None = Field(
        default=None, max_length=500, description="comma-separated symbols; all without"
    )
    flight: int | None = Field(default=None, ge=0, le=2**53, description="the newest without")

    def wanted(self, flight: int | None) -> tuple[HistoryWanted, frozenset[str] | None]:
        """The same for the database, and the derivatives that are asked for.

        Raises:
            ProblemError: 422 for names that are none, and for a time that ends before it begins.
        """
        if self.from_s is not None and self.to_s is not None and self.from_s > self.to_s:
            raise ProblemError(
                HTTPStatus.UNPROCESSABLE_ENTITY,
                f"The query parameter from={self.from_s} lies after to={self.to_s}; exchange them.",
            )
        names = parse_names(self.names)
        structures = None
        if names is not None:
            structures = tuple(n for n, one in STRUCTURES.items() if names & set(one.derivatives))
        return HistoryWanted(self.from_s, self.to_s, flight, structures), names


class SeriesQuery(PartQuery):
    """The same, and how many points."""

    points: int = Field(default=400, ge=4, le=5000, description="of each series at most")


def vehicle_router(door: Door) -> APIRouter:
    """The routes ``/vehicles/{id}/...`` of pictures; those that read the database do it in a thread."""
    router = APIRouter(tags=["vehicles"])

    @router.get(
        "/vehicles/{vehicle}/flights",
        response_model=FlightList,
        summary="Flights of which estimates are kept",
    )
    def flights(vehicle: Name, query: Annotated[_Query, Query()]) -> Response:
        door.vehicle(query.fleet, vehicle)
        history = door.history
        return json_answer(flight_list(None if history is None else history.flights(query.fleet, vehicle)))

    @router.get(
        "/vehicles/{vehicle}/derivatives/series",
        response_model=SeriesDocument,
        summary="Derivatives over time beside what is expected, thinned",
    )
    def series(vehicle: Name, query: Annotated[SeriesQuery, Query()]) -> Response:
        return json_answer(_series(door, vehicle, query))

    @router.get(
        "/vehicles/{vehicle}/derivatives/history.csv",
        responses=_CSV_FORM,
        response_class=Response,
        summary="All derivatives over time as CSV, units in the columns' names",
    )
    def table(vehicle: Name, query: Annotated[PartQuery, Query()]) -> Response:
        return _table(door, vehicle, query)

    @router.get(
        "/vehicles/{vehicle}/evidence",
        response_model=EvidenceSeriesDocument,
        summary="Innovation and excitation of the last hour's blocks, and when alerts began",
    )
    def evidence(vehicle: Name, query: Annotated[_Query, Query()]) -> Response:
        record = _record(door, query.fleet, vehicle)
        owner = (query.fleet, vehicle)
        alerts = [alert for alert in door.monitor.alerts() if (alert.fleet, alert.vehicle) == owner]
        return json_answer(evidence_document(query.fleet, vehicle, record, alerts))

    @router.get(
        "/vehicles/{vehicle}/telemetry",
        response_model=TelemetryDocument,
        summary="How its messages arrive: rate, gaps, delay, rejected by channel",
    )
    def telemetry(vehicle: Name, query: Annotated[_Query, Query()]) -> Response:
        record = _record(door, query.fleet, vehicle)
        return json_answer(telemetry_document(door.vehicle(query.fleet, vehicle), record.link))

    return router


def _record(door: Door, fleet: str, vehicle: str) -> FlightRecordView:
    found = door.monitor.flight_record(fleet, vehicle)
    if found is None:
        door.vehicle(fleet, vehicle)
        raise ProblemError(HTTPStatus.NOT_FOUND, f"Nothing is kept of vehicle '{vehicle}' yet.")
    return found


def _history(door: Door, fleet: str, vehicle: str) -> HistoryPort:
    door.vehicle(fleet, vehicle)
    if door.history is None:
        raise ProblemError(
            HTTPStatus.NOT_FOUND, "This service keeps no history; start it with a data folder or a database."
        )
    return door.history


def _newest(history: HistoryPort, fleet: str, vehicle: str, query: PartQuery) -> int | None:
    """The flight that is asked for, the newest one without; None where there is none."""
    if query.flight is not None:
        return query.flight
    return next((one.id for one in history.flights(fleet, vehicle)), None)


def _series(door: Door, vehicle: str, query: SeriesQuery) -> SeriesDocument:
    history = _history(door, query.fleet, vehicle)
    flight = _newest(history, query.fleet, vehicle, query)
    wanted, names = query.wanted(flight)
    read = partial(history.history_columns, query.fleet, vehicle)
    expect = partial(door.monitor.expected, query.fleet, vehicle)
    found = [] if flight is None else series_of(read, expect, wanted, names, query.points)
    ends = [(one.time_s[0], one.time_s[-1]) for one in found]
    return SeriesDocument(
        fleet=query.fleet,
        vehicle=vehicle,
        flight=flight,
        from_s=min((first for first, _ in ends), default=None) if query.from_s is None else query.from_s,
        to_s=max((last for _, last in ends), default=None) if query.to_s is None else query.to_s,
        points=query.points,
        thinned=any(len(one.time_s) < one.kept for one in found),
        series=found,
    )


def _table(door: Door, vehicle: str, query: PartQuery) -> Response:
    """A fault of the database that shows in the first piece is answered as any other; later the answer breaks off."""
    history = _history(door, query.fleet, vehicle)
    flight = _newest(history, query.fleet, vehicle, query)
    wanted, names = query.wanted(flight)
    read = partial(history.history_columns, query.fleet, vehicle)
    expect = partial(door.monitor.expected, query.fleet, vehicle)
    pieces: Iterator[bytes] = csv_pieces(read, expect, wanted, names)
    first = list(itertools.islice(pieces, 2))
    return StreamingResponse(
        itertools.chain(first, pieces),
        media_type=f"{CSV_MEDIA_TYPE}; charset=utf-8",
        headers={
            "Cache-Control": "no-store",
            "Content-Disposition": f'attachment; filename="{query.fleet}-{vehicle}-flight-{flight or 0}.csv"',
        },
    )
