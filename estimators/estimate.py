"""The Estimate: a value never without its covariance and its outcome."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure

__all__ = ["BlockEvidence", "Estimate", "Outcome"]


class Outcome(StrEnum):
    """Validity of an estimate."""

    CONVERGED = "converged"
    SETTLING = "settling"
    NOT_OBSERVABLE = "not_observable"
    REJECTED = "rejected"


@dataclass(frozen=True, slots=True)
class Estimate:
    """Concise derivatives of one mode of one vehicle at one instant.

    Attributes:
        estimator: ``fourier``, ``ekf``.
        structure: the mode's model structure.
        time_s: stamp of the last sample used.
        value: shape (k,), in the order of ``structure.derivatives``; NaN where nothing is known yet.
        covariance: shape (k, k); infinite on the diagonal where nothing is known yet.
        outcomes: validity of each derivative, in the same order.
        outcome: validity of the mode.
        reason: one clause for the operator when the outcome is not ``converged``, else empty.
        condition: mean (airspeed_true_m_s, altitude_m, air_density_kg_m3, angle_of_attack_rad) over
            the samples that the estimate rests on.
        confounded: sets of derivatives of which only combinations are known, because what they multiply moved
            together; those of them that are not known to within their natural size are ``not_observable``.
    """

    estimator: str
    structure: ModeStructure
    time_s: float
    value: NDArray[np.float64]
    covariance: NDArray[np.float64]
    outcomes: tuple[Outcome, ...]
    outcome: Outcome
    reason: str
    condition: tuple[float, float, float, float]
    confounded: tuple[tuple[str, ...], ...] = ()

    @property
    def standard_error(self) -> NDArray[np.float64]:
        """Square root of the covariance's diagonal, shape (k,)."""
        return np.sqrt(np.diagonal(self.covariance))


@dataclass(frozen=True, slots=True)
class BlockEvidence:
    """What one block of samples says of the referred aerodynamic derivatives, as a quadratic log-likelihood.

    Near its maximum the log-likelihood is -1/2 x' J x + h' x, x the referred derivatives. Blocks add. A quiet block
    has J near zero: it is evidence neither for a change nor against one.

    Attributes:
        blocks: how many blocks have been closed so far; the number grows by one with each.
        start_s: time stamp of the block's first sample.
        end_s: of its last.
        information: J, shape (k, k).
        vector: h, shape (k,).
        bias: J times the bias that gusts are expected to have caused, shape (k,).
        condition: mean airspeed_true_m_s, altitude_m, air_density_kg_m3, angle_of_attack_rad of the block.
    """

    blocks: int
    start_s: float
    end_s: float
    information: NDArray[np.float64]
    vector: NDArray[np.float64]
    bias: NDArray[np.float64]
    condition: tuple[float, float, float, float]
