"""What an input does between two readings; compiled."""

import numpy as np

from wingwatch.estimators.kernels.hot import hot

__all__ = ["course", "frames_of"]


FRAME_HZ = 50.0
"""Autopilots give their commands at least as often: a longer step holds several, which nobody recorded."""


@hot
def frames_of(dt):  # type: ignore[no-untyped-def]
    """How many commands an autopilot gives in a step."""
    return max(1, round(dt * FRAME_HZ))


@hot
def course(dt, servo_s, at_rest):  # type: ignore[no-untyped-def]
    """How an input u goes from one reading to the next, by the readings at both and the one before.

    ``servo_s``: time constant of a servo, which follows commands; infinite for one that is not known: u goes evenly,
    but for one that was at rest and has left it; 0 for a command, held to the step's end.

    Returns:
        of the mean of u - u_old over the step, its parts by the step's own change and by the change of the step before;
        the same of the mean of (1/2 - t/dt) (u - u_old).
    """
    if servo_s == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if dt < 1e-3 * servo_s:
        return (0.0, 0.0, 0.0, 0.0) if at_rest else (0.5 + dt / (12.0 * servo_s), 0.0, -1.0 / 12.0, 0.0)
    frames, lag = frames_of(dt), servo_s / dt
    whole, mean, early = _step_response(1.0, lag)
    if frames == 1:
        return mean / whole, 0.0, early / whole, 0.0
    return _expected_course(frames, lag)


@hot
def _step_response(left, lag):  # type: ignore[no-untyped-def]
    """A servo behind a command that steps by one when a part ``left`` of the step is left, ``lag`` its time constant in
    steps: where it ends, and the two means of ``course``."""
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
    before2 = both = own2 = mean_before = mean_own = early_before = early_own = 0.0
    for i in range(frames):
        risen, mean, early = _step_response(1.0 - i / frames, lag)
        variance, rest = 1.0 + (behind if i == 0 else 0.0), 1.0 - risen
        before2 += variance * risen * risen
        both += variance * risen * rest * first
        own2 += variance * rest * rest * first * first + risen * risen
        mean_before += variance * risen * rest * first_mean
        mean_own += variance * rest * rest * first * first_mean + risen * mean
        early_before += variance * risen * rest * first_early
        early_own += variance * rest * rest * first * first_early + risen * early
    over = 1.0 / (before2 * own2 - both * both)
    return (
        (mean_own * before2 - mean_before * both) * over,
        (mean_before * own2 - mean_own * both) * over,
        (early_own * before2 - early_before * both) * over,
        (early_before * own2 - early_own * both) * over,
    )
