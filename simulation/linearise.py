"""Concise derivatives of the simulated aircraft, by central differences of its equations of motion.

What the simulation flies is measured here from outside, so it can be held to what ``aircraft.linearised_derivatives``
says on paper, and the truth under an effect can be stated.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import (
    SURFACE_OF_INPUT,
    Aircraft,
    FlightCondition,
    ModeStructure,
    derived_from,
    reduced,
)
from wingwatch.simulation.dynamics import derivatives
from wingwatch.simulation.effects import Effect
from wingwatch.simulation.layout import STATE
from wingwatch.simulation.timeline import base_row, timeline
from wingwatch.simulation.trim import TrimPoint, trim_row

__all__ = ["linearise"]

_STATE_INDEX = {"u": 3, "v": 4, "w": 5, "p": 10, "q": 11, "r": 12}
_SURFACE_INDEX = {symbol: place for place, symbol in enumerate(SURFACE_OF_INPUT)}
_ROW_INDEX = {"x": 3, "y": 4, "z": 5, "l": 10, "m": 11, "n": 12}
_STEP = {"u": 1e-3, "v": 1e-3, "w": 1e-3, "p": 1e-4, "q": 1e-4, "r": 1e-4}
"""Steps in m/s and rad/s; the cube root of machine precision times the size of each motion."""
_CONTROL_STEP = 1e-5
"""Of a surface in rad, of the throttle as a fraction."""


def linearise(
    aircraft: Aircraft,
    condition: FlightCondition,
    structure: ModeStructure,
    effects: Sequence[Effect] = (),
    time_s: float = 0.0,
    climb_rad: float = 0.0,
    bank_rad: float = 0.0,
) -> dict[str, float]:
    """Concise derivatives of a structure at the trim of a condition (level unless said), effects acting as at a time.

    Each is the change of d(state)/dt with one state or control, all others held, attitude included. The forms with
    alpha and beta, the phugoid and the spiral follow from the full motion (``aircraft.reduced``).

    Raises:
        AircraftDataError, TrimError: as ``trim``.
        ValueError: phugoid or spiral in a bank, where longitudinal and lateral motion are one.
    """
    parameters = timeline(aircraft, condition, effects, base_row(aircraft, condition)).at(time_s)
    point = trim_row(aircraft, condition, parameters, climb_rad, bank_rad)
    source = derived_from(structure)
    if source is None:
        return _differences(parameters, point, structure)
    if source.attitudes and bank_rad != 0.0:
        raise ValueError(f"{structure.name} has no meaning in a bank of {bank_rad:g} rad; choose bank_rad 0")
    here = replace(condition, angle_of_attack_rad=point.angle_of_attack_rad)
    full = _differences(parameters, point, source)
    return reduced(full, structure, here, aircraft, climb_rad)


def _differences(
    parameters: NDArray[np.float64], point: TrimPoint, structure: ModeStructure
) -> dict[str, float]:
    force, rates = np.empty(3), np.empty(len(STATE))
    out: dict[str, float] = {}
    for regressor in structure.regressors:
        sides = []
        for sign in (1.0, -1.0):
            state, surfaces, throttle = point.state.copy(), point.surfaces_rad, point.throttle
            if regressor in _STATE_INDEX:
                state[_STATE_INDEX[regressor]] += sign * _STEP[regressor]
            elif regressor == "tau":
                throttle += sign * _CONTROL_STEP
            else:
                surfaces[_SURFACE_INDEX[regressor]] += sign * _CONTROL_STEP
            derivatives(state, surfaces, throttle, parameters, force, rates)
            sides.append(rates.copy())
        width = 2.0 * _STEP.get(regressor, _CONTROL_STEP)
        for equation in structure.equations:
            index = _ROW_INDEX[equation]
            out[f"{equation}_{regressor}"] = float((sides[0][index] - sides[1][index]) / width)
    return {symbol: out[symbol] for symbol in structure.derivatives}
