"""What a gateway sees of a fleet that a worker watches is what the worker's own monitor says."""

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fleet_hall import OLD_ALERT, FakeStore, Hall, fly_doublets
from worker_hall import Gateway, Reports, Said, hub, plain, until, worker

from wingwatch.api import DiagnosisState, DiagnosisView, WorkerSilentError
from wingwatch.baselines import DatabaseError
from wingwatch.monitor import AlertAction, AlertState, KeyReusedError
from wingwatch.simulation import ElevatorEffectiveness

DONE = DiagnosisView("d1", DiagnosisState.DONE, "aerosonde", "alert a1", 0, "done", 1.0, "", {"causes": []})


@pytest.fixture(scope="module")
def flown() -> Iterator[Any]:
    """A fleet of two, one with a fault and an alert, watched by a worker and seen by a gateway."""
    hall = Hall(store=FakeStore(earlier=[OLD_ALERT]))
    hall.announce()
    hall.fly(fly_doublets(130.0, ElevatorEffectiveness(0.5, 60.0)), 0, 130)
    hall.announce("still", mass_kg=11.0)
    said = Said("w1", {"loop": {"faults": 2}}, hall.fleet.figures)
    reports = Reports([DONE], {"d1": b"<html>"})
    with hub() as (_, endpoint), worker(endpoint, hall.fleet, said, reports) as answers:
        gateway = Gateway(endpoint, lambda: hall.fleet.alerts())
        try:
            until(lambda: len(gateway.fleet.vehicles()) == 2 and gateway.fleet.alerts())
            yield SimpleNamespace(
                hall=hall, local=hall.fleet, remote=gateway.fleet, gateway=gateway, answers=answers
            )
        finally:
            gateway.close()


def test_all_vehicles_are_as_their_worker_shows_them(flown: Any) -> None:
    local = [replace(view, worker="w1") for view in flown.local.vehicles()]
    assert plain(flown.remote.vehicles()) == plain(local)
    assert {view.vehicle for view in local} == {"uav", "still"}


def test_one_vehicle_is_asked_for_whole(flown: Any) -> None:
    view = flown.remote.vehicle("default", "uav")
    assert plain(view) == plain(replace(flown.local.vehicle("default", "uav"), worker="w1"))
    assert view.could_see
    assert flown.remote.vehicle("default", "nobody") is None


@pytest.mark.parametrize("question", ["derivatives", "manoeuvres", "flight_record"])
def test_what_is_asked_of_one_vehicle_is_the_same(flown: Any, question: str) -> None:
    for vehicle in ("uav", "still", "nobody"):
        local = getattr(flown.local, question)("default", vehicle)
        assert plain(getattr(flown.remote, question)("default", vehicle)) == plain(local)
    assert getattr(flown.remote, question)("default", "uav")


def test_expectations_at_flown_conditions_are_the_same_to_the_last_bit(flown: Any) -> None:
    conditions = np.array([[25.0, 1000.0, 1.1116, 0.04], [30.0, 500.0, 1.16, np.nan]])
    asked = ("default", "uav", "short_period", ("aerosonde", "clean"), conditions)
    local, remote = flown.local.expected(*asked), flown.remote.expected(*asked)
    assert local is not None
    assert remote is not None
    for ours, theirs in zip(local, remote, strict=True):
        np.testing.assert_array_equal(theirs, ours)
    assert flown.remote.expected("default", "uav", "short_period", ("twin", "clean"), conditions) is None


def test_alerts_groups_events_and_figures_are_the_same(flown: Any) -> None:
    until(lambda: plain(flown.remote.alerts()) == plain(flown.local.alerts()))
    assert flown.local.alerts()
    assert plain(flown.remote.alert_groups()) == plain(flown.local.alert_groups())
    assert plain(flown.remote.figures()) == plain(flown.local.figures())
    assert {alert.id for alert in flown.gateway.heard} == {alert.id for alert in flown.local.alerts()}


def test_an_event_of_the_worker_is_one_of_the_gateway(flown: Any) -> None:
    newest = max((event.id for event in flown.remote.events(-1)), default=0)
    flown.hall.announce("another")
    flown.hall.fly(fly_doublets(2.0), 0, 2, "another")
    flown.hall.clock.now_s += 20.0
    flown.local.tick()
    until(lambda: flown.remote.vehicle("default", "another"))
    until(lambda: any(e.data.get("vehicle") == "another" for e in flown.remote.events(newest)))
    assert flown.remote.events_complete_after() == 0


def test_a_person_acts_on_an_alert_through_its_worker(flown: Any) -> None:
    alert = next(one for one in flown.remote.alerts() if one.vehicle == "uav")
    acted = flown.remote.act_on_alert(alert.id, AlertAction.ACKNOWLEDGE, "lead", "seen", "key-1")
    assert acted is not None
    assert acted.state is AlertState.ACKNOWLEDGED
    assert plain(acted) == plain(next(one for one in flown.local.alerts() if one.id == alert.id))
    assert plain(flown.remote.alerts()) == plain(flown.local.alerts())
    with pytest.raises(ValueError, match="acknowledged"):
        flown.remote.act_on_alert(alert.id, AlertAction.ACKNOWLEDGE, "lead", "seen", "key-2")
    assert flown.remote.act_on_alert("nothing", AlertAction.ACKNOWLEDGE, "lead", "") is None


@pytest.mark.parametrize(
    "fault", [DatabaseError("the database sleeps"), KeyReusedError("this key is another's")]
)
def test_a_refusal_keeps_its_kind_and_its_words(
    flown: Any, fault: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise fault

    monkeypatch.setattr(flown.local, "act_on_alert", refuse)
    with pytest.raises(type(fault), match=str(fault)):
        flown.remote.act_on_alert("old", AlertAction.CLEAR, "lead", "", "key-3")


def test_reports_of_alerts_come_from_their_worker(flown: Any) -> None:
    assert plain(flown.remote.diagnoses()) == plain([DONE])
    assert flown.remote.report("d1") == b"<html>"
    assert flown.remote.report("d2") is None


def test_a_question_that_is_none_is_counted_and_not_answered(flown: Any) -> None:
    with pytest.raises(WorkerSilentError, match="w1 has not answered"):
        flown.remote._link.ask("w1", "vehicle", b"[{]", 1.0)
    with pytest.raises(WorkerSilentError, match="w1 has not answered"):
        flown.remote._link.ask("w1", "secrets", b"", 1.0)  # nobody hears it
    assert flown.answers.dropped == 1
