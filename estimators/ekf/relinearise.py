"""Running the last stretch again about better values.

The filter linearises the products of derivatives and states about what it knows at the moment, and what it has taken in
so it keeps. Early in an excited stretch that is little: the estimate moves with the noise, and answers to the start.
So the last seconds of signal rows are kept, with the filter's state at their beginning and amid them (marks), and when
it matters they are run again with the derivatives held at the present estimate theta*:

- theta* has a narrow covariance e P there, so it stays where it is, and the states follow p(x | theta*) of the mark.
  What the rows say of theta in this run, J = S^-1 - (e P)^-1 and h = S^-1 m - (e P)^-1 theta* for mean m and
  covariance S after it, is one step of Gauss and Newton on the likelihood of the innovations (thesis 5.3): its score,
  sensitivities that depend on the past alone times white innovations, has no mean at the truth.
- J and h of each half second go into the information that the mark had, in the place of what was first learned, then
  comes what the solution did there: resting inputs, information that was none, forgetting. No row counts twice.
- At the end the derivatives get their mean and covariance so, the states keep their regression on them.

It matters by how much the response bends. With J of the stretch, and theta known about the point of linearisation to
within covariance L (now P), the first-order change of the predicted readings between the two has the square
m = d' J d + tr J (L - P), in their noise, and the whole response r^2 = theta' J theta. Its curvature is about 1 / r
(Bates and Watts, J. Roy. Stat. Soc. B 42, 1980), so what linearisation left out is as long as m / (2 r), in noise
again, at most: an rms of m / (2 r sqrt(k)) standard errors over k derivatives, times the root of the share that the
stretch has in all that is known. What the rows said was also weighted by the noise levels of the moment, which the
misfit of a wrong start makes too large; it matters where the stated errors, which go with the root of the innovations'
variances, are off by as much, the share that the stretch has. While an input acts, the next half second moves the
estimate by the root of the share of all information that such a half second gives: what is less than that can wait.
A stretch that has taught too little for all of it to matter begins anew, and where the rows before the second mark are
not what matters, the run begins there.

A step of Gauss and Newton is a guide only where the response is straight within what is not known yet: tr J P / (2 r)
at most a quarter. Quiet flight, where J is what noise pretends, and a derivative just set free are left alone so.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.estimators.ekf.covariance import inverse_of, reseat
from wingwatch.estimators.ekf.inputs import pretended
from wingwatch.estimators.ekf.kernel import run_again
from wingwatch.estimators.ekf.solve import controls_of
from wingwatch.estimators.ekf.stretch import STRETCH_ROWS, Singles, advance_marks, mark, recalled, weigh
from wingwatch.estimators.kernels.symmetric import invert

__all__ = ["relinearise_all", "run_stretch_again"]

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Sizes = tuple[tuple[int, ...], ...]

_BENT = 0.25
"""Curvature of the response within what is not known of the derivatives, beyond which a linear step is no guide."""

_NARROW = 1e-4
"""Variance of the derivatives in a run about a fixed point, over what is known of them: a hundredth of an error."""

_SPARE_ROWS, _SPARE = 4 * STRETCH_ROWS, 0.2
"""Rows that may be run again: a few stretches, for when much is learned in a short time, and a fifth of all."""

_MATTERS = 0.1
"""Standard errors that linearisation may be off by: a tenth makes an rms error 0.5 % larger."""

_TAUGHT = 1e-9
"""Share in all that is known from which on a stretch has taught anything: less is rounding."""


@njit(cache=True)
def _said(value, present, later, about, kept, faded, prior_information):  # type: ignore[no-untyped-def]
    """Of the rows from a mark to a later time: m, r^2 and tr J P of the header; see there.

    Args:
        value, present: of the derivatives now: mean and covariance.
        later: information at the later time.
        about: of the mark.
        kept, faded: share of information that forgetting has left from the mark to then, and from then to now.
        prior_information: of each derivative, (k,).
    """
    k = value.size
    moved = strength = share = 0.0
    for a in range(k):
        for b in range(k):
            gained = later[a, b] - kept * about[a, 1 + k + b]
            if a == b:
                gained -= (1.0 - kept) * prior_information[a]
            off = (value[a] - about[a, 0]) * (value[b] - about[b, 0])
            moved += gained * (off + about[a, 1 + b] - present[a, b])
            strength += gained * value[a] * value[b]
            share += gained * present[a, b]
    return faded * moved, faded * strength, faded * share


@njit(cache=True)
def _left_out(value, present, information, about, weighed, noise, kept, prior_information, marks):  # type: ignore[no-untyped-def]
    """What linearisation has left out of the stretch, in standard errors; the part of it before the second mark; and
    the stretch's share; see above.

    Args:
        value, present, information: of the derivatives now: mean, covariance and its inverse.
        about, weighed: of ``EkfState``, one vehicle; noise: now.
        kept: share of information that forgetting has left from each mark to the next, or now, (2,).
        prior_information: of each derivative, (k,).
        marks: how many are set, 1 or 2.
    """
    k = value.size
    now = np.empty(weighed.shape[1])
    weigh(noise, now)
    moved, strength, share, off = np.zeros(2), 0.0, 0.0, np.zeros(2)
    for m in range(marks):
        last = m == marks - 1
        later = information if last else about[1, :, 1 + k :]
        moved[m], power, known = _said(
            value, present, later, about[m], kept[m], 1.0 if last else kept[1], prior_information
        )  # fmt: skip
        strength += power
        share += known
        off[m] = 0.5 * known / k * np.max(np.abs(now - weighed[m]))
    if not (strength > 0.0 and 0.0 < share <= 2.0 * _BENT * np.sqrt(strength)):
        return 0.0, 0.0, share / k
    share = min(share / k, 1.0)
    moved *= 0.5 * np.sqrt(share / (strength * k))
    return max(off.sum(), moved.sum()), max(off[0], moved[0]), share


@njit(cache=True)
def _inverse(matrix, room, out):  # type: ignore[no-untyped-def]
    """Inverse of a symmetric matrix into ``out``; returns whether the matrix is positive definite and finite."""
    n = matrix.shape[0]
    for a in range(n):
        for b in range(n):
            room[a, b] = matrix[a, b]
    invert(room, out)
    sound = True
    for a in range(n):
        sound = sound and 0.0 < room[a, a] < np.inf
    return sound


@njit(cache=True)
def _times(matrix, vector, out):  # type: ignore[no-untyped-def]
    for a in range(out.size):
        out[a] = 0.0
        for b in range(vector.size):
            out[a] += matrix[a, b] * vector[b]


@njit(cache=True)
def _take_back(information, vector, known, chosen):  # type: ignore[no-untyped-def]
    """Resting inputs: the marginal of their derivatives is again that of ``known``, a covariance and a mean.

    A density times the ratio of two marginals of C: to the information of C comes that of the one, less that of the
    other, each the inverse of its covariance.
    """
    k, m = vector.size, chosen.size
    room, now, mean = np.empty((k, k)), np.empty((k, k)), np.empty(k)
    _inverse(information, room, now)
    _times(now, vector, mean)
    old, new = inverse_of(known[0], chosen), inverse_of(now, chosen)
    for a in range(m):
        for b in range(m):
            information[chosen[a], chosen[b]] += old[a, b] - new[a, b]
            vector[chosen[a]] += old[a, b] * known[1][chosen[b]] - new[a, b] * mean[chosen[b]]


@njit(cache=True)
def _fold(  # type: ignore[no-untyped-def]
    information, vector, note, moments, echo, input_variance, prior_information, prior_value, ns, less, known
):
    """What a solution does to what is known: resting inputs (``known`` before the half second), information that was
    none, forgetting."""
    resting = note[2:] == 1.0
    pretended(echo, moments, input_variance, resting, ns, less)
    if resting.any():
        _take_back(information, vector, known, controls_of(resting, ns, input_variance.size))
    keep = note[1]
    for a in range(vector.size):
        vector[a] *= keep
        for b in range(vector.size):
            information[a, b] = keep * (information[a, b] - less[a, b])
        information[a, a] += (1.0 - keep) * prior_information[a]
        vector[a] += (1.0 - keep) * prior_information[a] * prior_value[a]
    for a in range(vector.size):
        for b in range(a):
            information[a, b] = information[b, a] = 0.5 * (information[a, b] + information[b, a])


@njit(cache=True)
def _put_together(  # type: ignore[no-untyped-def]
    star, narrow, noted_z, noted_cov, noted_moments, noted_echo, solved, cut, information, vector, middle,
    middle_vector, input_variance, prior_information, prior_value, first, ns,
):  # fmt: skip
    """Half second by half second, what the run about ``star`` says joins what is known.

    Args:
        star, narrow: the fixed point and its covariance at the run's beginning.
        noted_z, ..., noted_echo: of ``run_again``.
        solved: what the solutions did, of ``EkfState``, as many.
        cut: rows before the second mark.
        information, vector: of the derivatives at the beginning, become those at the end; into ``middle``,
            ``middle_vector`` go those at the second mark.
        input_variance, prior_information, prior_value, first, ns: of the filter.

    Returns:
        whether all of it is sound.
    """
    k = star.size
    room, seen, fresh, less, before = (
        np.empty((k, k)), np.empty((k, k)), np.empty((k, k)), np.empty((k, k)), np.empty((k, k)),
    )  # fmt: skip
    told, mean = np.empty(k), np.empty(k)
    _inverse(narrow, room, seen)
    _times(seen, star, told)
    _inverse(information, room, before)
    for s in range(len(noted_z)):
        value = noted_z[s, first : first + k]
        if not _inverse(noted_cov[s, first : first + k, first : first + k], room, fresh):
            return False
        _times(before, vector, mean)
        for a in range(k):
            now_told = 0.0
            for b in range(k):
                now_told += fresh[a, b] * value[b]
                information[a, b] += fresh[a, b] - seen[a, b]
                seen[a, b] = fresh[a, b]
            vector[a] += now_told - told[a]
            told[a] = now_told
        _fold(
            information, vector, solved[s], noted_moments[s], noted_echo[s], input_variance, prior_information,
            prior_value, ns, less, (before, mean),
        )  # fmt: skip
        if not _inverse(information, room, before):
            return False
        if int(solved[s, 0]) == cut:
            middle[:], middle_vector[:] = information, vector
    return True


def run_stretch_again(
    known_sizes: Sizes, fixed: Any, prior_value: Array, prior_information: Array, z: Array, cov: Array, noise: Array,
    slow: Array, echo: Array, counts: Counts, stretch: Singles, tally: Counts, solved: Array, marks_z: Array,
    marks_cov: Array, marks_rows: Array, weighed: Array, about: Array, first: int, start: int,
) -> bool:  # fmt: skip
    """The stretch from mark ``start`` on again about the present estimate: z, cov, noise, slow, echo and the marks
    become what it leaves.

    Returns whether it did: a run that leaves no sound covariance is left out.
    """
    k, ns, cut = about.shape[1], len(known_sizes[0]), int(tally[1])
    begin = cut if start == 1 else 0
    star = z[first : first + k].copy()
    narrow = _NARROW * cov[first : first + k, first : first + k]
    new_z, new_cov, last_rows, new_echo, again = (
        marks_z[start].copy(), marks_cov[start].copy(), marks_rows[start].copy(), echo.copy(), counts.copy(),
    )  # fmt: skip
    new_noise, new_slow = noise.copy(), slow.copy()
    information = about[start, :, 1 + k :].copy()
    vector = information @ new_z[first : first + k]
    middle, middle_vector = np.zeros((k, k)), np.zeros(k)
    reseat(new_z, new_cov, star, narrow, first)
    notes = solved[: tally[2]]
    notes = notes[notes[:, 0] > begin]
    ends = notes[:, 0].astype(np.int64) - begin
    again_rows = recalled(stretch[begin:], int(tally[0]) - begin, float(last_rows[0, 0]))
    noted = run_again(
        known_sizes, again_rows, ends, fixed, new_z, new_cov, new_noise, new_slow, last_rows, new_echo, again
    )  # fmt: skip
    if not _put_together(
        star, narrow, *noted, notes, cut, information, vector, middle, middle_vector, fixed.input_variance,
        prior_information, prior_value, first, ns,
    ):  # fmt: skip
        return False
    known = np.linalg.inv(information)
    reseat(new_z, new_cov, known @ vector, known, first)
    for m in range(start, 2):
        weigh(new_noise, weighed[m])
        about[m, :, 0], about[m, :, 1 : 1 + k] = star, cov[first : first + k, first : first + k]
    if start == 0 < cut:
        at = int(np.flatnonzero(ends == cut)[0])
        marks_z[1], marks_cov[1], about[1, :, 1 + k :] = noted[0][at], noted[1][at], middle
        known = np.linalg.inv(middle)
        reseat(marks_z[1], marks_cov[1], known @ middle_vector, known, first)
    z[:], cov[:], noise[:], slow[:], echo[:], counts[2] = (
        new_z,
        new_cov,
        new_noise,
        new_slow,
        new_echo,
        again[2],
    )
    return True


@njit(cache=True)
def _assess(  # type: ignore[no-untyped-def]
    first, prior_information, z, cov, noise, rows, information, counts, done, stretch, tally, solved, marks_z,
    marks_cov, marks_rows, weighed, about, fresh, matters,
):  # fmt: skip
    """Notes the solution of every vehicle; finds how many rows are ``fresh`` (-1: the stretch begins anew) and from
    which mark on it ``matters`` to run the stretch again (-1: from none)."""
    k, kept = prior_information.size, np.ones(2)
    for i in range(z.shape[0]):
        fresh[i] = matters[i] = -1
        count, solutions = tally[i, 0], tally[i, 2]
        if np.isnan(done[i, 0]) or count == 0:
            continue
        if count > stretch.shape[1] or not np.isfinite(cov[i]).all():
            tally[i] = 0
            mark(
                0, z[i], cov[i], noise[i], rows[i], first, information[i], marks_z[i], marks_cov[i], marks_rows[i],
                weighed[i], about[i],
            )  # fmt: skip
            continue
        fresh[i] = count - (int(solved[i, solutions - 1, 0]) if solutions > 0 else 0)
        solved[i, solutions, 0], solved[i, solutions, 1], solved[i, solutions, 2:] = (
            count,
            done[i, 0],
            done[i, 2:],
        )
        tally[i, 2] += 1
        cut = tally[i, 1]
        kept[:] = 1.0
        for s in range(tally[i, 2]):
            kept[1 if 0 < cut < solved[i, s, 0] else 0] *= solved[i, s, 1]
        if not np.isfinite(weighed[i, 0, 0]):
            weigh(noise[i], weighed[i, 0])
        left_out, before, share = _left_out(
            z[i, first : first + k], cov[i, first : first + k, first : first + k], information[i], about[i],
            weighed[i], noise[i], kept, prior_information, 2 if cut > 0 else 1,
        )  # fmt: skip
        start = 1 if 0 < cut < count and before <= _MATTERS else 0
        again = count - cut if start == 1 else count
        spare = _SPARE_ROWS + _SPARE * counts[i, 0] - tally[i, 3] - again
        if left_out > max(_MATTERS, np.sqrt(done[i, 1])) and spare >= 0.0:
            tally[i, 3] += again
            matters[i] = start
        elif _TAUGHT < share < _MATTERS * _MATTERS:
            fresh[i], tally[i, :3] = -1, 0
            mark(
                0, z[i], cov[i], noise[i], rows[i], first, information[i], marks_z[i], marks_cov[i], marks_rows[i],
                weighed[i], about[i],
            )  # fmt: skip


@njit(cache=True)
def _advance_all(  # type: ignore[no-untyped-def]
    first, z, cov, noise, rows, information, stretch, tally, solved, marks_z, marks_cov, marks_rows, weighed, about,
    fresh,
):  # fmt: skip
    """The marks of all vehicles whose stretch goes on."""
    for i in range(z.shape[0]):
        if fresh[i] >= 0:
            advance_marks(
                z[i], cov[i], noise[i], rows[i], information[i], stretch[i], tally[i], solved[i], marks_z[i],
                marks_cov[i], marks_rows[i], weighed[i], about[i], first, fresh[i],
            )  # fmt: skip


def relinearise_all(
    known_sizes: Sizes, fixed: Any, prior_value: Array, prior_std: Array, z: Array, cov: Array, noise: Array,
    slow: Array, rows: Array, variance: Array, information: Array, vector: Array, echo: Array, counts: Counts,
    done: Array, stretch: Singles, tally: Counts, solved: Array, marks_z: Array, marks_cov: Array, marks_rows: Array,
    weighed: Array, about: Array,
) -> None:  # fmt: skip
    """After a solution: the stretch is run again where linearisation has left out what matters, and the marks advance.

    Few stretches are, so what is done with one is put together here from kernels: compiled as a whole for each number
    of states it would take longer than all the filter.

    Args:
        known_sizes: of ``hot.sizes``: states, inputs, states of the air.
        fixed: of the filter; prior_value, prior_std: of derivatives and constants.
        z, ..., counts, stretch, ..., about: of ``EkfState``, all vehicles.
        done: of ``solve_all``.
    """
    k, first = variance.shape[1], len(known_sizes[0]) + len(known_sizes[2])
    prior_information = 1.0 / (prior_std[:k] * prior_std[:k])
    fresh, matters = np.empty(len(z), dtype=np.int64), np.empty(len(z), dtype=np.int64)
    _assess(
        first, prior_information, z, cov, noise, rows, information, counts, done, stretch, tally, solved, marks_z,
        marks_cov, marks_rows, weighed, about, fresh, matters,
    )  # fmt: skip
    for i in np.flatnonzero(matters >= 0):
        if run_stretch_again(
            known_sizes, fixed, prior_value[:k], prior_information, z[i], cov[i], noise[i], slow[i], echo[i],
            counts[i], stretch[i], tally[i], solved[i], marks_z[i], marks_cov[i], marks_rows[i], weighed[i],
            about[i], first, int(matters[i]),
        ):  # fmt: skip
            parameters = cov[i, first : first + k, first : first + k]
            information[i] = np.linalg.inv(parameters)
            vector[i] = information[i] @ z[i, first : first + k]
            variance[i] = np.diag(parameters)
    _advance_all(
        first, z, cov, noise, rows, information, stretch, tally, solved, marks_z, marks_cov, marks_rows, weighed, about,
        fresh,
    )  # fmt: skip
