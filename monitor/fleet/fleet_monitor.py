"""The live fleet: messages in, vehicles watched, alerts and events out. One lock, no I/O of its own.

Who brings messages, where alerts are stored and where outputs are published is handed in, so the same object serves
the service, the demo and the tests.
"""

import logging
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.monitor.detection.alert_finding import AlertFinding
from wingwatch.monitor.fleet import record as pictures
from wingwatch.monitor.fleet.alerts import FleetAlerts
from wingwatch.monitor.fleet.arrivals import FleetArrivals
from wingwatch.monitor.fleet.checkpoints import FleetCheckpoints
from wingwatch.monitor.fleet.context import FleetContext, Outgoing
from wingwatch.monitor.fleet.diagnoses import AlertFlight, alert_flight
from wingwatch.monitor.fleet.memory import note_changes
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.fleet.overload import FleetOverload
from wingwatch.monitor.fleet.proposals import FleetProposals
from wingwatch.monitor.fleet.resuming import Checkpoints
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.fleet.sample_way import SampleWay
from wingwatch.monitor.fleet.settings import FleetSettings
from wingwatch.monitor.fleet.views import FleetViews
from wingwatch.monitor.ports import ActionRequest, Outputs, Store
from wingwatch.monitor.positions import Place
from wingwatch.monitor.record_views import FlightRecordView
from wingwatch.monitor.vehicle.checkpoint import SavedVehicle
from wingwatch.monitor.views import (
    SHELVED_S,
    AlertAction,
    AlertGroupView,
    AlertState,
    AlertView,
    Event,
    FleetFigures,
    ManoeuvreView,
    VehicleView,
)
from wingwatch.telemetry import (
    InboundMessage,
)

__all__ = ["FleetMonitor", "FleetPorts"]

_LOG = logging.getLogger(__name__)

Array = NDArray[np.float64]

_START_PATIENCE_S = 5.0  # for the alerts of earlier runs


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
        self._way = SampleWay(
            context, self._arrivals, self._alerts, self._views, self._maker, self._saving.give_up
        )
        self._forgotten = 0
        self._alerts.repeat(self._alerts.read_earlier(_START_PATIENCE_S))

    def prepare_with(self, executor: Executor) -> None:
        """Expectations of further types and loadings are worked out there from now on, while their samples wait."""
        self._maker.prepare_with(executor)

    def resume(self) -> None:
        """Every vehicle goes on from its checkpoint; to be called once, before the first message."""
        self._saving.resume(self._find, self._maker, self._alerts.reinstate_earlier)
        with self._lock:
            self._way.begin()

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
            self._saving.resume_one(saved, self._find, self._maker, self._alerts.reinstate_earlier, {})
        with self._lock:
            self._way.go_on(key)
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
        self._vehicles.tell_forgotten(forgotten)

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
        with self._lock:
            ready, outgoing = self._way.take_in(messages)
            self._saving.save_some(ready)
        for key, news in outgoing:
            self._context.tell(key, news)

    @property
    def full(self) -> Collection[VehicleKey]:
        """Vehicles of which so much waits here that further messages of them are better left where they are.

        As of the last call: a vehicle that sends more than is taken in waits with its caller, and no other.
        """
        return self._way.full

    def relieve(self, lags_s: Mapping[VehicleKey, float]) -> None:
        """Leave vehicles out while there is too much to compute; to be called about once a second.

        Args:
            lags_s: how long the oldest message of each vehicle has waited, by fleet and name.
        """
        with self._lock:
            self._overload.look(lags_s)
            self._way.note_full()

    @property
    def left_out(self) -> int:
        """Vehicles that are not watched, because the machine is overloaded."""
        return self._overload.left_out

    @property
    def behind(self) -> bool:
        """Whether samples wait that the next call of ``receive_all`` takes in."""
        return self._way.behind

    @property
    def held(self) -> bool:
        """Whether samples wait for the monitor of their vehicle to be made."""
        with self._lock:
            return any(known.waiting for _, known in self._vehicles.items())

    @property
    def intake(self) -> Mapping[str, int]:
        """Messages ``received``, and what became of them (``Intake``)."""
        return self._way.intake.counts

    @property
    def problems(self) -> dict[str, int]:
        """What went wrong so far, by kind, without zeros."""
        return self._context.problems

    def tick(self) -> None:
        """To be called about once a second: staleness, and status for those who listen."""
        now = self._clock()
        due: list[tuple[VehicleKey, list[Outgoing]]] = []
        with self._lock:
            earlier = self._alerts.read_earlier(0.0)
            self._alerts.look_again()
            self._arrivals.new_second()
            note_changes(self._context)
            self._saving.save_some(dict(self._vehicles.items()))
            self._way.count_waiting()
            forgotten, self._forgotten = self._vehicles.forgotten - self._forgotten, self._vehicles.forgotten
            for key, known in self._vehicles.items():
                news = self._way.start_late(key, known)
                changed = self._views.news_of_state(key, known, now)
                if changed or now - known.published_s >= self._settings.status_interval_s:
                    known.note_published(now)
                    news += changed or [self._views.status(key, known)]
                due.append((key, news))
            due += [(key, [proposal]) for key, proposal in self._proposals.look()]
            self._way.note_full()
        self._alerts.repeat(earlier)
        for key, news in due:
            self._context.tell(key, news)
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
            if known is None:
                return None
            return () if known.watch is None else tuple(known.watch.manoeuvres)

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
        return self._views.figures(self._way.solutions, self.left_out)
