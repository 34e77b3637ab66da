"""How much of an aircraft's motion gusts cause, as the Kalman filter has it; compiled."""

import numpy as np

from wingwatch.estimators.ekf.model import gust_decay, transition
from wingwatch.estimators.ekf.noise import process_noise
from wingwatch.estimators.ekf.sample import Step
from wingwatch.estimators.ekf.state import ESTIMATED, PATH
from wingwatch.kernels.decorators import helper, whole

__all__ = ["gust_variance"]

STEP_S = 0.02
DOUBLINGS = 9
"""Gusts are followed over 2^9 steps of 20 ms, about the length of a block."""


@whole
def gust_variance(model, z, noise, condition, ratios, direction, places, out):  # type: ignore[no-untyped-def]
    """Variance of the states that gusts alone cause within ten seconds, vehicles ``places`` (m,), into ``out`` (m, ns).

    The covariance of x' = F x + noise after 2^n steps, by doubling: P = P + F P F', F = F F. ``z, noise, condition,
    ratios, direction`` of ``EkfState``; NaN where there is no condition yet.
    """
    ns, nu, nx = model.sizes.states, model.sizes.inputs, model.sizes.dynamic
    still, forward, scale, rest = np.zeros(nu), np.zeros(ns), np.empty(ns * (ns + nu)), np.zeros(ns)
    advance, caused, half, product = (
        np.empty((nx, nx)),
        np.empty((nx, nx)),
        np.empty((nx, nx)),
        np.empty((nx, nx)),
    )
    for m in range(places.size):
        i = places[m]
        airspeed, density, alpha = condition[i, 1], condition[i, 2], condition[i, 4]
        out[m] = np.nan
        if not np.isfinite(airspeed):
            continue
        if not np.isfinite(alpha):
            alpha = 0.0
        by_velocity = density * airspeed / (model.reference_airspeed_m_s * model.reference_density_kg_m3)
        for k in range(ns):
            for c in range(ns + nu):
                by_angle = by_velocity * airspeed / model.reference_airspeed_m_s
                scale[k * (ns + nu) + c] = by_velocity if c < ns else by_angle
        forward[ns - 1] = airspeed * np.cos(alpha) * (1.0 if model.longitudinal else -1.0)
        if model.roll:
            forward[1] = airspeed * np.sin(alpha)
        speed = max(airspeed, 1.0)
        decay = np.empty(model.sizes.gusts)
        if decay.size > 0:
            gust_decay(model, STEP_S, speed, decay)
        step = Step(
            STEP_S, 0.0, speed, False, ratios[i] == ESTIMATED, direction[i], still, still, still, still, still,
            scale, forward, rest, decay,
        )  # fmt: skip
        jacobian = transition(model, z[i], step).jacobian
        caused[:] = process_noise(model, noise, i, jacobian, step)
        advance[:] = jacobian[:, :nx]
        advance[:ns, ns + PATH : ns + PATH + ns] = 0.0  # an error of the path is no motion
        for _ in range(DOUBLINGS):
            _times(advance, caused, half)
            _times_transposed(half, advance, product)
            caused += product
            _times(advance, advance, half)
            advance[:] = half
        for k in range(ns):
            out[m, k] = caused[k, k]


@helper
def _times(one, other, out):  # type: ignore[no-untyped-def]
    for a in range(out.shape[0]):
        for b in range(out.shape[1]):
            total = 0.0
            for c in range(other.shape[0]):
                total += one[a, c] * other[c, b]
            out[a, b] = total


@helper
def _times_transposed(one, other, out):  # type: ignore[no-untyped-def]
    for a in range(out.shape[0]):
        for b in range(out.shape[1]):
            total = 0.0
            for c in range(other.shape[1]):
                total += one[a, c] * other[b, c]
            out[a, b] = total
