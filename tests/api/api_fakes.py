"""A monitor and a history for the door's tests: small, filled by hand, obeying the ports."""

import contextlib
import dataclasses
import threading
from collections import Counter
from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any

import httpx
import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import STRUCTURES
from wingwatch.api import (
    AccessSettings,
    AppSettings,
    BaselineImport,
    BaselineQuestion,
    BaselineRevert,
    DiagnosisPort,
    DiagnosisState,
    DiagnosisView,
    HistoryPort,
    HttpServer,
    KernelPart,
    KernelState,
    KernelsView,
    QueueFullError,
    ServiceFigures,
    create_app,
    listen,
)
from wingwatch.baselines import (
    EstimateRecord,
    FlightRecord,
    HistoryColumns,
    HistoryKey,
    HistoryRow,
    HistoryWanted,
)
from wingwatch.monitor.record_views import FlightRecordView, LinkView
from wingwatch.monitor.views import (
    SHELVED_S,
    AlertAction,
    AlertGroupView,
    AlertState,
    AlertView,
    Event,
    EvidenceView,
    FleetFigures,
    ManoeuvreView,
    VehicleState,
    VehicleView,
    WorstDerivative,
)

Array = NDArray[np.float64]

NO_RECORD = FlightRecordView((), None, {}, LinkView(None, None, 0, 0.0, None, None, None, ()))
ICED = EvidenceView("m_eta", -116.25, 1.75, -131.5, 2.5, 4.9985)
VERSION = "9.8.7"
COMPILING = KernelsView(
    text="The kernels are being compiled: the wings now, 1 of 2 parts done.",
    parts=(
        KernelPart("the tail", KernelState.COMPILED, True),
        KernelPart("the wings", KernelState.COMPILING, True),
        KernelPart("the paint", KernelState.WAITING, False),
    ),
    elapsed_s=12.34,
    remaining_s=40.4,
)


def vehicle(name: str, state: VehicleState = VehicleState.HEALTHY, **changes: Any) -> VehicleView:
    view = VehicleView(
        fleet="default",
        vehicle=name,
        aircraft="aerosonde",
        configuration="clean",
        state=state,
        state_since_s=2.0,
        reason="every derivative agrees with its expectation",
        last_sample_time_s=118.48,
        basis="a-priori",
        basis_text="rests on the aircraft file's own numbers (a-priori)",
        worst=WorstDerivative("fourier", "short_period", "m_q", -1.25),
        counts={"accepted": 5924, "duplicate": 0},
        active_alerts=(),
        condition={"airspeed_true_m_s": 25.0, "altitude_m": 1000.0, "air_density_kg_m3": 1.1116},
    )
    return dataclasses.replace(view, **changes)


def alert(number: int, **changes: Any) -> AlertView:
    view = AlertView(
        id=f"a{number}",
        fleet="default",
        vehicle="aero-2",
        kind="icing",
        cause="icing",
        level="warning",
        state=AlertState.ACTIVE,
        raised_s=70.0 + number,
        cleared_s=None,
        size=0.0625,
        size_standard_error=0.0078125,
        probability=0.96875,
        basis="a-priori",
        text="Icing of severity 0.06 is likely; leave the icing layer.",
        evidence=(ICED,),
    )
    return dataclasses.replace(view, **changes)


def derivative(value: float, standard_error: float, **more: Any) -> dict[str, Any]:
    return {"value": value, "standard_error": standard_error, "unit": "1/s", "outcome": "converged", **more}


