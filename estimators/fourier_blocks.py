"""Blocks of the recursive Fourier estimator, compiled: filled, solved while they run, closed, added to what is known.

Derivation and symbols: ``docs/estimators.md`` sections 3 to 9. Arrays lead with the vehicle axis.
"""

import numpy as np
from numba import njit

from wingwatch.estimators.change import CHANGE_LOG_THRESHOLD, change_of, changed_derivatives, free_memory
from wingwatch.estimators.forgetting import replaced
from wingwatch.estimators.fourier_bank import advance_bank, block_transforms
from wingwatch.estimators.fourier_between import between_samples
from wingwatch.estimators.fourier_change import MARKS, place_mark, since_mark
from wingwatch.estimators.fourier_directions import noise_edge, reduce_information
from wingwatch.estimators.fourier_equations import block_equations, noise_update
from wingwatch.estimators.signals import MAX_GAP_S

__all__ = ["solve_all", "update_all"]

RESERVE_THAT_COUNTS = 0.01
"""Share of a derivative's information in reserve, from which on the running block is asked what it replaces."""

LOWEST_NOISE = 0.5
"""A noise variance is not believed to be less than this share of the roughness (which signal, too, enlarges)."""

ROOT_MEAN = 0.8221790
"""Mean of the square root of a standard normal number's magnitude, 2^(1/4) Gamma(3/4) / sqrt(pi)."""


@njit(cache=True)
def _rough_noise(roughness, j, ns):  # type: ignore[no-untyped-def]
    """Variance of white noise of channel ``j`` that second differences (variance 6 D) would have such roots from.

    The roots of their magnitudes are summed, not their squares: what bends when a surface jumps is large, but rare.
    """
    root = roughness[j] / max(roughness[ns + 1], 1.0) / ROOT_MEAN
    return root**4 / 6.0


@njit(cache=True)
def _noise_start(roughness, noise, ns):  # type: ignore[no-untyped-def]
    """First variances from second differences, whose variance is 6 D for white noise."""
    floor = np.full(ns + 1, 1e-10)
    floor[0] = floor[ns] = 1e-8
    for j in range(ns + 1):
        noise[j] = max(_rough_noise(roughness, j, ns), floor[j])
    for k in range(ns):
        noise[ns + 1 + k] = noise[k]


@njit(cache=True)
def _floor_noise(noise, ns):  # type: ignore[no-untyped-def]
    """Below any sensor's resolution nothing is gained: 1e-4 m/s and m/s2, 1e-5 rad/s."""
    for j in range(2 * ns + 1):
        least = 1e-8 if j in (0, ns, ns + 1) else 1e-10
        noise[j] = max(noise[j], least)


@njit(cache=True)
def _present(sums, settings, exponents, longitudinal, roll, ns):  # type: ignore[no-untyped-def]
    """Scale from referred to present derivatives, and the kinematic part per state, at the block's mean condition."""
    airspeed, density, alpha = sums[0] / sums[4], sums[1] / sums[4], sums[3] / sums[4]
    pressure = density * airspeed / (settings[5] * settings[4])
    columns = exponents.size
    scale = np.empty(ns * columns)
    for k in range(ns):
        for c in range(columns):
            scale[k * columns + c] = pressure if exponents[c] == 1.0 else pressure * airspeed / settings[4]
    forward = np.zeros(ns)
    forward[ns - 1] = airspeed * np.cos(alpha) * (1.0 if longitudinal else -1.0)
    if roll:
        forward[1] = airspeed * np.sin(alpha)
    return scale, forward


@njit(cache=True)
def _believe(noise, fresh, noise_known, share, roughness, by_accelerometer, ns):  # type: ignore[no-untyped-def]
    """Noise variances from this block's residual and from earlier blocks, by the time each rests on."""
    known = noise_known[-1]
    for j in range(2 * ns + 1):
        noise[j] = (known * noise_known[j] + share * fresh[j]) / (known + share)
    noise[ns + 1 if by_accelerometer else ns] = 0.0
    for j in range(ns + 1):
        noise[j] = max(noise[j], LOWEST_NOISE * _rough_noise(roughness, j, ns))
    _floor_noise(noise, ns)


