"""The bank against analytic integrals; what a block says against chance."""

import numpy as np
import pytest
from estimator_kernels import as_complex, new_filters, reduced, rows_before, transforms_of
from estimator_plants import PLANTS, Array, Plant, fourier, noisy_batch, quiet_batch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from wingwatch.estimators import FourierEstimator, FourierState, SignalLayout
from wingwatch.estimators.fourier.bank import advance_bank, bank_channels
from wingwatch.estimators.fourier.directions import noise_edge
from wingwatch.estimators.kernels.intersample import Servos

LAYOUT = SignalLayout(2, 1)
OMEGA = 2.0 * np.pi * np.arange(1, 41) / 10.0


def run_bank(rows: Array, held: bool = False) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Bank (bins, channels) and decay after all rows, force from the accelerometer."""
    bank = np.zeros((bank_channels(2, 1), 2, OMEGA.size))
    filters, servos = new_filters(OMEGA.size), Servos(np.array([0.0 if held else np.inf]), np.array([np.inf]))
    for k in range(1, len(rows)):
        advance_bank(OMEGA, servos, np.zeros(1), filters, bank, rows_before(rows, k), rows[k], 2)
    transforms, decay = transforms_of(OMEGA, bank, rows[-1, 0] - rows[0, 0], 2, 1)
    return as_complex(transforms), as_complex(decay)


def exact(time: Array, value: Array, held: bool = False) -> NDArray[np.complex128]:
    """Integral of x(t) exp(j w (T - t)), segment by segment, from the antiderivative of a line times an exponential."""
    total = np.zeros(OMEGA.size, dtype=np.complex128)
    s = 1j * OMEGA
    for k in range(len(time) - 1):
        a, b = time[k], time[k + 1]
        slope = 0.0 if held else (value[k + 1] - value[k]) / (b - a)
        at_b = value[k] + slope * (b - a)
        here, there = np.exp(s * (time[-1] - a)), np.exp(s * (time[-1] - b))
        total += value[k] * here / s - at_b * there / s + slope * (here - there) / s**2
    return total


def rows_of(time: Array, rng: np.random.Generator) -> Array:
    rows = np.zeros((len(time), LAYOUT.columns))
    rows[:, 0] = time
    rows[:, 1:5] = rng.standard_normal((len(time), 4))
    rows[:, 6] = 1.0 + 0.1 * rng.standard_normal(len(time))
    return rows


@given(st.integers(0, 10_000))
@settings(max_examples=10, deadline=None)
def test_the_bank_is_the_integral_at_irregular_steps(seed: int) -> None:
    """Terms of the coefficients cancel to eps / (w dt)^2 of a step, at most 1e-11 here, and add up like rounding."""
    rng = np.random.default_rng(seed)
    time = 5.0 + np.cumsum(rng.uniform(0.01, 0.05, 200))
    rows = rows_of(time, rng)
    bank, decay = run_bank(rows)
    columns = [rows[:, 1], rows[:, 2], rows[:, 3], rows[:, 4], np.ones(200), rows[:, 6] - 1.0, time - time[0]]
    for c, column in enumerate(columns):
        want = exact(time, column)
        bound = 1e-12 * np.abs(column).max() * (time[-1] - time[0])
        np.testing.assert_allclose(bank[:, c], want, rtol=0.0, atol=bound, err_msg=str(c))
    np.testing.assert_allclose(decay, np.exp(1j * OMEGA * (time[-1] - time[0])), rtol=0.0, atol=1e-12)


def test_a_held_input_is_held() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(300) / 50.0
    rows = rows_of(time, rng)
    bank, _ = run_bank(rows, held=True)
    np.testing.assert_allclose(bank[:, 3], exact(time, rows[:, 4], held=True), rtol=0.0, atol=1e-11)


def test_a_position_that_repeats_is_held_until_it_moves() -> None:
    """A staircase of exact repeats is transformed as a staircase although the channel is no command."""
    time = np.arange(300) / 50.0
    rows = np.zeros((300, LAYOUT.columns))
    rows[:, 0], rows[:, 6] = time, 1.0
    rows[:, 4] = np.repeat(np.random.default_rng(2).standard_normal(30), 10)
    bank, _ = run_bank(rows)
    np.testing.assert_allclose(bank[:, 3], exact(time, rows[:, 4], held=True), rtol=0.0, atol=1e-11)
    assert np.abs(bank[:, 3] - exact(time, rows[:, 4])).max() > 1e-4, "the rule must matter here"


def test_the_transform_of_the_derivative_is_exact() -> None:
    """s X + x(T) - D x(0) of a piecewise linear signal is the transform of its slopes, held."""
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.01, 0.05, 200))
    rows = rows_of(time, rng)
    bank, decay = run_bank(rows)
    x = rows[:, 1]
    slopes = np.append(np.diff(x) / np.diff(time), 0.0)
    # X = integral of x exp(jw(T-t)): by parts, integral of x' exp(jw(T-t)) = x(T) - D x(0) + jw X
    got = 1j * OMEGA * bank[:, 0] + x[-1] - decay * x[0]
    np.testing.assert_allclose(got, exact(time, slopes, held=True), rtol=0.0, atol=1e-9)


def test_the_edge_holds_back_white_noise() -> None:
    """The largest eigenvalue of 2000 sample covariances of noise; the edge is its limit, passed by chance alone.

    Fluctuations about it are of the order of bins^(-2/3) (Tracy and Widom); the share they leave is asked of the mean.
    """
    rng = np.random.default_rng(4)
    channels, bins = 3, 40
    shares = []
    for _ in range(2000):
        z = (rng.standard_normal((channels, bins)) + 1j * rng.standard_normal((channels, bins))) / np.sqrt(
            2.0
        )
        largest = np.linalg.eigvalsh(z @ z.conj().T / bins)[-1]
        shares.append(1.0 - 1.0 / largest)
    edge = noise_edge(channels, bins)
    assert np.mean(np.array(shares) > edge) < 0.5
    assert np.mean(shares) < edge < np.max(shares) + 0.1
    assert noise_edge(3, 0.0) == 1.0
    assert noise_edge(3, 1e12) == pytest.approx(0.0, abs=1e-5)


def test_nothing_is_kept_of_pure_noise() -> None:
    m = np.diag([4.0, 1.0, 9.0])
    matrices, vectors = reduced(m, m.copy(), np.ones(3), np.ones(3), 0.5)
    for part in (*matrices, *vectors):
        assert (part == 0.0).all()


def test_all_is_kept_of_pure_signal() -> None:
    """Without noise in the regressors sensitivity, information and evidence are all M."""
    root = np.random.default_rng(5).standard_normal((3, 8))
    m = root @ root.T
    score = np.array([1.0, -2.0, 0.5])
    matrices, (score_kept, _, evidence_score, _) = reduced(m, np.zeros((3, 3)), score, np.zeros(3), 0.5)
    for part in matrices:
        np.testing.assert_allclose(part, m, rtol=0.0, atol=1e-7 * np.abs(m).max())  # ridge 1e-9
    np.testing.assert_allclose(score_kept, score, atol=1e-6)
    np.testing.assert_allclose(evidence_score, score, atol=1e-6)


def test_a_direction_that_is_mostly_noise_is_not_kept() -> None:
    """A state whose power is 40 or 60 % noise: kept to what is signal, or not at all."""
    for share, kept in ((0.4, 0.6), (0.6, 0.0)):
        (found, *_), _ = reduced(np.eye(3), np.diag([share, 0.0, 0.0]), np.ones(3), np.zeros(3), 0.5)
        np.testing.assert_allclose(np.diag(found), [kept, 1.0, 1.0], atol=1e-7)


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
def test_quiet_blocks_are_no_evidence(plant: Plant) -> None:
    """Sensor noise alone: none of 240 blocks."""
    runner = fourier(plant)
    state = runner.init(40)
    assert isinstance(state, FourierState)
    quiet = quiet_batch(plant, 60.2, 40, seed=100)
    evidence = 0
    for start in range(0, quiet.shape[1], 500):
        runner.update(state, quiet[:, start : start + 500])
        evidence += int((state.evidence_matrix != 0.0).any(axis=(1, 2)).sum())
    assert (state.counts[:, 1] == 6).all()
    assert evidence == 0


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
def test_evidence_is_worth_what_it_claims(plant: Plant) -> None:
    """Away from truth by chance alone: (theta^ - theta)' J (theta^ - theta) has mean rank(J), to four of its errors.

    theta^ is the block's own solution J^-1 h; the noise levels come from ten seconds of data, which leaves chi-square
    a scatter of its own; a fifth more or less is granted for it.
    """
    seeds = 100
    runner = fourier(plant)
    assert isinstance(runner.estimator, FourierEstimator)
    state = runner.run(noisy_batch(plant, 21.0, seeds, first_seed=500))
    assert isinstance(state, FourierState)
    chi, freedom = [], []
    for i in range(seeds):
        block = runner.estimator.evidence(state, i)
        values, vectors = np.linalg.eigh(block.information)
        seen = values > 1e-9 * values[-1]
        away = vectors.T @ (block.vector - block.information @ plant.aerodynamic)
        chi.append(float((away[seen] ** 2 / values[seen]).sum()))
        freedom.append(int(seen.sum()))
    ratio = np.sum(chi) / np.sum(freedom)
    chance = 4.0 * np.sqrt(2.0 / np.sum(freedom))
    assert abs(ratio - 1.0) < 0.2 + chance, ratio


def test_regressors_that_depend_on_each_other_to_the_last_digit_are_taken() -> None:
    """A record without noise gives an M that rounding makes indefinite; nothing is raised and nothing is made of it."""
    part = np.random.default_rng(3).standard_normal((4, 2))
    root = np.hstack((part, part @ np.array([[1.0, 2.0], [0.5, -1.0]])))
    m = root.T @ root - 1e-7 * np.eye(4)
    (sensitivity, *_), _ = reduced(m, np.zeros((4, 4)), np.ones(4), np.zeros(4), 0.5)
    assert np.isfinite(sensitivity).all()
    np.testing.assert_allclose(sensitivity, m, atol=1e-6)
