"""Who may ask and who may act: bearer tokens, the names under which the service is found, rate limits."""

import ipaddress
import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from http import HTTPStatus
from urllib.parse import urlsplit

from fastapi import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from wingwatch.api.guards import discard_body
from wingwatch.api.help_files import HELP
from wingwatch.api.problems import ProblemError, printable, problem_answer
from wingwatch.api.rates import Rate, RateLimit

__all__ = [
    "COOKIE",
    "Access",
    "AccessGuard",
    "AccessSettings",
    "Admission",
    "Caller",
    "TokenScope",
    "admission_of",
]

COOKIE = "wingwatch_token"
"""Of a browser that has logged in; no script can read it."""

_LOG = logging.getLogger(__name__)
_READING = ("GET", "HEAD", "OPTIONS")
_SESSION = "/v1/session"
_OPEN = ("/", "/alerts", "/diagnoses", "/studies", "/docs", "/health/live", "/health/ready", _SESSION)
_OPEN_BELOW = ("/pages/", "/vehicles/")  # the page's files and views hold no data
_NAMES_HERE = ("localhost",)
_LOGGED = Rate(per_s=0.2, burst=20)


class TokenScope(StrEnum):
    """What a token permits; ``operate`` includes reading."""

    READ = "read"
    OPERATE = "operate"


@dataclass(frozen=True, slots=True)
class Caller:
    """Whose token a request carries."""

    name: str
    scope: TokenScope


def _nobody(_token: str) -> Caller | None:
    return None


@dataclass(frozen=True, slots=True)
class AccessSettings:
    """Who may do what.

    Attributes:
        find: whose token this is; None for one that is none of ours.
        required: whether a request needs a token.
        names: host names under which the service is found, beside addresses and ``localhost``.
        reading, acting: how often one client may, where tokens are required: a program on the same machine may ask as
            often as it likes.
        guessing: how often one address may come with a token that is none of ours.
    """

    find: Callable[[str], Caller | None] = _nobody
    required: bool = False
    names: tuple[str, ...] = ()
    reading: Rate = field(default=Rate(per_s=200.0, burst=1000))
    acting: Rate = field(default=Rate(per_s=20.0, burst=200))
    guessing: Rate = field(default=Rate(per_s=0.5, burst=20))


@dataclass(frozen=True, slots=True)
class Admission:
    """On what grounds a request was let in.

    Attributes:
        caller: None without a token.
        client: the caller's name, or else its address: by it limits are kept.
        may_read: whether it may read; only the open paths let one in who may not.
        holds: whether its token is still ours.
    """

    caller: Caller | None
    client: str
    may_read: bool
    holds: Callable[[], bool]


def admission_of(request: Request) -> Admission:
    """What ``AccessGuard`` found about a request."""
    admission: Admission = request.state.admission
    return admission


