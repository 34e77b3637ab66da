"""Events kept for listeners who come back: bounded, in order, and nothing that matters lost behind derivatives."""

from wingwatch.monitor.fleet.kept_events import KeptEvents
from wingwatch.monitor.fleet.settings import FleetSettings


def solve(kept: KeptEvents, vehicles: int, seconds: int) -> None:
    for half_second in range(2 * seconds):
        for v in range(vehicles):
            kept.add("derivatives", {"fleet": "north", "vehicle": f"uav-{v}", "time_s": 0.5 * half_second})


def test_behind_a_minute_of_500_vehicles_an_alert_is_still_there() -> None:
    kept = KeptEvents(FleetSettings().kept_events)
    solve(kept, 500, 1)
    seen = kept.newest
    alert = kept.add("alert", {"id": "a1"})
    solve(kept, 500, 60)
    missed = kept.after(seen)
    assert kept.complete_after <= seen
    assert (missed[0].id, missed[0].kind) == (alert, "alert")
    assert len(missed) == 501
    assert {event.data["time_s"] for event in missed[1:]} == {59.5}
    assert [event.id for event in missed] == sorted(event.id for event in missed)
    assert kept.forgotten == 0


def test_what_happened_is_not_replaced_and_the_oldest_is_forgotten() -> None:
    kept = KeptEvents(5)
    for number in range(1, 8):
        assert kept.add("status", {"fleet": "north", "vehicle": "uav", "state": "stale"}) == number
    assert [event.id for event in kept.after(-1)] == [3, 4, 5, 6, 7]
    assert (kept.complete_after, kept.forgotten) == (2, 2)
    assert [event.id for event in kept.after(5)] == [6, 7]
    assert kept.after(7) == kept.after(1000) == []


def test_more_vehicles_than_room_are_bounded_and_said_to_be_incomplete() -> None:
    kept = KeptEvents(100)
    solve(kept, 150, 2)
    assert len(kept.after(0)) == 100
    assert kept.complete_after == kept.newest - 100
