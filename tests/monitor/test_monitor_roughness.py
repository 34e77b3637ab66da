"""Roughness that the accelerometer feels: gusts count, noise, smooth motion and single jerks do not."""

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.monitor.estimation.roughness import (
    MEAN_S,
    MEAN_SAMPLES,
    ROUGHNESS,
    ROUGHNESS_SAMPLES,
    follow_roughness,
    is_gusty,
)

NOISE = 0.03


def followed(readings: NDArray[np.float64], cuts: int = 1) -> NDArray[np.float64]:
    memory, times = np.zeros((2, ROUGHNESS)), 0.02 * np.arange(readings.size)
    for clock, piece in zip(np.array_split(times, cuts), np.array_split(readings, cuts), strict=True):
        follow_roughness(memory[0], clock, np.ascontiguousarray(piece), 0.0, ROUGHNESS_SAMPLES)
        follow_roughness(memory[1], clock, np.ascontiguousarray(piece), MEAN_S, MEAN_SAMPLES)
    return memory


def readings(gust_step: float, seed: int) -> NDArray[np.float64]:
    """60 s of white noise, a slow motion of 5 m/s2, a jerk of the surface every 10 s, and a random walk."""
    rng, time = np.random.default_rng(seed), 0.02 * np.arange(3000)
    jerks = 3.0 * (time % 10.0 < 0.1)
    walk = gust_step * rng.standard_normal(3000).cumsum()
    return np.asarray(-9.8 + 5.0 * np.sin(time) + jerks + walk + NOISE * rng.standard_normal(3000))


@pytest.mark.parametrize("seed", range(5))
def test_gusts_are_told_from_noise_motion_and_jerks(seed: int) -> None:
    assert not is_gusty(followed(readings(0.0, seed)), NOISE**2)
    assert is_gusty(followed(readings(0.15, seed)), NOISE**2)


def test_cuts_and_missing_readings_change_nothing() -> None:
    whole = readings(0.1, 1)
    spoilt = np.insert(whole, [100, 2000], np.nan)
    np.testing.assert_array_equal(followed(whole), followed(whole, 300))
    np.testing.assert_array_equal(followed(whole)[0], followed(spoilt, 7)[0])


@pytest.mark.parametrize("seed", range(5))
def test_gusts_that_drown_in_noise_are_felt_in_means(seed: int) -> None:
    """A tenth of the noise's second differences from sample to sample, ten times as much in means of five."""
    quiet, gusty = followed(readings(0.0, seed)), followed(readings(0.02, seed))
    assert is_gusty(gusty, NOISE**2)
    assert not is_gusty(np.stack([gusty[0], quiet[1]]), NOISE**2)


def test_nothing_is_said_before_there_is_a_level() -> None:
    assert not is_gusty(followed(readings(1.0, 2)[:40]), NOISE**2)


def test_with_noise_unknown_roughness_counts_as_the_airs() -> None:
    assert is_gusty(followed(readings(0.0, 3)), 0.0)
