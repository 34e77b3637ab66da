"""Simulated flights for tests of analytical redundancy, and what the monitor says of them."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import FlightCondition, load_aircraft
from wingwatch.monitor import AlertView, VehicleMonitor, surface_kinds
from wingwatch.simulation import FleetSimulation, Scenario, Turbulence, doublet_schedule, parse_effect
from wingwatch.telemetry import CHANNEL_INDEX, SampleBlock, complete

RATE_HZ, ONSET_S = 50.0, 50.0
AEROSONDE = load_aircraft("aerosonde")
CONDITION = FlightCondition(25.0, 1000.0)


@cache
def flown(
    *effects: str, turbulence: Turbulence = "none", seconds: float = 75.0, seed: int = 7
) -> NDArray[np.float64]:
    """A flight with doublets every 20 s from 5 s on, (samples, channels); it must not be written to."""
    scenario = Scenario(
        AEROSONDE,
        CONDITION.airspeed_true_m_s,
        CONDITION.altitude_m,
        manoeuvres=(doublet_schedule(AEROSONDE, CONDITION),),
        effects=tuple(parse_effect(e) for e in effects),
        turbulence=turbulence,
        seed=seed,
        wind_m_s=(3.0, -2.0, 0.0),
    )
    simulation = FleetSimulation([scenario], RATE_HZ)
    values = np.concatenate([simulation.step(50).copy()[0] for _ in range(round(seconds))])
    values.setflags(write=False)
    return values


def monitor_of(values: NDArray[np.float64], hidden: Sequence[str] = ()) -> tuple[VehicleMonitor, SampleBlock]:
    """A monitor for the channels of a flight, and its completed samples."""
    shown = values.copy()
    for name in hidden:
        shown[:, CHANNEL_INDEX[name]] = np.nan
    given = SampleBlock(shown)
    block, ids = complete(given), itertools.count(1)
    monitor = VehicleMonitor(
        AEROSONDE, "test", "one", block.present, surface_kinds(given.present), new_id=lambda: f"a{next(ids)}"
    )
    return monitor, block


def watched(
    values: NDArray[np.float64], hidden: Sequence[str] = (), piece: int = 10
) -> tuple[VehicleMonitor, list[AlertView]]:
    """The monitor after a flight, and every version of its alerts."""
    monitor, block = monitor_of(values, hidden)
    alerts: list[AlertView] = []
    for start in range(0, len(block), piece):
        alerts += monitor.feed(SampleBlock(block.values[start : start + piece])).alerts
    return monitor, alerts


def without_notes(alerts: Sequence[AlertView]) -> list[AlertView]:
    """To compare what two monitors said."""
    return [replace(alert, note=()) for alert in alerts]
