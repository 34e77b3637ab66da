"""Effects: published factors arrive in the equations of motion; text is parsed or refused in one sentence."""

import numpy as np
import pytest

from wingwatch.aircraft import (
    ICING_FACTORS,
    LATERAL,
    SHORT_PERIOD,
    FlightCondition,
    load_aircraft,
)
from wingwatch.simulation import (
    EFFECTS,
    AileronEffectiveness,
    Effect,
    EffectSyntaxError,
    ElevatorEffectiveness,
    Icing,
    RudderEffectiveness,
    linearise,
    parse_effect,
    trim,
)
from wingwatch.simulation.effects import coefficients_under
from wingwatch.simulation.layout import COEFFICIENTS

AEROSONDE = load_aircraft("aerosonde")
CONDITION = FlightCondition(25.0, 1000.0)

PUBLISHED_PERCENT = {
    "Cm_alpha": -9.9, "Cm_q": -3.5, "Cm_elevator": -10.0, "CL_alpha": -10.0, "CL_q": -1.4, "CL_elevator": -9.5,
    "CD_min": +44.1, "CY_beta": -20.0, "CY_rudder": -8.0, "Cl_beta": -10.0, "Cl_p": -10.0, "Cl_aileron": -10.0,
    "Cn_beta": -20.0, "Cn_r": -6.0, "Cn_rudder": -8.0, "CL_zero": 0.0, "Cm_zero": 0.0, "Cl_r": 0.0, "Cn_p": 0.0,
}  # fmt: skip
"""Change at the reference severity 0.0675, ice everywhere, as printed (to a tenth of a percent)."""


def pitching_moment(effects: tuple[Effect, ...], index: str) -> float:
    """m_x of the flown aircraft, the part of its own angle of attack taken out of m_w."""
    value = linearise(AEROSONDE, CONDITION, SHORT_PERIOD, effects)[f"m_{index}"]
    alpha = trim(AEROSONDE, CONDITION, effects=effects).angle_of_attack_rad
    return float(value / np.cos(alpha)) if index == "w" else value


@pytest.mark.parametrize(("index", "percent"), [("w", -9.9), ("q", -3.5), ("eta", -10.0)])
def test_icing_changes_the_flown_pitching_moments_by_the_published_percentage(
    index: str, percent: float
) -> None:
    change = pitching_moment((Icing(0.0675),), index) / pitching_moment((), index) - 1.0
    assert 100.0 * change == pytest.approx(percent, abs=0.05)


def test_icing_changes_the_flown_rolling_and_yawing_moments_by_the_published_percentage() -> None:
    mass = AEROSONDE.mass
    assert mass is not None
    clean = linearise(AEROSONDE, CONDITION, LATERAL)
    iced = linearise(AEROSONDE, CONDITION, LATERAL, (Icing(0.0675),))

    def moments(d: dict[str, float], index: str) -> tuple[float, float]:
        roll, yaw = d[f"l_{index}"], d[f"n_{index}"]
        return (
            mass.inertia_x_kg_m2 * roll - mass.inertia_xz_kg_m2 * yaw,
            mass.inertia_z_kg_m2 * yaw - mass.inertia_xz_kg_m2 * roll,
        )

    for index, percents in {
        "v": (-10.0, -20.0),
        "p": (-10.0, 0.0),
        "r": (0.0, -6.0),
        "zeta": (-8.0, -8.0),
    }.items():
        for before, after, percent in zip(moments(clean, index), moments(iced, index), percents, strict=True):
            assert 100.0 * (after / before - 1.0) == pytest.approx(percent, abs=0.05), index
    assert 100.0 * (iced["y_v"] / clean["y_v"] - 1.0) == pytest.approx(-20.0, abs=0.05)


def test_icing_changes_each_coefficient_by_the_published_percentage() -> None:
    clean = dict(zip(COEFFICIENTS, coefficients_under(AEROSONDE, (), 0.0), strict=True))
    iced = dict(zip(COEFFICIENTS, coefficients_under(AEROSONDE, (Icing(0.0675),), 0.0), strict=True))
    for name, percent in PUBLISHED_PERCENT.items():
        assert 100.0 * (iced[name] / clean[name] - 1.0) == pytest.approx(percent, abs=0.06), name


