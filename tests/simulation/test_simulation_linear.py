"""The linear plant: exact, and a flight table that is consistent with the rigid body's kinematics."""

import math
from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from wingwatch.aircraft import DUTCH_ROLL, LATERAL, SHORT_PERIOD, FlightCondition, ModeStructure, state_matrix
from wingwatch.simulation import linear_flight, linear_response, specific_force, state_rates

# the thesis's linearised Aerosonde (tables 7.2 and 7.7)
PITCH = dict(zip(SHORT_PERIOD.derivatives, (-4.139, 24.33, -2.361, -4.289, -6.035, -32.54), strict=True))
YAW = dict(zip(DUTCH_ROLL.derivatives, (-0.643, -25.02, 3.517, 0.684, -1.043, -22.10), strict=True))
CASES = [(SHORT_PERIOD, PITCH), (DUTCH_ROLL, YAW)]
IDS = ["short_period", "dutch_roll"]
LEVEL = FlightCondition(25.0, 1000.0, angle_of_attack_rad=0.05)
GRAVITY = 9.80665


def doublet(n: int = 300, width: int = 10) -> NDArray[np.float64]:
    u = np.zeros(n)
    u[50 : 50 + width], u[50 + width : 50 + 2 * width] = math.radians(2.0), -math.radians(2.0)
    return u


@pytest.mark.parametrize(("structure", "derivatives"), CASES, ids=IDS)
def test_states_are_those_of_the_differential_equation(
    structure: ModeStructure, derivatives: Mapping[str, float]
) -> None:
    u, dt = doublet(120), 0.02
    states = linear_response(structure, derivatives, u, dt, initial=(0.3, -0.02))
    a = state_matrix(structure, derivatives)
    b = np.array([derivatives[f"{row}_{structure.inputs[0]}"] for row in structure.equations])

    def rate(_: float, y: NDArray[np.float64], deflection: float) -> NDArray[np.float64]:
        return np.asarray(a @ y + b * deflection)

    x = np.array([0.3, -0.02])
    for k in range(len(u) - 1):
        np.testing.assert_allclose(states[k], x, rtol=0.0, atol=1e-8)
        step = solve_ivp(rate, (0.0, dt), x, rtol=1e-11, atol=1e-12, args=(u[k],))
        x = step.y[:, -1]


def test_rates_are_a_x_plus_b_u() -> None:
    rates = state_rates(SHORT_PERIOD, PITCH, [[1.0, 0.1]], [0.02])
    assert rates[0] == pytest.approx([-4.139 + 2.433 - 0.04722, -4.289 - 0.6035 - 0.6508])


def test_the_accelerometer_reads_aerodynamics_alone() -> None:
    rates = np.array([[0.0, 0.0]])
    assert specific_force(SHORT_PERIOD, rates, [0.0], LEVEL, 0.05)[0] == pytest.approx(
        -GRAVITY * math.cos(0.05)
    )
    u = LEVEL.forward_velocity_m_s
    assert specific_force(SHORT_PERIOD, rates, [0.1], LEVEL, 0.0)[0] == pytest.approx(-0.1 * u - GRAVITY)
    assert specific_force(DUTCH_ROLL, rates, [0.1], LEVEL, 0.0)[0] == pytest.approx(0.1 * u)


def test_a_pitching_flight_obeys_kinematics_and_derivatives() -> None:
    u = doublet()
    offsets = {"w": 1.3, "q": 0.05, "eta": -0.03}
    block = linear_flight(SHORT_PERIOD, PITCH, LEVEL, u, offsets=offsets)
    speed, alpha, q = (
        block.column(c) for c in ("airspeed_true_m_s", "angle_of_attack_rad", "pitch_rate_rad_s")
    )
    w = speed * np.sin(alpha)
    states = linear_response(SHORT_PERIOD, PITCH, u, 0.02)
    np.testing.assert_allclose(w, LEVEL.normal_velocity_m_s + 1.3 + states[:, 0], atol=1e-12)
    np.testing.assert_allclose(q, 0.05 + states[:, 1], atol=1e-15)
    np.testing.assert_allclose(block.column("elevator_rad"), u - 0.03, atol=1e-15)
    kinematic = speed * np.cos(alpha) * q + GRAVITY * np.cos(block.column("pitch_rad"))
    rate = state_rates(SHORT_PERIOD, PITCH, states, u)[:, 0]
    np.testing.assert_allclose(block.column("specific_force_z_m_s2") + kinematic, rate, atol=1e-11)


