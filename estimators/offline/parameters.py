"""Parameters of the likelihood of whole flights, and the filter of one window that they make.

In still air the derivatives are all of them: no process noise, so that the filter is the model's response. In moving
air everything else is there so that the derivatives' error is honest (docs/methods/filter_error.md).
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.offline.innovations import Record, System
from wingwatch.estimators.offline.window import Window, following
from wingwatch.estimators.plant.discretisation import discretise_levels, stationary_covariance
from wingwatch.estimators.plant.motion import Air, Flown, Plant

__all__ = ["Layout", "Model"]

Array = NDArray[np.float64]


class Layout(NamedTuple):
    """Where each parameter stands; in still air ``theta`` is all there is.

    Attributes:
        theta: derivatives, in natural sizes, equation by equation.
        log_noise: ln of each channel's noise variance above its floor.
        gust: ln of the gust's intensity, m/s; gust_rate_gain: how much of the turning air each equation meets.
        log_times: ln of the time constants of the span filter, the gust (scale length over airspeed) and unmeasured
            moments, s.
        disturbance: ln of the intensities of unmeasured moments, rad/s2, and of rolling air, rad/s.
        copy: of the stability derivatives, for what nobody measured, in natural sizes, equation by equation.
    """

    theta: slice
    log_noise: slice
    gust: slice
    gust_rate_gain: slice
    log_times: slice
    disturbance: slice
    copy: slice

    @property
    def gusts(self) -> NDArray[np.int64]:
        """All parameters that describe gusts."""
        return np.arange(self.gust.start, self.log_times.start + 2)


@dataclass(frozen=True, slots=True)
class Model:
    """Turns parameters into the filter of a window.

    Attributes:
        plant: the linear model.
        air: whether the air moves.
        natural: natural size of each derivative, (k,).
        fastest_growth: of its motion, 1/s; what grows faster is none of an aircraft that is flown.
    """

    plant: Plant
    air: bool
    natural: Array
    fastest_growth: float

    @property
    def layout(self) -> Layout:
        """Of the parameters."""
        ns, plant = self.plant.states, self.plant
        air = (plant.channels, 1, ns, 3, plant.disturbances, ns * ns) if self.air else (0,) * 6
        stops = np.cumsum([self.natural.size, *air]).tolist()
        return Layout(*(slice(start, stop) for start, stop in pairwise([0, *stops])))

    @property
    def parameters(self) -> int:
        """How many there are."""
        return int(self.layout.copy.stop)

    def derivatives(self, p: Array) -> Array:
        """Referred, (equations, states + inputs), of parameters p (size,)."""
        return np.asarray((p[self.layout.theta] * self.natural).reshape(self.plant.states, -1))

    def moving_air(self, p: Array) -> Air | None:
        """Air of parameters p (size,) in its units; None where it is still."""
        if not self.air:
            return None
        at, ns = self.layout, self.plant.states
        sizes = self.natural.reshape(ns, -1)[:, :ns]
        span, gust, moment = np.exp(np.clip(p[at.log_times], -6.0, 6.0)).tolist()
        return Air(
            p[at.copy].reshape(ns, ns) * sizes, float(np.exp(p[at.gust.start])), p[at.gust_rate_gain], span, gust,
            moment, np.exp(p[at.disturbance]),
        )  # fmt: skip

    def noise(self, p: Array) -> Array:
        """Variance of each channel above its floor, of SI units, (channels,); in still air that of the innovations."""
        return (
            np.exp(np.clip(p[self.layout.log_noise], -60.0, 30.0))
            if self.air
            else np.ones(self.plant.channels)
        )

    def grows(self, p: Array, window: Window) -> bool:
        """Whether the motion of the derivatives or of their copy at p (size,) grows faster than an aircraft's."""
        air, ns, middle = self.moving_air(p), self.plant.states, float(window.levels.mean())
        if self.fastest_growth == np.inf:
            return False
        both = [self.derivatives(p)[:, :ns], *([] if air is None else [air.copy])]
        rates = [float(np.linalg.eigvals(window.known + middle * a).real.max()) for a in both]
        return max(rates) > self.fastest_growth

    def size(self, window: Window) -> int:
        """States of the filter."""
        return self.plant.size(self.air, window.airspeed_m_s, window.dt)

    def system(self, p: Array, window: Window) -> System:
        """The filter at parameters p (size,), with the step of the window in seconds."""
        derivatives, air, ns = self.derivatives(p), self.moving_air(p), self.plant.states
        at = Flown(window.known, 1.0, window.airspeed_m_s, window.dt)
        linear = [
            self.plant.linear(derivatives, air, at._replace(stability=s)) for s in window.levels.tolist()
        ]
        # the noise of the air does not depend on the level
        f, early, late, q = discretise_levels(
            np.array([one.a for one in linear]),
            np.column_stack([derivatives, np.eye(ns)]),
            linear[0].noise,
            window.dt,
        )
        covariance = np.zeros_like(f[0])
        if air is not None:
            inner = slice(ns, -ns)
            covariance[inner, inner] = stationary_covariance(
                np.ascontiguousarray(f[0, inner, inner]), np.ascontiguousarray(q[0, inner, inner])
            )
        return System(
            window.level, f, q, early, late, np.array([one.c for one in linear]), self.plant.direct(derivatives),
            self.noise(p) + window.floor, covariance,
        )  # fmt: skip

    def record(self, window: Window, own: Array) -> Record:
        """What the filter of a window reads, with its own constants (own,) in the units of ``Window``."""
        plant = self.plant
        pushes, constants, initial = window.split(own)
        trim = window.trims @ pushes
        start, end = window.start.copy(), window.end.copy()
        start[:, -plant.states :] += trim
        end[:, -plant.states :] += following(trim)
        readings = window.readings - constants
        readings[:, plant.states :] -= (window.aerodynamic + trim)[:, plant.forces]
        state = np.zeros(self.size(window))
        state[-plant.states :] = initial
        return Record(readings, window.used, start, end, state)
