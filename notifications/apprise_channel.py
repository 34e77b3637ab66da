"""Notices by apprise: e-mail, Slack, Teams, Telegram, Matrix and whatever else it knows (extra ``notify``)."""

import logging
import re
from typing import Any
from urllib.parse import unquote

from wingwatch.notifications.channel import ChannelError, NotDeliveredError
from wingwatch.notifications.notice import Notice, Step
from wingwatch.notifications.wording import described, summary

__all__ = ["AppriseChannel"]

_TIMEOUT_S = 30.0
_LEAST_SECRET = 4
_MOST_REASON = 200


class AppriseChannel:
    """Sends to one address of apprise.

    Args:
        url: apprise's, with its secrets: ``mailto://``, ``slack://``, ``json://``, ...

    Raises:
        ChannelError: apprise is not installed, or does not know the address.
    """

    keeps_first = True

    def __init__(self, url: str) -> None:
        try:
            import apprise
        except ImportError:
            raise ChannelError(
                "apprise is not installed; install wingwatch with its extra notify (pip install 'wingwatch[notify]')"
            ) from None
        self._apprise: Any = apprise
        self._secrets = _parts(url)
        scheme = re.match(r"([a-zA-Z0-9]{1,30})://", url)  # what follows may be a secret, the host as well
        self.place = scheme[1] if scheme else "unknown"
        _mute()
        service = apprise.Apprise.instantiate(url, suppress_exceptions=True)
        if service is None:
            raise ChannelError(f"apprise does not understand the address ({self.place}://...)")
        self._sender = apprise.Apprise()
        self._sender.add(service)

    def send(self, notice: Notice) -> None:
        """Send a notice; apprise says only whether it arrived, so what did not is always tried again."""
        result = self._sender.notify(
            body=described(notice),
            title=summary(notice),
            notify_type=self._kind(notice),
            body_format=self._apprise.NotifyFormat.TEXT,
            timeout=_TIMEOUT_S,
        )
        if not result:
            raise NotDeliveredError(self._reason(result))

    def close(self) -> None:
        """There is nothing to close."""

    def _kind(self, notice: Notice) -> Any:
        kinds = self._apprise.NotifyType
        if Step.CLEARED in notice.steps:
            return kinds.SUCCESS
        return {"critical": kinds.FAILURE, "warning": kinds.WARNING}.get(notice.alert["level"], kinds.INFO)

    def _reason(self, result: Any) -> str:
        """What apprise said last, without any part of the address."""
        text = next((entry.message for entry in reversed(list(result.logs()))), "")
        for secret in self._secrets:
            text = text.replace(secret, "***")
        return " ".join(text.split())[:_MOST_REASON].rstrip(".") or "apprise could not deliver it"


def _mute() -> None:
    """What apprise and its HTTP client log names addresses, so it goes nowhere; a call's result has what is needed."""
    for name in ("apprise", "urllib3"):
        logger = logging.getLogger(name)
        logger.propagate = False
        if not any(isinstance(one, logging.NullHandler) for one in logger.handlers):
            logger.addHandler(logging.NullHandler())


def _parts(url: str) -> list[str]:
    """All parts of an address but its scheme, as they are written and decoded, longest first."""
    rest = url.partition("://")[2]
    pieces = {rest, *re.split(r"[/:@?&=,#+]", rest)}
    pieces |= {unquote(piece) for piece in pieces}
    return sorted((piece for piece in pieces if len(piece) >= _LEAST_SECRET), key=len, reverse=True)