def test_a_yawing_flight_obeys_kinematics_and_derivatives() -> None:
    u = doublet(width=19)
    block = linear_flight(DUTCH_ROLL, YAW, LEVEL, u, offsets={"v": 0.4, "zeta": 0.01})
    speed, alpha, r = (
        block.column(c) for c in ("airspeed_true_m_s", "angle_of_attack_rad", "yaw_rate_rad_s")
    )
    states = linear_response(DUTCH_ROLL, YAW, u, 0.02)
    np.testing.assert_allclose(speed * np.sin(block.column("sideslip_rad")), 0.4 + states[:, 0], atol=1e-12)
    np.testing.assert_array_equal(block.column("roll_rate_rad_s"), 0.0)
    rate = state_rates(DUTCH_ROLL, YAW, states, u)[:, 0]
    kinematic = -speed * np.cos(alpha) * r + GRAVITY * np.sin(block.column("roll_rad"))
    np.testing.assert_allclose(block.column("specific_force_y_m_s2") + kinematic, rate, atol=1e-11)


@pytest.mark.parametrize(("structure", "derivatives"), CASES, ids=IDS)
def test_the_table_has_what_estimators_read(
    structure: ModeStructure, derivatives: Mapping[str, float]
) -> None:
    block = linear_flight(structure, derivatives, LEVEL, doublet(), rate_hz=25.0)
    np.testing.assert_array_equal(block.time_s, np.arange(300) / 25.0)
    wanted = {
        "airspeed_true_m_s", "roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s", "specific_force_x_m_s2",
        "specific_force_y_m_s2", "specific_force_z_m_s2", "roll_rad", "pitch_rad", "heading_rad", "elevator_rad",
        "aileron_rad", "rudder_rad", "angle_of_attack_rad", "sideslip_rad", "altitude_m", "air_density_kg_m3",
    }  # fmt: skip
    assert wanted <= set(block.present)
    assert np.isfinite(block.values[:, :]).any(axis=0).sum() == len(block.present)


def test_noise_is_as_asked_and_by_the_generator() -> None:
    n = 20_000
    std = {"pitch_rate_rad_s": 0.02, "angle_of_attack_rad": 0.004}
    clean = linear_flight(SHORT_PERIOD, PITCH, LEVEL, np.zeros(n))
    noisy = linear_flight(
        SHORT_PERIOD, PITCH, LEVEL, np.zeros(n), noise_std=std, rng=np.random.default_rng(1)
    )
    again = linear_flight(
        SHORT_PERIOD, PITCH, LEVEL, np.zeros(n), noise_std=std, rng=np.random.default_rng(1)
    )
    np.testing.assert_array_equal(noisy.values, again.values)
    for name in clean.present:
        error = noisy.column(name) - clean.column(name)
        # 4.5 standard deviations of a standard deviation over n samples
        assert np.std(error) == pytest.approx(std.get(name, 0.0), rel=4.5 / math.sqrt(2 * n), abs=1e-15), name


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (
            lambda: linear_flight(LATERAL, YAW, LEVEL, doublet()),
            "lateral is not defined; give short_period or dutch_roll",
        ),
        (lambda: linear_flight(DUTCH_ROLL, YAW, LEVEL, np.zeros((5, 2))), "inputs of dutch_roll have shape"),
        (lambda: linear_flight(DUTCH_ROLL, YAW, LEVEL, doublet(), offsets={"q": 1.0}), "offset of 'q'"),
        (lambda: linear_flight(DUTCH_ROLL, YAW, LEVEL, 100.0 * doublet()), "give a smaller input"),
        (lambda: linear_flight(DUTCH_ROLL, YAW, LEVEL, doublet(), noise_std={"roll_rad": 0.1}), "no rng"),
        (
            lambda: linear_flight(DUTCH_ROLL, YAW, LEVEL, doublet(), noise_std={"roll": 0.1}),
            "'roll', which is no column",
        ),
    ],
)
def test_bad_input_is_named(build: object, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        build()  # type: ignore[operator]
