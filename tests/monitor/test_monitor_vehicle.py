"""One vehicle from samples to alerts, on simulated flights: the monitor never sees the simulation's truth."""

from collections.abc import Iterator
from itertools import count

import numpy as np
import pytest

from wingwatch.aircraft import SHORT_PERIOD, Aircraft, FlightCondition, load_aircraft, mode_quantities
from wingwatch.monitor import AlertView, VehicleMonitor, VehicleState, surface_kinds
from wingwatch.monitor.vehicle.checkpoint import CODEC
from wingwatch.monitor.vehicle.state import MonitorState
from wingwatch.simulation import (
    AileronEffectiveness,
    Effect,
    ElevatorEffectiveness,
    Icing,
    Scenario,
    doublet_schedule,
    simulate,
)
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

AIRCRAFT = load_aircraft("aerosonde")
CRUISE = FlightCondition(25.0, 1000.0)


def _flight(*effects: Effect, seconds: float = 180.0, seed: int = 11, excited: bool = True) -> SampleBlock:
    doublets = (doublet_schedule(AIRCRAFT, CRUISE, np.deg2rad(2.0)),) if excited else ()
    return complete(simulate(Scenario(AIRCRAFT, manoeuvres=doublets, effects=effects, seed=seed), seconds))


def _ids() -> Iterator[str]:
    return (f"alert-{n}" for n in count(1))


def _monitor(block: SampleBlock, aircraft: Aircraft = AIRCRAFT) -> VehicleMonitor:
    ids = _ids()
    return VehicleMonitor(aircraft, "default", "uav", block.present, {}, new_id=lambda: next(ids))


def _alerts(block: SampleBlock, aircraft: Aircraft = AIRCRAFT) -> tuple[VehicleMonitor, list[AlertView]]:
    monitor = _monitor(block, aircraft)
    return monitor, list(monitor.feed(block).alerts)


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_healthy_flight_raises_nothing(seed: int) -> None:
    monitor, alerts = _alerts(_flight(seed=seed))
    assert alerts == []
    assert monitor.state is VehicleState.HEALTHY
    assert monitor.observable_s > 120.0


@pytest.mark.parametrize(
    ("effect", "kind", "cause"),
    [
        (Icing(0.15, 80.0, 30.0), "icing", "icing"),
        (ElevatorEffectiveness(0.5, 80.0), "damage", "elevator_effectiveness"),
        (AileronEffectiveness(0.5, 80.0), "damage", "aileron_effectiveness"),
    ],
)
def test_an_effect_is_named_within_a_minute(effect: Effect, kind: str, cause: str) -> None:
    monitor, alerts = _alerts(_flight(effect))
    assert {a.id for a in alerts} == {"alert-1"}
    first, last = alerts[0], alerts[-1]
    assert (first.kind, first.cause) == (kind, cause)
    assert 80.0 < first.raised_s <= 140.0
    assert abs(last.size - effect.size) < 4.0 * last.size_standard_error + 0.15 * effect.size
    assert first.evidence
    assert abs(first.evidence[0].z) >= abs(first.evidence[-1].z)
    assert monitor.state is VehicleState.DEGRADED


def test_a_quiet_flight_is_not_observable_and_silent() -> None:
    monitor, alerts = _alerts(_flight(seconds=120.0, excited=False))
    assert alerts == []
    assert monitor.state is VehicleState.NOT_OBSERVABLE
    assert "no excitation" in monitor.reason


def test_a_wrong_aircraft_file_is_no_damage() -> None:
    coefficients = AIRCRAFT.coefficients
    assert coefficients is not None
    wrong = (
        coefficients.with_value("Cm_elevator", -2.0).with_value("Cm_alpha", -1.0).with_value("Cn_beta", 0.16)
    )
    monitor, alerts = _alerts(_flight(seconds=240.0), AIRCRAFT.model_copy(update={"coefficients": wrong}))
    assert alerts == []
    assert monitor.state is VehicleState.HEALTHY
    assert "does not fit this aircraft" in monitor.basis_text