@njit(cache=True)
def _block_step(  # type: ignore[no-untyped-def]
    omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, bank, rows, sums, theta, noise,
    noise_known, roughness, sensitivity, information, vector, past_driven, prior_value, prior_std, iterations,
):  # fmt: skip
    """Solve with the running block: theta and noise in place; returns what the block adds."""
    ns = theta.size // exponents.size
    nu = exponents.size - ns
    span = rows[1, 0] - rows[0, 0]
    lines, phase = block_transforms(omega, bank, span, ns, nu)
    count = sums[4]
    dt = span / max(count - 1.0, 1.0)
    power = span * dt
    scale, forward = _present(sums, settings, exponents, longitudinal, roll, ns)
    share = min(1.0, span / settings[0])
    for j in range(nu):
        rough = sums[6 + j] / (6.0 * max(sums[5], 1.0))
        noise[2 * ns + 1 + j] = min(settings[7 + j], rough)
    n_theta = theta.size
    weight = 1.0 / (prior_std * prior_std)
    suspected = np.ones(ns)
    for _ in range(iterations):
        transforms = between_samples(
            omega, lines, phase, rows[0], rows[1], dt, settings[7 + nu : 7 + 2 * nu], theta, scale, forward, lever,
            by_accelerometer, ns, nu,
        )  # fmt: skip
        m, n_noise, score, nuisance, follow, driven, bins = block_equations(
            omega, transforms, phase, rows[0], rows[1], theta, scale, noise, power, forward, lever, by_accelerometer,
            ns, nu,
        )  # fmt: skip
        for j in range(ns):
            suspected[j] = max(1.0, _rough_noise(roughness, j, ns) / noise[j])
        mc, kept, score, driven, evidence, evidence_score, gust = reduce_information(
            m, n_noise, suspected, score, driven, max(settings[3], noise_edge(ns + nu, bins * share))
        )
        gain = 2.0 * share
        add_vector = gain * (score + mc @ theta)
        total = sensitivity + gain * mc
        for a in range(n_theta):
            total[a, a] += weight[a]
        inverse = np.linalg.inv(total)
        evidence_vector = gain * (evidence @ theta + evidence_score)
        moved = inverse @ (vector + add_vector + weight * prior_value)
        nuisance += (follow @ (moved - theta)).reshape(ns, 3)
        theta[:] = moved
        fresh = noise_update(
            omega, transforms, phase, rows[0], rows[1], theta, scale, nuisance, noise, power, forward, lever,
            by_accelerometer, ns, nu,
        )  # fmt: skip
        _believe(noise, fresh, noise_known, share, roughness, by_accelerometer, ns)
    spread = information + gain * kept
    for a in range(n_theta):
        spread[a, a] += weight[a]
    bias = inverse @ (past_driven + gain * driven)
    covariance = inverse @ spread @ inverse + np.outer(bias, bias)
    return (
        gain * mc, gain * kept, add_vector, gain * driven, covariance, gain * evidence, evidence_vector, gain * gust,
        m, fresh,
    )  # fmt: skip


@njit(cache=True)
def _mark(informed, kept_diagonal, power_diagonal, time, gain):  # type: ignore[no-untyped-def]
    for a in range(informed.size):
        if power_diagonal[a] > 0.0 and kept_diagonal[a] > 0.5 * gain * power_diagonal[a]:
            informed[a] = time


@njit(cache=True)
def _condition(sums, condition):  # type: ignore[no-untyped-def]
    for j in range(4):
        condition[j] = sums[j] / sums[4]
    condition[1], condition[2] = sums[2] / sums[4], sums[1] / sums[4]


@njit(cache=True)
def _remembered(sensitivity, information, vector, driven, prior_value, prior_std):  # type: ignore[no-untyped-def]
    """Mean and covariance of what is remembered."""
    ridge = np.diag(1.0 / (prior_std * prior_std))
    inverse = np.linalg.inv(sensitivity + ridge)
    bias = inverse @ driven
    covariance = inverse @ (information + ridge) @ inverse + np.outer(bias, bias)
    return inverse @ (vector + ridge @ prior_value), covariance


