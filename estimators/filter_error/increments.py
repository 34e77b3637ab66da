"""What half a second of samples says of the parameters: the recursion's innermost loop, compiled.

All lanes (``lanes``) take the same samples. With e and s the innovation and its variance of lane 0, psi = -de/dp and
sigma = ds/dp from the others, each sample adds to cost, score and information (docs/methods/filter_error.md, (5), (6));
and with psi_u, what measured forcing alone drives, filtered as the data are, to the sums of the guards.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["LAGS", "Head", "Sums", "add_rows", "begin_record", "carry", "input_echo", "row_width"]

Array = NDArray[np.float64]

LAGS = 25
"""Lags at which innovations are compared with each other."""

_SETTLED = 1e-7
"""A gain has settled where its change over a step moves no predicted reading by more than this part of its noise."""


class Head(NamedTuple):
    """Where the filters stand after a sample; c columns are the responses to constants of the readings, then to what
    the surfaces drive.

    Attributes:
        x: states, (n, lanes); covariance: (n, n, lanes); gain: (channels, n, lanes); spread: innovation variances,
            (channels, lanes).
        columns: (n, c); driven: response to measured forcing alone of the first lanes, (states, 1 + k).
        late: last whitened innovations, newest first, (LAGS, channels).
        before: the last row.
        flags: whether a sample was taken, whether the gain has settled, samples since the start up to LAGS, which
            surfaces moved (bits), (4,).
    """

    x: Array
    covariance: Array
    gain: Array
    spread: Array
    columns: Array
    driven: Array
    late: Array
    before: Array
    flags: NDArray[np.int64]


class Sums(NamedTuple):
    """What a span of samples says; of size parameters (constants of readings last), k derivatives.

    Attributes:
        cost: half of the sum of e^2 / s + ln s, (1,).
        score, information: (size,), (size, size).
        driven, driven_score, cross: information, score of what surfaces drive, and their information with all
            parameters, (k, k), (k,), (k, size).
        products, squares: of innovations at each lag, (LAGS, channels, channels).
        samples: readings, the sum of their e^2 / s, and samples at which each input moved, (2 + inputs,).
    """

    cost: Array
    score: Array
    information: Array
    driven: Array
    driven_score: Array
    cross: Array
    products: Array
    squares: Array
    samples: Array


def row_width(states: int, inputs: int, channels: int) -> int:
    """Columns of a window's row: readings, slow regressors of the states, loads at the sample and at the end of the
    step to it, stability factor, turning speeds, known aerodynamic and kinematic accelerations, airspeed, which
    surfaces move (bits)."""
    return channels + 4 * states + 2 * inputs + 3


@njit(cache=True)
def begin_record(head, lanes):  # type: ignore[no-untyped-def]
    """Before the first sample: what surfaces move is at rest, the air is as it may be."""
    head.x[:] = 0.0
    head.covariance[:] = lanes.start
    head.gain[:] = 0.0
    head.spread[:] = 1.0
    head.columns[:] = 0.0
    head.driven[:] = 0.0
    head.late[:] = 0.0
    head.before[:] = 0.0
    head.flags[:] = 0


@njit(cache=True)
def carry(setup, head, move):  # type: ignore[no-untyped-def]
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
def _forcing(setup, lanes, row, arriving, known, force):  # type: ignore[no-untyped-def]
    """Acceleration of the structure's states by forcing at a sample, (states, lanes), and its known aerodynamic and
    whole part, (2, states).

    Args:
        arriving: whether that at the end of the step to the sample is meant.
    """
    ns, nu, ch = setup.states, setup.inputs, setup.channels
    stability = ch + ns + 2 * nu
    aero = stability + 1 + ns
    width = force.shape[1]
    turned = 0.0
    for j in range(1, ns):
        if row[j] == row[j]:
            turned += (row[stability + 1 + j] - lanes.level[1 + j]) * row[j]
    for i in range(ns):
        known[0, i] = row[aero + i]
        known[1, i] = row[aero + i] + row[aero + ns + i]
        if i == 0:
            known[1, i] += turned
        for lane in range(width):
            force[i, lane] = 0.0
        for c in range(ns):
            d = row[ch + c]
            if row[c] == row[c]:
                d += (row[stability] - lanes.level[0]) * row[c]
            if d != 0.0:
                for lane in range(width):
                    force[i, lane] += lanes.theta[i, c, lane] * d
        loads = ch + ns + (nu if arriving else 0)
        for u in range(nu):
            d = row[loads + u]
            if d != 0.0:
                for lane in range(width):
                    force[i, lane] += lanes.theta[i, ns + u, lane] * d


@njit(cache=True)
def _advance(setup, lanes, head, first, last):  # type: ignore[no-untyped-def]
    """All states over one step, forced by ``first`` at its start and ``last`` at its end, (states, lanes)."""
    ns = setup.states
    n, width = head.x.shape
    new = np.zeros((n, width))
    for i in range(n):
        for at in range(lanes.entries[i]):
            j = lanes.where[i, at]
            for lane in range(width):
                new[i, lane] += lanes.transition[i, j, lane] * head.x[j, lane]
        if i < ns:
            for j in range(ns):
                for lane in range(width):
                    new[i, lane] += (
                        lanes.early[i, j, lane] * first[j, lane] + lanes.late[i, j, lane] * last[j, lane]
                    )
    head.x[:] = new
    columns = head.columns.shape[1]
    old = head.columns.copy()
    for i in range(n):
        for c in range(columns):
            head.columns[i, c] = 0.0
        for at in range(lanes.entries[i]):
            j = lanes.where[i, at]
            f = lanes.transition[i, j, 0]
            for c in range(columns):
                head.columns[i, c] += f * old[j, c]
    few = head.driven.shape[1]
    open_loop = head.driven.copy()
    for i in range(ns):
        for lane in range(few):
            total = 0.0
            for j in range(ns):
                total += lanes.transition[i, j, lane] * open_loop[j, lane]
                total += lanes.early[i, j, lane] * first[j, lane] + lanes.late[i, j, lane] * last[j, lane]
            head.driven[i, lane] = total


@njit(cache=True)
def _spread(setup, lanes, head, moving):  # type: ignore[no-untyped-def]
    """P = F P F' + Q of all lanes."""
    n, _, width = head.covariance.shape
    p = head.covariance
    work = np.zeros((n, n, width))
    for i in range(n):
        for at in range(lanes.entries[i]):
            c = lanes.where[i, at]
            for j in range(n):
                for lane in range(width):
                    work[i, j, lane] += lanes.transition[i, c, lane] * p[c, j, lane]
    for i in range(n):
        for j in range(i + 1):
            extra = 0.0
            for u in range(setup.inputs):
                # at rest it is motion of the copy, so that it teaches the derivatives nothing
                first = 0 if (moving >> u) & 1 else n - setup.states
                if first <= j and i < first + setup.states:
                    extra += lanes.surface_noise[u, i - first, j - first]
            for lane in range(width):
                p[i, j, lane] = lanes.noise[i, j, lane] + extra
            for at in range(lanes.entries[j]):
                c = lanes.where[j, at]
                for lane in range(width):
                    p[i, j, lane] += work[i, c, lane] * lanes.transition[j, c, lane]
            if i != j:
                for lane in range(width):
                    p[j, i, lane] = p[i, j, lane]


