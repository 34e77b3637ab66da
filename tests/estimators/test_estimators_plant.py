"""The linear model of a mode: its A, B, C beside independent ones, affine in the derivatives, its step and response."""

import numpy as np
import pytest
from numpy.typing import NDArray
from offline_flights import CASES
from scipy.linalg import expm

from wingwatch.aircraft import LATERAL, SHORT_PERIOD
from wingwatch.estimators.offline.output_error import response
from wingwatch.estimators.plant.discretisation import discretise, discretise_levels
from wingwatch.estimators.plant.motion import Air, Flown, Plant

Array = NDArray[np.float64]

THETA = np.array([[-4.1, -0.7, -2.4], [-4.3, -6.0, -32.5]])
LEVER = np.array([[0.0, 0.2], [0.0, 0.0]])
AT = Flown(np.array([[0.0, 25.0], [0.0, 0.0]]), 0.9, 25.0, 0.02)
AIR = Air(0.8 * THETA[:, :2], 0.5, np.array([1.0, 1.2]), 0.05, 4.0, 0.5, np.array([0.3]))


def plant(vane_ahead_m: float = 0.0) -> Plant:
    return Plant(SHORT_PERIOD, np.array([0]), LEVER, vane_ahead_m)


def test_in_still_air_the_accelerometer_reads_the_force_less_lever_times_rate() -> None:
    a, c, noise = plant().linear(THETA, None, AT)
    x, u = np.array([0.4, -0.1]), np.array([0.05])
    rates = AT.known @ x + 0.9 * THETA[:, :2] @ x + THETA[:, 2:] @ u
    np.testing.assert_allclose(a @ x + THETA[:, 2:] @ u, rates)
    read = 0.9 * THETA[0, :2] @ x + THETA[0, 2:] @ u - 0.2 * rates[1]
    direct = plant().direct(THETA)
    np.testing.assert_allclose(c @ x + direct[:, 2:3] @ u, [*x, read])
    assert not noise.any()


@pytest.mark.parametrize("air", [None, AIR], ids=["still", "moving"])
@pytest.mark.parametrize("vane_ahead_m", [0.0, 0.5])
def test_the_model_is_affine_in_the_derivatives(air: Air | None, vane_ahead_m: float) -> None:
    rng, made = np.random.default_rng(1), plant(vane_ahead_m)
    one, other = THETA, THETA + rng.standard_normal(THETA.shape)
    found = [made.linear(t, air, AT) for t in (one, other, 0.25 * one + 0.75 * other)]
    for first, second, between in zip(*found, strict=True):
        np.testing.assert_allclose(between, 0.25 * first + 0.75 * second, atol=1e-12)


def test_a_steady_gust_moves_the_aircraft_as_its_own_velocity_does() -> None:
    """In air that moves up steadily the vane reads the aircraft's velocity less the gust, and forces answer to that."""
    made = plant(0.5)
    a, c, _ = made.linear(THETA, AIR, AT)
    steady = np.zeros(len(a))
    steady[2:6] = 1.0  # states of the gust, span filter and the vane's lag, whose last state has died out
    rate = a @ steady
    np.testing.assert_allclose(rate[:2], -0.9 * THETA[:, 0])
    np.testing.assert_allclose(rate[3:7], 0.0, atol=1e-9)
    np.testing.assert_allclose(c[0] @ steady, -1.0)


def test_lateral_air_rolls_the_copy_alone() -> None:
    derivatives = np.arange(15.0).reshape(3, 5) - 7.0
    made = Plant(LATERAL, np.array([0]), np.zeros((3, 3)), rolling_s=0.2)
    air = Air(derivatives[:, :3] - 1.0, 0.5, np.ones(3), 0.05, 4.0, 0.5, np.array([0.3, 0.2, 0.1]))
    at = Flown(np.zeros((3, 3)), 1.0, 25.0, 0.02)
    a, c, noise = made.linear(derivatives, air, at)
    n, roll = len(a), len(a) - 4
    assert n == made.size(True, 25.0, 0.02) == 12
    np.testing.assert_allclose(a[-3:, roll], -air.copy[:, 1])
    assert not a[:3, roll].any()
    assert c[3, roll] == pytest.approx(-air.copy[0, 1])
    assert noise[roll, roll] == pytest.approx(2.0 * 0.1**2 / 0.2)


def test_levels_are_discretised_as_one_is() -> None:
    a = np.array([plant().linear(THETA, AIR, AT._replace(stability=s)).a for s in (0.9, 1.0)])
    b = np.column_stack([THETA, np.eye(2)])
    w = plant().linear(THETA, AIR, AT).noise
    f, early, late, q = discretise_levels(a, b, w, 0.02)
    into = np.zeros((len(a[0]), 5))
    into[:2] = b
    for k in range(2):
        one = discretise(a[k], into, w, 0.02)
        for got, wanted in zip((f[k], early[k], late[k], q[k]), one, strict=True):
            np.testing.assert_array_equal(got, wanted[: len(got)])


@pytest.mark.parametrize("mode", CASES)
def test_the_response_is_the_flight_where_the_derivatives_are_its_own(mode: str) -> None:
    """Whatever trims the readings have; the flight is stepped by the matrix exponential."""
    case = CASES[mode]
    (part,) = case.parts(case.clean(offsets=(1.3, 0.05, 0.05)))
    truth = case.plant.aerodynamic
    found = response(part, truth)
    assert list(found) == [*part.config.structure.states, f"a_{part.config.structure.equations[0]}"]
    for measured, model in found.values():
        assert np.abs(measured - model).max() < 1e-7 * np.ptp(measured)
    wrong = response(part, 0.7 * truth)
    assert all(np.abs(m - y).max() > 0.01 * np.ptp(m) for m, y in wrong.values())
    unknown = response(part, np.where(np.arange(truth.size) == 0, np.nan, truth))
    assert all(np.isnan(y).all() for _, y in unknown.values())


def test_a_line_of_commands_held_is_stepped_by_the_exponential() -> None:
    """The plants of these tests themselves: A of a made flight beside A of the model."""
    case = CASES["short_period"]
    (part,) = case.parts(case.clean())
    theta = case.plant.aerodynamic.reshape(2, 3)
    model = Plant(part.config.structure, np.array([], dtype=np.int64), part.config.lever_m)
    a = model.linear(theta, None, Flown(part.known[0], 1.0, 25.0, part.dt)).a
    step = expm(np.block([[a, theta[:, 2:]], [np.zeros((1, 3))]]) * part.dt)
    moving = step[:2, :2] @ part.states[:-1].T + step[:2, 2:] @ part.inputs[:-1].T
    np.testing.assert_allclose(part.states[1:].T - part.states[:1].T, moving - part.states[:1].T, atol=1e-9)
