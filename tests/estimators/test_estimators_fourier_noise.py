"""Noise, gusts and rolling air in the equations of a block: compiled sums beside whole matrices, variances found
again."""

from dataclasses import dataclass

import numpy as np
import pytest
from estimator_kernels import PITCH_MODEL, in_python
from numpy.typing import NDArray

from wingwatch.estimators.fourier import doubt, driven_motion, noise, products, regressor_errors
from wingwatch.estimators.fourier.noise import (
    Air,
    NoiseWorkspace,
    Plant,
    air_of,
    between_samples_variance,
    noise_variances,
    noise_workspace,
    weigh,
)
from wingwatch.estimators.fourier.regressor_errors import without_errors
from wingwatch.estimators.fourier.state import AIR_VARIANCES, COURSES, GUST, ROLLING, Equation

weigh_with_doubt = in_python(noise.weigh_with_doubt)
doubt_of, doubt_of_courses = map(in_python, (doubt.doubt_of, doubt.doubt_of_courses))
driven_motions, roll_shared_at_ends = map(
    in_python, (driven_motion.driven_motions, driven_motion.roll_shared_at_ends)
)
expected_products, motion_by_moments = map(
    in_python, (products.expected_products, products.motion_by_moments)
)
add_unseen_errors, shared_with_residual, shown_by_residual = map(
    in_python,
    (
        regressor_errors.add_unseen_errors,
        regressor_errors.shared_with_residual,
        regressor_errors.shown_by_residual,
    ),
)

OMEGA = 2.0 * np.pi * np.arange(1, 41) / 10.0
SPEED, POWER, SPAN = 25.0, 0.2, 10.0

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Case:
    """An aircraft with ns states and one input, and its noise; rows ns or, with the kinematic one, ns + 1."""

    plant: Plant
    air: Air
    noise: Array
    rows: int

    @property
    def states(self) -> int:
        return int(self.plant.lever.size)


def case(ns: int, longitudinal: bool, kinematic: bool = True, by_accelerometer: bool = True) -> Case:
    rng = np.random.default_rng(ns)
    derivatives = rng.standard_normal((ns, ns + 1)) - 4.0 * np.eye(ns, ns + 1)
    forward, lever = np.zeros(ns), np.zeros(ns)
    forward[ns - 1], lever[-1] = (SPEED if longitudinal else -SPEED), 0.1
    noise = rng.uniform(0.5, 2.0, 2 * ns + 2 + AIR_VARIANCES) * 1e-2
    noise[2 * ns + 1], noise[ns + 1] = 1e-4, 0.0
    noise[GUST:] = 20.0, 0.3, 1e-3
    rolls = derivatives[:, 1].copy() if ns == 3 else np.zeros(ns)
    plant = Plant(derivatives, forward, lever, rolls, by_accelerometer, kinematic)
    turn = (-1.0 if longitudinal else 1.0) / SPEED
    return Case(plant, Air(turn, 0.15, 0.12, 0.4), noise, ns + (1 if kinematic else 0))


