"""The promise is kept: against a Fisher information made another way, and by fits to noisy records."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.signal import cont2discrete
from scipy.stats import chi2

from wingwatch.aircraft import (
    DUTCH_ROLL,
    GRAVITY_M_S2,
    LATERAL,
    PHUGOID,
    ROLL,
    SHORT_PERIOD,
    SPIRAL,
    Aircraft,
    AircraftDataError,
    FlightCondition,
    ModeStructure,
    analysis_band_hz,
    linearised_derivatives,
    load_aircraft,
    trim,
    trimmed,
)
from wingwatch.input_design import (
    INPUT_KINDS,
    InputDesign,
    SensedPlant,
    design_input,
    input_notes,
    promise,
    sensed_plant,
    surface_targets,
)
from wingwatch.simulation import linear_response, specific_force, state_rates

Array: TypeAlias = NDArray[np.float64]

RATE_HZ = 50.0
LEVEL = FlightCondition(25.0, 1000.0)
AEROSONDE = load_aircraft("aerosonde")
MODES = (SHORT_PERIOD, DUTCH_ROLL, LATERAL)


def off_centre(aircraft: Aircraft) -> Aircraft:
    """Accelerometer and vanes away from the centre of gravity."""
    sensors = aircraft.sensors.model_copy(
        update={"imu_position_m": (0.2, 0.0, -0.1), "vane_position_m": (0.6, 0.1, 0.05)}
    )
    return aircraft.model_copy(update={"sensors": sensors})


def made(
    structure: ModeStructure,
    kind: str,
    seconds: float = 10.0,
    aircraft: Aircraft = AEROSONDE,
    degrees: float = 2.0,
) -> tuple[SensedPlant, InputDesign]:
    """A mode with its sensors, and an input for it."""
    derivatives = linearised_derivatives(aircraft, LEVEL, structure)
    targets = surface_targets(
        structure, derivatives, analysis_band_hz(aircraft, structure), math.radians(degrees)
    )
    plant = sensed_plant(aircraft, structure, trimmed(aircraft, LEVEL), derivatives)
    return plant, design_input(kind, targets, seconds, RATE_HZ)


def measured(plant: SensedPlant, u: Array) -> Callable[[Array], Array]:
    """Sensor readings (samples x sensors,) of parameters: derivatives, trim constants, accelerometer's bias, start.

    Written from the equations of motion, apart from the code under test.
    """
    s, at = plant.structure, plant.condition
    speed, down = at.forward_velocity_m_s, at.normal_velocity_m_s
    ns, nu = len(s.states), len(s.inputs)
    lateral4 = s == LATERAL
    order = ns + (1 if lateral4 else 0)
    (xi, _, zi), (xv, _, zv) = plant.imu_position_m, plant.vane_position_m

    def readings(parameters: Array) -> Array:
        k = ns * (ns + nu)
        table = parameters[:k].reshape(ns, ns + nu)
        constant, bias, start = parameters[k : k + order], parameters[k + order], parameters[k + order + 1 :]
        a, b = np.zeros((order, order)), np.zeros((order, nu + order))
        a[:ns, :ns], b[:ns, :nu], b[:, nu:] = table[:, :ns], table[:, ns:], np.eye(order)
        if lateral4:
            a[0, 3] = GRAVITY_M_S2 * math.cos(at.angle_of_attack_rad)
            a[3] = [0.0, 1.0, math.tan(at.angle_of_attack_rad), 0.0]
        f, g, *_ = cont2discrete((a, b, np.eye(order), np.zeros((order, nu + order))), 1.0 / RATE_HZ)
        both = np.hstack([u, np.tile(constant, (len(u), 1))])
        x = np.empty((len(u), order))
        x[0] = start
        for i in range(1, len(u)):
            x[i] = f @ x[i - 1] + g @ both[i - 1]
        rates = x @ a.T + u @ b[:, :nu].T
        if s == SHORT_PERIOD:
            force = rates[:, 0] - speed * x[:, 1] - xi * rates[:, 1]
            return np.column_stack([x[:, 0] - xv * x[:, 1], x[:, 1], force + bias]).ravel()
        if s == DUTCH_ROLL:
            force = rates[:, 0] + speed * x[:, 1] + xi * rates[:, 1]
            return np.column_stack([x[:, 0] + xv * x[:, 1], x[:, 1], force + bias]).ravel()
        gravity = a[0, 3] * x[:, 3]
        force = rates[:, 0] + speed * x[:, 2] - down * x[:, 1] - gravity + xi * rates[:, 2] - zi * rates[:, 1]
        vane = x[:, 0] + xv * x[:, 2] - zv * x[:, 1]
        return np.column_stack([vane, x[:, 1], x[:, 2], force + bias, x[:, 3]]).ravel()

    return readings


def true_parameters(plant: SensedPlant) -> Array:
    return np.concatenate([plant.derivatives, np.zeros(2 * plant.order + 1)])


def slopes(function: Callable[[Array], Array], centre: Array) -> Array:
    columns = []
    for j, value in enumerate(centre):
        step = np.zeros(centre.size)
        step[j] = 1e-5 * max(abs(value), 1.0)
        columns.append((function(centre + step) - function(centre - step)) / (2.0 * step[j]))
    return np.column_stack(columns)


def noise_root(plant: SensedPlant, u: Array) -> Array:
    """Lower root of the whole record's covariance: sensors, and what the noise of the surfaces' readings does."""
    parameters = true_parameters(plant)
    rest = measured(plant, np.zeros_like(u))(parameters)
    sensors = np.tile(plant.noise_std, len(u))
    covariance = np.diag(sensors**2)
    for j, std in enumerate(plant.input_noise_std):
        kick = np.zeros_like(u)
        kick[0, j] = std
        answer = (measured(plant, kick)(parameters) - rest).reshape(len(u), -1)
        effects = np.zeros((len(u), answer.shape[1], len(u)))
        for i in range(len(u)):
            effects[i:, :, i] = answer[: len(u) - i]
        flat = effects.reshape(covariance.shape[0], -1)
        covariance += flat @ flat.T
    return np.asarray(np.linalg.cholesky(covariance))


@pytest.mark.parametrize("structure", MODES, ids=lambda s: s.name)
@pytest.mark.parametrize("kind", ["doublet", "multisine"])
def test_the_bound_is_that_of_a_dense_fisher_information(structure: ModeStructure, kind: str) -> None:
    plant, design = made(structure, kind, 4.0, off_centre(AEROSONDE))
    u = design.inputs_rad
    white = solve_triangular(
        noise_root(plant, u), slopes(measured(plant, u), true_parameters(plant)), lower=True
    )
    size = np.linalg.norm(white, axis=0)
    wanted = np.linalg.inv((white / size).T @ (white / size)) / np.outer(size, size)
    k = plant.derivatives.size
    predicted = promise(plant, u, RATE_HZ)
    # central differences: step^2 / 6 of the curvature, 1e-10, and rounding 1e-16 / 1e-5, times the condition number
    np.testing.assert_allclose(predicted.standard_error, np.sqrt(np.diagonal(wanted)[:k]), rtol=1e-5)
    errors = np.sqrt(np.diagonal(wanted)[:k])
    np.testing.assert_allclose(
        predicted.covariance, wanted[:k, :k], atol=1e-5 * float(np.outer(errors, errors).max())
    )


@pytest.mark.parametrize("kind", ["doublet", "multisine"])
def test_fits_to_noisy_records_scatter_as_promised(kind: str) -> None:
    """Generalised least squares on 400 records of the plant with noise of every sensor and of the surface's reading."""
    plant, design = made(SHORT_PERIOD, kind, 4.0)
    u, seeds = design.inputs_rad, 400
    # trim and bias left in the data: an equilibrium away from nought
    constants = np.array([0.3, 0.2])
    rest = -np.linalg.solve(plant.derivatives.reshape(2, 3)[:, :2], constants)
    truth = np.concatenate([plant.derivatives, constants, [0.1], rest])
    predicted = promise(plant, u, RATE_HZ).standard_error
    root = noise_root(plant, u)
    clean = measured(plant, u)(truth)
    jacobian = solve_triangular(root, slopes(measured(plant, u), truth), lower=True)
    size = np.linalg.norm(jacobian, axis=0)
    pseudo = np.linalg.pinv(jacobian / size) / size[:, np.newaxis]
    rng, errors = np.random.default_rng(0), []
    for _ in range(seeds):
        reading = u + plant.input_noise_std * rng.standard_normal(u.shape)
        noisy = clean + np.tile(plant.noise_std, len(u)) * rng.standard_normal(clean.size)
        model, guess = measured(plant, reading), truth.copy()
        for _ in range(2):  # the second step is a hundredth of the first
            guess += pseudo @ solve_triangular(root, noisy - model(guess), lower=True)
        errors.append(guess[:6] - plant.derivatives)
    ratio = np.sqrt(np.mean(np.square(errors), axis=0)) / predicted
    low, high = np.sqrt(chi2.ppf([1e-5, 1.0 - 1e-5], seeds) / seeds)
    assert (ratio > low).all(), ratio
    assert (ratio < high).all(), ratio


