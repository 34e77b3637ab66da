"""Tasks flown by the workers of a Dask cluster."""

import threading
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

from wingwatch.studies.grid import StudyError
from wingwatch.studies.run import Answer, Task, fly_task

__all__ = ["DaskWorkers"]

_CONNECT_S = 20
_LOOK_S = 1.0


class DaskWorkers:
    """The workers behind a scheduler; Dask itself flies again what a dead worker had not finished.

    Args:
        address: of the scheduler, such as ``tcp://127.0.0.1:8786``.

    Raises:
        StudyError: Dask is not installed, or nothing answers there.
    """

    def __init__(self, address: str) -> None:
        try:
            import distributed  # an extra: only a study on a cluster needs it
        except ImportError:
            raise StudyError(
                "--scheduler needs Dask, which is not installed; install wingwatch with its extra dask"
            ) from None
        self._distributed = distributed
        try:
            self._client = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise StudyError(
                f"no Dask scheduler answers at {address} ({type(error).__name__}); correct the address or start it"
            ) from None

    def answers(self, tasks: Sequence[Task], end: threading.Event) -> Iterator[Answer]:
        """See ``Workers``."""
        waiting = deque(tasks)
        under_way: dict[Any, Task] = {}
        try:
            while (waiting or under_way) and not end.is_set():
                most = 2 * max(1, sum(self._client.nthreads().values()))
                while waiting and len(under_way) < most:
                    task = waiting.popleft()
                    under_way[self._client.submit(fly_task, task, pure=False)] = task
                for future in self._done(list(under_way)):
                    yield self._answer(future, under_way.pop(future))
        finally:
            self._client.cancel(list(under_way))
            self._client.close()

    def _done(self, futures: list[Any]) -> list[Any]:
        try:
            with self._client.as_current():
                self._distributed.wait(futures, timeout=_LOOK_S, return_when="FIRST_COMPLETED")
        except TimeoutError:
            return []
        return [future for future in futures if future.done()]

    def _answer(self, future: Any, task: Task) -> Answer:
        try:
            answer: Answer = future.result()
        except Exception as error:
            return Answer(task, (), problem=" ".join(f"{type(error).__name__}: {error}".split())[:300])
        return answer
