"""One solution of the recursive Fourier estimator with one block: what the block says, and where it moves; compiled.

Derivation and symbols: ``docs/methods/fourier.md``. Arrays are those of one vehicle.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.fourier.air import air_channels, present_regressors
from wingwatch.estimators.fourier.bank import NUISANCE, bank_channels, block_transforms
from wingwatch.estimators.fourier.between import between_samples, turned_between_samples
from wingwatch.estimators.fourier.checkpoints import copy_bank
from wingwatch.estimators.fourier.coherence import gather_coherence
from wingwatch.estimators.fourier.directions import (
    DirectionsWorkspace,
    directions_workspace,
    noise_edge,
    reduce_information,
)
from wingwatch.estimators.fourier.doubt import doubt_of, doubt_of_courses
from wingwatch.estimators.fourier.driven_motion import driven_motions, roll_shared_at_ends
from wingwatch.estimators.fourier.equations import (
    EquationSides,
    normal_equations,
    residual_of,
    responses,
    with_other_regressors,
)
from wingwatch.estimators.fourier.noise import (
    NoiseWorkspace,
    Plant,
    air_of,
    between_samples_variance,
    noise_variances,
    noise_workspace,
    weigh,
    weigh_with_doubt,
)
from wingwatch.estimators.fourier.noise_levels import update_noise
from wingwatch.estimators.fourier.nuisance import (
    NormalWorkspace,
    bins_left,
    degrees_of_freedom,
    eliminate,
    factorise,
    fitted_columns,
    normal_workspace,
    nuisance_of,
    nuisance_variances,
    of_the_same_nuisance,
    reduce_weights,
)
from wingwatch.estimators.fourier.products import expected_products, motion_by_moments
from wingwatch.estimators.fourier.regressor_errors import (
    add_unseen_errors,
    shared_with_residual,
    shown_by_residual,
    without_errors,
)
from wingwatch.estimators.fourier.state import (
    AIR_VARIANCES,
    AIRSPEED,
    ALPHA,
    BETWEEN,
    DENSITY,
    GUST,
    LAST,
    SAMPLES,
    START,
    TIME,
    BlockSolution,
    Equation,
    Evidence,
    Memory,
    Transforms,
)
from wingwatch.estimators.kernels.symmetric import congruence, invert
from wingwatch.kernels.decorators import lean, part

__all__ = [
    "ALONE",
    "CAUSED",
    "MEASURED",
    "MOVE",
    "STAY",
    "STEP",
    "SolutionWorkspace",
    "block_solution",
    "coherence_of_block",
    "remembered",
    "solution_workspace",
    "solve_block",
    "zero_memory",
]

ALONE, MOVE, STEP, STAY = np.int64(0), np.int64(1), np.int64(2), np.int64(3)
"""What is asked of a solution: what the block says alone; derivatives, covariance and noise variances with the block
too, until the derivatives move no more, or after one step; noise variances alone, the derivatives staying where they
are.

Not Python's integers: for each of them a kernel would be compiled anew."""

MOST_STEPS = 5
"""Gauss-Newton steps of a solution at most."""

MEASURED, CAUSED = range(2)
"""Places in ``SolutionWorkspace.roll``."""

LEAST_FREEDOM = 0.25
"""Fraction of a block's degrees of freedom that its columns are believed to leave at least."""


class PosteriorWorkspace(NamedTuple):
    """Workspace of what memory and block say together.

    Attributes:
        inverse: (k, k) of the sensitivity.
        total, half: (k, k); line: (k,).
        nothing: of a block that says nothing: zeros.
    """

    inverse: NDArray[np.float64]
    total: NDArray[np.float64]
    half: NDArray[np.float64]
    line: NDArray[np.float64]
    nothing: Memory


