"""The recursion: a window of samples, what came before it as an arrival cost, and Gauss-Newton steps, compiled.

Every vehicle has two filters, one for still air and one with gusts, and each of them

    arrival     c + (p - mu)' La (p - mu) / 2, what has left the window, after random walks towards the prior,
    groups      of 2 s, each with its cost, score and information at the point p_0 of linearisation,
    marks       where the filters stood before each group, so that the window can be run again about another point.

docs/methods/filter_error.md, section 9, has the equations.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.estimators.kalman.increments import Head, Sums, add_rows, begin_record
from wingwatch.estimators.kalman.lanes import Lanes, build_lanes, fastest_growth

__all__ = [
    "BLOCKS_A_GROUP",
    "GROUPS",
    "Evidence",
    "Filters",
    "Priors",
    "absorb_all",
    "add_block",
    "begin",
    "current",
    "quadratic",
    "solve_filter",
]

Array = NDArray[np.float64]

GROUPS = 6
"""Groups in a window: 12 s at most, 10 s at least, some ten periods of a short period."""

BLOCKS_A_GROUP = 4
"""Half seconds in a group: 2 s, longer than the modes and shorter than a manoeuvre."""

_MOVED = 0.2
"""Standard errors that a derivative may be off the point of linearisation; all other parameters may be twice that."""

_LONGEST_STEP = 1.5
"""No parameter moves further than this in one step: natural sizes of derivatives, factors of e of noises."""

_PASSES = 2
"""Times that a window is run again for one solution, at most."""

_FASTEST_GROWTH = 1.0
"""Motion that grows faster than this, 1/s, is none of an aircraft that is flown."""

_SAME = 0.04
"""Change of the stability factor from which on the window is run again."""

_TOLERATED = 0.05
"""Cost that a step may add: a window that begins with what is remembered of another point is not quite the same."""

_MOST_DAMPING = 1e3


class Priors(NamedTuple):
    """Of all parameters, constants of readings last: standard deviation, variance of the random walk per second,
    (size,) each; and how far from the prior's mean each may be looked for, (size,)."""

    std: Array
    walk: Array
    reach: Array


class Evidence(NamedTuple):
    """What the guards need of groups that have left the window, fading as information does.

    Attributes:
        driven, driven_square: information of what surfaces drive, with weights and their squares, (k, k).
        driven_vector, cross: its score at p = 0 and its information with all parameters, (k,), (k, size).
        products, squares: of innovations, (LAGS, channels, channels).
        scatter, information: of the groups' scores: their outer products and their information, (size, size).
        groups: how many they are, (1,).
    """

    driven: Array
    driven_square: Array
    driven_vector: Array
    cross: Array
    products: Array
    squares: Array
    scatter: Array
    information: Array
    groups: Array


class Filters(NamedTuple):
    """Both filters of all vehicles; first axes: vehicles, still air or gusts.

    Attributes:
        lanes: matrices at the point of linearisation.
        heads: where the filters stood before each group, and now (the last), (GROUPS + 1,).
        sums: of each group, (GROUPS,).
        point: p_0, (size,); prior: mean, (size,).
        arrival: La, (size, size); centre: mu, (size,); cost: c, (1,).
        left: evidence of groups that have left.
        search: damping of the next step; expected move of the derivatives, in standard errors.
    """

    lanes: Lanes
    heads: Head
    sums: Sums
    point: Array
    prior: Array
    arrival: Array
    centre: Array
    cost: Array
    left: Evidence
    search: Array


class Window(NamedTuple):
    """The samples of all vehicles' windows.

    Attributes:
        rows: (vehicles, GROUPS, samples, row_width); counts: of rows, (vehicles, GROUPS).
        tally: groups in use, blocks in the last of them, whether the first of them begins a record, (vehicles, 3).
        condition: of ``build_lanes``, (vehicles, 2 + channels + inputs).
    """

    rows: Array
    counts: NDArray[np.int64]
    tally: NDArray[np.int64]
    condition: Array


__all__ += ["Window"]


@njit(cache=True)
def head_of(heads, i, h, g):  # type: ignore[no-untyped-def]
    """Views of one head."""
    return Head(
        heads.x[i, h, g], heads.covariance[i, h, g], heads.gain[i, h, g], heads.spread[i, h, g],
        heads.columns[i, h, g], heads.driven[i, h, g], heads.late[i, h, g], heads.before[i, h, g],
        heads.flags[i, h, g],
    )  # fmt: skip