class FakeMonitor:
    """Obeys MonitorPort."""

    def __init__(self) -> None:
        self.views: list[VehicleView] = []
        self.current: dict[tuple[str, str], Mapping[str, Any]] = {}
        self.flown: dict[tuple[str, str], Sequence[ManoeuvreView]] = {}
        self.records: dict[tuple[str, str], FlightRecordView] = {}
        self.raised: list[AlertView] = []
        self.groups: list[AlertGroupView] = []
        self.kept: list[Event] = []
        self.keys: list[str | None] = []
        self.shelved_s: list[float] = []
        self.store_fault: Exception | None = None
        self.lock = threading.Lock()
        self.counts: dict[str, int] = {}
        self.solutions = 0

    def vehicles(self) -> Sequence[VehicleView]:
        return tuple(dataclasses.replace(view, could_see=()) for view in self.views)

    def vehicle(self, fleet: str, vehicle: str) -> VehicleView | None:
        return next((v for v in tuple(self.views) if (v.fleet, v.vehicle) == (fleet, vehicle)), None)

    def derivatives(self, fleet: str, vehicle: str) -> Mapping[str, Any] | None:
        return self.current.get((fleet, vehicle))

    def alerts(self) -> Sequence[AlertView]:
        return tuple(self.raised)

    def manoeuvres(self, fleet: str, vehicle: str) -> Sequence[ManoeuvreView] | None:
        return self.flown.get((fleet, vehicle))

    def flight_record(self, fleet: str, vehicle: str) -> FlightRecordView | None:
        known = self.vehicle(fleet, vehicle) is not None
        return self.records.get((fleet, vehicle), NO_RECORD) if known else None

    def expected(
        self, fleet: str, vehicle: str, structure: str, aircraft: tuple[str, str], conditions: Array
    ) -> tuple[Array, Array] | None:
        """A hundredth of the altitude, and a tenth of the airspeed, for every derivative of the Aerosonde."""
        if aircraft != ("aerosonde", "clean"):
            return None
        k = len(STRUCTURES[structure].derivatives)
        return np.tile(conditions[:, 1:2] / 100.0, k), np.tile(conditions[:, :1] / 10.0, k)

    def alert_groups(self) -> Sequence[AlertGroupView]:
        return tuple(self.groups)

    def act_on_alert(
        self,
        alert_id: str,
        action: AlertAction,
        who: str,
        note: str,
        key: str | None = None,
        shelve_s: float = SHELVED_S,
    ) -> AlertView | None:
        self.keys.append(key)
        self.shelved_s.append(shelve_s)
        if self.store_fault is not None:
            raise self.store_fault
        states = {
            AlertAction.ACKNOWLEDGE: AlertState.ACKNOWLEDGED,
            AlertAction.SHELVE: AlertState.SHELVED,
            AlertAction.UNSHELVE: AlertState.ACTIVE,
            AlertAction.CLEAR: AlertState.CLEARED,
        }
        for place, view in enumerate(self.raised):
            if view.id == alert_id:
                if view.state is AlertState.CLEARED:
                    raise ValueError(f"alert {alert_id} is cleared; nothing more can be done to it.")
                line = f"{action} by {who}: {note}"
                self.raised[place] = dataclasses.replace(view, state=states[action], note=(*view.note, line))
                return self.raised[place]
        return None

    def events(self, after: int) -> Sequence[Event]:
        with self.lock:
            return [event for event in self.kept if event.id > after]

    def events_complete_after(self) -> int:
        with self.lock:
            return self.kept[0].id - 1 if self.kept else 0

    def figures(self) -> FleetFigures:
        vehicles = Counter(view.state for view in self.vehicles())
        alerts = Counter((view.state, view.level) for view in self.alerts())
        return FleetFigures(vehicles, alerts, self.counts, self.solutions, 0)

    def tell(self, kind: str, data: Mapping[str, Any]) -> int:
        """Add an event and return its id; the last 1000 are kept."""
        with self.lock:
            number = self.kept[-1].id + 1 if self.kept else 1
            self.kept = [*self.kept[-999:], Event(number, kind, data)]
            return number


def past(
    time_s: float, estimator: str, structure: str, value: Sequence[float], standard_error: Sequence[float],
    outcome: str = "converged", flight: int = 1,
) -> HistoryRow:  # fmt: skip
    estimate = EstimateRecord(
        "default", "aero-1", time_s, structure, estimator, tuple(value), tuple(standard_error), outcome,
        (25.0, 1000.0, 1.1, 0.05), "aerosonde", "clean",
    )  # fmt: skip
    return HistoryRow(estimate, flight, 1.7e9 + time_s)


class FakeHistory:
    """Obeys HistoryPort."""

    def __init__(self, rows: Sequence[HistoryRow]) -> None:
        self.rows = sorted(rows, key=self._key)
        self.most = 0

    @staticmethod
    def _key(row: HistoryRow) -> tuple[int, float, str, str]:
        return (row.flight, row.estimate.time_s, row.estimate.estimator, row.estimate.structure)

    def history_rows(self, fleet: str, vehicle: str, wanted: HistoryWanted) -> Sequence[HistoryRow]:
        low = float("-inf") if wanted.from_s is None else wanted.from_s
        high = float("inf") if wanted.to_s is None else wanted.to_s
        found = [
            row
            for row in self.rows
            if low <= row.estimate.time_s <= high
            and wanted.flight in (None, row.flight)
            and (wanted.structures is None or row.estimate.structure in wanted.structures)
            and (wanted.start is None or self._key(row) >= wanted.start)
        ][: wanted.limit]
        self.most = max(self.most, len(found))
        return found

    def history_columns(
        self, fleet: str, vehicle: str, wanted: HistoryWanted
    ) -> tuple[Sequence[HistoryColumns], HistoryKey | None]:
        rows = self.history_rows(fleet, vehicle, wanted)
        last = self._key(rows[-1]) if rows and len(rows) == wanted.limit else None
        return [_columns([row])[0] for row in rows], last

    def flights(self, fleet: str, vehicle: str) -> Sequence[FlightRecord]:
        found = []
        for number in sorted({row.flight for row in self.rows}, reverse=True):
            times = [row.estimate.time_s for row in self.rows if row.flight == number]
            ends = min(times), max(times)
            found.append(
                FlightRecord(number, "aerosonde", "clean", *ends, 1.7e9, 1.7e9 + ends[1], len(times))
            )
        return found


