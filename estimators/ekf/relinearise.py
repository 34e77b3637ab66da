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

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.rerun import Rerun
from wingwatch.estimators.ekf.state import ESTIMATED, EXPECTED, KEPT, EkfState, Model, Solved
from wingwatch.estimators.ekf.window import (
    WINDOW_ROWS,
    advance_checkpoints,
    begin_window,
    innovation_log_variance,
)
from wingwatch.estimators.evidence.information import Belief
from wingwatch.kernels.by_address import ByAddress
from wingwatch.kernels.copying import copy_into
from wingwatch.kernels.decorators import part, whole

__all__ = ["relinearise_all"]

_CURVED = 0.25
"""Curvature of the response within what is not known of the derivatives, beyond which a linear step is no guide."""

_SPARE_ROWS, _SPARE = 4 * WINDOW_ROWS, 0.2
"""Rows that may be run again: a few windows, for when much is learned in a short time, and a fifth of all."""

_KNOWN, _STILL_KNOWN = 4.0, 2.0
"""Standard errors of the damping of rolling in itself, from which on it is known, and below which no longer."""

_MATTERS = 0.1
"""Standard errors that linearisation may be off by: a tenth makes an rms error 0.5 % larger."""

_TAUGHT = 1e-9
"""Fraction of all that is known from which on a window has taught anything: less is rounding."""


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
    rerun: Rerun, state: EkfState, packed: ByAddress, places: NDArray[np.int64], solved: Solved
) -> dict[int, Exception]:
    """After a solution: the window is run again where linearisation has left out what matters or the damping of rolling
    has become known, and the checkpoints advance.

    ``packed``: the state by address. Returns the vehicles whose run failed, and how.
    """
    fresh = np.empty(len(places), dtype=np.int64)
    again, never = np.empty((2, len(places)), dtype=np.bool_)
    model = rerun.by_address
    _assess(model, packed, places, solved, fresh, again, never)
    faults: dict[int, Exception] = {}
    for m in np.flatnonzero(again):
        try:
            rerun.window_and_account(state, int(places[m]), packed, before=bool(never[m]))
        except Exception as error:  # the others are not to suffer by it
            faults[int(places[m])], fresh[m] = error, -1
    for m in np.flatnonzero(_damping_found(rerun.model, state, places)):
        i = int(places[m])
        try:
            if fresh[m] >= 0 and rerun.window_and_account(state, i, packed):
                state.window.rerun[i] += state.window.filled[i]
        except Exception as error:
            faults[i], fresh[m] = error, -1
    _advance_all(model, packed, places, fresh)
    return faults


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
