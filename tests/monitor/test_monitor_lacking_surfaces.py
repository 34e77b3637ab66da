"""Which surfaces a flight can do without, and what of its derivatives is then left out."""

import numpy as np
import pytest

from wingwatch.aircraft import DUTCH_ROLL, LATERAL, SHORT_PERIOD, Aircraft, load_aircraft
from wingwatch.monitor.detection.could_see import beside_lacking
from wingwatch.monitor.estimation.lacking_surfaces import (
    derivatives_by,
    disturbed_by,
    known_beside,
    lacking_surfaces,
    marginal,
    missing_beside,
    why_lacking,
)
from wingwatch.monitor.views import CouldSeeView
from wingwatch.telemetry import REQUIRED_CHANNELS

AEROSONDE = load_aircraft("aerosonde")


def without_effect(aircraft: Aircraft, surface: str) -> Aircraft:
    coefficients = aircraft.need_coefficients("the test")
    for table in ("CY", "Cl", "Cn"):
        coefficients = coefficients.with_value(f"{table}_{surface}", 0.0)
    return aircraft.model_copy(update={"coefficients": coefficients})


def test_a_rudder_can_be_missing_and_ailerons_only_where_there_are_none() -> None:
    ailerons, rudder = {*REQUIRED_CHANNELS, "aileron_rad"}, {*REQUIRED_CHANNELS, "rudder_rad"}
    assert lacking_surfaces(AEROSONDE, LATERAL, ailerons) == ("rudder_rad",)
    assert missing_beside(AEROSONDE, LATERAL, ailerons) == ()
    assert lacking_surfaces(AEROSONDE, LATERAL, rudder) == ()
    assert missing_beside(AEROSONDE, LATERAL, rudder) == ("aileron_rad",)
    assert lacking_surfaces(without_effect(AEROSONDE, "aileron"), LATERAL, rudder) == ("aileron_rad",)
    assert lacking_surfaces(AEROSONDE, LATERAL, ailerons | rudder) == ()


@pytest.mark.parametrize("structure", [SHORT_PERIOD, DUTCH_ROLL])
def test_the_only_surface_of_a_mode_is_needed(structure: object) -> None:
    assert isinstance(structure, type(LATERAL))
    assert lacking_surfaces(AEROSONDE, structure, REQUIRED_CHANNELS) == ()
    assert len(missing_beside(AEROSONDE, structure, REQUIRED_CHANNELS)) == 1


def test_what_an_unseen_rudder_may_have_done_is_left_out() -> None:
    lacking = ("rudder_rad",)
    assert derivatives_by(LATERAL, lacking) == ("y_zeta", "l_zeta", "n_zeta")
    disturbed = disturbed_by(AEROSONDE, LATERAL, lacking)
    assert {symbol[0] for symbol in disturbed} == {"y", "n"}
    known = known_beside(LATERAL, {*disturbed, *derivatives_by(LATERAL, lacking)})
    kept = [symbol for symbol, one in zip(LATERAL.derivatives, known, strict=True) if one]
    assert kept == ["l_v", "l_p", "l_r", "l_xi"]
    assert disturbed_by(without_effect(AEROSONDE, "rudder"), LATERAL, lacking) == ()
    assert why_lacking(lacking) == "the flight has no rudder"
    assert "n and y derivatives" in why_lacking(lacking, disturbed)


def test_the_evidence_of_what_is_known_is_the_marginal_one() -> None:
    draw = np.random.default_rng(3)
    rows = draw.normal(size=(40, 4)) * np.array([1.0, 100.0, 0.01, 0.0])
    information, vector = rows.T @ rows, draw.normal(size=4) * np.array([1.0, 100.0, 0.01, 0.0])
    found, moved = marginal(information, vector[None], np.array([1.0, 0.0, 1.0, 0.0]))
    covariance = np.linalg.inv(information[:3, :3])
    whole = covariance @ vector[:3]
    np.testing.assert_allclose(np.linalg.inv(found[::2, ::2]), covariance[::2, ::2], rtol=1e-9)
    np.testing.assert_allclose(np.linalg.solve(found[::2, ::2], moved[0, ::2]), whole[::2], rtol=1e-9)
    assert not found[1].any()
    assert not moved[0, [1, 3]].any()


@pytest.mark.parametrize("seed", range(20))
def test_marginal_evidence_is_never_negative(seed: int) -> None:
    draw = np.random.default_rng(seed)
    rows = draw.normal(size=(3, 6)) * 10.0 ** draw.integers(-6, 6, 6)  # fewer rows than derivatives
    known = np.array([1.0, 0.0, 1.0, 0.0, 1.0, 1.0])
    found, _ = marginal(rows.T @ rows, draw.normal(size=(1, 6)), known)
    assert (np.diagonal(found) >= 0.0).all()
    np.testing.assert_array_equal(found, found.T)


def test_nothing_is_wanted_from_a_surface_that_is_not_there() -> None:
    rows = (
        CouldSeeView("rudder_effectiveness", None, None, "", "a doublet of the rudder"),
        CouldSeeView("sensor_scale", "yaw_rate_rad_s", 0.2, "", "a doublet of the rudder"),
        CouldSeeView("icing", None, 0.2, "", "a doublet of the elevator"),
    )
    left = beside_lacking(rows, {"rudder_rad"})
    assert [(row.cause, row.input) for row in left] == [
        ("sensor_scale", ""),
        ("icing", "a doublet of the elevator"),
    ]
    assert beside_lacking(rows, set()) == rows