@njit(cache=True)
def _renew_gain(setup, lanes, head, q):  # type: ignore[no-untyped-def]
    """Gains and innovation variances of reading q, and P after it; returns the change of lane 0's gain by what it
    does to predicted readings, in their noises."""
    n, _, width = head.covariance.shape
    p = head.covariance
    new, s = np.zeros((n, width)), np.empty(width)
    extra = 0.0
    for u in range(setup.inputs):
        extra += lanes.surface_variance[u, q]
    for lane in range(width):
        s[lane] = lanes.variance[q, lane] + extra
    for j in range(n):
        # an output that is zero in all lanes costs nothing
        if not np.any(lanes.output[q, j] != 0.0):
            continue
        for i in range(n):
            for lane in range(width):
                new[i, lane] += p[i, j, lane] * lanes.output[q, j, lane]
    for j in range(n):
        for lane in range(width):
            s[lane] += new[j, lane] * lanes.output[q, j, lane]
    change = 0.0
    for c in range(lanes.variance.shape[0]):
        moved = 0.0
        for i in range(n):
            moved += lanes.output[c, i, 0] * (new[i, 0] / s[0] - head.gain[q, i, 0])
        change = max(change, abs(moved) * np.sqrt(s[0] / lanes.variance[c, 0]))
    for i in range(n):
        for lane in range(width):
            head.gain[q, i, lane] = new[i, lane] / s[lane]
        for j in range(i + 1):
            for lane in range(width):
                p[i, j, lane] -= head.gain[q, i, lane] * new[j, lane]
            if i != j:
                for lane in range(width):
                    p[j, i, lane] = p[i, j, lane]
    head.spread[q] = s
    return change


