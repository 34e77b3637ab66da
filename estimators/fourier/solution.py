"""One solution of the recursive Fourier estimator with one block: what the block says, and where it moves; compiled.

Derivation and symbols: ``docs/methods/fourier.md``. Arrays are those of one vehicle.
"""

import math
from typing import Any

import numpy as np

from wingwatch.estimators.fourier.air import air_channels, present_regressors
from wingwatch.estimators.fourier.bank import NUISANCE, block_transforms
from wingwatch.estimators.fourier.between import between_samples
from wingwatch.estimators.fourier.directions import (
    DIRECTION_LINES,
    DIRECTION_SQUARES,
    noise_edge,
    reduce_information,
)
from wingwatch.estimators.fourier.equations import (
    normal_equations,
    residual_of,
    responses,
)
from wingwatch.estimators.fourier.noise import (
    AIR_LEVELS,
    SMALLEST_VARIANCE,
    Plant,
    air_of,
    between_samples_variance,
    noise_variances,
    noise_workspace,
    weigh,
)
from wingwatch.estimators.fourier.nuisance import (
    degrees_of_freedom,
    eliminate,
    normal_workspace,
    nuisance_of,
    nuisance_variances,
    reduce_weights,
)
from wingwatch.estimators.fourier.products import expected_products, noise_power
from wingwatch.estimators.kernels.hot import lean, part
from wingwatch.estimators.kernels.symmetric import congruence, invert

__all__ = [
    "ALONE",
    "BEGIN",
    "LEARN",
    "MOVE",
    "Room",
    "remembered",
    "solution_room",
    "solve_block",
    "start_noise",
]

Room = tuple[Any, ...]
"""Arrays, and tuples of them, that kernels write to."""

ALONE, LEARN, MOVE, BEGIN = np.int64(0), np.int64(1), np.int64(2), np.int64(3)
"""What is asked of a solution: what the block says; the noise levels too; and what is known with it; that three times.

Not Python's integers: for each of them a kernel would be compiled anew."""

LOWEST_NOISE = 0.5
"""A noise variance is not believed to be less than this share of the roughness (which signal, too, enlarges)."""

LEAST_FREEDOM = 0.25
"""Share of a block's degrees of freedom that its columns are believed to leave at least."""

ROOT_MEAN = 0.8221790
"""Mean of the square root of a standard normal number's magnitude, 2^(1/4) Gamma(3/4) / sqrt(pi)."""

INPUT_RESOLUTION = 1e-12
"""Least noise variance of a surface, (1e-6 rad)^2: a surface at rest leaves rounding in its transform, no signal."""

AIR_MEMORY = 0.2
"""Weight of the air of earlier blocks beside a whole block's own, in blocks: two seconds."""

ROUGH_CHANCE = 2.4
"""Relative standard deviation of ``_rough_noise`` times the root of the count: that of the fourth power of the mean of
roots, 4 sqrt(0.180), differences of white noise being correlated by sqrt(35 / 18)."""


def solution_room(ns: int, nu: int, nf: int, rows: int) -> tuple[Room, Room]:
    """Room of ``solve_block`` for ns states, nu inputs, nf frequencies and ns or ns + 1 rows, and what it tells.

    Told: matrices (5, p, p), what the block adds to sensitivity and information, its evidence, the covariance, and M;
    vectors (4, p), what it adds to the score and to the driven part, its evidence's score and the gusts' part of that;
    the noise variances that its residual shows.
    """
    p = ns * (ns + nu)
    bins = (
        np.empty((2, ns + 2 * nu + 1 + NUISANCE + air_channels(ns, nu), 2, nf)),
        np.empty((2, ns + nu, 2, nf)),
        np.empty((2, nf)),
        np.empty((2, nf)),
        np.empty((rows, 2, nf)),
        np.empty((rows, 2, nf)),
    )
    states = (np.empty((ns, ns + nu)), np.empty(ns), np.empty(ns), np.empty(ns))
    squares, lines = np.empty((4 + DIRECTION_SQUARES, p, p)), np.empty((7 + DIRECTION_LINES, p))
    told = (np.empty((5, p, p)), np.empty((4, p)), np.empty(2 * ns + 1 + nu + AIR_LEVELS))
    work = noise_workspace(ns, nu, rows, nf)
    return (bins, normal_workspace(p, rows), states, squares, lines, np.empty((p, 2)), work), told


