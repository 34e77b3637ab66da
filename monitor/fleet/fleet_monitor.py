"""The live fleet: messages in, vehicles watched, alerts and events out. One lock, no I/O of its own.

Who brings messages, where alerts are stored and where outputs are published is handed in, so the same object serves
the service, the demo and the tests.
"""

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.monitor.detection.alert_finding import AlertFinding
from wingwatch.monitor.estimation.chain import Solution
from wingwatch.monitor.fleet import record as pictures
from wingwatch.monitor.fleet.alerts import FleetAlerts
from wingwatch.monitor.fleet.arrivals import FleetArrivals
from wingwatch.monitor.fleet.checkpoints import FleetCheckpoints
from wingwatch.monitor.fleet.context import FleetContext, Outgoing
from wingwatch.monitor.fleet.diagnoses import AlertFlight, FleetRings, alert_flight
from wingwatch.monitor.fleet.intake import Intake
from wingwatch.monitor.fleet.manoeuvres import judge_manoeuvres
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.memory import keep, learned_blocks, note_changes, renew
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.fleet.overload import FleetOverload
from wingwatch.monitor.fleet.proposals import FleetProposals
from wingwatch.monitor.fleet.resuming import Checkpoints
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.fleet.settings import FleetSettings
from wingwatch.monitor.fleet.together import feed_together
from wingwatch.monitor.fleet.views import FleetViews
from wingwatch.monitor.ports import ActionRequest, Outputs, Store, VehicleMemory
from wingwatch.monitor.positions import Place
from wingwatch.monitor.record_views import FlightRecordView
from wingwatch.monitor.vehicle.checkpoint import SavedVehicle, settings_of
from wingwatch.monitor.vehicle.vehicle_monitor import Report, VehicleMonitor
from wingwatch.monitor.views import (
    SHELVED_S,
    AlertAction,
    AlertGroupView,
    AlertState,
    AlertView,
    Event,
    FleetFigures,
    ManoeuvreView,
    VehicleState,
    VehicleView,
)
from wingwatch.telemetry import (
    InboundMessage,
    MessageError,
    SensorsMessage,
    decode_aircraft,
    decode_sensors,
)

__all__ = ["FleetMonitor", "FleetPorts"]

_LOG = logging.getLogger(__name__)

Array = NDArray[np.float64]

_MOST_HELD = 2000  # pieces of messages, of all vehicles together, for which monitors are still to be made
_MOST_WAITING = 1000  # pieces of one vehicle's messages; beyond, the publisher waits, and all others with it
_ENOUGH = 10  # pieces of one vehicle: two seconds of messages of ten samples at 50 Hz
_AT_ONCE_S = 0.005  # of samples that wait; REST and new messages wait as long
_CAUGHT_UP_AT_ONCE = 16  # vehicles
_START_PATIENCE_S = 5.0  # for the alerts of earlier runs


_NOTHING: Sequence[Outgoing] = ()


@dataclass(frozen=True, slots=True)
class FleetPorts:
    """What a fleet is connected to; each may be missing.

    Attributes:
        store: memory across restarts.
        outputs: where news goes.
        checkpoints: where states of vehicles are kept; ``FleetMonitor.resume`` goes on from them.
    """

    store: Store | None = None
    outputs: Outputs | None = None
    checkpoints: Checkpoints | None = None