class SolutionWorkspace(NamedTuple):
    """Workspace of ``solve_block``.

    Attributes:
        transforms, normal, noise, directions, posterior, equation: of its parts.
        without_errors: normal equations whose regressors are without their errors.
        derivatives, forward_speed, roll_column: arrays of ``Plant``.
        scale: (k,) what makes referred derivatives present ones.
        moved, change: (k,) derivatives with the block, and how far they have moved.
        roll: (2,) power of the roll rate by the roll equation's weight: as measured, and what surfaces and gusts cause
            of it. Without meaning where the structure has no roll.
    """

    transforms: Transforms
    normal: NormalWorkspace
    without_errors: NormalWorkspace
    noise: NoiseWorkspace
    directions: DirectionsWorkspace
    posterior: PosteriorWorkspace
    equation: Equation
    derivatives: NDArray[np.float64]
    forward_speed: NDArray[np.float64]
    roll_column: NDArray[np.float64]
    scale: NDArray[np.float64]
    moved: NDArray[np.float64]
    change: NDArray[np.float64]
    roll: NDArray[np.float64]


def zero_memory(k: int) -> Memory:
    """Memory of k derivatives that knows nothing."""
    return Memory(np.zeros((k, k)), np.zeros((k, k)), np.zeros(k), np.zeros(k))


def solution_workspace(ns: int, nu: int, bins: int, rows: int) -> SolutionWorkspace:
    """Workspace for ns states, nu inputs and ns or ns + 1 rows."""
    k, channels = ns * (ns + nu), bank_channels(ns, nu) + NUISANCE - 1 + air_channels(ns, nu)
    shapes = [(channels, 2, bins)] * 3 + [(ns + nu, 2, bins)] * 2 + [(2, bins)] * 2 + [(rows, 2, bins)] * 3
    normal = normal_workspace(k, rows)
    return SolutionWorkspace(
        Transforms(*(np.empty(shape) for shape in shapes)),
        normal,
        of_the_same_nuisance(normal),
        noise_workspace(ns, nu, rows, bins),
        directions_workspace(k),
        PosteriorWorkspace(np.empty((k, k)), np.empty((k, k)), np.empty((k, k)), np.empty(k), zero_memory(k)),
        Equation(np.empty((k, k)), np.empty((k, k)), np.empty(k), np.empty(k), np.empty(k)),
        np.empty((ns, ns + nu)),
        np.empty(ns),
        np.empty(ns),
        np.empty(k),
        np.empty(k),
        np.empty(k),
        np.zeros(2),
    )


def block_solution(ns: int, nu: int) -> BlockSolution:
    """Memory for what a block says."""
    k = ns * (ns + nu)
    evidence = Evidence(np.empty((k, k)), np.empty(k), np.empty(k))
    return BlockSolution(zero_memory(k), evidence, np.empty(2 * ns + 1 + nu + AIR_VARIANCES), np.zeros(1))


@part
def _present(model, sums, scale, forward_speed):  # type: ignore[no-untyped-def]
    """Scale from referred to present derivatives, and the kinematic part per state, at the block's mean condition."""
    exponents, reference = model.exponents, model.reference_airspeed_m_s
    count = sums[SAMPLES]
    airspeed, density, alpha = sums[AIRSPEED] / count, sums[DENSITY] / count, sums[ALPHA] / count
    pressure = density * airspeed / (model.reference_density_kg_m3 * reference)
    columns, ns = exponents.size, forward_speed.size
    for a in range(scale.size):
        scale[a] = pressure if exponents[a % columns] == 1.0 else pressure * airspeed / reference
    forward_speed[:] = 0.0
    forward_speed[ns - 1] = airspeed * math.cos(alpha) * (1.0 if model.longitudinal else -1.0)
    if model.roll:
        forward_speed[1] = airspeed * math.sin(alpha)


@part
def _plant(model, theta, work):  # type: ignore[no-untyped-def]
    """``Plant`` at ``theta``, in the arrays of the workspace."""
    present, roll_column, scale = work.derivatives, work.roll_column, work.scale
    ns, nd = present.shape
    for k in range(ns):
        for j in range(nd):
            present[k, j] = theta[k * nd + j] * scale[k * nd + j]
        roll_column[k] = present[k, 1] if model.roll else 0.0
    kinematic = work.noise.weights.shape[0] > ns
    return Plant(present, work.forward_speed, model.lever, roll_column, model.by_accelerometer, kinematic)


