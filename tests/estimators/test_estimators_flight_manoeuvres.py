"""Manoeuvres of every structure from samples of simulated flight, and the servos between samples."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from wingwatch.aircraft import (
    DUTCH_ROLL_BETA,
    LATERAL,
    LATERAL_FULL,
    LONGITUDINAL,
    LONGITUDINAL_THROTTLE,
    MODEL_STRUCTURES,
    PHUGOID,
    ROLL,
    SHORT_PERIOD,
    SPIRAL,
    Aircraft,
    FlightCondition,
    ModeStructure,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)
from wingwatch.estimators import (
    FORMS,
    Estimate,
    FlightForm,
    Form,
    equation_error,
    flight_manoeuvres,
    in_form,
    missing_channels,
    output_error,
    solved_as,
)
from wingwatch.estimators.offline.servo import ahead, follows_command, lead_steps, moved
from wingwatch.simulation import FleetSimulation, Scenario, doublet_schedule
from wingwatch.telemetry import CHANNEL_INDEX, REQUIRED_CHANNELS, SampleBlock, complete

Array = NDArray[np.float64]

AIRCRAFT = load_aircraft("aerosonde")
SERVO_RAD_S = 2.0 * np.pi * 8.0


def flown(aircraft: Aircraft, noise: bool, seconds: float = 80.0) -> SampleBlock:
    """Straight flight with a doublet of each surface every 20 s, the autopilot closed, still air."""
    doublets = doublet_schedule(AIRCRAFT, FlightCondition(25.0, 1000.0), np.deg2rad(2.0))
    fleet = FleetSimulation([Scenario(aircraft, manoeuvres=(doublets,), noise=noise, seed=11)])
    return complete(SampleBlock(fleet.step(round(50.0 * seconds))[0]))


@pytest.fixture(scope="module")
def clean() -> SampleBlock:
    return flown(AIRCRAFT, noise=False)


def form_of(form: Form = "accelerometer", *, servos: bool = True) -> FlightForm:
    cruise = FlightCondition(25.0, 1000.0)
    return FlightForm(
        (cruise.airspeed_true_m_s, cruise.air_density_kg_m3), form=form, window_s=20.0,
        servo_rad_s=dict.fromkeys(("eta", "xi", "zeta"), SERVO_RAD_S) if servos else {},
    )  # fmt: skip


def truth_of(estimate: Estimate, structure: ModeStructure) -> Array:
    airspeed, altitude, density, _ = estimate.condition
    at = trimmed(AIRCRAFT, FlightCondition(airspeed, altitude, density))
    table = linearised_derivatives(AIRCRAFT, at, structure)
    return np.array([table[s] for s in structure.derivatives])


@pytest.mark.parametrize(
    ("structure", "within"),
    [(LATERAL, 0.03), (LATERAL_FULL, 0.03), (SHORT_PERIOD, 0.03), (LONGITUDINAL, 0.03)],
)
def test_output_error_finds_the_strong_derivatives_of_simulated_flight(
    clean: SampleBlock, structure: ModeStructure, within: float
) -> None:
    estimate, _ = output_error(flight_manoeuvres(structure, form_of(), [clean]))
    truth = truth_of(estimate, structure)
    strong = {"z_w", "z_q", "m_w", "m_eta", "y_v", "y_r", "l_p", "l_xi", "n_v", "n_zeta", "x_w"}
    for symbol, value, true in zip(structure.derivatives, estimate.value, truth, strict=True):
        if symbol in strong:
            assert value == pytest.approx(true, rel=within), symbol


def test_the_servos_course_within_a_step_is_worth_three_per_cent_of_roll_damping(clean: SampleBlock) -> None:
    errors = {}
    for servos in (True, False):
        estimate, _ = output_error(flight_manoeuvres(LATERAL, form_of(servos=servos), [clean]))
        at = LATERAL.derivatives.index("l_p")
        errors[servos] = abs(estimate.value[at] / truth_of(estimate, LATERAL)[at] - 1.0)
    assert errors[True] < 0.01
    assert errors[False] > 0.02


def test_forward_velocity_and_attitude_have_their_equations(clean: SampleBlock) -> None:
    parts = flight_manoeuvres(LONGITUDINAL, form_of(), [clean])
    first = parts[0]
    u, w = first.states[:, :2].T
    speed, alpha = clean.column("airspeed_true_m_s"), clean.column("angle_of_attack_rad")
    n = len(first)
    assert u == pytest.approx((speed * np.cos(alpha) * np.cos(clean.column("sideslip_rad")))[:n])
    assert w == pytest.approx((speed * np.sin(alpha))[:n])
    # in flight without noise du/dt = a_x - q w + r v - g sin(theta), up to the trapezoids' error over jumps
    rate = (
        first.accelerometer[:, 0] + np.einsum("nj,nj->n", first.known[:, 0], first.states) + first.rest[:, 0]
    )
    integral = np.concatenate([[0.0], np.cumsum(0.01 * (rate[1:] + rate[:-1]))])
    assert np.abs(u - u[0] - integral).max() < 0.05 * np.ptp(u)
    assert (first.pressure == 1.0).all()
    assert np.ptp(first.stability) == 0.0
    phugoid = flight_manoeuvres(PHUGOID, form_of(), [clean])[0]
    assert phugoid.states[:, 1] == pytest.approx(clean.column("pitch_rad")[:n])
    assert not phugoid.known.any()
    throttle = flight_manoeuvres(LONGITUDINAL_THROTTLE, form_of(), [clean])[0]
    assert throttle.inputs[:, 1] == pytest.approx(clean.column("throttle")[:n])


@pytest.mark.parametrize(
    ("structure", "a", "b", "channels"),
    [
        (ROLL, [[-20.0]], [[-115.0]], {"p": "roll_rate_rad_s", "xi": "aileron_rad"}),
        (SPIRAL, [[-0.07]], [[0.9]], {"phi": "roll_rad", "zeta": "rudder_rad"}),
        (
            PHUGOID, [[-0.28, -9.8], [0.026, 0.02]], [[-1.8], [-1.1]],
            {"u": "airspeed_true_m_s", "theta": "pitch_rad", "eta": "elevator_rad"},
        ),
    ],
)  # fmt: skip
def test_reduced_motions_are_found_where_they_are_all_there_is(
    structure: ModeStructure, a: list[list[float]], b: list[list[float]], channels: dict[str, str]
) -> None:
    """A flight table whose columns are made by the reduced model itself, surfaces commanded."""
    dt, n = 0.02, 4000
    both = np.zeros((len(a) + 1, len(a) + 1))
    both[:-1, :-1], both[:-1, -1:] = a, b
    grown = expm(dt * both)
    surface = np.repeat(np.random.default_rng(5).uniform(-0.03, 0.03, n // 100), 100)
    states = np.zeros((n, len(a)))
    for k in range(1, n):
        states[k] = grown[:-1, :-1] @ states[k - 1] + grown[:-1, -1] * surface[k - 1]
    columns: dict[str, Array] = {name: np.zeros(n) for name in REQUIRED_CHANNELS}
    columns["time_s"] = np.linspace(0.0, (n - 1) * dt, n)
    columns["airspeed_true_m_s"] += 25.0
    columns["altitude_m"] += 1000.0
    for symbol, values in zip(structure.states, states.T, strict=True):
        columns[channels[symbol]] = columns[channels[symbol]] + values
    columns[channels[structure.inputs[0]]] = surface
    form = replace(form_of(servos=False), commanded=frozenset(structure.inputs), window_s=80.0)
    (part,) = flight_manoeuvres(structure, form, [complete(SampleBlock.from_columns(columns))])
    estimate, _ = output_error([part])
    assert estimate.value == pytest.approx(np.hstack([a, b]).ravel(), rel=0.01)


@pytest.mark.parametrize("form", FORMS)
def test_which_velocities_and_forces_a_form_uses(clean: SampleBlock, form: Form) -> None:
    part = flight_manoeuvres(SHORT_PERIOD, form_of(form), [clean])[1]
    assert part.measured.tolist() == [form != "reconstructed", True]
    assert part.forces.tolist() == [form != "differentiated", False]
    if form == "reconstructed":
        vane = flight_manoeuvres(SHORT_PERIOD, form_of(), [clean])[1]
        assert np.corrcoef(np.diff(part.states[:, 0]), np.diff(vane.states[:, 0]))[0, 1] > 0.99


def test_two_flights_are_cut_each_for_itself(clean: SampleBlock) -> None:
    one = flight_manoeuvres(SHORT_PERIOD, form_of(), [clean])
    both = flight_manoeuvres(SHORT_PERIOD, form_of(), [clean, clean])
    assert len(both) == 2 * len(one)
    assert both[len(one)].states.tolist() == one[0].states.tolist()


def test_an_estimate_with_sideslip_is_that_with_velocity(clean: SampleBlock) -> None:
    assert solved_as(DUTCH_ROLL_BETA).name == "dutch_roll"
    plain, fit = equation_error(flight_manoeuvres(DUTCH_ROLL_BETA, form_of(), [clean]))
    angled, angled_fit = in_form(plain, fit, DUTCH_ROLL_BETA)
    speed = plain.condition[0]
    assert angled.structure == DUTCH_ROLL_BETA
    assert angled.value == pytest.approx(plain.value * np.array([speed, 1.0, 1.0] * 2))
    assert angled.standard_error[0] == pytest.approx(speed * plain.standard_error[0])
    assert angled_fit.interval[0] == pytest.approx(speed * fit.interval[0])
    assert angled_fit.correlation == pytest.approx(fit.correlation)
    same, _ = in_form(plain, fit, plain.structure)
    assert same.value.tolist() == plain.value.tolist()


def test_slopes_by_normal_velocity_are_those_at_constant_forward_velocity() -> None:
    """Of lift that is linear in the angle of attack, at a level trim: what a trim that follows V^2 takes of z_w."""
    block = flown(load_aircraft("aerosonde"), noise=False)
    manoeuvres = flight_manoeuvres(SHORT_PERIOD, form_of(), [block])
    solved = equation_error(manoeuvres)
    truth = truth_of(solved[0], SHORT_PERIOD)[0]
    assert abs(solved[0].value[0] / truth - 1.0) > 0.007
    assert in_form(*solved, SHORT_PERIOD)[0].value[0] == pytest.approx(truth, rel=0.003)


def test_what_a_structure_needs_is_said_by_name(clean: SampleBlock) -> None:
    for structure in MODEL_STRUCTURES.values():
        assert missing_channels(structure, clean.present) == ()
    poor = [name for name in clean.present if name not in ("throttle", "angle_of_attack_rad", "rudder_rad")]
    assert missing_channels(LONGITUDINAL_THROTTLE, poor) == ("angle_of_attack_rad", "throttle")
    assert missing_channels(LONGITUDINAL_THROTTLE, poor, "reconstructed") == ("throttle",)
    assert missing_channels(DUTCH_ROLL_BETA, poor) == ("rudder_rad",)
    with pytest.raises(ValueError, match="form 'guessed' is none of accelerometer"):
        flight_manoeuvres(SHORT_PERIOD, FlightForm((25.0, 1.1), form="guessed"), [clean])  # type: ignore[arg-type]


def servo(command: Array, dt: float, delay: float = 0.0) -> Array:
    """Positions of a first-order servo at the samples, each command acting ``delay`` steps after its sample."""
    x = np.zeros(command.size)
    for k in range(1, command.size):
        before = command[k - 2] if k > 1 else 0.0
        middle = before + (x[k - 1] - before) * np.exp(-SERVO_RAD_S * dt * delay)
        x[k] = command[k - 1] + (middle - command[k - 1]) * np.exp(-SERVO_RAD_S * dt * (1.0 - delay))
    return x


def test_a_servo_is_believed_only_where_commands_are_held_from_the_samples_on() -> None:
    rng, dt = np.random.default_rng(3), 0.02
    time_s: Array = np.linspace(0.0, 999 * dt, 1000)
    command = np.repeat(rng.uniform(-0.03, 0.03, 100), 10)
    noise = 0.0009 * rng.standard_normal(1000)
    assert follows_command(servo(command, dt) + noise, command, time_s, SERVO_RAD_S)
    assert not follows_command(servo(command, dt, 0.5) + noise, command, time_s, SERVO_RAD_S)
    assert not follows_command(servo(np.roll(command, -1), dt) + noise, command, time_s, SERVO_RAD_S)
    assert not follows_command(noise, np.zeros(1000), time_s, SERVO_RAD_S)
    assert not follows_command(np.full(1000, np.nan), command, time_s, SERVO_RAD_S)
    assert not follows_command(command[:5], command[:5], time_s[:5], SERVO_RAD_S)


def test_a_surface_known_by_command_is_where_its_servo_has_it() -> None:
    dt = 0.02
    time_s: Array = dt * np.arange(200.0)
    command = np.zeros(200)
    command[20:40], command[40:60] = 0.03, -0.03
    np.testing.assert_allclose(moved(command, time_s, SERVO_RAD_S, 0.5), servo(command, dt), rtol=1e-12)
    time_s[50:] += 1.0
    after = moved(command, time_s, SERVO_RAD_S, 0.5)
    assert after[49] != command[49]
    assert after[50] == command[50], "after a gap it is at its command"
    command[100], command[101] = np.nan, 0.01
    after = moved(command, time_s, SERVO_RAD_S, 0.5)
    assert np.isnan(after[100])
    assert after[101] == 0.01


def test_commands_whose_servo_is_known_say_what_positions_say(clean: SampleBlock) -> None:
    values = clean.values.copy()
    for surface in ("elevator", "aileron", "rudder"):
        values[:, CHANNEL_INDEX[f"{surface}_rad"]] = clean.column(f"{surface}_command_rad")
    commanded_form = replace(form_of(), commanded=frozenset(("eta", "xi", "zeta")))
    roll = [LATERAL.derivatives.index(symbol) for symbol in ("l_p", "l_xi")]
    found = []
    for form, block in ((form_of(), clean), (commanded_form, SampleBlock(values))):
        estimate, _ = output_error(flight_manoeuvres(LATERAL, form, [block]))
        found.append(estimate.value[roll])
    np.testing.assert_allclose(found[1], found[0], rtol=0.01)
    without_servo = replace(commanded_form, servo_rad_s={})
    estimate, _ = output_error(flight_manoeuvres(LATERAL, without_servo, [SampleBlock(values)]))
    assert (np.abs(estimate.value[roll] / found[0] - 1.0) > 0.2).all(), "as if the surfaces leapt"


def test_the_line_through_positions_ahead_turns_the_aircraft_as_the_servo_does() -> None:
    """A first-order motion driven by the servo: exact on the one hand, with the input on lines on the other."""
    dt, damping = 0.02, -20.0
    command = np.zeros(200)
    command[20:40], command[40:60] = 0.03, -0.03
    position = servo(command, dt)
    both = expm(dt * np.array([[damping, 1.0, 0.0], [0.0, -SERVO_RAD_S, SERVO_RAD_S], [0.0, 0.0, 0.0]]))
    state, exact = np.zeros(2), np.zeros(200)
    for k in range(1, 200):
        state = both[:2, :2] @ state + both[:2, 2] * command[k - 1]
        exact[k] = state[0]
    line = expm(dt * np.array([[damping, 1.0, 0.0], [0.0, 0.0, 1.0 / dt], [0.0, 0.0, 0.0]]))

    def driven(u: Array) -> Array:
        y = np.zeros(200)
        for k in range(1, 200):
            y[k] = line[0, 0] * y[k - 1] + line[0, 1] * u[k - 1] + line[0, 2] * (u[k] - u[k - 1])
        return y

    wrong = np.abs(driven(position) - exact).max()
    assert (
        np.abs(driven(ahead(position, np.linspace(0.0, 199 * dt, 200), SERVO_RAD_S)) - exact).max()
        < 0.4 * wrong
    )


def test_the_lead_lies_between_a_line_and_a_step() -> None:
    assert lead_steps(1e-6, 0.02) == pytest.approx(0.0, abs=1e-6)
    assert lead_steps(1e6, 0.02) == pytest.approx(0.5, abs=1e-4)
    assert lead_steps(SERVO_RAD_S, 0.02) == pytest.approx(0.0824, abs=1e-4)
    assert lead_steps(0.0499, 0.02) == pytest.approx(lead_steps(0.0501, 0.02), rel=0.01)


def test_commands_between_samples_are_expected_to_go_evenly() -> None:
    """A servo commanded at random at 50 Hz, read at 25 Hz: where it is on average, not late by half a sample."""
    rng, commanded_form = np.random.default_rng(3), np.zeros(4001)
    commanded_form[1:] = np.cumsum(rng.standard_normal(4000))
    truth, stays = np.zeros(4001), np.exp(-SERVO_RAD_S * 0.02)
    for k in range(4000):
        truth[k + 1] = commanded_form[k] + stays * (truth[k] - commanded_form[k])
    time_s = 0.04 * np.arange(2001, dtype=np.float64)
    off = moved(commanded_form[::2], time_s, SERVO_RAD_S, 0.5) - truth[::2]
    rate = np.gradient(truth[::2], time_s)
    late_s = -(off @ rate) / (rate @ rate)
    assert abs(late_s) < 1e-3, "each command held until the next that is known would be late by 16 ms"
