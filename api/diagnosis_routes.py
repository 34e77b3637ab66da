"""Routes about diagnoses: upload a flight, follow the job, read its result and its report."""

import asyncio
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.responses import StreamingResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.concurrency import run_in_threadpool

from wingwatch.api.access import admission_of
from wingwatch.api.diagnosis_events import DiagnosisStreams
from wingwatch.api.door import Door
from wingwatch.api.encoding import JsonResponse, quantity
from wingwatch.api.guards import REPORT_POLICY, BodySize
from wingwatch.api.ports import DiagnosisPort, DiagnosisState, DiagnosisUpload, DiagnosisView, QueueFullError
from wingwatch.api.problems import ProblemError, printable

__all__ = ["FLIGHT_SIZE", "diagnosis_router"]

_LONGEST_UPLOAD_S = 300.0
FLIGHT_SIZE = BodySize(64 * 2**20, _LONGEST_UPLOAD_S + 10.0)
"""The upload's own limit comes first, with its own sentence."""

_LONGEST_MAP = 20_000

_FORM_TYPES = ("", "text/plain", "application/x-www-form-urlencoded", "multipart/form-data")
"""What a page of another site may send without asking: refused, so that none can have flights diagnosed here."""

DiagnosisId = Annotated[str, Path(min_length=1, max_length=64)]


class DiagnosisQuery(BaseModel):
    """What an uploaded flight is."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    aircraft: str = Field(
        min_length=1, max_length=63, description="name in the library or of a file given to the service"
    )
    map: str = Field(default="", max_length=_LONGEST_MAP, description="channel map (TOML)")
    file: str = Field(
        default="flight", min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$",
        description="what the report calls the flight",
    )  # fmt: skip


class DiagnosisDocument(BaseModel):
    """One diagnosis."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str
    state: DiagnosisState
    aircraft: str
    file: str
    ahead: int = Field(description="how many wait or run before it")
    doing: str = Field(description="what is being done")
    progress: float | None = Field(description="fraction done")
    problem: str = Field(description="why it failed; empty where it did not")
    report: str | None = Field(description="path of the HTML report, once done")
    result: dict[str, Any] | None = Field(
        description="the object of `wingwatch diagnose --json`, once done; null in the list"
    )