@pytest.mark.parametrize("structure", [SHORT_PERIOD, DUTCH_ROLL], ids=lambda s: s.name)
def test_the_response_is_the_simulated_plants(structure: ModeStructure) -> None:
    plant, design = made(structure, "3211")
    u = design.inputs_rad
    derivatives = dict(zip(structure.derivatives, map(float, plant.derivatives), strict=True))
    states = linear_response(structure, derivatives, u, 1.0 / RATE_HZ)
    at, got = plant.condition, promise(plant, u, RATE_HZ).response.quantities
    rates = state_rates(structure, derivatives, states, u)
    force = specific_force(structure, rates, states[:, 1], at, at.angle_of_attack_rad)
    if structure == SHORT_PERIOD:
        alpha = np.arctan2(at.normal_velocity_m_s + states[:, 0], at.forward_velocity_m_s)
        np.testing.assert_allclose(got["angle_of_attack_rad"], alpha, atol=1e-13)
        np.testing.assert_allclose(got["pitch_rate_rad_s"], states[:, 1], atol=1e-13)
        np.testing.assert_allclose(got["load_factor_z"], -force / GRAVITY_M_S2, atol=1e-12)
    else:
        np.testing.assert_allclose(got["sideslip_rad"], np.arctan2(states[:, 0], 25.0), atol=1e-13)
        np.testing.assert_allclose(got["yaw_rate_rad_s"], states[:, 1], atol=1e-13)
        np.testing.assert_allclose(got["load_factor_y"], force / GRAVITY_M_S2, atol=1e-12)


