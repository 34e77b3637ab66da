"""Running the window of recent samples again, linearised about better values.

The filter linearises the products of derivatives and states about what it knows at the moment, and what it has taken in
so it keeps. Early in an excited window that is little: the estimate moves with the noise, and answers to the start.
So the last seconds of signal rows are kept, with the filter's state at their beginning and amid them (checkpoints), and
when it matters they are run again with the derivatives held at the present estimate theta*:

- theta* has a narrow covariance e P there, so it stays where it is, and the states follow p(x | theta*) of the
  checkpoint. What the rows say of theta in this run, J = S^-1 - (e P)^-1 and h = S^-1 m - (e P)^-1 theta* for mean m
  and covariance S after it, is one step of Gauss and Newton on the likelihood of the innovations (thesis 5.3): its
  score, sensitivities that depend on the past alone times white innovations, has no mean at the truth.
- J and h of each half second go into the information that the checkpoint had, in the place of what was first learned,
  then comes what the solution did there: what rested, information that came of noise, forgetting. No row counts
  twice.
- At the end the derivatives get their mean and covariance so, the states keep their regression on them.

It matters by how much the response bends. With J of the window, and theta known about the point of linearisation to
within covariance L (now P), the first-order change of the predicted readings between the two has the square
m = d' J d + tr J (L - P), in their noise, and the whole response r^2 = theta' J theta. Its curvature is about 1 / r
(Bates and Watts, J. Roy. Stat. Soc. B 42, 1980), so what linearisation left out is as long as m / (2 r), in noise
again, at most: an rms of m / (2 r sqrt(k)) standard errors over k derivatives, times the root of the fraction that the
window has in all that is known. What the rows said was also weighted by the noise variances of the moment, which the
misfit of a wrong start makes too large; it matters where the stated errors, which go with the root of the innovations'
variances, are off by as much, times the window's fraction. While an input acts, the next half second moves the
estimate by the root of the fraction of all information that such a half second gives: what is less than that can wait.
A window that has taught too little for all of it to matter begins anew.

Rows that set levels of noise alone are run as soon as these are known, if anything moved in them, about what was known
before the window. What half a second of filtered rows says is no place to linearise about: where a vane's noise alone
has moved the velocity, it passes for motion that the force does not answer to. From a z_w of the wrong sign steps lead
on and on, for a force that tells of no velocity contradicts no vane.

What rolling air does in side force and yaw goes as n_p / l_p. The ratio of two numbers that are not known yet is none,
and the window would end at an aircraft that hardly damps its rolling. So it is that of the expectation until l_p is
known to a quarter of itself; then the window is run again with the ratio of the estimates.

A step of Gauss and Newton is a guide only where the response is straight within what is not known yet: tr J P / (2 r)
at most a quarter. Quiet flight, where J comes of noise, and a derivative just reset are left alone so.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.covariance import leave_out, reseat
from wingwatch.estimators.ekf.inputs import input_noise_information
from wingwatch.estimators.ekf.recursion import run_again
from wingwatch.estimators.ekf.solve import INFORMED
from wingwatch.estimators.ekf.state import (
    ESTIMATED,
    EXPECTED,
    KEPT,
    NEWEST,
    TIME,
    EkfState,
    Model,
    Running,
    Solved,
    one_vehicle,
)
from wingwatch.estimators.ekf.window import (
    WINDOW_ROWS,
    advance_checkpoints,
    begin_window,
    innovation_log_variance,
    recalled,
)
from wingwatch.estimators.kernels.apart import apart, room_around
from wingwatch.estimators.kernels.symmetric import invert
from wingwatch.kernels.by_address import ByAddress
from wingwatch.kernels.copying import copy_into
from wingwatch.kernels.decorators import helper, part, whole

__all__ = ["relinearise_all", "run_window_again"]

Array = NDArray[np.float64]

_CURVED = 0.25
"""Curvature of the response within what is not known of the derivatives, beyond which a linear step is no guide."""

_NARROW = 1e-4
"""Variance of the derivatives in a run about a fixed point, over what is known of them: a hundredth of an error."""

_SPARE_ROWS, _SPARE = 4 * WINDOW_ROWS, 0.2
"""Rows that may be run again: a few windows, for when much is learned in a short time, and a fifth of all."""

_KNOWN, _STILL_KNOWN = 4.0, 2.0
"""Standard errors of the damping of rolling in itself, from which on it is known, and below which no longer."""

_MATTERS = 0.1
"""Standard errors that linearisation may be off by: a tenth makes an rms error 0.5 % larger."""

_TAUGHT = 1e-9
"""Fraction of all that is known from which on a window has taught anything: less is rounding."""


class Information(NamedTuple):
    """On the derivatives: matrix (k, k) and vector (k,)."""

    matrix: Array
    vector: Array


class Belief(NamedTuple):
    """About the derivatives: mean (k,) and covariance (k, k)."""

    value: Array
    covariance: Array


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


@part
def _bending(now, then, later, gathered, kept, faded, prior_information):  # type: ignore[no-untyped-def]
    """Of the rows from a checkpoint to a later time: m, r^2 and tr J P of the header; see there.

    Args:
        now, then: ``Belief`` now, and the one that the rows were linearised about.
        later: information matrix at the later time.
        gathered: that at the checkpoint.
        kept, faded: fraction of information that forgetting has left from the checkpoint to then, from then to now.
        prior_information: of each derivative.
    """
    k = now.value.size
    moved = strength = fraction = 0.0
    for a in range(k):
        for b in range(k):
            gained = later[a, b] - kept * gathered[a, b]
            if a == b:
                gained -= (1.0 - kept) * prior_information[a]
            off = (now.value[a] - then.value[a]) * (now.value[b] - then.value[b])
            moved += gained * (off + then.covariance[a, b] - now.covariance[a, b])
            strength += gained * now.value[a] * now.value[b]
            fraction += gained * now.covariance[a, b]
    return faded * moved, faded * strength, faded * fraction


@part
def _left_out(model, state, i, first, kept, prior_information):  # type: ignore[no-untyped-def]
    """What linearisation has left out of the window, in standard errors, and the window's fraction of all that is
    known; see above.

    ``kept``: fraction of information that forgetting has left from each checkpoint to the next, or now, (2,).
    """
    points, k = state.window.checkpoints, prior_information.size
    count = 2 if state.window.middle[i] > 0 else 1
    now = Belief(state.z[i, first : first + k], state.cov[i, first : first + k, first : first + k])
    weighted = np.empty(points.log_variance.shape[2])
    innovation_log_variance(model, state, i, weighted)
    moved = strength = fraction = off = 0.0
    for m in range(count):
        last = m == count - 1
        later = state.information[i] if last else points.information[i, 1]
        then = Belief(points.value[i, m], points.covariance[i, m])
        by, power, known = _bending(
            now, then, later, points.information[i, m], kept[m], 1.0 if last else kept[1], prior_information
        )
        moved += by
        strength += power
        fraction += known
        off += 0.5 * known / k * np.max(np.abs(weighted - points.log_variance[i, m]))
    if not (strength > 0.0 and 0.0 < fraction <= 2.0 * _CURVED * np.sqrt(strength)):
        return 0.0, fraction / k
    fraction = min(fraction / k, 1.0)
    moved *= 0.5 * np.sqrt(fraction / (strength * k))
    return max(off, moved), fraction


@helper
def _inverse(matrix, work, out):  # type: ignore[no-untyped-def]
    """Inverse of a symmetric matrix into ``out``; returns whether the matrix is positive definite and finite."""
    n = matrix.shape[0]
    for a in range(n):
        for b in range(n):
            work[a, b] = matrix[a, b]
    invert(work, out)
    sound = True
    for a in range(n):
        sound = sound and 0.0 < work[a, a] < np.inf
    return sound


@helper
def _times(matrix, vector, out):  # type: ignore[no-untyped-def]
    for a in range(out.size):
        out[a] = 0.0
        for b in range(vector.size):
            out[a] += matrix[a, b] * vector[b]


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


@whole
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
    _inverse(fixed.covariance, work, seen)
    _times(seen, fixed.value, seen_vector)
    _inverse(known.matrix, work, known_covariance)
    for s in range(len(notes.z)):
        value = notes.z[s, first : first + k]
        if not _inverse(notes.cov[s, first : first + k, first : first + k], work, fresh):
            return False
        before.matrix[:] = known.matrix
        _times(known_covariance, known.vector, before.value)
        for a in range(k):
            now_vector = 0.0
            for b in range(k):
                now_vector += fresh[a, b] * value[b]
                known.matrix[a, b] += fresh[a, b] - seen[a, b]
                seen[a, b] = fresh[a, b]
            known.vector[a] += now_vector - seen_vector[a]
            seen_vector[a] = now_vector
        _forget(model, known, before, span, notes, s)
        if not _inverse(known.matrix, work, known_covariance):
            return False
        if span.ends[s] == span.middle:
            middle.matrix[:], middle.vector[:] = known.matrix, known.vector
    return True


def _reseat(posterior: tuple[Array, Array], known: Information, first: int) -> None:
    """The derivatives of one vehicle's mean and covariance become what is known of them."""
    covariance = np.linalg.inv(known.matrix)
    reseat(*posterior, covariance @ known.vector, covariance, first)


