"""Where a surface is between two samples, when its servo follows commands that are held from sample to sample.

Estimators let a position move on a line between samples. A first-order servo of bandwidth b with the command c from
sample k on moves as x = c + (x_k - c) exp(-b t): most of the way is made early in the step, and its mean is

    x_k + s (x_(k+1) - x_k),   s = 1 / (1 - exp(-b dt)) - 1 / (b dt),

where the line has s = 1/2. So the surface is (s - 1/2) dt ahead of the line: 1.6 ms for 8 Hz at 50 Hz, which makes roll
damping at 20 1/s three per cent too large. Samples that fall anywhere in the commands' frame have no such lead on
average; therefore it is taken only where the record shows that the commands are held from its samples on.
"""

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.kernels.intersample import course, frames_of

__all__ = ["ahead", "lead_steps", "moved", "follows_command"]

Array = NDArray[np.float64]

_EARLY = 0.1
"""Share of a step by which commands may act before or after their samples and still count as held from them on."""

_SURE = 3.0
"""Standard errors of that share that must lie within ``_EARLY`` of it."""

_FEWEST = 50
"""Samples from which on that is judged."""


def lead_steps(bandwidth_rad_s: float, dt: float) -> float:
    """s - 1/2: how far the servo's mean is ahead of the line's, in steps; between 0 (slow servo) and 1/2 (at once).

    Of a step that holds several commands (``intersample``), for a surface that goes on as it did.
    """
    held = course(dt, 1.0 / bandwidth_rad_s, False)
    return float(held.mean + held.mean_before) - 0.5


def follows_command(position: Array, command: Array, time_s: Array, bandwidth_rad_s: float) -> bool:
    """Whether a record of positions is that of a servo whose commands are held from each sample to the next.

    With e = exp(-b dt), x_(k+1) - e x_k = (1 - e) (c_k + f (c_(k+1) - c_k) - g (c_k - c_(k-1))), where f and g are 0 if
    commands change with the samples; f grows as they change before theirs, g as they change after. Both are fitted.

    Args:
        position, command: rad, (n,).
        time_s: (n,), increasing.
        bandwidth_rad_s: of the servo.
    """
    if time_s.size < _FEWEST:
        return False
    dt = float(np.median(np.diff(time_s)))
    stays = math.exp(-bandwidth_rad_s * dt)
    left = (position[1:] - stays * position[:-1])[1:] - (1.0 - stays) * command[1:-1]
    change = (1.0 - stays) * np.diff(command)
    regressors = np.column_stack([np.ones(left.size), change[1:], -change[:-1]])
    even = np.abs(np.diff(time_s) - dt) < 0.01 * dt
    fair = np.isfinite(left) & np.isfinite(regressors).all(axis=1) & even[1:] & even[:-1]
    regressors, left = regressors[fair], left[fair]
    power = regressors.T @ regressors
    if np.count_nonzero(fair) < _FEWEST or np.linalg.matrix_rank(power) < regressors.shape[1]:
        return False
    share = np.linalg.solve(power, regressors.T @ left)
    error = np.sqrt(np.mean((left - regressors @ share) ** 2) * np.diagonal(np.linalg.inv(power)))
    return bool((np.abs(share) + _SURE * error)[1:].max() < _EARLY)


def moved(command: Array, time_s: Array, bandwidth_rad_s: float, max_gap_s: float) -> Array:
    """Where a servo has a surface that is known by its command alone, each command held until the next.

    Between samples that hold several commands they go evenly from one that is known to the next.

    After a missing command or a step longer than ``max_gap_s`` the surface is where its command is.

    Args:
        command: rad, (n,).
        time_s: (n,), increasing.
        bandwidth_rad_s: of the servo.
    """
    position = command.copy()
    for k, step_s in enumerate(np.diff(time_s)):
        if not 0.0 < step_s <= max_gap_s or not np.isfinite(command[k : k + 2]).all():
            continue
        frames = frames_of(step_s)
        stays, at = math.exp(-bandwidth_rad_s * step_s / frames), position[k]
        for commanded in command[k] + np.arange(frames) / frames * (command[k + 1] - command[k]):
            at = commanded + stays * (at - commanded)
        position[k + 1] = at
    return position


def ahead(position: Array, time_s: Array, bandwidth_rad_s: float) -> Array:
    """Positions (n,), rad, whose line has the servo's mean over every step but for second order: x + (s - 1/2) dt x'.

    ``position`` in rad and ``time_s``: (n,).
    """
    dt = float(np.median(np.diff(time_s)))
    slope = np.gradient(position, time_s)
    return np.asarray(position + lead_steps(bandwidth_rad_s, dt) * dt * slope)
