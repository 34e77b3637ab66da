"""What workers answer: the monitor's own views as JSON, checked on arrival by their types.

Floats keep their last bit, NaN and infinity included; a sequence arrives as a list, whatever it was.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from wingwatch.api import DiagnosisView, KernelsView, ServiceFigures, WorkerView
from wingwatch.monitor import AlertAction, AlertView, Event, FleetFigures, ManoeuvreView, VehicleView
from wingwatch.monitor.positions import Place
from wingwatch.monitor.record_views import FlightRecordView

__all__ = [
    "ACT",
    "ANNOUNCED",
    "ACTED",
    "DERIVATIVES",
    "DIAGNOSES",
    "EXPECT",
    "EXPECTED",
    "MANOEUVRES",
    "NEWS",
    "NEWS_WANTED",
    "RECORD",
    "VEHICLE",
    "VEHICLE_NAME",
    "VIEWS",
    "Act",
    "Acted",
    "Announced",
    "AnswerError",
    "Expect",
    "Form",
    "NewsWanted",
    "VehicleName",
    "Whole",
    "WorkerNews",
    "WorkerState",
]

T = TypeVar("T")
_MOST_BYTES = 16_777_216  # Zenoh takes no more
_Rows = list[list[float]]


class AnswerError(Exception):
    """What arrived is no answer, or no question; one sentence."""


class Form(Generic[T]):
    """One kind of message.

    Args:
        kind: its type.
    """

    def __init__(self, kind: Any) -> None:
        # In a tuple, for a dataclass of the standard library takes its configuration from what holds it.
        self._adapter: TypeAdapter[tuple[T]] = TypeAdapter(
            tuple[kind], config=ConfigDict(ser_json_inf_nan="constants")
        )

    def encode(self, value: T) -> bytes:
        """As bytes."""
        return self._adapter.dump_json((value,), fallback=_plain)

    def decode(self, data: bytes) -> T:
        """From bytes.

        Raises:
            AnswerError: they are no such message.
        """
        if len(data) > _MOST_BYTES:
            raise AnswerError(f"a message of {len(data)} bytes is larger than any of a worker")
        try:
            return self._adapter.validate_json(data)[0]
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False)[0]
            where = ".".join(str(part) for part in first["loc"][1:])
            raise AnswerError(f"{where or 'the whole'}: {first['msg']}") from None


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} has no JSON form")


@dataclass(frozen=True, slots=True)
class VehicleName:
    """Which vehicle is asked for."""

    fleet: str
    vehicle: str


@dataclass(frozen=True, slots=True)
class NewsWanted:
    """What is new since the event of a number.

    Attributes:
        after: number of the last event that is known; None where none is, and then none is given.
        whole: whether its vehicles in brief and the worker's state are wanted as well.
    """

    after: int | None
    whole: bool


@dataclass(frozen=True, slots=True)
class WorkerState:
    """What a worker says of itself.

    Attributes:
        view: as it is shown.
        figures: its fleet in numbers, but for alerts: every worker knows those of others, too.
        service: the service in numbers; counters: what each part dropped or failed on.
        problems: of the parts that do not work.
        kernels: while they are being compiled.
    """

    view: WorkerView
    figures: FleetFigures
    service: ServiceFigures
    counters: Mapping[str, Mapping[str, int]]
    problems: Mapping[str, str]
    kernels: KernelsView | None = None


@dataclass(frozen=True, slots=True)
class Whole:
    """What a worker watches, and how it is.

    Attributes:
        vehicles: in brief, as ``FleetMonitor.brief`` has them.
        places: where and when alerts of icing were raised, by id, with how often each has come back.
    """

    state: WorkerState
    vehicles: tuple[VehicleView, ...]
    places: Mapping[str, tuple[int, Place]]


@dataclass(frozen=True, slots=True)
class WorkerNews:
    """The answer to ``NewsWanted``.

    Attributes:
        start: differs at each start of a worker of the same name: numbers of events begin anew.
        newest: number of the last event; complete_after: as ``MonitorPort.events_complete_after``.
        alerts: those that the events are about, as they are now; all in force of its vehicles without ``after``.
    """

    start: str
    newest: int
    complete_after: int
    events: tuple[Event, ...]
    alerts: tuple[AlertView, ...]
    whole: Whole | None = None


@dataclass(frozen=True, slots=True)
class Expect:
    """``MonitorPort.expected``, its arguments."""

    fleet: str
    vehicle: str
    structure: str
    aircraft: tuple[str, str]
    conditions: _Rows


@dataclass(frozen=True, slots=True)
class Act:
    """A person's action on an alert of a vehicle.

    Attributes:
        until_at_s: later it is not carried out: whoever asked has had a refusal. Seconds since 1970-01-01 UTC.
    """

    fleet: str
    vehicle: str
    alert_id: str
    action: AlertAction
    who: str
    note: str
    key: str
    shelve_s: float
    until_at_s: float


@dataclass(frozen=True, slots=True)
class Acted:
    """What became of it: the alert, or ``refused``: ``action``, ``key``, ``database`` or ``late``, and why."""

    alert: AlertView | None = None
    refused: str = ""
    why: str = ""


@dataclass(frozen=True, slots=True)
class Announced:
    """What a vehicle has said last of its aircraft: the message's bytes in base64, and their encoding."""

    fleet: str
    vehicle: str
    payload: str
    encoding: str


NEWS_WANTED = Form[NewsWanted](NewsWanted)
NEWS = Form[WorkerNews](WorkerNews)
VEHICLE_NAME = Form[VehicleName](VehicleName)
VIEWS = Form[tuple[VehicleView, ...]](tuple[VehicleView, ...])
VEHICLE = Form[VehicleView | None](VehicleView | None)
DERIVATIVES = Form[dict[str, Any] | None](dict[str, Any] | None)
MANOEUVRES = Form[tuple[ManoeuvreView, ...] | None](tuple[ManoeuvreView, ...] | None)
RECORD = Form[FlightRecordView | None](FlightRecordView | None)
EXPECT = Form[Expect](Expect)
EXPECTED = Form[tuple[_Rows, _Rows] | None](tuple[_Rows, _Rows] | None)
ACT = Form[Act](Act)
ACTED = Form[Acted](Acted)
ANNOUNCED = Form[tuple[Announced, ...]](tuple[Announced, ...])
DIAGNOSES = Form[tuple[DiagnosisView, ...]](tuple[DiagnosisView, ...])
