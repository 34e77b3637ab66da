"""Which publisher owns a vehicle's name: the first one, until it ends or has been silent for a while."""

from dataclasses import dataclass

from wingwatch.telemetry import AircraftMessage

__all__ = ["Ownership"]

_FAREWELL_S = 1.0
"""A publisher that still sends so long after its liveliness token went had only lost its link for a moment."""

_REPORTED_S = 60.0
"""Least time between two reports of a second publisher of one vehicle."""

Stream = int | float


@dataclass(slots=True)
class Ownership:
    """The present publisher of a vehicle's messages, and the one that was refused last.

    Attributes:
        heard_s: arrival of the last message of its own that was used.
        left_s: when its liveliness token went.
        named: whether its aircraft messages say its stream, so that those which say none are another's.
        claim: what a second publisher announced last, with its stream.
        refused_s: when a message of a second publisher was refused last.
        reported_s: when that was reported.
    """

    heard_s: float = float("-inf")
    left_s: float = float("-inf")
    named: bool = False
    claim: AircraftMessage | None = None
    refused_s: float = float("-inf")
    reported_s: float = float("-inf")

    def holds(self, at_s: float, silence_s: float) -> bool:
        """Whether the name has an owner when a message arrives.

        Args:
            at_s: its arrival.
            silence_s: after which the name is free.
        """
        ended = self.left_s > self.heard_s - _FAREWELL_S
        return not ended and at_s - self.heard_s < silence_s

    def hear(self, at_s: float) -> None:
        """A message of its own came then."""
        self.heard_s = at_s

    def leave(self, at_s: float) -> None:
        """Its liveliness token went then."""
        self.left_s = at_s

    def accept(self, message: AircraftMessage, stream: Stream | None, at_s: float, silence_s: float) -> bool:
        """Whether an aircraft message is the owner's own, as far as can be said; what another announces is a claim.

        Args:
            stream: of the owner, None where it says none.
            at_s: arrival of the message; silence_s: after which the name is free.
        """
        says = message.stream is not None
        others = stream is not None and message.stream != stream and (says or self.named)
        if others and self.holds(at_s, silence_s):
            self.claim = message if says else self.claim
            return False
        self.named = says
        return True

    def claimed(self, stream: Stream | None) -> AircraftMessage | None:
        """What the publisher with that stream announced while it was refused, once."""
        claim, self.claim = self.claim, None
        return claim if claim is not None and claim.stream == stream else None

    def refuse(self, now_s: float) -> bool:
        """A second publisher was refused; whether that is to be reported now."""
        self.refused_s = now_s
        if now_s - self.reported_s < _REPORTED_S:
            return False
        self.reported_s = now_s
        return True
