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

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from wingwatch.aircraft import Aircraft, AircraftDataError, FlightCondition, ModeStructure, affine
from wingwatch.estimators import offsets, referred_scale

__all__ = ["Change", "Coordinates", "change_since", "log_bayes_any", "log_bayes_direction"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The coordinates of one structure of one aircraft.

    Attributes:
        reference: (airspeed_true_m_s, air_density_kg_m3) to which the estimators refer derivatives.
    """

    structure: ModeStructure
    aircraft: Aircraft
    reference: tuple[float, float]

    def to_concise(self, condition: FlightCondition) -> tuple[Array, Array]:
        """(scale, offset) with ``concise = scale * coordinate + offset``, each of shape (k,)."""
        try:
            return affine(self.structure, self.aircraft, condition)
        except AircraftDataError:
            scale = referred_scale(
                self.structure, condition.airspeed_true_m_s, condition.air_density_kg_m3, self.reference
            )
            return scale, offsets(self.structure, condition.airspeed_true_m_s, condition.angle_of_attack_rad)

    def from_concise(
        self, value: Array, covariance: Array, condition: FlightCondition
    ) -> tuple[Array, Array]:
        """A value (k,) and its covariance (k, k) in these coordinates."""
        scale, offset = self.to_concise(condition)
        return (value - offset) / scale, covariance / (scale[:, None] * scale)

    def slope(self, condition: FlightCondition) -> Array:
        """d(referred)/d(coordinate), shape (k,)."""
        scale, _ = self.to_concise(condition)
        return scale / referred_scale(
            self.structure, condition.airspeed_true_m_s, condition.air_density_kg_m3, self.reference
        )

    def of_evidence(
        self, information: Array, vector: Array, condition: FlightCondition
    ) -> tuple[Array, Array]:
        """Information (k, k) and vector (k,) about referred derivatives, in these coordinates."""
        scale, offset = self.to_concise(condition)
        speed, density = condition.airspeed_true_m_s, condition.air_density_kg_m3
        referred = referred_scale(self.structure, speed, density, self.reference)
        kinematic = offsets(self.structure, speed, condition.angle_of_attack_rad)
        slope, shift = scale / referred, (offset - kinematic) / referred
        return information * (slope[:, None] * slope), slope * (vector - information @ shift)

    def to_evidence(
        self, information: Array, vector: Array, condition: FlightCondition
    ) -> tuple[Array, Array]:
        """Inverse of ``of_evidence``: information (k, k) and vector (k,) about referred derivatives."""
        scale, offset = self.to_concise(condition)
        speed, density = condition.airspeed_true_m_s, condition.air_density_kg_m3
        referred = referred_scale(self.structure, speed, density, self.reference)
        kinematic = offsets(self.structure, speed, condition.angle_of_attack_rad)
        slope, shift = scale / referred, (offset - kinematic) / referred
        known = information / (slope[:, None] * slope)
        return known, vector / slope + known @ shift


@dataclass(frozen=True, slots=True)
class Change:
    """A change of one structure's derivatives since an onset, or since each of several: axes in front of those below.

    Attributes:
        weight: K, shape (..., k, k): inverse covariance of the change, zero where nothing is known.
        pull: K d, shape (..., k).
        information, vector: J and h of the window, for the estimate after the onset.
        mean, covariance: the reference before it.
        natural: natural size of each derivative, (..., k).
    """

    weight: Array
    pull: Array
    information: Array
    vector: Array
    mean: Array
    covariance: Array
    natural: Array

    def at(self, place: tuple[int, ...]) -> "Change":
        """One of several changes, by its place in the axes in front."""
        return Change(*(getattr(self, f.name)[place] for f in fields(Change)))

    def loosened(self, spread: Array) -> "Change":
        """The same change seen through additional uncertainty of each derivative, standard deviations (..., k)."""
        inner = np.eye(spread.shape[-1]) + self.weight * spread[..., None, :] ** 2
        weight, pull = _solved(inner, self.weight, self.pull)
        return replace(self, weight=weight, pull=pull)

    def along(self, direction: Array) -> tuple[Array, Array]:
        """(a'K d, a'K a) of a direction a, (..., k)."""
        across = (self.weight @ direction[..., None])[..., 0]
        return (direction * self.pull).sum(axis=-1), (direction * across).sum(axis=-1)


def _solved(inner: Array, weight: Array, pull: Array) -> tuple[Array, Array]:
    """(I + J Q)^-1 times an information matrix and a vector; the first is symmetric but for rounding."""
    solved = np.linalg.solve(inner, np.concatenate([weight, pull[..., None]], axis=-1))
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
    weight, pull = _solved(inner, information, vector - known)
    return Change(weight, pull, information, vector, mean, covariance, natural)


def log_bayes_direction(
    pull: Array | float, weight: Array | float, size_std: Array | float
) -> tuple[Array, Array, Array]:
    """Log Bayes factor of "a change of some positive size along a direction" against "no change".

    The size is half-normal with standard deviation ``size_std``; the integral of the likelihood is exact.

    Returns:
        log Bayes factor, size (posterior mode, not below zero) and its standard error, each of the shape that
        the arguments have together.
    """
    variance = np.asarray(1.0 / (weight + size_std**-2))
    mode = variance * pull
    error = np.sqrt(variance)
    log_factor = np.log(error / size_std) + 0.5 * mode * pull + np.log(2.0) + log_ndtr(mode / error)
    return log_factor, np.maximum(mode, 0.0), error


def log_bayes_any(change: Change, spread: Array) -> Array:
    """Log Bayes factor of "every derivative may have changed", each N(0, spread^2), against "no change", (...)."""
    weight = change.weight * (spread[..., :, None] * spread[..., None, :])
    pull = change.pull * spread
    grown = np.eye(pull.shape[-1]) + weight
    _, log_determinant = np.linalg.slogdet(grown)
    moved = np.linalg.solve(grown, pull[..., None])[..., 0]
    return np.asarray(-0.5 * log_determinant + 0.5 * (pull * moved).sum(axis=-1))