@njit(cache=True)
def _correct(setup, lanes, head, row, q, force_known):  # type: ignore[no-untyped-def]
    """Innovations of reading q in all lanes and columns, the states corrected by them.

    Args:
        force_known: forcing at the sample (states, lanes), its known parts (2, states), and the constants of the
            readings.

    Returns:
        innovations (lanes,) and of the columns (c,).
    """
    force, known, own = force_known
    ns, ch = setup.states, setup.channels
    n, width = head.x.shape
    columns, few = head.columns.shape[1], head.driven.shape[1]
    e = np.full(width, row[q] - own[q])
    answer = np.zeros(columns)
    if q < ch:
        answer[q] = 1.0
    direct = np.zeros(width)
    if q >= ns:
        f = setup.force
        for lane in range(width):
            direct[lane] = force[f, lane] + known[0, f]
        for j in range(ns):
            if setup.lever[j] != 0.0:
                for lane in range(width):
                    direct[lane] -= setup.lever[j] * (force[j, lane] + known[1, j])
        for lane in range(width):
            e[lane] -= direct[lane]
    driven = direct[:few].copy()
    for i in range(ns):
        for lane in range(few):
            driven[lane] += lanes.output[q, i, lane] * head.driven[i, lane]
    for j in range(few - 1):
        answer[ch + j] = (driven[1 + j] - driven[0]) / setup.step[j]
    for i in range(n):
        for lane in range(width):
            e[lane] -= lanes.output[q, i, lane] * head.x[i, lane]
        out = lanes.output[q, i, 0]
        if out != 0.0:
            for c in range(columns):
                answer[c] -= out * head.columns[i, c]
    for i in range(n):
        for lane in range(width):
            head.x[i, lane] += head.gain[q, i, lane] * e[lane]
        gain = head.gain[q, i, 0]
        for c in range(columns):
            head.columns[i, c] += gain * answer[c]
    return e, answer


@njit(cache=True)
def _sum_up(setup, head, q, found, sums):  # type: ignore[no-untyped-def]
    """Add one reading to the sums; returns its whitened innovation."""
    e, answer = found
    ch = setup.channels
    lanes, k = e.size - 1, head.driven.shape[1] - 1
    size = lanes + ch
    s = head.spread[q, 0]
    root = 1.0 / np.sqrt(s)
    white = e[0] * root
    psi, sigma = np.empty(size), np.zeros(size)
    for i in range(lanes):
        psi[i] = (e[0] - e[1 + i]) * root / setup.step[i]
        sigma[i] = (head.spread[q, 1 + i] / s - 1.0) / setup.step[i]
    for c in range(ch):
        psi[lanes + c] = answer[c] * root
    surplus = 0.5 * (white * white - 1.0)
    sums.cost[0] += 0.5 * (white * white + np.log(s))
    sums.samples[0] += 1.0
    sums.samples[1] += white * white
    for a in range(size):
        sums.score[a] += psi[a] * white + surplus * sigma[a]
        one, half = psi[a], 0.5 * sigma[a]
        for b in range(size):
            sums.information[a, b] += one * psi[b] + half * sigma[b]
    for a in range(k):
        driven = answer[ch + a] * root
        sums.driven_score[a] += driven * white
        for b in range(k):
            sums.driven[a, b] += driven * answer[ch + b] * root
        for b in range(size):
            sums.cross[a, b] += driven * psi[b]
    return white


@njit(cache=True)
def _sum_lags(head, white, sums):  # type: ignore[no-untyped-def]
    """Products of the whitened innovations with earlier ones, and these kept for the next."""
    channels = white.size
    for lag in range(min(head.flags[2], LAGS)):
        for a in range(channels):
            for b in range(channels):
                product = white[a] * head.late[lag, b]
                sums.products[lag, a, b] += product
                sums.squares[lag, a, b] += product * product
    for lag in range(LAGS - 1, 0, -1):
        for a in range(channels):
            head.late[lag, a] = head.late[lag - 1, a]
    head.late[0] = white
    head.flags[2] = min(head.flags[2] + 1, LAGS)


