"""An alert that comes back opens again: one that says how often, in the place of a chain of new ones."""

from collections.abc import Callable
from dataclasses import replace
from typing import cast

import pytest
from redundancy_flights import flown, watched

from wingwatch.monitor import AlertAction, AlertState, AlertView
from wingwatch.monitor.detection.alerts import AlertBook, act, raised_again
from wingwatch.monitor.detection.redundancy import RedundancyWatch, VehicleRelations
from wingwatch.monitor.detection.redundancy.book import RedundancyBook
from wingwatch.monitor.detection.vehicle_alerts import REPEAT_S, VehicleAlerts
from wingwatch.monitor.fleet.alert_ledger import AlertLedger
from wingwatch.monitor.ports import ActionRequest
from wingwatch.monitor.views import Shelving, repeats_in
from wingwatch.telemetry import CHANNEL_INDEX

CLEARED, SHELVED, ACTIVE = AlertState.CLEARED, AlertState.SHELVED, AlertState.ACTIVE
ICE = AlertView(
    id="a1", fleet="f", vehicle="v", kind="icing", cause="icing", level="watch", state=ACTIVE, raised_s=100.0,
    cleared_s=None, size=0.1, size_standard_error=0.01, probability=0.95, basis="a-priori", text="Ice.", evidence=(),
)  # fmt: skip
GYRO = replace(ICE, kind="sensor", cause="sensor_bias", channel="pitch_rate_rad_s")


class Relations:
    """A book that does as it says."""

    def __init__(self) -> None:
        self.book = RedundancyBook("f", "v", str, cast(RedundancyWatch, None))
        self.state = self.book.state
        self.taken: list[AlertView] = []

    def take_over(self, alert: AlertView, now_s: float) -> None:
        self.taken.append(alert)
        self.state.active = [one for one in self.state.active if one.id != alert.id]


class Life:
    """Alerts of a vehicle, raised and cleared by hand as their books would."""

    def __init__(self) -> None:
        self.book, self.relations = AlertBook("f", "v", str), Relations()
        self.alerts = VehicleAlerts(self.book, cast(VehicleRelations, self.relations))

    def raise_(self, alert: AlertView) -> AlertView:
        if alert.channel is None:
            self.book.active = alert
        else:
            self.relations.state.active.append(alert)
        (said,) = self.alerts.announced([alert])
        return said

    def clear(self, now_s: float) -> AlertView:
        mine = self.alerts.active[0]
        self.book.active, self.relations.state.active = None, []
        (said,) = self.alerts.announced([replace(mine, state=CLEARED, cleared_s=now_s)])
        return said


@pytest.mark.parametrize("alert", [ICE, GYRO])
def test_within_five_minutes_the_same_cause_and_part_is_the_same_alert(alert: AlertView) -> None:
    life = Life()
    assert life.raise_(alert) == alert
    life.clear(150.0)
    again = life.raise_(replace(alert, id="a2", raised_s=150.0 + REPEAT_S - 1.0, size=0.2))
    assert (again.id, again.repeats, again.state, again.cleared_s) == ("a1", 1, ACTIVE, None)
    assert (again.raised_s, again.size) == (150.0 + REPEAT_S - 1.0, 0.2), "it is as it is now"
    assert [one.id for one in life.alerts.active] == ["a1"], "its book follows it under that name"
    life.clear(500.0)
    third = life.raise_(replace(alert, id="a3", raised_s=510.0))
    assert (third.id, third.note) == ("a1", ("wingwatch: raised again (2)",))


@pytest.mark.parametrize(
    "other",
    [
        replace(ICE, id="a2", raised_s=150.0 + REPEAT_S),
        replace(ICE, id="a2", raised_s=160.0, cause="unknown", kind="unexplained"),
        replace(GYRO, id="a2", raised_s=160.0),
        replace(ICE, id="a2", raised_s=20.0),  # of a clock that was set back
    ],
)
def test_later_or_another_cause_or_part_is_another_alert(other: AlertView) -> None:
    life = Life()
    life.raise_(ICE)
    life.clear(150.0)
    assert life.raise_(other) == other


@pytest.mark.parametrize("causes", [("sensor_bias", "unknown"), ("unknown", "sensor_bias")])
def test_a_part_whose_fault_has_no_name_yet_is_the_same_part(causes: tuple[str, str]) -> None:
    life = Life()
    life.raise_(replace(GYRO, cause=causes[0]))
    life.clear(150.0)
    again = life.raise_(replace(GYRO, id="a2", raised_s=160.0, cause=causes[1]))
    assert (again.id, again.cause) == ("a1", causes[1])


