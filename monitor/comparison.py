"""Comparison: what a window of blocks says of a change since its onset, with the covariance of both sides.

Coordinates are those in which derivatives hardly depend on the flight condition (American non-dimensional; where the
aircraft file lacks mass or geometry, referred to the nominal condition), so blocks at different airspeeds add. A
block's derivatives may wander by Q for reasons the linear model does not know: J becomes (J^-1 + Q)^-1. Blocks
before the onset and the expectation make the reference N(mu, L); blocks after it, with information J and vector h, a
change d with

    K = (J^-1 + L + b b')^-1,        K d = (I + J (L + b b'))^-1 (h - J mu)

without inverting J, which is singular where nothing was excited; b is the difference of the biases that gusts are
expected to have caused in the window and in the reference.
"""

from dataclasses import dataclass, replace

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
        return (value - offset) / scale, covariance / np.outer(scale, scale)

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
        return information * np.outer(slope, slope), slope * (vector - information @ shift)

    def to_evidence(
        self, information: Array, vector: Array, condition: FlightCondition
    ) -> tuple[Array, Array]:
        """Inverse of ``of_evidence``: information (k, k) and vector (k,) about referred derivatives."""
        scale, offset = self.to_concise(condition)
        speed, density = condition.airspeed_true_m_s, condition.air_density_kg_m3
        referred = referred_scale(self.structure, speed, density, self.reference)
        kinematic = offsets(self.structure, speed, condition.angle_of_attack_rad)
        slope, shift = scale / referred, (offset - kinematic) / referred
        known = information / np.outer(slope, slope)
        return known, vector / slope + known @ shift


@dataclass(frozen=True, slots=True)
class Change:
    """A change of one structure's derivatives since an onset.

    Attributes:
        weight: K, shape (k, k): inverse covariance of the change, zero where nothing is known.
        pull: K d, shape (k,).
        information, vector: J and h of the window, for the estimate after the onset.
        mean, covariance: the reference before it.
        natural: natural size of each derivative, (k,).
    """

    weight: Array
    pull: Array
    information: Array
    vector: Array
    mean: Array
    covariance: Array
    natural: Array

    def loosened(self, spread: Array) -> "Change":
        """The same change seen through additional uncertainty of each derivative, standard deviations (k,)."""
        inner = np.eye(spread.size) + self.weight * spread**2
        solved = np.linalg.solve(inner, np.column_stack([self.weight, self.pull]))
        weight = np.asarray(solved[:, :-1], dtype=np.float64)
        return replace(
            self, weight=0.5 * (weight + weight.T), pull=np.asarray(solved[:, -1], dtype=np.float64)
        )

    def along(self, direction: Array) -> tuple[float, float]:
        """(a'K d, a'K a) of a direction a."""
        return float(direction @ self.pull), float(direction @ self.weight @ direction)


def natural_size(value: Array, covariance: Array) -> Array:
    """Natural size of each derivative (k,): its expectation, or where that is near zero, two of its standard errors."""
    return np.asarray(np.maximum(np.abs(value), 2.0 * np.sqrt(np.diagonal(covariance))))


def blurred(information: Array, vector: Array, bias: Array, variance: Array) -> tuple[Array, Array, Array]:
    """A block's evidence when its derivatives may also wander by ``variance`` (k,): (J^-1 + Q)^-1 and its products."""
    inner = np.eye(variance.size) + information * variance
    solved = np.linalg.solve(inner, np.column_stack([information, vector, bias]))
    reduced = np.asarray(solved[:, :-2], dtype=np.float64)
    return 0.5 * (reduced + reduced.T), np.asarray(solved[:, -2]), np.asarray(solved[:, -1])


def change_since(
    mean: Array, covariance: Array, information: Array, vector: Array, model_error: Array, natural: Array
) -> Change:
    """The change that a window of blocks shows against a reference.

    Args:
        mean, covariance: reference, (k,) and (k, k).
        information, vector: sums over the window's blocks, (k, k) and (k,).
        model_error: covariance of what gusts may make of an unchanged aircraft, (k, k).
        natural: natural size of each derivative, (k,).
    """
    spread = covariance + model_error
    inner = np.eye(mean.size) + information @ spread
    solved = np.linalg.solve(inner, np.column_stack([information, vector - information @ mean]))
    weight = np.asarray(solved[:, :-1], dtype=np.float64)
    pull = np.asarray(solved[:, -1], dtype=np.float64)
    return Change(0.5 * (weight + weight.T), pull, information, vector, mean, covariance, natural)


def log_bayes_direction(pull: float, weight: float, size_std: float) -> tuple[float, float, float]:
    """Log Bayes factor of "a change of some positive size along a direction" against "no change".

    The size is half-normal with standard deviation ``size_std``; the integral of the likelihood is exact.

    Returns:
        log Bayes factor, size (posterior mode, not below zero) and its standard error.
    """
    variance = 1.0 / (weight + size_std**-2)
    mode = variance * pull
    error = float(np.sqrt(variance))
    log_factor = np.log(error / size_std) + 0.5 * mode * pull + np.log(2.0) + float(log_ndtr(mode / error))
    return float(log_factor), max(mode, 0.0), error


def log_bayes_any(change: Change, spread: Array) -> float:
    """Log Bayes factor of "every derivative may have changed", each N(0, spread^2), against "no change"."""
    weight = change.weight * np.outer(spread, spread)
    pull = change.pull * spread
    grown = np.eye(pull.size) + weight
    _, log_determinant = np.linalg.slogdet(grown)
    return float(-0.5 * log_determinant + 0.5 * pull @ np.linalg.solve(grown, pull))
