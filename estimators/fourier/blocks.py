"""Blocks of the recursive Fourier estimator, compiled: filled, solved while they run, closed, added to what is known.

Derivation: ``docs/methods/fourier.md`` sections 7 to 10. ``advance`` takes arrays that lead with the vehicle
axis; all else works on one vehicle, whose arrays are handed on in groups, in room that is made once.
"""

import math

import numpy as np

from wingwatch.estimators.fourier.air import advance_air, air_channels, rebase_products
from wingwatch.estimators.fourier.bank import advance_bank
from wingwatch.estimators.fourier.change import (
    CHANGE_LOG_THRESHOLD,
    change_of,
    changed_derivatives,
    free_memory,
)
from wingwatch.estimators.fourier.dispersion import DISPERSION_LINES, disperse, gather_scatter
from wingwatch.estimators.fourier.forgetting import FORGETTING_LINES, FORGETTING_SQUARES
from wingwatch.estimators.fourier.marks import (
    MARKS,
    copied,
    copied_bank,
    copied_rows,
    place_mark,
    since_mark,
)
from wingwatch.estimators.fourier.memory import fade, replace
from wingwatch.estimators.fourier.noise import AIR_LEVELS
from wingwatch.estimators.fourier.solution import (
    AIR_MEMORY,
    ALONE,
    BEGIN,
    LEARN,
    MOVE,
    Room,
    remembered,
    solution_room,
    solve_block,
    start_noise,
)
from wingwatch.estimators.kernels.hot import lean, part
from wingwatch.estimators.signals import MAX_GAP_S

__all__ = ["advance", "block_room"]

ROLLED = 0.1
"""Part of the roll rate's power that rolling air may drive where a block is linearised at its own solution: the score
has more roots there, at l_p = 0 and at infinity."""

GOES_ON, FULL, GAP = 0, 1, 2
"""What a sample does to the running block: it goes on, is full, or ends because time does not go on."""

NO_CHANGE, WHOLE = -2, -1
"""Instead of the mark at which something changed: nothing did, or all of the block is new."""


def block_room(ns: int, nu: int, nf: int, columns: int, rows: int) -> Room:
    """Room of ``advance``: of solutions, of forgetting and changes, zeros, a part of a block."""
    p = ns * (ns + nu)
    solving, told = solution_room(ns, nu, nf, rows)
    squares = np.empty((FORGETTING_SQUARES + 5, p, p))
    lines = np.empty((max(FORGETTING_LINES, DISPERSION_LINES) + 6, p))
    flags = np.zeros((2, p), dtype=np.bool_)
    own = (squares, lines, np.empty((p, p + 1)), flags, np.empty(2 * ns + 1 + nu + AIR_LEVELS))
    nothing = (np.zeros((1, p, p)), np.zeros((1, p)))
    bank = np.empty((ns + 2 * nu + 2 + air_channels(ns, nu), 2, nf))
    part = (bank, np.empty((3, columns)), np.empty(6 + nu), np.empty(ns + 2))
    return solving, told, own, nothing, part


@lean
def _mark(informed, kept, power, time, gain):  # type: ignore[no-untyped-def]
    """Note the time at which the regressors' power was mostly signal; ``kept`` is ``gain`` times the kept power."""
    for a in range(informed.size):
        if power[a, a] > 0.0 and kept[a, a] > 0.5 * gain * power[a, a]:
            informed[a] = time


@lean
def _condition(sums, condition):  # type: ignore[no-untyped-def]
    """Mean airspeed, altitude, density, angle of attack."""
    condition[0], condition[1] = sums[0] / sums[4], sums[2] / sums[4]
    condition[2], condition[3] = sums[1] / sums[4], sums[3] / sums[4]


@lean
def _outweighs(block, memory):  # type: ignore[no-untyped-def]
    """Whether the information of a block exceeds what is remembered of any derivative."""
    more = False
    for a in range(block.shape[0]):
        more = more or block[a, a] > memory[a, a]
    return more


