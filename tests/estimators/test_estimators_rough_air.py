"""How much of the motion the air causes, and the running moments that it is compared with."""

import numpy as np
import pytest
from estimator_plants import PLANTS

from wingwatch.estimators import EkfConfig, EkfEstimator
from wingwatch.monitor.estimation.roughness import follow_motion

SHORT = PLANTS["short_period"]


def filter_in(gust_step: float) -> tuple[EkfEstimator, np.ndarray]:
    """A short-period filter that believes in gusts of that size a step, and the variance that they cause."""
    value = SHORT.aerodynamic
    config = EkfConfig(SHORT.structure, value, np.abs(value) + 1.0, (25.0, 1.225), span_m=2.9)
    estimator = EkfEstimator(config)
    state = estimator.init(1)
    state.condition[0] = 1.0, 25.0, 1.225, 0.0, 0.0
    for variance in state.noise:
        variance[0] = 0.0
    state.noise.gust[0] = gust_step**2
    return estimator, estimator.gust_variance(state, np.array([0]))[0]


def test_calm_air_causes_nothing_and_gusts_by_their_square() -> None:
    assert (filter_in(0.0)[1] < 1e-12).all()
    _, one = filter_in(0.05)
    _, two = filter_in(0.1)
    np.testing.assert_allclose(two, 4.0 * one, rtol=1e-9)
    assert (one > 0.0).all()


def test_what_gusts_cause_is_what_a_plant_in_gusts_does() -> None:
    """w' = z_w w + (z_q + U) q - w_g', q' = m_w w + m_q (q - q_g), integrated finely with many random gusts."""
    step, dt, fine = 0.1, 0.02, 20
    _, said = filter_in(step)
    a = SHORT.aerodynamic.reshape(2, 3)
    rng = np.random.default_rng(8)
    n, h = 2000, dt / fine
    w, q, lag = np.zeros(n), np.zeros(n), np.zeros(n)
    tau = 4.0 * 2.9 / (np.pi * 25.0)
    for _ in range(round(10.0 / h)):
        change = step / np.sqrt(fine) * rng.standard_normal(n)
        turning = lag  # q_g: -w_g'/V through a first-order lag
        w_rate = a[0, 0] * w + a[0, 1] * (q - turning) + 25.0 * q
        q_rate = a[1, 0] * w + a[1, 1] * (q - turning)
        w += h * w_rate - change
        q += h * q_rate
        lag += -h * lag / tau - change / (25.0 * tau)
    # a variance over 2000 is known to sqrt(2 / 2000) = 3.2 %; four of that, and one step of 0.02 s is not fine
    np.testing.assert_allclose(said, [w.var(), q.var()], rtol=0.17)


def test_running_moments_do_not_depend_on_how_samples_are_cut() -> None:
    rng = np.random.default_rng(9)
    rows = np.column_stack([np.arange(400) / 50.0, 3.0 + rng.standard_normal((400, 2))])
    whole, pieces = np.full((3, 2), np.nan), np.full((3, 2), np.nan)
    follow_motion(whole, rows, 2.0)
    for cut in np.split(rows, [1, 7, 180]):
        follow_motion(pieces, cut, 2.0)
    np.testing.assert_array_equal(whole, pieces)
    variance = whole[1] - whole[0] ** 2
    assert variance == pytest.approx([1.0, 1.0], rel=0.5)
    rows[5, 1] = np.nan
    holed = np.full((3, 2), np.nan)
    follow_motion(holed, rows, 2.0)
    assert np.isfinite(holed[:2]).all()
