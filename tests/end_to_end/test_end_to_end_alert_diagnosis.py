"""An alert that the monitor raises as unknown is corrected by a diagnosis of the vehicle's last minutes."""

import itertools
import time
from pathlib import Path

import pytest

from wingwatch.aircraft import Aircraft, load_aircraft
from wingwatch.monitor import AlertState, FleetMonitor, FleetSettings
from wingwatch.operations.diagnosis_change import RING_CHANNELS
from wingwatch.service.alert_diagnoses import AlertDiagnoses
from wingwatch.service.diagnosis_jobs import DiagnosisJobs
from wingwatch.simulation import CgShift, Scenario, doublet_schedule, simulate
from wingwatch.telemetry import PROTOBUF, AircraftMessage, SampleBlock, encode_aircraft, encode_sensors

ONSET_S, SHIFT_M, RAISED_BY_S = 40.0, 0.03, 75.0
PATIENCE_S = 300.0
MESSAGE = 10


def library(name: str) -> Aircraft:
    return load_aircraft(name)


def watched_flight(aircraft: Aircraft) -> FleetMonitor:
    """A fleet of one whose centre of gravity moves aft in still air, watched until the alert is there."""
    assert aircraft.envelope is not None
    doublets = doublet_schedule(aircraft, aircraft.envelope.cruise)
    shift = CgShift(SHIFT_M, ONSET_S)
    flown = simulate(Scenario(aircraft, manoeuvres=(doublets,), effects=(shift,), seed=3), RAISED_BY_S)
    ids = itertools.count(1)
    fleet = FleetMonitor(
        library, lambda: 0.0, lambda: f"a{next(ids)}", settings=FleetSettings(ring_channels=RING_CHANNELS)
    )
    fleet.receive(
        "default", "uav", "aircraft", encode_aircraft(AircraftMessage(aircraft="aerosonde")), PROTOBUF
    )
    for number, start in enumerate(range(0, len(flown), MESSAGE)):
        block = SampleBlock(flown.values[start : start + MESSAGE])
        fleet.receive("default", "uav", "sensors", encode_sensors(number, block), PROTOBUF)
    return fleet


def test_a_shifted_centre_of_gravity_is_found_behind_an_unknown_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    fleet = watched_flight(load_aircraft("aerosonde"))
    (before,) = fleet.alerts()
    assert (before.cause, before.channel, before.note) == ("unknown", None, ())
    with DiagnosisJobs(library) as jobs:
        diagnoses = AlertDiagnoses(fleet, jobs)
        diagnoses.look()
        assert +diagnoses.counts == {"begun": 1}
        deadline = time.monotonic() + PATIENCE_S
        while not fleet.alerts()[0].note:
            assert time.monotonic() < deadline, "waited in vain"
            time.sleep(0.05)
        (after,) = fleet.alerts()
        (view,) = jobs.diagnoses()
        report = jobs.report(view.id)
    assert (after.id, after.state, after.kind, after.cause) == ("a1", AlertState.ACTIVE, "damage", "cg_shift")
    assert after.size == pytest.approx(SHIFT_M, abs=1.96 * after.size_standard_error)
    assert after.size_standard_error < 0.1 * SHIFT_M
    assert after.note[0].startswith("diagnosis: corrects unknown to cg_shift 0.030 ± 0.001 m since 4")
    assert after.diagnosis_id == view.id
    assert report is not None
    assert b"cg_shift" in report
    assert fleet.events(0)[-1].data["cause"] == "cg_shift"
