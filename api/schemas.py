"""The REST objects, and how the monitor's views become them."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from wingwatch.aircraft.vocabulary import DERIVATIVES
from wingwatch.api.encoding import quantity
from wingwatch.api.ports import KernelState, KernelsView
from wingwatch.monitor.views import (
    AlertGroupView,
    AlertState,
    AlertView,
    CandidateView,
    CouldSeeView,
    EvidenceView,
    ProposedInputView,
    VehicleState,
    VehicleView,
    WorstDerivative,
)
from wingwatch.telemetry.conditioning import AirQuality

__all__ = [
    "AirDocument",
    "AlertDocument",
    "AlertGroupDocument",
    "AlertList",
    "CandidateDocument",
    "CouldSeeDocument",
    "DerivativesDocument",
    "FieldProblem",
    "HistoryItem",
    "HistoryList",
    "KernelsDocument",
    "Live",
    "Name",
    "PersonAction",
    "Problem",
    "ProposedInputDocument",
    "Ready",
    "SessionDocument",
    "StatusDocument",
    "LogIn",
    "VehicleDocument",
    "VehicleList",
    "WorstDocument",
    "air_document",
    "alert_document",
    "could_see_documents",
    "group_document",
    "proposed_input_document",
    "status_document",
    "kernels_document",
    "vehicle_document",
    "worst_document",
]

Name = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_-]{0,62}$")]
"""A fleet's or vehicle's name, as the Zenoh keys allow it."""

_Line = r"^[^\x00-\x1f\x7f]*$"


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class _OpenAnswer(BaseModel):
    """An object to which the monitor may add keys; they are passed on as they are."""

    model_config = ConfigDict(frozen=True, extra="allow")


class FieldProblem(_Answer):
    """One part of a request that cannot be used."""

    where: str = Field(description="place and name, such as `query.limit`")
    message: str


class Problem(_Answer):
    """A problem document (RFC 9457)."""

    type: str = "about:blank"
    title: str = Field(description="the status code's meaning")
    status: int
    detail: str = Field(description="one sentence: what, which value, what to do")
    instance: str | None = Field(default=None, description="path of the request")
    errors: list[FieldProblem] | None = Field(default=None, description="every fault of a request's values")
    checks: dict[str, str | None] | None = Field(
        default=None, description="readiness: each part's problem, null where it works"
    )


class WorstDocument(_Answer):
    """The derivative furthest from its expectation."""

    estimator: str
    structure: str
    derivative: str
    z: float | None = Field(description="difference over its standard error")
    unit: str
    meaning: str


class GustDocument(_Answer):
    """One component's gust."""

    component: str = Field(description="vertical or lateral")
    rms_m_s: float | None = Field(description="root mean square of the whole gust, by Dryden's spectrum")
    rms_m_s_standard_error: float | None
    in_band_rms_m_s: float | None = Field(description="the part of it at the frequencies of the modes")
    share: float | None = Field(description="in that band: gust power over itself and what the vane sees")
    observable: bool = Field(description="whether it stands above the sensors' noise")


class AirDocument(_Answer):
    """The air of the last half minute."""

    fit_for_estimating: bool
    gusts: list[GustDocument]
    text: str


class CouldSeeDocument(_Answer):
    """What a flight so far could have shown of one cause."""

    cause: str
    channel: str | None = Field(
        description="the part, by its column of the flight table; null for a cause of the whole airframe"
    )
    smallest_size: float | None = Field(
        description="a change of this size or more would have been noticed, 1 for what is there or not (stuck, "
        "frozen); null where none would have been"
    )
    unit: str = Field(description="of the size; empty for a fraction")
    input: str = Field(description="the input that would show more; empty where none is needed")


class StepDocument(_Answer):
    """A deflection that is held from its start to the next step; the last one is the end, at trim."""

    start_s: float
    deflection_rad: float


