"""Flights of linear plants of any structure for the estimators that work on files, truth by construction."""

from dataclasses import dataclass

import numpy as np
from estimator_plants import LEVEL, PITCH, REFERENCE, YAW, Plant, add_noise, doublets, make_signals
from numpy.typing import NDArray
from scipy.linalg import expm

from wingwatch.aircraft import LATERAL
from wingwatch.estimators import Manoeuvre, ManoeuvreConfig, SignalLayout, manoeuvres

Array = NDArray[np.float64]

LATERAL_TRUTH = np.array(
    [-0.6, 1.5, -24.9, -1.3, 3.4, -3.4, -20.2, 9.5, -115.0, -1.6, 0.69, -2.6, -1.1, -4.4, -21.8]
)
"""Concise derivatives of the Aerosonde's size, in the order of ``LATERAL.derivatives``."""


@dataclass(frozen=True)
class Case:
    plant: Plant
    use_accelerometer: bool = True
    window_s: float = 12.0

    @property
    def config(self) -> ManoeuvreConfig:
        return ManoeuvreConfig(
            self.plant.structure,
            REFERENCE,
            held=(True,),
            use_accelerometer=self.use_accelerometer,
            window_s=self.window_s,
        )

    def clean(self, seconds: float = 12.0, offsets: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
        return make_signals(self.plant, doublets(self.plant, seconds), offsets)

    def noisy(self, seed: int, seconds: float = 12.0, signal_to_noise: float = 5.0) -> Array:
        clean = self.clean(seconds)
        std = clean[:, 1:4].std(axis=0) / signal_to_noise
        return add_noise(self.plant, clean, std, np.random.default_rng(seed))

    def parts(self, rows: Array) -> tuple[Manoeuvre, ...]:
        return manoeuvres(self.config, rows)


CASES = {"short_period": Case(PITCH), "dutch_roll": Case(YAW)}


def without_vane(rows: Array) -> Array:
    """The velocity as thesis 7.2 reconstructs it: the accelerometer and kinematics, integrated by trapezoids."""
    layout = SignalLayout(2, 1)
    rows = rows.copy()
    rate = rows[:, layout.accelerometer] + rows[:, layout.kinematic]
    step = np.diff(rows[:, 0])
    rows[0, 1], rows[1:, 1] = 0.0, np.cumsum(0.5 * step * (rate[1:] + rate[:-1]))
    rows[:, layout.kinematic + 6] = 0.0
    return rows


def lateral_rows(inputs: Array, noise_share: float = 0.0, seed: int = 0, dt: float = 0.02) -> Array:
    """Signal rows of the 4-DOF lateral plant in wings-level flight with W = 1.5 m/s; inputs (n, 2) held, from trim."""
    n = len(inputs)
    derivatives = LATERAL_TRUTH.reshape(3, 5)
    both = np.zeros((5, 5))
    both[:3] = derivatives * dt
    grown = expm(both)
    states = np.zeros((n, 3))
    for k in range(1, n):
        states[k] = grown[:3, :3] @ states[k - 1] + grown[:3, 3:] @ inputs[k - 1]
    rates = states @ derivatives[:, :3].T + inputs @ derivatives[:, 3:].T
    alpha = np.arcsin(1.5 / LEVEL.airspeed_true_m_s)
    forward, down = LEVEL.airspeed_true_m_s * np.cos(alpha), 1.5
    force = rates[:, 0] + forward * states[:, 2] - down * states[:, 1]
    rng = np.random.default_rng(seed)
    noisy = states + noise_share * states.std(axis=0) * rng.standard_normal(states.shape)
    layout = SignalLayout(3, 2)
    rows = np.zeros((n, layout.columns))
    rows[:, 0] = dt * np.arange(n)
    rows[:, 1:4] = noisy
    rows[:, layout.accelerometer] = force + noise_share * force.std() * rng.standard_normal(n)
    rows[:, layout.first_input : layout.kinematic] = inputs
    c = layout.kinematic
    rows[:, c] = -forward * noisy[:, 2] + down * noisy[:, 1]
    rows[:, c + 1] = 1.0
    rows[:, c + 2], rows[:, c + 3] = REFERENCE
    rows[:, c + 4], rows[:, c + 5], rows[:, c + 6] = LEVEL.altitude_m, alpha, 1.0
    return rows


def lateral_inputs(seconds: float = 24.0, dt: float = 0.02, ratio: float | None = None) -> Array:
    """Doublets of aileron and, later, rudder, (n, 2); with ``ratio`` the rudder is that times the aileron."""
    time = dt * np.arange(round(seconds / dt))
    inputs = np.zeros((time.size, 2))
    for column, first, half in ((0, 1.0, 0.2), (1, 4.0, 0.4), (0, 12.0, 0.3), (1, 16.0, 0.4)):
        if first + 2.0 * half < seconds:
            inputs[(time >= first) & (time < first + half), column] = np.radians(2.0)
            inputs[(time >= first + half) & (time < first + 2.0 * half), column] = -np.radians(2.0)
    if ratio is not None:
        inputs[:, 1] = ratio * inputs[:, 0]
    return inputs


def lateral_parts(rows: Array) -> tuple[Manoeuvre, ...]:
    return manoeuvres(ManoeuvreConfig(LATERAL, REFERENCE, held=(True, True)), rows)
