"""What people and programs reach over HTTP, and what says alerts to them: the same in a service and in a gateway."""

import logging
import os
import socket
import ssl
from collections.abc import Callable
from contextlib import ExitStack
from typing import NamedTuple

from wingwatch.api import AccessSettings, beyond_loopback, listen, read_certificate
from wingwatch.notifications import Clocks
from wingwatch.service.notifications import Notifications
from wingwatch.service.notify_settings import channel_plans
from wingwatch.service.settings import ServeSettings
from wingwatch.service.tokens import TokenFile, TokenRegister

__all__ = ["Door", "door_of", "notifications_of"]

_LOG = logging.getLogger(__name__)


class Door(NamedTuple):
    """An HTTP port that is taken: its socket, who may come in by which token, and TLS where it is offered."""

    listening: socket.socket
    tokens: TokenRegister
    access: AccessSettings
    tls: ssl.SSLContext | None


def door_of(stack: ExitStack, settings: ServeSettings) -> Door:
    """Take the HTTP port; nobody is answered yet.

    Raises:
        AddressError, CertificateError, CommandError: one sentence each.
    """
    listening = listen(settings.host, settings.port)
    stack.callback(listening.close)
    tokens = TokenRegister(TokenFile(settings.data))
    return Door(listening, tokens, _access(settings, listening, tokens), _tls(settings))


def _tls(settings: ServeSettings) -> ssl.SSLContext | None:
    """What TLS is offered with, where a certificate is set."""
    if settings.certificate is None or settings.private_key is None:
        return None
    return read_certificate(settings.certificate, settings.private_key)


def notifications_of(
    stack: ExitStack, settings: ServeSettings, listening: socket.socket, wall_clock: Callable[[], float]
) -> Notifications:
    """What says alerts to people, on the channels that are set.

    Raises:
        CommandError: a channel cannot be set up.
    """
    address, port, *_ = listening.getsockname()
    host = next(iter(settings.name), f"[{address}]" if ":" in address else address)
    url = f"{'http' if settings.certificate is None else 'https'}://{host}:{port}"
    plans = channel_plans(settings.notify, os.environ, url)
    return stack.enter_context(Notifications(plans, settings.outboxes, Clocks(wall=wall_clock)))


def _access(settings: ServeSettings, listening: socket.socket, tokens: TokenRegister) -> AccessSettings:
    """Who may do what at the address that is listened on.

    Raises:
        CommandError: tokens are required there, and there is none.
    """
    others = beyond_loopback(listening)
    if others or settings.require_token:
        tokens.require_some()
    if others and settings.certificate is None:
        _LOG.warning(
            "listening on %s without TLS: tokens and answers can be read on the way; give --certificate and "
            "--private-key unless something in front of the service offers TLS",
            listening.getsockname()[0],
        )
    return AccessSettings(
        find=tokens.find,
        required=others or settings.require_token,
        names=(settings.host, *settings.name),
    )