def _from_beginning(state: EkfState, i: int) -> Running:
    """A vehicle's filter at the beginning of its window, a batch of one."""
    points, one = state.window.checkpoints, slice(i, i + 1)
    return Running(
        z=room_around(points.z[one, 0]),
        cov=room_around(points.cov[one, 0]),
        noise=one_vehicle(state.noise, i),
        memory=one_vehicle(state.memory, i),
        input_errors=one_vehicle(state.input_errors, i),
        moment_level=one_vehicle(state.moment_level, i),
        coherence=one_vehicle(state.coherence, i),
        moments=room_around(state.moments[one]),
        rows=room_around(points.rows[one, 0]),
        condition=room_around(state.condition[one]),
        samples=room_around(state.samples[one]),
        settling=room_around(state.settling[one]),
        ratios=room_around(state.ratios[one]),
        direction=room_around(state.direction[one]),
    )


def run_window_again(model: Model, state: EkfState, i: int, about: Belief | None = None) -> bool:
    """A vehicle's window again about the present estimate, or ``about`` another: its state and checkpoints become what
    that leaves.

    Returns whether it did: a run that leaves no sound covariance is left out.
    """
    window, points, k = state.window, state.window.checkpoints, state.vector.shape[1]
    first = model.sizes.dynamic
    middle_row, count = int(window.middle[i]), int(window.filled[i])
    parameters = slice(first, first + k)
    value, covariance = about or Belief(state.z[i, parameters].copy(), state.cov[i, parameters, parameters])
    fixed = Belief(value, _NARROW * covariance)
    run = _from_beginning(state, i)
    run.moment_level.mean[:] = run.moment_level.covariance[:] = 0.0
    information = points.information[i, 0].copy()
    known = apart(Information(information, information @ run.z[0, parameters]))
    middle = apart(Information(np.zeros((k, k)), np.zeros(k)))
    reseat(run.z[0], run.cov[0], *fixed, first)
    solved = slice(int(window.solutions[i]))
    span = Span(
        window.ends[i, solved],
        window.keep[i, solved],
        window.resting[i, solved],
        middle_row,
        state.noise.inputs[i],
    )
    rows = recalled(window.rows[i, :count], float(run.rows[0, NEWEST, TIME]))
    notes = run_again(model, run, rows, span.ends)
    if not _put_together(model, fixed, span, notes, known, middle):
        return False
    _reseat((run.z[0], run.cov[0]), known, first)
    for m in range(2):
        innovation_log_variance(model, ByAddress(run), 0, points.log_variance[i, m])
        points.value[i, m], points.covariance[i, m] = fixed.value, state.cov[i, parameters, parameters]
    if middle_row > 0:
        at = int(np.flatnonzero(span.ends == middle_row)[0])
        points.z[i, 1], points.cov[i, 1], points.information[i, 1] = notes.z[at], notes.cov[at], middle.matrix
        _reseat((points.z[i, 1], points.cov[i, 1]), middle, first)
    state.z[i], state.cov[i] = run.z[0], run.cov[0]
    for learned in ("noise", "input_errors", "moment_level"):
        for kept, new in zip(getattr(state, learned), getattr(run, learned), strict=True):
            kept[i] = new[0]
    return True


