"""Processor time of the service's threads, as Linux counts it anyway: nothing is measured on the way of a sample."""

import threading
from collections.abc import Mapping
from pathlib import Path

__all__ = ["STAGES", "ProcessorTimes"]

STAGES: Mapping[str, str] = {
    "wingwatch-subscriber": "receive",
    "wingwatch-pump": "estimate",
    "wingwatch-store": "store",
    "wingwatch-recall": "recall",
    "wingwatch-checkpoints": "checkpoints",
    "wingwatch-outputs": "publish",
    "wingwatch-recorder": "record",
    "wingwatch-http": "http",
    "wingwatch-diagnoses": "diagnoses",
    "wingwatch-alert-diagnoses": "diagnoses",
    "wingwatch-alert-watch": "diagnoses",
    "wingwatch-notify": "notify",
}
"""What each long-lived thread does, by its name."""

_TASKS = Path("/proc/self/task")


class ProcessorTimes:
    """Sums by stage that never fall, also where a thread has ended and another has taken its place.

    Args:
        tasks: folder of the process's threads.
    """

    def __init__(self, tasks: Path = _TASKS) -> None:
        self._tasks = tasks
        self._seen: dict[tuple[str, int], float] = {}
        self._ended: dict[str, float] = dict.fromkeys(STAGES.values(), 0.0)
        self._lock = threading.Lock()

    def by_stage(self) -> Mapping[str, float]:
        """Seconds by stage; all 0 where the system does not count them."""
        with self._lock:
            running = {
                (STAGES[thread.name], thread.native_id): 0.0
                for thread in threading.enumerate()
                if thread.name in STAGES and thread.native_id is not None
            }
            for one in running:
                running[one] = max(self._read(one[1]), self._seen.get(one, 0.0))
            for one in self._seen.keys() - running.keys():
                self._ended[one[0]] += self._seen[one]
            self._seen = running
            total = dict(self._ended)
            for (stage, _), seconds in running.items():
                total[stage] += seconds
            return total

    def _read(self, task: int) -> float:
        try:
            return 1e-9 * int((self._tasks / str(task) / "schedstat").read_text(encoding="ascii").split()[0])
        except (OSError, ValueError, IndexError):  # it has just ended, or the system has no such file
            return 0.0
