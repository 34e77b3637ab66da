"""What the parts of a live fleet share: one lock, the vehicles, alerts and events, and the ways out."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

from wingwatch.monitor.fleet.alert_ledger import AlertLedger
from wingwatch.monitor.fleet.fair_lock import FairLock
from wingwatch.monitor.fleet.kept_events import KeptEvents
from wingwatch.monitor.fleet.member.known_vehicle import KnownVehicle
from wingwatch.monitor.fleet.roster import Roster, VehicleKey
from wingwatch.monitor.fleet.settings import FleetSettings
from wingwatch.monitor.ports import News, Outputs, Store
from wingwatch.telemetry import ServiceStream

__all__ = ["FleetContext", "Outgoing"]

_LOG = logging.getLogger(__name__)
_LOGGED_FAULTS = 10

Outgoing = tuple[ServiceStream, Callable[[], News]] | Literal["ask"]
"""A stream and what gives the news of it, or the question what aircraft a vehicle is."""


class FleetContext:
    """The lock of a fleet and all that is used with it held; ``tell`` alone is called without.

    Args:
        settings: limits of the live loop.
        clock: wall or monotonic time in s, for staleness only.
        wall_clock: seconds since 1970-01-01 UTC.
        store: memory across restarts, or None.
        outputs: where news goes, or None.
    """

    def __init__(
        self,
        settings: FleetSettings,
        clock: Callable[[], float],
        wall_clock: Callable[[], float] = time.time,
        store: Store | None = None,
        outputs: Outputs | None = None,
    ) -> None:
        self.settings, self.clock, self.wall_clock = settings, clock, wall_clock
        self.store, self._outputs = store, outputs
        self.lock = FairLock()
        self.ledger = AlertLedger(settings.kept_alerts)
        self.vehicles = Roster(settings.max_vehicles, clock, self.ledger.stands)
        self.events = KeptEvents(settings.kept_events)
        self._problems: dict[str, int] = {}

    def event(self, kind: str, data: Mapping[str, Any]) -> None:
        """Keep an event for those who read the stream."""
        self.events.add(kind, data)

    def count(self, problem: str) -> int:
        """One more problem of this kind; how many there have been."""
        self._problems[problem] = self._problems.get(problem, 0) + 1
        return self._problems[problem]

    @property
    def problems(self) -> dict[str, int]:
        """What went wrong so far, by kind, without zeros."""
        of_names = {
            "vehicles_forgotten": self.vehicles.forgotten,
            "too_many_vehicles": self.vehicles.refused,
            "events_forgotten": self.events.forgotten,
            "alerts_forgotten": self.ledger.forgotten,
        }
        return self._problems | {name: times for name, times in of_names.items() if times}

    def guarded(self, action: Callable[[], Any]) -> Any:
        """A store that fails is counted and reported; watching goes on."""
        try:
            return action()
        except Exception as error:  # whatever a database raises must not stop the watch
            self.count("store")
            self.event("problem", {"what": "store", "text": str(error)})
            return None

    def note_fault(self, fleet: str, vehicle: str, known: KnownVehicle, error: Exception) -> None:
        """Inside an ``except``: the vehicle's state shows it, the log says where it came from."""
        known.note_fault(error, self.clock())
        if self.count("faults") <= _LOGGED_FAULTS:
            about = {"vehicle": f"{fleet}/{vehicle}"}
            _LOG.exception("the samples of %s/%s led to a fault of the program", fleet, vehicle, extra=about)

    def note_second_publisher(self, fleet: str, vehicle: str, known: KnownVehicle) -> None:
        """A message under the vehicle's name was refused because another publisher owns it: reported once a minute."""
        if not known.messages.owner.refuse(self.clock()):
            return
        text = f"messages of a second publisher of {fleet}/{vehicle} are refused while the first one sends"
        self.event("problem", {"what": "second_publisher", "fleet": fleet, "vehicle": vehicle, "text": text})
        _LOG.warning("%s", text, extra={"vehicle": f"{fleet}/{vehicle}"})

    def tell(self, key: VehicleKey, news: Sequence[Outgoing]) -> None:
        """Hand news over, without the lock."""
        if self._outputs is None:
            return
        for item in news:
            if item == "ask":
                self._outputs.ask_aircraft(*key)
            else:
                self._outputs.announce(*key, *item)