@njit(cache=True)
def sums_of(sums, i, h, g):  # type: ignore[no-untyped-def]
    """Views of one group's sums."""
    return Sums(
        sums.cost[i, h, g], sums.score[i, h, g], sums.information[i, h, g], sums.driven[i, h, g],
        sums.driven_score[i, h, g], sums.cross[i, h, g], sums.products[i, h, g], sums.squares[i, h, g],
        sums.samples[i, h, g],
    )  # fmt: skip


@njit(cache=True)
def lanes_of(lanes, i, h):  # type: ignore[no-untyped-def]
    """Views of one filter's matrices."""
    return Lanes(
        lanes.transition[i, h], lanes.noise[i, h], lanes.early[i, h], lanes.late[i, h], lanes.output[i, h],
        lanes.variance[i, h], lanes.theta[i, h], lanes.start[i, h], lanes.count[i, h], lanes.where[i, h],
        lanes.surface_noise[i, h], lanes.surface_variance[i, h], lanes.level[i, h],
    )  # fmt: skip


@njit(cache=True)
def _copy_head(to, source):  # type: ignore[no-untyped-def]
    to.x[:] = source.x
    to.covariance[:] = source.covariance
    to.gain[:] = source.gain
    to.spread[:] = source.spread
    to.columns[:] = source.columns
    to.driven[:] = source.driven
    to.late[:] = source.late
    to.before[:] = source.before
    to.flags[:] = source.flags


@njit(cache=True)
def _copy_sums(to, source):  # type: ignore[no-untyped-def]
    to.cost[:] = source.cost
    to.score[:] = source.score
    to.information[:] = source.information
    to.driven[:] = source.driven
    to.driven_score[:] = source.driven_score
    to.cross[:] = source.cross
    to.products[:] = source.products
    to.squares[:] = source.squares
    to.samples[:] = source.samples


@njit(cache=True)
def _clear_sums(sums):  # type: ignore[no-untyped-def]
    sums.cost[:] = 0.0
    sums.score[:] = 0.0
    sums.information[:] = 0.0
    sums.driven[:] = 0.0
    sums.driven_score[:] = 0.0
    sums.cross[:] = 0.0
    sums.products[:] = 0.0
    sums.squares[:] = 0.0
    sums.samples[:] = 0.0


@njit(cache=True)
def begin(setup, filters, window, i):  # type: ignore[no-untyped-def]
    """A record begins: matrices at the present point, no group yet."""
    size = filters.point.shape[2] - setup.channels
    for h in range(2):
        filters.point[i, h, size:] = filters.centre[i, h, size:]
        lanes = lanes_of(filters.lanes, i, h)
        build_lanes(setup, window.condition[i], filters.point[i, h], lanes)
        begin_record(head_of(filters.heads, i, h, GROUPS), lanes)
        filters.search[i, h, 0] = 0.0
    window.tally[i] = 0
    window.tally[i, 2] = 1
    window.counts[i] = 0


@njit(cache=True)
def add_block(setup, priors, filters, window, i, block):  # type: ignore[no-untyped-def]
    """Half a second of rows (samples, row_width) of vehicle i; a full window lets its oldest group go first."""
    tally = window.tally[i]
    if tally[0] == 0 or tally[1] == BLOCKS_A_GROUP:
        if tally[0] == GROUPS:
            absorb(setup, priors, filters, window, i)
        for h in range(2):
            _copy_head(head_of(filters.heads, i, h, tally[0]), head_of(filters.heads, i, h, GROUPS))
            _clear_sums(sums_of(filters.sums, i, h, tally[0]))
        window.counts[i, tally[0]] = 0
        tally[0] += 1
        tally[1] = 0
    g = tally[0] - 1
    first = window.counts[i, g]
    window.rows[i, g, first : first + block.shape[0]] = block
    window.counts[i, g] += block.shape[0]
    tally[1] += 1
    size = filters.point.shape[2] - setup.channels
    for h in range(2):
        own = filters.point[i, h, size:]
        head = head_of(filters.heads, i, h, GROUPS)
        add_rows(setup, lanes_of(filters.lanes, i, h), own, head, block, sums_of(filters.sums, i, h, g))


