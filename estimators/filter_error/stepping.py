"""Gauss-Newton steps of the recursion: a window run again about another point, and filters that have lost their way."""

import copy
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.filter_error.increments import Head, Sums, add_rows, begin_record, carry, input_echo
from wingwatch.estimators.filter_error.lanes import Lanes, Setup, build_lanes, fastest_growth
from wingwatch.estimators.filter_error.recursion import (
    BLOCKS_A_GROUP,
    FASTEST_GROWTH,
    GROUPS,
    MOST_GAINED,
    Filters,
    One,
    Priors,
    Window,
    gained,
    inverse,
    quadratic,
    stabilise,
)

__all__ = ["Trial", "solve_vehicle"]

Array = NDArray[np.float64]

_MOVED = 0.2
"""Standard errors that a derivative may be off the point of linearisation."""

_PROMISED = 1.0
"""Log-likelihood that all parameters together may promise there."""

_LEAST_PROMISE = 1e-3
"""What a step that is to be tried promises at least."""

_WAIT = 4.0
"""Solutions after a refused step until the next is tried, unless it promises twice as much."""

_LONGEST_STEP = 1.5
"""No parameter moves further than this in one step: natural sizes of derivatives, factors of e of noises."""

_PASSES = 2
"""Times that a window is run again for one solution, at most."""

_SAME = 0.04
"""Change of the stability factor from which on the window is run again."""

_TOLERATED = 0.05
"""Cost that a step may add: a window that begins with what is remembered of another point is not quite the same."""

_MOST_DAMPING = 1e3

_FAR = 4.0
"""Move of a parameter beyond which states are not carried along by their sensitivities."""

_WAKES = 8.0
"""Gain of gusts over the window alone, below which it goes on: the gate's."""

_WORSE = 3.0
"""Log-likelihood by which the filter with gusts may be worse than that without: no more than its priors cost."""

_SURPRISED = 6.0
"""Standard deviations of a half second's chi-square that chance does not make."""


@dataclass(frozen=True, slots=True)
class Trial:
    """Memory for a window run again: heads (GROUPS + 1, ...), sums (GROUPS, ...), matrices of one filter."""

    heads: Head
    sums: Sums
    lanes: Lanes


def _run_again(setup: Setup, one: One, p: Array, trial: Trial) -> None:
    """The whole window about another point p; what it begins with goes there by its sensitivities."""
    w, i = one.window, one.i
    head = Head(*(a[GROUPS] for a in trial.heads))
    if w.tally[i, 2] == 1:
        begin_record(head, trial.lanes)
    else:
        for to, source in zip(head, one.head(0), strict=True):
            to[...] = source
        move = p - one.point
        # sensitivities say nothing of a gust that is switched on or off
        move[: p.size - setup.channels][np.abs(move[: p.size - setup.channels]) > _FAR] = 0.0
        carry(setup, head, move)
        head.flags[1] = 0
    own = p[p.size - setup.channels :]
    for g in range(one.groups):
        for array in trial.heads:
            array[g] = array[GROUPS]
        for array in trial.sums:
            array[g] = 0.0
        group = Sums(*(a[g] for a in trial.sums))
        add_rows(setup, trial.lanes, own, head, w.rows[i, g, : w.counts[i, g]], group)


def _level(setup: Setup, window: Window, i: int, level: Array) -> bool:
    """Mean stability factor and turning speeds of a window go to ``level``, its airspeed into its condition; whether
    the factor is another than before."""
    rows = [window.rows[i, g, : window.counts[i, g]] for g in range(window.tally[i, 0])]
    if not rows:
        return False
    before = level[0]
    at = setup.channels + setup.states + 2 * setup.inputs
    mean = np.vstack([r[:, at:] for r in rows]).mean(axis=0)
    level[...] = mean[: level.size]
    window.condition[i, 1] = mean[-2]
    return bool(abs(level[0] / before - 1.0) > _SAME)


def _accept(setup: Setup, one: One, p: Array, trial: Trial) -> None:
    one.point[...] = p
    for to, source in zip(one.heads, trial.heads, strict=True):
        to[...] = source
    for to, source in zip(one.filters.sums, trial.sums, strict=True):
        to[one.i, one.h] = source
    for to, source in zip(one.lanes, trial.lanes, strict=True):
        to[...] = source
    _find_echo(setup, one)


