"""What noise and gusts do to the equations of one block of the recursive Fourier estimator; compiled.

The rows of a block are the force equation, the moment equations and, where a vane and an accelerometer are there, the
kinematic row dw/dt = a_z + k (dv/dt = a_y + k), which holds no derivative. The residual of a bin is L n + B d + e: n
white noise of the sensors, d the rate of the gust at the vane and the rolling of the air, e what a moment equation
leaves out. Derivation, symbols and equation numbers: ``docs/methods/fourier.md`` sections 2 and 4.

Real and imaginary parts lie apart and bins side by side, (..., 2, bins). All memory is the caller's.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.fourier.hermitian import condition_on_last, invert_2, invert_3, join_last
from wingwatch.estimators.fourier.state import AIR_VARIANCES, GUST
from wingwatch.kernels.decorators import lean

__all__ = [
    "DRIVING",
    "Air",
    "NoiseWorkspace",
    "Plant",
    "air_of",
    "between_samples_variance",
    "channel_variance",
    "noise_variances",
    "noise_workspace",
    "weigh",
    "weigh_with_doubt",
    "weighted_column",
]

DRIVING = AIR_VARIANCES
"""All of the air drives the states."""

ESTIMATED = 2
"""Of the air's variances the first ones are estimated; the others follow from them."""

DOUBTED = 3
"""What an error of a derivative makes noise of: noise of the regressor, the turning of the air, its rolling."""

SMALLEST_VARIANCE = 1e-12
"""Of the air and of what a moment equation leaves out: nothing."""


class Air(NamedTuple):
    """How the air's motion enters the equations; one vehicle's block.

    Attributes:
        turn: gust-induced pitch (yaw) rate over the gust's rate, -1/V in pitch, 1/V in yaw, 1/(m/s); 0 where it is not
            known.
        turn_s: time constant of the smoothing over the span, s.
        roll_s: the same for rolling, s.
        together: correlation of what the gust does between samples at the vane and at the centre of gravity, 1 where
            it is there when a sample is taken at both.
    """

    turn: float
    turn_s: float
    roll_s: float
    together: float


class Plant(NamedTuple):
    """Present derivatives and kinematics that a block is linearised at.

    Attributes:
        derivatives: (states, states + inputs), aerodynamic, not referred.
        forward_speed: (states,), what the kinematic term has of each state, m/s.
        lever: (states,), of the accelerometer, m.
        roll_column: (states,), what rolling of the air does: derivatives by roll rate at what is known, else zeros.
        by_accelerometer: whether the force equation rests on the accelerometer; else on the velocity's rate.
        kinematic: whether there is the kinematic row, which needs vane and accelerometer.
    """

    derivatives: NDArray[np.float64]
    forward_speed: NDArray[np.float64]
    lever: NDArray[np.float64]
    roll_column: NDArray[np.float64]
    by_accelerometer: bool
    kinematic: bool


