"""Every model structure: names, forms, reductions, and what is known of the matrices beforehand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wingwatch.aircraft import (
    DERIVATIVES,
    DUTCH_ROLL,
    DUTCH_ROLL_BETA,
    GRAVITY_M_S2,
    LATERAL,
    LATERAL_FULL,
    LONGITUDINAL,
    LONGITUDINAL_THROTTLE,
    MODEL_DERIVATIVES,
    MODEL_STRUCTURES,
    PHUGOID,
    ROLL,
    SHORT_PERIOD,
    SHORT_PERIOD_ALPHA,
    SPIRAL,
    STRUCTURES,
    Aircraft,
    AircraftDataError,
    ConstantThrust,
    Convention,
    FlightCondition,
    ModeStructure,
    TrimError,
    analysis_band_hz,
    change_form,
    convert,
    display_name,
    form_scale,
    known_terms,
    linearised_derivatives,
    load_aircraft,
    longitudinal_mass_matrix,
    parse_aircraft,
    propulsion_thrust_n,
    reduced,
    state_space,
    thrust_slopes,
    trim,
    trimmed,
    unit,
    unsteady_inertia,
)
from wingwatch.simulation import linearise
from wingwatch.simulation.dynamics import derivatives as simulated_rates
from wingwatch.simulation.dynamics import euler_angles, quaternion, thrust_n
from wingwatch.simulation.layout import parameter_row
from wingwatch.simulation.trim import trim as simulated_trim

AEROSONDE = load_aircraft("aerosonde")
ULTRASTICK = load_aircraft("ultrastick25e")  # alphadot terms, no [propulsion]
TWINOTTER = load_aircraft("twinotter")
FLOWN = [AEROSONDE, ULTRASTICK, TWINOTTER]
FORMS = [(SHORT_PERIOD, SHORT_PERIOD_ALPHA), (DUTCH_ROLL, DUTCH_ROLL_BETA)]


def cruise(aircraft: Aircraft) -> FlightCondition:
    assert aircraft.envelope is not None
    return trimmed(aircraft, aircraft.envelope.cruise)


def test_the_live_set_is_what_it_was_and_every_symbol_is_explained() -> None:
    assert list(STRUCTURES) == ["short_period", "dutch_roll", "lateral"]
    assert set(DERIVATIVES) == {s for x in STRUCTURES.values() for s in x.derivatives}
    used = {s for x in MODEL_STRUCTURES.values() for s in x.derivatives}
    assert used == set(MODEL_DERIVATIVES)
    assert all(MODEL_STRUCTURES[name] is structure for name, structure in STRUCTURES.items())
    for structure in MODEL_STRUCTURES.values():
        dynamic = len(structure.all_states) - ("psi" in structure.attitudes)
        assert 2 * len(structure.oscillations) + len(structure.subsidences) in (dynamic, 0)
        assert len(structure.equations) == len(structure.states)


@pytest.mark.parametrize("structure", MODEL_STRUCTURES.values(), ids=lambda s: s.name)
def test_the_names_of_a_structure_are_unlike_in_every_convention(structure: ModeStructure) -> None:
    for convention in Convention:
        names = [display_name(s, convention) for s in structure.derivatives]
        assert len(set(names)) == len(names)
        assert all(isinstance(unit(s, convention), str) for s in structure.derivatives)


def test_thesis_3_17_and_3_18_row_by_row() -> None:
    """Gravity and kinematics of both full motions at Theta = alpha."""
    condition = FlightCondition(25.0, 1000.0, angle_of_attack_rad=0.06)
    cos, sin = GRAVITY_M_S2 * math.cos(0.06), GRAVITY_M_S2 * math.sin(0.06)
    a, b = state_space(LONGITUDINAL, dict.fromkeys(LONGITUDINAL.derivatives, 2.0), condition)
    expected: list[list[float]] = [[2, 2, 2, -cos], [2, 2, 2, -sin], [2, 2, 2, 0], [0, 0, 1, 0]]
    np.testing.assert_allclose(a, expected)
    np.testing.assert_array_equal(b, [[2], [2], [2], [0]])
    a, b = state_space(LATERAL_FULL, dict.fromkeys(LATERAL_FULL.derivatives, 2.0), condition)
    expected = [
        [2, 2, 2, cos, 0],
        [2, 2, 2, 0, 0],
        [2, 2, 2, 0, 0],
        [0, 1, math.tan(0.06), 0, 0],
        [0, 0, 1 / math.cos(0.06), 0, 0],
    ]
    np.testing.assert_allclose(a, expected)
    np.testing.assert_array_equal(b, [[2, 2], [2, 2], [2, 2], [0, 0], [0, 0]])
    level = known_terms(LATERAL_FULL, condition, climb_rad=-0.06).matrix
    assert level[3, 2] == 0.0  # Theta = 0: the thesis's own kinematics
    assert level[4, 2] == 1.0


def test_the_thesis_lateral_kinematics_are_the_same_system() -> None:
    """3.18 in integrals of p and r with y_psi = g sin(Theta): phi = phi' + psi' tan(Theta), psi = psi' / cos."""
    condition = cruise(AEROSONDE)
    pitch = condition.angle_of_attack_rad
    values = linearised_derivatives(AEROSONDE, condition, LATERAL_FULL)
    ours, _ = state_space(LATERAL_FULL, values, condition)
    theirs = ours.copy()
    theirs[0, 3:] = GRAVITY_M_S2 * math.cos(pitch), GRAVITY_M_S2 * math.sin(pitch)
    theirs[3], theirs[4] = [0, 1, 0, 0, 0], [0, 0, 1, 0, 0]
    change = np.eye(5)
    change[3, 4], change[4, 4] = math.tan(pitch), 1.0 / math.cos(pitch)
    np.testing.assert_allclose(ours @ change, change @ theirs, atol=1e-12)


