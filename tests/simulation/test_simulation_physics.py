"""What the equations of motion hold beyond a clean aircraft file, each term against its own formula."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from wingwatch.aircraft import (
    GRAVITY_M_S2,
    SHORT_PERIOD,
    Aircraft,
    ConstantThrust,
    FlightCondition,
    ModeStructure,
    load_aircraft,
)
from wingwatch.simulation import CgShift, linearise, trim
from wingwatch.simulation.aerodynamics import Deflections, Motion, load
from wingwatch.simulation.atmosphere import air_density
from wingwatch.simulation.dynamics import derivatives, quaternion, thrust_n
from wingwatch.simulation.flight import _move_centre
from wingwatch.simulation.icing_increments import icing_increments
from wingwatch.simulation.layout import AREA, INDEX, STATE, parameter_row
from wingwatch.simulation.prepared import working_row
from wingwatch.simulation.rigid_body import (
    AIR,
    DENSITY_ALTITUDE,
    FORCE_Z,
    GUST,
    GUST_Q,
    RISE,
    SETTING_WIDTH,
    WIND,
    advance,
)
from wingwatch.simulation.timeline import base_row

Array = NDArray[np.float64]
AEROSONDE = load_aircraft("aerosonde")
LEVEL = FlightCondition(25.0, 1000.0)
SPEED, DENSITY = 25.0, 1.1
FORCE = 0.5 * DENSITY * SPEED**2 * parameter_row(AEROSONDE)[AREA]
SPAN, CHORD = (parameter_row(AEROSONDE)[INDEX[name]] for name in ("span_m", "chord_m"))


def changed(**values: float) -> Array:
    row = parameter_row(AEROSONDE)
    for name, value in values.items():
        row[INDEX[name]] = value
    return row


def coefficients(
    row: Array, alpha: float = 0.08, surfaces: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Array:
    """(CL, CD, CY, Cl, Cm, Cn) without sideslip and rates."""
    x, y, z, roll, pitch, yaw, _, _ = load(
        working_row(row),
        Motion(SPEED * math.cos(alpha), 0.0, SPEED * math.sin(alpha), 0.0, 0.0, 0.0),
        Deflections(*surfaces),
        DENSITY,
        0.0,
    )
    lift, drag = x * math.sin(alpha) - z * math.cos(alpha), -x * math.cos(alpha) - z * math.sin(alpha)
    return np.asarray(np.array([lift, drag, y, roll / SPAN, pitch / CHORD, yaw / SPAN]) / FORCE)


def rates(
    row: Array, state: Array, surfaces: tuple[float, float, float], throttle: float
) -> tuple[Array, Array]:
    """d(state)/dt and the specific force at the centre of gravity."""
    force, out = np.empty(3), np.empty(len(STATE))
    derivatives(state, np.array(surfaces), throttle, row, force, out)
    return out, force


def flying(rate: tuple[float, float, float] = (0.2, -0.3, 0.4)) -> Array:
    state = np.zeros(len(STATE))
    state[2], state[3:6], state[10:13] = -1000.0, (24.0, 1.5, 2.0), rate
    state[6:10] = quaternion(0.1, 0.05, -0.4)
    return state


@settings(max_examples=100, deadline=None)
@given(
    products=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    spin=st.tuples(*[st.floats(-5.0, 5.0)] * 3),
)
def test_a_body_with_every_product_of_inertia_turns_by_eulers_equation(
    products: tuple[float, float, float], spin: tuple[float, float, float]
) -> None:
    xy, xz, yz = products
    row = changed(area_m2=0.0, electric=0.0, thrust_max_n=0.0, inertia_xy=xy, inertia_xz=xz, inertia_yz=yz)
    ix, iy, iz = (row[INDEX[f"inertia_{axis}"]] for axis in "xyz")
    inertia = np.array([[ix, -xy, -xz], [-xy, iy, -yz], [-xz, -yz, iz]])
    omega = np.array(spin)
    wanted = np.linalg.solve(inertia, -np.cross(omega, inertia @ omega))
    found, _ = rates(row, flying(spin), (0.0, 0.0, 0.0), 0.0)
    assert found[10:13] == pytest.approx(wanted, rel=1e-11, abs=1e-12)


def test_forces_act_at_the_reference_point_wherever_the_centre_of_gravity_is() -> None:
    """Against the forces of the reference point's own motion, carried over by hand."""
    cg = np.array([-0.07, 0.03, 0.02])
    row = changed(cg_x_m=cg[0], cg_y_m=cg[1], cg_z_m=cg[2], inertia_xy=0.02, inertia_yz=-0.01)
    state, surfaces, throttle = flying(), (-0.03, 0.02, 0.01), 0.7
    omega = state[10:13]
    there = state[3:6] - np.cross(omega, cg)
    density = air_density(1000.0)
    *_, lift_rate, pitch_rate = found = load(
        working_row(row), Motion(*there, *omega), Deflections(*surfaces), density, 0.0
    )
    assert lift_rate == pitch_rate == 0.0
    force, moment = np.array(found[:3]), np.array(found[3:6])
    force[0] += thrust_n(row, throttle, float(np.linalg.norm(there)), density)
    moment = moment - np.cross(cg, force)
    names = ("x", "xy", "xz"), ("xy", "y", "yz"), ("xz", "yz", "z")
    inertia = np.array(
        [[row[INDEX[f"inertia_{n}"]] * (1 if len(n) == 1 else -1) for n in line] for line in names]
    )
    wanted = np.linalg.solve(inertia, moment - np.cross(omega, inertia @ omega))
    out, felt = rates(row, state, surfaces, throttle)
    assert felt == pytest.approx(force / row[INDEX["mass_kg"]], rel=1e-12)
    assert out[10:13] == pytest.approx(wanted, rel=1e-10, abs=1e-10)