class ProposedInputDocument(_Answer):
    """An input that somebody may fly so that more can be seen; the service never flies it."""

    id: str
    surface: str = Field(description="column of the flight table that it moves")
    shape: str = Field(description="doublet or 3211")
    amplitude_rad: float = Field(description="largest deflection from trim")
    width_s: float = Field(description="of the narrowest step")
    duration_s: float
    steps: list[StepDocument]
    why: str = Field(description="what would be seen then")
    proposed_s: float = Field(description="the vehicle's own clock")
    valid_until_s: float = Field(description="it is not to be flown later")


class VehicleDocument(_Answer):
    """One vehicle as an operator sees it."""

    fleet: str
    vehicle: str
    aircraft: str | None = Field(description="announced aircraft; null before it is known")
    configuration: str | None
    state: VehicleState
    state_since_s: float | None
    reason: str = Field(description="why the state is what it is")
    last_sample_time_s: float | None = Field(description="the vehicle's own clock")
    basis: str | None = Field(description="what the comparison rests on: a-priori, empirical, identified")
    basis_text: str
    worst: WorstDocument | None
    counts: dict[str, int] = Field(description="samples and messages accepted and rejected, by reason")
    active_alerts: list[str] = Field(description="ids of alerts that are not cleared, worst first")
    condition: dict[str, float | None] = Field(
        description="latest airspeed_true_m_s, altitude_m, air_density_kg_m3"
    )
    air: AirDocument | None = Field(
        default=None, description="gusts of the last half minute; null without a vane and before that"
    )
    rejected_by_channel: dict[str, int] = Field(
        default_factory=dict,
        description="readings refused as non-finite, out of range or of a stuck sensor, by channel",
    )
    mass_kg: float | None = Field(
        default=None, description="mass that is expected: the announced one, else the aircraft file's"
    )
    cg_shift_m: float = Field(default=0.0, description="centre of gravity in use, aft of the aircraft file's")
    could_see: list[CouldSeeDocument] = Field(
        default_factory=list,
        description="by cause and part, the smallest change that this flight would have shown; empty in lists",
    )
    unseen_surfaces: list[str] = Field(
        default_factory=list,
        description="columns of surfaces that have not moved enough in this flight for a stuck one to be noticed; "
        "while there are any the vehicle is not healthy",
    )
    proposed_input: ProposedInputDocument | None = Field(
        default=None, description="an input that would help, where `serve --excite` proposes one; null else"
    )
    worker: str | None = Field(
        default=None, description="the worker that watches it; null where the service itself does, or nobody"
    )


class VehicleList(_Answer):
    """All vehicles, worst first."""

    items: list[VehicleDocument]
    next: None = None


class SizeDocument(_Answer):
    """Size of a cause, with its standard error."""

    value: float | None
    standard_error: float | None


class EvidenceDocument(_Answer):
    """One derivative's part in an alert."""

    derivative: str
    estimate: float | None
    standard_error: float | None
    expected: float | None
    expected_standard_error: float | None
    z: float | None
    unit: str
    meaning: str


class CandidateDocument(_Answer):
    """One cause that is possible for an alert."""

    cause: str
    channel: str | None = Field(
        description="the part that it befalls, by its column of the flight table; null for the whole airframe"
    )
    probability: float | None


class AlertDocument(_Answer):
    """One alert with its evidence."""

    id: str
    fleet: str
    vehicle: str
    kind: str = Field(description="icing, damage, sensor or unexplained")
    cause: str
    level: str = Field(description="watch, warning or critical")
    state: AlertState
    raised_s: float = Field(description="sample time at which it was raised")
    cleared_s: float | None
    size: SizeDocument
    probability: float | None = Field(description="of the cause among those considered")
    basis: str = Field(description="what the comparison rests on")
    text: str
    evidence: list[EvidenceDocument]
    notes: list[str] = Field(description="who did what and why, newest last")
    shelved_until_at_s: float | None = Field(
        default=None, description="where it is shelved: it comes back then; seconds since 1970-01-01 UTC"
    )
    channel: str | None = Field(
        default=None,
        description="sensor, surface or throttle at fault, by its column of the flight table; null for the airframe",
    )
    candidates: list[CandidateDocument] = Field(
        default_factory=list, description="causes that are possible, likeliest first; empty where only one is"
    )
    repeats: int = Field(
        default=0,
        description="how often it has come back within five minutes after it had returned to normal",
    )
    group: str | None = Field(
        default=None, description="id of the group that it is in, in `groups` of the lists; null without"
    )
    diagnosis_id: str | None = Field(
        default=None,
        description="of the diagnosis of it, see /v1/diagnoses/{id}; null without and after a restart",
    )