class NoiseWorkspace(NamedTuple):
    """Memory of this module's kernels; rows are ``states`` or ``states + 1``, sources sensors and air.

    Attributes:
        transfer: (sources, rows, 2, bins) L and B: states, accelerometer, inputs, gust's rate, rolling air.
        weights: (rows, rows, 2, bins) W, inverse of the residual's covariance.
        sure: (rows, rows, 2, bins) the same were the derivatives known; then what fitted nuisance columns leave of it.
        fitted, half, taken: (rows, rows, 2, bins), of ``nuisance.reduce_weights``.
        weighted: (rows, 2, bins) W times one column of ``transfer``.
        spread: (bins,).
        doubt: (DOUBTED, states, states) covariance that the equations' residuals have because the derivatives are not
            known: by the regressors' noise, by the turning of the air for a unit of it, and by its rolling.
        shaped: (DOUBTED, bins) power of these in a bin: white, and what the span leaves of the air's.
        believed: (bins,) part of the kinematic row that is the gust's rate, H of (8); zeros where there is no such row.
        sums: (states, states) sum over bins of Re W.
        determinant: (bins,) of W.
        driven: (states, 2, bins) products of explained motion and weighted residual that are due to the air.
        rolled: (1,) sum over bins of the power that the rolling air gives the roll rate, by the roll equation's weight.
        answers: (states, 2 states + DRIVING, 2, bins) of ``driven_motion.driven_motions``.
        shared: (states + inputs, rows, 2, bins) covariance of the regressors' errors with the residual.
        common: (2, bins) workspace.
        caused: (states, 2, bins) weighted residual by a unit of one motion of the air.
        at_ends: (states,) of ``driven_motion.roll_shared_at_ends``; begun: (states, states + 1, 2, 1) workspace.
        at_rest: (1,) the frequency zero.
        lines: (sensors, rows, 2) a and b of the sensors' transfer a + s b.
    """

    transfer: NDArray[np.float64]
    weights: NDArray[np.float64]
    sure: NDArray[np.float64]
    fitted: NDArray[np.float64]
    half: NDArray[np.float64]
    taken: NDArray[np.float64]
    weighted: NDArray[np.float64]
    spread: NDArray[np.float64]
    doubt: NDArray[np.float64]
    shaped: NDArray[np.float64]
    believed: NDArray[np.float64]
    sums: NDArray[np.float64]
    determinant: NDArray[np.float64]
    driven: NDArray[np.float64]
    rolled: NDArray[np.float64]
    answers: NDArray[np.float64]
    shared: NDArray[np.float64]
    common: NDArray[np.float64]
    caused: NDArray[np.float64]
    at_ends: NDArray[np.float64]
    begun: NDArray[np.float64]
    at_rest: NDArray[np.float64]
    lines: NDArray[np.float64]


def noise_workspace(states: int, inputs: int, rows: int, bins: int) -> NoiseWorkspace:
    """Memory for one structure."""
    return NoiseWorkspace(
        np.zeros((states + 1 + inputs + AIR_VARIANCES, rows, 2, bins)),
        np.zeros((rows, rows, 2, bins)),
        np.zeros((rows, rows, 2, bins)),
        np.zeros((rows, rows, 2, bins)),
        np.zeros((rows, rows, 2, bins)),
        np.zeros((rows, rows, 2, bins)),
        np.zeros((rows, 2, bins)),
        np.zeros(bins),
        np.zeros((DOUBTED, states, states)),
        np.ones((DOUBTED, bins)),
        np.zeros(bins),
        np.zeros((states, states)),
        np.ones(bins),
        np.zeros((states, 2, bins)),
        np.zeros(1),
        np.zeros((states, 2 * states + DRIVING, 2, bins)),
        np.zeros((states + inputs, rows, 2, bins)),
        np.zeros((2, bins)),
        np.zeros((states, 2, bins)),
        np.zeros(states),
        np.zeros((states, states + 1, 2, 1)),
        np.zeros(1),
        np.zeros((states + 1 + inputs, rows, 2)),
    )


@lean
def air_of(model, airspeed, dt):  # type: ignore[no-untyped-def]
    """``Air`` at an airspeed, m/s, of samples dt apart, s."""
    speed = max(airspeed, 1.0)
    turn = 0.0
    if model.turn_smoothing_m > 0.0:
        turn = (-1.0 if model.longitudinal else 1.0) / speed
    ahead = model.vane_ahead_m / (speed * dt)
    part = ahead - math.floor(ahead)
    together = 1.0 - 6.0 * part * (1.0 - part)
    return Air(turn, model.turn_smoothing_m / speed, model.roll_smoothing_m / speed, together)


