"""One solution of the recursive Fourier estimator with one block: what the block says, and where it moves; compiled.

Derivation and symbols: ``docs/estimators.md`` sections 3 to 8. Arrays are those of one vehicle.
"""

import math
from typing import Any

import numpy as np

from wingwatch.estimators.fourier_air import (
    AIR_COLUMNS,
    AIR_LEVELS,
    air_channels,
    air_of,
    air_regressors,
    start_air_noise,
)
from wingwatch.estimators.fourier_air_equations import air_noise_update, air_products, air_weights
from wingwatch.estimators.fourier_bank import NUISANCE, block_transforms
from wingwatch.estimators.fourier_between import between_samples
from wingwatch.estimators.fourier_directions import (
    DIRECTION_LINES,
    DIRECTION_SQUARES,
    noise_edge,
    reduce_information,
)
from wingwatch.estimators.fourier_equations import (
    block_equations,
    eliminate,
    noise_update,
    nuisance_of,
    responses,
)
from wingwatch.estimators.fourier_weights import bin_weights
from wingwatch.estimators.hot import lean, part
from wingwatch.estimators.symmetric import congruence, invert

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

ROOT_MEAN = 0.8221790
"""Mean of the square root of a standard normal number's magnitude, 2^(1/4) Gamma(3/4) / sqrt(pi)."""

ROUGH_CHANCE = 2.4
"""Relative standard deviation of ``_rough_noise`` times the root of the count: that of the fourth power of the mean of
roots, 4 sqrt(0.180), differences of white noise being correlated by sqrt(35 / 18)."""


def solution_room(ns: int, nu: int, nf: int) -> tuple[Room, Room]:
    """Room of ``solve_block`` for ns states, nu inputs and nf frequencies, and what it tells.

    Told: matrices (5, p, p), what the block adds to sensitivity and information, its evidence, the covariance, and M;
    vectors (4, p), what it adds to the score and to the driven part, its evidence's score and the gusts' part of that;
    the noise variances that its residual shows.
    """
    p, q = ns * (ns + nu), NUISANCE * ns
    bins = (
        np.empty((2, ns + 2 * nu + 1 + NUISANCE + air_channels(ns, nu), 2, nf)),
        np.empty((2, ns + nu, 2, nf)),
        np.empty((2, nf)),
        np.empty((2, nf)),
        np.empty((ns, 2, nf)),
        np.empty((ns, 2, nf)),
        np.empty((ns, ns, 2, nf)),
    )
    columns = (
        np.empty((p + q, p + q)),
        np.empty(p + q),
        np.empty((q, p)),
        np.empty((q, q)),
        np.empty((2, q, 1)),
        np.empty(q),
    )
    states = (
        np.empty((2, ns, ns + 1 + nu)),
        np.empty((3, ns, ns)),
        np.empty((ns, ns)),
        np.empty((2, ns)),
        np.empty(3),
    )
    squares, lines = np.empty((4 + DIRECTION_SQUARES, p, p)), np.empty((7 + DIRECTION_LINES, p))
    told = (np.empty((5, p, p)), np.empty((4, p)), np.empty(2 * ns + 1 + nu + AIR_LEVELS))
    air = (
        np.empty((nf, ns, ns + 1 + nu + AIR_COLUMNS), dtype=np.complex128),
        np.empty((nf, ns + 1), dtype=np.complex128),
        np.empty((nf, AIR_COLUMNS)),
        np.empty((ns, 2 * ns + 1), dtype=np.complex128),
    )
    return (bins, columns, states, squares, lines, np.empty((p, 2)), air), told


@lean
def _rough_noise(roughness, j, ns):  # type: ignore[no-untyped-def]
    """Variance of white noise of channel ``j`` that second differences (variance 6 D) would have such roots from.

    The roots of their magnitudes are summed, not their squares: what bends when a surface jumps is large, but rare.
    """
    root = roughness[j] / max(roughness[ns + 1], 1.0) / ROOT_MEAN
    return root**4 / 6.0


@lean
def start_noise(roughness, noise, ns):  # type: ignore[no-untyped-def]
    """First variances from second differences, whose variance is 6 D for white noise."""
    for j in range(ns + 1):
        least = 1e-8 if j in (0, ns) else 1e-10
        noise[j] = max(_rough_noise(roughness, j, ns), least)
    for k in range(ns):
        noise[ns + 1 + k] = noise[k]
    start_air_noise(noise)


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
def _believe(noise, fresh, noise_known, share, roughness, by_accelerometer, air, ns):  # type: ignore[no-untyped-def]
    """Noise variances from this block's residual and from earlier blocks, by the time each rests on.

    Below any sensor's resolution nothing is gained: 1e-4 m/s and m/s2, 1e-5 rad/s.
    """
    known = noise_known[-1]
    for j in range(2 * ns + 1):
        noise[j] = (known * noise_known[j] + share * fresh[j]) / (known + share)
    noise[ns + 1 if by_accelerometer else ns] = 0.0
    for j in range(ns + 1):
        noise[j] = max(noise[j], LOWEST_NOISE * _rough_noise(roughness, j, ns))
    for j in range(2 * ns + 1):
        noise[j] = max(noise[j], 1e-8 if j in (0, ns, ns + 1) else 1e-10)
    if air[0] == 0.0:
        return
    chance = 1.0 + 2.0 * ROUGH_CHANCE / math.sqrt(max(roughness[ns + 1], 1.0))
    for j in range(ns):
        # A sensor's noise is white: more than that, chance allowed, is the power of air, or of what the model leaves
        # out. Neither is it remembered: taken for noise it would be taken out of the regressors' power.
        most = max(chance * _rough_noise(roughness, j, ns), 1e-8 if j == 0 else 1e-10)
        noise[j] = min(noise[j], most)
        fresh[j] = min(fresh[j], most)
    known = noise_known[-2]
    for j in range(noise.size - AIR_LEVELS, noise.size):
        noise[j] = max((known * noise_known[j] + share * fresh[j]) / (known + share), 1e-10)
    if air[0] > 0.0:
        noise[noise.size - 1] = 1e-10


