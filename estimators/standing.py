"""Validity of estimates: which derivatives have converged, which are settling, and which cannot be observed.

The numbers are worked out for many vehicles at once; an ``Estimate`` of one of them is made when somebody asks.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.confounding import confounding_text, find_confounded, sets_of
from wingwatch.estimators.estimate import Estimate, Outcome
from wingwatch.kernels.decorators import helper, whole

__all__ = ["ConcisePosterior", "Validity", "Validities", "assess"]

Array = NDArray[np.float64]
Codes = NDArray[np.int64]


class ConcisePosterior(NamedTuple):
    """Concise derivatives of m vehicles after the data, with the prior that they are measured against; (m, k) each.

    Attributes:
        value: NaN where there is none.
        covariance: (m, k, k).
        prior_std: of the wide prior, three natural sizes.
        prior_ratio: the prior that the covariance holds, in natural sizes.
    """

    value: Array
    covariance: Array
    prior_std: Array
    prior_ratio: float = 3.0


class Validity(NamedTuple):
    """What an estimator says of one mode of one vehicle, in numbers.

    Attributes:
        value, covariance: concise derivatives, (k,) and (k, k).
        code: place of each one's outcome in ``_OUTCOMES``, (k,).
        number: the set of confounded derivatives that each belongs to, from 1, (k,); 0 where it is in none.
        stale: whether the regressor of each has carried nothing but noise for long, (k,).
        condition: of an ``Estimate``, (4,).
        informed_s: when a regressor carried signal last.
        time_s: of the last sample.
        solved: whether there is a solution.
    """

    value: Array
    covariance: Array
    code: Codes
    number: Codes
    stale: NDArray[np.bool_]
    condition: Array
    informed_s: float
    time_s: float
    solved: bool

    @staticmethod
    def stored_name() -> str:
        """The class's name in checkpoints."""
        return "Standing"

    @property
    def says_something(self) -> bool:
        """Whether the mode is settling or converged."""
        if not self.solved:
            return False
        codes = self.code.tolist()
        return _REJECTED not in codes and 2 * codes.count(_HIDDEN) <= len(codes)

    @property
    def unseen(self) -> NDArray[np.bool_]:
        """Which derivatives are not observable for want of signal, or cannot be distinguished, (k,)."""
        return np.asarray((self.code == _HIDDEN) & (self.stale | (self.number > 0)))

    def estimate(self, estimator: str, structure: ModeStructure) -> Estimate:
        """The same with names and reasons."""
        sets = sets_of(structure, self.number)
        outcomes = tuple(_OUTCOMES[c] for c in self.code.tolist())
        outcome, reason = _together(structure, outcomes, self.informed_s, self.solved)
        if sets and outcome is not Outcome.REJECTED:
            reason = "; ".join(part for part in (confounding_text(structure, sets), reason) if part)
        airspeed_m_s, altitude_m, density_kg_m3, alpha_rad = self.condition.tolist()
        return Estimate(
            estimator, structure, self.time_s, self.value, self.covariance, outcomes, outcome, reason,
            (airspeed_m_s, altitude_m, density_kg_m3, alpha_rad), sets,
        )  # fmt: skip


class Validities(NamedTuple):
    """``Validity`` of m vehicles: its arrays with a first axis more, (m,) where it has one number."""

    value: Array
    covariance: Array
    code: Codes
    number: Codes
    stale: NDArray[np.bool_]
    condition: Array
    informed_s: Array
    time_s: Array
    solved: NDArray[np.bool_]

    def of(self, m: int) -> Validity:
        """A copy of one vehicle's."""
        return Validity(
            self.value[m].copy(), self.covariance[m].copy(), self.code[m].copy(), self.number[m].copy(),
            self.stale[m].copy(), self.condition[m].copy(),
            float(self.informed_s[m]), float(self.time_s[m]), bool(self.solved[m]),
        )  # fmt: skip