@njit(cache=True)
def _combine(i, theta, covariance, sensitivity, information, vector, driven, prior_value, prior_std):  # type: ignore[no-untyped-def]
    """Theta and its covariance from all closed blocks."""
    theta[i], covariance[i] = _remembered(
        sensitivity[i], information[i], vector[i], driven[i], prior_value, prior_std
    )


@njit(cache=True)
def _fade(share, sensitivity, information, vector, driven, reserve):  # type: ignore[no-untyped-def]
    """What the clock makes fade goes into reserve; what is known in all stays as it is."""
    k = vector.size
    for a in range(k):
        for b in range(k):
            reserve[a, b] += share * (sensitivity[a, b] - reserve[a, b])
            reserve[a, k + b] += share * (information[a, b] - reserve[a, k + b])
        reserve[a, 2 * k] += share * (vector[a] - reserve[a, 2 * k])
        reserve[a, 2 * k + 1] += share * (driven[a] - reserve[a, 2 * k + 1])


@njit(cache=True)
def _replace(share, gained, prior_std, sensitivity, information, vector, driven, reserve):  # type: ignore[no-untyped-def]
    """Of the reserve goes what a block that brings ``gained`` replaces."""
    k = vector.size
    counts = False
    for a in range(k):
        counts = counts or reserve[a, a] > RESERVE_THAT_COUNTS * sensitivity[a, a]
    if not counts or np.trace(gained) <= 0.0:
        return
    ridge = np.diag(1.0 / (prior_std * prior_std))
    old, spread = np.ascontiguousarray(reserve[:, :k]), np.ascontiguousarray(reserve[:, k : 2 * k])
    score, gust = np.ascontiguousarray(reserve[:, 2 * k]), np.ascontiguousarray(reserve[:, 2 * k + 1])
    left = replaced(old, sensitivity + gained + ridge, gained, share)
    turned = np.ascontiguousarray(left.T)
    new, spread_left = left @ old @ turned, left @ spread @ turned
    score_left, gust_left = left @ score, left @ gust
    sensitivity += new - old
    information += spread_left - spread
    vector += score_left - score
    driven += gust_left - gust
    reserve[:, :k], reserve[:, k : 2 * k] = new, spread_left
    reserve[:, 2 * k], reserve[:, 2 * k + 1] = score_left, gust_left


@njit(cache=True)
def _close(i, common, arrays):  # type: ignore[no-untyped-def]
    """End the block of vehicle i: solved on its own, from what is known, its information joins what is known."""
    omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, prior_value, prior_std = common
    (bank, rows, sums, roughness, theta, noise, noise_known, sensitivity, information, vector, driven,
     reserve, covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span, condition,
     counts) = arrays  # fmt: skip
    if counts[i, 0] == 0:
        _noise_start(roughness[i], noise[i], lever.size)
    _combine(i, theta, covariance, sensitivity, information, vector, driven, prior_value, prior_std)
    nothing = np.zeros_like(sensitivity[i])
    anchor, own = theta[i].copy(), theta[i].copy()
    level = noise_known[i, :-1].copy() if noise_known[i, -1] > 0.0 else noise[i].copy()
    _, _, _, _, _, _, _, _, _, fresh = _block_step(
        omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, bank[i], rows[i], sums[i],
        own, level, noise_known[i], roughness[i], nothing, nothing, nothing[0], nothing[0], anchor, prior_std / 3.0, 1,
    )  # fmt: skip
    own[:] = anchor
    mc, kept, add, gust, _, evidence, evidence_v, evidence_b, m, _ = _block_step(
        omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, bank[i], rows[i], sums[i],
        own, level, noise_known[i], roughness[i], nothing, nothing, nothing[0], nothing[0], anchor, prior_std / 3.0, 1,
    )  # fmt: skip
    share = min(1.0, (rows[i, 1, 0] - rows[i, 0, 0]) / settings[0])
    _mark(informed[i], np.diag(kept), np.diag(m), rows[i, 1, 0], 2.0 * share)
    evidence_matrix[i] = evidence
    evidence_vector[i] = evidence_v
    evidence_bias[i] = evidence_b
    evidence_span[i, 0], evidence_span[i, 1] = rows[i, 0, 0], rows[i, 1, 0]
    _condition(sums[i], condition[i])
    evidence_span[i, 2:] = condition[i]
    quiet = rows[i, 1, 0] - np.max(informed[i]) > settings[6]
    keep = 1.0 if quiet else np.exp(-(rows[i, 1, 0] - rows[i, 0, 0]) / settings[2])
    _fade(1.0 - keep, sensitivity[i], information[i], vector[i], driven[i], reserve[i])
    lost = 1.0 - np.exp(-(rows[i, 1, 0] - rows[i, 0, 0]) / settings[2])
    _replace(lost, mc, prior_std, sensitivity[i], information[i], vector[i], driven[i], reserve[i])
    sensitivity[i] += mc
    information[i] += kept
    vector[i] += add
    driven[i] += gust
    known = noise_known[i, -1]
    for j in range(noise.shape[1]):
        noise_known[i, j] = (known * noise_known[i, j] + share * fresh[j]) / (known + share)
    noise_known[i, -1] = np.exp(-settings[0] / settings[2]) * (known + share)
    noise[i, : 2 * lever.size + 1] = noise_known[i, : 2 * lever.size + 1]
    _combine(i, theta, covariance, sensitivity, information, vector, driven, prior_value, prior_std)
    counts[i, 0] += 1
    counts[i, 1] += 1