@part
def _close(model, prior, vehicle, room):  # type: ignore[no-untyped-def]
    """End the block: solved on its own, from what is known, its information joins what is known.

    A block that says more of a derivative than all before it is linearised where it leads itself, unless rolling air
    drives it.
    """
    block, known, memory, closed, _ = vehicle
    rows, sums, roughness = block[1], block[2], block[3]
    theta, noise, noise_known, reserve, covariance, informed = known
    evidence_matrix, evidence_vector, evidence_bias, evidence_span, condition, counts, scatter = closed
    solving, told, own_room, nothing, _ = room
    squares, lines, level = own_room[0], own_room[1], own_room[4]
    settings, k = model[4], theta.size
    p_in_p = model[3].size + 1  # roll rate's column of the roll equation
    if counts[0] == 0:
        start_noise(roughness, noise, model[1].size, model[7])
    remembered(memory, nothing, prior, solving[3], lines[0], theta, covariance)
    steady = (memory[0], memory[1], memory[2], nothing[1][0])
    remembered(steady, nothing, prior, solving[3], lines[0], theta, squares[4])
    anchor, own, error = lines[1], lines[2], lines[3]
    for a in range(k):
        anchor[a] = own[a] = theta[a]
        error[a] = prior[1][a] / 3.0
    for j in range(level.size):
        level[j] = noise_known[j] if noise_known[-1] > 0.0 else noise[j]
    alone = (nothing[0][0], nothing[0][0], nothing[1][0], nothing[1][0])
    solve_block(model, block, own, level, noise_known, alone, (anchor, error), LEARN, solving, told)
    rolled = solving[6].rolled[0] / told[0][4, p_in_p, p_in_p]
    if rolled < ROLLED and _outweighs(told[0][0], memory[0]):
        solve_block(model, block, own, level, noise_known, alone, (anchor, error), LEARN, solving, told)
        for a in range(k):
            anchor[a] = own[a]
    solve_block(model, block, anchor, level, noise_known, alone, (anchor, error), ALONE, solving, told)
    matrices, vectors, fresh = told
    span = rows[1, 0] - rows[0, 0]
    share = min(1.0, span / settings[0])
    _mark(informed, matrices[1], matrices[4], rows[1, 0], 2.0 * share)
    lost = 1.0 - math.exp(-span / settings[2])
    gather_scatter(matrices[2], vectors[2], theta, squares[4], 1.0 - lost, scatter, squares, lines[6:])
    disperse(matrices[2], vectors[2], vectors[3], scatter, squares, lines[6:])
    copied_rows(matrices[2], evidence_matrix)
    copied(vectors[2], evidence_vector)
    copied(vectors[3], evidence_bias)
    _condition(sums, condition)
    evidence_span[0], evidence_span[1] = rows[0, 0], rows[1, 0]
    last = informed[0]
    for a in range(1, k):
        last = max(last, informed[a])
    for j in range(4):
        evidence_span[2 + j] = condition[j]
    fade(0.0 if rows[1, 0] - last > settings[6] else lost, memory, reserve)
    replace(lost, matrices[0], prior[1], memory, reserve, own_room)
    for a in range(k):
        memory[2][a] += vectors[0, a]
        memory[3][a] += vectors[1, a]
        for b in range(k):
            memory[0][a, b] += matrices[0, a, b]
            memory[1][a, b] += matrices[1, a, b]
    _gather_noise(noise, noise_known, fresh, share, math.exp(-settings[0] / settings[2]), model[1].size)
    remembered(memory, nothing, prior, solving[3], lines[0], theta, covariance)
    counts[0] += 1
    counts[1] += 1


@lean
def _gather_noise(noise, noise_known, fresh, share, keep, ns):  # type: ignore[no-untyped-def]
    """Add a block's noise variances to those of earlier blocks, and go on from there; of the air the block's own."""
    first, weight = noise.size - AIR_LEVELS, noise_known[-1]
    for j in range(noise.size):
        known = min(weight, AIR_MEMORY) if j >= first else weight
        noise_known[j] = (known * noise_known[j] + share * fresh[j]) / (known + share)
        if j <= 2 * ns or j >= first:
            noise[j] = noise_known[j]
    noise_known[-1] = keep * (weight + share)


