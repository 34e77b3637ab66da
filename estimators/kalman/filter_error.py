"""Filter error: maximum likelihood with sensor noise, moving air and unmeasured moments, on files.

Output error with a Kalman filter between model and data (Jategaonkar 2006, chapter 5): the innovations' full likelihood,
with gains and innovation variances as functions of the parameters. Derivation, priors and guards:
docs/methods/filter_error.md.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.kalman.likelihood import Prior, Problem
from wingwatch.estimators.kalman.model import FilterModel, Layout
from wingwatch.estimators.kalman.window import Window, window
from wingwatch.estimators.manoeuvre import Manoeuvre
from wingwatch.estimators.regression import common_forces, plain_start, sensor_noise, shared_config

__all__ = ["FilterErrorConfig", "problem_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FilterErrorConfig:
    """What the filter is given besides the data.

    Attributes:
        span_m: of the wing; makes the time constants of gusts' gradients, 4 b / (pi V) for pitch and roll, 3 b / (pi V)
            for yaw (MIL-F-8785C).
        vane_ahead_m: how far the vane is ahead of the centre of gravity.
        prior_ratio: standard deviation of the derivatives' prior, in natural sizes.
    """

    span_m: float = 2.9
    vane_ahead_m: float = 0.0
    prior_ratio: float = 3.0


def problem_of(
    parts: Sequence[Manoeuvre], config: FilterErrorConfig, expected: Array | None, natural: Array | None
) -> Problem:
    """Windows, model and prior of a call.

    Raises:
        ValueError: a structure that is none of short period, Dutch roll and lateral.
    """
    shared = shared_config(parts)
    s = shared.structure
    if s.states not in (("w", "q"), ("v", "r"), ("v", "p", "r")):
        raise ValueError(
            f"filter error estimates short_period, dutch_roll and lateral; {s.name} has other states"
        )
    forces = np.flatnonzero(common_forces(parts))
    input_noise = sensor_noise(parts, common_forces(parts))[-len(s.inputs) :]
    windows = [window(p, forces, input_noise) for p in parts]
    mean = plain_start(parts) if expected is None else np.asarray(expected, dtype=np.float64)
    size = np.abs(mean) if natural is None else np.asarray(natural, dtype=np.float64)
    size = np.maximum(size, 1e-6)
    layout = Layout(s, len(s.states) + forces.size)
    airspeed = float(np.mean([w.airspeed_m_s for w in windows]))
    model = FilterModel(
        layout, size, forces, shared.lever_m, config.vane_ahead_m, 4.0 * config.span_m / (math.pi * airspeed)
    )
    return Problem(windows, model, _prior(model, windows, mean, config), np.ones(layout.size, dtype=np.bool_))


def _prior(model: FilterModel, windows: Sequence[Window], mean: Array, config: FilterErrorConfig) -> Prior:
    at, size = model.layout, model.layout.size
    ns = model.states
    airspeed = float(np.mean([w.airspeed_m_s for w in windows]))
    centre, std, step = np.zeros(size), np.ones(size), np.full(size, 1e-3)
    centre[at.theta], std[at.theta], step[at.theta] = mean / model.natural, config.prior_ratio, 1e-4
    copied = centre[at.theta].reshape(ns, -1)[:, :ns].ravel()
    centre[at.copy], std[at.copy], step[at.copy] = copied, 1.0, 1e-4
    centre[at.log_noise], std[at.log_noise] = np.log(_roughness(windows)), 3.0
    std[at.gust] = 0.08 * airspeed
    centre[at.gust_rate_gain], step[at.gust_rate_gain] = 1.0, 1e-4
    shape = 4.0 if at.structure.states[0] == "w" else 3.0
    centre[at.log_span_time] = math.log(shape * config.span_m / (math.pi * airspeed))
    std[at.log_span_time] = 0.7
    centre[at.log_gust_time] = math.log(_GUST_SCALE_M / airspeed)
    centre[at.log_moment_time] = math.log(0.5)
    std[at.disturbance] = _disturbances(model, std[at.gust], config)
    step[at.disturbance] = 1e-3 * std[at.disturbance]
    start = centre.copy()
    start[at.gust] = 0.35 * std[at.gust]
    start[at.disturbance] = 0.2 * std[at.disturbance]
    return Prior(centre, std, start, step)


_GUST_SCALE_M = 100.0


def _disturbances(model: FilterModel, gust: float, config: FilterErrorConfig) -> Array:
    """Prior standard deviations: moments as of a degree of the strongest surface, rolling air as gusts make it."""
    at, ns = model.layout, model.states
    surfaces = model.natural.reshape(ns, -1)[1:, ns:].max(axis=1) * math.radians(1.0)
    if not at.rolling_air:
        return np.asarray(surfaces)
    return np.append(surfaces, 1.9 * gust / math.sqrt(_GUST_SCALE_M * config.span_m))


def _roughness(windows: Sequence[Window]) -> Array:
    """Noise variance of each channel by the median square of its second differences, (channels,)."""
    channels = windows[0].readings.shape[1]
    floor = np.max([w.floor for w in windows], axis=0)
    rough = np.zeros(channels)
    for c in range(channels):
        squares = [np.diff(w.readings[w.used[:, c], c], 2) ** 2 for w in windows]
        every = np.concatenate(squares)
        # the median of a normal variable's square is 0.455 of its mean, and second differences have 6 times the variance
        rough[c] = np.median(every) / (0.455 * 6.0) if every.size else 1.0
    return np.maximum(rough, np.maximum(floor, 1e-12))
