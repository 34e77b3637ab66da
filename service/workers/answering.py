"""A worker's side of the link: what it answers gateways, out of Zenoh's threads and within bounds."""

import logging
import secrets
import threading
import time
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np
import zenoh

from wingwatch.api import DiagnosisView
from wingwatch.baselines import DatabaseError
from wingwatch.monitor import AlertState, AlertView, KeyReusedError, MonitorPort, VehicleView
from wingwatch.monitor.positions import Place
from wingwatch.service.workers import messages as forms
from wingwatch.service.workers.messages import (
    Act,
    Acted,
    Announced,
    NewsWanted,
    Whole,
    WorkerNews,
    WorkerState,
)
from wingwatch.telemetry import InboundMessage
from wingwatch.telemetry.worker_keys import worker_key

__all__ = ["AnsweringMonitor", "AnsweringPorts", "ReportsPort", "WorkerAnswers"]

_LOG = logging.getLogger(__name__)
_MOST_WAITING = 256
_MOST_ACTIONS = 16
_READERS, _ACTORS = 2, 4
_SLOW = ("act",)
"""Questions that wait for the database."""


class AnsweringMonitor(MonitorPort, Protocol):
    """What is asked of a worker's monitor beside what doors ask."""

    def brief(self) -> Sequence[VehicleView]:
        """All vehicles in brief."""
        ...

    def alert_places(self) -> Mapping[str, tuple[int, Place]]:
        """Where and when alerts of icing were raised, by id."""
        ...


class ReportsPort(Protocol):
    """Diagnoses of a worker's alerts."""

    def diagnoses(self) -> Sequence[DiagnosisView]:
        """All that are kept, newest first."""
        ...

    def report(self, diagnosis_id: str) -> bytes | None:
        """The HTML report of one that is done."""
        ...


@dataclass(frozen=True, slots=True)
class AnsweringPorts:
    """What a worker answers from.

    Attributes:
        monitor: of its vehicles.
        reports: of its alerts' diagnoses.
        state: what it says of itself.
        owns: whether a vehicle, by fleet and name, is watched here.
        announced: what vehicles have said of their aircraft, here or to others.
        claim: takes a vehicle, by fleet and name, that is watched nowhere, with its alerts as the database has them. It
            raises DatabaseError where it cannot be taken now.
    """

    monitor: AnsweringMonitor
    reports: ReportsPort
    state: Callable[[], WorkerState]
    owns: Callable[[str, str], bool] = lambda _fleet, _vehicle: True
    announced: Callable[[], Sequence[InboundMessage]] = tuple
    claim: Callable[[str, str], None] = lambda _fleet, _vehicle: None


