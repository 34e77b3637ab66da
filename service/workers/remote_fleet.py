"""The fleet as a gateway sees it: vehicles that workers watch, asked for over Zenoh (``MonitorPort``).

A thread asks each worker for its events five times a second, and for all its vehicles once a second; lists are answered
from that. What is asked of one vehicle goes to its worker. A worker that has not answered is not asked by anybody else:
its vehicles are shown as they were, ``unknown``, with the reason, and no question waits for it.
"""

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
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
    VehicleState,
    VehicleView,
)
from wingwatch.monitor.fleet.kept_events import KeptEvents
from wingwatch.monitor.fleet.views import worst_first
from wingwatch.monitor.record_views import FlightRecordView
from wingwatch.monitor.views import SHELVED_S
from wingwatch.service.loops import Loop
from wingwatch.service.workers import messages as forms
from wingwatch.service.workers.alert_book import AlertBook
from wingwatch.service.workers.link import PATIENCE_S, WorkerLink
from wingwatch.service.workers.messages import (
    Act,
    AnswerError,
    Expect,
    Form,
    NewsWanted,
    VehicleName,
    WorkerNews,
    WorkerState,
)

__all__ = ["SILENT_S", "RemoteFleet"]

Array = NDArray[np.float64]
Key = tuple[str, str]
T = TypeVar("T")

SILENT_S = PATIENCE_S
"""Without an answer for so long, a worker counts as silent."""
_ASK_S, _WHOLE_S = 0.2, 1.0
_READ_S = 60.0
_ORPHANED_S = 600.0
_ACT_S = 5.0  # the worker waits 3 s for its database
_JOIN_S = PATIENCE_S + 1.0
_MOST_EVENTS = 10_000
_MOST_TURNS = 3  # workers that are asked one after the other for what any of them may have


