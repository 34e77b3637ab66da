"""The end of a block of the recursive Fourier estimator: solved on its own, and added to what is known; compiled.

Derivation and symbols: ``docs/methods/fourier.md`` sections 7 to 9. Arrays are those of one vehicle; the workspace is
that of ``blocks``.
"""

import math

from wingwatch.estimators.evidence.chance import beyond_chance
from wingwatch.estimators.evidence.dispersion import (
    DISPERSION,
    disperse,
    dispersion_of,
    gather_scatter,
)
from wingwatch.estimators.fourier.checkpoints import copy_matrix, copy_vector
from wingwatch.estimators.fourier.coherence import dispersion_of_bins
from wingwatch.estimators.fourier.condition import mean_condition
from wingwatch.estimators.fourier.memory import discount, replace
from wingwatch.estimators.fourier.noise_levels import AIR_MEMORY, INPUT_RESOLUTION, start_noise
from wingwatch.estimators.fourier.solution import (
    ALONE,
    CAUSED,
    MEASURED,
    MOVE,
    STAY,
    coherence_of_block,
    remembered,
    solve_block,
)
from wingwatch.estimators.fourier.state import (
    AIR_VARIANCES,
    CHANGED,
    CLOSED,
    LAST,
    SOLUTIONS,
    START,
    TIME,
    WEIGHT,
    Linearisation,
    Memory,
    Prior,
)
from wingwatch.estimators.kernels.reading_noise import reading_variance
from wingwatch.estimators.kernels.symmetric import invert
from wingwatch.kernels.decorators import lean, part

__all__ = [
    "believe_inputs",
    "close",
    "noise_of_block",
    "note_signal",
    "rolls_by_air",
    "what_is_known",
]

MOST_ROLL = 1.25
"""Power of the roll that surfaces and gusts should cause, over that which is there, beyond which the derivatives by
roll rate cannot be right: in still air it is one, and rolling air adds to what is there."""

ROLLED = 0.1
"""Part of the roll rate's power that rolling air may drive where a block is linearised at its own solution: what its
own fit has left of the residual shows too little rolling air."""


@part
def believe_inputs(model, filters, noise):  # type: ignore[no-untyped-def]
    """The inputs' part of the noise variances, as their readings have shown it."""
    first = 2 * model.lever.size + 1
    for j in range(model.servos.time_s.size):
        noise[first + j] = max(
            reading_variance(filters.readings[j], model.input_variance[j]), INPUT_RESOLUTION
        )


@part
def noise_of_block(model, vehicle, noise):  # type: ignore[no-untyped-def]
    """Variances that a part of the running block is solved at: of sensors what all blocks so far have shown, of the
    air, which changes, what the running block has."""
    known = vehicle.posterior
    first = noise.size - AIR_VARIANCES
    for j in range(noise.size):
        earlier = j < first and known.noise_known[WEIGHT] > 0.0
        noise[j] = known.noise_known[j] if earlier else known.noise[j]
    believe_inputs(model, vehicle.filters, noise)


@lean
def note_signal(informed_s, kept, power, time_s, gain):  # type: ignore[no-untyped-def]
    """Note the time at which the regressors' power was mostly signal; ``kept`` is ``gain`` times the kept power."""
    for a in range(informed_s.size):
        if power[a, a] > 0.0 and kept[a, a] > 0.5 * gain * power[a, a]:
            informed_s[a] = time_s


@part
def _outweighs(block, memory):  # type: ignore[no-untyped-def]
    """Whether the information of a block exceeds what is remembered of any derivative."""
    more = False
    for a in range(block.shape[0]):
        more = more or block[a, a] > memory[a, a]
    return more