@njit(cache=True)
def quadratic(filters, window, i, h):  # type: ignore[no-untyped-def]
    """Cost at the point of linearisation, its gradient downwards and its information, arrival and window together."""
    point, groups = filters.point[i, h], window.tally[i, 0]
    off = filters.centre[i, h] - point
    information = filters.arrival[i, h].copy()
    pull = information @ off
    cost = filters.cost[i, h, 0] + 0.5 * np.sum(off * pull)
    score = pull.copy()
    for g in range(groups):
        cost += filters.sums.cost[i, h, g, 0]
        score += filters.sums.score[i, h, g]
        information += filters.sums.information[i, h, g]
    return cost, score, information


@njit(cache=True)
def current(filters, window, i, h):  # type: ignore[no-untyped-def]
    """Least cost, where it is, and the covariance there, by the quadratic."""
    cost, score, information = quadratic(filters, window, i, h)
    covariance = _inverse(information)
    move = covariance @ score
    return cost - 0.5 * np.sum(score * move), filters.point[i, h] + move, covariance


@njit(cache=True)
def _inverse(matrix):  # type: ignore[no-untyped-def]
    """Of a positive definite matrix of mixed units, symmetric."""
    size = matrix.shape[0]
    root = np.empty(size)
    for a in range(size):
        root[a] = 1.0 / np.sqrt(matrix[a, a])
    scaled = np.empty((size, size))
    for a in range(size):
        for b in range(size):
            scaled[a, b] = 0.5 * (matrix[a, b] + matrix[b, a]) * root[a] * root[b]
    inverse = np.linalg.inv(scaled)
    for a in range(size):
        for b in range(a + 1):
            value = 0.5 * (inverse[a, b] + inverse[b, a]) * root[a] * root[b]
            inverse[a, b] = value
            inverse[b, a] = value
    return inverse


@njit(cache=True)
def absorb(setup, priors, filters, window, i):  # type: ignore[no-untyped-def]
    """The window's oldest group goes into the arrival cost, which then walks; the others move up."""
    groups = window.tally[i, 0]
    seconds = window.counts[i, 0] * window.condition[i, 0]
    fade = 1.0
    for h in range(2):
        fade = _absorb_group(priors, filters, window, i, h, seconds)
        for g in range(groups - 1):
            _copy_head(head_of(filters.heads, i, h, g), head_of(filters.heads, i, h, g + 1))
            _copy_sums(sums_of(filters.sums, i, h, g), sums_of(filters.sums, i, h, g + 1))
    # only the difference counts, and it fades as the information of the filter with gusts does
    filters.cost[i, 0, 0] = fade * (filters.cost[i, 0, 0] - filters.cost[i, 1, 0])
    filters.cost[i, 1, 0] = 0.0
    for g in range(groups - 1):
        window.rows[i, g] = window.rows[i, g + 1]
        window.counts[i, g] = window.counts[i, g + 1]
    window.tally[i, 0] -= 1
    window.tally[i, 2] = 0


@njit(cache=True)
def absorb_all(setup, priors, filters, window, i):  # type: ignore[no-untyped-def]
    """A record has ended: all of its groups; constants of the readings are unknown again."""
    while window.tally[i, 0] > 0:
        absorb(setup, priors, filters, window, i)
    size, whole = filters.point.shape[2] - setup.channels, filters.point.shape[2]
    for h in range(2):
        kept = _inverse(filters.arrival[i, h])
        kept[size:] = 0.0
        kept[:, size:] = 0.0
        for a in range(size, whole):
            kept[a, a] = priors.std[a] ** 2
        filters.arrival[i, h] = _inverse(kept)
        filters.centre[i, h, size:] = 0.0
        # what crossed with the constants does so no more
        filters.left.cross[i, h, :, size:] = 0.0


