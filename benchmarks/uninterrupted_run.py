"""The run that nobody kills: a monitor beside the service, which is given what the service counts as taken in."""

from dataclasses import dataclass, field, replace
from functools import cache
from itertools import chain

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor import AlertState, AlertView, JudgeConfig, VehicleMemory, VehicleMonitor
from wingwatch.monitor.detection.cell_memory import CellBookState
from wingwatch.monitor.detection.vehicle_alerts import AlertMemory
from wingwatch.monitor.estimation.chain import SavedChain
from wingwatch.monitor.fleet.monitors import MonitorMaker
from wingwatch.monitor.vehicle.checkpoint import CODEC, SavedVehicle
from wingwatch.monitor.vehicle.state import MonitorState
from wingwatch.telemetry import AircraftMessage, SampleBlock, SensorsMessage

AIRCRAFT = "aerosonde"


@dataclass(frozen=True, slots=True)
class Comparison:
    """A checkpoint beside the uninterrupted run.

    Attributes:
        messages: that both have taken in since the comparison before.
        known: whether the checkpoint names every message that the service has not taken in.
        estimates: whether the estimators' states are the same to the bit; whole: whether all else is, too.
        differs: fields of the state that are not the same.
        alarmed: whether an alert was in force.
    """

    messages: int
    known: bool
    estimates: bool
    whole: bool
    differs: tuple[str, ...]
    alarmed: bool


@dataclass
class Uninterrupted:
    """The run that nobody kills, of one vehicle.

    Attributes:
        given: channels of its messages.
        sent: messages that have not been given to it, the first of them with number ``first``.
        lost: messages that the service counted as lost at the comparison before.
    """

    given: tuple[str, ...]
    sent: list[SensorsMessage] = field(default_factory=list)
    first: int = 0
    lost: int = 0

    def __post_init__(self) -> None:
        self.monitor = fresh(self.given)

    def compare(self, saved: SavedVehicle) -> Comparison:
        """Take in what the service had taken in when it saved this checkpoint, and compare to the bit.

        A checkpoint names the latest 64 gaps. Where there were more, nothing can be said, and the run goes on from the
        checkpoint; so it does after a difference, which then counts once.
        """
        end = max(saved.arrivals.next or 0, self.first)
        missing = {n for n in chain(*saved.arrivals.gaps) if self.first <= n < end}
        known = len(missing) == saved.arrivals.counts["messages_lost"] - self.lost
        taken = [m for m in self.sent[: end - self.first] if m.sequence not in missing]
        del self.sent[: end - self.first]
        self.first, self.lost = end, saved.arrivals.counts["messages_lost"]
        service = fresh(self.given)
        service.restore(saved.monitor)
        if len(saved.waiting):
            service.feed(SampleBlock(saved.waiting))
        if known:
            for message in taken:
                self.monitor.feed(message.block)
        differs = _differences(self.monitor, service) if known else ()
        if differs or not known:
            self.monitor = service
        return Comparison(len(taken), known, "chain" not in differs, not differs, differs, saved.alarmed)


def fresh(given: tuple[str, ...]) -> VehicleMonitor:
    """A monitor as the service makes it for these vehicles.

    Args:
        given: channels of the messages.
    """
    message = AircraftMessage(aircraft=AIRCRAFT)
    return _maker().make("default", "v", load_aircraft(AIRCRAFT), message, given, VehicleMemory())


@cache
def _maker() -> MonitorMaker:
    return MonitorMaker(lambda: "", JudgeConfig())


def _differences(own: VehicleMonitor, its: VehicleMonitor) -> tuple[str, ...]:
    """Parts of the state whose bytes differ."""
    states = []
    for monitor in (own, its):
        _ = monitor.air  # worked out when it is asked for first, and the service has been asked
        states.append(_comparable(monitor.saved()))
    first, second = states
    kinds = {"chain": SavedChain}
    found = []
    for name, kind in (MonitorState.__annotations__ | kinds).items():
        if CODEC.encode(kind, getattr(first, name)) != CODEC.encode(kind, getattr(second, name)):
            found.append(name)
    return tuple(found)


def _comparable(state: MonitorState) -> MonitorState:
    """Without names of alerts and what persons did to them, and without what is only handed over once more."""

    def bare(alert: AlertView) -> AlertView:
        return replace(alert, id="", fleet="", vehicle="", state=AlertState.ACTIVE, note=(), shelving=None)

    alert = None if state.book.active is None else bare(state.book.active)
    cells = CellBookState(state.cells.accounts, state.cells.visits, set())
    several = replace(state.redundancy_book, active=[bare(a) for a in state.redundancy_book.active])
    memory = AlertMemory([""] * len(state.alerts.in_force), [bare(a) for a in state.alerts.over])
    book = replace(state.book, active=alert)
    return replace(state, book=book, cells=cells, redundancy_book=several, alerts=memory)