def test_bank_follows_the_roll_rate() -> None:
    plant, design = made(LATERAL, "doublet")
    got = promise(plant, design.inputs_rad, RATE_HZ).response.quantities
    along = got["roll_rate_rad_s"] + math.tan(plant.condition.angle_of_attack_rad) * got["yaw_rate_rad_s"]
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (along[1:] + along[:-1])) / RATE_HZ])
    # the trapezium's error over a step that begins with a kick l_xi xi of roll acceleration: dt^2 / 12 of its change
    kick = 115.0 * math.radians(4.0) / (12.0 * RATE_HZ**2)
    np.testing.assert_allclose(got["roll_rad"], summed, atol=10.0 * kick)


@pytest.mark.parametrize("structure", MODES, ids=lambda s: s.name)
@pytest.mark.parametrize("kind", INPUT_KINDS)
def test_errors_go_with_noise_and_against_amplitude(structure: ModeStructure, kind: str) -> None:
    plant, design = made(structure, kind)
    noisier = replace(plant, noise_std=2.0 * plant.noise_std, input_noise_std=2.0 * plant.input_noise_std)
    one = promise(plant, design.inputs_rad, RATE_HZ).standard_error
    assert np.isfinite(one).all()
    np.testing.assert_allclose(
        promise(plant, 2.0 * design.inputs_rad, RATE_HZ).standard_error, one / 2.0, rtol=1e-6
    )
    np.testing.assert_allclose(
        promise(noisier, design.inputs_rad, RATE_HZ).standard_error, 2.0 * one, rtol=1e-6
    )
    exact = replace(plant, input_noise_std=np.zeros_like(plant.input_noise_std))
    assert (promise(exact, design.inputs_rad, RATE_HZ).standard_error < one).all()
    longer = np.vstack([design.inputs_rad, design.inputs_rad])
    assert (promise(plant, longer, RATE_HZ).standard_error < one).all()


def test_the_same_input_twice_tells_at_least_twice_as_much() -> None:
    """The first response is over by then; the constants, which the halves share, are known better too."""
    plant, design = made(SHORT_PERIOD, "3211")
    one, two = (promise(plant, np.vstack([design.inputs_rad] * n), RATE_HZ).covariance for n in (1, 2))
    assert np.linalg.eigvalsh(0.5 * one - two).min() > -1e-9 * np.linalg.eigvalsh(one).max()
    assert (np.diagonal(two) < 0.5 * np.diagonal(one)).all()


