"""The expectation of a structure's derivatives at any point of an envelope, with its standard error.

Entries are carried to the wanted flight condition through the American non-dimensional form
(``wingwatch.aircraft.affine``), where little depends on airspeed and density, and interpolated there. Rules
and derivations: docs/decisions/0011-baseline-envelope.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    AffineForm,
    Aircraft,
    AircraftDataError,
    Convention,
    FlightCondition,
    ModeStructure,
    Provenance,
    affine,
    carried,
    isa_density_kg_m3,
)
from wingwatch.baselines.interpolation import Placement, interpolator
from wingwatch.baselines.reference import Reference

__all__ = [
    "DECLARED",
    "Envelope",
    "Expectation",
    "MEASURED",
    "Neighbourhood",
    "OutOfEnvelope",
    "UNSCALED",
    "american",
    "concise",
    "empirical",
]

CARRY_SHARE = 0.03
"""Standard error of an American derivative carried outside the hull, as a share of its value and of the
relative change of trim lift coefficient: what the library's linearised coefficients lose at most."""

LIFT_PROPORTIONAL = frozenset(("l_r", "n_p"))
"""Derivatives that strip theory makes proportional to the lift coefficient: their share is 1."""

_WEAKEST_FIRST = (Provenance.A_PRIORI, Provenance.EMPIRICAL, Provenance.IDENTIFIED)


@dataclass(frozen=True, slots=True, eq=False)
class Expectation:
    """What the derivatives of one structure should be at one flight condition.

    Attributes:
        value: concise derivatives, shape (k,), in the order of ``structure.derivatives``.
        covariance: shape (k, k), symmetric, positive semidefinite.
        provenance: the weakest of what it rests on.
        source: where the numbers come from, for the reader.
    """

    structure: ModeStructure
    value: NDArray[np.float64]
    covariance: NDArray[np.float64]
    provenance: Provenance
    condition: FlightCondition
    source: str

    def __post_init__(self) -> None:
        k = len(self.structure.derivatives)
        if self.value.shape != (k,) or self.covariance.shape != (k, k):
            raise ValueError(
                f"an expectation of {self.structure.name} has shapes ({k},) and ({k}, {k}), "
                f"got {self.value.shape} and {self.covariance.shape}"
            )
        if not (np.isfinite(self.value).all() and np.isfinite(self.covariance).all()):
            raise ValueError(f"an expectation of {self.structure.name} must be finite, got {self.value}")

    @property
    def standard_error(self) -> NDArray[np.float64]:
        """Square root of the covariance's diagonal, shape (k,)."""
        return np.sqrt(np.diagonal(self.covariance))


@dataclass(frozen=True, slots=True)
class OutOfEnvelope:
    """No expectation here; ``reason`` says why in one sentence."""

    reason: str


@dataclass(frozen=True, slots=True)
class Neighbourhood:
    """How far from the points' hull their outermost values are still trusted.

    Attributes:
        airspeed_fraction: of the hull's nearest airspeed, either way.
        altitude_m: either way.
    """

    airspeed_fraction: float = 0.15
    altitude_m: float = 1000.0

    def __post_init__(self) -> None:
        if not (0.0 <= self.airspeed_fraction < 1.0 and self.altitude_m >= 0.0):
            raise ValueError(f"a neighbourhood is 0 to 1 of the airspeed and 0 m or more, got {self}")

    def holds(self, query: NDArray[np.float64], nearest: NDArray[np.float64]) -> bool:
        """Whether a query (airspeed, altitude) is near enough to the hull's nearest point."""
        airspeed_m_s, altitude_m = np.abs(query - nearest)
        slack = 1e-9  # a limit typed as 1.15 V must not fail by its last bit
        return bool(
            airspeed_m_s <= self.airspeed_fraction * nearest[0] + slack * nearest[0]
            and altitude_m <= self.altitude_m + slack * max(1.0, abs(float(nearest[1])))
        )


MEASURED = Neighbourhood()
"""Around entries that were measured or stated at some flight conditions."""

DECLARED = Neighbourhood(0.0, 0.0)
"""Around entries that span an envelope whose limits are declared."""

UNSCALED = Neighbourhood(0.05, 500.0)
"""Around entries that cannot be carried, because the aircraft's file lacks geometry or mass."""


