"""The recursion: a window of samples, and what came before it as an arrival cost.

Every vehicle has two filters, one for still air and one with gusts, and each of them

    arrival     c + (p - mu)' La (p - mu) / 2, what has left the window, after random walks towards the prior,
    groups      of 2 s, each with its cost, score and information at the point p_0 of linearisation,
    marks       where the filters stood before each group, so that the window can be run again about another point.

docs/methods/filter_error.md, section 9, has the equations.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.filter_error.increments import Head, Sums, add_rows, begin_record
from wingwatch.estimators.filter_error.input_noise import signal_information
from wingwatch.estimators.filter_error.lanes import Lanes, Setup, build_lanes, fastest_growth

__all__ = [
    "BLOCKS_A_GROUP",
    "FASTEST_GROWTH",
    "GROUPS",
    "MOST_GAINED",
    "Evidence",
    "Filters",
    "One",
    "Priors",
    "Window",
    "absorb_all",
    "add_block",
    "begin",
    "current",
    "gained",
    "inverse",
    "quadratic",
    "stabilise",
]

Array = NDArray[np.float64]

GROUPS = 10
"""Groups in a window: 18 to 20 s. What leaves it is linearised for good, so it must be long enough for the likelihood
to be a quadratic: where an autopilot alone moves the surfaces 12 s were not."""

BLOCKS_A_GROUP = 4
"""Half seconds in a group: 2 s, longer than the modes and shorter than a manoeuvre."""

FASTEST_GROWTH = 0.0
"""Motion must not grow, 1/s: what surfaces drive is followed without correction, for as long as the flight lasts."""

_DAMPED = 0.2
"""Damping, 1/s, of where a search begins that would begin at motion that grows."""

MOST_GAINED = 50.0
"""Log-likelihood that gusts gain when the filter for still air rests: no chance makes as much."""


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
        echo: information that noise of the surfaces added, (size, size).
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
    echo: Array


class Filters(NamedTuple):
    """Both filters of all vehicles; first axes: vehicles, still air or gusts.

    Attributes:
        lanes: matrices at the point of linearisation.
        heads: where the filters stood before each group, and now (the last), (GROUPS + 1,).
        sums: of each group, (GROUPS,).
        point: p_0, (size,); prior: mean, (size,).
        arrival: La, (size, size); centre: mu, (size,); cost: c, (1,).
        left: evidence of groups that have left.
        echo_cost, echo_score, echo_information: what noise of each input is expected to add at every sample at which it
            moves (``increments.input_echo``), (inputs, 1), (inputs, size), (inputs, size, size).
        search: damping of the next step; expected move of the derivatives, in standard errors; solutions to wait
            after a step that was refused, and what it promised; surprise of the last half second, in standard
            deviations of chi-square; whether the filter rests because the other is far better, (6,).
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
    echo_cost: Array
    echo_score: Array
    echo_information: Array
    search: Array


class Window(NamedTuple):
    """The samples of all vehicles' windows.

    Attributes:
        rows: (vehicles, GROUPS, samples, row_width); counts: of rows, (vehicles, GROUPS).
        tally: groups in use, blocks in the last of them, whether the first of them begins a record, (vehicles, 3).
        condition: of ``build_lanes``, then the variance of each input's noise, (vehicles, 2 + channels + inputs).
    """

    rows: Array
    counts: NDArray[np.int64]
    tally: NDArray[np.int64]
    condition: Array


@dataclass(frozen=True, slots=True)
class One:
    """Filter ``h`` (0 still air, 1 gusts) of vehicle ``i``: views of its arrays."""

    filters: Filters
    window: Window
    i: int
    h: int

    @property
    def lanes(self) -> Lanes:
        """Its matrices."""
        return Lanes(*(a[self.i, self.h] for a in self.filters.lanes))

    def head(self, g: int) -> Head:
        """Where it stood before group g; GROUPS: where it stands."""
        return Head(*(a[self.i, self.h, g] for a in self.filters.heads))

    def sums(self, g: int) -> Sums:
        """Of group g."""
        return Sums(*(a[self.i, self.h, g] for a in self.filters.sums))

    @property
    def heads(self) -> Head:
        """Of all groups."""
        return Head(*(a[self.i, self.h] for a in self.filters.heads))

    def window_cost(self) -> float:
        """Cost of all groups in the window."""
        return float(self.filters.sums.cost[self.i, self.h, : self.groups].sum())

    @property
    def groups(self) -> int:
        """In use."""
        return int(self.window.tally[self.i, 0])

    @property
    def point(self) -> Array:
        """p_0."""
        return np.asarray(self.filters.point[self.i, self.h])