@settings(deadline=None)
@given(
    st.sampled_from(FORMS),
    st.lists(st.floats(-1e3, 1e3), min_size=6, max_size=6),
    st.floats(5.0, 100.0),
    st.floats(-0.3, 0.5),
)
def test_velocity_and_angle_forms_are_one_system(
    forms: tuple[ModeStructure, ModeStructure], numbers: list[float], speed: float, alpha: float
) -> None:
    plain, angle = forms
    condition = FlightCondition(speed, 0.0, angle_of_attack_rad=alpha)
    values = dict(zip(plain.derivatives, numbers, strict=True))
    turned = change_form(values, plain, angle, condition)
    back = change_form(turned, angle, plain, condition)
    assert back == pytest.approx(values, rel=1e-14)
    a, b = state_space(plain, values)
    other, b_other = state_space(angle, turned, condition)
    per_rad = form_scale(plain, angle, condition)[0]
    change = np.diag([per_rad, 1.0])  # (w, q) = change (alpha, q)
    # atol: numbers at the very end of the floating point have no relative rounding
    np.testing.assert_allclose(change @ other, a @ change, rtol=1e-13, atol=1e-300)
    np.testing.assert_allclose(change @ b_other, b, rtol=1e-13, atol=1e-300)


def test_a_radian_of_angle_is_what_the_definition_of_alpha_and_beta_says() -> None:
    condition = FlightCondition(25.0, 1000.0, angle_of_attack_rad=0.2)
    u, w, h = condition.forward_velocity_m_s, condition.normal_velocity_m_s, 1e-6
    by_w = (math.atan2(w + h, u) - math.atan2(w - h, u)) / (2.0 * h)
    by_v = (math.asin(h / math.hypot(u, w, h)) - math.asin(-h / math.hypot(u, w, h))) / (2.0 * h)
    # truncation (h/V)^2 ~ 2e-15, rounding 1e-16/1e-6
    assert 1.0 / form_scale(SHORT_PERIOD, SHORT_PERIOD_ALPHA, condition)[0] == pytest.approx(by_w, rel=1e-8)
    assert 1.0 / form_scale(DUTCH_ROLL, DUTCH_ROLL_BETA, condition)[0] == pytest.approx(by_v, rel=1e-8)


