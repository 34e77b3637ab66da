"""The equations of motion against conservation laws, the aircraft file's own meaning and the paper's derivatives."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from simulation_accuracy import rotation, tumbling

from wingwatch.aircraft import (
    DUTCH_ROLL,
    GRAVITY_M_S2,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    AircraftDataError,
    ElectricPropulsion,
    FlightCondition,
    ModeStructure,
    TrimError,
    aspect_ratio,
    body_coefficients,
    isa_density_kg_m3,
    linearised_derivatives,
    load_aircraft,
    unsteady_inertia,
)
from wingwatch.simulation import linearise, trim
from wingwatch.simulation.aerodynamics import Deflections, Motion, arc_tangent, load
from wingwatch.simulation.atmosphere import CELL_M, air_density, expand_density
from wingwatch.simulation.dynamics import euler_angles, fly_held, thrust_n
from wingwatch.simulation.layout import (
    COEFFICIENTS,
    MASS,
    parameter_row,
)
from wingwatch.simulation.prepared import GRAVITY, working_row

AEROSONDE = load_aircraft("aerosonde")
ULTRASTICK = load_aircraft("ultrastick25e")

Array = NDArray[np.float64]


def fly_open_loop(state: Array, surfaces: Array, throttle: float, row: Array, dt: float, steps: int) -> Array:
    """State after steps with everything held."""
    state = state.copy()
    fly_held(working_row(row), state, surfaces, throttle, dt, steps)
    return state


def test_a_body_without_forces_keeps_energy_and_angular_momentum_for_ten_minutes() -> None:
    body, inertia, start = tumbling()
    assert np.linalg.eigvalsh(inertia).min() > 0.0
    end, seconds, dt = start.copy(), 600.0, 0.0015
    fly_held(body, end, np.zeros(3), 0.0, dt, round(seconds / dt))
    momentum = [rotation(s) @ inertia @ s[10:13] for s in (start, end)]
    spin_energy = [0.5 * s[10:13] @ inertia @ s[10:13] for s in (start, end)]
    drift = [0.5 * body[MASS] * s[3:6] @ s[3:6] for s in (start, end)]
    assert np.linalg.norm(momentum[1] - momentum[0]) < 1e-9 * np.linalg.norm(momentum[0])
    assert spin_energy[1] == pytest.approx(spin_energy[0], rel=1e-9)
    assert drift[1] == pytest.approx(drift[0], rel=1e-9)
    velocity = [rotation(s) @ s[3:6] for s in (start, end)]
    assert np.linalg.norm(velocity[1] - velocity[0]) < 1e-9 * np.linalg.norm(velocity[0])
    flown = velocity[0] * seconds
    assert np.linalg.norm(end[:3] - start[:3] - flown) < 1e-9 * np.linalg.norm(flown)
    assert np.linalg.norm(end[6:10]) == pytest.approx(1.0, abs=1e-15)


def test_a_body_that_falls_in_vacuum_follows_a_parabola() -> None:
    body, _, start = tumbling()
    body[GRAVITY] = GRAVITY_M_S2
    end, seconds, dt = start.copy(), 60.0, 0.0025
    fly_held(body, end, np.zeros(3), 0.0, dt, round(seconds / dt))
    earth = rotation(start) @ start[3:6]
    fallen = start[:3] + earth * seconds
    fallen[2] += 0.5 * GRAVITY_M_S2 * seconds**2
    # a step of the method errs by at most (spin dt)^5 / 120 relative, in both the rates and the attitude
    spin = float(np.linalg.norm(start[10:13]))
    drift = 2.0 * (spin * dt) ** 4 / 120.0 * spin * seconds
    assert np.abs(end[:3] - fallen).max() < drift * np.abs(fallen).max()


def test_the_integration_converges_with_the_fourth_order() -> None:
    row = parameter_row(AEROSONDE)
    point = trim(AEROSONDE, FlightCondition(25.0, 1000.0))
    moved = point.surfaces_rad + np.array([0.03, 0.02, -0.03])

    def after_two_seconds(dt: float) -> Array:
        return fly_open_loop(point.state, moved, point.throttle, row, dt, round(2.0 / dt))

    exact = after_two_seconds(0.00125)
    errors = [float(np.abs(after_two_seconds(dt) - exact)[3:].max()) for dt in (0.02, 0.01)]
    # fourth order: 2^4 = 16; the fifth-order remainder is worth (mode frequency x step) = 25/s x 0.02 s, half, of it
    assert 16.0 / 1.5 < errors[0] / errors[1] < 16.0 * 1.5


@pytest.mark.parametrize("aircraft", [AEROSONDE, ULTRASTICK], ids=lambda a: a.name)
@settings(max_examples=200, deadline=None)
@given(
    angles=st.tuples(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2)),
    rates=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    surfaces=st.tuples(*[st.floats(-0.4, 0.4)] * 3),
    airspeed=st.floats(1.0, 60.0),
)
def test_forces_are_those_the_aircraft_file_means(
    aircraft: Aircraft,
    angles: tuple[float, float],
    rates: tuple[float, float, float],
    surfaces: tuple[float, float, float],
    airspeed: float,
) -> None:
    alpha, beta = angles
    density = 1.1
    geometry, c = aircraft.geometry, aircraft.coefficients
    assert geometry is not None
    assert c is not None
    half_span, half_chord = 0.5 * geometry.span_m / airspeed, 0.5 * geometry.mean_chord_m / airspeed
    u, v, w = airspeed * np.array([
        math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta),
    ])  # fmt: skip
    out = np.array(
        load(
            working_row(parameter_row(aircraft)),
            Motion(u, v, w, *rates),
            Deflections(*surfaces),
            density,
            0.0,
        )
    )
    hat = (rates[0] * half_span, rates[1] * half_chord, rates[2] * half_span)
    expected = body_coefficients(
        c, aspect_ratio(geometry.span_m, geometry.wing_area_m2), alpha, beta, hat, surfaces
    )
    arm = geometry.span_m, geometry.mean_chord_m, geometry.span_m
    pressure_area = 0.5 * density * airspeed**2 * geometry.wing_area_m2
    wanted = [float(v.real) * pressure_area * s for v, s in zip(expected, (1.0, 1.0, 1.0, *arm), strict=True)]
    # rounding of some thirty operations on terms of the size of the largest coefficient (about 40 x 3 rad/s hat)
    assert out[:6] == pytest.approx(wanted, rel=1e-11, abs=1e-11 * pressure_area)
    unsteady = body_coefficients(
        c, aspect_ratio(geometry.span_m, geometry.wing_area_m2), 0.0, alphadot_hat=half_chord
    )
    still = body_coefficients(c, aspect_ratio(geometry.span_m, geometry.wing_area_m2), 0.0)
    lift, pitch = still.CZ.real - unsteady.CZ.real, unsteady.Cm.real - still.Cm.real
    assert out[6] == pytest.approx(pressure_area * lift, rel=1e-9, abs=1e-12)
    assert out[7] == pytest.approx(pressure_area * geometry.mean_chord_m * pitch, rel=1e-9, abs=1e-12)


def test_coefficients_stand_in_the_order_of_the_file() -> None:
    coefficients = AEROSONDE.coefficients
    assert coefficients is not None
    assert dict(zip(COEFFICIENTS, parameter_row(AEROSONDE), strict=False)) == dict(coefficients.items())


@pytest.mark.parametrize("altitude_m", [-500.0, 0.0, 1000.0, 10995.0, 11005.0, 19000.0])
def test_the_density_near_an_altitude_is_that_of_the_atmosphere(altitude_m: float) -> None:
    for within in (-0.5 * CELL_M, 0.3 * CELL_M, 0.5 * CELL_M - 1e-6):
        middle = CELL_M * math.floor(altitude_m / CELL_M) + 0.5 * CELL_M
        centre, a, b, c = expand_density(middle + within)
        assert centre == middle
        d = middle + within - centre
        # the terms left out, as the function states them
        assert a + d * (b + d * c) == pytest.approx(air_density(middle + within), rel=1e-10)


@settings(max_examples=300, deadline=None)
@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_the_fast_arc_tangent_is_the_arc_tangent(y: float, x: float) -> None:
    assert arc_tangent(y, x) == pytest.approx(math.atan2(y, x), rel=4e-16, abs=1e-300)


@pytest.mark.parametrize("altitude_m", [-500.0, 0.0, 1000.0, 10999.0, 11001.0, 19000.0])
def test_density_is_the_standard_atmosphere(altitude_m: float) -> None:
    assert air_density(altitude_m) == pytest.approx(float(isa_density_kg_m3(altitude_m)), rel=1e-9)


def test_electric_thrust_balances_motor_and_propeller_torque() -> None:
    p = AEROSONDE.propulsion
    assert isinstance(p, ElectricPropulsion)
    airspeed, density, throttle = 25.0, 1.1116, 0.8
    c0, c1, c2 = p.torque_coefficients
    low, high = 0.0, 2000.0
    for _ in range(200):  # bisection of the torque balance itself
        omega = 0.5 * (low + high)
        n = omega / (2 * math.pi)
        j = airspeed / (n * p.propeller_diameter_m)
        propeller = density * p.propeller_diameter_m**5 * n**2 * (c0 + c1 * j + c2 * j**2)
        current = (p.voltage_max_v * throttle - p.motor_constant_v_s_rad * omega) / p.resistance_ohm
        motor = p.torque_constant_n_m_a * (current - p.no_load_current_a)
        low, high = (omega, high) if motor > propeller else (low, omega)
    t0, t1, t2 = p.thrust_coefficients
    wanted = density * p.propeller_diameter_m**4 * n**2 * (t0 + t1 * j + t2 * j**2)
    assert thrust_n(parameter_row(AEROSONDE), throttle, airspeed, density) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("airspeed", [20.0, 25.0, 30.0, 32.0])
def test_level_trim_agrees_with_the_aircraft_package(airspeed: float) -> None:
    from wingwatch.aircraft import trim as paper_trim

    condition = FlightCondition(airspeed, 1000.0)
    point, paper = trim(AEROSONDE, condition), paper_trim(AEROSONDE, condition)
    assert point.residual < 1e-8
    assert point.angle_of_attack_rad == pytest.approx(paper.angle_of_attack_rad, abs=1e-9)
    assert point.elevator_rad == pytest.approx(paper.elevator_rad, abs=1e-9)
    thrust = thrust_n(parameter_row(AEROSONDE), point.throttle, airspeed, condition.air_density_kg_m3)
    assert thrust == pytest.approx(paper.thrust_n, rel=1e-8)


def test_a_climbing_turn_stays_what_it_was_trimmed_for() -> None:
    condition = FlightCondition(25.0, 1000.0)
    climb, bank = 0.03, 0.5
    point = trim(AEROSONDE, condition, climb_rad=climb, bank_rad=bank)
    row = parameter_row(AEROSONDE)
    end = fly_open_loop(point.state, point.surfaces_rad, point.throttle, row, 0.005, 400)
    roll, pitch, heading = euler_angles(end)
    # density falls by about 1e-4 per metre and the climb is 1.5 m: 1.5e-4 of each quantity
    assert roll == pytest.approx(bank, abs=1.5e-4)
    assert pitch == pytest.approx(point.pitch_rad, abs=1.5e-4)
    assert heading == pytest.approx(2.0 * point.turn_rate_rad_s, rel=1e-3)
    assert -end[2] - 1000.0 == pytest.approx(2.0 * 25.0 * math.sin(climb), rel=1e-2)
    assert point.turn_rate_rad_s == pytest.approx(GRAVITY_M_S2 * math.tan(bank) / 25.0, rel=0.05)


def test_flights_that_cannot_be_trimmed_are_refused_in_a_sentence() -> None:
    with pytest.raises(TrimError, match="throttle"):
        trim(AEROSONDE, FlightCondition(35.0, 1000.0))
    with pytest.raises(TrimError, match="lift coefficient"):
        trim(AEROSONDE, FlightCondition(8.0, 1000.0))
    with pytest.raises(AircraftDataError, match="simulation"):
        trim(load_aircraft("jetstream31"), FlightCondition(87.4, 1853.0))


@pytest.mark.parametrize("structure", [SHORT_PERIOD, DUTCH_ROLL, LATERAL], ids=lambda s: s.name)
@pytest.mark.parametrize("airspeed", [20.0, 25.0, 30.0])
def test_what_is_flown_has_the_derivatives_of_the_paper(airspeed: float, structure: ModeStructure) -> None:
    condition = FlightCondition(airspeed, 1000.0)
    flown = linearise(AEROSONDE, condition, structure)
    paper = linearised_derivatives(AEROSONDE, condition, structure)
    if structure == SHORT_PERIOD:
        paper["z_eta"] += _elevator_drag_slope(condition)
    for symbol, value in paper.items():
        # central differences: (step / airspeed)^2 / 6 = 4e-10 of curvature, and the rounding of accelerations of
        # 10 m/s2 over a step of 1e-5
        assert flown[symbol] == pytest.approx(value, rel=1e-8, abs=1e-8), symbol


def _elevator_drag_slope(condition: FlightCondition) -> float:
    """The paper leaves out the drag of |elevator|, which is even; beside neutral it has a slope in z body."""
    geometry, mass, c = AEROSONDE.geometry, AEROSONDE.mass, AEROSONDE.coefficients
    assert geometry is not None
    assert mass is not None
    assert c is not None
    point = trim(AEROSONDE, condition)
    slope = -math.copysign(c.CD.elevator, point.elevator_rad) * math.sin(point.angle_of_attack_rad)
    return condition.dynamic_pressure_pa * geometry.wing_area_m2 / mass.mass_kg * slope


def test_the_lag_of_the_downwash_agrees_with_the_paper_to_its_own_neglect() -> None:
    condition = FlightCondition(17.0, 300.0)
    flown = linearise(
        ULTRASTICK, condition, ModeStructure("with_x", ("w", "q"), ("eta",), ("x", "z", "m"), "")
    )
    paper = linearised_derivatives(ULTRASTICK, condition, SHORT_PERIOD)
    mass, geometry, c = ULTRASTICK.mass, ULTRASTICK.geometry, ULTRASTICK.coefficients
    assert mass is not None
    assert geometry is not None
    assert c is not None
    alpha = trim(ULTRASTICK, condition).angle_of_attack_rad
    z_wdot, _ = unsteady_inertia(ULTRASTICK, condition)
    assert z_wdot != 0.0
    drag_slope = condition.dynamic_pressure_pa * geometry.wing_area_m2 / mass.mass_kg * c.CD.elevator
    for index in ("w", "q", "eta"):
        # the paper's alphadot has no part in du/dt: what is left out is Z_wdot/m tan(alpha) du/dt
        neglected = abs(z_wdot) / mass.mass_kg * math.tan(abs(alpha)) * abs(flown[f"x_{index}"])
        neglected += drag_slope * abs(math.sin(alpha)) if index == "eta" else 0.0
        assert flown[f"z_{index}"] == pytest.approx(
            paper[f"z_{index}"], rel=1e-8, abs=1.01 * neglected + 1e-8
        )
        assert flown[f"m_{index}"] == pytest.approx(paper[f"m_{index}"], rel=1e-8, abs=1e-8)