@lean
def _gather(sums, row, kinematic):  # type: ignore[no-untyped-def]
    """Add a row to the sums of the flight condition."""
    alpha = row[kinematic + 5]
    sums[0] += row[kinematic + 2]
    sums[1] += row[kinematic + 3]
    sums[2] += row[kinematic + 4]
    sums[3] += alpha if math.isfinite(alpha) else 0.0
    sums[4] += 1.0


@lean
def _bends(block, new, ns, nu):  # type: ignore[no-untyped-def]
    """Add second differences: roots of their magnitudes of states and accelerometer, squares of inputs."""
    rows, sums, roughness = block[1], block[2], block[3]
    for j in range(ns + 1):
        bend = new[1 + j] - 2.0 * rows[1, 1 + j] + rows[2, 1 + j]
        roughness[j] += math.sqrt(abs(bend))
    roughness[ns + 1] += 1.0
    for j in range(nu):
        bend = new[2 + ns + j] - 2.0 * rows[1, 2 + ns + j] + rows[2, 2 + ns + j]
        sums[6 + j] += bend * bend
    sums[5] += 1.0


@lean
def _take(model, block, filters, new):  # type: ignore[no-untyped-def]
    """Take in one row of signals; returns what it does to the block."""
    omega, lever, exponents, settings = model[0], model[1], model[3], model[4]
    bank, rows, sums = block[0], block[1], block[2]
    coefficients, step = filters
    ns, nu = lever.size, exponents.size - lever.size
    kinematic = 2 + ns + nu
    for j in range(kinematic + 5):
        if not math.isfinite(new[j]):
            return GOES_ON
    dt = new[0] - rows[1, 0]
    if not (0.0 < dt <= MAX_GAP_S):
        return GAP
    servo_s = settings[7 + nu : 7 + 2 * nu]
    advance_bank(omega, bank, step, coefficients, rows[1], new, rows[2], servo_s, ns, nu)
    advance_air(bank, coefficients, rows[0], rows[1], new, exponents, ns)
    if math.isfinite(rows[2, 1]):
        _bends(block, new, ns, nu)
    copied(rows[1], rows[2])
    copied(new, rows[1])
    _gather(sums, new, kinematic)
    return FULL if new[0] - rows[0, 0] >= settings[0] - 0.5 * dt else GOES_ON


@lean
def _restart(model, block, row, gap, mark_rows):  # type: ignore[no-untyped-def]
    """Begin a block at a row; after a gap nothing before it counts."""
    bank, rows, sums, roughness = block
    bank[:, :, :] = 0.0
    sums[:] = 0.0
    roughness[:] = 0.0
    copied(row, rows[0])
    _gather(sums, row, 2 + model[3].size)
    if gap:
        copied(row, rows[1])
        rows[2, 0] = row[0]
        rows[2, 1:] = np.nan
        mark_rows[:, :] = np.nan


@part
def _solve(model, prior, vehicle, room):  # type: ignore[no-untyped-def]
    """Solve with the running block; ``told`` becomes what the block alone says."""
    block, known, memory, closed, marks = vehicle
    rows, roughness = block[1], block[3]
    theta, noise, noise_known, reserve, covariance, informed = known
    solving, told, own_room, _, _ = room
    settings = model[4]
    asked = MOVE
    if closed[5][0] == 0:
        start_noise(roughness, noise, model[1].size, model[7])
        asked = BEGIN
    solve_block(model, block, theta, noise, noise_known, memory, prior, asked, solving, told)
    matrices, vectors, _ = told
    copied_rows(matrices[3], covariance)
    span = rows[1, 0] - rows[0, 0]
    share = 1.0 - math.exp(-span / settings[2])
    replace(share, matrices[0], prior[1], memory, reserve, own_room)
    _mark(informed, matrices[1], matrices[4], rows[1, 0], 2.0 * min(1.0, span / settings[0]))
    place_mark(
        block[0], rows, block[2], roughness, (matrices[0], matrices[1]), (vectors[0], vectors[1]),
        marks[0], marks[1], marks[2], marks[3],
    )  # fmt: skip


