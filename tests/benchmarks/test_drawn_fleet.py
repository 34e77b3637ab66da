"""The fleet that the page's benchmark draws: it flies, and it can be acted upon."""

from drawn_fleet import DrawnFleet

from wingwatch.monitor.views import AlertAction, AlertState, VehicleState


def test_a_drawn_fleet_repeats_by_its_seed_flies_and_is_acted_upon() -> None:
    fleet, again = DrawnFleet(12, alerts=3, seed=4), DrawnFleet(12, alerts=3, seed=4)
    assert [view.worst for view in fleet.vehicles()] == [view.worst for view in again.vehicles()]
    assert [view.state for view in fleet.vehicles()][:3] == [VehicleState.DEGRADED] * 3
    before = fleet.vehicles()
    fleet.step()
    after = fleet.vehicles()
    assert after[0].last_sample_time_s == 118.5
    assert after[0].worst != before[0].worst
    assert len(fleet.events(0)) == sum(view.state is not VehicleState.STALE for view in after)
    acted = fleet.act_on_alert("a2", AlertAction.SHELVE, "ana", "soon down")
    assert acted is not None
    assert (acted.state, acted.note) == (AlertState.SHELVED, ("ana: shelve (soon down)",))
    assert fleet.act_on_alert("a9", AlertAction.CLEAR, "ana", "") is None
