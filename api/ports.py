"""What the REST door needs from others beside the monitor: history, diagnoses, and how far the compilation is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Protocol

from wingwatch.baselines import HistoryRow, HistoryWanted

__all__ = [
    "DiagnosisPort",
    "DiagnosisState",
    "DiagnosisUpload",
    "DiagnosisView",
    "HistoryPort",
    "KernelPart",
    "KernelState",
    "KernelsView",
    "QueueFullError",
]


class HistoryPort(Protocol):
    """Where stored estimates are read from. Called from worker threads, and answers in a bounded time."""

    def history_rows(self, fleet: str, vehicle: str, wanted: HistoryWanted) -> Sequence[HistoryRow]:
        """A part of a vehicle's history, by flight, time, estimator and structure.

        Raises:
            DatabaseError: it cannot be read now.
        """
        ...


class DiagnosisState(StrEnum):
    """Where a diagnosis stands."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


@dataclass(frozen=True, slots=True)
class DiagnosisView:
    """One diagnosis.

    Attributes:
        file: what the flight is called.
        ahead: how many wait or run before it.
        doing: what is being done.
        progress: the fraction done.
        problem: why it failed, one sentence; empty where it did not.
        result: the ``diagnose`` object of the contract, once done.
    """

    id: str
    state: DiagnosisState
    aircraft: str
    file: str
    ahead: int
    doing: str
    progress: float
    problem: str
    result: Mapping[str, Any] | None


class KernelState(StrEnum):
    """Where a part of the numerical kernels stands."""

    WAITING = "waiting"
    COMPILING = "compiling"
    COMPILED = "compiled"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class KernelPart:
    """A part of the numerical kernels that is compiled in one go.

    Attributes:
        name: what it computes, in words.
        first: whether no sample is taken in before it is compiled.
    """

    name: str
    state: KernelState
    first: bool


@dataclass(frozen=True, slots=True)
class KernelsView:
    """The compilation of the numerical kernels, which a machine goes through once.

    Attributes:
        text: what is being compiled, what is done and how long it takes: one sentence.
        elapsed_s: time since it began.
        remaining_s: time until samples are taken in, as the parts done so far let expect; None where that is not known.
    """

    text: str
    parts: Sequence[KernelPart]
    elapsed_s: float
    remaining_s: float | None


class QueueFullError(Exception):
    """No further diagnosis is taken now; one sentence."""


class DiagnosisUpload(Protocol):
    """A place in the queue whose flight is still coming in; either submit or discard it."""

    def write(self, content: bytes) -> None:
        """The flight file's next bytes."""
        ...

    def submit(self) -> DiagnosisView:
        """The flight is whole: queue it."""
        ...

    def discard(self) -> None:
        """Give the place back; nothing happens after a submit."""
        ...


class DiagnosisPort(Protocol):
    """Jobs that diagnose flights, elsewhere than in the door's process. Every method is thread-safe."""

    def open(self, aircraft: str, channel_map: str, file: str) -> DiagnosisUpload:
        """Reserve a place in the queue.

        Args:
            aircraft: its name.
            channel_map: TOML; empty for none.
            file: what the flight is called.

        Raises:
            ValueError: no such aircraft, or no channel map; one sentence.
            QueueFullError: as many wait as may.
        """
        ...

    def diagnoses(self) -> Sequence[DiagnosisView]:
        """All that are kept, newest first."""
        ...

    def report(self, diagnosis_id: str) -> bytes | None:
        """The HTML report of one that is done; None without."""
        ...

    def remove(self, diagnosis_id: str) -> bool:
        """Cancel one that waits or runs, forget one that has ended; False where there is none."""
        ...
