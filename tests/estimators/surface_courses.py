"""Courses of a surface behind its servo."""

import numpy as np
from numpy.typing import NDArray

SERVO_S = 1.0 / (2.0 * np.pi * 8.0)
AMPLITUDE_RAD = np.deg2rad(2.0)


def surface_course(manoeuvre: str, seconds: float, rate_hz: float) -> NDArray[np.float64]:
    """Positions: at rest, doublets every 10 s, a 3-2-1-1 every 30 s, or a multisine from 0.1 to 4 Hz."""
    time = np.arange(0.0, seconds, 1.0 / rate_hz)
    command = np.zeros(time.size)
    if manoeuvre == "doublets":
        phase = time % 10.0
        command = np.where(phase < 0.5, 1.0, np.where(phase < 1.0, -1.0, 0.0))
    elif manoeuvre == "3211":
        phase, sign, at = time % 30.0, 1.0, 0.0
        for length in (0.9, 0.6, 0.3, 0.3):
            command[(phase >= at) & (phase < at + length)] = sign
            sign, at = -sign, at + length
    elif manoeuvre == "multisine":
        for k, frequency in enumerate(np.arange(0.1, 4.05, 0.1)):
            command += np.cos(2.0 * np.pi * frequency * time + np.pi * k * k / 40.0)
        command /= np.abs(command).max()
    surface, keep = np.zeros(time.size), np.exp(-1.0 / (rate_hz * SERVO_S))
    for k in range(1, time.size):
        surface[k] = command[k - 1] + keep * (surface[k - 1] - command[k - 1])
    return np.asarray(AMPLITUDE_RAD * surface)
