"""What every route may use: the ports behind the door, and the questions that several routes ask them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import TypeVar

from starlette.concurrency import run_in_threadpool

from wingwatch.aircraft import Aircraft
from wingwatch.api.events import EventStreams
from wingwatch.api.ports import (
    BaselinePort,
    DiagnosisPort,
    HistoryPort,
    KernelsView,
    ServiceFigures,
    StudyPort,
    WorkerView,
)
from wingwatch.api.problems import ProblemError
from wingwatch.monitor.views import MonitorPort, VehicleView

__all__ = ["Door"]

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Door:
    """The parts that routes translate between.

    Attributes:
        readiness: per part (``zenoh``, ``database``, ``http``) None or its problem, one sentence.
        history: None where estimates are not kept.
        counters: of the service, by part.
        aircraft: an aircraft by its announced name; ValueError with one sentence where there is none.
        diagnoses: None where flights are not diagnosed.
        kernels: the compilation of the numerical kernels while it goes on, and where it failed; else None.
        database_problem: why entries wait for the database, without asking it; None while none does.
        problems: of each part of the service None or its problem, without asking the database.
        figures: the service in numbers.
        baselines: None where there is no baseline database.
        studies: None where none are shown.
        workers: processes that watch vehicles, by name.
        waits: whether the monitor's answers about one vehicle take time.
    """

    monitor: MonitorPort
    readiness: Callable[[], Mapping[str, str | None]]
    history: HistoryPort | None
    version: str
    aircraft: Callable[[str], Aircraft]
    streams: EventStreams
    counters: Callable[[], Mapping[str, Mapping[str, int]]] = dict
    diagnoses: DiagnosisPort | None = None
    kernels: Callable[[], KernelsView | None] = lambda: None
    database_problem: Callable[[], str | None] = lambda: None
    problems: Callable[[], Mapping[str, str | None]] = dict
    figures: Callable[[], ServiceFigures] = ServiceFigures
    baselines: BaselinePort | None = None
    studies: StudyPort | None = None
    workers: Callable[[], Sequence[WorkerView]] = tuple
    waits: bool = False

    async def asked(self, question: Callable[[], T]) -> T:
        """The answer to a question about one vehicle: in a thread where it takes time, else at once."""
        return await run_in_threadpool(question) if self.waits else question()

    def vehicle(self, fleet: str, vehicle: str) -> VehicleView:
        """One vehicle.

        Raises:
            ProblemError: 404 for an unknown vehicle.
        """
        view = self.monitor.vehicle(fleet, vehicle)
        if view is not None:
            return view
        raise ProblemError(
            HTTPStatus.NOT_FOUND,
            f"Vehicle '{vehicle}' of fleet '{fleet}' is unknown; /v1/vehicles lists all, "
            "and ?fleet= names a fleet other than 'default'.",
        )
