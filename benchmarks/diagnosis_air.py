"""What moves an aircraft that this benchmark flies itself: servos with their faults, and gusts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from diagnosis_hidden import Array, Hidden
from diagnosis_inputs import RATE_HZ
from scipy.signal import lfilter

__all__ = ["Servo", "Surfaces", "gusts"]

GUST_RMS_M_S = {"light": 0.8, "moderate": 1.5}
"""MIL-F-8785C at medium altitude, likely once in two and in a hundred flights."""
_GUST_LENGTH_M = 533.0


@dataclass(frozen=True, slots=True)
class Servo:
    """A first-order servo and the play behind it.

    Attributes:
        bandwidth_hz: as the file has it.
        lag_s: added to its time constant.
        rate_limit_rad_s: most it moves.
        play_rad: full width between servo and surface.
        offset_rad: deflection at zero command.
    """

    bandwidth_hz: float
    lag_s: float = 0.0
    rate_limit_rad_s: float = math.inf
    play_rad: float = 0.0
    offset_rad: float = 0.0

    def under(self, effects: Sequence[Hidden], surface: str) -> "Servo":
        """The servo of a surface with what is hidden in it."""
        field = {
            "actuator_lag": "lag_s", "actuator_rate_limit": "rate_limit_rad_s", "actuator_backlash": "play_rad",
            "surface_offset": "offset_rad",
        }  # fmt: skip
        sizes = {field[e.name]: e.size for e in effects if e.name in field and e.target == surface}
        return replace(self, **sizes)


class Surfaces:
    """Servos and the surfaces that they move, in equal steps, commands held over each.

    Attributes:
        at: positions of the surfaces, rad.
    """

    def __init__(self, servos: Sequence[Servo], start_rad: Sequence[float], step_s: float) -> None:
        self.at = list(start_rad)
        self._servo = list(start_rad)
        self._play = [0.5 * servo.play_rad for servo in servos]
        self._offset = [servo.offset_rad for servo in servos]
        self._most = [servo.rate_limit_rad_s * step_s for servo in servos]
        lags_s = [1.0 / (2.0 * math.pi * servo.bandwidth_hz) + servo.lag_s for servo in servos]
        self._part = [1.0 - math.exp(-step_s / lag_s) for lag_s in lags_s]

    def move(self, command: Sequence[float]) -> None:
        """One step."""
        for j, wanted in enumerate(command):
            way = self._part[j] * (wanted + self._offset[j] - self._servo[j])
            self._servo[j] += min(self._most[j], max(-self._most[j], way))
            servo, play = self._servo[j], self._play[j]
            self.at[j] = min(servo + play, max(servo - play, self.at[j]))


def gusts(rng: np.random.Generator, level: str, airspeed_m_s: float, samples: int) -> Array:
    """Velocity of the air along north, east and down, m/s, (samples, 3): Dryden's spectra, one point of the aircraft.

    Along the path 1 / (1 + T s), across it (1 + sqrt(3) T s) / (1 + T s)^2 with T = L / V, by Tustin's rule.
    """
    time_s = _GUST_LENGTH_M / airspeed_m_s
    k = 2.0 * RATE_HZ
    pole = np.array([1.0 + time_s * k, 1.0 - time_s * k])
    lead = np.array([1.0 + math.sqrt(3.0) * time_s * k, 1.0 - math.sqrt(3.0) * time_s * k])
    settling = round(5.0 * time_s * RATE_HZ)
    white = rng.standard_normal((3, settling + samples)) * math.sqrt(RATE_HZ)
    along = math.sqrt(2.0 * time_s) * lfilter([1.0, 1.0], pole, white[0])
    across = [
        math.sqrt(time_s) * lfilter(np.convolve(lead, [1.0, 1.0]), np.convolve(pole, pole), w)
        for w in white[1:]
    ]
    rows = np.stack([along, *across], axis=1)[settling:]
    return np.asarray(GUST_RMS_M_S[level] * rows)
