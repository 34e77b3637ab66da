"""How a long task tells whoever waits which step it is at."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

__all__ = ["Track", "untracked"]

Track = Callable[[Sequence[Any], str], Iterable[Any]]
"""Gives the steps one by one, and may show which; the text says what is being done."""


def untracked(steps: Sequence[Any], what: str) -> Iterable[Any]:
    """The steps; nothing is shown."""
    return steps