@njit(cache=True)
def update_all(  # type: ignore[no-untyped-def]
    signals, omega, servo_s, lever, by_accelerometer, exponents, settings, prior_value, prior_std, longitudinal, roll,
    bank, coefficients, step, rows, sums, roughness, theta, noise, noise_known, sensitivity, information,
    vector, driven, reserve, covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span,
    condition, counts, mark_bank, mark_rows, mark_sums, mark_known, changed_s, follows,
):  # fmt: skip
    """Take in samples (vehicles, samples, columns), all in place; arguments as ``FourierEstimator`` lays them out."""
    ns = lever.size
    nu = servo_s.size
    kinematic = 2 + ns + nu
    force = 1 + ns if by_accelerometer else kinematic
    common = (omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, prior_value, prior_std)
    arrays = (bank, rows, sums, roughness, theta, noise, noise_known, sensitivity, information, vector,
              driven, reserve, covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span,
              condition, counts)  # fmt: skip
    for i in range(signals.shape[0]):
        for k in range(signals.shape[1]):
            new = signals[i, k]
            complete = True
            for j in range(kinematic + 5):
                complete = complete and np.isfinite(new[j])
            if not complete:
                continue
            dt = new[0] - rows[i, 1, 0]
            if not (0.0 < dt <= MAX_GAP_S):
                if rows[i, 1, 0] - rows[i, 0, 0] >= settings[1]:
                    _close(i, common, arrays)
                rows[i, 0], rows[i, 1], rows[i, 2] = new, new, new
                rows[i, 2, 1:] = np.nan
                _restart(i, bank, sums, roughness)
                mark_rows[i] = np.nan
                _gather(sums[i], new, kinematic)
                continue
            advance_bank(
                omega, bank[i], step[i], coefficients[i], rows[i, 1], new, rows[i, 2], servo_s, ns, nu, force
            )  # fmt: skip
            if np.isfinite(rows[i, 2, 1]):
                for j in range(ns + 1):
                    bend = new[1 + j] - 2.0 * rows[i, 1, 1 + j] + rows[i, 2, 1 + j]
                    roughness[i, j] += np.sqrt(abs(bend))
                roughness[i, ns + 1] += 1.0
                for j in range(nu):
                    bend = new[2 + ns + j] - 2.0 * rows[i, 1, 2 + ns + j] + rows[i, 2, 2 + ns + j]
                    sums[i, 6 + j] += bend * bend
                sums[i, 5] += 1.0
            rows[i, 2] = rows[i, 1]
            rows[i, 1] = new
            _gather(sums[i], new, kinematic)
            if new[0] - rows[i, 0, 0] >= settings[0] - 0.5 * dt:
                _close(i, common, arrays)
                rows[i, 0] = new
                _restart(i, bank, sums, roughness)
                _gather(sums[i], new, kinematic)


