"""Manoeuvres as the likelihood reads them: on an even clock, with what drives the model between samples.

With c u the inputs at the present control factor, s the factor of the stability derivatives, s_l the nearest of a few
levels of it, P the dynamic pressure that the trim follows and x_m the measured states, the model is

    x' = (K_bar + s_l A) x + Theta d(t) + a(t) + k(t).                                                      (1)

Without process noise x is the motion itself and the trim a force of unknown strength b (and drift) in each window:

    d(t) = [(s - s_l) x_m; c u],   a(t) = P b,   k(t) = rest + (K - K_bar) x_m.

With it x is the deviation from the window's means, marked by a bar, and trims are constants of the readings:

    d(t) = [(s - s_l) (x_m - x_bar) + (s - s_bar P / P_bar) x_bar; c u - (P / P_bar) mean(c u)],
    a(t) = (P / P_bar - 1) mean(aerodynamic acceleration),
    k(t) = rest + (K - K_bar) x_m, less its mean.

What multiplies x_m is a per cent or two (s - s_l), or known to a per cent (K), so its noise hardly counts. The levels
are there for what is not measured: rolling air meets the same changing damping as the aircraft does.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.surface import at_rest

__all__ = ["Window", "following", "window"]

Array = NDArray[np.float64]

_LEVEL = 0.04
"""Width of a level of the stability factor, of its middle."""

_ROUNDING = 1e-5
"""Noise below this part of a channel's own spread is not believed: models are no better."""


@dataclass(frozen=True, slots=True)
class Window:
    """One manoeuvre on an even clock; n samples, channels = states, then the accelerometers in use.

    Its own constants are, in this order: the strength of each trim force, equation by equation within a column of
    ``trims``; a constant of each channel in ``constants``, in its SI unit; the state at the first sample of what no
    input explains.

    Attributes:
        dt: step, s.
        readings: as they are, or deviations from the mean, (n, channels).
        used: whether a reading is there, (n, channels).
        start, end: at the beginning and the end of the step after each sample, (n, states + inputs + states): d of (1),
            what the derivatives' columns multiply, then a + k.
        aerodynamic: a of (1) at each sample, (n, states).
        known: K_bar, (states, states).
        levels: of s, (levels,); level: which of them at each sample and over the step after it, (n,).
        airspeed_m_s: mean.
        floor: least noise variance of each channel, (channels,).
        input_noise: variance of each measured input's noise, in the units of d, (inputs,).
        moving: whether each input is taken as measured, (n, inputs).
        trims: courses of trim forces of unknown strength, (n, trims).
        constants: channels whose readings have an unknown constant.
    """

    dt: float
    readings: Array
    used: NDArray[np.bool_]
    start: Array
    end: Array
    aerodynamic: Array
    known: Array
    levels: Array
    level: NDArray[np.int64]
    airspeed_m_s: float
    floor: Array
    input_noise: Array
    moving: NDArray[np.bool_]
    trims: Array
    constants: NDArray[np.int64]

    def __len__(self) -> int:
        return int(self.readings.shape[0])

    @property
    def own(self) -> int:
        """How many constants of its own there are."""
        states = self.known.shape[0]
        return int(states * (self.trims.shape[1] + 1) + self.constants.size)

    def split(self, own: Array) -> tuple[Array, Array, Array]:
        """Own constants (own,), SI units, as strengths of the trims (trims, states), constants of all channels
        (channels,), and the state at the first sample (states,)."""
        ns, (columns, channels) = self.known.shape[0], (self.trims.shape[1], self.readings.shape[1])
        constants = np.zeros(channels)
        constants[self.constants] = own[columns * ns : own.size - ns]
        return own[: columns * ns].reshape(columns, ns), constants, own[own.size - ns :]


