"""What the filter's innovations have in common with the motion before them: nothing, while the model holds."""

import numpy as np
from estimator_plants import PITCH, Array, add_noise, doublets, ekf, make_signals

from wingwatch.estimators import EkfState, SignalLayout
from wingwatch.estimators.ekf.coherence import coherent_dispersions, no_coherence
from wingwatch.estimators.ekf.scatter import dispersion_before, stated_dispersions

LATE = 3
"""Samples by which the surface acts later than its reading says: 60 ms."""


def flown(late: int, noise_share: float, seeds: int) -> EkfState:
    """A minute of doublets, the elevator's reading so much earlier than what it does."""
    inputs = doublets(PITCH, 60.0)
    clean = make_signals(PITCH, inputs)
    std = noise_share * clean[:, 1:4].std(axis=0)
    batch = np.stack([add_noise(PITCH, clean, std, np.random.default_rng(seed)) for seed in range(seeds)])
    column = SignalLayout(2, 1).first_input
    batch[:, :, column] = np.roll(batch[:, :, column], -late, axis=1)
    state = ekf(PITCH).run(batch)
    assert isinstance(state, EkfState)
    return state


def dispersions(state: EkfState) -> Array:
    """What stated variances are multiplied by, (vehicles, equations)."""
    return stated_dispersions(state, np.arange(len(state.z)))


def test_an_effect_that_comes_late_widens_what_is_stated() -> None:
    straight, late = dispersions(flown(0, 0.05, 6)), dispersions(flown(LATE, 0.05, 6))
    assert np.median(straight, axis=0).max() < 1.6
    assert late[:, 1].min() > 5.0


def test_what_is_said_at_a_change_is_weighed_by_what_was_before() -> None:
    """The dispersion of evidence is that of the beginning of the running block, five seconds at most before."""
    state = flown(LATE, 0.05, 1)
    before = dispersion_before(state.scatter, 0)
    state.coherence.sums[0] *= 10.0
    assert (dispersions(state)[0] > 2.0 * before).any()
    np.testing.assert_array_equal(dispersion_before(state.scatter, 0), before)


def test_a_derivative_that_changed_takes_the_blame_with_it() -> None:
    state, runner = flown(LATE, 0.05, 1), ekf(PITCH)
    assert (dispersions(state)[0] > 2.0).any()
    runner.estimator.release(state, np.eye(PITCH.truth.size)[5])  # type: ignore[union-attr]
    assert (state.coherence.sums == 0.0).all()
    assert (state.scatter.coherent == 1.0).all()


def test_sums_by_chance_give_one_and_a_known_misfit_its_power() -> None:
    rng, found = np.random.default_rng(4), []
    for _ in range(300):
        one = no_coherence(1, 1)
        stages = one.sums.shape[2]
        motion = np.cumsum(rng.standard_normal((400, stages)), axis=0) / 20.0
        innovations = rng.standard_normal(400)
        one.sums[0, 0] = innovations @ motion
        one.products[0, 0] = np.tril(motion.T @ motion)
        found.append(float((one.sums**2).sum() / np.trace(one.products[0, 0])))
    # A ratio of some two degrees of freedom has a variance of about one; 300 of them.
    assert abs(np.mean(found) - 1.0) < 4.0 * np.std(found) / np.sqrt(300.0)
    out = np.empty(1)
    coherent_dispersions(no_coherence(1, 1), 0, out)
    assert out[0] == 1.0
    one = no_coherence(1, 1)
    one.sums[0, 0] = 10.0
    one.products[0, 0] = np.eye(one.sums.shape[2])
    coherent_dispersions(one, 0, out)
    freedom = one.sums.shape[2]
    assert out[0] == (3.0 + freedom * 100.0) / (3.0 + freedom)
