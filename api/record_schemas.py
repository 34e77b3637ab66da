"""The REST objects of pictures over time: flights, series of derivatives, evidence of blocks, telemetry's health."""

from collections.abc import Mapping, Sequence

from pydantic import BaseModel, ConfigDict, Field

from wingwatch.api.encoding import quantity
from wingwatch.baselines import FlightRecord
from wingwatch.monitor.record_views import BlockRecord, FlightRecordView, LinkView, ModeRecord
from wingwatch.monitor.views import AlertState, AlertView, VehicleView

__all__ = [
    "EvidenceSeriesDocument",
    "FlightList",
    "SeriesDocument",
    "SeriesOfDerivative",
    "TelemetryDocument",
    "evidence_document",
    "flight_list",
    "telemetry_document",
]


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class FlightDocument(_Answer):
    """One flight of which estimates are kept."""

    flight: int = Field(description="a later flight of the vehicle has a higher number")
    aircraft: str | None
    configuration: str | None
    first_time_s: float = Field(description="the vehicle's own clock, of its first estimate")
    last_time_s: float
    began_at_s: float | None = Field(description="seconds since 1970-01-01 UTC; null where it is not known")
    last_at_s: float
    estimates: int = Field(description="that are kept, of one mode by one estimator each")


class FlightList(_Answer):
    """Flights of which estimates are kept, newest first."""

    items: list[FlightDocument]
    kept: bool = Field(description="whether the service keeps estimates at all")
    next: None = None


class SeriesOfDerivative(_Answer):
    """One derivative by one estimator over time; all lists are of one length."""

    estimator: str
    structure: str
    derivative: str
    unit: str
    meaning: str
    kept: int = Field(description="estimates in the time asked for, before they were thinned")
    time_s: list[float]
    value: list[float | None]
    standard_error: list[float | None]
    outcome: list[str] = Field(description="of the mode's estimate")
    expected: list[float | None] = Field(
        description="what is expected now at the condition that was flown then; null where nothing is"
    )
    expected_standard_error: list[float | None]


class SeriesDocument(_Answer):
    """Derivatives of one flight over time, thinned so that extremes stay."""

    fleet: str
    vehicle: str
    flight: int | None = Field(description="null where no estimate is kept")
    from_s: float | None = Field(description="as it was asked for, else the flight's first estimate")
    to_s: float | None
    points: int = Field(description="how many a series has at most")
    thinned: bool = Field(description="whether any series has fewer points than are kept")
    series: list[SeriesOfDerivative]


class ModeEvidenceDocument(_Answer):
    """What a block said of one structure by one estimator."""

    information_bit: float | None = Field(
        description="excitation: what the block says of the derivatives beside their natural sizes, in bits; "
        "0 where nothing moved, null where the estimator's account of the block is not used"
    )
    innovation: float | None = Field(
        description="normalised innovation squared over its degrees of freedom, 1 on average of an aircraft that is as "
        "expected; null where it was not compared"
    )
    limit: float | None = Field(description="95 % of the innovations are below it then")


class BlockDocument(_Answer):
    """A block of about ten seconds."""

    start_s: float
    end_s: float
    statistic: float | None = Field(
        description="natural logarithm of the test's statistic after it; null where nothing was compared"
    )
    rough: list[str] = Field(description="structures whose air was rough")
    modes: dict[str, dict[str, ModeEvidenceDocument]] = Field(description="by structure, then by estimator")


class MarkDocument(_Answer):
    """When an alert of the vehicle began."""

    id: str
    cause: str
    channel: str | None
    level: str
    state: AlertState
    onset_s: float | None = Field(
        description="when the fault began, as far as it is known; null else and after a restart"
    )
    raised_s: float
    cleared_s: float | None


class EvidenceSeriesDocument(_Answer):
    """What the last hour's blocks said, and when the vehicle's alerts began; it begins anew with the service."""

    fleet: str
    vehicle: str
    threshold: float | None = Field(description="of `statistic`: an alert is raised from it on")
    blocks: list[BlockDocument] = Field(description="oldest first")
    marks: list[MarkDocument] = Field(description="newest first, at most 100")


