"""The states of one vehicle's watch: each holds what exists in it, and no more. ``KnownVehicle`` leads between them.

    Stranger --announces an aircraft--> Announced --samples come--> Recalling --its memory is read--> Watched
       ^                                  |  ^                         |                                 |
       +--announces one not known here----+  +--announces another one--+---------------------------------+

``LeftOut`` stands in front of another one while the machine is overloaded: its samples are not taken in.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from wingwatch.aircraft import Aircraft
from wingwatch.monitor.fleet.member.contradictions import Contradictions
from wingwatch.monitor.fleet.member.loading import Loading
from wingwatch.monitor.fleet.member.recalled_memory import RecalledMemory
from wingwatch.monitor.fleet.member.sample_ring import SampleRing
from wingwatch.monitor.fleet.member.waiting import WaitingSamples
from wingwatch.monitor.vehicle.flight_record import FlightRecord
from wingwatch.monitor.vehicle.vehicle_monitor import Report, VehicleMonitor, surface_kinds
from wingwatch.monitor.views import ManoeuvreView
from wingwatch.telemetry import AircraftMessage, SampleBlock

__all__ = [
    "KEPT_MANOEUVRES",
    "Announced",
    "Basis",
    "LeftOut",
    "Recalling",
    "Said",
    "State",
    "Stranger",
    "Watched",
]

KEPT_MANOEUVRES = 10
"""Of a vehicle."""


@dataclass(frozen=True, slots=True)
class Said:
    """What a vehicle said last that it is.

    Attributes:
        aircraft: of that name; loading: that it announced.
    """

    message: AircraftMessage
    aircraft: Aircraft
    loading: Loading


@dataclass(frozen=True, slots=True)
class Basis:
    """What a vehicle is watched as: it may have announced another loading since.

    Attributes:
        message: what it had said when the loading came into use.
    """

    message: AircraftMessage
    loading: Loading


@dataclass(frozen=True, slots=True)
class Stranger:
    """Nobody knows what aircraft it is.

    Attributes:
        message: what it said; None where it said nothing.
        problem: why that is no aircraft, one sentence; empty where it said nothing.
    """

    message: AircraftMessage | None = None
    problem: str = ""


@dataclass(frozen=True, slots=True)
class Announced:
    """It has said what it is, and no samples of it wait."""

    said: Said


@dataclass(frozen=True, slots=True)
class Recalling:
    """Its samples wait until what is kept of it has been read, or for their turn to have a monitor made.

    Attributes:
        asked_s: when what is kept of it was asked for first; None before.
    """

    said: Said
    basis: Basis
    samples: WaitingSamples
    asked_s: float | None = None


@dataclass(slots=True)
class Watched:
    """It has a monitor.

    Attributes:
        samples: that the monitor has not taken in yet.
        given: channels of the messages that the monitor was made for; settings: what it was made from, by
            ``settings_of``.
        memory: how far what the database keeps of it has come to the monitor.
        deferred: another aircraft or configuration that it announced while an alert is in force.
        ring: its latest samples; None where none are kept.
        contradictions: what its channels say of one another.
        record: of its last hour, for pictures.
        manoeuvres: verdicts on its last ones, newest first.

    The last four are of this run alone: after a restart they are made anew.
    """

    said: Said
    basis: Basis
    samples: WaitingSamples
    monitor: VehicleMonitor
    given: tuple[str, ...]
    settings: str
    memory: RecalledMemory
    deferred: AircraftMessage | None = None
    ring: SampleRing | None = None
    contradictions: Contradictions = field(default_factory=Contradictions)
    record: FlightRecord = field(default_factory=FlightRecord)
    manoeuvres: deque[ManoeuvreView] = field(default_factory=lambda: deque(maxlen=KEPT_MANOEUVRES))

    def announce(self, said: Said) -> None:
        """The same aircraft has said something new of itself."""
        self.said = said

    def defer(self, message: AircraftMessage | None) -> None:
        """It says that it is another one, which waits; None where it says no longer so."""
        self.deferred = message

    def keep_samples(self, names: Sequence[str], block: SampleBlock) -> None:
        """Samples that its monitor has taken in join the ring, of these channels; without any none are kept."""
        if not names:
            return
        if self.ring is None:
            present = set(block.present)
            self.ring = SampleRing([name for name in names if name in present])
        self.ring.add(block)

    def look_for_contradictions(self) -> None:
        """Check its channels against one another where it is time for that."""
        now_s = self.monitor.last_sample_time_s
        if self.ring is not None and now_s is not None and self.contradictions.due(now_s):
            self.contradictions.look(self.ring, self.basis.loading.aircraft, surface_kinds(self.given))

    def note_manoeuvre(self, view: ManoeuvreView) -> None:
        """A manoeuvre has ended; the oldest verdict gives way."""
        self.manoeuvres.appendleft(view)

    def record_report(self, report: Report) -> None:
        """What a report says of blocks and alerts joins the record of the last hour."""
        blocks = [self.monitor.block_record(solution) for solution in report.solutions]
        self.record.note_blocks([block for block in blocks if block is not None])
        for alert in report.alerts:
            self.record.note_onset(alert.id, self.monitor.onset_s(alert.id))


@dataclass(frozen=True, slots=True)
class LeftOut:
    """It is not watched, because the machine is overloaded.

    Attributes:
        instead_of: the state that it goes on from when it is taken back; a monitor is kept as it is meanwhile.
    """

    instead_of: Stranger | Announced | Watched


State = Stranger | Announced | Recalling | Watched | LeftOut
