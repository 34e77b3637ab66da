"""One filter for each parameter, a small step apart, side by side: the recursion's sensitivities are their differences.

The model is that of ``model.FilterModel`` (docs/methods/filter_error.md, section 1), compiled and at one level of
dynamic pressure, with one more set of parameters behind the others: the constant of each reading. Lane 0 is at the
parameters themselves, lane 1 + i has parameter i moved. The lane is the last axis of every array, so that what is done
to one is done to all at once.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.estimators.filter_error.discretisation import discretise, stationary_covariance

__all__ = ["Lanes", "Setup", "build_lanes", "fastest_growth"]

Array = NDArray[np.float64]

_NUMERATOR = np.sqrt(3.0)
"""Of the Dryden spectrum of vertical and lateral gusts, (1 + sqrt(3) T s) / (1 + T s)^2."""

_START_ANGLE, _START_RATE = 0.1, 0.5
"""Motion from before a record may be as large as this, of airspeed and in rad/s."""


class Setup(NamedTuple):
    """What does not change from parameters to parameters.

    Attributes:
        states, inputs, channels, moments: of the structure; readings: states, then the accelerometer if it is used.
        rolling: 1 where rolling air is modelled.
        turning: place of the rate that gusts turn the air at; its sign times the gust's slope over airspeed is the
            air's rate; roll: place of the roll rate.
        force: equation whose accelerometer is read; -1: none.
        sign: of that rate.
        vane_ahead_m: of the vane.
        rolling_m: time constant of rolling air times airspeed, m.
        natural: natural sizes, (states, states + inputs).
        lever: of the accelerometer, (states,), m.
        step: of each parameter, for differences, (parameters,).
        held: whether each input is held between samples, (inputs,).
    """

    states: int
    inputs: int
    channels: int
    moments: int
    rolling: int
    turning: int
    roll: int
    force: int
    sign: float
    vane_ahead_m: float
    rolling_m: float
    natural: Array
    lever: Array
    step: Array
    held: NDArray[np.bool_]


class Lanes(NamedTuple):
    """The filters' matrices, the lane last.

    Attributes:
        transition, noise: F and Q, (n, n, lanes).
        early, late: what forcing of the structure's states at a step's start and at its end adds, (states, states,
            lanes).
        output: C, (channels, n, lanes).
        variance: R, (channels, lanes).
        theta: referred derivatives, (states, states + inputs, lanes).
        start: covariance before a record's first reading, (n, n, lanes).
        entries, where: number and places of the entries of a transition that are not zero, row by row, (n,), (n, n).
        surface_noise, surface_variance: what noise of each input adds to Q, (inputs, states, states), and to R,
            (inputs, channels), in all lanes.
        level: stability factor and turning speed (states,) that the transition holds, (1 + states,).
    """

    transition: Array
    noise: Array
    early: Array
    late: Array
    output: Array
    variance: Array
    theta: Array
    start: Array
    entries: NDArray[np.int64]
    where: NDArray[np.int64]
    surface_noise: Array
    surface_variance: Array
    level: Array


@njit(cache=True)
def _aerodynamics(setup, p):  # type: ignore[no-untyped-def]
    """Referred derivatives (states, states + inputs) and the copy's (states, states)."""
    ns = setup.states
    m = ns + setup.inputs
    theta, copy = np.empty((ns, m)), np.empty((ns, ns))
    first = ns * m + setup.channels + 4 + ns + setup.moments + setup.rolling
    for i in range(ns):
        for c in range(m):
            theta[i, c] = p[i * m + c] * setup.natural[i, c]
            if c < ns:
                copy[i, c] = p[first + i * ns + c] * setup.natural[i, c]
    return theta, copy


@njit(cache=True)
def fastest_growth(setup, p, level):  # type: ignore[no-untyped-def]
    """Rate of the fastest growing motion of the derivatives and of their copy, 1/s."""
    ns = setup.states
    theta, copy = _aerodynamics(setup, p)
    fastest = -np.inf
    for part in range(2):
        a = np.zeros((ns, ns), dtype=np.complex128)
        for i in range(ns):
            for j in range(ns):
                a[i, j] = level[0] * (theta[i, j] if part == 0 else copy[i, j])
        for j in range(ns):
            a[0, j] += level[1 + j]
        fastest = max(fastest, np.max(np.linalg.eigvals(a).real))
    return fastest


