import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wingwatch.aircraft import (
    DERIVATIVES,
    DUTCH_ROLL,
    LATERAL,
    SHORT_PERIOD,
    STRUCTURES,
    AircraftDataError,
    Convention,
    FlightCondition,
    ModeStructure,
    affine,
    convert,
    convert_standard_errors,
    display_name,
    load_aircraft,
    unit,
    unsteady_inertia,
)

AEROSONDE = load_aircraft("aerosonde")
ULTRASTICK = load_aircraft("ultrastick25e")  # has alphadot terms
CONDITION = FlightCondition(25.0, 1000.0, angle_of_attack_rad=0.06)

aircraft_s = st.sampled_from([AEROSONDE, ULTRASTICK])
structures = st.sampled_from(list(STRUCTURES.values()))
conventions = st.sampled_from(list(Convention))
conditions = st.builds(
    FlightCondition,
    airspeed_true_m_s=st.floats(5.0, 100.0),
    altitude_m=st.floats(0.0, 10000.0),
    angle_of_attack_rad=st.floats(-0.3, 0.5),
)


def values_of(structure: ModeStructure, numbers: list[float]) -> dict[str, float]:
    return dict(zip(structure.derivatives, numbers, strict=False))


numbers = st.lists(st.floats(-1e3, 1e3), min_size=15, max_size=15)


@settings(deadline=None)
@given(aircraft_s, structures, conditions, conventions, conventions, numbers)
def test_round_trips_return_the_values(aircraft, structure, condition, first, second, given_numbers) -> None:  # type: ignore[no-untyped-def]
    values = values_of(structure, given_numbers)
    there = convert(
        values, aircraft=aircraft, condition=condition, structure=structure, source=first, target=second
    )
    back = convert(
        there, aircraft=aircraft, condition=condition, structure=structure, source=second, target=first
    )
    scale, _ = affine(structure, aircraft, condition, second)
    from_scale, _ = affine(structure, aircraft, condition, first)
    # Rounding of the largest number on the way (a kinematic U or a coupled neighbour, through the ratio of
    # the scales); 40 operations of half an ulp each.
    largest = 1e3 + condition.airspeed_true_m_s / float(np.min(from_scale)) + 1.0
    largest *= max(1.0, float(np.max(from_scale) / np.min(from_scale)))
    for symbol, value in values.items():
        assert back[symbol] == pytest.approx(value, rel=1e-12, abs=40 * 1.2e-16 * largest)
    assert scale.shape == (len(structure.derivatives),)


def test_concise_is_the_mass_matrix_inverse_times_the_dimensional_derivatives() -> None:
    """Thesis B.8 to B.13 solved as matrices, for the lateral with Ixz and the longitudinal with alphadot."""
    rng = np.random.default_rng(1)
    for aircraft in (AEROSONDE, ULTRASTICK):
        mass = aircraft.need_mass("the test")
        m, u, w = mass.mass_kg, CONDITION.forward_velocity_m_s, CONDITION.normal_velocity_m_s
        lateral = np.array(
            [
                [m, 0.0, 0.0],
                [0.0, mass.inertia_x_kg_m2, -mass.inertia_xz_kg_m2],
                [0.0, -mass.inertia_xz_kg_m2, mass.inertia_z_kg_m2],
            ]
        )
        z_wdot, m_wdot = unsteady_inertia(aircraft, CONDITION)
        longitudinal = np.array([[m - z_wdot, 0.0], [-m_wdot, mass.inertia_y_kg_m2]])
        for structure, matrix, kinematic in (
            (LATERAL, lateral, {(0, 1): m * w, (0, 2): -m * u}),
            (SHORT_PERIOD, longitudinal, {(0, 1): m * u}),
        ):
            dimensional = rng.normal(size=(len(structure.equations), len(structure.regressors)))
            right = dimensional.copy()
            for place, value in kinematic.items():
                right[place] += value
            expected = np.linalg.solve(matrix, right)
            got = convert(
                values_of(structure, dimensional.ravel().tolist()),
                aircraft=aircraft,
                condition=CONDITION,
                structure=structure,
                source=Convention.DIMENSIONAL,
                target=Convention.CONCISE,
            )
            np.testing.assert_allclose(list(got.values()), expected.ravel(), rtol=1e-12, atol=1e-12)


