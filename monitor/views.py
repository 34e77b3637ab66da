"""What the monitor shows: plain frozen objects that REST, Zenoh and the terminal translate, and the port they read.

Times are the vehicle's own clock (time stamps of its samples), in seconds.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from wingwatch.monitor.positions import Position
from wingwatch.monitor.record_views import FlightRecordView
from wingwatch.telemetry.conditioning import AirQuality

__all__ = [
    "AlertAction",
    "AlertGroupView",
    "LEVELS",
    "SHELVED_S",
    "AlertState",
    "AlertView",
    "CandidateView",
    "CouldSeeView",
    "Event",
    "EvidenceView",
    "FleetFigures",
    "HelpfulInputView",
    "KeyReusedError",
    "LearnedView",
    "ManoeuvreView",
    "MonitorPort",
    "PoorView",
    "ProposedInputView",
    "Shelving",
    "VehicleState",
    "VehicleView",
    "WorstDerivative",
    "repeats_in",
]

Array = NDArray[np.float64]

LEVELS = ("watch", "warning", "critical")
"""Of alerts, from the least."""

SHELVED_S = 3600.0
"""For how long an alert is shelved where no time is given."""


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
class ProposedInputView:
    """An input that somebody may fly so that more can be seen; the service never flies it.

    Attributes:
        id: of the proposal.
        surface: column of the flight table that it moves.
        shape: a key of ``input_design.INPUT_KINDS``.
        amplitude_rad: largest deflection from trim; width_s: of the narrowest step; duration_s: of the whole input.
        steps: from each start in s its deflection from trim in rad; the last one is the end.
        why: what would be seen then, one sentence.
        proposed_s, valid_until_s: sample times; it is not to be flown later.
    """

    id: str
    surface: str
    shape: str
    amplitude_rad: float
    width_s: float
    duration_s: float
    steps: Sequence[tuple[float, float]]
    why: str
    proposed_s: float
    valid_until_s: float


@dataclass(frozen=True, slots=True)
class LearnedView:
    """What a manoeuvre taught of one derivative by one estimator: its standard errors before and after.

    Attributes:
        before: None where there was no solution before the manoeuvre.
        after: of the solution at which the manoeuvre was known to be over.
    """

    estimator: str
    structure: str
    derivative: str
    before: float | None
    after: float


@dataclass(frozen=True, slots=True)
class PoorView:
    """What was poor in a manoeuvre.

    Attributes:
        what: ``too_small``, ``too_slow``, ``too_fast``, ``correlated_inputs`` or ``rough_air``.
        text: one clause with the figure that says so.
    """

    what: str
    text: str


@dataclass(frozen=True, slots=True)
class HelpfulInputView:
    """An input that would teach more than the one that was flown.

    Attributes:
        surface: column of the flight table; shape: a key of ``input_design.INPUT_KINDS``.
        amplitude_rad: largest deflection from trim; width_s: of the narrowest step.
    """

    surface: str
    shape: str
    amplitude_rad: float
    width_s: float


@dataclass(frozen=True, slots=True)
class ManoeuvreView:
    """Whether a manoeuvre was a good one.

    Attributes:
        number: of the vehicle's manoeuvres since its watch began, from 1.
        begin_s, end_s: of the surfaces' movement, sample times; known_s: when the verdict was made.
        surfaces: by column, the largest deflection from trim, rad.
        good: whether nothing was poor.
        learned: of the structures that the surfaces move, by estimator and derivative.
        poor: what was poor; empty where nothing was.
        inputs: that would help; empty where none is needed, or none is known.
        text: the verdict, one or two sentences.
    """

    number: int
    begin_s: float
    end_s: float
    known_s: float
    surfaces: Mapping[str, float]
    good: bool
    learned: Sequence[LearnedView]
    poor: Sequence[PoorView]
    inputs: Sequence[HelpfulInputView]
    text: str


@dataclass(frozen=True, slots=True)
class AlertGroupView:
    """Alerts of several vehicles that are one event to an operator: ice in one area.

    Attributes:
        id: of the group, stable while its first alert is in force.
        kind: of its alerts; level: the worst of them.
        alerts: their ids, oldest first; vehicles: whose they are, as fleet and name.
        latitude_deg, longitude_deg, altitude_m: the middle of where they were raised.
        text: one sentence.
    """

    id: str
    kind: str
    level: str
    alerts: Sequence[str]
    vehicles: Sequence[tuple[str, str]]
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    text: str


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
        could_see: by cause, the smallest size that this flight would have shown; empty in a view of all vehicles, where
            it would be most of the work.
        unseen_surfaces: columns of surfaces that have not moved enough since the start of the flight for a stuck one to
            be noticed; while there are any the vehicle is not healthy.
        proposed_input: that would help, where proposals are asked for and one is valid.
        sample_age_s: since samples of it arrived last; None before the first.
        position: where it was last, where it says so.
        worker: the process that watches it; None where that is the one that is asked.
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
    unseen_surfaces: Sequence[str] = ()
    proposed_input: ProposedInputView | None = None
    sample_age_s: float | None = None
    position: Position | None = None
    worker: str | None = None


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
        raised_s: sample time at which it was raised, the last time where it has come back (``repeats``).
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

    @property
    def repeats(self) -> int:
        """How often it has come back after it had returned to normal."""
        return repeats_in(self.note)


_REPEATED = re.compile(r"wingwatch: raised again \((\d+)\)")


def repeats_in(note: Sequence[str]) -> int:
    """How often an alert has come back, by its notes; persons' notes have an action in that place."""
    found = [int(match[1]) for line in note if (match := _REPEATED.fullmatch(line))]
    return max(found, default=0)


