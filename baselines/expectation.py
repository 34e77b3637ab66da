"""The expectation of a structure's derivatives at any point of an envelope, with its standard error.

Entries are carried to the wanted flight condition through the American non-dimensional form
(``wingwatch.aircraft.affine``), where little depends on airspeed and density, and interpolated there. Rules
and derivations: docs/decisions/0011-baseline-envelope.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import blake2b

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
from wingwatch.baselines.interpolation import Placements, interpolator
from wingwatch.baselines.reference import Reference

__all__ = [
    "DECLARED",
    "Envelope",
    "Expectation",
    "MEASURED",
    "Neighbourhood",
    "OutOfEnvelope",
    "UNSCALED",
    "WEAKEST_FIRST",
    "american",
    "concise",
    "empirical",
]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

CARRY_SHARE = 0.03
"""Standard error of an American derivative carried outside the hull, as a share of its value and of the
relative change of trim lift coefficient: what the library's linearised coefficients lose at most."""

LIFT_PROPORTIONAL = frozenset(("l_r", "n_p"))
"""Derivatives that strip theory makes proportional to the lift coefficient: their share is 1."""

WEAKEST_FIRST = (Provenance.A_PRIORI, Provenance.EMPIRICAL, Provenance.IDENTIFIED)
"""Provenances from the weakest to the strongest."""


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
    value: Array
    covariance: Array
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
    def standard_error(self) -> Array:
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

    def holds(self, queries: Array, nearest: Array) -> Flags:
        """Whether queries (airspeed, altitude), (m, 2), are near enough to the hull's nearest points, (m,)."""
        off = np.abs(queries - nearest)
        slack = 1e-9  # a limit typed as 1.15 V must not fail by its last bit
        by_airspeed = off[:, 0] <= (self.airspeed_fraction + slack) * nearest[:, 0]
        by_altitude = off[:, 1] <= self.altitude_m + slack * np.maximum(1.0, np.abs(nearest[:, 1]))
        return np.asarray(by_airspeed & by_altitude)


MEASURED = Neighbourhood()
"""Around entries that were measured or stated at some flight conditions."""

DECLARED = Neighbourhood(0.0, 0.0)
"""Around entries that span an envelope whose limits are declared."""

UNSCALED = Neighbourhood(0.05, 500.0)
"""Around entries that cannot be carried, because the aircraft's file lacks geometry or mass."""


def american(
    value: Array,
    covariance: Array,
    structure: ModeStructure,
    aircraft: Aircraft,
    condition: FlightCondition,
) -> tuple[Array, Array]:
    """Concise value (k,) and covariance (k, k) in American non-dimensional (effective) coordinates.

    Raises:
        AircraftDataError: the aircraft's file lacks what the conversion needs.
    """
    scale, offset = affine(structure, aircraft, condition, Convention.AMERICAN)
    return (value - offset) / scale, covariance / (scale[:, None] * scale)