@lean
def between_samples_variance(gust_variance, dt):  # type: ignore[no-untyped-def]
    """Variance of white noise that the velocity seems to have because a gust is no line between samples, (docs (11)).

    A gust whose rate is white moves as a Wiener process. Between two samples it is a Brownian bridge, whose integral
    over the step has the variance gust_variance dt dt^3 / 12, and does not depend on what the samples are.
    """
    return gust_variance * dt * dt / 12.0


@lean
def channel_variance(noise, j, ns):  # type: ignore[no-untyped-def]
    """Noise variance of source j (states, accelerometer, inputs, air) in the vector of all variances."""
    return noise[j] if j <= ns else noise[ns + j]


@lean
def _transfer_of_sensors(omega, plant, work):  # type: ignore[no-untyped-def]
    """L of states, accelerometer and inputs: lines in s, a + s b, (docs (7)); a and b into ``work.lines``."""
    transfer, lines = work.transfer, work.lines
    ns, nd = plant.derivatives.shape
    rows = transfer.shape[1]
    for j in range(nd + 1):
        for k in range(rows):
            flat, rate = 0.0, 0.0
            if k < ns:
                if j != ns:
                    flat = -plant.derivatives[k, j if j < ns else j - 1]
                if k > 0 and j == k:
                    rate = 1.0
                if k == 0 and plant.by_accelerometer:
                    flat += 1.0 if j == ns else 0.0
                    rate = plant.lever[j] if j < ns else 0.0
                elif k == 0:
                    rate = 1.0 if j == 0 else 0.0
                    flat -= plant.forward_speed[j] if j < ns else 0.0
            elif j < ns:
                rate = (1.0 if j == 0 else 0.0) - plant.lever[j]
                flat = -plant.forward_speed[j]
            elif j == ns:
                flat = -1.0
            lines[j, k, 0], lines[j, k, 1] = flat, rate
            real, imaginary = transfer[j, k, 0], transfer[j, k, 1]
            for f in range(omega.size):
                real[f] = flat
                imaginary[f] = omega[f] * rate


@lean
def _transfer_of_air(omega, plant, air, transfer):  # type: ignore[no-untyped-def]
    """B: how the gust's rate, rolling air and a gust between samples enter the rows, (docs (8) to (11)).

    The lines of velocity and accelerometer lack what they do between samples, and so lack the same in the force row;
    the rows with rates are exact in the left sides. The turning of the air follows the gust between samples too.
    """
    ns, nd = plant.derivatives.shape
    rows = transfer.shape[1]
    gust, rolling, between = transfer[nd + 1], transfer[nd + 2], transfer[nd + 3]
    for f in range(omega.size):
        s = 1j * omega[f]
        turn = air.turn / (1.0 + s * air.turn_s)
        roll = 1.0 / (1.0 + s * air.roll_s)
        for k in range(rows):
            by_gust, by_roll = -1.0 + 0.0j, 0.0j
            if k < ns:
                by_gust = -plant.derivatives[k, ns - 1] * turn
                if k == 0 and rows == ns and not plant.by_accelerometer:
                    by_gust -= 1.0
                by_roll = -plant.roll_column[k] * roll
            gust[k, 0, f], gust[k, 1, f] = by_gust.real, by_gust.imag
            rolling[k, 0, f], rolling[k, 1, f] = by_roll.real, by_roll.imag
            if k == ns:
                short = air.together * plant.derivatives[0, 0] + 0.0j
            elif k > 0 or not plant.by_accelerometer:
                short = plant.derivatives[k, 0] + plant.derivatives[k, ns - 1] * turn * s
            else:
                short = (1.0 - air.together) * plant.derivatives[0, 0] + 0.0j
                if air.turn != 0.0:
                    short -= plant.derivatives[0, ns - 1] * turn / air.turn_s
            between[k, 0, f], between[k, 1, f] = short.real, short.imag


