"""The sample: one instant of one vehicle, in SI, on one clock; its channels and the block of many.

Latitude and longitude alone are in degrees, as receivers and maps have them.

Channel names, units and order are those of the flight table (contract "flight table"). A block is a
matrix with one row an instant and one column a channel, NaN where a channel is absent; this matrix is the
currency between telemetry, simulation and the estimators, so a batch of vehicles is one more leading axis.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wingwatch.aircraft.vocabulary import SURFACE_OF_INPUT, SURFACES

__all__ = [
    "Channel",
    "CHANNELS",
    "CHANNEL_INDEX",
    "CHANNEL_NAMES",
    "INPUT_CHANNELS",
    "LEAPING_CHANNELS",
    "MAX_GAP_S",
    "MAX_TIME_S",
    "SampleBlock",
    "SURFACE_CHANNELS",
]


@dataclass(frozen=True, slots=True)
class Channel:
    """One column of the flight table.

    Attributes:
        name: column name with its unit as qualifier.
        unit: SI unit as printed; deg for latitude and longitude.
        low: smallest value a working sensor can report; below it the sample is rejected.
        high: largest value a working sensor can report.
        meaning: one line.
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str


MAX_TIME_S = 2.0**32
"""Largest stamp, either sign: any clock in seconds, Unix time until 2106 among them. Stamps below it resolve half a
microsecond; microseconds sent for seconds lie beyond."""

MAX_GAP_S = 0.5
"""Nothing is bridged over a longer step between stamps: no interpolation, no hold, and every recursion starts anew."""

CHANNELS: tuple[Channel, ...] = (
    Channel("time_s", "s", -MAX_TIME_S, MAX_TIME_S, "time stamp of the source's clock"),
    Channel("airspeed_true_m_s", "m/s", -10.0, 400.0, "true airspeed"),
    Channel("airspeed_indicated_m_s", "m/s", -10.0, 400.0, "indicated airspeed"),
    Channel("roll_rate_rad_s", "rad/s", -35.0, 35.0, "roll rate, right wing down positive"),
    Channel("pitch_rate_rad_s", "rad/s", -35.0, 35.0, "pitch rate, nose up positive"),
    Channel("yaw_rate_rad_s", "rad/s", -35.0, 35.0, "yaw rate, nose right positive"),
    Channel("specific_force_x_m_s2", "m/s2", -320.0, 320.0, "accelerometer, forward"),
    Channel("specific_force_y_m_s2", "m/s2", -320.0, 320.0, "accelerometer, right"),
    Channel("specific_force_z_m_s2", "m/s2", -320.0, 320.0, "accelerometer, down (level flight reads -9.81)"),
    Channel("roll_rad", "rad", -7.0, 7.0, "bank angle"),
    Channel("pitch_rad", "rad", -1.6, 1.6, "pitch attitude"),
    Channel("heading_rad", "rad", -1000.0, 1000.0, "heading"),
    Channel("elevator_rad", "rad", -1.6, 1.6, "elevator, trailing edge down positive"),
    Channel("aileron_rad", "rad", -1.6, 1.6, "half of right minus left aileron"),
    Channel("rudder_rad", "rad", -1.6, 1.6, "rudder, trailing edge left positive"),
    Channel("angle_of_attack_rad", "rad", -1.57, 1.57, "angle of attack at the vane, short of a right angle"),
    Channel("sideslip_rad", "rad", -1.57, 1.57, "sideslip at the vane, short of a right angle"),
    Channel("throttle", "", -1.0, 1.5, "throttle, 0 to 1"),
    Channel("altitude_m", "m", -1000.0, 40000.0, "altitude above mean sea level"),
    Channel("air_density_kg_m3", "kg/m3", 0.001, 2.0, "air density"),
    Channel("outside_air_temperature_k", "K", 150.0, 350.0, "outside air temperature"),
    Channel("elevator_command_rad", "rad", -1.6, 1.6, "commanded elevator"),
    Channel("aileron_command_rad", "rad", -1.6, 1.6, "commanded aileron"),
    Channel("rudder_command_rad", "rad", -1.6, 1.6, "commanded rudder"),
    Channel("aileron_left_rad", "rad", -1.6, 1.6, "left aileron, trailing edge down positive"),
    Channel("aileron_right_rad", "rad", -1.6, 1.6, "right aileron, trailing edge down positive"),
    Channel("roll_demand_rad", "rad", -7.0, 7.0, "bank angle the autopilot wants"),
    Channel("pitch_demand_rad", "rad", -1.6, 1.6, "pitch attitude the autopilot wants"),
    Channel("airspeed_demand_m_s", "m/s", -10.0, 400.0, "airspeed the autopilot wants"),
    Channel("altitude_demand_m", "m", -1000.0, 40000.0, "altitude the autopilot wants"),
    Channel("velocity_north_m_s", "m/s", -500.0, 500.0, "inertial velocity over the ground, north"),
    Channel("velocity_east_m_s", "m/s", -500.0, 500.0, "inertial velocity over the ground, east"),
    Channel("velocity_down_m_s", "m/s", -500.0, 500.0, "inertial velocity, down"),
    Channel("latitude_deg", "deg", -90.0, 90.0, "latitude, north positive"),
    Channel("longitude_deg", "deg", -180.0, 180.0, "longitude, east positive"),
)
"""Every channel of the flight table, in the order of the columns of a block; time comes first."""

