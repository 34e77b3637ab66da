"""The thesis's plants in turbulence, and with a surface that loses effect in flight."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from wingwatch.simulation import linear_response, state_rates
from wingwatch.studies.thesis.printed import Plant
from wingwatch.studies.thesis.records import RATE_HZ, Flown

__all__ = ["gusty", "losing_effect"]

Array = NDArray[np.float64]

_FINE = 8
"""Steps of the plant to a sample."""
_GUST_M_S, _GUST_LENGTH_M = 1.5, 533.0
"""Light turbulence of MIL-F-8785C above 600 m: 5 ft/s, and 1750 ft."""


def gusty(plant: Plant, surface: Array, seed: int) -> Flown:
    """The plant in gusts across its path, as vane, gyro and accelerometer have it without noise of their own.

    With the air moving at w_g the aerodynamics feels w - w_g, which is what a vane at the centre of gravity reads;
    the velocity itself follows from all forces. Gusts are those of a first-order spectrum; they turn nothing.
    """
    n = surface.size * _FINE
    dt = 1.0 / (RATE_HZ * _FINE)
    rng = np.random.default_rng([seed, 1])
    keep = math.exp(-plant.condition.airspeed_true_m_s * dt / _GUST_LENGTH_M)
    drawn = _GUST_M_S * rng.standard_normal(n)
    gust = np.empty(n)
    gust[0] = drawn[0]
    for k in range(1, n):
        gust[k] = keep * gust[k - 1] + math.sqrt(1.0 - keep**2) * drawn[k]
    u = np.repeat(surface, _FINE)
    a, b = _matrices(plant)
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[:2, 2], whole[:2, 3] = a * dt, b * dt, -a[:, 0] * dt
    grown = expm(whole)[:2]
    states = np.zeros((n, 2))
    for k in range(1, n):
        states[k] = grown @ (states[k - 1, 0], states[k - 1, 1], u[k - 1], gust[k - 1])
    felt = states - np.column_stack([gust, np.zeros(n)])
    force = felt @ a[0] + b[0] * u - plant.turn * states[:, 1]
    return Flown(plant, surface, felt[::_FINE].copy(), force[::_FINE].copy())


def _matrices(plant: Plant) -> tuple[Array, Array]:
    d = np.array(plant.derivatives).reshape(2, 3)
    return d[:, :2], d[:, 2]


def losing_effect(plant: Plant, surface: Array, at_s: float, share: float) -> Flown:
    """The plant whose surface's moment falls by a share at a time."""
    at = round(at_s * RATE_HZ)
    structure, before = plant.structure, plant.by_symbol
    moment = structure.derivatives[5]
    after = before | {moment: before[moment] * (1.0 - share)}
    dt = 1.0 / RATE_HZ
    first = linear_response(structure, before, surface[: at + 1], dt)
    second = linear_response(structure, after, surface[at:], dt, first[-1])
    states = np.concatenate([first[:-1], second])
    rates = state_rates(structure, before, states, surface)
    return Flown(plant, surface, states, rates[:, 0] - plant.turn * states[:, 1])
