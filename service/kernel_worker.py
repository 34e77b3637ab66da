"""The process in which kernels are compiled, behind the service's back.

``python -m wingwatch.service.kernel_worker`` reads names of steps from standard input, one a line, and answers each on
standard output with a line of JSON: ``{"problem": null}``, or one sentence. It ends when its standard input does: with
the service. A step that can wait (``later NAME``) yields to whatever else wants the processor from then on.
"""

import contextlib
import errno
import fcntl
import json
import os
import queue
import sys
import threading
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

from wingwatch.service.kernel_steps import STEPS

__all__ = ["LATER", "compile_step", "main", "one_writer"]

LATER = "later "
_LOWEST_PRIORITY = 19


def main() -> int:
    """Compile what is asked for, until nobody asks any more."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what libraries print is no answer
    asked: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(asked,), daemon=True).start()
    with one_writer():
        while True:
            name = asked.get()
            if name.startswith(LATER):
                os.setpriority(os.PRIO_PROCESS, 0, _LOWEST_PRIORITY)
            answers.write(json.dumps({"problem": compile_step(name.removeprefix(LATER))}) + "\n")
            answers.flush()


def compile_step(name: str) -> str | None:
    """Compile one step's kernels; None where all went well, else a sentence without a full stop."""
    try:
        STEPS[name].run()
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        remedy = (
            "free some hundred megabytes" if full else "let NUMBA_CACHE_DIR name a folder that can be written"
        )
        return f"what is compiled cannot be kept ({(error.strerror or str(error)).lower()}); {remedy}, then start again"
    except MemoryError:
        return "the memory is used up; close other programs, then start again"
    except Exception as error:
        return f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
    return None


@contextlib.contextmanager
def one_writer() -> Iterator[None]:
    """Let one process at a time write into a folder of numba's cache.

    numba reads the index of a function's compiled forms, adds one and writes it back. Two processes that do so at once
    would lose a form, or take the other's for their own.
    """
    index: Any = import_module("numba.core.caching").IndexDataCacheFile
    save: Callable[..., Any] = index.save

    def save_alone(self: Any, key: Any, data: Any) -> None:
        folder = os.open(self._cache_path, os.O_RDONLY)
        try:
            fcntl.flock(folder, fcntl.LOCK_EX)
            save(self, key, data)
        finally:
            os.close(folder)

    index.save = save_alone
    try:
        yield
    finally:
        index.save = save


def _listen(asked: queue.SimpleQueue[str]) -> None:
    for line in sys.stdin:
        asked.put(line.strip())
    os._exit(0)  # also in the middle of a compilation, which cannot be interrupted


if __name__ == "__main__":
    sys.exit(main())
