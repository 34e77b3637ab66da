"""Comparison: what a window of blocks says of a change since its onset, with the covariance of both sides.

Coordinates are those in which derivatives hardly depend on the flight condition (American non-dimensional; where the
aircraft file lacks mass or geometry, referred to the nominal condition), so blocks at different airspeeds add. A
block's derivatives may differ from the mean by Q for reasons the linear model does not know: J becomes (J^-1 + Q)^-1.
Blocks before the onset and the expectation make the reference N(mu, L); blocks after it, with information J and vector
h, a change d with

    K = (J^-1 + L + b b')^-1,        K d = (I + J (L + b b'))^-1 (h - J mu)

without inverting J, which is singular where nothing was excited; b is the difference of the biases that gusts are
expected to have caused in the window and in the reference.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from wingwatch.aircraft import Affine, AffineForm, Aircraft, AircraftDataError, FlightCondition, ModeStructure
from wingwatch.estimators import offsets, referred_scale
from wingwatch.estimators.kernels.symmetric import cholesky, forward
from wingwatch.kernels.decorators import whole

__all__ = [
    "Along",
    "Change",
    "Conversion",
    "Coordinates",
    "along",
    "bias_of",
    "change_since",
    "log_bayes_any",
    "log_bayes_direction",
    "without_bias",
]

Array = NDArray[np.float64]

_LEAST_PIVOT = 0.5
"""Of I and a positive semidefinite matrix, whose pivots are one at least but for rounding."""

_RIDGE = 1e-12
"""Of a derivative's own information: what is below it is rounding."""

_NO_INFORMATION = 1e-280
"""Smaller numbers lose their digits, and a ridge of them is nothing."""


