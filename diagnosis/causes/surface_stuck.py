"""A surface that does not follow its commands: stuck somewhere, or free of its servo.

It acts as (1 - f) u + d, u being what the servo makes of the command, with f near 1 and d the deflection at which it
stands. Where steady forces and moments are each window's own, d is part of them and not to be known.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject, output_index
from wingwatch.diagnosis.measured import SURFACES
from wingwatch.diagnosis.replay import BIAS, SCALE, Model

__all__ = ["LEAST_LOST", "candidates"]

LEAST_LOST = 0.9
"""Part of a surface's movement from which on it is called stuck: what loses less has lost effectiveness."""

_LOST = FreeParameter("fraction_lost", "", 0.02, 1.0, 0.5, LEAST_LOST, 2.0 - LEAST_LOST)
_STANDS = FreeParameter("deflection_rad", "rad", 0.002, 0.2, np.inf, -1.6, 1.6)
_ODDS = 2.0

_TERMS: Mapping[str, tuple[tuple[str, str], ...]] = {
    "elevator": (("CL_elevator", "CL_zero"), ("Cm_elevator", "Cm_zero")),
    "aileron": (("CY_aileron", "CY_zero"), ("Cl_aileron", "Cl_zero"), ("Cn_aileron", "Cn_zero")),
    "rudder": (("CY_rudder", "CY_zero"), ("Cl_rudder", "Cl_zero"), ("Cn_rudder", "Cn_zero")),
}
"""Coefficients of a surface, and the constants that a deflection at which it stands adds to."""


def candidates(subject: Subject) -> list[Candidate]:
    """Where a command is known that moves."""
    found = []
    for j, column in enumerate(SURFACES):
        commands, surface = subject.flight.commands[:, j], column.removesuffix("_rad")
        if not np.isfinite(commands).any() or np.nanmax(commands) == np.nanmin(commands):
            continue
        says, where = f"the {surface} does not follow its commands: it is stuck, or free of its servo", ""
        parameters: tuple[FreeParameter, ...] = (_LOST,)
        change: _Flown | _Read = _Flown(surface)
        if subject.measures(column):
            change = _Read(output_index(column))
        if subject.measures(column) or subject.trims_known:
            parameters, where = (_STANDS, _LOST), "; it stands at {0:+.3f} rad"
        found.append(Candidate("surface_stuck", surface, parameters, change, says + where, odds=_ODDS))
    return found


class _Flown:
    """The surface's place is known from its command alone."""

    def __init__(self, surface: str) -> None:
        self.terms = tuple((INDEX[of], INDEX[constant]) for of, constant in _TERMS[surface])

    def __call__(self, model: Model, v: NDArray[np.float64]) -> None:
        """In place."""
        for of, constant in self.terms:
            if len(v) > 1:
                model.row[constant] += v[0] * model.row[of]
            model.row[of] *= 1.0 - v[-1]


class _Read:
    """The surface's place is measured, and flown as it is: it does not follow what the servo makes of the command."""

    def __init__(self, column: int) -> None:
        self.column = column

    def __call__(self, model: Model, v: NDArray[np.float64]) -> None:
        """In place."""
        model.sensors[self.column, BIAS] += v[0]
        model.sensors[self.column, SCALE] -= v[1]
