"""A vehicle as the live loop knows it: the state of its watch, the ways from one to another, what outlives them."""

from collections.abc import Callable, Mapping, MutableMapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

from wingwatch.aircraft import Aircraft
from wingwatch.monitor.fleet.member.counts import VehicleCounts
from wingwatch.monitor.fleet.member.loading import loading_of
from wingwatch.monitor.fleet.member.message_watch import MessageWatch
from wingwatch.monitor.fleet.member.recalled_memory import RecalledMemory
from wingwatch.monitor.fleet.member.saving import Saving
from wingwatch.monitor.fleet.member.states import (
    Announced,
    Basis,
    LeftOut,
    Recalling,
    Said,
    State,
    Stranger,
    Watched,
)
from wingwatch.monitor.fleet.member.waiting import WaitingSamples
from wingwatch.monitor.ports import VehicleMemory
from wingwatch.monitor.vehicle.checkpoint import settings_of
from wingwatch.monitor.vehicle.vehicle_monitor import VehicleMonitor
from wingwatch.monitor.views import VehicleState
from wingwatch.telemetry import AircraftMessage, SensorsMessage

__all__ = ["Fault", "KnownVehicle"]

_Inner = TypeVar("_Inner", bound=Stranger | Announced | Recalling | Watched)


@dataclass(frozen=True, slots=True)
class Fault:
    """The program's last fault over a vehicle, in words, and when that was by the wall clock."""

    text: str = ""
    at_s: float = float("-inf")


