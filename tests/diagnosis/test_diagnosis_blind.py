"""Effects hidden in flights are found, and nothing is found where nothing is hidden.

The flights are those of ``benchmarks/diagnosis_cases``, which shares no code with the diagnosis; the benchmark flies
hundreds, here are a few fixed ones.
"""

import pytest
from diagnosis_cases import FIXED
from diagnosis_score import judged

from wingwatch.diagnosis import Diagnosis, diagnose
from wingwatch.telemetry import SampleBlock

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


def first(flight: SampleBlock, seconds: float) -> SampleBlock:
    return SampleBlock(flight.values[: round(50.0 * seconds)])


def told(name: str, seconds: float = 60.0) -> Diagnosis:
    """What is said of the first seconds of a case; what is hidden must be named first."""
    case = FIXED[name]()
    found = diagnose(first(case.flight, seconds), case.aircraft, kinds=case.kinds)
    if case.effects:
        verdict = judged(case, found, 0.0)
        assert verdict.first, (name, verdict.said)
    return found


@pytest.mark.parametrize(("name", "seconds"), [("slow-actuator", 60.0), ("vane-ahead", 40.0)])
def test_what_is_hidden_in_a_simulated_flight_is_named_first(name: str, seconds: float) -> None:
    found = told(name, seconds)
    assert found.gain is not None
    assert found.gain.source == "windows left out"
    assert min(change.value for change in found.gain.change.values()) < -0.05


@pytest.mark.parametrize("name", ["jsbsim-weak-elevator"])
def test_what_is_hidden_in_a_flight_of_others_is_named_first(name: str) -> None:
    assert told(name, 40.0).causes[0].held_out_gain > 0.0


@pytest.mark.parametrize("name", ["nothing", "jsbsim-nothing", "plant-nothing"])
def test_nothing_is_claimed_where_nothing_is_hidden(name: str) -> None:
    found = told(name)
    assert found.causes == ()
    assert found.model is None
    assert found.gain is None


def test_a_jetstream_with_late_inertial_sensors_is_seen_through() -> None:
    """The thesis's own case (7.6.3): 50 ms on rates and attitude, 60 ms on accelerometers, impulses of the elevator."""
    case = FIXED["inertial-delay"]()
    flown, other = first(case.flight, 40.0), first(case.held_out, 40.0)
    found = diagnose(flown, case.aircraft, kinds=case.kinds, validate=other)
    late = {cause.label: cause.parameters["delay_s"] for cause in found.causes}
    assert list(late) == ["sensor_delay[inertial]", "sensor_delay[specific_force_z_m_s2]"]
    all_of_them, more = late.values()
    for found_s, true_s in ((all_of_them, 0.05), (more, 0.01)):
        assert abs(found_s.value - true_s) < 3.0 * found_s.standard_error < 0.005
    assert found.gain is not None
    assert found.gain.after["pitch_rate_rad_s"].r_squared > 0.99
    assert found.derivatives["m_q"][1] == found.derivatives["m_q"][0] < 0.0
