"""Alerts beside the truth: the first, the right and the wrong ones, whatever their order."""

import math
from dataclasses import replace
from typing import Any

import pytest

from wingwatch.monitor import AlertState, AlertView
from wingwatch.monitor.views import CandidateView
from wingwatch.studies.alert_history import AlertHistory, after_onset, keep_alert
from wingwatch.studies.fault_names import kind_of, names_rightly, part_of, parts_of

ONSET_S = 100.0
GYRO = "pitch_rate_rad_s"


def alert(number: str, kind: str, cause: str, channel: str | None, raised_s: float, **more: Any) -> AlertView:
    view = AlertView(
        id=number, fleet="f", vehicle="v", kind=kind, cause=cause, level="watch", state=AlertState.ACTIVE,
        raised_s=raised_s, cleared_s=None, size=0.01, size_standard_error=0.002, probability=0.95, basis="empirical",
        text="", evidence=(), channel=channel,
    )  # fmt: skip
    return replace(view, **more)


def histories(*versions: tuple[float, AlertView]) -> list[AlertHistory]:
    kept: dict[str, AlertHistory] = {}
    for now_s, version in versions:
        keep_alert(kept, version, now_s)
    return list(kept.values())


@pytest.mark.parametrize(
    ("effect", "target", "cause", "channel", "right"),
    [
        ("icing", "left", "icing", None, True),
        ("icing", "all", "wing_damage", None, False),
        ("surface_stuck", "rudder", "surface_stuck", "rudder_rad", True),
        ("surface_stuck", "rudder", "surface_stuck", "aileron_rad", False),
        ("elevator_effectiveness", "", "elevator_effectiveness", None, True),
        ("thrust_loss", "", "thrust_loss", "throttle", True),
        ("airspeed_error", "", "airspeed_error", "airspeed_true_m_s", True),
        ("sensor_scale", "airspeed_true_m_s", "airspeed_error", "airspeed_true_m_s", True),
        ("vane_upwash", "sideslip", "sensor_scale", "sideslip_rad", True),
        ("sensor_bias", GYRO, "sensor_bias", GYRO, True),
        ("sensor_bias", GYRO, "sensor_delay", GYRO, False),
        ("sensor_bias", GYRO, "sensor_bias", "roll_rate_rad_s", False),
    ],
)
def test_cause_and_part_are_named_rightly(
    effect: str, target: str, cause: str, channel: str | None, right: bool
) -> None:
    assert names_rightly(effect, target, cause, channel) is right


def test_a_fault_has_a_kind_and_a_part() -> None:
    assert [kind_of(e) for e in ("icing", "thrust_loss", "vane_upwash")] == ["icing", "damage", "sensor"]
    assert [part_of("wing_damage", "left"), part_of("actuator_lag", "aileron")] == ["", "aileron_rad"]
    assert [parts_of(c) for c in ("", GYRO, "aileron_rad", "altitude_m")] == [
        "airframe", "gyros", "surfaces", "altitude_m",
    ]  # fmt: skip


def test_a_right_name_that_comes_second_is_no_first_one() -> None:
    scale = alert("1", "sensor", "sensor_scale", GYRO, 101.0)
    bias = replace(scale, cause="sensor_bias", size=0.012)
    found = after_onset(
        histories((101.5, scale), (107.0, bias), (120.0, replace(bias, size=0.011))), "sensor_bias", GYRO, ONSET_S
    )  # fmt: skip
    assert (found["delay_s"], found["first_cause"], found["said_cause"]) == (
        1.0,
        "sensor_scale",
        "sensor_bias",
    )
    assert (found["first_right"], found["first_in_set"], found["right_at_end"]) == (False, False, True)
    assert (found["right_delay_s"], found["size"]) == (7.0, 0.011)
    assert math.isnan(found["other_kind_delay_s"])


def test_a_candidate_is_in_the_set_and_what_was_cleared_is_not_right_at_the_end() -> None:
    drag = alert(
        "1", "unexplained", "unknown", "specific_force_x_m_s2", 103.0,
        candidates=(CandidateView("icing", None, 0.5), CandidateView("wing_damage", None, 0.5)),
    )  # fmt: skip
    ice = alert("2", "icing", "icing", None, 120.0)
    gone = replace(drag, state=AlertState.CLEARED, cleared_s=120.0)
    found = after_onset(histories((103.0, drag), (120.0, ice), (120.0, gone)), "icing", "wing", ONSET_S)
    assert (found["first_right"], found["first_in_set"], found["right_at_end"]) == (False, True, True)
    assert (found["delay_s"], found["right_delay_s"], found["derivatives_delay_s"]) == (3.0, 20.0, 20.0)
    assert (found["said_kind"], found["said_cause"]) == ("icing", "icing")
    cleared = replace(ice, state=AlertState.CLEARED, cleared_s=150.0)
    after = after_onset(histories((120.0, ice), (150.0, cleared)), "icing", "wing", ONSET_S)
    assert (after["right_at_end"], after["right_delay_s"]) == (False, 20.0)


def test_wrong_alerts_beside_the_right_one_are_kept_and_counted() -> None:
    wrong = alert("1", "icing", "icing", None, 130.0)
    right = alert("2", "sensor", "airspeed_error", "airspeed_true_m_s", 140.0)
    early = alert("0", "damage", "surface_stuck", "rudder_rad", 99.9)
    alerts = histories((99.9, early), (130.0, wrong), (140.0, right))
    found = after_onset(alerts, "airspeed_error", "", ONSET_S)
    assert (found["first_kind"], found["first_right"], found["right_delay_s"]) == ("icing", False, 40.0)
    assert found["other_kind_delay_s"] == 30.0, (
        "what came before the onset is a false alert, not a wrong name"
    )
    assert [a.as_json()["names"][0]["cause"] for a in alerts] == ["surface_stuck", "icing", "airspeed_error"]
    assert after_onset(histories((99.9, early)), "airspeed_error", "", ONSET_S) == {}
