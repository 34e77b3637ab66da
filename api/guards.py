"""What stands around every route: safe headers on answers, a limit on requests' bodies."""

from collections.abc import Mapping
from http import HTTPStatus

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["CONTENT_SECURITY_POLICY", "LARGEST_BODY_BYTES", "BodyLimit", "SafetyHeaders"]

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
LARGEST_BODY_BYTES = 65_536
_MOST_DISCARDED_BYTES = 16 * 2**20


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
    """ASGI wrapper: whoever reads a body of more than the limit meets HTTPException 413, its detail the limit.

    What is too much is read and thrown away (up to 16 MiB), because a connection that is closed over unread
    bytes is reset, and its client would never see the answer.

    Args:
        larger: limits of paths that take more than ``LARGEST_BODY_BYTES``.
    """

    def __init__(self, app: ASGIApp, larger: Mapping[str, int] | None = None) -> None:
        self._app = app
        self._larger = larger or {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer through the wrapped application."""
        limit = self._larger.get(scope.get("path", ""), LARGEST_BODY_BYTES)
        announced = Headers(scope=scope).get("content-length", "0") if scope["type"] == "http" else "0"
        too_much = announced.isdigit() and int(announced) > limit
        taken = 0

        async def receive_within_limit() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if too_much or taken > limit:
                most = taken + _MOST_DISCARDED_BYTES
                while message.get("more_body", False) and taken <= most:
                    message = await receive()
                    taken += len(message.get("body", b""))
                raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _size(limit))
            return message

        await self._app(scope, receive_within_limit, send)


def _size(limit: int) -> str:
    return f"{limit >> 10} kB" if limit < 2**20 else f"{limit >> 20} MB"
