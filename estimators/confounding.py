"""Derivatives that the data cannot tell apart, because what they multiply moved together: named instead of given.

With D the natural sizes and P0 the prior, J = D (P^-1 - P0^-1) D is what the data alone say, in units in which a
derivative known no better than its natural size has information one. Under a prior of three natural sizes the
derivatives have the covariance C = (J + I / 9)^-1. Derivative a is confounded if

    C_aa > 1/16          it has not converged: its standard error is over a quarter of its natural size, and
    J_aa C_aa >= 400     were all others known, its standard error would be a twentieth of what it is.

What it cannot be distinguished from are those of its equation whose error goes with its own,
|C_ab| > 0.9 sqrt(C_aa C_bb) (above 0.9 regressors count as collinear: Klein and Morelli 2006, section 5.4). A
derivative that nothing moved has J_aa near zero: it is not observable, but not confounded.
"""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.kernels.hot import whole
from wingwatch.estimators.kernels.symmetric import eigen

__all__ = ["confounded_sets", "told_apart_text"]

Array = NDArray[np.float64]

UNKNOWN_VARIANCE = 1.0 / 16.0
LOST_TO_OTHERS = 400.0
SHARED_CORRELATION = 0.9
WIDE_PRIOR = 3.0

_WORDS = {
    "u": "forward speed", "w": "vertical speed", "v": "sideslip", "p": "roll rate", "q": "pitch rate", "r": "yaw rate",
    "alpha": "angle of attack", "beta": "sideslip", "eta": "elevator", "xi": "aileron", "zeta": "rudder",
    "tau": "throttle",
}  # fmt: skip


def confounded_sets(
    structure: ModeStructure, covariance: Array, natural: Array, prior_ratio: float
) -> tuple[NDArray[np.bool_], tuple[tuple[str, ...], ...]]:
    """Which derivatives cannot be distinguished from others, and from which.

    Args:
        structure: the mode's.
        covariance: of its derivatives, (k, k), the prior in it.
        natural: natural size of each derivative, (k,).
        prior_ratio: the prior's standard deviation in natural sizes.

    Returns:
        Whether each derivative is confounded, (k,); sets of derivatives of which only combinations are known.
    """
    symbols = structure.derivatives
    hidden = np.zeros(len(symbols), dtype=np.bool_)
    error = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    if not np.isfinite(covariance).all() or not (natural > 0.0).all() or (error <= 0.25 * natural).all():
        return hidden, ()
    alone, unknown = np.zeros(len(symbols)), np.zeros(covariance.shape)
    _by_data_alone(covariance, natural, prior_ratio, alone, unknown)
    size = np.sqrt(np.diagonal(unknown))
    hidden = (np.square(size) > UNKNOWN_VARIANCE) & (alone * np.square(size) >= LOST_TO_OTHERS)
    if not hidden.any():
        return hidden, ()
    linked = np.abs(unknown) > SHARED_CORRELATION * np.outer(size, size)
    row = np.arange(len(symbols)) // len(structure.regressors)
    linked &= (hidden[:, None] | hidden[None, :]) & (row[:, None] == row[None, :])
    sets, seen = [], np.zeros(len(symbols), dtype=np.bool_)
    for a in np.flatnonzero(hidden):
        if seen[a]:
            continue
        members = np.zeros(len(symbols), dtype=np.bool_)
        members[a] = True
        while (grown := members | linked[members].any(axis=0)).sum() > members.sum():
            members = grown
        seen |= members
        if members.sum() > 1:
            sets.append(tuple(symbols[b] for b in np.flatnonzero(members)))
        else:
            hidden[a] = False
    return hidden, tuple(sets)


@whole
def _by_data_alone(covariance, natural, prior_ratio, alone, unknown):  # type: ignore[no-untyped-def]
    """Adds the diagonal of J to ``alone`` (k,), and C to ``unknown`` (k, k)."""
    k = natural.size
    directions, spread = np.empty((k, k)), np.empty(k)
    for a in range(k):
        for b in range(k):
            directions[a, b] = covariance[a, b] / (natural[a] * natural[b])
    eigen(directions, spread, np.empty(k), np.empty(k))
    for d in range(k):
        gained = max(1.0 / max(spread[d], 1e-12) - prior_ratio**-2, 0.0)
        for a in range(k):
            alone[a] += directions[d, a] * directions[d, a] * gained
            for b in range(k):
                unknown[a, b] += directions[d, a] * directions[d, b] / (gained + WIDE_PRIOR**-2)


def told_apart_text(structure: ModeStructure, sets: tuple[tuple[str, ...], ...]) -> str:
    """One clause that names the sets and what moved together; empty where there is none."""
    clauses: dict[str, list[str]] = {}
    for names in sets:
        columns = dict.fromkeys(
            structure.regressors[structure.derivatives.index(n) % len(structure.regressors)] for n in names
        )
        together = _listed([_WORDS.get(c, c) for c in columns])
        clauses.setdefault(together, []).append(_listed(list(names)))
    return "; ".join(
        f"{', '.join(names)} cannot be distinguished: {together} move together"
        for together, names in clauses.items()
    )


def _listed(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
