"""What a gateway makes of several workers: their diagnoses as one list, their counters and figures as one service's."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from wingwatch.api import (
    DelayView,
    DiagnosisView,
    KernelsView,
    QueueView,
    ServiceFigures,
    WorkerView,
)
from wingwatch.api.ports import DiagnosisUpload
from wingwatch.service.diagnosis_jobs import DiagnosisJobs
from wingwatch.service.workers.messages import WorkerState
from wingwatch.service.workers.remote_fleet import RemoteFleet

__all__ = ["JoinedDiagnoses", "joined_figures", "kernels_of", "summed", "worker_views"]

_States = Mapping[str, tuple[WorkerState | None, float]]


class JoinedDiagnoses:
    """Implements the door's ``DiagnosisPort``: flights are diagnosed here, alerts where their vehicles are watched.

    Args:
        jobs: of uploaded flights.
        fleet: whose workers diagnose alerts.
    """

    def __init__(self, jobs: DiagnosisJobs, fleet: RemoteFleet) -> None:
        self._jobs, self._fleet = jobs, fleet

    def open(self, aircraft: str, channel_map: str, file: str) -> DiagnosisUpload:
        """Reserve a place in the queue of flights."""
        return self._jobs.open(aircraft, channel_map, file)

    def diagnoses(self) -> Sequence[DiagnosisView]:
        """Flights first, then alerts; each newest first."""
        return [*self._jobs.diagnoses(), *self._fleet.diagnoses()]

    def report(self, diagnosis_id: str) -> bytes | None:
        """The HTML report of one that is done."""
        return self._jobs.report(diagnosis_id) or self._fleet.report(diagnosis_id)

    def remove(self, diagnosis_id: str) -> bool:
        """Cancel or forget a flight's; an alert's stays with its worker."""
        return self._jobs.remove(diagnosis_id)


def worker_views(states: _States) -> list[WorkerView]:
    """Workers by name, each with how long it has been silent; those that have said nothing yet without figures."""
    return [
        WorkerView(name, "", 0, 0.0, 0.0, 0, silent_s=silent_s)
        if state is None
        else replace(state.view, silent_s=silent_s)
        for name, (state, silent_s) in sorted(states.items())
    ]


def summed(*several: Mapping[str, Mapping[str, int]]) -> dict[str, dict[str, int]]:
    """Counters of several, by part and name."""
    total: dict[str, Counter[str]] = {}
    for counters in several:
        for part, counts in counters.items():
            total.setdefault(part, Counter()).update(counts)
    return {part: dict(counts) for part, counts in total.items()}


def joined_figures(own: ServiceFigures, workers: Sequence[ServiceFigures]) -> ServiceFigures:
    """The workers' delays, queues and processor times together with the gateway's own.

    A queue is as long as all of its name together, and as old as the oldest entry in any.
    """
    queues: dict[str, QueueView] = dict(own.queues)
    processor_s: Counter[str] = Counter(own.processor_s)
    for one in workers:
        for name, queue in one.queues.items():
            queues[name] = _longer(queues.get(name), queue)
        processor_s.update(one.processor_s)
    settings = next((one.settings for one in workers), own.settings)
    return replace(
        own,
        settings=settings,
        delay=_delays([one.delay for one in workers]),
        queues=queues,
        processor_s=dict(processor_s),
    )


def _longer(one: QueueView | None, other: QueueView) -> QueueView:
    if one is None:
        return other
    ages = [age for age in (one.age_s, other.age_s) if age is not None]
    return QueueView(one.length + other.length, max(ages, default=None))


def _delays(delays: Sequence[DelayView]) -> DelayView:
    if not delays:
        return DelayView((), (0,), 0.0)
    limits = delays[0].limits_s
    alike = [one for one in delays if list(one.limits_s) == list(limits)]
    counts = tuple(sum(column) for column in zip(*(one.counts for one in alike), strict=True))
    return DelayView(limits, counts, sum(one.total_s for one in alike))


def kernels_of(states: _States) -> KernelsView | None:
    """The compilation of kernels, while it goes on in any worker."""
    found = (state.kernels for state, _ in states.values() if state is not None)
    return next((view for view in found if view is not None), None)
