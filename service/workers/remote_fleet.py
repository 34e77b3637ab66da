"""The fleet as a gateway sees it: vehicles that workers watch, asked for over Zenoh (``MonitorPort``).

A thread asks each worker for its events five times a second, and once a second for its vehicles in brief. Views are
made when somebody asks: of all vehicles by all workers at once, of one by its worker. A worker that has not answered is
not asked: its vehicles are shown as they were, ``unknown``, with the reason, and no question waits for it.
"""

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, Self, TypeVar
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from wingwatch.api import DiagnosisView, WorkerSilentError
from wingwatch.baselines import DatabaseError
from wingwatch.monitor import (
    AlertAction,
    AlertGroupView,
    AlertView,
    Event,
    FleetFigures,
    KeyReusedError,
    ManoeuvreView,
    VehicleView,
)
from wingwatch.monitor.record_views import FlightRecordView
from wingwatch.monitor.views import SHELVED_S
from wingwatch.service.loops import Loop
from wingwatch.service.workers import messages as forms
from wingwatch.service.workers.alert_book import AlertBook
from wingwatch.service.workers.link import PATIENCE_S, WorkerLink
from wingwatch.service.workers.messages import Act, AnswerError, Expect, Form, VehicleName, WorkerState
from wingwatch.service.workers.watchers import Key, Watchers

__all__ = ["RemoteFleet"]

Array = NDArray[np.float64]
T = TypeVar("T")

_ASK_S, _READ_S, _READ_AGAIN_S = 0.2, 60.0, 1.0
_ACT_S = 5.0  # the worker waits 3 s for its database
_JOIN_S = PATIENCE_S + 1.0


