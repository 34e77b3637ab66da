"""Which directions of the Fourier estimator's regressors carry signal, and the information they give; compiled.

Derivation and symbols: ``docs/methods/fourier.md`` section 3, (16).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.kernels.symmetric import (
    all_below,
    backward,
    cholesky,
    eigen,
    whiten,
)
from wingwatch.kernels.decorators import lean

__all__ = ["DirectionsWorkspace", "directions_workspace", "noise_edge", "reduce_information"]

PIVOT = 1e-9
"""Least fraction of a regressor's power that is its own, not that of the regressors before it."""

RIDGE = 1e-9
"""Added to M, every regressor of unit power."""


class DirectionsWorkspace(NamedTuple):
    """Workspace of ``reduce_information``, names as there.

    Attributes:
        lower, turned, other: (k, k).
        size, signal, off, work, ray: (k,).
    """

    lower: NDArray[np.float64]
    turned: NDArray[np.float64]
    other: NDArray[np.float64]
    size: NDArray[np.float64]
    signal: NDArray[np.float64]
    off: NDArray[np.float64]
    work: NDArray[np.float64]
    ray: NDArray[np.float64]


def directions_workspace(k: int) -> DirectionsWorkspace:
    """Workspace for k derivatives."""
    shapes = [(k, k)] * 3 + [(k,)] * 5
    return DirectionsWorkspace(*(np.empty(shape) for shape in shapes))


@lean
def noise_edge(regressors, bins):  # type: ignore[no-untyped-def]
    """Fraction of "signal" that pure noise of a known variance can show by chance.

    Of ``regressors`` channels of white noise over ``bins`` independent bins the largest eigenvalue tends to
    (1 + sqrt(regressors / bins))^2 times the true power (Marchenko and Pastur 1967).
    """
    if bins <= 0.0:
        return 1.0
    return 1.0 - 1.0 / (1.0 + math.sqrt(regressors / bins)) ** 2


@lean
def _add_direction(ray, signal, power, drive, gained, evidence):  # type: ignore[no-untyped-def]
    """Add the information of one direction, its ray (k,) in derivatives, to the sums of ``reduce_information``."""
    for a in range(ray.size):
        gained.vector[a] += ray[a] * power
        evidence.vector[a] += ray[a] * signal * power
        gained.bias[a] += ray[a] * drive
        evidence.bias[a] += ray[a] * signal * drive
        for b in range(ray.size):
            outer = ray[a] * ray[b]
            gained.sensitivity[a, b] += signal * outer
            gained.information[a, b] += outer
            evidence.information[a, b] += signal * signal * outer


@lean
def reduce_information(equation, smallest, work, gained, evidence):  # type: ignore[no-untyped-def]
    """Keep the directions in which the regressors' power is signal, not noise.

    The sensitivity of the estimating equation is M - N. In coordinates that whiten M its eigenvalues are
    the fraction of signal in the power (at most 1). A direction is kept if that is at least ``smallest``. Records
    without noise make regressors dependent to the last digits: no pivot of M is believed below ``PIVOT``.

    Args:
        equation: ``Equation`` of the block.
        smallest: least fraction of signal.
        work: ``DirectionsWorkspace``.
        gained: becomes the memory that the block adds: M - N, M, score and bias, restricted to the kept directions.
        evidence: becomes what the block says alone.
    """
    m, n_noise = equation.power, equation.noise
    p = m.shape[0]
    lower, turned, other, size, signal, ray = (
        work.lower,
        work.turned,
        work.other,
        work.size,
        work.signal,
        work.ray,
    )
    gained.sensitivity[:, :] = 0.0
    gained.information[:, :] = 0.0
    evidence.information[:, :] = 0.0
    gained.vector[:] = 0.0
    gained.bias[:] = 0.0
    evidence.vector[:] = 0.0
    evidence.bias[:] = 0.0
    for a in range(p):
        size[a] = math.sqrt(m[a, a]) if m[a, a] > 0.0 else 1.0
    for a in range(p):
        for b in range(p):
            other[a, b] = m[a, b] / (size[a] * size[b])
            turned[a, b] = (m[a, b] - n_noise[a, b]) / (size[a] * size[b])
        other[a, a] += RIDGE
    cholesky(other, PIVOT, lower)
    whiten(lower, turned)
    if all_below(turned, smallest, other):
        return
    eigen(turned, signal, work.off, work.work)
    for a in range(p):
        for v in range(p):
            other[a, v] = turned[v, a]
    backward(lower, other)
    for v in range(p):
        if not signal[v] >= smallest:
            continue
        # With d the direction, d' L^-1 is a column of L^-T d: what the score and its bias say along it.
        power = drive = 0.0
        for a in range(p):
            power += other[a, v] * equation.vector[a] / size[a]
            drive += other[a, v] * equation.bias[a] / size[a]
            total = 0.0
            for b in range(a + 1):
                total += lower[a, b] * turned[v, b]
            ray[a] = total * size[a]
        _add_direction(ray, min(signal[v], 1.0), power, drive, gained, evidence)