def test_requests_without_sense_are_refused_in_a_sentence() -> None:
    condition = FlightCondition(25.0, 1000.0)
    for structure in (LONGITUDINAL, LATERAL_FULL, SHORT_PERIOD_ALPHA):
        with pytest.raises(ValueError, match=f"matrices of {structure.name} depend on .* give the flight"):
            state_space(structure, dict.fromkeys(structure.derivatives, 1.0))
    with pytest.raises(ValueError, match="short_period is no form of dutch_roll_beta"):
        form_scale(SHORT_PERIOD, DUTCH_ROLL_BETA, condition)
    with pytest.raises(ValueError, match="lateral is no form or reduction"):
        reduced({}, LATERAL, condition)
    with pytest.raises(
        AircraftDataError, match=r"ultrastick25e states no \[propulsion\], which derivatives by"
    ):
        linearised_derivatives(ULTRASTICK, cruise(ULTRASTICK), LONGITUDINAL_THROTTLE)
    with pytest.raises(TrimError, match=r"needs a thrust of .* which no throttle of 0 to 1 gives"):
        linearised_derivatives(AEROSONDE, FlightCondition(35.0, 1000.0), LONGITUDINAL)
    with pytest.raises(ValueError, match=r"spiral has no meaning in a bank of 0\.3 rad"):
        linearise(AEROSONDE, condition, SPIRAL, bank_rad=0.3)


# -- paper against flight --------------------------------------------------------------------------

NEW = [s for n, s in MODEL_STRUCTURES.items() if n not in STRUCTURES]


@pytest.mark.parametrize("aircraft", FLOWN, ids=lambda a: a.name)
@pytest.mark.parametrize("structure", NEW, ids=lambda s: s.name)
def test_what_is_flown_has_the_derivatives_of_the_paper(aircraft: Aircraft, structure: ModeStructure) -> None:
    if structure is LONGITUDINAL_THROTTLE and aircraft is ULTRASTICK:
        assert aircraft.propulsion is None  # refused on paper, see above
        return
    condition = cruise(aircraft)
    if (
        structure is SHORT_PERIOD_ALPHA
    ):  # without what the short period leaves out: elevator drag, alphadot by du/dt
        c = (
            aircraft.need_coefficients("the test")
            .with_value("CD_elevator", 0.0)
            .with_value("CL_alphadot", 0.0)
        )
        aircraft = aircraft.model_copy(update={"coefficients": c})
    paper = linearised_derivatives(aircraft, condition, structure)
    flown = linearise(aircraft, condition, structure)
    assert tuple(paper) == tuple(flown) == structure.derivatives
    # central differences: (step / airspeed)^2 / 6 = 6e-10 of curvature with a factor of a few, and the rounding of
    # 10 m/s2 over a step of 1e-5; a radian of alpha is V metres a second
    size = condition.airspeed_true_m_s if "alpha" in structure.states or "beta" in structure.states else 1.0
    for symbol, value in paper.items():
        assert flown[symbol] == pytest.approx(value, rel=1e-8, abs=1e-8 * size), symbol


def six_degrees(aircraft: Aircraft, condition: FlightCondition) -> np.ndarray:
    """d(u v w p q r phi theta)/dt by differences of the simulated flight, attitude rates from its quaternion."""
    point = simulated_trim(aircraft, condition)
    row, force, out = parameter_row(aircraft), np.empty(3), np.empty(13)

    def rates(x: np.ndarray) -> np.ndarray:
        state = point.state.copy()
        state[3:6], state[10:13] = x[:3], x[3:6]
        state[6:10] = quaternion(x[6], x[7], 0.0)
        simulated_rates(state, point.surfaces_rad, point.throttle, row, force, out)
        ahead, behind = state.copy(), state.copy()
        ahead[6:10] += 1e-6 * out[6:10]
        behind[6:10] -= 1e-6 * out[6:10]
        turned = (np.array(euler_angles(ahead)) - np.array(euler_angles(behind))) / 2e-6
        return np.concatenate((out[3:6], out[10:13], turned[:2]))

    at = np.concatenate((point.state[3:6], point.state[10:13], [0.0, point.pitch_rad]))
    columns = []
    for j in range(8):
        step = np.zeros(8)
        step[j] = 1e-4
        columns.append((rates(at + step) - rates(at - step)) / 2e-4)
    return np.array(columns).T