class Conversion(NamedTuple):
    """From the coordinates of one structure to others and back, one derivative at a time, at one flight condition or at
    each of several: axes in front of those below.

    Attributes:
        scale, offset: ``concise = scale * coordinate + offset``, (k,) each.
        slope, shift: ``referred = slope * coordinate + shift``, as the estimators refer derivatives, (k,) each.
    """

    scale: Array
    offset: Array
    slope: Array
    shift: Array

    def from_concise(self, value: Array, covariance: Array) -> tuple[Array, Array]:
        """A concise value (k,) and its covariance (k, k) in these coordinates."""
        return Affine(self.scale, self.offset).from_concise(value, covariance)

    def to_concise(self, value: Array, covariance: Array) -> tuple[Array, Array]:
        """Inverse of ``from_concise``: a concise value (k,) and its covariance (k, k)."""
        return Affine(self.scale, self.offset).to_concise(value, covariance)

    def of_evidence(self, information: Array, vector: Array) -> tuple[Array, Array]:
        """Information (k, k) and vector (k,) about referred (concise) derivatives, in these coordinates."""
        both = self.slope[:, None] * self.slope
        return information * both, self.slope * (vector - information @ self.shift)

    def to_evidence(self, information: Array, vector: Array) -> tuple[Array, Array]:
        """Inverse of ``of_evidence``: information (k, k) and vector (k,) about referred (concise) derivatives."""
        known = information / (self.slope[:, None] * self.slope)
        return known, vector / self.slope + known @ self.shift


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The coordinates of one structure of one aircraft.

    Attributes:
        reference: (airspeed_true_m_s, air_density_kg_m3) to which the estimators refer derivatives.
    """

    structure: ModeStructure
    aircraft: Aircraft
    reference: tuple[float, float]
    _form: AffineForm | None = field(init=False, repr=False, compare=False, default=None)

    def __post_init__(self) -> None:
        try:
            form = AffineForm(self.structure, self.aircraft)
        except AircraftDataError:
            return
        object.__setattr__(self, "_form", form)

    def at(self, condition: FlightCondition) -> Conversion:
        """What they are at a flight condition."""
        return Conversion(*(part[0] for part in self.at_each([condition])))

    def at_each(self, conditions: Sequence[FlightCondition]) -> Conversion:
        """What they are at each of m flight conditions."""
        speed = np.array([c.airspeed_true_m_s for c in conditions])
        density = np.array([c.air_density_kg_m3 for c in conditions])
        referred = referred_scale(self.structure, speed, density, self.reference)
        if self._form is None:
            alpha = np.array([c.angle_of_attack_rad for c in conditions])
            kinematic = offsets(self.structure, speed, alpha)
            return Conversion(referred, kinematic, np.ones_like(referred), np.zeros_like(referred))
        scale, offset = self._form.at(conditions)
        shift = (offset - self._form.kinematic(conditions)) / referred
        return Conversion(scale, offset, scale / referred, shift)


@dataclass(frozen=True, slots=True)
class Change:
    """A change of one structure's derivatives since an onset, or since each of several: axes in front of those below.

    Attributes:
        precision: K, shape (..., k, k): inverse covariance of the change, zero where nothing is known.
        score: K d, shape (..., k).
        information, vector: J and h of the window, for the estimate after the onset.
        mean, covariance: the reference before it.
        natural: natural size of each derivative, (..., k).
    """

    precision: Array = field(metadata={"stored": "weight"})
    score: Array = field(metadata={"stored": "pull"})
    information: Array
    vector: Array
    mean: Array
    covariance: Array
    natural: Array

    def at(self, place: tuple[int, ...]) -> "Change":
        """One of several changes, by its place in the axes in front; a copy, which does not keep the others."""
        return Change(*(np.array(getattr(self, f.name)[place]) for f in fields(Change)))


def _solved(inner: Array, precision: Array, score: Array) -> tuple[Array, Array]:
    """(I + J Q)^-1 times an information matrix and a vector; the first is symmetric but for rounding."""
    solved = np.linalg.solve(inner, np.concatenate([precision, score[..., None]], axis=-1))
    reduced = solved[..., :-1]
    return 0.5 * (reduced + np.swapaxes(reduced, -1, -2)), solved[..., -1]


def natural_size(value: Array, covariance: Array) -> Array:
    """Natural size of each derivative (k,): its expectation, or where that is near zero, two of its standard errors."""
    return np.asarray(np.maximum(np.abs(value), 2.0 * np.sqrt(np.diagonal(covariance))))


def blurred(information: Array, vector: Array, bias: Array, variance: Array) -> tuple[Array, Array, Array]:
    """A block's evidence, (J^-1 + Q)^-1 and its products, when its derivatives may also differ from the mean by
    ``variance`` (k,)."""
    inner = np.eye(variance.size) + information * variance
    solved = np.linalg.solve(inner, np.column_stack([information, vector, bias]))
    reduced = np.asarray(solved[:, :-2], dtype=np.float64)
    return 0.5 * (reduced + reduced.T), np.asarray(solved[:, -2]), np.asarray(solved[:, -1])


def bias_of(information: Array, pushed: Array) -> Array:
    """A bias b from J b, (..., k), with J (..., k, k): of what J does not see of it the result does not matter.

    Whatever uses b multiplies it by J, so J may be singular, and a ridge of ``_RIDGE`` of each derivative's own
    information changes nothing but what J does not see.
    """
    if not pushed.any():
        return np.zeros_like(pushed)
    own = np.diagonal(information, axis1=-2, axis2=-1)
    solid = information.copy()
    np.einsum("...ii->...i", solid)[...] += np.where(own > _NO_INFORMATION, _RIDGE * own, 1.0)
    return np.asarray(np.linalg.solve(solid, pushed[..., None])[..., 0])


def without_bias(information: Array, vector: Array, pushed: Array) -> tuple[Array, Array]:
    """Evidence J (k, k), h (k,) with the bias b that gusts may have caused, given as J b, as one more error:
    (J^-1 + b b')^-1 and its vector."""
    bias = bias_of(information, pushed)
    grown = 1.0 + float(bias @ pushed)
    reduced = information - np.outer(pushed, pushed) / grown
    return reduced, vector - pushed * float(bias @ vector) / grown


def informative_part(information: Array, vector: Array, natural: Array) -> tuple[Array, Array]:
    """Of a difference of two states of knowledge, (k, k) and (k,), what is known better than a natural size by it.

    What was learned and what was taken back for better reasons are both in such a difference, so some directions have
    lost, and of what is left of little the value is not to be trusted.
    """
    w, u = np.linalg.eigh(information * (natural[:, None] * natural))
    kept = u[:, w > 1.0] / natural[:, None]
    shown = (u[:, w > 1.0] * natural[:, None]).T @ vector
    return (kept * w[w > 1.0]) @ kept.T, kept @ shown


def change_since(
    mean: Array, covariance: Array, information: Array, vector: Array, model_error: Array, natural: Array
) -> Change:
    """The change that a window of blocks shows against a reference, or each of several windows against its own.

    Args:
        mean, covariance: reference, (..., k) and (..., k, k).
        information, vector: sums over the window's blocks, (..., k, k) and (..., k).
        model_error: covariance of what gusts may make of an unchanged aircraft, (..., k, k).
        natural: natural size of each derivative, (..., k).
    """
    inner = np.eye(mean.shape[-1]) + information @ (covariance + model_error)
    known = (information @ mean[..., None])[..., 0]
    precision, score = _solved(inner, information, vector - known)
    return Change(precision, score, information, vector, mean, covariance, natural)


def log_bayes_direction(
    score: Array | float, precision: Array | float, size_std: Array | float
) -> tuple[Array, Array, Array]:
    """Log Bayes factor of "a change of some positive size along a direction" against "no change".

    The size is half-normal with standard deviation ``size_std``; the integral of the likelihood is exact.

    Returns:
        log Bayes factor, size (posterior mode, not below zero) and its standard error, each of the shape that
        the arguments have together.
    """
    variance = np.asarray(1.0 / (precision + size_std**-2))
    mode = variance * score
    error = np.sqrt(variance)
    log_factor = np.log(error / size_std) + 0.5 * mode * score + np.log(2.0) + log_ndtr(mode / error)
    return log_factor, np.maximum(mode, 0.0), error


def log_bayes_any(change: Change, spread: Array) -> Array:
    """Log Bayes factor of "every derivative may have changed", each N(0, spread^2), against "no change", (...)."""
    nothing = np.zeros((1, *spread.shape))
    return np.asarray(along(change, nothing, spread[None]).log_factor[0])


class Along(NamedTuple):
    """What a change says along directions that each derivative may be off, (n, ...) each.

    Attributes:
        score, precision: a'K d and a'K a of each direction a.
        log_factor: log Bayes factor of derivatives that are off against none that is.
    """

    score: Array
    precision: Array
    log_factor: Array


def along(change: Change, directions: Array, spread: Array) -> Along:
    """What a change says along directions, each derivative of which may be off by N(0, spread^2).

    With D the diagonal of ``spread`` and B = I + D K D, the change seen through that is K - K D B^-1 D K, and the
    factor -log det B / 2 + (D K d)' B^-1 (D K d) / 2.

    Args:
        directions, spread: (n, ..., k); a spread of zero is an exact direction.
    """
    k = directions.shape[-1]
    found = np.empty((3, *directions.shape[:-1]))
    _all_along(
        np.ascontiguousarray(change.precision).reshape(-1, k, k),
        np.ascontiguousarray(change.score).reshape(-1, k),
        np.ascontiguousarray(directions).reshape(len(directions), -1, k),
        np.ascontiguousarray(spread).reshape(len(directions), -1, k),
        found.reshape(3, len(directions), -1),
    )
    return Along(*found)


@whole
def _all_along(precision, score, directions, spread, found):  # type: ignore[no-untyped-def]
    """``along``, into ``found`` (3, n, m): K (m, k, k) and K d (m, k) of m changes, directions and spread (n, m, k)."""
    n, m, k = directions.shape
    root, rows, across = np.empty((k, k)), np.empty((k, 2)), np.empty(k)
    for i in range(n):
        for j in range(m):
            own, scored, a, d = precision[j], score[j], directions[i, j], spread[i, j]
            total = moved = factor = 0.0
            for r in range(k):
                across[r] = 0.0
                for c in range(k):
                    across[r] += own[r, c] * a[c]
                total += a[r] * across[r]
                moved += a[r] * scored[r]
            if d.any():
                for r in range(k):
                    for c in range(r + 1):
                        root[r, c] = d[r] * own[r, c] * d[c]
                    root[r, r] += 1.0
                    rows[r, 0], rows[r, 1] = d[r] * across[r], d[r] * scored[r]
                cholesky(root, _LEAST_PIVOT, root)
                forward(root, rows)
                for r in range(k):
                    total -= rows[r, 0] * rows[r, 0]
                    moved -= rows[r, 0] * rows[r, 1]
                    factor += 0.5 * rows[r, 1] * rows[r, 1] - math.log(root[r, r])
            found[0, i, j], found[1, i, j], found[2, i, j] = moved, total, factor
