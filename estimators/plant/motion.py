"""The linear model of a mode: motion, moving air, sensors; stated once, for whatever estimates from it.

Deviations x from trim obey, with the referred derivatives Theta = (A B), s and c the factors of stability and control
derivatives at the present airspeed and density, K what is known of kinematics (U in the column of q, and so on),

    x' = (K + s A) x + c B u - s A g_a + known accelerations,                                              (1)

and a sensor reads a state, or of equation i the specific force at its place,

    a_i = row i of (s A x + c B u - s A g_a) - lever_i x'.                                                 (2)

In still air g_a = 0 and the state is x. In moving air it is, in this order (s of them belong to the structure):

    s      x    motion that surfaces and gusts cause, through the derivatives
    2      c    the two states of a Dryden gust
    1      f    the gust through the span filter, which makes its gradient along the flight path
    2      l    lag of the gust behind the vane (only with a vane ahead)
    m      d    unmeasured accelerations, one each moment equation, and rolling air
    s      y    motion that they and what happened before the window cause, through a copy of the derivatives

with docs/methods/filter_error.md, (2) to (4). A, B and C are affine in Theta: a difference of two of them over the
difference of a derivative is their slope, without a term that is left out.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import ModeStructure

__all__ = ["Air", "Flown", "Linear", "Plant"]

Array = NDArray[np.float64]

_NUMERATOR = np.sqrt(3.0)
"""Of the Dryden spectrum of vertical and lateral gusts, (1 + sqrt(3) T s) / (1 + T s)^2."""

_LEAST_LAG = 0.02
"""Of a step: a vane that is less ahead than this is at the aircraft."""

_GUST_AT = {"w": "q", "v": "r"}
"""Rate that a gust of this velocity turns the air at."""

_GRADIENT = {"w": -1.0, "v": 1.0}
"""Sign of that rate: q_g = -(dw_g/dt)/V, r_g = +(dv_g/dt)/V."""


class Air(NamedTuple):
    """Moving air and unmeasured moments, in their units.

    Attributes:
        copy: stability derivatives of the motion that they cause, (equations, states).
        gust: intensity, m/s; gust_rate_gain: how much of the turning air each equation meets, (equations,).
        span_s, gust_s, moment_s: time constants of the span filter, the gust and the moments.
        disturbance: intensities of moments, rad/s2, and of rolling air, rad/s, (disturbances,).
    """

    copy: Array
    gust: float
    gust_rate_gain: Array
    span_s: float
    gust_s: float
    moment_s: float
    disturbance: Array


class Flown(NamedTuple):
    """Where the model is linearised: K (states, states), s, airspeed in m/s, the sensors' step in s."""

    known: Array
    stability: float
    airspeed_m_s: float
    dt: float


class Linear(NamedTuple):
    """A (n, n) and C (channels, n) of the whole state, and the intensity of its process noise, (n, n)."""

    a: Array
    c: Array
    noise: Array


