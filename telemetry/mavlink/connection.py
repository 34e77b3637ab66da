"""Where a MAVLink link's bytes come from: UDP, TCP or a serial line, in pymavlink's notation."""

import os
import re
import selectors
import socket
import stat
import termios
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self, cast

from wingwatch.telemetry.zenoh_link import LinkError

__all__ = ["Arrival", "MavlinkConnection", "open_connection"]

_NETWORK = re.compile(r"(udp|udpin|udpout|tcp|tcpin):(?:\[([^\]]+)\]|([^:\[\]]+)):(\d{1,5})")
_FORMS = "udp:HOST:PORT or udpin: (listen), udpout:, tcp:, tcpin:, or a serial device such as /dev/ttyACM0"
_MOST_BYTES = 65_536
_MOST_AT_ONCE = 512  # reads before the samples are looked at again
_BUFFER_BYTES = 4_194_304  # of the socket: half a second of hundreds of vehicles
_CONNECT_S = 5.0
_AGAIN_S = 1.0
_MOST_CLIENTS = 16


@dataclass(frozen=True, slots=True)
class Arrival:
    """Bytes that came together.

    Attributes:
        data: of one datagram or one read.
        received_s: when, on the connection's clock.
        source: whose they are; what is sent back to it reaches the vehicle.
    """

    data: bytes
    received_s: float
    source: object