@njit(cache=True)
def add_rows(setup, lanes, own, head, rows, sums):  # type: ignore[no-untyped-def]
    """Take in rows of samples, one step apart.

    Args:
        setup, lanes: the filters.
        own: constants of the readings that the rows are taken less, (channels,).
        head: in place; the row before the first is in it.
        rows: (samples, row_width); a reading that is not there is NaN.
        sums: added to.
    """
    ns, ch = setup.states, setup.channels
    width = head.x.shape[1]
    flag = rows.shape[1] - 1
    first, last, force = np.zeros((ns, width)), np.zeros((ns, width)), np.zeros((ns, width))
    known, white = np.zeros((2, ns)), np.zeros(ch)
    for t in range(rows.shape[0]):
        row, before = rows[t], head.before
        moving = int(row[flag])
        same = head.flags[0] == 1 and head.flags[1] == 1 and head.flags[3] == moving
        for q in range(ch):
            same = same and (row[q] == row[q]) == (before[q] == before[q])
        if head.flags[0] == 1:
            _forcing(setup, lanes, before, False, known, first)
            for i in range(ns):
                first[i] += known[1, i]
            _forcing(setup, lanes, row, True, known, last)
            for i in range(ns):
                last[i] += known[1, i]
            _advance(setup, lanes, head, first, last)
            if not same:
                _spread(setup, lanes, head, moving)
        _forcing(setup, lanes, row, False, known, force)
        change = 0.0
        for q in range(ch):
            white[q] = 0.0
            if row[q] != row[q]:
                continue
            if not same:
                change = max(change, _renew_gain(setup, lanes, head, q))
            found = _correct(setup, lanes, head, row, q, (force, known, own))
            white[q] = _sum_up(setup, head, q, found, sums)
        _sum_lags(head, white, sums)
        head.flags[1] = 1 if same or change <= _SETTLED else 0
        head.flags[0], head.flags[3] = 1, moving
        for u in range(setup.inputs):
            sums.samples[2 + u] += (moving >> u) & 1
        head.before[:] = row


@njit(cache=True)
def input_echo(setup, lanes, head, rows, echo):  # type: ignore[no-untyped-def]
    """What noise of an input at one sample is expected to add (``likelihood``, (3); Nakamura 1990).

    Args:
        head: one that has seen nothing yet, with a covariance; used up.
        rows: of a record in which only that noise is, after gains have settled, (samples, row_width), its readings 0.
        echo: half the expected sum of squares, what it takes from the score (size,), what it adds to the information
            (size, size); filled. Noises change how an echo is weighted, not what it is of: that is in the information
            already, so only derivatives are in the last.
    """
    expected, score, information = echo
    ns, ch = setup.states, setup.channels
    width, k = head.x.shape[1], head.driven.shape[1] - 1
    first, last, force = np.zeros((ns, width)), np.zeros((ns, width)), np.zeros((ns, width))
    known, own, slope = np.zeros((2, ns)), np.zeros(ch), np.zeros(width - 1)
    expected[0] = 0.0
    score[:] = 0.0
    information[:] = 0.0
    for t in range(1, rows.shape[0]):
        _forcing(setup, lanes, rows[t - 1], False, known, first)
        _forcing(setup, lanes, rows[t], True, known, last)
        _forcing(setup, lanes, rows[t], False, known, force)
        _advance(setup, lanes, head, first, last)
        _spread(setup, lanes, head, int(rows[t, rows.shape[1] - 1]))
        for q in range(ch):
            _renew_gain(setup, lanes, head, q)
            e, _ = _correct(setup, lanes, head, rows[t], q, (force, known, own))
            white = e[0] / np.sqrt(head.spread[q, 0])
            expected[0] += 0.5 * white * white
            for i in range(width - 1):
                slope[i] = (e[1 + i] / np.sqrt(head.spread[q, 1 + i]) - white) / setup.step[i]
                score[i] += white * slope[i]
            for i in range(k):
                for j in range(k):
                    information[i, j] += slope[i] * slope[j]
