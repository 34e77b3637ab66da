"""Commands of pilots and test computers for flights that this benchmark flies itself: elevator, aileron, rudder."""

import math
from collections.abc import Sequence

import numpy as np
from diagnosis_hidden import Array

from wingwatch.aircraft import deal_harmonics, doublet_pulse_s, schroeder_phases_rad, step_3211_s, wave

__all__ = ["KINDS", "RATE_HZ", "commands"]

RATE_HZ = 50
KINDS = ("doublets", "3211", "multisine", "doublets and multisine")
_LONGEST_PULSE_S = 1.5
_STEPS_3211 = ((3.0, 1.0), (2.0, -1.0), (1.0, 1.0), (1.0, -1.0))
_PULSE_S = 0.25
_LOWEST_HZ, _HIGHEST_HZ = 0.1, 3.0


def commands(
    rng: np.random.Generator,
    kind: str,
    seconds: float,
    frequencies_rad_s: tuple[float, float],
    amplitude_rad: float,
) -> Array:
    """Deflections from trim, rad, (samples, 3).

    Args:
        rng: consumed; start, order and distances differ by it.
        kind: one of ``KINDS``, or ``pulses``: short impulses of the elevator, one up and one down, and rudder doublets.
        seconds: of flight.
        frequencies_rad_s: of short period and Dutch roll, for the widths.
        amplitude_rad: of each surface.
    """
    out = np.zeros((round(seconds * RATE_HZ), 3))
    start_s = float(rng.uniform(2.0, 5.0))
    if kind == "multisine":
        _add_multisine(out, start_s, float(rng.choice([10.0, 15.0, 20.0])), 0.8 * amplitude_rad)
        return out
    until_s = 0.5 * seconds if kind == "doublets and multisine" else seconds
    gap_s, order = float(rng.uniform(3.0, 5.0)), rng.permutation(3)
    at_s, turn = start_s, 0
    while at_s < until_s - 5.0:
        surface = int(order[turn % 3])
        pulses = _pulses(kind, surface, frequencies_rad_s[min(surface, 1)])
        sign = 1.0 if (turn // 3) % 2 == 0 else -1.0
        for width_s, direction in pulses:
            first, last = round(at_s * RATE_HZ), round((at_s + width_s) * RATE_HZ)
            out[first:last, surface] = sign * direction * amplitude_rad
            at_s += width_s
        at_s, turn = at_s + gap_s, turn + 1
    if kind == "doublets and multisine":
        _add_multisine(out, until_s, 10.0, 0.8 * amplitude_rad)
    return out


def _pulses(kind: str, surface: int, frequency_rad_s: float) -> Sequence[tuple[float, float]]:
    """Width in s and direction of each step of one manoeuvre."""
    if kind == "3211":
        step_s = min(step_3211_s(frequency_rad_s), _LONGEST_PULSE_S / 2.0)
        return [(width * step_s, 0.8 * sign) for width, sign in _STEPS_3211]
    if kind == "pulses" and surface == 0:
        return [(_PULSE_S, 1.5), (8.0 * _PULSE_S, 0.0), (_PULSE_S, -1.5)]
    pulse_s = min(doublet_pulse_s(frequency_rad_s), _LONGEST_PULSE_S)
    return [(pulse_s, 1.0), (pulse_s, -1.0)]


def _add_multisine(out: Array, start_s: float, length_s: float, amplitude_rad: float) -> None:
    """Sums of sines with harmonics of their own on each surface, over and over until the end."""
    first = round(start_s * RATE_HZ)
    samples = round(length_s * RATE_HZ)
    dealt = deal_harmonics(("elevator", "aileron", "rudder"), [(_LOWEST_HZ, _HIGHEST_HZ)] * 3, length_s)
    for surface, harmonics in enumerate(dealt):
        one = wave(harmonics, schroeder_phases_rad(len(harmonics)), samples)
        many = np.tile(amplitude_rad * one / np.abs(one).max(), math.ceil(len(out) / samples))
        out[first:, surface] += many[: len(out) - first]
