"""Blocks of the recursive Fourier estimator, compiled: filled, solved while they run, closed, added to what is known.

Derivation and symbols: ``docs/methods/fourier.md`` sections 7 to 10. ``advance`` takes a ``State`` whose arrays lead
with the vehicle axis; all else works on the state of one vehicle, in a workspace that is made once.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.evidence.chance import beyond_chance
from wingwatch.estimators.evidence.change import (
    ChangeWorkspace,
    change_workspace,
)
from wingwatch.estimators.evidence.dispersion import DispersionWorkspace, dispersion_workspace
from wingwatch.estimators.fourier.air import advance_air, air_channels
from wingwatch.estimators.fourier.bank import advance_bank, bank_channels
from wingwatch.estimators.fourier.change_search import (
    NO_CHANGE,
    cut_after,
    cut_before,
    find_change,
    let_change,
)
from wingwatch.estimators.fourier.checkpoints import (
    copy_vector,
    place_checkpoint,
)
from wingwatch.estimators.fourier.closing import (
    believe_inputs,
    close,
    note_signal,
    rolls_by_air,
    what_is_known,
)
from wingwatch.estimators.fourier.condition import gather_condition, mean_condition
from wingwatch.estimators.fourier.memory import MemoryWorkspace, memory_workspace, replace
from wingwatch.estimators.fourier.noise_levels import start_noise
from wingwatch.estimators.fourier.solution import (
    MOVE,
    STEP,
    SolutionWorkspace,
    block_solution,
    solution_workspace,
    solve_block,
    zero_memory,
)
from wingwatch.estimators.fourier.state import (
    AIR_VARIANCES,
    ALPHA,
    BEFORE,
    CHANGED,
    CLOSED,
    CONDITION,
    COURSES,
    LAST,
    SOLUTIONS,
    START,
    TIME,
    Block,
    BlockSolution,
    Filters,
    Linearisation,
    Memory,
)
from wingwatch.estimators.kernels.apart import apart
from wingwatch.estimators.kernels.intersample import frames_of, means_of_rows
from wingwatch.estimators.kernels.reading_noise import follow_reading, forget_readings
from wingwatch.kernels.by_address import one_vehicle
from wingwatch.kernels.decorators import entry, lean, part
from wingwatch.telemetry import MAX_GAP_S

__all__ = ["Workspace", "advance", "block_workspace", "fill"]

GOES_ON, FULL, GAP = 0, 1, 2
"""What a sample does to the running block: it goes on, is full, or ends because time does not go on."""


class Workspace(NamedTuple):
    """Workspace of ``advance``.

    Attributes:
        solving, found, replacing, dispersing, testing: of the parts.
        window: the running block since a checkpoint.
        earlier: memory of all that was known at a checkpoint.
        anchor, own, mean, size: (k,) derivatives at which a block is linearised, to which it leads itself, that are
            remembered; natural size of each.
        covariance, own_covariance: (k, k) of what is remembered, and of ``own``.
        likeliest, likeliest_covariance, likeliest_noise: where the likeliest way leads that a block goes.
        noise: variances at which a block is linearised, as ``Posterior.noise``.
        trial: (k,) which derivatives have changed since a checkpoint.
        spread: (k,) what each has changed by since the best one, in natural sizes.
        misfit: (states, 3) dispersions of what a window says.
    """

    solving: SolutionWorkspace
    found: BlockSolution
    replacing: MemoryWorkspace
    dispersing: DispersionWorkspace
    testing: ChangeWorkspace
    window: Block
    earlier: Memory
    anchor: NDArray[np.float64]
    own: NDArray[np.float64]
    mean: NDArray[np.float64]
    size: NDArray[np.float64]
    covariance: NDArray[np.float64]
    own_covariance: NDArray[np.float64]
    likeliest: NDArray[np.float64]
    likeliest_covariance: NDArray[np.float64]
    likeliest_noise: NDArray[np.float64]
    noise: NDArray[np.float64]
    trial: NDArray[np.bool_]
    spread: NDArray[np.float64]
    misfit: NDArray[np.float64]


def block_workspace(ns: int, nu: int, bins: int, columns: int, rows: int) -> Workspace:
    """Workspace for ns states, nu inputs, signal rows of so many columns, and ns or ns + 1 rows of a block."""
    k, channels = ns * (ns + nu), bank_channels(ns, nu) + air_channels(ns, nu)
    window = ((channels, 2, bins), (3, columns), COURSES + 2 * nu, ns + 2)
    workspace = Workspace(
        solution_workspace(ns, nu, bins, rows),
        block_solution(ns, nu),
        memory_workspace(k),
        dispersion_workspace(k),
        change_workspace(k),
        Block(*(np.empty(shape) for shape in window)),
        zero_memory(k),
        np.empty(k),
        np.empty(k),
        np.empty(k),
        np.empty(k),
        np.empty((k, k)),
        np.empty((k, k)),
        np.empty(k),
        np.empty((k, k)),
        np.empty(2 * ns + 1 + nu + AIR_VARIANCES),
        np.empty(2 * ns + 1 + nu + AIR_VARIANCES),
        np.zeros(k, dtype=np.bool_),
        np.zeros(k),
        np.zeros((ns, 3)),
    )
    return apart(workspace)


@lean
def _add_second_differences(block, new, ns):  # type: ignore[no-untyped-def]
    """Add the roots of the magnitudes of second differences of states and accelerometer."""
    rows, roughness = block.rows, block.roughness
    for j in range(ns + 1):
        difference = new[1 + j] - 2.0 * rows[LAST, 1 + j] + rows[BEFORE, 1 + j]
        roughness[j] += math.sqrt(abs(difference))
    roughness[ns + 1] += 1.0


@lean
def _add_course_doubt(model, block, new):  # type: ignore[no-untyped-def]
    """Add the square of how far each input has moved over the step to ``new``, and that times its mean's variance."""
    rows, sums, first = block.rows, block.sums, 2 + model.lever.size
    several = frames_of(new[TIME] - rows[LAST, TIME]) > 1
    for j in range(model.servos.time_s.size):
        moved = (new[first + j] - rows[LAST, first + j]) ** 2
        sums[COURSES + 2 * j] += moved
        if several:
            means = means_of_rows(new, rows[LAST], rows[BEFORE], j, first, model.servos, model.input_variance)
            sums[COURSES + 2 * j + 1] += moved * means.variance