def test_lift_due_to_alphadot_goes_by_the_motion_through_the_air() -> None:
    """Air that turns by its slope changes the angle of attack, -w_g'/V = q_g; neither a steady wind nor what the gust
    gains at the centre of gravity does."""
    lag, step_s = 30.0, 1e-5
    none, some = changed(CL_alphadot=0.0, Cm_alphadot=0.0), changed(CL_alphadot=lag, Cm_alphadot=0.0)

    def flown(row: Array, turning: float, wind: float, rise: float = 0.0) -> tuple[float, Array, Array]:
        """Normal force at the step's start, and the motion through steady air at its start and end."""
        c, s, state = working_row(row), np.zeros(SETTING_WIDTH), flying()
        state[4] = 0.0
        s[WIND], s[GUST : GUST + 3] = wind, (0.5, 0.0, -0.8)
        s[GUST_Q], s[RISE : RISE + 3] = turning, rise
        s[DENSITY_ALTITUDE : DENSITY_ALTITUDE + 2] = 1000.0, DENSITY
        work = np.empty((3, len(STATE)))
        advance(c, s, state, step_s, *work)
        force, before = float(s[FORCE_Z]), s[AIR : AIR + 3].copy()
        advance(c, s, state, step_s, *work)
        return force, before, s[AIR : AIR + 3].copy()

    for wind in (0.0, 12.0):
        for turning in (0.0, 1.7, -0.4):
            plain, *_ = flown(none, turning, wind)
            force, before, after = flown(some, turning, wind)
            alphadot = turning + (math.atan2(after[2], after[0]) - math.atan2(before[2], before[0])) / step_s
            speed, plane = float(np.linalg.norm(before)), math.hypot(before[0], before[2])
            lift = 0.25 * DENSITY * speed * CHORD * parameter_row(AEROSONDE)[AREA] * lag * alphadot
            wanted = -lift * before[0] / plane / parameter_row(AEROSONDE)[INDEX["mass_kg"]]
            assert force - plain == pytest.approx(wanted, rel=2e-3)
            assert flown(some, turning, wind, 4e-4)[0] == force


