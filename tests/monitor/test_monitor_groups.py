"""Ice on several vehicles of one area is shown as one event."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fleet_hall import OLD_ALERT, Hall, fly_doublets

from wingwatch.monitor import AlertState, AlertView
from wingwatch.monitor.fleet.groups import ABOVE_M, NEAR_M, WITHIN_S, IcingGroups
from wingwatch.monitor.positions import Place, Position, near_one_another, position_of
from wingwatch.telemetry import SampleBlock

HERE = Position(50.0, 10.0, 1000.0)
DEGREE_M = 111_195.0
"""Of a great circle."""


def ice(number: int, **changes: Any) -> AlertView:
    return replace(OLD_ALERT, id=f"a{number}", vehicle=f"uav{number}", **changes)


def north(metres: float, up_m: float = 0.0) -> Position:
    return Position(HERE.latitude_deg + metres / DEGREE_M, HERE.longitude_deg, HERE.altitude_m + up_m)


def grouped(*noted: tuple[AlertView, Position | None, float]) -> list[tuple[str, ...]]:
    groups = IcingGroups()
    for alert, position, at_s in noted:
        groups.note(alert, position, at_s)
    newest_first = [alert for alert, *_ in reversed(noted)]
    return [tuple(group.alerts) for group in groups.groups(newest_first)]


@pytest.mark.parametrize(
    ("position", "at_s", "together"),
    [
        (north(0.99 * NEAR_M), 0.0, True),
        (north(1.01 * NEAR_M), 0.0, False),
        (north(0.0, 0.99 * ABOVE_M), 0.0, True),
        (north(0.0, -1.01 * ABOVE_M), 0.0, False),
        (HERE, WITHIN_S, True),
        (HERE, WITHIN_S + 1.0, False),
        (None, 0.0, False),
    ],
)
def test_near_is_within_a_cloud_and_half_an_hour(
    position: Position | None, at_s: float, together: bool
) -> None:
    found = grouped((ice(1), HERE, 0.0), (ice(2), position, at_s))
    assert found == ([("a1", "a2")] if together else [])


def test_a_chain_of_neighbours_is_one_area_and_another_area_another_group() -> None:
    far = Position(-40.0, 179.9, 500.0)
    across = Position(-40.0, -179.9, 500.0)
    found = grouped(
        (ice(1), far, 0.0),
        (ice(2), across, 5.0),
        (ice(3), north(0.0), 0.0),
        (ice(4), north(1.8 * NEAR_M), 0.0),
        (ice(5), north(0.9 * NEAR_M), 0.0),
    )
    assert found == [("a3", "a4", "a5"), ("a1", "a2")]


def test_only_ice_in_force_on_several_vehicles_makes_a_group() -> None:
    damage = ice(2, kind="damage", cause="wing_damage")
    same = replace(ice(2), vehicle="uav1")
    assert grouped((ice(1), HERE, 0.0), (damage, HERE, 0.0)) == []
    assert grouped((ice(1), HERE, 0.0), (same, HERE, 0.0)) == []
    groups = IcingGroups()
    for alert in (ice(1), ice(2)):
        groups.note(alert, HERE, 0.0)
    groups.note(over := replace(ice(2), state=AlertState.CLEARED), HERE, 10.0)
    assert groups.groups([over, ice(1)]) == []


def test_where_it_was_first_counts_until_it_comes_back() -> None:
    again = ice(2, note=("wingwatch: raised again (1)",))
    first = (ice(1), HERE, 0.0), (ice(2), HERE, 0.0)
    assert grouped(*first, (ice(2, size=0.3), north(9.0 * NEAR_M), 60.0))[0] == ("a1", "a2", "a2")
    groups = IcingGroups()
    for alert, position, at_s in (*first, (again, north(9.0 * NEAR_M), 60.0)):
        groups.note(alert, position, at_s)
    assert groups.groups([again, ice(1)]) == []


def test_a_group_says_where_and_on_how_many_with_the_worst_level() -> None:
    groups = IcingGroups()
    west = Position(-33.5, -70.25, 2000.0)
    for alert in (ice(1), ice(2, level="critical")):
        groups.note(alert, west, 0.0)
    (group,) = groups.groups([ice(2, level="critical"), ice(1)])
    assert group.text.startswith("Ice on 2 vehicles near 33.50° S 70.25° W at 2000 m.")
    assert (group.id, group.level) == ("group-a1", "critical")
    assert group.vehicles == (("default", "uav1"), ("default", "uav2"))


def test_nothing_is_near_nothing() -> None:
    assert near_one_another([], 1.0, 1.0, 1.0) == []
    assert near_one_another([Place(HERE, 0.0)], 1.0, 1.0, 1.0) == [0]


def test_the_last_sample_that_says_where_counts() -> None:
    values = SampleBlock.from_columns(
        {
            "time_s": np.arange(3.0),
            "latitude_deg": np.array([1.0, 2.0, np.nan]),
            "longitude_deg": np.array([10.0, 20.0, 30.0]),
            "altitude_m": np.array([100.0, 200.0, 300.0]),
        }
    )
    assert position_of(values) == Position(2.0, 20.0, 200.0)
    assert position_of(SampleBlock(values.values[2:])) is None
    assert position_of(SampleBlock(values.values[:0])) is None


def test_the_fleet_groups_alerts_of_vehicles_whose_clocks_differ() -> None:
    hall, flight = Hall(), fly_doublets(3.0)
    later = SampleBlock(flight.values.copy())
    later.values[:, 0] += 50_000.0
    for vehicle, samples in (("one", flight), ("two", later)):
        hall.announce(vehicle)
        hall.fly(samples, 0, 3, vehicle)
        raised_s = float(samples.time_s[-1]) - 0.5
        hall.fleet._alerts.keep(replace(OLD_ALERT, id=vehicle, vehicle=vehicle, raised_s=raised_s))
    (group,) = hall.fleet.alert_groups()
    assert group.vehicles == (("default", "one"), ("default", "two"))
