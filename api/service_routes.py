"""Routes about the service itself: the event stream, its health, and who asks."""

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Header, Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from wingwatch.api.access import COOKIE, Access, Caller, admission_of
from wingwatch.api.door import Door
from wingwatch.api.encoding import json_answer
from wingwatch.api.events import Listener
from wingwatch.api.problems import ProblemError
from wingwatch.api.schemas import Live, LogIn, Ready, SessionDocument
from wingwatch.monitor.views import Event

__all__ = ["event_router", "health_router", "session_router"]

_SESSION_S = 12 * 3600
_KINDS = ("alert", "status", "derivatives", "manoeuvre")

_STREAM: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "Server-sent events.",
        "content": {"text/event-stream": {"schema": {"type": "string"}}},
    }
}


def _kinds(text: str) -> str:
    if not set(text.split(",")) <= set(_KINDS):
        raise ValueError(f"should be some of {', '.join(_KINDS)}, with commas between them")
    return text


class EventQuery(BaseModel):
    """Which events, and after which one."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kinds: Annotated[str, AfterValidator(_kinds)] | None = Field(
        default=None, max_length=200, description="comma-separated kinds of events; all without"
    )
    derivatives_of: str | None = Field(
        default=None,
        pattern=r"^[a-z0-9][a-z0-9_-]{0,62}/[a-z0-9][a-z0-9_-]{0,62}$",
        description="`fleet/vehicle`: events `derivatives` of this vehicle only; of all without",
    )
    last_event_id: str | None = Field(
        default=None,
        max_length=100,
        description="as the header Last-Event-ID, which counts where both are given",
    )

    def wants(self, event: Event) -> bool:
        """Whether an event passes."""
        if self.kinds is not None and event.kind not in self.kinds.split(","):
            return False
        if self.derivatives_of is None or event.kind != "derivatives":
            return True
        return f"{event.data.get('fleet')}/{event.data.get('vehicle')}" == self.derivatives_of


def event_router(door: Door) -> APIRouter:
    """The route ``/events``."""
    router = APIRouter(tags=["events"])

    @router.get("/events", response_class=StreamingResponse, responses=_STREAM, summary="Server-sent events")
    async def events(
        request: Request,
        query: Annotated[EventQuery, Query()],
        last_event_id: Annotated[str | None, Header(max_length=100)] = None,
    ) -> Response:
        admission = admission_of(request)
        after = last_event_id if last_event_id is not None else query.last_event_id
        listener = Listener(admission.client, admission.holds)
        return StreamingResponse(
            door.streams.admit(after, listener, query.wants),
            media_type="text/event-stream",
            headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
        )

    return router


def health_router(door: Door) -> APIRouter:
    """The routes ``/health/live`` and ``/health/ready``."""
    router = APIRouter(prefix="/health", tags=["health"])

    @router.get("/live", response_model=Live, summary="The process answers")
    async def live() -> Response:
        return json_answer(Live(version=door.version))

    @router.get("/ready", response_model=Ready, summary="Zenoh, database and HTTP all work")
    def ready(request: Request) -> Response:
        checks = dict(door.readiness())
        problems = [f"{part}: {problem}" for part, problem in checks.items() if problem is not None]
        if problems and not admission_of(request).may_read:
            raise ProblemError(
                HTTPStatus.SERVICE_UNAVAILABLE, "The service is not ready; send a token to see the reason."
            )
        if problems:
            raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, " ".join(problems), checks)
        return json_answer(Ready(checks=checks))

    return router


def session_router(access: Access) -> APIRouter:
    """The route ``/session``: logging in on the status page, and out of it."""
    router = APIRouter(tags=["session"])

    def answer(caller: Caller | None) -> Response:
        name, scope = (None, None) if caller is None else (caller.name, str(caller.scope))
        return json_answer(SessionDocument(name=name, scope=scope, required=access.required))

    @router.get("/session", response_model=SessionDocument, summary="Who asks")
    async def session(request: Request) -> Response:
        return answer(admission_of(request).caller)

    @router.post("/session", response_model=SessionDocument, summary="Log in: the token becomes a cookie")
    async def log_in(request: Request, entry: LogIn) -> Response:
        address = request.client.host if request.client is not None else "unknown"
        answered = answer(access.identify(entry.token, address))
        answered.set_cookie(
            COOKIE, entry.token, max_age=_SESSION_S, httponly=True, samesite="strict",
            secure="https" in (request.scope["scheme"], request.headers.get("origin", "").partition("://")[0]),
        )  # fmt: skip
        return answered

    @router.delete("/session", response_model=SessionDocument, summary="Log out")
    async def log_out() -> Response:
        answered = answer(None)
        answered.delete_cookie(COOKIE, httponly=True, samesite="strict")
        return answered

    return router
