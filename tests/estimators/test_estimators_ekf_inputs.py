"""Inputs between their readings, and the errors of these readings, in the Kalman filter."""

from collections.abc import Callable
from typing import Literal

import numpy as np
import pytest
from estimator_kernels import in_python
from estimator_plants import PITCH, RATE_HZ, REFERENCE, SOLVE_EVERY, Array, doublets, make_signals
from scipy.integrate import quad
from scipy.linalg import expm

from wingwatch.estimators import EkfConfig, EkfEstimator
from wingwatch.estimators.ekf.covariance import leave_out
from wingwatch.estimators.ekf.model import transition
from wingwatch.estimators.ekf.sample import Step
from wingwatch.estimators.kernels.intersample import course

DT = 1.0 / RATE_HZ
SURFACE, KINEMATIC = 4, 5


@pytest.mark.parametrize("servo_s", [0.005, 0.02, 0.1, 1.0])
def test_course_of_a_servo_whose_command_is_held(servo_s: float) -> None:
    def risen(s: float) -> float:
        return float((1.0 - np.exp(-s * DT / servo_s)) / (1.0 - np.exp(-DT / servo_s)))

    mean, mean_before, early, early_before, *doubt = course(DT, servo_s, False)
    assert mean == pytest.approx(quad(risen, 0.0, 1.0)[0], rel=1e-9)
    assert early == pytest.approx(quad(lambda s: (0.5 - s) * risen(s), 0.0, 1.0)[0], rel=1e-6)
    assert mean_before == early_before == 0.0, "where the command is held, its own change says all"
    assert doubt == [0.0] * 4


@pytest.mark.parametrize(("rate_hz", "frames"), [(25.0, 2), (10.0, 5)])
def test_course_of_a_servo_between_samples_that_hold_several_commands(rate_hz: float, frames: int) -> None:
    """Beside a regression of what a servo did on its readings, commands a random walk with a step a frame."""
    servo_s, steps = 0.02, 100_000
    step_s = 1.0 / rate_hz
    lag, keep = servo_s / step_s, np.exp(-step_s / (frames * servo_s))
    command = np.cumsum(np.random.default_rng(1).standard_normal(frames * steps))
    at, mean, early = np.zeros(frames * steps + 1), np.zeros(steps), np.zeros(steps)
    for i, commanded in enumerate(command):
        at[i + 1] = commanded + keep * (at[i] - commanded)
    start = at[::frames][:-1]
    for i in range(frames):
        commanded, behind = command[i::frames] - start, (at[:-1] - command)[i::frames]
        first, last = i / frames, (i + 1) / frames

        def of_frame(weight: Callable[[float], float], first: float = first, last: float = last) -> Array:
            """Means over the frame, its part of the step: of the weight, and of the weight times what is left."""
            left = quad(lambda t: weight(t) * np.exp(-(t - first) / lag), first, last)[0]
            return np.array([quad(weight, first, last)[0], left])

        whole, left = of_frame(lambda t: 1.0)
        mean += whole * commanded + left * behind
        whole, left = of_frame(lambda t: 0.5 - t)
        early += whole * commanded + left * behind
    change = np.diff(at[::frames])
    regressors = np.column_stack([change[1:], change[:-1]])
    want = np.linalg.lstsq(regressors, np.column_stack([mean[1:], early[1:]]), rcond=None)[0].T.ravel()
    by = course(step_s, servo_s, False)
    np.testing.assert_allclose(by[:4], want, atol=2e-3)
    left = mean[1:] - regressors @ want[:2]
    assert by.left == pytest.approx(left.var(), rel=0.02)
    inverse = np.linalg.inv(np.cov(regressors.T))
    np.testing.assert_allclose((by.own2, by.both, by.before2), inverse[[0, 0, 1], [0, 1, 1]], atol=0.01)


