"""How much of an aircraft's motion the air itself causes, as the Kalman filter has it; compiled."""

import numpy as np
from numba import njit

from wingwatch.estimators.ekf.model import transition
from wingwatch.estimators.ekf.noise import process_noise

__all__ = ["unrest_variance"]

STEP_S = 0.02
DOUBLINGS = 9
"""Unrest is followed over 2^9 steps of 20 ms, about the length of a block."""


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