def test_multipliers_are_those_of_table_b3_with_its_misprint_corrected() -> None:
    """Table B.3 by hand; Y_zeta carries 1/2 rho V^2 S, not the printed 1/2 rho V S b."""
    g = AEROSONDE.need_geometry("the test")
    half, v, s = 0.5 * CONDITION.air_density_kg_m3, CONDITION.airspeed_true_m_s, g.wing_area_m2
    b, c = g.span_m, g.mean_chord_m
    table = {
        "z_w": half * v * s,
        "z_q": half * v * s * c,
        "z_eta": half * v**2 * s,
        "m_w": half * v * s * c,
        "m_q": half * v * s * c**2,
        "m_eta": half * v**2 * s * c,
        "y_v": half * v * s,
        "y_p": half * v * s * b,
        "y_r": half * v * s * b,
        "y_xi": half * v**2 * s,
        "y_zeta": half * v**2 * s,
        "l_v": half * v * s * b,
        "l_p": half * v * s * b**2,
        "l_r": half * v * s * b**2,
        "l_xi": half * v**2 * s * b,
        "l_zeta": half * v**2 * s * b,
        "n_v": half * v * s * b,
        "n_p": half * v * s * b**2,
        "n_r": half * v * s * b**2,
        "n_xi": half * v**2 * s * b,
        "n_zeta": half * v**2 * s * b,
    }
    for structure in (SHORT_PERIOD, LATERAL):
        ones = dict.fromkeys(structure.derivatives, 1.0)
        dimensional = convert(
            ones,
            aircraft=AEROSONDE,
            condition=CONDITION,
            structure=structure,
            source=Convention.BRITISH,
            target=Convention.DIMENSIONAL,
        )
        for symbol, value in dimensional.items():
            assert value == pytest.approx(table[symbol], rel=1e-14), symbol
        american = convert(
            ones,
            aircraft=AEROSONDE,
            condition=CONDITION,
            structure=structure,
            source=Convention.BRITISH,
            target=Convention.AMERICAN,
        )
        for symbol, value in american.items():  # table B.5: rates double, the rest stays
            assert value == pytest.approx(2.0 if symbol[2:] in ("p", "q", "r") else 1.0, rel=1e-14), symbol


def test_affine_is_the_conversion_of_one_derivative_where_nothing_is_coupled() -> None:
    no_coupling = AEROSONDE.model_copy(
        update={"mass": AEROSONDE.need_mass("the test").model_copy(update={"inertia_xz_kg_m2": 0.0})}
    )
    rng = np.random.default_rng(2)
    for structure in STRUCTURES.values():
        for target in Convention:
            concise = rng.normal(size=len(structure.derivatives)) * 10.0
            scale, offset = affine(structure, no_coupling, CONDITION, target)
            converted = convert(
                values_of(structure, concise.tolist()),
                aircraft=no_coupling,
                condition=CONDITION,
                structure=structure,
                source=Convention.CONCISE,
                target=target,
            )
            np.testing.assert_allclose((concise - offset) / scale, list(converted.values()), rtol=1e-11)


def test_affine_gives_the_primed_coefficient_where_roll_and_yaw_are_coupled() -> None:
    mass = AEROSONDE.need_mass("the test")
    i_x, i_z, i_xz = mass.inertia_x_kg_m2, mass.inertia_z_kg_m2, mass.inertia_xz_kg_m2
    american = values_of(LATERAL, np.random.default_rng(3).normal(size=15).tolist())
    concise = convert(
        american,
        aircraft=AEROSONDE,
        condition=CONDITION,
        structure=LATERAL,
        source=Convention.AMERICAN,
        target=Convention.CONCISE,
    )
    scale, offset = affine(LATERAL, AEROSONDE, CONDITION)
    effective = dict(
        zip(LATERAL.derivatives, (np.array(list(concise.values())) - offset) / scale, strict=True)
    )
    determinant = i_x * i_z - i_xz**2
    for index in LATERAL.regressors:
        roll, yaw = american[f"l_{index}"], american[f"n_{index}"]
        assert effective[f"n_{index}"] == pytest.approx(i_z * (i_x * yaw + i_xz * roll) / determinant)
        assert effective[f"l_{index}"] == pytest.approx(i_x * (i_z * roll + i_xz * yaw) / determinant)
        assert effective[f"y_{index}"] == pytest.approx(american[f"y_{index}"])


def test_the_effective_coefficient_carries_over_the_envelope() -> None:
    """One non-dimensional set, two flight conditions: concise changes, effective does not."""
    american = {"z_w": -5.6, "z_q": -8.0, "z_eta": -0.13, "m_w": -2.7, "m_q": -38.0, "m_eta": -1.0}
    for condition in (FlightCondition(20.0, 0.0), FlightCondition(35.0, 3000.0, angle_of_attack_rad=0.1)):
        scale, offset = affine(SHORT_PERIOD, AEROSONDE, condition)
        concise = scale * np.array(list(american.values())) + offset
        assert concise[1] == pytest.approx(condition.forward_velocity_m_s, rel=0.05)  # z_q is nearly U
        back = convert(
            values_of(SHORT_PERIOD, concise.tolist()),
            aircraft=AEROSONDE,
            condition=condition,
            structure=SHORT_PERIOD,
            source=Convention.CONCISE,
            target=Convention.AMERICAN,
        )
        assert back == pytest.approx(american)


