"""A vehicle as the live loop knows it: what it said it is, its monitor, its faults, and the state they make."""

from collections import Counter, deque
from collections.abc import Collection, MutableMapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import ChangeRecord
from wingwatch.monitor.fleet.member.contradictions import Contradictions
from wingwatch.monitor.fleet.member.link_watch import LinkWatch
from wingwatch.monitor.fleet.member.loading import Loading, loading_of
from wingwatch.monitor.fleet.member.ownership import Ownership
from wingwatch.monitor.fleet.member.pace import Pace
from wingwatch.monitor.fleet.member.pieces import pieces
from wingwatch.monitor.fleet.member.sample_ring import SampleRing
from wingwatch.monitor.vehicle.flight_record import FlightRecord
from wingwatch.monitor.vehicle.vehicle_monitor import VehicleMonitor
from wingwatch.monitor.views import ManoeuvreView, VehicleState, VehicleView
from wingwatch.telemetry import CHANNELS, AircraftMessage, SensorsMessage, SequenceTracker

__all__ = ["FAULT_SHOWN_S", "KEPT_MANOEUVRES", "LEFT_OUT", "KnownVehicle"]

FAULT_SHOWN_S = 30.0
"""Wall-clock time for which a fault is shown after the last one: three blocks, so that no block passes in silence."""

KEPT_MANOEUVRES = 10
"""Of a vehicle."""

LEFT_OUT = "degraded service: this vehicle is not watched, because the machine is overloaded"
"""The reason of a vehicle that is left out."""

_REFUSED = (
    "Messages of a second publisher under this name are refused: two aircraft with one name, or a forger"
)


