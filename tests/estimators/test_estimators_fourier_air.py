"""What the bank follows beside states and surfaces: products with the growth of what acts, what is known of rates."""

import numpy as np
from estimator_kernels import PITCH_MODEL, as_complex, new_filters, rows_before, transforms_of

from wingwatch.estimators import SignalLayout
from wingwatch.estimators.fourier.air import advance_air, air_channels, product_channel, rebase_products
from wingwatch.estimators.fourier.bank import advance_bank, bank_channels

LAYOUT = SignalLayout(2, 1)
OMEGA = 2.0 * np.pi * np.arange(1, 41) / 10.0
SPEED = 25.0
EXPONENTS = np.array([1.0, 1.0, 2.0])


def flown_bank(rows: np.ndarray) -> np.ndarray:
    """The bank after the last row."""
    bank = np.zeros((bank_channels(2, 1) + air_channels(2, 1), 2, OMEGA.size))
    filters = new_filters(OMEGA.size)
    for k in range(1, len(rows)):
        known = rows_before(rows, k)
        advance_bank(OMEGA, PITCH_MODEL.servos, np.zeros(1), filters, bank, known, rows[k], 2)
        advance_air(EXPONENTS, filters.coefficients, bank, known, rows[k], 2)
    return bank


def flown(rows: np.ndarray) -> np.ndarray:
    """The transforms of the whole block, complex (bins, channels)."""
    return as_complex(transforms_of(OMEGA, flown_bank(rows), rows[-1, 0] - rows[0, 0], 2, 1)[0])


def still(seconds: float = 10.0) -> np.ndarray:
    rows = np.zeros((round(50 * seconds) + 1, LAYOUT.columns))
    rows[:, 0] = np.arange(len(rows)) / 50.0
    kinematic = LAYOUT.kinematic
    rows[:, kinematic + 1], rows[:, kinematic + 2], rows[:, kinematic + 3] = 1.0, SPEED, 1.225
    rows[:, kinematic + 6] = 1.0
    return rows


def test_products_are_nothing_in_steady_flight_and_the_growth_of_what_acts_else() -> None:
    rows = still()
    rows[:, 1:3] = np.random.default_rng(1).standard_normal((len(rows), 2))
    first = product_channel(2, 1)
    steady = flown(rows)
    assert (steady[:, first : first + 3] == 0.0).all()
    rows[:, LAYOUT.kinematic + 2] = SPEED * 1.1
    rows[0, LAYOUT.kinematic + 2] = SPEED
    rows[0, 1:3] = 0.0
    faster = flown(rows)
    np.testing.assert_allclose(faster[:, first], 0.1 * faster[:, 0], rtol=1e-9, atol=1e-12)


def test_kinematic_term_and_known_moment_are_transformed_as_states_are() -> None:
    rows = still()
    rows[:, 1] = np.random.default_rng(2).standard_normal(len(rows))
    rows[:, LAYOUT.kinematic] = 3.0 * rows[:, 1]
    rows[:, LAYOUT.known_moments] = -0.5 * rows[:, 1]
    found = flown(rows)
    np.testing.assert_allclose(found[:, -2], 3.0 * found[:, 0], rtol=1e-12)
    np.testing.assert_allclose(found[:, -1], -0.5 * found[:, 0], rtol=1e-12)


def test_products_counted_from_a_checkpoint_are_those_of_a_block_that_begins_there() -> None:
    rows = still()
    rows[:, 1:5] = np.random.default_rng(4).standard_normal((len(rows), 4))
    rows[:, LAYOUT.kinematic + 2] = SPEED * (1.0 + 0.1 * np.sin(rows[:, 0]))
    at = 230
    whole = flown_bank(rows)
    before = flown_bank(rows[: at + 1])
    turn = np.exp(1j * OMEGA * (rows[-1, 0] - rows[at, 0]))
    part = (whole[:, 0] + 1j * whole[:, 1]) - turn * (before[:, 0] + 1j * before[:, 1])
    bank = np.ascontiguousarray(np.stack([part.real, part.imag], axis=1))
    rebase_products(bank, rows[0], rows[at], EXPONENTS, 2)
    alone = flown_bank(rows[at:])
    first = bank_channels(2, 1)
    np.testing.assert_allclose(bank[first:], alone[first:], rtol=0.0, atol=1e-10)
    assert np.abs(part[first:].real - alone[first:, 0]).max() > 1e-3
