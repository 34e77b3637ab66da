"""A fleet monitor with a clock, a store and outputs made by hand, and messages as a vehicle would send them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

import numpy as np

from wingwatch.aircraft import Aircraft, FlightCondition, load_aircraft
from wingwatch.baselines import ChangeRecord, Envelope, EstimateRecord, Reference
from wingwatch.monitor import (
    ActionPlan,
    AlertState,
    AlertView,
    CellPlace,
    Checkpoint,
    FleetMonitor,
    FleetPorts,
    FleetSettings,
    SavedVehicle,
    VehicleMemory,
    VehicleState,
    VehicleView,
    decode_checkpoint,
    encode_checkpoint,
)
from wingwatch.monitor.ports import News
from wingwatch.simulation import ElevatorEffectiveness, Scenario, doublet_schedule, simulate
from wingwatch.telemetry import (
    JSON,
    PROTOBUF,
    AircraftMessage,
    SampleBlock,
    encode_aircraft,
    encode_sensors,
)

AEROSONDE = load_aircraft("aerosonde")
TWIN = AEROSONDE.model_copy(update={"name": "twin"})
AIRCRAFT_FILES = {"aerosonde": AEROSONDE, "twin": TWIN}
PIECE = 50
"""Samples a message: one second."""

OLD_ALERT = AlertView(
    id="old", fleet="default", vehicle="gone", kind="icing", cause="icing", level="watch",
    state=AlertState.ACTIVE, raised_s=10.0, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.95,
    basis="a-priori", text="Icing.", evidence=(),
)  # fmt: skip


def find(name: str) -> Aircraft:
    if name not in AIRCRAFT_FILES:
        raise ValueError(f"aircraft {name} is not known; known are {', '.join(AIRCRAFT_FILES)}")
    return AIRCRAFT_FILES[name]


@dataclass
class Clock:
    """A clock made by hand; ``reading_s`` passes with each look at it, as on a machine that has too much to do."""

    now_s: float = 1000.0
    reading_s: float = 0.0

    def __call__(self) -> float:
        self.now_s += self.reading_s
        return self.now_s


@dataclass
class FakeStore:
    """Remembers what it is given.

    With ``broken`` every call fails, with ``unread`` nothing has been read yet, with ``slow`` alerts are committed by
    ``commit``. ``meanwhile`` happens while an action is being committed.
    """

    broken: bool = False
    unread: bool = False
    slow: bool = False
    uncommitted: list[tuple[AlertView, Callable[[AlertView], None]]] = field(default_factory=list)
    meanwhile: Callable[[], object] = lambda: None
    known: Mapping[str, Reference] = field(default_factory=dict)
    envelopes: Mapping[str, Envelope] = field(default_factory=dict)
    earlier: Sequence[AlertView] = ()
    asked: list[tuple[str, str]] = field(default_factory=list)
    learned: list[tuple[str, int]] = field(default_factory=list)
    alerts_kept: list[AlertView] = field(default_factory=list)
    rows: list[EstimateRecord] = field(default_factory=list)
    newest: int = 0
    changes: list[ChangeRecord] = field(default_factory=list)
    cells_kept: dict[CellPlace, Reference] = field(default_factory=dict)

    def _fail(self) -> None:
        if self.broken:
            raise OSError("database is locked")

    def recall(
        self, fleet: str, vehicle: str, aircraft: Aircraft, configuration: str
    ) -> VehicleMemory | None:
        self._fail()
        self.asked.append((aircraft.name, configuration))
        return None if self.unread else VehicleMemory(self.known, self.envelopes, change=self.newest)

    def baseline_changes(self) -> Sequence[ChangeRecord]:
        found, self.changes = self.changes, []
        return found

    def save_references(
        self, fleet: str, vehicle: str, aircraft: str, configuration: str, references: Mapping[str, Reference]
    ) -> None:
        self._fail()
        self.learned.append((aircraft, max(r.blocks for r in references.values())))

    def save_cells(
        self,
        fleet: str,
        vehicle: str,
        aircraft: str,
        configuration: str,
        cells: Mapping[CellPlace, Reference],
    ) -> None:
        self._fail()
        self.cells_kept.update(cells)

    def save_alert(self, alert: AlertView, kept: Callable[[AlertView], None]) -> None:
        self._fail()
        self.alerts_kept.append(alert)
        if self.slow:
            self.uncommitted.append((alert, kept))
        else:
            kept(alert)

    def commit(self) -> None:
        """What waits is in the database now."""
        waiting, self.uncommitted = self.uncommitted, []
        for alert, kept in waiting:
            kept(alert)

    def carry_out(self, plan: ActionPlan) -> None:
        self._fail()
        changed = plan.change()
        self.alerts_kept.append(changed)
        self.meanwhile()
        plan.taken(changed)

    def append_estimates(self, rows: Sequence[EstimateRecord]) -> None:
        self._fail()
        self.rows.extend(rows)

    def alerts(self, patience_s: float) -> Sequence[AlertView] | None:
        self._fail()
        return None if self.unread else self.earlier

    def expectations(self, aircraft: Aircraft, configuration: str) -> Mapping[str, Envelope]:
        self._fail()
        return self.envelopes


@dataclass
class FakeOutputs:
    """Keeps what was announced and who was asked."""

    said: list[tuple[str, News]] = field(default_factory=list)
    asked: list[tuple[str, str]] = field(default_factory=list)

    def announce(self, fleet: str, vehicle: str, stream: str, news: Callable[[], News]) -> None:
        self.said.append((stream, news()))

    def ask_aircraft(self, fleet: str, vehicle: str) -> None:
        self.asked.append((fleet, vehicle))

    def states(self) -> list[VehicleState]:
        return [v.state for _, v in self.said if isinstance(v, VehicleView)]


@dataclass
class FakeCheckpoints:
    """Keeps the bytes of the newest checkpoint of each vehicle."""

    files: dict[tuple[str, str], bytes] = field(default_factory=dict)
    handed_over: list[tuple[str, bool]] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
    away_s: float = 0.0
    room: bool = True

    def load(self) -> Sequence[SavedVehicle]:
        saved = [decode_checkpoint(data).saved for data in self.files.values()]
        return [replace(one, silent_s=one.silent_s + self.away_s) for one in saved]

    def has_room(self) -> bool:
        return self.room

    def keep(self, saved: SavedVehicle, urgent: bool) -> None:
        self.files[saved.fleet, saved.vehicle] = encode_checkpoint(Checkpoint(0.0, saved))
        self.handed_over.append((saved.vehicle, urgent))

    def count(self, what: str, text: str = "") -> None:
        self.counts[what] = self.counts.get(what, 0) + 1
        self.said += [text] if text else []


class Hall:
    """A fleet monitor with everything around it."""

    def __init__(
        self,
        settings: FleetSettings | None = None,
        store: FakeStore | None = None,
        checkpoints: FakeCheckpoints | None = None,
    ) -> None:
        self.clock, self.outputs = Clock(), FakeOutputs()
        self.store = store or FakeStore()
        ids = count(1)
        self.fleet = FleetMonitor(
            find,
            self.clock,
            lambda: f"a{next(ids)}",
            FleetPorts(self.store, self.outputs, checkpoints),
            settings,
            self.clock,
        )
        self.fleet.resume()
        self.sequence = count()

    def announce(self, vehicle: str = "uav", aircraft: str = "aerosonde", **rest: Any) -> None:
        message = AircraftMessage(aircraft=aircraft, **rest)
        self.fleet.receive("default", vehicle, "aircraft", encode_aircraft(message), PROTOBUF)

    def sample(
        self,
        block: SampleBlock,
        sequence: int,
        vehicle: str = "uav",
        encoding: str = PROTOBUF,
        stream: int | None = None,
    ) -> None:
        payload = encode_sensors(sequence, block, encoding, stream=stream)
        self.fleet.receive("default", vehicle, "sensors", payload, encoding)

    def leave(self, vehicle: str = "uav") -> None:
        """The vehicle's publisher ends, and its liveliness token goes."""
        self.fleet.receive("default", vehicle, "left", b"", "")

    def raw(self, payload: bytes, encoding: str = JSON, stream: str = "sensors") -> None:
        self.fleet.receive("default", "uav", stream, payload, encoding)

    def fly(self, flight: SampleBlock, from_s: int, to_s: int, vehicle: str = "uav") -> None:
        """Whole seconds of a flight, a message each, with running numbers."""
        for k in range(from_s, to_s):
            self.sample(second(flight, k), next(self.sequence), vehicle)

    def view(self, vehicle: str = "uav") -> VehicleView:
        return next(v for v in self.fleet.vehicles() if v.vehicle == vehicle)

    def derivatives(self) -> Mapping[str, Any]:
        found = self.fleet.derivatives("default", "uav")
        assert found is not None
        return found


def second(flight: SampleBlock, k: int) -> SampleBlock:
    return SampleBlock(flight.values[k * PIECE : (k + 1) * PIECE])


def fly_doublets(seconds: float, *effects: ElevatorEffectiveness) -> SampleBlock:
    schedule = doublet_schedule(AEROSONDE, FlightCondition(25.0, 1000.0), np.deg2rad(2.0))
    return simulate(Scenario(AEROSONDE, manoeuvres=(schedule,), effects=effects, seed=3), seconds)