@dataclass(slots=True)
class _Watcher:
    """A worker as it is known here.

    Attributes:
        since_s: when it was first seen; answered_s: when it answered last; asked_s: when the question went out that
            waits for an answer; whole_s: when all was asked for last.
        start, newest: of its events; None before its first answer.
        views: its vehicles.
    """

    since_s: float
    answered_s: float
    asked_s: float | None = None
    whole_s: float = float("-inf")
    start: str = ""
    newest: int | None = None
    state: WorkerState | None = None
    views: dict[Key, VehicleView] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Orphan:
    """A vehicle whose worker has gone, and since when."""

    view: VehicleView
    worker: str
    since_s: float


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
        self._link, self._live, self._first, self._clock = link, live, first, clock
        self._book = AlertBook(read_alerts, heard)
        self._lock = threading.Lock()
        self._workers: dict[str, _Watcher] = {}
        self._orphans: dict[Key, _Orphan] = {}
        self._gone: dict[str, Counter[str]] = {}
        self._gone_solutions = 0
        self._gone_counts: Counter[str] = Counter()
        self._events = KeptEvents(_MOST_EVENTS)
        self._answers: deque[tuple[str, bytes | None]] = deque()
        self._woken, self._ending = threading.Event(), threading.Event()
        self._read_s, self._reading = float("-inf"), threading.Event()
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

    # -- the thread that asks workers ----------------------------------------------------------------

    def _run(self) -> None:
        while not self._ending.is_set():
            self._woken.wait(_ASK_S)
            self._woken.clear()
            self.turn()

    def turn(self) -> None:
        """Take in what was answered, see who has come and gone, and ask whoever is due."""
        while self._answers:
            self._take(*self._answers.popleft())
        now_s, live = self._clock(), set(self._live())
        with self._lock:
            for name in live - self._workers.keys():
                self._workers[name] = _Watcher(now_s, now_s)
            gone = [(name, self._workers.pop(name)) for name in self._workers.keys() - live]
            for name, watcher in gone:
                self._orphan(name, watcher, now_s)
            self._orphans = {k: o for k, o in self._orphans.items() if now_s - o.since_s < _ORPHANED_S}
            due = [(n, w) for n, w in self._workers.items() if w.asked_s is None]
        if gone:
            self._reading.set()
        for name, watcher in due:
            self._ask_news(name, watcher, now_s)

    def _orphan(self, name: str, watcher: _Watcher, now_s: float) -> None:
        """A worker has gone; the lock is held."""
        for key, view in watcher.views.items():
            self._orphans[key] = _Orphan(view, name, now_s)
            fleet, vehicle = key
            data = {"fleet": fleet, "vehicle": vehicle, "state": str(VehicleState.UNKNOWN)}
            self._events.add("status", data)
        if watcher.state is not None:  # what it has counted does not fall
            for part, counts in watcher.state.counters.items():
                self._gone.setdefault(part, Counter()).update(counts)
            self._gone_solutions += watcher.state.figures.solutions
            self._gone_counts.update(watcher.state.figures.counts)

    def _ask_news(self, name: str, watcher: _Watcher, now_s: float) -> None:
        whole = now_s - watcher.whole_s >= _WHOLE_S
        watcher.asked_s = now_s
        if whole:
            watcher.whole_s = now_s
        payload = forms.NEWS_WANTED.encode(NewsWanted(watcher.newest, whole))
        self._link.send(name, "news", payload, partial(self._answered, name))

    def _answered(self, name: str, answer: bytes | None) -> None:
        """In Zenoh's thread: one question a worker is out, so little waits."""
        self._answers.append((name, answer))
        if answer is None or len(answer) > 1000:
            self._woken.set()

    def _take(self, name: str, answer: bytes | None) -> None:
        with self._lock:
            watcher = self._workers.get(name)
        if watcher is None:
            return
        watcher.asked_s = None
        if answer is None:
            self.counts["unanswered"] += 1
            watcher.whole_s = float("-inf")
            return
        try:
            news = forms.NEWS.decode(answer)
        except AnswerError:
            self.counts["bad_answers"] += 1
            watcher.whole_s = float("-inf")
            return
        self._take_news(name, watcher, news)

    def _take_news(self, name: str, watcher: _Watcher, news: WorkerNews) -> None:
        anew = watcher.newest is not None and watcher.start != news.start
        missed = watcher.newest is not None and not anew and watcher.newest < news.complete_after
        self._book.take(tuple(reversed(news.alerts)))
        with self._lock:
            watcher.answered_s, watcher.start = self._clock(), news.start
            watcher.newest = None if anew else news.newest
            if missed:
                self._events.complete_after = self._events.newest
            for event in () if anew else news.events:
                self._events.add(event.kind, event.data)
            if news.whole is not None:
                watcher.state = news.whole.state
                watcher.views = {(v.fleet, v.vehicle): replace(v, worker=name) for v in news.whole.vehicles}
                for key in watcher.views:
                    self._orphans.pop(key, None)
            elif any(_owner(event) not in watcher.views for event in news.events):
                watcher.whole_s = float("-inf")
        if news.whole is not None:
            self._book.take_places(news.whole.places)

    # -- the thread that reads alerts -----------------------------------------------------------------

    def _keep_reading(self) -> None:
        while not self._ending.is_set():
            try:
                self._book.look()
                self.read_problem, wait_s = None, _READ_S
            except DatabaseError as error:
                self.read_problem, wait_s = str(error), 1.0
            self._reading.wait(wait_s)
            self._reading.clear()

    # -- who watches what ----------------------------------------------------------------------------

    def _watcher_of(self, key: Key) -> tuple[str, _Watcher] | None:
        """Of two that have it the one that has had samples last; the lock is held."""
        having = [(n, w) for n, w in self._workers.items() if key in w.views]
        return min(having, key=lambda one: self._age_s(one[1], one[1].views[key]), default=None)

    def _age_s(self, watcher: _Watcher, view: VehicleView) -> float:
        age_s = float("inf") if view.sample_age_s is None else view.sample_age_s
        return age_s + self._clock() - watcher.answered_s

    def _silent_s(self, watcher: _Watcher) -> float:
        """For how long a worker has not answered; 0 where it answers."""
        silent_s = self._clock() - watcher.answered_s
        return silent_s if silent_s > SILENT_S else 0.0

    def _ask(self, worker: str, question: str, payload: bytes, patience_s: float = PATIENCE_S) -> bytes:
        """Ask a worker, unless it is known not to answer.

        Raises:
            WorkerSilentError: it does not.
        """
        with self._lock:
            watcher = self._workers.get(worker)
            silent_s = 0.0 if watcher is None else self._silent_s(watcher)
        if silent_s:
            raise WorkerSilentError(f"worker {worker} has not answered for {silent_s:.0f} s; try again later")
        return self._link.ask(worker, question, payload, patience_s)

    def _of_vehicle(self, question: str, key: Key, form: Form[T]) -> T | None:
        """What a vehicle's worker answers; None where none has it.

        Raises:
            WorkerSilentError: it does not answer, or has gone.
        """
        return self._of_worker(question, key, forms.VEHICLE_NAME.encode(VehicleName(*key)), form)

    def _of_worker(self, question: str, key: Key, payload: bytes, form: Form[T]) -> T | None:
        with self._lock:
            found, orphan = self._watcher_of(key), self._orphans.get(key)
        if found is None:
            if orphan is None:
                return None
            raise WorkerSilentError(f"worker {orphan.worker} of '{key[1]}' has ended; try again later")
        try:
            return form.decode(self._ask(found[0], question, payload))
        except AnswerError as error:
            self.counts["bad_answers"] += 1
            raise WorkerSilentError(f"worker {found[0]} answers something else: {error}") from None

    # -- what may be asked (MonitorPort) -------------------------------------------------------------

    def vehicles(self) -> Sequence[VehicleView]:
        """All known vehicles, worst state first, as they were within the last second."""
        now_s = self._clock()
        with self._lock:
            shown: dict[Key, tuple[float, VehicleView]] = {}
            for name, watcher in self._workers.items():
                silent_s = self._silent_s(watcher)
                for key, view in watcher.views.items():
                    age_s = self._age_s(watcher, view)
                    if key not in shown or age_s < shown[key][0]:
                        shown[key] = age_s, self._with_silence(view, name, silent_s)
            orphans = {k: self._orphaned(o, now_s) for k, o in self._orphans.items() if k not in shown}
        return worst_first([*(view for _, view in shown.values()), *orphans.values()])

    def _with_silence(self, view: VehicleView, worker: str, silent_s: float) -> VehicleView:
        why = f"its worker {worker} has not answered for {silent_s:.0f} s"
        return _unwatched(view, why, silent_s) if silent_s else view

    def _orphaned(self, orphan: _Orphan, now_s: float) -> VehicleView:
        why = f"its worker {orphan.worker} has ended, and no other watches it"
        return replace(_unwatched(orphan.view, why, now_s - orphan.since_s), worker=None)

    def vehicle(self, fleet: str, vehicle: str) -> VehicleView | None:
        """One vehicle; as it was known last where its worker does not answer."""
        key = fleet, vehicle
        with self._lock:
            found, orphan = self._watcher_of(key), self._orphans.get(key)
            silent_s = 0.0 if found is None else self._silent_s(found[1])
        if found is None:
            return None if orphan is None else self._orphaned(orphan, self._clock())
        name, watcher = found
        try:
            view = self._of_vehicle("vehicle", key, forms.VEHICLE)
        except WorkerSilentError:
            return self._with_silence(watcher.views[key], name, max(silent_s, PATIENCE_S))
        return watcher.views.get(key) if view is None else replace(view, worker=name)

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
        act = Act(alert_id, action, who, note, key or uuid4().hex, shelve_s, time.time() + _ACT_S)
        try:
            acted = forms.ACTED.decode(self._ask(worker, "act", forms.ACT.encode(act), _ACT_S))
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
        with self._lock:
            found = self._watcher_of(key)
            answering = [n for n, w in self._workers.items() if w.state and not self._silent_s(w)]
        if found is not None:
            return found[0]
        if not answering:
            raise WorkerSilentError("no worker answers, so nothing has happened; try again later")
        return self._first(answering, *key)

    def events(self, after: int) -> Sequence[Event]:
        """Events with an id above ``after``, oldest first; ids are this gateway's own."""
        with self._lock:
            return self._events.after(after)

    def events_complete_after(self) -> int:
        """Who has seen the event of this id or a later one has missed none but those that newer ones replaced."""
        return self._events.complete_after

    def figures(self) -> FleetFigures:
        """All workers' fleets in numbers, those that have gone included where numbers do not fall."""
        states = Counter(view.state for view in self.vehicles())
        alerts = Counter((alert.state, alert.level) for alert in self.alerts())
        with self._lock:
            found = [w.state.figures for w in self._workers.values() if w.state is not None]
            counts, solutions = Counter(self._gone_counts), self._gone_solutions
        for one in found:
            counts.update(one.counts)
        return FleetFigures(
            states,
            alerts,
            counts,
            solutions + sum(one.solutions for one in found),
            sum(one.waiting for one in found),
            sum(one.left_out for one in found),
        )

    # -- what else a gateway asks ---------------------------------------------------------------------

    def states(self) -> Mapping[str, tuple[WorkerState | None, float]]:
        """By worker what it says of itself, None before its first answer, and for how long it has been silent."""
        with self._lock:
            return {name: (w.state, self._silent_s(w)) for name, w in self._workers.items()}

    def gone_counters(self) -> Mapping[str, Mapping[str, int]]:
        """What workers that have gone have counted, by part."""
        with self._lock:
            return {part: dict(counts) for part, counts in self._gone.items()}

    def diagnoses(self) -> Sequence[DiagnosisView]:
        """Of all workers' alerts; of those that answer."""
        found: list[DiagnosisView] = []
        for name in self._answering():
            try:
                found += forms.DIAGNOSES.decode(self._ask(name, "diagnoses", b""))
            except (WorkerSilentError, AnswerError):
                continue
        return found

    def report(self, diagnosis_id: str) -> bytes | None:
        """The HTML report of the diagnosis of an alert, from the worker that has it."""
        for name in self._answering():
            try:
                if found := self._ask(name, "diagnosis_report", diagnosis_id.encode()):
                    return found
            except WorkerSilentError:
                continue
        return None

    def _answering(self) -> list[str]:
        with self._lock:
            return [name for name, watcher in self._workers.items() if not self._silent_s(watcher)]


def _owner(event: Event) -> Key:
    return str(event.data.get("fleet")), str(event.data.get("vehicle"))


def _unwatched(view: VehicleView, why: str, since_s: float) -> VehicleView:
    """A vehicle whose samples nobody takes in: an alert outlasts that, and the vehicle does not pass for health."""
    age_s = None if view.sample_age_s is None else view.sample_age_s + since_s
    if view.state is VehicleState.DEGRADED:
        return replace(view, reason=f"{view.reason.rstrip('.')}. Meanwhile {why}", sample_age_s=age_s)
    return replace(view, state=VehicleState.UNKNOWN, reason=why, sample_age_s=age_s)
