"""What is said of an alert: each step once, to whom it concerns, in words that fit."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson
import pytest
from receivers import ICING, Bench

from wingwatch.monitor import AlertState
from wingwatch.notifications import Notice, Selection, Step, trial_notice
from wingwatch.notifications.alertmanager import alertmanager_document
from wingwatch.notifications.wording import described, short_text, summary

ACTIVE, ACKNOWLEDGED, SHELVED, CLEARED = AlertState


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path / "outbox.json")


def test_each_step_of_an_alert_is_said_once(bench: Bench) -> None:
    lives: tuple[dict[str, Any], ...] = (
        {},
        {"size": 0.2},  # no step
        {"level": "critical"},
        {"level": "critical", "note": ("ann: look",)},  # no step
        {"level": "critical", "cause": "wing_damage", "channel": None},
        {"level": "critical", "cause": "wing_damage", "diagnosis_id": "d1"},
        {"level": "critical", "cause": "wing_damage", "diagnosis_id": "d1", "state": ACKNOWLEDGED},
        {
            "level": "critical",
            "cause": "wing_damage",
            "diagnosis_id": None,
            "state": ACKNOWLEDGED,
        },  # after a restart
        {"level": "critical", "cause": "wing_damage", "diagnosis_id": "d1", "state": SHELVED},
        {"level": "critical", "cause": "wing_damage", "diagnosis_id": "d1", "state": ACTIVE},
        {"level": "watch", "cause": "icing", "diagnosis_id": "d2"},
        {"level": "watch", "cause": "icing", "state": CLEARED, "cleared_s": 99.0},
        {"level": "watch", "cause": "icing", "state": CLEARED, "cleared_s": 99.0, "note": ("ann: seen",)},
    )
    for life in lives:
        bench.hear(**life)
        bench.hear(**life)  # what is announced again is no step
    assert bench.channel.steps == [
        "a1 raised", "a1 level", "a1 cause", "a1 diagnosed", "a1 acknowledged", "a1 shelved", "a1 unshelved",
        "a1 level+cause+diagnosed", "a1 cleared",
    ]  # fmt: skip
    assert len({notice.key for notice in bench.channel.taken}) == 9
    assert {notice.raised_at_s for notice in bench.channel.taken} == {bench.wall_s}


def test_an_alert_that_comes_back_is_said_again(bench: Bench) -> None:
    bench.hear()
    bench.hear(state=CLEARED)
    bench.after(100.0)
    bench.hear(note=("wingwatch: raised again (1)",))
    bench.hear(
        note=("wingwatch: raised again (2)",)
    )  # it was cleared in between, and nobody saw that version
    assert bench.channel.steps == ["a1 raised", "a1 cleared", "a1 raised", "a1 raised"]
    assert bench.channel.taken[2].raised_at_s == bench.wall_s + 100.0
    assert "back for the 2. time" in summary(bench.channel.taken[2])


def test_what_was_never_said_is_not_cleared(bench: Bench) -> None:
    bench.hear(state=CLEARED)
    assert bench.channel.steps == []
    bench.hear(replace(ICING, id="a2"), state=SHELVED)
    assert bench.channel.steps == ["a2 raised"]


def test_an_alert_is_spoken_of_from_the_least_level_on_and_then_to_its_end(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "o.json", selection=Selection(least_level="warning"))
    for level, state in (("watch", ACTIVE), ("warning", ACTIVE), ("watch", ACTIVE), ("watch", CLEARED)):
        bench.hear(level=level, state=state)
    assert bench.channel.steps == ["a1 raised", "a1 level", "a1 cleared"]
    assert summary(bench.channel.taken[1]).startswith("uav1 (north), now watch (it was warning): ")


@pytest.mark.parametrize(
    ("selection", "said"),
    [
        (Selection(fleets=("north",)), True),
        (Selection(fleets=("south",)), False),
        (Selection(vehicles=("uav1",)), True),
        (Selection(vehicles=("north/uav1", "uav7")), True),
        (Selection(vehicles=("south/uav1",)), False),
        (Selection(fleets=("south",), vehicles=("uav1",)), False),
    ],
)
def test_a_channel_is_about_its_vehicles(tmp_path: Path, selection: Selection, said: bool) -> None:
    bench = Bench(tmp_path / "o.json", selection=selection)
    bench.hear()
    assert bool(bench.channel.taken) is said


def test_steps_that_nobody_wants_are_followed_in_silence(tmp_path: Path) -> None:
    selection = Selection(steps=(Step.RAISED, Step.CLEARED))
    bench = Bench(tmp_path / "o.json", selection=selection)
    for state in (ACTIVE, ACKNOWLEDGED, SHELVED, CLEARED):
        bench.hear(state=state)
    assert bench.channel.steps == ["a1 raised", "a1 cleared"]


def test_a_version_that_cannot_be_made_keeps_no_other_from_being_said(bench: Bench) -> None:
    def broken() -> object:
        raise RuntimeError("no version")

    bench.dispatcher.hear(broken)
    bench.hear()
    assert bench.channel.steps == ["a1 raised"]


def notice_at(bench: Bench, **changes: Any) -> Notice:
    bench.hear(**changes)
    return bench.channel.taken[-1]


def test_words_say_size_and_derivatives_with_intervals(bench: Bench) -> None:
    text = described(notice_at(bench))
    assert "Size: 0.16, with 95 % confidence between 0.121 and 0.199." in text
    assert "Probability of this cause: 97 %." in text
    assert "z_w (normal acceleration due to normal velocity): -2.8, 95 % interval -3 to -2.6 1/s; " in text
    assert "expected -3.6 to -3.4 1/s." in text
    in_degrees = notice_at(
        bench, id="a2", kind="damage", cause="surface_offset", channel="elevator_rad", size=0.1, evidence=()
    )
    assert "Size: 5.73°, with 95 % confidence between 3.48 and 7.98°." in described(in_degrees)
    unknown = notice_at(bench, id="a3", cause="unknown", size_standard_error=float("nan"), probability=0.9999)
    assert "Size" not in described(unknown)
    assert "Probability of this cause: above 99 %." in described(unknown)


def test_the_first_fifty_characters_say_what_counts(bench: Bench) -> None:
    raised = notice_at(bench)
    assert short_text(raised, "")[:50] == "WARNING: Icing of severity 0.16 +/- 0.02 (Twin Ott"
    assert short_text(raised, "uav1")[:50] == "WARNING uav1: Icing of severity 0.16 +/- 0.02 (Twi"
    assert short_text(raised, "a" * 63)[:31] == f"WARNING {'a' * 16}: Icing"
    assert short_text(raised, "").endswith("Leave icing conditions.")
    assert short_text(notice_at(bench, level="critical"), "uav1").startswith("CRITICAL uav1: Icing of")
    seen = notice_at(bench, level="critical", state=ACKNOWLEDGED, note=("ann: acknowledge (seen)",))
    assert short_text(seen, "").startswith("Acknowledged: Icing of severity 0.16")
    assert short_text(seen, "").endswith(" ann: acknowledge (seen).")
    assert short_text(notice_at(bench, state=CLEARED), "uav1").startswith("CLEARED uav1: Icing of severity")
    assert len(short_text(trial_notice(0.0), "")) <= 50


def test_the_document_is_alertmanagers(bench: Bench) -> None:
    raised = notice_at(bench, channel="throttle", note=("ann: hm",))
    critical, cleared = notice_at(bench, level="critical"), notice_at(bench, state=CLEARED)
    first, second, last = (
        alertmanager_document(n, "ops", "https://wing.example") for n in (raised, critical, cleared)
    )
    assert first["version"] == "4"
    assert (first["status"], first["receiver"], first["truncatedAlerts"]) == ("firing", "ops", 0)
    alert = first["alerts"][0]
    assert alert["labels"] == {
        "alertname": "WingwatchIcing", "alert": "a1", "fleet": "north", "vehicle": "uav1", "cause": "icing",
        "channel": "throttle", "severity": "warning",
    }  # fmt: skip
    assert first["commonLabels"] == alert["labels"]
    assert set(first["groupLabels"].items()) <= set(alert["labels"].items())
    assert (alert["startsAt"], alert["endsAt"]) == ("2023-11-14T22:13:20.000Z", "0001-01-01T00:00:00Z")
    assert alert["generatorURL"] == "https://wing.example/v1/alerts/a1"
    assert alert["annotations"]["steps"] == "raised"
    assert alert["annotations"]["notes"] == "ann: hm"
    assert (last["status"], last["alerts"][0]["status"]) == ("resolved", "resolved")
    assert last["alerts"][0]["endsAt"] == "2023-11-14T22:13:20.000Z"
    assert second["alerts"][0]["labels"]["severity"] == "critical"
    assert len({(d["groupKey"], d["alerts"][0]["fingerprint"]) for d in (first, second, last)}) == 1


def test_notices_survive_a_file(bench: Bench) -> None:
    notice = notice_at(bench)
    assert Notice.from_json(orjson.loads(orjson.dumps(notice))) == notice