class WorkerAnswers:
    """Answers gateways and other workers; use it in a ``with`` statement.

    What waits for the database or a disk has threads of its own: a worker whose database does not answer is still to
    answer.

    Args:
        session: open.
        name: of the worker.
        ports: what it answers from.
        wall_clock: seconds since 1970-01-01 UTC.

    Attributes:
        dropped: questions that found too many before them, or that could not be answered.

    What other workers ask of vehicles that move is answered by ``ZenohMoves``.
    """

    def __init__(
        self,
        session: zenoh.Session,
        name: str,
        ports: AnsweringPorts,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        self._session, self._name, self._ports, self._wall_clock = session, name, ports, wall_clock
        self._start = secrets.token_hex(8)
        self._lock = threading.Lock()
        self._waiting = {"ask": 0, "act": 0}
        self._asked = ThreadPoolExecutor(_READERS, "wingwatch-answers")
        self._acted = ThreadPoolExecutor(_ACTORS, "wingwatch-actions")
        self._declared: list[Any] = []
        self.dropped = 0
        self._answers: Mapping[str, Callable[[bytes], bytes]] = {
            "news": self._news,
            "views": self._views,
            "vehicle": self._vehicle,
            "derivatives": self._derivatives,
            "manoeuvres": self._manoeuvres,
            "flight_record": self._flight_record,
            "expected": self._expected,
            "diagnoses": self._diagnoses,
            "diagnosis_report": self._report,
            "announced": self._announced,
            "act": self._act,
        }

    def __enter__(self) -> Self:
        heard = zenoh.handlers.Callback(self._heard, indirect=False)
        self._declared = [
            self._session.declare_queryable(worker_key(self._name, question), heard)
            for question in self._answers
        ]
        return self

    def __exit__(self, *_: object) -> None:
        for declared in self._declared:
            declared.undeclare()
        self._asked.shutdown(wait=False, cancel_futures=True)
        self._acted.shutdown(wait=False, cancel_futures=True)

    def _heard(self, query: Any) -> None:
        """In Zenoh's thread: have the question answered in another one."""
        question = str(query.key_expr).rpartition("/")[2]
        if question not in self._answers:  # asked by an expression
            return
        kind = "act" if question in _SLOW else "ask"
        with self._lock:
            full = self._waiting[kind] >= (_MOST_ACTIONS if kind == "act" else _MOST_WAITING)
            self.dropped += full
            self._waiting[kind] += not full
        if full:
            query.drop()
            return
        try:
            (self._acted if kind == "act" else self._asked).submit(self._answer, kind, question, query)
        except RuntimeError:  # it is ending
            query.drop()

    def _answer(self, kind: str, question: str, query: Any) -> None:
        try:
            payload = b"" if query.payload is None else query.payload.to_bytes()
            query.reply(worker_key(self._name, question), self._answers[question](payload))
        except Exception as error:  # one question's fault must not end the answers
            self.dropped += 1
            _LOG.warning("question %s not answered: %s: %s", question, type(error).__name__, error)
        finally:
            query.drop()
            with self._lock:
                self._waiting[kind] -= 1

    # -- the answers ----------------------------------------------------------------------------------

    def _news(self, payload: bytes) -> bytes:
        wanted: NewsWanted = forms.NEWS_WANTED.decode(payload)
        monitor = self._ports.monitor
        events = monitor.events(-1 if wanted.after is None else wanted.after)
        complete_after = monitor.events_complete_after()  # asked after the events: never too low
        newest = events[-1].id if events else wanted.after or 0
        alerts: Sequence[AlertView] = ()
        if wanted.after is None:
            alerts, events = [alert for alert in monitor.alerts() if self._in_force_here(alert)], ()
        elif named := {event.data.get("id") for event in events if event.kind == "alert"}:
            alerts = [alert for alert in monitor.alerts() if alert.id in named]
        whole = None
        if wanted.whole:
            whole = Whole(self._ports.state(), tuple(monitor.brief()), monitor.alert_places())
        return forms.NEWS.encode(
            WorkerNews(self._start, newest, complete_after, tuple(events), tuple(alerts), whole)
        )

    def _in_force_here(self, alert: AlertView) -> bool:
        return alert.state is not AlertState.CLEARED and self._ports.owns(alert.fleet, alert.vehicle)

    def _views(self, _payload: bytes) -> bytes:
        return forms.VIEWS.encode(tuple(self._ports.monitor.vehicles()))

    def _vehicle(self, payload: bytes) -> bytes:
        asked = forms.VEHICLE_NAME.decode(payload)
        return forms.VEHICLE.encode(self._ports.monitor.vehicle(asked.fleet, asked.vehicle))

    def _derivatives(self, payload: bytes) -> bytes:
        asked = forms.VEHICLE_NAME.decode(payload)
        found = self._ports.monitor.derivatives(asked.fleet, asked.vehicle)
        return forms.DERIVATIVES.encode(None if found is None else dict(found))

    def _manoeuvres(self, payload: bytes) -> bytes:
        asked = forms.VEHICLE_NAME.decode(payload)
        found = self._ports.monitor.manoeuvres(asked.fleet, asked.vehicle)
        return forms.MANOEUVRES.encode(None if found is None else tuple(found))

    def _flight_record(self, payload: bytes) -> bytes:
        asked = forms.VEHICLE_NAME.decode(payload)
        return forms.RECORD.encode(self._ports.monitor.flight_record(asked.fleet, asked.vehicle))

    def _expected(self, payload: bytes) -> bytes:
        asked = forms.EXPECT.decode(payload)
        found = self._ports.monitor.expected(
            asked.fleet,
            asked.vehicle,
            asked.structure,
            asked.aircraft,
            np.reshape(np.array(asked.conditions), (-1, 4)),
        )
        return forms.EXPECTED.encode(None if found is None else (found[0].tolist(), found[1].tolist()))

    def _diagnoses(self, _payload: bytes) -> bytes:
        return forms.DIAGNOSES.encode(tuple(self._ports.reports.diagnoses()))

    def _report(self, payload: bytes) -> bytes:
        return self._ports.reports.report(payload[:200].decode("utf-8", "replace")) or b""

    def _announced(self, _payload: bytes) -> bytes:
        return forms.ANNOUNCED.encode(
            tuple(
                Announced(one.fleet, one.vehicle, b64encode(one.payload).decode("ascii"), one.encoding)
                for one in self._ports.announced()
            )
        )

    def _act(self, payload: bytes) -> bytes:
        act = forms.ACT.decode(payload)
        return forms.ACTED.encode(self._acted_on(act))

    def _acted_on(self, act: Act) -> Acted:
        """A question that has waited in a frozen process comes too late: whoever asked has had a refusal."""
        if self._wall_clock() > act.until_at_s:
            return Acted(refused="late", why="the action has come too late; nothing has happened, try again")
        try:
            if not self._ports.owns(act.fleet, act.vehicle):
                self._ports.claim(act.fleet, act.vehicle)
            return Acted(
                self._ports.monitor.act_on_alert(
                    act.alert_id, act.action, act.who, act.note, act.key, act.shelve_s
                )
            )
        except KeyReusedError as error:
            return Acted(refused="key", why=str(error))
        except ValueError as error:
            return Acted(refused="action", why=str(error))
        except DatabaseError as error:
            return Acted(refused="database", why=str(error))