@lean
def _take(model, block, filters, new):  # type: ignore[no-untyped-def]
    """Take in one row of signals; returns what it does to the block."""
    bank, rows = block.bank, block.rows
    ns, nu = model.lever.size, model.servos.time_s.size
    condition = 2 + ns + nu + CONDITION
    for j in range(condition + ALPHA):
        if not math.isfinite(new[j]):
            return GOES_ON
    dt = new[TIME] - rows[LAST, TIME]
    if not (0.0 < dt <= MAX_GAP_S):
        for j in range(nu):
            forget_readings(filters.readings[j])
        return GAP
    advance_bank(model.omega, model.servos, model.input_variance, filters, bank, rows, new, ns)
    advance_air(model.exponents, filters.coefficients, bank, rows, new, ns)
    if math.isfinite(rows[BEFORE, 1]):
        _add_second_differences(block, new, ns)
    for j in range(nu):
        follow_reading(filters.readings[j], new[2 + ns + j], dt, model.input_variance[j])
    _add_course_doubt(model, block, new)
    copy_vector(rows[LAST], rows[BEFORE])
    copy_vector(new, rows[LAST])
    gather_condition(block.sums, new, condition)
    return FULL if new[TIME] - rows[START, TIME] >= model.block_s - 0.5 * dt else GOES_ON


@lean
def _restart(model, block, row, gap, checkpoint_rows):  # type: ignore[no-untyped-def]
    """Begin a block at a row; after a gap nothing before it counts."""
    rows = block.rows
    block.bank[:, :, :] = 0.0
    block.sums[:] = 0.0
    block.roughness[:] = 0.0
    copy_vector(row, rows[START])
    gather_condition(block.sums, row, 2 + model.exponents.size + CONDITION)
    if gap:
        copy_vector(row, rows[LAST])
        rows[BEFORE, 0] = row[TIME]
        rows[BEFORE, 1:] = np.nan
        checkpoint_rows[:, :] = np.nan


