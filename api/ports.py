"""What the REST door needs from others beside the monitor: history, diagnoses, the service's own figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import FlightRecord, HistoryColumns, HistoryKey, HistoryRow, HistoryWanted

__all__ = [
    "BaselinePort",
    "BaselineQuestion",
    "BaselineRevert",
    "DelayView",
    "DiagnosisPort",
    "DiagnosisState",
    "DiagnosisUpload",
    "DiagnosisView",
    "HistoryPort",
    "KernelPart",
    "KernelState",
    "KernelsView",
    "QueueFullError",
    "QueueView",
    "ServiceFigures",
    "StudyPort",
    "StudyView",
    "WorkerSilentError",
    "WorkerView",
]


class HistoryPort(Protocol):
    """Where stored estimates are read from. Called from worker threads, and answers in a bounded time."""

    def history_rows(self, fleet: str, vehicle: str, wanted: HistoryWanted) -> Sequence[HistoryRow]:
        """A part of a vehicle's history, by flight, time, estimator and structure.

        Raises:
            DatabaseError: it cannot be read now.
        """
        ...

    def history_columns(
        self, fleet: str, vehicle: str, wanted: HistoryWanted
    ) -> tuple[Sequence[HistoryColumns], HistoryKey | None]:
        """The same as columns, by flight, estimator and structure, and the key of the last row where as many rows were
        read as ``wanted.limit``: there may be more from it on; ``DatabaseError`` likewise."""
        ...

    def flights(self, fleet: str, vehicle: str) -> Sequence[FlightRecord]:
        """Flights of which estimates are kept, the newest first; ``DatabaseError`` likewise."""
        ...


@dataclass(frozen=True, slots=True)
class BaselineQuestion:
    """What of the baseline is asked for.

    Attributes:
        vehicle: whose flights' teaching; None for nobody's.
        at: true airspeed and altitude at which expectation and flights are set side by side; cruise where None.
    """

    aircraft: Aircraft
    configuration: str
    convention: str
    fleet: str
    vehicle: str | None
    at: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class BaselineRevert:
    """What is to be taken back, and by whom: an entry, or all versions of a vehicle after one; else the newest."""

    aircraft: str
    configuration: str
    structure: str | None
    fleet: str
    vehicle: str | None
    entry: int | None
    version: int | None
    who: str
    note: str


@dataclass(frozen=True, slots=True)
class BaselineImport:
    """What `wingwatch baseline export` wrote, to be put into the database, and by whom.

    Attributes:
        aircraft: name; all of the document must be of it.
        document: the file's JSON value.
    """

    aircraft: str
    document: Mapping[str, Any]
    who: str
    note: str


class BaselinePort(Protocol):
    """The baseline, as objects. Called from worker threads, answers in a bounded time, may raise ``DatabaseError``."""

    def listed(self) -> Mapping[str, Any]:
        """What the database knows something of."""
        ...

    def shown(self, question: BaselineQuestion) -> Mapping[str, Any]:
        """What counts now.

        Raises:
            ValueError: the aircraft cannot be shown so; one sentence.
        """
        ...

    def past(self, question: BaselineQuestion) -> Mapping[str, Any]:
        """All that there ever was; ``ValueError`` as for ``shown``."""
        ...

    def imported(self, request: BaselineImport) -> Mapping[str, Any]:
        """Put a file's content into the database: all of it or nothing; how much there was, and how much was new.

        Raises:
            ValueError: it is no whole file, or of other units, derivatives or aircraft; one sentence.
        """
        ...

    def reverted(self, request: BaselineRevert) -> Mapping[str, Any]:
        """Take something back: what was, and what counts again.

        Raises:
            ValueError: there is nothing to take back; one sentence.
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


@dataclass(frozen=True, slots=True)
class DelayView:
    """How long messages took, as a histogram.

    Attributes:
        limits_s: upper limits of the classes, ascending.
        counts: messages of each class; the last class, above all limits, has none.
        total_s: of all messages together.
    """

    limits_s: Sequence[float]
    counts: Sequence[int]
    total_s: float


@dataclass(frozen=True, slots=True)
class QueueView:
    """What waits in a queue: how much, and for how long the oldest of it; None where that is not noted."""

    length: int
    age_s: float | None = None


@dataclass(frozen=True, slots=True)
class ServiceFigures:
    """The service in numbers, each of them there without asking anybody.

    Attributes:
        settings: fingerprint of the estimators' and the test's settings.
        delay: from a message's arrival until its samples are estimated from.
        queues: by name.
        links: of Zenoh, by kind of the other side.
        processor_s: processor time since the start, by stage.
        connections: of HTTP that are open.
    """

    settings: str = ""
    delay: DelayView = field(default=DelayView((), (0,), 0.0))
    queues: Mapping[str, QueueView] = field(default_factory=dict)
    links: Mapping[str, int] = field(default_factory=dict)
    processor_s: Mapping[str, float] = field(default_factory=dict)
    connections: int = 0


@dataclass(frozen=True, slots=True)
class WorkerView:
    """A worker: a process that watches vehicles.

    Attributes:
        host, pid: where it runs.
        load: part of the last ten seconds in which it took messages in; at 1 it can take no more.
        capacity: what it takes beside others, as it was set.
        vehicles: that it watches; left_out: those of them that it leaves out, because it is overloaded.
        behind_s: how long the oldest message has waited.
        moves: vehicles ``taken`` over and ``given`` up since it started.
        silent_s: for how long it has not answered; 0 where it does.
    """

    name: str
    host: str
    pid: int
    load: float
    capacity: float
    vehicles: int
    left_out: int = 0
    behind_s: float = 0.0
    moves: Mapping[str, int] = field(default_factory=dict)
    silent_s: float = 0.0


class WorkerSilentError(Exception):
    """The worker that watches a vehicle does not answer; one sentence."""


@dataclass(frozen=True, slots=True)
class StudyView:
    """One finished study.

    Attributes:
        name: of its report's file, without the ending; title: of the report; answer: its heading, what the study found.
        written_at_s: seconds since 1970-01-01 UTC; bytes: of the report.
    """

    name: str
    title: str
    answer: str
    written_at_s: float
    bytes: int


class StudyPort(Protocol):
    """Finished studies. Every method is thread-safe."""

    def studies(self) -> Sequence[StudyView]:
        """Those whose report can be read, newest first."""
        ...

    def report(self, name: str) -> bytes | None:
        """The HTML report of the study of this name; None without."""
        ...


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
