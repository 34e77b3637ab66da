"""Flights of the diagnosis benchmark in small: kinematics, sensors, and effects against what they are said to be."""

import math
from dataclasses import replace
from functools import cache

import diagnosis_from_jsbsim as bundled
import diagnosis_from_plants as linear
import numpy as np
import pytest
from diagnosis_air import GUST_RMS_M_S, Servo, Surfaces, gusts
from diagnosis_hidden import RATES, Array, Hidden
from diagnosis_inputs import KINDS, commands
from diagnosis_jsbsim_flight import Holds, jsbsim_motion
from diagnosis_plants import BASES, Plant, plant_motion
from diagnosis_readings import Motion, readings
from jsbsim_aircraft import AIRCRAFT, misfit
from scipy.signal import lsim

from wingwatch.aircraft import GRAVITY_M_S2, LATERAL, SHORT_PERIOD, linearised_derivatives
from wingwatch.telemetry import SampleBlock

IDEAL = [Servo(1e6)] * 3
HOLDS = (0.1, 0.1)


def moved(plant: Plant, kind: str = "doublets", size_rad: float = 0.03, seconds: float = 30.0) -> Motion:
    inputs = commands(np.random.default_rng(2), kind, seconds, linear.frequencies(plant), size_rad)
    return plant_motion(plant, inputs, [Servo(6.0)] * 3, HOLDS, None)


def slope(values: Array) -> Array:
    """d/dt by the four neighbours, error of fourth order; two samples less at either end."""
    return np.asarray((values[:-4] - 8.0 * values[1:-3] + 8.0 * values[3:-1] - values[4:]) * 50.0 / 12.0)


@pytest.fixture(scope="module", params=list(BASES))
def flight(request: pytest.FixtureRequest) -> tuple[Plant, Motion]:
    plant = BASES[request.param]
    return plant, moved(plant, "multisine")


def test_attitude_and_altitude_of_a_plant_are_its_rates_integrated(flight: tuple[Plant, Motion]) -> None:
    b = SampleBlock(flight[1].table)
    p, q, r = (b.column(name) for name in RATES)
    phi, theta, v, w = b.column("roll_rad"), b.column("pitch_rad"), *flight[1].air.T[1:]
    turn = q * np.sin(phi) + r * np.cos(phi)
    u = flight[1].air[:, 0]
    climb = u * np.sin(theta) - (v * np.sin(phi) + w * np.cos(phi)) * np.cos(theta)
    for column, rate in (
        ("pitch_rad", q * np.cos(phi) - r * np.sin(phi)),
        ("roll_rad", p + np.tan(theta) * turn),
        ("heading_rad", turn / np.cos(theta)),
        ("altitude_m", climb),
    ):
        error = (
            slope(np.unwrap(b.column(column)) if column != "altitude_m" else b.column(column)) - rate[2:-2]
        )
        assert np.abs(error).max() < 0.01 * np.abs(rate).max()


def test_accelerometers_of_a_plant_are_its_motion_less_gravity(flight: tuple[Plant, Motion]) -> None:
    b = SampleBlock(flight[1].table)
    p, q, r = (b.column(name) for name in RATES)
    phi, theta, alpha, beta = (
        b.column(n) for n in ("roll_rad", "pitch_rad", "angle_of_attack_rad", "sideslip_rad")
    )
    speed, g = b.column("airspeed_true_m_s"), GRAVITY_M_S2
    u, v, w = speed * np.cos(alpha) * np.cos(beta), speed * np.sin(beta), speed * np.sin(alpha) * np.cos(beta)
    assert np.ptp(u) < 1e-9 * u[0]
    wanted = {
        "x": slope(u) + (q * w - r * v + g * np.sin(theta))[2:-2],
        "y": slope(v) + (r * u - p * w - g * np.cos(theta) * np.sin(phi))[2:-2],
        "z": slope(w) + (p * v - q * u - g * np.cos(theta) * np.cos(phi))[2:-2],
    }
    for axis, force in wanted.items():
        error = b.column(f"specific_force_{axis}_m_s2")[2:-2] - force
        assert error.std() < 0.01 * force.std()


