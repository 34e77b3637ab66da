"""The last accepted posterior: in quiet flight the filter goes back to what it knew when data last carried signal.

The filter takes every movement of a measured regressor for one of the aircraft, so quiet flight teaches it that noise
has no effect: l_p of the Aerosonde went from -20 to -105 in nine seconds (stated error 35), where a time constant is
shorter than a sample, and the first doublet then found a false optimum at -124 +- 0.7 (seed 7014 of
``benchmarks/turbulence.py``, still air). Whoever can tell noise from signal says which it was
(``FourierEstimator.sees``): SIGNAL, what was learned is accepted; NOISE, the derivatives go back to what was accepted
last, all else, given these, staying; UNDECIDED, the filter goes on, and the next decision counts.
"""

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.covariance import reseat
from wingwatch.estimators.ekf.scatter import forget_block
from wingwatch.estimators.ekf.state import Accepted, Coherence, EkfState
from wingwatch.estimators.ekf.window import empty_window

__all__ = ["NOISE", "SIGNAL", "UNDECIDED", "accept", "go_back", "prior_accepted"]

Array = NDArray[np.float64]

SIGNAL, NOISE, UNDECIDED = 1, 0, -1


def prior_accepted(value: Array, std: Array, coherence: Coherence) -> Accepted:
    """Before the first sample: the prior, nothing gained; ``value``, ``std``: derivatives at the reference, (k,)."""
    k, vehicles = value.size, len(coherence.level)
    return Accepted(
        np.tile(value, (vehicles, 1)), np.tile(np.diag(std**2), (vehicles, 1, 1)), np.zeros((vehicles, k, k)),
        np.zeros((vehicles, k)), coherence.sums.copy(), coherence.products.copy(),
    )  # fmt: skip


def accept(state: EkfState, i: int, first: int) -> None:
    """What a vehicle's filter knows now is kept; its derivatives begin at ``first``."""
    accepted, k = state.accepted, state.vector.shape[1]
    accepted.value[i] = state.z[i, first : first + k]
    accepted.covariance[i] = state.cov[i, first : first + k, first : first + k]
    accepted.gained_matrix[i], accepted.gained_vector[i] = state.gained_matrix[i], state.gained_vector[i]
    accepted.sums[i], accepted.products[i] = state.coherence.sums[i], state.coherence.products[i]


def go_back(state: EkfState, i: int, first: int) -> None:
    """A vehicle's derivatives become what was accepted last, and so the information gained."""
    accepted = state.accepted
    value, covariance = accepted.value[i].copy(), accepted.covariance[i].copy()
    reseat(state.z[i], state.cov[i], value, covariance, first)
    state.information[i] = np.linalg.inv(covariance)
    state.vector[i] = state.information[i] @ value
    state.variance[i] = np.diagonal(covariance)
    state.gained_matrix[i], state.gained_vector[i] = accepted.gained_matrix[i], accepted.gained_vector[i]
    state.coherence.sums[i], state.coherence.products[i] = accepted.sums[i], accepted.products[i]
    state.moments[i] = 0.0
    forget_block(state, i)
    for errors in (state.input_errors.response, state.input_errors.energy, state.input_errors.information):
        errors[i] = 0.0
    empty_window(state.window, i)