@lean
def _rough_noise(roughness, j, ns):  # type: ignore[no-untyped-def]
    """Variance of white noise of channel ``j`` that second differences (variance 6 D) would have such roots from.

    The roots of their magnitudes are summed, not their squares: what bends when a surface jumps is large, but rare.
    """
    root = roughness[j] / max(roughness[ns + 1], 1.0) / ROOT_MEAN
    return root**4 / 6.0


@lean
def start_noise(roughness, noise, ns, gust_m):  # type: ignore[no-untyped-def]
    """First variances from second differences, whose variance is 6 D for white noise; those of the air as of a breeze
    that moves 1 m/s2 from sample to sample, which the first solutions correct; none where gusts have no
    length ``gust_m`` over which they act."""
    for j in range(ns + 1):
        least = 1e-8 if j in (0, ns) else 1e-10
        noise[j] = max(_rough_noise(roughness, j, ns), least)
    for k in range(ns):
        noise[ns + 1 + k] = noise[k]
    noise[noise.size - 3], noise[noise.size - 2], noise[noise.size - 1] = 1.0, 1e-4, 0.0
    if gust_m[1] == 0.0:
        noise[noise.size - 3] = 0.0


@part
def _present(sums, settings, exponents, longitudinal, roll, scale, forward_speed):  # type: ignore[no-untyped-def]
    """Scale from referred to present derivatives, and the kinematic part per state, at the block's mean condition."""
    airspeed, density, alpha = sums[0] / sums[4], sums[1] / sums[4], sums[3] / sums[4]
    pressure = density * airspeed / (settings[5] * settings[4])
    columns, ns = exponents.size, forward_speed.size
    for a in range(scale.size):
        scale[a] = pressure if exponents[a % columns] == 1.0 else pressure * airspeed / settings[4]
    forward_speed[:] = 0.0
    forward_speed[ns - 1] = airspeed * math.cos(alpha) * (1.0 if longitudinal else -1.0)
    if roll:
        forward_speed[1] = airspeed * math.sin(alpha)


@lean
def _believe(noise, fresh, noise_known, share, dt, roughness, plant, air):  # type: ignore[no-untyped-def]
    """Noise variances from this block's residual and from earlier blocks, by the time each rests on.

    Sensors' noise is the same in all blocks, and white, so between half and all of the roughness (two standard
    deviations of chance allowed): what is more, is air or what a moment equation leaves out. Of the roughness of vane
    and accelerometer the gust has its part: a walk of variance D dt^2 a step leaves 2 D dt^2 in second differences,
    white noise of variance R leaves 6 R, and the accelerometer feels the walk by the force's derivative. Below any
    sensor's resolution nothing is gained: 1e-4 m/s and m/s2, 1e-5 rad/s. Air changes: of earlier blocks little is
    believed.
    """
    first, ns, slope = noise.size - AIR_LEVELS, plant.lever.size, plant.derivatives[0, 0]
    gust_walk = noise[first] * dt * dt / 3.0
    for j in range(noise.size):
        if 2 * ns + 1 <= j < first:
            continue
        sensor = j <= ns
        known = noise_known[noise.size] if j < first else min(noise_known[noise.size], AIR_MEMORY)
        noise[j] = (known * noise_known[j] + share * fresh[j]) / (known + share)
        if sensor:
            rough = _rough_noise(roughness, j, ns)
            most = rough * (1.0 + 2.0 * ROUGH_CHANCE / math.sqrt(max(roughness[ns + 1], 1.0)))
            if not plant.kinematic:
                most = math.inf  # a reconstructed velocity's noise is no white noise
            least = 1e-8 if j in (0, ns) else 1e-10
            walk = gust_walk * (1.0 if j == 0 else (slope * slope if j == ns else 0.0))
            noise[j] = max(min(noise[j], most), LOWEST_NOISE * (rough - walk), least)
            fresh[j] = min(fresh[j], max(most, least))
        else:
            noise[j] = max(noise[j], SMALLEST_VARIANCE)
    noise[ns + 1 if plant.by_accelerometer else ns] = 0.0
    if air.turn != 0.0:
        noise[ns + 1] = 0.0  # all that a force equation leaves out is the gust's rate
    noise[noise.size - 1] = between_samples_variance(noise[first], dt)
    if ns == 3:
        noise[ns + 2] = 0.0


@part
def _plant(model, theta, scale, kinematic, states):  # type: ignore[no-untyped-def]
    """``Plant`` at ``theta``, in the arrays ``states``."""
    present, forward_speed, roll_column = states[0], states[1], states[2]
    ns, nd = present.shape
    for k in range(ns):
        for j in range(nd):
            present[k, j] = theta[k * nd + j] * scale[k * nd + j]
        roll_column[k] = present[k, 1] if model[6] else 0.0
    return Plant(present, forward_speed, model[1], roll_column, model[2], kinematic)


