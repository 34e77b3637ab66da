"""What the equations leave and the motion that they explain: noise goes with nothing, a misfit goes with the motion in
every block, and what is stated grows by as much."""

import numpy as np
import pytest
from estimator_plants import PITCH, Array, add_noise, curved_signals, doublets, fourier

from wingwatch.estimators import FourierState
from wingwatch.estimators.fourier.coherence import dispersion_of_bins, gather_coherence
from wingwatch.estimators.fourier.noise import Plant, noise_workspace
from wingwatch.estimators.fourier.solution import solution_workspace

BINS, COLUMNS, WEIGHT = 30, 3, 25.0


def products(blocks: int, misfit: float, seed: int) -> Array:
    """Sums of so many blocks of one manoeuvre, flown at another time in each: a residual of unit noise over the root
    of ``WEIGHT``, and so much of the motion."""
    rng = np.random.default_rng(seed)
    solving, work = solution_workspace(2, 1, BINS, 2), noise_workspace(2, 1, 2, BINS)
    plant = Plant(
        np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 1.0]]), np.zeros(2), np.zeros(2), np.zeros(2), True, False
    )
    transforms, out = solving.transforms, np.zeros((2, 3, BINS))
    shape = np.random.default_rng(0).standard_normal((3, BINS, 2)) @ np.array([1.0, 1j])
    for k in range(2):
        work.weights[k, k, 0] = WEIGHT
    for _ in range(blocks):
        moved = shape * np.exp(-1j * np.arange(1, BINS + 1) * rng.uniform(0.0, 2.0 * np.pi))
        explained = np.array([moved[0], 2.0 * moved[1] + moved[2]])
        noise = rng.standard_normal((2, BINS, 2)) @ np.array([1.0, 1j]) / np.sqrt(2.0 * WEIGHT)
        left = noise + misfit * explained
        for channel, values in zip((0, 1, 3), moved, strict=True):
            transforms.without_errors[channel] = values.real, values.imag
        transforms.residual[:, 0], transforms.residual[:, 1] = left.real, left.imag
        gather_coherence(transforms, plant, work, 1.0, out)
    return out


def ratio(sums: Array) -> float:
    """Power of the products over what noise gives them."""
    return float((sums[0] ** 2 + sums[1] ** 2).sum() / sums[2].sum())


def test_noise_goes_with_no_motion() -> None:
    found = [ratio(row) for seed in range(200) for row in products(5, 0.0, seed)]
    # The mean of 400 ratios of some 20 degrees of freedom each: four standard deviations.
    assert np.mean(found) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 20.0 / 400.0))


@pytest.mark.parametrize("blocks", [2, 8, 32])
def test_a_misfit_adds_up_over_blocks_whenever_they_are_flown(blocks: int) -> None:
    misfit = 0.3
    sums = products(blocks, misfit, 3)[1]
    power = sums[2] / WEIGHT  # of the motion, all blocks
    expected = 1.0 + (misfit * power * WEIGHT) @ (misfit * power * WEIGHT) / sums[2].sum()
    assert ratio(sums) == pytest.approx(expected, rel=0.5)
    assert dispersion_of_bins(sums, COLUMNS) > 0.8 * ratio(sums)


def test_nothing_flown_widens_nothing() -> None:
    assert dispersion_of_bins(np.zeros((3, BINS)), COLUMNS) == 1.0


def flown(bent: float, noise_share: float, seeds: int) -> FourierState:
    """A minute of doublets by a short period with a curved pitching moment."""
    clean = curved_signals(doublets(PITCH, 60.0), bent)
    std = noise_share * clean[:, 1:4].std(axis=0)
    batch = np.stack([add_noise(PITCH, clean, std, np.random.default_rng(seed)) for seed in range(seeds)])
    state = fourier(PITCH).run(batch)
    assert isinstance(state, FourierState)
    return state


def test_a_moment_that_no_derivative_describes_widens_the_moment_equation_alone() -> None:
    straight, curved = flown(0.0, 0.02, 6).dispersion, flown(0.5, 0.02, 6).dispersion
    assert np.median(straight, axis=0).max() < 1.5
    assert curved[:, 1].min() > 3.0
    assert np.median(curved[:, 0]) < 1.5
