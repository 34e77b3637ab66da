"""Blocks of the recursive Fourier estimator, compiled: filled, solved while they run, closed, added to what is known.

Derivation and symbols: ``docs/estimators.md`` sections 3 to 9. ``advance`` takes arrays that lead with the vehicle
axis; all else works on one vehicle, whose arrays are handed on in groups, in room that is made once.
"""

import math

import numpy as np
from numba import njit

from wingwatch.estimators.change import CHANGE_LOG_THRESHOLD, change_of, changed_derivatives, free_memory
from wingwatch.estimators.forgetting import FORGETTING_LINES, FORGETTING_SQUARES, replaced
from wingwatch.estimators.fourier_bank import advance_bank
from wingwatch.estimators.fourier_change import (
    MARKS,
    copied,
    copied_bank,
    copied_rows,
    place_mark,
    since_mark,
)
from wingwatch.estimators.fourier_solution import (
    ALONE,
    LEARN,
    MOVE,
    remembered,
    solution_room,
    solve_block,
    start_noise,
)
from wingwatch.estimators.hot import lean
from wingwatch.estimators.signals import MAX_GAP_S
from wingwatch.estimators.symmetric import congruence

__all__ = ["advance"]

RESERVE_THAT_COUNTS = 0.01
"""Share of a derivative's information in reserve, from which on the running block is asked what it replaces."""


@njit(cache=True)
def _block_room(ns, nu, nf, columns):  # type: ignore[no-untyped-def]
    """Room of everything that is done with a block: of solutions, of forgetting and changes, of a part of a block."""
    p = ns * (ns + nu)
    solving, told = solution_room(ns, nu, nf)
    squares, lines = np.empty((FORGETTING_SQUARES + 5, p, p)), np.empty((FORGETTING_LINES + 6, p))
    nothing = (np.zeros((1, p, p)), np.zeros((1, p)))
    part = (np.empty((ns + 2 * nu + 2, 2, nf)), np.empty((3, columns)), np.empty(6 + nu), np.empty(ns + 2))
    flags = np.zeros((2, p), dtype=np.bool_)
    return (
        solving,
        told,
        (squares, lines, np.empty((p, p + 1)), flags, np.empty(2 * ns + 1 + nu)),
        nothing,
        part,
    )


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
def _fade(share, memory, reserve):  # type: ignore[no-untyped-def]
    """What the clock makes fade goes into reserve; what is known in all stays as it is."""
    sensitivity, information, vector, driven = memory
    k = vector.size
    for a in range(k):
        for b in range(k):
            reserve[a, b] += share * (sensitivity[a, b] - reserve[a, b])
            reserve[a, k + b] += share * (information[a, b] - reserve[a, k + b])
        reserve[a, 2 * k] += share * (vector[a] - reserve[a, 2 * k])
        reserve[a, 2 * k + 1] += share * (driven[a] - reserve[a, 2 * k + 1])


@lean
def _replace(share, gained, prior_std, memory, reserve, room):  # type: ignore[no-untyped-def]
    """Of the reserve goes what a block that brings ``gained`` replaces."""
    squares, lines = room[0], room[1]
    sensitivity, information, vector, driven = memory
    k = vector.size
    counts, trace = False, 0.0
    for a in range(k):
        counts = counts or reserve[a, a] > RESERVE_THAT_COUNTS * sensitivity[a, a]
        trace += gained[a, a]
    if not counts or trace <= 0.0:
        return
    left, old, known, new = squares[0], squares[1], squares[2], squares[3]
    score, gust = lines[0], lines[1]
    for a in range(k):
        for b in range(k):
            old[a, b] = reserve[a, b]
            known[a, b] = sensitivity[a, b] + gained[a, b]
        known[a, a] += 1.0 / (prior_std[a] * prior_std[a])
    if replaced(old, known, gained, share, squares[5:], lines[6:], left) == k:
        return
    congruence(left, old, known, new)
    for a in range(k):
        score[a] = gust[a] = 0.0
        for b in range(k):
            score[a] += left[a, b] * reserve[b, 2 * k]
            gust[a] += left[a, b] * reserve[b, 2 * k + 1]
            sensitivity[a, b] += new[a, b] - old[a, b]
    for a in range(k):
        vector[a] += score[a] - reserve[a, 2 * k]
        driven[a] += gust[a] - reserve[a, 2 * k + 1]
        reserve[a, 2 * k], reserve[a, 2 * k + 1] = score[a], gust[a]
        for b in range(k):
            old[a, b] = reserve[a, k + b]
            reserve[a, b] = new[a, b]
    congruence(left, old, known, new)
    for a in range(k):
        for b in range(k):
            information[a, b] += new[a, b] - old[a, b]
            reserve[a, k + b] = new[a, b]