class AlertGroupDocument(_Answer):
    """Alerts of several vehicles that are one event: ice in one area."""

    id: str
    kind: str
    level: str = Field(description="the worst of its alerts'")
    alerts: list[str] = Field(description="ids, oldest first")
    vehicles: list[str] = Field(description="as `fleet/vehicle`")
    latitude_deg: float = Field(description="of the middle of where they were raised")
    longitude_deg: float
    altitude_m: float
    text: str


class AlertList(_Answer):
    """Alerts, newest first, one page."""

    items: list[AlertDocument]
    groups: list[AlertGroupDocument] = Field(
        default_factory=list, description="events that several of all alerts in force are, largest first"
    )
    next: str | None = Field(default=None, description="`cursor` of the next page, null on the last")


class KernelPartDocument(_Answer):
    """A part of the numerical kernels."""

    name: str
    state: KernelState
    first: bool = Field(description="whether no sample is taken in before it is compiled")


class KernelsDocument(_Answer):
    """The compilation of the numerical kernels, which a machine goes through once."""

    text: str = Field(description="what is compiled, what is done and how long it takes: one sentence")
    parts: list[KernelPartDocument] = Field(description="in the order in which they are begun")
    elapsed_s: float
    remaining_s: float | None = Field(description="until samples are taken in, null where it is not known")


class StatusDocument(_Answer):
    """The fleet at a glance."""

    version: str
    counts: dict[VehicleState, int] = Field(description="vehicles per state, every state listed")
    vehicles: list[VehicleDocument] = Field(description="worst first")
    alerts: list[AlertDocument] = Field(description="alerts that are not cleared, newest first")
    groups: list[AlertGroupDocument] = Field(
        default_factory=list, description="events that several of these alerts are, largest first"
    )
    counters: dict[str, dict[str, int]] = Field(
        default_factory=dict,
        description="of the service, by part: what went wrong or was dropped, and how often",
    )
    kernels: KernelsDocument | None = Field(
        default=None, description="the compilation of the numerical kernels; null where none is under way"
    )
    database: str | None = Field(
        default=None,
        description="why alerts and actions wait for the database, one sentence; null while none does",
    )
    problems: dict[str, str] = Field(
        default_factory=dict, description="parts of the service that do not work, each with one sentence"
    )


class DerivativeValue(_OpenAnswer):
    """One derivative, estimated and expected."""

    value: float | None
    standard_error: float | None
    unit: str
    outcome: str
    expected: float | None = None
    expected_standard_error: float | None = None


class ModeEstimate(_OpenAnswer):
    """One mode's estimate by one estimator."""

    outcome: str
    derivatives: dict[str, DerivativeValue]
    confounded: list[list[str]] = Field(
        default_factory=list,
        description="sets of derivatives that cannot be distinguished: only combinations are known",
    )
    natural_frequency_rad_s: float | None = None
    natural_frequency_rad_s_standard_error: float | None = None
    damping_ratio: float | None = None
    damping_ratio_standard_error: float | None = None


class DerivativesDocument(_OpenAnswer):
    """Current derivatives of a vehicle: estimator, then structure, then derivative."""

    fleet: str
    vehicle: str
    time_s: float | None = Field(description="stamp of the last sample used")
    convention: str
    estimators: dict[str, dict[str, ModeEstimate]]


class HistoryItem(_Answer):
    """One derivative at one past instant."""

    time_s: float
    estimator: str
    structure: str
    derivative: str
    value: float | None
    standard_error: float | None
    unit: str
    outcome: str
    recorded_at_s: float | None = Field(
        description="seconds since 1970-01-01 UTC; null where it is not known"
    )
    flight: int = Field(description="a later flight of the vehicle has a higher number")
    aircraft: str | None
    configuration: str | None


