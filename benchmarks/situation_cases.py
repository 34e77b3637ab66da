"""The situations that ``situations.py`` puts estimators into, by name.

Names are read left to right: the air (still, light, moderate), the loop (open, autopilot), what the surface does
(doublets each 5 or 10 s, none), then what is unlike what an estimator may assume.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from reference_plant import AMPLITUDE_RAD
from situation_plants import (
    Air,
    GustShape,
    RandomMoment,
    Situation,
    multisine,
    pulse_doublets,
    three_two_one_one,
)

__all__ = ["CONDITIONS", "SITUATIONS", "SURFACE_NOISE_RAD"]

Array = NDArray[np.float64]

LIGHT, MODERATE = Air(0.75), Air(1.5)
AUTOPILOT = (0.3, 0.1)
STRONG_AUTOPILOT = (0.6, 0.3)
EACH_5, EACH_10 = pulse_doublets(2.0, 5.0), pulse_doublets(2.0, 10.0)
SURFACE_NOISE_RAD = AMPLITUDE_RAD / 20.0
RECORD_S = 12.0
"""Length of a record with one input, as the reference plant's."""


def bump(time_s: Array) -> Array:
    """A moment of 0.35 rad/s2 that swells and ebbs within 1.5 s, each 10 s from 3 s on, to either side in turn."""
    since = np.mod(time_s - 3.0, 10.0)
    side = np.where(np.mod((time_s - 3.0) // 10.0, 2.0) < 1.0, 1.0, -1.0)
    inside = (time_s > 3.0) & (since < 1.5)
    return np.where(inside, 0.35 * side * np.sin(np.pi * since / 1.5) ** 2, 0.0)


def _steps(time_s: Array) -> Array:
    """A moment that steps by 0.3 rad/s2 at 20 s and by -0.5 at 40 s."""
    return np.asarray(0.3 * (time_s > 20.0) - 0.5 * (time_s > 40.0))


def _second_half(time_s: Array) -> Array:
    return np.asarray((time_s > 30.0) * 1.0)


def _patches(time_s: Array) -> Array:
    return np.asarray(0.05 + np.sin(np.pi * time_s / 10.0) ** 2)


def _moderate(
    length_m: float = 50.0, shape: GustShape = "dryden", span_m: float = 2.9, turns: bool = True
) -> Air:
    return Air(1.5, length_m, shape, span_m, turns)


_OPEN_5, _OPEN_10 = Situation(EACH_5), Situation(EACH_10)
_AUTO, _AUTO_10 = Situation(loop=AUTOPILOT), Situation(EACH_10, loop=AUTOPILOT)
_DURING, _APART = pulse_doublets(3.5, 10.0), pulse_doublets(8.0, 10.0)
_DRIFT = RandomMoment(0.1, 2.0)

SITUATIONS: dict[str, Situation] = {
    "record of 12 s, doublet at 2 s": Situation(pulse_doublets(2.0), seconds=RECORD_S),
    "still, open, each 5 s": _OPEN_5,
    "still, autopilot, each 10 s": _AUTO_10,
    "still, autopilot": _AUTO,
    "quiet": Situation(),
    "quiet, ten minutes": Situation(seconds=600.0),
    "light, open, each 5 s": replace(_OPEN_5, air=LIGHT),
    "light, open": Situation(air=LIGHT),
    "light, autopilot, each 10 s": replace(_AUTO_10, air=LIGHT),
    "light, autopilot": replace(_AUTO, air=LIGHT),
    "moderate, open, each 5 s": replace(_OPEN_5, air=MODERATE),
    "moderate, open": Situation(air=MODERATE),
    "moderate, autopilot, each 10 s": replace(_AUTO_10, air=MODERATE),
    "moderate, autopilot": replace(_AUTO, air=MODERATE),
    "moderate, strong autopilot, intensity 3 m/s": Situation(air=Air(3.0), loop=STRONG_AUTOPILOT),
    "unknown moment, surface at rest": Situation(moment=bump),
    "unknown moment, autopilot": replace(_AUTO, moment=bump),
    "unknown moment, open, each 10 s, at once": Situation(_DURING, moment=bump),
    "unknown moment, open, each 10 s, apart": Situation(_APART, moment=bump),
    "unknown moment, autopilot, each 10 s": Situation(_DURING, loop=AUTOPILOT, moment=bump),
    "unknown moment, moderate, autopilot": replace(_AUTO, air=MODERATE, moment=bump),
    "unknown moment, moderate, autopilot, each 10 s": Situation(_DURING, MODERATE, AUTOPILOT, bump),
    "moment steps, autopilot": replace(_AUTO, moment=_steps),
    "random moment, autopilot": replace(_AUTO, moment=_DRIFT),
    "random moment, autopilot, each 10 s": replace(_AUTO_10, moment=_DRIFT),
    "random moment, moderate, autopilot": replace(_AUTO, air=MODERATE, moment=_DRIFT),
    "moderate, scale half, open, each 5 s": replace(_OPEN_5, air=_moderate(25.0)),
    "moderate, scale half, autopilot, each 10 s": replace(_AUTO_10, air=_moderate(25.0)),
    "moderate, scale half, autopilot": replace(_AUTO, air=_moderate(25.0)),
    "moderate, scale double, open, each 5 s": replace(_OPEN_5, air=_moderate(100.0)),
    "moderate, scale double, autopilot": replace(_AUTO, air=_moderate(100.0)),
    "moderate, first order, open, each 5 s": replace(_OPEN_5, air=_moderate(shape="first-order")),
    "moderate, first order, autopilot, each 10 s": replace(_AUTO_10, air=_moderate(shape="first-order")),
    "moderate, first order, autopilot": replace(_AUTO, air=_moderate(shape="first-order")),
    "moderate, first order, scale half, autopilot": replace(_AUTO, air=_moderate(25.0, "first-order")),
    "moderate, von Karman, open, each 5 s": replace(_OPEN_5, air=_moderate(shape="von-karman")),
    "moderate, von Karman, autopilot, each 10 s": replace(_AUTO_10, air=_moderate(shape="von-karman")),
    "moderate, von Karman, autopilot": replace(_AUTO, air=_moderate(shape="von-karman")),
    "moderate, span half, autopilot": replace(_AUTO, air=_moderate(span_m=1.45)),
    "moderate, span double, autopilot": replace(_AUTO, air=_moderate(span_m=5.8)),
    "moderate, air does not turn, open, each 5 s": replace(_OPEN_5, air=_moderate(turns=False)),
    "moderate, air does not turn, autopilot, each 10 s": replace(_AUTO_10, air=_moderate(turns=False)),
    "moderate, air does not turn, autopilot": replace(_AUTO, air=_moderate(turns=False)),
    "moderate, vane 0.3 m ahead, open, each 5 s": replace(_OPEN_5, air=MODERATE, vane_ahead_m=0.3),
    "moderate, vane 0.3 m ahead, autopilot": replace(_AUTO, air=MODERATE, vane_ahead_m=0.3),
    "moderate, vane 0.3 m ahead unstated, open, each 5 s": replace(
        _OPEN_5, air=MODERATE, vane_ahead_m=0.3, vane_stated_m=0.0
    ),
    "moderate, vane 0.3 m ahead unstated, autopilot": replace(
        _AUTO, air=MODERATE, vane_ahead_m=0.3, vane_stated_m=0.0
    ),
    "gust from 30 s, autopilot": replace(_AUTO, air=Air(1.5, profile=_second_half)),
    "patches of gust, autopilot": replace(_AUTO, air=Air(3.0, profile=_patches)),
}  # fmt: skip
"""Flights as long as the command asks unless they say otherwise."""

_RECORD = Situation(pulse_doublets(2.0), seconds=RECORD_S)

CONDITIONS: dict[str, Situation] = {
    "record": _RECORD,
    "record, no accelerometer": replace(_RECORD, accelerometer=False),
    "record, surface noise": replace(_RECORD, surface_noise_rad=SURFACE_NOISE_RAD),
    "record, no accelerometer, surface noise": replace(
        _RECORD, accelerometer=False, surface_noise_rad=SURFACE_NOISE_RAD
    ),
    "still, autopilot, each 10 s, surface noise": replace(_AUTO_10, surface_noise_rad=SURFACE_NOISE_RAD),
    "still, autopilot, each 10 s, surface noise, on a line": replace(
        _AUTO_10, surface_noise_rad=SURFACE_NOISE_RAD, surface_moves=True
    ),
    "moderate, open, each 5 s, surface noise": replace(
        _OPEN_5, air=MODERATE, surface_noise_rad=SURFACE_NOISE_RAD
    ),
    "moderate, open, each 5 s, no accelerometer": replace(_OPEN_5, air=MODERATE, accelerometer=False),
    "quiet, surface noise": Situation(surface_noise_rad=SURFACE_NOISE_RAD),
    "record, 20 Hz": replace(_RECORD, rate_hz=20.0),
    "record, 200 Hz": replace(_RECORD, rate_hz=200.0),
    "moderate, open, each 5 s, 20 Hz": replace(_OPEN_5, air=MODERATE, rate_hz=20.0),
    "moderate, open, each 5 s, 200 Hz": replace(_OPEN_5, air=MODERATE, rate_hz=200.0),
    "record, doublet at 0.5 s": replace(_RECORD, surface=pulse_doublets(0.5)),
    "record, doublet at 8 s": replace(_RECORD, surface=pulse_doublets(8.0)),
    "record, 3-2-1-1": replace(_RECORD, surface=three_two_one_one(2.0)),
    "record, multisine": replace(_RECORD, surface=multisine(2.0)),
    "record, signal-to-noise 3": replace(_RECORD, signal_to_noise=3.0),
    "record, signal-to-noise 10": replace(_RECORD, signal_to_noise=10.0),
    "record, signal-to-noise 30": replace(_RECORD, signal_to_noise=30.0),
    "record, noise-free": replace(_RECORD, signal_to_noise=np.inf),
    "still, autopilot, each 10 s, noise-free": replace(_AUTO_10, signal_to_noise=np.inf),
    "moderate, autopilot, each 10 s, noise-free": replace(_AUTO_10, air=MODERATE, signal_to_noise=np.inf),
}
"""The reference record and its like with their conditions varied."""
