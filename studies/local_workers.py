"""Tasks flown by processes of this machine."""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import Connection

from wingwatch.studies.run import Answer, Task, fly_task

__all__ = ["LocalWorkers"]

_LOOK_S = 0.5
_MOST_ATTEMPTS = 3
"""After which a task whose worker dies each time is given up."""


class LocalWorkers:
    """Processes of this machine, each with one thread.

    A worker that dies takes its pool with it; a new pool flies again what was not finished. A task that was under way
    at two such deaths flies alone from then on, so that a third one is surely its own.

    Args:
        workers: how many.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers

    def answers(self, tasks: Sequence[Task], end: threading.Event) -> Iterator[Answer]:
        """See ``Workers``."""
        waiting = deque(tasks)
        attempts: dict[int, int] = {}
        while waiting and not end.is_set():
            dropped: list[Task] = []
            yield from self._pool(waiting, attempts, dropped, end)
            for task in sorted(dropped, key=lambda t: t.index):
                attempts[task.index] = attempts.get(task.index, 0) + 1
                if attempts[task.index] >= _MOST_ATTEMPTS:
                    yield Answer(task, (), problem="the worker process ended each time this batch was flown")
                else:
                    waiting.append(task)

    def _pool(
        self, waiting: deque[Task], attempts: dict[int, int], dropped: list[Task], end: threading.Event
    ) -> Iterator[Answer]:
        """Fly until all is flown or a worker dies; the tasks under way then are ``dropped``."""
        spawn = multiprocessing.get_context("spawn")
        lifeline, ours = spawn.Pipe(duplex=False)
        pool = ProcessPoolExecutor(min(self._workers, len(waiting)), spawn, _set_up, (lifeline,))
        under_way: dict[Future[Answer], Task] = {}
        try:
            while (waiting or under_way) and not end.is_set() and not dropped:
                self._submit(pool, waiting, attempts, under_way)
                done, _ = wait(under_way, _LOOK_S, FIRST_COMPLETED)
                for future in done:
                    task = under_way.pop(future)
                    try:
                        answer = future.result()
                    except BrokenProcessPool:
                        dropped.append(task)
                        continue
                    except Exception as error:
                        answer = Answer(task, (), problem=f"{type(error).__name__}: {error}"[:300])
                    yield answer
        except BrokenProcessPool:
            pass
        finally:
            dropped += under_way.values()
            ours.close()  # ends every worker, busy or not
            lifeline.close()
            pool.shutdown(cancel_futures=True)

    def _submit(
        self, pool: ProcessPoolExecutor, waiting: deque[Task], attempts: dict[int, int],
        under_way: dict[Future[Answer], Task],
    ) -> None:  # fmt: skip
        """Keep every worker busy with one task more than it flies."""
        while waiting and len(under_way) < 2 * self._workers:
            alone = attempts.get(waiting[0].index, 0) >= _MOST_ATTEMPTS - 1
            if under_way and (
                alone or any(attempts.get(t.index, 0) >= _MOST_ATTEMPTS - 1 for t in under_way.values())
            ):
                return
            with _ignoring_ctrl_c():
                under_way[pool.submit(fly_task, waiting[0])] = waiting[0]
            waiting.popleft()


@contextmanager
def _ignoring_ctrl_c() -> Iterator[None]:
    """Processes started inside never get SIGINT, not even while they load: the client ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _set_up(lifeline: Connection) -> None:
    """In a worker: end when the client closes the line or is no more."""
    threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()


def _end_with(lifeline: Connection) -> None:
    try:
        lifeline.recv()
    except (EOFError, OSError):
        os._exit(1)