class MavlinkConnection:
    """An open link; use it in a ``with`` statement.

    A TCP peer or a serial device that goes away is tried again every second; meanwhile nothing comes.

    Args:
        notation: as written on the command line, for sentences.
        opened: makes the socket or device anew.
        kind: ``udpin``, ``udpout``, ``tcp``, ``tcpin`` or ``serial``.
        clock: monotonic seconds.

    Attributes:
        interruptions: how often a TCP peer or a serial device went away.
    """

    def __init__(
        self, notation: str, opened: Callable[[], "socket.socket | int"], kind: str,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self._opened, self._kind, self._clock = opened, kind, clock
        self._selector = selectors.DefaultSelector()
        self._link: socket.socket | int | None = None
        self._clients: dict[int, socket.socket] = {}
        self._again_s = 0.0
        self.notation, self.interruptions = notation, 0
        self._open()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the link."""
        for client in list(self._clients.values()):
            self._drop(client)
        self._lose()
        self._selector.close()

    @property
    def address(self) -> tuple[str, int] | None:
        """Host and port of this end; None of a serial line or a link that is broken."""
        return self._link.getsockname()[:2] if isinstance(self._link, socket.socket) else None

    def read(self, timeout_s: float) -> list[Arrival]:
        """What has come; waits for the first bytes, not for the last."""
        if self._link is None and self._clock() >= self._again_s:
            try:
                self._open()
            except OSError:
                self._again_s = self._clock() + _AGAIN_S
        if self._link is None:
            time.sleep(min(timeout_s, _AGAIN_S))
            return []
        arrivals: list[Arrival] = []
        for key, _ in self._selector.select(timeout_s):
            arrivals += self._read_one(cast("socket.socket | int", key.fileobj))
        return arrivals

    def send(self, data: bytes, source: object = None) -> None:
        """Bytes to whoever ``source`` is of, to the peer of a link that has one; lost where nobody is there."""
        with suppress(OSError):  # a link may break at any time; the next read notices
            if isinstance(self._link, int):
                os.write(self._link, data)
            elif self._kind == "udpin" and self._link is not None and isinstance(source, tuple):
                self._link.sendto(data, source)
            elif self._kind == "tcpin" and isinstance(source, int) and source in self._clients:
                self._clients[source].send(data)
            elif self._kind in ("udpout", "tcp") and self._link is not None:
                self._link.send(data)

    def _open(self) -> None:
        self._link = self._opened()
        self._selector.register(self._link, selectors.EVENT_READ)

    def _lose(self) -> None:
        link, self._link = self._link, None
        if link is None:
            return
        self._selector.unregister(link)
        if isinstance(link, int):
            os.close(link)
        else:
            link.close()

    def _drop(self, client: socket.socket) -> None:
        self._clients.pop(client.fileno(), None)
        self._selector.unregister(client)
        client.close()

    def _read_one(self, end: "socket.socket | int") -> list[Arrival]:
        if self._kind in ("udpin", "udpout") and isinstance(end, socket.socket):
            return self._datagrams(end)
        if self._kind == "tcpin" and end is self._link and isinstance(end, socket.socket):
            self._accept(end)
            return []
        try:
            data = end.recv(_MOST_BYTES) if isinstance(end, socket.socket) else os.read(end, _MOST_BYTES)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if data:
            return [Arrival(data, self._clock(), end.fileno() if isinstance(end, socket.socket) else 0)]
        self.interruptions += 1
        if isinstance(end, socket.socket) and end is not self._link:
            self._drop(end)
        else:
            self._lose()
            self._again_s = self._clock() + _AGAIN_S
        return []

    def _datagrams(self, end: socket.socket) -> list[Arrival]:
        """All that wait, the newest last; a port that nobody listens to answers with an error, which is no end."""
        found: list[Arrival] = []
        clock = self._clock
        for _ in range(_MOST_AT_ONCE):
            try:
                data, source = end.recvfrom(_MOST_BYTES)
            except BlockingIOError:
                break
            except OSError:
                continue
            found.append(Arrival(data, clock(), source))
        return found

    def _accept(self, end: socket.socket) -> None:
        try:
            client, _ = end.accept()
        except OSError:
            return
        if len(self._clients) >= _MOST_CLIENTS:
            client.close()
            return
        client.setblocking(False)
        self._clients[client.fileno()] = client
        self._selector.register(client, selectors.EVENT_READ)


def open_connection(
    notation: str, baud: int = 57_600, clock: Callable[[], float] = time.monotonic
) -> MavlinkConnection:
    """A link by pymavlink's notation.

    Args:
        notation: ``udp:HOST:PORT`` or ``udpin:`` listens, ``udpout:`` sends to there first, ``tcp:`` connects,
            ``tcpin:`` listens; else the path of a serial device.
        baud: of the serial device.
        clock: monotonic seconds.

    Raises:
        LinkError: another notation, an address that is not to be had, a device that is none; one sentence.
    """
    match = _NETWORK.fullmatch(notation)
    if match is None and (":" in notation or not notation.startswith("/")):
        raise LinkError(f"--connect {notation!r} is no MAVLink link: write {_FORMS}")
    if match is None:
        return _open_or_say(notation, lambda: _serial(notation, baud), "serial", clock)
    kind, host, port = match[1], match[2] or match[3], int(match[4])
    if port > 65_535:
        raise LinkError(f"--connect {notation!r}: port {port} is none; ports are 0 to 65535")
    kind = "udpin" if kind == "udp" else kind
    return _open_or_say(notation, lambda: _socket(kind, host, port), kind, clock)


def _open_or_say(
    notation: str, opened: Callable[[], "socket.socket | int"], kind: str, clock: Callable[[], float]
) -> MavlinkConnection:
    try:
        return MavlinkConnection(notation, opened, kind, clock)
    except socket.gaierror:
        raise LinkError(f"--connect {notation}: this host is not known; give its name or address") from None
    except OSError as problem:
        why = (problem.strerror or str(problem) or "it does not answer").lower()
        advice = {
            "serial": "correct the device, or the permission to open it",
            "tcp": "start what listens there, or correct the address",
        }.get(kind, "choose another port, or an address of this machine")
        raise LinkError(f"--connect {notation}: {why}; {advice}") from None


def _socket(kind: str, host: str, port: int) -> socket.socket:
    stream = kind in ("tcp", "tcpin")
    want = socket.SOCK_STREAM if stream else socket.SOCK_DGRAM
    family, _, _, _, address = socket.getaddrinfo(host, port, type=want)[0]
    link = socket.socket(family, want)
    try:
        if not stream:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        if kind in ("udpin", "tcpin"):
            link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, int(stream))
            link.bind(address)
            if stream:
                link.listen(_MOST_CLIENTS)
        else:
            link.settimeout(_CONNECT_S)
            link.connect(address)
        link.setblocking(False)
    except OSError:
        link.close()
        raise
    return link


def _serial(path: str, baud: int) -> int:
    """The device as raw bytes at this rate."""
    if not stat.S_ISCHR(Path(path).stat().st_mode):
        raise LinkError(f"--connect {path}: this is no serial device; write {_FORMS}")
    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise LinkError(f"--baud {baud} is no rate of a serial line: 57600, 115200 and 921600 are usual ones")
    device = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        attributes = termios.tcgetattr(device)
        attributes[0] = attributes[1] = attributes[3] = 0
        attributes[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
        attributes[4] = attributes[5] = speed
        attributes[6][termios.VMIN], attributes[6][termios.VTIME] = 0, 0
        termios.tcsetattr(device, termios.TCSANOW, attributes)
    except termios.error:
        os.close(device)
        raise LinkError(f"--connect {path}: this is no serial device; write {_FORMS}") from None
    return device