@whole
def _assess(model, state, places, solved, fresh, again, never):  # type: ignore[no-untyped-def]
    """Notes the solution of every vehicle; finds how many rows are ``fresh`` (-1: the window begins anew), whether the
    window is run ``again``, and whether some of its rows have ``never`` been filtered."""
    first, k, window, kept = model.sizes.dynamic, state.vector.shape[1], state.window, np.ones(2)
    prior_information, ns = 1.0 / (model.prior_std[:k] * model.prior_std[:k]), model.sizes.states
    for m in range(places.size):
        i = places[m]
        fresh[m] = -1
        again[m] = never[m] = False
        count, solutions = window.filled[i], window.solutions[i]
        if np.isnan(solved.keep[m]) or count == 0:
            continue
        if count > window.rows.shape[1] or not np.isfinite(state.cov[i]).all():
            window.rerun[i] = 0
            begin_window(model, state, i)
            continue
        fresh[m] = count - (window.ends[i, solutions - 1] if solutions > 0 else 0)
        window.ends[i, solutions], window.keep[i, solutions] = count, solved.keep[m]
        copy_into(solved.resting[m], window.resting[i, solutions])
        window.solutions[i] += 1
        middle = window.middle[i]
        kept[:] = 1.0
        for s in range(window.solutions[i]):
            kept[1 if 0 < middle < window.ends[i, s] else 0] *= window.keep[i, s]
        if not np.isfinite(window.checkpoints.log_variance[i, 0, 0]):
            first_weights = window.checkpoints.log_variance[i, 0]
            innovation_log_variance(model, state, i, first_weights)
        left_out, fraction = _left_out(model, state, i, first, kept, prior_information)
        spare = _SPARE_ROWS + _SPARE * state.samples[i] - window.rerun[i] - count
        rested = window.resting[i, : window.solutions[i], :ns].all()
        if state.settling[i]:
            window.skipped[i] = count
        elif window.skipped[i] > 0 and not rested:
            window.skipped[i] = 0
            window.rerun[i] += count
            again[m] = never[m] = True
        elif left_out > max(_MATTERS, np.sqrt(solved.gained[m])) and spare >= 0.0:
            window.rerun[i] += count
            again[m] = True
        elif fraction < _MATTERS * _MATTERS and (fraction > _TAUGHT or rested):
            fresh[m] = -1
            begin_window(model, state, i)


