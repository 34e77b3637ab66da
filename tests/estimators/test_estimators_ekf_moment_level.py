"""The strength of the unmeasured moment: the score of the likelihood, and where it leads."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from estimator_kernels import in_python
from numba import njit
from numpy.typing import NDArray
from reference_plant import PLANTS, Plant
from situation_cases import SITUATIONS
from situation_plants import RandomMoment, Situation, fly_situation, pulse_doublets

from wingwatch.estimators import EkfConfig, EkfEstimator
from wingwatch.estimators.ekf.moment_level import (
    MOST_INFORMATION,
    Slope,
    correct_slope,
    follow_moment_levels,
    predict_slope,
)
from wingwatch.estimators.ekf.sample import Gains, Readings
from wingwatch.estimators.ekf.state import EkfState, MomentLevel

Array = NDArray[np.float64]

NS, SAMPLES, RATE = 2, 400, 1e-3
DECAY = math.exp(-0.02 / 0.15)


@njit(error_model="numpy")
def slope_of(level, jacobian, variance, measured, work):  # type: ignore[no-untyped-def]
    """Score and information of one sample."""
    slope = Slope(level.mean[0, 0], level.covariance[0, 0], NS, NS)
    predict_slope(slope, jacobian, variance, work)
    return correct_slope(slope, measured, work)


class Sizes(NamedTuple):
    states: int
    gusts: int


class Model(NamedTuple):
    sizes: Sizes
    roll: bool
    use_accelerometer: bool


class Noise(NamedTuple):
    unmeasured: Array
    reading: Array


class State(NamedTuple):
    noise: Noise
    moment_level: MomentLevel


class Step(NamedTuple):
    decay: Array
    dt_s: float


def transition() -> Array:
    """Of two states and the moment that drives them."""
    return np.array([[0.93, 0.4, 0.003], [-0.08, 0.9, 0.018], [0.0, 0.0, DECAY]])


def process(log_variance: float) -> Array:
    """A moment that is driven at any time within the step."""
    v, late = np.array([0.0, 0.0, 1.0]), transition()[:, 2] - np.array([0.0, 0.0, 1.0])
    one = np.outer(v, v) + 0.5 * (np.outer(v, late) + np.outer(late, v)) + np.outer(late, late) / 3.0
    return math.exp(log_variance) * one + np.diag([1e-3, 1e-7, 0.0])


def filtered(log_variance: float, readings: Array, follow: bool) -> tuple[float, float, float]:
    """Log-likelihood of readings by a filter in plain numpy; the score and the information that the kernel adds up."""
    f, rows, variance = (
        transition(),
        np.array([[1.0, 0, 0], [0, 1.0, 0], [-4.0, 0.3, 0.5]]),
        [1e-2, 1e-5, 1e-2],
    )
    x, p, likelihood, score, information = np.zeros(3), np.diag([1e-2, 1e-5, 0.0]), 0.0, 0.0, 0.0
    level = MomentLevel(np.zeros((1, 1, 3)), np.zeros((1, 1, 3, 3)), np.zeros((1, 1)), np.full((1, 1), 1e12))
    for z in readings:
        x, p = f @ x, f @ p @ f.T + process(log_variance)
        gains = Gains(np.zeros((4, 3)), np.zeros(4), np.zeros(4))
        for j, row in enumerate(rows):
            s = row @ p @ row + variance[j]
            nu, gain = z[j] - row @ x, p @ row / s
            gains.gain[j], gains.innovation[j] = gain * math.sqrt(s), nu / math.sqrt(s)
            gains.inverse_std[j] = 1.0 / math.sqrt(s)
            x, p = x + gain * nu, p - np.outer(gain, row @ p)
            likelihood -= 0.5 * (nu * nu / s + math.log(s))
        if follow:
            measured = Readings(np.array(variance), np.zeros(3), rows[2], np.ones(3, dtype=bool)), gains
            by = slope_of(level, f, math.exp(log_variance), measured, np.empty((3, 3)))
            score, information = score + by[0], information + by[1]
    return likelihood, score, information


def drawn(log_variance: float, seed: int) -> Array:
    """Readings of that model, (samples, 3)."""
    rng, x, out = np.random.default_rng(seed), np.zeros(3), np.empty((SAMPLES, 3))
    root = np.linalg.cholesky(process(log_variance) + 1e-15 * np.eye(3))
    for k in range(SAMPLES):
        x = transition() @ x + root @ rng.standard_normal(3)
        out[k] = np.array([[1.0, 0, 0], [0, 1.0, 0], [-4.0, 0.3, 0.5]]) @ x
    return out + rng.standard_normal(out.shape) * np.sqrt([1e-2, 1e-5, 1e-2])


@pytest.mark.parametrize("off", [-1.0, 0.0, 1.5])
def test_the_score_is_the_slope_of_the_likelihood(off: float) -> None:
    truth, step = math.log(0.02), 1e-4
    readings = drawn(truth, 1)
    ahead, behind = (filtered(truth + off + by, readings, False)[0] for by in (step, -step))
    slope = (ahead - behind) / (2.0 * step)
    assert filtered(truth + off, readings, True)[1] == pytest.approx(slope, rel=1e-4, abs=1e-4)


def test_the_information_is_the_variance_of_the_score() -> None:
    truth = math.log(0.02)
    found = np.array([filtered(truth, drawn(truth, seed), True)[1:] for seed in range(60)])
    mean, variance = found[:, 0].mean(), found[:, 0].var(ddof=1)
    information = found[:, 1].mean()
    assert abs(mean) < 3.5 * math.sqrt(information / 60.0)
    assert variance / information == pytest.approx(1.0, abs=3.5 * math.sqrt(2.0 / 59.0))


def test_large_innovations_count_as_seen_noise_at_most() -> None:
    """At a level far too low they seem to tell a thousand times more, and the level would stand still afterwards."""
    row = np.array([-4.0, 0.3, 0.5])
    level = MomentLevel(
        np.full((1, NS, 3), 50.0), np.full((1, NS, 3, 3), 1e-4), np.zeros((1, NS)), np.zeros((1, NS))
    )
    state = State(Noise(np.full((1, NS), 0.02), np.zeros((1, 3))), level)
    gains = Gains(np.zeros((4, 3)), np.full(4, 30.0), np.full(4, 10.0))
    measured = Readings(np.ones(3), np.zeros(3), row, np.ones(3, dtype=bool)), gains
    step = Step(np.zeros(3), 0.02)
    for _ in range(900):
        level.mean[:] = 50.0
        in_python(follow_moment_levels)(
            Model(Sizes(NS, 3), False, True), state, 0, step, transition(), measured, RATE, np.empty((3, 3))
        )
    assert 0.0 < level.information[0, 1] <= MOST_INFORMATION


def flown(plant: Plant, situation: Situation, seed: int, seconds: float) -> EkfState:
    """The filter's state after a flight, as the live chain configures it."""
    flight = fly_situation(plant, situation, seed, seconds)
    k = flight.known
    config = EkfConfig(
        plant.structure, k.start, k.natural, k.reference, held=(k.held,), span_m=k.span_m,
        noise_std=(0.0, k.rate_noise_rad_s),
    )  # fmt: skip
    estimator = EkfEstimator(config)
    state = estimator.init(1)
    for at in range(0, len(flight.rows), 25):
        estimator.update(state, flight.rows[None, at : at + 25])
        estimator.solve(state)
    return state