class Access:
    """Lets requests in or refuses them, and counts what it refused. Used in one thread, that of the server.

    Args:
        clock: monotonic seconds.
    """

    def __init__(self, settings: AccessSettings, clock: Callable[[], float] = time.monotonic) -> None:
        self._settings = settings
        self._names = {name.lower() for name in (*_NAMES_HERE, *settings.names)}
        self._reading, self._acting = RateLimit(settings.reading, clock), RateLimit(settings.acting, clock)
        self._guessing, self._logging = RateLimit(settings.guessing, clock), RateLimit(_LOGGED, clock)
        self.counts = dict.fromkeys(
            ("foreign_host", "foreign_origin", "no_token", "wrong_token", "wrong_scope", "too_often"), 0
        )

    @property
    def required(self) -> bool:
        """Whether a request needs a token."""
        return self._settings.required

    def admit(self, request: Request) -> Admission:
        """Let a request in.

        Raises:
            ProblemError: 421 for a foreign host, 403 for a foreign origin or scope, 401 without a token, 429.
        """
        self._check_names(request)
        address = request.client.host if request.client is not None else "unknown"
        path = request.scope["path"]  # which routes go by; a URL is taken apart once more
        is_open = path in _OPEN or path.startswith(_OPEN_BELOW) or f"{path}/".startswith(f"{HELP}/")
        token, asked = _token_of(request)
        strict = not is_open and (asked or self._settings.required)
        caller = None
        if token is not None:
            caller = self.identify(token, address) if strict else self._settings.find(token)
        client = address if caller is None else f"token {caller.name}"
        reads = request.method in _READING
        if self._settings.required:
            self._check_wait((self._reading if reads else self._acting).take(client))
        if not is_open:
            self._check_scope(caller, reads, address)

        def holds() -> bool:
            return token is None or caller is None or self._settings.find(token) is not None

        return Admission(caller, client, caller is not None or not self._settings.required, holds)

    def identify(self, token: str, address: str) -> Caller:
        """Whose token this is.

        Raises:
            ProblemError: 401 for one that is none of ours, 429 for an address that has tried too many of them.
        """
        caller = self._settings.find(token)
        if caller is not None:
            return caller
        self._check_wait(self._guessing.take(address))
        raise self._refuse(
            "wrong_token", address, HTTPStatus.UNAUTHORIZED,
            "The token is none of this service's; `wingwatch token list` names those that it has.",
        )  # fmt: skip

    def _check_names(self, request: Request) -> None:
        address = request.client.host if request.client is not None else "unknown"
        host = request.headers.get("host")
        if host is not None and not self._is_ours(host):
            raise self._refuse(
                "foreign_host", address, HTTPStatus.MISDIRECTED_REQUEST,
                f"The service is not known as {printable(host)}; name it with --name, or use its address.",
            )  # fmt: skip
        origin = request.headers.get("origin")
        if origin is not None and origin.partition("://")[2].lower() != (host or "").lower():
            raise self._refuse(
                "foreign_origin", address, HTTPStatus.FORBIDDEN,
                f"A page of {printable(origin)} may not ask here; only the service's own page may.",
            )  # fmt: skip

    def _is_ours(self, host: str) -> bool:
        """An address cannot be pointed elsewhere by others, as a name can: any address will do."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        if name.rstrip(".") in self._names:
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    def _check_scope(self, caller: Caller | None, reads: bool, address: str) -> None:
        if caller is None:
            if self._settings.required:
                raise self._refuse(
                    "no_token", address, HTTPStatus.UNAUTHORIZED,
                    "A token is required: send Authorization: Bearer TOKEN, or log in on the page at /.",
                )  # fmt: skip
        elif not reads and caller.scope is not TokenScope.OPERATE:
            raise self._refuse(
                "wrong_scope", address, HTTPStatus.FORBIDDEN,
                f"Token '{caller.name}' may only read; acting takes one of scope operate.",
            )  # fmt: skip

    def _check_wait(self, wait_s: float) -> None:
        if wait_s > 0.0:
            self.counts["too_often"] += 1
            seconds = str(math.ceil(wait_s))
            raise ProblemError(
                HTTPStatus.TOO_MANY_REQUESTS,
                f"There are too many requests from here; try again in {seconds} s.",
                headers={"Retry-After": seconds},
            )

    def _refuse(self, count: str, address: str, status: HTTPStatus, sentence: str) -> ProblemError:
        self.counts[count] += 1
        if self._logging.take(count) == 0.0:  # a flood must not fill the log
            _LOG.warning("refused %s (%s, %d so far): %s", address, count, self.counts[count], sentence)
        headers = {"WWW-Authenticate": "Bearer"} if status is HTTPStatus.UNAUTHORIZED else None
        return ProblemError(status, sentence, headers=headers)


def _token_of(request: Request) -> tuple[str | None, bool]:
    """The token that a request carries, and whether it asks to be let in by it: a browser sends a cookie unasked."""
    kind, _, token = request.headers.get("authorization", "").partition(" ")
    if kind:
        return token.strip() if kind.lower() == "bearer" else "", True
    return request.cookies.get(COOKIE), False


class AccessGuard:
    """ASGI wrapper: what ``access`` refuses never reaches a route; what it found is in ``request.state.admission``."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer through the wrapped application."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        try:
            request.state.admission = self._access.admit(request)
        except ProblemError as error:
            await discard_body(receive)
            await problem_answer(request, error)(scope, receive, send)
            return
        await self._app(scope, receive, send)