@part
def _explained(std, gain, work):  # type: ignore[no-untyped-def]
    """What of the residual's power another value of the derivatives explains, by the equations as they are.

    ``std``: of the prior, (k,); ``gain``: of information over power.
    """
    m, score, total, inverse = (
        work.equation.power,
        work.equation.vector,
        work.posterior.total,
        work.posterior.inverse,
    )
    for a in range(std.size):
        for b in range(std.size):
            total[a, b] = m[a, b]
        total[a, a] += 1.0 / (gain * std[a] * std[a])
    invert(total, inverse)
    explained = 0.0
    for a in range(std.size):
        for b in range(std.size):
            explained += score[a] * inverse[a, b] * score[b]
    return explained


@part
def _leave_out_errors(model, plant, air, power, fraction, noise, work):  # type: ignore[no-untyped-def]
    """Score, power and noise of the regressors without what the residual shows of their errors, (docs (12), (13))."""
    transforms, normal, clear, equation = work.transforms, work.normal, work.without_errors, work.equation
    omega = model.omega
    explained = _explained(model.prior.std, 2.0 * fraction, work)
    work.change[:] = 0.0
    nuisance_of(normal, work.change, work.scale)
    residual = transforms.residual
    copy_bank(transforms.response, residual)
    residual_of(transforms.regressors, residual, transforms.whitened, plant, normal.values, work.noise.sure)
    shown = shown_by_residual(work.noise.weights, residual, explained)
    shared_with_residual(omega, plant, air, noise, power, work.noise)
    without_errors(transforms.whitened, shown, transforms.regressors, work.noise, transforms.without_errors)
    left = EquationSides(transforms.without_errors, residual, transforms.product)
    with_other_regressors(left, plant, work.noise.weights, normal, clear)
    eliminate(clear, work.change, work.scale, equation.power, equation.vector)
    fitted_columns(transforms.regressors, work.derivatives.shape[1] + 1, normal, work.noise)
    reduce_weights(work.noise.sure, work.noise)
    add_unseen_errors(noise, power, shown, work.noise, equation)


@part
def _form(model, block, at, power, fraction, work, found):  # type: ignore[no-untyped-def]
    """The block's equations where it is linearised, and what of them is signal."""
    omega, theta, noise, rows, sums = model.omega, at.theta, at.noise, block.rows, block.sums
    transforms, normal, weighing, equation = work.transforms, work.normal, work.noise, work.equation
    scale, g, bias, score = work.scale, equation.expected, equation.bias, equation.vector
    n_noise, m, nd = equation.noise, equation.power, model.exponents.size
    span = rows[LAST, TIME] - rows[START, TIME]
    dt = span / max(sums[SAMPLES] - 1.0, 1.0)
    air = air_of(model, sums[AIRSPEED] / sums[SAMPLES], dt)
    plant = _plant(model, theta, work)
    between_samples(model, rows, dt, theta, scale, work.forward_speed, transforms)
    weighing.doubt[:, :, :] = 0.0
    weigh(omega, plant, air, noise, power, weighing)
    for k in range(weighing.weights.shape[0]):
        copy_bank(weighing.weights[k], weighing.sure[k])
    doubt_of(at.covariance, scale, plant, noise, weighing.doubt)
    doubt_of_courses(sums, plant, weighing.doubt[0])
    weigh_with_doubt(omega, noise, power, weighing)
    driven_motions(omega, plant, weighing)
    responses(omega, rows, plant, transforms)
    present_regressors(model, block, plant, air, weighing.believed, transforms)
    turned_between_samples(omega, dt, plant, air, transforms)
    nuisance_variances(plant, air, noise, power / span, normal.variances)
    sides = EquationSides(transforms.regressors, transforms.response, transforms.product)
    normal_equations(sides, plant, fraction, weighing.weights, normal)
    factorise(normal, theta.size, span)
    eliminate(normal, theta, scale, m, score)
    by_roll = nd + 1
    work.roll[MEASURED] = m[by_roll, by_roll]
    g[:] = 0.0
    motion_by_moments(omega, plant, noise, power, weighing, n_noise)
    _leave_out_errors(model, plant, air, power, fraction, noise, work)
    work.roll[CAUSED] = m[by_roll, by_roll]
    reduce_weights(weighing.weights, weighing)
    bins = bins_left(weighing)
    roll_shared_at_ends(plant, air, weighing)
    expected_products(omega, plant, air, noise, power, span, weighing, equation)
    for a in range(scale.size):
        score[a] -= scale[a] * g[a]
        bias[a] *= scale[a]
        for b in range(scale.size):
            n_noise[a, b] *= scale[a] * scale[b]
    smallest = max(model.smallest_signal, noise_edge(nd, bins * fraction))
    reduce_information(equation, smallest, work.directions, found.gained, found.evidence)


