"""The filter's noise levels of sensors: what aircraft and surfaces do is no noise."""

import numpy as np
import pytest

from wingwatch.estimators.ekf.adaptation import Residuals
from wingwatch.estimators.ekf.noise import adapt_accelerometer, learn_reading_noise
from wingwatch.estimators.ekf.sample import Sample
from wingwatch.estimators.ekf.state import Noise

SAMPLES, DT, MEMORY_S = 1500, 0.02, 10.0


def learned(readings: np.ndarray, predicted: np.ndarray) -> float:
    """Variance of a rate's reading after all ``readings``, its steps ``predicted`` as the filter would."""
    variance, differences = np.zeros(3), np.zeros((2, 5))
    rows = np.zeros((readings.size, 3))
    rows[:, 2] = readings
    for k in range(2, readings.size):
        z, after = np.zeros(2), np.array([0.0, predicted[k]])
        rate = max(DT / MEMORY_S, 1.0 / (k - 1.0))
        sample = Sample(rows[k], rows[k - 1], rows[k - 2], DT, False, 0.0)
        learn_reading_noise(variance, differences, np.zeros(2), sample, z, after, rate, 2)
    return float(variance[1])


def doublets(amplitude: float) -> np.ndarray:
    """A rate that goes up, down and back within 0.6 s, every 4 s, (SAMPLES,)."""
    t = np.arange(SAMPLES) * DT % 4.0
    pulse = (t < 0.2).astype(float) - ((t >= 0.2) & (t < 0.4))
    return amplitude * np.convolve(pulse, np.ones(10) / 10.0)[:SAMPLES]


def test_a_doublet_s_edges_are_no_noise() -> None:
    """Thirty times the noise's power in the differences at a few edges adds a third at most."""
    levels = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        rate = doublets(300.0) + 1.0 * rng.standard_normal(SAMPLES)
        assert np.mean(np.diff(rate, 2) ** 2) / 6.0 > 4.0
        levels.append(learned(rate, np.zeros(SAMPLES)))
    assert np.mean(levels) < 4.0 / 3.0


def test_predicted_motion_is_no_noise() -> None:
    levels = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        motion = np.cumsum(30.0 * rng.standard_normal(SAMPLES))
        rate = motion + rng.standard_normal(SAMPLES)
        levels.append(learned(rate, np.diff(motion, prepend=0.0)))
    # 1000 differences count: each level is known to 1.7 times 1.39 / sqrt(1000), their mean to 2 %
    assert np.mean(levels) == pytest.approx(1.0, abs=0.08)


def test_a_repeated_reading_is_not_a_silent_sensor() -> None:
    """Held for five samples, as of a slower sensor: only changes count, less what their covariance (none) allows."""
    rng = np.random.default_rng(3)
    held = np.repeat(rng.standard_normal(SAMPLES // 5), 5)
    allowed = 1.4 * 6.0 * np.sqrt(0.5 * DT / MEMORY_S)
    assert learned(held, np.full(SAMPLES, 1e-3)) == pytest.approx(allowed * 2.0 / 6.0, rel=0.2)


def test_an_accelerometer_s_level_that_misfit_has_raised_comes_down_again() -> None:
    """Two seconds of a thousand times the power, and it is what it was a minute later."""
    noise = Noise(
        reading=np.full((1, 3), 1e-2), gust=np.zeros(1), unmeasured=np.zeros((1, 2)), gain=np.zeros(1),
        fisher=np.zeros((1, 2)), corrections=np.zeros(1), inputs=np.zeros((1, 1)), largest=np.ones((1, 3)),
    )  # fmt: skip
    rng, residuals, rate = np.random.default_rng(0), Residuals(0.0, 0.0, 0.1, 0.0, 0.0), DT / MEMORY_S
    levels = []
    for k in range(round(112.0 / DT)):
        std = 1.0 if 50.0 <= k * DT < 52.0 else 0.03
        adapt_accelerometer(noise, 0, (std * rng.standard_normal()) ** 2, residuals, rate, 2)
        levels.append(float(noise.reading[0, 2] + noise.gain[0] * 0.01))
    before, raised, after = (levels[round(s / DT) - 1] for s in (50.0, 52.0, 112.0))
    assert 0.5 * 9e-4 < before < 1.5 * 9e-4
    assert raised > 20.0 * before
    assert after < 2.0 * before
