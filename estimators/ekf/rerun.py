"""A vehicle's window of recent rows run again, linearised about one point; ``relinearise`` says why.

Python copies one vehicle's filter into a ``Room`` and back, kernels do the rest: a window costs what its rows cost.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.covariance import leave_out, reseat
from wingwatch.estimators.ekf.inputs import input_noise_information
from wingwatch.estimators.ekf.recursion import Notes, Runner, notes_of
from wingwatch.estimators.ekf.state import NEWEST, TIME, EkfState, Model, Running, one_vehicle, running
from wingwatch.estimators.ekf.window import SOLUTIONS, innovation_log_variance, recalled
from wingwatch.estimators.evidence.information import Belief, Information, believe, inverse_into, times
from wingwatch.estimators.kernels.apart import apart
from wingwatch.kernels.by_address import ByAddress
from wingwatch.kernels.copying import copy_into
from wingwatch.kernels.decorators import helper, whole

__all__ = ["INFORMED", "Rerun"]

Array = NDArray[np.float64]

INFORMED = 0.98
"""Fraction of its variance below which a derivative has been informed."""

USUAL = 24
"""Solutions of a window of twelve seconds."""

_NARROW = 1e-4
"""Variance of the derivatives in a run about a fixed point, over what is known of them: a hundredth of an error."""


class Before(NamedTuple):
    """Known of the derivatives before a half second: information matrix (k, k) and mean (k,)."""

    matrix: Array
    value: Array


class Span(NamedTuple):
    """What solutions did in a part of the window (axis s) that is run again."""

    ends: NDArray[np.int64]
    """(s,): rows of the window before each solution."""
    keep: Array
    """(s,): fraction of the information that was kept."""
    resting: NDArray[np.bool_]
    """(s, ns + nu): states and inputs at rest."""
    middle: int
    """Rows of the window before its second checkpoint, 0 where there is none."""
    input_variance: Array
    """(nu,): of the inputs' readings, rad2."""


class Room(NamedTuple):
    """Where a window is run again, one for all vehicles of a filter."""

    run: Running
    """One vehicle's filter, a batch of one."""
    notes: Notes
    """For as many solutions as a window holds."""
    fixed: Belief
    """The point, and the covariance of the derivatives at the run's beginning."""
    known: Information
    """At the beginning, then at the end."""
    middle: Information
    """At the second checkpoint."""


def _room(model: Model, state: EkfState, solutions: int) -> Room:
    """For a filter with states such as this one, and windows of so many solutions at most."""
    k = state.vector.shape[1]
    square = np.zeros((k, k))
    fixed, known = Belief(np.zeros(k), square.copy()), Information(square.copy(), np.zeros(k))
    middle = Information(square.copy(), np.zeros(k))
    return apart(Room(one_vehicle(running(state), 0), notes_of(model, solutions), fixed, known, middle))


@helper
def _forget(model, known, before, span, notes, s):  # type: ignore[no-untyped-def]
    """What solution ``s`` does to what is known: what rested (``before``: as known before the half second), information
    that came of reading errors, forgetting."""
    information, vector, k = known.matrix, known.vector, known.vector.size
    resting, keep, prior_std = span.resting[s], span.keep[s], model.prior_std
    noise_information = np.empty((k, k))
    input_noise_information(
        notes.error_information[s], notes.moments[s], span.input_variance, resting, noise_information
    )
    if resting.any():
        leave_out(known.matrix, known.vector, before.matrix, before.value, resting, model.sizes.states)
    for a in range(k):
        prior = 1.0 / (prior_std[a] * prior_std[a])
        vector[a] *= keep
        for b in range(k):
            information[a, b] = keep * (information[a, b] - noise_information[a, b])
        information[a, a] += (1.0 - keep) * prior
        vector[a] += (1.0 - keep) * prior * model.prior_value[a]
    for a in range(k):
        for b in range(a):
            information[a, b] = information[b, a] = 0.5 * (information[a, b] + information[b, a])