@part
def _contradicts(own, own_covariance, mean, covariance, dispersion, work):  # type: ignore[no-untyped-def]
    """Whether a block leads further from what is known than chance and the scatter of blocks lead one.

    Args:
        own, own_covariance: of the block, (k,) and (k, k); mean, covariance: of what is known.
        dispersion: of the blocks so far, by equation, (ns,).
        work: ``PosteriorWorkspace``.
    """
    total, inverse, k = work.total, work.inverse, own.size
    columns = k // dispersion.size
    for a in range(k):
        for b in range(k):
            wider = math.sqrt(dispersion[a // columns] * dispersion[b // columns])
            total[a, b] = wider * own_covariance[a, b] + covariance[a, b]
    invert(total, inverse)
    distance = 0.0
    for a in range(k):
        for b in range(k):
            distance += (own[a] - mean[a]) * inverse[a, b] * (own[b] - mean[b])
    return beyond_chance(distance, k)


@lean
def rolls_by_air(model, solving):  # type: ignore[no-untyped-def]
    """Whether rolling air drives the block that was solved last."""
    p_in_p = model.exponents.size + 1  # roll rate's column of the roll equation
    return model.roll and not (solving.noise.rolled[0] < ROLLED * solving.equation.power[p_in_p, p_in_p])


@part
def what_is_known(model, vehicle, mean, work):  # type: ignore[no-untyped-def]
    """Derivatives without the running block, into ``mean``, (k,), and the covariance of the posterior; of what is next
    to unknown, what is expected beforehand, to a natural size.

    A mean within a wide interval may lie anywhere, at a damping that is none, too.
    """
    prior = model.prior
    for a in range(mean.size):
        work.size[a] = prior.std[a] / 3.0
    beforehand = Prior(prior.value, work.size)
    remembered(vehicle.memory, beforehand, work.solving.posterior, mean, vehicle.posterior.covariance)


@part
def _rolls_too_much(model, work):  # type: ignore[no-untyped-def]
    """Whether surfaces and gusts should cause more roll than there is: rolling air, which would have to take it away,
    goes with neither."""
    roll = work.solving.roll
    return model.roll and roll[CAUSED] > MOST_ROLL * roll[MEASURED]


@part
def _lead_from(model, vehicle, around, begins, work):  # type: ignore[no-untyped-def]
    """Where the block leads by itself from ``work.own``, in place, and in ``work.own_covariance``; its likelihood
    there, and whether rolling air drives it.

    Args:
        around: ``Prior`` of the way.
        begins: whether noise and air are found as if nothing were known of them.
    """
    known, solving, found = vehicle.posterior, work.solving, work.found
    copy_matrix(known.covariance, work.own_covariance)
    noise_of_block(model, vehicle, work.noise)
    if begins:
        start_noise(model, vehicle.block.roughness, work.noise)
        believe_inputs(model, vehicle.filters, work.noise)
    own = Linearisation(work.own, work.own_covariance, work.noise, known.noise_known)
    solve_block(model, vehicle.block, own, solving.posterior.nothing, around, MOVE, solving, found)
    return found.likelihood[0], rolls_by_air(model, solving)


@part
def _lead(model, vehicle, work):  # type: ignore[no-untyped-def]
    """Where the block leads by itself, with its noise and air: of several ways the likeliest, into the workspace.

    Returns:
        whether the block is to be linearised there.
    """
    prior, dispersion, changed = (
        model.prior,
        vehicle.progress.dispersion,
        vehicle.progress.counts[CHANGED] > 0,
    )
    around, beforehand = Prior(work.anchor, work.size), Prior(prior.value, work.size)
    most, contradicts, leads = -math.inf, False, False
    for way in range(3):
        begins = way == 2
        copy_vector(work.anchor if way == 0 else work.mean if way == 1 else prior.value, work.own)
        likelihood, rolls = _lead_from(model, vehicle, beforehand if begins else around, begins, work)
        if likelihood > most and not _rolls_too_much(model, work):
            most = likelihood
            contradicts = changed or _contradicts(
                work.own,
                work.own_covariance,
                work.anchor,
                work.covariance,
                dispersion,
                work.solving.posterior,
            )
            outweighs = _outweighs(work.found.gained.sensitivity, vehicle.memory.sensitivity)
            leads = contradicts or (outweighs and not rolls)
            copy_vector(work.own, work.likeliest)
            copy_matrix(work.own_covariance, work.likeliest_covariance)
            copy_vector(work.noise, work.likeliest_noise)
        if not contradicts:
            break
    return leads


@part
def _fit_noise(model, vehicle, around, work):  # type: ignore[no-untyped-def]
    """Fit the variances of noise and air where the block is linearised."""
    known, solving = vehicle.posterior, work.solving
    noise_of_block(model, vehicle, work.noise)
    at = Linearisation(work.anchor, known.covariance, work.noise, known.noise_known)
    for _ in range(2):
        solve_block(model, vehicle.block, at, solving.posterior.nothing, around, STAY, solving, work.found)


@lean
def close(model, vehicle, work):  # type: ignore[no-untyped-def]
    """End the block: solved on its own, from what is known, its information joins what is known.

    A block that contradicts what is known is linearised where it leads itself: the aircraft has changed. So is one in
    which a change was found, and one that says more of a derivative than all before it, unless rolling air drives it.
    Any other is linearised at what is known (``what_is_known``), and the variances of noise and air are fitted there.
    Nothing is linearised where surfaces and gusts would roll the aircraft more than it rolls: what is expected
    beforehand of the derivatives by roll rate stands in for them.

    The way to where a block leads begins at what is known. Where it contradicts that, it is gone from the last solution
    and from what is expected beforehand, too, and the likeliest end counts: noise and air are found too strong beside a
    model that is far off, and five steps may end anywhere.
    """
    block, known, memory, progress = vehicle.block, vehicle.posterior, vehicle.memory, vehicle.progress
    solving, found, prior = work.solving, work.found, model.prior
    k = known.theta.size
    if progress.counts[SOLUTIONS] == 0:
        start_noise(model, block.roughness, known.noise)
    nothing = solving.posterior.nothing
    copy_vector(known.theta, work.mean)
    remembered(memory, prior, solving.posterior, known.theta, known.covariance)
    unbiased = Memory(memory.sensitivity, memory.information, memory.vector, nothing.bias)
    remembered(unbiased, prior, solving.posterior, known.theta, work.covariance)
    what_is_known(model, vehicle, work.anchor, work)
    at = Linearisation(work.anchor, known.covariance, work.noise, known.noise_known)
    around = Prior(work.anchor, work.size)
    if _lead(model, vehicle, work):
        copy_vector(work.likeliest, work.anchor)
        copy_matrix(work.likeliest_covariance, known.covariance)
        copy_vector(work.likeliest_noise, work.noise)
    else:
        for attempt in range(2):
            _fit_noise(model, vehicle, around, work)
            if attempt == 1 or not _rolls_too_much(model, work):
                break
            for a in range(1, k, model.exponents.size):
                work.anchor[a] = prior.value[a]
    solve_block(model, block, at, nothing, around, ALONE, solving, found)
    _remember(model, vehicle, work)
    remembered(memory, prior, solving.posterior, known.theta, known.covariance)
    keep = math.exp(-(block.rows[LAST, TIME] - block.rows[START, TIME]) / model.memory_s)
    coherence_of_block(model, known, work.anchor, keep, solving, progress)
    _disperse_more(progress, model.exponents.size)
    progress.counts[SOLUTIONS] += 1
    progress.counts[CLOSED] += 1
    progress.counts[CHANGED] = 0


@part
def _disperse_more(progress, columns):  # type: ignore[no-untyped-def]
    """What stated variances are multiplied by from here on, (docs (31), (32b)): the blocks' scatter does not show what
    errs in all of them alike, and what goes with the motion does not show what differs from block to block."""
    for e in range(progress.dispersion.size):
        scattered = dispersion_of(progress.scatter[e])
        progress.dispersion[e] = max(scattered, dispersion_of_bins(progress.coherence[e], columns))


@part
def _remember(model, vehicle, work):  # type: ignore[no-untyped-def]
    """Add what the closed block says to scatter, evidence, memory and noise variances."""
    block, known, memory, progress = vehicle.block, vehicle.posterior, vehicle.memory, vehicle.progress
    rows, informed_s, found, scatter = block.rows, known.informed_s, work.found, progress.scatter
    gained, evidence, dispersing = found.gained, found.evidence, work.dispersing
    span = rows[LAST, TIME] - rows[START, TIME]
    fraction = min(1.0, span / model.block_s)
    power = work.solving.equation.power
    note_signal(informed_s, gained.information, power, rows[LAST, TIME], 2.0 * fraction)
    decay = 1.0 - math.exp(-span / model.memory_s)
    gather_scatter(
        evidence.information, evidence.vector, known.theta, work.covariance, 1.0 - decay, scatter, dispersing
    )
    copy_vector(progress.dispersion, scatter[:, DISPERSION])
    disperse(evidence.information, evidence.vector, evidence.bias, scatter, dispersing)
    copy_matrix(evidence.information, vehicle.evidence.information)
    copy_vector(evidence.vector, vehicle.evidence.vector)
    copy_vector(evidence.bias, vehicle.evidence.bias)
    mean_condition(block.sums, progress.condition)
    progress.span[0], progress.span[1] = rows[START, TIME], rows[LAST, TIME]
    last = informed_s[0]
    for a in range(1, informed_s.size):
        last = max(last, informed_s[a])
    for j in range(4):
        progress.span[2 + j] = progress.condition[j]
    discounted = vehicle.discounted
    discount(0.0 if rows[LAST, TIME] - last > model.stale_s else decay, memory, discounted)
    replace(decay, gained.sensitivity, known.theta, model.prior.std, memory, discounted, work.replacing)
    for a in range(informed_s.size):
        memory.vector[a] += gained.vector[a]
        memory.bias[a] += gained.bias[a]
        for b in range(informed_s.size):
            memory.sensitivity[a, b] += gained.sensitivity[a, b]
            memory.information[a, b] += gained.information[a, b]
    keep = math.exp(-model.block_s / model.memory_s)
    _gather_noise(known.noise, known.noise_known, found.noise, fraction, keep, model.lever.size)


@lean
def _gather_noise(noise, noise_known, fresh, fraction, keep, ns):  # type: ignore[no-untyped-def]
    """Add a block's noise variances to those of earlier blocks, and go on from there; of the air the block's own."""
    first, weight = noise.size - AIR_VARIANCES, noise_known[WEIGHT]
    for j in range(noise.size):
        known = min(weight, AIR_MEMORY) if j >= first else weight
        noise_known[j] = (known * noise_known[j] + fraction * fresh[j]) / (known + fraction)
        if j <= 2 * ns or j >= first:
            noise[j] = noise_known[j]
    noise_known[WEIGHT] = keep * (weight + fraction)
