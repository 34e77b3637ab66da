"""The Zenoh session: loopback and no scouting unless set otherwise, one sentence where it cannot be had."""

import json
import re
import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

import zenoh

from wingwatch.telemetry.link_security import LinkSecurity

__all__ = ["DEFAULT_ENDPOINT", "LinkError", "ZenohSettings", "open_session", "with_free_ports"]

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
_PROTECTED = ("tls/", "quic/")
_ANY_PORT = re.compile(r"(?P<kind>tcp|tls|ws|udp|quic)/(?P<host>.+):0(?P<rest>[?#].*)?")
_DATAGRAMS = ("udp", "quic")
_RETRY_FIRST_MS, _RETRY_LAST_MS = 100, 500  # a lost router is found again 0.3 s after it is back
_ACCEPT_PENDING, _ACCEPT_MS = (
    1000,
    2000,
)  # connections that are opened and say nothing must not hold others up
_STALL_ALLOWED_US = 10_000_000  # a busy receiver holds up a blocking publisher as long as the link lives


class LinkError(RuntimeError):
    """A session, listener or receiver that is not to be had; one sentence."""


@dataclass(frozen=True, slots=True)
class ZenohSettings:
    """How this process takes part.

    Attributes:
        mode: ``peer`` (others may connect to it), ``client`` (connects to one router or peer) or ``router``.
        listen: endpoints others connect to.
        connect: endpoints to connect to.
        max_message_bytes: longest payload that is taken; a longer one is counted as ``too_large``.
        max_transport_bytes: a message longer than this is dropped before it has been put together, uncounted
            but for the gap it leaves in the sequence; it bounds the memory a stranger can claim.
        open_timeout_s: how long to try to connect.
        security: certificates, user and rules; none for links on loopback.
    """

    mode: Literal["peer", "client", "router"] = "peer"
    listen: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    connect: tuple[str, ...] = ()
    max_message_bytes: int = 65_536
    max_transport_bytes: int = 16_777_216
    open_timeout_s: float = 5.0
    security: LinkSecurity | None = None

    @classmethod
    def for_service(
        cls,
        listen: tuple[str, ...] = (),
        connect: tuple[str, ...] = (),
        security: LinkSecurity | None = None,
    ) -> "ZenohSettings":
        """A service: a peer that listens (on loopback where nothing is said), or a client of a router."""
        if connect and not listen:
            return cls(mode="client", listen=(), connect=connect, security=security)
        return cls(mode="peer", listen=listen or (DEFAULT_ENDPOINT,), connect=connect, security=security)

    @classmethod
    def for_vehicle(
        cls, connect: tuple[str, ...] = (DEFAULT_ENDPOINT,), security: LinkSecurity | None = None
    ) -> "ZenohSettings":
        """A vehicle: always a client, because two peers that do not listen never hear of each other."""
        return cls(mode="client", listen=(), connect=connect, security=security)

    def config(self) -> zenoh.Config:
        """The settings in Zenoh's own form.

        Raises:
            LinkError: an endpoint that is none, a client without one, or one that security does not reach.
            LinkSecurityError: certificates or rules that will not do.
        """
        if self.mode == "client" and not self.connect:
            raise LinkError(f"a Zenoh client needs an endpoint to connect to, such as {DEFAULT_ENDPOINT}")
        values: dict[str, Any] = {
            "mode": self.mode,
            "listen/endpoints": list(self.listen),
            "connect/endpoints": list(self.connect),
            "connect/timeout_ms": round(1000 * self.open_timeout_s),
            "connect/exit_on_failure": True,
            "connect/retry": {"period_init_ms": _RETRY_FIRST_MS, "period_max_ms": _RETRY_LAST_MS},
            "scouting/multicast/enabled": False,
            "transport/shared_memory/enabled": False,
            "transport/link/rx/max_message_size": self.max_transport_bytes,
            "transport/link/tx/queue/congestion_control/block/wait_before_close": _STALL_ALLOWED_US,
            "transport/unicast/accept_pending": _ACCEPT_PENDING,
            "transport/unicast/accept_timeout": _ACCEPT_MS,
        }
        if self.security is not None:
            for endpoint in (*self.listen, *self.connect):
                if not endpoint.startswith(_PROTECTED):
                    raise LinkError(f"{endpoint} takes no certificates: write tls/HOST:PORT")
            values |= self.security.config(bool(self.listen))
        config = zenoh.Config()
        for key, value in values.items():
            try:
                config.insert_json5(key, json.dumps(value))
            except zenoh.ZError:
                shown = "(not shown)" if "password" in key else json.dumps(value)
                raise LinkError(
                    f"Zenoh does not take {shown} for {key}: use the form tcp/HOST:PORT"
                ) from None
        return config


def with_free_ports(endpoints: Sequence[str]) -> tuple[str, ...]:
    """Endpoints to listen on, with a free port in the place of port 0.

    Zenoh takes port 0, too, but does not say which port it has got. The port chosen here is free when it is looked for;
    in the moment until Zenoh listens somebody else may take it, which Zenoh then says. An endpoint whose host cannot be
    listened on stays as it is, for Zenoh to say why.
    """
    return tuple(_with_free_port(endpoint) for endpoint in endpoints)


def _with_free_port(endpoint: str) -> str:
    found = _ANY_PORT.fullmatch(endpoint)
    if found is None:
        return endpoint
    kind, host = found["kind"], found["host"]
    try:
        place = socket.getaddrinfo(
            host.strip("[]"), 0, type=socket.SOCK_DGRAM if kind in _DATAGRAMS else socket.SOCK_STREAM
        )[0]
        with socket.socket(*place[:3]) as free:
            free.bind(place[4])
            port = free.getsockname()[1]
    except OSError:
        return endpoint
    return f"{kind}/{host}:{port}{found['rest'] or ''}"


@contextmanager
def open_session(settings: ZenohSettings) -> Iterator[zenoh.Session]:
    """A session that is closed on the way out, whatever happens: an open one keeps the process from ending.

    Raises:
        LinkError: the port is taken, nothing answers within the timeout, or an endpoint is wrong.
    """
    try:
        session = zenoh.open(settings.config())
    except zenoh.ZError as problem:
        raise LinkError(_sentence(settings, str(problem))) from None
    try:
        yield session
    finally:
        session.close()  # type: ignore[no-untyped-call]


def _sentence(settings: ZenohSettings, problem: str) -> str:
    listen, connect = " ".join(settings.listen), " ".join(settings.connect)
    if "Address already in use" in problem:
        return f"Zenoh cannot listen on {listen}: the port is in use; choose another one"
    if "Cannot assign requested address" in problem:
        return f"Zenoh cannot listen on {listen}: this machine does not have that address"
    if "ermission denied" in problem:
        return f"Zenoh cannot listen on {listen}: the system does not permit it; choose a port above 1023"
    if "Unable to connect" in problem and settings.security is not None:
        return (
            f"nothing answers at {connect} within {settings.open_timeout_s:g} s, or it refuses the certificate or "
            "the user: start the router, or correct the endpoint, the authority and the certificate"
        )
    if "Unable to connect" in problem:
        return (
            f"nothing answers at {connect} within {settings.open_timeout_s:g} s: "
            "start the service or router, or correct the endpoint"
        )
    what = problem.split(" at /", 1)[0].rstrip(".")
    return f"Zenoh cannot be opened (listen {listen or 'none'}, connect {connect or 'none'}): {what}"
