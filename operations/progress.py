"""Progress and results for a person: on a terminal only, and never on standard output."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import orjson
from rich.console import Console
from rich.progress import Progress as Bar

__all__ = ["Progress", "page", "write_json"]

T = TypeVar("T")

_PLAIN_WIDTH = 130
"""Columns of a table that is written to a file or a pipe, which have no width of their own."""


class Progress:
    """Shows how far a long task is, where standard error is a terminal.

    Args:
        shown: whether it does at all; one of several processes shows nothing.
    """

    def __init__(self, shown: bool = True) -> None:
        self._console = Console(stderr=True, force_terminal=None if shown else False)

    def track(self, items: Sequence[T], what: str) -> Iterator[T]:
        """The items one by one, with a bar."""
        if not self._console.is_terminal:
            yield from items
            return
        with Bar(console=self._console, transient=True) as bar:
            yield from bar.track(items, description=what)

    @contextmanager
    def count(self, total: int, what: str) -> Iterator[Callable[[int], None]]:
        """A bar that is set by the function this gives."""
        if not self._console.is_terminal:
            yield lambda done: None
            return
        with Bar(console=self._console, transient=True) as bar:
            task = bar.add_task(what, total=total)
            yield lambda done: bar.update(task, completed=done)

    @contextmanager
    def follow(self) -> Iterator[Callable[[str, float], None]]:
        """A bar that is set by what is being done and the fraction done."""
        if not self._console.is_terminal:
            yield lambda what, fraction: None
            return
        with Bar(console=self._console, transient=True) as bar:
            task = bar.add_task("", total=1.0)
            yield lambda what, fraction: bar.update(task, description=what, completed=fraction)


def page() -> Console:
    """Where results for a person are written."""
    return Console(width=None if sys.stdout.isatty() else _PLAIN_WIDTH, highlight=False)


def write_json(value: Any) -> None:
    """A machine result as one line; floats read back to the same bits, what is not finite is null."""
    sys.stdout.write(orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY).decode() + "\n")
    sys.stdout.flush()