def _trial_cost(one: One, p: Array, trial: Trial) -> float:
    f, i, h = one.filters, one.i, one.h
    off = p - f.centre[i, h]
    moved = trial.sums.samples[: one.groups, 2:].sum(axis=0)
    # to first order the echo is as it was
    echo = float(moved @ (f.echo_cost[i, h, :, 0] + f.echo_score[i, h] @ (p - one.point)))
    found = float(trial.sums.cost[: one.groups].sum()) - echo
    return float(f.cost[i, h, 0] + 0.5 * off @ f.arrival[i, h] @ off) + found


def _asks(priors: Priors, one: One, score: Array, information: Array) -> float:
    """What a full step within reach promises, in log-likelihood; 0 where it would change nothing that matters."""
    covariance = inverse(information)
    move = _within_reach(priors, one, covariance @ score)
    k = one.filters.left.driven.shape[2]
    largest = float(np.max(np.abs(move[:k]) / np.sqrt(np.diagonal(covariance)[:k])))
    promised = float(score @ move - 0.5 * move @ information @ move)
    one.filters.search[one.i, one.h, 1] = largest
    return max(promised, _LEAST_PROMISE) if largest > _MOVED or promised > _PROMISED else 0.0


def _within_reach(priors: Priors, one: One, move: Array) -> Array:
    """A move that ends within reach of the prior."""
    off = one.filters.prior[one.i, one.h] - one.point
    return np.asarray(np.clip(move, off - priors.reach, off + priors.reach))


def _next_point(priors: Priors, one: One, score: Array, information: Array) -> Array:
    """A damped step of limited length, within reach of the prior."""
    damping = one.filters.search[one.i, one.h, 0]
    move = inverse(information + damping * np.diag(np.diagonal(information))) @ score
    bounded = np.isfinite(priors.reach)
    move /= max(float(np.max(np.abs(move[bounded]))) / _LONGEST_STEP, 1.0)
    return one.point + _within_reach(priors, one, move)


def solve_vehicle(
    setup: Setup, priors: Priors, filters: Filters, window: Window, i: int, trial: Trial
) -> None:
    """Move the points of linearisation of vehicle i; each group, see that no filter stays where the other shows it is
    lost.

    A filter with gusts can do what one without does: where it is worse, it has lost its way and goes on from the other.
    A filter for still air in air that is surely not still learns nonsense. It rests, and goes on from the other when
    the last seconds tell the two apart no more.
    """
    if window.tally[i, 0] == 0:
        return
    still, gusty = One(filters, window, i, 0), One(filters, window, i, 1)
    for one in (still, gusty):
        if not _is_sound(one):
            _start_anew(setup, priors, one, trial)
    if window.tally[i, 1] == BLOCKS_A_GROUP:
        if filters.search[i, 0, 5] > 0.0:
            _wake(setup, still, gusty, trial)
        elif gained(filters, window, i) < -_WORSE:
            p = still.point.copy()
            at = _gust(setup)
            p[at] = filters.prior[i, 1, at] - priors.reach[at]
            _go_on_from(setup, gusty, still, p, trial)
    if filters.search[i, 1, 4] > _SURPRISED:
        _try_gusts(setup, gusty, trial)
    _solve(setup, priors, gusty, trial)
    if filters.search[i, 0, 5] == 0.0:
        _solve(setup, priors, still, trial)
        if gained(filters, window, i) >= MOST_GAINED:
            filters.search[i, 0, 5] = 1.0


def _is_sound(one: One) -> bool:
    """Whether the information is that of finite numbers."""
    cost, score, information = quadratic(one)
    if not (math.isfinite(cost) and np.isfinite(score).all() and np.isfinite(information).all()):
        return False
    return bool(np.diagonal(information).min() > 0.0 and np.diagonal(inverse(information)).min() > 0.0)


def _start_anew(setup: Setup, priors: Priors, one: One, trial: Trial) -> None:
    """A filter that is lost knows what it knew before the flight, and reads the window from its beginning."""
    f, i, h = one.filters, one.i, one.h
    f.arrival[i, h] = np.diag(priors.std**-2.0)
    f.centre[i, h] = f.prior[i, h]
    f.cost[i] = 0.0
    f.search[i, h] = 0.0
    for array in f.left:
        array[i, h] = 0.0
    one.window.tally[i, 2] = 1
    p = f.prior[i, h].copy()
    stabilise(setup, p, one.lanes.level)
    _evaluate(setup, one, p, trial)
    _accept(setup, one, p, trial)


def _gust(setup: Setup) -> int:
    """Place of the ln of the gust's intensity."""
    return setup.states * (setup.states + setup.inputs) + setup.channels


def _evaluate(setup: Setup, one: One, p: Array, trial: Trial) -> float:
    """Cost about another point."""
    trial.lanes.level[...] = one.lanes.level
    build_lanes(setup, one.window.condition[one.i], p, trial.lanes)
    _run_again(setup, one, p, trial)
    return _trial_cost(one, p, trial)


