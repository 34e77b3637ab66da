"""A flight that moves the aircraft too little, or flies otherwise than the file states, and what is said of it."""

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.diagnosis import as_json, diagnose
from wingwatch.diagnosis.answerable import MAIN
from wingwatch.diagnosis.notes import another_aircraft
from wingwatch.diagnosis.subject import subject_of
from wingwatch.diagnosis.summary import headline
from wingwatch.simulation import Scenario, doublet_schedule, simulate

AEROSONDE = load_aircraft("aerosonde")


def test_a_flight_without_inputs_in_still_air_judges_next_to_nothing() -> None:
    found = diagnose(simulate(Scenario(AEROSONDE, seed=1), 30.0), AEROSONDE)
    assert found.causes == ()
    assert {"m_q", "l_p", "l_v", "n_v", "n_r", "n_zeta"} <= set(found.not_judged)
    assert found.missing_terms == ()
    assert "too little to judge the simulation" in headline(found)[0]
    assert as_json(found)["not_judged"] == list(found.not_judged)
    assert any("would not be beyond doubt" in note for note in found.notes)


def test_a_flight_with_doublets_of_all_surfaces_judges_every_main_derivative() -> None:
    inputs = (doublet_schedule(AEROSONDE, FlightCondition(25.0, 1000.0), spacing_s=3.0, start_s=2.0),)
    found = diagnose(simulate(Scenario(AEROSONDE, manoeuvres=inputs, seed=5), 30.0), AEROSONDE)
    assert found.not_judged == ()
    assert set(MAIN) <= set(found.derivatives)
    assert "agrees" in headline(found)[0]


def test_a_flight_outside_the_envelope_that_a_file_states_may_be_of_another_aircraft() -> None:
    flown = simulate(Scenario(AEROSONDE, seed=1), 12.0)
    assert another_aircraft(subject_of(flown, AEROSONDE, {}), {}) == ""
    why = another_aircraft(subject_of(flown, load_aircraft("twinotter"), {}), {})
    assert "m/s is not in the" in why