@dataclass(slots=True)
class KnownVehicle:
    """One vehicle of the fleet. Its fields are set here alone.

    Attributes:
        state: of its watch.
        messages: how they come.
        counts: of what was not used.
        fault: the program's last one over this vehicle.
        saving: when what of it was saved.
        shown: the state that was published last; published_s: when its status was.
        manoeuvres_flown: how many it has flown while it was watched, as whatever aircraft.
    """

    state: State = field(default_factory=Stranger)
    messages: MessageWatch = field(default_factory=MessageWatch)
    counts: VehicleCounts = field(default_factory=VehicleCounts)
    fault: Fault = field(default_factory=Fault)
    saving: Saving = field(default_factory=Saving)
    shown: VehicleState = VehicleState.UNKNOWN
    published_s: float = float("-inf")
    manoeuvres_flown: int = 0

    # -- what there is in its state ---------------------------------------------------------------

    @property
    def watch(self) -> Watched | None:
        """The watch of it, also while it is left out; None where there is none."""
        inner = self._inner
        return inner if isinstance(inner, Watched) else None

    @property
    def monitor(self) -> VehicleMonitor | None:
        """Of its watch."""
        return None if (watch := self.watch) is None else watch.monitor

    @property
    def said(self) -> Said | None:
        """What it is; None while nobody knows."""
        inner = self._inner
        return None if isinstance(inner, Stranger) else inner.said

    @property
    def message(self) -> AircraftMessage | None:
        """What it said that it is, known here or not."""
        inner = self._inner
        return inner.message if isinstance(inner, Stranger) else inner.said.message

    @property
    def left_out(self) -> bool:
        """Whether it is not watched, because the machine is overloaded."""
        return isinstance(self.state, LeftOut)

    @property
    def waiting(self) -> int:
        """Pieces of messages that wait for its monitor, or for one to be made."""
        inner = self._inner
        return len(inner.samples) if isinstance(inner, (Recalling, Watched)) else 0

    @property
    def alarmed(self) -> bool:
        """Whether an alert is in force."""
        return (monitor := self.monitor) is not None and monitor.alarmed

    @property
    def suspected(self) -> bool:
        """Whether what was seen last speaks for a change, without an alert so far."""
        return (monitor := self.monitor) is not None and monitor.suspects

    @property
    def all_counts(self) -> dict[str, int]:
        """Of samples and of messages, without zeros."""
        return self.counts.all(self._of_samples, self.messages.sequence.counts)

    def add_counts(self, total: MutableMapping[str, int]) -> None:
        """Add what has been counted since the service started: it never falls, whatever becomes of the monitor."""
        self.counts.add_to(total, self._of_samples, self.messages.sequence.counts)

    @property
    def _of_samples(self) -> Mapping[str, int]:
        return {} if (monitor := self.monitor) is None else monitor.counts

    @property
    def _inner(self) -> Stranger | Announced | Recalling | Watched:
        return self.state.instead_of if isinstance(self.state, LeftOut) else self.state

    # -- from one state to another ----------------------------------------------------------------

    def announce(self, message: AircraftMessage, find: Callable[[str], Aircraft]) -> None:
        """It says what it is: as another aircraft than before, its watch ends.

        An alert in force is not ended by that: another aircraft then counts once it is cleared (``take_deferred``).

        Args:
            find: the aircraft of a name; raises ValueError with one sentence for an unknown one.
        """
        before, inner = self.message, self._inner
        if isinstance(inner, Watched):
            inner.defer(None)
        if message == before:
            return
        changed = before is not None and _kind(message) != _kind(before)
        if changed and isinstance(inner, Watched) and inner.monitor.alarmed:
            inner.defer(message)
            return
        try:
            aircraft = find(message.aircraft)
        except ValueError as error:
            self.counts.count("unknown_aircraft")
            self._end_watch()
            self._become(Stranger(message, str(error)))
            return
        if changed:
            self._end_watch()
        said = Said(message, aircraft, loading_of(aircraft, message))
        for name in said.loading.unused:
            self.counts.count(name)
        inner = self._inner
        if isinstance(inner, Watched):
            inner.announce(said)
        else:
            self._become(replace(inner, said=said) if isinstance(inner, Recalling) else Announced(said))

    def take_deferred(self, find: Callable[[str], Aircraft]) -> bool:
        """What it announced while an alert was in force counts, once that is cleared; whether it has come to that."""
        watch = self.watch
        if watch is None or watch.deferred is None or watch.monitor.alarmed:
            return False
        self.announce(watch.deferred, find)
        return True

    def hold(self, message: SensorsMessage) -> int:
        """Its samples wait for the monitor, in pieces; how many these are.

        They are watched at the loading that it announced last; where that is another, estimation begins anew. An alert
        in force is not ended by an announcement: the loading then waits until it is cleared.

        Raises:
            ValueError: nobody knows what it is, or it is left out.
        """
        inner = self.state
        if isinstance(inner, (Stranger, LeftOut)):
            raise ValueError("the samples of a vehicle that is not watched cannot be held")
        said = inner.said
        if isinstance(inner, Watched):
            other = said.loading is not inner.basis.loading and said.loading.differs(inner.basis.loading)
            if not other or inner.monitor.alarmed:
                return inner.samples.add(message)
            self._end_watch()
        if not isinstance(inner, Recalling):
            inner = self._become(Recalling(said, Basis(said.message, said.loading), WaitingSamples()))
        elif said.loading is not inner.basis.loading:
            inner = self._become(replace(inner, basis=Basis(said.message, said.loading)))
        return inner.samples.add(message)

    def note_recall(self, now_s: float) -> float:
        """What is kept of it is asked for; for how long it has been. 0 where nothing is to be recalled."""
        inner = self._inner
        if not isinstance(inner, Recalling):
            return 0.0
        asked_s = now_s if inner.asked_s is None else inner.asked_s
        self._become(replace(inner, asked_s=asked_s))
        return now_s - asked_s

    def begin_watch(
        self, monitor: VehicleMonitor, given: tuple[str, ...], memory: VehicleMemory | None
    ) -> None:
        """What is kept of it has been read, or has not for too long: the samples that wait have a monitor.

        Args:
            given: channels that the monitor was made for.
            memory: what it was made with; None where nothing has been read yet.

        Raises:
            ValueError: no samples wait for a monitor.
        """
        inner = self._inner
        if not isinstance(inner, Recalling):
            raise ValueError("only samples that wait begin a watch")
        change = 0 if memory is None else memory.change
        recalled = RecalledMemory(memory is not None, change=change, saved_blocks=monitor.learned_blocks)
        self._become(
            Watched(
                inner.said, inner.basis, inner.samples, monitor, given, settings_of(monitor, given), recalled
            )
        )

    def leave_out(self) -> None:
        """The machine is overloaded: it is not watched any longer, and what waits of it is dropped."""
        self.drop_waiting()
        inner = self._inner
        self.state = LeftOut(Announced(inner.said) if isinstance(inner, Recalling) else inner)

    def take_back(self) -> None:
        """It is watched again, as it was when it was left out."""
        self.state = self._inner

    def drop_waiting(self) -> None:
        """What waits is not watched: the samples are counted."""
        inner = self._inner
        if isinstance(inner, (Recalling, Watched)) and len(inner.samples):
            self.counts.count("dropped_waiting", inner.samples.drop())

    def _end_watch(self) -> Stranger | Announced:
        """It is another aircraft from now on, or at another loading, or none that is known."""
        inner = self._inner
        if isinstance(inner, (Stranger, Announced)):
            return inner
        if isinstance(inner, Watched):
            self.counts.note_ended(inner.monitor.counts)
        self.saving.begin_anew()
        self.drop_waiting()
        return self._become(Announced(inner.said))

    def _become(self, inner: _Inner) -> _Inner:
        """The state that it is in, or would be in if it were not left out: then no samples wait of it."""
        if isinstance(self.state, LeftOut) and not isinstance(inner, Recalling):
            self.state = LeftOut(inner)
        else:
            self.state = inner
        return inner

    # -- what outlives its states -----------------------------------------------------------------

    def note_fault(self, error: Exception, now_s: float) -> None:
        """A fault of the program over this vehicle's samples; where it has no monitor, those that wait are dropped."""
        self.counts.count("faults")
        self.fault = Fault(f"{type(error).__name__}: {error}"[:200], now_s)
        if self.watch is None:  # there is none to be made, and what waits for it must not grow
            self.drop_waiting()

    def number_manoeuvre(self) -> int:
        """One more manoeuvre has ended; the how manyth."""
        self.manoeuvres_flown += 1
        return self.manoeuvres_flown

    def show(self, state: VehicleState) -> bool:
        """This is its state now; whether it was another one."""
        changed = state is not self.shown
        self.shown = state
        return changed

    def note_published(self, now_s: float) -> None:
        """Its status is published now."""
        self.published_s = now_s


def _kind(message: AircraftMessage) -> tuple[str, str]:
    return message.aircraft, message.configuration
