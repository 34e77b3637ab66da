"""The live fleet: messages in, vehicles watched, alerts and events out. One lock, no I/O of its own.

Who brings messages, where alerts are stored and where outputs are published is handed in, so the same object serves
the service, the demo and the tests.
"""

import logging
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import Envelope, EstimateRecord
from wingwatch.estimators import Estimate
from wingwatch.monitor.alert_ledger import AlertLedger
from wingwatch.monitor.chain import Solution
from wingwatch.monitor.checkpoint import CheckpointError, SavedVehicle, settings_of
from wingwatch.monitor.fair_lock import FairLock
from wingwatch.monitor.judge import JudgeConfig
from wingwatch.monitor.known_vehicle import KnownVehicle
from wingwatch.monitor.monitors import MonitorMaker
from wingwatch.monitor.ports import ActionPlan, ActionRequest, News, Outputs, Store, VehicleMemory
from wingwatch.monitor.resuming import Checkpoints, agreed, goes_on, resumed_vehicle, saved_vehicle
from wingwatch.monitor.roster import Roster, VehicleKey
from wingwatch.monitor.together import feed_together
from wingwatch.monitor.vehicle import Report, VehicleMonitor
from wingwatch.monitor.views import (
    SHELVED_S,
    AlertAction,
    AlertState,
    AlertView,
    Event,
    VehicleState,
    VehicleView,
)
from wingwatch.telemetry import (
    AircraftMessage,
    InboundMessage,
    MessageError,
    SensorsMessage,
    ServiceStream,
    decode_aircraft,
    decode_sensors,
)

__all__ = ["FleetMonitor", "FleetSettings"]

_LOG = logging.getLogger(__name__)
_LOGGED_FAULTS = 10
_MOST_HELD = 2000  # messages, of all vehicles together
_SHOWN_AT_ONCE = 16  # vehicles, between which samples are taken in
_START_PATIENCE_S = 5.0  # for the alerts of earlier runs
_REPEATED = 100  # of the latest alerts, and all that are not cleared, are announced again at the start
_CHECKPOINTS_A_SECOND = 10  # of all vehicles together: half a megabyte each, and 3 ms of processor time
_SAVED_AT_ONCE = 2  # vehicles' states between two rounds of messages: 0.24 ms each
_MOST_ASKS = 100  # questions between two ticks, a second: invented names are not worth more

_Told = tuple[ServiceStream, Callable[[], News]] | Literal["ask"]
"""A stream and what gives the news of it, or the question what aircraft a vehicle is."""

STATE_ORDER = (
    VehicleState.DEGRADED,
    VehicleState.STALE,
    VehicleState.UNKNOWN,
    VehicleState.NOT_OBSERVABLE,
    VehicleState.HEALTHY,
)
"""Worst first."""


@dataclass(frozen=True, slots=True)
class FleetSettings:
    """Limits of the live loop.

    Attributes:
        stale_s: wall-clock time without samples after which a vehicle is stale.
        status_interval_s: how often an unchanged status is published.
        ask_interval_s: least time between two questions for a vehicle's aircraft.
        max_vehicles: vehicles remembered (``Roster`` says who gives way).
        kept_events, kept_alerts: how many are kept in memory.
        history_interval_s: least sample time between two estimates kept for history.
        recall_patience_s: how long samples wait for what is kept of their vehicle before they are watched without.
        checkpoint_interval_s: least time between two checkpoints of a vehicle without news of an alert; of more than
            fifty vehicles each waits longer.
    """

    stale_s: float = 5.0
    status_interval_s: float = 5.0
    ask_interval_s: float = 1.0
    max_vehicles: int = 5000
    kept_events: int = 1000
    kept_alerts: int = 10_000
    history_interval_s: float = 1.0
    recall_patience_s: float = 2.0
    checkpoint_interval_s: float = 5.0
    judge: JudgeConfig = field(default_factory=JudgeConfig)