class RemoteFleet:
    """Implements ``MonitorPort``; use it in a ``with`` statement, inside that of its session.

    Args:
        link: to workers.
        live: names of those that live.
        read_alerts: all alerts of the database, newest first; it may raise.
        heard: called with each new version of an alert, in threads of this object.
        first: of these workers the one that a vehicle belongs to, where none watches it.
        clock: monotonic seconds.

    Attributes:
        counts: answers that were none (``bad_answers``), and those that did not come (``unanswered``).
        loop: asks the workers.
    """

    def __init__(
        self,
        link: WorkerLink,
        live: Callable[[], Sequence[str]],
        read_alerts: Callable[[], Sequence[AlertView]],
        heard: Callable[[AlertView], None] = lambda _: None,
        first: Callable[[Sequence[str], str, str], str] = lambda names, _fleet, _vehicle: names[0],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._link, self._live, self._first = link, live, first
        self._book = AlertBook(read_alerts, heard)
        self._watchers = Watchers(clock)
        self._refreshing = threading.Lock()
        self._answers: deque[tuple[str, bytes | None]] = deque()
        self._woken, self._ending = threading.Event(), threading.Event()
        self._reading = threading.Event()
        self.counts = {"bad_answers": 0, "unanswered": 0}
        self.read_problem: str | None = None
        self.loop = Loop("wingwatch-workers", "the loop that asks workers", self._run, self._woken.set)
        self.reader = Loop(
            "wingwatch-alerts", "the loop that reads alerts", self._keep_reading, self._reading.set
        )

    def __enter__(self) -> Self:
        self.loop.start()
        self.reader.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._woken.set()
        self._reading.set()
        self.loop.join(_JOIN_S)
        self.reader.join(_JOIN_S)

    def look_again(self) -> None:
        """Workers have come or gone; returns at once."""
        self._woken.set()

    # -- the threads -----------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._ending.is_set():
            self._woken.wait(_ASK_S)
            self._woken.clear()
            self.turn()

    def turn(self) -> None:
        """Take in what was answered, see who has come and gone, and ask whoever is due."""
        while self._answers:
            self._take(*self._answers.popleft())
        if self._watchers.follow(set(self._live())):
            self._reading.set()
        for name, wanted in self._watchers.to_ask().items():
            self._link.send(name, "news", forms.NEWS_WANTED.encode(wanted), partial(self._answered, name))

    def _answered(self, name: str, answer: bytes | None) -> None:
        """In Zenoh's thread; one question a worker is out, so little waits."""
        self._answers.append((name, answer))

    def _take(self, name: str, answer: bytes | None) -> None:
        try:
            if answer is None:
                self.counts["unanswered"] += 1
                return self._watchers.unanswered(name)
            news = forms.NEWS.decode(answer)
        except AnswerError:
            self.counts["bad_answers"] += 1
            return self._watchers.unanswered(name)
        self._book.take(tuple(reversed(news.alerts)))
        if news.whole is not None:
            self._book.take_places(news.whole.places)
        return self._watchers.take(name, news)

    def _keep_reading(self) -> None:
        """Read the alerts of the database, now and then and where a worker has ended."""
        while not self._ending.is_set():
            try:
                self._book.look()
                self.read_problem, wait_s = None, _READ_S
            except DatabaseError as error:
                self.read_problem, wait_s = str(error), _READ_AGAIN_S
            self._reading.wait(wait_s)
            self._reading.clear()

    # -- questions about one vehicle -------------------------------------------------------------------

    def _ask(self, worker: str, question: str, payload: bytes) -> bytes:
        """Ask a worker, unless it is known not to answer.

        Raises:
            WorkerSilentError: it does not.
        """
        self._refuse_silent(worker)
        return self._link.ask(worker, question, payload)

    def _refuse_silent(self, worker: str) -> None:
        if silent_s := self._watchers.silent_s(worker):
            raise WorkerSilentError(
                f"worker {worker} has not answered for {silent_s:.0f} s and is not asked; try again later"
            )

    def _of_vehicle(self, question: str, key: Key, form: Form[T]) -> T | None:
        """What a vehicle's worker answers; None where none has it.

        Raises:
            WorkerSilentError: it does not answer, or has ended.
        """
        return self._of_worker(question, key, forms.VEHICLE_NAME.encode(VehicleName(*key)), form)

    def _of_worker(self, question: str, key: Key, payload: bytes, form: Form[T]) -> T | None:
        place = self._watchers.place(key)
        if place is None:
            return None
        if place.worker is None:
            raise WorkerSilentError(f"'{key[1]}' of fleet '{key[0]}': {place.view.reason}; try again later")
        try:
            return form.decode(self._ask(place.worker, question, payload))
        except AnswerError as error:
            self.counts["bad_answers"] += 1
            raise WorkerSilentError(f"worker {place.worker} answers something else: {error}") from None

    # -- what may be asked (MonitorPort) -------------------------------------------------------------

    def vehicles(self) -> Sequence[VehicleView]:
        """All known vehicles, worst state first, as they were within the last half second.

        Those of a worker that does not answer in time are as they were.
        """
        with self._refreshing:
            self._refresh()
        return self._watchers.vehicles()

    def _refresh(self) -> None:
        """Have all workers that answer show their vehicles, at the same time, where they have not just done so."""
        answers: SimpleQueue[tuple[str, bytes | None]] = SimpleQueue()
        asked = self._watchers.to_view()
        for name in asked:
            self._link.send(name, "views", b"", partial(_put, answers, name))
        until_s = time.monotonic() + PATIENCE_S
        for _ in asked:
            try:
                name, answer = answers.get(timeout=max(0.0, until_s - time.monotonic()))
            except Empty:
                return
            if answer is not None:
                try:
                    self._watchers.take_views(name, forms.VIEWS.decode(answer))
                except AnswerError:
                    self.counts["bad_answers"] += 1

    def vehicle(self, fleet: str, vehicle: str) -> VehicleView | None:
        """One vehicle; as it was known last where its worker does not answer."""
        place = self._watchers.place((fleet, vehicle))
        if place is None or place.worker is None:
            return None if place is None else place.view
        try:
            view = self._of_vehicle("vehicle", (fleet, vehicle), forms.VEHICLE)
        except WorkerSilentError:
            place = self._watchers.place((fleet, vehicle)) or place
            return place.view
        return place.view if view is None else replace(view, worker=place.worker)

    def derivatives(self, fleet: str, vehicle: str) -> Mapping[str, Any] | None:
        """As the vehicle's worker says; ``WorkerSilentError`` where it does not answer."""
        return self._of_vehicle("derivatives", (fleet, vehicle), forms.DERIVATIVES)

    def alerts(self) -> Sequence[AlertView]:
        """All alerts, newest first, as the database has them."""
        return self._book.newest_first()

    def manoeuvres(self, fleet: str, vehicle: str) -> Sequence[ManoeuvreView] | None:
        """As the vehicle's worker says; ``WorkerSilentError`` where it does not answer."""
        return self._of_vehicle("manoeuvres", (fleet, vehicle), forms.MANOEUVRES)

    def flight_record(self, fleet: str, vehicle: str) -> FlightRecordView | None:
        """As the vehicle's worker says; ``WorkerSilentError`` where it does not answer."""
        return self._of_vehicle("flight_record", (fleet, vehicle), forms.RECORD)

    def expected(
        self, fleet: str, vehicle: str, structure: str, aircraft: tuple[str, str], conditions: Array
    ) -> tuple[Array, Array] | None:
        """As the vehicle's worker says; ``WorkerSilentError`` where it does not answer."""
        question = forms.EXPECT.encode(Expect(fleet, vehicle, structure, aircraft, conditions.tolist()))
        found = self._of_worker("expected", (fleet, vehicle), question, forms.EXPECTED)
        return None if found is None else (np.array(found[0]), np.array(found[1]))

    def alert_groups(self) -> Sequence[AlertGroupView]:
        """Alerts in force that are one event, whichever workers watch their vehicles."""
        return self._book.groups()

    def act_on_alert(
        self,
        alert_id: str,
        action: AlertAction,
        who: str,
        note: str,
        key: str | None = None,
        shelve_s: float = SHELVED_S,
    ) -> AlertView | None:
        """Have the vehicle's worker carry out a person's action; None for an unknown alert.

        Raises:
            ValueError, KeyReusedError, DatabaseError: as the worker's monitor.
            WorkerSilentError: the worker has not answered; whether it has happened is said there.
        """
        alert = self._book.get(alert_id)
        if alert is None:
            return None
        worker = self._responsible((alert.fleet, alert.vehicle))
        act = Act(
            alert.fleet, alert.vehicle, alert_id, action, who, note, key or uuid4().hex, shelve_s, time.time() + _ACT_S
        )  # fmt: skip
        self._refuse_silent(worker)
        try:
            acted = forms.ACTED.decode(self._link.ask(worker, "act", forms.ACT.encode(act), _ACT_S))
        except (AnswerError, WorkerSilentError) as error:
            raise WorkerSilentError(
                f"{error}. Whether the action has been carried out is not known: read the alert, or repeat the request "
                "under its Idempotency-Key"
            ) from None
        if acted.refused:
            kinds = {"key": KeyReusedError, "action": ValueError}
            raise kinds.get(acted.refused, DatabaseError)(acted.why)
        if acted.alert is not None:
            self._book.take([acted.alert])
        return acted.alert

    def _responsible(self, key: Key) -> str:
        """The worker that watches a vehicle, or would."""
        place, answering = self._watchers.place(key), self._watchers.answering()
        if place is not None and place.worker is not None:
            return place.worker
        if not answering:
            raise WorkerSilentError("no worker answers, so nothing has happened; try again later")
        return self._first(answering, *key)

    def events(self, after: int) -> Sequence[Event]:
        """Events with an id above ``after``, oldest first; ids are this gateway's own."""
        return self._watchers.events(after)

    def events_complete_after(self) -> int:
        """Who has seen the event of this id or a later one has missed none but those that newer ones replaced."""
        return self._watchers.events_complete_after

    def figures(self) -> FleetFigures:
        """All workers' fleets in numbers, those that have ended included where numbers do not fall."""
        alerts = Counter((alert.state, alert.level) for alert in self.alerts())
        return replace(self._watchers.figures(), alerts=alerts)

    # -- what else a gateway asks ---------------------------------------------------------------------

    def states(self) -> Mapping[str, tuple[WorkerState | None, float]]:
        """By worker what it says of itself, None before its first answer, and for how long it has been silent."""
        return self._watchers.states()

    def gone_counters(self) -> Mapping[str, Mapping[str, int]]:
        """What workers that have ended have counted, by part."""
        return self._watchers.gone_counters()

    def diagnoses(self) -> Sequence[DiagnosisView]:
        """Of all workers' alerts; of those that answer."""
        found: list[DiagnosisView] = []
        for name in self._watchers.answering():
            try:
                found += forms.DIAGNOSES.decode(self._ask(name, "diagnoses", b""))
            except (WorkerSilentError, AnswerError):
                continue
        return found

    def report(self, diagnosis_id: str) -> bytes | None:
        """The HTML report of the diagnosis of an alert, from the worker that has it."""
        for name in self._watchers.answering():
            try:
                if found := self._ask(name, "diagnosis_report", diagnosis_id.encode()):
                    return found
            except WorkerSilentError:
                continue
        return None


def _put(answers: SimpleQueue[tuple[str, bytes | None]], name: str, answer: bytes | None) -> None:
    answers.put((name, answer))