def test_a_centre_of_gravity_that_moves_leaves_every_point_of_the_body_where_it_is() -> None:
    state, cg = flying(), np.array([-0.05, 0.02, 0.03])
    before, centre = state.copy(), np.zeros(3)
    _move_centre(changed(cg_x_m=cg[0], cg_y_m=cg[1], cg_z_m=cg[2]), state, centre)
    np.testing.assert_array_equal(centre, cg)
    omega = state[10:13]
    assert state[3:6] - np.cross(omega, cg) == pytest.approx(before[3:6], abs=1e-14)
    q0, q = state[6], state[7:10]
    turned = cg + 2.0 * np.cross(q, np.cross(q, cg) + q0 * cg)
    assert state[:3] - turned == pytest.approx(before[:3], abs=1e-12)
    np.testing.assert_array_equal(state[6:], before[6:])


def test_shifting_the_centre_of_gravity_aft_changes_the_stiffness_by_the_lift_slope_times_the_shift() -> None:
    """m_w is about the centre of gravity: it gains x cg Z_w / I_y, all else being of second order in the shift."""
    shift = 1e-4
    with_z = ModeStructure("z", ("w", "q"), ("eta",), ("z", "m"), "")
    clean = linearise(AEROSONDE, LEVEL, with_z)
    moved = linearise(AEROSONDE, LEVEL, with_z, (CgShift(shift),))
    mass, inertia = (parameter_row(AEROSONDE)[INDEX[name]] for name in ("mass_kg", "inertia_y"))
    wanted = -shift * mass * clean["z_w"] / inertia
    # the trim, and the airspeed that a rate makes at the reference point, change with the shift too: a few percent
    assert moved["m_w"] - clean["m_w"] == pytest.approx(wanted, rel=0.05)


def test_terms_of_a_wing_that_is_not_alike_left_and_right() -> None:
    alpha = 0.08
    values = {"CY_zero": 0.01, "Cl_zero": 0.02, "Cl_alpha": 0.3, "Cn_zero": -0.004, "Cn_alpha": 0.05}
    gained = coefficients(changed(**values), alpha) - coefficients(parameter_row(AEROSONDE), alpha)
    wanted = [0.0, 0.0, 0.01, 0.02 + 0.3 * alpha, 0.0, -0.004 + 0.05 * alpha]
    assert gained == pytest.approx(wanted, abs=1e-14)


def test_lift_and_moment_bend_about_the_reference_angle() -> None:
    alpha, reference = 0.1, 0.06
    row = changed(CL_alpha_square=3.0, Cm_alpha_square=-2.0, alpha_reference=reference)
    gained = coefficients(row, alpha) - coefficients(parameter_row(AEROSONDE), alpha)
    square = (alpha - reference) ** 2
    assert gained == pytest.approx([3.0 * square, 0.0, 0.0, 0.0, -2.0 * square, 0.0], abs=1e-14)


@pytest.mark.parametrize("degrees", [-3.0, 0.0, 4.0, 12.0])
def test_ice_adds_what_the_published_polynomials_say(degrees: float) -> None:
    de = -4.0
    lift = np.polyval([4.0859e-5, -0.0005459, 0.004836, 0.088449], degrees)
    drag = np.polyval([2.3384e-6, -4.7511e-5, -0.00046253, 0.001578, -0.0089], degrees)
    pitch = np.polyval([1.7594e-6, -4.0692e-5, 1.0205e-5, -0.0056476, -0.01892], degrees)
    elevator = np.polyval([-1.8439e-6, -1.1304e-5, 0.00039086, 0.0, -0.014928 - 0.0037783 * degrees], de)
    alpha, eta = math.radians(degrees), math.radians(de)
    at_reference = icing_increments(alpha, eta, 0.08, 0.20, 0.0)
    wanted = (-lift, -drag, 0.0, (0.75 * 0.08 + 0.25 * 0.20) / 0.08 * pitch + elevator, 0.0)
    assert at_reference == pytest.approx(wanted, rel=1e-12)
    row = changed(ice_wing=0.08, ice_tail=0.20)
    gained = coefficients(row, alpha, (eta, 0.0, 0.0)) - coefficients(
        parameter_row(AEROSONDE), alpha, (eta, 0.0, 0.0)
    )
    assert gained == pytest.approx([wanted[0], wanted[1], 0.0, 0.0, wanted[3], 0.0], abs=1e-13)


