"""The motion of the air in the recursive Fourier estimator: its turning, measured by vane and accelerometer; compiled.

Derivation and symbols: ``docs/estimators.md`` section 7. Arrays are those of one vehicle, all room is the caller's.
"""

import math

from wingwatch.estimators.fourier_bank import NUISANCE, advance_linear
from wingwatch.estimators.hot import lean

__all__ = [
    "AIR_COLUMNS",
    "AIR_LEVELS",
    "advance_air",
    "air_channels",
    "air_of",
    "air_regressors",
    "heard_turning",
    "rebase_products",
    "start_air_noise",
    "turning_channel",
    "turning_level",
]

AIR_LEVELS = 3
"""Noise levels of the air: rate of the gust that the vane sees, m/s2; unsmoothed roll rate of the air, rad/s; what
turns the air in pitch beside that gust, as a rate of it, m/s2."""

AIR_COLUMNS = 2
"""Columns of the noise transfer that the air has: rolling, and the turning that is not believed or not seen."""

STEPS = 6
"""Of the fixed point of a gust's level, a solution."""


@lean
def turning_channel(ns, nu):  # type: ignore[no-untyped-def]
    """Of a block's transforms. Products follow it."""
    return ns + 2 * nu + 1 + NUISANCE


@lean
def _first_channel(ns, nu):  # type: ignore[no-untyped-def]
    """Of the bank, which has of the nuisance columns the dynamic pressure alone: the turning. Products follow it."""
    return ns + 2 * nu + 2


@lean
def air_channels(ns, nu):  # type: ignore[no-untyped-def]
    """Channels that this module adds to the bank: the air's turning, and products of all that acts."""
    return 1 + ns + nu


@lean
def start_air_noise(noise):  # type: ignore[no-untyped-def]
    """First levels, the last ones of all noise levels."""
    n = noise.size
    noise[n - 3], noise[n - 2], noise[n - 1] = 1.0, 1e-4, 1.0


@lean
def _growth(row, start, exponent, kinematic):  # type: ignore[no-untyped-def]
    """How much what acts has grown since the block began: rho V for states, rho V^2 for inputs (table B.3), less 1."""
    speed = row[kinematic + 2] / max(start[kinematic + 2], 1.0)
    pressure = row[kinematic + 3] / start[kinematic + 3] * speed
    return (pressure if exponent == 1.0 else pressure * speed) - 1.0


@lean
def advance_air(bank, coefficients, turning, start, old, new, exponents, gust_m, lever, longitudinal):  # type: ignore[no-untyped-def]
    """One sample on: the rate at which the air turns, and products of all that acts with its growth.

    The gust's rate is what the vane sees change less what the inertial motion changes, dw/dt - a_z - k. The rate
    relative to the air is q - (dw/dt - a_z - k) / V or r + (dv/dt - a_y - k) / V, smoothed over the span
    (MIL-F-8785C 3.7.5); what is added to the rate is what is kept. Without a vane it fades to nothing. What acts
    changes with the airspeed within a block: states and inputs times ``_growth`` are nothing in steady flight.

    Args:
        bank: (channels, 2, frequencies), some of them advanced.
        coefficients: (8, frequencies) of the step, as ``advance_bank`` has left them.
        turning: (1,) rad/s, in place.
        start, old, new: signal rows at the block's start and the two ends of the step.
        gust_m: lengths of smoothing, (2,): roll, and pitch or yaw; 0 where the air is not known to turn.
        lever: of the accelerometer, (ns,), m.
    """
    if gust_m[1] <= 0.0:
        return
    ns, nu = lever.size, exponents.size - lever.size
    kinematic = 2 + ns + nu
    dt = new[0] - old[0]
    speed = max(0.5 * (old[kinematic + 2] + new[kinematic + 2]), 1.0)
    keep = math.exp(-dt * speed / gust_m[1])
    before = turning[0]
    turning[0] *= keep
    if old[kinematic + 6] == 1.0 and new[kinematic + 6] == 1.0:
        change = new[1] - old[1]
        change -= 0.5 * dt * (old[1 + ns] + new[1 + ns] + old[kinematic] + new[kinematic])
        for j in range(1, ns):
            change -= lever[j] * (new[1 + j] - old[1 + j])
        turning[0] += (1.0 - keep) * (-change if longitudinal else change) / (dt * speed)
    row = bank[_first_channel(ns, nu)]
    advance_linear(row[0], row[1], coefficients, before, turning[0])
    for c in range(ns + nu):
        column = 1 + c if c < ns else 2 + c
        row = bank[_first_channel(ns, nu) + 1 + c]
        advance_linear(
            row[0],
            row[1],
            coefficients,
            old[column] * _growth(old, start, exponents[c], kinematic),
            new[column] * _growth(new, start, exponents[c], kinematic),
        )


