"""Alerts of the running service diagnosed: which are, when, and what becomes of the answers.

A thread of its own looks at the fleet's events once a second. An alert of the airframe or of unclear cause is diagnosed
once, a second time with more flight where that decided nothing, and anew where its monitor changes its cause. The work
is done by ``DiagnosisJobs``.
"""

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Protocol, Self

from wingwatch.api import DiagnosisView, QueueFullError
from wingwatch.monitor import AlertFinding, AlertFlight, AlertState, AlertView, Event
from wingwatch.operations.diagnosis_change import ChangeRequest
from wingwatch.service.alert_findings import asked_causes, finding_of, refused
from wingwatch.service.loops import Loop

__all__ = ["AlertDiagnoses", "DiagnosedFleet", "Jobs", "is_diagnosed"]

_LOG = logging.getLogger(__name__)
_LOOK_S = 1.0
_JOIN_S = 2.0
_AFTER_S, _AGAIN_S = 12.0, 45.0
"""Of flight since the onset that a diagnosis waits for, and a second one after one that decided nothing; by the
service's clock since the alert, and since that answer, at most."""
_MOST_PENDING = 100


class DiagnosedFleet(Protocol):
    """What is needed of the fleet's monitor."""

    def events(self, after: int) -> Sequence[Event]:
        """Events with an id above ``after``, oldest first."""
        ...

    def alert_flight(self, alert_id: str) -> AlertFlight | None:
        """The last minutes of the vehicle of an alert in force."""
        ...

    def note_diagnosis(self, alert_id: str, finding: AlertFinding) -> bool:
        """A diagnosis says something about an alert."""
        ...


class Jobs(Protocol):
    """What is needed of ``DiagnosisJobs``."""

    def diagnose(self, request: ChangeRequest, ended: Callable[[DiagnosisView], None]) -> DiagnosisView:
        """Queue a diagnosis; QueueFullError where no further one is taken."""
        ...


def is_diagnosed(alert: AlertView) -> bool:
    """Whether an alert is of the airframe or of unclear cause; a channel that is named needs no simulation."""
    if alert.kind == "sensor":
        return False
    return alert.channel is None or alert.cause == "unknown" or len(alert.candidates) > 1


class AlertDiagnoses:
    """Has alerts diagnosed; use it in a ``with`` statement.

    Args:
        fleet: whose alerts.
        jobs: that diagnose.
        clock: monotonic seconds.

    Attributes:
        counts: alerts by what became of their diagnosis: ``begun``, ``refused`` (the queue is full), ``decided``,
            ``undecided``, ``failed``, ``late`` (the alert is no longer kept).
        loop: the thread.
    """

    def __init__(
        self, fleet: DiagnosedFleet, jobs: Jobs, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._fleet, self._jobs, self._clock = fleet, jobs, clock
        self._seen = 0
        self._pending: dict[str, tuple[float, float]] = {}  # since when, and for how much flight
        self._begun: dict[str, tuple[str, str | None, int]] = {}  # by which cause, and how often
        self._undecided: deque[str] = deque(maxlen=_MOST_PENDING)
        self._ending = threading.Event()
        self.counts = Counter(
            dict.fromkeys(("begun", "refused", "decided", "undecided", "failed", "late"), 0)
        )
        self.loop = Loop("wingwatch-alert-watch", "the loop that has alerts diagnosed", self._run)

    def __enter__(self) -> Self:
        self.loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self.loop.join(_JOIN_S)

    def look(self) -> None:
        """Take in what is new, and begin what is due."""
        for event in self._fleet.events(self._seen):
            self._seen = event.id
            if event.kind == "alert" and event.data["state"] != str(AlertState.CLEARED):
                self._wait_for(event.data)
        while self._undecided:
            self._pending[self._undecided.popleft()] = self._clock(), _AGAIN_S
        for alert_id, (since_s, needed_s) in list(self._pending.items()):
            flight = self._fleet.alert_flight(alert_id)
            if flight is None or not self._wanted(flight.alert, needed_s):
                self._pending.pop(alert_id)
            elif self._due(flight, since_s, needed_s):
                self._pending.pop(alert_id)
                self._begin(flight)

    def _run(self) -> None:
        while not self._ending.wait(_LOOK_S):
            self.look()

    def _wait_for(self, data: Mapping[str, object]) -> None:
        alert_id = str(data["id"])
        if data["kind"] != "sensor" and len(self._pending) < _MOST_PENDING:
            self._pending.setdefault(alert_id, (self._clock(), _AFTER_S))

    def _wanted(self, alert: AlertView, needed_s: float) -> bool:
        """Whether an alert is to be diagnosed that has, or has not, been so by this cause."""
        *by, times = self._begun.get(alert.id, ("", None, 0))
        anew = by != [alert.cause, alert.channel]
        return is_diagnosed(alert) and (anew or (times == 1 and needed_s == _AGAIN_S))

    def _due(self, flight: AlertFlight, since_s: float, needed_s: float) -> bool:
        flown = bool(len(flight.time_s)) and flight.time_s[-1] - flight.onset_s >= needed_s
        return flown or self._clock() - since_s >= needed_s

    def _begin(self, flight: AlertFlight) -> None:
        alert = flight.alert
        while len(self._begun) >= 10 * _MOST_PENDING:
            self._begun.pop(next(iter(self._begun)))
        *by, times = self._begun.get(alert.id, ("", None, 0))
        same = by == [alert.cause, alert.channel]
        self._begun[alert.id] = alert.cause, alert.channel, times + 1 if same else 1
        request = ChangeRequest(
            f"alert {alert.id} of {alert.fleet}/{alert.vehicle}", flight.aircraft, flight.kinds, flight.onset_s,
            asked_causes(alert), flight.names, flight.time_s, flight.values,
        )  # fmt: skip
        try:
            self._jobs.diagnose(request, partial(self._ended, alert))
        except QueueFullError as full:
            self.counts["refused"] += 1
            self._fleet.note_diagnosis(alert.id, refused(alert, str(full)))
        else:
            self.counts["begun"] += 1

    def _ended(self, alert: AlertView, view: DiagnosisView) -> None:
        finding = finding_of(alert, view)
        failed = view.result is None
        self.counts["failed" if failed else "decided" if finding.correction is not None else "undecided"] += 1
        if not self._fleet.note_diagnosis(alert.id, finding):
            self.counts["late"] += 1
        elif finding.correction is None and not failed:
            self._undecided.append(alert.id)
        _LOG.info("alert %s of %s/%s: %s", alert.id, alert.fleet, alert.vehicle, finding.note)
