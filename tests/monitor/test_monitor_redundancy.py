"""Faults of surfaces, thrust and sensors by analytical redundancy: found, named, sized; their end; healthy silence."""

from dataclasses import replace

import numpy as np
import pytest
from redundancy_flights import ONSET_S, flown, monitor_of, watched, without_notes

from wingwatch.monitor import AlertState, VehicleState
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock


@pytest.mark.parametrize(
    ("effect", "cause", "channel", "kind", "size", "within_s"),
    [
        ("surface_stuck[aileron]:here@50", "surface_stuck", "aileron_rad", "damage", 1.0, 3.0),
        ("surface_offset[elevator]:0.03@50", "surface_offset", "elevator_rad", "damage", 0.03, 3.0),
        ("airspeed_error:-0.1@50", "airspeed_error", "airspeed_true_m_s", "sensor", -0.1, 3.0),
        ("sensor_freeze[airspeed_true_m_s]:1@50", "sensor_freeze", "airspeed_true_m_s", "sensor", 1.0, 10.0),
        (
            "sensor_freeze[angle_of_attack_rad]:1@50",
            "sensor_freeze",
            "angle_of_attack_rad",
            "sensor",
            1.0,
            10.0,
        ),
        ("sensor_bias[pitch_rate_rad_s]:0.02@50", "sensor_bias", "pitch_rate_rad_s", "sensor", 0.02, 5.0),
        ("sensor_bias[pitch_rad]:0.04@50", "sensor_bias", "pitch_rad", "sensor", 0.04, 3.0),
        ("sensor_scale[roll_rate_rad_s]:-0.2@50", "sensor_scale", "roll_rate_rad_s", "sensor", -0.2, 20.0),
        ("sensor_delay[roll_rate_rad_s]:0.08@50", "sensor_delay", "roll_rate_rad_s", "sensor", 0.08, 20.0),
    ],
)
def test_a_fault_is_named_within_seconds_and_nothing_before(
    effect: str, cause: str, channel: str, kind: str, size: float, within_s: float
) -> None:
    monitor, alerts = watched(flown(effect))
    assert alerts, "nothing was noticed"
    first = alerts[0]
    assert ONSET_S <= first.raised_s <= ONSET_S + within_s
    last = [alert for alert in alerts if alert.id == first.id][-1]
    assert (last.cause, last.channel, last.kind) == (cause, channel, kind)
    assert last.size == pytest.approx(size, rel=0.35)
    assert monitor.state is VehicleState.DEGRADED
    assert last.text.split(",")[0] in monitor.reason
    assert {alert.id for alert in alerts} == {first.id}, "a second fault was made of the first"
    assert {alert.kind for alert in alerts} <= {kind, "unexplained"}


@pytest.mark.parametrize("turbulence", ["none", "moderate"])
def test_lost_thrust_is_noticed_and_shown_as_what_is_possible(turbulence: str) -> None:
    """In steady flight drag that has grown looks alike."""
    _, alerts = watched(flown("thrust_loss:0.6@50", turbulence=turbulence))
    assert alerts
    assert ONSET_S <= alerts[0].raised_s <= ONSET_S + 5.0
    last = alerts[-1]
    causes = {last.cause, *(c.cause for c in last.candidates)}
    assert "thrust_loss" in causes
    assert causes <= {"thrust_loss", "unknown", "icing", "wing_damage", "sensor_bias"}


@pytest.mark.parametrize("turbulence", ["none", "light", "moderate", "severe"])
def test_a_healthy_flight_is_silent(turbulence: str) -> None:
    monitor, alerts = watched(flown(turbulence=turbulence, seconds=150.0, seed=21))
    assert alerts == []
    assert monitor.state is VehicleState.HEALTHY


def test_derivatives_are_not_compared_while_a_sensor_is_at_fault() -> None:
    monitor, alerts = watched(flown("airspeed_error:0.12@50", seconds=100.0))
    assert [a.cause for a in alerts if a.channel is None] == [], "a wrong airspeed was taken for damage"
    assert monitor.last_block is not None
    assert monitor.last_block.end_s <= ONSET_S + 10.0


def test_a_fault_that_ends_is_cleared_and_its_relation_watched_again() -> None:
    values = flown(seconds=150.0).copy()
    rate = values[:, CHANNEL_INDEX["pitch_rate_rad_s"]]
    rate[50 * 50 : 50 * 100] += 0.02
    monitor, alerts = watched(values)
    assert "sensor_bias" in {alert.cause for alert in alerts}
    cleared = alerts[-1]
    assert cleared.state is AlertState.CLEARED
    assert cleared.cleared_s is not None
    assert 100.0 <= cleared.cleared_s <= 105.0
    assert not monitor.alarmed
    assert monitor.state is not VehicleState.DEGRADED


def test_a_reading_that_moves_again_clears_its_freeze() -> None:
    values = flown(seconds=100.0).copy()
    vane = values[:, CHANNEL_INDEX["sideslip_rad"]]
    vane[50 * 50 : 50 * 70] = vane[50 * 50]
    _, alerts = watched(values)
    assert [(alert.cause, alert.channel) for alert in alerts] == [("sensor_freeze", "sideslip_rad")] * 2
    assert alerts[-1].state is AlertState.CLEARED
    assert alerts[-1].cleared_s == pytest.approx(70.0, abs=2.5)


