"""Dryden turbulence of MIL-F-8785C (sections 3.7.2 and 3.7.3), as exact discrete filters.

The gust field is frozen and crossed at the scenario's airspeed, so every filter is linear with constant coefficients;
over a step its state is x' = Phi x + G n, n white, Phi and G G^T exact (matrix exponential, Van Loan's integral).
The altitude is taken as height above ground, the ground as at sea level. Filters, with T = L / V:

- u_g: first order, T_u;
- v_g, w_g: sigma sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2;
- p_g: first order, time constant 4 b / (pi V), variance sigma_w^2 0.8 pi^2 / (8 b L_w) (pi L_w / (4 b))^(1/3);
- q_g, r_g: the gradient of w_g and v_g along the flight path, smoothed over 4 b / (pi V) and 3 b / (pi V).

Signs of q_g and r_g follow from the frozen field: the air at a place x ahead of the centre of gravity has
w_g + x w_g'/V, the aircraft's own motion there is w - q x, so a gradient acts as a pitch rate of the air -w_g'/V;
likewise +v_g'/V in yaw.
"""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm, solve_continuous_lyapunov

__all__ = ["Turbulence", "TurbulenceFilter", "gust_scales", "step_gust", "turbulence_filter"]

Turbulence = Literal["none", "light", "moderate", "severe"]
LEVELS: tuple[str, ...] = get_args(Turbulence)

_FOOT_M = 0.3048
_KNOT_M_S = 1852.0 / 3600.0
_WIND_AT_20_FT_KNOTS = {"light": 15.0, "moderate": 30.0, "severe": 45.0}
"""Section 3.7.3.4."""

_FIGURE_7_ALTITUDE_FT = (1750.0, 3750.0, 7500.0, 15000.0, 25000.0, 35000.0, 45000.0, 55000.0, 65000.0)
_FIGURE_7_RMS_FT_S = {
    "light": (6.9, 7.4, 6.7, 4.6, 2.7, 0.4, 0.0, 0.0, 0.0),
    "moderate": (9.6, 10.6, 10.1, 8.0, 6.6, 5.0, 4.2, 2.7, 0.0),
    "severe": (17.6, 23.0, 23.6, 22.1, 20.0, 16.0, 15.1, 12.1, 7.9),
}
"""Figure 7 of MIL-F-8785C, read at the probabilities of exceedance 1e-2, 1e-3 and 1e-5 that belong to the three levels
(the values as JSBSim tabulates them)."""

_LOW_FT, _MEDIUM_FT, _MEDIUM_SCALE_FT = 1000.0, 2000.0, 1750.0

STATES = 8
"""u; v (two) and its lag; w (two) and its lag; p."""
_V, _W, _P = slice(1, 4), slice(4, 7), 7


@dataclass(frozen=True, slots=True)
class GustScales:
    """Root mean squares (m/s) and scale lengths (m) along u, v and w."""

    sigma_u_m_s: float
    sigma_w_m_s: float
    length_u_m: float
    length_w_m: float


@dataclass(frozen=True, slots=True)
class TurbulenceFilter:
    """Discrete filter of one vehicle.

    Attributes:
        transition: Phi, shape (8, 8).
        input_gain: G, shape (8, 8); G G^T is the covariance that a step adds.
        output: state to (u, v, w, p, q, r) of the air, shape (6, 8).
        stationary: a square root of the stationary covariance, shape (8, 8).
    """

    transition: NDArray[np.float64]
    input_gain: NDArray[np.float64]
    output: NDArray[np.float64]
    stationary: NDArray[np.float64]


def _low_altitude(level: str, height_ft: float) -> tuple[float, float, float, float]:
    """(sigma_u, sigma_w, L_u, L_w) in ft and ft/s, section 3.7.3.4; below 10 ft as at 10 ft."""
    h = max(height_ft, 10.0)
    sigma_w = 0.1 * _WIND_AT_20_FT_KNOTS[level] * _KNOT_M_S / _FOOT_M
    shape = 0.177 + 0.000823 * h
    return sigma_w / shape**0.4, sigma_w, h / shape**1.2, h


def gust_scales(level: Turbulence, height_m: float) -> GustScales:
    """Intensities and scale lengths at a height above ground.

    Below 1000 ft the low-altitude model, above 2000 ft figure 7 with L = 1750 ft, linear in between.

    Raises:
        ValueError: a level that is not known.
    """
    if level not in LEVELS:
        raise ValueError(f"turbulence is {level!r}; give one of {', '.join(LEVELS)}")
    if level == "none":
        return GustScales(0.0, 0.0, _MEDIUM_SCALE_FT * _FOOT_M, _MEDIUM_SCALE_FT * _FOOT_M)
    h = height_m / _FOOT_M
    low = np.array(_low_altitude(level, min(h, _LOW_FT)))
    sigma = float(np.interp(max(h, _MEDIUM_FT), _FIGURE_7_ALTITUDE_FT, _FIGURE_7_RMS_FT_S[level]))
    high = np.array([sigma, sigma, _MEDIUM_SCALE_FT, _MEDIUM_SCALE_FT])
    share = min(1.0, max(0.0, (h - _LOW_FT) / (_MEDIUM_FT - _LOW_FT)))
    su, sw, lu, lw = ((1.0 - share) * low + share * high) * _FOOT_M
    return GustScales(float(su), float(sw), float(lu), float(lw))