def american(
    value: NDArray[np.float64],
    covariance: NDArray[np.float64],
    structure: ModeStructure,
    aircraft: Aircraft,
    condition: FlightCondition,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Concise value (k,) and covariance (k, k) in American non-dimensional (effective) coordinates.

    Raises:
        AircraftDataError: the aircraft's file lacks what the conversion needs.
    """
    scale, offset = affine(structure, aircraft, condition, Convention.AMERICAN)
    return (value - offset) / scale, covariance / (scale[:, None] * scale)


def concise(
    value: NDArray[np.float64],
    covariance: NDArray[np.float64],
    structure: ModeStructure,
    aircraft: Aircraft,
    condition: FlightCondition,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Inverse of ``american``."""
    scale, offset = affine(structure, aircraft, condition, Convention.AMERICAN)
    return scale * value + offset, covariance * (scale[:, None] * scale)


def empirical(expectation: Expectation, reference: Reference, aircraft: Aircraft) -> Expectation:
    """The expectation after this aircraft's own flights, at the same condition; unchanged before the first.

    Raises:
        AircraftDataError: the aircraft's file lacks what carrying the reference needs.
    """
    if reference.blocks == 0:
        return expectation
    e = expectation
    prior = american(e.value, e.covariance, e.structure, aircraft, e.condition)
    value, covariance = concise(*reference.posterior(*prior), e.structure, aircraft, e.condition)
    return Expectation(
        e.structure,
        value,
        covariance,
        max(e.provenance, Provenance.EMPIRICAL, key=_WEAKEST_FIRST.index),
        e.condition,
        f"{e.source}; with {reference.seconds:.0f} s of this aircraft's own flights",
    )


class Envelope:
    """Expectations of one structure in one configuration, over the points where entries stand.

    Args:
        aircraft: whose mass and geometry carry entries between flight conditions.
        structure: of every entry.
        points: the entries, each at its own flight condition; without any, every lookup is refused.
        configuration: of every entry.
        neighbourhood: how far outside the points' hull lookups are still answered.
        absent: the sentence an envelope without points refuses with.

    Raises:
        ValueError: an entry of another structure or configuration, or two at the same point.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        structure: ModeStructure,
        points: Sequence[Expectation],
        *,
        configuration: str = "clean",
        neighbourhood: Neighbourhood = MEASURED,
        absent: str = "",
    ) -> None:
        for p in points:
            if p.structure != structure or p.condition.configuration != configuration:
                raise ValueError(
                    f"an envelope of {structure.name} in configuration {configuration!r} cannot hold "
                    f"an entry of {p.structure.name} in configuration {p.condition.configuration!r}"
                )
        self.aircraft = aircraft
        self.structure = structure
        self.points = tuple(points)
        self.configuration = configuration
        self.neighbourhood = neighbourhood
        self._absent = absent or f"nothing is expected of {structure.name} in {configuration!r} yet"
        self._why_unscaled = ""
        if points:
            self._prepare()

    def at_loading(self, aircraft: Aircraft) -> "Envelope":
        """The same entries at the mass and centre of gravity of another loading of the aircraft (``aircraft.carried``).

        Raises:
            AircraftDataError: the aircraft's file lacks [mass] or [geometry].
        """
        points = []
        for p in self.points:
            value, covariance, condition = carried(
                p.value, p.covariance, self.structure, p.condition, (self.aircraft, aircraft)
            )
            points.append(replace(p, value=value, covariance=covariance, condition=condition))
        return Envelope(
            aircraft, self.structure, points, configuration=self.configuration,
            neighbourhood=self.neighbourhood, absent=self._absent,
        )  # fmt: skip

    def _prepare(self) -> None:
        places = np.array([_place(p.condition) for p in self.points])
        try:
            carried = [
                american(p.value, p.covariance, self.structure, self.aircraft, p.condition)
                for p in self.points
            ]
        except AircraftDataError as error:
            self._why_unscaled = str(error)
            self.neighbourhood = UNSCALED
            carried = [(p.value, p.covariance) for p in self.points]
        else:
            self._form = AffineForm(self.structure, self.aircraft)
        self._places = places
        self._values = np.array([value for value, _ in carried])
        self._covariances = np.array([covariance.ravel() for _, covariance in carried])  # (points, k k)
        self._alphas = np.array([p.condition.angle_of_attack_rad for p in self.points])
        self._carry_share = np.array(
            [1.0 if s in LIFT_PROPORTIONAL else CARRY_SHARE for s in self.structure.derivatives]
        )
        self._interpolator = interpolator(places, self._values)

    @property
    def limits(self) -> str:
        """Where lookups are answered, for the reader."""
        if not self.points:
            return "nowhere"
        (v_low, h_low), (v_high, h_high) = self._places.min(axis=0), self._places.max(axis=0)
        n = self.neighbourhood
        airspeed = f"{v_low * (1 - n.airspeed_fraction):.4g} to {v_high * (1 + n.airspeed_fraction):.4g} m/s"
        return f"{airspeed} and {h_low - n.altitude_m:.0f} to {h_high + n.altitude_m:.0f} m"

    def angle_of_attack_rad(self, airspeed_true_m_s: float, altitude_m: float) -> float | None:
        """Steady angle of attack interpolated from the entries, for aircraft without a vane; None outside."""
        query = np.array([airspeed_true_m_s, altitude_m])
        placement = self._placement(query)
        return None if placement is None else float(placement.weights @ self._alphas)

    def lookup(self, condition: FlightCondition) -> Expectation | OutOfEnvelope:
        """The expectation at a flight condition, or why there is none; nothing is ever extrapolated."""
        if not self.points:
            return OutOfEnvelope(self._absent)
        if condition.configuration != self.configuration:
            return OutOfEnvelope(
                f"the baseline of {self.structure.name} is for configuration {self.configuration!r}, "
                f"but the aircraft flies in {condition.configuration!r}; add entries for that configuration"
            )
        query = np.array(_place(condition))
        placement = self._placement(query)
        if placement is None:
            return OutOfEnvelope(
                f"{query[0]:.4g} m/s at {query[1]:.0f} m is outside the baseline of {self.structure.name}, "
                f"which covers {self.limits}; it is not extrapolated"
            )
        if self._why_unscaled:
            return self._unscaled(int(np.argmax(placement.weights)), condition)
        return self._carried(placement, condition)

    def _placement(self, query: NDArray[np.float64]) -> Placement | None:
        """None where no lookup is answered."""
        if not self.points or not np.isfinite(query).all():
            return None
        if self._why_unscaled:
            return self._nearest_entry(query)
        placement = self._interpolator.place(query)
        return placement if self.neighbourhood.holds(query, placement.nearest) else None

    def _nearest_entry(self, query: NDArray[np.float64]) -> Placement | None:
        """The whole weight on one entry whose neighbourhood holds the query."""
        n = self.neighbourhood
        reach = np.column_stack(
            (n.airspeed_fraction * self._places[:, 0], np.full(len(self.points), n.altitude_m))
        )
        nearest = int(np.argmin(np.max(np.abs(query - self._places) / reach, axis=1)))
        if not n.holds(query, self._places[nearest]):
            return None
        weights = np.zeros(len(self.points))
        weights[nearest] = 1.0
        return Placement(weights, self._places[nearest], np.zeros(self._values.shape[1]))

    def _carried(self, placement: Placement, condition: FlightCondition) -> Expectation:
        """Interpolated in non-dimensional form, then made concise at the condition."""
        value = placement.weights @ self._values
        carried = self._carry_share * np.abs(value) * _lift_change(condition, placement.nearest)
        covariance = (placement.weights @ self._covariances).reshape(value.size, value.size)
        covariance.flat[:: value.size + 1] += placement.curvature_bound**2 + carried**2
        scale, offset = self._form.at(condition)
        used = [p for p, w in zip(self.points, placement.weights, strict=True) if w > 0.0]
        return Expectation(
            self.structure,
            scale * value + offset,
            covariance * (scale[:, None] * scale),
            min((p.provenance for p in used), key=_WEAKEST_FIRST.index),
            condition,
            "; ".join(dict.fromkeys(p.source for p in used)),
        )

    def _unscaled(self, entry: int, condition: FlightCondition) -> Expectation:
        """The entry as it stands, with the error of not scaling it as one more standard error.

        The parts of a concise derivative go with V, ρV or ρV^2 (thesis tables B.3 and B.4).
        """
        p = self.points[entry]
        airspeed = condition.airspeed_true_m_s / p.condition.airspeed_true_m_s
        density = condition.air_density_kg_m3 / p.condition.air_density_kg_m3
        off = max(abs(r - 1.0) for r in (airspeed, density * airspeed, density * airspeed**2))
        return Expectation(
            self.structure,
            p.value,
            p.covariance + np.diag((off * p.value) ** 2),
            p.provenance,
            condition,
            f"{p.source}; not scaled to this airspeed and density, because {self._why_unscaled}",
        )


def _place(condition: FlightCondition) -> tuple[float, float]:
    return condition.airspeed_true_m_s, condition.altitude_m


def _lift_change(condition: FlightCondition, nearest: NDArray[np.float64]) -> float:
    """Relative change of the lift coefficient of level flight against the hull's nearest point; 0 inside."""
    airspeed_m_s, altitude_m = (float(x) for x in nearest)
    if (airspeed_m_s, altitude_m) == _place(condition):
        return 0.0
    there, here = isa_density_kg_m3(np.array([altitude_m, condition.altitude_m]))
    return abs(float(there * airspeed_m_s**2 / (here * condition.airspeed_true_m_s**2)) - 1.0)