def _go_on_from(setup: Setup, one: One, other: One, p: Array, trial: Trial) -> None:
    """One filter becomes the other, but for the point p it is linearised about."""
    f, i = one.filters, one.i
    if not math.isfinite(_evaluate(setup, other, p, trial)):
        return
    for array in f.left:
        array[i, one.h] = array[i, other.h]
    for array in (f.arrival, f.centre, f.cost):
        array[i, one.h] = array[i, other.h]
    at = _gust(setup)
    # the intensity is the one parameter whose prior is not the other's
    f.centre[i, one.h, at] = f.prior[i, one.h, at]
    f.search[i, one.h] = 0.0
    _accept(setup, one, p, trial)


def _wake(setup: Setup, still: One, gusty: One, trial: Trial) -> None:
    """Let a resting filter for still air go on from the one with gusts, if the window does not tell them apart."""
    at = _gust(setup)
    p = gusty.point.copy()
    p[at] = still.filters.prior[still.i, 0, at]
    _evaluate(setup, gusty, p, trial)
    gain = float(trial.sums.cost[: gusty.groups].sum() - gusty.window_cost())
    if gain < _WAKES:
        _go_on_from(setup, still, gusty, p, trial)


def _try_gusts(setup: Setup, one: One, trial: Trial) -> None:
    """Where the last half second surprises, see whether gusts of the expected intensity explain it."""
    f, at = one.filters, _gust(setup)
    p = one.point.copy()
    p[at] = max(p[at], f.prior[one.i, 1, at])
    if p[at] > one.point[at] and _evaluate(setup, one, p, trial) < quadratic(one)[0]:
        _accept(setup, one, p, trial)


def _solve(setup: Setup, priors: Priors, one: One, trial: Trial) -> None:
    """Move the point of linearisation of one filter where the data ask for it; two passes at most."""
    search = one.filters.search[one.i, one.h]
    for _ in range(_PASSES):
        cost, score, information = quadratic(one)
        promised = _asks(priors, one, score, information)
        trial.lanes.level[...] = one.lanes.level
        other = _level(setup, one.window, one.i, trial.lanes.level)
        if promised == 0.0 and not other:
            return
        if search[2] > 0.0 and promised < 2.0 * search[3] and not other:
            search[2] -= 1.0
            return
        p = _next_point(priors, one, score, information)
        better = fastest_growth(setup, p, trial.lanes.level) < FASTEST_GROWTH
        if better:
            build_lanes(setup, one.window.condition[one.i], p, trial.lanes)
            _run_again(setup, one, p, trial)
            found = _trial_cost(one, p, trial)
            better = math.isfinite(found) and (found < cost + _TOLERATED or other)
        if better:
            _accept(setup, one, p, trial)
            search[0] = 0.0 if search[0] < 2e-3 else search[0] / 10.0
            search[2] = search[3] = 0.0
        else:
            search[0] = min(max(5.0 * search[0], 1e-2), _MOST_DAMPING)
            search[2], search[3] = _WAIT, promised
    _, score, information = quadratic(one)
    _asks(priors, one, score, information)


_SETTLING_S = 2.0
"""Time in which gains settle."""

_MEMORY_S = 4.0
"""After this an innovation no longer answers to the noise of one sample."""


def _find_echo(setup: Setup, one: One) -> None:
    """What noise of each input adds at one sample, with the gains as they are now."""
    f, i, h = one.filters, one.i, one.h
    first = 2 + setup.channels
    for u in range(setup.inputs):
        variance = one.window.condition[i, first + u]
        if variance == 0.0:
            continue
        before = math.ceil(_SETTLING_S / one.window.condition[i, 0])
        after = math.ceil(_MEMORY_S / one.window.condition[i, 0])
        rows = np.zeros((before + after, one.window.rows.shape[3]))
        at = setup.channels + setup.states
        rows[:, at + 2 * setup.inputs : at + 2 * setup.inputs + 1 + setup.states] = one.lanes.level
        rows[:, -1] = 1 << u
        loads = math.sqrt(variance) * one.lanes.level[0]
        rows[before, at + u] = loads
        rows[before + int(setup.held[u]), at + setup.inputs + u] = loads
        head = copy.deepcopy(one.head(GROUPS))
        for array in (head.x, head.columns, head.driven):
            array[...] = 0.0
        echo = f.echo_cost[i, h, u], f.echo_score[i, h, u], f.echo_information[i, h, u]
        input_echo(setup, one.lanes, head, rows, echo)