@lean
def rebase_products(bank, old_start, new_start, exponents, ns):  # type: ignore[no-untyped-def]
    """The products' growth counted from another start: 1 + growth is a ratio to the start's rho V or rho V^2.

    Args:
        bank: (channels, 2, frequencies) of what came since the new start, with products that count from the old one;
            the products in place.
    """
    nd = exponents.size
    kinematic = 2 + nd
    for c in range(nd):
        ratio = 1.0 + _growth(old_start, new_start, exponents[c], kinematic)
        plain, row = bank[c if c < ns else c + 1], bank[_first_channel(ns, nd - ns) + 1 + c]
        for part in range(2):
            for f in range(row.shape[1]):
                row[part, f] = ratio * row[part, f] + (ratio - 1.0) * plain[part, f]


@lean
def air_of(gust_m, airspeed, longitudinal, air):  # type: ignore[no-untyped-def]
    """What the air's motion depends on, into ``air`` (3,): rate of turning over the gust's rate (1/V with its sign),
    1/(m/s), and the time constants of turning and of rolling in s; zeros where the air is not known to turn."""
    air[:] = 0.0
    if gust_m[1] > 0.0:
        speed = max(airspeed, 1.0)
        air[0] = (-1.0 if longitudinal else 1.0) / speed
        air[1], air[2] = gust_m[1] / speed, gust_m[0] / speed


@lean
def _deaf(square, noise, forward_speed, lever, ns):  # type: ignore[no-untyped-def]
    """Variance of the sensors' noise in the measured rate of a gust, at omega^2."""
    total = square * noise[0] + noise[ns]
    for j in range(1, ns):
        total += (forward_speed[j] * forward_speed[j] + square * lever[j] * lever[j]) * noise[j]
    return total


@lean
def heard_turning(omega, noise, level, air, forward_speed, lever, ns, heard):  # type: ignore[no-untyped-def]
    """How the sensors' noise enters the rate relative to the air at one frequency.

    Of the measured turning the share H = level / (level + noise) is believed (Wiener's filter); what remains of the
    gust has variance (1 - H) level.

    Args:
        heard: (ns + 1,) complex, filled with the coefficients of the states' and of the accelerometer's noise.

    Returns:
        H, and how the rate relative to the air answers to the gust's rate.
    """
    s = 1j * omega
    heard[:] = 0.0
    heard[ns - 1] = 1.0
    answer = air[0] / (1.0 + s * air[1])
    share = level / (level + _deaf(omega * omega, noise, forward_speed, lever, ns))
    heard[0] += share * answer * s
    heard[ns] -= share * answer
    for j in range(1, ns):
        heard[j] -= share * answer * (forward_speed[j] + lever[j] * s)
    return share, answer


@lean
def turning_level(omega, bank, noise, power, air, forward_speed, lever, ns, nu):  # type: ignore[no-untyped-def]
    """Variance of the gust's rate, white, that fits the measured one: a few steps of the fixed point."""
    turning = bank[turning_channel(ns, nu)]
    level = noise[noise.size - AIR_LEVELS]
    lag, gain = air[1], 1.0 / (air[0] * air[0])
    for _ in range(STEPS):
        total, determined = 0.0, 0.0
        for f in range(omega.size):
            square = omega[f] * omega[f]
            share = level / (level + _deaf(square, noise, forward_speed, lever, ns))
            found = turning[0, f] * turning[0, f] + turning[1, f] * turning[1, f]
            total += found * (1.0 + square * lag * lag) * gain * share * share / power
            determined += share
        if determined <= 1e-12:
            return level
        level = min(max(total / determined, 0.1 * level), 10.0 * level)
    return level


@lean
def air_regressors(omega, bank, start, sums, exponents, noise, air, forward_speed, lever):  # type: ignore[no-untyped-def]
    """What acts, in place of states and inputs: grown with the airspeed, and the rate relative to the air.

    Args:
        bank: (channels, 2, frequencies) as ``between_samples`` gives it; in place.
        start: signal row at the block's start; sums: of the flight condition over the block.
    """
    ns, nd = lever.size, exponents.size
    kinematic, turning = 2 + nd, turning_channel(ns, nd - ns)
    ratio = max(start[kinematic + 2], 1.0) * sums[4] / sums[0]
    for c in range(nd):
        norm = start[kinematic + 3] * sums[4] / sums[1] * ratio * (1.0 if exponents[c] == 1.0 else ratio)
        row, product = bank[c if c < ns else c + 1], bank[turning + 1 + c]
        for part in range(2):
            for f in range(omega.size):
                row[part, f] = norm * (row[part, f] + product[part, f])
    level = noise[noise.size - AIR_LEVELS]
    for f in range(omega.size):
        share = level / (level + _deaf(omega[f] * omega[f], noise, forward_speed, lever, ns))
        bank[ns - 1, 0, f] += share * bank[turning, 0, f]
        bank[ns - 1, 1, f] += share * bank[turning, 1, f]