@part
def _gain(theta, gain, found):  # type: ignore[no-untyped-def]
    """From scores at ``theta`` to those at zero, everything ``gain`` times (two real parts a bin)."""
    gained, evidence = found.gained, found.evidence
    sensitivity, kept, matrix = gained.sensitivity, gained.information, evidence.information
    add, bias, vector, evidence_bias = gained.vector, gained.bias, evidence.vector, evidence.bias
    for a in range(theta.size):
        bias[a] *= gain
        evidence_bias[a] *= gain
        for b in range(theta.size):
            add[a] += sensitivity[a, b] * theta[b]
            vector[a] += matrix[a, b] * theta[b]
            sensitivity[a, b] *= gain
            kept[a, b] *= gain
            matrix[a, b] *= gain
        add[a] *= gain
        vector[a] *= gain


@lean
def _moved(memory, gained, prior, work, moved):  # type: ignore[no-untyped-def]
    """What is known with the block: the inverse of its sensitivity, into ``work``, and the derivatives (k,)."""
    total, inverse, std = work.total, work.inverse, prior.std
    k = moved.size
    for a in range(k):
        for b in range(k):
            total[a, b] = memory.sensitivity[a, b] + gained.sensitivity[a, b]
        total[a, a] += 1.0 / (std[a] * std[a])
    invert(total, inverse)
    moved[:] = 0.0
    for b in range(k):
        score = memory.vector[b] + gained.vector[b] + prior.value[b] / (std[b] * std[b])
        for a in range(k):
            moved[a] += inverse[a, b] * score


@lean
def _settled(change, covariance):  # type: ignore[no-untyped-def]
    """Whether no derivative has moved by more than its stated error: what the next step would move is of second order
    in that."""
    far = False
    for a in range(change.size):
        far = far or change[a] * change[a] > covariance[a, a]
    return not far


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
def _covariance(memory, gained, std, work, out):  # type: ignore[no-untyped-def]
    """A^-1 C A^-1, with A^-1 of ``_moved`` and the prior's information in C, and the bias, (k, k)."""
    inverse, total, line = work.inverse, work.total, work.line
    p = std.size
    for a in range(p):
        for b in range(p):
            total[a, b] = memory.information[a, b] + gained.information[a, b]
        total[a, a] += 1.0 / (std[a] * std[a])
    congruence(inverse, total, work.half, out)
    for a in range(p):
        line[a] = 0.0
        for b in range(p):
            line[a] += inverse[a, b] * (memory.bias[b] + gained.bias[b])
    for a in range(p):
        for b in range(p):
            out[a, b] += line[a] * line[b]


@part
def _log_likelihood(residual, whitened, determinant):  # type: ignore[no-untyped-def]
    """Of a complex Gaussian residual (rows, 2, bins) with the weight W, (docs (27b)): sum of log det W - r' W r."""
    total = 0.0
    for f in range(determinant.size):
        total += math.log(determinant[f])
    for k in range(residual.shape[0]):
        for f in range(determinant.size):
            total -= residual[k, 0, f] * whitened[k, 0, f] + residual[k, 1, f] * whitened[k, 1, f]
    return total