@dataclass(slots=True)
class KnownVehicle:
    """One vehicle of the fleet.

    Attributes:
        message: what it said it is; aircraft: that aircraft where it is known here; problem: why it is not.
        announced: the loading it announced last; loading: the one that it is watched at.
        monitor: from its first samples on.
        arrivals: follows the numbers of its messages.
        counts: samples and messages that were not used, by reason.
        earlier: what monitors that it had before counted, less what was counted before the service started.
        heard_s: wall clock at the last message; received_s: at the last that was used; refused_s: at the last one
            that was not.
        fault, fault_s: the program's last fault over this vehicle, and when.
        asked_s, published_s: when its aircraft was asked for, and its status published.
        shown: the state that was published last.
        history_s: sample time of the last estimate kept for history.
        saved_blocks: blocks that the references rest on that were kept last.
        held: messages that wait for what is kept of the vehicle, or for their turn.
        recalled: whether that has been read; until then nothing is written in its place.
        recall_s: when it was asked for first.
        watched_as: what it had said when ``loading`` came into use; given: channels that the monitor was made for;
            settings: what it was made from (``settings_of``); late: whether what is kept of the vehicle came after it.
        owner: which publisher its messages are taken from.
        pace: how fast it sends beside how fast it flies.
        left_out: whether it is not watched, because the machine is overloaded.
        deferred: another aircraft or configuration that was announced while an alert is in force.
        checkpoint_s: when its state was handed over to be saved; unsaved: whether it has changed since; urgent: whether
            that is to be saved at once.
        ring: its latest samples; None where none are kept.
        contradictions: what its channels say of one another.
        change: the newest change of the baseline in what is known of it.
        renewal: a later one, while what is kept is read again; renewed: the last one that was taken in.
        record, link: of its last hour and of its messages' arrivals, for pictures, neither of them saved.
        manoeuvres: verdicts on its last ones, newest first, none of them saved: after a restart they are made anew;
            manoeuvres_flown: how many there have been.
    """

    message: AircraftMessage | None = None
    aircraft: Aircraft | None = None
    problem: str = ""
    announced: Loading | None = None
    loading: Loading | None = None
    monitor: VehicleMonitor | None = None
    arrivals: SequenceTracker = field(default_factory=SequenceTracker)
    counts: dict[str, int] = field(default_factory=dict)
    earlier: Counter[str] = field(default_factory=Counter)
    heard_s: float = float("-inf")
    received_s: float | None = None
    refused_s: float = float("-inf")
    fault: str = ""
    fault_s: float = float("-inf")
    asked_s: float = float("-inf")
    published_s: float = float("-inf")
    shown: VehicleState = VehicleState.UNKNOWN
    history_s: float = float("-inf")
    saved_blocks: int = 0
    held: deque[SensorsMessage] = field(default_factory=deque)
    recalled: bool = False
    recall_s: float | None = None
    watched_as: AircraftMessage | None = None
    given: tuple[str, ...] = ()
    settings: str = ""
    late: bool = False
    owner: Ownership = field(default_factory=Ownership)
    pace: Pace = field(default_factory=Pace)
    left_out: bool = False
    deferred: AircraftMessage | None = None
    checkpoint_s: float = float("-inf")
    unsaved: bool = False
    urgent: bool = False
    ring: SampleRing | None = None
    contradictions: Contradictions = field(default_factory=Contradictions)
    change: int = 0
    renewal: ChangeRecord | None = None
    renewed: ChangeRecord | None = None
    manoeuvres: deque[ManoeuvreView] = field(default_factory=lambda: deque(maxlen=KEPT_MANOEUVRES))
    manoeuvres_flown: int = 0
    record: FlightRecord = field(default_factory=FlightRecord)
    link: LinkWatch = field(default_factory=LinkWatch)

    def count(self, reason: str, times: int = 1) -> None:
        """Count what was not used."""
        self.counts[reason] = self.counts.get(reason, 0) + times

    @property
    def alarmed(self) -> bool:
        """Whether an alert is in force."""
        return self.monitor is not None and self.monitor.alarmed

    @property
    def suspected(self) -> bool:
        """Whether what was seen last speaks for a change, without an alert so far."""
        return self.monitor is not None and self.monitor.suspects

    def note_fault(self, error: Exception, now_s: float) -> None:
        """Remember a fault of the program over this vehicle's samples."""
        self.count("faults")
        self.fault, self.fault_s = f"{type(error).__name__}: {error}"[:200], now_s

    def announce_loading(self) -> None:
        """Note how the aircraft of its message is loaded, and count what of that cannot be used."""
        if self.aircraft is None or self.message is None:
            self.announced = None
            return
        self.announced = loading_of(self.aircraft, self.message)
        for name in self.announced.unused:
            self.count(name)

    def take_loading(self) -> None:
        """Watch it at the announced loading from now on; where that is another, estimation begins anew.

        An alert in force is not ended by an announcement: the loading then waits until it is cleared.
        """
        if self.announced is None or self.announced is self.loading:
            return
        if self.monitor is not None and self.loading is not None:
            if not self.announced.differs(self.loading) or self.monitor.alarmed:
                return
            self.start_anew()
        self.loading, self.watched_as = self.announced, self.message

    def start_anew(self) -> None:
        """It is another aircraft from now on, or none that is known."""
        if self.monitor is not None:
            self.earlier.update(self.monitor.counts)
        self.monitor, self.recalled, self.recall_s = None, False, None
        self.given, self.settings, self.late, self.unsaved, self.urgent = (), "", False, False, False
        self.change, self.renewal, self.renewed = 0, None, None
        self.ring, self.contradictions = None, Contradictions()
        self.manoeuvres.clear()
        self.record = FlightRecord()
        self.drop_held()

    def hold(self, message: SensorsMessage) -> int:
        """Its samples wait for the monitor, in pieces; how many these are."""
        before = len(self.held)
        self.held.extend(pieces(message))
        return len(self.held) - before

    @property
    def waiting(self) -> NDArray[np.float64]:
        """The samples that wait, shape (samples, channels)."""
        return np.concatenate(
            [np.empty((0, len(CHANNELS))), *(message.block.values for message in self.held)]
        )

    def drop_held(self) -> None:
        """What waits is not watched: the samples are counted."""
        if self.held:
            self.count("dropped_waiting", sum(len(message.block) for message in self.held))
        self.held.clear()

    @property
    def all_counts(self) -> dict[str, int]:
        """Of samples and of messages, without zeros."""
        of_samples = {} if self.monitor is None else self.monitor.counts
        numbers = {name: times for name, times in self.arrivals.counts.items() if times}
        return {**of_samples, **self.counts, **numbers}

    def leave_out_counts(self) -> None:
        """What has been counted so far is of an earlier run of the service."""
        self.earlier.subtract(self.all_counts)

    def add_counts(self, total: MutableMapping[str, int]) -> None:
        """Add what has been counted since the service started: it never falls, whatever becomes of the monitor."""
        of_samples = {} if self.monitor is None else self.monitor.counts
        for counts in (self.earlier, of_samples, self.counts, self.arrivals.counts):
            for name, times in counts.items():
                if times:
                    total[name] = total.get(name, 0) + times

    def standing(self, now_s: float, stale_s: float) -> tuple[VehicleState, str | None]:
        """State, and its reason where that is not the monitor's own.

        An alert stands through silence and faults; neither passes for health. Channels that contradict each other do
        not either.
        """
        faulty = now_s - self.fault_s <= FAULT_SHOWN_S
        blind = self.fault_text if faulty else LEFT_OUT if self.left_out else None
        if self.monitor is not None and self.monitor.state is VehicleState.DEGRADED:
            meanwhile = blind or self._contradiction
            return (
                VehicleState.DEGRADED,
                f"{self.monitor.reason} Meanwhile {meanwhile}" if meanwhile else None,
            )
        if blind:
            return VehicleState.UNKNOWN, blind
        if self.monitor is None:
            return VehicleState.UNKNOWN, self._unknown_because
        if self.received_s is None or now_s - self.received_s > stale_s:
            if now_s - self.refused_s <= stale_s:
                return VehicleState.STALE, "messages arrive, but none that can be used: see the counts"
            return VehicleState.STALE, "no samples are arriving"
        if self._contradiction:
            return VehicleState.NOT_OBSERVABLE, self._contradiction
        return self.monitor.state, None

    @property
    def _contradiction(self) -> str:
        """Channels that contradict each other in one clause; empty where none do."""
        said = self.contradictions.text
        return f"its channels contradict each other: {said}" if said else ""

    @property
    def fault_text(self) -> str:
        """The program's faults over this vehicle in one clause."""
        return (
            f"the program failed on its samples {self.counts.get('faults', 0)} times, last with {self.fault}"
        )

    @property
    def _loading_text(self) -> str:
        """The loading in use, and what of that which was announced is not used."""
        loading, announced = self.loading, self.announced
        if loading is None or announced is None:
            return ""
        if (other := self.deferred) is not None:
            name = f"{other.aircraft} ({other.configuration})"
            return f"{loading.text} It has announced that it is {name}, which counts once its alert is cleared.".strip()
        waits = self.monitor is not None and announced.differs(loading)
        said = [
            loading.text,
            *(text for name, text in announced.unused.items() if name not in loading.unused),
        ]
        if waits:
            said.append("It has announced another since, which counts once its alert is cleared.")
        return " ".join(part for part in said if part)

    @property
    def _unknown_because(self) -> str:
        if self.message is None:
            return "samples arrive, but the vehicle has not announced its aircraft"
        if self.held:
            return "its earlier flights are being read from the database"
        return self.problem or "announced; no samples yet"

    def view(
        self, fleet: str, vehicle: str, now_s: float, stale_s: float, alerts: Collection[str]
    ) -> VehicleView:
        """The vehicle as an operator sees it.

        Args:
            now_s: wall clock.
            stale_s: silence after which it is stale.
            alerts: ids of all that are kept.
        """
        state, reason = self.standing(now_s, stale_s)
        refused = now_s - self.owner.refused_s <= FAULT_SHOWN_S
        if self.monitor is None:
            return self.bare_view(fleet, vehicle, state, _with_refusal(reason or "", refused))
        view = self.monitor.view()
        unread = "" if self.recalled else " Its earlier flights have not been read yet."
        loaded = f" {text}" if (text := self._loading_text) else ""
        return replace(
            view,
            state=state,
            reason=_with_refusal(view.reason if reason is None else reason, refused),
            basis_text=view.basis_text + loaded + unread + _change_text(self.renewed),
            counts=self.all_counts,
            active_alerts=tuple(name for name in view.active_alerts if name in alerts),
            mass_kg=None if self.loading is None else self.loading.mass_kg,
            cg_shift_m=0.0 if self.loading is None else self.loading.cg_shift_m,
            sample_age_s=None if self.received_s is None else max(now_s - self.received_s, 0.0),
        )

    def bare_view(self, fleet: str, vehicle: str, state: VehicleState, reason: str) -> VehicleView:
        """The vehicle without anything that its monitor says."""
        message = self.message
        return VehicleView(
            fleet=fleet, vehicle=vehicle, aircraft=message.aircraft if message else None,
            configuration=message.configuration if message else None, state=state, state_since_s=None,
            reason=reason, last_sample_time_s=None, basis=None, basis_text="Nothing has been compared yet.",
            worst=None, counts=self.all_counts, active_alerts=(), condition={},
        )  # fmt: skip


def _change_text(change: ChangeRecord | None) -> str:
    """That the baseline is not what the flight began with."""
    if change is None:
        return ""
    at = datetime.fromtimestamp(change.at_s, UTC).strftime("%Y-%m-%d %H:%M UTC")
    by = f" by {change.who}" if change.who else ""
    return f" The baseline was changed{by} at {at} ({change.action}: {change.text}), and counts as it is now."


def _with_refusal(reason: str, refused: bool) -> str:
    """The reason, with a second publisher where messages of one were refused."""
    return f"{reason.rstrip('.')}. {_REFUSED}." if refused else reason