@part
def _before(model, prior, vehicle, room, m):  # type: ignore[no-untyped-def]
    """Mean and covariance of all that was known at mark m, and the block since then, into the room."""
    block, known, memory, _, marks = vehicle
    noise_known = known[2]
    solving, _, own_room, nothing, part = room
    squares, lines, _, _, level = own_room
    before, k = marks[3][m], lines.shape[1]
    for a in range(k):
        lines[4][a] = memory[2][a] + before[a, 2 * k]
        lines[5][a] = memory[3][a] + before[a, 2 * k + 1]
        for b in range(k):
            squares[0][a, b] = memory[0][a, b] + before[a, b]
            squares[1][a, b] = memory[1][a, b] + before[a, k + b]
    earlier = (squares[0], squares[1], lines[4], lines[5])
    remembered(earlier, nothing, prior, solving[3], lines[0], lines[1], squares[4])
    _cut_out(model, block, marks, m, part)
    for j in range(level.size):
        level[j] = noise_known[j]


@part
def _cut_out(model, block, marks, m, part):  # type: ignore[no-untyped-def]
    """The running block since mark m as a block of its own, the row at the mark in its sums."""
    since_mark(
        model[0], block[0], block[1], block[2], block[3], marks[0][m], marks[1][m], marks[2][m],
        part[0], part[1], part[2], part[3],
    )  # fmt: skip
    rebase_products(part[0], block[1][0], part[1][0], model[3], model[1].size)
    _gather(part[2], part[1][0], 2 + model[3].size)


@part
def _find_change(model, prior, vehicle, room):  # type: ignore[no-untyped-def]
    """Whether a derivative has changed, and since when: a mark, ``WHOLE`` or ``NO_CHANGE``; which ones, into the room.

    The running block against the closed ones is what a solution knows anyway; only where it speaks for a change at all
    are the windows since the marks held against all that was before them.
    """
    block, known, memory, _, marks = vehicle
    rows = block[1]
    solving, told, own_room, nothing, part = room
    squares, lines, both, flags, level = own_room
    weight, spread, inner = squares[2], squares[4], squares[0]
    line, mean, pull, size = lines[0], lines[1], lines[2], lines[3]
    changed, trial = flags[0], flags[1]
    said = 0.0
    for a in range(mean.size):
        size[a] = prior[1][a] / 3.0
        said += told[0][2, a, a]
    if said == 0.0:
        return NO_CHANGE
    remembered(memory, nothing, prior, solving[3], line, mean, spread)
    change_of(told[0][2], told[1][2], mean, spread, inner, both, weight, pull)
    whole = changed_derivatives(weight, pull, size, CHANGE_LOG_THRESHOLD, 0.0, inner, both, line, trial)
    if not whole > 0.0:
        return NO_CHANGE
    best, cut = CHANGE_LOG_THRESHOLD, NO_CHANGE
    if trial.any():
        best, cut = whole, WHOLE
        copied(trial, changed)
    alone = (nothing[0][0], nothing[0][0], nothing[1][0], nothing[1][0])
    for m in range(MARKS):
        if not (rows[0, 0] <= marks[1][m, 0] < rows[1, 0] - 0.5):
            continue
        _before(model, prior, vehicle, room, m)
        since = (part[0], part[1], part[2], part[3])
        solve_block(model, since, mean, level, known[2], alone, (mean, size), ALONE, solving, told)
        change_of(told[0][2], told[1][2], mean, spread, inner, both, weight, pull)
        value = changed_derivatives(weight, pull, size, CHANGE_LOG_THRESHOLD, 0.0, inner, both, line, trial)
        if trial.any() and value > best:
            best, cut = value, m
            copied(trial, changed)
    return cut


