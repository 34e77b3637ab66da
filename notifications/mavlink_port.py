"""The way to a ground control station: UDP or TCP, packets out and nothing in."""

import os
import re
import socket

from wingwatch.notifications.channel import ChannelError

__all__ = ["MavlinkPort"]

_PLACE = re.compile(r"(udpout|udp|tcp):(\[[0-9a-fA-F:.]+\]|[^\s:\[\]/@]+):(\d{1,5})")
_TIMEOUT_S = 2.0
_A_READ, _MOST_READS = 65_536, 1000


class MavlinkPort:
    """Opened when something is to be sent, and again after a failure.

    Args:
        connect: ``udpout:HOST:PORT`` (a station listens there) or ``tcp:HOST:PORT``, as MAVLink's tools write it.

    Raises:
        ChannelError: it is of no such form.
    """

    def __init__(self, connect: str) -> None:
        match = _PLACE.fullmatch(connect)
        if match is None or not 0 < int(match[3]) < 65_536:
            raise ChannelError(f"connect is {connect!r}; give udpout:HOST:PORT or tcp:HOST:PORT")
        self._kind = socket.SOCK_STREAM if match[1] == "tcp" else socket.SOCK_DGRAM
        self._host, self._port = match[2].strip("[]"), int(match[3])
        self._socket: socket.socket | None = None

    def send(self, *packets: bytes) -> None:
        """Send packets, in order.

        UDP confirms nothing. That nobody listens at a port is noticed where its machine says so at once.

        Raises:
            OSError: they could not be sent, or a machine says that nobody listens there.
        """
        try:
            opened = self._socket = self._usable() or self._opened()
            for packet in packets:
                opened.sendall(packet)
            if error := opened.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
                raise OSError(error, os.strerror(error))
        except OSError:
            self.close()
            raise

    def _usable(self) -> socket.socket | None:
        """What is open, what has come in thrown away; None where nothing is, or the other side has ended it."""
        opened = self._socket
        if opened is None:
            return None
        opened.setblocking(False)
        try:
            for _ in range(_MOST_READS):
                if not opened.recv(_A_READ) and self._kind is socket.SOCK_STREAM:
                    raise ConnectionResetError
        except BlockingIOError:
            pass
        except OSError:  # that of earlier packets, too
            self.close()
            return None
        opened.settimeout(_TIMEOUT_S)
        return opened

    def close(self) -> None:
        """Close what is open."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _opened(self) -> socket.socket:
        if self._kind is socket.SOCK_STREAM:
            return socket.create_connection((self._host, self._port), _TIMEOUT_S)
        family, kind, protocol, _, address = socket.getaddrinfo(self._host, self._port, type=self._kind)[0]
        opened = socket.socket(family, kind, protocol)
        try:
            opened.settimeout(_TIMEOUT_S)
            opened.connect(address)
        except OSError:
            opened.close()
            raise
        return opened
