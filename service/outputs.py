"""The service's own streams on Zenoh: derivatives, status, alerts and proposals, published and answered to queries.

Whoever calls here never waits: one thread makes, encodes and hands over. All but alerts are coalesced, the
newest of each vehicle counts, and are made only while somebody subscribes them; alerts go first, each of them, and wait
for a congested link and for a lost one. Zenoh's callbacks only put the query into a queue.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, Self

import zenoh

from wingwatch.api import alert_document, proposed_input_document, vehicle_document
from wingwatch.monitor import AlertState, AlertView, MonitorPort, ProposedInputView, VehicleView
from wingwatch.monitor.ports import News
from wingwatch.service.loops import Loop
from wingwatch.telemetry import (
    JSON,
    ServiceStream,
    encode_service_object,
    service_alive_key,
    vehicle_key,
)
from wingwatch.telemetry.keys import KEY_ROOT, KeyNameError, parse_key

__all__ = ["ZenohOutputs"]

_LOG = logging.getLogger(__name__)
_MOST_ALERTS = 10_000
_MOST_QUERIES = 256
_STREAMS: tuple[ServiceStream, ...] = ("derivatives", "status", "alerts", "proposals")
_COALESCED: tuple[ServiceStream, ...] = ("derivatives", "status", "proposals")
_JOIN_S = 1.0
_LOOK_S = 0.2
_ASKED_AGAIN_S = (
    0.1  # whether anybody subscribes; the question costs as much as all else that announcing does
)
_SAID_AGAIN_S = 60.0
_MOST_FOREIGN, _MOST_KEY = 1000, 300
_MOST_REMEMBERED = 5000


def _always() -> bool:
    return True


class ZenohOutputs:
    """Implements the monitor's ``Outputs``; use it in a ``with`` statement, inside that of its session.

    Args:
        session: open.
        connected: whether the link to the router holds; what is put meanwhile is lost without a word, so alerts wait.
        owns: whether a vehicle, by fleet and name, is watched here; what is asked of others is answered elsewhere, and
            alerts of them are said elsewhere. Every one is without.

    Attributes:
        dropped: alerts and queries that found their queue full, and messages that could not be sent.
        foreign_alerts: messages that somebody else published under a vehicle's alerts, which the service alone writes.
        loop: hands over what waits.
    """

    def __init__(
        self,
        session: zenoh.Session,
        connected: Callable[[], bool] = _always,
        owns: Callable[[str, str], bool] | None = None,
    ) -> None:
        self._session, self._owns = session, owns
        self._connected = connected
        self._monitor: MonitorPort | None = None
        self._ask: Callable[[str, str], None] | None = None
        self._sent_rows: dict[tuple[str, str], Any] = {}
        self._latest: dict[tuple[str, str, ServiceStream], Callable[[], News]] = {}
        self._alerts: deque[tuple[str, str, Callable[[], News]]] = deque()
        self._queries: deque[Any] = deque()
        self._alerts_since_s: float | None = None
        self._lock = threading.Lock()
        self._news = threading.Event()
        self._ending = False
        self.loop = Loop("wingwatch-outputs", "the loop that publishes", self._run, self._news.set)
        self._listening: list[Any] = []
        self._listened: dict[ServiceStream, Any] = {
            stream: session.declare_publisher(f"{KEY_ROOT}/*/*/{stream}") for stream in _COALESCED
        }
        """Nothing is put through these: they tell whether anybody subscribes the stream of any vehicle. The session's
        end ends them, so whoever still announces is not refused."""
        self._matching: dict[ServiceStream, tuple[float, bool]] = {}
        """When it was last asked whether anybody does, and the answer."""
        self._token: Any = None
        self.dropped = {"alerts": 0, "queries": 0, "unsent": 0}
        self.foreign_alerts = 0
        self._foreign: deque[str] = deque(maxlen=_MOST_FOREIGN)
        self._foreign_said_s: dict[str, float] = {}

    def __enter__(self) -> Self:
        self.loop.start()
        return self

    def __exit__(self, *_: object) -> None:
        for declared in (*self._listening, self._token):
            if declared is not None:
                declared.undeclare()
        self._ending = True
        self._news.set()
        self.loop.join(_JOIN_S)  # a link that takes nothing holds it; the session's end frees it

    @property
    def waiting(self) -> dict[str, int]:
        """How much waits to be published or answered: alerts, newest derivatives and states, queries."""
        return {"alerts": len(self._alerts), "latest": len(self._latest), "queries": len(self._queries)}

    @property
    def alerts_wait_s(self) -> float:
        """How long alerts have waited without all of them being published; 0 where none wait."""
        since_s = self._alerts_since_s
        return 0.0 if since_s is None else time.monotonic() - since_s

    def answer_from(self, monitor: MonitorPort) -> None:
        """From now on answer queries with what the monitor knows, and show that the service lives."""
        self._monitor = monitor
        for stream in _STREAMS:
            callback = zenoh.handlers.Callback(self._asked, indirect=False)
            self._listening.append(self._session.declare_queryable(f"{KEY_ROOT}/*/*/{stream}", callback))
        foreign = zenoh.handlers.Callback(self._note_foreign, indirect=False)
        self._listening.append(
            self._session.declare_subscriber(
                f"{KEY_ROOT}/*/*/alerts", foreign, allowed_origin=zenoh.Locality.REMOTE
            )
        )
        key = service_alive_key(str(self._session.info.zid()))
        self._token = self._session.liveliness().declare_token(key)

    def ask_through(self, ask: Callable[[str, str], None]) -> None:
        """From now on vehicles are asked for their aircraft by ``ask(fleet, vehicle)``."""
        self._ask = ask

    # -- what the monitor calls ---------------------------------------------------------------------

    def announce(self, fleet: str, vehicle: str, stream: ServiceStream, news: Callable[[], News]) -> None:
        """Publish soon; returns at once."""
        if stream in _COALESCED and not self._is_listened(stream):
            return
        with self._lock:
            if stream in _COALESCED:
                self._latest[fleet, vehicle, stream] = news
            elif len(self._alerts) >= _MOST_ALERTS:
                self.dropped["alerts"] += 1
            else:
                self._alerts.append((fleet, vehicle, news))
                if self._alerts_since_s is None:
                    self._alerts_since_s = time.monotonic()
        self._news.set()

    def ask_aircraft(self, fleet: str, vehicle: str) -> None:
        """Have the subscriber ask, which also takes the answer."""
        if self._ask is not None:
            self._ask(fleet, vehicle)

    def _is_listened(self, stream: ServiceStream) -> bool:
        now_s = time.monotonic()
        asked_s, matching = self._matching.get(stream, (float("-inf"), False))
        if now_s - asked_s >= _ASKED_AGAIN_S:
            matching = bool(self._listened[stream].matching_status.matching)
            self._matching[stream] = now_s, matching
        return matching

    # -- the thread that hands over -------------------------------------------------------------------

    def _asked(self, query: Any) -> None:
        """In Zenoh's thread: keep the query for ours."""
        with self._lock:
            if len(self._queries) >= _MOST_QUERIES:
                self.dropped["queries"] += 1
                query.drop()
                return
            self._queries.append(query)
        self._news.set()

    def _note_foreign(self, sample: Any) -> None:
        """In Zenoh's thread: somebody else has published an alert, of a vehicle that he does not watch."""
        if self._owns is not None:
            with suppress(KeyNameError):
                found = parse_key(str(sample.key_expr))
                if not self._owns(found.fleet, found.vehicle):
                    return
        with self._lock:
            self.foreign_alerts += 1
            self._foreign.append(str(sample.key_expr)[:_MOST_KEY])
        self._news.set()

    def _answer_foreign(self, key: str) -> None:
        """Announce it, and publish the vehicle's state again: subscribers received the other one's last."""
        monitor, now_s = self._monitor, time.monotonic()
        if monitor is None or now_s - self._foreign_said_s.get(key, float("-inf")) < _SAID_AGAIN_S:
            return
        try:
            found = parse_key(key)
        except KeyNameError:
            return
        if len(self._foreign_said_s) >= _MOST_FOREIGN:
            self._foreign_said_s.clear()
        self._foreign_said_s[key] = now_s
        about = f"{found.fleet}/{found.vehicle}"
        _LOG.warning("somebody else publishes alerts of %s", about, extra={"vehicle": about})
        for alert in reversed(monitor.alerts()):
            if (alert.fleet, alert.vehicle) == (
                found.fleet,
                found.vehicle,
            ) and alert.state is not AlertState.CLEARED:
                self.announce(found.fleet, found.vehicle, "alerts", partial(_same, alert))

    def _run(self) -> None:
        while True:
            self._news.wait(_LOOK_S if self._alerts else None)
            if self._ending:
                return
            self._news.clear()
            while self._foreign:
                self._safely(self._answer_foreign, self._foreign.popleft())
            connected = self._connected() if self._alerts else True
            with self._lock:
                latest, queries = self._latest, list(self._queries)
                alerts = list(self._alerts) if connected else []
                if connected:
                    self._alerts.clear()
                self._queries.clear()
                self._latest = {}
            for fleet, vehicle, news in alerts:
                self._safely(self._put, fleet, vehicle, "alerts", news)
            with self._lock:
                self._alerts_since_s = self._alerts_since_s if self._alerts else None
            for (fleet, vehicle, stream), news in latest.items():
                self._safely(self._put, fleet, vehicle, stream, news)
            for query in queries:
                self._safely(self._answer, query)

    def _safely(self, action: Callable[..., None], *arguments: object) -> None:
        """What cannot be sent is counted; the thread goes on."""
        try:
            action(*arguments)
        except Exception as error:
            self.dropped["unsent"] += 1
            _LOG.warning("not published: %s: %s", type(error).__name__, error)

    def _put(self, fleet: str, vehicle: str, stream: ServiceStream, news: Callable[[], News]) -> None:
        urgent = stream == "alerts"
        control, priority = zenoh.CongestionControl, zenoh.Priority
        value = news()
        if isinstance(value, AlertView):
            said = (value.level, value.cause, value.id, value.state)
            _LOG.info("%s alert (%s) %s is %s", *said, extra={"vehicle": f"{fleet}/{vehicle}"})
        document = _document(fleet, vehicle, value)
        if stream == "status":
            document = self._without_repeated_rows((fleet, vehicle), document)
        self._session.put(
            vehicle_key(fleet, vehicle, stream),
            encode_service_object(stream, document),
            encoding=JSON,
            congestion_control=control.BLOCK if urgent else control.DROP,
            priority=priority.INTERACTIVE_HIGH if urgent else priority.DATA,
        )

    def _without_repeated_rows(
        self, owner: tuple[str, str], document: Mapping[str, Any]
    ) -> Mapping[str, Any]:
        """A status without ``could_see`` where that is as it was sent last: two thirds of its bytes."""
        rows = document["could_see"]
        if self._sent_rows.get(owner) == rows:
            return {name: value for name, value in document.items() if name != "could_see"}
        if len(self._sent_rows) >= _MOST_REMEMBERED:
            self._sent_rows.clear()
        self._sent_rows[owner] = rows
        return document

    def _answer(self, query: Any) -> None:
        """Reply with every object whose key the query asks for, and end it."""
        try:
            for key, stream, document in self._documents(query.key_expr):
                query.reply(key, encode_service_object(stream, document), encoding=JSON)
        finally:
            query.drop()

    def _documents(self, asked: Any) -> Iterator[tuple[str, ServiceStream, Mapping[str, Any]]]:
        """Alerts come oldest first: of several replies under one key Zenoh keeps the last unless asked otherwise."""
        monitor = self._monitor
        if monitor is None:
            return
        for view in monitor.vehicles():
            owner = (view.fleet, view.vehicle)
            keys = {stream: vehicle_key(*owner, stream) for stream in _COALESCED}
            wanted = {s for s, key in keys.items() if asked.intersects(zenoh.KeyExpr(key))}
            if "status" in wanted:  # the view of all vehicles does not have everything
                yield keys["status"], "status", _document(*owner, monitor.vehicle(*owner) or view)
            if "proposals" in wanted and view.proposed_input is not None:
                yield keys["proposals"], "proposals", _document(*owner, view.proposed_input)
            if "derivatives" in wanted and (value := monitor.derivatives(*owner)) is not None:
                yield keys["derivatives"], "derivatives", _document(*owner, value)
        for alert in reversed(monitor.alerts()):  # also of vehicles without a message since the start
            if self._owns is not None and not self._owns(alert.fleet, alert.vehicle):
                continue
            key = vehicle_key(alert.fleet, alert.vehicle, "alerts")
            if asked.intersects(zenoh.KeyExpr(key)):
                yield key, "alerts", _document(alert.fleet, alert.vehicle, alert)


def _same(alert: AlertView) -> AlertView:
    return alert


def _document(fleet: str, vehicle: str, value: News) -> Mapping[str, Any]:
    """The object that REST gives."""
    if isinstance(value, AlertView):
        return alert_document(value).model_dump(mode="json")
    if isinstance(value, VehicleView):
        return vehicle_document(value).model_dump(mode="json")
    if isinstance(value, ProposedInputView):
        return {**proposed_input_document(value).model_dump(mode="json"), "fleet": fleet, "vehicle": vehicle}
    return {**value, "fleet": fleet, "vehicle": vehicle, "convention": "concise"}
