"""Routes about the service itself: the event stream and its health."""

from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Header, Response
from fastapi.responses import StreamingResponse

from wingwatch.api.door import Door
from wingwatch.api.encoding import json_answer
from wingwatch.api.problems import ProblemError
from wingwatch.api.schemas import Live, Ready

__all__ = ["event_router", "health_router"]

_STREAM: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "Server-sent events.",
        "content": {"text/event-stream": {"schema": {"type": "string"}}},
    }
}


def event_router(door: Door) -> APIRouter:
    """The route ``/events``."""
    router = APIRouter(tags=["events"])

    @router.get("/events", response_class=StreamingResponse, responses=_STREAM, summary="Server-sent events")
    async def events(last_event_id: Annotated[str | None, Header(max_length=100)] = None) -> Response:
        return StreamingResponse(
            door.streams.admit(last_event_id),
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
    def ready() -> Response:
        checks = dict(door.readiness())
        problems = [f"{part}: {problem}" for part, problem in checks.items() if problem is not None]
        if problems:
            raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, " ".join(problems), checks)
        return json_answer(Ready(checks=checks))

    return router
