"""The aircraft in moving air with unmeasured moments, as a linear filter of one window (docs/methods/filter_error.md).

States, in this order (s of them belong to the structure):

    s      x    motion that surfaces and gusts cause, through the derivatives theta
    2      c    the two states of a Dryden gust
    1      f    the gust through the span filter, which makes its gradient along the flight path
    2      l    lag of the gust behind the vane (only with a vane ahead)
    m      d    unmeasured accelerations, one each moment equation, and rolling air
    s      y    motion that they and what happened before the window cause, through a copy of the derivatives
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure
from wingwatch.estimators.plant.discretisation import discretise, stationary_covariance
from wingwatch.estimators.offline.innovations import Record, System
from wingwatch.estimators.offline.window import Window

__all__ = ["FilterModel", "Layout", "Physical"]

Array = NDArray[np.float64]

_NUMERATOR = np.sqrt(3.0)
"""Of the Dryden spectrum of vertical and lateral gusts, (1 + sqrt(3) T s) / (1 + T s)^2."""

_LEAST_LAG = 0.02
"""Of a step: a vane that is less ahead than this is at the aircraft."""

_GUST_AT = {"w": "q", "v": "r"}
"""Rate that a gust of this velocity turns the air at."""

_GRADIENT = {"w": -1.0, "v": 1.0}
"""Sign of that rate: q_g = -(dw_g/dt)/V, r_g = +(dv_g/dt)/V."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where each parameter stands; everything beyond ``theta`` is there so that theta's error is honest.

    Attributes:
        structure: which mode.
        channels: how many readings a sample has.
    """

    structure: ModeStructure
    channels: int

    @property
    def rolling_air(self) -> bool:
        """Whether air that rolls about the flight path is modelled: where roll rate is a state."""
        return "p" in self.structure.states

    @property
    def moments(self) -> int:
        """Unmeasured accelerations: all equations but the first, the force."""
        return len(self.structure.equations) - 1

    @property
    def disturbances(self) -> int:
        """Unmeasured moments, and rolling air."""
        return self.moments + int(self.rolling_air)

    @property
    def theta(self) -> slice:
        """Derivatives, in natural sizes."""
        return slice(0, len(self.structure.derivatives))

    @property
    def log_noise(self) -> slice:
        """ln of each channel's noise variance above its floor."""
        return slice(self.theta.stop, self.theta.stop + self.channels)

    @property
    def gust(self) -> int:
        """ln of the gust's intensity, m/s."""
        return int(self.log_noise.stop)

    @property
    def gust_rate_gain(self) -> slice:
        """k of each equation: how much of the turning air it meets."""
        return slice(self.gust + 1, self.gust + 1 + len(self.structure.equations))

    @property
    def log_span_time(self) -> int:
        """ln of the time constant of the span filter, s."""
        return int(self.gust_rate_gain.stop)

    @property
    def log_gust_time(self) -> int:
        """ln of the gust's scale length over airspeed, s."""
        return self.log_span_time + 1

    @property
    def log_moment_time(self) -> int:
        """ln of the time constant of unmeasured moments, s."""
        return self.log_span_time + 2

    @property
    def disturbance(self) -> slice:
        """ln of the intensities of unmeasured moments, rad/s2, and of rolling air, rad/s."""
        return slice(self.log_span_time + 3, self.log_span_time + 3 + self.disturbances)

    @property
    def air(self) -> list[int]:
        """All that describes gusts."""
        gains = range(self.gust_rate_gain.start, self.gust_rate_gain.stop)
        return [self.gust, *gains, self.log_span_time, self.log_gust_time]

    @property
    def copy(self) -> slice:
        """The copy of the stability derivatives for what nobody measured, in natural sizes, equation by equation."""
        s = self.structure
        return slice(self.disturbance.stop, self.disturbance.stop + len(s.equations) * len(s.states))

    @property
    def size(self) -> int:
        """How many parameters there are."""
        return int(self.copy.stop)