@part
def _form(model, block, theta, noise, power, share, room, told):  # type: ignore[no-untyped-def]
    """The block's equations at ``theta``, and what of them is signal."""
    omega, lever, _, exponents, settings, longitudinal, _, gust_m = model
    _, rows, sums, roughness = block
    transforms, between, phase, product, response, _ = room[0]
    normal, squares, lines, work = room[1], room[3], room[4], room[6]
    matrices, vectors, _ = told
    ns, nu = lever.size, exponents.size - lever.size
    forward_speed, suspected = room[2][1], room[2][3]
    scale, g, driven, score = lines[0], lines[1], lines[2], lines[3]
    n_noise, m = squares[0], matrices[4]
    span = rows[1, 0] - rows[0, 0]
    air = air_of(gust_m, sums[0] / sums[4], gust_m[2], longitudinal)
    plant = _plant(model, theta, scale, work.weights.shape[0] > ns, room[2])
    between_samples(
        omega, transforms[0], phase, rows[0], rows[1], span / max(sums[4] - 1.0, 1.0), settings[7 + nu : 7 + 2 * nu],
        theta, scale, forward_speed, lever, ns, nu, between, transforms[1],
    )  # fmt: skip
    weigh(omega, plant, air, noise, power, work)
    responses(omega, transforms[1], phase, rows[0], rows[1], plant, response)
    present_regressors(omega, transforms[1], (rows[0], sums), exponents, plant, air, work.believed, response)
    nuisance_variances(plant, air, noise, power / span, normal.variances)
    normal_equations(transforms[1], response, plant, share, work, product, normal)
    eliminate(normal, theta, scale, span, m, score)
    noise_power(omega, plant, air, noise, power, work, n_noise)
    bins = reduce_weights(transforms[1], ns + nu + 1, normal, work)
    expected_products(omega, plant, noise, power, work, g, driven)
    for a in range(scale.size):
        score[a] -= scale[a] * g[a]
        driven[a] *= scale[a]
        for b in range(scale.size):
            n_noise[a, b] *= scale[a] * scale[b]
    for j in range(ns):
        suspected[j] = max(1.0, _rough_noise(roughness, j, ns) / noise[j])
    reduce_information(
        m, n_noise, suspected, score, driven, max(settings[3], noise_edge(ns + nu, bins * share)),
        squares[4:], lines[7:], room[5], (vectors[0], vectors[1], vectors[2], vectors[3]),
        (matrices[0], matrices[1], matrices[2]),
    )  # fmt: skip


@part
def _gain(theta, gain, told):  # type: ignore[no-untyped-def]
    """From scores at ``theta`` to those at zero, everything ``gain`` times (two real parts a bin)."""
    sensitivity, kept, evidence = told[0][0], told[0][1], told[0][2]
    add, driven, evidence_vector, gust = told[1][0], told[1][1], told[1][2], told[1][3]
    for a in range(theta.size):
        driven[a] *= gain
        gust[a] *= gain
        for b in range(theta.size):
            add[a] += sensitivity[a, b] * theta[b]
            evidence_vector[a] += evidence[a, b] * theta[b]
            sensitivity[a, b] *= gain
            kept[a, b] *= gain
            evidence[a, b] *= gain
        add[a] *= gain
        evidence_vector[a] *= gain


@lean
def _moved(memory, prior, more, more_score, squares, inverse, moved):  # type: ignore[no-untyped-def]
    """What is known with the block: the inverse of its sensitivity (p, p), and the derivatives (p,)."""
    value, std = prior
    total = squares[2]
    p = moved.size
    for a in range(p):
        for b in range(p):
            total[a, b] = memory[0][a, b] + more[a, b]
        total[a, a] += 1.0 / (std[a] * std[a])
    invert(total, inverse)
    moved[:] = 0.0
    for b in range(p):
        score = memory[2][b] + more_score[b] + value[b] / (std[b] * std[b])
        for a in range(p):
            moved[a] += inverse[a, b] * score


@lean
def _learned(inverse, information):  # type: ignore[no-untyped-def]
    """How many derivatives' worth of freedom a block has taken: tr(what is known^-1 of the block), at most all."""
    p = inverse.shape[0]
    total = 0.0
    for a in range(p):
        for b in range(p):
            total += inverse[a, b] * information[a, b]
    return min(max(total, 0.0), 1.0 * p)


