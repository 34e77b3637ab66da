"""The manoeuvre that tells two causes apart: what it promises, it keeps."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.diagnosis import separating
from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.causes import candidates
from wingwatch.diagnosis.fit import fit
from wingwatch.diagnosis.noise import first_noise
from wingwatch.diagnosis.problem import Point, Problem, prepare
from wingwatch.diagnosis.separating import separating_manoeuvre
from wingwatch.diagnosis.subject import subject_of
from wingwatch.simulation import Scenario, doublet_schedule, simulate

AEROSONDE = load_aircraft("aerosonde")


@cache
def flown() -> tuple[Problem, Point, dict[str, Candidate]]:
    inputs = (doublet_schedule(AEROSONDE, FlightCondition(25.0, 1000.0), spacing_s=3.0, start_s=2.0),)
    subject = subject_of(simulate(Scenario(AEROSONDE, manoeuvres=inputs, seed=5), 20.0), AEROSONDE, {})
    problem, point = prepare(subject, first_noise(subject))
    return problem, point, {c.label: c for c in candidates(subject)}


def with_cause(label: str, value: float) -> Point:
    _, point, named = flown()
    return replace(point, causes=(named[label],), values=(np.array([value]),))


@pytest.mark.parametrize(
    ("label", "rival", "surface"),
    [
        ("elevator_effectiveness", "derivative[m_eta]", "elevator"),
        ("rudder_effectiveness", "derivative[n_zeta]", "rudder"),
    ],
)
def test_it_moves_the_surface_whose_effect_is_in_question(label: str, rival: str, surface: str) -> None:
    problem, _, named = flown()
    said = separating_manoeuvre(problem, with_cause(label, 0.1), 0, [named[rival]])
    assert f"{surface}," in said
    assert "odds of 20 to 1" in said


def test_what_is_one_and_the_same_is_told_apart_by_nothing() -> None:
    problem, _, named = flown()
    scale = named["airspeed_error"]
    assert separating_manoeuvre(problem, with_cause("airspeed_error", 0.1), 0, [scale]) == ""


def test_the_evidence_that_is_promised_is_what_a_flight_gives() -> None:
    """A flight without noise gives what is expected of one with noise."""
    problem, _, named = flown()
    point, rival = with_cause("rudder_effectiveness", 0.1), named["derivative[n_zeta]"]
    design = next(
        d for d in separating._designs(problem, point) if d.kind == "3211" and "rudder" in d.surfaces
    )
    promised = separating._evidence(problem, point, 0, rival, design)
    its, there = separating._flown(problem, point, design)
    other = replace(there, causes=(rival,), values=(np.array([-0.1]),))
    given = fit(its, other).cost - fit(its, there).cost
    assert promised > 5.0
    assert given == pytest.approx(promised, rel=0.1)
