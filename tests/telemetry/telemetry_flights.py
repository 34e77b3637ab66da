"""Small flights that the telemetry tests share."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry import REQUIRED_CHANNELS, SampleBlock

THOR75 = Path(__file__).parents[2].parent / "shared" / "data" / "thor75" / "thor_flight75.mat"

THOR75_MAP = """
format = 1
[rows]
from_s = 235.0
to_s = 532.0
filter = "mode == 2"
[channels]
time_s = { source = "time" }
airspeed_indicated_m_s = { source = "ias" }
roll_rate_rad_s = { source = "p" }
pitch_rate_rad_s = { source = "q" }
yaw_rate_rad_s = { source = "r" }
specific_force_x_m_s2 = { source = "ax" }
specific_force_y_m_s2 = { source = "ay" }
specific_force_z_m_s2 = { source = "az" }
roll_rad = { source = "phi" }
pitch_rad = { source = "theta" }
altitude_m = { source = "h" }
angle_of_attack_rad = { source = "aoa" }
sideslip_rad = { source = "aos" }
elevator_rad = { source = "de", kind = "command" }
aileron_rad = { source = "(da_r - da_l) / 2", kind = "command" }
rudder_rad = { source = "dr", kind = "command" }
"""


def flight_columns(rows: int = 50, rate_hz: float = 50.0) -> dict[str, NDArray[np.float64]]:
    """Every required channel, each with values of its own that differ from row to row."""
    steps = np.arange(rows, dtype=np.float64)
    columns = {
        name: 0.001 * (i + 1) * np.cos(0.1 * i + 0.3 * steps) for i, name in enumerate(REQUIRED_CHANNELS)
    }
    columns["time_s"] = 10.0 + steps / rate_hz
    columns["airspeed_true_m_s"] = 25.0 + columns["airspeed_true_m_s"]
    columns["altitude_m"] = 1000.0 + columns["altitude_m"]
    return columns


def flight_block(rows: int = 50, **changes: object) -> SampleBlock:
    """A block of ``flight_columns`` with some columns replaced."""
    columns: Mapping[str, object] = {**flight_columns(rows), **changes}
    return SampleBlock.from_columns({name: np.asarray(column) for name, column in columns.items()})


def block_at(times_s: list[float]) -> SampleBlock:
    """A block with these stamps."""
    return flight_block(len(times_s), time_s=times_s)


def same(one: SampleBlock, other: SampleBlock) -> bool:
    """Whether two blocks are equal to the bit, missing values included."""
    return one.values.shape == other.values.shape and one.values.tobytes() == other.values.tobytes()
