"""What sensors have that no aircraft file knows, because it differs from one aircraft, flight or link to the next."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

from wingwatch.aircraft import SENSOR_COLUMNS

__all__ = ["NAVIGATION", "READINGS", "SIMULATED", "SensorErrors"]

_NOT_SIMULATED = (
    "airspeed_indicated_m_s",
    "outside_air_temperature_k",
    "aileron_left_rad",
    "aileron_right_rad",
)

READINGS: tuple[str, ...] = tuple(column for column in SENSOR_COLUMNS if column not in _NOT_SIMULATED)
"""Simulated columns that a sensor or a signal line stands behind: all but the time and what the autopilot wants."""

NAVIGATION: tuple[str, ...] = (
    "velocity_north_m_s",
    "velocity_east_m_s",
    "velocity_down_m_s",
    "latitude_deg",
    "longitude_deg",
)
"""Those of the navigation receiver, the last of ``READINGS``. Their noise has a stream of its own: they came later, and
the other readings of every seed are as they were."""

SIMULATED: tuple[str, ...] = (
    "time_s",
    *(column for column in READINGS if column not in NAVIGATION),
    "roll_demand_rad",
    "pitch_demand_rad",
    "airspeed_demand_m_s",
    "altitude_demand_m",
    *NAVIGATION,
)
"""Columns that a simulated flight has; the others are NaN."""

_VANES = ("angle_of_attack_rad", "sideslip_rad")
_SlowColumns = Literal["absent", "held"]


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """Errors of one vehicle's sensors, beside what its aircraft file says of the type's.

    Attributes:
        bias: constant by column, in the column's unit.
        bias_std: standard deviation of a turn-on bias by column: drawn once a flight, from its seed.
        scale: scale error by column, ratio minus 1.
        vane_upwash: of ``angle_of_attack_rad`` and ``sideslip_rad``: the flow's angle at the vane over the undisturbed
            one, minus 1.
        dropout_fraction: share of samples that arrive with nothing but their time.
        column_dropout_fraction: the same for single columns, by column, beside the whole samples.
        dropout_length_s: mean length of a dropout; never shorter than that of losses independent of one another.
        slow_columns: what a column whose ``rate_hz`` is below the table's has between its readings: "absent" (NaN:
            nothing is invented) or "held" (its last reading, as on a bus that repeats it).

    Raises:
        ValueError: a column that is not simulated or is no vane, a number that is not finite, a negative standard
            deviation or length, a fraction outside 0 to below 1, a word that is not known.
    """

    bias: Mapping[str, float] = field(default_factory=dict)
    bias_std: Mapping[str, float] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    vane_upwash: Mapping[str, float] = field(default_factory=dict)
    dropout_fraction: float = 0.0
    column_dropout_fraction: Mapping[str, float] = field(default_factory=dict)
    dropout_length_s: float = 0.0
    slow_columns: _SlowColumns = "absent"

    def __post_init__(self) -> None:
        for name in ("bias", "bias_std", "scale", "vane_upwash", "column_dropout_fraction"):
            _check(name, getattr(self, name), _VANES if name == "vane_upwash" else READINGS)
        for column, std in self.bias_std.items():
            if std < 0.0:
                raise ValueError(f"bias_std of {column} is {std}; give a standard deviation from 0")
        for what, fraction in (
            ("dropout_fraction", self.dropout_fraction),
            *((f"column_dropout_fraction of {c}", f) for c, f in self.column_dropout_fraction.items()),
        ):
            if not 0.0 <= fraction < 1.0:
                raise ValueError(f"{what} is {fraction}; give a fraction from 0 to below 1")
        if not (math.isfinite(self.dropout_length_s) and self.dropout_length_s >= 0.0):
            raise ValueError(f"dropout_length_s is {self.dropout_length_s}; give a number of seconds from 0")
        if self.slow_columns not in get_args(_SlowColumns):
            raise ValueError(
                f"slow_columns is {self.slow_columns!r}; give one of {', '.join(get_args(_SlowColumns))}"
            )


def _check(name: str, table: Mapping[str, float], allowed: tuple[str, ...]) -> None:
    for column, value in table.items():
        if column not in allowed:
            raise ValueError(f"{name} of {column!r} cannot be simulated; give one of {', '.join(allowed)}")
        if not math.isfinite(value):
            raise ValueError(f"{name} of {column} is {value}; give a finite number")
