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

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.kernels.symmetric import eigen
from wingwatch.kernels.decorators import helper, whole

__all__ = ["confounded_sets", "find_confounded", "sets_of", "confounding_text"]

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
    k = len(structure.derivatives)
    hidden, number = np.zeros(k, dtype=np.bool_), np.zeros(k, dtype=np.int64)
    find_confounded(
        np.ascontiguousarray(covariance), natural, prior_ratio, len(structure.regressors), hidden, number
    )
    return hidden, sets_of(structure, number)


def sets_of(structure: ModeStructure, number: NDArray[np.int64]) -> tuple[tuple[str, ...], ...]:
    """The derivatives of each set by name, from the number of each one's set, (k,); 0 where it is in none."""
    if not number.any():
        return ()
    named = list(zip(number.tolist(), structure.derivatives, strict=True))
    return tuple(tuple(s for m, s in named if m == n) for n in range(1, int(number.max()) + 1))


@whole
def find_confounded(covariance, natural, prior_ratio, columns, hidden, number):  # type: ignore[no-untyped-def]
    """Compiled ``confounded_sets``.

    Args:
        covariance, natural, prior_ratio: as there; the covariance contiguous.
        columns: regressors of an equation.
        hidden: (k,), gets whether each derivative is confounded; false before.
        number: (k,), gets the number of each one's set, from 1; 0 before, and where it is in none.
    """
    k = natural.size
    settled = True
    for a in range(k):
        if not natural[a] > 0.0:
            return
        settled &= covariance[a, a] <= 0.0625 * natural[a] * natural[a]
        for b in range(k):
            if not np.isfinite(covariance[a, b]):
                return
    if settled:
        return
    alone, unknown = np.zeros(k), np.zeros((k, k))
    _by_data_alone(covariance, natural, prior_ratio, alone, unknown)
    found = False
    for a in range(k):
        size = unknown[a, a]
        hidden[a] = size > UNKNOWN_VARIANCE and alone[a] * size >= LOST_TO_OTHERS
        found |= hidden[a]
    if not found:
        return
    member, sets = np.empty(k, dtype=np.int64), 0
    for a in range(k):
        if not hidden[a] or number[a] > 0:
            continue
        sets += 1
        member[0], reached, at = a, 1, 0
        number[a] = sets
        while at < reached:
            c = member[at]
            at += 1
            for b in range(k):
                if number[b] == 0 and b // columns == a // columns and (hidden[b] or hidden[c]):
                    shared = SHARED_CORRELATION * math.sqrt(unknown[b, b] * unknown[c, c])
                    if abs(unknown[b, c]) > shared:
                        number[b], member[reached] = sets, b
                        reached += 1
        if reached == 1:  # nothing goes with it
            hidden[a], number[a] = False, 0
            sets -= 1


@helper
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


def confounding_text(structure: ModeStructure, sets: tuple[tuple[str, ...], ...]) -> str:
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
