"""An aircraft file of which only derivatives are known, as one that can be flown.

Coefficients that give the stated concise derivatives at the stated condition are found by Newton's method on the
simulation's own linearisation (one step would do, but for drag's and lift's shares in each other's rows). Constants of
steady flight are not in such a file: each window finds its own.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import GRAVITY_M_S2, SURFACE_OF_INPUT, Aircraft, ConditionEntry, FlightCondition
from wingwatch.diagnosis.candidate import INDEX
from wingwatch.diagnosis.causes.derivative import COEFFICIENT
from wingwatch.diagnosis.replay import body_state
from wingwatch.simulation.dynamics import derivatives
from wingwatch.simulation.layout import parameter_row

__all__ = ["concise", "entry_near", "row_of_derivatives"]

Array = NDArray[np.float64]

_COEFFICIENT = {**COEFFICIENT, "m_q": "Cm_q"}
_STATE = {"w": 5, "v": 4, "p": 10, "q": 11, "r": 12}
_SURFACE = {symbol: place for place, symbol in enumerate(SURFACE_OF_INPUT)}
_ROW = {"z": 5, "m": 11, "y": 4, "l": 10, "n": 12}
_STEP = {"w": 1e-2, "v": 1e-2, "p": 1e-3, "q": 1e-3, "r": 1e-3, "eta": 1e-3, "xi": 1e-3, "zeta": 1e-3}
_DRAG = 0.04
"""Zero-lift drag of a file that states none: it matters little within a window."""


def entry_near(aircraft: Aircraft, airspeed_m_s: float) -> ConditionEntry | None:
    """The stated condition whose airspeed is nearest."""
    stated = [c for c in aircraft.conditions if c.derivatives]
    return min(stated, key=lambda c: abs(c.airspeed_true_m_s - airspeed_m_s)) if stated else None


def concise(row: Array, at: FlightCondition, symbols: tuple[str, ...]) -> Array:
    """Concise derivatives of a parameter row at a condition's airspeed, density and angle of attack."""
    v, alpha = at.airspeed_true_m_s, at.angle_of_attack_rad
    start = np.array([v * math.cos(alpha), 0.0, v * math.sin(alpha), 0.0, 0.0, 0.0, 0.0, alpha])
    return np.array([_slope(row, start, at, symbol) for symbol in symbols])


def _slope(row: Array, start: Array, at: FlightCondition, symbol: str) -> float:
    equation, by = symbol.split("_")
    out = []
    for sign in (1.0, -1.0):
        state, surfaces, rates = body_state(start, at.altitude_m), np.zeros(3), np.empty(13)
        if by in _STATE:
            state[_STATE[by]] += sign * _STEP[by]
        else:
            surfaces[_SURFACE[by]] = sign * _STEP[by]
        derivatives(state, surfaces, 0.0, row, np.empty(3), rates)
        out.append(rates[_ROW[equation]])
    return float(out[0] - out[1]) / (2.0 * _STEP[by])


def row_of_derivatives(aircraft: Aircraft, entry: ConditionEntry) -> Array:
    """A parameter row whose linearisation at an entry's condition is what the entry states.

    Raises:
        AircraftDataError: the file lacks [mass] or [geometry].
    """
    mass, geometry = aircraft.need_mass("a replay"), aircraft.need_geometry("a replay")
    at = replace(entry.condition)
    tables: dict[str, object] = {
        "force_axes": "stability", "CL": {"alpha": 5.0}, "CD": {"min": _DRAG, "oswald": 0.8},
        **{name: {"beta": 0.0} for name in ("CY", "Cl", "Cn")}, "Cm": {"alpha": 0.0, "q": 0.0, "elevator": 0.0},
    }  # fmt: skip
    row = parameter_row(type(aircraft).model_validate(aircraft.model_dump() | {"coefficients": tables}))
    pressure_n = 0.5 * at.air_density_kg_m3 * at.airspeed_true_m_s**2 * geometry.wing_area_m2
    symbols = tuple(s for s in entry.derivatives if s in _COEFFICIENT)
    columns = [INDEX[_COEFFICIENT[s]] for s in symbols]
    target = np.array([entry.derivatives[s].value for s in symbols])
    for _ in range(4):
        lift = mass.mass_kg * GRAVITY_M_S2 / pressure_n
        row[INDEX["CL_zero"]] = lift - row[INDEX["CL_alpha"]] * at.angle_of_attack_rad
        found = concise(row, at, symbols)
        jacobian = np.empty((len(symbols), len(columns)))
        for j, column in enumerate(columns):
            moved = row.copy()
            moved[column] += 1e-3
            jacobian[:, j] = (concise(moved, at, symbols) - found) / 1e-3
        row[columns] += np.linalg.solve(jacobian, target - found)
    return row
