"""Routes about finished studies: the list, and the report of one."""

from http import HTTPStatus
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import APIRouter, Path, Response
from pydantic import BaseModel, ConfigDict, Field

from wingwatch.api.door import Door
from wingwatch.api.encoding import json_answer
from wingwatch.api.guards import REPORT_POLICY
from wingwatch.api.ports import StudyPort
from wingwatch.api.problems import ProblemError, printable

__all__ = ["study_router"]

StudyName = Annotated[str, Path(min_length=1, max_length=100)]
_REPORT: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "One page that needs nothing beside it.",
        "content": {"text/html": {"schema": {"type": "string"}}},
    }
}


class StudyDocument(BaseModel):
    """One finished study."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(description="of its report's file, without .html")
    title: str
    answer: str = Field(description="what it found, as its report's heading says; may be empty")
    written_at_s: float = Field(description="seconds since 1970-01-01 UTC")
    bytes: int = Field(description="of the report")
    report: str = Field(description="path of the report")


class StudyList(BaseModel):
    """Finished studies, newest first."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    items: list[StudyDocument]
    next: None = None


def study_router(door: Door) -> APIRouter:
    """The routes ``/studies...``."""
    router = APIRouter(tags=["studies"])

    @router.get("/studies", response_model=StudyList, summary="Finished studies, newest first")
    def studies() -> Response:
        items = [
            StudyDocument(
                name=view.name,
                title=view.title,
                answer=view.answer,
                written_at_s=view.written_at_s,
                bytes=view.bytes,
                report=f"/v1/studies/{quote(view.name)}/report",
            )
            for view in _port(door).studies()
        ]
        return json_answer(StudyList(items=items))

    @router.get(
        "/studies/{name}/report", response_class=Response, responses=_REPORT, summary="A study's report"
    )
    def report(name: StudyName) -> Response:
        page = _port(door).report(name)
        if page is None:
            raise ProblemError(
                HTTPStatus.NOT_FOUND,
                f"There is no study {printable(name)}; /v1/studies lists those that there are.",
            )
        headers = {"Content-Security-Policy": REPORT_POLICY, "Cache-Control": "no-store"}
        return Response(page, media_type="text/html", headers=headers)

    return router


def _port(door: Door) -> StudyPort:
    if door.studies is None:
        raise ProblemError(
            HTTPStatus.NOT_FOUND,
            "This service shows no studies; start it with --studies and the folder of their reports.",
        )
    return door.studies
