"""Alerts of the running service diagnosed: which, when, how often, and what becomes of the answers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from wingwatch.aircraft import load_aircraft
from wingwatch.api import DiagnosisState, DiagnosisView, QueueFullError
from wingwatch.monitor import AlertFinding, AlertFlight, AlertState, AlertView, CandidateView, Event
from wingwatch.operations.diagnosis_change import ChangeRequest
from wingwatch.service.alert_diagnoses import AlertDiagnoses, is_diagnosed
from wingwatch.service.alert_findings import asked_causes, finding_of

AEROSONDE = load_aircraft("aerosonde")
ICING = AlertView(
    id="a", fleet="default", vehicle="uav", kind="icing", cause="icing", level="watch", state=AlertState.ACTIVE,
    raised_s=70.0, cleared_s=None, size=0.1, size_standard_error=0.02, probability=0.95, basis="empirical",
    text="Icing.", evidence=(),
)  # fmt: skip
UNKNOWN = replace(ICING, kind="unexplained", cause="unknown")
BIAS = replace(ICING, kind="sensor", cause="sensor_bias", channel="pitch_rate_rad_s")


def explained(cause: str, target: str = "", size: float = 0.12, **values: Any) -> dict[str, Any]:
    return {
        "cause": cause, "target": target, "parameters": {}, "size": size, "size_standard_error": 0.02, "unit": "",
        "evidence": 50.0, "probability": 0.99, "text": "", **values,
    }  # fmt: skip


def answered(outcome: str, *explanations: dict[str, Any], manoeuvre: str = "") -> DiagnosisView:
    result = {
        "outcome": outcome, "onset_s": 60.0, "explanations": list(explanations),
        "separating_manoeuvre": manoeuvre,
    }  # fmt: skip
    return DiagnosisView("d", DiagnosisState.DONE, "aerosonde", "alert", 0, "done", 1.0, "", result)


@dataclass
class Fleet:
    """A fleet with alerts as the test sets them."""

    last_s: float = 61.0
    flights: dict[str, AlertView] = field(default_factory=dict)
    announced: list[Event] = field(default_factory=list)
    findings: list[AlertFinding] = field(default_factory=list)

    def raise_alert(self, alert: AlertView) -> None:
        self.flights[alert.id] = alert
        data = {"id": alert.id, "state": str(alert.state), "kind": alert.kind, "cause": alert.cause}
        self.announced.append(Event(len(self.announced) + 1, "alert", data))

    def events(self, after: int) -> Sequence[Event]:
        return [event for event in self.announced if event.id > after]

    def alert_flight(self, alert_id: str) -> AlertFlight | None:
        if alert_id not in self.flights:
            return None
        time_s = np.linspace(0.0, self.last_s, 100)
        values = np.zeros((100, 1), dtype=np.float32)
        return AlertFlight(self.flights[alert_id], 60.0, AEROSONDE, {}, ("roll_rad",), time_s, values)

    def note_diagnosis(self, alert_id: str, finding: AlertFinding) -> bool:
        self.findings.append(finding)
        return alert_id in self.flights


@dataclass
class Queue:
    """Jobs that the test answers."""

    room: int = 8
    taken: list[tuple[ChangeRequest, Callable[[DiagnosisView], None]]] = field(default_factory=list)

    def diagnose(self, request: ChangeRequest, ended: Callable[[DiagnosisView], None]) -> DiagnosisView:
        if len(self.taken) >= self.room:
            raise QueueFullError("8 alerts wait for a diagnosis, the limit")
        self.taken.append((request, ended))
        return DiagnosisView(
            "d", DiagnosisState.QUEUED, "aerosonde", request.title, 0, "waiting", 0.0, "", None
        )


@dataclass
class Clock:
    now_s: float = 0.0

    def __call__(self) -> float:
        return self.now_s


def watched() -> tuple[Fleet, Queue, Clock, AlertDiagnoses]:
    fleet, queue, clock = Fleet(), Queue(), Clock()
    return fleet, queue, clock, AlertDiagnoses(fleet, queue, clock)


def test_twelve_seconds_of_flight_since_the_onset_are_waited_for() -> None:
    fleet, queue, _, diagnoses = watched()
    fleet.raise_alert(UNKNOWN)
    diagnoses.look()
    assert queue.taken == []
    fleet.last_s = 72.5
    diagnoses.look()
    ((request, _),) = queue.taken
    assert (request.onset_s, request.aircraft, request.asked) == (60.0, AEROSONDE, ())


def test_a_vehicle_that_falls_silent_is_waited_for_twelve_seconds_at_most() -> None:
    fleet, queue, clock, diagnoses = watched()
    fleet.raise_alert(UNKNOWN)
    diagnoses.look()
    clock.now_s = 12.0
    diagnoses.look()
    assert len(queue.taken) == 1


def test_an_alert_is_diagnosed_once_and_again_when_its_monitor_changes_the_cause() -> None:
    fleet, queue, _, diagnoses = watched()
    fleet.last_s = 100.0
    for alert in (UNKNOWN, replace(UNKNOWN, size=0.2), ICING, replace(ICING, size=0.2)):
        fleet.raise_alert(alert)
        diagnoses.look()
    assert [asked_causes(fleet.flights["a"]), [r.asked for r, _ in queue.taken]] == [
        ("icing",),
        [(), ("icing",)],
    ]


@pytest.mark.parametrize(
    ("alert", "wanted"),
    [
        (ICING, True),
        (UNKNOWN, True),
        (BIAS, False),
        (replace(UNKNOWN, channel="specific_force_x_m_s2"), True),
        (replace(BIAS, kind="damage", cause="surface_stuck", channel="rudder_rad"), False),
    ],
)
def test_alerts_of_the_airframe_or_of_unclear_cause_are_diagnosed(alert: AlertView, wanted: bool) -> None:
    assert is_diagnosed(alert) is wanted
    fleet, queue, _, diagnoses = watched()
    fleet.last_s = 100.0
    fleet.raise_alert(alert)
    diagnoses.look()
    assert bool(queue.taken) is wanted


def test_a_full_queue_says_so_in_a_note_and_a_count() -> None:
    fleet, queue, _, diagnoses = watched()
    queue.room, fleet.last_s = 0, 100.0
    fleet.raise_alert(ICING)
    diagnoses.look()
    assert [f.note for f in fleet.findings] == ["diagnosis: none, 8 alerts wait for a diagnosis, the limit"]
    assert +diagnoses.counts == {"refused": 1}


def test_the_answer_goes_to_the_alert_with_the_version_it_was_begun_with() -> None:
    fleet, queue, _, diagnoses = watched()
    fleet.last_s = 100.0
    fleet.raise_alert(UNKNOWN)
    diagnoses.look()
    queue.taken[0][1](answered("decided", explained("cg_shift", size=0.03, unit="m")))
    (finding,) = fleet.findings
    assert finding.begun_with == UNKNOWN
    assert finding.note == "diagnosis: corrects unknown to cg_shift 0.030 ± 0.020 m since 60 s"
    assert +diagnoses.counts == {"begun": 1, "decided": 1}


def test_what_decided_nothing_is_looked_at_once_more_with_more_flight() -> None:
    fleet, queue, _, diagnoses = watched()
    fleet.last_s = 75.0
    fleet.raise_alert(UNKNOWN)
    diagnoses.look()
    queue.taken[0][1](answered("nothing"))
    for last_s, begun in ((80.0, 1), (105.5, 2), (120.0, 2)):
        fleet.last_s = last_s
        diagnoses.look()
        assert len(queue.taken) == begun
    queue.taken[1][1](answered("nothing"))
    diagnoses.look()
    assert len(queue.taken) == 2


def test_a_failed_diagnosis_says_why() -> None:
    view = DiagnosisView("d", DiagnosisState.FAILED, "aerosonde", "alert", 0, "", 0.2, "it took longer", None)
    assert finding_of(ICING, view) == AlertFinding(ICING, "diagnosis: none, it took longer")


def test_a_confirmed_cause_brings_its_size_level_and_words() -> None:
    finding = finding_of(ICING, answered("decided", explained("icing", "tail")))
    assert finding.note == "diagnosis: confirms icing of tail 0.12 ± 0.02 since 60 s"
    assert finding.correction is not None
    assert (finding.correction.kind, finding.correction.level) == ("icing", "warning")
    assert finding.correction.text == (
        "Icing of severity 0.12 ± 0.02 (Twin Otter scale), since about 60 s. "
        "Leave the icing layer and keep airspeed up."
    )


def test_a_part_is_named_by_its_column() -> None:
    offset = explained("surface_offset", "elevator", 0.026, size_standard_error=0.001, unit="rad")
    finding = finding_of(UNKNOWN, answered("decided", offset))
    assert (
        finding.note
        == "diagnosis: corrects unknown to surface_offset of elevator 0.026 ± 0.001 rad since 60 s"
    )
    assert finding.correction is not None
    assert (finding.correction.channel, finding.correction.level) == ("elevator_rad", "watch")


def test_what_is_not_decided_changes_nothing() -> None:
    two = explained("icing", probability=0.6), explained("airspeed_error", size=0.1, probability=0.4)
    finding = finding_of(ICING, answered("not_separable", *two, manoeuvre="a doublet of the rudder would"))
    assert finding.correction is None
    assert finding.note == (
        "diagnosis: cannot distinguish icing from airspeed_error of airspeed_true_m_s; a doublet of the rudder would"
    )


def test_no_change_is_said_with_the_size_that_the_alerts_cause_has() -> None:
    finding = finding_of(
        replace(ICING, candidates=(CandidateView("icing", None, 0.6),)),
        answered("nothing", explained("icing", size=0.0)),
    )
    assert finding.correction is None
    assert finding.note == (
        "diagnosis: does not confirm icing (icing 0.00 ± 0.02): no change since 60 s that is beyond doubt"
    )
