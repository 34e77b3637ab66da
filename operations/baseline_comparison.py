"""What is expected of a structure at one flight condition beside what a vehicle's flights taught, and how far apart.

Coordinates, prior and posterior are those that the monitor compares in; here nothing is tested and nothing learned. The
monitor itself is loaded for aircraft without geometry or mass alone: its kernels take seconds, and a look does not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Affine, AffineForm, Aircraft, AircraftDataError, FlightCondition, ModeStructure
from wingwatch.baselines import Envelope, Expectation, OutOfEnvelope, Reference, posteriors
from wingwatch.baselines.reference import MAX_CONDITION

__all__ = ["Distance", "Estimated", "SideBySide", "affine_at", "side_by_side"]

Array = NDArray[np.float64]

_UNDETERMINED = 1e-6
"""Share of a derivative that may lie in directions that no flight has excited, while it counts as known."""


@dataclass(frozen=True, slots=True)
class Estimated:
    """Concise derivatives with standard errors, (k,) each; NaN where nothing is known."""

    value: Array
    standard_error: Array


@dataclass(frozen=True, slots=True)
class Distance:
    """How far an expectation and flights are apart, by the covariance of both together.

    Attributes:
        z: of each derivative, difference over joint standard error, (k,); NaN where flights say nothing of it.
        squared: Mahalanobis distance of all derivatives together, squared.
        freedom: directions that flights have excited.
        probability: of a distance so large or larger where both are right.
    """

    z: Array
    squared: float
    freedom: int
    probability: float


@dataclass(frozen=True, slots=True)
class SideBySide:
    """One structure at one condition.

    Attributes:
        a_priori: by the aircraft's file.
        stored: by the entries of the database; None where it has none.
        flights: by the vehicle's flights alone; None where it has taught nothing.
        expected: what the monitor compares with, flights included; None where there is no expectation.
        distance: between flights and the expectation without them.
    """

    structure: ModeStructure
    condition: FlightCondition
    a_priori: Expectation | OutOfEnvelope
    stored: Expectation | OutOfEnvelope | None
    flights: Estimated | None
    expected: Estimated | None
    distance: Distance | None


def affine_at(structure: ModeStructure, aircraft: Aircraft, conditions: Sequence[FlightCondition]) -> Affine:
    """The coordinates in which references are kept, at m conditions (``monitor.comparison.Coordinates``)."""
    try:
        form = AffineForm(structure, aircraft)
    except AircraftDataError:
        from wingwatch.monitor.detection.comparison import Coordinates

        nominal = aircraft.nominal_condition
        reference = (nominal.airspeed_true_m_s, nominal.air_density_kg_m3) if nominal else (1.0, 1.0)
        return Affine(*Coordinates(structure, aircraft, reference).at_each(conditions)[:2])
    return form.at(conditions)


def side_by_side(
    a_priori: Envelope, stored: Envelope | None, reference: Reference | None, condition: FlightCondition
) -> SideBySide:
    """Set expectation and flights side by side.

    Args:
        a_priori: of the aircraft's file, at the stated loading.
        stored: of the database's entries; it goes before the file.
        reference: what the vehicle's flights taught.
        condition: where.
    """
    structure, by_file = a_priori.structure, a_priori.lookup(condition)
    entries = None if stored is None else stored.lookup(condition)
    prior = by_file if entries is None else entries
    flown = reference if reference is not None and reference.blocks else None
    each = affine_at(structure, a_priori.aircraft, [condition])
    conversion = Affine(each.scale[0], each.offset[0])
    flights = None if flown is None else _alone(flown, conversion)
    expected = distance = None
    if isinstance(prior, Expectation):
        before = conversion.from_concise(prior.value, prior.covariance)
        after = before if flown is None else posteriors(*before, flown.information, flown.vector)
        value, covariance = conversion.to_concise(*after)
        expected = Estimated(value, np.sqrt(np.diagonal(covariance)))
        if flown is not None and flights is not None:
            joint = np.hypot(prior.standard_error, flights.standard_error)
            distance = _distance(before, flown, (flights.value - prior.value) / joint)
    return SideBySide(structure, condition, by_file, entries, flights, expected, distance)


def _alone(reference: Reference, conversion: Affine) -> Estimated:
    """Value and standard error of each derivative that the flights alone determine, whatever else they leave open."""
    information = reference.information
    diagonal = np.diagonal(information)
    scale = np.where(diagonal > 0.0, 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)), 0.0)
    w, u = np.linalg.eigh(information * np.outer(scale, scale))
    seen = w * MAX_CONDITION >= w[-1]
    root = scale[:, None] * u[:, seen] / np.sqrt(w[seen])
    covariance = root @ root.T
    value, covariance = conversion.to_concise(covariance @ reference.vector, covariance)
    known = (diagonal > 0.0) & (np.sum(np.square(u[:, ~seen]), axis=1) <= _UNDETERMINED)
    error = np.sqrt(np.diagonal(covariance))
    return Estimated(np.where(known, value, np.nan), np.where(known, error, np.nan))


def _distance(prior: tuple[Array, Array], flown: Reference, z: Array) -> Distance:
    """The distance of all derivatives, in directions that flights have excited alone.

    With J and h of the flights and N(mu, L) of the expectation: K = (J^-1 + L)^-1 = (I + J L)^-1 J and
    K d = (I + J L)^-1 (h - J mu), so that J may be singular, as in ``monitor.comparison``.
    """
    value, covariance = prior
    inner = np.eye(value.size) + flown.information @ covariance
    innovation = flown.vector - flown.information @ value
    solved = np.linalg.solve(inner, np.column_stack([flown.information, innovation]))
    precision, vector = 0.5 * (solved[:, :-1] + solved[:, :-1].T), solved[:, -1]
    freedom = int(np.linalg.matrix_rank(precision, tol=1e-9 * np.trace(precision) + 1e-300))
    squared = float(vector @ np.linalg.pinv(precision, hermitian=True) @ vector)
    return Distance(z, squared, freedom, chi_square_tail(squared, freedom) if freedom else 1.0)


def chi_square_tail(squared: float, freedom: int) -> float:
    """Probability that chi-square of some degrees of freedom is larger (Abramowitz and Stegun, 26.4.4 and 26.4.5).

    A finite sum, for which the command needs no SciPy: that takes longer to load than the question to answer.
    """
    half = 0.5 * max(squared, 0.0)
    odd = freedom % 2
    total = math.erfc(math.sqrt(half)) if odd else 0.0
    term = math.exp(-half) * (math.sqrt(half / math.pi) * 2.0 if odd else 1.0)
    for k in range(freedom // 2):
        total += term
        term *= half / (k + (1.5 if odd else 1.0))
    return min(1.0, total)