def test_what_a_person_cleared_is_raised_anew() -> None:
    life = Life()
    life.raise_(ICE)
    life.alerts.take_over(replace(ICE, state=CLEARED), 120.0)
    assert life.book.active is None
    assert life.raise_(replace(ICE, id="a2", raised_s=130.0)).id == "a2"


def test_versions_of_one_call_go_under_the_same_name() -> None:
    """A long block of samples: the book has raised, changed and cleared before anybody could rename it."""
    life = Life()
    life.raise_(GYRO)
    life.clear(150.0)
    new = replace(GYRO, id="a2", raised_s=160.0)
    changed = replace(
        new, size=0.3, note=("wingwatch: sensor_bias became sensor_scale",), cause="sensor_scale"
    )
    gone = replace(changed, state=CLEARED, cleared_s=170.0)
    said = life.alerts.announced([new, changed, gone])
    assert [(one.id, one.state, one.repeats) for one in said] == [
        ("a1", ACTIVE, 1),
        ("a1", ACTIVE, 1),
        ("a1", CLEARED, 1),
    ]
    assert said[-1].note[-1].endswith("became sensor_scale")


def test_an_alert_that_changes_into_an_earlier_one_stays_itself() -> None:
    life = Life()
    life.raise_(ICE)
    life.clear(150.0)
    unknown = replace(ICE, id="a2", raised_s=160.0, cause="unknown", kind="unexplained")
    life.raise_(unknown)
    (said,) = life.alerts.announced([replace(unknown, cause="icing", kind="icing")])
    assert said.id == "a2"


def test_one_that_was_shelved_stays_on_the_shelf_until_it_is_worse() -> None:
    life, shelving = Life(), Shelving(5000.0, "watch", 0.1)
    life.raise_(ICE)
    life.alerts.take_over(replace(ICE, state=SHELVED, shelving=shelving, note=("ana: shelve",)), 110.0)
    cleared = life.clear(150.0)
    assert cleared.shelving == shelving
    again = life.raise_(replace(ICE, id="a2", raised_s=160.0))
    assert (again.state, again.shelving) == (SHELVED, shelving)
    ledger = AlertLedger(10)
    for version in (ICE, cleared):
        ledger.merge(version)
    assert ledger.merge(again).state is SHELVED
    assert ledger.merge(replace(again, size=0.5)).state is ACTIVE


def test_the_ledger_opens_it_again_with_all_that_was_noted_and_it_must_be_acknowledged_again() -> None:
    ledger = AlertLedger(10)
    ledger.merge(ICE)
    request = ActionRequest("a1", AlertAction.ACKNOWLEDGE, "ana", "seen")
    ledger.acted(ledger.changed(request, lambda _: None))
    over = replace(ICE, state=CLEARED, cleared_s=150.0)
    late = replace(over, note=("ana: acknowledge (seen)", "bo: looked"))
    ledger.merge(late)
    again = replace(ICE, raised_s=160.0, note=raised_again(("ana: acknowledge (seen)",)))
    kept = ledger.merge(again)
    assert kept.state is ACTIVE
    assert kept.note == ("ana: acknowledge (seen)", "bo: looked", "wingwatch: raised again (1)")
    ledger.merge(late_clear := replace(kept, state=CLEARED))
    assert ledger.merge(replace(late_clear, state=ACTIVE)).state is CLEARED, "the same raise does not open it"


@pytest.mark.parametrize(
    "says",
    [
        lambda: act(ICE, AlertAction.SHELVE, "wingwatch", "raised again (9)").note,
        lambda: ("raised again (9)",),
    ],
)
def test_a_person_cannot_make_it_count(says: Callable[[], tuple[str, ...]]) -> None:
    assert repeats_in(says()) == 0


def test_a_gyro_that_fails_comes_right_and_fails_again_is_one_alert_however_samples_are_cut() -> None:
    values = flown(seconds=100.0).copy()
    rate = values[:, CHANNEL_INDEX["pitch_rate_rad_s"]]
    rate[50 * 40 : 50 * 60] += 0.02
    rate[50 * 90 :] += 0.02
    _, alerts = watched(values, piece=250)
    assert {(a.id, a.channel) for a in alerts} == {("a1", "pitch_rate_rad_s")}
    first, last = alerts[0], alerts[-1]
    assert (first.repeats, last.repeats, last.state) == (0, 1, ACTIVE)
    assert 90.0 < last.raised_s < 100.0
    assert CLEARED in {a.state for a in alerts}
    _, whole = watched(values, piece=len(values))
    assert [(a.id, a.state, a.raised_s, a.repeats) for a in whole] == [
        (a.id, a.state, a.raised_s, a.repeats) for a in alerts
    ]
