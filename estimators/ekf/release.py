"""Derivatives that have changed some seconds ago are set free then, not now.

A change is told a few seconds late. What the filter has taken in meanwhile it has shared out between what it knew of
the old aircraft and what the new one showed, and it would keep that. The stretch of signal rows that is kept
(``stretch``) reaches back further: it is cut at the last solution before the change, what is known of the changed
derivatives is set free there, P + s^2 e e', and the rest is run again about what it says itself (``relinearise``).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.relinearise import run_stretch_again
from wingwatch.estimators.ekf.stretch import mark, recalled

__all__ = ["release_since"]

Array = NDArray[np.float64]

_STEPS = 3
"""Steps of Gauss and Newton: the first is taken from the old aircraft's values."""

_FAR = 5.0
"""Natural sizes beyond which the steps have run off; then nothing is run again."""


def release_since(
    known_sizes: tuple[tuple[int, ...], ...], fixed: Any, prior_value: Array, prior_std: Array, state: Any, i: int,
    changed: NDArray[np.bool_], since_s: float,
) -> bool:  # fmt: skip
    """Sets derivatives free as of a time within the stretch, if that has solutions on both sides of it.

    Args:
        known_sizes: of ``hot.sizes``: states, inputs, states of the air.
        fixed: of the filter; prior_value, prior_std: of derivatives and constants.
        state: ``EkfState``, in place, right after a solution; i: the vehicle.
        changed: which derivatives, (k,).
        since_s: when they had not changed yet, on the rows' clock.

    Returns:
        whether it was done; else the state is as it was.
    """
    k, first = changed.size, len(known_sizes[0]) + len(known_sizes[2])
    count, _, solutions, _ = state.tally[i]
    if not 0 < count <= state.stretch.shape[1] or solutions < 2 or state.solved[i, solutions - 1, 0] != count:
        return False
    rows = recalled(state.stretch[i], int(count), float(state.marks_rows[i, 0, 0, 0]))
    ends = state.solved[i, :solutions, 0].astype(np.int64)
    before = int(np.sum(rows[ends - 1, 0] <= since_s))
    if not 0 < before < solutions:
        return False
    information = 1.0 / (prior_std[:k] * prior_std[:k])
    work = {
        name: getattr(state, name)[i].copy()
        for name in (
            "z", "cov", "noise", "slow", "echo", "counts", "stretch", "tally", "solved", "marks_z", "marks_cov",
            "marks_rows", "weighed", "about",
        )
    }  # fmt: skip
    there = {name: value.copy() for name, value in work.items()}
    there["tally"][:3] = ends[before - 1], 0, before
    if not run_stretch_again(known_sizes, fixed, prior_value[:k], information, **there, first=first, start=0):
        return False
    cut = int(ends[before - 1])
    last = np.concatenate([rows[max(cut - 2, 0) : cut][::-1], state.marks_rows[i, 0]])[:2]
    freed = first + np.flatnonzero(changed)
    there["cov"][freed, freed] += prior_std[:k][changed] ** 2
    work["cov"][freed, freed] += prior_std[:k][changed] ** 2
    work["stretch"][: count - cut] = work["stretch"][cut:count].copy()
    work["solved"][: solutions - before] = work["solved"][before:solutions].copy()
    work["solved"][: solutions - before, 0] -= cut
    work["tally"][:3] = count - cut, 0, solutions - before
    mark(
        0, there["z"], there["cov"], work["noise"], last, first,
        np.linalg.inv(there["cov"][first : first + k, first : first + k]), work["marks_z"], work["marks_cov"],
        work["marks_rows"], work["weighed"], work["about"],
    )  # fmt: skip
    for _ in range(_STEPS):
        if not run_stretch_again(
            known_sizes, fixed, prior_value[:k], information, **work, first=first, start=0
        ):
            return False
        moved = work["z"][first : first + k] - state.z[i, first : first + k]
        if not (np.isfinite(work["cov"]).all() and (np.abs(moved) <= _FAR * prior_std[:k]).all()):
            return False
    for name, value in work.items():
        getattr(state, name)[i] = value
    return True
