"""Turbulence of MIL-F-8785C and MIL-HDBK-1797: strength, length and spectra, in Dryden's and von Karman's form.

The gust field is frozen and crossed at one airspeed V. One-sided spectra over the angular frequency w, with T = L / V,
a = 1.339 and the span b (MIL-F-8785C, 3.7.1.1 and 3.7.1.2):

- u, Dryden: sigma^2 (2 T / pi) / (1 + (T w)^2); von Karman: sigma^2 (2 T / pi) / (1 + (a T w)^2)^(5/6);
- v and w, Dryden: sigma^2 (T / pi) (1 + 3 (T w)^2) / (1 + (T w)^2)^2;
  von Karman: sigma^2 (T / pi) (1 + 8/3 (a T w)^2) / (1 + (a T w)^2)^(11/6);
- p: sigma_w^2 / (V L_w) 0.8 (pi L_w / (4 b))^(1/3) / (1 + (4 b w / (pi V))^2), the same in both forms;
- q: (w / V)^2 / (1 + (4 b w / (pi V))^2) times that of w; r: (w / V)^2 / (1 + (3 b w / (pi V))^2) times that of v.

MIL-HDBK-1797 halves the lengths of v and w and doubles L in their spectra and in that of p: the same air (a test holds
the two together), so there is nothing to choose between them. The short form of the roll gust that other simulators
take from Yeager (NASA CR-1998-206937) is not used.
"""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "LEVELS",
    "MODELS",
    "GustScales",
    "Turbulence",
    "TurbulenceModel",
    "gust_scales",
    "gust_spectra",
    "roll_gust_density",
    "span_lags_s",
]

Turbulence = Literal["none", "light", "moderate", "severe"]
LEVELS: tuple[str, ...] = get_args(Turbulence)
TurbulenceModel = Literal["dryden", "von-karman"]
MODELS: tuple[str, ...] = get_args(TurbulenceModel)

Matrix = NDArray[np.float64]

_FOOT_M = 0.3048
_KNOT_M_S = 1852.0 / 3600.0
_WIND_AT_20_FT_KNOTS = {"light": 15.0, "moderate": 30.0, "severe": 45.0}
"""MIL-F-8785C, 3.7.3.4."""

_FIGURE_7_ALTITUDE_FT = (1750.0, 3750.0, 7500.0, 15000.0, 25000.0, 35000.0, 45000.0, 55000.0, 65000.0)
_FIGURE_7_RMS_FT_S = {
    "light": (6.9, 7.4, 6.7, 4.6, 2.7, 0.4, 0.0, 0.0, 0.0),
    "moderate": (9.6, 10.6, 10.1, 8.0, 6.6, 5.0, 4.2, 2.7, 0.0),
    "severe": (17.6, 23.0, 23.6, 22.1, 20.0, 16.0, 15.1, 12.1, 7.9),
}
"""Figure 7 of MIL-F-8785C, read at the probabilities of exceedance 1e-2, 1e-3 and 1e-5 that belong to the three levels
(the values as JSBSim tabulates them)."""

_LOWEST_FT, _LOW_FT, _MEDIUM_FT = 10.0, 1000.0, 2000.0
_MEDIUM_SCALE_FT = {"dryden": 1750.0, "von-karman": 2500.0}
"""MIL-F-8785C, 3.7.2.1."""

_KARMAN = 1.339


@dataclass(frozen=True, slots=True)
class GustScales:
    """Root mean squares (m/s) and scale lengths (m); v has those of u."""

    sigma_u_m_s: float
    sigma_w_m_s: float
    length_u_m: float
    length_w_m: float


def _low_altitude(level: str, height_ft: float) -> tuple[float, float, float, float]:
    """(sigma_u, sigma_w, L_u, L_w) in ft and ft/s, section 3.7.3.4; below 10 ft as at 10 ft."""
    h = max(height_ft, _LOWEST_FT)
    sigma_w = 0.1 * _WIND_AT_20_FT_KNOTS[level] * _KNOT_M_S / _FOOT_M
    shape = 0.177 + 0.000823 * h
    return sigma_w / shape**0.4, sigma_w, h / shape**1.2, h