@pytest.mark.parametrize("kind", ["all", "wing", "tail"])
def test_every_published_factor_but_those_of_drag_due_to_lift_is_used(kind: str) -> None:
    factors = Icing(0.1, kind=kind).factors()  # type: ignore[arg-type]
    published = ICING_FACTORS[kind]  # type: ignore[index]
    assert len(factors) == len(published) - 2  # CXalpha and CXalpha2
    assert sorted(factors.values()) == sorted(v for k, v in published.items() if not k.startswith("CXalpha"))
    assert set(factors) <= set(COEFFICIENTS)


@pytest.mark.parametrize(
    ("effect", "symbols"),
    [
        (ElevatorEffectiveness(0.5), ("m_eta",)),
        (AileronEffectiveness(0.5), ("l_xi", "n_xi", "y_xi")),
        (RudderEffectiveness(0.5), ("l_zeta", "n_zeta", "y_zeta")),
    ],
)
def test_a_surface_loses_its_fraction_and_nothing_else_changes(
    effect: Effect, symbols: tuple[str, ...]
) -> None:
    structure = SHORT_PERIOD if symbols == ("m_eta",) else LATERAL
    clean = linearise(AEROSONDE, CONDITION, structure)
    faulty = linearise(AEROSONDE, CONDITION, structure, (effect,))
    for symbol in structure.derivatives:
        share = 0.5 if symbol in symbols else 1.0
        if symbol in ("z_eta", "z_w", "m_w", "z_q"):
            continue  # a weaker elevator trims elsewhere
        # the elevator's trim moves angle of attack by what its lift lacks, under 1 %
        tolerance = 1e-2 if isinstance(effect, ElevatorEffectiveness) else 1e-6
        assert faulty[symbol] == pytest.approx(share * clean[symbol], rel=tolerance), symbol


def test_severity_grows_linearly_from_the_onset() -> None:
    effect = Icing(0.2, 10.0, 4.0)
    assert [effect.severity(t) for t in (0.0, 9.99, 10.0, 11.0, 14.0, 100.0)] == [
        0.0,
        0.0,
        0.0,
        0.05,
        0.2,
        0.2,
    ]
    assert [ElevatorEffectiveness(0.5, 3.0).severity(t) for t in (2.99, 3.0)] == [0.0, 0.5]


def test_effects_multiply() -> None:
    both = coefficients_under(AEROSONDE, (Icing(0.1), ElevatorEffectiveness(0.5)), 0.0)
    iced = coefficients_under(AEROSONDE, (Icing(0.1),), 0.0)
    index = COEFFICIENTS.index("Cm_elevator")
    assert both[index] == 0.5 * iced[index]


@pytest.mark.parametrize(
    ("text", "effect"),
    [
        ("icing:0.15@60+30", Icing(0.15, 60.0, 30.0)),
        ("elevator_effectiveness:0.5@90", ElevatorEffectiveness(0.5, 90.0)),
        (" rudder_effectiveness:1@0+0 ", RudderEffectiveness(1.0)),
        ("aileron_effectiveness:0.25@1e1", AileronEffectiveness(0.25, 10.0)),
    ],
)
def test_effects_are_read_from_text(text: str, effect: Effect) -> None:
    assert parse_effect(text) == effect


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("frost:0.1@3", r"'frost' cannot be simulated; known are icing, elevator_effectiveness"),
        ("", r"'' cannot be simulated"),
        ("icing", r"has no size; write NAME:SIZE@START"),
        ("icing:0.1", r"has no start; write NAME:SIZE@START"),
        ("icing:lots@3", r"size 'lots' is not a number"),
        ("icing:0.1@", r"start '' is not a number"),
        ("icing:0.1@3+", r"ramp '' is not a number"),
        ("icing:0.5@3", r"size 0.5; give the severity eta, 0 to 0.4"),
        ("icing:nan@3", r"size nan"),
        ("elevator_effectiveness:-0.1@3", r"size -0.1; give the fraction lost, 0 to 1"),
        ("icing:0.1@-3", r"start -3.0 s"),
        ("icing:0.1@3+inf", r"ramp inf s"),
    ],
)
def test_text_that_is_no_effect_is_refused_in_one_sentence(text: str, says: str) -> None:
    with pytest.raises(EffectSyntaxError, match=says) as caught:
        parse_effect(text)
    assert "\n" not in str(caught.value)
    assert repr(text) in str(caught.value)


def test_names_are_those_of_the_causes() -> None:
    assert set(EFFECTS) == {
        "icing",
        "elevator_effectiveness",
        "aileron_effectiveness",
        "rudder_effectiveness",
    }
    assert all(name == effect.name for name, effect in EFFECTS.items())
