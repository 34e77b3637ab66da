"""Pages of a list that may grow between two requests: an opaque cursor names the last item given."""

import base64
import binascii
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

import orjson

from wingwatch.api.problems import ProblemError, printable

__all__ = ["decode_cursor", "encode_cursor"]


def encode_cursor(key: Sequence[object]) -> str:
    """The key of a page's last item as URL-safe text."""
    return base64.urlsafe_b64encode(orjson.dumps(list(key))).decode().rstrip("=")


def decode_cursor(cursor: str, kinds: tuple[type, ...]) -> tuple[Any, ...]:
    """The key that ``encode_cursor`` was given; its parts have these types.

    Raises:
        ProblemError: 422 for text that is no cursor of this list.
    """
    try:
        key = orjson.loads(base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)))
    except (ValueError, binascii.Error):
        key = None
    if not isinstance(key, list) or tuple(type(part) for part in key) != kinds:
        raise ProblemError(
            HTTPStatus.UNPROCESSABLE_ENTITY,
            f"The query parameter cursor {printable(cursor)} is none of this list's; take `next` of a page.",
        )
    return tuple(key)