@njit(cache=True)
def _absorb_group(priors, filters, window, i, h, seconds):  # type: ignore[no-untyped-def]
    _, estimate, _ = current(filters, window, i, h)
    sums, point = sums_of(filters.sums, i, h, 0), filters.point[i, h]
    _remember(filters.left, sums, point, estimate, i, h)
    off = filters.centre[i, h] - point
    pull = filters.arrival[i, h] @ off
    cost = filters.cost[i, h, 0] + sums.cost[0] + 0.5 * np.sum(off * pull)
    information = filters.arrival[i, h] + sums.information
    covariance = _inverse(information)
    score = pull + sums.score
    move = covariance @ score
    filters.cost[i, h, 0] = cost - 0.5 * np.sum(score * move)
    centre = point + move
    k = sums.driven_score.size
    size = centre.size
    kept, fade = np.empty(size), 0.0
    for a in range(size):
        # a random walk towards the prior, so that nothing is ever less known than before the flight
        gained = priors.walk[a] * seconds
        kept[a] = np.sqrt(max(1.0 - gained / priors.std[a] ** 2, 0.0))
        if a < k:
            fade += np.log(covariance[a, a] / (covariance[a, a] + gained)) / k
    fade = np.exp(fade)
    for a in range(size):
        for b in range(size):
            covariance[a, b] *= kept[a] * kept[b]
        covariance[a, a] += (1.0 - kept[a] ** 2) * priors.std[a] ** 2
        filters.centre[i, h, a] = filters.prior[i, h, a] + kept[a] * (centre[a] - filters.prior[i, h, a])
    filters.arrival[i, h] = _inverse(covariance)
    _fade(filters.left, i, h, fade)
    return fade


@njit(cache=True)
def _remember(left, sums, point, estimate, i, h):  # type: ignore[no-untyped-def]
    """Add a group to the guards' evidence."""
    left.driven[i, h] += sums.driven
    left.driven_square[i, h] += sums.driven
    left.driven_vector[i, h] += sums.driven_score + sums.cross @ point
    left.cross[i, h] += sums.cross
    left.products[i, h] += sums.products
    left.squares[i, h] += sums.squares
    score = sums.score - sums.information @ (estimate - point)
    for a in range(score.size):
        for b in range(score.size):
            left.scatter[i, h, a, b] += score[a] * score[b]
    left.information[i, h] += sums.information
    left.groups[i, h] += 1.0


@njit(cache=True)
def _fade(left, i, h, fade):  # type: ignore[no-untyped-def]
    left.driven[i, h] *= fade
    left.driven_square[i, h] *= fade * fade
    left.driven_vector[i, h] *= fade
    left.cross[i, h] *= fade
    left.products[i, h] *= fade
    left.squares[i, h] *= fade * fade
    left.scatter[i, h] *= fade
    left.information[i, h] *= fade
    left.groups[i, h] *= fade


@njit(cache=True)
def _run_again(setup, lanes, filters, window, i, h, p, trial):  # type: ignore[no-untyped-def]
    """The whole window about another point p; heads and sums go to ``trial`` (one vehicle, one filter).

    What the window begins with goes to the new point by its sensitivities.
    """
    heads, sums = trial
    groups, size = window.tally[i, 0], p.size - setup.channels
    head = head_of(heads, 0, 0, GROUPS)
    if window.tally[i, 2] == 1:
        begin_record(head, lanes)
    else:
        _copy_head(head, head_of(filters.heads, i, h, 0))
        _carry(setup, head, p - filters.point[i, h])
        head.flags[1] = 0
    for g in range(groups):
        _copy_head(head_of(heads, 0, 0, g), head)
        group = sums_of(sums, 0, 0, g)
        _clear_sums(group)
        add_rows(setup, lanes, p[size:], head, window.rows[i, g, : window.counts[i, g]], group)


@njit(cache=True)
def _carry(setup, head, move):  # type: ignore[no-untyped-def]
    """States at parameters ``move`` away, by their sensitivities."""
    n, width = head.x.shape
    few = head.driven.shape[1]
    for j in range(n):
        shift = 0.0
        for lane in range(1, width):
            shift += (head.x[j, lane] - head.x[j, 0]) / setup.step[lane - 1] * move[lane - 1]
        for q in range(setup.channels):
            shift -= head.columns[j, q] * move[width - 1 + q]
        for lane in range(width):
            head.x[j, lane] += shift
    for j in range(setup.states):
        shift = 0.0
        for lane in range(1, few):
            shift += (head.driven[j, lane] - head.driven[j, 0]) / setup.step[lane - 1] * move[lane - 1]
        for lane in range(few):
            head.driven[j, lane] += shift


@njit(cache=True)
def _level(setup, window, i, level):  # type: ignore[no-untyped-def]
    """Mean stability factor and turning speeds of a window, and the airspeed into its condition; whether the factor
    is another than before."""
    ns = setup.states
    at = setup.channels + ns + 2 * setup.inputs
    mean, airspeed, count = np.zeros(1 + ns), 0.0, 0
    for g in range(window.tally[i, 0]):
        for r in range(window.counts[i, g]):
            row = window.rows[i, g, r]
            for c in range(1 + ns):
                mean[c] += row[at + c]
            airspeed += row[row.size - 2]
            count += 1
    mean /= max(count, 1)
    return mean, airspeed / max(count, 1), abs(mean[0] / level[0] - 1.0) > _SAME