class FleetMonitor:
    """All vehicles of a service; implements ``MonitorPort``.

    Args:
        find_aircraft: the aircraft of a name; raises ValueError with one sentence for an unknown one.
        clock: wall or monotonic time in s, for staleness only.
        new_id: makes alert ids.
        store: memory across restarts, or None.
        outputs: where news goes, or None.
        wall_clock: seconds since 1970-01-01 UTC, for the time that alerts are shelved.
        checkpoints: where states of vehicles are kept, or None; ``resume`` goes on from them.
    """

    def __init__(
        self,
        find_aircraft: Callable[[str], Aircraft],
        clock: Callable[[], float],
        new_id: Callable[[], str],
        store: Store | None = None,
        outputs: Outputs | None = None,
        settings: FleetSettings | None = None,
        wall_clock: Callable[[], float] = time.time,
        checkpoints: Checkpoints | None = None,
    ) -> None:
        self._find, self._clock, self._wall_clock = find_aircraft, clock, wall_clock
        self._checkpoints = checkpoints
        self._store, self.outputs = store, outputs
        self._settings = settings or FleetSettings()
        self._lock = FairLock()
        self._vehicles = Roster(self._settings.max_vehicles, clock, self._alarmed)
        self._ledger = AlertLedger(self._settings.kept_alerts)
        self._forgotten = 0
        self._asks_left = _MOST_ASKS
        self._events: deque[Event] = deque(maxlen=self._settings.kept_events)
        self._event_id = 0
        self._maker = MonitorMaker(new_id, self._settings.judge)
        self._held = 0
        self._problems: dict[str, int] = {}
        self._earlier_alerts = False
        self._earlier: dict[VehicleKey, AlertView] = {}
        self._repeat(self._read_alerts(_START_PATIENCE_S))

    def resume(self) -> None:
        """Every vehicle goes on from its checkpoint; to be called once, before the first message."""
        if self._checkpoints is None:
            return
        envelopes: dict[tuple[str, str], Mapping[str, Envelope]] = {}
        for saved in self._checkpoints.load():
            key = saved.fleet, saved.vehicle
            if not goes_on(saved, self._settings.judge):
                self._checkpoints.count("expired")
                continue
            try:
                known = resumed_vehicle(saved, self._find, self._maker, partial(self._stored, envelopes))
            except Exception as error:  # one vehicle's checkpoint must not keep the service from starting
                if not isinstance(error, CheckpointError):
                    _LOG.exception("the checkpoint of %s/%s led to a fault of the program", *key)
                text = f"the checkpoint of {key[0]}/{key[1]} is not used: {error}; the vehicle starts anew"
                self._checkpoints.count("refused", text)
                continue
            known.heard_s = self._clock() - saved.silent_s
            with self._lock:
                news = self._follow_earlier(key, known)
                if not self._vehicles.resume(key, known):
                    self._checkpoints.count("refused", f"there is no place for {key[0]}/{key[1]}")
                    continue
            self._checkpoints.count("resumed")
            self._tell(*key, news)

    def _stored(
        self, known: dict[tuple[str, str], Mapping[str, Envelope]], aircraft: Aircraft, configuration: str
    ) -> Mapping[str, Envelope]:
        """Expectations that the database has for a type, read once."""
        store, kind = self._store, (aircraft.name, configuration)
        if kind not in known:
            ask = partial(store.expectations, aircraft, configuration) if store is not None else dict
            known[kind] = self._guarded(ask) or {}
        return known[kind]

    def _follow_earlier(self, key: VehicleKey, known: KnownVehicle) -> list[_Told]:
        """The vehicle's monitor follows the alert that was in force before the restart, if there was one."""
        monitor, standing = known.monitor, self._earlier.pop(key, None)
        if monitor is None:
            return []
        if standing is not None:
            standing = self._ledger.newest(standing.id)
        if standing is not None and standing.state is AlertState.CLEARED:
            standing = None
        active = monitor.book.active
        missing = agreed(monitor, self._ledger.newest(active.id) if active else None, standing)
        if missing is None:
            return []
        self._ledger.drop(missing.id)  # what the checkpoint has is newer
        return self._keep_alert(missing)

    # -- what comes in ------------------------------------------------------------------------

    def receive(self, fleet: str, vehicle: str, stream: str, payload: bytes, encoding: str) -> None:
        """Take in one message; ``stream`` is ``sensors`` or ``aircraft``. It raises nothing.

        What a message holds that is no message is counted; what the program fails on is counted and shown in the
        vehicle's state.
        """
        self.receive_all([InboundMessage(fleet, vehicle, stream, payload, encoding, self._clock())])

    def receive_all(self, messages: Sequence[InboundMessage]) -> None:
        """Take in messages in the order of their arrival, their vehicles together, as ``receive`` takes in one.

        What may be asked waits until all of them are taken in: a few dozen at a time.
        """
        told: list[tuple[VehicleKey, list[_Told]]] = []
        with self._lock:
            ready: dict[VehicleKey, KnownVehicle] = {}
            for message in messages:
                key = message.fleet, message.vehicle
                known = self._vehicles.heard(key)
                if known is None:
                    continue
                if message.stream == "aircraft" and key in ready:
                    told += self._advance({key: ready.pop(key)})  # its samples so far are of what it was
                news = self._taken_in(key, known, message)
                if news:
                    told.append((key, news))
                if known.monitor is not None and known.held:
                    ready[key] = known
            told += self._advance(ready)
            self._save_some(ready)
        for (fleet, vehicle), news in told:
            self._tell(fleet, vehicle, news)

    # -- what is saved of it -------------------------------------------------------------------

    def _save_some(self, ready: Mapping[VehicleKey, KnownVehicle]) -> None:
        """Hand over the states that are due, a few at a time: at once where an alert has changed."""
        checkpoints = self._checkpoints
        if checkpoints is None:
            return
        left, now_s = _SAVED_AT_ONCE, self._clock()
        interval_s = max(self._settings.checkpoint_interval_s, len(self._vehicles) / _CHECKPOINTS_A_SECOND)
        for key, known in ready.items():
            due = known.unsaved and now_s - known.checkpoint_s >= interval_s
            if known.urgent or (due and left and checkpoints.has_room()):
                left -= not known.urgent
                saved, urgent = self._saved(key, known), known.urgent
                known.urgent = False
                if saved is not None:
                    checkpoints.keep(saved, urgent)

    def _saved(self, key: VehicleKey, known: KnownVehicle) -> SavedVehicle | None:
        """A copy of the vehicle's state, with the lock held."""
        known.checkpoint_s, known.unsaved = self._clock(), False
        try:
            return saved_vehicle(key, known, self._clock())
        except Exception as error:  # the watch goes on without
            self._count("checkpoint")
            self._event("problem", {"what": "checkpoint", "text": str(error)})
            return None

    def unsaved(self) -> Iterator[SavedVehicle]:
        """States that have changed since they were saved, for whoever ends the service; one copied at a time."""
        with self._lock:
            everyone = list(self._vehicles.items())
        for key, known in everyone:
            with self._lock:
                saved = self._saved(key, known) if known.unsaved else None
            if saved is not None:
                yield saved

    def _taken_in(self, key: VehicleKey, known: KnownVehicle, message: InboundMessage) -> list[_Told]:
        """One message decoded; samples that can be used are held for ``_advance``."""
        try:
            if message.stream == "aircraft":
                self._announced(key, known, decode_aircraft(message.payload, message.encoding))
                return []
            return self._sampled(key, known, decode_sensors(message.payload, message.encoding))
        except MessageError as error:
            known.count(f"message_{error.reason}")
        except Exception as error:  # one vehicle's fault must neither end the watch nor pass for health
            self._note_fault(*key, known, error)
        return []

    def _announced(self, key: VehicleKey, known: KnownVehicle, message: AircraftMessage) -> None:
        if message == known.message:
            return
        changed = known.message is not None and (
            message.aircraft != known.message.aircraft or message.configuration != known.message.configuration
        )
        known.message = message
        try:
            known.aircraft, known.problem = self._find(message.aircraft), ""
        except ValueError as error:
            known.aircraft, known.problem = None, str(error)
            known.count("unknown_aircraft")
        self._vehicles.sort(key)
        if changed or known.aircraft is None:
            known.start_anew()
        known.announce_loading()

    def _sampled(self, key: VehicleKey, known: KnownVehicle, message: SensorsMessage) -> list[_Told]:
        if not known.arrivals.observe(message.sequence, message.stream, *message.span_s):
            known.refused_s = self._clock()
            return []
        known.received_s = self._clock()
        if known.aircraft is None:
            known.count("unannounced" if known.message is None else "unknown_aircraft", len(message.block))
            return ["ask"] if known.message is None and self._may_ask(known) else []
        known.take_loading()
        known.held.append(message)
        self._held += 1
        if known.monitor is None and not known.recalled:
            self._recall(*key, known)
        return []

    def _advance(self, ready: Mapping[VehicleKey, KnownVehicle]) -> list[tuple[VehicleKey, list[_Told]]]:
        """Hand over what is held of vehicles that have a monitor, message by message, all vehicles at once."""
        told: list[tuple[VehicleKey, list[_Told]]] = []
        going = [(key, known, known.monitor) for key, known in ready.items() if known.monitor is not None]
        while going := [one for one in going if one[1].held]:
            self._held -= len(going)
            blocks = [known.held.popleft().block for _, known, _ in going]
            reports = feed_together([monitor for _, _, monitor in going], blocks)
            sound = []
            for one, report in zip(going, reports, strict=True):
                key, known, _ = one
                try:
                    if isinstance(report, Exception):
                        raise report
                    news = self._digest(*key, known, report)
                except Exception as error:  # it must neither end the watch of others nor pass for health
                    self._note_fault(*key, known, error)
                    continue
                sound.append(one)
                known.unsaved = True
                known.urgent |= bool(report.alerts)
                if news:
                    told.append((key, news))
            going = sound
        return told

    def _recall(self, fleet: str, vehicle: str, known: KnownVehicle) -> None:
        """Start the vehicle's monitor with what is kept of it, or without after a while, and then add it later."""
        store, aircraft, announced = self._store, known.aircraft, known.message
        loading = known.loading
        if aircraft is None or announced is None or loading is None or not (known.held or known.monitor):
            return
        memory: VehicleMemory | None = VehicleMemory()
        if store is not None:
            ask = partial(store.recall, fleet, vehicle, aircraft, announced.configuration)
            memory = self._guarded(ask)
        if known.monitor is not None:
            if memory is not None:
                known.monitor.adopt(loading.recalled(memory))
                known.recalled, known.late = True, True
                known.saved_blocks = sum(r.blocks for r in memory.references.values())
            return
        now_s = self._clock()
        known.recall_s = now_s if known.recall_s is None else known.recall_s
        waiting = now_s - known.recall_s < self._settings.recall_patience_s and self._held < _MOST_HELD
        if memory is None and waiting:
            return
        given = known.held[0].given
        known.monitor = self._maker.make(
            fleet, vehicle, loading.aircraft, announced, given, loading.recalled(memory or VehicleMemory())
        )
        known.recalled = memory is not None
        known.saved_blocks = _blocks(known.monitor)
        known.given, known.settings = given, settings_of(known.monitor, given)
        self._follow_earlier((fleet, vehicle), known)

    # -- what it leads to ----------------------------------------------------------------------

    def _digest(self, fleet: str, vehicle: str, known: KnownVehicle, report: Report) -> list[_Told]:
        monitor = known.monitor
        if monitor is None:
            return []
        news: list[_Told] = []
        for alert in report.alerts:
            news += self._keep_alert(alert)
        if report.solutions:
            self._keep_history(fleet, vehicle, known, monitor, report)
            latest = report.solutions[-1]
            news.append(("derivatives", partial(self._derivatives_of, monitor, latest)))
            self._event("derivatives", {"fleet": fleet, "vehicle": vehicle, "time_s": latest.time_s})
        state, _ = known.standing(self._clock(), self._settings.stale_s)
        if state is not known.shown:
            news.append(self._shown(fleet, vehicle, known, state))
        return news

    def _shown(self, fleet: str, vehicle: str, known: KnownVehicle, state: VehicleState) -> _Told:
        """The state has changed to this one."""
        known.shown = state
        self._event("status", {"fleet": fleet, "vehicle": vehicle, "state": str(state)})
        return "status", partial(self._view, fleet, vehicle, known)

    def _derivatives_of(self, monitor: VehicleMonitor, solution: Solution) -> Mapping[str, Any]:
        with self._lock:
            return monitor.derivatives(solution)

    def _read_alerts(self, patience_s: float) -> Sequence[AlertView]:
        """Alerts of earlier runs, once; a read that failed is no empty one, and is tried again.

        Returns those to be announced again, oldest first: an earlier run may have ended before it announced them.
        """
        store = self._store
        if store is None or self._earlier_alerts:
            return ()
        found: Sequence[AlertView] | None = self._guarded(lambda: store.alerts(patience_s))
        if found is None:
            return ()
        self._ledger.add_earlier(found)
        self._earlier_alerts = True
        for alert in reversed(found):
            if alert.state is not AlertState.CLEARED:
                self._earlier[alert.fleet, alert.vehicle] = alert
        for key, known in self._vehicles.items():
            if known.monitor is not None:
                self._follow_earlier(key, known)
        again = [a for k, a in enumerate(found) if k < _REPEATED or a.state is not AlertState.CLEARED]
        return again[::-1]

    def _repeat(self, alerts: Sequence[AlertView]) -> None:
        for alert in alerts:
            self._tell(alert.fleet, alert.vehicle, [_of_alert(alert)])

    def _keep_alert(self, alert: AlertView) -> list[_Told]:
        """Hand a new version to the store, which says when it may be told; returns what may be told at once."""
        kept = self._ledger.follow(alert)
        self._follow_in_book(kept)
        if self._store is None:
            self._ledger.unsaved.clear()
            self._show_alert(kept)
            return [_of_alert(kept)]
        self._save_alerts(self._store)
        return []

    def _save_alerts(self, store: Store) -> None:
        """Hand over what the store has not taken over yet."""
        for name in list(self._ledger.unsaved):
            alert = self._ledger.newest(name)
            if alert is None or self._guarded(partial(_saved, store, alert, self._alert_kept)):
                self._ledger.unsaved.pop(name)

    def _alert_kept(self, alert: AlertView) -> None:
        """In the store's thread: this version is committed, so it may be told."""
        with self._lock:
            self._show_alert(alert)
        self._tell(alert.fleet, alert.vehicle, [_of_alert(alert)])

    def _show_alert(self, alert: AlertView) -> None:
        self._ledger.commit(alert)
        self._event(
            "alert",
            {"id": alert.id, "fleet": alert.fleet, "vehicle": alert.vehicle, "state": str(alert.state),
             "kind": alert.kind, "cause": alert.cause, "level": alert.level, "text": alert.text},
        )  # fmt: skip

    def _keep_history(
        self, fleet: str, vehicle: str, known: KnownVehicle, monitor: VehicleMonitor, report: Report
    ) -> None:
        store = self._store
        if store is None:
            return
        rows: list[EstimateRecord] = []
        for solution in report.solutions:
            since = solution.time_s - known.history_s
            if 0.0 <= since < self._settings.history_interval_s - 1e-6:
                continue
            known.history_s = solution.time_s
            estimates: list[Estimate] = [e for m in solution.modes.values() for e in (m.fourier, m.ekf)]
            rows += [
                EstimateRecord.of(fleet, vehicle, e, monitor.aircraft.name, monitor.configuration)
                for e in estimates
            ]
        if rows:
            self._guarded(lambda: store.append_estimates(rows))
        loading = known.loading
        if not known.recalled or loading is None:
            return  # nothing is written over what has not been read
        name, configuration = monitor.aircraft.name, monitor.configuration
        cells = loading.kept_cells(monitor.cells.take_changed())
        if cells:
            self._guarded(lambda: store.save_cells(fleet, vehicle, name, configuration, cells))
        learned = _blocks(monitor)
        if learned > known.saved_blocks:
            known.saved_blocks = learned
            self._guarded(
                lambda: store.save_references(
                    fleet, vehicle, name, configuration, loading.kept(monitor.references)
                )
            )

    def _guarded(self, action: Callable[[], Any]) -> Any:
        """A store that fails is counted and reported; watching goes on."""
        try:
            return action()
        except Exception as error:  # whatever a database raises must not stop the watch
            self._count("store")
            self._event("problem", {"what": "store", "text": str(error)})
            return None

    def _late_start(self, key: VehicleKey, known: KnownVehicle) -> list[_Told]:
        """What is held of a vehicle handed over, if it can be by now."""
        if known.recalled:
            return []
        try:
            self._recall(*key, known)
        except Exception as error:
            self._note_fault(*key, known, error)
            return []
        return [told for _, news in self._advance({key: known}) for told in news]

    def _note_fault(self, fleet: str, vehicle: str, known: KnownVehicle, error: Exception) -> None:
        """Inside an ``except``: the vehicle's state shows it, the log says where it came from."""
        known.note_fault(error, self._clock())
        if known.monitor is None:
            known.drop_held()  # there is none to be made, and what waits for it must not grow
        self._count("faults")
        if self._problems["faults"] <= _LOGGED_FAULTS:
            about = {"vehicle": f"{fleet}/{vehicle}"}
            _LOG.exception("the samples of %s/%s led to a fault of the program", fleet, vehicle, extra=about)

    def _count(self, problem: str) -> None:
        self._problems[problem] = self._problems.get(problem, 0) + 1

    @property
    def problems(self) -> dict[str, int]:
        """What went wrong so far, by kind, without zeros."""
        of_names = {
            "vehicles_forgotten": self._vehicles.forgotten,
            "too_many_vehicles": self._vehicles.refused,
            "events_forgotten": self._event_id - len(self._events),
            "alerts_forgotten": self._ledger.forgotten,
        }
        return self._problems | {name: times for name, times in of_names.items() if times}

    def _alarmed(self, key: VehicleKey) -> bool:
        return self._ledger.stands(key)

    def _event(self, kind: str, data: Mapping[str, Any]) -> None:
        self._event_id += 1
        self._events.append(Event(self._event_id, kind, data))

    def _tell(self, fleet: str, vehicle: str, news: Sequence[_Told]) -> None:
        if self.outputs is None:
            return
        for item in news:
            if item == "ask":
                self.outputs.ask_aircraft(fleet, vehicle)
            else:
                self.outputs.announce(fleet, vehicle, *item)

    def _may_ask(self, known: KnownVehicle) -> bool:
        """Whether a vehicle that never said what it is is asked now."""
        now = self._clock()
        if now - known.asked_s < self._settings.ask_interval_s or self._asks_left <= 0:
            return False
        known.asked_s = now
        self._asks_left -= 1
        return True

    def tick(self) -> None:
        """To be called about once a second: staleness, and status for those who listen."""
        now = self._clock()
        due: list[tuple[str, str, list[_Told]]] = []
        with self._lock:
            earlier = self._read_alerts(0.0)
            for alert in self._ledger.come_back(self._wall_clock()):
                self._follow_in_book(alert)
            if self._store is not None:
                self._save_alerts(self._store)
            self._asks_left = _MOST_ASKS
            self._save_some(dict(self._vehicles.items()))
            self._held = sum(len(known.held) for _, known in self._vehicles.items())
            forgotten, self._forgotten = self._vehicles.forgotten - self._forgotten, self._vehicles.forgotten
            for (fleet, vehicle), known in self._vehicles.items():
                news = self._late_start((fleet, vehicle), known)
                state, _ = known.standing(now, self._settings.stale_s)
                if state is not known.shown:
                    known.published_s = now
                    news.append(self._shown(fleet, vehicle, known, state))
                elif now - known.published_s >= self._settings.status_interval_s:
                    known.published_s = now
                    news.append(("status", partial(self._view, fleet, vehicle, known)))
                due.append((fleet, vehicle, news))
        self._repeat(earlier)
        for fleet, vehicle, news in due:
            self._tell(fleet, vehicle, news)
        if forgotten:
            _LOG.warning("%d vehicles were forgotten to make room for new names", forgotten)

    # -- what may be asked (MonitorPort) ---------------------------------------------------------

    def _view(self, fleet: str, vehicle: str, known: KnownVehicle) -> VehicleView:
        with self._lock:
            now_s = self._clock()
            try:
                return known.view(fleet, vehicle, now_s, self._settings.stale_s, self._ledger.ids)
            except Exception as error:  # one vehicle that cannot be shown must not hide the others
                self._note_fault(fleet, vehicle, known, error)
                return known.bare_view(fleet, vehicle, VehicleState.UNKNOWN, known.fault_text)

    def vehicles(self) -> Sequence[VehicleView]:
        """All vehicles ever heard of, worst state first; samples are taken in between some and the next."""
        with self._lock:
            everyone = list(self._vehicles.items())
        views: list[VehicleView] = []
        for start in range(0, len(everyone), _SHOWN_AT_ONCE):
            with self._lock:
                some = everyone[start : start + _SHOWN_AT_ONCE]
                views += [self._view(fleet, vehicle, known) for (fleet, vehicle), known in some]
        return sorted(views, key=lambda v: (STATE_ORDER.index(v.state), v.fleet, v.vehicle))

    def vehicle(self, fleet: str, vehicle: str) -> VehicleView | None:
        """One vehicle; None for one never heard of."""
        with self._lock:
            known = self._vehicles.get((fleet, vehicle))
        return None if known is None else self._view(fleet, vehicle, known)

    def derivatives(self, fleet: str, vehicle: str) -> Mapping[str, Any] | None:
        """The ``estimate`` object with ``time_s`` and expectations; None for an unknown vehicle."""
        with self._lock:
            known = self._vehicles.get((fleet, vehicle))
            if known is None:
                return None
            if known.monitor is None:
                return {"time_s": None, "basis": None, "estimators": {}, "not_estimated": {}}
            return known.monitor.derivatives()

    def alerts(self) -> Sequence[AlertView]:
        """All alerts that may be told, newest first."""
        with self._lock:
            return self._ledger.all_shown()

    def act_on_alert(
        self,
        alert_id: str,
        action: AlertAction,
        who: str,
        note: str,
        key: str | None = None,
        shelve_s: float = SHELVED_S,
    ) -> AlertView | None:
        """Carry out a person's action; returns once the store has committed it, None for an unknown alert.

        Raises:
            ValueError: it makes no sense; ``KeyReusedError`` where its key belongs to another one.
            DatabaseError: it has not been committed in time, and has not happened.
        """
        request = ActionRequest(alert_id, action, who, note, key, self._wall_clock() + shelve_s)
        with self._lock:
            shown = self._ledger.shown(alert_id)
        if shown is None:
            return None
        change, taken = partial(self._changed, request), partial(self._acted, request)
        if self._store is None:
            taken(change())
        else:
            newest = partial(self._newest_alert, shown)
            self._store.carry_out(ActionPlan(request, change, taken, newest, self._rewritten))
        with self._lock:
            return self._ledger.shown(alert_id) or shown

    def _changed(self, request: ActionRequest) -> AlertView:
        with self._lock:
            return self._ledger.changed(request, self._last_sample_time_s)

    def _last_sample_time_s(self, alert: AlertView) -> float | None:
        known = self._vehicles.get((alert.fleet, alert.vehicle))
        return None if known is None or known.monitor is None else known.monitor.last_sample_time_s

    def _acted(self, request: ActionRequest, changed: AlertView) -> None:
        """The action is committed: it counts from now on, and is told."""
        with self._lock:
            merged = self._ledger.acted(changed)
            self._show_alert(changed)
            self._follow_in_book(merged)
            key = changed.fleet, changed.vehicle
            known = self._vehicles.get(key)
            if known is not None and known.monitor is not None:
                known.urgent = True
                self._save_some({key: known})
            if merged != changed and self._store is not None:  # the monitor has gone on meanwhile
                self._ledger.unsaved[merged.id] = None
                self._save_alerts(self._store)
        self._tell(changed.fleet, changed.vehicle, [_of_alert(changed)])

    def _follow_in_book(self, alert: AlertView) -> None:
        """The vehicle's monitor takes over what was done to its alert; one that is cleared it follows no longer."""
        known = self._vehicles.get((alert.fleet, alert.vehicle))
        book = known.monitor.book if known is not None and known.monitor is not None else None
        if book is None or book.active is None or book.active.id != alert.id:
            return
        if alert.state is AlertState.CLEARED:
            book.dismiss()
        else:
            book.take_over(alert)

    def _newest_alert(self, shown: AlertView) -> AlertView:
        with self._lock:
            return self._ledger.newest(shown.id) or shown

    def _rewritten(self, newest: AlertView) -> None:
        """An action was undone by writing the newest version, which may be newer than the one that was told."""
        with self._lock:
            told = self._ledger.shown(newest.id) == newest
        if not told:
            self._alert_kept(newest)

    def events(self, after: int) -> Sequence[Event]:
        """Events with an id above ``after``, oldest first."""
        with self._lock:
            if after >= self._event_id:
                return []
            return [e for e in self._events if e.id > after]


def _of_alert(alert: AlertView) -> _Told:
    return "alerts", lambda: alert


def _saved(store: Store, alert: AlertView, kept: Callable[[AlertView], None]) -> bool:
    store.save_alert(alert, kept)
    return True


def _blocks(monitor: VehicleMonitor) -> int:
    """Blocks that a vehicle's references rest on; one more means there is something new to keep."""
    return sum(r.blocks for r in monitor.references.values())
