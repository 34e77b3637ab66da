"""What of one vehicle was counted: by itself, by its messages and by its monitors, of this run and since its start."""

from collections import Counter
from collections.abc import Mapping, MutableMapping

from wingwatch.monitor.vehicle.vehicle_monitor import VehicleMonitor

__all__ = ["VehicleCounts"]


class VehicleCounts:
    """Samples and messages that were not used, by reason.

    Args:
        own: counted before this run of the service.

    Attributes:
        own: what is counted here.
    """

    __slots__ = ("_earlier", "own")

    def __init__(self, own: Mapping[str, int] | None = None) -> None:
        self.own: dict[str, int] = dict(own or {})
        self._earlier: Counter[str] = Counter()

    def count(self, reason: str, times: int = 1) -> None:
        """Count what was not used."""
        self.own[reason] = self.own.get(reason, 0) + times

    def note_ended(self, monitor: VehicleMonitor) -> None:
        """The monitor is dropped: what it has counted stays in the totals."""
        self._earlier.update(monitor.counts)

    def note_earlier_run(self, monitor: VehicleMonitor | None, of_messages: Mapping[str, int]) -> None:
        """What has been counted so far is of an earlier run of the service, and in no total."""
        self._earlier.subtract(self.all(monitor, of_messages))

    def all(self, monitor: VehicleMonitor | None, of_messages: Mapping[str, int]) -> dict[str, int]:
        """Of samples and of messages, without zeros.

        Args:
            monitor: the present one.
            of_messages: by the numbers of messages (``SequenceTracker.counts``).
        """
        of_samples = {} if monitor is None else monitor.counts
        return {**of_samples, **self.own, **{name: times for name, times in of_messages.items() if times}}

    def add_to(
        self, total: MutableMapping[str, int], monitor: VehicleMonitor | None, of_messages: Mapping[str, int]
    ) -> None:
        """Add what has been counted since the service started: it never falls, whatever becomes of the monitor."""
        of_samples = {} if monitor is None else monitor.counts
        for counts in (self._earlier, of_samples, self.own, of_messages):
            for name, times in counts.items():
                if times:
                    total[name] = total.get(name, 0) + times
