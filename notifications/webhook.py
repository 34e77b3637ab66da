"""Notices by HTTP POST, in Alertmanager's format, signed."""

import base64
import hashlib
import hmac
import http.client
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
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
        timeout_s: that connecting may take, and all that comes after it.
    """

    url: str = field(repr=False)
    secret: bytes = field(repr=False)
    receiver: str
    external_url: str
    authority: Path | None = None
    timeout_s: float = 10.0


class WebhookChannel:
    """Calls one webhook, over a connection of its own each time. Redirects are not followed, proxies not used.

    Args:
        settings: of it.
        wall_clock: seconds since 1970-01-01 UTC, for the signature.

    Raises:
        ChannelError: the address or the authority cannot be used.
    """

    keeps_first = True

    def __init__(self, settings: WebhookSettings, wall_clock: Callable[[], float] = time.time) -> None:
        self._settings, self._wall_clock = settings, wall_clock
        self._address = _taken_apart(settings.url)
        self.place = self._address.place
        self._context = _context(settings.authority) if self._address.is_https else None

    def send(self, notice: Notice) -> None:
        """Post a notice; of the answer nothing but status and ``Retry-After`` is looked at."""
        settings = self._settings
        document = alertmanager_document(notice, settings.receiver, settings.external_url)
        body = orjson.dumps(document)
        late: list[bool] = []
        with closing(self._connection()) as connection:
            try:
                connection.connect()
                with _ended_after(settings.timeout_s, connection, late):
                    connection.request("POST", self._address.target, body, self._headers_of(notice, body))
                    with connection.getresponse() as answer:
                        status, wish = answer.status, answer.headers.get("Retry-After", "")
            except (OSError, http.client.HTTPException) as error:
                raise NotDeliveredError(_reason(TimeoutError() if late else error)) from None
        if late:  # what was cut off looks like an answer that has ended
            raise NotDeliveredError(_reason(TimeoutError()))
        if not 200 <= status < 300:
            raise _of_answer(status, wish)

    def close(self) -> None:
        """There is nothing to close."""

    def _connection(self) -> http.client.HTTPConnection:
        address, timeout_s = self._address, self._settings.timeout_s
        if self._context is None:
            return http.client.HTTPConnection(address.host, address.port, timeout=timeout_s)
        return http.client.HTTPSConnection(
            address.host, address.port, timeout=timeout_s, context=self._context
        )

    def _headers_of(self, notice: Notice, body: bytes) -> dict[str, str]:
        headers = {
            **self._address.headers,
            "Content-Type": "application/json",
            "User-Agent": "wingwatch",
            "Connection": "close",
            "Idempotency-Key": notice.key,
        }
        if self._settings.secret:
            timestamp = f"{self._wall_clock():.0f}"
            headers["X-Wingwatch-Timestamp"] = timestamp
            headers["X-Wingwatch-Signature"] = signature(self._settings.secret, timestamp, body)
        return headers


@dataclass(frozen=True, slots=True)
class _Address:
    """A URL taken apart; ``target`` and ``headers`` may be secret."""

    is_https: bool
    host: str
    port: int | None
    target: str
    headers: Mapping[str, str]

    @property
    def place(self) -> str:
        """Scheme and host."""
        return (
            f"{'https' if self.is_https else 'http'}://{f'[{self.host}]' if ':' in self.host else self.host}"
        )


def signature(secret: bytes, timestamp: str, body: bytes) -> str:
    """``sha256=`` and the HMAC in hexadecimal of the time stamp, a full stop and the body."""
    return f"sha256={hmac.new(secret, timestamp.encode() + b'.' + body, hashlib.sha256).hexdigest()}"


@contextmanager
def _ended_after(seconds: float, connection: http.client.HTTPConnection, late: list[bool]) -> Iterator[None]:
    """What is done within ends after so long, however slowly the other side sends; ``late`` is filled then."""

    def end() -> None:
        late.append(True)
        with suppress(OSError):
            connection.sock.shutdown(socket.SHUT_RDWR)

    timer = threading.Timer(seconds, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _taken_apart(url: str) -> _Address:
    """The address to call, and the header for the user in it."""
    try:
        parts = urlsplit(url)
        port, host = parts.port, parts.hostname
    except ValueError:
        raise ChannelError("the address is no URL; give https://HOST/PATH") from None
    if parts.scheme not in ("http", "https") or not host or not url.isascii() or any(c <= " " for c in url):
        raise ChannelError("the address is not of the form https://HOST/PATH")
    headers = {}
    if parts.username is not None:
        user = f"{unquote(parts.username)}:{unquote(parts.password or '')}"
        headers["Authorization"] = f"Basic {base64.b64encode(user.encode()).decode()}"
    target = urlunsplit(("", "", parts.path or "/", parts.query, ""))
    return _Address(parts.scheme == "https", host, port, target, headers)


def _context(authority: Path | None) -> ssl.SSLContext:
    """Certificates and host names are always verified."""
    try:
        return ssl.create_default_context(cafile=None if authority is None else str(authority))
    except (OSError, ssl.SSLError):
        raise ChannelError(f"{authority}: no certificates (PEM) can be read from it") from None


def _of_answer(status: int, wish: str) -> NotDeliveredError | RefusedError:
    """What an answer other than success means: 408, 425, 429 and 5xx are for now, the rest is for ever.

    Args:
        wish: the header ``Retry-After``; only seconds are understood.
    """
    said = f"answered {status}"
    if status >= 500 or status in _TRY_AGAIN:
        return NotDeliveredError(said, min(float(wish), _LONGEST_WISH_S) if wish.isdecimal() else None)
    if 300 <= status < 400:
        return RefusedError(f"{said}, a redirect, which is not followed: set the address that it leads to")
    return RefusedError(said)


def _reason(error: Exception) -> str:
    """Why there was no answer, without what the error quotes of the address."""
    if isinstance(error, TimeoutError):
        return "no answer in time"
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its certificate is not accepted ({error.verify_message})"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    return f"no answer that HTTP knows ({type(error).__name__})"