def test_severe_ice_takes_lift_more_slowly_and_is_held_beyond_its_polynomials() -> None:
    per_severity = icing_increments(0.1, 0.0, 0.08, 0.0, 0.0)[0] / 0.08
    more = icing_increments(0.1, 0.0, 0.3, 0.0, 0.0)[0]
    assert more == pytest.approx(per_severity * (0.3 - 0.3297 * math.exp(-1.5)), rel=1e-12)
    # the source's two laws for the lift meet at a severity of 0.1 to three digits
    below, above = (icing_increments(0.1, 0.0, 0.1 + d, 0.0, 0.0)[0] for d in (-1e-9, 1e-9))
    assert above == pytest.approx(below, rel=1e-3)
    for alpha, edge in ((0.5, 16.0), (-0.5, -5.0)):
        beyond = icing_increments(alpha, 0.0, 0.08, 0.20, 0.05)
        assert beyond == pytest.approx(icing_increments(math.radians(edge), 0.0, 0.08, 0.20, 0.05), rel=1e-12)


def test_ice_on_the_left_wing_alone_rolls_and_yaws_to_the_left() -> None:
    lift, drag, roll, _, yaw = icing_increments(0.1, 0.0, 0.04, 0.0, 0.08)
    assert lift < 0.0 < drag
    assert roll < 0.0
    assert yaw < 0.0
    # of the whole wing's increments at 0.04, the difference of 0.08 acts at an eighth of the span
    assert roll == pytest.approx(lift * 2.0 / 8.0, rel=1e-12)
    assert yaw == pytest.approx(-drag * 2.0 / 8.0, rel=1e-12)


def with_thrust(**values: object) -> Aircraft:
    return AEROSONDE.model_copy(
        update={"propulsion": ConstantThrust.model_validate({"kind": "constant_thrust", **values})}
    )


def test_constant_thrust_is_the_throttle_times_it_less_what_is_lost() -> None:
    row = parameter_row(with_thrust(thrust_max_n=40.0))
    assert thrust_n(row, 0.3, 25.0, 1.1) == thrust_n(row, 0.3, 5.0, 0.9) == pytest.approx(12.0, rel=1e-15)
    row[INDEX["thrust_share"]] = 0.75
    assert thrust_n(row, 0.3, 25.0, 1.1) == pytest.approx(9.0, rel=1e-15)


def test_a_propeller_that_brakes_brakes_on_when_thrust_is_lost() -> None:
    whole, half = parameter_row(AEROSONDE), changed(thrust_share=0.5)
    pulls, brakes = (thrust_n(whole, throttle, 25.0, 1.1) for throttle in (0.9, 0.2))
    assert brakes < 0.0 < pulls
    assert thrust_n(half, 0.9, 25.0, 1.1) == pytest.approx(0.5 * pulls, rel=1e-15)
    assert thrust_n(half, 0.2, 25.0, 1.1) == brakes


def test_thrust_below_the_centre_of_gravity_lifts_the_nose() -> None:
    row, below = parameter_row(with_thrust(thrust_max_n=40.0)), 0.12
    state = flying((0.0, 0.0, 0.0))
    before, _ = rates(row, state, (0.0, 0.0, 0.0), 0.5)
    row[INDEX["thrust_line_z_m"]] = below
    after, _ = rates(row, state, (0.0, 0.0, 0.0), 0.5)
    assert after[11] - before[11] == pytest.approx(20.0 * below / row[INDEX["inertia_y"]], rel=1e-9)
    assert after[[3, 5]] == pytest.approx(before[[3, 5]], rel=1e-12)


