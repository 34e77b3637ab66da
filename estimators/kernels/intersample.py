"""What an input does between two readings, angles in rad; compiled. Derivation: ``docs/methods/kalman_filter.md``
section 5, (12) to (12c)."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import hot, lean

__all__ = [
    "Course",
    "Servos",
    "SurfaceMeans",
    "course",
    "frames_of",
    "means_of_rows",
    "servos_of",
    "surface_means",
]

FRAME_HZ = 50.0
"""Autopilots give their commands at least as often: a longer step holds several, which nobody recorded."""

SERVO_ERROR = 0.1
"""Of its motion a servo may be elsewhere than its command and time constant say, and still be known by them."""

SURE = 3.0
"""Standard errors of its reading that a surface may be elsewhere besides."""


class Servos(NamedTuple):
    """What moves the inputs, each at most by its rate.

    Attributes:
        time_s: (inputs,) time constants; infinite where unknown, 0 for a command.
        rate_rad_s: (inputs,) what the surface moves by at most, rad/s; infinite where unknown.
    """

    time_s: NDArray[np.float64]
    rate_rad_s: NDArray[np.float64]


class Course(NamedTuple):
    """How an input u goes from one reading to the next, by its change over this step and over the one before.

    Attributes:
        mean, mean_before: of the mean of u - u_old over the step, its parts by the two changes.
        early, early_before: the same of the mean of (1/2 - t/dt) (u - u_old).
        left: variance of the mean that the changes leave, by that of each command between the readings; 0 where there
            is none.
        own2, both, before2: inverse of the two changes' covariance, by the same; 0 likewise.
    """

    mean: float
    mean_before: float
    early: float
    early_before: float
    left: float
    own2: float
    both: float
    before2: float


class SurfaceMeans(NamedTuple):
    """Where a surface u was over a step.

    Attributes:
        mean: of u - u_old; early: of (1/2 - t/dt) (u - u_old).
        newest: of the newer reading in the mean.
        variance: of the mean, by commands that nobody recorded.
    """

    mean: float
    early: float
    newest: float
    variance: float


def servos_of(servo_s: Sequence[float], rate_rad_s: Sequence[float], held: Sequence[bool]) -> Servos:
    """``Servos`` of a configuration: 0, and nothing, where one is not known.

    Args:
        servo_s, rate_rad_s: of each input, or empty; s, rad/s.
        held: whether each is held between samples.
    """
    moved = ~np.array(held, dtype=np.bool_)
    time_s, rate = (
        np.array(given or (0.0,) * moved.size, dtype=np.float64) for given in (servo_s, rate_rad_s)
    )
    known = moved & (time_s > 0.0)
    return Servos(
        np.where(known, time_s, np.where(moved, np.inf, 0.0)), np.where(known & (rate > 0.0), rate, np.inf)
    )


@hot
def frames_of(dt):  # type: ignore[no-untyped-def]
    """Number of commands that an autopilot gives in a step of ``dt`` s, a scalar of at least one."""
    return max(1, round(dt * FRAME_HZ))


@hot
def means_of_rows(new, old, older, j, first_input, servos, reading_variance):  # type: ignore[no-untyped-def]
    """``SurfaceMeans`` of input j over the step between the last two of three rows of ``Signals``.

    Args:
        new, old, older: (columns,), the newest first.
        first_input: column of the first input.
        servos: ``Servos``; reading_variance: (inputs,), rad2.
    """
    c, ahead, dt = first_input + j, new.size - servos.time_s.size + j, new[0] - old[0]
    servo_s, rate_rad_s, change = servos.time_s[j], servos.rate_rad_s[j], new[c] - old[c]
    # Most steps are far from the limit, and need no exponential to know it.
    near = frames_of(dt) == 1 and abs(change) > 0.5 * rate_rad_s * min(servo_s, dt)
    if near and abs(change) > rate_rad_s * servo_s * (1.0 - math.exp(-dt / servo_s)):
        return _limited_means(dt, servo_s, rate_rad_s, change)
    before = old[c] - older[c]
    if before != 0.0 and not abs(old[0] - older[0] - dt) < 0.5 * dt:
        before = np.nan
    return surface_means(dt, servo_s, reading_variance[j], before, change, old[ahead], new[ahead])


@lean
def _limited_means(dt, servo_s, rate_rad_s, change):  # type: ignore[no-untyped-def]
    """``SurfaceMeans`` of a servo at its rate limit L, its command further ahead at the step's beginning than L T.

    It goes evenly until the command is L T ahead, T its time constant, and the rest x of the step as the servo does:
    |change| = L (dt - x) + L T (1 - exp(-x/T)), so that x - T (1 - exp(-x/T)) = dt - |change|/L =: m (docs (12a)). As
    in an even motion, half of the newer reading's error is in the mean.
    """
    left = max(dt - abs(change) / rate_rad_s, 0.0)
    x = min(math.sqrt(2.0 * servo_s * left) + left, dt)
    for _ in range(6):
        risen = 1.0 - math.exp(-x / servo_s)
        if risen > 0.0:
            x = max(x - (x - servo_s * risen - left) / risen, 0.0)
    even = dt - x
    rest = 1.0 - math.exp(-x / servo_s)
    # Integrals over the step of u - u_old and of t (u - u_old), over L.
    area = 0.5 * even * even + even * x + servo_s * left
    late = 0.5 * x * x - servo_s * (servo_s * rest - x * (1.0 - rest))
    moment = even**3 / 3.0 + even * (even * x + 0.5 * x * x) + servo_s * (even * left + late)
    of_limit = math.copysign(rate_rad_s / dt, change)
    return SurfaceMeans(of_limit * area, of_limit * (0.5 * area - moment / dt), 0.5, 0.0)


@hot
def surface_means(dt, servo_s, reading_variance, before, change, ahead, ahead_after):  # type: ignore[no-untyped-def]
    """``SurfaceMeans`` of a step of ``dt``, s; all arguments are scalars.

    Args:
        servo_s: of ``course``, s; reading_variance: of u, rad2.
        before, change: of the readings, over the step before (NaN where that was of another length) and this one.
        ahead, ahead_after: how far the command is ahead of the surface at the step's beginning and end, 0 where it is
            not known.
    """
    frames = frames_of(dt)
    if frames > 1 and ahead != 0.0 and ahead_after != 0.0 and 0.0 < servo_s < np.inf:
        followed, means = _commanded_means(
            frames, servo_s / dt, reading_variance, change, ahead, change + ahead_after - ahead
        )
        if followed:
            return means
    by = course(dt, servo_s, before == 0.0)
    last = before if np.isfinite(before) else 0.0
    squares = by.own2 * change * change + 2.0 * by.both * change * last + by.before2 * last * last
    return SurfaceMeans(
        by.mean * change + by.mean_before * last,
        by.early * change + by.early_before * last,
        by.mean,
        0.5 * by.left * squares,
    )


@hot
def _commanded_means(frames, lag, reading_variance, change, ahead, command_change):  # type: ignore[no-untyped-def]
    """``SurfaceMeans`` of a servo whose commands at both ends of a step were recorded.

    The first command acts from the beginning. At each later frame, and at the end, it changes by what nobody recorded:
    together by ``command_change``, and so that the surface ends where it is read. Of all such changes those with the
    least sum of squares are a random walk's likeliest. Half of that, for two conditions, is an estimate of their
    variance.

    Returns:
        whether the surface follows its command: it moves where it is behind, and the changes are no larger than the
        command's, but for what readings and servo err; the means.
    """
    first, first_mean, first_early = _step_response(1.0, lag)
    own = change - first * ahead
    rr = r1 = mean_r = mean_1 = mean_2 = early_r = early_1 = 0.0
    for i in range(1, frames):
        risen, mean, early = _step_response(1.0 - i / frames, lag)
        rr += risen * risen
        r1 += risen
        mean_r += mean * risen
        mean_1 += mean
        mean_2 += mean * mean
        early_r += early * risen
        early_1 += early
    over = 1.0 / (frames * rr - r1 * r1)
    by_own, by_command = (frames * own - r1 * command_change) * over, (rr * command_change - r1 * own) * over
    squares = by_own * own + by_command * command_change
    newest, of_command = (frames * mean_r - r1 * mean_1) * over, (rr * mean_1 - r1 * mean_r) * over
    left = max(0.0, mean_2 - newest * mean_r - of_command * mean_1)
    error = SERVO_ERROR * max(abs(ahead), abs(change))
    noise = SURE * SURE * frames * over * reading_variance * (1.0 + (1.0 - first) ** 2)
    likely = squares <= command_change * command_change + error * error + noise
    return (
        likely and abs(change) > SERVO_ERROR * abs(ahead),
        SurfaceMeans(
            first_mean * ahead + by_own * mean_r + by_command * mean_1,
            first_early * ahead + by_own * early_r + by_command * early_1,
            newest,
            0.5 * left * squares,
        ),
    )


@hot
def course(dt, servo_s, at_rest):  # type: ignore[no-untyped-def]
    """``Course`` of a step of ``dt``, s, of scalars.

    ``servo_s``: time constant of a servo, which follows commands; infinite for one that is not known: u goes evenly,
    but for one that was at rest and has left it; 0 for a command, held to the step's end.
    """
    if servo_s == 0.0:
        return Course(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if dt < 1e-3 * servo_s:
        if at_rest:
            return Course(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return Course(0.5 + dt / (12.0 * servo_s), 0.0, -1.0 / 12.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    frames, lag = frames_of(dt), servo_s / dt
    if frames > 1:
        return _expected_course(frames, lag)
    whole, mean, early = _step_response(1.0, lag)
    return Course(mean / whole, 0.0, early / whole, 0.0, 0.0, 0.0, 0.0, 0.0)


@hot
def _step_response(left, lag):  # type: ignore[no-untyped-def]
    """A servo behind a command that steps by one when a part ``left`` of the step is left, ``lag`` its time constant in
    steps: where it ends, and its two means."""
    risen = 1.0 - np.exp(-left / lag)
    area = left - lag * risen
    moment = 0.5 * left * left + lag * left * (1.0 - risen) - lag * lag * risen
    return risen, area, (left - 0.5) * area - moment


@hot
def _expected_course(frames, lag):  # type: ignore[no-untyped-def]
    """``course`` of a servo whose commands are a random walk with a step at the beginning of each of some frames:
    regression on the changes of this step and of the one before.

    What the servo was behind at the beginning, and every step of the command, is one independent source. In the step
    before, a source moves the servo by its ``risen``; what is left of it moves the servo now.
    """
    first, first_mean, first_early = _step_response(1.0, lag)
    keep = np.exp(-2.0 / (frames * lag))
    behind = keep / (1.0 - keep)
    before2 = both = own2 = mean2 = mean_before = mean_own = early_before = early_own = 0.0
    for i in range(frames):
        risen, mean, early = _step_response(1.0 - i / frames, lag)
        variance, rest = 1.0 + (behind if i == 0 else 0.0), 1.0 - risen
        before2 += variance * risen * risen
        both += variance * risen * rest * first
        own2 += variance * rest * rest * first * first + risen * risen
        mean2 += variance * rest * rest * first_mean * first_mean + mean * mean
        mean_before += variance * risen * rest * first_mean
        mean_own += variance * rest * rest * first * first_mean + risen * mean
        early_before += variance * risen * rest * first_early
        early_own += variance * rest * rest * first * first_early + risen * early
    over = 1.0 / (before2 * own2 - both * both)
    by_own, by_before = (
        (mean_own * before2 - mean_before * both) * over,
        (mean_before * own2 - mean_own * both) * over,
    )
    return Course(
        by_own,
        by_before,
        (early_own * before2 - early_before * both) * over,
        (early_before * own2 - early_own * both) * over,
        max(0.0, mean2 - by_own * mean_own - by_before * mean_before),
        before2 * over,
        -both * over,
        own2 * over,
    )