def test_ice_that_has_settled_keeps_its_size_through_doublets() -> None:
    _, alerts = watched(flown("icing:0.3@50", seconds=180.0, seed=32))
    assert {(alert.id, alert.cause) for alert in alerts} == {(alerts[0].id, "icing")}
    for alert in alerts:
        assert abs(alert.size - 0.3) < 3.0 * alert.size_standard_error, alert.text


def test_two_faults_of_different_parts_are_two_alerts() -> None:
    monitor, alerts = watched(
        flown("surface_stuck[rudder]:here@50", "sensor_bias[roll_rate_rad_s]:0.03@70", seconds=90.0)
    )
    assert {(a.cause, a.channel) for a in monitor.active_alerts} == {
        ("surface_stuck", "rudder_rad"),
        ("sensor_bias", "roll_rate_rad_s"),
    }
    assert len({alert.id for alert in alerts}) == 2


def test_how_samples_are_cut_changes_nothing() -> None:
    values = flown("sensor_bias[yaw_rate_rad_s]:0.02@50", turbulence="light")
    found = [watched(values, piece=piece)[1] for piece in (1, 10, 333)]
    assert found[0]
    assert without_notes(found[0]) == without_notes(found[1]) == without_notes(found[2])


def test_a_whole_flight_at_once_is_judged_as_its_pieces_are() -> None:
    """A sensor that fails later makes no earlier block one that is not compared."""
    values = flown("airspeed_error:0.12@50", seconds=100.0)
    (pieces, said), (whole, at_once) = watched(values), watched(values, piece=len(values))
    assert without_notes(said) == without_notes(at_once)
    assert pieces.last_block is not None
    assert whole.last_block is not None
    assert pieces.last_block.end_s == whole.last_block.end_s > 30.0


def test_a_monitor_that_is_restored_amid_a_fault_says_the_same() -> None:
    values = flown(
        "surface_stuck[aileron]:here@50", "airspeed_error:0.1@60", turbulence="light", seconds=90.0
    )
    _, uninterrupted = watched(values)
    monitor, block = monitor_of(values)
    alerts = list(monitor.feed(SampleBlock(block.values[:2570])).alerts)
    resumed, _ = monitor_of(values)
    saved = monitor.saved()
    monitor.feed(SampleBlock(block.values[2570:3500]))  # what was saved does not go on with it
    resumed.restore(saved)
    for start in range(2570, len(block), 10):
        alerts += resumed.feed(SampleBlock(block.values[start : start + 10])).alerts
    assert [(a.cause, a.channel, a.raised_s, a.size) for a in alerts] == [
        (a.cause, a.channel, a.raised_s, a.size) for a in uninterrupted
    ]


def test_a_surface_that_is_only_commanded_has_no_position_to_compare() -> None:
    monitor, _ = monitor_of(flown(), hidden=("elevator_rad", "aileron_rad", "rudder_rad"))
    absent = monitor.relations.absent
    assert "known by its command alone" in absent["elevator position against its command"]


def test_what_a_flight_could_have_shown_depends_on_what_moved() -> None:
    quiet = flown(seconds=60.0).copy()
    for name in ("elevator", "aileron", "rudder"):
        for column in (f"{name}_rad", f"{name}_command_rad"):
            noise = (
                np.random.default_rng(1).normal(0.0, 0.0008, len(quiet)) if column.endswith("r_rad") else 0.0
            )
            quiet[:, CHANNEL_INDEX[column]] = 0.01 + noise
    rows = {(c.cause, c.channel): c for c in watched(quiet)[0].could_see()}
    assert rows["surface_stuck", "elevator_rad"].smallest_size is None
    assert rows["surface_stuck", "elevator_rad"].input == "a command of the elevator"
    moved = {(c.cause, c.channel): c for c in watched(flown(seconds=70.0))[0].could_see()}
    assert moved["surface_stuck", "elevator_rad"].smallest_size == 1.0
    bias = moved["sensor_bias", "pitch_rate_rad_s"]
    assert bias.smallest_size is not None
    assert 0.002 < bias.smallest_size < 0.02
    assert bias.unit == "rad/s"
    assert {"icing", "elevator_effectiveness"} <= {cause for cause, channel in moved if channel is None}


def test_a_person_clears_an_alert_and_its_relation_learns_what_is_now() -> None:
    values = flown("sensor_bias[pitch_rate_rad_s]:0.02@50", seconds=110.0)
    monitor, block = monitor_of(values)
    monitor.feed(SampleBlock(block.values[: 58 * 50]))
    (alert,) = monitor.active_alerts
    monitor.take_over(replace(alert, state=AlertState.CLEARED))
    assert not monitor.alarmed
    assert monitor.feed(SampleBlock(block.values[58 * 50 :])).alerts == []


@pytest.mark.parametrize(
    "effect",
    [
        "sensor_freeze[sideslip_rad]:1@50",
        "sensor_bias[roll_rate_rad_s]:0.03@50",
        "surface_stuck[rudder]:here@50",
    ],
)
def test_an_alert_of_an_earlier_run_is_in_force_again(effect: str) -> None:
    """Without a checkpoint: nothing is raised a second time while the fault lasts."""
    values = flown(effect, seconds=110.0)
    _, alerts = watched(values[: 60 * 50])
    monitor, block = monitor_of(values[56 * 50 :])
    monitor.reinstate(alerts[-1])
    assert [alert.id for alert in monitor.active_alerts] == [alerts[-1].id]
    later = [
        a
        for start in range(0, len(block), 10)
        for a in monitor.feed(SampleBlock(block.values[start : start + 10])).alerts
    ]
    assert all(alert.id == alerts[-1].id for alert in later)