def concise(
    value: Array,
    covariance: Array,
    structure: ModeStructure,
    aircraft: Aircraft,
    condition: FlightCondition,
) -> tuple[Array, Array]:
    """Inverse of ``american``: values (k,) and covariance (k, k) from American to concise units at the condition."""
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
        max(e.provenance, Provenance.EMPIRICAL, key=WEAKEST_FIRST.index),
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

    Attributes:
        absent: that sentence.

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
        self.absent = absent or f"nothing is expected of {structure.name} in {configuration!r} yet"
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
            neighbourhood=self.neighbourhood, absent=self.absent,
        )  # fmt: skip

    def _prepare(self) -> None:
        places = _places([p.condition for p in self.points])
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

    @cached_property
    def content(self) -> bytes:
        """A digest of the entries and of where they are trusted: envelopes of one aircraft that have the same give the
        same answers."""
        digest = blake2b(
            repr((self.structure.name, self.configuration, self.neighbourhood, self.absent)).encode()
        )
        for p in self.points:
            digest.update(repr((p.condition, str(p.provenance), p.source)).encode())
            digest.update(p.value.tobytes() + p.covariance.tobytes())
        return digest.digest()

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
        if not self.points:
            return None
        placements, answered = self._placed(np.array([[airspeed_true_m_s, altitude_m]]))
        return float(placements.weights[0] @ self._alphas) if answered[0] else None

    def lookup(self, condition: FlightCondition) -> Expectation | OutOfEnvelope:
        """The expectation at a flight condition, or why there is none; nothing is ever extrapolated."""
        if not self.points:
            return OutOfEnvelope(self.absent)
        if condition.configuration != self.configuration:
            return OutOfEnvelope(
                f"the baseline of {self.structure.name} is for configuration {self.configuration!r}, "
                f"but the aircraft flies in {condition.configuration!r}; add entries for that configuration"
            )
        query = _places([condition])
        placements, answered = self._placed(query)
        if not answered[0]:
            return OutOfEnvelope(
                f"{query[0, 0]:.4g} m/s at {query[0, 1]:.0f} m is outside the baseline of {self.structure.name}, "
                f"which covers {self.limits}; it is not extrapolated"
            )
        weights = placements.weights[0]
        if self._why_unscaled:
            return self._unscaled(int(np.argmax(weights)), condition)
        value, covariance = self._carried(placements, [condition])
        used = [p for p, w in zip(self.points, weights, strict=True) if w > 0.0]
        return Expectation(
            self.structure,
            value[0],
            covariance[0],
            min((p.provenance for p in used), key=WEAKEST_FIRST.index),
            condition,
            "; ".join(dict.fromkeys(p.source for p in used)),
        )

    def values_at(self, conditions: Sequence[FlightCondition]) -> tuple[Array, Array]:
        """What ``lookup`` finds at m conditions, concise: value (m, k) and covariance (m, k, k), NaN where nothing."""
        k = len(self.structure.derivatives)
        value, covariance = np.full((len(conditions), k), np.nan), np.full((len(conditions), k, k), np.nan)
        here = [m for m, c in enumerate(conditions) if c.configuration == self.configuration]
        if not self.points or not here:
            return value, covariance
        there = [conditions[m] for m in here]
        placements, answered = self._placed(_places(there))
        if self._why_unscaled:
            found = [
                self._unscaled(int(np.argmax(w)), c) for w, c in zip(placements.weights, there, strict=True)
            ]
            value[here] = [e.value for e in found]
            covariance[here] = [e.covariance for e in found]
        else:
            value[here], covariance[here] = self._carried(placements, there)
        beyond = np.array(here)[~answered]
        value[beyond], covariance[beyond] = np.nan, np.nan
        return value, covariance

    def _placed(self, queries: Array) -> tuple[Placements, Flags]:
        """Where queries (m, 2) stand among the entries, and which of them are answered, (m,)."""
        sound = np.asarray(np.all(np.isfinite(queries), axis=1))
        queries = np.where(sound[:, None], queries, self._places[0])
        placements = (
            self._nearest_entries(queries) if self._why_unscaled else self._interpolator.place(queries)
        )
        return placements, sound & self.neighbourhood.holds(queries, placements.nearest)

    def _nearest_entries(self, queries: Array) -> Placements:
        """For each query the whole weight on one entry, the nearest as neighbourhoods reach."""
        n = self.neighbourhood
        reach = np.column_stack(
            (n.airspeed_fraction * self._places[:, 0], np.full(len(self.points), n.altitude_m))
        )
        off = np.abs(queries[:, None] - self._places) / reach
        nearest = np.argmin(off.max(axis=2), axis=1)
        weights = np.zeros((len(queries), len(self.points)))
        weights[np.arange(len(queries)), nearest] = 1.0
        return Placements(weights, self._places[nearest], np.zeros((len(queries), self._values.shape[1])))

    def _carried(self, placements: Placements, conditions: Sequence[FlightCondition]) -> tuple[Array, Array]:
        """Interpolated in non-dimensional form, then made concise at the conditions: (m, k) and (m, k, k)."""
        each = placements.weights[:, None]  # a product for each condition: its rounding is not its company's
        value, k = (each @ self._values)[:, 0], self._values.shape[1]
        lift_change = _lift_change(_places(conditions), placements.nearest)
        carried = self._carry_share * np.abs(value) * lift_change[:, None]
        covariance = (each @ self._covariances).reshape(-1, k, k)
        covariance[:, range(k), range(k)] += placements.curvature_bound**2 + carried**2
        scale, offset = self._form.at(conditions)
        return scale * value + offset, covariance * (scale[:, :, None] * scale[:, None, :])

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


def _places(conditions: Sequence[FlightCondition]) -> Array:
    """Airspeeds and altitudes, (m, 2)."""
    return np.array([(c.airspeed_true_m_s, c.altitude_m) for c in conditions])


def _lift_change(queries: Array, nearest: Array) -> Array:
    """Relative change of the lift coefficient of level flight against the hull's nearest point, (m,); 0 inside."""
    if np.array_equal(queries, nearest):
        return np.zeros(len(queries))
    here, there = (isa_density_kg_m3(place[:, 1]) * place[:, 0] ** 2 for place in (queries, nearest))
    inside = np.all(queries == nearest, axis=1)
    return np.where(inside, 0.0, np.abs(there / here - 1.0))