def _transverse(sigma: float, time_s: float, lag_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and B of x1' = x2/T, x2' = (-x1 - 2 x2)/T + n/T, lag' = (gust - lag)/lag_s.

    The gust is sigma sqrt(T) (x1 + sqrt(3) x2).
    """
    c = sigma * math.sqrt(time_s) * np.array([1.0, math.sqrt(3.0)])
    a = np.zeros((3, 3))
    a[0, 1] = 1.0 / time_s
    a[1, :2] = -1.0 / time_s, -2.0 / time_s
    a[2] = *(c / lag_s), -1.0 / lag_s
    return a, np.array([[0.0], [1.0 / time_s], [0.0]])


def turbulence_filter(
    level: Turbulence, height_m: float, airspeed_true_m_s: float, span_m: float, dt_s: float
) -> TurbulenceFilter:
    """The filter for steps of ``dt_s`` at an airspeed, a height above ground and a wing span."""
    g, v = gust_scales(level, height_m), airspeed_true_m_s
    time_u, time_w = g.length_u_m / v, g.length_w_m / v
    lag_p = lag_q = 4.0 * span_m / (math.pi * v)
    lag_r = 3.0 * span_m / (math.pi * v)
    variance_p = g.sigma_w_m_s**2 * 0.8 * math.pi**2 / (8.0 * span_m * g.length_w_m)
    variance_p *= (math.pi * g.length_w_m / (4.0 * span_m)) ** (1.0 / 3.0)
    across, down = _transverse(g.sigma_u_m_s, time_u, lag_r), _transverse(g.sigma_w_m_s, time_w, lag_q)
    drive_u, drive_p = g.sigma_u_m_s * math.sqrt(2.0 / time_u), math.sqrt(2.0 * variance_p / lag_p)
    a = _blocks(np.array([[-1.0 / time_u]]), across[0], down[0], np.array([[-1.0 / lag_p]]))
    b = _blocks(np.array([[drive_u]]), across[1], down[1], np.array([[drive_p]]))
    c = np.zeros((6, STATES))
    c[0, 0] = 1.0
    c[1, _V] = *(across[0][2, :2] * lag_r), 0.0
    c[2, _W] = *(down[0][2, :2] * lag_q), 0.0
    c[3, _P] = 1.0
    c[4, _W] = -down[0][2] / v
    c[5, _V] = across[0][2] / v
    noise = b @ b.T
    grown = np.asarray(expm(dt_s * np.block([[-a, noise], [np.zeros_like(a), a.T]])), dtype=np.float64)
    transition = grown[STATES:, STATES:].T
    added = transition @ grown[:STATES, STATES:]
    return TurbulenceFilter(
        transition, _root(added), c, _root(np.asarray(solve_continuous_lyapunov(a, -noise), dtype=np.float64))
    )


def _blocks(*blocks: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(block_diag(*blocks), dtype=np.float64)


def _root(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetric square root of a covariance that rounding may have left indefinite by its last digits."""
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


@njit(cache=True, error_model="numpy")
def step_gust(transition, input_gain, output, state, normals, after):  # type: ignore[no-untyped-def]
    """One step of the filter: ``state`` (8,) advances, ``after`` (6,) is the air's motion at the end of the step.

    The matrices are block-diagonal (1, 3, 3, 1) and are read as such.
    """
    first = 0
    for size in (1, 3, 3, 1):
        x0 = state[first]
        x1, x2 = (state[first + 1], state[first + 2]) if size == 3 else (0.0, 0.0)
        for i in range(first, first + size):
            total = transition[i, first] * x0 + input_gain[i, first] * normals[first]
            if size == 3:
                total += transition[i, first + 1] * x1 + transition[i, first + 2] * x2
                total += (
                    input_gain[i, first + 1] * normals[first + 1]
                    + input_gain[i, first + 2] * normals[first + 2]
                )
            state[i] = total
        first += size
    after[0] = state[0]
    after[1] = output[1, 1] * state[1] + output[1, 2] * state[2]
    after[2] = output[2, 4] * state[4] + output[2, 5] * state[5]
    after[3] = state[7]
    after[4] = output[4, 4] * state[4] + output[4, 5] * state[5] + output[4, 6] * state[6]
    after[5] = output[5, 1] * state[1] + output[5, 2] * state[2] + output[5, 3] * state[3]
