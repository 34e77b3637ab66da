"""Noise, gusts and rolling air in the equations of a block: compiled sums beside whole matrices, variances found
again."""

from dataclasses import dataclass

import numpy as np
import pytest
from kernels import PITCH_MODEL
from numpy.typing import NDArray

from wingwatch.estimators.fourier.driven_motion import driven_motions, roll_shared_at_ends
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
from wingwatch.estimators.fourier.products import expected_products, noise_power
from wingwatch.estimators.fourier.rolling_air import rolling_gain, without_rolling
from wingwatch.estimators.fourier.state import AIR_VARIANCES, BETWEEN, GUST

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
    return Case(plant, Air(turn, 0.15, 0.12), noise, ns + (1 if kinematic else 0))


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
    air[1:ns, 2], air[ns, 2] = d[1:, 0], d[0, 0] - s
    if not c.plant.by_accelerometer:
        # the velocity's rate: force row and kinematic row together, the accelerometer gone
        together = sensors[0] + sensors[ns]
        together[0] = s - d[0, 0]
        sensors[0], air[0] = together, air[0] + air[ns]
        sensors[0, 1:ns] = -d[0, 1:ns] - u[1:]
    return sensors[: c.rows], air[: c.rows]


def weighed(c: Case) -> NoiseWorkspace:
    work = noise_workspace(c.states, 1, c.rows, OMEGA.size)
    weigh(OMEGA, c.plant, c.air, c.noise, POWER, work)
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
    """E[R' W r] written out: sensors' noise in both, the gust through (s - A)^-1, a gust between samples.

    Of the rolling air only what it did to the readings at the block's ends is left in the regressors; with the lag tau
    that goes with 2 c(1/tau) - c(s). What moment equations leave out drives the states as well: no part of the
    correction, for its loop is not known, but noise power of the regressors.
    """
    c = CASES[name]
    ns, nd, work = c.states, c.states + 1, weighed(c)
    n_noise, g, driven = np.empty((ns * nd, ns * nd)), np.empty(ns * nd), np.empty(ns * nd)
    noise_power(OMEGA, c.plant, c.air, c.noise, POWER, work, n_noise)
    roll_shared_at_ends(c.plant, c.air, work)
    expected_products(OMEGA, c.plant, c.noise, POWER, SPAN, work, g, driven)
    sensors, own = variances(c)
    want_g, want_driven = np.zeros((ns, nd)), np.zeros((ns, nd))
    a = c.plant.derivatives[:, :ns].copy()
    a[0] += c.plant.forward_speed
    for f, omega in enumerate(OMEGA):
        left, by_air = transfer_of(c, omega)
        w = work.weights[:, :, 0, f] + 1j * work.weights[:, :, 1, f]
        regressors = np.zeros((nd, ns + 2), complex)
        regressors[:ns, :ns], regressors[ns, ns + 1] = np.eye(ns), 1.0
        products = left @ np.diag(sensors) @ regressors.conj().T
        answer = np.linalg.inv(1j * omega * np.eye(ns) - a)
        drive = by_air[:ns].copy()
        drive[0] += by_air[ns]
        by_gust, by_roll = (answer @ drive[:, e] for e in range(2))
        begun = np.linalg.inv(np.eye(ns) / c.air.roll_s - a) @ -c.plant.roll_column
        moved = by_gust - answer @ by_gust / SPAN, answer @ (begun - by_roll) / SPAN
        for e in range(2):
            products[:, :ns] += c.noise[GUST + e] * np.outer(by_air[:, e], moved[e].conj())
        products[:, 0] -= c.noise[BETWEEN] * by_air[:, 2]
        want_g += POWER * (w @ products).real[:ns]
        moments = np.zeros((c.rows, ns), complex)
        moments[:ns] = np.diag(own[:ns]) @ answer.conj().T
        want_driven[:, :ns] += POWER * (w @ moments).real[:ns]
    np.testing.assert_allclose(g, want_g.ravel(), rtol=1e-7, atol=1e-8 * np.abs(want_g).max())
    np.testing.assert_allclose(driven, want_driven.ravel(), rtol=1e-7, atol=1e-8 * np.abs(want_driven).max())
    np.testing.assert_allclose(n_noise, n_noise.T, rtol=1e-12)
    assert (np.diag(n_noise) > 0.0).all()


def test_what_is_left_of_the_regressors_goes_with_no_rolling_air() -> None:
    """Residuals drawn as the model has them, and the motion that their rolling air causes: on average the score has
    none of it left, and had much."""
    c, draws, rng = CASES["lateral"], 400, np.random.default_rng(8)
    work, (sensors, own) = weighed(c), variances(c)
    rolling_gain(c.noise, POWER, work)
    residual, regressors = (np.zeros((draws, k, 2, OMEGA.size)) for k in (c.rows, c.states + 1))
    for f, omega in enumerate(OMEGA):
        left, by_air = transfer_of(c, omega)
        air = drawn(rng, draws, c.noise[GUST:])
        r = drawn(rng, draws, sensors) @ left.T + air @ by_air.T + drawn(rng, draws, own)
        x = np.outer(air[:, 1], work.answers[f, :, c.states + 1])
        residual[:, :, 0, f], residual[:, :, 1, f] = r.real, r.imag
        regressors[:, : c.states, 0, f], regressors[:, : c.states, 1, f] = x.real, x.imag
    quiet = np.empty_like(regressors)
    for i in range(draws):
        without_rolling(residual[i], regressors[i], work, quiet[i])
    before, after = scores(regressors, work, residual), scores(quiet, work, residual)
    error = after.std(axis=0) / np.sqrt(draws)
    seen = error > 0.0
    assert (np.abs(after.mean(axis=0))[seen] < 4.5 * error[seen]).all()
    assert (np.abs(before.mean(axis=0))[seen] > 10.0 * error[seen]).any()


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
    found = air_of(model, SPEED)
    np.testing.assert_allclose(found, [-1.0 / SPEED, 4.0 / SPEED, 3.0 / SPEED], rtol=1e-15)
    assert air_of(model._replace(longitudinal=False), SPEED).turn == 1.0 / SPEED
    assert air_of(PITCH_MODEL, SPEED).turn == 0.0
