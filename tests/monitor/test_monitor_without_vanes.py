"""Aircraft without vanes: the filter's derivatives are shown and not compared, rough air takes their standing."""

from itertools import count

import numpy as np
import pytest

from wingwatch.aircraft import LATERAL, SHORT_PERIOD, FlightCondition, load_aircraft
from wingwatch.estimators import Outcome
from wingwatch.monitor import AlertView, VehicleMonitor, VehicleState
from wingwatch.simulation import (
    Effect,
    ElevatorEffectiveness,
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


def test_still_air_gives_the_filters_derivatives_and_no_alert() -> None:
    """Both doublets and a lost elevator: what is reconstructed is shown, and compared with nothing."""
    for effects in ((), (ElevatorEffectiveness(0.5, 60.0),)):
        monitor, alerts = watched(*effects, seconds=120.0)
        assert alerts == []
        assert monitor.state is VehicleState.NOT_OBSERVABLE
        assert "reconstructed, no vane: shown, not compared" in monitor.reason
    monitor, _ = watched(seconds=120.0)
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


def test_a_fault_is_no_rough_air() -> None:
    monitor, _ = watched(ElevatorEffectiveness(0.5, 60.0), seconds=120.0)
    row = monitor.derivatives()["estimators"]["ekf"][SHORT_PERIOD.name]["derivatives"]["m_eta"]
    assert row["outcome"] in (Outcome.CONVERGED, Outcome.SETTLING)
    assert abs(row["value"]) < 0.75 * abs(row["expected"])


def test_one_vane_is_enough_for_its_own_modes() -> None:
    monitor, _ = watched(seconds=30.0, vanes=VANES[1:])
    assert [s.name for s in monitor.chain.seen] == [SHORT_PERIOD.name]
    assert monitor.basis == "a-priori"


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
