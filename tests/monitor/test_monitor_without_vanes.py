"""Aircraft without vanes: the filter's derivatives are compared in calm air, rough air takes their validity."""

from itertools import count

import numpy as np
import pytest

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, FlightCondition, load_aircraft
from wingwatch.estimators import Outcome
from wingwatch.monitor import AlertView, VehicleMonitor, VehicleState
from wingwatch.simulation import (
    Effect,
    ElevatorEffectiveness,
    Icing,
    Scenario,
    TurbulenceOnset,
    doublet_schedule,
    simulate,
)
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

AIRCRAFT = load_aircraft("aerosonde")
VANES = [CHANNEL_INDEX[name] for name in ("angle_of_attack_rad", "sideslip_rad")]


def watched(
    *effects: Effect, seconds: float, vanes: list[int] = VANES
) -> tuple[VehicleMonitor, list[AlertView]]:
    doublets = doublet_schedule(AIRCRAFT, FlightCondition(25.0, 1000.0), period_s=20.0)
    values = simulate(
        Scenario(AIRCRAFT, manoeuvres=(doublets,), effects=effects, seed=21), seconds
    ).values.copy()
    values[:, vanes] = np.nan
    block, numbers = complete(SampleBlock(values)), count(1)
    monitor = VehicleMonitor(AIRCRAFT, "f", "v", block.present, {}, new_id=lambda: str(next(numbers)))
    return monitor, list(monitor.feed(block).alerts)


def test_healthy_in_calm_air_is_compared_and_raises_nothing() -> None:
    monitor, alerts = watched(seconds=120.0)
    assert alerts == []
    assert monitor.state is VehicleState.HEALTHY
    assert "reconstructed, no vane" in monitor.basis_text
    assert "calm air only" in monitor.basis_text
    assert monitor.last_verdict is not None
    assert {name for name, mode in monitor.last_block.modes.items()} == {SHORT_PERIOD.name, LATERAL.name}  # type: ignore[union-attr]
    modes = monitor.derivatives()["estimators"]
    for structure, symbol in (
        (SHORT_PERIOD, "z_w"),
        (SHORT_PERIOD, "m_eta"),
        (LATERAL, "l_p"),
        (LATERAL, "y_p"),
    ):
        row = modes["ekf"][structure.name]["derivatives"][symbol]
        assert row["outcome"] in (Outcome.CONVERGED, Outcome.SETTLING)
        assert row["value"] == pytest.approx(row["expected"], rel=0.1)
    for structure in (SHORT_PERIOD, LATERAL):
        outcomes = {row["outcome"] for row in modes["fourier"][structure.name]["derivatives"].values()}
        assert outcomes <= {str(Outcome.REJECTED), str(Outcome.NOT_OBSERVABLE)}


def test_ice_in_calm_air_is_called_ice_and_has_its_size() -> None:
    monitor, alerts = watched(Icing(0.15, 80.0), seconds=140.0)
    found = [alert for alert in alerts if alert.channel is None]
    assert [alert.cause for alert in found[:1]] == ["icing"]
    assert found[0].raised_s >= 80.0
    active = next(alert for alert in monitor.active_alerts if alert.channel is None)
    assert abs(active.size - 0.15) < 3.0 * active.size_standard_error
    assert monitor.state is VehicleState.DEGRADED


def test_a_fault_is_no_rough_air() -> None:
    """The filter puts it down to gusts at first; the accelerometer feels none."""
    monitor, alerts = watched(ElevatorEffectiveness(0.5, 80.0), seconds=150.0)
    assert {alert.cause for alert in alerts} == {"elevator_effectiveness"}
    row = monitor.derivatives()["estimators"]["ekf"][SHORT_PERIOD.name]["derivatives"]["m_eta"]
    assert row["outcome"] in (Outcome.CONVERGED, Outcome.SETTLING)
    assert abs(row["value"]) < 0.75 * abs(row["expected"])


def test_one_vane_is_enough_for_its_own_modes() -> None:
    monitor, _ = watched(seconds=30.0, vanes=VANES[1:])
    assert "lateral (reconstructed, no vane)" in monitor.basis_text
    assert "short_period" not in monitor.basis_text
    assert monitor.basis == "a-priori"


def test_rough_air_is_compared_with_nothing_and_says_so() -> None:
    monitor, alerts = watched(TurbulenceOnset(1.5, 0.0, 0.0), seconds=60.0)
    assert alerts == []
    assert monitor.state is VehicleState.NOT_OBSERVABLE
    assert "compared in calm air only, and gusts have been felt" in monitor.reason
    assert monitor.last_block is None


def test_gusts_that_set_in_take_the_standing_and_raise_nothing() -> None:
    """They are recognised within half a minute; later nothing is learned any more."""
    for seconds in (85.0, 120.0):
        monitor, alerts = watched(TurbulenceOnset(1.5, 60.0, 5.0), seconds=seconds)
        assert alerts == []
        mode = monitor.derivatives()["estimators"]["ekf"][SHORT_PERIOD.name]
        outcomes = {row["outcome"] for row in mode["derivatives"].values()}
        assert outcomes <= {str(Outcome.REJECTED), str(Outcome.NOT_OBSERVABLE)}
        if seconds == 85.0:
            assert mode["outcome"] == "rejected"
            assert "rough air" in mode["reason"]