def transfer_of(c: Case, omega: float) -> tuple[Complex, Complex]:
    """L of states, accelerometer and input; B of the gust's rate, the rolling, and what a gust does between samples."""
    ns, s = c.states, 1j * omega
    d, u, lever = c.plant.derivatives, c.plant.forward_speed, c.plant.lever
    sensors, air = np.zeros((ns + 1, ns + 2), complex), np.zeros((ns + 1, 3), complex)
    sensors[:ns, :ns], sensors[:ns, ns + 1] = -d[:, :ns], -d[:, ns]
    sensors[1:ns, 1:ns] += s * np.eye(ns - 1)
    sensors[0, ns], sensors[ns, ns] = 1.0, -1.0
    sensors[0, 1:ns] += lever[1:] * s
    sensors[ns, 0] = s
    sensors[ns, 1:ns] = -u[1:] - lever[1:] * s
    turn = c.air.turn / (1.0 + s * c.air.turn_s)
    air[:ns, 0] = -d[:, ns - 1] * turn
    air[ns, 0] = -1.0
    air[:ns, 1] = -c.plant.roll_column / (1.0 + s * c.air.roll_s)
    # e moves the states as velocity and turn rate do; the line of the accelerometer lacks some of it, too
    air[:ns, 2], air[ns, 2] = d[:, 0] + d[:, ns - 1] * turn * s, c.air.together * d[0, 0]
    if c.plant.by_accelerometer:
        air[0, 2] = (1.0 - c.air.together) * d[0, 0] - d[0, ns - 1] * turn / c.air.turn_s
    if not c.plant.by_accelerometer:
        # the velocity's rate: force row and kinematic row together, the accelerometer gone
        together = sensors[0] + sensors[ns]
        together[0] = s - d[0, 0]
        sensors[0], air[0, :2] = together, air[0, :2] + air[ns, :2]
        sensors[0, 1:ns] = -d[0, 1:ns] - u[1:]
    return sensors[: c.rows], air[: c.rows]


def weighed(c: Case) -> NoiseWorkspace:
    work = noise_workspace(c.states, 1, c.rows, OMEGA.size)
    weigh(OMEGA, c.plant, c.air, c.noise, POWER, work)
    work.sure[...] = work.weights
    driven_motions(OMEGA, c.plant, work)
    return work


def variances(c: Case) -> tuple[Array, Array]:
    """Of states, accelerometer and input; of the equations."""
    ns = c.states
    own = np.zeros(c.rows)
    own[:ns] = c.noise[ns + 1 : 2 * ns + 1]
    return np.concatenate([c.noise[: ns + 1], c.noise[2 * ns + 1 : 2 * ns + 2]]), own


CASES = {
    "pitch": case(2, True),
    "yaw": case(2, False),
    "lateral": case(3, False),
    "without kinematic row": case(2, True, kinematic=False),
    "without accelerometer": case(2, True, kinematic=False, by_accelerometer=False),
}


@pytest.mark.parametrize("name", list(CASES))
def test_weights_are_the_inverse_of_all_that_noise_and_air_do(name: str) -> None:
    c = CASES[name]
    work, (sensors, own) = weighed(c), variances(c)
    for f, omega in enumerate(OMEGA):
        left, by_air = transfer_of(c, omega)
        if not c.plant.by_accelerometer:
            sensors = sensors * np.array([1.0, 1.0, 0.0, 1.0])
        sigma = left @ np.diag(sensors) @ left.conj().T + np.diag(own)
        sigma = POWER * (sigma + by_air @ np.diag(c.noise[GUST:]) @ by_air.conj().T)
        found = work.weights[:, :, 0, f] + 1j * work.weights[:, :, 1, f]
        if c.plant.by_accelerometer:
            np.testing.assert_allclose(found @ sigma, np.eye(c.rows), atol=1e-8)
        else:
            np.testing.assert_allclose(found, np.linalg.inv(sigma), rtol=1e-6)