@pytest.mark.parametrize("aircraft", FLOWN, ids=lambda a: a.name)
def test_full_motions_are_the_numerical_linearisation_attitudes_included(aircraft: Aircraft) -> None:
    condition = cruise(aircraft)
    numeric = six_degrees(aircraft, condition)
    places = {"u": 0, "v": 1, "w": 2, "p": 3, "q": 4, "r": 5, "phi": 6, "theta": 7}
    for structure in (LONGITUDINAL, LATERAL_FULL):
        values = linearised_derivatives(aircraft, condition, structure)
        a, _ = state_space(structure, values, condition, aircraft)
        kept = [places[s] for s in structure.all_states if s != "psi"]
        n = len(kept)
        # rounding of attitude rates: 1e-16 / 1e-6 over a step of 1e-4 = 1e-6; differences of forces 1e-11
        np.testing.assert_allclose(a[:n, :n], numeric[np.ix_(kept, kept)], rtol=1e-6, atol=3e-6)


def roots_of(aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure) -> np.ndarray:
    values = linearised_derivatives(aircraft, condition, structure)
    roots = np.linalg.eigvals(state_space(structure, values, condition, aircraft)[0])
    return roots[roots.imag >= 0.0]


@pytest.mark.parametrize("aircraft", FLOWN, ids=lambda a: a.name)
def test_reduced_modes_lie_next_to_their_own_root_of_the_full_motion(aircraft: Aircraft) -> None:
    condition = cruise(aircraft)
    full = sorted(roots_of(aircraft, condition, LONGITUDINAL), key=abs)
    phugoid, short = (roots_of(aircraft, condition, s)[0] for s in (PHUGOID, SHORT_PERIOD))
    assert [min(full, key=lambda r, x=x: abs(r - x)) for x in (phugoid, short)] == full  # type: ignore[misc]
    # the short period holds the slow motion still: what it leaves out is of the order of slow over fast
    assert abs(short - full[1]) < abs(full[0] / full[1]) * abs(full[1])
    full = sorted(roots_of(aircraft, condition, LATERAL_FULL), key=abs)[1:]  # without heading
    spiral, dutch, roll = (roots_of(aircraft, condition, s)[0] for s in (SPIRAL, DUTCH_ROLL, ROLL))
    assert [min(full, key=lambda r, x=x: abs(r - x)) for x in (spiral, dutch, roll)] == full  # type: ignore[misc]


@pytest.mark.parametrize("aircraft", FLOWN, ids=lambda a: a.name)
@pytest.mark.parametrize(("structure", "full"), [(PHUGOID, LONGITUDINAL), (SPIRAL, LATERAL_FULL)])
def test_what_a_reduction_neglects_is_the_next_term_of_its_series(
    aircraft: Aircraft, structure: ModeStructure, full: ModeStructure
) -> None:
    """Fast states follow with a lag: (1 + A_kf A_ff^-2 A_fk) dx/dt = A_reduced x is the next approximation
    (Kokotovic, Khalil, O'Reilly, Singular Perturbation Methods in Control, section 2.2)."""
    condition = cruise(aircraft)
    a, _ = state_space(full, linearised_derivatives(aircraft, condition, full), condition, aircraft)
    kept = [full.all_states.index(s) for s in structure.states]
    fast = [i for i, s in enumerate(full.all_states) if s not in (*structure.states, "psi")]
    inverse = np.linalg.inv(a[np.ix_(fast, fast)])
    near, far = a[np.ix_(kept, fast)], a[np.ix_(fast, kept)]
    none = a[np.ix_(kept, kept)] - near @ inverse @ far
    first = np.linalg.solve(np.eye(len(kept)) + near @ inverse @ inverse @ far, none)
    exact = min((r for r in roots_of(aircraft, condition, full) if abs(r) > 1e-9), key=abs)
    zeroth, better = (max(np.linalg.eigvals(m), key=lambda r: r.imag) for m in (none, first))
    assert roots_of(aircraft, condition, structure)[0] == pytest.approx(zeroth, rel=1e-10)
    assert abs(better - exact) < abs(better - zeroth)