@njit(cache=True)
def _accept(filters, window, i, h, p, trial):  # type: ignore[no-untyped-def]
    heads, sums = trial
    filters.point[i, h] = p
    for g in range(window.tally[i, 0]):
        _copy_head(head_of(filters.heads, i, h, g), head_of(heads, 0, 0, g))
        _copy_sums(sums_of(filters.sums, i, h, g), sums_of(sums, 0, 0, g))
    _copy_head(head_of(filters.heads, i, h, GROUPS), head_of(heads, 0, 0, GROUPS))


@njit(cache=True)
def _copy_lanes(to, source):  # type: ignore[no-untyped-def]
    to.transition[:] = source.transition
    to.noise[:] = source.noise
    to.early[:] = source.early
    to.late[:] = source.late
    to.output[:] = source.output
    to.variance[:] = source.variance
    to.theta[:] = source.theta
    to.start[:] = source.start
    to.count[:] = source.count
    to.where[:] = source.where
    to.surface_noise[:] = source.surface_noise
    to.surface_variance[:] = source.surface_variance
    to.level[:] = source.level


@njit(cache=True)
def _trial_cost(filters, window, i, h, p, trial):  # type: ignore[no-untyped-def]
    off = p - filters.centre[i, h]
    cost = filters.cost[i, h, 0] + 0.5 * np.sum(off * (filters.arrival[i, h] @ off))
    for g in range(window.tally[i, 0]):
        cost += trial[1].cost[0, 0, g, 0]
    return cost


@njit(cache=True)
def _longest_move(priors, information, move, k):  # type: ignore[no-untyped-def]
    """The largest move in standard errors: of the derivatives, and of the others by half."""
    covariance = _inverse(information)
    largest, other = 0.0, 0.0
    for a in range(move.size):
        size = abs(move[a]) / np.sqrt(covariance[a, a])
        if a < k:
            largest = max(largest, size)
        else:
            other = max(other, 0.5 * size)
    return largest, other


@njit(cache=True)
def solve_filter(setup, priors, filters, window, i, h, trial, lanes):  # type: ignore[no-untyped-def]
    """Move the point of linearisation of filter h of vehicle i where the data ask for it; two passes at most.

    Args:
        trial: heads and sums of one filter, memory for the passes; lanes: likewise.
    """
    if window.tally[i, 0] == 0:
        return
    k, size = filters.left.driven.shape[2], filters.point.shape[2] - setup.channels
    mine, search = lanes_of(filters.lanes, i, h), filters.search[i, h]
    for _ in range(_PASSES):
        cost, score, information = quadratic(filters, window, i, h)
        damped = information.copy()
        for a in range(damped.shape[0]):
            damped[a, a] *= 1.0 + search[0]
        move = _inverse(damped) @ score
        level, airspeed, other = _level(setup, window, i, mine.level)
        largest, beside = _longest_move(priors, information, _inverse(information) @ score, k)
        search[1] = largest
        if max(largest, beside) < _MOVED and not other:
            search[0] = 0.0
            return
        p = filters.point[i, h].copy()
        longest = max(np.max(np.abs(move[:size])) / _LONGEST_STEP, 1.0)
        for a in range(p.size):
            p[a] += move[a] / longest
            low, high = filters.prior[i, h, a] - priors.reach[a], filters.prior[i, h, a] + priors.reach[a]
            p[a] = min(max(p[a], low), high)
        lanes.level[:] = level
        window.condition[i, 1] = airspeed
        better = fastest_growth(setup, p, level) < _FASTEST_GROWTH
        if better:
            build_lanes(setup, window.condition[i], p, lanes)
            _run_again(setup, lanes, filters, window, i, h, p, trial)
            found = _trial_cost(filters, window, i, h, p, trial)
            better = np.isfinite(found) and (found < cost + _TOLERATED or other)
        if better:
            _accept(filters, window, i, h, p, trial)
            _copy_lanes(mine, lanes)
            search[0] = 0.0 if search[0] < 2e-3 else search[0] / 10.0
        else:
            search[0] = min(max(5.0 * search[0], 1e-2), _MOST_DAMPING)
    _, score, information = quadratic(filters, window, i, h)
    search[1], _ = _longest_move(priors, information, _inverse(information) @ score, k)