@lean
def _weigh(model, theta, noise, power, room):  # type: ignore[no-untyped-def]
    """The noise transfer and the weights of all bins at ``theta``."""
    omega, lever, by_accelerometer, exponents = model[0], model[1], model[2], model[3]
    transfer, moments, _, edges, air = room[2]
    ns, nu = lever.size, exponents.size - lever.size
    scale, weights = room[4][0], room[0][6]
    if air[0] == 0.0:
        bin_weights(
            omega, theta, scale, noise, power, edges[0], lever, by_accelerometer, ns, nu, transfer, weights, moments
        )  # fmt: skip
    else:
        air_weights(
            omega, theta, scale, noise, power, edges[0], lever, air, by_accelerometer, ns, nu, room[6], transfer[1],
            weights, moments,
        )  # fmt: skip


@part
def _form(model, block, theta, noise, power, share, room, told):  # type: ignore[no-untyped-def]
    """The block's equations at ``theta``, and what of them is signal."""
    omega, lever, by_accelerometer, exponents, settings, _, _, _ = model
    _, rows, sums, roughness = block
    transforms, between, phase, product, response, _, weights = room[0]
    m_full, b_full, crossed, root, rest, size = room[1]
    transfer, moments, matrix, edges, air = room[2]
    squares, lines = room[3], room[4]
    matrices, vectors, _ = told
    ns, nu = lever.size, exponents.size - lever.size
    forward_speed, suspected = edges[0], edges[1]
    scale, score, driven, g = lines[0], lines[1], lines[2], lines[3]
    n_noise, m = squares[0], matrices[4]
    span = rows[1, 0] - rows[0, 0]
    between_samples(
        omega, transforms[0], phase, rows[0], rows[1], span / max(sums[4] - 1.0, 1.0), settings[7 + nu : 7 + 2 * nu],
        theta, scale, forward_speed, lever, by_accelerometer, ns, nu, between, transforms[1],
    )  # fmt: skip
    _weigh(model, theta, noise, power, room)
    responses(omega, transforms[1], phase, rows[0], rows[1], lever, by_accelerometer, ns, response)
    if air[0] != 0.0:
        air_regressors(omega, transforms[1], rows[0], sums, exponents, noise, air, forward_speed, lever)
    bins = block_equations(
        omega, transforms[1], response, theta, scale, noise, power, share, forward_speed, ns, nu, transfer, weights,
        moments, (product, matrix), m_full, b_full, n_noise, g, driven,
    )  # fmt: skip
    if air[0] != 0.0:
        air_products(
            omega, theta, scale, noise, power, forward_speed, air, ns, nu, room[6], weights, n_noise, g, driven
        )  # fmt: skip
    eliminate(
        m_full, b_full, g, theta, scale, span, theta.size, root, size, crossed, rest[0], m, score,
    )  # fmt: skip
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
            and the lengths over which gusts are smoothed, zero where the air is not looked at.
        block: bank, rows, sums and roughness.
        theta, noise: at which the block is linearised; in place, unless ``asked`` is ``ALONE``.
        noise_known: of earlier blocks.
        memory: sensitivity, information, vector and driven part of what is known without the block.
        prior: value and standard deviation.
        asked: ``ALONE``, ``LEARN``, ``MOVE`` or ``BEGIN``.
        room, told: of ``solution_room``; told becomes what the block says.
    """
    omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, gust_m = model
    bank, rows, sums, roughness = block
    transforms, _, phase, product, response, whitened, weights = room[0]
    _, _, crossed, root, rest, size = room[1]
    transfer, moments, _, edges, air = room[2]
    squares, lines = room[3], room[4]
    ns, nu = lever.size, exponents.size - lever.size
    span = rows[1, 0] - rows[0, 0]
    power = span * span / max(sums[4] - 1.0, 1.0)
    share = min(1.0, span / settings[0])
    scale, moved, change = lines[0], lines[4], lines[5]
    inverse = squares[1]
    block_transforms(omega, bank, span, ns, nu, transforms[0], phase)
    _present(sums, settings, exponents, longitudinal, roll, scale, edges[0])
    air_of(gust_m, sums[0] / sums[4], longitudinal, air)
    for j in range(nu):
        noise[2 * ns + 1 + j] = min(settings[7 + j], sums[6 + j] / (6.0 * max(sums[5], 1.0)))
    for _ in range(3 if asked == BEGIN else 1):
        _form(model, block, theta, noise, power, share, room, told)
        _gain(theta, 2.0 * share, told)
        if asked == ALONE:
            return
        _moved(memory, prior, told[0][0], told[1][0], squares, inverse, moved)
        for a in range(theta.size):
            change[a] = moved[a] - theta[a]
            theta[a] = moved[a]
        nuisance_of(root, size, crossed, rest[0], change, scale, rest[1])
        _weigh(model, theta, noise, power, room)
        if air[0] == 0.0:
            noise_update(
                omega, transforms[1], response, theta, scale, rest[1], noise, power, ns, nu, transfer, weights, moments,
                (whitened, product), told[2],
            )  # fmt: skip
        else:
            air_noise_update(
                omega, transforms[1], response, theta, scale, rest[1], noise, power, edges[0], lever, air, ns, nu,
                room[6], weights, moments, whitened, told[2],
            )  # fmt: skip
        _believe(noise, told[2], noise_known, share, roughness, by_accelerometer, air, ns)
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