@njit(cache=True)
def _dynamics(setup, p, level, airspeed):  # type: ignore[no-untyped-def]
    """A of the whole filter, its noise intensity, and C."""
    ns, ch = setup.states, setup.channels
    m = ns + setup.inputs
    n = 2 * ns + 3 + setup.moments + setup.rolling + (2 if setup.vane_ahead_m > 0.0 else 0)
    theta, copy = _aerodynamics(setup, p)
    at = ns * m + ch
    gust = np.exp(p[at])
    gains = p[at + 1 : at + 1 + ns]
    times = np.exp(np.minimum(np.maximum(p[at + 1 + ns : at + 4 + ns], -6.0), 6.0))
    span_s, gust_s, moment_s = times[0], times[1], times[2]
    intensities = np.exp(p[at + 4 + ns : at + 4 + ns + setup.moments + setup.rolling])
    a, w, output = np.zeros((n, n)), np.zeros((n, n)), np.zeros((ch, n))
    c, f, y = ns, ns + 2, n - ns
    d = y - setup.moments - setup.rolling
    a[c, c] = a[c + 1, c + 1] = -1.0 / gust_s
    a[c + 1, c] = 1.0 / gust_s
    w[c, c] = 4.0 * gust**2 / (gust_s * (1.0 + _NUMERATOR**2))
    vane = np.zeros(n)
    vane[c], vane[c + 1] = _NUMERATOR, 1.0 - _NUMERATOR
    here = vane.copy()
    if d > f + 1:
        # Pade of second order, g = g_vane - l_2, l_1' = l_2 / T, l_2' = (12 (g_vane - l_1) - 6 l_2) / T
        rate = airspeed / setup.vane_ahead_m
        a[f + 1, f + 2] = rate
        a[f + 2] = 12.0 * rate * vane
        a[f + 2, f + 1] -= 12.0 * rate
        a[f + 2, f + 2] -= 6.0 * rate
        here[f + 2] = -1.0
    a[f] = here / span_s
    a[f, f] -= 1.0 / span_s
    turned = setup.sign / airspeed * a[f]
    air = np.zeros((ns, n))
    for i in range(ns):
        air[i] = level[0] * (theta[i, 0] * here + gains[i] * theta[i, setup.turning] * turned)
        for j in range(ns):
            a[i, j] = level[0] * theta[i, j]
            a[y + i, y + j] = level[0] * copy[i, j]
            if i == 0:
                a[i, j] += level[1 + j]
                a[y, y + j] += level[1 + j]
        a[i] -= air[i]
    for i in range(setup.moments):
        a[d + i, d + i] = -1.0 / moment_s
        a[y + 1 + i, d + i] = 1.0
        w[d + i, d + i] = 2.0 * intensities[i] ** 2 / moment_s
    if setup.rolling:
        roll = d + setup.moments
        a[roll, roll] = -airspeed / setup.rolling_m
        w[roll, roll] = 2.0 * intensities[setup.moments] ** 2 * airspeed / setup.rolling_m
        for i in range(ns):
            a[y + i, roll] = -level[0] * copy[i, setup.roll]
    for q in range(ns):
        output[q, q] = output[q, y + q] = 1.0
    output[0] -= vane
    if setup.force >= 0:
        row = setup.force
        output[ns] -= air[row]
        for j in range(ns):
            output[ns, j] += level[0] * theta[row, j]
            output[ns, y + j] += level[0] * copy[row, j]
            output[ns] -= setup.lever[j] * (a[j] + a[y + j])
        if setup.rolling:
            output[ns, y - 1] -= level[0] * copy[row, setup.roll]
    return a, w, output


@njit(cache=True)
def build_lanes(setup, condition, p, lanes):  # type: ignore[no-untyped-def]
    """Fill the filters at parameters p.

    Args:
        condition: step s, airspeed m/s, then the least variance of each reading, then variance of each input's noise.
        p: parameters, then the constants of the readings.
        lanes: filled; ``level`` is read.
    """
    ns, ch, nu = setup.states, setup.channels, setup.inputs
    m, n = ns + nu, lanes.transition.shape[0]
    into = np.eye(n, ns)
    width = lanes.variance.shape[1]
    quiet_from, quiet_to = ns * m, ns * m + ch
    moved = p.copy()
    lanes.entries[:] = 0
    for lane in range(width):
        parameter = lane - 1
        if lane > 0:
            moved[parameter] += setup.step[parameter]
        theta, _ = _aerodynamics(setup, moved)
        lanes.theta[:, :, lane] = theta
        for q in range(ch):
            power = min(max(moved[ns * m + q], -60.0), 30.0)
            lanes.variance[q, lane] = np.exp(power) + condition[2 + q]
        if quiet_from <= parameter < quiet_to:
            # noise of a reading: the same motion
            for i in range(n):
                for j in range(n):
                    lanes.transition[i, j, lane] = lanes.transition[i, j, 0]
                    lanes.noise[i, j, lane] = lanes.noise[i, j, 0]
                    lanes.start[i, j, lane] = lanes.start[i, j, 0]
            lanes.early[:, :, lane], lanes.late[:, :, lane] = lanes.early[:, :, 0], lanes.late[:, :, 0]
            lanes.output[:, :, lane] = lanes.output[:, :, 0]
        else:
            a, w, output = _dynamics(setup, moved, lanes.level, condition[1])
            f, early, late, q_ = discretise(a, into, w, condition[0])
            lanes.transition[:, :, lane], lanes.noise[:, :, lane] = f, q_
            lanes.early[:, :, lane], lanes.late[:, :, lane] = early[:ns], late[:ns]
            lanes.output[:, :, lane] = output
            air_f = np.ascontiguousarray(f[ns : n - ns, ns : n - ns])
            air_q = np.ascontiguousarray(q_[ns : n - ns, ns : n - ns])
            lanes.start[:, :, lane] = 0.0
            lanes.start[ns : n - ns, ns : n - ns, lane] = stationary_covariance(air_f, air_q)
            for i in range(ns):
                std = _START_ANGLE * condition[1] if i == 0 else _START_RATE
                lanes.start[n - ns + i, n - ns + i, lane] = std**2
        if lane > 0:
            moved[parameter] = p[parameter]
    for i in range(n):
        for j in range(n):
            if np.any(lanes.transition[i, j] != 0.0):
                lanes.where[i, lanes.entries[i]] = j
                lanes.entries[i] += 1
    for u in range(nu):
        variance = condition[2 + ch + u]
        moved = np.zeros(ns)
        for i in range(ns):
            for j in range(ns):
                moved[i] += (lanes.early[i, j, 0] + lanes.late[i, j, 0]) * lanes.theta[j, ns + u, 0]
        for i in range(ns):
            for j in range(ns):
                lanes.surface_noise[u, i, j] = variance * moved[i] * moved[j]
        if setup.force >= 0:
            direct = lanes.theta[setup.force, ns + u, 0]
            for j in range(ns):
                direct -= setup.lever[j] * lanes.theta[j, ns + u, 0]
            lanes.surface_variance[u, ns] = variance * direct**2