class Physical(NamedTuple):
    """Parameters in their units.

    Attributes:
        derivatives: referred, (equations, states + inputs).
        copy: stability derivatives of the copy, (equations, states).
        noise: variance of each channel above its floor, (channels,).
        gust: intensity, m/s; gust_rate_gain: k, (equations,); span_s, gust_s, moment_s: time constants.
        disturbance: intensities, (disturbances,).
    """

    derivatives: Array
    copy: Array
    noise: Array
    gust: float
    gust_rate_gain: Array
    span_s: float
    gust_s: float
    moment_s: float
    disturbance: Array


@dataclass(frozen=True, slots=True)
class FilterModel:
    """Turns parameters into the filter of a window.

    Attributes:
        layout: of the parameters.
        natural: natural size of each derivative, (k,).
        forces: equations whose accelerometer is read.
        lever: of the accelerometers, (equations, states), m.
        vane_ahead_m: how far ahead of the centre of gravity the vane is; one behind it is taken to be at it.
        rolling_s: time constant of rolling air.
    """

    layout: Layout
    natural: Array
    forces: NDArray[np.int64]
    lever: Array
    vane_ahead_m: float
    rolling_s: float

    @property
    def states(self) -> int:
        """How many of the structure."""
        return len(self.layout.structure.states)

    def physical(self, p: Array) -> Physical:
        """Parameters p (size,) in their units."""
        at, ns = self.layout, self.states
        sizes = self.natural.reshape(ns, -1)
        theta = p[at.theta].reshape(ns, -1) * sizes
        span, gust, moment = np.exp(np.clip(p[at.log_span_time : at.log_moment_time + 1], -6.0, 6.0)).tolist()
        return Physical(
            theta, p[at.copy].reshape(ns, ns) * sizes[:, :ns], np.exp(np.clip(p[at.log_noise], -60.0, 30.0)),
            float(np.exp(p[at.gust])), p[at.gust_rate_gain], span, gust, moment, np.exp(p[at.disturbance]),
        )  # fmt: skip

    def growth(self, p: Array, window: Window) -> float:
        """Rate of the fastest growing motion of the derivatives and of their copy at p (size,), 1/s."""
        values, ns, middle = self.physical(p), self.states, float(window.levels.mean())
        both = (values.derivatives[:, :ns], values.copy)
        return max(float(np.linalg.eigvals(window.known + middle * a).real.max()) for a in both)

    def size(self, window: Window) -> int:
        """States of the filter."""
        return 2 * self.states + 3 + 2 * self._has_lag(window) + self.layout.disturbances

    def system(self, p: Array, window: Window) -> System:
        """The filter at parameters p (size,), with the step of the window in seconds."""
        values = self.physical(p)
        ns, n = self.states, self.size(window)
        noise, into = self._noise(values, n), np.eye(n, ns)
        steps, outputs = [], []
        for stability in window.levels:
            dynamics, output = self._dynamics(values, window, float(stability))
            steps.append(discretise(dynamics, into, noise, window.dt))
            outputs.append(output)
        f, early, late, q = (np.stack(matrices) for matrices in zip(*steps, strict=True))
        covariance = np.zeros((n, n))
        air = slice(ns, n - ns)
        covariance[air, air] = stationary_covariance(
            np.ascontiguousarray(f[0, air, air]), np.ascontiguousarray(q[0, air, air])
        )
        variance = values.noise + window.floor
        return System(window.level, f, q, early, late, np.stack(outputs), variance, covariance)

    def record(self, p: Array, window: Window, own: Array) -> Record:
        """What the filter reads at parameters p (size,).

        Args:
            own: the window's own constants: of each channel in its SI unit, then the copy's state at the first sample.
        """
        ns, theta = self.states, self.physical(p).derivatives
        aerodynamic = window.start @ theta.T + window.aerodynamic
        start = aerodynamic + window.kinematic
        known = window.aerodynamic + window.kinematic
        end = window.end @ theta.T + np.vstack([known[1:], known[-1:]])
        readings = window.readings - own[: window.readings.shape[1]]
        readings[:, ns:] -= aerodynamic[:, self.forces] - start @ self.lever[self.forces].T
        state = np.zeros(self.size(window))
        state[-ns:] = own[window.readings.shape[1] :]
        return Record(readings, window.used, start, end, state)

    def _has_lag(self, window: Window) -> bool:
        return self.vane_ahead_m / window.airspeed_m_s > _LEAST_LAG * window.dt

    def _dynamics(self, values: Physical, window: Window, stability: float) -> tuple[Array, Array]:
        """A of the whole filter, and C."""
        ns, n, at = self.states, self.size(window), self.layout
        structure = at.structure
        force = stability * values.derivatives[:, :ns]
        copy = stability * values.copy
        c, f, d = ns, ns + 2, n - ns - at.disturbances
        a = np.zeros((n, n))
        a[c, c] = a[c + 1, c + 1] = -1.0 / values.gust_s
        a[c + 1, c] = 1.0 / values.gust_s
        vane = np.zeros(n)
        vane[c], vane[c + 1] = _NUMERATOR, 1.0 - _NUMERATOR
        gust = vane
        if self._has_lag(window):
            # Pade of second order, g = g_vane - l_2, l_1' = l_2 / T, l_2' = (12 (g_vane - l_1) - 6 l_2) / T
            rate = window.airspeed_m_s / self.vane_ahead_m
            a[f + 1, f + 2] = rate
            a[f + 2] = 12.0 * rate * vane
            a[f + 2, f + 1] -= 12.0 * rate
            a[f + 2, f + 2] -= 6.0 * rate
            gust = vane.copy()
            gust[f + 2] = -1.0
        a[f] = gust / values.span_s
        a[f, f] -= 1.0 / values.span_s
        velocity = structure.states[0]
        turning = _GRADIENT[velocity] / window.airspeed_m_s * a[f]
        by_rate = values.gust_rate_gain * force[:, structure.states.index(_GUST_AT[velocity])]
        air = np.outer(force[:, 0], gust) + np.outer(by_rate, turning)
        a[:ns, :ns] = window.known + force
        a[:ns] -= air
        y = n - ns
        a[y:, y:] = window.known + copy
        for i in range(at.moments):
            a[d + i, d + i] = -1.0 / values.moment_s
            a[y + 1 + i, d + i] = 1.0
        if at.rolling_air:
            roll = d + at.moments
            a[roll, roll] = -1.0 / self.rolling_s
            a[y:, roll] = -copy[:, structure.states.index("p")]
        return a, self._output(a, force, copy, air, vane)

    def _output(self, a: Array, force: Array, copy: Array, air: Array, vane: Array) -> Array:
        """C: states as vane and gyros read them, then the accelerometers."""
        ns, n = self.states, a.shape[0]
        output = np.zeros((self.layout.channels, n))
        output[:ns, :ns] = output[:ns, n - ns :] = np.eye(ns)
        output[0] -= vane
        for place, row in enumerate(self.forces):
            reading = output[ns + place]
            reading[:ns] = force[row]
            reading -= air[row]
            reading[n - ns :] = copy[row]
            if self.layout.rolling_air:
                roll = n - ns - 1
                reading[roll] -= copy[row, self.layout.structure.states.index("p")]
            reading -= self.lever[row] @ (a[:ns] + a[n - ns :])
        return output

    def _noise(self, values: Physical, n: int) -> Array:
        """Intensity of the process noise."""
        ns, at = self.states, self.layout
        noise = np.zeros((n, n))
        noise[ns, ns] = 4.0 * values.gust**2 / (values.gust_s * (1.0 + _NUMERATOR**2))
        first = n - ns - at.disturbances
        for i, intensity in enumerate(values.disturbance):
            time = self.rolling_s if at.rolling_air and i == at.moments else values.moment_s
            noise[first + i, first + i] = 2.0 * intensity**2 / time
        return noise
