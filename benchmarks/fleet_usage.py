"""What a service, or a gateway with its workers, has used so far: processor time, memory, what it dropped."""

import os
import resource
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from service_process import processor_time_s

from wingwatch.service.service import Service
from wingwatch.service.workers.gateway import Gateway

__all__ = ["Usage", "all_ready", "usage_of_service", "usage_of_workers"]


@dataclass(frozen=True, slots=True)
class Usage:
    """What the service has used and taken in so far, in all its processes; ``threads_s`` by thread, or by process."""

    stages_s: dict[str, float]
    threads_s: dict[str, float]
    processor_s: float
    resident_bytes: int
    peak_bytes: int
    received: int
    problems: dict[str, int]


def all_ready(running: Service | Gateway, workers: int, patience_s: float) -> bool:
    """Wait until every worker takes samples in; whether all do."""
    until_s = time.monotonic() + patience_s
    if not running.wait(patience_s) or isinstance(running, Service):
        return isinstance(running, Service)
    while time.monotonic() < until_s:
        states = [state for state, _ in running.fleet.states().values() if state is not None]
        if len(states) == workers and not any(state.problems for state in states):
            return True
        time.sleep(0.1)
    return False


def usage_of_service(service: Service, stages_s: Mapping[str, float]) -> Usage:
    """Of a service in this process."""
    counters = service.counters()
    peak_bytes = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return Usage(
        dict(stages_s), _threads_s(), time.process_time(), _memory_bytes("self", "VmRSS"), peak_bytes,
        counters["messages"]["received"], _dropped(counters),
    )  # fmt: skip


def usage_of_workers(gateway: Gateway) -> Usage:
    """Of a gateway in this process and its workers in theirs."""
    counters = gateway.counters()
    pids = [] if gateway.children is None else gateway.children.pids
    own = {f"worker {k + 1}": processor_time_s(pid) for k, pid in enumerate(pids)}
    spent_s = {"gateway": processor_time_s(os.getpid()), **own}
    everyone = ("self", *map(str, pids))
    return Usage(
        {}, spent_s, sum(spent_s.values()), sum(_memory_bytes(pid, "VmRSS") for pid in everyone),
        sum(_memory_bytes(pid, "VmHWM") for pid in everyone), counters["messages"]["received"], _dropped(counters),
    )  # fmt: skip


def _dropped(counters: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
    return {
        f"{part}: {name}": n
        for part, counts in counters.items()
        for name, n in counts.items()
        if n and name != "received"
    }


def _threads_s() -> dict[str, float]:
    """Processor time of this process's own threads so far; Zenoh's are not among them."""
    spent_s = {}
    for thread in threading.enumerate():
        nanoseconds = (
            Path(f"/proc/self/task/{thread.native_id}/schedstat").read_text(encoding="ascii").split()[0]
        )
        spent_s[thread.name] = 1e-9 * int(nanoseconds)
    return spent_s


def _memory_bytes(pid: str, what: str) -> int:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(f"{what}:"))