@part
def _solve(model, vehicle, work):  # type: ignore[no-untyped-def]
    """Solve with the running block; ``work.found`` becomes what the block alone says.

    Where rolling air drives it, it is linearised at what is known without it, as where it is closed: its own solution
    shows too little rolling air. That fails where the residual is so much less likely there that it is no chance: next
    to nothing is known. After a change what is known is the aircraft as it was.
    """
    block, known, memory = vehicle.block, vehicle.posterior, vehicle.memory
    rows, found, discounted = block.rows, work.found, vehicle.discounted
    gained = found.gained
    if vehicle.progress.counts[SOLUTIONS] == 0:
        start_noise(model, block.roughness, known.noise)
    believe_inputs(model, vehicle.filters, known.noise)
    at = Linearisation(known.theta, known.covariance, known.noise, known.noise_known)
    copy_vector(known.theta, work.mean)
    copy_vector(known.noise, work.noise)
    solve_block(model, block, at, memory, model.prior, MOVE, work.solving, found)
    if vehicle.progress.counts[CHANGED] == 0 and rolls_by_air(model, work.solving):
        likelihood = found.likelihood[0]
        what_is_known(model, vehicle, known.theta, work)
        solve_block(model, block, at, memory, model.prior, STEP, work.solving, found)
        if beyond_chance(2.0 * (likelihood - found.likelihood[0]), known.theta.size):
            copy_vector(work.mean, known.theta)
            copy_vector(work.noise, known.noise)
            solve_block(model, block, at, memory, model.prior, MOVE, work.solving, found)
    span = rows[LAST, TIME] - rows[START, TIME]
    decay = 1.0 - math.exp(-span / model.memory_s)
    replace(decay, gained.sensitivity, known.theta, model.prior.std, memory, discounted, work.replacing)
    power, gain = work.solving.equation.power, 2.0 * min(1.0, span / model.block_s)
    note_signal(known.informed_s, gained.information, power, rows[LAST, TIME], gain)
    place_checkpoint(block, gained, vehicle.checkpoints)


@entry
def fill(model, block, filters, signals, lanes, ends):  # type: ignore[no-untyped-def]
    """Take samples (vehicles, samples, columns) into running blocks, as far as these go: most calls need no more.

    Args:
        model: ``Model``.
        block, filters: ``Block`` and ``Filters`` of all vehicles, in place.
        lanes: ``Lanes`` of the samples.
        ends: (vehicles, 2), filled: the row at which the block ends, and why; the number of rows where it goes on.
    """
    for m in range(ends.shape[0]):
        i = lanes.place[m]
        own = Block(block.bank[i], block.rows[i], block.sums[i], block.roughness[i])
        own_filters = Filters(filters.coefficients[i], filters.step[i], filters.readings[i])
        ends[m, 0], ends[m, 1] = lanes.counts[m], GOES_ON
        for k in range(lanes.counts[m]):
            what = _take(model, own, own_filters, signals[m, k])
            if what != GOES_ON:
                ends[m, 0], ends[m, 1] = k, what
                break


@entry
def advance(model, state, follows, signals, lanes, ends, solves, work):  # type: ignore[no-untyped-def]
    """Take in what ``fill`` left, and solve with the running block of each of the vehicles if ``solves``.

    Args:
        model: ``Model``.
        state: ``State`` of all vehicles, in place.
        follows: (vehicles,) whether changes are looked for.
        signals: (vehicles, samples, columns).
        lanes: ``Lanes`` of the samples.
        ends: (vehicles, 2), of ``fill``.
        work: ``Workspace``.
    """
    for m in range(lanes.place.size):
        i = lanes.place[m]
        vehicle = one_vehicle(state, i)
        block, progress, rows = vehicle.block, vehicle.progress, vehicle.block.rows
        what = ends[m, 1]
        for k in range(ends[m, 0], lanes.counts[m]):
            if k > ends[m, 0]:
                what = _take(model, block, vehicle.filters, signals[m, k])
            if what == GOES_ON:
                continue
            if what == FULL or rows[LAST, TIME] - rows[START, TIME] >= model.first_solution_s:
                close(model, vehicle, work)
            _restart(model, block, signals[m, k], what == GAP, vehicle.checkpoints.rows)
        if not solves:
            continue
        vehicle.posterior.changed[:] = 0.0
        if not (rows[LAST, TIME] - rows[START, TIME] >= model.first_solution_s - 1e-9):
            continue
        for attempt in range(2):
            _solve(model, vehicle, work)
            cut = NO_CHANGE
            if attempt == 0 and follows[i] and progress.counts[CLOSED] > 0:
                cut = find_change(model, vehicle, work)
            if cut == NO_CHANGE:
                break
            if cut >= 0:
                if cut_before(model, vehicle, work, cut):
                    close(model, vehicle, work)
                cut_after(vehicle, work.window)
            let_change(model, vehicle, work)
            progress.counts[CHANGED] = 1
        mean_condition(block.sums, progress.condition)
        progress.counts[SOLUTIONS] += 1
