"""A wandering level: the smoother that is chosen predicts as well as the best there is."""

import numpy as np
import pytest

from wingwatch.estimators.kernels.levels import LEVELS, SLOWEST_S, advance_level, start_level

DT = 0.02


def follow(readings: np.ndarray, motion: np.ndarray) -> tuple[int, np.ndarray]:
    """Index of the smoother that is gone by at the end, and the memory."""
    memory = np.zeros((4, LEVELS))
    start_level(memory, readings[0])
    index = 0
    for reading, step in zip(readings[1:], motion[1:], strict=True):
        index = advance_level(memory, reading, step, DT, 10.0)
    return int(index), memory


@pytest.mark.parametrize("gust_over_noise", [0.03, 0.3, 1.0])
def test_the_gain_is_that_of_the_steady_kalman_filter(gust_over_noise: float) -> None:
    """Q = K^2 R / (1 - K): the mean gain over seeds within one step of the grid (a factor 1.5 in time constant)."""
    q = gust_over_noise**2
    optimal = 0.5 * (np.sqrt(q * q + 4.0 * q) - q)
    gains = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        level = np.cumsum(gust_over_noise * rng.standard_normal(2000))
        index, memory = follow(level + rng.standard_normal(2000), np.zeros(2000))
        gains.append(memory[0, index])
    lag = -DT / np.log(1.0 - np.array(gains))
    best = -DT / np.log(1.0 - optimal)
    assert 1.0 / 1.5 < np.exp(np.mean(np.log(lag / best))) < 1.5 * 1.5, (
        "slower smoothers are preferred within chance"
    )


def test_a_level_at_rest_is_smoothed_the_most() -> None:
    rng = np.random.default_rng(1)
    chosen = [follow(rng.standard_normal(1000), np.zeros(1000))[0] for _ in range(20)]
    assert np.mean(np.array(chosen) == LEVELS - 1) >= 0.8


def test_known_motion_is_no_unrest() -> None:
    """A level that moves as it is said to is followed by the slowest smoother and without lag."""
    rng = np.random.default_rng(2)
    motion = 0.5 * rng.standard_normal(1500)
    motion[0] = 0.0
    level = np.cumsum(motion)
    index, memory = follow(level + 0.1 * rng.standard_normal(1500), motion)
    assert index == LEVELS - 1
    # the slowest smoother averages over 2 * 4 s / 0.02 s samples: 0.1 / sqrt(400), five times over
    assert abs(memory[1, index] - level[-1]) < 5.0 * 0.1 * np.sqrt(DT / (2.0 * SLOWEST_S))
    still, _ = follow(level + 0.1 * rng.standard_normal(1500), np.zeros(1500))
    assert still < LEVELS // 2