def test_the_thesis_printed_frequencies_are_those_of_the_full_motions() -> None:
    """Tables 7.2 and 7.7 print 11.373 and 0.4473, 5.977 and 0.2139; its variant of the aircraft, full motions."""
    aircraft = load_aircraft("aerosonde-a")
    condition = trimmed(aircraft, FlightCondition(25.0, 1000.0))
    for structure, frequency, damping in ((LONGITUDINAL, 11.373, 0.4473), (LATERAL_FULL, 5.977, 0.2139)):
        values = linearised_derivatives(aircraft, condition, structure)
        roots = np.linalg.eigvals(state_space(structure, values, condition, aircraft)[0])
        root = max((r for r in roots if r.imag > 0.0), key=abs)
        # the variant's derivatives are the printed ones to 0.5 %, a frequency is half of that
        assert abs(root) == pytest.approx(frequency, rel=2.5e-3)
        assert -root.real / abs(root) == pytest.approx(damping, rel=5e-3)


def test_the_phugoid_is_the_quasi_steady_solution_by_hand() -> None:
    """Two equations solved by Cramer's rule, Cook's form: w and q at balance under u, theta, eta."""
    condition = cruise(TWINOTTER)
    d = linearised_derivatives(TWINOTTER, condition, LONGITUDINAL)
    got = linearised_derivatives(TWINOTTER, condition, PHUGOID)
    z_theta = -GRAVITY_M_S2 * math.sin(condition.angle_of_attack_rad)
    determinant = d["z_w"] * d["m_q"] - d["z_q"] * d["m_w"]
    for index, z, m in (
        ("u", d["z_u"], d["m_u"]),
        ("theta", z_theta, 0.0),
        ("eta", d["z_eta"], d["m_eta"]),
    ):
        w = (-z * d["m_q"] + m * d["z_q"]) / determinant
        q = (-m * d["z_w"] + z * d["m_w"]) / determinant
        direct = d.get(f"x_{index}", -GRAVITY_M_S2 * math.cos(condition.angle_of_attack_rad))
        assert got[f"theta_{index}"] == pytest.approx(q, rel=1e-12)
        assert got[f"x_{index}"] == pytest.approx(direct + d["x_w"] * w + d["x_q"] * q, rel=1e-12)


# -- thrust ----------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=50)
@given(
    st.sampled_from([AEROSONDE, TWINOTTER]), st.floats(0.0, 1.0), st.floats(5.0, 80.0), st.floats(0.4, 1.3)
)
def test_thrust_on_paper_is_the_thrust_that_is_flown(
    aircraft: Aircraft, throttle: float, speed: float, density: float
) -> None:
    assert aircraft.propulsion is not None
    flown = thrust_n(parameter_row(aircraft), throttle, speed, density)
    paper = propulsion_thrust_n(aircraft.propulsion, throttle, speed, density)
    scale = density * speed**2 * 0.2 + 1.0  # forces of J^2 and of J^0 cancel near the windmill
    assert paper == pytest.approx(flown, rel=1e-11, abs=1e-13 * scale)


def test_thrust_slopes_are_differences_of_thrust() -> None:
    assert AEROSONDE.propulsion is not None
    condition = cruise(AEROSONDE)
    speed, density, wanted = (
        condition.airspeed_true_m_s,
        condition.air_density_kg_m3,
        trim(AEROSONDE, condition).thrust_n,
    )
    found = thrust_slopes(AEROSONDE.propulsion, wanted, speed, density)
    assert found is not None

    def thrust(throttle: float, v: float) -> float:
        assert AEROSONDE.propulsion is not None
        return float(propulsion_thrust_n(AEROSONDE.propulsion, throttle, v, density).real)

    h = 1e-5
    assert thrust(found.throttle, speed) == pytest.approx(wanted, rel=1e-12)
    by_speed = (thrust(found.throttle, speed + h) - thrust(found.throttle, speed - h)) / (2.0 * h)
    by_throttle = (thrust(found.throttle + h, speed) - thrust(found.throttle - h, speed)) / (2.0 * h)
    # rounding 1e-15 * 10 N / 1e-5
    assert found.by_airspeed == pytest.approx(by_speed, rel=1e-8)
    assert found.by_throttle == pytest.approx(by_throttle, rel=1e-8)
    assert found.by_airspeed < 0.0 < found.by_throttle
    assert thrust_slopes(AEROSONDE.propulsion, 1e4, speed, density) is None


