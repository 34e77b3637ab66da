"""What the database takes and gives: plain frozen objects, free of any database library.

Times named ``*_at_s`` are seconds since 1970-01-01 UTC, handed in by the caller; all others are the
vehicle's own clock.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import STRUCTURES, FlightCondition, Provenance
from wingwatch.baselines.cells import Cell
from wingwatch.baselines.expectation import Expectation
from wingwatch.baselines.reference import Reference

if TYPE_CHECKING:
    from wingwatch.estimators.estimate import Estimate

__all__ = [
    "ActionRecord",
    "AlertPage",
    "AlertRecord",
    "CandidateRecord",
    "CellRecord",
    "ChangeRecord",
    "EstimateRecord",
    "EvidenceRecord",
    "ExpectationRecord",
    "HistoryRow",
    "HistoryWanted",
    "ReferenceKey",
    "ReferenceRecord",
    "Retention",
    "SeriesOverview",
    "TaughtOverview",
]


@dataclass(frozen=True, slots=True)
class ExpectationRecord:
    """One entry of the baseline: concise derivatives of a structure at one flight condition.

    Attributes:
        value: length k, in the order of ``structure.derivatives``.
        covariance: k rows of length k.
        provenance: ``a-priori``, ``empirical`` or ``identified``.
        source: where the numbers come from, for the reader.
        id: given by the database; None before.
        superseded_by: id of the entry that took its place; None while it is the current one. Of one that was taken back
            the id of the earlier entry that counts again, or its own where there was none.
        change_id: of the change that wrote it; None where that is not known.
    """

    aircraft: str
    configuration: str
    structure: str
    airspeed_true_m_s: float
    altitude_m: float
    air_density_kg_m3: float
    angle_of_attack_rad: float
    value: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    provenance: str
    source: str
    created_at_s: float
    id: int | None = None
    superseded_by: int | None = None
    change_id: int | None = None

    @classmethod
    def of(cls, aircraft: str, expectation: Expectation, created_at_s: float) -> "ExpectationRecord":
        """An expectation as an entry of the aircraft of that name."""
        condition = expectation.condition
        return cls(
            aircraft=aircraft,
            configuration=condition.configuration,
            structure=expectation.structure.name,
            airspeed_true_m_s=float(condition.airspeed_true_m_s),
            altitude_m=float(condition.altitude_m),
            air_density_kg_m3=float(condition.air_density_kg_m3),
            angle_of_attack_rad=float(condition.angle_of_attack_rad),
            value=tuple(expectation.value.tolist()),
            covariance=tuple(tuple(row) for row in expectation.covariance.tolist()),
            provenance=str(expectation.provenance),
            source=expectation.source,
            created_at_s=created_at_s,
        )

    @property
    def expectation(self) -> Expectation:
        """The entry as an expectation, a point for an ``Envelope``.

        Raises:
            KeyError, ValueError: a structure or provenance that this program does not know.
        """
        return Expectation(
            STRUCTURES[self.structure],
            np.array(self.value),
            np.array(self.covariance),
            Provenance(self.provenance),
            FlightCondition(
                self.airspeed_true_m_s,
                self.altitude_m,
                self.air_density_kg_m3,
                self.configuration,
                self.angle_of_attack_rad,
            ),
            self.source,
        )


@dataclass(frozen=True, slots=True)
class ReferenceKey:
    """What a reference belongs to."""

    fleet: str
    vehicle: str
    aircraft: str
    configuration: str
    structure: str


@dataclass(frozen=True, slots=True)
class ReferenceRecord:
    """One saved version of a reference.

    Attributes:
        source: the flights that it was learned from; empty for what a service learned live.
        id: given by the database; None before.
        change_id: of the change that wrote it; None for what a service learned live.
        withdrawn_by: of the change that took it back; None while it stands.
    """

    key: ReferenceKey
    reference: Reference
    updated_at_s: float
    source: str = ""
    id: int | None = None
    change_id: int | None = None
    withdrawn_by: int | None = None


@dataclass(frozen=True, slots=True)
class CellRecord:
    """What a cell of the envelope taught, as it is stored."""

    key: ReferenceKey
    cell: Cell
    reference: Reference
    updated_at_s: float


@dataclass(frozen=True, slots=True)
class ChangeRecord:
    """A change that a person made to the baseline.

    Attributes:
        action: ``import``, ``learn``, ``revert`` or ``delete``.
        who: by whom; empty where that is not known.
        fleet, vehicle: whose teaching was changed; None where expectations of the aircraft were.
        text: what was done, one clause.
        id: given by the database; None before.
    """

    at_s: float
    action: str
    who: str
    aircraft: str
    configuration: str
    text: str
    fleet: str | None = None
    vehicle: str | None = None
    id: int | None = None

    def concerns(self, fleet: str, vehicle: str, aircraft: str, configuration: str) -> bool:
        """Whether what is kept of a vehicle is not as it was."""
        mine = self.vehicle is None or (self.fleet, self.vehicle) == (fleet, vehicle)
        return mine and (self.aircraft, self.configuration) == (aircraft, configuration)


@dataclass(frozen=True, slots=True)
class SeriesOverview:
    """Entries of one aircraft, configuration and structure.

    Attributes:
        entries: current ones by provenance.
        superseded: entries that are history.
        newest_at_s: when the newest current entry was made.
    """

    aircraft: str
    configuration: str
    structure: str
    entries: Mapping[str, int]
    superseded: int
    newest_at_s: float | None


@dataclass(frozen=True, slots=True)
class TaughtOverview:
    """What a vehicle's flights taught of one structure: its newest version, and how many cells are remembered."""

    key: ReferenceKey
    blocks: int
    seconds: float
    cells: int
    updated_at_s: float


