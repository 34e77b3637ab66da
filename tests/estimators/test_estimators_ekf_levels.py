"""Levels of the filter's noise in gusts and with coarse sensors, on a short period whose gusts walk at random."""

import numpy as np
import pytest
from estimator_plants import PITCH, RATE_HZ, REFERENCE, SOLVE_EVERY, Array
from scipy.integrate import quad

from wingwatch.aircraft import GRAVITY_M_S2
from wingwatch.estimators import EkfConfig, EkfEstimator, EkfState, SignalLayout
from wingwatch.estimators.ekf.noise import process_noise
from wingwatch.estimators.ekf.recursion import step_of
from wingwatch.estimators.ekf.sample import Sample
from wingwatch.estimators.ekf.state import TURN

DT, FINE = 1.0 / RATE_HZ, 10
SPEED_M_S = REFERENCE[0]


def flights(seconds: float, gust_m_s: float, noise: tuple[float, float, float], vehicles: int) -> Array:
    """Signals (vehicles, samples, columns) of doublets each 5 s, rests between.

    The gust is a random walk of ``gust_m_s`` a sample; ``noise`` is of vane, gyro and accelerometer.
    """
    rng, layout, samples = np.random.default_rng(3), SignalLayout(2, 1), round(seconds * RATE_HZ)
    a, since = PITCH.aerodynamic.reshape(2, 3), np.mod(np.arange(samples) * DT, 5.0)
    surface = np.radians(2.0) * ((since < PITCH.pulse_s) * 1.0 - (np.abs(since / PITCH.pulse_s - 1.5) < 0.5))
    rows = np.zeros((vehicles, samples, layout.columns))
    w = q = np.zeros(vehicles)
    for k in range(samples):
        read = np.array([w, q, a[0, 0] * w + a[0, 1] * q + a[0, 2] * surface[k]])
        rows[:, k, 1:4] = read.T + np.array(noise) * rng.standard_normal((vehicles, 3))
        for _ in range(FINE):
            force = a[0, 0] * w + a[0, 1] * q + a[0, 2] * surface[k]
            turn = a[1, 0] * w + a[1, 1] * q + a[1, 2] * surface[k]
            w = w + DT / FINE * (force + SPEED_M_S * q)
            w, q = w + gust_m_s / np.sqrt(FINE) * rng.standard_normal(vehicles), q + DT / FINE * turn
    rows[:, :, 0] = np.arange(samples) * DT
    rows[:, :, layout.accelerometer] -= GRAVITY_M_S2
    rows[:, :, layout.first_input] = surface
    c = layout.kinematic
    rows[:, :, c] = SPEED_M_S * rows[:, :, 2] + GRAVITY_M_S2
    rows[:, :, c + 1 : c + 5] = [1.0, SPEED_M_S, REFERENCE[1], 1000.0]
    rows[:, :, c + 6] = 1.0
    return rows


def watched(rows: Array, span_m: float = 0.0) -> tuple[EkfEstimator, EkfState]:
    """A filter that starts 30 % off, and its state after the flights."""
    value = PITCH.aerodynamic
    config = EkfConfig(PITCH.structure, 0.7 * value, np.abs(value), REFERENCE, held=(True,), span_m=span_m)
    estimator = EkfEstimator(config)
    state = estimator.init(len(rows))
    for start in range(0, rows.shape[1], SOLVE_EVERY):
        estimator.update(state, rows[:, start : start + SOLVE_EVERY])
        estimator.solve(state)
    return estimator, state


def scores(estimator: EkfEstimator, state: EkfState) -> Array:
    """Errors over stated errors of the force's derivatives by velocity and rate, (vehicles, 2)."""
    found = [estimator.estimate(state, i) for i in range(len(state.z))]
    return np.array([((e.value - PITCH.truth) / e.standard_error)[:2] for e in found])


def test_in_gusts_their_level_and_the_vanes_noise_are_told_apart() -> None:
    """The gust's variance within a third, the vane's noise within a hundredth of it; the errors hold."""
    gust, vane = 0.25, 0.008
    estimator, state = watched(flights(60.0, gust, (vane, 0.0034, 0.03), 12))
    assert np.median(state.noise.gust) == pytest.approx(gust**2, rel=1.0 / 3.0)
    assert np.median(state.noise.reading[:, 0]) < 0.01 * gust**2
    assert np.sqrt(np.mean(np.square(scores(estimator, state)))) < 1.3


def test_a_coarse_accelerometer_does_not_wear_the_force_derivatives_off() -> None:
    """An accelerometer is no input: at 0.33 m/s2 z_w stays within its errors through the rests between doublets."""
    rows = flights(60.0, 0.0, (0.1, 0.004, 0.33), 12)
    assert np.sqrt(np.mean(np.square(scores(*watched(rows))))) < 1.3


def test_a_gust_turns_the_air_by_its_slope_over_the_span() -> None:
    """Variance of the air's rate after a step in which gusts strike evenly, beside the integral over their times.

    The filter takes the chord of the exponential, whose mean square is faded^2 / 6 above.
    """
    span_m = 2.9
    estimator, state = watched(flights(8.0, 0.1, (0.01, 0.003, 0.03), 1), span_m)
    model, (older, new) = estimator.model, state.rows[0, ::-1]
    step = step_of(model, Sample(new, older, older, DT, True, 0.0), False, estimator.model.gust_direction)
    still = np.eye(model.sizes.dynamic, model.sizes.augmented)
    turn = model.sizes.states + TURN
    still[turn, turn] = step.decay[TURN]
    length_m = 4.0 * span_m / np.pi
    faded = DT * SPEED_M_S / length_m
    walked = quad(lambda s: np.exp(-2.0 * s * faded), 0.0, 1.0)[0] / length_m**2
    found = process_noise(model, state.noise, 0, still, step)[turn, turn]
    assert found == pytest.approx(state.noise.gust[0] * walked, rel=faded**2 / 4.0)