class HistoryList(_Answer):
    """Past estimates, oldest first, one page."""

    items: list[HistoryItem]
    next: str | None = Field(default=None, description="`cursor` of the next page, null on the last")


class Live(_Answer):
    """The process answers."""

    live: Literal[True] = True
    version: str


class Ready(_Answer):
    """Everything works."""

    ready: Literal[True] = True
    checks: dict[str, str | None] = Field(description="each part of the service: null where it works")


class LogIn(BaseModel):
    """A token that a person logs in with."""

    model_config = ConfigDict(frozen=True, extra="forbid", str_strip_whitespace=True)

    token: str = Field(min_length=1, max_length=200)


class SessionDocument(_Answer):
    """Who asks."""

    name: str | None = Field(description="of the token; null without one")
    scope: str | None = Field(description="`read` or `operate`; null without a token")
    required: bool = Field(description="whether the service asks for a token")


class PersonAction(BaseModel):
    """Who acts on an alert, and why."""

    model_config = ConfigDict(frozen=True, extra="forbid", str_strip_whitespace=True)

    who: str | None = Field(
        default=None, min_length=1, max_length=100, pattern=_Line,
        description="required without a token; with one it stands behind the token's name",
    )  # fmt: skip
    note: str = Field(default="", max_length=1000, pattern=_Line)
    minutes: float = Field(
        default=60.0, gt=0.0, le=1440.0, allow_inf_nan=False,
        description="of shelve: for how long; the alert comes back earlier when the fault grows",
    )  # fmt: skip


def could_see_documents(rows: Sequence[CouldSeeView]) -> list[CouldSeeDocument]:
    """The vehicle's ``could_see``."""
    return [
        CouldSeeDocument(
            cause=one.cause,
            channel=one.channel,
            smallest_size=quantity(one.smallest_size),
            unit=one.unit,
            input=one.input,
        )
        for one in rows
    ]


def vehicle_document(view: VehicleView) -> VehicleDocument:
    """The object of ``/v1/vehicles/{id}`` and of the Zenoh status key."""
    return VehicleDocument(
        fleet=view.fleet,
        vehicle=view.vehicle,
        aircraft=view.aircraft,
        configuration=view.configuration,
        state=view.state,
        state_since_s=quantity(view.state_since_s),
        reason=view.reason,
        last_sample_time_s=quantity(view.last_sample_time_s),
        basis=view.basis,
        basis_text=view.basis_text,
        worst=None if view.worst is None else worst_document(view.worst),
        counts={key: int(count) for key, count in view.counts.items()},
        active_alerts=list(view.active_alerts),
        condition={key: quantity(value) for key, value in view.condition.items()},
        air=None if view.air is None else air_document(view.air),
        rejected_by_channel=dict(view.rejected_by_channel),
        mass_kg=view.mass_kg,
        cg_shift_m=view.cg_shift_m,
        could_see=could_see_documents(view.could_see),
        unseen_surfaces=list(view.unseen_surfaces),
        proposed_input=None if view.proposed_input is None else proposed_input_document(view.proposed_input),
        worker=view.worker,
    )


def proposed_input_document(view: ProposedInputView) -> ProposedInputDocument:
    """The vehicle's ``proposed_input``, and the object of the Zenoh key of proposals."""
    values = {name: getattr(view, name) for name in ProposedInputDocument.model_fields if name != "steps"}
    steps = [StepDocument(start_s=start_s, deflection_rad=to_rad) for start_s, to_rad in view.steps]
    return ProposedInputDocument(**values, steps=steps)


def air_document(air: AirQuality) -> AirDocument:
    """The vehicle's ``air``."""
    return AirDocument(
        fit_for_estimating=air.fit_for_estimating,
        text=air.text,
        gusts=[
            GustDocument(
                component=whole.name.removesuffix(" gust"),
                rms_m_s=quantity(whole.value if whole.observable else None),
                rms_m_s_standard_error=quantity(whole.standard_error if whole.observable else None),
                in_band_rms_m_s=quantity(band.value if band.observable else None),
                share=quantity(share),
                observable=whole.observable,
            )
            for whole, band, share in zip(air.sigma, air.in_band, air.share, strict=True)
        ],
    )