def test_a_thrust_line_off_the_centre_gives_pitch() -> None:
    """m_tau = z T_max / I_y, and an electric propeller's slope by airspeed reaches m_u and m_w."""
    assert TWINOTTER.propulsion is not None
    below = TWINOTTER.model_copy(
        update={"propulsion": TWINOTTER.propulsion.model_copy(update={"thrust_line_z_m": 0.5})}
    )
    condition = cruise(TWINOTTER)
    assert isinstance(TWINOTTER.propulsion, ConstantThrust)
    got = linearised_derivatives(below, condition, LONGITUDINAL_THROTTLE)
    mass = below.need_mass("the test")
    assert got["m_tau"] == pytest.approx(0.5 * TWINOTTER.propulsion.thrust_max_n / mass.inertia_y_kg_m2)
    assert got["x_tau"] == pytest.approx(TWINOTTER.propulsion.thrust_max_n / mass.mass_kg)
    assert AEROSONDE.propulsion is not None
    electric = AEROSONDE.model_copy(
        update={"propulsion": AEROSONDE.propulsion.model_copy(update={"thrust_line_z_m": 0.1})}
    )
    at = cruise(AEROSONDE)
    plain = linearised_derivatives(AEROSONDE, at, LONGITUDINAL)
    moved = linearised_derivatives(electric, at, LONGITUDINAL)
    slopes = thrust_slopes(AEROSONDE.propulsion, trim(AEROSONDE, at).thrust_n, 25.0, at.air_density_kg_m3)
    assert slopes is not None
    per = 0.1 * slopes.by_airspeed / AEROSONDE.need_mass("the test").inertia_y_kg_m2
    assert moved["m_u"] - plain["m_u"] == pytest.approx(per * math.cos(at.angle_of_attack_rad))
    assert moved["m_w"] - plain["m_w"] == pytest.approx(per * math.sin(at.angle_of_attack_rad))


# -- conventions -----------------------------------------------------------------------------------


@settings(deadline=None)
@given(
    st.sampled_from([AEROSONDE, ULTRASTICK]),
    st.sampled_from(list(MODEL_STRUCTURES.values())),
    st.sampled_from(list(Convention)),
    st.floats(5.0, 100.0),
    st.floats(-0.3, 0.5),
)
def test_every_structure_returns_from_every_convention(
    aircraft: Aircraft, structure: ModeStructure, there: Convention, speed: float, alpha: float
) -> None:
    condition = FlightCondition(speed, 500.0, angle_of_attack_rad=alpha)
    values = {s: 1.0 + 0.5 * i for i, s in enumerate(structure.derivatives)}
    one = convert(
        values,
        aircraft=aircraft,
        condition=condition,
        structure=structure,
        source=Convention.CONCISE,
        target=there,
    )
    back = convert(
        one,
        aircraft=aircraft,
        condition=condition,
        structure=structure,
        source=there,
        target=Convention.CONCISE,
    )
    # the kinematic U or W, 100 m/s, is taken out and put back: its rounding, through the mass matrix
    assert back == pytest.approx(values, rel=1e-12, abs=1e-12)


def test_full_longitudinal_conversion_is_the_mass_matrix() -> None:
    for aircraft in (AEROSONDE, ULTRASTICK):
        condition = cruise(aircraft)
        matrix = longitudinal_mass_matrix(aircraft, condition)
        z_wdot, m_wdot = unsteady_inertia(aircraft, condition)
        mass = aircraft.need_mass("the test")
        assert matrix[1, 1] == mass.mass_kg - z_wdot
        assert (matrix[2, 1], matrix[2, 2]) == (-m_wdot, mass.inertia_y_kg_m2)
        concise = linearised_derivatives(aircraft, condition, LONGITUDINAL)
        dimensional = convert(
            concise,
            aircraft=aircraft,
            condition=condition,
            structure=LONGITUDINAL,
            source=Convention.CONCISE,
            target=Convention.DIMENSIONAL,
        )
        rows = np.array(list(concise.values())).reshape(3, 4)
        force = matrix @ rows
        force[0, 2] += mass.mass_kg * condition.normal_velocity_m_s
        force[1, 2] -= mass.mass_kg * condition.forward_velocity_m_s
        np.testing.assert_allclose(list(dimensional.values()), force.ravel(), rtol=1e-12, atol=1e-9)


