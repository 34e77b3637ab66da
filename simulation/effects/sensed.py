"""The columns whose sensor an effect can spoil: those of an aircraft file that a simulated flight has."""

from wingwatch.aircraft import SENSOR_COLUMNS

__all__ = ["SENSED"]

_NOT_SIMULATED = (
    "airspeed_indicated_m_s",
    "outside_air_temperature_k",
    "aileron_left_rad",
    "aileron_right_rad",
)

SENSED: tuple[str, ...] = tuple(column for column in SENSOR_COLUMNS if column not in _NOT_SIMULATED)
