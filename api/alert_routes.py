"""Routes about alerts: the list, one alert, and what a person does to it."""

import logging
from http import HTTPStatus
from typing import Annotated, Literal

from fastapi import APIRouter, Header, Path, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from wingwatch.api.access import Caller, admission_of
from wingwatch.api.door import Door
from wingwatch.api.encoding import json_answer
from wingwatch.api.groups import groups_of
from wingwatch.api.paging import decode_cursor, encode_cursor
from wingwatch.api.problems import ProblemError, printable
from wingwatch.api.schemas import (
    AlertDocument,
    AlertList,
    Name,
    PersonAction,
    alert_document,
    group_document,
)
from wingwatch.monitor.views import AlertAction, AlertState, AlertView, KeyReusedError
from wingwatch.telemetry import CHANNEL_NAMES

__all__ = ["alert_router"]

_LOG = logging.getLogger(__name__)

RequestKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        pattern=r"^[!-~]+$",
        description="the same when the request is repeated: it is then carried out once",
    ),
]
AlertId = Annotated[str, Path(min_length=1, max_length=200)]


def _column(name: str) -> str:
    if name not in CHANNEL_NAMES:
        raise ValueError("should be a column of the flight table such as 'pitch_rate_rad_s'")
    return name


ColumnName = Annotated[str, AfterValidator(_column), Field(json_schema_extra={"enum": list(CHANNEL_NAMES)})]
"""A column of the flight table."""


Cause = Annotated[str, Field(pattern=r"^[a-z][a-z_]{0,62}$")]


class AlertQuery(BaseModel):
    """Which alerts, and which page of them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    state: AlertState | None = None
    vehicle: Name | None = None
    fleet: Name | None = Field(default=None, description="only this fleet; all without")
    kind: Literal["icing", "damage", "sensor", "unexplained"] | None = None
    cause: Cause | None = Field(default=None, description="of the vocabulary of causes")
    level: Literal["watch", "warning", "critical"] | None = None
    channel: ColumnName | None = Field(default=None, description="only of this sensor, surface or throttle")
    since: float | None = Field(
        default=None, allow_inf_nan=False, description="raised at or after, s of the vehicle's own clock"
    )
    until: float | None = Field(
        default=None, allow_inf_nan=False, description="raised at or before, s of the vehicle's own clock"
    )
    limit: int = Field(default=100, ge=1, le=1000)
    cursor: str | None = Field(default=None, max_length=500, description="`next` of the page before")

    def wants(self, alert: AlertView) -> bool:
        """Whether an alert passes every filter."""
        return (
            self.state in (None, alert.state)
            and self.vehicle in (None, alert.vehicle)
            and self.fleet in (None, alert.fleet)
            and self.kind in (None, alert.kind)
            and self.cause in (None, alert.cause)
            and self.level in (None, alert.level)
            and self.channel in (None, alert.channel)
            and (self.since is None or alert.raised_s >= self.since)
            and (self.until is None or alert.raised_s <= self.until)
        )


def alert_router(door: Door) -> APIRouter:
    """The routes ``/alerts...``."""
    router = APIRouter(tags=["alerts"])

    @router.get("/alerts", response_model=AlertList, summary="Alerts, newest first")
    async def alerts(query: Annotated[AlertQuery, Query()]) -> Response:
        return json_answer(_page(door, query))

    @router.get("/alerts/{alert_id}", response_model=AlertDocument, summary="One alert")
    async def alert(alert_id: AlertId) -> Response:
        for view in door.monitor.alerts():
            if view.id == alert_id:
                return json_answer(alert_document(view, door.monitor.alert_groups()))
        raise _unknown(alert_id)

    for action in AlertAction:
        _add_action(router, door, action)
    return router


def _add_action(router: APIRouter, door: Door, action: AlertAction) -> None:
    def act(
        request: Request, alert_id: AlertId, person: PersonAction, idempotency_key: RequestKey = None
    ) -> Response:
        who = _signature(admission_of(request).caller, person)
        try:
            shelve_s = 60.0 * person.minutes
            view = door.monitor.act_on_alert(alert_id, action, who, person.note, idempotency_key, shelve_s)
        except KeyReusedError as error:
            raise ProblemError(HTTPStatus.UNPROCESSABLE_ENTITY, f"{error}.") from error
        except ValueError as error:
            raise ProblemError(HTTPStatus.CONFLICT, str(error)) from error
        if view is None:
            raise _unknown(alert_id)
        _LOG.info(
            "%s of alert %s by %s", action, view.id, who, extra={"vehicle": f"{view.fleet}/{view.vehicle}"}
        )
        return json_answer(alert_document(view))

    router.add_api_route(
        f"/alerts/{{alert_id}}/{action}",
        act,
        methods=["POST"],
        name=f"{action}_alert",
        response_model=AlertDocument,
        summary=f"{action.capitalize()} an alert",
    )


def _signature(caller: Caller | None, person: PersonAction) -> str:
    """Under which name an action is kept: the token's comes first, for it alone is known to be true."""
    if caller is None:
        if person.who is None:
            fault = {"type": "missing", "loc": ("body", "who"), "msg": "Field required", "input": None}
            raise RequestValidationError([fault])
        return person.who
    return caller.name if person.who in (None, caller.name) else f"{caller.name}, for {person.who}"


def _page(door: Door, query: AlertQuery) -> AlertList:
    """The cursor is a place in the whole list: a change of state between two pages skips no alert."""
    everything = list(door.monitor.alerts())
    start = 0
    if query.cursor is not None:
        (last,) = decode_cursor(query.cursor, (str,))
        start = 1 + next((i for i, alert in enumerate(everything) if alert.id == last), len(everything))
    wanted = [alert for alert in everything[start:] if query.wants(alert)]
    page = wanted[: query.limit]
    more = len(wanted) > query.limit
    groups = groups_of(door.monitor.alert_groups(), query.fleet)
    return AlertList(
        items=[alert_document(alert, groups) for alert in page],
        groups=[group_document(group) for group in groups],
        next=encode_cursor([page[-1].id]) if more else None,
    )


def _unknown(alert_id: str) -> ProblemError:
    return ProblemError(
        HTTPStatus.NOT_FOUND, f"There is no alert {printable(alert_id)}; /v1/alerts lists all."
    )