@pytest.mark.parametrize("name", ["pitch", "yaw", "lateral"])
def test_products_with_the_regressors_are_those_of_noise_and_of_what_drives_the_states(name: str) -> None:
    """E[R' W r] of what the regressors are without their errors, written out: the gust, between samples too, through
    (s - A)^-1, and the turning of the air in the last rate.

    Of the rolling air only what it did to the readings at the block's ends is left in the regressors; with the lag tau
    that goes with 2 c(1/tau) - c(s). What moment equations leave out drives the states as well: no part of the
    correction, for its loop is not known, but noise power of the regressors.
    """
    c = CASES[name]
    ns, nd, work = c.states, c.states + 1, weighed(c)
    n_noise, nothing = np.empty((ns * nd, ns * nd)), np.empty((0, 0))
    g, driven = np.zeros(ns * nd), np.empty(ns * nd)
    motion_by_moments(OMEGA, c.plant, c.noise, POWER, work, n_noise)
    roll_shared_at_ends(c.plant, c.air, work)
    equation = Equation(nothing, nothing, np.empty(0), g, driven)
    expected_products(OMEGA, c.plant, c.air, c.noise, POWER, SPAN, work, equation)
    _, own = variances(c)
    want_g, want_driven = np.zeros((ns, nd)), np.zeros((ns, nd))
    a = c.plant.derivatives[:, :ns].copy()
    a[0] += c.plant.forward_speed
    for f, omega in enumerate(OMEGA):
        _, by_air = transfer_of(c, omega)
        w = work.weights[:, :, 0, f] + 1j * work.weights[:, :, 1, f]
        products = np.zeros((c.rows, nd), complex)
        answer = np.linalg.inv(1j * omega * np.eye(ns) - a)
        drive = by_air[:ns].copy()
        drive[0] += by_air[ns]
        by_gust, by_roll, by_rest = (answer @ drive[:, e] for e in range(3))
        begun = np.linalg.inv(np.eye(ns) / c.air.roll_s - a) @ -c.plant.roll_column
        relative = by_gust.copy()
        relative[-1] -= c.air.turn / (1.0 + 1j * omega * c.air.turn_s)
        moved = (
            relative - answer @ by_gust / SPAN,
            answer @ (begun - by_roll) / SPAN,
            by_rest - answer @ by_rest / SPAN,
        )
        for e in range(3):
            products[:, :ns] += c.noise[GUST + e] * np.outer(by_air[:, e], moved[e].conj())
        want_g += POWER * (w @ products).real[:ns]
        moments = np.zeros((c.rows, ns), complex)
        moments[:ns] = np.diag(own[:ns]) @ answer.conj().T
        want_driven[:, :ns] += POWER * (w @ moments).real[:ns]
    np.testing.assert_allclose(g, want_g.ravel(), rtol=1e-7, atol=1e-8 * np.abs(want_g).max())
    np.testing.assert_allclose(driven, want_driven.ravel(), rtol=1e-7, atol=1e-8 * np.abs(want_driven).max())
    explained = (c.plant.derivatives * want_g).sum(axis=1)
    size = np.abs(c.plant.derivatives * want_g).max()
    np.testing.assert_allclose(work.driven[:, 0].sum(axis=1), explained, rtol=1e-7, atol=1e-8 * size)
    np.testing.assert_allclose(n_noise, n_noise.T, rtol=1e-12)
    by_moments = np.diag(n_noise).reshape(ns, nd)
    np.testing.assert_array_equal((by_moments[:, :ns] > 0.0).all(axis=1), own[:ns] > 0.0)
    assert (by_moments[:, ns:] == 0.0).all()


