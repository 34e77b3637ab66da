"""Plants of two degrees of freedom in still and rough air, with an autopilot, with moments nobody measures.

The air moves as Dryden's spectrum has it (second order), and its gradient along the path, through a span filter, turns
the aircraft; the vane may be ahead. Integrated at half a millisecond: with 2 ms the moment derivatives of a good method
are biased by three of its errors.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

from wingwatch.aircraft import DUTCH_ROLL, SHORT_PERIOD, ModeStructure
from wingwatch.estimators import Manoeuvre, ManoeuvreConfig
from wingwatch.estimators.manoeuvre import FlightColumns, cut

__all__ = ["PLANTS", "SITUATIONS", "Flight", "Plant", "Situation", "fly"]

Array = NDArray[np.float64]

AIRSPEED_M_S, DENSITY_KG_M3, SPAN_M = 25.0, 1.112, 2.9
LIGHT_M_S, MODERATE_M_S = 0.75, 1.5
FINE = 40
"""Steps of integration in a sample of 20 ms."""


@dataclass(frozen=True)
class Plant:
    """A mode with the thesis's linearised Aerosonde derivatives (tables 7.2 and 7.7) and its doublet."""

    structure: ModeStructure
    derivatives: tuple[float, ...]
    pulse_s: float

    @property
    def turn(self) -> float:
        """What the rate's column of the force equation holds of the forward speed."""
        return AIRSPEED_M_S if self.structure is SHORT_PERIOD else -AIRSPEED_M_S

    @property
    def aerodynamic(self) -> Array:
        """Derivatives less the forward speed."""
        return np.asarray(np.array(self.derivatives) - np.array([0.0, self.turn, 0.0, 0.0, 0.0, 0.0]))


PLANTS = {
    "short_period": Plant(SHORT_PERIOD, (-4.139, 24.33, -2.361, -4.289, -6.035, -32.54), 0.2018),
    "dutch_roll": Plant(DUTCH_ROLL, (-0.643, -25.02, 3.517, 0.684, -1.043, -22.10), 0.3846),
}


@dataclass(frozen=True)
class Situation:
    """What happens in a flight.

    Attributes:
        doublets: (first, every), s; none where None.
        autopilot: (gain on rate, gain on its integral); open loop where None.
        gust_m_s: intensity; scale_m: length; first_order: of the spectrum instead of Dryden's second.
        span_m: of the air's span filter; turning: whether gusts turn the air.
        moment: unmeasured angular acceleration of time, rad/s2.
        vane_ahead_m: of the vane; said_ahead_m: what the estimator is given, the same where None.
        surface_noise_rad: of the measured surface, which then moves on a line between samples instead of being held.
    """

    doublets: tuple[float, float] | None = None
    autopilot: tuple[float, float] | None = None
    gust_m_s: float = 0.0
    scale_m: float = 50.0
    first_order: bool = False
    span_m: float = SPAN_M
    turning: bool = True
    moment: Callable[[Array], Array] | None = None
    vane_ahead_m: float = 0.0
    said_ahead_m: float | None = None
    surface_noise_rad: float = 0.0


