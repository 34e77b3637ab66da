"""Notices by HTTP POST, in Alertmanager's format, signed."""

import base64
import hashlib
import hmac
import http.client
import ssl
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass, field
from email.message import Message
from pathlib import Path
from typing import IO, Any
from urllib.parse import unquote, urlsplit, urlunsplit

import orjson

from wingwatch.notifications.alertmanager import alertmanager_document
from wingwatch.notifications.channel import ChannelError, NotDeliveredError, RefusedError
from wingwatch.notifications.notice import Notice

__all__ = ["WebhookChannel", "WebhookSettings", "signature"]

_TRY_AGAIN = (408, 425, 429)
_LONGEST_WISH_S = 1e6


@dataclass(frozen=True, slots=True)
class WebhookSettings:
    """Where and how a webhook is called.

    Attributes:
        url: whole, with whatever secrets it holds; user and password in it are sent as HTTP's basic authorisation.
        secret: that signs; empty where nothing is signed.
        receiver: what the document calls its receiver.
        external_url: where people find the status page.
        authority: PEM file of the certificates that are trusted, where the system's are not to be.
        timeout_s: that connecting, sending and each read may take.
    """

    url: str = field(repr=False)
    secret: bytes = field(repr=False)
    receiver: str
    external_url: str
    authority: Path | None = None
    timeout_s: float = 10.0


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """A redirect is an answer like another: what is signed for one host goes to no other."""

    def redirect_request(
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: Message, newurl: str
    ) -> None:  # fmt: skip
        return None


class WebhookChannel:
    """Calls one webhook.

    Args:
        settings: of it.
        wall_clock: seconds since 1970-01-01 UTC, for the signature.

    Raises:
        ChannelError: the address or the authority cannot be used.
    """

    keeps_first = True

    def __init__(self, settings: WebhookSettings, wall_clock: Callable[[], float] = time.time) -> None:
        self._settings, self._wall_clock = settings, wall_clock
        self._url, self.place, self._headers = _taken_apart(settings.url)
        handlers: list[Any] = [_NoRedirect()]
        if self._url.startswith("https:"):
            handlers.append(urllib.request.HTTPSHandler(context=_context(settings.authority)))
        self._opener = urllib.request.build_opener(*handlers)

    def send(self, notice: Notice) -> None:
        """Post a notice; what the receiver says beside its status is not read."""
        settings = self._settings
        document = alertmanager_document(notice, settings.receiver, settings.external_url)
        body = orjson.dumps(document)
        request = urllib.request.Request(self._url, body, self._headers_of(notice, body), method="POST")
        try:
            with self._opener.open(request, timeout=settings.timeout_s):
                return
        except urllib.error.HTTPError as answer:
            with answer:
                raise _of_answer(answer) from None
        except (OSError, http.client.HTTPException) as error:
            raise NotDeliveredError(_reason(error)) from None

    def close(self) -> None:
        """There is nothing to close: each call has a connection of its own."""

    def _headers_of(self, notice: Notice, body: bytes) -> dict[str, str]:
        headers = {
            **self._headers,
            "Content-Type": "application/json",
            "User-Agent": "wingwatch",
            "Idempotency-Key": notice.key,
        }
        if self._settings.secret:
            timestamp = f"{self._wall_clock():.0f}"
            headers["X-Wingwatch-Timestamp"] = timestamp
            headers["X-Wingwatch-Signature"] = signature(self._settings.secret, timestamp, body)
        return headers


def signature(secret: bytes, timestamp: str, body: bytes) -> str:
    """``sha256=`` and the HMAC in hexadecimal of the time stamp, a full stop and the body."""
    return f"sha256={hmac.new(secret, timestamp.encode() + b'.' + body, hashlib.sha256).hexdigest()}"


def _taken_apart(url: str) -> tuple[str, str, dict[str, str]]:
    """The address to call, what may be shown of it, and the header for the user in it."""
    try:
        parts = urlsplit(url)
        port, host = parts.port, parts.hostname
    except ValueError:
        raise ChannelError("the address is no URL; give https://HOST/PATH") from None
    if parts.scheme not in ("http", "https") or not host or not url.isascii() or any(c <= " " for c in url):
        raise ChannelError("the address is not of the form https://HOST/PATH")
    shown = f"[{host}]" if ":" in host else host
    netloc = shown if port is None else f"{shown}:{port}"
    headers = {}
    if parts.username is not None:
        user = f"{unquote(parts.username)}:{unquote(parts.password or '')}"
        headers["Authorization"] = f"Basic {base64.b64encode(user.encode()).decode()}"
    return (
        urlunsplit((parts.scheme, netloc, parts.path or "/", parts.query, "")),
        f"{parts.scheme}://{host}",
        headers,
    )


def _context(authority: Path | None) -> ssl.SSLContext:
    """Certificates and host names are always verified."""
    try:
        return ssl.create_default_context(cafile=None if authority is None else str(authority))
    except (OSError, ssl.SSLError):
        raise ChannelError(f"{authority}: no certificates (PEM) can be read from it") from None


def _of_answer(answer: urllib.error.HTTPError) -> NotDeliveredError | RefusedError:
    """What an answer other than success means: 408, 425, 429 and 5xx are for now, the rest is for ever."""
    status = answer.code
    said = f"answered {status}"
    if status >= 500 or status in _TRY_AGAIN:
        wish = answer.headers.get("Retry-After", "")
        return NotDeliveredError(said, min(float(wish), _LONGEST_WISH_S) if wish.isdecimal() else None)
    if 300 <= status < 400:
        return RefusedError(f"{said}, a redirect, which is not followed: set the address that it leads to")
    return RefusedError(said)


def _reason(error: Exception) -> str:
    """Why there was no answer, without what the error quotes of the address."""
    inner = error.reason if isinstance(error, urllib.error.URLError) else error
    if isinstance(inner, TimeoutError):
        return "no answer in time"
    if isinstance(inner, ssl.SSLCertVerificationError):
        return f"its certificate is not accepted ({inner.verify_message})"
    if isinstance(inner, OSError) and inner.strerror:
        return inner.strerror.lower()
    return type(inner).__name__