@lean
def _residual_covariance(omega, noise, power, work):  # type: ignore[no-untyped-def]
    """Upper triangle of power (L D L' + B D B' + Q + U) into ``work.weights``, (docs (10)).

    Of the sensors, whose transfers are lines a + s b, all bins have the same three sums: of a a, b b and b a - a b.
    """
    transfer, doubt, weights, shaped = work.transfer, work.doubt, work.weights, work.shaped
    ns, sensors = doubt.shape[1], work.lines.shape[0]
    rows, bins = weights.shape[0], weights.shape[3]
    for k in range(rows):
        for m in range(k, rows):
            real, imaginary = weights[k, m, 0], weights[k, m, 1]
            flat, square, across = _sums_of_sensors(noise, ns, work.lines, k, m)
            if k == m and k < ns:
                flat += noise[ns + 1 + k]
            turning = rolling = 0.0
            if m < ns:
                flat += doubt[0, k, m]
                turning, rolling = power * doubt[1, k, m], power * doubt[2, k, m]
            flat, square, across = power * flat, power * square, power * across
            for f in range(bins):
                real[f] = (
                    flat + square * omega[f] * omega[f] + (turning * shaped[1, f] + rolling * shaped[2, f])
                )
                imaginary[f] = across * omega[f]
            for j in range(sensors, transfer.shape[0]):
                variance = power * channel_variance(noise, j, ns)
                if variance == 0.0:
                    continue
                a, b = transfer[j, k, 0], transfer[j, k, 1]
                c, d = transfer[j, m, 0], transfer[j, m, 1]
                for f in range(bins):
                    real[f] += variance * (a[f] * c[f] + b[f] * d[f])
                    imaginary[f] += variance * (b[f] * c[f] - a[f] * d[f])


@lean
def _sums_of_sensors(noise, ns, lines, k, m):  # type: ignore[no-untyped-def]
    """Over the sensors, of rows k and m: a a, b b and b a - a b, each times the sensor's variance."""
    flat = square = across = 0.0
    for j in range(lines.shape[0]):
        variance = channel_variance(noise, j, ns)
        a, b, c, d = lines[j, k, 0], lines[j, k, 1], lines[j, m, 0], lines[j, m, 1]
        flat += variance * a * c
        square += variance * b * d
        across += variance * (b * c - a * d)
    return flat, square, across


@lean
def weigh(omega, plant, air, noise, power, work):  # type: ignore[no-untyped-def]
    """Transfer of noise and air, and the weight of every bin, W = (L D L' + B D B' + Q)^-1 / power.

    Args:
        omega: (bins,), rad/s.
        noise: all variances: states, accelerometer, equations' own, inputs, air.
        power: of white noise of unit variance in a bin.
        work: ``NoiseWorkspace``, its ``doubt`` as ``doubt_of`` leaves it; the rest is filled.
    """
    _transfer_of_sensors(omega, plant, work)
    _transfer_of_air(omega, plant, air, work.transfer)
    for f in range(omega.size):
        work.shaped[1, f] = air.turn * air.turn / (1.0 + (omega[f] * air.turn_s) ** 2)
        work.shaped[2, f] = 1.0 / (1.0 + (omega[f] * air.roll_s) ** 2)
    weigh_with_doubt(omega, noise, power, work)


@lean
def weigh_with_doubt(omega, noise, power, work):  # type: ignore[no-untyped-def]
    """The weight of every bin with another ``doubt`` than in the call of ``weigh`` before, all else as there."""
    weights, ns = work.weights, work.doubt.shape[1]
    _residual_covariance(omega, noise, power, work)
    for f in range(work.determinant.size):
        work.determinant[f] = 1.0
    if weights.shape[0] > ns:
        gust = power * noise[GUST]
        for f in range(work.believed.size):
            work.believed[f] = gust / weights[ns, ns, 0, f]
            work.determinant[f] = 1.0 / weights[ns, ns, 0, f]
        condition_on_last(weights)
    if ns == 2:
        invert_2(weights, work.determinant)
    else:
        invert_3(weights, work.determinant)
    if weights.shape[0] > ns:
        join_last(weights)
    for k in range(ns):
        for m in range(ns):
            total = 0.0
            for f in range(weights.shape[3]):
                total += weights[k, m, 0, f]
            work.sums[k, m] = total


