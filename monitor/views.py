"""What the monitor shows: plain frozen objects that REST, Zenoh and the terminal translate, and the port they read.

Times are the vehicle's own clock (time stamps of its samples), in seconds.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

from wingwatch.telemetry.conditioning import AirQuality

__all__ = [
    "AlertAction",
    "LEVELS",
    "SHELVED_S",
    "AlertState",
    "AlertView",
    "CandidateView",
    "CouldSeeView",
    "Event",
    "EvidenceView",
    "FleetFigures",
    "KeyReusedError",
    "MonitorPort",
    "Shelving",
    "VehicleState",
    "VehicleView",
    "WorstDerivative",
]


LEVELS = ("watch", "warning", "critical")
"""Of alerts, from the least."""

SHELVED_S = 3600.0
"""For how long an alert is shelved unless told otherwise."""


class VehicleState(StrEnum):
    """Health state of a vehicle."""

    HEALTHY = "healthy"
    DEGRADED = "degraded"
    NOT_OBSERVABLE = "not_observable"
    STALE = "stale"
    UNKNOWN = "unknown"


class AlertState(StrEnum):
    """Where an alert is in its life."""

    ACTIVE = "active"
    ACKNOWLEDGED = "acknowledged"
    SHELVED = "shelved"
    CLEARED = "cleared"


class AlertAction(StrEnum):
    """What a person may do to an alert."""

    ACKNOWLEDGE = "acknowledge"
    SHELVE = "shelve"
    UNSHELVE = "unshelve"
    CLEAR = "clear"


class KeyReusedError(ValueError):
    """The key of a request belongs to another request; one sentence."""


@dataclass(frozen=True, slots=True)
class WorstDerivative:
    """The derivative furthest from its expectation, in standard errors of the difference."""

    estimator: str
    structure: str
    derivative: str
    z: float


@dataclass(frozen=True, slots=True)
class CouldSeeView:
    """What the flight so far could have shown of one cause.

    Attributes:
        cause: of the shared vocabulary.
        channel: the part, by its column of the flight table; None for a cause of the whole airframe.
        smallest_size: a change of this size or more would have been noticed, had it begun with what is remembered: half
            a minute of relations, three minutes of blocks. 1 for what is there or not (stuck, frozen) and would have
            been noticed; None where no size would have been.
        unit: of the size; empty for a fraction.
        input: the input that would show more; empty where none is needed.
    """

    cause: str
    channel: str | None
    smallest_size: float | None
    unit: str
    input: str = ""


@dataclass(frozen=True, slots=True)
class VehicleView:
    """One vehicle as an operator sees it.

    Attributes:
        reason: one clause saying why the state is what it is.
        basis: what the comparison rests on: ``a-priori``, ``empirical``, ``identified``; None before any.
        basis_text: the same as a sentence, with contradictions between expectation and flight if there are any.
        counts: samples and messages accepted and rejected, by reason (``accepted``, ``duplicate``, ...).
        active_alerts: ids of the alerts that are not cleared, worst first.
        condition: latest airspeed_true_m_s, altitude_m, air_density_kg_m3 (empty before the first sample).
        air: gusts of the last half minute; None without a vane and before there is half a minute.
        rejected_by_channel: readings refused as non-finite, out of range or of a stuck sensor, by channel.
        mass_kg: of the aircraft as it is expected, where it or its file states one.
        cg_shift_m: its centre of gravity aft of the file's.
        could_see: by cause, the smallest size that this flight would have shown.
    """

    fleet: str
    vehicle: str
    aircraft: str | None
    configuration: str | None
    state: VehicleState
    state_since_s: float | None
    reason: str
    last_sample_time_s: float | None
    basis: str | None
    basis_text: str
    worst: WorstDerivative | None
    counts: Mapping[str, int]
    active_alerts: Sequence[str]
    condition: Mapping[str, float]
    air: AirQuality | None = None
    rejected_by_channel: Mapping[str, int] = field(default_factory=dict)
    mass_kg: float | None = None
    cg_shift_m: float = 0.0
    could_see: Sequence[CouldSeeView] = ()


@dataclass(frozen=True, slots=True)
class EvidenceView:
    """One derivative's part in an alert."""

    derivative: str
    estimate: float
    standard_error: float
    expected: float
    expected_standard_error: float
    z: float


