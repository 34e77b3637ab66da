"""What the sensors make of a flight: delays, then white noise, each column as the aircraft file says."""

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.simulation.scenario import Scenario
from wingwatch.telemetry import CHANNEL_INDEX, CHANNEL_NAMES

__all__ = ["SIMULATED", "NormalStreams", "Sensors"]

SIMULATED: tuple[str, ...] = (
    "time_s",
    "airspeed_true_m_s",
    "roll_rate_rad_s",
    "pitch_rate_rad_s",
    "yaw_rate_rad_s",
    "specific_force_x_m_s2",
    "specific_force_y_m_s2",
    "specific_force_z_m_s2",
    "roll_rad",
    "pitch_rad",
    "heading_rad",
    "elevator_rad",
    "aileron_rad",
    "rudder_rad",
    "angle_of_attack_rad",
    "sideslip_rad",
    "throttle",
    "altitude_m",
    "air_density_kg_m3",
    "elevator_command_rad",
    "aileron_command_rad",
    "rudder_command_rad",
    "roll_demand_rad",
    "pitch_demand_rad",
    "airspeed_demand_m_s",
    "altitude_demand_m",
)
"""Columns that a simulated flight has; the others are NaN."""

_PIECE = 32
"""Samples whose random numbers are drawn at once."""


class NormalStreams:
    """Standard normal numbers, a stream of its own for each vehicle, consumed in order.

    A vehicle's numbers depend on its seed and on how many it has consumed, not on its neighbours nor on how a flight
    is cut into steps.
    """

    def __init__(self, generators: Sequence[np.random.Generator], widths: Sequence[int]) -> None:
        self._generators = generators
        self._widths = widths
        self._buffer = np.zeros((len(generators), 0, max(widths, default=0)))
        self.width = self._buffer.shape[2]

    def take(self, samples: int) -> NDArray[np.float64]:
        """The next numbers, shape (vehicles, samples, width); beyond a vehicle's own width, zeros."""
        missing = samples - self._buffer.shape[1]
        if missing > 0 and self.width > 0:
            length = -(-missing // _PIECE) * _PIECE
            fresh = np.zeros((len(self._generators), length, self.width))
            for i, (generator, width) in enumerate(zip(self._generators, self._widths, strict=True)):
                if width > 0:
                    fresh[i, :, :width] = generator.standard_normal((length, width))
            self._buffer = np.concatenate([self._buffer, fresh], axis=1)
        elif missing > 0:
            return np.zeros((len(self._generators), samples, 0))
        taken, self._buffer = self._buffer[:, :samples], self._buffer[:, samples:]
        return taken


def _noisy_columns(aircraft: Aircraft) -> dict[int, float]:
    """Standard deviation by column of the flight table, of simulated columns."""
    table = aircraft.sensors.noise_std
    return {CHANNEL_INDEX[c]: table[c] for c in CHANNEL_NAMES if c in SIMULATED and table.get(c, 0.0) > 0.0}


@njit(cache=True, error_model="numpy")
def _add_noise(values, normals, columns, noise_std):  # type: ignore[no-untyped-def]
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            for j in range(columns.shape[1]):
                if noise_std[i, j] > 0.0:
                    values[i, k, columns[i, j]] += noise_std[i, j] * normals[i, k, j]


class Sensors:
    """Delays and noise of a fleet's sensors.

    A delayed column is read, linearly between samples, that much earlier; before the flight its first value stood.
    """

    def __init__(
        self, scenarios: Sequence[Scenario], generators: Sequence[np.random.Generator], rate_hz: float
    ) -> None:
        tables = [_noisy_columns(s.aircraft) if s.noise else {} for s in scenarios]
        width = max((len(t) for t in tables), default=0)
        self._columns = np.zeros((len(tables), width), dtype=np.int64)
        self._noise_std = np.zeros((len(tables), width))
        for i, table in enumerate(tables):
            self._columns[i, : len(table)] = list(table)
            self._noise_std[i, : len(table)] = list(table.values())
        self._normals = NormalStreams(generators, [len(t) for t in tables])
        self._delays = [
            (i, CHANNEL_INDEX[column], delay * rate_hz)
            for i, s in enumerate(scenarios)
            for column, delay in s.aircraft.sensors.delay_s.items()
            if delay > 0.0 and column in SIMULATED
        ]
        self._past: dict[tuple[int, int], NDArray[np.float64]] = {}

    def read(self, values: NDArray[np.float64]) -> None:
        """True columns, shape (vehicles, samples, channels), become what the sensors report, in place."""
        for vehicle, column, delay in self._delays:
            self._delay(values[vehicle, :, column], vehicle, column, delay)
        _add_noise(values, self._normals.take(values.shape[1]), self._columns, self._noise_std)

    def _delay(self, signal: NDArray[np.float64], vehicle: int, column: int, delay: float) -> None:
        """One column, ``delay`` in samples."""
        whole = int(delay)
        share = delay - whole
        length = whole + 1
        past = self._past.get((vehicle, column))
        if past is None:
            past = np.full(length, signal[0] if signal.size else np.nan)
        record = np.concatenate([past, signal])
        self._past[vehicle, column] = record[signal.size :].copy()
        newer, older = record[length - whole :][: signal.size], record[length - whole - 1 :][: signal.size]
        signal[:] = (1.0 - share) * newer + share * older