@dataclass(frozen=True, slots=True)
class EvidenceRecord:
    """One derivative's part in an alert."""

    derivative: str
    estimate: float
    standard_error: float
    expected: float
    expected_standard_error: float
    z: float


@dataclass(frozen=True, slots=True)
class CandidateRecord:
    """A cause that is possible for an alert, the part that it befalls (None: the airframe), and its probability."""

    cause: str
    channel: str | None
    probability: float


@dataclass(frozen=True, slots=True)
class AlertRecord:
    """One alert as it is stored; its fields mean what the monitor's alert says.

    Of what older versions stored the channel is None, and there are no candidates.
    """

    id: str
    fleet: str
    vehicle: str
    kind: str
    cause: str
    level: str
    state: str
    raised_s: float
    cleared_s: float | None
    size: float
    size_standard_error: float
    probability: float
    basis: str
    text: str
    evidence: Sequence[EvidenceRecord]
    created_at_s: float
    updated_at_s: float
    note: Sequence[str] = field(default=())
    shelving: Mapping[str, float | str] | None = None
    channel: str | None = None
    candidates: Sequence[CandidateRecord] = field(default=())


@dataclass(frozen=True, slots=True)
class ActionRecord:
    """What a person did to an alert.

    Attributes:
        key: of the request; a repeated request has the same.
        at_s: seconds since 1970-01-01 UTC.
    """

    key: str
    alert_id: str
    action: str
    who: str
    note: str
    at_s: float


@dataclass(frozen=True, slots=True)
class AlertPage:
    """Some alerts, newest first, and the cursor of the following page (None at the end)."""

    items: tuple[AlertRecord, ...]
    next: str | None


@dataclass(frozen=True, slots=True)
class EstimateRecord:
    """One estimate of a vehicle's mode, as kept for history.

    Attributes:
        value: length k, in the order of ``structure.derivatives``; NaN where nothing is known.
        standard_error: length k; infinite where nothing is known.
        condition: airspeed_true_m_s, altitude_m, air_density_kg_m3, angle_of_attack_rad.
        covariance: below its diagonal, row by row, length k (k - 1) / 2; empty where it is not known. The diagonal is
            the square of the standard errors.
    """

    fleet: str
    vehicle: str
    time_s: float
    structure: str
    estimator: str
    value: tuple[float, ...]
    standard_error: tuple[float, ...]
    outcome: str
    condition: tuple[float, float, float, float]
    aircraft: str = ""
    configuration: str = ""
    covariance: tuple[float, ...] = ()

    @classmethod
    def of(
        cls, fleet: str, vehicle: str, estimate: "Estimate", aircraft: str = "", configuration: str = ""
    ) -> "EstimateRecord":
        """The part of an estimate that is kept."""
        airspeed, altitude, density, alpha = (float(x) for x in estimate.condition)
        return cls(
            fleet=fleet,
            vehicle=vehicle,
            time_s=float(estimate.time_s),
            structure=estimate.structure.name,
            estimator=estimate.estimator,
            value=tuple(estimate.value.tolist()),
            standard_error=tuple(estimate.standard_error.tolist()),
            outcome=str(estimate.outcome),
            condition=(airspeed, altitude, density, alpha),
            aircraft=aircraft,
            configuration=configuration,
            covariance=tuple(estimate.covariance[_below_diagonal(len(estimate.value))].tolist()),
        )


@cache
def _below_diagonal(k: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Places below the diagonal of a matrix (k, k), row by row."""
    return np.tril_indices(k, -1)


@dataclass(frozen=True, slots=True)
class HistoryRow:
    """One estimate of the history.

    Attributes:
        flight: its number; a later flight of the vehicle has a higher one.
        at_s: when it was kept, seconds since 1970-01-01 UTC; None for what older versions kept.
    """

    estimate: EstimateRecord
    flight: int
    at_s: float | None


@dataclass(frozen=True, slots=True)
class HistoryWanted:
    """Which part of a vehicle's history, in the order of flight, time, estimator and structure.

    Attributes:
        from_s, to_s: vehicle's time, inclusive; None leaves an end open.
        flight: only this one; all without.
        structures: only these; all without.
        start: flight, time, estimator and structure of the first row; the first of all without.
        limit: at most so many rows; all without.
    """

    from_s: float | None = None
    to_s: float | None = None
    flight: int | None = None
    structures: tuple[str, ...] | None = None
    start: tuple[int, float, str, str] | None = None
    limit: int | None = None


@dataclass(frozen=True, slots=True)
class Retention:
    """How long the history of estimates is kept.

    Attributes:
        full_rate_s: as it came.
        interval_s: of what is older, the first instant of each interval stays.
        keep_s: flights that ended longer ago go.
        most_rows: where there are more, the flights that ended first go.
    """

    full_rate_s: float = 24.0 * 3600.0
    interval_s: float = 10.0
    keep_s: float = 90.0 * 86_400.0
    most_rows: int = 20_000_000