@njit(cache=True)
def _restart(i, bank, sums, roughness):  # type: ignore[no-untyped-def]
    bank[i] = 0.0
    sums[i] = 0.0
    roughness[i] = 0.0


@njit(cache=True)
def _gather(sums, row, kinematic):  # type: ignore[no-untyped-def]
    alpha = row[kinematic + 5]
    sums[0] += row[kinematic + 2]
    sums[1] += row[kinematic + 3]
    sums[2] += row[kinematic + 4]
    sums[3] += alpha if np.isfinite(alpha) else 0.0
    sums[4] += 1.0


@njit(cache=True)
def solve_all(  # type: ignore[no-untyped-def]
    omega, servo_s, lever, by_accelerometer, exponents, settings, prior_value, prior_std, longitudinal, roll,
    bank, coefficients, step, rows, sums, roughness, theta, noise, noise_known, sensitivity, information,
    vector, driven, reserve, covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span,
    condition, counts, mark_bank, mark_rows, mark_sums, mark_known, changed_s, follows,
):  # fmt: skip
    """Solve with every vehicle's running block; the same arguments, in place."""
    common = (omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, prior_value, prior_std)
    arrays = (bank, rows, sums, roughness, theta, noise, noise_known, sensitivity, information, vector,
              driven, reserve, covariance, informed, evidence_matrix, evidence_vector, evidence_bias, evidence_span,
              condition, counts)  # fmt: skip
    marks = (mark_bank, mark_rows, mark_sums, mark_known)
    for i in range(theta.shape[0]):
        if not (rows[i, 1, 0] - rows[i, 0, 0] >= settings[1] - 1e-9):
            continue
        evidence, evidence_v = _solve(i, common, arrays, marks)
        if (
            follows[i]
            and counts[i, 1] > 0
            and _follow_change(i, common, arrays, marks, evidence, evidence_v, servo_s.size, changed_s)
        ):
            _solve(i, common, arrays, marks)
        _condition(sums[i], condition[i])
        counts[i, 0] += 1


@njit(cache=True)
def _solve(i, common, arrays, marks):  # type: ignore[no-untyped-def]
    """Solve with the running block of vehicle i; returns what the block alone says, as ``BlockEvidence`` has it."""
    omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, prior_value, prior_std = common
    (bank, rows, sums, roughness, theta, noise, noise_known, sensitivity, information, vector, driven,
     reserve, covariance, informed, _, _, _, _, _, counts) = arrays  # fmt: skip
    mark_bank, mark_rows, mark_sums, mark_known = marks
    iterations = 1
    if counts[i, 0] == 0:
        _noise_start(roughness[i], noise[i], lever.size)
        iterations = 3
    mc, kept, add, gust, cov, evidence, evidence_v, _, m, _ = _block_step(
        omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, bank[i], rows[i],
        sums[i], theta[i], noise[i], noise_known[i], roughness[i], sensitivity[i], information[i], vector[i],
        driven[i], prior_value, prior_std, iterations,
    )  # fmt: skip
    covariance[i] = cov
    span = rows[i, 1, 0] - rows[i, 0, 0]
    share = 1.0 - np.exp(-span / settings[2])
    _replace(share, mc, prior_std, sensitivity[i], information[i], vector[i], driven[i], reserve[i])
    _mark(informed[i], np.diag(kept), np.diag(m), rows[i, 1, 0], 2.0 * min(1.0, span / settings[0]))
    place_mark(
        bank[i], rows[i], sums[i], roughness[i], mc, kept, add, gust, mark_bank[i], mark_rows[i],
        mark_sums[i], mark_known[i],
    )  # fmt: skip
    return evidence, evidence_v


