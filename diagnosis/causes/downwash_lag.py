"""Downwash that reaches the tail late: terms in the rate of the angle of attack.

Cm_alphadot = epsilon_alpha Cm_q and CL_alphadot = epsilon_alpha CL_q (Etkin and Reid, Dynamics of Flight, 5.5).
"""

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft
from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject
from wingwatch.diagnosis.coefficients import with_added
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]

_SLOPE = FreeParameter("downwash_slope", "", 0.03, 0.4, 0.05, -1.0, 1.0)


def candidates(subject: Subject) -> list[Candidate]:
    """Where the file states pitch damping."""
    if not subject.states("Cm_q"):
        return []
    return [
        Candidate(
            "downwash_lag", "", (_SLOPE,), _change,
            "downwash reaches the tail late: its change with angle of attack is {0:+.2f} more than simulated", _mend,
        )
    ]  # fmt: skip


def _change(model: Model, v: NDArray[np.float64]) -> None:
    for table in ("CL", "Cm"):
        model.row[INDEX[f"{table}_alphadot"]] += v[0] * model.row[INDEX[f"{table}_q"]]


def _mend(aircraft: Aircraft, v: NDArray[np.float64]) -> Aircraft | None:
    c = aircraft.coefficients
    if c is None:
        return None
    return with_added(aircraft, {"CL_alphadot": v[0] * c.CL.q, "Cm_alphadot": v[0] * c.Cm.q})
