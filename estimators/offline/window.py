"""Manoeuvres as the filter reads them: deviations from the mean, forcing between samples, an even clock.

With the means over a window marked by a bar, x = x_bar + dx, c u the inputs at the present control factor, s the factor
of the stability derivatives, s_l the nearest of a few levels of it and P the dynamic pressure that the trim follows,

    d(dx)/dt = (K_bar + s_l A) dx + Theta d(t) + a(t) + k(t),                                              (1)
    d(t) = [(s - s_l) (x_m - x_bar) + (s - s_bar P / P_bar) x_bar; c u - (P / P_bar) mean(c u)],
    a(t) = (P / P_bar - 1) mean(aerodynamic acceleration),
    k(t) = rest + (K - K_bar) x_m, less its mean,

where x_m is measured. What multiplies it is a per cent or two (s - s_l), or known to a per cent (K), so its noise
hardly counts. The levels are there for what is not measured: rolling air meets the same changing damping as the
aircraft does.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.surface import at_rest

__all__ = ["Window", "window"]

Array = NDArray[np.float64]

_LEVEL = 0.04
"""Width of a level of the stability factor, of its middle."""

_ROUNDING = 1e-5
"""Noise below this part of a channel's own spread is not believed: models are no better."""


@dataclass(frozen=True, slots=True)
class Window:
    """One manoeuvre on an even clock; n samples, channels = states, then the accelerometers in use.

    Attributes:
        dt: step, s.
        readings: deviations from the mean, (n, channels).
        used: whether a reading is there, (n, channels).
        start, end: d of (1) at the beginning and the end of the step after each sample, (n, states + inputs): what the
            derivatives' columns multiply.
        aerodynamic: a of (1) at each sample, (n, states).
        kinematic: k of (1) at each sample, (n, states).
        known: K_bar, (states, states).
        levels: of s, (levels,); level: which of them at each sample and over the step after it, (n,).
        airspeed_m_s: mean.
        floor: least noise variance of each channel, (channels,).
        input_noise: variance of each measured input's noise, in the units of d, (inputs,).
        moving: whether each input is taken as measured, (n, inputs).
    """

    dt: float
    readings: Array
    used: NDArray[np.bool_]
    start: Array
    end: Array
    aerodynamic: Array
    kinematic: Array
    known: Array
    levels: Array
    level: NDArray[np.int64]
    airspeed_m_s: float
    floor: Array
    input_noise: Array
    moving: NDArray[np.bool_]

    def __len__(self) -> int:
        return int(self.readings.shape[0])


def window(part: Manoeuvre, forces: NDArray[np.int64], input_noise: Array) -> Window:
    """A manoeuvre for the filter.

    Args:
        input_noise: variance of each measured input, (inputs,); 0 for commands.
        part: with evenly spaced stamps or not; where a sample is missing its readings are left out, and other uneven
            stamps are interpolated on a line (``Manoeuvre.even``).
        forces: equations whose accelerometer is read.
    """
    part, present = _on_even_clock(part)
    held = np.vstack([part.held_steps, np.ones((1, part.inputs.shape[1]), dtype=bool)])
    measured = part.inputs
    part = replace(part, inputs=_surfaces(part, input_noise))
    states = part.states
    readings = np.column_stack([states, part.accelerometer[:, forces]])
    used = np.isfinite(readings) & present[:, None]
    used[:, : states.shape[1]] &= part.measured
    used &= ~_stuck(readings, used)
    levels, level = _levels(part.stability)
    start, end = _regressors(part, held, levels[level])
    aerodynamic, kinematic = _known_accelerations(part, forces)
    mean = np.array([readings[u, c].mean() if u.any() else 0.0 for c, u in enumerate(used.T)])
    centred = np.where(used, readings - mean, 0.0)
    return Window(
        part.dt, centred, used, start, end, aerodynamic, kinematic, part.known.mean(axis=0),
        levels, level, float(part.condition[0]), _floor(readings, used),
        input_noise * float(part.control.mean()) ** 2,
        part.inputs == measured,
    )  # fmt: skip


