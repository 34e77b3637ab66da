"""How far a published coefficient set may be trusted before any flight.

A monitor that takes a-priori numbers for truth calls every error of the book damage. The figures here are
judgement, not measurement; ``docs/decisions/0003-aircraft-apriori-errors.md`` says how they were chosen,
and a file's ``[coefficients.relative_standard_error]`` and ``[coefficients.standard_error_floor]`` replace
them.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.aircraft_file import Aircraft
from wingwatch.aircraft.coefficients import Coefficients
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.linearisation import Trim, linearised_at, trim
from wingwatch.aircraft.structures import ModeStructure

__all__ = [
    "HANDBOOK_RELATIVE_STANDARD_ERROR",
    "HANDBOOK_STANDARD_ERROR_FLOOR",
    "coefficient_standard_error",
    "derivative_covariance",
    "derivative_standard_errors",
]

HANDBOOK_RELATIVE_STANDARD_ERROR: Mapping[str, float] = {
    "default": 0.5,
    "CL_alpha": 0.10,
    "Cm_alpha": 0.15,
    "Cm_elevator": 0.15,
    "CY_beta": 0.20,
    "Cl_beta": 0.20,
    "Cn_beta": 0.15,
    "Cl_aileron": 0.15,
    "Cn_rudder": 0.15,
    "CY_rudder": 0.20,
    "CL_q": 0.30,
    "Cm_q": 0.20,
    "Cl_p": 0.15,
    "Cn_r": 0.20,
    "CD_min": 0.20,
    "CD_oswald": 0.20,
    "CL_zero": 0.20,
}
"""Relative standard error by coefficient; a share of one half leaves only the sign at 95 %."""

HANDBOOK_STANDARD_ERROR_FLOOR: Mapping[str, float] = {
    "CL_elevator": 0.05,
    "CL_q": 1.0,
    "CY_p": 0.05,
    "CY_r": 0.10,
    "CY_aileron": 0.02,
    "Cl_r": 0.03,
    "Cl_rudder": 0.005,
    "Cn_p": 0.03,
    "Cn_aileron": 0.005,
}
"""Smallest standard error by coefficient: weak ones are often published as a round zero."""


LEAST_STANDARD_ERROR = 0.001
"""Of a coefficient by which alone a derivative would be known exactly: a hundredth of a weak surface's effect, per rad.
Nothing is known exactly, and a covariance without it is singular."""


def coefficient_standard_error(coefficients: Coefficients, name: str) -> float:
    """Standard error of one coefficient (``CL_alpha``): the larger of its relative share and its floor.

    The file's own entry counts first, then the file's ``default``, then the handbook's figures above.
    """
    return _standard_error(coefficients, name, dict(coefficients.items())[name])


def _standard_error(coefficients: Coefficients, name: str, value: float) -> float:
    return max(
        abs(value) * _looked_up(coefficients.relative_standard_error, HANDBOOK_RELATIVE_STANDARD_ERROR, name),
        _looked_up(coefficients.standard_error_floor, HANDBOOK_STANDARD_ERROR_FLOOR, name),
    )


def _looked_up(stated: Mapping[str, float], handbook: Mapping[str, float], name: str) -> float:
    if name in stated:
        return stated[name]
    if "default" in stated:
        return stated["default"]
    return handbook.get(name, handbook.get("default", 0.0))


def derivative_covariance(
    aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure
) -> NDArray[np.float64]:
    """Covariance of the concise derivatives, (k, k) in the order of ``structure.derivatives``.

    First order, as ``derivative_standard_errors``: derivatives that one coefficient moves are correlated by it.

    Raises:
        AircraftDataError, TrimError: as ``linearised_derivatives``.
    """
    moves, least = _moves(aircraft, condition, structure)
    missing = ~moves.any(axis=0)
    spread = np.array(moves.T @ moves)
    spread[missing, missing] = (least[:, missing] ** 2).sum(axis=0)
    return spread


def derivative_standard_errors(
    aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure, at: Trim | None = None
) -> dict[str, float]:
    """A-priori standard error of each concise derivative that ``linearised_derivatives`` gives.

    First-order propagation: each coefficient is moved by one standard error at the fixed trim, the changes
    of the derivatives are added as squares (coefficients taken as independent). The errors of the moments
    also stand for those of the inertias, which publications state without any. A derivative that would have no error at
    all, as by the rudder of a flying wing, has that of ``LEAST_STANDARD_ERROR`` of its coefficients.

    Args:
        at: level trim there, where the caller has it already.

    Raises:
        AircraftDataError, TrimError: as ``linearised_derivatives``.
    """
    moves, least = _moves(aircraft, condition, structure, at)
    variance = (moves**2).sum(axis=0)
    variance = np.where(variance == 0.0, (least**2).sum(axis=0), variance)
    return dict(zip(structure.derivatives, np.sqrt(variance).tolist(), strict=True))


def _moves(
    aircraft: Aircraft, condition: FlightCondition, structure: ModeStructure, at: Trim | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Change of each derivative by one standard error of each coefficient, and by ``LEAST_STANDARD_ERROR`` of those
    that have none, where one of the derivatives needs it; (coefficients, k) each."""
    at = trim(aircraft, condition) if at is None else at
    coefficients = aircraft.need_coefficients("a-priori standard errors")
    base = linearised_at(aircraft, condition, structure, at)
    values = dict(coefficients.items())
    errors = {name: _standard_error(coefficients, name, value) for name, value in values.items()}

    def moved(errors: Mapping[str, float]) -> NDArray[np.float64]:
        rows = [[0.0] * len(structure.derivatives)]
        for name, value in values.items():
            if not (error := errors.get(name, 0.0)):
                continue
            other = aircraft.model_copy(update={"coefficients": coefficients.with_value(name, value + error)})
            there = linearised_at(other, condition, structure, at)
            rows.append([there[symbol] - base[symbol] for symbol in structure.derivatives])
        return np.array(rows)

    found = moved(errors)
    if found.any(axis=0).all():
        return found, np.zeros((1, len(structure.derivatives)))
    return found, moved({name: LEAST_STANDARD_ERROR for name, error in errors.items() if not error})