def test_course_where_no_servo_is_known() -> None:
    assert course(DT, np.inf, False) == (0.5, 0.0, -1.0 / 12.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert course(DT, np.inf, True) == (0.0,) * 8, "a surface that was at rest is held to the step's end"
    assert course(DT, 0.0, False) == (0.0,) * 8


@pytest.mark.parametrize(("damping", "input_now"), [(0.0, 0.06), (-400.0, 0.01)])
def test_a_step_under_an_input_that_moves_evenly_is_exact(damping: float, input_now: float) -> None:
    """Beside the exponential of the system extended by the input and its rate; the series leaves (A dt)^5 / 120.

    With eight times its damping over a step there, which no series of four terms has, under an input that stays.
    """
    derivatives = PITCH.aerodynamic.copy()
    derivatives[4] += damping
    a = derivatives.reshape(2, 3)
    whole = np.zeros((4, 4))
    whole[:2, :3] = a
    whole[0, 1] += 25.0
    whole[2, 3] = 1.0
    start, old, new = np.array([0.4, -0.2]), 0.01, input_now
    exact = (expm(DT * whole) @ np.concatenate([start, [old, (new - old) / DT]]))[:2]
    z = np.concatenate([start, derivatives, [0.0, 0.0]])
    mean, _, early, *_ = course(DT, np.inf, False)
    step = Step(
        dt_s=DT,
        pressure_ratio=1.0,
        airspeed_m_s=25.0,
        inertial=False,
        rolling=False,
        direction=np.array([0.0, 1.0]),
        inputs=np.array([old + mean * (new - old)]),
        early=np.array([early * (new - old)]),
        newest_fraction=np.array([mean]),
        course_variance=np.zeros(1),
        inputs_end=np.array([new]),
        scale=np.ones(6),
        forward=np.array([0.0, 25.0]),
        rest=np.zeros(2),
        decay=np.zeros(0),
    )
    after = transition(filter_of(0.0).model, z, step).after
    np.testing.assert_allclose(after[:2], exact, rtol=0.0, atol=2e-6)


@pytest.mark.parametrize("damping", [-1e300, -np.inf, np.nan])
def test_a_step_with_a_derivative_that_is_no_number_comes_to_its_end(damping: float) -> None:
    """A filter that is lost is started anew at its next solution; until then its steps must not hold up others."""
    z = np.concatenate([[0.4, -0.2], PITCH.aerodynamic, [0.0, 0.0]])
    z[6] = damping
    nothing = np.zeros(1)
    step = Step(DT, 1.0, 25.0, False, False, np.array([0.0, 1.0]), nothing, nothing, nothing, nothing, nothing,
                np.ones(6), np.array([0.0, 25.0]), np.zeros(2), np.zeros(0))  # fmt: skip
    assert not np.isfinite(transition(filter_of(0.0).model, z, step).after[:2]).all()


def filter_of(stated_std: float, engine: Literal["compiled", "filterpy"] = "compiled") -> EkfEstimator:
    """A filter that starts 20 % off, with a stated error of the surface's readings."""
    value = PITCH.aerodynamic
    return EkfEstimator(
        EkfConfig(
            PITCH.structure, 0.8 * value, np.abs(value), REFERENCE, held=(True,), memory_s=1e9,
            input_noise_std=(stated_std,), engine=engine,
        )
    )  # fmt: skip


def readings(surface_std: float, vehicles: int, inputs: Array) -> Array:
    """Signals with noisy readings of the surface, and little noise in all else, (vehicles, samples, columns)."""
    clean = make_signals(PITCH, inputs)
    rng = np.random.default_rng(11)
    batch = np.tile(clean, (vehicles, 1, 1))
    batch[:, :, SURFACE] += surface_std * rng.standard_normal(batch.shape[:2])
    std = 0.01 * clean[:, 1:4].std(axis=0) + np.array([1e-3, 1e-4, 1e-3])
    noise = std * rng.standard_normal((*batch.shape[:2], 3))
    batch[:, :, 1:4] += noise
    batch[:, :, KINEMATIC] += 25.0 * noise[:, :, 1]
    return batch


def last(estimator: EkfEstimator, batch: Array) -> tuple[Array, Array]:
    """Values and standard errors of the derivatives at the end, one row a vehicle."""
    state = estimator.init(batch.shape[0])
    for start in range(0, batch.shape[1], SOLVE_EVERY):
        estimator.update(state, batch[:, start : start + SOLVE_EVERY])
        estimator.solve(state)
    found = [estimator.estimate(state, i) for i in range(batch.shape[0])]
    return np.array([e.value for e in found]), np.array([e.standard_error for e in found])


def test_reading_errors_of_a_surface_are_in_the_standard_errors() -> None:
    """A fifth of the doublets' rms is noise: where it is not stated, the forces' derivatives come out many times as
    wrong; blocks scatter then, so the errors say so.

    What is left where it is stated, 1 to 2 % of m_eta, is the errors' part in w and q
    (docs/methods/kalman_filter.md, section 11).
    """
    inputs = doublets(PITCH, 60.0, every_s=2.0)
    noise_std = 0.2 * float(inputs.std())
    batch = readings(noise_std, 12, inputs)
    stated, silent = (last(filter_of(std), batch) for std in (noise_std, 0.0))
    rms = [np.sqrt(np.mean(np.square(value - PITCH.truth), axis=0)) for value, _ in (stated, silent)]
    assert (rms[0][:3] < rms[1][:3] / 3.0).all(), rms
    for value, error in (stated, silent):
        scores = np.sqrt(np.mean(np.square((value - PITCH.truth) / error), axis=0))
        assert (scores < 2.5).all(), scores
    assert abs(stated[0][:, 5].mean() / PITCH.truth[5] - 1.0) < 0.02


def test_a_surface_at_rest_teaches_nothing_of_itself() -> None:
    """Its derivatives keep their prior to rounding of inverses, however its readings flicker."""
    batch = readings(1e-3, 4, np.zeros(round(30.0 * RATE_HZ)))
    value, error = last(filter_of(1e-3), batch)
    controls, prior = [2, 5], PITCH.aerodynamic
    np.testing.assert_allclose(value[:, controls], np.tile(0.8 * prior[controls], (4, 1)), rtol=1e-4)
    np.testing.assert_allclose(error[:, controls], np.tile(np.abs(prior[controls]), (4, 1)), rtol=1e-4)


def some_information(rng: np.random.Generator, k: int) -> Array:
    root = rng.standard_normal((k, 2 * k))
    return np.asarray(root @ root.T)


def test_others_are_known_as_far_as_the_input_that_rests_beside_them() -> None:
    """Two equations of two states and an input: what rests has the distribution of before, the others, given it, that
    of after."""
    rng, rests, others = np.random.default_rng(3), [2, 5], [0, 1, 3, 4]
    before, mean = some_information(rng, 6), rng.standard_normal(6)
    matrix = before + 10.0 * some_information(rng, 6)
    vector = matrix @ (mean + 0.1 * rng.standard_normal(6))
    found, score = matrix.copy(), vector.copy()
    in_python(leave_out)(found, score, before, mean, np.array([False, False, True]), 2)
    covariance = np.linalg.inv(found)
    np.testing.assert_allclose((covariance @ score)[rests], mean[rests], rtol=1e-9)
    np.testing.assert_allclose(
        covariance[np.ix_(rests, rests)], np.linalg.inv(before)[np.ix_(rests, rests)], rtol=1e-9
    )
    np.testing.assert_allclose(found[others], matrix[others], rtol=1e-9)
    np.testing.assert_allclose(score[others], vector[others], rtol=1e-9)


def test_where_the_mode_rests_the_others_are_known_at_the_mean_of_what_rests() -> None:
    rng, rests, others = np.random.default_rng(4), [0, 1, 3, 4], [2, 5]
    before, mean = some_information(rng, 6), rng.standard_normal(6)
    matrix = before + 10.0 * some_information(rng, 6)
    vector = matrix @ (mean + 0.1 * rng.standard_normal(6))
    found, score = matrix.copy(), vector.copy()
    in_python(leave_out)(found, score, before, mean, np.array([True, True, False]), 2)
    np.testing.assert_array_equal(found[rests], before[rests])
    np.testing.assert_array_equal(found[np.ix_(others, others)], matrix[np.ix_(others, others)])
    given = np.linalg.solve(
        found[np.ix_(others, others)], score[others] - found[np.ix_(others, rests)] @ mean[rests]
    )
    was = np.linalg.solve(
        matrix[np.ix_(others, others)], vector[others] - matrix[np.ix_(others, rests)] @ mean[rests]
    )
    np.testing.assert_allclose(given, was, rtol=1e-9)


def test_both_engines_treat_reading_errors_alike() -> None:
    batch = readings(2e-3, 1, doublets(PITCH, 12.0, every_s=2.0))
    value, error = last(filter_of(2e-3), batch)
    by_filterpy, error_by_filterpy = last(filter_of(2e-3, "filterpy"), batch)
    np.testing.assert_allclose(value, by_filterpy, rtol=1e-9)
    np.testing.assert_allclose(error, error_by_filterpy, rtol=1e-9)


def test_a_surface_noisier_than_stated_does_not_make_its_derivatives_small() -> None:
    """Noise of a fifth of the doublets' rms, stated as a tenth, and ten seconds of rest in which that shows."""
    inputs = np.concatenate([np.zeros(round(10.0 * RATE_HZ)), doublets(PITCH, 60.0, every_s=10.0)])
    noise_std = 0.2 * float(inputs.std())
    batch = readings(noise_std, 12, inputs)
    value, _ = last(filter_of(noise_std / 2.0), batch)
    assert abs(value[:, 5].mean() / PITCH.truth[5] - 1.0) < 0.02