@dataclass(frozen=True, slots=True)
class Event:
    """Something a listener may want to know: ``kind`` is ``alert``, ``status``, ``derivatives`` or ``manoeuvre``."""

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
        left_out: vehicles that are not watched, because the machine is overloaded.
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
        """All known vehicles, worst state first."""
        ...

    def vehicle(self, fleet: str, vehicle: str) -> VehicleView | None:
        """One vehicle; None for an unknown one."""
        ...

    def derivatives(self, fleet: str, vehicle: str) -> Mapping[str, Any] | None:
        """The ``estimate`` object of the contract with ``time_s`` and expectations; None for an unknown vehicle."""
        ...

    def alerts(self) -> Sequence[AlertView]:
        """All alerts, newest first, as the database has them."""
        ...

    def manoeuvres(self, fleet: str, vehicle: str) -> Sequence[ManoeuvreView] | None:
        """The vehicle's last ten manoeuvres, newest first; None for an unknown vehicle."""
        ...

    def flight_record(self, fleet: str, vehicle: str) -> FlightRecordView | None:
        """What is kept of the vehicle's last hour for pictures; None for an unknown vehicle."""
        ...

    def expected(
        self, fleet: str, vehicle: str, structure: str, aircraft: tuple[str, str], conditions: Array
    ) -> tuple[Array, Array] | None:
        """What is expected now of one structure at conditions that were flown; None where nothing is.

        Args:
            aircraft: name and configuration of the aircraft that was flown; of another than is watched now nothing is
                expected.
            conditions: (m, 4), as estimates have them.

        Returns:
            values and standard errors, (m, k) each, NaN where nothing is expected.
        """
        ...

    def alert_groups(self) -> Sequence[AlertGroupView]:
        """Alerts in force that are one event, largest first."""
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
        """Events with an id above ``after``, oldest first; of a vehicle's ``derivatives`` the newest alone."""
        ...

    def events_complete_after(self) -> int:
        """Who has seen the event of this id or a later one has missed none but those that newer ones replaced."""
        ...

    def figures(self) -> FleetFigures:
        """The fleet in numbers; cheap enough to be asked for every second."""
        ...