@lean
def _close(model, prior, vehicle, room):  # type: ignore[no-untyped-def]
    """End the block: solved on its own, from what is known, its information joins what is known."""
    block, known, memory, closed, _ = vehicle
    rows, sums, roughness = block[1], block[2], block[3]
    theta, noise, noise_known, reserve, covariance, informed = known
    evidence_matrix, evidence_vector, evidence_bias, evidence_span, condition, counts = closed
    solving, told, own_room, nothing, _ = room
    lines, level = own_room[1], own_room[4]
    settings, k = model[4], theta.size
    if counts[0] == 0:
        start_noise(roughness, noise, model[1].size)
    remembered(memory, nothing, prior, solving[3], lines[0], theta, covariance)
    anchor, own, error = lines[1], lines[2], lines[3]
    for a in range(k):
        anchor[a] = own[a] = theta[a]
        error[a] = prior[1][a] / 3.0
    for j in range(level.size):
        level[j] = noise_known[j] if noise_known[-1] > 0.0 else noise[j]
    alone = (nothing[0][0], nothing[0][0], nothing[1][0], nothing[1][0])
    solve_block(model, block, own, level, noise_known, alone, (anchor, error), 1, LEARN, solving, told)
    solve_block(model, block, anchor, level, noise_known, alone, (anchor, error), 1, ALONE, solving, told)
    matrices, vectors, fresh = told
    span = rows[1, 0] - rows[0, 0]
    share = min(1.0, span / settings[0])
    _mark(informed, matrices[1], matrices[4], rows[1, 0], 2.0 * share)
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
    lost = 1.0 - math.exp(-span / settings[2])
    _fade(0.0 if rows[1, 0] - last > settings[6] else lost, memory, reserve)
    _replace(lost, matrices[0], prior[1], memory, reserve, own_room)
    for a in range(k):
        memory[2][a] += vectors[0, a]
        memory[3][a] += vectors[1, a]
        for b in range(k):
            memory[0][a, b] += matrices[0, a, b]
            memory[1][a, b] += matrices[1, a, b]
    weight = noise_known[-1]
    for j in range(noise.size):
        noise_known[j] = (weight * noise_known[j] + share * fresh[j]) / (weight + share)
    noise_known[-1] = math.exp(-settings[0] / settings[2]) * (weight + share)
    for j in range(2 * model[1].size + 1):
        noise[j] = noise_known[j]
    remembered(memory, nothing, prior, solving[3], lines[0], theta, covariance)
    counts[0] += 1
    counts[1] += 1


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
def _restart(block, row, kinematic):  # type: ignore[no-untyped-def]
    """Begin a block at a row."""
    bank, rows, sums, roughness = block
    bank[:, :, :] = 0.0
    sums[:] = 0.0
    roughness[:] = 0.0
    copied(row, rows[0])
    _gather(sums, row, kinematic)


@lean
def _bends(block, new, ns, nu):  # type: ignore[no-untyped-def]
    """Add second differences: roots of their magnitudes of states and accelerometer, squares of inputs."""
    _, rows, sums, roughness = block
    for j in range(ns + 1):
        bend = new[1 + j] - 2.0 * rows[1, 1 + j] + rows[2, 1 + j]
        roughness[j] += math.sqrt(abs(bend))
    roughness[ns + 1] += 1.0
    for j in range(nu):
        bend = new[2 + ns + j] - 2.0 * rows[1, 2 + ns + j] + rows[2, 2 + ns + j]
        sums[6 + j] += bend * bend
    sums[5] += 1.0


@lean
def _take(model, prior, vehicle, filters, new, room):  # type: ignore[no-untyped-def]
    """Take in one row of signals."""
    omega, lever, by_accelerometer, exponents, settings, _, _ = model
    block, _, _, _, marks = vehicle
    bank, rows, sums, _ = block
    coefficients, step = filters
    ns, nu = lever.size, exponents.size - lever.size
    servo_s = settings[7 + nu : 7 + 2 * nu]
    kinematic = 2 + ns + nu
    for j in range(kinematic + 5):
        if not math.isfinite(new[j]):
            return
    dt = new[0] - rows[1, 0]
    if not (0.0 < dt <= MAX_GAP_S):
        if rows[1, 0] - rows[0, 0] >= settings[1]:
            _close(model, prior, vehicle, room)
        copied(new, rows[1])
        rows[2, 0] = new[0]
        rows[2, 1:] = np.nan
        marks[1][:, :] = np.nan
        _restart(block, new, kinematic)
        return
    force = 1 + ns if by_accelerometer else kinematic
    advance_bank(omega, bank, step, coefficients, rows[1], new, rows[2], servo_s, ns, nu, force)
    if math.isfinite(rows[2, 1]):
        _bends(block, new, ns, nu)
    copied(rows[1], rows[2])
    copied(new, rows[1])
    _gather(sums, new, kinematic)
    if new[0] - rows[0, 0] >= settings[0] - 0.5 * dt:
        _close(model, prior, vehicle, room)
        _restart(block, new, kinematic)