def _on_even_clock(part: Manoeuvre) -> tuple[Manoeuvre, NDArray[np.bool_]]:
    """The manoeuvre on stamps of one step, and whether each was measured."""
    step = float(np.median(np.diff(part.time_s)))
    steps = (part.time_s - part.time_s[0]) / step
    whole = np.round(steps)
    if np.abs(steps - whole).max() > 0.02 or np.any(np.diff(whole) < 1.0):
        return part.even(), np.ones(len(part), dtype=np.bool_)
    present = np.zeros(int(whole[-1]) + 1, dtype=np.bool_)
    present[whole.astype(int)] = True
    if present.all():
        return part, present
    grid = part.time_s[0] + step * np.arange(present.size)
    columns = ("states", "accelerometer", "inputs", "known", "rest", "stability", "control", "pressure")
    filled = {name: _interpolated(grid, part.time_s, getattr(part, name)) for name in columns}
    return (
        Manoeuvre(part.config, grid, measured=part.measured, condition=part.condition, **filled),
        present,
    )


def _interpolated(grid: Array, time_s: Array, values: Array) -> Array:
    flat = values.reshape(time_s.size, -1)
    columns = np.column_stack([np.interp(grid, time_s, c) for c in flat.T])
    return columns.reshape((grid.size, *values.shape[1:]))


def _surfaces(part: Manoeuvre, noise: Array) -> Array:
    columns = zip(part.inputs.T, noise, strict=True)
    return np.column_stack([at_rest(c, part.dt, float(np.sqrt(v))) for c, v in columns])


def _stuck(readings: Array, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Channels that never change: they say nothing of the motion, (channels,)."""
    return np.array([not u.any() or np.ptp(readings[u, c]) == 0.0 for c, u in enumerate(used.T)])


def _levels(stability: Array) -> tuple[Array, NDArray[np.int64]]:
    """Levels of the stability factor, and which one each sample has: the middle and steps of ``_LEVEL`` from it."""
    middle = 0.5 * float(stability.min() + stability.max())
    steps = np.round((stability / middle - 1.0) / _LEVEL).astype(np.int64)
    found, level = np.unique(steps, return_inverse=True)
    return np.asarray(middle * (1.0 + _LEVEL * found)), np.asarray(level, dtype=np.int64)


def _regressors(part: Manoeuvre, held: NDArray[np.bool_], near: Array) -> tuple[Array, Array]:
    """d of (1), at the start and the end of each step, (n, states + inputs).

    Args:
        held: over which steps each input is, (n, inputs); of the readings as they were, for a surface at rest may leave
            its level within a step.
        near: s_l at each sample, (n,).
    """
    trim = (part.pressure / part.pressure.mean())[:, None]
    s, mean = part.stability[:, None], part.states.mean(axis=0)
    slow = (s - trim * s.mean()) * mean
    moving = part.states - mean
    loads = part.control[:, None] * part.inputs
    ends = _next(part.control)[:, None] * np.where(held, part.inputs, _next(part.inputs))
    level = loads.mean(axis=0)
    here = near[:, None]
    start = np.column_stack([(s - here) * moving + slow, loads - trim * level])
    end = np.column_stack([(_next(s) - here) * _next(moving) + _next(slow), ends - _next(trim) * level])
    return start, end


def _next(column: Array) -> Array:
    """Each row's successor; the last is its own."""
    return np.concatenate([column[1:], column[-1:]])


def _known_accelerations(part: Manoeuvre, forces: NDArray[np.int64]) -> tuple[Array, Array]:
    """a and k of (1), (n, states) each."""
    known = np.einsum("nij,nj->ni", part.known, part.states) + part.rest
    mean_force = (part.states[-1] - part.states[0]) / part.duration_s - known.mean(axis=0)
    mean_force[forces] = part.accelerometer[:, forces].mean(axis=0)
    aerodynamic = (part.pressure / part.pressure.mean() - 1.0)[:, None] * mean_force
    changing = part.known - part.known.mean(axis=0)
    kinematic = np.einsum("nij,nj->ni", changing, part.states) + part.rest
    return aerodynamic, kinematic - kinematic.mean(axis=0)


def _floor(readings: Array, used: NDArray[np.bool_]) -> Array:
    """Least noise variance that each channel can have: rounding of the model, and the channel's own steps."""
    floor = np.full(readings.shape[1], 1e-300)
    for c, u in enumerate(used.T):
        if not u.any():
            continue
        values = np.unique(readings[u, c])
        steps = np.diff(values)
        quantum = float(steps.min()) if 0 < steps.size < 0.5 * np.count_nonzero(u) else 0.0
        floor[c] = max(_ROUNDING**2 * float(readings[u, c].var()), quantum**2 / 12.0, 1e-300)
    return floor
