"""Effects hidden in flights are found, and nothing is found where nothing is hidden.

The flights are those of ``benchmarks/diagnosis_cases``, which shares no code with the diagnosis; the benchmark flies
hundreds, here are a few fixed ones.
"""

import json
from pathlib import Path
from typing import Any

import pytest
from diagnosis_cases import FIXED
from diagnosis_score import judged

from wingwatch.aircraft import aircraft_toml
from wingwatch.cli.main import main
from wingwatch.diagnosis import Diagnosis, diagnose
from wingwatch.diagnosis.evidence import SIMULATION_ERROR
from wingwatch.telemetry import SampleBlock, write_flight

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


def first(flight: SampleBlock, seconds: float) -> SampleBlock:
    return SampleBlock(flight.values[: round(50.0 * seconds)])


def diagnosed(name: str, seconds: float = 60.0) -> Diagnosis:
    """What is said of the first seconds of a case; what is hidden must be named first."""
    case = FIXED[name]()
    found = diagnose(first(case.flight, seconds), case.aircraft, kinds=case.kinds)
    if case.effects:
        verdict = judged(case, found, 0.0)
        assert verdict.first, (name, verdict.said)
    return found


@pytest.mark.parametrize(("name", "seconds"), [("slow-actuator", 60.0)])
def test_what_is_hidden_in_a_simulated_flight_is_named_first(name: str, seconds: float) -> None:
    found = diagnosed(name, seconds)
    assert found.gain is not None
    assert found.gain.source == "windows left out"
    assert min(change.value for change in found.gain.change.values()) < -0.05
    for parameter in found.causes[0].parameters.values():
        assert parameter.standard_error >= 0.999 * SIMULATION_ERROR * abs(parameter.value)


@pytest.mark.parametrize("name", ["jsbsim-weak-elevator"])
def test_what_is_hidden_in_a_flight_of_others_is_named_first(name: str) -> None:
    assert diagnosed(name, 30.0).causes[0].held_out_gain > 0.0


@pytest.mark.parametrize(("name", "seconds"), [("nothing", 60.0), ("jsbsim-nothing", 30.0)])
def test_nothing_is_claimed_where_nothing_is_hidden(name: str, seconds: float) -> None:
    found = diagnosed(name, seconds)
    assert found.causes == ()
    assert found.model is None
    assert found.gain is None


def asked(capsys: pytest.CaptureFixture[str], *arguments: object) -> Any:
    """The object that a command prints with ``--json``."""
    assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_jetstream_with_late_inertial_sensors_is_seen_through_from_the_command_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """The thesis's own case (7.6.3): 50 ms on rates and attitude, 60 ms on accelerometers, impulses of the elevator."""
    case = FIXED["inertial-delay"]()
    flight, other, stated, extended = (
        tmp_path / name for name in ("flight.csv", "other.csv", "jetstream.toml", "extended.toml")
    )
    write_flight(case.flight, flight)
    write_flight(case.held_out, other)
    stated.write_text(aircraft_toml(case.aircraft, "as stated"))
    found = asked(capsys, "diagnose", flight, "--aircraft", stated, "--validate", other, "--model", extended)

    late = {cause["label"]: cause["parameters"]["delay_s"] for cause in found["causes"]}
    assert list(late) == ["sensor_delay[inertial]", "sensor_delay[specific_force_z_m_s2]"]
    for delay, true_s in zip(late.values(), (0.05, 0.01), strict=True):
        assert abs(delay["value"] - true_s) < 3.0 * delay["standard_error"] < 0.005
    assert found["gain"]["source"] == "another flight"
    for channel in ("pitch_rate_rad_s", "specific_force_z_m_s2"):
        before, after = (
            found["gain"]["held_out"][channel][when]["r_squared"] for when in ("before", "after")
        )
        assert after > 0.99 > before, channel

    def damping(aircraft: Path) -> Any:
        diagnosed = asked(capsys, "estimate", flight, "--aircraft", aircraft, "--estimator", "equation-error")
        return diagnosed["estimators"]["equation-error"]["short_period"]["derivatives"]["m_q"]

    without, mended = damping(stated), damping(extended)
    assert without["value"] + 1.96 * without["standard_error"] > 0.0  # of its sign nothing is known
    assert mended["value"] + 4.0 * mended["standard_error"] < 0.0
    assert abs(mended["value"] + 1.547) < 3.0 * mended["standard_error"]