def test_an_input_that_does_not_move_promises_nothing() -> None:
    plant, design = made(LATERAL, "doublet")
    assert np.isinf(promise(plant, np.zeros_like(design.inputs_rad), RATE_HZ).standard_error).all()
    with pytest.raises(ValueError, match=r"shape \(samples, 2\)"):
        promise(plant, design.inputs_rad[:, :1], RATE_HZ)


def test_noise_that_is_not_stated_is_asked_for() -> None:
    stated = {
        k: v for k, v in AEROSONDE.sensors.noise_std.items() if k not in ("sideslip_rad", "yaw_rate_rad_s")
    }
    silent = AEROSONDE.model_copy(
        update={"sensors": AEROSONDE.sensors.model_copy(update={"noise_std": stated})}
    )
    with pytest.raises(AircraftDataError, match="no noise of sideslip_rad, yaw_rate_rad_s"):
        made(DUTCH_ROLL, "doublet", aircraft=silent)


def test_the_vanes_noise_is_a_velocitys() -> None:
    plant, _ = made(SHORT_PERIOD, "doublet")
    at = plant.condition
    along, across = 0.0035 * at.forward_velocity_m_s, 0.2 * math.sin(at.angle_of_attack_rad)
    np.testing.assert_allclose(plant.noise_std, [math.hypot(along, across), 0.00227, 0.0245])
    assert plant.input_noise_std.tolist() == [0.00087]


def notes(structure: ModeStructure, kind: str, degrees: float) -> str:
    plant, design = made(structure, kind, degrees=degrees)
    predicted = promise(plant, design.inputs_rad, RATE_HZ)
    return "\n".join(input_notes(AEROSONDE, design, [predicted], trim(AEROSONDE, LEVEL).elevator_rad))


def test_notes_name_the_limits_that_are_passed() -> None:
    assert notes(SHORT_PERIOD, "weighted-multisine", 10.0) == ""
    weak = notes(SHORT_PERIOD, "doublet", 2.0)
    assert "signal-to-noise below 10: angle_of_attack_rad" in weak
    assert "degrees/s" not in weak
    assert "the elevator would go to" in notes(SHORT_PERIOD, "doublet", 22.0)
    assert "stops at 22.5" in notes(SHORT_PERIOD, "doublet", 22.0)
    assert "manages 201: give a smaller amplitude" in notes(SHORT_PERIOD, "multisine", 20.0)
    assert "takes 0.18 s from one step to the next, of 0.16 s" in notes(SHORT_PERIOD, "3211", 18.0)
    assert "beyond the stall at 26.9" in notes(SHORT_PERIOD, "3211", 60.0)
    assert "not distinguished from zero: l_zeta" in notes(LATERAL, "impulse", 2.0)


@pytest.mark.parametrize("structure", [PHUGOID, ROLL, SPIRAL], ids=lambda s: s.name)
def test_errors_of_reduced_modes_are_the_inverse_of_their_information(structure: ModeStructure) -> None:
    """Sensitivities by finite differences of records of states, written apart from the code under test."""
    quiet = AEROSONDE.sensors.model_copy(
        update={"noise_std": {k: v for k, v in AEROSONDE.sensors.noise_std.items() if "elevator" not in k
                              and "aileron" not in k and "rudder" not in k}}
    )  # fmt: skip
    plant, design = made(structure, "step", 20.0, AEROSONDE.model_copy(update={"sensors": quiet}))
    ns = len(structure.states)

    def record(parameters: Array) -> Array:
        table = parameters[: plant.derivatives.size].reshape(ns, ns + 1)
        constant, start = parameters[plant.derivatives.size :].reshape(2, ns)
        b = np.hstack([table[:, ns:], np.eye(ns)])
        f, g, *_ = cont2discrete((table[:, :ns], b, np.eye(ns), 0.0 * b), 1.0 / RATE_HZ)
        x = np.empty((len(design.inputs_rad), ns))
        x[0] = start
        for i, u in enumerate(design.inputs_rad[:-1]):
            x[i + 1] = f @ x[i] + g @ np.concatenate([u, constant])
        return (x / plant.noise_std).ravel()

    columns = slopes(record, np.concatenate([plant.derivatives, np.zeros(2 * ns)]))
    bound = np.sqrt(np.diagonal(np.linalg.inv(columns.T @ columns)))[: plant.derivatives.size]
    np.testing.assert_allclose(promise(plant, design.inputs_rad, RATE_HZ).standard_error, bound, rtol=1e-3)
