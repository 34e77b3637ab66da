"""What of one vehicle was counted: here, by its messages and by its monitors, of this run and since its start."""

from collections import Counter
from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass, field

__all__ = ["VehicleCounts"]

Counts = Mapping[str, int]


@dataclass(slots=True)
class VehicleCounts:
    """Samples and messages that were not used, by reason.

    Attributes:
        own: what is counted here.
        earlier: what monitors that it had before counted, less what was counted before the service started.
    """

    own: dict[str, int] = field(default_factory=dict)
    earlier: Counter[str] = field(default_factory=Counter)

    def count(self, reason: str, times: int = 1) -> None:
        """Count what was not used."""
        self.own[reason] = self.own.get(reason, 0) + times

    def note_ended(self, of_samples: Counts) -> None:
        """A monitor is dropped: what it has counted stays in the totals."""
        self.earlier.update(of_samples)

    def note_earlier_run(self, counted: Counts) -> None:
        """This was counted in an earlier run of the service, and is in no total."""
        self.earlier.subtract(counted)

    def all(self, of_samples: Counts, of_messages: Counts) -> dict[str, int]:
        """Of samples by the present monitor, here, and of messages by their numbers, without zeros."""
        return {**of_samples, **self.own, **{name: times for name, times in of_messages.items() if times}}

    def add_to(self, total: MutableMapping[str, int], of_samples: Counts, of_messages: Counts) -> None:
        """Add what has been counted since the service started: it never falls, whatever becomes of the monitor."""
        for counts in (self.earlier, of_samples, self.own, of_messages):
            for name, times in counts.items():
                if times:
                    total[name] = total.get(name, 0) + times