@lean
def solve_block(model, block, at, memory, prior, asked, work, found):  # type: ignore[no-untyped-def]
    """Solve with a block.

    Args:
        at: ``Linearisation``; in place, unless ``asked`` is ``ALONE``.
        memory: what is known without the block.
        prior: ``Prior``.
        asked: ``ALONE``, ``MOVE``, ``STEP`` or ``STAY``.
        work: ``SolutionWorkspace``.
        found: ``BlockSolution``; becomes what the block says.
    """
    omega, rows, sums, theta, noise = model.omega, block.rows, block.sums, at.theta, at.noise
    transforms, normal, weighing, scale = work.transforms, work.normal, work.noise, work.scale
    ns, nu = model.lever.size, model.servos.time_s.size
    span = rows[LAST, TIME] - rows[START, TIME]
    power = span * span / max(sums[SAMPLES] - 1.0, 1.0)
    fraction = min(1.0, span / model.block_s)
    air = air_of(model, sums[AIRSPEED] / sums[SAMPLES], power / span)
    block_transforms(omega, block.bank, span, air.turn_s, ns, nu, transforms.lines, transforms.phase)
    _present(model, sums, scale, work.forward_speed)
    noise[BETWEEN] = between_samples_variance(noise[GUST], power / span)
    for _ in range(MOST_STEPS if asked == MOVE else 1):
        _form(model, block, at, power, fraction, work, found)
        _gain(theta, 2.0 * fraction, found)
        if asked == ALONE:
            return
        fitted = 0.0
        if asked == STAY:
            work.change[:] = 0.0
        else:
            _moved(memory, found.gained, prior, work.posterior, work.moved)
            for a in range(theta.size):
                work.change[a] = work.moved[a] - theta[a]
                theta[a] = work.moved[a]
            _covariance(memory, found.gained, prior.std, work.posterior, at.covariance)
            fitted = _learned(work.posterior.inverse, found.gained.information)
        nuisance_of(normal, work.change, scale)
        plant = _plant(model, theta, work)
        weighing.doubt[:, :, :] = 0.0
        weigh(omega, plant, air, noise, power, weighing)
        residual_of(
            transforms.regressors,
            transforms.response,
            transforms.whitened,
            plant,
            normal.values,
            weighing.weights,
        )
        whitened = transforms.whitened
        found.likelihood[0] = fraction * _log_likelihood(transforms.response, whitened, weighing.determinant)
        taken = degrees_of_freedom(normal, fraction) + fitted
        left = 1.0 - taken / (2.0 * omega.size * fraction * whitened.shape[0])
        noise_variances(whitened, 1.0 / max(left, LEAST_FREEDOM), noise, power, weighing, found.noise)
        update_noise(at, found.noise, fraction, power / span, block.roughness, plant, air)
        if _settled(work.change, at.covariance):
            return


@part
def coherence_of_block(model, posterior, linearised, keep, work, progress):  # type: ignore[no-untyped-def]
    """Add the block that was solved last to what goes with the motion, its residual at what is known with it.

    Args:
        posterior: ``Posterior`` with the block.
        linearised: (k,) derivatives at which it was solved.
        keep: what is kept of the blocks before.
        work: ``SolutionWorkspace`` of that solution.
        progress: ``Progress``, in place.
    """
    transforms, normal, weights = work.transforms, work.normal, work.noise.weights
    for a in range(linearised.size):
        work.change[a] = posterior.theta[a] - linearised[a]
    nuisance_of(normal, work.change, work.scale)
    plant = _plant(model, posterior.theta, work)
    residual, whitened = transforms.residual, transforms.whitened
    copy_bank(transforms.response, residual)
    residual_of(transforms.regressors, residual, whitened, plant, normal.values, weights)
    gather_coherence(transforms, plant, work.noise, keep, progress.coherence)


@lean
def remembered(memory, prior, work, mean, covariance):  # type: ignore[no-untyped-def]
    """Mean (k,) and covariance (k, k) of what is remembered; ``work`` is a ``PosteriorWorkspace``."""
    _moved(memory, work.nothing, prior, work, mean)
    _covariance(memory, work.nothing, prior.std, work, covariance)
