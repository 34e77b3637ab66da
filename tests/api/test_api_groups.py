"""Groups of alerts, alerts that came back, and proposed inputs, as REST gives them."""

import dataclasses
from typing import Any

from api_fakes import FakeMonitor, alert, served, vehicle

from wingwatch.monitor.views import AlertGroupView, ProposedInputView

GROUP = AlertGroupView(
    "group-a1", "icing", "warning", ("a1", "a2"), (("default", "aero-2"), ("north", "aero-1")), 50.0, 10.5, 1000.0,
    "Ice on 2 vehicles.",
)  # fmt: skip
PROPOSAL = ProposedInputView(
    "p1", "rudder_rad", "doublet", 0.035, 0.22, 0.44, ((0.0, 0.035), (0.22, -0.035), (0.44, 0.0)),
    "A stuck rudder would not have been noticed yet.", 60.0, 120.0,
)  # fmt: skip


def filled() -> FakeMonitor:
    monitor = FakeMonitor()
    monitor.views = [vehicle("aero-2", unseen_surfaces=("rudder_rad",), proposed_input=PROPOSAL)]
    monitor.raised = [
        alert(1),
        alert(2, fleet="north", vehicle="aero-1", note=("wingwatch: raised again (2)",)),
        alert(3, kind="damage"),
    ]
    monitor.groups = [GROUP]
    return monitor


def answers(*paths: str) -> list[Any]:
    with served(filled()) as (_, client):
        return [client.get(path).json() for path in paths]


def test_every_alert_says_in_which_group_it_is_and_lists_have_the_groups() -> None:
    status, alerts, one, elsewhere = answers(
        "/v1/status", "/v1/alerts", "/v1/alerts/a2", "/v1/alerts?fleet=south"
    )
    assert {a["id"]: a["group"] for a in alerts["items"]} == {"a1": "group-a1", "a2": "group-a1", "a3": None}
    assert {a["id"]: a["group"] for a in status["alerts"]} == {"a1": "group-a1", "a2": "group-a1", "a3": None}
    assert (
        status["groups"]
        == alerts["groups"]
        == [
            {
                "id": "group-a1",
                "kind": "icing",
                "level": "warning",
                "alerts": ["a1", "a2"],
                "vehicles": ["default/aero-2", "north/aero-1"],
                "latitude_deg": 50.0,
                "longitude_deg": 10.5,
                "altitude_m": 1000.0,
                "text": "Ice on 2 vehicles.",
            }
        ]
    )
    assert (one["group"], one["repeats"]) == ("group-a1", 2)
    assert elsewhere["groups"] == []


def test_a_fleet_sees_a_group_whole_where_one_of_its_vehicles_is_in_it() -> None:
    north, south = answers("/v1/status?fleet=north", "/v1/status?fleet=south")
    assert [group["alerts"] for group in north["groups"]] == [["a1", "a2"]]
    assert south["groups"] == []


def test_a_vehicle_says_what_it_has_not_shown_and_what_would_help() -> None:
    (shown,) = answers("/v1/vehicles/aero-2")
    assert shown["unseen_surfaces"] == ["rudder_rad"]
    expected = dataclasses.asdict(PROPOSAL)
    expected["steps"] = [{"start_s": start_s, "deflection_rad": to_rad} for start_s, to_rad in PROPOSAL.steps]
    assert shown["proposed_input"] == expected