class FleetMonitor:
    """All vehicles of a service; implements ``MonitorPort``.

    Args:
        find_aircraft: the aircraft of a name; raises ValueError with one sentence for an unknown one.
        clock: wall or monotonic time in s, for staleness only.
        new_id: makes alert ids.
        ports: what it is connected to; nothing if not given.
        settings: limits of the live loop, and the settings of the test.
        wall_clock: seconds since 1970-01-01 UTC, for the time that alerts are shelved.
    """

    def __init__(
        self,
        find_aircraft: Callable[[str], Aircraft],
        clock: Callable[[], float],
        new_id: Callable[[], str],
        ports: FleetPorts | None = None,
        settings: FleetSettings | None = None,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        ports = ports or FleetPorts()
        self._find, self._settings = find_aircraft, settings or FleetSettings()
        self._context = context = FleetContext(self._settings, clock, wall_clock, ports.store, ports.outputs)
        self._lock, self._clock, self._vehicles = context.lock, clock, context.vehicles
        self._saving = FleetCheckpoints(context, ports.checkpoints)
        self._alerts = FleetAlerts(context, self._saving.save_now)
        self._proposals = FleetProposals(context, new_id)
        self._views = FleetViews(context, self._proposals)
        self._arrivals, self._overload = FleetArrivals(context, find_aircraft), FleetOverload(context)
        self._maker = MonitorMaker(new_id, self._settings.judge)
        self._rings = FleetRings(self._settings.ring_channels)
        self._forgotten = 0
        self._solutions = 0
        self._held = 0
        self._behind: dict[VehicleKey, KnownVehicle] = {}
        self._intake = Intake()
        self._alerts.repeat(self._alerts.read_earlier(_START_PATIENCE_S))

    def prepare_with(self, executor: Executor) -> None:
        """Expectations of further types and loadings are worked out there from now on, while their samples wait."""
        self._maker.executor = executor

    def resume(self) -> None:
        """Every vehicle goes on from its checkpoint; to be called once, before the first message."""
        self._saving.resume(self._find, self._maker, self._alerts.follow_earlier)
        with self._lock:
            self._behind |= {key: known for key, known in self._vehicles.items() if known.held}
            self._held += sum(len(known.held) for known in self._behind.values())

    def take_over(
        self, fleet: str, vehicle: str, saved: SavedVehicle | None, alerts: Sequence[AlertView]
    ) -> None:
        """A vehicle is watched here from now on; to be called before its first message.

        Args:
            saved: its last checkpoint, from which it goes on; None where there is none.
            alerts: its alerts as the database has them, newest first.
        """
        key = fleet, vehicle
        with self._lock:
            self._alerts.take(key, alerts)
            known_here = self._vehicles.get(key) is not None
        if saved is not None and not known_here:
            self._saving.resume_one(saved, self._find, self._maker, self._alerts.follow_earlier, {})
        with self._lock:
            known = self._vehicles.get(key)
            if known is not None and known.held:
                self._behind[key] = known
                self._held += len(known.held)
        in_force = [alert for alert in alerts if alert.state is not AlertState.CLEARED]
        self._alerts.repeat(in_force[::-1])  # whoever watched it may have ended before it said so

    def knows(self, fleet: str, vehicle: str) -> bool:
        """Whether a vehicle is watched here."""
        return self._vehicles.get((fleet, vehicle)) is not None

    @property
    def size(self) -> int:
        """Vehicles that are remembered."""
        return len(self._vehicles)

    def tell_forgotten(self, forgotten: Callable[[VehicleKey], object]) -> None:
        """Each vehicle that gives way to another name is named from now on, with the lock held."""
        self._vehicles.tell = forgotten

    def _give_up(self, key: VehicleKey, saved: bool) -> None:
        """A vehicle is watched elsewhere from now on: nothing is said of it any more.

        Args:
            saved: whether its last state is saved; where another has gone on with it, what is known here is older.
        """
        known = self._vehicles.remove(key)
        self._behind.pop(key, None)
        if known is not None:
            self._held -= len(known.held)
            if saved:
                self._saving.give_up(key, known)
            self._context.ledger.give_up(key)

    def unsaved(self) -> Iterator[SavedVehicle]:
        """States that have changed since they were saved, for whoever ends the service; one copied at a time."""
        return self._saving.unsaved()

    # -- what comes in ------------------------------------------------------------------------

    def receive(self, fleet: str, vehicle: str, stream: str, payload: bytes, encoding: str) -> None:
        """Take in one message; ``stream`` is ``sensors`` or ``aircraft``. It raises nothing.

        What a message holds that is no message is counted; what the program fails on is counted and shown in the
        vehicle's state.
        """
        self.receive_all([InboundMessage(fleet, vehicle, stream, payload, encoding, self._clock())])

    def receive_all(self, messages: Sequence[InboundMessage]) -> None:
        """Take in messages in the order of their arrival, their vehicles together, as ``receive`` takes in one.

        What may be asked waits until all of them are taken in: a few dozen at a time. Large messages may be left in
        part for the next call, which may bring none (``behind``).
        """
        outgoing: list[tuple[VehicleKey, Sequence[Outgoing]]] = []
        with self._lock:
            ready: dict[VehicleKey, KnownVehicle] = {}
            for message in messages:
                key = message.fleet, message.vehicle
                if message.stream == "left":
                    self._arrivals.left(key, message.received_s)
                    continue
                if message.stream in ("given_up", "dropped"):
                    ready.pop(key, None)
                    self._give_up(key, message.stream == "given_up")
                    continue
                known = self._vehicles.heard(key)
                if known is None:
                    self._intake.count("too_many_vehicles")
                    continue
                if message.stream == "aircraft" and key in ready:
                    outgoing += self._advance({key: ready.pop(key)})  # its samples so far are of what it was
                news = self._taken_in(key, known, message)
                if news:
                    outgoing.append((key, news))
                if known.monitor is not None and known.held:
                    ready[key] = known
            for key in list(self._behind)[:_CAUGHT_UP_AT_ONCE]:
                ready.setdefault(key, self._behind.pop(key))
            outgoing += self._advance(ready)
            self._saving.save_some(ready)
        for (fleet, vehicle), news in outgoing:
            self._context.tell((fleet, vehicle), news)

    def has_enough(self, fleet: str, vehicle: str) -> bool:
        """Whether so much of the vehicle waits here that further messages of it are better left where they are.

        For the thread that calls ``receive_all``: a vehicle that sends more than is taken in waits there, and no other.
        """
        known = self._vehicles.get((fleet, vehicle))
        return known is not None and len(known.held) >= _ENOUGH

    def relieve(self, lags_s: Mapping[VehicleKey, float]) -> None:
        """Leave vehicles out while there is too much to compute; to be called about once a second.

        Args:
            lags_s: how long the oldest message of each vehicle has waited, by fleet and name.
        """
        with self._lock:
            self._overload.look(lags_s)
            self._behind = {key: known for key, known in self._behind.items() if not known.left_out}

    @property
    def left_out(self) -> int:
        """Vehicles that are not watched, because the machine is overloaded."""
        return self._overload.left_out

    @property
    def behind(self) -> bool:
        """Whether samples wait that the next call of ``receive_all`` takes in."""
        return bool(self._behind)

    @property
    def held(self) -> bool:
        """Whether samples wait for the monitor of their vehicle to be made."""
        with self._lock:
            return any(known.held for _, known in self._vehicles.items())

    @property
    def intake(self) -> Mapping[str, int]:
        """Messages ``received``, and what became of them (``Intake``)."""
        return self._intake.counts

    def _taken_in(self, key: VehicleKey, known: KnownVehicle, message: InboundMessage) -> Sequence[Outgoing]:
        """One message decoded; samples that can be used are held for ``_advance``."""
        if known.left_out and message.stream != "aircraft":
            known.owner.heard_s = message.received_s
            known.count("message_left_out")
            self._intake.count("message_left_out")
            return _NOTHING
        try:
            if message.stream == "aircraft":
                announced = decode_aircraft(message.payload, message.encoding)
                became, news = self._arrivals.heard_of(key, known, announced, message.received_s), _NOTHING
            else:
                samples = decode_sensors(message.payload, message.encoding)
                became, news = self._sampled(key, known, samples, message.received_s)
        except MessageError as error:
            became, news = f"message_{error.reason}", _NOTHING
            known.count(became)
        except Exception as error:  # one vehicle's fault must neither end the watch nor pass for health
            became, news = "faults", _NOTHING
            self._context.note_fault(*key, known, error)
        self._intake.count(became)
        return news

    def _sampled(
        self, key: VehicleKey, known: KnownVehicle, message: SensorsMessage, at_s: float
    ) -> tuple[str, Sequence[Outgoing]]:
        """What became of the message, and the question what aircraft it is, if that is asked."""
        became, news = self._arrivals.sampled(key, known, message, at_s)
        if became == "sensors":
            self._held += known.hold(message)
            if known.monitor is None and not known.recalled:
                self._recall(*key, known)
        return became, news

    def _advance(self, ready: Mapping[VehicleKey, KnownVehicle]) -> list[tuple[VehicleKey, list[Outgoing]]]:
        """Hand over what is held of vehicles that have a monitor, piece by piece, all vehicles at once.

        It ends after ``_AT_ONCE_S``; what is left then is handed over later, unless too much waits: nothing is lost.
        """
        until_s = self._clock() + _AT_ONCE_S
        outgoing: list[tuple[VehicleKey, list[Outgoing]]] = []
        going = [(key, known, known.monitor) for key, known in ready.items() if known.monitor is not None]
        while going := [one for one in going if one[1].held]:
            self._held -= len(going)
            blocks = [known.held.popleft().block for _, known, _ in going]
            reports = feed_together([monitor for _, _, monitor in going], blocks)
            sound = []
            for one, block, report in zip(going, blocks, reports, strict=True):
                key, known, _ = one
                self._rings.add(known, block)
                try:
                    if isinstance(report, Exception):
                        raise report
                    self._rings.look(known)
                    news = self._digest(*key, known, report)
                except Exception as error:  # it must neither end the watch of others nor pass for health
                    self._context.note_fault(*key, known, error)
                    continue
                sound.append(one)
                known.unsaved = True
                known.urgent |= bool(report.alerts)
                if news:
                    outgoing.append((key, news))
            going = sound
            most = max((len(known.held) for _, known, _ in going), default=0)
            if self._clock() >= until_s and most < _MOST_WAITING:
                break
        self._behind |= {
            key: known for key, known in ready.items() if known.monitor is not None and known.held
        }
        return outgoing

    def _recall(self, fleet: str, vehicle: str, known: KnownVehicle) -> None:
        """Start the vehicle's monitor with what is kept of it, or without after a while, and then add it later."""
        store, aircraft, announced = self._context.store, known.aircraft, known.message
        loading = known.loading
        if aircraft is None or announced is None or loading is None or not (known.held or known.monitor):
            return
        if known.monitor is None and self._held < _MOST_HELD:
            given = known.held[0].given
            if not self._maker.ready(loading.aircraft, announced.configuration, given):
                return
        memory: VehicleMemory | None = VehicleMemory()
        if store is not None:
            ask = partial(store.recall, fleet, vehicle, aircraft, announced.configuration)
            memory = self._context.guarded(ask)
        if known.monitor is not None:
            if memory is not None:
                known.monitor.adopt(loading.recalled(memory))
                known.recalled, known.late = True, True
                known.change, known.renewed, known.renewal = memory.change, known.renewal, None
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
        known.recalled, known.change = memory is not None, 0 if memory is None else memory.change
        known.saved_blocks = learned_blocks(known.monitor)
        known.given, known.settings = given, settings_of(known.monitor, given)
        self._alerts.follow_earlier((fleet, vehicle), known)

    # -- what it leads to ----------------------------------------------------------------------

    def _digest(self, fleet: str, vehicle: str, known: KnownVehicle, report: Report) -> list[Outgoing]:
        monitor = known.monitor
        if monitor is None:
            return []
        news: list[Outgoing] = []
        for alert in report.alerts:
            news += self._alerts.keep(alert)
        judge_manoeuvres(self._context, (fleet, vehicle), known, report.manoeuvres)
        pictures.note(known, report)
        self._solutions += len(report.solutions)
        if report.solutions:
            keep(self._context, (fleet, vehicle), known, report)
            latest = report.solutions[-1]
            news.append(("derivatives", partial(self._derivatives_of, monitor, latest)))
            self._context.event("derivatives", {"fleet": fleet, "vehicle": vehicle, "time_s": latest.time_s})
        state, _ = known.standing(self._clock(), self._settings.stale_s)
        if state is not known.shown:
            news.append(self._shown(fleet, vehicle, known, state))
        return news

    def _shown(self, fleet: str, vehicle: str, known: KnownVehicle, state: VehicleState) -> Outgoing:
        """The state has changed to this one."""
        known.shown = state
        self._context.event("status", {"fleet": fleet, "vehicle": vehicle, "state": str(state)})
        return "status", partial(self._views.one, (fleet, vehicle), known)

    def _derivatives_of(self, monitor: VehicleMonitor, solution: Solution) -> Mapping[str, Any]:
        with self._lock:
            return monitor.derivatives(solution)

    def _late_start(self, key: VehicleKey, known: KnownVehicle) -> list[Outgoing]:
        """What is held of a vehicle handed over, if it can be by now."""
        if known.recalled and known.renewal is None:
            return []
        try:
            if known.recalled:
                renew(self._context, key, known, self._maker)
                return []
            self._recall(*key, known)
        except Exception as error:
            self._context.note_fault(*key, known, error)
            return []
        return [outgoing for _, news in self._advance({key: known}) for outgoing in news]

    @property
    def problems(self) -> dict[str, int]:
        """What went wrong so far, by kind, without zeros."""
        return self._context.problems

    def tick(self) -> None:
        """To be called about once a second: staleness, and status for those who listen."""
        now = self._clock()
        due: list[tuple[str, str, list[Outgoing]]] = []
        with self._lock:
            earlier = self._alerts.read_earlier(0.0)
            self._alerts.look_again()
            self._arrivals.new_second()
            note_changes(self._context)
            self._saving.save_some(dict(self._vehicles.items()))
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
                    news.append(("status", partial(self._views.one, (fleet, vehicle), known)))
                due.append((fleet, vehicle, news))
            due += [(*key, [proposal]) for key, proposal in self._proposals.look()]
        self._alerts.repeat(earlier)
        for fleet, vehicle, news in due:
            self._context.tell((fleet, vehicle), news)
        if forgotten:
            _LOG.warning("%d vehicles were forgotten to make room for new names", forgotten)

    # -- what may be asked (MonitorPort) ---------------------------------------------------------

    def vehicles(self) -> Sequence[VehicleView]:
        """All known vehicles, worst state first; samples are taken in between some and the next."""
        return self._views.all()

    def brief(self) -> Sequence[VehicleView]:
        """All known vehicles in any order, without what is worked out for a view; cheap enough for every second."""
        return self._views.brief()

    def vehicle(self, fleet: str, vehicle: str) -> VehicleView | None:
        """One vehicle; None for an unknown one."""
        with self._lock:
            known = self._vehicles.get((fleet, vehicle))
        return None if known is None else self._views.one((fleet, vehicle), known)

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
        """All alerts that may be announced, newest first."""
        with self._lock:
            return self._context.ledger.all_shown()

    def manoeuvres(self, fleet: str, vehicle: str) -> Sequence[ManoeuvreView] | None:
        """The vehicle's last ten manoeuvres, newest first; None for an unknown vehicle."""
        with self._lock:
            known = self._vehicles.get((fleet, vehicle))
            return None if known is None else tuple(known.manoeuvres)

    def flight_record(self, fleet: str, vehicle: str) -> FlightRecordView | None:
        """What is kept of the vehicle's last hour for pictures; None for an unknown vehicle."""
        with self._lock:
            known = self._vehicles.get((fleet, vehicle))
            return None if known is None else pictures.record_of(known, self._clock())

    def expected(
        self, fleet: str, vehicle: str, structure: str, aircraft: tuple[str, str], conditions: Array
    ) -> tuple[Array, Array] | None:
        """Present expectation of a structure at m flown conditions (``MonitorPort``).

        ``conditions`` (m, 4): airspeed m/s, altitude m, density kg/m3, angle of attack rad. Gives value and standard
        error, concise, (m, k) each; None without an expectation.
        """
        with self._lock:
            known = self._vehicles.get((fleet, vehicle))
        # Without the lock: expectations and what flights taught are replaced, never changed.
        return None if known is None else pictures.expected_of(known, structure, aircraft, conditions)

    def alert_groups(self) -> Sequence[AlertGroupView]:
        """Alerts in force that are one event, largest first."""
        with self._lock:
            return self._alerts.groups()

    def alert_places(self) -> Mapping[str, tuple[int, Place]]:
        """Where and when alerts of icing were raised, by id, for whoever groups those of several monitors."""
        with self._lock:
            return self._alerts.places()

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
        until_at_s = self._context.wall_clock() + shelve_s
        return self._alerts.carry_out(ActionRequest(alert_id, action, who, note, key, until_at_s))

    def alert_flight(self, alert_id: str) -> AlertFlight | None:
        """The last minutes of the vehicle of an alert in force; None where there are none."""
        with self._lock:
            return alert_flight(self._context, alert_id)

    def note_diagnosis(self, alert_id: str, finding: AlertFinding) -> bool:
        """A diagnosis says something about an alert, which is updated as by its monitor; False for an unknown one."""
        with self._lock:
            news, shown = self._alerts.diagnosed(alert_id, finding), self._context.ledger.newest(alert_id)
        if news is None or shown is None:
            return False
        self._context.tell((shown.fleet, shown.vehicle), news)
        return True

    def events(self, after: int) -> Sequence[Event]:
        """Events with an id above ``after``, oldest first."""
        with self._lock:
            return self._context.events.after(after)

    def events_complete_after(self) -> int:
        """Who has seen the event of this id or a later one has missed none but those that newer ones replaced."""
        return self._context.events.complete_after

    def figures(self) -> FleetFigures:
        """The fleet in numbers; samples are taken in between some vehicles and the next."""
        return self._views.figures(self._solutions, self.left_out)