@whole
def _advance_all(model, state, places, fresh):  # type: ignore[no-untyped-def]
    """The checkpoints of all vehicles whose window goes on."""
    for m in range(fresh.size):
        if fresh[m] >= 0:
            advance_checkpoints(model, state, places[m], fresh[m])


def relinearise_all(
    model: Model, state: EkfState, places: NDArray[np.int64], solved: Solved
) -> dict[int, Exception]:
    """After a solution: the window is run again where linearisation has left out what matters or the damping of rolling
    has become known, and the checkpoints advance.

    Returns the vehicles whose run failed, and how.

    Few windows are, so what is done with one is put together here from kernels: compiled as a whole for each number
    of states it would take longer than all the filter.
    """
    fresh = np.empty(len(places), dtype=np.int64)
    again, never = np.empty((2, len(places)), dtype=np.bool_)
    packed = ByAddress(state)
    _assess(model, packed, places, solved, fresh, again, never)
    faults: dict[int, Exception] = {}
    for m in np.flatnonzero(again):
        try:
            i = int(places[m])
            _run_again(model, state, i, _before(state, i) if never[m] else None)
        except Exception as error:  # the others are not to suffer by it
            faults[int(places[m])], fresh[m] = error, -1
    for m in np.flatnonzero(_damping_found(model, state, places)):
        i = int(places[m])
        try:
            if fresh[m] >= 0 and _run_again(model, state, i):
                state.window.rerun[i] += state.window.filled[i]
        except Exception as error:
            faults[i], fresh[m] = error, -1
    _advance_all(model, packed, places, fresh)
    return faults


def _before(state: EkfState, i: int) -> Belief:
    """What was known of a vehicle's derivatives before its window."""
    points = state.window.checkpoints
    return Belief(points.value[i, 0].copy(), points.covariance[i, 0].copy())


def _run_again(model: Model, state: EkfState, i: int, about: Belief | None = None) -> bool:
    """``run_window_again``, and what follows from the derivatives' new covariance; returns whether it did."""
    if not run_window_again(model, state, i, about):
        return False
    parameters = slice(model.sizes.dynamic, model.sizes.dynamic + state.vector.shape[1])
    covariance = state.cov[i, parameters, parameters]
    state.information[i] = np.linalg.inv(covariance)
    state.vector[i] = state.information[i] @ state.z[i, parameters]
    informed = np.diag(covariance) < INFORMED * state.variance[i]
    moved_s = float(np.max(state.moved_s[i, : model.sizes.states]))
    state.informed_s[i, informed] = np.maximum(state.informed_s[i, informed], moved_s)
    state.variance[i] = np.diag(covariance)
    return True


def _damping_found(model: Model, state: EkfState, places: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Of which vehicles the damping of rolling is known now and was not before; notes of which it is."""
    if not model.roll or model.sizes.gusts == 0:
        return np.zeros(len(places), dtype=np.bool_)
    before = state.ratios[places]
    damping = model.sizes.dynamic + model.sizes.states + model.sizes.inputs + 1
    errors = np.where(before == ESTIMATED, _STILL_KNOWN, _KNOWN) * np.sqrt(
        state.cov[places, damping, damping]
    )
    known = np.abs(state.z[places, damping]) > errors
    found: NDArray[np.bool_] = known & (before == EXPECTED)
    state.ratios[places] = np.where(before == KEPT, KEPT, np.where(known, ESTIMATED, EXPECTED))
    return found