@pytest.mark.parametrize("plane", ["elevator", "rudder"])
def test_in_one_plane_a_plant_is_its_linear_equations(plane: str) -> None:
    still = replace(BASES["jetstream"], rolls=False)
    inputs = commands(np.random.default_rng(2), "doublets", 20.0, linear.frequencies(still), 1e-4)
    inputs *= np.array([1.0, 0.0, 0.0] if plane == "elevator" else [0.0, 0.0, 1.0])
    b = SampleBlock(plant_motion(still, inputs, IDEAL, (0.0, 0.0), None).table)
    d = still.derivatives
    states, u = (("w", "q"), "eta") if plane == "elevator" else (("v", "r"), "zeta")
    rows = ("z", "m") if plane == "elevator" else ("y", "n")
    a = [[d[f"{row}_{x}"] for x in states] for row in rows]
    system = (a, [[d[f"{row}_{u}"]] for row in rows], np.eye(2), np.zeros((2, 1)))
    fine = np.repeat(inputs[:, 0 if plane == "elevator" else 2], 20)  # held between samples
    _, exact, _ = lsim(system, fine, np.arange(fine.size) / 1000.0, interp=False)
    rate = b.column("pitch_rate_rad_s" if plane == "elevator" else "yaw_rate_rad_s")
    # Gravity's fall along z with pitch is beside the linear equations, of second order.
    assert np.abs(rate - exact[::20, 1]).max() < 0.01 * np.abs(exact[:, 1]).max()


def test_a_plant_that_is_held_does_not_roll_and_one_that_is_coupled_does() -> None:
    still = replace(BASES["commuter"], rolls=False)
    coupled = linear.with_effects(still, [Hidden("roll_yaw_coupling", "", "n_p", 1.0)])
    for plant, rolls in ((still, False), (coupled, True)):
        inputs = np.zeros((500, 3))
        inputs[50:100, 2] = 0.03
        table = plant_motion(plant, inputs, IDEAL, (0.1, 0.0), None).table
        moves = float(np.abs(SampleBlock(table).column("roll_rate_rad_s")).max())
        assert moves > 0.001 if rolls else moves == 0.0


def test_effects_on_a_plant_are_ratios_of_its_derivatives() -> None:
    plant = BASES["small"]
    weak = linear.with_effects(plant, [Hidden("elevator_effectiveness", "", "fraction", 0.2)]).derivatives
    off = {name for name, value in weak.items() if value != plant.derivatives[name]}
    assert off == {"z_eta", "m_eta"}
    assert weak["m_eta"] == pytest.approx(0.8 * plant.derivatives["m_eta"])
    damped = linear.with_effects(plant, [Hidden("pitch_damping", "", "ratio", -0.25)]).derivatives
    assert damped["m_q"] == pytest.approx(0.75 * plant.derivatives["m_q"])


@pytest.mark.parametrize("kind", ["short", "dutch", "full"])
def test_a_plant_s_file_states_what_flies(kind: str) -> None:
    plant = replace(BASES["jetstream"], rolls=kind == "full")
    (stated,) = linear.stated_plant(plant, kind, 8.0, {}).conditions
    symbols = {s for structure in linear.STRUCTURES[kind] for s in structure.derivatives}
    assert set(stated.derivatives) == symbols
    assert all(stated.derivatives[s].value == plant.derivatives[s] for s in symbols)


