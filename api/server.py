"""Serving the application: the port is taken before anything else starts, and it ends within seconds."""

import asyncio
import contextlib
import errno
import ipaddress
import logging
import math
import signal
import socket
import ssl
import threading
from collections.abc import Callable, Generator
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Self

import uvicorn
from fastapi import FastAPI

from wingwatch.api.connections import BoundedConnection, Connections

__all__ = [
    "AddressError",
    "CertificateError",
    "HttpServer",
    "PortInUse",
    "beyond_loopback",
    "listen",
    "read_certificate",
    "serve",
]

_LOG = logging.getLogger(__name__)
_BACKLOG = 256
_LAST_PORT = 65_535
_START_S = 10.0
_HANDSHAKE_S = 5.0


class AddressError(OSError):
    """A host and port on which the service cannot listen; its text is one sentence for the user."""


class PortInUse(AddressError):
    """Another process already listens there."""


class CertificateError(ValueError):
    """Files with which TLS cannot be offered; its text is one sentence for the user."""


def listen(host: str, port: int) -> socket.socket:
    """A listening TCP socket, taken now, served later; port 0 lets the system choose.

    Whoever asks first thing knows that the port is theirs before a session or a database is opened.

    Raises:
        PortInUse: another process listens there.
        AddressError: no such host here, or no right to the port.
    """
    where = f"{host}:{port}"
    if not 0 <= port <= _LAST_PORT:
        raise AddressError(f"cannot listen on {where}: a port is a number from 0 to {_LAST_PORT}")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (socket.gaierror, UnicodeError) as error:
        raise AddressError(
            f"cannot listen on {where}: host {host!r} has no address here; use 127.0.0.1"
        ) from error
    bound = socket.socket(family, kind, protocol)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(address)
        bound.listen(_BACKLOG)
    except OSError as error:
        bound.close()
        raise _refusal(error, host, port) from error
    bound.set_inheritable(False)
    return bound


def beyond_loopback(listening: socket.socket) -> bool:
    """Whether other machines can reach a listening socket."""
    chosen = str(listening.getsockname()[0])
    return not ipaddress.ip_address(chosen.split("%")[0]).is_loopback