def _columns(rows: Sequence[HistoryRow]) -> list[HistoryColumns]:
    return [
        HistoryColumns(
            row.flight, row.estimate.aircraft, row.estimate.configuration, row.estimate.structure,
            row.estimate.estimator, np.array([row.estimate.time_s]), np.array([row.estimate.value]),
            np.array([row.estimate.standard_error]), np.array([row.estimate.condition]), (row.estimate.outcome,),
        )
        for row in rows
    ]  # fmt: skip


@contextlib.contextmanager
def served(
    monitor: FakeMonitor,
    history: HistoryPort | None = None,
    checks: Mapping[str, str | None] | None = None,
    diagnoses: DiagnosisPort | None = None,
    counters: Mapping[str, Mapping[str, int]] | None = None,
    kernels: Callable[[], KernelsView | None] = lambda: None,
    access: AccessSettings | None = None,
    figures: ServiceFigures | None = None,
) -> Generator[tuple[HttpServer, httpx.Client]]:
    """The application over the fake, on a real socket, with a client."""
    ready = checks if checks is not None else {"zenoh": None, "database": None, "http": None}
    settings = AppSettings(
        problems=lambda: ready,
        figures=lambda: figures or ServiceFigures(),
        access=access or AccessSettings(),
        counters=lambda: counters or {},
        kernels=kernels,
        diagnoses=diagnoses,
    )
    app = create_app(monitor, lambda: ready, history, VERSION, settings)
    with (
        HttpServer(app, listen("127.0.0.1", 0)) as server,
        httpx.Client(base_url=server.url, verify=False) as client,
    ):
        yield server, client


class FakeBaselines:
    """A baseline that remembers what it was asked."""

    def __init__(self) -> None:
        self.asked: list[BaselineQuestion | BaselineRevert | BaselineImport] = []
        self.fault = ""

    def listed(self) -> Mapping[str, Any]:
        return {
            "aircraft": [{"aircraft": "aerosonde", "configuration": "clean", "structures": {}}],
            "vehicles": [],
        }

    def _kept(self, question: BaselineQuestion) -> dict[str, Any]:
        self.asked.append(question)
        if self.fault:
            raise ValueError(self.fault)
        names = {"aircraft": question.aircraft.name, "configuration": question.configuration}
        return {**names, "convention": question.convention, "structures": {"short_period": []}}

    def shown(self, question: BaselineQuestion) -> Mapping[str, Any]:
        return self._kept(question) | {"at": None}

    def past(self, question: BaselineQuestion) -> Mapping[str, Any]:
        return self._kept(question) | {"changes": []}

    def imported(self, request: BaselineImport) -> Mapping[str, Any]:
        self.asked.append(request)
        if self.fault:
            raise ValueError(self.fault)
        kinds = ("entries", "references", "cells")
        return {**{kind: len(request.document[kind]) for kind in kinds}, "stored": 0}

    def reverted(self, request: BaselineRevert) -> Mapping[str, Any]:
        self.asked.append(request)
        if self.fault:
            raise ValueError(self.fault)
        names = {"aircraft": request.aircraft, "configuration": request.configuration}
        return {**names, "withdrawn": [4], "restored": [2], "cells": 0}


class FakeDiagnoses:
    """Obeys DiagnosisPort; jobs stay as they are put."""

    def __init__(self) -> None:
        self.views: list[DiagnosisView] = []
        self.uploads: list[FakeUpload] = []
        self.full = False
        self.page: bytes | None = None

    def open(self, aircraft: str, channel_map: str, file: str) -> "FakeUpload":
        if self.full:
            raise QueueFullError(
                "No further flight is taken: 4 flights wait already, the limit; try again later"
            )
        if aircraft != "aerosonde":
            raise ValueError(f"aircraft {aircraft!r} is not known here")
        self.uploads.append(FakeUpload(self, aircraft, channel_map, file))
        return self.uploads[-1]

    def diagnoses(self) -> Sequence[DiagnosisView]:
        return self.views

    def report(self, diagnosis_id: str) -> bytes | None:
        return self.page

    def remove(self, diagnosis_id: str) -> bool:
        before = len(self.views)
        self.views = [view for view in self.views if view.id != diagnosis_id]
        return len(self.views) < before


class FakeUpload:
    """Obeys DiagnosisUpload."""

    def __init__(self, port: FakeDiagnoses, aircraft: str, channel_map: str, file: str) -> None:
        self.port, self.aircraft, self.channel_map, self.file = port, aircraft, channel_map, file
        self.content = b""
        self.ended = ""

    def write(self, content: bytes) -> None:
        self.content += content

    def submit(self) -> DiagnosisView:
        self.ended = "submitted"
        view = diagnosis_view(f"d{len(self.port.views)}", aircraft=self.aircraft, file=self.file)
        self.port.views.insert(0, view)
        return view

    def discard(self) -> None:
        self.ended = self.ended or "discarded"


def diagnosis_view(name: str, **changes: Any) -> DiagnosisView:
    view = DiagnosisView(
        id=name, state=DiagnosisState.QUEUED, aircraft="aerosonde", file="flight", ahead=0, doing="waiting",
        progress=0.0, problem="", result=None,
    )  # fmt: skip
    return dataclasses.replace(view, **changes)
