"""How much of an aircraft's motion gusts cause, as the Kalman filter has it; compiled."""

import numpy as np
from numba import njit

from wingwatch.estimators.ekf.model import transition
from wingwatch.estimators.ekf.noise import process_noise
from wingwatch.estimators.ekf.state import Step

__all__ = ["gust_variance"]

STEP_S = 0.02
DOUBLINGS = 9
"""Gusts are followed over 2^9 steps of 20 ms, about the length of a block."""


@njit(cache=True)
def gust_variance(model, z, noise, i, scale, forward, airspeed_m_s):  # type: ignore[no-untyped-def]
    """Variance of the states that gusts alone cause within ten seconds, (ns,).

    The covariance of x' = F x + noise after 2^n steps, by doubling: P = P + F P F', F = F F. ``z, noise, i`` of one
    vehicle; ``scale`` and ``forward`` of its ``Step``.
    """
    ns, nu, nx = model.sizes.states, model.sizes.inputs, model.sizes.dynamic
    speed, still = max(airspeed_m_s, 1.0), np.zeros(nu)
    decay = np.exp(-STEP_S * speed / model.gust_length_m)
    step = Step(
        STEP_S, 0.0, speed, False, still, still, still, still, scale, forward, np.zeros(ns), decay
    )  # fmt: skip
    jacobian = transition(model, z, step).jacobian
    advance = np.ascontiguousarray(jacobian[:, :nx])
    caused = process_noise(model, noise, i, jacobian, step)
    for _ in range(DOUBLINGS):
        caused = caused + advance @ caused @ np.ascontiguousarray(advance.T)
        advance = advance @ advance
    return np.diag(caused)[:ns].copy()