def read_certificate(certificate: Path, private_key: Path) -> ssl.SSLContext:
    """What TLS is offered with.

    Raises:
        CertificateError: files that cannot be read, or do not belong together.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    for path in (certificate, private_key):
        try:
            path.open("rb").close()
        except OSError as error:
            reason = (error.strerror or "unreadable").lower()
            raise CertificateError(
                f"{path}: {reason}; give a certificate and its private key (PEM)"
            ) from None
    try:
        context.load_cert_chain(certificate, private_key, password="")
    except (ssl.SSLError, OSError) as error:
        what = getattr(error, "reason", None) or error
        raise CertificateError(
            f"{certificate} and {private_key} are no certificate with its private key ({what}): "
            "give PEM files that belong together, the key without a password"
        ) from None
    return context


class HttpServer:
    """The application on a socket, in a thread of its own.

    Args:
        app: made by ``create_app``.
        listening: made by ``listen``; closed at the end.
        grace_s: how long requests under way may go on after the end was asked for; streams end at once.
        tls: made by ``read_certificate``; plain HTTP without.
        connections: their limits.
    """

    def __init__(
        self,
        app: FastAPI,
        listening: socket.socket,
        grace_s: float = 1.0,
        tls: ssl.SSLContext | None = None,
        connections: Connections | None = None,
    ) -> None:
        self._connections = connections or Connections()
        self._server = _server(app, grace_s, self._connections, tls)
        self._scheme = "http" if tls is None else "https"
        self._listening = listening
        self._address = listening.getsockname()
        self._thread: threading.Thread | None = None
        self._fault: BaseException | None = None

    @property
    def port(self) -> int:
        """The port listened on."""
        return int(self._address[1])

    @property
    def url(self) -> str:
        """Where a browser on this machine finds the status page."""
        host = str(self._address[0])
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
        return f"{self._scheme}://{f'[{host}]' if ':' in host else host}:{self.port}"

    @property
    def counts(self) -> dict[str, int]:
        """Connections that were closed, by reason."""
        return dict(self._connections.counts)

    @property
    def connections(self) -> int:
        """Connections that are open."""
        return self._connections.open

    @property
    def problem(self) -> str | None:
        """None while requests are answered, else why not (for readiness)."""
        if self._fault is not None:
            return f"the HTTP server failed: {self._fault}."
        running = self._thread is not None and self._thread.is_alive() and self._server.started
        return None if running and not self._server.should_exit else "the HTTP server is not running."

    def start(self) -> Self:
        """Serve from a thread; returns once requests are answered.

        Raises:
            RuntimeError: the server did not come up; the sentence says why.
        """
        self._thread = threading.Thread(target=self._run, name="wingwatch-http", daemon=True)
        self._thread.start()
        waited = threading.Event()
        for _ in range(int(_START_S / 0.01)):
            if self._server.started or not self._thread.is_alive():
                break
            waited.wait(0.01)
        if not self._server.started:
            raise RuntimeError(f"the HTTP server did not start: {self._fault or 'no reason given'}")
        return self

    def stop(self, timeout_s: float = 2.5) -> None:
        """End it: streams at once, requests after the grace, then whatever is left by force."""
        self._server.should_exit = True
        if self._thread is not None:
            self._thread.join(timeout_s)
            if self._thread.is_alive():
                self._server.force_exit = True
                self._thread.join(0.5)
        self._listening.close()

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _run(self) -> None:
        try:
            self._server.run(sockets=[self._listening])
        except BaseException as error:  # a thread's end must not be silent, whatever ended it
            self._fault = error
            _LOG.exception("the HTTP server ended")


def serve(app: FastAPI, listening: socket.socket, grace_s: float = 1.0) -> None:
    """Serve in the calling (main) thread until SIGINT or SIGTERM, then return for the caller to tidy up."""
    try:
        _server(app, grace_s, Connections(), None).run(sockets=[listening])
    finally:
        listening.close()


class _Server(uvicorn.Server):
    """Uvicorn that ends event streams first, and returns from a signal instead of dying of it."""

    def __init__(
        self,
        config: uvicorn.Config,
        before_shutdown: Callable[[], None],
        grace_s: float,
        connections: Connections,
        tls: ssl.SSLContext | None,
    ) -> None:
        super().__init__(config)
        self._before_shutdown = before_shutdown
        self._grace_s = grace_s
        self._bounded = connections
        self._tls = tls

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """As uvicorn does for given sockets, with limits on connections and on the handshake of TLS."""
        connection = partial(
            BoundedConnection,
            self._bounded,
            config=self.config,
            server_state=self.server_state,
            app_state=self.lifespan.state,
        )
        handshake_s = None if self._tls is None else _HANDSHAKE_S
        loop = asyncio.get_running_loop()
        self.servers = [
            await loop.create_server(
                connection, sock=one, ssl=self._tls, backlog=_BACKLOG, ssl_handshake_timeout=handshake_s
            )
            for one in sockets or []
        ]
        self.started = True

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._before_shutdown()
        grace_over = asyncio.get_running_loop().call_later(self._grace_s, self._abort_connections)
        await super().shutdown(sockets)
        grace_over.cancel()
        self._abort_connections()
        await asyncio.sleep(0)

    def _abort_connections(self) -> None:
        """A client that reads no more would hold the rest of its answer for ever."""
        for connection in list(self.server_state.connections):
            connection.transport.abort()

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {number: signal.signal(number, self._end) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _end(self, _number: int, _frame: FrameType | None) -> None:
        self.force_exit = self.should_exit
        self.should_exit = True


def _server(app: FastAPI, grace_s: float, connections: Connections, tls: ssl.SSLContext | None) -> _Server:
    config = uvicorn.Config(
        app,
        http="h11",
        ws="none",
        lifespan="off",
        loop="asyncio",
        log_config=None,
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=math.ceil(grace_s) + 1,  # only for what outlives its connection
    )
    return _Server(config, app.state.close_streams, grace_s, connections, tls)


def _refusal(error: OSError, host: str, port: int) -> AddressError:
    if error.errno == errno.EADDRINUSE:
        return PortInUse(
            f"port {port} on {host} is in use by another process; end that one or give another with --port"
        )
    if error.errno == errno.EACCES:
        return AddressError(
            f"port {port} on {host} needs rights this user lacks; give one above 1023 with --port"
        )
    if error.errno == errno.EADDRNOTAVAIL:
        return AddressError(
            f"cannot listen on {host}:{port}: {host} is no address of this machine; use 127.0.0.1"
        )
    return AddressError(
        f"cannot listen on {host}:{port}: {error.strerror}; give another with --host or --port"
    )
