"""Has every kernel of the live path compiled before the first sample needs it.

On a machine that has never run them this takes most of a minute; afterwards they come from numba's cache.
"""

import itertools

import numpy as np

from wingwatch.aircraft import load_aircraft
from wingwatch.monitor import VehicleMonitor
from wingwatch.telemetry import REQUIRED_CHANNELS, SampleBlock

__all__ = ["warm_up"]

_SECONDS, _RATE_HZ = 25.0, 50.0  # two blocks of the monitor's comparison and a little


def warm_up() -> None:
    """Watch a short invented flight and forget it."""
    numbers = itertools.count(1)
    block = _block()
    monitor = VehicleMonitor(
        load_aircraft("aerosonde"), "default", "warm-up", block.present, {}, new_id=lambda: str(next(numbers))
    )
    for start in range(0, len(block), 10):
        monitor.feed(SampleBlock(block.values[start : start + 10]))
    monitor.derivatives()
    monitor.view()


def _block() -> SampleBlock:
    """Level flight with every channel of every mode moving a little."""
    time_s = np.arange(round(_SECONDS * _RATE_HZ)) / _RATE_HZ
    moving = ("elevator_rad", "aileron_rad", "rudder_rad", "angle_of_attack_rad", "sideslip_rad")
    columns = {
        name: 0.02 * np.sin((2.0 + 0.7 * i) * time_s + i)
        for i, name in enumerate((*REQUIRED_CHANNELS, *moving))
    }
    columns["time_s"] = time_s
    columns["airspeed_true_m_s"] = 25.0 + columns["airspeed_true_m_s"]
    columns["altitude_m"] = 1000.0 + columns["altitude_m"]
    columns["air_density_kg_m3"] = np.full_like(time_s, 1.1)
    columns["specific_force_z_m_s2"] = -9.81 + columns["specific_force_z_m_s2"]
    return SampleBlock.from_columns(columns)