@njit(cache=True)
def _follow_change(i, common, arrays, marks, evidence, evidence_v, inputs, changed_s):  # type: ignore[no-untyped-def]
    """Where a derivative has changed, end the block at the change and set the memory of it free; returns whether.

    The running block against the closed ones is what a solution knows anyway; only where it speaks for a change at all
    are the windows since the marks held against all that was before them.
    """
    omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, prior_value, prior_std = common
    (bank, rows, sums, roughness, _, _, noise_known, sensitivity, information, vector, driven,
     reserve, _, _, _, _, _, _, _, _) = arrays  # fmt: skip
    mark_bank, mark_rows, mark_sums, mark_known = marks
    k, size = prior_std.size, prior_std / 3.0
    changed, trial = np.zeros(k, dtype=np.bool_), np.zeros(k, dtype=np.bool_)
    mean, spread = _remembered(sensitivity[i], information[i], vector[i], driven[i], prior_value, prior_std)
    weight, pull = change_of(evidence, evidence_v, mean, spread)
    best, cut = CHANGE_LOG_THRESHOLD, -2
    whole = changed_derivatives(weight, pull, size, CHANGE_LOG_THRESHOLD, 0.0, trial)
    if not whole > 0.0:
        return False
    if trial.any():
        best, cut = whole, -1
        changed[:] = trial
    nothing = np.zeros((k, k))
    for m in range(MARKS):
        if not (rows[i, 0, 0] <= mark_rows[i, m, 0] < rows[i, 1, 0] - 0.5):
            continue
        known = mark_known[i, m]
        mean, spread = _remembered(
            sensitivity[i] + known[:, :k], information[i] + known[:, k : 2 * k], vector[i] + known[:, 2 * k],
            driven[i] + known[:, 2 * k + 1], prior_value, prior_std,
        )  # fmt: skip
        part, ends, part_sums, part_roughness = since_mark(
            omega, bank[i], rows[i], sums[i], roughness[i], mark_bank[i, m], mark_rows[i, m], mark_sums[i, m]
        )
        _gather(part_sums, ends[0], 2 + lever.size + inputs)
        level = noise_known[i, :-1].copy()
        _, _, _, _, _, window, window_v, _, _, _ = _block_step(
            omega, lever, by_accelerometer, exponents, settings, longitudinal, roll, part, ends, part_sums,
            mean.copy(), level, noise_known[i], part_roughness, nothing, nothing, nothing[0], nothing[0], mean, size, 1,
        )  # fmt: skip
        weight, pull = change_of(window, window_v, mean, spread)
        value = changed_derivatives(weight, pull, size, CHANGE_LOG_THRESHOLD, 0.0, trial)
        if trial.any() and value > best:
            best, cut = value, m
            changed[:] = trial
    if cut == -2:
        return False
    if cut >= 0:
        _cut(i, common, arrays, marks, cut, inputs)
    free_memory(sensitivity[i], information[i], vector[i], driven[i], size, changed)
    for a in range(k):
        if changed[a]:
            changed_s[i, a] = rows[i, 1, 0]
    # All that is left is as good as new: nothing of it waits to be replaced.
    reserve[i] = 0.0
    return True


@njit(cache=True)
def _cut(i, common, arrays, marks, m, inputs):  # type: ignore[no-untyped-def]
    """End the running block of vehicle i at mark m; what came after it is the running block."""
    bank, rows, sums, roughness = arrays[:4]
    mark_bank, mark_rows, mark_sums, _ = marks
    part, ends, part_sums, part_roughness = since_mark(
        common[0], bank[i], rows[i], sums[i], roughness[i], mark_bank[i, m], mark_rows[i, m], mark_sums[i, m]
    )
    _gather(part_sums, ends[0], 2 + common[1].size + inputs)
    if mark_rows[i, m, 0] - rows[i, 0, 0] >= common[4][1]:
        bank[i] = mark_bank[i, m]
        rows[i, 1] = mark_rows[i, m]
        sums[i] = mark_sums[i, m, : sums.shape[1]]
        roughness[i] = mark_sums[i, m, sums.shape[1] :]
        _close(i, common, arrays)
    bank[i], rows[i], sums[i], roughness[i] = part, ends, part_sums, part_roughness
    mark_rows[i] = np.nan
