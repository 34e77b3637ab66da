"""How the messages of one vehicle come: in which order, from which publisher, how fast, and when the last one came."""

from dataclasses import dataclass, field

from wingwatch.monitor.fleet.member.link_watch import LinkWatch
from wingwatch.monitor.fleet.member.ownership import Ownership
from wingwatch.monitor.fleet.member.pace import Pace
from wingwatch.telemetry import (
    AircraftMessage,
    SensorsMessage,
    SequenceState,
    SequenceTracker,
)

__all__ = ["Arrival", "MessageWatch"]


@dataclass(frozen=True, slots=True)
class Arrival:
    """What is made of a message with samples.

    Attributes:
        refusal: under which name it is counted instead of being used; empty where it is used.
        restarted: whether another publisher has taken the place of the one before.
    """

    refusal: str = ""
    restarted: bool = False


@dataclass(slots=True)
class MessageWatch:
    """Messages of one vehicle, whatever is known of it.

    Attributes:
        sequence: follows their numbers.
        owner: which publisher they are taken from.
        pace: how fast it sends beside how fast it flies.
        link: of their arrivals, for pictures.
        heard_s: wall clock at the last message; received_s: at the last with samples that was used; refused_s: at the
            last that was not.
        asked_s: when it was asked what aircraft it is.
    """

    sequence: SequenceTracker = field(default_factory=SequenceTracker)
    owner: Ownership = field(default_factory=Ownership)
    pace: Pace = field(default_factory=Pace)
    link: LinkWatch = field(default_factory=LinkWatch)
    heard_s: float = float("-inf")
    received_s: float | None = None
    refused_s: float = float("-inf")
    asked_s: float = float("-inf")

    @property
    def last_s(self) -> float:
        """Wall clock at the last message that was used; at the last at all where none was."""
        return self.heard_s if self.received_s is None else self.received_s

    def resume(self, sequence: SequenceState, silent_s: float, now_s: float) -> None:
        """Go on from where another run stopped, to which nothing had come for ``silent_s`` by now.

        Who speaks first after a restart takes nobody's name.
        """
        self.sequence.resume(sequence)
        self.heard_s = now_s - silent_s
        self.owner.hear(now_s)

    def hear(self, now_s: float) -> None:
        """A message has come, whatever is in it."""
        self.heard_s = now_s

    def accept_aircraft(self, message: AircraftMessage, at_s: float, silence_s: float) -> bool:
        """Whether an aircraft message that came then is taken: not from a second publisher while the first one sends.

        Args:
            silence_s: after which the name is free.
        """
        if self.owner.accept(message, self.sequence.stream, at_s, silence_s):
            return True
        self.sequence.refuse()
        return False

    def accept_samples(self, message: SensorsMessage, at_s: float, now_s: float, silence_s: float) -> Arrival:
        """What is made of a message with samples.

        Args:
            at_s: its arrival; now_s: now, both by the wall clock.
            silence_s: after which the name is free.
        """
        restarts, (first_s, last_s) = self.restarts, message.span_s
        owned = self.owner.holds(at_s, silence_s)
        if not self.sequence.observe(message.sequence, message.stream, first_s, last_s, owned):
            self.refused_s = now_s
            return Arrival(self.sequence.refusal)
        self.received_s = now_s
        self.owner.hear(at_s)
        self.pace.note(last_s, at_s)
        self.link.note(message.block.time_s, at_s)
        return Arrival(restarted=self.restarts > restarts)

    def take_claim(self) -> AircraftMessage | None:
        """What the present publisher announced while it was refused, once."""
        return self.owner.claimed(self.sequence.stream)

    def may_ask(self, now_s: float, interval_s: float) -> bool:
        """Whether the vehicle is asked now what aircraft it is; it then counts as asked."""
        if now_s - self.asked_s < interval_s:
            return False
        self.asked_s = now_s
        return True

    @property
    def restarts(self) -> int:
        """How often another publisher has taken the place of the one before."""
        return self.sequence.counts["publisher_restarts"]