@pytest.mark.parametrize("shown", [1.0, 0.4])
@pytest.mark.parametrize("name", list(CASES))
def test_what_is_left_of_the_errors_of_regressors_is_known(name: str, shown: float) -> None:
    """Residuals drawn as the model has them, beside the errors in regressors that made them: on average the score has
    as much of these left as said, nothing where the residual is believed to show all, and had much more; and the power
    of what is left is as said."""
    c, draws, rng = CASES[name], 2000, np.random.default_rng(8)
    ns, nd, work = c.states, c.states + 1, weighed(c)
    sensors, own = variances(c)
    shared_with_residual(OMEGA, c.plant, c.air, c.noise, POWER, work)
    n_noise, expected, nothing = np.zeros((ns * nd, ns * nd)), np.zeros(ns * nd), np.empty(0)
    unseen = Equation(np.empty((0, 0)), n_noise, nothing, expected, nothing)
    add_unseen_errors(c.noise, POWER, shown, work, unseen)
    assert expected.any() == (shown < 1.0)
    residual, errors = np.zeros((draws, c.rows, 2, OMEGA.size)), np.zeros((draws, nd + 1, 2, OMEGA.size))
    for f, omega in enumerate(OMEGA):
        left, by_air = transfer_of(c, omega)
        noise, air = drawn(rng, draws, sensors), drawn(rng, draws, c.noise[GUST:])
        r = noise @ left.T + air @ by_air.T + drawn(rng, draws, own)
        x = noise.copy()
        x[:, ns - 1] += air[:, 0] * c.air.turn / (1.0 + 1j * omega * c.air.turn_s)
        if ns == 3:
            x[:, :ns] += np.outer(
                air[:, 1], work.answers[:, ns + 1, 0, f] + 1j * work.answers[:, ns + 1, 1, f]
            )
        residual[:, :, 0, f], residual[:, :, 1, f] = r.real, r.imag
        errors[:, :, 0, f], errors[:, :, 1, f] = x.real, x.imag
    rest, whitened = np.empty_like(errors), np.empty_like(residual)
    w = work.weights[:, :, 0] + 1j * work.weights[:, :, 1]
    for i in range(draws):
        white = np.einsum("kmf,mf->kf", w, residual[i, :, 0] + 1j * residual[i, :, 1])
        whitened[i, :, 0], whitened[i, :, 1] = white.real, white.imag
        without_errors(whitened[i], shown, errors[i], work, rest[i])
    kept = [*range(ns), ns + 1]
    before, after = scores(errors[:, kept], work, residual), scores(rest[:, kept], work, residual)
    error = after.std(axis=0) / np.sqrt(draws)
    assert (np.abs(after.mean(axis=0) - expected) < 4.5 * error + 1e-12).all()
    assert (np.abs(before.mean(axis=0)) > 10.0 * error).any()
    v = rest[:, kept, 0] + 1j * rest[:, kept, 1]
    power = np.einsum("ijf,kmf,inf->ikjmn", v.conj(), w[:ns, :ns], v).real.reshape(draws, ns * nd, ns * nd)
    scatter = power.std(axis=0) / np.sqrt(draws)
    assert (np.abs(power.mean(axis=0) - n_noise) < 4.5 * scatter + 1e-9 * np.abs(n_noise).max()).all()


@pytest.mark.parametrize("name", ["pitch", "lateral"])
def test_a_residual_shows_noise_as_far_as_no_derivative_explains_it(name: str) -> None:
    """All of one as large as noise makes it, whatever derivatives explain; of a larger one what they leave, and no
    less than noise is."""
    c, rng = CASES[name], np.random.default_rng(9)
    work = weighed(c)
    residual = rng.normal(size=(c.rows, 2, OMEGA.size))
    w = work.weights[:, :, 0] + 1j * work.weights[:, :, 1]
    r = residual[:, 0] + 1j * residual[:, 1]
    residual *= np.sqrt(c.rows * OMEGA.size / np.einsum("kf,kmf,mf->", r.conj(), w, r).real)
    noise = c.rows * OMEGA.size
    for size, explained, shown in (
        (0.9, 0.8, 1.0),
        (100.0, 0.0, 1.0),
        (100.0, 0.7, 0.3),
        (100.0, 0.9999, 0.01),
    ):
        found = shown_by_residual(work.weights, np.sqrt(size) * residual, explained * size * noise)
        assert found == pytest.approx(shown, rel=1e-9)


def test_doubt_of_derivatives_widens_the_weights_alone() -> None:
    c = CASES["pitch"]
    work = weighed(c)
    doubt_of(np.eye(6), np.ones(6), c.plant, c.noise, work.doubt)
    weigh_with_doubt(OMEGA, c.noise, POWER, work)
    rows = np.arange(c.states)
    assert (work.weights[rows, rows, 0] < work.sure[rows, rows, 0]).all()


