"""Live, a vehicle whose channels contradict each other is never healthy, and says why."""

import numpy as np
import pytest
from fleet_hall import Hall, fly_doublets

from wingwatch.monitor import FleetSettings, VehicleState
from wingwatch.operations.diagnosis_change import RING_CHANNELS
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock

RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")


@pytest.fixture(scope="module")
def flight() -> SampleBlock:
    return fly_doublets(100.0)


def spoiled(flight: SampleBlock, factor: float, *names: str) -> SampleBlock:
    values = flight.values.copy()
    for name in names:
        values[:, CHANNEL_INDEX[name]] *= factor
    return SampleBlock(values)


def hall(channels: tuple[str, ...] = RING_CHANNELS) -> Hall:
    made = Hall(FleetSettings(ring_channels=channels))
    made.announce()
    return made


@pytest.mark.parametrize(
    ("factor", "names", "said"),
    [
        (180.0 / np.pi, RATES, "roll_rate_rad_s is in deg/s"),
        (-1.0, ("specific_force_z_m_s2",), "specific_force_z_m_s2 is positive up"),
        (3600.0 / 1852.0, ("airspeed_true_m_s",), "it is in kt"),
    ],
)
def test_a_vehicle_whose_channels_contradict_each_other_is_never_healthy(
    flight: SampleBlock, factor: float, names: tuple[str, ...], said: str
) -> None:
    live, wrong = hall(), spoiled(flight, factor, *names)
    states = set()
    for k in range(100):
        live.fly(wrong, k, k + 1)
        states.add(live.view().state)
    view = live.view()
    assert VehicleState.HEALTHY not in states
    assert view.state in (VehicleState.NOT_OBSERVABLE, VehicleState.DEGRADED)
    assert "its channels contradict each other" in view.reason
    assert said in view.reason


def test_a_healthy_vehicle_stays_so(flight: SampleBlock) -> None:
    live = hall()
    live.fly(flight, 0, 100)
    assert live.view().state is VehicleState.HEALTHY


def test_what_is_sent_right_later_is_right_once_it_was_looked_at_again() -> None:
    long = fly_doublets(330.0)
    live = hall()
    live.fly(spoiled(long, -1.0, "specific_force_z_m_s2"), 0, 40)
    assert "positive up" in live.view().reason
    live.fly(long, 40, 330)
    assert "contradict" not in live.view().reason


def test_without_kept_samples_nothing_is_looked_at(flight: SampleBlock) -> None:
    live = hall(())
    live.fly(spoiled(flight, -1.0, "specific_force_z_m_s2"), 0, 60)
    assert "contradict" not in live.view().reason