@dataclass(frozen=True, slots=True)
class Plant:
    """A mode of an aircraft with its sensors.

    Attributes:
        structure: which mode.
        forces: equations whose accelerometer is read, behind the states.
        lever: of the accelerometers, (equations, states), m.
        vane_ahead_m: how far ahead of the centre of gravity the vane is; one behind it is taken to be at it.
        rolling_s: time constant of rolling air.
    """

    structure: ModeStructure
    forces: NDArray[np.int64]
    lever: Array
    vane_ahead_m: float = 0.0
    rolling_s: float = np.inf

    @property
    def states(self) -> int:
        """How many of the structure."""
        return len(self.structure.states)

    @property
    def channels(self) -> int:
        """Readings of a sample: the states, then the accelerometers."""
        return self.states + self.forces.size

    @property
    def channel_names(self) -> list[str]:
        """Of the readings."""
        s = self.structure
        return [*s.states, *(f"a_{s.equations[f]}" for f in self.forces)]

    @property
    def rolling_air(self) -> bool:
        """Whether air that rolls about the flight path is modelled: where roll rate is a state."""
        return "p" in self.structure.states

    @property
    def disturbances(self) -> int:
        """Unmeasured moments, those of all equations but the first, the force, and rolling air."""
        return self.states - 1 + int(self.rolling_air)

    def has_lag(self, airspeed_m_s: float, dt: float) -> bool:
        """Whether the vane meets the gust earlier than the aircraft, at airspeed in m/s and a step ``dt`` in s."""
        return self.vane_ahead_m / airspeed_m_s > _LEAST_LAG * dt

    def size(self, air: bool, airspeed_m_s: float, dt: float) -> int:
        """States in all; ``air``: whether it moves; airspeed in m/s, step ``dt`` in s."""
        if not air:
            return self.states
        return 2 * self.states + 3 + 2 * self.has_lag(airspeed_m_s, dt) + self.disturbances

    def linear(self, derivatives: Array, air: Air | None, at: Flown) -> Linear:
        """The model at referred derivatives, concise, (equations, states + inputs)."""
        ns = self.states
        force = at.stability * derivatives[:, :ns]
        n = self.size(air is not None, at.airspeed_m_s, at.dt)
        a, c = np.zeros((n, n)), np.zeros((self.channels, n))
        a[:ns, :ns] = at.known + force
        c[:ns, :ns] = np.eye(ns)
        c[ns:, :ns] = force[self.forces]
        noise = np.zeros((n, n))
        if air is not None:
            self._move_air(air, force, at, Linear(a, c, noise))
        moving = a[:ns] if air is None else a[:ns] + a[n - ns :]
        c[ns:] -= self.lever[self.forces] @ moving
        return Linear(a, c, noise)

    def direct(self, derivatives: Array) -> Array:
        """What sensors read at once of the regressors (c u, and s x where it is given) and of the known accelerations
        behind them, but for those that the accelerometer feels itself, (channels, states + inputs + states)."""
        out = np.zeros((self.channels, derivatives.shape[1] + self.states))
        lever = self.lever[self.forces]
        out[self.states :] = np.column_stack([derivatives[self.forces] - lever @ derivatives, -lever])
        return out

    def _move_air(self, air: Air, force: Array, at: Flown, into: Linear) -> None:
        """What the air adds to still air's A, C and process noise."""
        a, c, ns, n = into.a, into.c, self.states, len(into.a)
        velocity = self.structure.states[0]
        vane, gust = self._gust(air, at, a)
        turning = _GRADIENT[velocity] / at.airspeed_m_s * a[ns + 2]
        by_rate = air.gust_rate_gain * force[:, self.structure.states.index(_GUST_AT[velocity])]
        felt = np.outer(force[:, 0], gust) + np.outer(by_rate, turning)
        a[:ns] -= felt
        c[0] -= vane
        c[:ns, n - ns :] = np.eye(ns)
        c[ns:] -= felt[self.forces]
        self._disturb(air, at, into)
        into.noise[ns, ns] = 4.0 * air.gust**2 / (air.gust_s * (1.0 + _NUMERATOR**2))

    def _gust(self, air: Air, at: Flown, a: Array) -> tuple[Array, Array]:
        """Rows of the gust's states in A, and the gust as vane and aircraft meet it, (n,) each."""
        c, f = self.states, self.states + 2
        a[c, c] = a[c + 1, c + 1] = -1.0 / air.gust_s
        a[c + 1, c] = 1.0 / air.gust_s
        vane = np.zeros(len(a))
        vane[c], vane[c + 1] = _NUMERATOR, 1.0 - _NUMERATOR
        gust = vane
        if self.has_lag(at.airspeed_m_s, at.dt):
            # Pade of second order, g = g_vane - l_2, l_1' = l_2 / T, l_2' = (12 (g_vane - l_1) - 6 l_2) / T
            rate = at.airspeed_m_s / self.vane_ahead_m
            a[f + 1, f + 2] = rate
            a[f + 2] = 12.0 * rate * vane
            a[f + 2, f + 1] -= 12.0 * rate
            a[f + 2, f + 2] -= 6.0 * rate
            gust = vane.copy()
            gust[f + 2] = -1.0
        a[f] = gust / air.span_s
        a[f, f] -= 1.0 / air.span_s
        return vane, gust

    def _disturb(self, air: Air, at: Flown, into: Linear) -> None:
        """Unmeasured moments, rolling air, and the motion that they cause."""
        ns, n = self.states, len(into.a)
        y, d = n - ns, n - ns - self.disturbances
        copy = at.stability * air.copy
        into.a[y:, y:] = at.known + copy
        into.c[ns:, y:] = copy[self.forces]
        times = [*[air.moment_s] * (ns - 1), *[self.rolling_s] * self.rolling_air]
        for i, (time, intensity) in enumerate(zip(times, air.disturbance, strict=True)):
            into.a[d + i, d + i] = -1.0 / time
            into.noise[d + i, d + i] = 2.0 * intensity**2 / time
            if i < ns - 1:
                into.a[y + 1 + i, d + i] = 1.0
        if self.rolling_air:
            by_roll = copy[:, self.structure.states.index("p")]
            into.a[y:, y - 1] = -by_roll
            into.c[ns:, y - 1] -= by_roll[self.forces]
