"""A recording through the whole chain once more, and what comes of it beside what came of it then."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count

from wingwatch.aircraft import Aircraft
from wingwatch.baselines import ChangeRecord, Envelope, EstimateRecord, Reference
from wingwatch.monitor import AlertView, FleetMonitor, FleetPorts, SavedVehicle, decode_checkpoint
from wingwatch.monitor.detection.cell_memory import CellPlace
from wingwatch.monitor.ports import ActionPlan, VehicleMemory
from wingwatch.service.recorded_memory import decode_earlier_alerts, decode_envelopes, decode_memory
from wingwatch.service.recorder import alert_message, estimate_message
from wingwatch.telemetry import InboundMessage
from wingwatch.telemetry.keys import KEY_ROOT
from wingwatch.telemetry.protocol import recording_pb2, service_pb2
from wingwatch.telemetry.recording.reading import RecordedMessage, Recording

__all__ = ["Agreement", "Replay"]

_GATHERED = 64
_TICK_S = 1.0
_INPUTS = ("sensors", "aircraft", "left")
_RAISED_AGAIN = "wingwatch: raised again"


@dataclass(slots=True)
class Agreement:
    """What a replay came to beside what was recorded.

    Attributes:
        estimates: recorded; estimates_equal: of these the same to the bit.
        first_difference: the first estimate that is not the same, None where all are.
        alerts: recorded; alerts_equal: of these raised alike; alerts_changed: of these, those that a person or a
            diagnosis changed later, which a replay does not repeat.
        further_alerts: raised by the replay alone.
    """

    estimates: int = 0
    estimates_equal: int = 0
    first_difference: str | None = None
    alerts: int = 0
    alerts_equal: int = 0
    alerts_changed: int = 0
    further_alerts: int = 0

    @property
    def whole(self) -> bool:
        """Whether everything recorded came again, and nothing else."""
        return (
            self.estimates == self.estimates_equal
            and self.alerts == self.alerts_equal
            and self.further_alerts == 0
        )


class _Memory:
    """The monitor's ``Store`` in a replay: what the database knew then; what is to be kept is compared.

    Attributes:
        estimates: by topic and time what came of the replay, as recordings have it.
        versions: of each alert, by fleet and vehicle, then by its name in the replay.
    """

    def __init__(self, attached: Mapping[str, bytes]) -> None:
        self._attached = attached
        self._waiting: deque[tuple[AlertView, Callable[[AlertView], None]]] = deque()
        self.estimates: dict[tuple[str, float], bytes] = {}
        self.versions: dict[tuple[str, str], dict[str, list[bytes]]] = {}

    def recall(self, fleet: str, vehicle: str, aircraft: Aircraft, configuration: str) -> VehicleMemory:
        """What was known of a vehicle then."""
        data = self._attached.get(f"memory/{fleet}/{vehicle}/{aircraft.name}/{configuration}")
        return VehicleMemory() if data is None else decode_memory(data, aircraft, configuration)

    def baseline_changes(self) -> Sequence[ChangeRecord]:
        """Nobody changes the baseline in a replay."""
        return ()

    def expectations(self, aircraft: Aircraft, configuration: str) -> Mapping[str, Envelope]:
        """Expectations of a type that the database had."""
        data = self._attached.get(f"expectations/{aircraft.name}/{configuration}")
        return {} if data is None else decode_envelopes(data, aircraft, configuration)

    def alerts(self, patience_s: float) -> Sequence[AlertView]:
        """Alerts of runs before the recorded one."""
        data = self._attached.get("alerts")
        return () if data is None else decode_earlier_alerts(data)

    def save_references(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str, references: Mapping[str, Reference]
    ) -> None:
        """Not kept."""

    def save_cells(
        self,
        fleet: str,
        vehicle: str,
        aircraft: str,
        configuration: str,
        cells: Mapping[CellPlace, Reference],
    ) -> None:
        """Not kept."""

    def save_alert(self, alert: AlertView, kept: Callable[[AlertView], None]) -> None:
        """Wait until ``commit``: the fleet's lock is held."""
        self._waiting.append((alert, kept))

    def commit(self) -> None:
        """Everything that waits is kept."""
        while self._waiting:
            alert, kept = self._waiting.popleft()
            versions = self.versions.setdefault((alert.fleet, alert.vehicle), {})
            versions.setdefault(alert.id, []).append(_as_raised(alert_message(alert)))
            kept(alert)

    def carry_out(self, plan: ActionPlan) -> None:
        """Nobody acts in a replay."""
        raise ValueError("a replay takes no action of a person")

    def append_estimates(self, rows: Sequence[EstimateRecord]) -> None:
        """Keep estimates to be compared."""
        for row in rows:
            topic = f"{KEY_ROOT}/{row.fleet}/{row.vehicle}/estimates/{row.estimator}/{row.structure}"
            self.estimates[topic, row.time_s] = estimate_message(row)


class _Beginning:
    """The monitor's ``Checkpoints`` in a replay: those that the recorded run started from."""

    def __init__(self, attached: Mapping[str, bytes]) -> None:
        self._attached = attached
        self.refused: list[str] = []

    def load(self) -> Sequence[SavedVehicle]:
        """States of vehicles in the order in which the run had them."""
        names = sorted((n for n in self._attached if n.startswith("checkpoint/")), key=lambda n: int(n[11:]))
        return [decode_checkpoint(self._attached[name]).saved for name in names]

    def has_room(self) -> bool:
        """Nothing is saved."""
        return False

    def keep(self, saved: SavedVehicle, urgent: bool) -> None:
        """Nothing is saved."""

    def count(self, what: str, text: str = "") -> None:
        """A state that cannot be used is said."""
        if text:
            self.refused.append(text)