@dataclass(frozen=True, slots=True)
class Shelving:
    """For how long an alert is shelved, and what it was like then.

    Attributes:
        until_at_s: it comes back then, seconds since 1970-01-01 UTC.
        level, size: where it grows beyond these, it comes back at once.
    """

    until_at_s: float
    level: str
    size: float


@dataclass(frozen=True, slots=True)
class CandidateView:
    """A cause that is possible, the part that it befalls (None: the airframe), and its probability."""

    cause: str
    channel: str | None
    probability: float


@dataclass(frozen=True, slots=True)
class AlertView:
    """One alert, with its evidence.

    Attributes:
        kind: ``icing``, ``damage``, ``sensor`` or ``unexplained``.
        cause: a name of the shared vocabulary of causes.
        level: ``watch``, ``warning`` or ``critical``.
        raised_s: sample time at which it was raised.
        cleared_s: sample time at which it was cleared, or None.
        size: the cause's size (icing severity, fraction lost), with standard error.
        probability: of the cause among those considered.
        text: what, how much, what to do; one or two sentences for the operator.
        note: who did what to it and why, newest last.
        shelving: where it is shelved; None else, and for what older versions shelved.
        channel: the sensor, surface or throttle at fault, by its column of the flight table; None for the airframe.
        candidates: causes that are possible, likeliest first; empty where only one is.
        diagnosis_id: of the diagnosis of it whose report this service has; None without, and after a restart.
    """

    id: str
    fleet: str
    vehicle: str
    kind: str
    cause: str
    level: str
    state: AlertState
    raised_s: float
    cleared_s: float | None
    size: float
    size_standard_error: float
    probability: float
    basis: str
    text: str
    evidence: Sequence[EvidenceView]
    note: Sequence[str] = field(default=())
    shelving: Shelving | None = None
    channel: str | None = None
    candidates: Sequence[CandidateView] = field(default=())
    diagnosis_id: str | None = None


@dataclass(frozen=True, slots=True)
class Event:
    """Something a listener may want to know: ``kind`` is ``alert``, ``status`` or ``derivatives``."""

    id: int
    kind: str
    data: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class FleetFigures:
    """The fleet in numbers, without a vehicle's name.

    Attributes:
        vehicles: how many are in each state.
        alerts: how many are kept, by state and level.
        counts: samples and messages since the service started, by what became of them (as ``VehicleView.counts``);
            they do not fall when a vehicle is forgotten or watched anew.
        solutions: half seconds of flight that were estimated and compared since the service started.
        waiting: messages that wait for what the database keeps of their vehicle.
        left_out: vehicles that are not watched, for there is more to compute than the machine can.
    """

    vehicles: Mapping[VehicleState, int]
    alerts: Mapping[tuple[AlertState, str], int]
    counts: Mapping[str, int]
    solutions: int
    waiting: int
    left_out: int = 0


class MonitorPort(Protocol):
    """What the doors (REST, terminal) may ask the monitor. Every method is thread-safe.

    All return at once but ``act_on_alert``, which waits for the database for a bounded time.
    """

    def vehicles(self) -> Sequence[VehicleView]:
        """All vehicles ever heard of, worst state first."""
        ...

    def vehicle(self, fleet: str, vehicle: str) -> VehicleView | None:
        """One vehicle; None for one never heard of."""
        ...

    def derivatives(self, fleet: str, vehicle: str) -> Mapping[str, Any] | None:
        """The ``estimate`` object of the contract with ``time_s`` and expectations; None for an unknown vehicle."""
        ...

    def alerts(self) -> Sequence[AlertView]:
        """All alerts, newest first, as the database has them."""
        ...

    def act_on_alert(
        self,
        alert_id: str,
        action: AlertAction,
        who: str,
        note: str,
        key: str | None = None,
        shelve_s: float = SHELVED_S,
    ) -> AlertView | None:
        """Carry out a person's action; returns once it is committed, None for an unknown alert.

        Args:
            shelve_s: for how long the alert is shelved, where that is the action.
            key: of the request; the action of a request that is repeated under its key is carried out once.

        Raises:
            ValueError: it makes no sense in the alert's state, in one sentence.
            KeyReusedError: its key belongs to another action.
            DatabaseError: the database has not taken it in a bounded time; it has not happened.
        """
        ...

    def events(self, after: int) -> Sequence[Event]:
        """Events with an id above ``after``, oldest first (the last 1000 are kept)."""
        ...

    def figures(self) -> FleetFigures:
        """The fleet in numbers; cheap enough to be asked for every second."""
        ...
