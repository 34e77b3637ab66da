"""The estimators that work on files: each of them, the same promises."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from estimator_plants import LEVEL, REFERENCE, quiet_batch
from numpy.typing import NDArray
from offline_flights import (
    CASES,
    LATERAL_TRUTH,
    lateral_inputs,
    lateral_parts,
    lateral_rows,
    without_vane,
)
from scipy.stats import binom

from wingwatch.aircraft import DUTCH_ROLL, SHORT_PERIOD
from wingwatch.estimators import (
    EquationErrorConfig,
    Estimate,
    Fit,
    FrequencyEquationErrorConfig,
    Manoeuvre,
    ManoeuvreConfig,
    Outcome,
    OutputErrorConfig,
    SignalLayout,
    correlated_pairs,
    equation_error,
    frequency_equation_error,
    manoeuvres,
    output_error,
)

Array = NDArray[np.float64]
Solve = Callable[[Sequence[Manoeuvre]], tuple[Estimate, Fit]]

BAND_HZ = (0.1, 4.0)

ESTIMATORS: dict[str, Solve] = {
    "equation-error": equation_error,
    "frequency-equation-error": lambda parts: frequency_equation_error(
        parts, FrequencyEquationErrorConfig(BAND_HZ)
    ),
    "output-error": output_error,
}

every = pytest.mark.parametrize("name", ESTIMATORS)
both = pytest.mark.parametrize("mode", CASES)


def disturbed(rows: Array, added: Array) -> Array:
    """Signal rows with something added to velocity and rate, (n, 2), which the kinematics read too."""
    layout = SignalLayout(2, 1)
    turn = np.polyfit(rows[:, 2], rows[:, layout.kinematic], 1)[0]
    out = rows.copy()
    out[:, 1:3] += added
    out[:, layout.kinematic] += turn * added[:, 1]
    return out


@every
@both
def test_clean_data_give_the_truth_closer_than_faint_noise_would(name: str, mode: str) -> None:
    case = CASES[mode]
    estimate, _ = ESTIMATORS[name](case.parts(case.clean()))
    _, faint = ESTIMATORS[name](case.parts(case.noisy(0, signal_to_noise=30.0)))
    error = np.abs(estimate.value - case.plant.truth)
    assert (error < np.sqrt(np.diagonal(faint.covariance_white))).all()
    assert estimate.estimator == name


@both
def test_output_error_on_clean_data_is_exact(mode: str) -> None:
    case = CASES[mode]
    for use in (True, False):
        whole = replace(case, use_accelerometer=use)
        estimate, fit = output_error(whole.parts(whole.clean(offsets=(1.3, 0.05, 0.05))))
        assert estimate.value == pytest.approx(case.plant.truth, rel=1e-6)
        assert all(c.r_squared > 1.0 - 1e-12 for c in fit.channels)


@every
@both
def test_the_interval_holds_the_truth_as_often_as_it_says(name: str, mode: str) -> None:
    case, records = CASES[mode], 60
    solved = [ESTIMATORS[name](case.parts(case.noisy(seed))) for seed in range(records)]
    within = np.sum(
        [(f.interval[:, 0] <= case.plant.truth) & (case.plant.truth <= f.interval[:, 1]) for _, f in solved],
        axis=0,
    )
    assert within.min() >= binom.ppf(1e-4, records, 0.95)
    error = np.array([e.value - case.plant.truth for e, _ in solved])
    stated = np.mean([e.standard_error for e, _ in solved], axis=0)
    # a standard deviation from 60 records is known to 9 %; 1.45 is five times that, either way
    assert (error.std(axis=0) / stated).max() < 1.45
    assert (stated / error.std(axis=0)).max() < 1.45


@every
@both
def test_trim_offsets_do_not_matter(name: str, mode: str) -> None:
    case = CASES[mode]
    rows = case.noisy(3)
    layout = SignalLayout(2, 1)
    moved = rows.copy()
    moved[:, 1] += 1.3
    moved[:, 2] += 0.05
    moved[:, layout.first_input] += 0.05
    moved[:, layout.kinematic] += (
        0.05 * (rows[1, layout.kinematic] - rows[0, layout.kinematic]) / (rows[1, 2] - rows[0, 2])
    )
    one, _ = ESTIMATORS[name](case.parts(rows))
    other, _ = ESTIMATORS[name](case.parts(moved))
    assert np.abs(one.value - other.value).max() < 0.01 * one.standard_error.min()


@every
@both
def test_two_flights_together_err_less_and_keep_their_own_trims(name: str, mode: str) -> None:
    case = CASES[mode]
    flights = [case.noisy(seed) for seed in (1, 2)]
    flights[1] = flights[1].copy()
    flights[1][:, 1] += 2.0
    alone, _ = ESTIMATORS[name](case.parts(flights[0]))
    parts = [part for flight in flights for part in case.parts(flight)]
    together, fit = ESTIMATORS[name](parts)
    assert (len(parts), fit.manoeuvres) == (2, 2)
    ratio = alone.standard_error / together.standard_error
    assert np.sqrt(2.0) == pytest.approx(np.median(ratio), rel=0.15)
    assert (np.abs(together.value - case.plant.truth) < 5.0 * together.standard_error).all()


@every
@both
def test_flights_at_two_airspeeds_have_common_referred_derivatives(name: str, mode: str) -> None:
    """Aerodynamic columns scale with rho V and rho V^2: the flight is made by scaling what acts, not the estimate."""
    case = CASES[mode]
    parts = case.parts(case.noisy(4))
    assert len(parts) == 1
    estimate, _ = ESTIMATORS[name](parts)
    faster = replace(
        case.config, reference=(REFERENCE[0] / 1.2, REFERENCE[1])
    )  # the same flight seen from a lower reference: referred derivatives shrink, present ones stay
    same, _ = ESTIMATORS[name](
        [
            replace(
                parts[0], config=faster, stability=parts[0].stability * 1.2, control=parts[0].control * 1.44
            )
        ]
    )
    assert same.value == pytest.approx(estimate.value, rel=1e-6)


@every
def test_lateral_motion_with_two_surfaces(name: str) -> None:
    estimate, fit = ESTIMATORS[name](lateral_parts(lateral_rows(lateral_inputs(), 0.05, seed=5)))
    z = (estimate.value - LATERAL_TRUTH) / estimate.standard_error
    assert np.abs(z).max() < 5.0
    assert np.sqrt(np.mean(z**2)) < 2.0
    assert fit.correlation.shape == (15, 15)


@every
def test_surfaces_moved_as_one_are_named_instead_of_given(name: str) -> None:
    rows = lateral_rows(lateral_inputs(ratio=0.5), 0.05, seed=6)
    estimate, _ = ESTIMATORS[name](lateral_parts(rows))
    by_surface = [d.endswith(("_xi", "_zeta")) for d in estimate.structure.derivatives]
    hidden = np.array([o is Outcome.NOT_OBSERVABLE for o in estimate.outcomes])
    assert hidden[by_surface].all()
    assert np.isnan(estimate.value[by_surface]).all()
    assert np.isinf(estimate.standard_error[by_surface]).all()
    assert "l_xi" in estimate.reason
    assert "l_zeta" in estimate.reason
    alone = ~np.array(by_surface)
    z = (estimate.value - LATERAL_TRUTH)[alone] / estimate.standard_error[alone]
    assert np.abs(z).max() < 5.0


@every
@both
def test_quiet_flight_teaches_nothing(name: str, mode: str) -> None:
    case = CASES[mode]
    estimate, _ = ESTIMATORS[name](case.parts(quiet_batch(case.plant, 30.0, seed=7)[0]))
    converged = {
        symbol
        for symbol, outcome in zip(estimate.structure.derivatives, estimate.outcomes, strict=True)
        if outcome is Outcome.CONVERGED
    }
    assert converged <= {"z_q", "y_r"}  # these are the forward speed, which is measured, but for a little


@every
def test_motion_that_the_model_does_not_have_is_rejected(name: str) -> None:
    case = CASES["short_period"]
    rows = case.noisy(8, signal_to_noise=30.0)
    shake = np.zeros((len(rows), 2))
    shake[:, 1] = 1.5 * rows[:, 2].std() * np.sin(2.0 * np.pi * 0.7 * rows[:, 0])
    rows = disturbed(rows, shake)
    estimate, _ = ESTIMATORS[name](case.parts(rows))
    assert Outcome.REJECTED in estimate.outcomes
    assert "neither the model's nor the sensors' noise" in estimate.reason


@pytest.mark.parametrize("name", ["frequency-equation-error", "output-error"])
@both
def test_without_a_vane_the_errors_stay_honest(name: str, mode: str) -> None:
    case, z = CASES[mode], []
    for seed in range(12):
        estimate, _ = ESTIMATORS[name](case.parts(without_vane(case.noisy(seed))))
        z.append((estimate.value - case.plant.truth) / estimate.standard_error)
    # the mean square of 72 correlated normal values, of which at least 12 are independent: below 2.75 but for 1 in 1000
    assert np.mean(np.square(z)) < 2.75
    assert np.abs(np.mean(z, axis=0)).max() < 4.0 / np.sqrt(12.0)


@both
def test_gauss_newton_and_levenberg_marquardt_meet(mode: str) -> None:
    case = CASES[mode]
    parts = case.parts(case.noisy(9))
    one, _ = output_error(parts, OutputErrorConfig("gauss-newton"))
    other, _ = output_error(parts, OutputErrorConfig("levenberg-marquardt"))
    assert (np.abs(one.value - other.value) < 0.01 * one.standard_error).all()
    far, fit = output_error(parts, start=0.3 * case.plant.aerodynamic)
    assert fit.converged
    assert (np.abs(far.value - other.value) < 0.01 * one.standard_error).all()


def test_output_error_finds_the_noise_and_counts_its_freedom() -> None:
    case = replace(CASES["short_period"], use_accelerometer=False)
    clean = case.clean()
    true = clean[:, 1:3].std(axis=0) / 5.0
    found = np.mean(
        [list(output_error(case.parts(case.noisy(s)))[1].noise_std.values()) for s in range(10)], axis=0
    )
    # 6000 values of each channel: known to 0.9 %
    assert found == pytest.approx(true, rel=0.04)


@every
@both
def test_statistics_are_those_of_the_estimate(name: str, mode: str) -> None:
    case = CASES[mode]
    estimate, fit = ESTIMATORS[name](case.parts(case.noisy(10)))
    spread = fit.covariance_coloured if fit.coloured else fit.covariance_white
    assert estimate.covariance == pytest.approx(spread)
    assert np.diagonal(fit.correlation) == pytest.approx(np.ones(6))
    assert np.abs(fit.correlation).max() <= 1.0 + 1e-9
    half = 0.5 * (fit.interval[:, 1] - fit.interval[:, 0])
    assert fit.interval.mean(axis=1) == pytest.approx(estimate.value)
    assert (half >= 1.959 * estimate.standard_error).all()
    for channel in fit.channels:
        assert channel.bias + channel.variance + channel.covariance == pytest.approx(1.0)
        assert 0.0 < channel.tic < 1.0
        assert channel.autocorrelation[0] == pytest.approx(1.0)
    for one, other, value in correlated_pairs(estimate.structure, fit.correlation, 0.0):
        names = estimate.structure.derivatives
        assert value == fit.correlation[names.index(one), names.index(other)]


def test_coloured_residuals_widen_the_interval() -> None:
    """Noise through a first-order lag: its power lies where the mode is, and white-noise errors are too small."""
    case = replace(CASES["dutch_roll"], use_accelerometer=False)
    errors, white, stated = [], [], []
    for seed in range(40):
        rows = case.clean()
        shocks = np.random.default_rng(seed).standard_normal((len(rows) + 200, 2))
        noise = np.zeros_like(shocks)
        for k in range(1, len(noise)):
            noise[k] = 0.8 * noise[k - 1] + 0.6 * shocks[k]
        rows = disturbed(rows, rows[:, 1:3].std(axis=0) / 20.0 * noise[200:])
        estimate, fit = output_error(case.parts(rows))
        assert fit.coloured
        errors.append(estimate.value - case.plant.truth)
        white.append(np.sqrt(np.diagonal(fit.covariance_white)))
        stated.append(estimate.standard_error)
    scatter = np.std(errors, axis=0)
    # a standard deviation from 40 records is known to 11 %; 1.45 is four of them
    assert (scatter / np.mean(stated, axis=0)).max() < 1.45
    assert (scatter / np.mean(white, axis=0)).max() > 1.6


def test_correcting_for_noise_takes_the_bias_away() -> None:
    case = replace(CASES["short_period"], use_accelerometer=False)
    records = [case.parts(case.noisy(s, signal_to_noise=2.0)) for s in range(25)]
    bias = {}
    for correct in (True, False):
        config = EquationErrorConfig(cutoff_hz=8.0, correct_noise=correct)
        solved = [equation_error(parts, config)[0] for parts in records]
        error = np.mean([e.value - case.plant.truth for e in solved], axis=0)
        bias[correct] = np.abs(error) / (np.mean([e.standard_error for e in solved], axis=0) / 5.0)
    assert bias[True].max() < 4.0
    assert bias[False].max() > 8.0


def test_manoeuvres_are_cut_at_gaps_and_windows() -> None:
    case = replace(CASES["short_period"], window_s=5.0)
    rows = case.clean(13.0)
    rows = np.concatenate([rows[:300], rows[350:]])
    parts = case.parts(rows)
    assert [round(p.duration_s + p.dt, 6) for p in parts] == [3.0, 3.0, 3.0, 3.0]
    assert case.parts(rows[:60]) == ()
    rows[100:110, 2] = np.nan
    assert len(case.parts(rows)) == 4


def test_uneven_stamps_are_brought_to_even_ones() -> None:
    case = CASES["short_period"]
    rows = case.noisy(11)
    rng = np.random.default_rng(0)
    even = case.parts(rows)[0]
    assert even.even() is even
    jittered = replace(even, time_s=even.time_s + 0.002 * rng.uniform(-1.0, 1.0, len(even)))
    straight = jittered.even()
    assert np.ptp(np.diff(straight.time_s)) < 1e-12
    assert straight.states == pytest.approx(even.states, abs=0.2 * np.abs(np.diff(even.states, axis=0)).max())


def test_bad_input_is_said_in_one_sentence() -> None:
    pitch, yaw = CASES["short_period"], CASES["dutch_roll"]
    with pytest.raises(ValueError, match="no manoeuvre"):
        output_error([])
    with pytest.raises(ValueError, match="different structures"):
        equation_error([*pitch.parts(pitch.clean()), *yaw.parts(yaw.clean())])
    with pytest.raises(ValueError, match="give 5"):
        equation_error(pitch.parts(pitch.clean()), EquationErrorConfig(noise_std=(0.1,)))
    with pytest.raises(ValueError, match="widen the band"):
        frequency_equation_error(pitch.parts(pitch.clean()), FrequencyEquationErrorConfig((1.0, 1.1)))
    with pytest.raises(ValueError, match="signals have shape"):
        manoeuvres(pitch.config, np.zeros((10, 3)))
    with pytest.raises(ValueError, match="has 1 inputs"):
        ManoeuvreConfig(SHORT_PERIOD, REFERENCE, held=(True, False))
    with pytest.raises(ValueError, match="shortest_s"):
        ManoeuvreConfig(DUTCH_ROLL, REFERENCE, window_s=1.0)


def test_the_condition_is_that_of_the_manoeuvres() -> None:
    case = CASES["short_period"]
    estimate, fit = output_error(case.parts(case.clean(30.0)))
    assert fit.manoeuvres == 3
    assert fit.samples == 1500
    assert estimate.condition[0] == pytest.approx(LEVEL.airspeed_true_m_s)
    assert estimate.time_s == pytest.approx(29.98)