CHANNEL_NAMES: tuple[str, ...] = tuple(c.name for c in CHANNELS)
CHANNEL_INDEX: Mapping[str, int] = {name: i for i, name in enumerate(CHANNEL_NAMES)}

SURFACE_CHANNELS: tuple[str, ...] = tuple(f"{surface}_rad" for surface in SURFACES)
INPUT_CHANNELS: Mapping[str, str] = {
    **dict(zip(SURFACE_OF_INPUT, SURFACE_CHANNELS, strict=True)),
    "tau": "throttle",
}
"""Channel of each control input of a model structure."""

LEAPING_CHANNELS = ("roll_rad", "heading_rad")
"""Angles in rad that may leap by 2 pi from one sample to the next. ``longitude_deg``, which leaps by 360, is none of
them: nobody unwraps it, and a stated delay of it is interpolated the long way round where it leaps."""


@dataclass(frozen=True, slots=True)
class SampleBlock:
    """Consecutive samples of one vehicle.

    Attributes:
        values: shape (samples, channels) in the order of ``CHANNELS``, float64, NaN where absent.
    """

    values: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.values.ndim != 2 or self.values.shape[1] != len(CHANNELS):
            raise ValueError(f"a block has shape (samples, {len(CHANNELS)}), got {self.values.shape}")

    def __len__(self) -> int:
        return int(self.values.shape[0])

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time stamps, shape (samples,)."""
        return self.values[:, 0]

    def column(self, name: str) -> NDArray[np.float64]:
        """One channel, shape (samples,); KeyError for a name that is no channel."""
        return self.values[:, CHANNEL_INDEX[name]]

    @property
    def present(self) -> tuple[str, ...]:
        """Names of the channels that have at least one finite value."""
        return tuple(CHANNEL_NAMES[i] for i in np.flatnonzero(np.isfinite(self.values).any(axis=0)))

    @classmethod
    def from_columns(cls, columns: Mapping[str, ArrayLike]) -> "SampleBlock":
        """A block from named columns of equal length.

        Raises:
            KeyError: a name that is no channel.
            ValueError: columns of different lengths.
        """
        lengths = {name: len(np.atleast_1d(np.asarray(column))) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"columns differ in length: {lengths}")
        n = next(iter(lengths.values()), 0)
        values = np.full((n, len(CHANNELS)), np.nan)
        for name, column in columns.items():
            values[:, CHANNEL_INDEX[name]] = column
        return cls(values)

    @classmethod
    def concatenate(cls, blocks: Sequence["SampleBlock"]) -> "SampleBlock":
        """Blocks one after another; an empty sequence gives an empty block."""
        if not blocks:
            return cls(np.empty((0, len(CHANNELS))))
        return cls(np.concatenate([b.values for b in blocks]))