def begin(setup: Setup, filters: Filters, window: Window, i: int) -> None:
    """A record begins: matrices at the present point, no group yet."""
    size = filters.point.shape[2] - setup.channels
    for h in range(2):
        one = One(filters, window, i, h)
        one.point[size:] = filters.centre[i, h, size:]
        lanes = one.lanes
        stabilise(setup, one.point, lanes.level)
        build_lanes(setup, window.condition[i], one.point, lanes)
        begin_record(one.head(GROUPS), lanes)
        filters.search[i, h] = 0.0
    window.tally[i] = 0, 0, 1
    window.counts[i] = 0


def stabilise(setup: Setup, p: Array, level: Array) -> None:
    """Where motion would grow at p, damp all of it alike: what is expected of an aircraft may be that far off."""
    growth = fastest_growth(setup, p, level)
    if growth < FASTEST_GROWTH:
        return
    ns = setup.states
    copy = p.size - setup.channels - ns * ns
    for i in range(ns):
        shift = (growth + _DAMPED) / (level[0] * setup.natural[i, i])
        p[i * (ns + setup.inputs) + i] -= shift
        p[copy + i * ns + i] -= shift


def add_block(setup: Setup, priors: Priors, filters: Filters, window: Window, i: int, block: Array) -> None:
    """Half a second of rows (samples, row_width) of vehicle i; a full window lets its oldest group go first."""
    tally = window.tally[i]
    if tally[0] == 0 or tally[1] == BLOCKS_A_GROUP:
        if tally[0] == GROUPS:
            _absorb(setup, priors, filters, window, i)
        for array in filters.heads:
            array[i, :, tally[0]] = array[i, :, GROUPS]
        for array in filters.sums:
            array[i, :, tally[0]] = 0.0
        window.counts[i, tally[0]] = 0
        tally[0] += 1
        tally[1] = 0
    g = int(tally[0]) - 1
    first = window.counts[i, g]
    window.rows[i, g, first : first + len(block)] = block
    window.counts[i, g] += len(block)
    tally[1] += 1
    size = filters.point.shape[2] - setup.channels
    for h in range(2):
        if filters.search[i, h, 5] > 0.0:
            continue
        one = One(filters, window, i, h)
        sums = one.sums(g)
        before = sums.samples.copy()
        add_rows(setup, one.lanes, one.point[size:], one.head(GROUPS), block, sums)
        readings, squares = (sums.samples - before)[:2]
        filters.search[i, h, 4] = (squares - readings) / math.sqrt(2.0 * max(readings, 1.0))


def _said(one: One, groups: slice) -> tuple[float, Array, Array, Array]:
    """Cost, score, information of some groups, without what noise of the surfaces adds, and that information."""
    f, i, h = one.filters, one.i, one.h
    sums = f.sums
    cost, score = float(sums.cost[i, h, groups].sum()), sums.score[i, h, groups].sum(axis=0)
    information = sums.information[i, h, groups].sum(axis=0)
    moved = sums.samples[i, h, groups, 2:].sum(axis=0)
    cost -= float(moved @ f.echo_cost[i, h, :, 0])
    score = score + moved @ f.echo_score[i, h]
    echo = np.einsum("u,uab->ab", moved, f.echo_information[i, h])
    return cost, score, signal_information(information, echo, f.arrival[i, h]), echo


def quadratic(one: One) -> tuple[float, Array, Array]:
    """Cost at the point of linearisation, its gradient downwards and its information, arrival and window together."""
    f, i, h = one.filters, one.i, one.h
    off = f.centre[i, h] - one.point
    pull = f.arrival[i, h] @ off
    cost, score, information, _ = _said(one, slice(one.groups))
    return float(f.cost[i, h, 0] + 0.5 * off @ pull) + cost, score + pull, f.arrival[i, h] + information


def current(one: One) -> tuple[Array, Array]:
    """The best parameters (size,) by the quadratic, and their covariance (size, size)."""
    _, score, information = quadratic(one)
    covariance = inverse(information)
    echo = _said(one, slice(one.groups))[3] + one.filters.left.echo[one.i, one.h]
    return one.point + covariance @ score, covariance + covariance @ echo @ covariance


def gained(filters: Filters, window: Window, i: int) -> float:
    """Log-likelihood that gusts gain over still air; at most MOST_GAINED.

    At the points of linearisation: what a step only promises would let a filter that is lost look best.
    """
    if filters.search[i, 0, 5] > 0.0:
        return MOST_GAINED
    still, gusty = (quadratic(One(filters, window, i, h))[0] for h in range(2))
    return min(still - gusty, MOST_GAINED)


