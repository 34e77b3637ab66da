"""Referred derivatives and the standing of an estimate: what both estimators share.

Aerodynamic stability derivatives grow with rho V and control derivatives with rho V^2 (thesis table B.3), so an
estimate made at one airspeed is carried to another by a ratio, without any geometry. Referred means: as it would be
at the reference airspeed and density. The kinematic parts (forward speed in z_q and y_r, W in y_p and x_q) are offsets.
"""

import math
from enum import Enum
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.confounding import find_confounded, sets_of, told_apart_text
from wingwatch.estimators.estimate import Estimate, Outcome
from wingwatch.estimators.kernels.hot import whole

__all__ = ["ConcisePosterior", "Says", "offsets", "referred_scale", "says_something", "standing"]

Array = NDArray[np.float64]


class ConcisePosterior(NamedTuple):
    """Concise derivatives after the data, with the prior that they are measured against; (k,) each.

    Attributes:
        value: NaN where there is none.
        covariance: (k, k).
        prior_std: of the wide prior, three natural sizes.
        prior_ratio: the prior that the covariance holds, in natural sizes.
    """

    value: Array
    covariance: Array
    prior_std: Array
    prior_ratio: float = 3.0


def referred_scale(
    structure: ModeStructure,
    airspeed_true_m_s: float,
    air_density_kg_m3: float,
    reference: tuple[float, float],
) -> Array:
    """Factor from referred to present aerodynamic derivatives, shape (k,).

    Columns of velocities and rates grow with rho V, those of angles and inputs with rho V^2. Phugoid and spiral are
    gravity and the full motion's quotients, of which neither law holds: theirs are not carried over, the factor is 1.
    """
    goes_by_angle = _goes_by_angle(structure)
    if goes_by_angle is None:
        return np.ones(len(structure.derivatives))
    by_velocity = air_density_kg_m3 * airspeed_true_m_s / (reference[0] * reference[1])
    by_angle = by_velocity * airspeed_true_m_s / reference[0]
    return np.where(goes_by_angle, by_angle, by_velocity)


@cache
def _goes_by_angle(structure: ModeStructure) -> NDArray[np.bool_] | None:
    """Which derivatives grow with rho V^2, (k,); None where neither law holds."""
    if any(row in ("theta", "phi") for row in structure.equations):
        return None
    row = [c in ("alpha", "beta", *structure.inputs) for c in structure.regressors]
    return np.array(row * len(structure.equations))


def offsets(structure: ModeStructure, airspeed_true_m_s: float, angle_of_attack_rad: float) -> Array:
    """Kinematic part of each concise derivative (thesis table B.4), shape (k,)."""
    alpha = angle_of_attack_rad if np.isfinite(angle_of_attack_rad) else 0.0
    forward, down = airspeed_true_m_s * np.cos(alpha), airspeed_true_m_s * np.sin(alpha)
    kinematic, out = (
        {"z_q": forward, "y_r": -forward, "y_p": down, "x_q": -down},
        np.zeros(len(structure.derivatives)),
    )
    for k, symbol in _kinematic(structure):
        out[k] = kinematic[symbol]
    return out


@cache
def _kinematic(structure: ModeStructure) -> tuple[tuple[int, str], ...]:
    """Places and symbols of the derivatives with a kinematic part."""
    return tuple((k, s) for k, s in enumerate(structure.derivatives) if s in ("z_q", "y_r", "y_p", "x_q"))


def standing(
    estimator: str,
    structure: ModeStructure,
    time_s: float,
    posterior: ConcisePosterior,
    informed_s: Array,
    stale_s: float,
    solved: bool,
    condition: Array,
) -> Estimate:
    """An Estimate with its outcomes.

    A derivative is converged when its standard error is below a quarter of its size or of its natural size (a third
    of the wide prior); it is settling while data arrive; it is not observable when its regressor has carried
    nothing but noise for ``stale_s``, or the data have said less than its natural size, or it cannot be told from
    others (``confounding``).
    """
    covariance = np.ascontiguousarray(posterior.covariance)
    k, number = covariance.shape[0], np.zeros(covariance.shape[0], dtype=np.int64)
    code, stale = np.empty(k, dtype=np.int64), time_s - informed_s > stale_s
    _judge(
        (posterior.value, posterior.prior_std / 3.0), covariance, posterior.prior_ratio, len(structure.regressors),
        (stale, solved), code, number,
    )  # fmt: skip
    sets = sets_of(structure, number)
    outcomes = tuple(_OUTCOMES[c] for c in code.tolist())
    outcome, reason = _together(structure, outcomes, informed_s, solved)
    if sets and outcome is not Outcome.REJECTED:
        reason = "; ".join(part for part in (told_apart_text(structure, sets), reason) if part)
    return Estimate(
        estimator, structure, time_s, posterior.value, covariance, outcomes, outcome, reason,
        (float(condition[0]), float(condition[1]), float(condition[2]), float(condition[3])),
        sets,
    )  # fmt: skip


_OUTCOMES = (Outcome.NOT_OBSERVABLE, Outcome.REJECTED, Outcome.SETTLING, Outcome.CONVERGED)
_HIDDEN, _REJECTED, _SETTLING, _CONVERGED = range(4)


@whole
def _judge(sizes, covariance, prior_ratio, columns, known, code, number):  # type: ignore[no-untyped-def]
    """The standing of each derivative.

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


class Says(Enum):
    """What can be said of an estimate's outcome without making it."""

    SOMETHING = "settling or converged"
    NOTHING = "not observable or rejected"
    UNDECIDED = "only the estimate tells"


_ROUNDING = 1e-9
"""Of a standard error over a natural size: so near to a limit only the estimate tells on which side it is."""


def says_something(value: Array, ratio: Array, stale: NDArray[np.bool_]) -> Says:
    """What ``standing`` will make of a solution under a prior of three natural sizes.

    Args:
        value: derivatives, (k,).
        ratio: standard error of each over its natural size, (k,).
        stale: whether its regressor has carried nothing but noise for long, (k,).
    """
    if not (np.isfinite(value).all() and np.isfinite(ratio).all()):
        return Says.UNDECIDED
    if 2 * np.count_nonzero(stale | (ratio > 1.0 + _ROUNDING)) > ratio.size:
        return Says.NOTHING
    # Only those with an error above a quarter of their natural size can be found to be confounded.
    if 2 * np.count_nonzero(stale | (ratio > 0.25 - _ROUNDING)) <= ratio.size:
        return Says.SOMETHING
    return Says.UNDECIDED


def _together(
    structure: ModeStructure, outcomes: tuple[Outcome, ...], informed_s: Array, solved: bool
) -> tuple[Outcome, str]:
    """The mode's own outcome: that of most of its derivatives, worst named."""
    if not solved:
        return Outcome.NOT_OBSERVABLE, "less than two seconds of data so far"
    if Outcome.REJECTED in outcomes:
        return Outcome.REJECTED, "the solution is not finite; the samples contradict the model"
    hidden = [d for d, o in zip(structure.derivatives, outcomes, strict=True) if o is Outcome.NOT_OBSERVABLE]
    if len(hidden) > len(outcomes) / 2:
        latest = float(np.max(informed_s))
        since = f"since {latest:.1f} s" if np.isfinite(latest) else "so far"
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