def test_an_error_of_all_that_roll_does_is_one_of_the_rolling_air_and_ratios_are_doubted() -> None:
    """Of derivatives by roll rate that err together nothing is noise; of one that errs alone, all of it."""
    c = CASES["lateral"]
    work, columns = weighed(c), c.plant.derivatives.shape[1]
    by_roll = np.zeros(c.states * columns)
    by_roll[1::columns] = c.plant.roll_column
    size = np.outer(by_roll, by_roll)
    doubt_of(0.04 * size, np.ones(by_roll.size), c.plant, c.noise, work.doubt)
    assert np.abs(work.doubt[2]).max() < 1e-12 * c.noise[ROLLING] * size.max()
    yaw_alone = np.zeros_like(size)
    yaw_alone[2 * columns + 1, 2 * columns + 1] = 0.04
    doubt_of(yaw_alone, np.ones(by_roll.size), c.plant, c.noise, work.doubt)
    want = np.zeros((3, 3))
    want[2, 2] = 0.04 * c.noise[ROLLING]
    np.testing.assert_allclose(work.doubt[2], want, atol=1e-15)


@pytest.mark.parametrize("name", ["pitch", "lateral"])
def test_a_surface_that_was_elsewhere_between_samples_is_noise_while_it_moves(name: str) -> None:
    """Known to a tenth of a degree where it moved, by two degrees in ten steps of a block: as large as there.

    Of an accelerometer ahead of the centre of gravity the lever's part is left, the angular accelerations being exact.
    """
    c = CASES[name]
    ns, nd = c.plant.derivatives.shape
    variance = np.deg2rad(0.1) ** 2
    sums = np.zeros(COURSES + 2 * (nd - ns))
    moved = 10.0 * np.deg2rad(2.0) ** 2
    sums[COURSES:] = np.tile([moved, moved * variance], nd - ns)
    doubt = np.zeros((ns, ns))
    doubt_of_courses(sums, c.plant, doubt)
    by_surface = c.plant.derivatives[:, ns:].copy()
    if c.plant.by_accelerometer:
        by_surface[0] = c.plant.lever[1:] @ by_surface[1:]
    np.testing.assert_allclose(doubt, variance * by_surface @ by_surface.T, rtol=1e-12)
    still = np.zeros((ns, ns))
    doubt_of_courses(np.zeros(sums.size), c.plant, still)
    assert (still == 0.0).all()


def drawn(rng: np.random.Generator, draws: int, variance: Array) -> Complex:
    """Transforms of white noise in one bin, (draws, sources)."""
    parts = rng.standard_normal((2, draws, variance.size)) * np.sqrt(0.5 * POWER * variance)
    return np.asarray(parts[0] + 1j * parts[1])


def scores(regressors: Array, work: NoiseWorkspace, residual: Array) -> Array:
    """sum Re(R' W r) of every draw, equation by equation."""
    x, r = regressors[:, :, 0] + 1j * regressors[:, :, 1], residual[:, :, 0] + 1j * residual[:, :, 1]
    w = work.weights[:, :, 0] + 1j * work.weights[:, :, 1]
    weighted = np.einsum("kmf,imf->ikf", w, r)[:, : work.sums.shape[0]]
    return np.asarray(np.einsum("ijf,ikf->ikj", x.conj(), weighted).real.reshape(len(r), -1))


@pytest.mark.parametrize("variance", [0.0, 30.0])
def test_the_gust_s_variance_is_found_and_may_be_nothing(variance: float) -> None:
    """Residuals drawn as the model has them, with and without a gust; 20 blocks of 40 bins tell it to 4 / sqrt(800)."""
    c, rng = CASES["pitch"], np.random.default_rng(5)
    truth = c.noise.copy()
    truth[GUST] = variance
    found = []
    for _ in range(20):
        noise = c.noise.copy()
        drawn = draw(c, truth, rng)
        for _ in range(12):
            work = noise_workspace(2, 1, c.rows, OMEGA.size)
            weigh(OMEGA, c.plant, c.air, noise, POWER, work)
            w = work.weights[:, :, 0] + 1j * work.weights[:, :, 1]
            whitened = np.einsum("kmf,mf->kf", w, drawn)
            total = np.empty(noise.size)
            parts = np.ascontiguousarray(np.stack([whitened.real, whitened.imag], axis=1))
            noise_variances(parts, 1.0, noise, POWER, work, total)
            noise[GUST] = total[GUST]
        found.append(noise[GUST])
    if variance:
        assert np.mean(found) == pytest.approx(variance, rel=4.0 / np.sqrt(800))
    else:
        assert np.median(found) < 0.02


