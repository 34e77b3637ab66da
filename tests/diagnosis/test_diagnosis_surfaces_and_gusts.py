"""Surfaces that do not follow their commands; gusts along the path that are as strong as the flight shows them."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import FIXED, draw

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.diagnosis import diagnose
from wingwatch.diagnosis.causes import candidates
from wingwatch.diagnosis.evaluation import evaluate
from wingwatch.diagnosis.fit import fit
from wingwatch.diagnosis.measured import OUTPUTS, measure
from wingwatch.diagnosis.misfit import noise_variance, replayed
from wingwatch.diagnosis.noise import first_noise, fit_noise, likeliest_level
from wingwatch.diagnosis.problem import prepare
from wingwatch.diagnosis.search import _promises, settled
from wingwatch.diagnosis.subject import subject_of
from wingwatch.diagnosis.traces import traces_of
from wingwatch.simulation import Scenario, doublet_schedule, parse_effect, simulate
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

AEROSONDE = load_aircraft("aerosonde")
CRUISE = FlightCondition(25.0, 1000.0)
POSITIONS = ("elevator_rad", "aileron_rad", "rudder_rad")


def flown(effect: str, seconds: float = 24.0, noise: bool = True) -> SampleBlock:
    inputs = (doublet_schedule(AEROSONDE, CRUISE, spacing_s=3.0, start_s=2.0),)
    effects = (parse_effect(effect),) if effect else ()
    return simulate(Scenario(AEROSONDE, manoeuvres=inputs, effects=effects, noise=noise, seed=5), seconds)


def with_commands_alone(block: SampleBlock) -> SampleBlock:
    values = block.values.copy()
    for name in POSITIONS:
        values[:, CHANNEL_INDEX[name]] = values[:, CHANNEL_INDEX[name.replace("_rad", "_command_rad")]]
    return SampleBlock(values)


@pytest.mark.parametrize("measured", [True, False], ids=["position-measured", "command-alone"])
def test_a_rudder_that_is_stuck_is_named_with_where_it_stands(measured: bool) -> None:
    block = flown("surface_stuck[rudder]:0.02@0")
    kinds = {} if measured else dict.fromkeys(POSITIONS, "command")
    found = diagnose(block if measured else with_commands_alone(block), AEROSONDE, kinds=kinds)
    assert [cause.label for cause in found.causes] == ["surface_stuck[rudder]"]
    stands = found.causes[0].parameters["deflection_rad"]
    assert stands.value == pytest.approx(0.02, abs=4.0 * stands.standard_error + 2e-4)
    assert "does not follow its commands" in found.causes[0].text


def test_a_surface_that_stands_still_is_measured_where_its_command_moves() -> None:
    block = flown("surface_stuck[rudder]:0.02@0", noise=False)
    values = block.values.copy()
    values[:, CHANNEL_INDEX["rudder_rad"]] = 0.02
    outputs = measure(SampleBlock(values), AEROSONDE, {}).outputs[:, OUTPUTS.index("rudder_rad")]
    assert (outputs == 0.02).all()
    values[:, CHANNEL_INDEX["rudder_command_rad"]] = 0.02
    assert np.isnan(measure(SampleBlock(values), AEROSONDE, {}).outputs[:, OUTPUTS.index("rudder_rad")]).all()


def test_an_elevator_that_lost_a_third_does_not_promise_to_be_stuck() -> None:
    subject = subject_of(
        with_commands_alone(flown("elevator_effectiveness:0.33@0")),
        AEROSONDE,
        dict.fromkeys(POSITIONS, "command"),
    )
    problem, point = prepare(subject, first_noise(subject))
    both = [
        c for c in candidates(subject) if c.label in ("surface_stuck[elevator]", "elevator_effectiveness")
    ]
    fitted = fit(problem, point)
    promised = _promises(problem, fitted, both, evaluate(problem, fitted.point, both))
    stuck, weak = sorted(zip(promised, both, strict=True), key=lambda p: p[0])
    assert weak[1].label == "elevator_effectiveness"
    assert stuck[0] < 0.7 * weak[0]


def test_gusts_along_the_path_are_as_strong_as_the_flight_shows_them() -> None:
    """A plant whose forward speed is held feels none of them; flown otherwise, turbulence is isotropic."""
    plant = draw("plant", 10015)
    inputs = (doublet_schedule(AEROSONDE, CRUISE, spacing_s=3.0, start_s=2.0),)
    isotropic = simulate(Scenario(AEROSONDE, manoeuvres=inputs, turbulence="light", seed=5), 60.0)
    ratios = []
    for subject in (
        subject_of(plant.flight, plant.aircraft, plant.kinds),
        subject_of(isotropic, AEROSONDE, {}),
    ):
        problem, point = prepare(subject, first_noise(subject))
        gusts = fit_noise(problem, likeliest_level(problem, point)).noise.gusts
        ratios.append(gusts[0] / gusts[2])
    assert ratios[0] < 0.3
    assert 0.6 < ratios[1] < 1.6


def test_pitch_damping_in_gusts_is_no_downwash_lag() -> None:
    """Seed 10015 of the plants: with gusts along the path as strong as the others, downwash lag fitted better."""
    plant = draw("plant", 10015)
    subject = subject_of(plant.flight, plant.aircraft, plant.kinds)
    problem, point = prepare(subject, first_noise(subject))
    point, named = likeliest_level(problem, point), {c.label: c for c in candidates(subject)}

    def cost(*labels: str) -> float:
        causes = tuple(named[label] for label in labels)
        return settled(problem, replace(point, causes=causes, values=tuple(np.zeros(1) for _ in causes))).cost

    assert cost("pitch_damping") < cost("downwash_lag", "derivative[m_w]") - 3.0


def test_what_no_model_explains_is_of_the_size_of_what_is_left_where_a_file_states_no_force_along_x() -> None:
    """The force along x may be anything for the filter; open loop it is what was read, and wrong by its noise."""
    case = FIXED["plant-nothing"]()
    subject = subject_of(case.flight, case.aircraft, case.kinds)
    problem, point = prepare(subject, first_noise(subject))
    solution = settled(problem, point)
    noise, flown = noise_variance(problem, solution.point), replayed(problem, solution.point)
    spectra = traces_of(problem, flown, flown, solution.point).spectra
    for name in ("pitch_rate_rad_s", "specific_force_z_m_s2", "yaw_rate_rad_s", "pitch_rad"):
        k = OUTPUTS.index(name)
        left = float(np.mean([np.mean((a - b) ** 2) for a, b in flown.pairs(k)]))
        assert 0.5 * left < noise[k] < 3.0 * left, name
        before, _, floor = spectra[name]
        assert 0.3 < np.median(before[2:] / floor[2:]) < 2.0, name
