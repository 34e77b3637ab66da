"""A worker as a process of ``wingwatch serve --workers``: settings come on standard input, whose end is its end."""

import os
import signal
import sys
import threading
from types import FrameType

# Before numpy is loaded: its matrices are of a dozen rows here, and threads that share one wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from wingwatch.operations.faults import say, user_error
from wingwatch.service.kernel_wheel import take_or_say
from wingwatch.service.logs import configure_logs
from wingwatch.service.settings import ServeSettings
from wingwatch.service.workers.worker import running_worker

__all__ = ["main"]

_LEAVE_S = 1.0
"""All workers of a command end with it; those of other machines take over what is left."""

_MOST_BYTES = 1_000_000


def main() -> int:
    """Watch until the end is asked for or the parent has gone; the exit code."""
    end = threading.Event()

    def handle(_number: int, _frame: FrameType | None) -> None:
        end.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handle)
    settings = ServeSettings.model_validate_json(sys.stdin.buffer.readline(_MOST_BYTES))
    configure_logs(settings.log_format)
    take_or_say()
    threading.Thread(target=_watch_parent, args=(end,), name="wingwatch-parent", daemon=True).start()
    try:
        with running_worker(settings, leave_s=_LEAVE_S):
            end.wait()
    except Exception as error:
        sentence = user_error(error)
        if sentence is None:
            raise
        say(f"error: a worker cannot start: {sentence}")
        return 2
    # All is closed. What the interpreter and its compiler take apart at their own end is memory, and takes two seconds;
    # kernels that are still being loaded would crash it.
    sys.stderr.flush()
    os._exit(0)


def _watch_parent(end: threading.Event) -> None:
    """Standard input is closed where the parent ends, however it does."""
    while os.read(sys.stdin.fileno(), 1024):
        pass
    end.set()


if __name__ == "__main__":
    sys.exit(main())
