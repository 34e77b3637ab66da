"""Concise derivatives of the simulated aircraft, by central differences of its equations of motion.

What the simulation flies is measured here from outside, so it can be held to what ``aircraft.linearised_derivatives``
says on paper, and the truth under an effect can be stated.
"""

from collections.abc import Sequence

import numpy as np

from wingwatch.aircraft import Aircraft, FlightCondition, ModeStructure
from wingwatch.simulation.dynamics import derivatives
from wingwatch.simulation.effects import Effect, coefficients_under
from wingwatch.simulation.layout import STATE, vehicle_row
from wingwatch.simulation.trim import trim

__all__ = ["linearise"]

_STATE_INDEX = {"u": 3, "v": 4, "w": 5, "p": 10, "q": 11, "r": 12}
_SURFACE_INDEX = {"eta": 0, "xi": 1, "zeta": 2}
_ROW_INDEX = {"x": 3, "y": 4, "z": 5, "l": 10, "m": 11, "n": 12}
_STEP = {"u": 1e-3, "v": 1e-3, "w": 1e-3, "p": 1e-4, "q": 1e-4, "r": 1e-4}
"""Steps in m/s and rad/s; the cube root of machine precision times the size of each motion."""
_SURFACE_STEP_RAD = 1e-5


def linearise(
    aircraft: Aircraft,
    condition: FlightCondition,
    structure: ModeStructure,
    effects: Sequence[Effect] = (),
    time_s: float = 0.0,
) -> dict[str, float]:
    """Concise derivatives of a structure at the level trim of a condition, effects acting as at a time.

    Each is the change of d(state)/dt with one state or surface, all others held, attitude included.

    Raises:
        AircraftDataError, TrimError: as ``trim``.
    """
    vehicle = vehicle_row(aircraft)
    coefficients = coefficients_under(aircraft, effects, time_s)
    point = trim(aircraft, condition, effects=effects, time_s=time_s)
    wind, gust, air, load, rates = np.zeros(3), np.zeros(6), np.empty(6), np.empty(8), np.empty(len(STATE))
    out: dict[str, float] = {}
    for regressor in structure.regressors:
        sides = []
        for sign in (1.0, -1.0):
            state, surfaces = point.state.copy(), point.surfaces_rad
            if regressor in _STATE_INDEX:
                state[_STATE_INDEX[regressor]] += sign * _STEP[regressor]
            else:
                surfaces[_SURFACE_INDEX[regressor]] += sign * _SURFACE_STEP_RAD
            derivatives(state, surfaces, point.throttle, wind, gust, vehicle, coefficients, air, load, rates)
            sides.append(rates.copy())
        width = 2.0 * _STEP.get(regressor, _SURFACE_STEP_RAD)
        for row in structure.equations:
            index = _ROW_INDEX[row]
            out[f"{row}_{regressor}"] = float((sides[0][index] - sides[1][index]) / width)
    return {symbol: out[symbol] for symbol in structure.derivatives}