def bump(time_s: Array) -> Array:
    """A moment of 1.5 s every 10 s, of changing sign."""
    since = np.mod(time_s - 3.0, 10.0)
    on = (time_s > 3.0) & (since < 1.5)
    sign = np.where(np.mod((time_s - 3.0) // 10.0, 2.0) < 1.0, 1.0, -1.0)
    return np.where(on, 0.35 * sign * np.sin(np.pi * since / 1.5) ** 2, 0.0)


def steps(time_s: Array) -> Array:
    """Moments that come and stay."""
    return np.asarray(0.3 * (time_s > 20.0) - 0.5 * (time_s > 40.0))


_AP = (0.1, 0.3)
_D5, _D10 = (2.0, 5.0), (2.0, 10.0)
_LIGHT, _MODERATE = LIGHT_M_S, MODERATE_M_S

SITUATIONS: dict[str, Situation] = {
    "still, doublets": Situation(_D5),
    "still, autopilot, doublets": Situation(_D10, _AP),
    "still, autopilot": Situation(None, _AP),
    "quiet": Situation(),
    "light, doublets": Situation(_D5, gust_m_s=_LIGHT),
    "moderate, doublets": Situation(_D5, gust_m_s=_MODERATE),
    "moderate": Situation(gust_m_s=_MODERATE),
    "light, autopilot, doublets": Situation(_D10, _AP, _LIGHT),
    "light, autopilot": Situation(None, _AP, _LIGHT),
    "moderate, autopilot, doublets": Situation(_D10, _AP, _MODERATE),
    "moderate, autopilot": Situation(None, _AP, _MODERATE),
    "moment": Situation(moment=bump),
    "moment, autopilot": Situation(None, _AP, moment=bump),
    "moment, doublets": Situation((3.5, 10.0), moment=bump),
    "moment, autopilot, doublets": Situation((3.5, 10.0), _AP, moment=bump),
    "moderate, moment, autopilot": Situation(None, _AP, _MODERATE, moment=bump),
    "moderate, moment, autopilot, doublets": Situation((3.5, 10.0), _AP, _MODERATE, moment=bump),
    "moment steps, autopilot": Situation(None, _AP, moment=steps),
    "moderate, 25 m, autopilot": Situation(None, _AP, _MODERATE, 25.0),
    "moderate, 100 m, autopilot": Situation(None, _AP, _MODERATE, 100.0),
    "moderate, first order, autopilot": Situation(None, _AP, _MODERATE, first_order=True),
    "moderate, half span, autopilot": Situation(None, _AP, _MODERATE, span_m=1.45),
    "moderate, no turning air, autopilot": Situation(None, _AP, _MODERATE, turning=False),
    "moderate, vane ahead, autopilot": Situation(None, _AP, _MODERATE, vane_ahead_m=0.3),
    "moderate, vane ahead unsaid, autopilot": Situation(
        None, _AP, _MODERATE, vane_ahead_m=0.3, said_ahead_m=0.0
    ),
    "still, doublets, surface noise": Situation(_D5, surface_noise_rad=math.radians(0.1)),
    "quiet, surface noise": Situation(surface_noise_rad=math.radians(0.1)),
    "still, autopilot, doublets, surface noise": Situation(_D10, _AP, surface_noise_rad=math.radians(0.1)),
    "moderate, autopilot, surface noise": Situation(
        None, _AP, _MODERATE, surface_noise_rad=math.radians(0.1)
    ),
}


@dataclass(frozen=True)
class Flight:
    """Manoeuvres of one flight, and what the estimator may know of it."""

    parts: tuple[Manoeuvre, ...]
    expected: Array
    natural: Array
    vane_ahead_m: float


@njit(cache=True)
def _steps(state, a, b, surface, gust, moment, air, forward):  # type: ignore[no-untyped-def]
    """Midpoint steps of one sample; state is velocity, rate and the gust behind the span filter.

    ``surface`` is where it is at the sample's start and at its end; ``air`` is the step, the span filter's time
    constant and the turning air's factor; ``forward`` the part of the force's rate column that is no aerodynamics.
    """
    h, tau, turn = air
    decay = np.exp(-h / tau)
    v, r, f = state
    for i in range(gust.size):
        u = surface[0] + (surface[1] - surface[0]) * (i + 0.5) / gust.size
        g, before = gust[i], f
        f = g + (f - g) * decay
        turning = turn * (g - 0.5 * (f + before)) / tau
        lost = (a[0, 1] - forward) * turning
        rate_v = a[0, 0] * (v - g) + a[0, 1] * r - lost + b[0] * u
        rate_r = a[1, 0] * (v - g) + a[1, 1] * (r - turning) + b[1] * u + moment[i]
        mid_v, mid_r = v + 0.5 * h * rate_v, r + 0.5 * h * rate_r
        v += h * (a[0, 0] * (mid_v - g) + a[0, 1] * mid_r - lost + b[0] * u)
        r += h * (a[1, 0] * (mid_v - g) + a[1, 1] * (mid_r - turning) + b[1] * u + moment[i])
    state[0], state[1], state[2] = v, r, f


def _gusts(situation: Situation, n: int, h: float, rng: np.random.Generator) -> Array:
    """n values of the gust at steps of h, exact in its variance."""
    if situation.gust_m_s == 0.0:
        return np.zeros(n)
    t = situation.scale_m / AIRSPEED_M_S
    if situation.first_order:
        numerator, denominator = [math.sqrt(2.0)], [t, 1.0]
    else:
        numerator, denominator = [math.sqrt(3.0) * t, 1.0], [t * t, 2.0 * t, 1.0]
    b, a, _ = cont2discrete((np.array(numerator), np.array(denominator)), h, "zoh")
    warm = round(20.0 * t / h)
    pulse = np.zeros(warm)
    pulse[0] = 1.0
    size = math.sqrt(float(np.sum(lfilter(b[0], a, pulse) ** 2)))
    raw = lfilter(b[0], a, rng.standard_normal(n + warm))[warm:]
    return np.asarray(raw * situation.gust_m_s / size)


def _commands(situation: Situation, plant: Plant, time_s: Array) -> Array:
    if situation.doublets is None:
        return np.zeros(time_s.size)
    first, every = situation.doublets
    since = np.where(time_s >= first, np.mod(time_s - first, every), -1.0)
    up = (since >= 0.0) & (since < plant.pulse_s)
    down = (since >= plant.pulse_s) & (since < 2.0 * plant.pulse_s)
    return np.asarray(math.radians(2.0) * (up.astype(float) - down.astype(float)))


def noise_std(plant: Plant) -> Array:
    """A fifth of each signal's spread in 12 s of still air with one doublet, (3,): signal-to-noise 5."""
    still = Situation((2.0, 100.0))
    states, force, _, _ = _response(plant, still, 12.0, 0.02, np.zeros(3), np.random.default_rng(0))
    return np.asarray(np.column_stack([states, force]).std(axis=0) / 5.0)


def _response(
    plant: Plant, situation: Situation, seconds: float, dt: float, std: Array, rng: np.random.Generator
) -> tuple[Array, Array, Array, Array]:
    """Measured states (n, 2), force (n,) and applied surface (n,), time (n,); noise of ``std`` is in the first two."""
    n, held = round(seconds / dt), situation.surface_noise_rad == 0.0
    fine = max(round(FINE * dt / 0.02), 4)
    h = dt / fine
    matrix = np.array(plant.derivatives).reshape(2, 3)
    a, b = np.ascontiguousarray(matrix[:, :2]), np.ascontiguousarray(matrix[:, 2])
    longitudinal = plant.structure is SHORT_PERIOD
    sign = -1.0 if longitudinal else 1.0
    gust = _gusts(situation, n * fine, h, rng)
    grid = np.arange(n * fine, dtype=np.float64) * h
    moment = np.zeros(n * fine) if situation.moment is None else situation.moment(grid)
    tau = (4.0 if longitudinal else 3.0) * situation.span_m / (math.pi * AIRSPEED_M_S)
    turn = sign / AIRSPEED_M_S if situation.turning else 0.0
    ahead = round(situation.vane_ahead_m / AIRSPEED_M_S / h)
    time = np.arange(n, dtype=np.float64) * dt
    planned = _commands(situation, plant, time)
    noise = rng.standard_normal((n, 3)) * std
    states, force, surface = np.zeros((n, 2)), np.zeros(n), np.zeros(n)
    state, answer, angle = np.array([0.0, 0.0, gust[0]]), 0.0, 0.0
    for k in range(n):
        u = planned[k] + answer
        g, at_vane = gust[k * fine], gust[min(k * fine + ahead, gust.size - 1)]
        arm = situation.vane_ahead_m * sign
        states[k] = state[0] - at_vane + arm * state[1], state[1]
        turning = turn * (g - state[2]) / tau
        force[k] = a[0, 0] * (state[0] - g) + (a[0, 1] - plant.turn) * (state[1] - turning) + b[0] * u
        states[k] += noise[k, :2]
        force[k] += noise[k, 2]
        surface[k] = u
        span = slice(k * fine, (k + 1) * fine)
        if situation.autopilot is not None:
            angle += dt * states[k, 1]
            sense = 1.0
            answer = float(
                np.clip(
                    sense * (situation.autopilot[0] * states[k, 1] + situation.autopilot[1] * angle),
                    -0.3,
                    0.3,
                )
            )
        later = u if held else planned[min(k + 1, n - 1)] + answer
        _steps(state, a, b, (u, later), gust[span], moment[span], (h, tau, turn), plant.turn)
    # as the signals have it: the vane's reading carried to the centre of gravity by the measured rate
    states[:, 0] -= situation.vane_ahead_m * sign * states[:, 1]
    return states, force, surface, time


def fly(
    plant: Plant, situation: Situation, seed: int, seconds: float = 60.0, *,
    window_s: float = 30.0, accelerometer: bool = True, noise: float = 1.0, rate_hz: float = 50.0,
) -> Flight:  # fmt: skip
    """One flight; what is expected beforehand is 30 % off, up or down, in every derivative."""
    rng = np.random.default_rng(1000 + seed)
    std = noise * noise_std(plant)
    states, force, surface, time = _response(plant, situation, seconds, 1.0 / rate_hz, std, rng)
    off = 1.0 + 0.3 * rng.choice([-1.0, 1.0], 6)
    n = time.size
    known = np.zeros((n, 2, 2))
    known[:, 0, 1] = plant.turn
    accelerations = np.column_stack([force, np.full(n, np.nan)])
    measured_surface = surface + situation.surface_noise_rad * rng.standard_normal(n)
    columns = FlightColumns(
        time, states, accelerations, measured_surface[:, None], known, np.zeros((n, 2)), np.ones(n), np.ones(n),
        np.ones(n), np.ones((n, 2), dtype=bool),
        np.tile([AIRSPEED_M_S, 1000.0, DENSITY_KG_M3, 0.0], (n, 1)),
    )  # fmt: skip
    config = ManoeuvreConfig(
        plant.structure, (AIRSPEED_M_S, DENSITY_KG_M3), held=(situation.surface_noise_rad == 0.0,), window_s=window_s,
        use_accelerometer=accelerometer,
    )  # fmt: skip
    said = situation.vane_ahead_m if situation.said_ahead_m is None else situation.said_ahead_m
    return Flight(cut(config, columns), plant.aerodynamic * off, np.abs(plant.aerodynamic * off), said)


def varied(situation: Situation, **changes: object) -> Situation:
    """The same with some of it changed."""
    return replace(situation, **changes)  # type: ignore[arg-type]