@lean
def weighted_column(work, j):  # type: ignore[no-untyped-def]
    """W times column j of the transfer into ``work.weighted``, and its power, Re L_j' W L_j, into ``work.spread``."""
    column, weights, out, spread = work.transfer[j], work.weights, work.weighted, work.spread
    rows = weights.shape[0]
    for f in range(spread.size):
        spread[f] = 0.0
    for k in range(rows):
        real, imaginary = out[k, 0], out[k, 1]
        for f in range(spread.size):
            real[f] = imaginary[f] = 0.0
        for m in range(rows):
            a, b, x, y = weights[k, m, 0], weights[k, m, 1], column[m, 0], column[m, 1]
            for f in range(spread.size):
                real[f] += a[f] * x[f] - b[f] * y[f]
                imaginary[f] += a[f] * y[f] + b[f] * x[f]
        x, y = column[k, 0], column[k, 1]
        for f in range(spread.size):
            spread[f] += x[f] * real[f] + y[f] * imaginary[f]


@lean
def noise_variances(whitened, freedom, noise, power, work, total):  # type: ignore[no-untyped-def]
    """One step to the likeliest noise variances, from the weighted residual of one block, (docs (17), (18)).

    Sensors, whose variance is never nothing: what the residual shows of a source over what it determines of it (fixed
    point of expectation-maximisation). Air, and what moment equations leave out, which may be nothing: a step of Fisher
    scoring, at most to ten times the variance or its standard error.

    Args:
        whitened: (rows, 2, bins), W times the residual.
        freedom: what the residual's power is multiplied by for the degrees of freedom that columns took.
        total: becomes the new variances.
    """
    ns = work.sums.shape[0]
    sources = work.transfer.shape[0]
    for j in range(noise.size):
        total[j] = noise[j]
    for j in range(sources):
        if ns < j < sources - AIR_VARIANCES or j >= sources - AIR_VARIANCES + ESTIMATED:
            continue
        own = j if j <= ns else noise.size - sources + j
        weighted_column(work, j)
        found = spread = squared = 0.0
        for f in range(work.spread.size):
            real = imaginary = 0.0
            for k in range(whitened.shape[0]):
                a, b = work.transfer[j, k, 0, f], work.transfer[j, k, 1, f]
                real += a * whitened[k, 0, f] + b * whitened[k, 1, f]
                imaginary += a * whitened[k, 1, f] - b * whitened[k, 0, f]
            found += real * real + imaginary * imaginary
            spread += work.spread[f]
            squared += work.spread[f] * work.spread[f]
        total[own] = _step(found * freedom, spread, squared, noise[own], power, j < sources - AIR_VARIANCES)
    for k in range(1, ns):
        found = squared = 0.0
        for f in range(work.spread.size):
            found += whitened[k, 0, f] ** 2 + whitened[k, 1, f] ** 2
            squared += work.weights[k, k, 0, f] ** 2
        total[ns + 1 + k] = _step(found * freedom, work.sums[k, k], squared, noise[ns + 1 + k], power, False)


@lean
def _step(found, spread, squared, variance, power, sensor):  # type: ignore[no-untyped-def]
    """New variance: ``found`` is what the residual shows, ``spread`` its expectation over the variance."""
    if sensor:
        if not spread * power * variance > 1e-12:
            return variance
        return min(max(variance * found / spread, 0.1 * variance), 10.0 * variance)
    if not spread > 0.0:
        return variance
    step = (found - spread) / (squared * power)
    most = 10.0 * max(variance, 1.0 / (power * math.sqrt(squared)))
    return min(max(variance + step, SMALLEST_VARIANCE), most)