def strength(state: EkfState, span_m: float = 2.9, speed_m_s: float = 25.0) -> float:
    """Standard deviation of the moment that the filter has found, rad/s2."""
    decay = math.exp(-0.02 * speed_m_s * math.pi / (4.0 * span_m))
    return math.sqrt(state.noise.unmeasured[0, 1] / (1.0 - decay**2))


@pytest.mark.parametrize("plant", PLANTS, ids=[p.structure.name for p in PLANTS])
@pytest.mark.parametrize("std_rad_s2", [0.2, 1.0])
def test_a_moment_of_the_assumed_memory_is_found(plant: Plant, std_rad_s2: float) -> None:
    memory_s = 4.0 * 2.9 / (math.pi * 25.0)
    situation = Situation(pulse_doublets(8.0, 10.0), moment=RandomMoment(std_rad_s2, memory_s))
    found = [strength(flown(plant, situation, seed, 60.0)) for seed in range(3)]
    assert np.mean(found) == pytest.approx(std_rad_s2, rel=0.25)


@pytest.mark.parametrize("plant", PLANTS, ids=[p.structure.name for p in PLANTS])
def test_in_still_air_there_is_none_within_a_minute(plant: Plant) -> None:
    """The filter begins at what second differences of the gyro leave open, some 0.05 rad/s2."""
    found = strength(flown(plant, SITUATIONS["still, open, each 5 s"], 0, 60.0))
    assert found < 0.01