def inverse(matrix: Array) -> Array:
    """Of a positive definite matrix of mixed units, symmetric."""
    root = 1.0 / np.sqrt(np.diagonal(matrix))
    scale = np.outer(root, root)
    inverse = np.linalg.inv(matrix * scale)
    return np.asarray(0.5 * (inverse + inverse.T) * scale)


def _absorb(setup: Setup, priors: Priors, filters: Filters, window: Window, i: int) -> None:
    """The window's oldest group goes into the arrival cost, which then walks; the others move up."""
    groups = int(window.tally[i, 0])
    seconds = float(window.counts[i, 0] * window.condition[i, 0])
    fade = [
        1.0 if filters.search[i, h, 5] > 0.0 else _absorb_group(priors, One(filters, window, i, h), seconds)
        for h in range(2)
    ]
    # only the difference counts, and it fades as the information of the filter with gusts does
    filters.cost[i, 0] = fade[1] * (filters.cost[i, 0] - filters.cost[i, 1])
    filters.cost[i, 1] = 0.0
    for array in (*filters.heads, *filters.sums):
        array[i, :, : groups - 1] = array[i, :, 1:groups].copy()
    window.rows[i, : groups - 1] = window.rows[i, 1:groups].copy()
    window.counts[i, : groups - 1] = window.counts[i, 1:groups].copy()
    window.tally[i, 0] -= 1
    window.tally[i, 2] = 0


def absorb_all(setup: Setup, priors: Priors, filters: Filters, window: Window, i: int) -> None:
    """A record has ended: all of its groups go; constants of the readings are unknown again."""
    while window.tally[i, 0] > 0:
        _absorb(setup, priors, filters, window, i)
    own = slice(filters.point.shape[2] - setup.channels, None)
    for h in range(2):
        kept = inverse(filters.arrival[i, h])
        kept[own] = kept[:, own] = 0.0
        kept[own, own] = np.diag(priors.std[own] ** 2)
        filters.arrival[i, h] = inverse(kept)
        filters.centre[i, h, own] = 0.0
        # what crossed with the constants does so no more
        filters.left.cross[i, h, :, own] = 0.0


def _absorb_group(priors: Priors, one: One, seconds: float) -> float:
    """The oldest group of one filter; returns what part of the derivatives' information the walk left."""
    f, i, h, point, sums = one.filters, one.i, one.h, one.point, one.sums(0)
    said, pushed, information, echo = _said(one, slice(1))
    _remember(one, sums, current(one)[0])
    f.left.echo[i, h] += echo
    off = f.centre[i, h] - point
    pull = f.arrival[i, h] @ off
    covariance = inverse(f.arrival[i, h] + information)
    score = pull + pushed
    move = covariance @ score
    f.cost[i, h] += said + 0.5 * off @ pull - 0.5 * score @ move
    # a random walk towards the prior, so that nothing is ever less known than before the flight
    gained = priors.walk * seconds
    kept = np.sqrt(np.maximum(1.0 - gained / priors.std**2, 0.0))
    k = sums.driven_score.size
    spread = np.diagonal(covariance)[:k]
    fade = float(np.exp(np.mean(np.log(spread / (spread + gained[:k])))))
    f.centre[i, h] = f.prior[i, h] + kept * (point + move - f.prior[i, h])
    f.arrival[i, h] = inverse(covariance * np.outer(kept, kept) + np.diag((1.0 - kept**2) * priors.std**2))
    for name, array in zip(f.left._fields, f.left, strict=True):
        array[i, h] *= fade**2 if name in ("driven_square", "squares") else fade
    return fade


def _remember(one: One, sums: Sums, estimate: Array) -> None:
    """Add a group to the guards' evidence."""
    left = Evidence(*(a[one.i, one.h] for a in one.filters.left))
    echo = sums.samples[2:] @ one.filters.echo_score[one.i, one.h]
    score = sums.score + echo - sums.information @ (estimate - one.point)
    left.driven[...] += sums.driven
    left.driven_square[...] += sums.driven
    left.driven_vector[...] += sums.driven_score + sums.cross @ one.point
    left.cross[...] += sums.cross
    left.products[...] += sums.products
    left.squares[...] += sums.squares
    left.scatter[...] += np.outer(score, score)
    left.information[...] += sums.information
    left.groups[...] += 1.0
