"""What became of every message that was handed to the fleet: each is counted once, and the counts add up."""

from collections.abc import Mapping

__all__ = ["Intake"]

MOST_COUNTED = 2**53 - 1
"""What JSON carries exactly."""


class Intake:
    """Messages by what became of them.

    ``sensors`` and ``aircraft`` were taken in. All others were not, by reason: ``message_...`` (``MessageError``),
    ``messages_late``, ``messages_repeated``, ``messages_stray``, ``messages_second_publisher`` (``SequenceTracker``),
    ``unannounced``,
    ``unknown_aircraft``, ``too_many_vehicles``, ``faults`` of the program.
    """

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}
        self._received = 0

    def count(self, what: str) -> None:
        """Count one message."""
        self._counts[what] = min(self._counts.get(what, 0) + 1, MOST_COUNTED)
        self._received = min(self._received + 1, MOST_COUNTED)

    @property
    def counts(self) -> Mapping[str, int]:
        """``received``, and by what became of them, without zeros: ``received`` is the sum of all others."""
        return {"received": self._received, **self._counts}
