"""Ending on Ctrl-C or SIGTERM: asked once the process ends in order, asked twice at once."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from wingwatch.operations.faults import say

__all__ = ["asked_to_end", "leave", "leave_at_once"]

_AT_ONCE = 130


@contextmanager
def asked_to_end() -> Iterator[threading.Event]:
    """An event that SIGINT or SIGTERM sets; the handlers before are put back on the way out.

    Outside the main thread, where no handler can be set, only the caller sets it.
    """
    end = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield end
        return

    def handle(_number: int, _frame: FrameType | None) -> None:
        if end.is_set():
            os._exit(_AT_ONCE)
        end.set()

    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield end
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def leave(code: int, busy: bool) -> int:
    """The exit code; ends the process right here if a thread is ``busy`` with what cannot be interrupted.

    Kernels that are still being loaded would otherwise crash or delay the interpreter's own end.
    """
    if busy:
        say("left while kernels were being loaded; that starts anew next time")
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


def leave_at_once(code: int) -> NoReturn:
    """End the process once all has been closed in order: what the interpreter and its compiler take apart then is
    memory, which takes them two seconds, and the system none."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