def draw(c: Case, noise: Array, rng: np.random.Generator) -> Complex:
    """Residuals of one block, (rows, bins)."""
    out = np.empty((c.rows, OMEGA.size), complex)
    for f, omega in enumerate(OMEGA):
        left, by_air = transfer_of(c, omega)
        sensors, own = variances(c)
        sigma = left @ np.diag(sensors) @ left.conj().T + np.diag(own)
        sigma = POWER * (sigma + by_air @ np.diag(noise[GUST:]) @ by_air.conj().T)
        z = rng.standard_normal(c.rows) + 1j * rng.standard_normal(c.rows)
        out[:, f] = np.linalg.cholesky(sigma) @ z / np.sqrt(2.0)
    return out


def test_a_walk_between_samples_is_short_of_its_line_by_a_twelfth() -> None:
    """The integral of a Wiener process over a step less that of the line through its ends, drawn 200 times finer."""
    rng, dt, rate, fine = np.random.default_rng(6), 0.02, 30.0, 200
    steps = rng.standard_normal((4000, fine)) * np.sqrt(rate * dt * dt / fine)
    walk = np.concatenate([np.zeros((4000, 1)), np.cumsum(steps, axis=1)], axis=1)
    short = walk[:, :-1].mean(axis=1) * dt + steps.sum(axis=1) * dt / (2 * fine) - dt * walk[:, -1] / 2.0
    # white noise of variance v has, held over a step, an integral of variance v dt^2
    assert np.var(short) / dt**2 == pytest.approx(between_samples_variance(rate, dt), rel=0.1)


def test_the_air_of_a_span_at_an_airspeed() -> None:
    model = PITCH_MODEL._replace(roll_smoothing_m=3.0, turn_smoothing_m=4.0)
    found = air_of(model, SPEED, 0.02)
    np.testing.assert_allclose(found, [-1.0 / SPEED, 4.0 / SPEED, 3.0 / SPEED, 1.0], rtol=1e-15)
    assert air_of(model._replace(longitudinal=False), SPEED, 0.02).turn == 1.0 / SPEED
    assert air_of(PITCH_MODEL, SPEED, 0.02).turn == 0.0


@pytest.mark.parametrize("ahead_m", [0.0, 0.1, 0.25, 0.4, 0.5])
def test_what_a_gust_does_between_samples_at_two_places(ahead_m: float) -> None:
    """Integrals of a Wiener process over a step less their lines' at two phases, summed over many steps: 0.5 m are a
    whole step at 25 m/s."""
    rng, dt, fine, steps = np.random.default_rng(7), 0.02, 40, 20_000
    walk = np.concatenate([[0.0], np.cumsum(rng.standard_normal((steps + 2) * fine))])
    shift = round(ahead_m / SPEED / dt * fine)

    def lacking(first: int) -> Array:
        own = walk[first : first + steps * fine + 1]
        ends = own[::fine]
        inside = 0.5 * (own[:-1] + own[1:]).reshape(steps, fine).sum(axis=1)
        rest = inside - 0.5 * fine * (ends[:-1] + ends[1:])
        return np.asarray(rest.reshape(-1, 10).sum(axis=1))

    found = np.corrcoef(lacking(fine), lacking(fine - shift))[0, 1]
    model = PITCH_MODEL._replace(vane_ahead_m=ahead_m)
    assert found == pytest.approx(air_of(model, SPEED, dt).together, abs=0.12)
