"""Quiet flight: the filter goes back to what it knew when the data last carried signal.

The filter takes every movement of a measured regressor for one of the aircraft, so quiet flight teaches it that noise
has no effect: l_p of the Aerosonde went from -20 to -105 in nine seconds (stated error 35), where a time constant is
shorter than a sample, and the first doublet then found a false optimum at -124 +- 0.7 (seed 7014 of
``benchmarks/turbulence.py``, still air). Somebody who can tell noise from signal says which it was
(``FourierEstimator.sees``): SIGNAL, what was learned is kept; NOISE, the derivatives go back to what was last kept, all
else, given these, staying; UNDECIDED, the filter goes on, and the next word decides.

``sure`` is what was last kept, (k, 2 k + 2): mean, covariance, and the account of information gained: matrix, vector.
"""

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.covariance import reseat

__all__ = ["NOISE", "SIGNAL", "UNDECIDED", "go_back", "keep_sure", "nothing_sure"]

Array = NDArray[np.float64]

SIGNAL, NOISE, UNDECIDED = 1, 0, -1


def nothing_sure(value: Array, std: Array) -> Array:
    """``sure`` before the first sample: the prior, and nothing gained; shape (k, 2 k + 2)."""
    return np.column_stack([value, np.diag(std**2), np.zeros((value.size, value.size + 1))])


def keep_sure(sure: Array, z: Array, cov: Array, gained: tuple[Array, Array], first: int) -> None:
    """What is known now is kept."""
    k = len(sure)
    sure[:, 0] = z[first : first + k]
    sure[:, 1 : 1 + k] = cov[first : first + k, first : first + k]
    sure[:, 1 + k : -1], sure[:, -1] = gained


def go_back(
    sure: Array,
    z: Array,
    cov: Array,
    known: tuple[Array, Array, Array],
    gained: tuple[Array, Array],
    first: int,
) -> None:
    """The derivatives become what was kept, and so the account of them.

    Args:
        sure: what was kept.
        z, cov: of one vehicle, in place; derivatives begin at ``first``.
        known: information (k, k), its vector (k,) and the variances (k,) of the last solution, in place.
        gained: account of information gained, (k, k) and (k,), in place.
    """
    k = len(sure)
    value, covariance = sure[:, 0].copy(), sure[:, 1 : 1 + k].copy()
    reseat(z, cov, value, covariance, first)
    information, vector, variance = known
    information[:] = np.linalg.inv(covariance)
    vector[:] = information @ value
    variance[:] = np.diagonal(covariance)
    gained[0][:], gained[1][:] = sure[:, 1 + k : -1], sure[:, -1]