def test_the_slipstream_works_on_the_tail_by_momentum_theory() -> None:
    """Elevator moment by 1 + 2 T / (rho A V^2) of the part that is blown on, pitch damping by the root of it."""
    share, diameter, thrust = 0.6, 0.5, 30.0
    still = with_thrust(thrust_max_n=thrust, propeller_diameter_m=diameter)
    blown = with_thrust(thrust_max_n=thrust, propeller_diameter_m=diameter, slipstream_share=share)
    state = np.zeros(len(STATE))
    state[2], state[3], state[6] = -1000.0, SPEED, 1.0
    area = math.pi / 4.0 * diameter**2
    ratio = 1.0 + share * 2.0 * thrust / (air_density(1000.0) * area * SPEED**2)
    gains = []
    for aircraft in (still, blown):
        row = parameter_row(aircraft)
        level, up, rudder = (rates(row, state, s, 1.0)[0] for s in ((0, 0, 0), (0.1, 0, 0), (0, 0, 0.1)))
        turning = state.copy()
        turning[11] = 0.3
        spun, _ = rates(row, turning, (0.0, 0.0, 0.0), 1.0)
        gains.append((up[11] - level[11], rudder[4] - level[4], rudder[12] - level[12], spun[11] - level[11]))
    by_surface = [gains[1][i] / gains[0][i] for i in range(3)]
    assert by_surface == pytest.approx([ratio] * 3, rel=1e-9)
    assert gains[1][3] / gains[0][3] == pytest.approx(math.sqrt(ratio), rel=1e-9)
    idle = [rates(parameter_row(a), state, (0.0, 0.0, 0.0), 0.0)[0] for a in (still, blown)]
    np.testing.assert_array_equal(idle[0], idle[1])


@pytest.mark.parametrize("climb", [-0.05, 0.0, 0.04])
@pytest.mark.parametrize("bank", [-0.4, 0.0, 0.6])
@pytest.mark.parametrize("effects", [(), (CgShift(0.02),)], ids=["clean", "aft"])
def test_a_trim_is_steady_at_its_airspeed_climb_and_bank(
    climb: float, bank: float, effects: tuple[CgShift, ...]
) -> None:
    point = trim(AEROSONDE, FlightCondition(24.0, 600.0), climb, bank, effects, 1.0)
    assert point.residual < 1e-8
    assert np.linalg.norm(point.state[3:6]) == pytest.approx(24.0, rel=1e-12)
    row = base_row(AEROSONDE, FlightCondition(24.0, 600.0))
    if effects:
        row[INDEX["cg_x_m"]] = -0.02
    surfaces = (point.elevator_rad, point.aileron_rad, point.rudder_rad)
    out, _ = rates(row, point.state, surfaces, point.throttle)
    assert -out[2] == pytest.approx(24.0 * math.sin(climb), abs=1e-9)
    assert point.bank_rad == bank
    assert point.sideslip_rad == pytest.approx(0.0, abs=1e-12)
    assert (point.turn_rate_rad_s == 0.0) == (bank == 0.0)


def test_level_flight_of_an_aircraft_that_pulls_to_one_side_is_straight_with_sideslip() -> None:
    from wingwatch.simulation.trim import trim_row

    row = base_row(AEROSONDE, LEVEL)
    row[INDEX["Cl_zero"]], row[INDEX["Cn_zero"]] = 0.01, 0.003
    point = trim_row(AEROSONDE, LEVEL, row)
    assert point.turn_rate_rad_s == point.bank_rad == 0.0
    assert abs(point.sideslip_rad) > 1e-3
    assert point.aileron_rad != 0.0
    assert point.residual < 1e-8
    row[INDEX["rudder_stuck"]], row[INDEX["rudder_stuck_at"]] = 1.0, 0.0
    banked = trim_row(AEROSONDE, LEVEL, row)
    assert banked.rudder_rad == 0.0
    assert banked.bank_rad != 0.0
    assert banked.turn_rate_rad_s == 0.0


def test_a_banked_climb_is_linearised_where_it_is() -> None:
    """Angle of attack grows with the load, and with it what the lift's direction makes of the derivatives."""
    level = linearise(AEROSONDE, LEVEL, SHORT_PERIOD)
    steep = linearise(AEROSONDE, LEVEL, SHORT_PERIOD, climb_rad=0.03, bank_rad=0.6)
    point = trim(AEROSONDE, LEVEL, 0.03, 0.6)
    assert 1.15 < 1.0 / math.cos(point.bank_rad) < 1.25
    assert steep["m_eta"] == pytest.approx(level["m_eta"], rel=1e-3)
    assert steep["z_q"] == pytest.approx(
        level["z_q"] * math.cos(point.angle_of_attack_rad) / math.cos(0.0598), rel=2e-3
    )
    assert GRAVITY_M_S2 == 9.80665