@lean
def _covariance(sensitivity_inverse, information, more, driven, more_driven, std, squares, line, out):  # type: ignore[no-untyped-def]
    """A^-1 C A^-1 and the gusts' bias, C the information with the prior's in it."""
    p = std.size
    total, half = squares[2], squares[3]
    for a in range(p):
        for b in range(p):
            total[a, b] = information[a, b] + more[a, b]
        total[a, a] += 1.0 / (std[a] * std[a])
    congruence(sensitivity_inverse, total, half, out)
    for a in range(p):
        line[a] = 0.0
        for b in range(p):
            line[a] += sensitivity_inverse[a, b] * (driven[b] + more_driven[b])
    for a in range(p):
        for b in range(p):
            out[a, b] += line[a] * line[b]


@lean
def solve_block(model, block, theta, noise, noise_known, memory, prior, asked, room, told):  # type: ignore[no-untyped-def]
    """Solve with a block.

    Args:
        model: omega, lever, by_accelerometer, exponents, settings, longitudinal, roll as ``FourierEstimator`` has them,
            and the lengths over which gusts are smoothed and by which the vane is ahead.
        block: bank, rows, sums, roughness.
        theta, noise: at which the block is linearised; in place, unless ``asked`` is ``ALONE``.
        noise_known: of earlier blocks, and their weight.
        memory: sensitivity, information, vector and driven part of what is known without the block.
        prior: value and standard deviation.
        asked: ``ALONE``, ``LEARN``, ``MOVE`` or ``BEGIN``.
        room, told: of ``solution_room``; told becomes what the block says.
    """
    omega, lever, _, exponents, settings, longitudinal, roll, gust_m = model
    bank, rows, sums, roughness = block
    transforms, _, phase, _, response, whitened = room[0]
    normal, squares, lines, work = room[1], room[3], room[4], room[6]
    ns, nu = lever.size, exponents.size - lever.size
    span = rows[1, 0] - rows[0, 0]
    power = span * span / max(sums[4] - 1.0, 1.0)
    share = min(1.0, span / settings[0])
    scale, moved, change = lines[0], lines[4], lines[5]
    inverse = squares[1]
    air = air_of(gust_m, sums[0] / sums[4], gust_m[2], longitudinal)
    block_transforms(omega, bank, span, air.turn_s, ns, nu, transforms[0], phase)
    _present(sums, settings, exponents, longitudinal, roll, scale, room[2][1])
    for j in range(nu):
        found = min(settings[7 + j], sums[6 + j] / (6.0 * max(sums[5], 1.0)))
        noise[2 * ns + 1 + j] = max(found, INPUT_RESOLUTION)
    noise[noise.size - 1] = between_samples_variance(noise[noise.size - AIR_LEVELS], power / span)
    for _ in range(3 if asked == BEGIN else 1):
        _form(model, block, theta, noise, power, share, room, told)
        _gain(theta, 2.0 * share, told)
        if asked == ALONE:
            return
        _moved(memory, prior, told[0][0], told[1][0], squares, inverse, moved)
        for a in range(theta.size):
            change[a] = moved[a] - theta[a]
            theta[a] = moved[a]
        nuisance_of(normal, change, scale)
        plant = _plant(model, theta, scale, work.weights.shape[0] > ns, room[2])
        weigh(omega, plant, air, noise, power, work)
        residual_of(transforms[1], response, plant, normal.values, work.weights, whitened)
        taken = degrees_of_freedom(normal, share) + _learned(inverse, told[0][1])
        left = 1.0 - taken / (2.0 * omega.size * share * whitened.shape[0])
        noise_variances(whitened, 1.0 / max(left, LEAST_FREEDOM), noise, power, work, told[2])
        _believe(noise, told[2], noise_known, share, power / span, roughness, plant, air)
    if asked >= MOVE:
        _covariance(
            inverse, memory[1], told[0][1], memory[3], told[1][1], prior[1], squares, lines[6], told[0][3]
        )  # fmt: skip


@lean
def remembered(memory, nothing, prior, squares, line, mean, covariance):  # type: ignore[no-untyped-def]
    """Mean (k,) and covariance (k, k) of what is remembered.

    Args:
        memory: sensitivity, information, vector and driven part.
        nothing: matrices (1 or more, k, k) and vectors (1 or more, k) of zeros.
        prior: value and standard deviation.
        squares, line: room, (4 or more, k, k) and (k,).
    """
    _moved(memory, prior, nothing[0][0], nothing[1][0], squares, squares[1], mean)
    _covariance(
        squares[1], memory[1], nothing[0][0], memory[3], nothing[1][0], prior[1], squares, line, covariance
    )  # fmt: skip