class DiagnosisList(BaseModel):
    """Diagnoses that are kept, newest first."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    items: list[DiagnosisDocument]
    next: None = None


_UPLOAD: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "description": "The flight file as it is: CSV, Parquet or MATLAB.",
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}
_REPORT: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "One page that needs nothing beside it.",
        "content": {"text/html": {"schema": {"type": "string"}}},
    }
}
_STREAM: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "An event `diagnosis` now and at each change, its data the diagnosis without its result.",
        "content": {"text/event-stream": {"schema": {"type": "string"}}},
    }
}


def diagnosis_router(door: Door) -> APIRouter:
    """The routes ``/diagnoses...``."""
    router = APIRouter(tags=["diagnoses"])
    _add_upload(router, door)
    _add_progress(router, door)

    @router.get(
        "/diagnoses", response_model=DiagnosisList, summary="Diagnoses, newest first, without their results"
    )
    def diagnoses() -> Response:
        items = [_document(view, with_result=False) for view in _port(door).diagnoses()]
        return JsonResponse(DiagnosisList(items=items), headers={"Cache-Control": "no-store"})

    @router.get("/diagnoses/{diagnosis_id}", response_model=DiagnosisDocument, summary="One diagnosis")
    def diagnosis(diagnosis_id: DiagnosisId) -> Response:
        return _answer(_find(_port(door), diagnosis_id))

    @router.get(
        "/diagnoses/{diagnosis_id}/report", response_class=Response, responses=_REPORT, summary="Its report"
    )
    def report(diagnosis_id: DiagnosisId) -> Response:
        return _report(_port(door), diagnosis_id)

    @router.delete(
        "/diagnoses/{diagnosis_id}", status_code=HTTPStatus.NO_CONTENT, response_class=Response,
        summary="Cancel a diagnosis that waits or runs; forget one that has ended",
    )  # fmt: skip
    def remove(diagnosis_id: DiagnosisId) -> Response:
        if not _port(door).remove(diagnosis_id):
            raise _unknown(diagnosis_id)
        return Response(status_code=HTTPStatus.NO_CONTENT)

    return router


def _add_upload(router: APIRouter, door: Door) -> None:
    @router.post(
        "/diagnoses", status_code=HTTPStatus.ACCEPTED, response_model=DiagnosisDocument, openapi_extra=_UPLOAD,
        summary="Upload a flight to be diagnosed",
    )  # fmt: skip
    async def submit(request: Request, query: Annotated[DiagnosisQuery, Query()]) -> Response:
        port = _port(door)
        await _refuse_forms(request)
        view = await _upload(request, port, query)
        return _answer(view, HTTPStatus.ACCEPTED, {"Location": f"/v1/diagnoses/{view.id}"})


def _add_progress(router: APIRouter, door: Door) -> None:
    streams = DiagnosisStreams(lambda: door.streams.closing)

    @router.get(
        "/diagnoses/{diagnosis_id}/events", response_class=StreamingResponse, responses=_STREAM,
        summary="How far it is, as server-sent events until it has ended",
    )  # fmt: skip
    async def progress(request: Request, diagnosis_id: DiagnosisId) -> Response:
        port, admission = _port(door), admission_of(request)
        await run_in_threadpool(_find, port, diagnosis_id)
        return StreamingResponse(
            streams.follow(
                lambda: _kept(port, diagnosis_id),
                lambda view: _document(view, with_result=False).model_dump(mode="json"),
                admission.holds,
            ),
            media_type="text/event-stream",
            headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
        )


def _port(door: Door) -> DiagnosisPort:
    if door.diagnoses is None:
        raise ProblemError(
            HTTPStatus.NOT_FOUND, "This service diagnoses no flights; use `wingwatch diagnose` instead."
        )
    return door.diagnoses


async def _refuse_forms(request: Request) -> None:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind in _FORM_TYPES:
        await _drain(request)
        raise ProblemError(
            HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
            f"The Content-Type {printable(kind)} is not taken; send the flight file as the body with "
            "Content-Type: application/octet-stream.",
        )


async def _upload(request: Request, port: DiagnosisPort, query: DiagnosisQuery) -> DiagnosisView:
    """Bring the body into the queue, in pieces."""
    try:
        upload = await run_in_threadpool(port.open, query.aircraft, query.map, query.file)
    except QueueFullError as error:
        await _drain(request)
        raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, f"{error}.") from error
    except ValueError as error:
        await _drain(request)
        sentence = "".join(c if c.isprintable() else "?" for c in " ".join(str(error).split()))
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY, f"{sentence[:1].upper()}{sentence[1:]}."
        ) from error
    try:
        async with asyncio.timeout(_LONGEST_UPLOAD_S):
            return await _receive(request, upload)
    except TimeoutError:
        raise ProblemError(
            HTTPStatus.REQUEST_TIMEOUT,
            f"The flight did not arrive within {_LONGEST_UPLOAD_S:.0f} s; send it again.",
        ) from None
    finally:
        await run_in_threadpool(upload.discard)


async def _receive(request: Request, upload: DiagnosisUpload) -> DiagnosisView:
    empty = True
    async for piece in request.stream():
        if piece:
            empty = False
            await run_in_threadpool(upload.write, piece)
    if empty:
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY, "The body is empty; send the flight file as the request's body."
        )
    return await run_in_threadpool(upload.submit)


async def _drain(request: Request) -> None:
    """Read what is sent: a connection closed over unread bytes is reset, and its client never sees the answer."""
    async with asyncio.timeout(_LONGEST_UPLOAD_S):
        async for _ in request.stream():
            pass


def _kept(port: DiagnosisPort, diagnosis_id: str) -> DiagnosisView | None:
    return next((view for view in port.diagnoses() if view.id == diagnosis_id), None)


def _find(port: DiagnosisPort, diagnosis_id: str) -> DiagnosisView:
    view = _kept(port, diagnosis_id)
    if view is None:
        raise _unknown(diagnosis_id)
    return view


def _report(port: DiagnosisPort, diagnosis_id: str) -> Response:
    view = _find(port, diagnosis_id)
    page = port.report(diagnosis_id)
    if page is None:
        raise ProblemError(
            HTTPStatus.CONFLICT,
            f"The diagnosis {printable(diagnosis_id)} is {view.state} and has no report; it has one once it is done.",
        )
    headers = {"Content-Security-Policy": REPORT_POLICY, "Cache-Control": "no-store"}
    return Response(page, media_type="text/html", headers=headers)


def _document(view: DiagnosisView, with_result: bool = True) -> DiagnosisDocument:
    done = view.state is DiagnosisState.DONE
    return DiagnosisDocument(
        id=view.id,
        state=view.state,
        aircraft=view.aircraft,
        file=view.file,
        ahead=view.ahead,
        doing=view.doing,
        progress=quantity(view.progress),
        problem=view.problem,
        report=f"/v1/diagnoses/{view.id}/report" if done else None,
        result=dict(view.result) if with_result and view.result is not None else None,
    )


def _answer(
    view: DiagnosisView, status: int = HTTPStatus.OK, headers: dict[str, str] | None = None
) -> Response:
    return JsonResponse(
        _document(view), status_code=status, headers={"Cache-Control": "no-store", **(headers or {})}
    )


def _unknown(diagnosis_id: str) -> ProblemError:
    return ProblemError(
        HTTPStatus.NOT_FOUND,
        f"There is no diagnosis {printable(diagnosis_id)}; /v1/diagnoses lists those that are kept.",
    )