def test_how_samples_are_cut_changes_nothing() -> None:
    block = _flight(ElevatorEffectiveness(0.5, 40.0), seconds=90.0)
    whole, pieces = _monitor(block), _monitor(block)
    whole.feed(block)
    start, rng = 0, np.random.default_rng(4)
    while start < len(block):
        n = int(rng.integers(1, 60))
        pieces.feed(SampleBlock(block.values[start : start + n]))
        start += n
    assert whole.derivatives() == pieces.derivatives()
    assert whole.view() == pieces.view()
    assert CODEC.encode(MonitorState, whole.saved()) == CODEC.encode(MonitorState, pieces.saved())


def test_missing_channels_are_named_not_guessed() -> None:
    block = _flight(seconds=20.0)
    values = block.values.copy()
    for surface in ("aileron", "rudder"):
        values[:, CHANNEL_INDEX[f"{surface}_rad"]] = np.nan
        values[:, CHANNEL_INDEX[f"{surface}_command_rad"]] = np.nan
    monitor = _monitor(SampleBlock(values))
    monitor.feed(SampleBlock(values))
    found = monitor.derivatives()
    assert "rudder_rad" in found["not_estimated"]["lateral"]
    assert set(found["estimators"]["fourier"]) == {"short_period"}


def test_frequency_and_damping_are_shown_with_standard_errors() -> None:
    block = _flight(seconds=40.0)
    monitor = _monitor(block)
    monitor.feed(block)
    for modes in monitor.derivatives()["estimators"].values():
        shown = modes["short_period"]
        values = {symbol: row["value"] for symbol, row in shown["derivatives"].items()}
        errors = np.array([row["standard_error"] for row in shown["derivatives"].values()])
        size = np.abs(list(values.values()))
        for key in ("natural_frequency_rad_s", "damping_ratio"):
            error = shown[f"{key}_standard_error"]
            # not more than all derivatives' errors at once, each in its worst direction
            worst = sum(
                q.standard_error
                for k in range(len(size))
                for q in mode_quantities(
                    SHORT_PERIOD, values, np.diag((errors * (np.arange(len(size)) == k)) ** 2)
                )
                if q.name == key
            )
            assert 0.0 < error <= worst * (1.0 + 1e-9)


def test_what_is_outside_the_envelope_is_said() -> None:
    block = _flight(seconds=60.0)
    values = block.values.copy()
    values[:, CHANNEL_INDEX["altitude_m"]] += 9000.0
    monitor = _monitor(SampleBlock(values))
    assert list(monitor.feed(SampleBlock(values)).alerts) == []
    assert monitor.state is VehicleState.NOT_OBSERVABLE
    assert "outside the baseline" in monitor.reason


def test_surfaces_known_by_command_are_held() -> None:
    assert surface_kinds(["elevator_command_rad", "aileron_rad"]) == {"elevator_rad": "command"}


def test_bad_samples_are_counted_and_change_nothing() -> None:
    block = _flight(seconds=60.0)
    rows = block.values
    dirty = np.concatenate([rows[:1000], rows[998:1000], rows[1000:]])  # two rows come again
    broken = rows[1500].copy()
    broken[CHANNEL_INDEX["pitch_rate_rad_s"]] = np.nan
    broken[0] += 0.001
    dirty = np.insert(dirty, 1503, broken, axis=0)
    clean, other = _monitor(block), _monitor(block)
    clean.feed(block)
    other.feed(SampleBlock(dirty))
    assert other.derivatives() == clean.derivatives()
    counts = other.view().counts
    assert counts["non_finite"] == 1
    assert counts["duplicate"] + counts.get("out_of_order", 0) == 2


def test_a_stuck_vane_is_named_counted_and_believed_by_nobody() -> None:
    """The short period goes on; of the lateral structure nothing is claimed, and the alert is about the vane."""
    block = _flight(seconds=60.0)
    block.values[:, CHANNEL_INDEX["sideslip_rad"]] = 0.01
    monitor, alerts = _alerts(block)
    view, estimators = monitor.view(), monitor.derivatives()["estimators"]
    assert [(alert.cause, alert.channel) for alert in alerts] == [("sensor_freeze", "sideslip_rad")]
    assert view.reason.startswith("Sideslip is frozen")
    assert view.rejected_by_channel == {"sideslip_rad": pytest.approx(2900, abs=2)}
    for estimates in estimators.values():
        assert estimates["lateral"]["outcome"] != "converged"
        assert estimates["short_period"]["outcome"] == "converged"
