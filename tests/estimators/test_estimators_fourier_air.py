"""The turning of the air: measured through the lag over the span, and believed as far as it is not noise."""

import numpy as np
import pytest
from kernels import as_complex, transforms_of

from wingwatch.estimators import SignalLayout
from wingwatch.estimators.fourier_air import (
    AIR_COLUMNS,
    AIR_LEVELS,
    advance_air,
    air_channels,
    air_of,
    heard_turning,
    rebase_products,
    turning_channel,
    turning_level,
)
from wingwatch.estimators.fourier_air_equations import air_products, air_weights
from wingwatch.estimators.fourier_bank import advance_bank, bank_channels
from wingwatch.estimators.fourier_blocks import _gather_noise

LAYOUT = SignalLayout(2, 1)
OMEGA = 2.0 * np.pi * np.arange(1, 41) / 10.0
SPEED, GUST_M = 25.0, np.array([3.0, 4.0])
LEVER = np.zeros(2)
EXPONENTS = np.array([1.0, 1.0, 2.0])


def flown_bank(rows: np.ndarray, longitudinal: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Turning at every sample, and the bank after the last."""
    bank = np.zeros((bank_channels(2, 1) + air_channels(2, 1), 2, OMEGA.size))
    step, coefficients, turning = np.full(1, -1.0), np.zeros((8, OMEGA.size)), np.zeros(1)
    before, seen = np.full(LAYOUT.columns, np.nan), [0.0]
    for k in range(1, len(rows)):
        old, new = rows[k - 1], rows[k]
        advance_bank(OMEGA, bank, step, coefficients, old, new, before, np.array([np.inf]), 2, 1, 3)
        advance_air(bank, coefficients, turning, rows[0], old, new, EXPONENTS, GUST_M, LEVER, longitudinal)
        before = old
        seen.append(turning[0])
    return np.array(seen), bank


def flown(rows: np.ndarray, longitudinal: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Turning at every sample, and the transforms of the whole block, complex (frequencies, channels)."""
    seen, bank = flown_bank(rows, longitudinal)
    return seen, as_complex(transforms_of(OMEGA, bank, rows[-1, 0] - rows[0, 0], 2, 1)[0])


def still(seconds: float = 10.0) -> np.ndarray:
    rows = np.zeros((round(50 * seconds) + 1, LAYOUT.columns))
    rows[:, 0] = np.arange(len(rows)) / 50.0
    kinematic = LAYOUT.kinematic
    rows[:, kinematic + 1], rows[:, kinematic + 2], rows[:, kinematic + 3] = 1.0, SPEED, 1.225
    rows[:, kinematic + 6] = 1.0
    return rows


def air_at(longitudinal: bool, gust_m: np.ndarray = GUST_M) -> np.ndarray:
    air = np.empty(3)
    air_of(gust_m, SPEED, longitudinal, air)
    return air


@pytest.mark.parametrize("longitudinal", [True, False])
def test_a_gust_that_grows_evenly_turns_the_air_by_its_gradient_once_the_span_is_in_it(
    longitudinal: bool,
) -> None:
    """The vane sees w change by 1 m/s2, the accelerometer nothing: w_g' = -1 m/s2, q_g = 1/V; v likewise, -1/V."""
    rows = still()
    rows[:, 1] = rows[:, 0]
    seen, _ = flown(rows, longitudinal)
    lag = 1.0 - np.exp(-rows[:, 0] * SPEED / GUST_M[1])
    np.testing.assert_allclose(seen, (-1.0 if longitudinal else 1.0) / SPEED * lag, rtol=0.0, atol=1e-12)


def test_motion_that_the_accelerometer_explains_is_no_gust() -> None:
    rows = still()
    rows[:, 1], rows[:, 3], rows[:, LAYOUT.kinematic] = rows[:, 0], 0.7, 0.3
    seen, _ = flown(rows)
    assert np.abs(seen).max() < 1e-12


def test_a_vane_that_is_silent_tells_nothing() -> None:
    rows = still()
    rows[:, 1], rows[:, LAYOUT.kinematic + 6] = rows[:, 0], 0.0
    assert np.abs(flown(rows)[0]).max() == 0.0


def test_products_are_nothing_in_steady_flight_and_the_growth_of_what_acts_else() -> None:
    rows = still()
    rows[:, 1:3] = np.random.default_rng(1).standard_normal((len(rows), 2))
    first = turning_channel(2, 1) + 1
    _, steady = flown(rows)
    assert (steady[:, first:] == 0.0).all()
    rows[:, LAYOUT.kinematic + 2] = SPEED * 1.1
    rows[0, LAYOUT.kinematic + 2] = SPEED
    rows[0, 1:3] = 0.0
    _, faster = flown(rows)
    np.testing.assert_allclose(faster[:, first], 0.1 * faster[:, 0], rtol=1e-9, atol=1e-12)


def test_the_level_of_white_gusts_is_found_beside_the_noise_and_believed_by_its_share() -> None:
    rng, level, vane = np.random.default_rng(2), 30.0, 0.0075
    found = []
    noise = np.array([vane, 1e-10, 1e-8, 1.0, 1.0, 0.0, level, 1e-4, 1.0])
    air = air_at(True)
    for _ in range(20):
        rows = still()
        gust = np.cumsum(np.sqrt(level) * 0.02 * rng.standard_normal(len(rows)))
        rows[:, 1] = gust + np.sqrt(vane) * rng.standard_normal(len(rows))
        _, bank = flown_bank(rows)
        transforms, _ = transforms_of(OMEGA, bank, 10.0, 2, 1)
        noise[-AIR_LEVELS] = 1.0
        found.append(turning_level(OMEGA, transforms, noise, 10.0 * 0.02, air, np.zeros(2), LEVER, 2, 1))
    # 40 bins: 1 / sqrt(40) a record, 20 records; four of that
    assert np.mean(found) == pytest.approx(level, rel=4.0 / np.sqrt(800))
    heard = np.zeros(3, dtype=np.complex128)
    believed, _ = heard_turning(10.0, noise, level, air, np.zeros(2), LEVER, 2, heard)
    assert believed == pytest.approx(level / (level + 100.0 * vane), rel=1e-6)
    assert heard_turning(10.0, noise, 0.0, air, np.zeros(2), LEVER, 2, heard)[0] == 0.0
    np.testing.assert_array_equal(heard, [0.0, 1.0, 0.0])


def test_air_that_is_not_known_to_turn_has_no_motion() -> None:
    np.testing.assert_array_equal(air_at(True, np.zeros(2)), np.zeros(3))
    np.testing.assert_allclose(air_at(True), [-1.0 / SPEED, 4.0 / SPEED, 3.0 / SPEED], rtol=1e-15)
    assert air_at(False)[0] == 1.0 / SPEED


def test_calm_blocks_teach_nothing_of_the_air_and_do_not_weigh_when_it_becomes_rough() -> None:
    noise, known = np.full(6 + AIR_LEVELS, 0.1), np.zeros(8 + AIR_LEVELS)
    for _ in range(5):
        _gather_noise(noise, known, np.full(noise.size, 0.2), 1.0, 0.8, False, 2)
    np.testing.assert_allclose(noise, [0.2] * 5 + [0.1] * (1 + AIR_LEVELS), rtol=1e-12)
    _gather_noise(noise, known, np.full(noise.size, 7.0), 1.0, 0.8, True, 2)
    np.testing.assert_allclose(noise[-AIR_LEVELS:], 7.0, rtol=1e-12)
    assert noise[0] < 3.0


def test_products_counted_from_a_mark_are_those_of_a_block_that_begins_there() -> None:
    rows = still()
    rows[:, 1:5] = np.random.default_rng(4).standard_normal((len(rows), 4))
    rows[:, LAYOUT.kinematic + 2] = SPEED * (1.0 + 0.1 * np.sin(rows[:, 0]))
    at = 230
    _, whole = flown_bank(rows)
    _, before = flown_bank(rows[: at + 1])
    turn = np.exp(1j * OMEGA * (rows[-1, 0] - rows[at, 0]))
    part = (whole[:, 0] + 1j * whole[:, 1]) - turn * (before[:, 0] + 1j * before[:, 1])
    bank = np.ascontiguousarray(np.stack([part.real, part.imag], axis=1))
    rebase_products(bank, rows[0], rows[at], EXPONENTS, 2)
    _, alone = flown_bank(rows[at:])
    # After the products' first: the turning has a memory of what was before the mark.
    first = bank_channels(2, 1) + 1
    np.testing.assert_allclose(bank[first:], alone[first:], rtol=0.0, atol=1e-10)
    assert np.abs(part[first:].real - alone[first:, 0]).max() > 1e-3


def dense(ns: int, longitudinal: bool) -> tuple[np.ndarray, ...]:
    """Derivatives, scales, noise and forward speeds of some aircraft with ns states and one input."""
    rng = np.random.default_rng(ns)
    theta = rng.standard_normal(ns * (ns + 1)) - 4.0 * np.eye(ns, ns + 1).ravel()
    noise = rng.uniform(0.5, 2.0, 2 * ns + 2 + AIR_LEVELS) * 1e-2
    noise[-AIR_LEVELS] = 20.0
    noise[2 * ns + 1] = 1e-4
    forward = np.zeros(ns)
    forward[ns - 1] = SPEED if longitudinal else -SPEED
    return theta, rng.uniform(0.5, 2.0, ns * (ns + 1)), noise, forward


def hearing(
    s: complex, turned: complex, forward: np.ndarray, lever: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How regressors (states, input) and left sides hear the noise of states, accelerometer and one input."""
    ns = forward.size
    heard = np.zeros((ns + 1, ns + 2), dtype=complex)
    heard[:ns, :ns], heard[ns, ns + 1] = np.eye(ns), 1.0
    heard[ns - 1, 0] += turned * s
    heard[ns - 1, ns] -= turned
    for j in range(1, ns):
        heard[ns - 1, j] -= turned * (forward[j] + lever[j] * s)
    left = np.zeros((ns, ns + 2), dtype=complex)
    for k in range(1, ns):
        left[k, k] = s
    left[0, ns] = 1.0
    left[0, 1:ns] += lever[1:] * s
    return heard, left


@pytest.mark.parametrize(("ns", "longitudinal"), [(2, True), (2, False), (3, False)])
def test_weights_and_what_noise_shares_with_the_regressors_are_those_of_whole_matrices(
    ns: int, longitudinal: bool
) -> None:
    """Section 7 written out with dense matrices, bin by bin, beside the compiled sums."""
    theta, scale, noise, forward = dense(ns, longitudinal)
    nd, nf, power = ns + 1, OMEGA.size, 0.2
    air, lever = air_at(longitudinal), np.zeros(ns)
    lever[-1] = 0.1
    slopes = (theta * scale).reshape(ns, nd)
    room = (
        np.empty((nf, ns, nd + 1 + AIR_COLUMNS), dtype=np.complex128),
        np.empty((nf, ns + 1), dtype=np.complex128),
        np.empty((nf, AIR_COLUMNS)),
        np.empty((ns, 2 * ns + 1), dtype=np.complex128),
    )
    weights, moments = np.empty((ns, ns, 2, nf)), np.empty((3, ns, ns))
    air_weights(
        OMEGA, theta, scale, noise, power, forward, lever, air, True, ns, 1, room, np.empty((ns, nd + 1)), weights,
        moments,
    )  # fmt: skip
    n_noise, g, driven = np.empty((ns * nd, ns * nd)), np.empty(ns * nd), np.empty(ns * nd)
    air_products(
        OMEGA, theta, scale, noise, power, forward, air, ns, 1, room, weights, n_noise, g, driven
    )  # fmt: skip

    gust, rolling, beside = noise[-AIR_LEVELS:]
    sensors = np.concatenate([noise[: ns + 1], noise[2 * ns + 1 : 2 * ns + 2]])
    own = np.array([0.0 if k == 0 else noise[ns + 1 + k] for k in range(ns)])
    own[1] = 0.0 if longitudinal or ns == 3 else own[1]
    want_n, want_g, want_driven = np.zeros((ns * nd, ns * nd)), np.zeros(ns * nd), np.zeros(ns * nd)
    total = np.zeros((ns, ns))
    for f, omega in enumerate(OMEGA):
        s = 1j * omega
        deaf = omega**2 * noise[0] + noise[ns]
        deaf += sum((forward[j] ** 2 + (omega * lever[j]) ** 2) * noise[j] for j in range(1, ns))
        believed = gust / (gust + deaf)
        answer = air[0] / (1.0 + s * air[1])
        heard, left = hearing(s, believed * answer, forward, lever)
        transfer = left - slopes @ heard
        columns = np.zeros((ns, 2), dtype=complex)
        columns[:, 0] = -slopes[:, 1] / (1.0 + s * air[2]) if ns == 3 else 0.0
        columns[:, 1] = -slopes[:, ns - 1] * answer
        levels = np.array([rolling, gust * (1.0 - believed) + beside])
        sigma = transfer @ np.diag(sensors) @ transfer.conj().T + columns @ np.diag(levels) @ columns.conj().T
        own[0] = noise[ns + 1]
        sigma = power * (sigma + np.diag(own))
        w = np.linalg.inv(sigma)
        np.testing.assert_allclose(weights[:, :, 0, f] + 1j * weights[:, :, 1, f], w, rtol=1e-8)
        total += w.real
        products = power * heard.conj() @ np.diag(sensors) @ transfer.T
        want_g += (w @ products.T).real.ravel()
        twice = power * heard.conj() @ np.diag(sensors) @ heard.T
        want_n += np.einsum("km,cd->kcmd", w, twice).real.reshape(want_n.shape)
        rates = slopes[:, :ns].copy()
        rates[0] += forward
        states = np.linalg.inv(s * np.eye(ns) - rates)
        which = 1 if longitudinal else 0
        driving = states @ columns[:, which]
        want_g.reshape(ns, nd)[:, :ns] += (
            power * levels[which] * np.outer(w @ columns[:, which], driving.conj()).real
        )
        want_driven.reshape(ns, nd)[:, :ns] += power * (w @ np.diag(own) @ states.conj().T).real
    np.testing.assert_allclose(moments[0], total, rtol=1e-8)
    np.testing.assert_allclose(g, want_g, rtol=1e-7, atol=1e-9 * np.abs(want_g).max())
    np.testing.assert_allclose(driven, want_driven * scale, rtol=1e-7, atol=1e-9 * np.abs(want_driven).max())
    np.testing.assert_allclose(
        n_noise, want_n * np.outer(scale, scale), rtol=1e-7, atol=1e-9 * np.abs(want_n).max()
    )
