"""What stands around every route: safe headers on answers, limits on requests' bodies."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = [
    "CONTENT_SECURITY_POLICY",
    "REPORT_POLICY",
    "BodyLimit",
    "BodySize",
    "SafetyHeaders",
    "discard_body",
]

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
REPORT_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Of an HTML report that brings its own script: in a sandbox it has no origin and reaches nothing of the service."""

_MOST_DISCARDED_BYTES = 16 * 2**20
_DISCARD_S = 5.0


@dataclass(frozen=True, slots=True)
class BodySize:
    """What a request's body may be, and how long it may take to arrive."""

    most_bytes: int = 65_536
    most_s: float = 20.0


class SafetyHeaders:
    """ASGI wrapper: nothing from elsewhere may be loaded, no other site may frame or embed an answer."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer through the wrapped application."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.setdefault("Content-Security-Policy", CONTENT_SECURITY_POLICY)
                headers["X-Content-Type-Options"] = "nosniff"
                headers["Referrer-Policy"] = "no-referrer"
                headers["Cross-Origin-Resource-Policy"] = "same-origin"
            await send(message)

        await self._app(scope, receive, send_with_headers)


class BodyLimit:
    """ASGI wrapper: whoever reads a body that is too large meets HTTPException 413, one that is too late 408.

    What is too much is read and thrown away (up to 16 MiB), because a connection that is closed over unread
    bytes is reset, and its client would never see the answer.

    Args:
        larger: of paths that take more than others; of all below one that ends with a slash.
    """

    def __init__(self, app: ASGIApp, larger: Mapping[str, BodySize] | None = None) -> None:
        self._app = app
        self._larger = larger or {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer through the wrapped application."""
        limit = self._limit(scope.get("path", ""))
        announced = Headers(scope=scope).get("content-length", "0") if scope["type"] == "http" else "0"
        too_much = announced.isdigit() and int(announced) > limit.most_bytes
        until_s = asyncio.get_running_loop().time() + limit.most_s
        taken, whole = 0, False

        async def receive_within_limit() -> Message:
            nonlocal taken, whole
            if whole:
                return await receive()
            try:
                async with asyncio.timeout_at(until_s):
                    message = await receive()
            except TimeoutError:
                raise HTTPException(HTTPStatus.REQUEST_TIMEOUT, f"{limit.most_s:g} s") from None
            taken += len(message.get("body", b""))
            whole = not message.get("more_body", False)
            if too_much or taken > limit.most_bytes:
                if not whole:
                    await discard_body(receive)
                raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _size(limit.most_bytes))
            return message

        await self._app(scope, receive_within_limit, send)

    def _limit(self, path: str) -> BodySize:
        above = (size for key, size in self._larger.items() if key.endswith("/") and path.startswith(key))
        return self._larger.get(path) or next(above, None) or BodySize()


async def discard_body(receive: Receive) -> None:
    """Read what a refused client still sends, within limits, so that it sees the answer."""
    taken = 0
    try:
        async with asyncio.timeout(_DISCARD_S):
            more = True
            while more and taken <= _MOST_DISCARDED_BYTES:
                message = await receive()
                more = message.get("more_body", False)
                taken += len(message.get("body", b""))
    except TimeoutError:
        return


def _size(limit: int) -> str:
    return f"{limit >> 10} kB" if limit < 2**20 else f"{limit >> 20} MB"
