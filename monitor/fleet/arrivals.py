"""What a vehicle's messages are taken for: its own or a second publisher's, in sequence or not, of which aircraft."""

from collections.abc import Callable, Sequence

from wingwatch.aircraft import Aircraft
from wingwatch.monitor.fleet.context import FleetContext, Outgoing
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.roster import VehicleKey
from wingwatch.telemetry import SECOND_PUBLISHER, AircraftMessage, SensorsMessage

__all__ = ["FleetArrivals"]

_MOST_ASKS = 100  # questions between two ticks, a second: invented names are not worth more
_NOTHING: Sequence[Outgoing] = ()


class FleetArrivals:
    """Decides about decoded messages. To be used with the fleet's lock held.

    Args:
        context: of the fleet.
        find: the aircraft of a name; raises ValueError with one sentence for an unknown one.
    """

    def __init__(self, context: FleetContext, find: Callable[[str], Aircraft]) -> None:
        self._context, self._find = context, find
        self._asks_left = _MOST_ASKS

    def new_second(self) -> None:
        """As many questions as in the last second may be asked again."""
        self._asks_left = _MOST_ASKS

    def left(self, key: VehicleKey, at_s: float) -> None:
        """The vehicle's publisher has ended: its name is free."""
        known = self._context.vehicles.get(key)
        if known is not None:
            known.owner.left_s = at_s

    def heard_of(self, key: VehicleKey, known: KnownVehicle, message: AircraftMessage, at_s: float) -> str:
        """What became of an aircraft message: a second publisher's is refused."""
        owner = known.owner
        if owner.holds(at_s, self._context.settings.stale_s) and owner.is_others(
            message, known.arrivals.stream
        ):
            owner.claim = message if message.stream is not None else owner.claim
            known.arrivals.refuse()
            self._context.note_second_publisher(*key, known)
            return SECOND_PUBLISHER
        owner.named = message.stream is not None
        self._announced(key, known, message.model_copy(update={"stream": None}))
        return "aircraft"

    def _announced(self, key: VehicleKey, known: KnownVehicle, message: AircraftMessage) -> None:
        """It says what it is. An alert in force is not ended by that: another aircraft counts once it is cleared."""
        known.deferred = None
        if message == known.message:
            return
        changed = known.message is not None and (
            message.aircraft != known.message.aircraft or message.configuration != known.message.configuration
        )
        if changed and known.alarmed:
            known.deferred = message
            return
        known.message = message
        try:
            known.aircraft, known.problem = self._find(message.aircraft), ""
        except ValueError as error:
            known.aircraft, known.problem = None, str(error)
            known.count("unknown_aircraft")
        self._context.vehicles.sort(key)
        if changed or known.aircraft is None:
            known.start_anew()
        known.announce_loading()

    def sampled(
        self, key: VehicleKey, known: KnownVehicle, message: SensorsMessage, at_s: float
    ) -> tuple[str, Sequence[Outgoing]]:
        """What became of the message, and the question what aircraft it is, if that is asked."""
        arrivals, owned = known.arrivals, known.owner.holds(at_s, self._context.settings.stale_s)
        restarts, (first_s, last_s) = arrivals.counts["publisher_restarts"], message.span_s
        if not arrivals.observe(message.sequence, message.stream, first_s, last_s, owned):
            known.refused_s = self._context.clock()
            if arrivals.refusal == SECOND_PUBLISHER:
                self._context.note_second_publisher(*key, known)
            return arrivals.refusal, _NOTHING
        known.received_s, known.owner.heard_s = self._context.clock(), at_s
        known.pace.note(last_s, at_s)
        known.link.note(message.block.time_s, at_s)
        news = _NOTHING
        if known.message is not None and arrivals.counts["publisher_restarts"] > restarts:
            claim = known.owner.claimed(arrivals.stream)
            if claim is not None:
                self.heard_of(key, known, claim, at_s)
            elif self._may_ask(known):
                news = ("ask",)  # another publisher may be another aircraft
        if known.deferred is not None and not known.alarmed:
            self._announced(key, known, known.deferred)
        if known.aircraft is None:
            unknown = "unannounced" if known.message is None else "unknown_aircraft"
            known.count(unknown, len(message.block))
            return unknown, ("ask",) if known.message is None and self._may_ask(known) else news
        known.take_loading()
        return "sensors", news

    def _may_ask(self, known: KnownVehicle) -> bool:
        """Whether a vehicle is asked now what aircraft it is."""
        now_s = self._context.clock()
        if now_s - known.asked_s < self._context.settings.ask_interval_s or self._asks_left <= 0:
            return False
        known.asked_s = now_s
        self._asks_left -= 1
        return True