class Replay:
    """A recording through a monitor of its own, as the service that recorded it had one; nothing is stored.

    Args:
        recording: read from its first message.
        find: the aircraft of a name; raises ValueError for an unknown one.

    Attributes:
        monitor: of the fleet.
        messages: given to it so far.
        refused: checkpoints of the recording that could not be used, one sentence each.
    """

    def __init__(self, recording: Recording, find: Callable[[str], Aircraft]) -> None:
        attached = recording.attachments()
        self._recording = recording
        self._now_s = 0.0
        self._memory, beginning = _Memory(attached), _Beginning(attached)
        self._then: dict[tuple[str, float], bytes] = {}
        self._alerts_then: dict[tuple[str, str], dict[str, list[service_pb2.Alert]]] = {}
        numbers = count(1)
        self.monitor = FleetMonitor(
            find,
            lambda: self._now_s,
            lambda: f"replay-{next(numbers)}",
            FleetPorts(self._memory, None, beginning),
            wall_clock=lambda: self._recording.started_ns / 1e9 + self._now_s,
        )
        self.monitor.resume()
        self.messages = 0
        self.refused = beginning.refused

    def seconds(self) -> Iterator[float]:
        """Give everything to the monitor; after each second of the recording, the time since its beginning in s."""
        gathered: list[InboundMessage] = []
        tick_s = _TICK_S
        for message in self._recording.messages():
            at_s = (message.time_ns - self._recording.started_ns) / 1e9
            inbound = _inbound(message, at_s)
            if inbound is None:
                self._keep(message)
                continue
            while at_s >= tick_s:
                self._give(gathered, tick_s)
                self.monitor.tick()
                yield tick_s
                tick_s += _TICK_S
            gathered.append(inbound)
            if len(gathered) >= _GATHERED:
                self._give(gathered, at_s)
        self._give(gathered, tick_s)
        self.monitor.tick()
        yield tick_s

    def agreement(self) -> Agreement:
        """What came of it beside what was recorded; after ``seconds``."""
        result = Agreement(estimates=len(self._then))
        for key, then in self._then.items():
            if self._memory.estimates.get(key) == then:
                result.estimates_equal += 1
            elif result.first_difference is None:
                result.first_difference = f"{key[0]} at {key[1]:.2f} s"
        for owner in self._alerts_then.keys() | self._memory.versions.keys():
            self._compare(self._alerts_then.get(owner, {}), self._memory.versions.get(owner, {}), result)
        return result

    def _compare(
        self,
        then: Mapping[str, Sequence[service_pb2.Alert]],
        now: Mapping[str, Sequence[bytes]],
        result: Agreement,
    ) -> None:
        """Alerts of one vehicle: each recorded one has one of the replay's that went through the same versions."""
        left = dict(now)
        for versions in then.values():
            untouched = [_as_raised(one.SerializeToString()) for one in versions if not _touched(one)]
            result.alerts += 1
            result.alerts_changed += len(untouched) < len(versions)
            same = next((name for name, made in left.items() if _in_order(untouched, made)), None)
            if same is not None:
                result.alerts_equal += 1
                left.pop(same)
        result.further_alerts += len(left)

    def _keep(self, message: RecordedMessage) -> None:
        """What was said then."""
        _, _, fleet, vehicle, leaf, *_ = message.topic.split("/")
        if leaf == "estimates":
            estimate = recording_pb2.RecordedEstimate.FromString(message.payload)
            self._then[message.topic, estimate.time_s] = message.payload
        elif leaf == "alerts":
            alert = service_pb2.Alert.FromString(message.payload)
            self._alerts_then.setdefault((fleet, vehicle), {}).setdefault(alert.id, []).append(alert)

    def _give(self, gathered: list[InboundMessage], now_s: float) -> None:
        """Hand over what is gathered, and wait until all of it is taken in."""
        self._now_s = now_s
        self.messages += len(gathered)
        self.monitor.receive_all(tuple(gathered))
        gathered.clear()
        while self.monitor.behind:
            self.monitor.receive_all(())
        self._memory.commit()


def _inbound(message: RecordedMessage, at_s: float) -> InboundMessage | None:
    """The message as the subscriber had it; None for what the service said."""
    _, _, fleet, vehicle, leaf, *_ = message.topic.split("/")
    if leaf not in _INPUTS:
        return None
    if leaf == "left":
        return InboundMessage(fleet, vehicle, leaf, b"", "", at_s)
    return InboundMessage(fleet, vehicle, leaf, message.payload, message.encoding, at_s)


def _as_raised(payload: bytes) -> bytes:
    """An alert without its name and without what persons did to it."""
    alert = service_pb2.Alert.FromString(payload)
    alert.ClearField("id")
    alert.ClearField("notes")
    return alert.SerializeToString(deterministic=True)


def _touched(alert: service_pb2.Alert) -> bool:
    """Whether a person or a diagnosis has changed it."""
    return any(not note.startswith(_RAISED_AGAIN) for note in alert.notes)


def _in_order(some: Sequence[bytes], among: Sequence[bytes]) -> bool:
    """Whether all of these are among those, in the same order."""
    rest = iter(among)
    return all(any(one == other for other in rest) for one in some)