@part
def _cut_before(model, vehicle, room, m):  # type: ignore[no-untyped-def]
    """Make the running block end at mark m, what came after it kept in the room; returns whether it can be closed."""
    block, _, _, _, marks = vehicle
    bank, rows, sums, roughness = block
    mark_bank, mark_rows, mark_sums, _ = marks
    _cut_out(model, block, marks, m, room[4])
    if not mark_rows[m, 0] - rows[0, 0] >= model[4][1]:
        return False
    copied_bank(mark_bank[m], bank)
    copied(mark_rows[m], rows[1])
    for a in range(sums.size):
        sums[a] = mark_sums[m, a]
    for a in range(roughness.size):
        roughness[a] = mark_sums[m, sums.size + a]
    return True


@part
def _cut_after(vehicle, room):  # type: ignore[no-untyped-def]
    """Make what came after a cut the running block."""
    bank, rows, sums, roughness = vehicle[0]
    part = room[4]
    copied_bank(part[0], bank)
    copied_rows(part[1], rows)
    copied(part[2], sums)
    copied(part[3], roughness)
    vehicle[4][1][:, :] = np.nan


@part
def _release(prior, vehicle, changed_s, room):  # type: ignore[no-untyped-def]
    """Set the memory of what has changed free. All that is left is as good as new: nothing waits to be replaced."""
    block, known, memory, _, _ = vehicle
    lines, changed = room[2][1], room[2][3][0]
    size = lines[3]
    for a in range(size.size):
        size[a] = prior[1][a] / 3.0
    free_memory(memory[0], memory[1], memory[2], memory[3], size, changed, lines[4], lines[5])
    for a in range(size.size):
        if changed[a]:
            changed_s[a] = block[1][1, 0]
    known[3][:, :] = 0.0


@lean
def advance(  # type: ignore[no-untyped-def]
    signals, solves, omega, lever, gusts, by_accelerometer, exponents, settings, prior_value, prior_std, longitudinal,
    roll, bank, coefficients, step, rows, sums, roughness, theta, noise, noise_known, sensitivity, information,
    vector, driven, reserve, covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span,
    condition, counts, scatter, mark_bank, mark_rows, mark_sums, mark_known, changed_s, follows, room,
):  # fmt: skip
    """Take in samples (vehicles, samples, columns), and solve with every vehicle's running block if ``solves``.

    All in place; arguments as ``FourierEstimator`` lays them out, room of ``block_room``.
    """
    prior = (prior_value, prior_std)
    model = (omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, gusts)
    for i in range(follows.size):
        filters = (coefficients[i], step[i])
        block = (bank[i], rows[i], sums[i], roughness[i])
        vehicle = (
            block,
            (theta[i], noise[i], noise_known[i], reserve[i], covariance[i], informed[i]),
            (sensitivity[i], information[i], vector[i], driven[i]),
            (
                evidence_matrix[i],
                evidence_vector[i],
                evidence_bias[i],
                evidence_span[i],
                condition[i],
                counts[i],
                scatter[i],
            ),
            (mark_bank[i], mark_rows[i], mark_sums[i], mark_known[i]),
        )
        for k in range(signals.shape[1]):
            what = _take(model, block, filters, signals[i, k])
            if what == GOES_ON:
                continue
            if what == FULL or rows[i, 1, 0] - rows[i, 0, 0] >= settings[1]:
                _close(model, prior, vehicle, room)
            _restart(model, block, signals[i, k], what == GAP, mark_rows[i])
        if not solves or not (rows[i, 1, 0] - rows[i, 0, 0] >= settings[1] - 1e-9):
            continue
        for attempt in range(2):
            _solve(model, prior, vehicle, room)
            cut = NO_CHANGE
            if attempt == 0 and follows[i] and counts[i, 1] > 0:
                cut = _find_change(model, prior, vehicle, room)
            if cut == NO_CHANGE:
                break
            if cut >= 0:
                if _cut_before(model, vehicle, room, cut):
                    _close(model, prior, vehicle, room)
                _cut_after(vehicle, room)
            _release(prior, vehicle, changed_s[i], room)
        _condition(sums[i], condition[i])
        counts[i, 0] += 1
