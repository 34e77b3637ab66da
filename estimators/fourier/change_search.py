"""Whether a derivative has changed in the running block, since when, and what becomes of the block; compiled.

Derivation and symbols: ``docs/methods/fourier.md`` section 10. Arrays are those of one vehicle; the workspace is that
of ``blocks``.
"""

import numpy as np

from wingwatch.estimators.evidence.change import (
    CHANGE_LOG_THRESHOLD,
    change_of,
    changed_derivatives,
    inflate_covariance,
    spread_of_change,
)
from wingwatch.estimators.evidence.dispersion import disperse
from wingwatch.estimators.fourier.air import rebase_products
from wingwatch.estimators.fourier.checkpoints import (
    CHECKPOINTS,
    copy_bank,
    copy_matrix,
    copy_vector,
    since_checkpoint,
)
from wingwatch.estimators.fourier.closing import noise_of_block
from wingwatch.estimators.fourier.condition import gather_condition
from wingwatch.estimators.fourier.misfit import misfit_dispersions
from wingwatch.estimators.fourier.solution import ALONE, remembered, solve_block
from wingwatch.estimators.fourier.state import CONDITION, LAST, START, TIME, Linearisation, Prior
from wingwatch.kernels.decorators import part

__all__ = ["NO_CHANGE", "cut_after", "cut_before", "find_change", "let_change"]

NO_CHANGE, WHOLE = -2, -1
"""Instead of the checkpoint at which something changed: nothing did, or all of the block is new."""


@part
def _before(model, vehicle, work, m):  # type: ignore[no-untyped-def]
    """Mean and covariance of all that was known at checkpoint m, and the block since then, into the workspace."""
    memory, gained, earlier = vehicle.memory, vehicle.checkpoints.gained, work.earlier
    for a in range(work.mean.size):
        earlier.vector[a] = memory.vector[a] + gained.vector[m, a]
        earlier.bias[a] = memory.bias[a] + gained.bias[m, a]
        for b in range(work.mean.size):
            earlier.sensitivity[a, b] = memory.sensitivity[a, b] + gained.sensitivity[m, a, b]
            earlier.information[a, b] = memory.information[a, b] + gained.information[m, a, b]
    remembered(earlier, model.prior, work.solving.posterior, work.mean, work.covariance)
    _cut_out(model, vehicle, work, m)
    noise_of_block(model, vehicle, work.noise)


@part
def _cut_out(model, vehicle, work, m):  # type: ignore[no-untyped-def]
    """The running block since checkpoint m as a block of its own, the row at the checkpoint in its sums."""
    block, window = vehicle.block, work.window
    since_checkpoint(model.omega, block, vehicle.checkpoints, m, window)
    rebase_products(window.bank, block.rows[START], window.rows[START], model.exponents, model.lever.size)
    gather_condition(window.sums, window.rows[START], 2 + model.exponents.size + CONDITION)


@part
def _changed(scatter, work):  # type: ignore[no-untyped-def]
    """Which derivatives have changed in a block that was just solved, into ``work.trial``; returns log of the mean
    Bayes factor.

    Whether anything has changed is asked with the misfit of the equations in the block's errors. Where something has,
    others are likely to have, too: which, the block says as it is.
    """
    evidence, testing, trial = work.found.evidence, work.testing, work.trial
    mean, covariance, size = work.mean, work.covariance, work.size
    change_of(evidence.information, evidence.vector, mean, covariance, testing)
    value = changed_derivatives(size, CHANGE_LOG_THRESHOLD, testing, trial)
    if not trial.any():
        return value
    plain = work.earlier
    copy_matrix(evidence.information, plain.information)
    copy_vector(evidence.vector, plain.vector)
    misfit_dispersions(mean, scatter, work.solving, work.misfit)
    disperse(evidence.information, evidence.vector, evidence.bias, work.misfit, work.dispersing)
    change_of(evidence.information, evidence.vector, mean, covariance, testing)
    sure = changed_derivatives(size, CHANGE_LOG_THRESHOLD, testing, trial)
    if trial.any():
        change_of(plain.information, plain.vector, mean, covariance, testing)
        changed_derivatives(size, CHANGE_LOG_THRESHOLD, testing, trial)
    return sure