@lean
def _solve(model, prior, vehicle, room):  # type: ignore[no-untyped-def]
    """Solve with the running block; ``told`` becomes what the block alone says."""
    block, known, memory, closed, marks = vehicle
    rows, roughness = block[1], block[3]
    theta, noise, noise_known, reserve, covariance, informed = known
    solving, told, own_room, _, _ = room
    settings = model[4]
    iterations = 1
    if closed[5][0] == 0:
        start_noise(roughness, noise, model[1].size)
        iterations = 3
    solve_block(model, block, theta, noise, noise_known, memory, prior, iterations, MOVE, solving, told)
    matrices, vectors, _ = told
    copied_rows(matrices[3], covariance)
    span = rows[1, 0] - rows[0, 0]
    share = 1.0 - math.exp(-span / settings[2])
    _replace(share, matrices[0], prior[1], memory, reserve, own_room)
    _mark(informed, matrices[1], matrices[4], rows[1, 0], 2.0 * min(1.0, span / settings[0]))
    place_mark(
        block[0], rows, block[2], roughness, (matrices[0], matrices[1]), (vectors[0], vectors[1]),
        marks[0], marks[1], marks[2], marks[3],
    )  # fmt: skip


@lean
def _window(model, prior, vehicle, room, m):  # type: ignore[no-untyped-def]
    """What the block since mark m says alone, against all that was known before it: K, pull into the room."""
    block, known, memory, _, marks = vehicle
    noise_known = known[2]
    solving, told, own_room, nothing, part = room
    squares, lines, both, _, level = own_room
    mean, size, spread = lines[1], lines[3], squares[4]
    before, k = marks[3][m], mean.size
    for a in range(k):
        lines[4][a] = memory[2][a] + before[a, 2 * k]
        lines[5][a] = memory[3][a] + before[a, 2 * k + 1]
        for b in range(k):
            squares[0][a, b] = memory[0][a, b] + before[a, b]
            squares[1][a, b] = memory[1][a, b] + before[a, k + b]
    earlier = (squares[0], squares[1], lines[4], lines[5])
    remembered(earlier, nothing, prior, solving[3], lines[0], mean, spread)
    _cut_out(model, block, marks, m, part)
    for j in range(level.size):
        level[j] = noise_known[j]
    alone = (nothing[0][0], nothing[0][0], nothing[1][0], nothing[1][0])
    solve_block(model, part, mean, level, noise_known, alone, (mean, size), 1, ALONE, solving, told)
    change_of(told[0][2], told[1][2], mean, spread, squares[0], both, squares[2], lines[2])


@lean
def _cut_out(model, block, marks, m, part):  # type: ignore[no-untyped-def]
    """The running block since mark m as a block of its own, the row at the mark in its sums."""
    since_mark(
        model[0], block[0], block[1], block[2], block[3], marks[0][m], marks[1][m], marks[2][m],
        part[0], part[1], part[2], part[3],
    )  # fmt: skip
    _gather(part[2], part[1][0], 2 + model[3].size)


@lean
def _follow_change(model, prior, vehicle, changed_s, room):  # type: ignore[no-untyped-def]
    """Where a derivative has changed, end the block at the change and set the memory of it free; returns whether.

    The running block against the closed ones is what a solution knows anyway; only where it speaks for a change at all
    are the windows since the marks held against all that was before them.
    """
    block, known, memory, _, marks = vehicle
    rows, reserve = block[1], known[3]
    solving, told, own_room, nothing, _ = room
    squares, lines, both, flags, _ = own_room
    weight, spread, inner = squares[2], squares[4], squares[0]
    line, mean, pull, size = lines[0], lines[1], lines[2], lines[3]
    changed, trial = flags[0], flags[1]
    k = mean.size
    said = 0.0
    for a in range(k):
        size[a] = prior[1][a] / 3.0
        said += told[0][2, a, a]
    if said == 0.0:
        return False
    remembered(memory, nothing, prior, solving[3], line, mean, spread)
    change_of(told[0][2], told[1][2], mean, spread, inner, both, weight, pull)
    whole = changed_derivatives(weight, pull, size, CHANGE_LOG_THRESHOLD, 0.0, inner, both, line, trial)
    if not whole > 0.0:
        return False
    best, cut = CHANGE_LOG_THRESHOLD, -2
    if trial.any():
        best, cut = whole, -1
        copied(trial, changed)
    for m in range(MARKS):
        if not (rows[0, 0] <= marks[1][m, 0] < rows[1, 0] - 0.5):
            continue
        _window(model, prior, vehicle, room, m)
        value = changed_derivatives(weight, pull, size, CHANGE_LOG_THRESHOLD, 0.0, inner, both, line, trial)
        if trial.any() and value > best:
            best, cut = value, m
            copied(trial, changed)
    if cut == -2:
        return False
    if cut >= 0:
        _cut(model, prior, vehicle, room, cut)
    free_memory(memory[0], memory[1], memory[2], memory[3], size, changed, lines[4], lines[5])
    for a in range(k):
        if changed[a]:
            changed_s[a] = rows[1, 0]
    # All that is left is as good as new: nothing of it waits to be replaced.
    reserve[:, :] = 0.0
    return True