def test_sensor_effects_are_what_they_say() -> None:
    motion = moved(BASES["commuter"], "multisine")
    truth = SampleBlock(readings(motion, (), {}, None))

    def read(*effects: tuple[str, str, float]) -> SampleBlock:
        hidden = [Hidden(name, target, "", size) for name, target, size in effects]
        return SampleBlock(readings(motion, hidden, {}, None))

    q, alpha = "pitch_rate_rad_s", "angle_of_attack_rad"
    assert read(("sensor_delay", q, 0.06)).column(q)[3:] == pytest.approx(truth.column(q)[:-3], abs=1e-12)
    assert read(("sensor_bias", q, 0.01)).column(q) == pytest.approx(truth.column(q) + 0.01)
    assert read(("sensor_scale", q, -0.1)).column(q) == pytest.approx(0.9 * truth.column(q))
    assert read(("airspeed_error", "", 0.05)).column("airspeed_true_m_s") == pytest.approx(
        1.05 * truth.column("airspeed_true_m_s")
    )
    assert read(("vane_upwash", "angle_of_attack", 0.2)).column(alpha) == pytest.approx(
        1.2 * truth.column(alpha)
    )
    ahead = read(("sensor_position", "vane_x", 5.0)).column(alpha) - truth.column(alpha)
    # A vane ahead sinks less, the nose going up: -q x / V.
    assert ahead == pytest.approx(-truth.column(q) * 5.0 / truth.column("airspeed_true_m_s"), abs=2e-4)
    z = "specific_force_z_m_s2"
    low = (read(("sensor_position", "imu_x", 2.0)).column(z) - truth.column(z))[2:-2]
    assert (low + 2.0 * slope(truth.column(q))).std() < 0.05 * low.std()


def test_noise_is_that_of_the_file() -> None:
    motion = moved(BASES["commuter"])
    noisy = readings(motion, (), {"roll_rad": 0.01}, np.random.default_rng(1))
    error = SampleBlock(noisy).column("roll_rad") - SampleBlock(motion.table).column("roll_rad")
    assert error.std() == pytest.approx(0.01, rel=0.1)


def test_servos_have_the_faults_they_are_given() -> None:
    effects = [
        Hidden("actuator_lag", "elevator", "", 0.1),
        Hidden("actuator_rate_limit", "aileron", "", 0.5),
        Hidden("actuator_backlash", "rudder", "", 0.02),
    ]
    servos = [Servo(1e6).under(effects, surface) for surface in ("elevator", "aileron", "rudder")]
    surfaces = Surfaces(servos, (0.0, 0.0, 0.0), 0.01)
    for _ in range(10):
        surfaces.move((0.1, 0.1, 0.1))
    elevator, aileron, rudder = surfaces.at
    assert elevator == pytest.approx(0.1 * (1.0 - math.exp(-1.0)), rel=1e-4)
    assert aileron == pytest.approx(0.05)
    assert rudder == pytest.approx(0.09)


def test_gusts_have_their_root_mean_square() -> None:
    air = gusts(np.random.default_rng(4), "light", 100.0, 400_000)
    # 8000 s of air that remembers for 5 s.
    assert air.std(axis=0) == pytest.approx(np.full(3, GUST_RMS_M_S["light"]), rel=0.1)


@pytest.mark.parametrize("kind", [*KINDS, "pulses"])
def test_inputs_move_every_surface_within_their_amplitude(kind: str) -> None:
    made = commands(np.random.default_rng(3), kind, 60.0, (3.0, 1.5), 0.02)
    assert made.shape == (3000, 3)
    assert (np.abs(made).max(axis=0) > 0.01).all()
    assert np.abs(made).max() <= 0.03
    assert (made[:90] == 0.0).all()


@pytest.mark.parametrize("name", list(bundled.NAMES))
def test_a_healthy_bundled_aircraft_is_what_its_file_says(name: str) -> None:
    condition = AIRCRAFT[name]
    subject = bundled.subject_with(name, condition)
    frequencies = (subject.frequency_rad_s(SHORT_PERIOD), subject.frequency_rad_s(LATERAL))
    inputs = commands(np.random.default_rng(3), "doublets", 20.0, frequencies, math.radians(2.0))
    motion = jsbsim_motion(subject, inputs, [Servo(8.0)] * 3, Holds(), None)
    for structure in (SHORT_PERIOD, LATERAL):
        assert misfit(subject, structure, motion.table, motion.spin) < 0.055
    (stated,) = bundled.file_of_derivatives(subject, 8.0, {}).conditions
    table, _ = subject.truth_at(condition.airspeed_true_m_s)
    assert all(entry.value == table[symbol] for symbol, entry in stated.derivatives.items())


