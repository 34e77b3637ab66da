"""Natural frequency and damping of a mode, and the analysis band that follows from them."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wingwatch.aircraft.aircraft_file import Aircraft, AircraftDataError
from wingwatch.aircraft.linearisation import linearised_derivatives
from wingwatch.aircraft.structures import ModeStructure

__all__ = ["default_band_hz", "natural_frequency_and_damping", "state_matrix"]

_BAND_LOW, _BAND_HIGH = 0.055, 2.2
"""The thesis's band over its short period: 0.1 to 4 Hz at 11.373 rad/s = 1.810 Hz (chapters 7 to 9)."""


def state_matrix(structure: ModeStructure, derivatives: Mapping[str, float]) -> NDArray[np.float64]:
    """A of ``dx/dt = A x + B u`` from concise derivatives, shape (states, states)."""
    return np.array([[derivatives[f"{row}_{s}"] for s in structure.states] for row in structure.equations])


def natural_frequency_and_damping(structure: ModeStructure, matrix: ArrayLike) -> tuple[float, float]:
    """Natural frequency in rad/s and damping ratio of a mode.

    For two states ``w_n² = det A``, ``2 ζ w_n = -trace A`` (thesis 9.4), also where the mode is overdamped.
    With more states they are those of the oscillatory pair of highest frequency.

    Args:
        structure: the mode's structure.
        matrix: A, shape (states, states).

    Returns:
        (natural_frequency_rad_s, damping_ratio); NaN for both where the mode has no natural frequency (a
        divergence, no oscillatory pair, or a matrix that is not finite).

    Raises:
        ValueError: a matrix of another shape.
    """
    a = np.asarray(matrix, dtype=np.float64)
    k = len(structure.states)
    if a.shape != (k, k):
        raise ValueError(f"the state matrix of {structure.name} has shape {(k, k)}, got {a.shape}")
    if not np.isfinite(a).all():
        return math.nan, math.nan
    if k == 2:
        square = float(a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0])
        if square <= 0.0:
            return math.nan, math.nan
        frequency = math.sqrt(square)
        return frequency, -float(a[0, 0] + a[1, 1]) / (2.0 * frequency)
    roots = np.linalg.eigvals(a)
    oscillatory = roots[roots.imag > 1e-9 * np.abs(roots).max()]
    if oscillatory.size == 0:
        return math.nan, math.nan
    root = complex(oscillatory[np.argmax(np.abs(oscillatory))])
    return abs(root), -root.real / abs(root)


def _cruise_derivatives(aircraft: Aircraft, structure: ModeStructure) -> Mapping[str, float]:
    stated = next((entry for entry in aircraft.conditions if entry.covers(structure)), None)
    if stated is not None:
        return {symbol: entry.value for symbol, entry in stated.derivatives.items()}
    if aircraft.envelope is None:
        raise AircraftDataError(
            f"aircraft {aircraft.name} states no [modes.{structure.name}] band_hz and no [envelope] "
            "to derive it at; add one of them to its file"
        )
    return linearised_derivatives(aircraft, aircraft.envelope.cruise, structure)


def default_band_hz(aircraft: Aircraft, structure: ModeStructure) -> tuple[float, float]:
    """Analysis band of a mode from its frequency at cruise, in Hz.

    0.055 times the frequency of the oscillation to 2.2 times that of the fastest root: the ratio of the
    thesis's band to its short period. Cruise is the first of [[conditions]] that states the mode, else that
    of [envelope].

    Raises:
        AircraftDataError: the file has neither, or no coefficients.
        TrimError: cruise is no possible level flight.
    """
    a = state_matrix(structure, _cruise_derivatives(aircraft, structure))
    fastest = float(np.abs(np.linalg.eigvals(a)).max())
    frequency, _ = natural_frequency_and_damping(structure, a)
    slow = fastest if math.isnan(frequency) else frequency
    return _BAND_LOW * slow / (2.0 * math.pi), _BAND_HIGH * fastest / (2.0 * math.pi)