@lean
def _cut(model, prior, vehicle, room, m):  # type: ignore[no-untyped-def]
    """End the running block at mark m; what came after it is the running block."""
    block, _, _, _, marks = vehicle
    bank, rows, sums, roughness = block
    mark_bank, mark_rows, mark_sums, _ = marks
    part = room[4]
    _cut_out(model, block, marks, m, part)
    if mark_rows[m, 0] - rows[0, 0] >= model[4][1]:
        copied_bank(mark_bank[m], bank)
        copied(mark_rows[m], rows[1])
        for a in range(sums.size):
            sums[a] = mark_sums[m, a]
        for a in range(roughness.size):
            roughness[a] = mark_sums[m, sums.size + a]
        _close(model, prior, vehicle, room)
    copied_bank(part[0], bank)
    copied_rows(part[1], rows)
    copied(part[2], sums)
    copied(part[3], roughness)
    mark_rows[:, :] = np.nan


@lean
def _advance(signals, solves, model, prior, states, changed_s, follows, room):  # type: ignore[no-untyped-def]
    """``advance`` with its arguments grouped."""
    block, filters, known, memory, closed, marks = states
    settings = model[4]
    for i in range(follows.size):
        vehicle = (
            (block[0][i], block[1][i], block[2][i], block[3][i]),
            (known[0][i], known[1][i], known[2][i], known[3][i], known[4][i], known[5][i]),
            (memory[0][i], memory[1][i], memory[2][i], memory[3][i]),
            (closed[0][i], closed[1][i], closed[2][i], closed[3][i], closed[4][i], closed[5][i]),
            (marks[0][i], marks[1][i], marks[2][i], marks[3][i]),
        )
        rows, counts = vehicle[0][1], vehicle[3][5]
        for k in range(signals.shape[1]):
            _take(model, prior, vehicle, (filters[0][i], filters[1][i]), signals[i, k], room)
        if not solves or not (rows[1, 0] - rows[0, 0] >= settings[1] - 1e-9):
            continue
        _solve(model, prior, vehicle, room)
        if follows[i] and counts[1] > 0 and _follow_change(model, prior, vehicle, changed_s[i], room):
            _solve(model, prior, vehicle, room)
        _condition(vehicle[0][2], vehicle[3][4])
        counts[0] += 1


@njit(cache=True)
def advance(  # type: ignore[no-untyped-def]
    signals, solves, omega, servo_s, lever, by_accelerometer, exponents, settings, prior_value, prior_std, longitudinal,
    roll, bank, coefficients, step, rows, sums, roughness, theta, noise, noise_known, sensitivity, information,
    vector, driven, reserve, covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span,
    condition, counts, mark_bank, mark_rows, mark_sums, mark_known, changed_s, follows,
):  # fmt: skip
    """Take in samples (vehicles, samples, columns), and solve with every vehicle's running block if ``solves``.

    All in place; arguments as ``FourierEstimator`` lays them out.
    """
    room = _block_room(lever.size, servo_s.size, omega.size, rows.shape[2])
    states = (
        (bank, rows, sums, roughness),
        (coefficients, step),
        (theta, noise, noise_known, reserve, covariance, informed),
        (sensitivity, information, vector, driven),
        (evidence_matrix, evidence_vector, evidence_bias, evidence_span, condition, counts),
        (mark_bank, mark_rows, mark_sums, mark_known),
    )
    model = (omega, lever, by_accelerometer, exponents, settings, longitudinal, roll)
    _advance(signals, solves, model, (prior_value, prior_std), states, changed_s, follows, room)