def test_non_dimensional_forms_do_not_hang_on_the_condition() -> None:
    """The American form gives the coefficients back: CX_u, CZ_alpha by alpha, CY_beta, Cl_p."""
    c = TWINOTTER.need_coefficients("the test")
    condition = cruise(TWINOTTER)

    def american(structure: ModeStructure) -> dict[str, float]:
        return convert(
            linearised_derivatives(TWINOTTER, condition, structure),
            aircraft=TWINOTTER,
            condition=condition,
            structure=structure,
            source=Convention.CONCISE,
            target=Convention.AMERICAN,
        )

    at = trim(TWINOTTER, condition)
    lift, drag, alpha = at.lift_coefficient, at.drag_coefficient, at.angle_of_attack_rad
    slope = 2.0 * c.CL.alpha * (c.CL.zero + c.CL.alpha * alpha - c.CD.CL_at_min)
    geometry = TWINOTTER.need_geometry("the test")
    drag_slope = slope / (math.pi * c.CD.oswald * geometry.span_m**2 / geometry.wing_area_m2)
    cos, sin = math.cos(alpha), math.sin(alpha)
    cx, cz = -drag * cos + lift * sin, -drag * sin - lift * cos
    cx_alpha = -drag_slope * cos + drag * sin + c.CL.alpha * sin + lift * cos
    got = american(LONGITUDINAL)  # its thrust is constant
    assert got["x_u"] == pytest.approx(2.0 * cos * cx - sin * cx_alpha, rel=1e-9)
    assert got["x_w"] == pytest.approx(cos * cx_alpha + 2.0 * sin * cx, rel=1e-9)
    cz_alpha = -drag_slope * sin - drag * cos - c.CL.alpha * cos + lift * sin
    assert american(SHORT_PERIOD_ALPHA)["z_alpha"] == pytest.approx(cz_alpha + 2.0 * sin / cos * cz, rel=1e-9)
    assert american(DUTCH_ROLL_BETA)["y_beta"] == pytest.approx(american(DUTCH_ROLL)["y_v"], rel=1e-12)
    throttled = american(LONGITUDINAL_THROTTLE)
    assert isinstance(TWINOTTER.propulsion, ConstantThrust)
    force = condition.dynamic_pressure_pa * geometry.wing_area_m2
    assert throttled["x_tau"] == pytest.approx(TWINOTTER.propulsion.thrust_max_n / force)
    assert [unit("theta_u", x) for x in Convention] == ["1/m", "1/m", "", ""]
    assert [unit("z_alpha", x) for x in Convention] == ["m/s2", "N", "", ""]


def test_an_aircraft_file_may_state_any_structure() -> None:
    text = """
format = 1
name = "glider"
[modes.phugoid]
band_hz = [0.02, 0.2]
[[conditions]]
airspeed_true_m_s = 20.0
altitude_m = 500.0
provenance = "identified"
[conditions.derivatives]
l_p = { value = -10.0, standard_error = 1.0 }
l_xi = { value = -50.0, standard_error = 2.0 }
"""
    glider = parse_aircraft(text.encode(), "glider.toml")
    assert analysis_band_hz(glider, PHUGOID) == (0.02, 0.2)
    low, high = analysis_band_hz(glider, ROLL)  # one root of 10 rad/s
    assert (low, high) == pytest.approx((0.055 * 10.0 / (2.0 * math.pi), 2.2 * 10.0 / (2.0 * math.pi)))


def test_bands_of_full_motions_reach_from_the_slow_oscillation_to_the_fast_root() -> None:
    condition = cruise(AEROSONDE)
    values = linearised_derivatives(AEROSONDE, condition, LONGITUDINAL)
    roots = np.abs(np.linalg.eigvals(state_space(LONGITUDINAL, values, condition)[0])) / (2.0 * math.pi)
    assert analysis_band_hz(AEROSONDE, LONGITUDINAL) == pytest.approx(
        (0.055 * roots.min(), 2.2 * roots.max())
    )
