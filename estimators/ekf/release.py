"""Derivatives that have changed some seconds ago get their covariance reset as of then, not as of now.

A change is reported a few seconds late. What the filter has taken in meanwhile it has divided between what it knew of
the old aircraft and what the new one showed, and it would keep that. The window of recent signal rows reaches back
further: it is cut at the last solution before the change, the covariance of the changed derivatives is inflated there,
P + s^2 e e', and the rest is run again about what it says itself (``relinearise``). A window that begins later than the
change, for what came before taught nothing, is run again from its beginning.

What rolling air does in side force and yaw stays what it was. Where some derivatives are still those of the old
aircraft and some those of the new one, their ratios would move both.
"""

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.model import LEAST_DAMPING
from wingwatch.estimators.ekf.rerun import Rerun
from wingwatch.estimators.ekf.state import (
    ESTIMATED,
    KEPT,
    NEWEST,
    TIME,
    EkfState,
    Model,
    one_vehicle,
    put_vehicle,
)
from wingwatch.estimators.ekf.window import FIRST, cut_at, recalled, set_checkpoint
from wingwatch.kernels.by_address import ByAddress

__all__ = ["gained_in_window", "keep_ratios", "release_since"]

Array = NDArray[np.float64]

_STEPS = 3
"""Steps of Gauss and Newton: the first is taken from the old aircraft's values."""

_FAR = 5.0
"""Natural sizes beyond which the steps have run off; then nothing is run again."""


def keep_ratios(model: Model, state: EkfState, i: int) -> None:
    """Rolling air goes on to act on vehicle i as its derivatives by roll rate are now."""
    if not model.roll:
        return
    if state.ratios[i] == ESTIMATED:
        ns, nd, first = model.sizes.states, model.sizes.states + model.sizes.inputs, model.sizes.dynamic
        by_roll_rate = state.z[i, first + 1 : first + ns * nd : nd]
        if by_roll_rate[1] < LEAST_DAMPING * model.prior_value[nd + 1]:
            state.direction[i] = by_roll_rate / by_roll_rate[1]
    state.ratios[i] = KEPT


def _lower_levels(one: EkfState) -> None:
    """Levels of noise of a batch of one become those of the window's beginning where these are lower.

    What a changed aircraft did beside the old one's derivatives has passed for noise; a level comes down slowly.
    """
    noise, level, then = one.noise, one.moment_level, one.window.checkpoints.levels
    if then.accelerometer[0, 0] < noise.reading[0, -1]:
        noise.reading[0, -1], noise.gain[0] = then.accelerometer[0, 0], then.gain[0, 0]
        noise.fisher[0] = then.fisher[0, 0]
    lower = then.unmeasured[0, 0] < noise.unmeasured[0]
    noise.unmeasured[0, lower] = then.unmeasured[0, 0, lower]
    level.information[0, lower] = then.information[0, 0, lower]


def _go_to(rerun: Rerun, one: EkfState, since_s: float) -> int | None:
    """A batch of one goes back to its window's last solution at or before a time, or to the window's beginning where
    that is later.

    Returns how many of the window's solutions it keeps; None where it cannot go back.
    """
    window, points = one.window, one.window.checkpoints
    solutions, beginning = int(window.solutions[0]), points.rows[0, 0].copy()
    rows = recalled(
        window.rows[0, : int(window.filled[0])], float(beginning[NEWEST, TIME]), rerun.model.sizes.kinematic
    )
    ends = window.ends[0, :solutions]
    before = int(np.sum(rows[ends - 1, TIME] <= since_s))
    if before == solutions or np.isnan(since_s):
        return None
    _lower_levels(one)
    if before == 0:
        one.z[0], one.cov[0], one.rows[0] = points.z[0, 0], points.cov[0, 0], beginning
        return 0
    cut = int(ends[before - 1])
    window.filled[0], window.middle[0], window.solutions[0] = cut, 0, before
    if not rerun.window(one, 0):
        return None
    one.rows[0] = np.concatenate([rows[max(cut - 2, 0) : cut][::-1], beginning])[:2]
    return before


def gained_in_window(model: Model, state: EkfState, i: int) -> tuple[Array, Array]:
    """Information (k, k) and vector (k,) that a vehicle's window has given since its beginning, less what was forgotten
    of it meanwhile."""
    window, points = state.window, state.window.checkpoints
    k, first = state.vector.shape[1], model.sizes.dynamic
    information, value = points.information[i, 0], points.z[i, 0, first : first + k]
    kept = float(np.prod(window.keep[i, : int(window.solutions[i])]))
    prior = (1.0 - kept) / model.prior_std[:k] ** 2
    matrix = state.information[i] - kept * information - np.diag(prior)
    vector = state.vector[i] - kept * information @ value - prior * model.prior_value[:k]
    return matrix, vector


def release_since(rerun: Rerun, state: EkfState, i: int, spread: Array, since_s: float) -> bool:
    """Resets derivatives as of a time within the window, or as of its beginning where that is later, if solutions have
    come since.

    Args:
        rerun: of the filter.
        state: in place, right after a solution; i: the vehicle.
        spread: standard deviation of what each has changed by, in natural sizes, (k,).
        since_s: when they had not changed yet, on the rows' clock.

    Returns:
        whether it was done; else the state is as it was.
    """
    model, window, k = rerun.model, state.window, spread.size
    first = model.sizes.dynamic
    count, solutions = int(window.filled[i]), int(window.solutions[i])
    if not 0 < count <= window.rows.shape[1] or solutions < 1 or window.ends[i, solutions - 1] != count:
        return False
    there, work = one_vehicle(state, i), one_vehicle(state, i)
    before = _go_to(rerun, there, since_s)
    if before is None:
        return False
    parameters, diagonal = slice(first, first + k), np.arange(first, first + k)
    prior_std = model.prior_std[:k]
    for one in (there, work):
        one.cov[0, diagonal, diagonal] += (spread * prior_std) ** 2
    keep_ratios(model, there, 0)
    work.ratios[0], work.direction[0] = there.ratios[0], there.direction[0]
    cut_at(work, before)
    there.information[0] = np.linalg.inv(there.cov[0, parameters, parameters])
    set_checkpoint(rerun.by_address, ByAddress(there), 0, ByAddress(work.window.checkpoints), FIRST)
    for _ in range(_STEPS):
        _lower_levels(work)
        if not rerun.window(work, 0):
            return False
        moved = work.z[0, parameters] - state.z[i, parameters]
        if not (np.isfinite(work.cov).all() and (np.abs(moved) <= _FAR * prior_std).all()):
            return False
    put_vehicle(state, [i], work)
    return True
