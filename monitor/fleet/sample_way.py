"""One sample's way: decoded, held, handed to its vehicle's monitor; what that leads to is kept, and given as news."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from wingwatch.monitor.estimation.chain import Solution
from wingwatch.monitor.fleet.alerts import FleetAlerts
from wingwatch.monitor.fleet.arrivals import FleetArrivals
from wingwatch.monitor.fleet.context import FleetContext, Outgoing
from wingwatch.monitor.fleet.intake import Intake
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.member.states import Recalling, Watched
from wingwatch.monitor.fleet.memory import adopt_late, keep, recalled, renew
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.monitor.fleet.together import feed_together
from wingwatch.monitor.fleet.views import FleetViews
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.monitor.vehicle.manoeuvre_verdict import verdict
from wingwatch.monitor.vehicle.manoeuvre_watch import FlownManoeuvre
from wingwatch.monitor.vehicle.vehicle_monitor import Report, VehicleMonitor
from wingwatch.telemetry import (
    InboundMessage,
    MessageError,
    SensorsMessage,
    decode_aircraft,
    decode_sensors,
)

__all__ = ["SampleWay"]

_MOST_HELD = 2000  # pieces of messages, of all vehicles together, for which monitors are still to be made
_MOST_WAITING = 1000  # pieces of one vehicle's messages; beyond, the publisher waits, and all others with it
_ENOUGH = 10  # pieces of one vehicle: two seconds of messages of ten samples at 50 Hz
_AT_ONCE_S = 0.005  # of samples that wait; REST and new messages wait as long
_CAUGHT_UP_AT_ONCE = 16  # vehicles

_NOTHING: Sequence[Outgoing] = ()


class SampleWay:
    """All that lies between a fleet's messages and its news. To be used with the fleet's lock held.

    Args:
        context: of the fleet.
        arrivals: decides about decoded messages.
        alerts: keeps what monitors find.
        views: show vehicles.
        maker: of monitors.
        save_last: hands over the last state of a vehicle that is watched elsewhere from now on.

    Attributes:
        intake: what became of every message.
        solutions: how many there have been.
        full: vehicles of which so much waits that further messages of them are better left where they are.
    """

    def __init__(
        self,
        context: FleetContext,
        arrivals: FleetArrivals,
        alerts: FleetAlerts,
        views: FleetViews,
        maker: MonitorMaker,
        save_last: Callable[[VehicleKey, KnownVehicle], None],
    ) -> None:
        self._context, self._settings, self._clock = context, context.settings, context.clock
        self._vehicles, self._lock = context.vehicles, context.lock
        self._arrivals, self._alerts, self._views, self._maker = arrivals, alerts, views, maker
        self._save_last = save_last
        self.intake, self.solutions = Intake(), 0
        self.full: frozenset[VehicleKey] = frozenset()
        self._held = 0
        self._behind: dict[VehicleKey, KnownVehicle] = {}
        self._recalling: dict[VehicleKey, KnownVehicle] = {}

    @property
    def behind(self) -> bool:
        """Whether samples wait that the next call of ``take_in`` hands over."""
        return bool(self._behind)

    def begin(self) -> None:
        """Vehicles have gone on from their checkpoints, with the samples that waited."""
        self._behind = {key: known for key, known in self._vehicles.items() if known.waiting}
        self.count_waiting()
        self.note_full()

    def go_on(self, key: VehicleKey) -> None:
        """A vehicle has gone on from the checkpoint of whoever watched it, with the samples that waited."""
        known = self._vehicles.get(key)
        if known is not None and known.waiting and known.watch is not None:
            self._behind[key] = known
            self.count_waiting()

    def _give_up(self, key: VehicleKey, saved: bool) -> None:
        """A vehicle is watched elsewhere from now on: nothing is said of it any more.

        Args:
            saved: whether its last state is saved; where another has gone on with it, what is known here is older.
        """
        known = self._vehicles.remove(key)
        self._behind.pop(key, None)
        self._recalling.pop(key, None)
        if known is not None:
            self._held -= known.waiting
            if saved:
                self._save_last(key, known)
            self._context.ledger.give_up(key)

    def count_waiting(self) -> None:
        """Look through all vehicles for what waits of them."""
        self._held = sum(known.waiting for _, known in self._vehicles.items())

    def note_full(self) -> None:
        """Vehicles may have been left out, or had a monitor made, since samples were taken in last."""
        self._behind = {key: known for key, known in self._behind.items() if not known.left_out}
        self._recalling = {
            key: known
            for key, known in self._recalling.items()
            if known.watch is None and known.waiting and self._vehicles.get(key) is known
        }
        waiting = (*self._behind.items(), *self._recalling.items())
        self.full = frozenset(
            key for key, known in waiting if known.waiting >= _ENOUGH and self._vehicles.get(key) is known
        )

    def take_in(
        self, messages: Sequence[InboundMessage]
    ) -> tuple[Mapping[VehicleKey, KnownVehicle], list[tuple[VehicleKey, Sequence[Outgoing]]]]:
        """Take in messages in the order of their arrival, their vehicles together.

        Returns:
            vehicles whose monitors were handed samples, and the news of each vehicle.
        """
        outgoing: list[tuple[VehicleKey, Sequence[Outgoing]]] = []
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
                self.intake.count("too_many_vehicles")
                continue
            if message.stream == "aircraft" and key in ready:
                outgoing += self._advance({key: ready.pop(key)})  # its samples so far are of what it was
            news = self._taken_in(key, known, message)
            if news:
                outgoing.append((key, news))
            if known.watch is not None and known.waiting:
                ready[key] = known
        for key in list(self._behind)[:_CAUGHT_UP_AT_ONCE]:
            ready.setdefault(key, self._behind.pop(key))
        outgoing += self._advance(ready)
        self.note_full()
        return ready, outgoing

    def _taken_in(self, key: VehicleKey, known: KnownVehicle, message: InboundMessage) -> Sequence[Outgoing]:
        """One message decoded; samples that can be used are held for ``_advance``."""
        if known.left_out and message.stream != "aircraft":
            known.messages.owner.hear(message.received_s)
            known.counts.count("message_left_out")
            self.intake.count("message_left_out")
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
            known.counts.count(became)
        except Exception as error:  # one vehicle's fault must neither end the watch nor pass for health
            became, news = "faults", _NOTHING
            self._context.note_fault(*key, known, error)
        self.intake.count(became)
        return news

    def _sampled(
        self, key: VehicleKey, known: KnownVehicle, message: SensorsMessage, at_s: float
    ) -> tuple[str, Sequence[Outgoing]]:
        """What became of the message, and the question what aircraft it is, if that is asked."""
        became, news = self._arrivals.sampled(key, known, message, at_s)
        if became == "sensors":
            self._held += known.hold(message)
            self._recall(key, known)
            if known.watch is None:
                self._recalling[key] = known
        return became, news

    def _advance(self, ready: Mapping[VehicleKey, KnownVehicle]) -> list[tuple[VehicleKey, list[Outgoing]]]:
        """Hand over what is held of vehicles that have a monitor, piece by piece, all vehicles at once.

        It ends after ``_AT_ONCE_S``; what is left then is handed over later, unless too much waits: nothing is lost.
        """
        until_s = self._clock() + _AT_ONCE_S
        outgoing: list[tuple[VehicleKey, list[Outgoing]]] = []
        going = [(key, known, known.watch) for key, known in ready.items() if known.watch is not None]
        while going := [one for one in going if len(one[2].samples)]:
            self._held -= len(going)
            blocks = [watch.samples.take() for _, _, watch in going]
            reports = feed_together([watch.monitor for _, _, watch in going], blocks)
            sound = []
            for one, block, report in zip(going, blocks, reports, strict=True):
                key, known, watch = one
                watch.keep_samples(self._settings.ring_channels, block)
                try:
                    if isinstance(report, Exception):
                        raise report
                    watch.look_for_contradictions()
                    news = self._digest(key, known, watch, report)
                except Exception as error:  # it must neither end the watch of others nor pass for health
                    self._context.note_fault(*key, known, error)
                    continue
                sound.append(one)
                known.saving.note_change(urgent=bool(report.alerts))
                if news:
                    outgoing.append((key, news))
            going = sound
            most = max((len(watch.samples) for _, _, watch in going), default=0)
            if self._clock() >= until_s and most < _MOST_WAITING:
                break
        behind = {key: known for key, known in ready.items() if known.watch is not None and known.waiting}
        self._behind |= behind
        return outgoing

    def _recall(self, key: VehicleKey, known: KnownVehicle) -> None:
        """Start the monitor of a vehicle whose samples wait: with what is kept of it, or without after a while."""
        state = known.state
        if not isinstance(state, Recalling) or not len(state.samples):
            return
        aircraft, message, given = state.basis.loading.aircraft, state.said.message, state.samples.given
        if self._held < _MOST_HELD and not self._maker.ready(aircraft, message.configuration, given):
            return
        memory = recalled(self._context, key, state.said)
        waited_s = known.note_recall(self._clock())
        if memory is None and waited_s < self._settings.recall_patience_s and self._held < _MOST_HELD:
            return
        kept = state.basis.loading.recalled(memory or VehicleMemory())
        known.begin_watch(self._maker.make(*key, aircraft, message, given, kept), given, memory)
        self._alerts.reinstate_earlier(key, known)

    def _digest(self, key: VehicleKey, known: KnownVehicle, watch: Watched, report: Report) -> list[Outgoing]:
        """What samples led to is kept and shown; returns what is announced at once."""
        news: list[Outgoing] = []
        for alert in report.alerts:
            kept, announced = self._alerts.keep(alert)
            watch.monitor.take_over(kept)
            news += announced
        self._judge_manoeuvres(key, known, watch, report.manoeuvres)
        watch.record_report(report)
        self.solutions += len(report.solutions)
        if report.solutions:
            keep(self._context, key, watch, known.saving, report)
            latest = report.solutions[-1]
            news.append(("derivatives", partial(self._derivatives_of, watch.monitor, latest)))
            self._context.event("derivatives", {"fleet": key[0], "vehicle": key[1], "time_s": latest.time_s})
        return news + self._views.news_of_state(key, known, self._clock())

    def _judge_manoeuvres(
        self, key: VehicleKey, known: KnownVehicle, watch: Watched, flown: Sequence[FlownManoeuvre]
    ) -> None:
        """Verdicts on manoeuvres that have just ended."""
        for one in flown:
            view = verdict(watch.monitor, one, known.number_manoeuvre())
            watch.note_manoeuvre(view)
            self._context.event(
                "manoeuvre",
                {
                    "fleet": key[0], "vehicle": key[1], "number": view.number, "begin_s": view.begin_s,
                    "end_s": view.end_s, "good": view.good, "text": view.text,
                },
            )  # fmt: skip

    def _derivatives_of(self, monitor: VehicleMonitor, solution: Solution) -> Mapping[str, Any]:
        with self._lock:
            return monitor.derivatives(solution)

    def start_late(self, key: VehicleKey, known: KnownVehicle) -> list[Outgoing]:
        """What is held of a vehicle handed over, if it can be by now."""
        watch = known.watch
        if watch is not None and watch.memory.may_be_written:
            return []
        try:
            if watch is None:
                self._recall(key, known)
            elif not watch.memory.read:
                adopt_late(self._context, key, watch)
            else:
                if renew(self._context, key, watch, self._maker):
                    known.saving.note_change()
                return []
        except Exception as error:
            self._context.note_fault(*key, known, error)
            return []
        return [outgoing for _, news in self._advance({key: known}) for outgoing in news]
