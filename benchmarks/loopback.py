"""Ports on this machine for services that are given a place to listen."""

import random
import socket

__all__ = ["free_endpoint", "free_port"]

_FIRST, _LAST = 20_000, 32_000
"""Below the ports that the system hands out itself: between the choice and its use nobody else is given one."""
_CHOICE = random.SystemRandom()


def free_port() -> int:
    """One that nobody listens on now, and that the system gives to no other process."""
    while True:
        port = _CHOICE.randint(_FIRST, _LAST)
        try:
            socket.create_server(("127.0.0.1", port)).close()
        except OSError:
            continue
        return port


def free_endpoint() -> str:
    """Such a port as a Zenoh endpoint."""
    return f"tcp/127.0.0.1:{free_port()}"
