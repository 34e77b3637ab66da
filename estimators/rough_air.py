"""How much of an aircraft's motion the air itself causes, as the Kalman filter has it; compiled.

Air that turns and rolls an aircraft acts within the same block as the aircraft's answer to it, and the autopilot's. A
transform of the block knows no before and after: of the rate's variance the share that the air causes is, to first
order, the share by which the Fourier form's damping, and with it the other moment derivatives, come out too small.
"""

import numpy as np
from numba import njit

from wingwatch.estimators.ekf_model import transition
from wingwatch.estimators.ekf_noise import process_noise

__all__ = ["ROUGH_SHARE", "gather_motion", "unrest_variance"]

ROUGH_SHARE = 0.1
"""Share of a rate's variance from which on the air is rough: the Fourier form's moment derivatives are off as much."""

STEP_S = 0.02
DOUBLINGS = 9
"""Unrest is followed over 2^9 steps of 20 ms, about the length of a block."""


@njit(cache=True)
def gather_motion(motion, signals, memory_s):  # type: ignore[no-untyped-def]
    """Running mean and mean square of the measured states of one vehicle, sample by sample, in place.

    Args:
        motion: (3, ns): means, mean squares, and the last time in the third row's first place; NaN at the start.
        signals: (samples, columns) from ``Signals``.
        memory_s: time constant.
    """
    ns = motion.shape[1]
    for k in range(signals.shape[0]):
        row = signals[k]
        complete = True
        for j in range(1 + ns):
            complete = complete and np.isfinite(row[j])
        if not complete:
            continue
        weight = 1.0
        if np.isfinite(motion[2, 0]):
            weight = 1.0 - np.exp(-max(row[0] - motion[2, 0], 0.0) / memory_s)
        for j in range(ns):
            before, square = (motion[0, j], motion[1, j]) if weight < 1.0 else (0.0, 0.0)
            motion[0, j] = before + weight * (row[1 + j] - before)
            motion[1, j] = square + weight * (row[1 + j] * row[1 + j] - square)
        motion[2, 0] = row[0]


@njit(cache=True)
def unrest_variance(  # type: ignore[no-untyped-def]
    z, noise, scale, forward, gust_m, direction, speed, longitudinal, ns, nu
):
    """Variance of the states that the air's unrest alone causes within ten seconds, (ns,).

    The covariance of x' = F x + noise after 2^n steps, by doubling: P = P + F P F', F = F F.
    """
    gusts = gust_m.size
    nx = ns + gusts
    decay = np.exp(-STEP_S * max(speed, 1.0) / gust_m)
    _, jacobian = transition(
        z, STEP_S, scale, forward, np.zeros(nu), np.zeros(nu), 0.0, np.zeros(ns), decay, direction, False, ns, nu, gusts
    )  # fmt: skip
    step = np.ascontiguousarray(jacobian[:, :nx])
    caused = process_noise(noise, jacobian, STEP_S, max(speed, 1.0), decay, longitudinal, ns, gusts)
    for _ in range(DOUBLINGS):
        caused = caused + step @ caused @ np.ascontiguousarray(step.T)
        step = step @ step
    return np.diag(caused)[:ns].copy()
