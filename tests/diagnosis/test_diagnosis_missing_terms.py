"""What is left names the term that the simulation lacks."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.diagnosis import MissingTerm, as_json, diagnose
from wingwatch.diagnosis.causes import candidates
from wingwatch.diagnosis.missing_terms import missing_terms
from wingwatch.diagnosis.noise import first_noise, likeliest_level
from wingwatch.diagnosis.problem import prepare
from wingwatch.diagnosis.search import settled
from wingwatch.diagnosis.subject import subject_of
from wingwatch.simulation import Effect, Scenario, doublet_schedule, parse_effect, simulate
from wingwatch.telemetry import SampleBlock

Air = Literal["none", "light"]
AEROSONDE = load_aircraft("aerosonde")


def flown(effects: Sequence[Effect], air: Air, seconds: float = 40.0) -> SampleBlock:
    inputs = (doublet_schedule(AEROSONDE, FlightCondition(25.0, 1000.0), spacing_s=3.0, start_s=2.0),)
    return simulate(
        Scenario(AEROSONDE, manoeuvres=inputs, effects=tuple(effects), turbulence=air, seed=5), seconds
    )


def terms_of(block: SampleBlock) -> tuple[MissingTerm, ...]:
    """Of the simulation as stated, without any cause."""
    subject = subject_of(block, AEROSONDE, {})
    problem, point = prepare(subject, first_noise(subject))
    return missing_terms(problem, settled(problem, likeliest_level(problem, point)))


@pytest.mark.parametrize(("what", "coefficient"), [("lift", "CL"), ("pitch", "Cm")])
def test_a_bend_in_incidence_is_a_square_of_the_angle_of_attack(what: str, coefficient: str) -> None:
    bend = 8.0  # change of slope per rad, of the slope
    (term,) = terms_of(flown([parse_effect(f"incidence_nonlinearity[{what}]:{bend}@0")], "light"))
    assert (term.coefficient, term.signal) == (coefficient, "angle of attack squared")
    assert AEROSONDE.coefficients is not None
    stated = dict(AEROSONDE.coefficients.items())[f"{coefficient}_alpha"]
    assert term.value == pytest.approx(
        0.5 * bend * stated, rel=0.25
    )  # gusts that a vane shows with noise make it smaller
    assert term.standard_error < 0.2 * abs(term.value)


def test_a_vane_that_is_known_to_turn_too_far_does_not_shrink_the_term() -> None:
    effects = [
        parse_effect(e) for e in ("incidence_nonlinearity[pitch]:8@0", "vane_upwash[angle_of_attack]:0.5@0")
    ]
    subject = subject_of(flown(effects, "none"), AEROSONDE, {})
    problem, point = prepare(subject, first_noise(subject))
    (vane,) = [c for c in candidates(subject) if c.label == "vane_upwash[angle_of_attack]"]
    begun = replace(point, causes=(vane,), values=(np.array([0.5]),))
    terms = missing_terms(problem, settled(problem, likeliest_level(problem, begun)))
    (term,) = [t for t in terms if t.coefficient == "Cm" and t.signal == "angle of attack squared"]
    assert AEROSONDE.coefficients is not None
    expected = 4.0 * dict(AEROSONDE.coefficients.items())["Cm_alpha"]
    assert abs(term.value - expected) < 2.0 * term.standard_error < 0.4 * abs(expected)


@pytest.mark.parametrize("air", ["none", "light"])
def test_where_the_simulation_is_right_no_term_is_missing(air: Air) -> None:
    assert terms_of(flown([], air)) == ()


def test_a_derivative_that_is_wrong_is_no_missing_term() -> None:
    found = diagnose(flown([parse_effect("derivative[m_w]:0.3@0")], "none", 20.0), AEROSONDE)
    assert [c.label for c in found.causes] == ["derivative[m_w]"]
    assert found.missing_terms == ()
    assert as_json(found)["missing_terms"] == []