def group_document(view: AlertGroupView) -> AlertGroupDocument:
    """One of the ``groups`` of a list."""
    return AlertGroupDocument(
        id=view.id,
        kind=view.kind,
        level=view.level,
        alerts=list(view.alerts),
        vehicles=[f"{fleet}/{vehicle}" for fleet, vehicle in view.vehicles],
        latitude_deg=view.latitude_deg,
        longitude_deg=view.longitude_deg,
        altitude_m=view.altitude_m,
        text=view.text,
    )


def alert_document(view: AlertView, groups: Sequence[AlertGroupView] = ()) -> AlertDocument:
    """The object of ``/v1/alerts/{id}`` and of the Zenoh alert key.

    Args:
        groups: of all alerts; on Zenoh an alert does not say in which it is.
    """
    return AlertDocument(
        id=view.id,
        fleet=view.fleet,
        vehicle=view.vehicle,
        kind=view.kind,
        cause=view.cause,
        level=view.level,
        state=view.state,
        raised_s=view.raised_s,
        cleared_s=quantity(view.cleared_s),
        size=SizeDocument(value=quantity(view.size), standard_error=quantity(view.size_standard_error)),
        probability=quantity(view.probability),
        basis=view.basis,
        text=view.text,
        evidence=[_evidence(e) for e in view.evidence],
        notes=list(view.note),
        shelved_until_at_s=None if view.shelving is None else quantity(view.shelving.until_at_s),
        channel=view.channel,
        candidates=[_candidate(one) for one in view.candidates],
        repeats=view.repeats,
        group=next((group.id for group in groups if view.id in group.alerts), None),
        diagnosis_id=view.diagnosis_id,
    )


def status_document(
    version: str,
    vehicles: list[VehicleDocument],
    alerts: list[AlertDocument],
    counters: Mapping[str, Mapping[str, int]],
    kernels: KernelsView | None = None,
    database: str | None = None,
    problems: Mapping[str, str] | None = None,
    groups: Sequence[AlertGroupView] = (),
) -> StatusDocument:
    """The fleet's status from its vehicles, from those alerts that are not cleared, and the service's own state."""
    counts = {state: sum(v.state == state for v in vehicles) for state in VehicleState}
    parts = {part: dict(counters[part]) for part in counters}
    return StatusDocument(
        version=version,
        counts=counts,
        vehicles=vehicles,
        alerts=alerts,
        groups=[group_document(group) for group in groups],
        counters=parts,
        kernels=None if kernels is None else kernels_document(kernels),
        database=database,
        problems=dict(problems or {}),
    )


def kernels_document(view: KernelsView) -> KernelsDocument:
    """The compilation of the kernels."""
    return KernelsDocument(
        text=view.text,
        parts=[KernelPartDocument(name=p.name, state=p.state, first=p.first) for p in view.parts],
        elapsed_s=round(view.elapsed_s, 1),
        remaining_s=None if view.remaining_s is None else round(view.remaining_s),
    )


def worst_document(worst: WorstDerivative) -> WorstDocument:
    """The derivative that is furthest from its expectation, with its unit and meaning."""
    unit, meaning = _words(worst.derivative)
    return WorstDocument(
        estimator=worst.estimator,
        structure=worst.structure,
        derivative=worst.derivative,
        z=quantity(worst.z),
        unit=unit,
        meaning=meaning,
    )


def _evidence(part: EvidenceView) -> EvidenceDocument:
    unit, meaning = _words(part.derivative)
    return EvidenceDocument(
        derivative=part.derivative,
        estimate=quantity(part.estimate),
        standard_error=quantity(part.standard_error),
        expected=quantity(part.expected),
        expected_standard_error=quantity(part.expected_standard_error),
        z=quantity(part.z),
        unit=unit,
        meaning=meaning,
    )


def _candidate(one: CandidateView) -> CandidateDocument:
    return CandidateDocument(cause=one.cause, channel=one.channel, probability=quantity(one.probability))


def _words(symbol: str) -> tuple[str, str]:
    known = DERIVATIVES.get(symbol)
    return (known.unit, known.meaning) if known else ("", "")
