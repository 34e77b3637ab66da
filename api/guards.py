"""What stands around every route: safe headers on answers, a limit on requests' bodies."""

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
                headers["Content-Security-Policy"] = CONTENT_SECURITY_POLICY
                headers["X-Content-Type-Options"] = "nosniff"
                headers["Referrer-Policy"] = "no-referrer"
                headers["Cross-Origin-Resource-Policy"] = "same-origin"
            await send(message)

        await self._app(scope, receive, send_with_headers)


class BodyLimit:
    """ASGI wrapper: whoever reads a body of more than ``LARGEST_BODY_BYTES`` meets HTTPException 413.

    What is too much is read and thrown away (up to 16 MiB), because a connection that is closed over unread
    bytes is reset, and its client would never see the answer.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer through the wrapped application."""
        announced = Headers(scope=scope).get("content-length", "0") if scope["type"] == "http" else "0"
        too_much = announced.isdigit() and int(announced) > LARGEST_BODY_BYTES
        taken = 0

        async def receive_within_limit() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if too_much or taken > LARGEST_BODY_BYTES:
                while message.get("more_body", False) and taken <= _MOST_DISCARDED_BYTES:
                    message = await receive()
                    taken += len(message.get("body", b""))
                raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
            return message

        await self._app(scope, receive_within_limit, send)
