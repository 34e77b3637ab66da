"""How rough the air was: gusts as what the vanes saw less what the aircraft itself did (thesis 10.4, Foster 1982).

Vertical: V sin(alpha) cos(beta) changes by a_z + q U - p V + g cos(theta) cos(phi) in still air; what is left of its
rate is that of the gust, -w_g', and of sensors. In the frequency domain (``spectra``) power P(w) of what is left is

    P(w) = w^2 s^2 G(w) + w^2 R + A,      G Dryden's spectrum of the component, MIL-F-8785C 3.7.2,

R the vane's white noise and A that of the inertial channels. s and R are found by the likelihood of a periodogram
(Whittle 1953). Above V / L the gust's term is as flat as A, so A is taken from the top of these channels' own
spectra, where gusts hardly show, as well as these tell it. Sideways alike with a_y.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.gust_spectrum import dryden_across, fit_gust
from wingwatch.telemetry.conditioning.kinematics import IDENTITIES, Columns
from wingwatch.telemetry.conditioning.parameter import Parameter
from wingwatch.telemetry.conditioning.positions import at_centre
from wingwatch.telemetry.conditioning.sensor_noise import detrended
from wingwatch.telemetry.conditioning.spectra import Bins, make_bins
from wingwatch.telemetry.conditioning.windows import even_window
from wingwatch.telemetry.sample import SampleBlock

__all__ = ["GUST_CHANNELS", "VANES", "AirConfig", "AirQuality", "turbulence_intensity"]

Array = NDArray[np.float64]

GUST_CHANNELS = (
    "airspeed_true_m_s", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "specific_force_x_m_s2",
    "specific_force_y_m_s2", "specific_force_z_m_s2", "roll_rad", "pitch_rad",
)  # fmt: skip
"""Channels without which no gust is found."""

VANES = ("angle_of_attack_rad", "sideslip_rad")
"""At least one of them, too: of the vertical and of the lateral gust."""

_LEAST_AIRSPEED_M_S = 1.0

_COMPONENTS = (("vertical", "down", VANES[0]), ("lateral", "across", VANES[1]))


@dataclass(frozen=True, slots=True)
class AirConfig:
    """What is supposed.

    Attributes:
        vertical_length_m: of the vertical gust, L_w of MIL-F-8785C: 533.4 above 2000 ft, the height near the ground.
        lateral_length_m: L_v likewise. The whole gust's strength goes with the root of its length; that in
            ``mode_band_hz`` hardly does.
        band_hz: frequencies that are used.
        mode_band_hz: where the modes lie that are to be estimated.
        share_max: up to this ``AirQuality.share`` the air is fit. A derivative from an equation that a
            gust disturbs shrinks by about the share.
        vane_position_m: (x, y, z) of the vane from the centre of gravity, body axes.
        imu_position_m: of the accelerometers.
    """

    vertical_length_m: float = 533.4
    lateral_length_m: float = 533.4
    band_hz: tuple[float, float] = (0.1, 12.0)
    mode_band_hz: tuple[float, float] = (0.5, 3.0)
    share_max: float = 0.05
    vane_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    imu_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name, length in (
            ("vertical_length_m", self.vertical_length_m),
            ("lateral_length_m", self.lateral_length_m),
        ):
            if not (math.isfinite(length) and length > 0.0):
                raise ValueError(f"{name} is {length}; give a positive number of m")
        for name, band in (("band_hz", self.band_hz), ("mode_band_hz", self.mode_band_hz)):
            if not 0.0 < band[0] < band[1]:
                raise ValueError(f"{name} is {band}; give two rising positive frequencies")
        if not 0.0 < self.share_max < 1.0:
            raise ValueError(f"share_max is {self.share_max}; give a share between 0 and 1")


@dataclass(frozen=True, slots=True)
class AirQuality:
    """The air of a flight.

    Attributes:
        sigma: root mean square of the whole vertical and lateral gust, m/s, by Dryden's form; not observable where
            there is no vane or nothing above sensor noise.
        in_band: the same within the modes' band, m/s.
        share: by component, gust power in the modes' band over itself plus that of what the vane sees there (which
            is less than the gust where the aircraft rides with it).
        fit_for_estimating: whether every share is small enough.
        text: that as one sentence.
    """

    sigma: tuple[Parameter, ...]
    in_band: tuple[Parameter, ...]
    share: tuple[float, ...]
    fit_for_estimating: bool
    text: str


@dataclass(frozen=True, slots=True)
class _Component:
    """One component's gust: strength with error, part of it in the modes' band, and its share there."""

    sigma: float
    error: float
    per_sigma: float
    share: float
    seen: bool


def turbulence_intensity(block: SampleBlock, config: AirConfig | None = None) -> AirQuality:
    """Strength of the vertical and the lateral gust, and whether the air was fit for estimating.

    Args:
        block: samples, aligned; the longest window without a gap is used.
        config: what is supposed.

    Raises:
        ValueError: no vane at all, a needed channel is missing, no window is long enough, or no airspeed.
    """
    c = AirConfig() if config is None else config
    there = [part for part in _COMPONENTS if part[2] in block.present]
    if not there:
        raise ValueError(
            "the flight has neither angle_of_attack_rad nor sideslip_rad: turbulence needs a vane"
        )
    time_s, columns = even_window(block, (*GUST_CHANNELS, *(part[2] for part in there)))
    moved = at_centre(
        SampleBlock.from_columns({"time_s": time_s, **columns}), c.vane_position_m, c.imu_position_m
    )
    centred = {name: moved.column(name) for name in columns}
    bins = make_bins(len(time_s), float(time_s[1] - time_s[0]), c.band_hz)
    found = [_component(part[1], centred, bins, c) for part in there]
    sigma = tuple(_parameter(f"{p[0]} gust", f, 1.0) for p, f in zip(there, found, strict=True))
    band = tuple(
        _parameter(f"{p[0]} gust in band", f, f.per_sigma) for p, f in zip(there, found, strict=True)
    )
    shares = tuple(f.share for f in found)
    fit = all(share <= c.share_max for share in shares)
    return AirQuality(sigma, band, shares, fit, _sentence(there, band, shares, fit, c))


def _parameter(name: str, found: _Component, factor: float) -> Parameter:
    reason = "" if found.seen else "nothing is left above the sensors' noise"
    return Parameter(name, factor * found.sigma, factor * found.error, "m/s", found.seen, reason)


def _sentence(
    parts: list[tuple[str, str, str]],
    band: tuple[Parameter, ...],
    shares: tuple[float, ...],
    fit: bool,
    c: AirConfig,
) -> str:
    low, high = c.mode_band_hz
    if not any(share > 0.0 for share in shares):
        names = " or ".join(part[0] for part in parts)
        return f"the air is fit for estimating: no {names} gust stands above the sensors' noise"
    worst = int(np.argmax(shares))
    verdict = "is fit for estimating" if fit else "is not fit for estimating moment derivatives by regression"
    than = "at most" if fit else "more than"
    return (
        f"the air {verdict}: between {low:g} and {high:g} Hz the {parts[worst][0]} gust is "
        f"{band[worst].value:.2g} m/s, {shares[worst]:.1%} of itself and what the vane sees, {than} "
        f"the {c.share_max:.1%} allowed"
    )


def _component(identity: str, columns: Columns, bins: Bins, c: AirConfig) -> _Component:
    """One gust from its identity."""
    measured, rate = IDENTITIES[identity](columns)
    omega, window = bins.omega_rad_s, bins.step_s * float(np.sum(bins.taper**2))
    moved = bins.of_rate(detrended(measured))
    length_m = c.vertical_length_m if identity == "down" else c.lateral_length_m
    airspeed_m_s = float(np.mean(columns["airspeed_true_m_s"]))
    if airspeed_m_s < _LEAST_AIRSPEED_M_S:
        raise ValueError(f"the airspeed is {airspeed_m_s:.3g} m/s on average; give a flight")
    gust_time = length_m / airspeed_m_s
    found = fit_gust(np.abs(moved - bins.of(rate - np.mean(rate))) ** 2, identity, columns, bins, gust_time)
    sigma, seen = found.sigma_m_s, found.seen
    inside = (omega >= 2.0 * math.pi * c.mode_band_hz[0]) & (omega <= 2.0 * math.pi * c.mode_band_hz[1])
    step_hz = float(omega[1] - omega[0]) / (2.0 * math.pi)
    per_sigma = math.sqrt(2.0 * step_hz * float(np.sum(dryden_across(omega[inside], gust_time))))
    all_power = 2.0 * step_hz * float(np.sum((np.abs(moved) ** 2 / window / omega**2)[inside]))
    gust_power = (per_sigma * sigma) ** 2
    share = gust_power / (gust_power + all_power) if seen else 0.0
    return _Component(sigma, found.standard_error_m_s, per_sigma, share, seen)
