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
            known.messages.owner.leave(at_s)

    def heard_of(self, key: VehicleKey, known: KnownVehicle, message: AircraftMessage, at_s: float) -> str:
        """What became of an aircraft message: a second publisher's is refused."""
        if not known.messages.accept_aircraft(message, at_s, self._context.settings.stale_s):
            self._context.note_second_publisher(*key, known)
            return SECOND_PUBLISHER
        known.announce(message.model_copy(update={"stream": None}), self._find)
        self._context.vehicles.sort(key)
        return "aircraft"

    def sampled(
        self, key: VehicleKey, known: KnownVehicle, message: SensorsMessage, at_s: float
    ) -> tuple[str, Sequence[Outgoing]]:
        """What became of the message, and the question what aircraft it is, if that is asked."""
        messages, settings = known.messages, self._context.settings
        arrival = messages.accept_samples(message, at_s, self._context.clock(), settings.stale_s)
        if arrival.refusal:
            if arrival.refusal == SECOND_PUBLISHER:
                self._context.note_second_publisher(*key, known)
            return arrival.refusal, _NOTHING
        news = _NOTHING
        if known.message is not None and arrival.restarted:
            claim = messages.take_claim()
            if claim is not None:
                self.heard_of(key, known, claim, at_s)
            elif self._may_ask(known):
                news = ("ask",)  # another publisher may be another aircraft
        if known.take_deferred(self._find):
            self._context.vehicles.sort(key)
        if known.said is None:
            unknown = "unannounced" if known.message is None else "unknown_aircraft"
            known.counts.count(unknown, len(message.block))
            return unknown, ("ask",) if known.message is None and self._may_ask(known) else news
        return "sensors", news

    def _may_ask(self, known: KnownVehicle) -> bool:
        """Whether a vehicle is asked now what aircraft it is."""
        now_s, interval_s = self._context.clock(), self._context.settings.ask_interval_s
        if self._asks_left <= 0 or not known.messages.may_ask(now_s, interval_s):
            return False
        self._asks_left -= 1
        return True