@helper
def _put_together(model, fixed, span, notes, known, middle):  # type: ignore[no-untyped-def]
    """Half second by half second, what the run about a fixed point says joins what is known.

    Args:
        model: of the filter.
        fixed: ``Belief``: the fixed point and its covariance at the run's beginning.
        span, notes: what the solutions did, and what the run has at each.
        known: ``Information`` at the beginning, becomes that at the end.
        middle: becomes that at the second checkpoint.

    Returns:
        whether all of it is sound.
    """
    k, first = fixed.value.size, model.sizes.dynamic
    square = (k, k)
    work, seen, fresh, known_covariance = (
        np.empty(square),
        np.empty(square),
        np.empty(square),
        np.empty(square),
    )
    seen_vector, before = np.empty(k), Before(np.empty(square), np.empty(k))
    inverse_into(fixed.covariance, work, seen)
    times(seen, fixed.value, seen_vector)
    inverse_into(known.matrix, work, known_covariance)
    for s in range(span.ends.size):
        value = notes.z[s, first : first + k]
        if not inverse_into(notes.cov[s, first : first + k, first : first + k], work, fresh):
            return False
        copy_into(known.matrix, before.matrix)
        times(known_covariance, known.vector, before.value)
        for a in range(k):
            now_vector = 0.0
            for b in range(k):
                now_vector += fresh[a, b] * value[b]
                known.matrix[a, b] += fresh[a, b] - seen[a, b]
                seen[a, b] = fresh[a, b]
            known.vector[a] += now_vector - seen_vector[a]
            seen_vector[a] = now_vector
        _forget(model, known, before, span, notes, s)
        if not inverse_into(known.matrix, work, known_covariance):
            return False
        if span.ends[s] == span.middle:
            copy_into(known.matrix, middle.matrix)
            copy_into(known.vector, middle.vector)
    return True


@helper
def _put(z, cov, known, work, covariance, value, first):  # type: ignore[no-untyped-def]
    """The derivatives of one vehicle's mean and covariance become what is ``known`` of them; else is workspace."""
    believe(known.matrix, known.vector, work, covariance, value)
    reseat(z, cov, value, covariance, first)


@whole
def _begin(model, state, i, before, room):  # type: ignore[no-untyped-def]
    """A vehicle's filter goes to the beginning of its window, its derivatives held where they are, or where they were
    ``before`` the window."""
    points, first, k, fixed, known = (
        state.window.checkpoints,
        model.sizes.dynamic,
        state.vector.shape[1],
        room.fixed,
        room.known,
    )
    run = room.run
    copy_into(points.z[i, 0], run.z[0])
    copy_into(points.cov[i, 0], run.cov[0])
    copy_into(points.rows[i, 0], run.rows[0])
    copy_into(points.information[i, 0], known.matrix)
    times(known.matrix, run.z[0, first : first + k], known.vector)
    run.moment_level.mean[0] = 0.0
    run.moment_level.covariance[0] = 0.0
    run.moments[0] = 0.0
    for a in range(k):
        fixed.value[a] = points.value[i, 0, a] if before else state.z[i, first + a]
        for b in range(k):
            own = points.covariance[i, 0, a, b] if before else state.cov[i, first + a, first + b]
            fixed.covariance[a, b] = _NARROW * own
    reseat(run.z[0], run.cov[0], fixed.value, fixed.covariance, first)


@whole
def _end(model, state, i, room):  # type: ignore[no-untyped-def]
    """What a run leaves becomes the vehicle's filter and its checkpoints; returns whether that is sound."""
    window, points, first, k = (
        state.window,
        state.window.checkpoints,
        model.sizes.dynamic,
        state.vector.shape[1],
    )
    run, notes, fixed, known, middle = room.run, room.notes, room.fixed, room.known, room.middle
    count, middle_row = window.solutions[i], window.middle[i]
    span = Span(
        window.ends[i, :count],
        window.keep[i, :count],
        window.resting[i, :count],
        middle_row,
        state.noise.inputs[i],
    )
    if not _put_together(model, fixed, span, notes, known, middle):
        return False
    work, covariance, value = np.empty((k, k)), np.empty((k, k)), np.empty(k)
    _put(run.z[0], run.cov[0], known, work, covariance, value, first)
    for m in range(2):
        innovation_log_variance(model, run, 0, points.log_variance[i, m])
        copy_into(fixed.value, points.value[i, m])
        for a in range(k):
            for b in range(k):
                points.covariance[i, m, a, b] = state.cov[i, first + a, first + b]
    if middle_row > 0:
        at = 0
        while at < count - 1 and span.ends[at] != middle_row:
            at += 1
        copy_into(notes.z[at], points.z[i, 1])
        copy_into(notes.cov[at], points.cov[i, 1])
        copy_into(middle.matrix, points.information[i, 1])
        _put(points.z[i, 1], points.cov[i, 1], middle, work, covariance, value, first)
    copy_into(run.z[0], state.z[i])
    copy_into(run.cov[0], state.cov[i])
    return True


