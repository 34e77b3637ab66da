"""Parameters over time: what the effects say, exactly where they are linear, as flown everywhere."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.simulation import CgShift, Effect, ElevatorEffectiveness, Icing, Scenario, SurfaceStuck
from wingwatch.simulation.effects import Parameters, parameters_under
from wingwatch.simulation.flight import _parameters_now
from wingwatch.simulation.layout import INDEX, PARAMETERS
from wingwatch.simulation.scenario_timeline import timeline_of
from wingwatch.simulation.timeline import Timeline, base_row, timeline

AEROSONDE = load_aircraft("aerosonde")
LEVEL = FlightCondition(25.0, 1000.0)
CLEAN = base_row(AEROSONDE, LEVEL)
TIMES = np.linspace(0.0, 60.0, 241)


@dataclass(frozen=True, slots=True)
class Cubed(Effect):
    """An effect that is far from linear in its severity."""

    name: ClassVar[str] = "cubed"
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "anything"

    def apply(self, parameters: Parameters, severity: float) -> None:
        parameters["CL_alpha"] *= 1.0 + severity**3


@dataclass(frozen=True, slots=True)
class Lag(Effect):
    """A lag on a rudder without actuator: its bandwidth falls from infinite."""

    name: ClassVar[str] = "lag"
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "s"

    def apply(self, parameters: Parameters, severity: float) -> None:
        parameters["rudder_bandwidth"] = 1.0 / severity


def of(*effects: Effect) -> Timeline:
    return timeline(AEROSONDE, LEVEL, effects, CLEAN)


def test_without_effects_nothing_is_kept() -> None:
    line = of()
    assert line.times_s.size == line.columns.size == line.values.size == 0
    np.testing.assert_array_equal(line.at(17.0), CLEAN)


def test_an_effect_that_is_linear_costs_two_rows_and_its_own_columns() -> None:
    line = of(ElevatorEffectiveness(0.5, 10.0, 20.0))
    assert line.times_s.tolist() == [10.0, 30.0]
    assert {PARAMETERS[i] for i in line.columns} == {"CL_elevator", "CD_elevator", "Cm_elevator"}
    for time_s in TIMES:
        wanted = parameters_under(AEROSONDE, LEVEL, (ElevatorEffectiveness(0.5, 10.0, 20.0),), time_s, CLEAN)
        np.testing.assert_allclose(line.at(time_s), wanted, rtol=1e-15)


def test_a_step_is_there_from_its_onset_on() -> None:
    line = of(ElevatorEffectiveness(0.5, 10.0))
    assert line.times_s.tolist() == [10.0, 10.0]
    column = INDEX["Cm_elevator"]
    assert line.at(math.nextafter(10.0, 0.0))[column] == CLEAN[column]
    assert line.at(10.0)[column] == line.at(99.0)[column] == 0.5 * CLEAN[column]


def test_an_effect_from_the_start_is_there_at_the_start() -> None:
    column = INDEX["Cm_elevator"]
    assert of(ElevatorEffectiveness(0.5)).at(0.0)[column] == 0.5 * CLEAN[column]


@pytest.mark.parametrize(
    "effects",
    [(Cubed(0.8, 5.0, 20.0),), (Icing(0.3, 5.0, 30.0), ElevatorEffectiveness(0.9, 10.0, 20.0))],
    ids=["non-linear", "overlapping"],
)
def test_a_ramp_that_is_not_straight_is_cut_until_it_strays_by_a_thousandth(
    effects: tuple[Effect, ...],
) -> None:
    line = of(*effects)
    final = line.at(99.0)
    for time_s in TIMES:
        wanted = parameters_under(AEROSONDE, LEVEL, effects, time_s, CLEAN)
        # a piece is halved while its middle deviates by more than 1e-3 of its own change, at most of the whole ramp
        assert np.all(np.abs(line.at(time_s) - wanted) <= 1.1e-3 * np.abs(final - CLEAN) + 1e-15)


def test_what_begins_from_infinite_grows_too() -> None:
    column = INDEX["rudder_bandwidth"]
    effect = Lag(0.2, 10.0, 16.0)
    row = CLEAN.copy()
    row[column] = math.inf
    line = timeline(AEROSONDE, LEVEL, (effect,), row)
    assert line.at(10.0)[column] == math.inf
    for time_s in (11.0, 14.0, 20.0, 25.0):
        # within a piece, one 32nd of the ramp, the bandwidth stays between its ends
        early, late = (1.0 / effect.severity(time_s + d) for d in (-0.5, 0.5))
        assert late <= line.at(time_s)[column] <= early
    assert line.at(30.0)[column] == 5.0


def test_what_the_kernel_flies_is_what_the_timeline_says() -> None:
    stuck = SurfaceStuck(math.nan, 20.0, target="rudder")
    line = of(Icing(0.3, 5.0, 30.0), ElevatorEffectiveness(0.9, 10.0, 20.0), CgShift(0.02, 15.0), stuck)
    row = line.row.copy()
    for time_s in (*TIMES, *line.times_s):
        _parameters_now(line.times_s, line.columns, line.values.ravel(), time_s, row)
        np.testing.assert_array_equal(row, line.at(time_s))
        row[:] = line.row


def test_a_scenario_flies_with_gusts_on_or_off() -> None:
    calm, rough = Scenario(AEROSONDE), Scenario(AEROSONDE, turbulence="light")
    gain, sigma = INDEX["gust_gain"], INDEX["gust_sigma"]
    still, gusty = timeline_of(calm).at(1.0), timeline_of(rough).at(1.0)
    assert (still[gain], still[sigma]) == (0.0, 0.0)
    assert gusty[gain] == 1.0
    assert gusty[sigma] > 1.0
    assert still[INDEX["alpha_reference"]] == pytest.approx(0.0598, abs=1e-4)