@part
def find_change(model, vehicle, work):  # type: ignore[no-untyped-def]
    """Whether a derivative has changed, and since when: a checkpoint, ``WHOLE`` or ``NO_CHANGE``; by how much each may
    have, into ``work.spread``.

    A solution compares the running block with the closed ones anyway; only where it speaks for a change at all are the
    windows since the checkpoints compared with all that was before them.
    """
    rows, solving, evidence, testing = vehicle.block.rows, work.solving, work.found.evidence, work.testing
    mean, covariance, size, trial = work.mean, work.covariance, work.size, work.trial
    trace = 0.0
    for a in range(mean.size):
        size[a] = model.prior.std[a] / 3.0
        trace += evidence.information[a, a]
    if trace == 0.0:
        return NO_CHANGE
    remembered(vehicle.memory, model.prior, solving.posterior, mean, covariance)
    whole = _changed(vehicle.progress.scatter, work)
    if not whole > 0.0:
        return NO_CHANGE
    best, cut = CHANGE_LOG_THRESHOLD, NO_CHANGE
    if trial.any():
        best, cut = whole, WHOLE
        spread_of_change(size, trial, testing, work.spread)
    at = Linearisation(mean, covariance, work.noise, vehicle.posterior.noise_known)
    around = Prior(mean, size)
    for m in range(CHECKPOINTS):
        if not (rows[START, TIME] <= vehicle.checkpoints.rows[m, TIME] < rows[LAST, TIME] - 0.5):
            continue
        _before(model, vehicle, work, m)
        solve_block(model, work.window, at, solving.posterior.nothing, around, ALONE, solving, work.found)
        value = _changed(vehicle.progress.scatter, work)
        if trial.any() and value > best:
            best, cut = value, m
            spread_of_change(size, trial, testing, work.spread)
    return cut


@part
def cut_before(model, vehicle, work, m):  # type: ignore[no-untyped-def]
    """Make the running block end at checkpoint m, what came after it kept as window; returns whether it can be
    closed."""
    block, checkpoints = vehicle.block, vehicle.checkpoints
    _cut_out(model, vehicle, work, m)
    if not checkpoints.rows[m, TIME] - block.rows[START, TIME] >= model.first_solution_s:
        return False
    copy_bank(checkpoints.bank[m], block.bank)
    copy_vector(checkpoints.rows[m], block.rows[LAST])
    copy_vector(checkpoints.sums[m], block.sums)
    copy_vector(checkpoints.roughness[m], block.roughness)
    known = vehicle.posterior  # what was solved last is of the change, too
    remembered(vehicle.memory, model.prior, work.solving.posterior, known.theta, known.covariance)
    return True


@part
def cut_after(vehicle, window):  # type: ignore[no-untyped-def]
    """Make what came after a cut the running block."""
    block = vehicle.block
    copy_bank(window.bank, block.bank)
    copy_matrix(window.rows, block.rows)
    copy_vector(window.sums, block.sums)
    copy_vector(window.roughness, block.roughness)
    vehicle.checkpoints.rows[:, :] = np.nan


@part
def let_change(model, vehicle, work):  # type: ignore[no-untyped-def]
    """Inflate the covariance by what has changed. All that is left is as good as new: nothing waits to be replaced."""
    posterior, size, spread = vehicle.posterior, work.size, work.spread
    for a in range(size.size):
        size[a] = spread[a] * model.prior.std[a] / 3.0
        posterior.changed[a] = spread[a]
    inflate_covariance(vehicle.memory, size, work.testing)
    vehicle.discounted.sensitivity[:, :] = 0.0
    vehicle.discounted.information[:, :] = 0.0
    vehicle.discounted.vector[:] = 0.0
    vehicle.discounted.bias[:] = 0.0