def gust_scales(level: Turbulence, height_m: float, model: TurbulenceModel = "dryden") -> GustScales:
    """Intensities and scale lengths at a height above ground.

    Below 1000 ft the low-altitude model, above 2000 ft figure 7 with L = 1750 ft (Dryden) or 2500 ft (von Karman),
    linear in between.

    Raises:
        ValueError: a level or a model that is not known.
    """
    if level not in LEVELS:
        raise ValueError(f"turbulence is {level!r}; give one of {', '.join(LEVELS)}")
    if model not in MODELS:
        raise ValueError(f"turbulence_model is {model!r}; give one of {', '.join(MODELS)}")
    scale = _MEDIUM_SCALE_FT[model]
    if level == "none":
        return GustScales(0.0, 0.0, scale * _FOOT_M, scale * _FOOT_M)
    h = height_m / _FOOT_M
    low = np.array(_low_altitude(level, min(h, _LOW_FT)))
    sigma = float(np.interp(max(h, _MEDIUM_FT), _FIGURE_7_ALTITUDE_FT, _FIGURE_7_RMS_FT_S[level]))
    high = np.array([sigma, sigma, scale, scale])
    share = min(1.0, max(0.0, (h - _LOW_FT) / (_MEDIUM_FT - _LOW_FT)))
    su, sw, lu, lw = ((1.0 - share) * low + share * high) * _FOOT_M
    return GustScales(float(su), float(sw), float(lu), float(lw))


def roll_gust_density(length_m: float, airspeed: float, span_m: float) -> float:
    """Spectrum of p at frequency 0, per sigma_w^2."""
    return 0.8 * math.pow(math.pi * length_m / (4.0 * span_m), 1.0 / 3.0) / (airspeed * length_m)


def span_lags_s(airspeed: float, span_m: float) -> tuple[float, float]:
    """Time constants in s that smooth p and q, and r, over the span."""
    return 4.0 * span_m / (math.pi * airspeed), 3.0 * span_m / (math.pi * airspeed)


def gust_spectra(
    model: TurbulenceModel, scales: GustScales, airspeed_true_m_s: float, span_m: float, omega_rad_s: Matrix
) -> Matrix:
    """One-sided spectra of the specification, whose integral over the angular frequency is the variance.

    Returns:
        (u, v, w, p, q, r), shape (6, frequencies), in (m/s)^2/(rad/s) and (rad/s)^2/(rad/s).
    """
    g, v, w = scales, airspeed_true_m_s, omega_rad_s
    time_u, time_w = g.length_u_m / v, g.length_w_m / v
    lag_q, lag_r = span_lags_s(v, span_m)

    def along(time: float) -> Matrix:
        if model == "dryden":
            return 1.0 / (1.0 + (time * w) ** 2)
        return np.asarray((1.0 + (_KARMAN * time * w) ** 2) ** (-5.0 / 6.0))

    def across(time: float) -> Matrix:
        if model == "dryden":
            return np.asarray((1.0 + 3.0 * (time * w) ** 2) / (1.0 + (time * w) ** 2) ** 2)
        x = (_KARMAN * time * w) ** 2
        return np.asarray((1.0 + 8.0 / 3.0 * x) / (1.0 + x) ** (11.0 / 6.0))

    u = g.sigma_u_m_s**2 * 2.0 * time_u / math.pi * along(time_u)
    side = g.sigma_u_m_s**2 * time_u / math.pi * across(time_u)
    down = g.sigma_w_m_s**2 * time_w / math.pi * across(time_w)
    roll = g.sigma_w_m_s**2 * roll_gust_density(g.length_w_m, v, span_m) / (1.0 + (lag_q * w) ** 2)
    pitch = (w / v) ** 2 / (1.0 + (lag_q * w) ** 2) * down
    yaw = (w / v) ** 2 / (1.0 + (lag_r * w) ** 2) * side
    return np.array([u, side, down, roll, pitch, yaw])