class LinkSecondDocument(_Answer):
    """A second in which messages arrived."""

    time_s: float | None = Field(description="latest stamp, the vehicle's own clock")
    samples: int
    messages: int
    longest_step_s: float | None = Field(description="between stamps of successive samples")
    delay_s: float | None = Field(
        description="by how much longer than the fastest message that is kept the slowest one took"
    )


class TelemetryDocument(_Answer):
    """How a vehicle's messages arrive, and what of them was not used; of the last ten minutes but for the counts."""

    fleet: str
    vehicle: str
    rate_hz: float | None = Field(description="samples a second, of the last ten seconds")
    step_s: float | None = Field(description="usual step between stamps")
    gaps: int = Field(description="seconds in which a step was three usual ones or longer")
    longest_gap_s: float = Field(description="the longest such step; 0 without")
    delay_s: float | None = Field(
        description="median over the seconds of the slowest message's delay beyond that of the fastest kept"
    )
    longest_delay_s: float | None
    silent_s: float | None = Field(description="since the last message")
    counts: dict[str, int] = Field(description="samples and messages accepted and rejected, by reason")
    rejected_by_channel: dict[str, int]
    seconds: list[LinkSecondDocument] = Field(description="oldest first, at most 600")


def flight_list(flights: Sequence[FlightRecord] | None) -> FlightList:
    """The object of ``/v1/vehicles/{id}/flights``; None where the service keeps no estimates."""
    return FlightList(
        kept=flights is not None,
        items=[
            FlightDocument(
                flight=one.id,
                aircraft=one.aircraft or None,
                configuration=one.configuration or None,
                first_time_s=one.first_time_s,
                last_time_s=one.last_time_s,
                began_at_s=quantity(one.began_at_s),
                last_at_s=one.last_at_s,
                estimates=one.estimates,
            )
            for one in flights or ()
        ],
    )


def evidence_document(
    fleet: str, vehicle: str, record: FlightRecordView, alerts: list[AlertView]
) -> EvidenceSeriesDocument:
    """The object of ``/v1/vehicles/{id}/evidence``; ``alerts``: of the vehicle, newest first."""
    return EvidenceSeriesDocument(
        fleet=fleet,
        vehicle=vehicle,
        threshold=quantity(record.threshold),
        blocks=[_block(one) for one in record.blocks],
        marks=[_mark(one, record.onsets_s) for one in alerts[:100]],
    )


def telemetry_document(view: VehicleView, link: LinkView) -> TelemetryDocument:
    """The object of ``/v1/vehicles/{id}/telemetry``."""
    return TelemetryDocument(
        fleet=view.fleet,
        vehicle=view.vehicle,
        rate_hz=quantity(link.rate_hz),
        step_s=quantity(link.step_s),
        gaps=link.gaps,
        longest_gap_s=link.longest_gap_s,
        delay_s=quantity(link.delay_s),
        longest_delay_s=quantity(link.longest_delay_s),
        silent_s=quantity(link.silent_s),
        counts={name: int(times) for name, times in view.counts.items()},
        rejected_by_channel=dict(view.rejected_by_channel),
        seconds=[
            LinkSecondDocument(
                time_s=quantity(one.time_s),
                samples=one.samples,
                messages=one.messages,
                longest_step_s=quantity(one.longest_step_s),
                delay_s=quantity(one.delay_s),
            )
            for one in link.seconds
        ],
    )


def _block(one: BlockRecord) -> BlockDocument:
    return BlockDocument(
        start_s=one.start_s,
        end_s=one.end_s,
        statistic=quantity(one.statistic),
        rough=list(one.rough),
        modes={
            name: {estimator: _mode(mode) for estimator, mode in modes.items()}
            for name, modes in one.modes.items()
        },
    )


def _mode(mode: ModeRecord) -> ModeEvidenceDocument:
    return ModeEvidenceDocument(
        information_bit=quantity(mode.information_bit),
        innovation=quantity(mode.innovation),
        limit=quantity(mode.limit),
    )


def _mark(alert: AlertView, onsets_s: Mapping[str, float]) -> MarkDocument:
    return MarkDocument(
        id=alert.id,
        cause=alert.cause,
        channel=alert.channel,
        level=alert.level,
        state=alert.state,
        onset_s=quantity(onsets_s.get(alert.id)),
        raised_s=alert.raised_s,
        cleared_s=quantity(alert.cleared_s),
    )