@cache
def linearised(name: str, *effects: Hidden) -> dict[str, float]:
    """JSBSim's own derivatives of a bundled aircraft with effects."""
    at = AIRCRAFT[name]
    return bundled.subject_with(name, at, effects).truth_at(at.airspeed_true_m_s)[0]


def ratios(name: str, hidden: Hidden) -> dict[str, float]:
    """The same after over before."""
    after = linearised(name, hidden)
    return {s: after[s] / value if value else math.nan for s, value in linearised(name).items()}


@pytest.mark.parametrize("name", list(bundled.NAMES))
@pytest.mark.parametrize(
    ("surface", "symbols"),
    [("elevator", ("m_eta", "z_eta")), ("aileron", ("l_xi",)), ("rudder", ("n_zeta", "l_zeta"))],
)
def test_lost_effectiveness_shows_in_jsbsim_s_own_derivatives(
    name: str, surface: str, symbols: tuple[str, ...]
) -> None:
    found = ratios(name, Hidden(f"{surface}_effectiveness", "", "fraction", 0.15))
    for symbol in symbols:
        if math.isfinite(found[symbol]):
            assert found[symbol] == pytest.approx(0.85, abs=0.002), symbol
    other = {"elevator": "n_zeta", "aileron": "m_eta", "rudder": "m_eta"}[surface]
    assert found[other] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("name", list(bundled.NAMES))
@pytest.mark.parametrize("target", ["", "m_w", "l_p", "n_r", "l_xi", "n_zeta"])
def test_a_scaled_coefficient_is_stated_as_the_ratio_of_its_derivative(name: str, target: str) -> None:
    effect = Hidden("derivative" if target else "pitch_damping", target, "ratio", 0.3)
    before, after = (bundled.subject_with(name, AIRCRAFT[name], e) for e in ((), (effect,)))
    stated, found = bundled.as_stated(effect, before, after), ratios(name, effect)
    assert found[target or "m_q"] == pytest.approx(1.0 + stated.size)
    # Never more than the coefficient's own, but where moments of forces beside the centre of gravity work against it.
    assert 0.05 < stated.size < 0.6
    assert found["z_w"] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("name", bundled.WITH_COEFFICIENTS)
def test_a_file_of_coefficients_has_jsbsim_s_own_derivatives(name: str) -> None:
    at = AIRCRAFT[name]
    file = bundled.file_of_coefficients(bundled.subject_with(name, at), 8.0, {})
    for structure in (SHORT_PERIOD, LATERAL):
        for symbol, value in linearised_derivatives(file, at, structure).items():
            assert value == pytest.approx(linearised(name)[symbol], rel=0.005, abs=0.01), symbol


@pytest.mark.parametrize("name", bundled.WITH_COEFFICIENTS)
def test_a_scaled_coefficient_is_stated_as_its_own_ratio(name: str) -> None:
    effect = Hidden("pitch_damping", "", "ratio", 0.3)
    before, after = (bundled.subject_with(name, AIRCRAFT[name], e) for e in ((), (effect,)))
    # Lift due to pitch rate acts beside the centre of gravity and has a share in the file's Cm_q.
    assert bundled.as_stated(effect, before, after, coefficients=True).size == pytest.approx(0.3, abs=0.03)


def test_a_heavier_aircraft_has_smaller_derivatives() -> None:
    found = ratios("c172r", Hidden("mass_inertia", "", "ratio", 0.25))
    # Angle of attack and elevator of the trim change, and some slopes with them.
    for symbol in ("m_eta", "l_p", "l_xi", "n_zeta"):
        assert found[symbol] == pytest.approx(0.8, abs=0.01)


def test_a_centre_of_gravity_further_aft_takes_stability_away() -> None:
    name, shift_m = "c172r", 0.1
    subject = bundled.subject_with(name, AIRCRAFT[name])
    table = linearised(name)
    mass = subject.peer.mass
    less = -table["z_w"] * shift_m * mass.mass_kg / mass.inertia_y_kg_m2
    found = ratios(name, Hidden("cg_shift", "", "shift_m", shift_m))["m_w"] * table["m_w"]
    assert found == pytest.approx(table["m_w"] + less, rel=0.05)
