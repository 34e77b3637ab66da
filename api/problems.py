"""Errors as problem documents (RFC 9457): one sentence that says what, which value, what to do."""

import logging
import re
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any
from urllib.parse import quote

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wingwatch.api.answers import JsonResponse
from wingwatch.api.ports import WorkerSilentError
from wingwatch.api.schemas import FieldProblem, Problem
from wingwatch.baselines import DatabaseError

__all__ = [
    "PROBLEM_MEDIA_TYPE",
    "PROBLEM_RESPONSES",
    "FaultGuard",
    "ProblemError",
    "install_problem_handlers",
    "printable",
    "problem_answer",
]

PROBLEM_MEDIA_TYPE = "application/problem+json"

_LONGEST_ECHO = 80
_FAULT = "The service met a fault of its own while answering; its log says which, and trying again may help."
_LOG = logging.getLogger(__name__)

_CONTENT = {PROBLEM_MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
PROBLEM_RESPONSES: dict[int | str, dict[str, Any]] = {
    "4XX": {"description": "The request cannot be answered; `detail` says why.", "content": _CONTENT},
    "5XX": {"description": "The service cannot answer now; `detail` says why.", "content": _CONTENT},
}
"""What every operation's description says about errors."""


class ProblemError(Exception):
    """A request that is refused.

    Attributes:
        status: HTTP status code.
        detail: one sentence for the caller.
        checks: per part of the service its problem or None, where the problem is about readiness.
        headers: of the answer, beside the usual ones.
    """

    def __init__(
        self,
        status: int,
        detail: str,
        checks: Mapping[str, str | None] | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.checks = checks
        self.headers = headers


class FaultGuard:
    """ASGI wrapper: a fault of our own is logged and answered as a problem, and the connection lives on."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer through the wrapped application."""
        started = False

        async def send_noting(message: Message) -> None:
            nonlocal started
            started = True
            await send(message)

        try:
            await self._app(scope, receive, send_noting)
        except Exception:
            if started or scope["type"] != "http":
                raise
            request = Request(scope)
            _LOG.exception("fault while answering %s %s", request.method, printable(request.url.path))
            problem = _problem(HTTPStatus.INTERNAL_SERVER_ERROR, _FAULT)
            await _document(request, problem)(scope, receive, send)


def printable(value: object) -> str:
    """A caller's value as it may be echoed: quoted, without control characters, at most 80 characters."""
    text = (
        ascii(value) if isinstance(value, str) else repr(value).encode("ascii", "backslashreplace").decode()
    )
    return text if len(text) <= _LONGEST_ECHO else text[: _LONGEST_ECHO - 3] + "..."


def install_problem_handlers(app: FastAPI) -> None:
    """Make every error of the application a problem document, its own faults included."""
    app.add_exception_handler(ProblemError, _refused)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(DatabaseError, _unavailable)
    app.add_exception_handler(WorkerSilentError, _unavailable)
    app.add_middleware(FaultGuard)


def _document(request: Request, problem: Problem, headers: Mapping[str, str] | None = None) -> Response:
    document = problem.model_copy(update={"instance": quote(request.url.path, safe="/:@-._~")})
    return JsonResponse(
        {key: value for key, value in document.model_dump().items() if value is not None},
        status_code=problem.status,
        headers={"Cache-Control": "no-store", **(headers or {})},
        media_type=PROBLEM_MEDIA_TYPE,
    )


def _problem(status: int, detail: str) -> Problem:
    return Problem(title=HTTPStatus(status).phrase, status=status, detail=detail)


def problem_answer(request: Request, error: ProblemError) -> Response:
    """The answer to a request that is refused."""
    problem = _problem(error.status, error.detail)
    if error.checks is not None:
        problem = problem.model_copy(update={"checks": dict(error.checks)})
    return _document(request, problem, error.headers)


async def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, ProblemError)
    return problem_answer(request, error)


async def _invalid(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    fields = [_field(e) for e in error.errors()]
    first = fields[0].message
    more = f" (and {len(fields) - 1} more, see `errors`)" if len(fields) > 1 else ""
    problem = _problem(HTTPStatus.UNPROCESSABLE_ENTITY, f"{first[:1].upper()}{first[1:]}{more}.")
    return _document(request, problem.model_copy(update={"errors": fields}))


async def _unavailable(request: Request, error: Exception) -> Response:
    text = str(error).rstrip(".")
    sentence = f"{text[:1].upper()}{text[1:]}." if isinstance(error, WorkerSilentError) else f"{text}."
    return _document(request, _problem(HTTPStatus.SERVICE_UNAVAILABLE, sentence))


async def _http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    path = printable(request.url.path)
    headers = dict(error.headers or {})
    allowed = headers.get("Allow", "GET")
    if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        allowed = headers["Allow"] = _offered(request) or allowed
    details = {
        HTTPStatus.NOT_FOUND: f"Nothing is served at {path}; /openapi.json lists every path.",
        HTTPStatus.METHOD_NOT_ALLOWED: (
            f"{printable(request.method)} is not offered at {path}; use {allowed}."
        ),
        HTTPStatus.REQUEST_ENTITY_TOO_LARGE: f"The request's body is too large; at most {error.detail} are read.",
        HTTPStatus.REQUEST_TIMEOUT: f"The request's body did not arrive within {error.detail}; send it again.",
        HTTPStatus.BAD_REQUEST: "The request's body cannot be read; send one JSON object encoded as UTF-8.",
    }
    detail = details.get(HTTPStatus(error.status_code), f"The request was refused: {error.detail}.")
    return _document(request, _problem(error.status_code, detail), headers or None)


def _offered(request: Request) -> str:
    """Every method that is described for the path: routes are one a method, and the one that refused names its own."""
    for template, operations in request.app.openapi()["paths"].items():
        if re.fullmatch(re.sub(r"\{\w+\}", "[^/]+", template), request.scope["path"]):
            return ", ".join(sorted(method.upper() for method in operations))
    return ""


_PLACES = {
    "query": "the query parameter",
    "path": "the path's",
    "body": "the body's field",
    "header": "the header",
}


def _field(error: Mapping[str, Any]) -> FieldProblem:
    """One fault of validation as a clause: where, what is allowed, what came."""
    location: Sequence[object] = error["loc"]
    kind, message = str(error["type"]), str(error["msg"])
    place = _PLACES.get(str(location[0]), str(location[0]))
    name = ".".join(printable(part)[1:-1] if isinstance(part, str) else str(part) for part in location[1:])
    where = f"{location[0]}.{name}" if name else str(location[0])
    if kind == "json_invalid":
        reason = printable(error.get("ctx", {}).get("error", "syntax error"))[1:-1]
        return FieldProblem(
            where="body", message=f"the body is no JSON: {reason} at character {location[-1]}"
        )
    subject = f"{place} {name}" if name else "the body"
    if kind == "missing":
        clause = (
            f"{subject} is required" if name else "a JSON body is required (Content-Type: application/json)"
        )
    elif kind == "extra_forbidden":
        clause = f"{subject} is not known here"
    else:
        allowed = message.removeprefix("Input ").removeprefix("String ").removeprefix("Value error, ")
        if not allowed.startswith(("should ", "must ")):
            allowed = f"is not usable: {allowed[:1].lower()}{allowed[1:]}"
        clause = f"{subject} {allowed}, got {printable(error.get('input'))}"
    return FieldProblem(where=where, message=clause)