def test_the_dutch_roll_alone_keeps_effective_yaw_moments() -> None:
    concise = values_of(DUTCH_ROLL, [-0.6, -25.0, 3.5, 0.7, -1.0, -22.0])
    scale, offset = affine(DUTCH_ROLL, AEROSONDE, CONDITION)
    american = convert(
        concise,
        aircraft=AEROSONDE,
        condition=CONDITION,
        structure=DUTCH_ROLL,
        source=Convention.CONCISE,
        target=Convention.AMERICAN,
    )
    np.testing.assert_allclose(list(american.values()), (np.array(list(concise.values())) - offset) / scale)


def test_one_unknown_value_does_not_spoil_the_others() -> None:
    values = dict.fromkeys(LATERAL.derivatives, 1.0) | {"l_v": math.nan}
    american = convert(
        values,
        aircraft=AEROSONDE,
        condition=CONDITION,
        structure=LATERAL,
        source=Convention.CONCISE,
        target=Convention.AMERICAN,
    )
    assert {s for s, v in american.items() if math.isnan(v)} == {"l_v", "n_v"}  # coupled through Ixz


def test_standard_errors_scale_and_couple() -> None:
    errors = dict.fromkeys(LATERAL.derivatives, 0.0) | {"y_v": 0.1, "l_v": 3.0, "n_v": 4.0}
    mass = AEROSONDE.need_mass("the test")
    dimensional = convert_standard_errors(
        errors,
        aircraft=AEROSONDE,
        condition=CONDITION,
        structure=LATERAL,
        source=Convention.CONCISE,
        target=Convention.DIMENSIONAL,
    )
    assert dimensional["y_v"] == pytest.approx(0.1 * mass.mass_kg)
    assert dimensional["l_v"] == pytest.approx(
        math.hypot(3.0 * mass.inertia_x_kg_m2, 4.0 * mass.inertia_xz_kg_m2)
    )
    assert dimensional["n_v"] == pytest.approx(
        math.hypot(4.0 * mass.inertia_z_kg_m2, 3.0 * mass.inertia_xz_kg_m2)
    )
    assert dimensional["y_r"] == 0.0  # the offset is known


def test_what_cannot_be_converted_is_refused_in_one_sentence() -> None:
    jetstream = load_aircraft("jetstream31")
    values = dict.fromkeys(SHORT_PERIOD.derivatives, 1.0)
    with pytest.raises(AircraftDataError, match=r"jetstream31 states no \[mass\], which conversion"):
        affine(SHORT_PERIOD, jetstream, CONDITION)
    with pytest.raises(AircraftDataError, match="add that table to its file"):
        convert(
            values,
            aircraft=jetstream,
            condition=CONDITION,
            structure=SHORT_PERIOD,
            source=Convention.CONCISE,
            target=Convention.AMERICAN,
        )
    same = convert(
        values,
        aircraft=jetstream,
        condition=CONDITION,
        structure=SHORT_PERIOD,
        source=Convention.CONCISE,
        target=Convention.CONCISE,
    )
    assert same == values
    with pytest.raises(ValueError, match="missing or unknown here: l_p, m_q"):
        convert(
            {s: v for s, v in values.items() if s != "m_q"} | {"l_p": 1.0},
            aircraft=AEROSONDE,
            condition=CONDITION,
            structure=SHORT_PERIOD,
            source=Convention.CONCISE,
            target=Convention.AMERICAN,
        )


def test_names_and_units() -> None:
    assert [display_name("z_w", c) for c in Convention] == ["z_w", "Z_w", "Z_w", "CZ_alpha"]
    assert display_name("n_zeta", Convention.AMERICAN) == "Cn_dr"
    assert display_name("l_xi", Convention.AMERICAN) == "Cl_da"
    assert [unit("m_q", c) for c in Convention] == ["1/s", "N m s", "", ""]
    assert [unit(s, Convention.DIMENSIONAL) for s in ("z_w", "z_q", "z_eta", "m_w", "m_eta")] == [
        "N s/m",
        "N s",
        "N",
        "N s",
        "N m",
    ]
    names = [display_name(s, Convention.AMERICAN) for s in DERIVATIVES]
    assert len(set(names)) == len(names)


@given(conditions)
@settings(deadline=None)
def test_alphadot_inertia_is_the_unsteady_lift_and_moment(condition: FlightCondition) -> None:
    c, g = ULTRASTICK.need_coefficients("the test"), ULTRASTICK.need_geometry("the test")
    z_wdot, m_wdot = unsteady_inertia(ULTRASTICK, condition)
    q_s = condition.dynamic_pressure_pa * g.wing_area_m2
    # unit dw/dt: d(alpha)/dt = cos(alpha) / V, lift turned into z body
    cos = math.cos(condition.angle_of_attack_rad)
    alphadot_hat = cos / condition.airspeed_true_m_s * g.mean_chord_m / (2.0 * condition.airspeed_true_m_s)
    assert z_wdot == pytest.approx(-q_s * c.CL.alphadot * alphadot_hat * cos)
    assert m_wdot == 0.0  # the published set has no Cm_alphadot
    assert unsteady_inertia(AEROSONDE, condition) == (0.0, 0.0)
