"""The truth of a flight: what acts when, and the derivatives that belong to it."""

import json
import math

import pytest

from wingwatch.aircraft import STRUCTURES, FlightCondition, load_aircraft
from wingwatch.simulation import (
    CgShift,
    ElevatorEffectiveness,
    Icing,
    Scenario,
    SensorBias,
    SurfaceStuck,
    ThrustLoss,
    doublet_schedule,
    flight_truth,
    linearise,
    parse_effect,
    trim,
    truth,
)

AEROSONDE = load_aircraft("aerosonde")
CONDITION = FlightCondition(25.0, 1000.0)


def test_truth_says_what_acts_and_how_much() -> None:
    scenario = Scenario(AEROSONDE, effects=(Icing(0.2, 10.0, 20.0), ElevatorEffectiveness(0.5, 30.0)))
    sizes = {t: [e["size"] for e in truth(scenario, t)["effects"]] for t in (0.0, 10.0, 15.0, 30.0, 99.0)}
    assert sizes == {
        0.0: [0.0, 0.0], 10.0: [0.0, 0.0], 15.0: [pytest.approx(0.05), 0.0], 30.0: [0.2, 0.5], 99.0: [0.2, 0.5],
    }  # fmt: skip
    assert truth(scenario, 1.0)["effects"][0] == {
        "name": "icing", "target": "all", "size": 0.0, "acting": False, "size_final": 0.2,
        "onset_s": 10.0, "ramp_s": 20.0,
    }  # fmt: skip


def test_a_size_that_is_a_word_stays_one() -> None:
    scenario = Scenario(AEROSONDE, effects=(SurfaceStuck(math.nan, 5.0, target="rudder"),))
    sizes = [truth(scenario, t)["effects"][0]["size"] for t in (4.0, 5.0)]
    assert sizes == [0.0, "here"]


FLIGHT = Scenario(
    AEROSONDE,
    manoeuvres=(doublet_schedule(AEROSONDE, CONDITION),),
    effects=(Icing(0.2, 20.0, 20.0), SensorBias(0.01, 5.0, target="roll_rad"), CgShift(0.01, 50.0)),
    turbulence="light",
    seed=7,
    name="seventh",
)


def test_the_truth_of_a_flight_is_whole_and_is_json() -> None:
    found = json.loads(json.dumps(flight_truth(FLIGHT, 65.0), allow_nan=False))
    scenario = found["scenario"]
    assert (scenario["aircraft"], scenario["airspeed_true_m_s"], scenario["altitude_m"]) == (
        "aerosonde",
        25.0,
        1000.0,
    )
    assert (scenario["seed"], scenario["turbulence"], scenario["name"]) == (7, "light", "seventh")
    assert [parse_effect(e["text"]) for e in found["effects"]] == list(FLIGHT.effects)
    assert found["trim"]["elevator_rad"] == trim(AEROSONDE, CONDITION).elevator_rad
    spans = [(w["from_s"], w["to_s"], w["time_s"]) for w in found["windows"]]
    assert spans[:2] == [(0.0, 10.0, 5.0), (10.0, 20.0, 15.0)]
    assert spans[-1] == (60.0, 65.0, 62.5)
    assert len(spans) == 7
    assert [w["effects"][0]["size"] for w in found["windows"]] == pytest.approx(
        [0.0, 0.0, 0.05, 0.15, 0.2, 0.2, 0.2]
    )


def test_derivatives_are_those_of_the_aircraft_as_it_is_then() -> None:
    found = flight_truth(FLIGHT, 65.0)
    for name, structure in STRUCTURES.items():
        clean = linearise(AEROSONDE, CONDITION, structure)
        assert found["before"]["derivatives"][name] == clean
        assert found["windows"][1]["derivatives"][name] == clean  # a sensor's bias changes no aircraft
        after = linearise(AEROSONDE, CONDITION, structure, (Icing(0.2), CgShift(0.01)))
        assert found["after"]["derivatives"][name] == pytest.approx(after, rel=1e-9)
        growing = linearise(AEROSONDE, CONDITION, structure, (Icing(0.05),))
        assert found["windows"][2]["derivatives"][name] == pytest.approx(growing, rel=1e-9)


def test_without_a_trim_there_is_a_reason() -> None:
    found = flight_truth(Scenario(AEROSONDE, effects=(ThrustLoss(0.9, 10.0),)), 20.0)
    assert found["windows"][0]["why"] is None
    for part in (found["after"], found["windows"][1]):
        assert part["derivatives"] is None
        assert "no steady flight at 25 m/s" in part["why"]


@pytest.mark.parametrize(
    ("seconds", "window_s", "says"),
    [(0.0, 10.0, "seconds is 0.0"), (10.0, -1.0, "window_s is -1.0"), (math.inf, 10.0, "seconds is inf")],
)
def test_lengths_are_positive(seconds: float, window_s: float, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        flight_truth(FLIGHT, seconds, window_s)