@whole
def _account(model, state, i):  # type: ignore[no-untyped-def]
    """What follows from a vehicle's new covariance."""
    information, vector = state.information[i], state.vector[i]
    first, k = model.sizes.dynamic, vector.size
    work, moved_s = np.empty((k, k)), np.max(state.moved_s[i, : model.sizes.states])
    inverse_into(state.cov[i, first : first + k, first : first + k], work, information)
    times(information, state.z[i, first : first + k], vector)
    for a in range(k):
        own = state.cov[i, first + a, first + a]
        if own < INFORMED * state.variance[i, a]:
            state.informed_s[i, a] = max(state.informed_s[i, a], moved_s)
        state.variance[i, a] = own


class Rerun:
    """Runs windows of one filter's vehicles again.

    Attributes:
        model: of the filter; by_address: as kernels take it.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.by_address, self._runner = ByAddress(model), Runner(model)
        self._rooms: tuple[ByAddress, ByAddress] | None = None  # a ``Room`` and the ``Running`` in it

    def window(self, state: EkfState, i: int, packed: ByAddress | None = None, before: bool = False) -> bool:
        """A vehicle's window again about the present estimate, or about what was known ``before`` it: its state and
        checkpoints become what that leaves.

        ``packed``: the state by address, where that is at hand. Returns whether it did: a run that leaves no sound
        covariance is left out.
        """
        window, packed = state.window, packed or ByAddress(state)
        of_room, of_run = self._room_for(state, int(window.solutions[i]))
        room = of_room.named
        for part in _LEARNED:
            for kept, all_of_them in zip(getattr(room.run, part), getattr(state, part), strict=True):
                kept[0] = all_of_them[i]
        for part in _OTHERS:
            getattr(room.run, part)[0] = getattr(state, part)[i]
        _begin(self.by_address, packed, i, before, of_room)
        kept, before_s = window.rows[i, : int(window.filled[i])], float(room.run.rows[0, NEWEST, TIME])
        rows = recalled(kept, before_s, self.model.sizes.kinematic)
        ends = window.ends[i, : int(window.solutions[i])]
        self._runner.again(of_run, rows, ends, room.notes)
        if not _end(self.by_address, packed, i, of_room):
            return False
        for part in ("noise", "input_errors", "moment_level"):
            for kept, new in zip(getattr(state, part), getattr(room.run, part), strict=True):
                kept[i] = new[0]
        return True

    def _room_for(self, state: EkfState, solutions: int) -> tuple[ByAddress, ByAddress]:
        """Room for a window with so many solutions, and the ``Running`` in it, by address."""
        if self._rooms is None or len(self._rooms[0].named.notes.z) < solutions:
            room = _room(self.model, state, USUAL if solutions <= USUAL else SOLUTIONS)
            self._rooms = ByAddress(room), ByAddress(room.run)
        return self._rooms

    def window_and_account(self, state: EkfState, i: int, packed: ByAddress, before: bool = False) -> bool:
        """``window``, and what follows from the derivatives' new covariance; returns whether it did."""
        if not self.window(state, i, packed, before):
            return False
        _account(self.by_address, packed, i)
        return True


_LEARNED = ("noise", "memory", "input_errors", "moment_level", "coherence")
_OTHERS = ("condition", "samples", "settling", "ratios", "direction")
"""Parts of a ``Running`` that a window begins with as they are now: tuples of arrays, and arrays."""
