"""Noise of an input's readings, learned beside its motion."""

import numpy as np
import pytest
from numba import njit
from surface_courses import surface_course

from wingwatch.estimators.kernels.reading_noise import (
    READING_MEMORY,
    follow_reading,
    forget_readings,
    reading_variance,
)

RATE_HZ = 50.0
STATED = 0.00087**2


@njit
def _follow(memory, readings, dt, stated):  # type: ignore[no-untyped-def]
    for reading in readings:
        follow_reading(memory, reading, dt, stated)
    return reading_variance(memory, stated)


def believed(course: np.ndarray, std: float, seed: int = 1, stated: float = STATED) -> float:
    """Standard deviation believed at the end of readings of a course, over the stated one."""
    noise = std * np.random.default_rng(seed).standard_normal(course.size)
    variance = _follow(np.zeros(READING_MEMORY), course + noise, 1.0 / RATE_HZ, stated)
    return float(np.sqrt(variance / STATED))


@pytest.mark.parametrize("manoeuvre", ["rest", "doublets", "3211", "multisine"])
@pytest.mark.parametrize("ratio", [0.2, 0.5, 1.0, 2.0, 4.0])
def test_noise_that_is_not_the_stated_one_is_found_under_any_manoeuvre(manoeuvre: str, ratio: float) -> None:
    course = surface_course(manoeuvre, 120.0, RATE_HZ)
    found = [believed(course, ratio * np.sqrt(STATED), seed) for seed in range(8)]
    assert np.mean(found) == pytest.approx(ratio, rel=0.08)
    assert np.std(found) < 0.12 * ratio


@pytest.mark.parametrize("manoeuvre", ["rest", "doublets", "3211", "multisine"])
def test_exact_readings_have_next_to_no_noise(manoeuvre: str) -> None:
    assert believed(surface_course(manoeuvre, 60.0, RATE_HZ), 0.0) < 0.05


def test_what_is_stated_counts_until_enough_is_seen() -> None:
    course = surface_course("rest", 0.5, RATE_HZ)
    assert believed(course, 3.0 * np.sqrt(STATED)) == 1.0


def test_an_exact_input_stays_exact() -> None:
    assert believed(surface_course("doublets", 20.0, RATE_HZ), 0.01, stated=0.0) == 0.0


def test_a_slow_sensor_repeats_its_readings_and_is_no_less_noisy() -> None:
    course = surface_course("rest", 120.0, RATE_HZ / 2.0)
    noisy = course + 2.0 * np.sqrt(STATED) * np.random.default_rng(3).standard_normal(course.size)
    variance = _follow(np.zeros(READING_MEMORY), np.repeat(noisy, 2), 1.0 / RATE_HZ, STATED)
    assert np.sqrt(variance / STATED) == pytest.approx(2.0, rel=0.15)


def test_a_step_across_a_gap_is_no_noise() -> None:
    memory = np.zeros(READING_MEMORY)
    noise = np.sqrt(STATED) * np.random.default_rng(4).standard_normal(2000)
    _follow(memory, noise[:1000], 1.0 / RATE_HZ, STATED)
    levels = []
    for k in range(1000, 2000, 5):
        forget_readings(memory)
        levels.append(_follow(memory, noise[k : k + 5] + 0.1 * k, 1.0 / RATE_HZ, STATED))
    assert np.ptp(levels) == 0.0
