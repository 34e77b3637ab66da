"""Icing and lost effectiveness: published factors arrive in the equations of motion; how effects grow and combine."""

import numpy as np
import pytest

from wingwatch.aircraft import ICING_FACTORS, LATERAL, SHORT_PERIOD, FlightCondition, load_aircraft
from wingwatch.simulation import (
    AileronEffectiveness,
    CgShift,
    Effect,
    ElevatorEffectiveness,
    Icing,
    RudderEffectiveness,
    SurfaceStuck,
    linearise,
    trim,
)
from wingwatch.simulation.effects import parameters_under
from wingwatch.simulation.layout import COEFFICIENTS, INDEX, PARAMETERS

AEROSONDE = load_aircraft("aerosonde")
CONDITION = FlightCondition(25.0, 1000.0)

PUBLISHED_PERCENT = {
    "Cm_alpha": -9.9, "Cm_q": -3.5, "Cm_elevator": -10.0, "CL_alpha": -10.0, "CL_q": -1.4, "CL_elevator": -9.5,
    "CD_min": +44.1, "CY_beta": -20.0, "CY_rudder": -8.0, "Cl_beta": -10.0, "Cl_p": -10.0, "Cl_aileron": -10.0,
    "Cn_beta": -20.0, "Cn_r": -6.0, "Cn_rudder": -8.0, "CL_zero": 0.0, "Cm_zero": 0.0, "Cl_r": 0.0, "Cn_p": 0.0,
}  # fmt: skip
"""Change at the reference severity 0.0675, ice everywhere, as printed (to a tenth of a percent)."""


def under(*effects: Effect, time_s: float = 0.0) -> dict[str, float]:
    return dict(
        zip(PARAMETERS, parameters_under(AEROSONDE, CONDITION, effects, time_s).tolist(), strict=True)
    )


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
    clean, iced = under(), under(Icing(0.0675))
    for name, percent in PUBLISHED_PERCENT.items():
        assert 100.0 * (iced[name] / clean[name] - 1.0) == pytest.approx(percent, abs=0.06), name


@pytest.mark.parametrize("where", ["all", "wing", "tail"])
def test_every_published_factor_but_those_of_drag_due_to_lift_is_used(where: str) -> None:
    effect = Icing(0.1, target=where)
    ones = parameters_under(AEROSONDE, CONDITION, (effect,), 0.0, clean=np.ones(len(PARAMETERS)))
    factors = (ones - 1.0) / 0.1
    published = ICING_FACTORS[where]  # type: ignore[index]
    used = [k for name, k in published.items() if not name.startswith("CXalpha")]
    assert np.sort(factors[factors != 0.0]) == pytest.approx(sorted(k for k in used if k != 0.0))
    assert set(np.flatnonzero(factors)) <= {INDEX[name] for name in COEFFICIENTS}


@pytest.mark.parametrize(
    ("target", "wing", "tail", "left_less_right"),
    [
        ("nonlinear", 0.2, 0.2, 0.0),
        ("nonlinear_wing", 0.2, 0.0, 0.0),
        ("nonlinear_tail", 0.0, 0.2, 0.0),
        ("left", 0.1, 0.0, 0.2),
        ("right", 0.1, 0.0, -0.2),
    ],
)
def test_non_linear_icing_is_handed_to_the_flight_as_severities(
    target: str, wing: float, tail: float, left_less_right: float
) -> None:
    clean, iced = under(), under(Icing(0.2, target=target))
    severities = {"ice_wing": wing, "ice_tail": tail, "ice_left_less_right": left_less_right}
    assert {name: iced[name] for name in severities} == severities
    assert all(iced[name] == clean[name] for name in PARAMETERS if name not in severities)


def test_ice_on_both_wings_is_ice_on_the_left_and_ice_on_the_right() -> None:
    assert under(Icing(0.2, target="left"), Icing(0.2, target="right")) == under(
        Icing(0.2, target="nonlinear_wing")
    )


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
    severities = [effect.severity(t) for t in (0.0, 9.99, 10.0, 11.0, 14.0, 100.0)]
    assert severities == [0.0, 0.0, 0.0, 0.05, 0.2, 0.2]
    assert [effect.acts(t) for t in (9.99, 10.0, 10.01)] == [False, False, True]
    assert [ElevatorEffectiveness(0.5, 3.0).severity(t) for t in (2.99, 3.0)] == [0.0, 0.5]
    assert [CgShift(-0.04, 1.0, 2.0).severity(t) for t in (1.0, 2.0, 3.0)] == [0.0, -0.02, -0.04]


def test_a_surface_may_stick_at_nothing_and_does_so_at_once() -> None:
    effect = SurfaceStuck(0.0, 3.0, target="aileron")
    assert [effect.acts(t) for t in (2.99, 3.0, 9.0)] == [False, True, True]
    assert [under(effect, time_s=t)["aileron_stuck"] for t in (2.99, 3.0)] == [0.0, 1.0]
    with pytest.raises(ValueError, match=r"has ramp 5\.0 s, but is there at once"):
        SurfaceStuck(0.0, 3.0, 5.0, "aileron")


def test_effects_act_together() -> None:
    both = under(Icing(0.1), ElevatorEffectiveness(0.5), CgShift(0.01), CgShift(0.02))
    assert both["Cm_elevator"] == 0.5 * under(Icing(0.1))["Cm_elevator"]
    assert both["cg_x_m"] == -0.03


def test_each_grows_by_its_own_clock() -> None:
    effects = (Icing(0.2, 10.0, 10.0), CgShift(0.02, 15.0))
    at = {t: under(*effects, time_s=t) for t in (5.0, 12.0, 15.0, 30.0)}
    assert [row["cg_x_m"] for row in at.values()] == [0.0, 0.0, -0.02, -0.02]
    drag = [row["CD_min"] / at[5.0]["CD_min"] - 1.0 for row in at.values()]
    assert drag == pytest.approx(
        [0.2 * share * ICING_FACTORS["all"]["CX0"] for share in (0.0, 0.2, 0.5, 1.0)]
    )
