import numpy as np
import pytest

from wingwatch.aircraft import (
    DUTCH_ROLL,
    ICING_FACTORS,
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    Convention,
    FlightCondition,
    IcingKind,
    ModeStructure,
    convert,
    icing_direction,
    icing_factor,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)

AEROSONDE = load_aircraft("aerosonde")
ULTRASTICK = load_aircraft("ultrastick25e")
LAGGING = ULTRASTICK.model_copy(
    update={"coefficients": ULTRASTICK.need_coefficients("the test").with_value("Cm_alphadot", -5.0)}
)
KINDS: tuple[IcingKind, ...] = ("all", "wing", "tail")


def test_the_published_factors_are_round_percentages_at_the_reference_severity() -> None:
    """k' times 0.0675, in percent, as the files' own table of measured changes has them."""
    percent = {k: 100.0 * 0.0675 * v for k, v in ICING_FACTORS["all"].items()}
    expected = {
        "CZalpha": -10.0,
        "CZq": -1.4,
        "CZde": -9.5,
        "Cmalpha": -9.9,
        "Cmq": -3.5,
        "Cmde": -10.0,
        "CYbeta": -20.0,
        "CYdr": -8.0,
        "Clbeta": -10.0,
        "Clp": -10.0,
        "Clda": -10.0,
        "Cldr": -8.0,
        "Cnbeta": -20.0,
        "Cnr": -6.0,
        "Cndr": -8.0,
    }
    assert {k: percent[k] for k in expected} == pytest.approx(expected, abs=1e-3)
    assert {k for k, v in ICING_FACTORS["all"].items() if v == 0.0} == {
        "CZ0",
        "Cm0",
        "CYp",
        "CYr",
        "CYda",
        "Clr",
        "Cnp",
        "Cnda",
    }
    assert {k: set(v) for k, v in ICING_FACTORS.items()} == {
        kind: set(ICING_FACTORS["all"]) for kind in KINDS
    }


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("structure", [SHORT_PERIOD, LATERAL], ids=lambda s: s.name)
@pytest.mark.parametrize("aircraft", [AEROSONDE, LAGGING], ids=lambda a: a.name)
def test_direction_is_the_change_of_the_coefficients_themselves(
    aircraft: Aircraft, structure: ModeStructure, kind: IcingKind
) -> None:
    """Un-mix to American coefficients, scale each by 1 + eta k', mix again: the difference over eta."""
    assert aircraft.envelope is not None
    condition = trimmed(aircraft, aircraft.envelope.cruise)
    clean = linearised_derivatives(aircraft, condition, structure)
    american = convert(
        clean,
        aircraft=aircraft,
        condition=condition,
        structure=structure,
        source=Convention.CONCISE,
        target=Convention.AMERICAN,
    )
    for eta in (0.0675, 0.3):
        iced = convert(
            {s: v * (1.0 + eta * icing_factor(s, kind)) for s, v in american.items()},
            aircraft=aircraft,
            condition=condition,
            structure=structure,
            source=Convention.AMERICAN,
            target=Convention.CONCISE,
        )
        change = np.array(list(iced.values())) - np.array(list(clean.values()))
        direction = icing_direction(structure, list(clean.values()), aircraft, condition, kind)
        np.testing.assert_allclose(eta * direction, change, rtol=1e-9, atol=1e-10)


def test_the_dutch_roll_moves_as_its_rows_of_the_full_lateral_model() -> None:
    condition = trimmed(AEROSONDE, FlightCondition(25.0, 1000.0))
    full = linearised_derivatives(AEROSONDE, condition, LATERAL)
    direction = dict(
        zip(
            LATERAL.derivatives,
            icing_direction(LATERAL, list(full.values()), AEROSONDE, condition),
            strict=True,
        )
    )
    alone = icing_direction(DUTCH_ROLL, [full[s] for s in DUTCH_ROLL.derivatives], AEROSONDE, condition)
    np.testing.assert_allclose(alone, [direction[s] for s in DUTCH_ROLL.derivatives], rtol=1e-12)


def test_kinematic_parts_do_not_ice() -> None:
    condition = FlightCondition(25.0, 1000.0, angle_of_attack_rad=0.06)
    u, w = condition.forward_velocity_m_s, condition.normal_velocity_m_s
    longitudinal = icing_direction(SHORT_PERIOD, [0.0, u, 0.0, 0.0, 0.0, 0.0], AEROSONDE, condition)
    np.testing.assert_allclose(longitudinal, 0.0, atol=1e-12)
    lateral = np.zeros(15)
    lateral[1], lateral[2] = w, -u
    np.testing.assert_allclose(icing_direction(LATERAL, lateral, AEROSONDE, condition), 0.0, atol=1e-12)


def test_an_aircraft_without_mass_takes_each_derivative_for_itself() -> None:
    jetstream = load_aircraft("jetstream31")
    entry = jetstream.conditions[0]
    values = np.array([entry.derivatives[s].value for s in DUTCH_ROLL.derivatives])
    direction = icing_direction(DUTCH_ROLL, values, jetstream, entry.condition)
    factors = np.array([icing_factor(s) for s in DUTCH_ROLL.derivatives])
    offset = np.array([0.0, -87.4, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(direction, factors * (values - offset))
    short = np.array([entry.derivatives[s].value for s in SHORT_PERIOD.derivatives])
    np.testing.assert_allclose(
        icing_direction(SHORT_PERIOD, short, jetstream, entry.condition, "tail")[[0, 3, 5]],
        short[[0, 3, 5]] * [-0.36593, -0.53244, -1.24756],
    )
