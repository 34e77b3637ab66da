"""What `monitor` prints of an alert without evidence, of its part and candidates, and of what a flight could show."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from cli_flights import demo_block, run

from wingwatch.cli import monitor_command
from wingwatch.cli.flight_watch import Watched, watch
from wingwatch.monitor import (
    AlertState,
    AlertView,
    CandidateView,
    CouldSeeView,
    EvidenceView,
    VehicleMonitor,
)
from wingwatch.telemetry import write_flight

EVIDENCE = EvidenceView("m_q", -5.0, 0.1, -6.0, 0.2, 4.5)
ALERT = AlertView(
    id="alert-1", fleet="default", vehicle="offline", kind="sensor", cause="sensor_bias", level="warning",
    state=AlertState.ACTIVE, raised_s=9.5, cleared_s=None, size=0.02, size_standard_error=0.003, probability=0.62,
    basis="empirical", text="The pitch rate [of a kind] reads too much.", evidence=(), channel="pitch_rate_rad_s",
    candidates=(CandidateView("sensor_bias", "pitch_rate_rad_s", 0.62), CandidateView("icing", None, 0.0004)),
)  # fmt: skip
COULD_SEE = (
    CouldSeeView("sensor_bias", "pitch_rate_rad_s", 0.0123456, "rad/s"),
    CouldSeeView("thrust_loss", "throttle", None, "", "a change of the throttle"),
    CouldSeeView("icing", None, 0.08, ""),
    CouldSeeView("sensor_freeze", "pitch_rad", 1.0, ""),
)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flights") / "healthy.parquet"
    write_flight(demo_block("healthy", 10.0), path)
    return path


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Have the command's watch end with these alerts, and its vehicle with what it could have seen."""

    def end_with(alerts: Sequence[AlertView], could_see: Sequence[CouldSeeView] = ()) -> None:
        def watched(*arguments: Any, **options: Any) -> Watched:
            return replace(watch(*arguments, **options), alerts=tuple(alerts), conditions={})

        monkeypatch.setattr(VehicleMonitor, "could_see", lambda _: could_see)
        monkeypatch.setattr(monitor_command, "watch", watched)

    return end_with


def test_an_alert_of_a_sensor_names_its_part_and_candidates(
    capsys: pytest.CaptureFixture[str], flight: Path, shown: Any
) -> None:
    shown([ALERT])
    ran = run(capsys, ["monitor", flight, "--aircraft", "aerosonde"])
    assert ran.code == 0
    text = " ".join(ran.out.split())
    assert "warning alert-1 (pitch_rate_rad_s) raised at 9.5 s: The pitch rate [of a kind] reads" in text
    assert (
        "Possible causes: sensor bias of pitch_rate_rad_s, probability 0.62; icing, probability < 0.001"
        in text
    )
    assert "derivative" not in ran.out.split("alert-1")[1]  # the head of a table of evidence
    assert "could have shown" not in ran.out


@pytest.mark.parametrize("convention", ["concise", "dimensional", "american"])
def test_an_alert_without_evidence_in_every_convention(
    capsys: pytest.CaptureFixture[str], flight: Path, shown: Any, convention: str
) -> None:
    shown([ALERT])
    command = ["monitor", flight, "--aircraft", "aerosonde", "--convention", convention]
    result = run(capsys, [*command, "--json"]).json
    (alert,) = result["alerts"]
    assert (alert["channel"], alert["evidence"]) == ("pitch_rate_rad_s", [])
    assert alert["candidates"] == [
        {"cause": "sensor_bias", "channel": "pitch_rate_rad_s", "probability": 0.62},
        {"cause": "icing", "channel": None, "probability": 0.0004},
    ]
    assert result["could_see"] == []
    assert run(capsys, command).code == 0


def test_an_alert_of_the_airframe_is_printed_as_before(
    capsys: pytest.CaptureFixture[str], flight: Path, shown: Any
) -> None:
    unknown_z = EvidenceView("m_w", math.nan, math.inf, -4.0, 0.2, math.nan)
    shown([replace(ALERT, channel=None, candidates=(), evidence=(EVIDENCE, unknown_z))])
    out = run(capsys, ["monitor", flight, "--aircraft", "aerosonde"]).out
    assert "warning alert-1 raised at 9.5 s" in out
    assert "Possible causes" not in out
    assert "-5 ± 0.1" in out
    assert "4.5" in out


def test_what_a_flight_could_have_shown(capsys: pytest.CaptureFixture[str], flight: Path, shown: Any) -> None:
    shown([], COULD_SEE)
    out = run(capsys, ["monitor", flight, "--aircraft", "aerosonde"]).out
    after = out.split("No alert.")[1]
    assert "What this flight could have shown" in after
    rows = [
        [cell.strip() for cell in line.strip("│").split("│")] for line in after.splitlines() if "│" in line
    ]
    assert rows == [
        ["sensor bias", "pitch_rate_rad_s", "0.0123 rad/s", "-"],
        ["thrust loss", "throttle", "not seen", "a change of the throttle"],
        ["icing", "airframe", "0.08", "-"],
        ["sensor freeze", "pitch_rad", "seen", "-"],
    ]
    result = run(capsys, ["monitor", flight, "--aircraft", "aerosonde", "--json"]).json
    assert result["could_see"] == [
        {
            "cause": "sensor_bias",
            "channel": "pitch_rate_rad_s",
            "smallest_size": 0.0123456,
            "unit": "rad/s",
            "input": "",
        },
        {
            "cause": "thrust_loss",
            "channel": "throttle",
            "smallest_size": None,
            "unit": "",
            "input": "a change of the throttle",
        },
        {"cause": "icing", "channel": None, "smallest_size": 0.08, "unit": "", "input": ""},
        {"cause": "sensor_freeze", "channel": "pitch_rad", "smallest_size": 1.0, "unit": "", "input": ""},
    ]