def window(
    part: Manoeuvre, forces: NDArray[np.int64], input_noise: Array, *, deviations: bool, drift: bool = False
) -> Window:
    """A manoeuvre for the likelihood.

    Args:
        part: with evenly spaced stamps or not; where a sample is missing its readings are left out, and other uneven
            stamps are interpolated on a line (``Manoeuvre.even``).
        forces: equations whose accelerometer is read.
        input_noise: variance of each measured input, rad2, (inputs,); 0 for commands.
        deviations: whether x is the deviation from the means, or the motion itself. Of deviations surfaces at rest are
            taken to be at their mean.
        drift: whether trim forces may move on a line.
    """
    part, present = _on_even_clock(part)
    held = np.vstack([part.held_steps, np.ones((1, part.inputs.shape[1]), dtype=bool)])
    measured = part.inputs
    if deviations:
        part = replace(part, inputs=_surfaces(part, input_noise))
    states = part.states
    readings = np.column_stack([states, part.accelerometer[:, forces]])
    used = np.isfinite(readings) & present[:, None]
    used[:, : states.shape[1]] &= part.measured
    used &= ~_stuck(readings, used)
    levels, level = _levels(part.stability)
    changing = np.einsum("nij,nj->ni", part.known - part.known.mean(axis=0), states) + part.rest
    if deviations:
        start, end = _deviations(part, held, levels[level])
        aerodynamic, kinematic = _trim_by_pressure(part, forces), changing - changing.mean(axis=0)
        mean = np.array([readings[u, c].mean() if u.any() else 0.0 for c, u in enumerate(used.T)])
        trims, constants = np.zeros((len(part), 0)), np.arange(readings.shape[1])
    else:
        start, end = _whole(part, held, levels[level])
        aerodynamic, kinematic, mean = np.zeros_like(states), changing, np.zeros(readings.shape[1])
        along = np.linspace(-0.5, 0.5, len(part))
        trims = np.column_stack([part.pressure, part.pressure * along] if drift else [part.pressure])
        constants = np.arange(states.shape[1], readings.shape[1])
    known = aerodynamic + kinematic
    start, end = np.column_stack([start, known]), np.column_stack([end, following(known)])
    return Window(
        part.dt, np.where(used, readings - mean, 0.0), used, start, end, aerodynamic, part.known.mean(axis=0),
        levels, level, float(part.condition[0]), _floor(readings, used),
        input_noise * float(part.control.mean()) ** 2, part.inputs == measured, trims, constants,
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
    return part.on(part.time_s[0] + step * np.arange(present.size)), present


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


def _whole(part: Manoeuvre, held: NDArray[np.bool_], near: Array) -> tuple[Array, Array]:
    """d at the start and the end of each step, (n, states + inputs), of the motion itself.

    Args:
        held: over which steps each input is, (n, inputs); of the readings as they were, for a surface at rest may leave
            its level within a step.
        near: s_l at each sample, (n,).
    """
    s, here = part.stability[:, None], near[:, None]
    ends = np.where(held, part.inputs, following(part.inputs))
    start = np.column_stack([(s - here) * part.states, part.control[:, None] * part.inputs])
    end = np.column_stack(
        [(following(s) - here) * following(part.states), following(part.control)[:, None] * ends]
    )
    return start, end


def _deviations(part: Manoeuvre, held: NDArray[np.bool_], near: Array) -> tuple[Array, Array]:
    """The same of deviations from the means."""
    trim = (part.pressure / part.pressure.mean())[:, None]
    mean = part.states.mean(axis=0)
    start, end = _whole(replace(part, states=part.states - mean), held, near)
    s = part.stability[:, None]
    slow = (s - trim * s.mean()) * mean
    level = (part.control[:, None] * part.inputs).mean(axis=0)
    start += np.column_stack([slow, -trim * level])
    end += np.column_stack([following(slow), -following(trim) * level])
    return start, end


def following(column: Array) -> Array:
    """Each row's successor, (n, ...); the last is its own."""
    return np.concatenate([column[1:], column[-1:]])


def _trim_by_pressure(part: Manoeuvre, forces: NDArray[np.int64]) -> Array:
    """a of the deviations, (n, states): what the changing dynamic pressure makes of the mean accelerations."""
    known = np.einsum("nij,nj->ni", part.known, part.states) + part.rest
    mean_force = (part.states[-1] - part.states[0]) / part.duration_s - known.mean(axis=0)
    mean_force[forces] = part.accelerometer[:, forces].mean(axis=0)
    return np.asarray((part.pressure / part.pressure.mean() - 1.0)[:, None] * mean_force)


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