def assess(
    structure: ModeStructure,
    time_s: Array,
    posterior: ConcisePosterior,
    informed_s: Array,
    stale_s: float,
    solved: NDArray[np.bool_],
    condition: Array,
) -> Validities:
    """Validity of m vehicles' derivatives.

    A derivative is converged when its standard error is below a quarter of its size or of its natural size (a third
    of the wide prior); it is settling while data arrive; it is not observable when its regressor has carried
    nothing but noise for ``stale_s``, or the data have said less than its natural size, or it cannot be distinguished
    from others (``confounding``).

    Args:
        structure: of all.
        time_s: of the last sample, (m,).
        posterior: the derivatives.
        informed_s: when the regressor of each carried signal last, (m, k).
        stale_s: how long ago that may be.
        solved: whether there is a solution, (m,).
        condition: of an ``Estimate``, (m, 4).
    """
    covariance = np.ascontiguousarray(posterior.covariance)
    code, number = np.zeros((2, *informed_s.shape), dtype=np.int64)
    stale = time_s[:, None] - informed_s > stale_s
    natural = posterior.prior_std / 3.0
    _judge_all(
        (posterior.value, natural), covariance, posterior.prior_ratio, len(structure.regressors),
        (stale, solved), code, number,
    )  # fmt: skip
    return Validities(
        posterior.value, covariance, code, number, stale, condition, informed_s.max(axis=1), time_s, solved
    )


_OUTCOMES = (Outcome.NOT_OBSERVABLE, Outcome.REJECTED, Outcome.SETTLING, Outcome.CONVERGED)
_HIDDEN, _REJECTED, _SETTLING, _CONVERGED = range(4)


@whole
def _judge_all(sizes, covariance, prior_ratio, columns, known, code, number):  # type: ignore[no-untyped-def]
    """``_judge`` for every vehicle: everything has a first axis more."""
    (value, natural), (stale, solved) = sizes, known
    for m in range(value.shape[0]):
        sizes_m, known_m = (value[m], natural[m]), (stale[m], solved[m])
        _judge(sizes_m, covariance[m], prior_ratio, columns, known_m, code[m], number[m])


@helper
def _judge(sizes, covariance, prior_ratio, columns, known, code, number):  # type: ignore[no-untyped-def]
    """Validity of each derivative.

    Args:
        sizes: values and natural sizes, (k,) each.
        covariance, prior_ratio, columns, number: of ``find_confounded``.
        known: whether each regressor has carried nothing but noise for long, (k,), and whether there is a solution.
        code: (k,), gets the place of each one's outcome in ``_OUTCOMES``.
    """
    (value, natural), (stale, solved) = sizes, known
    k = value.size
    confounded = np.zeros(k, dtype=np.bool_)
    find_confounded(covariance, natural, prior_ratio, columns, confounded, number)
    for a in range(k):
        error = math.sqrt(max(covariance[a, a], 0.0)) if not math.isnan(covariance[a, a]) else math.nan
        if not (math.isfinite(value[a]) and math.isfinite(error)):
            code[a] = _REJECTED if solved else _HIDDEN
        elif not solved or stale[a] or error > natural[a] or confounded[a]:
            code[a] = _HIDDEN
        elif error <= 0.25 * max(abs(value[a]), natural[a]):
            code[a] = _CONVERGED
        else:
            code[a] = _SETTLING


def _together(
    structure: ModeStructure, outcomes: tuple[Outcome, ...], informed_s: float, solved: bool
) -> tuple[Outcome, str]:
    """The mode's own outcome: that of most of its derivatives, worst named."""
    if not solved:
        return Outcome.NOT_OBSERVABLE, "less than two seconds of data so far"
    if Outcome.REJECTED in outcomes:
        return Outcome.REJECTED, "the solution is not finite; the samples contradict the model"
    hidden = [d for d, o in zip(structure.derivatives, outcomes, strict=True) if o is Outcome.NOT_OBSERVABLE]
    if len(hidden) > len(outcomes) / 2:
        since = f"since {informed_s:.1f} s" if math.isfinite(informed_s) else "so far"
        return Outcome.NOT_OBSERVABLE, f"no excitation {since}; move {', '.join(_surfaces(structure))}"
    settling = [d for d, o in zip(structure.derivatives, outcomes, strict=True) if o is Outcome.SETTLING]
    if hidden or settling:
        names = ", ".join(hidden + settling)
        return (Outcome.CONVERGED if len(hidden + settling) <= len(outcomes) / 2 else Outcome.SETTLING), (
            f"not yet settled: {names}"
        )
    return Outcome.CONVERGED, ""


def _surfaces(structure: ModeStructure) -> list[str]:
    words = {"eta": "the elevator", "xi": "the ailerons", "zeta": "the rudder", "tau": "the throttle"}
    return [words[u] for u in structure.inputs]
