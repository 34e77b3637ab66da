"""A rudder with less or more effect than the file says: all of its coefficients alike."""

from wingwatch.diagnosis.candidate import Candidate, FreeParameter, Subject, scale
from wingwatch.diagnosis.causes.surface_stuck import LEAST_LOST
from wingwatch.diagnosis.coefficients import with_coefficients

__all__ = ["candidates"]

_FACTORS = {"CD_rudder": -1.0, "CY_rudder": -1.0, "Cl_rudder": -1.0, "Cn_rudder": -1.0}
_LOST = FreeParameter("fraction_lost", "", 0.02, 0.3, 0.02, -1.0, LEAST_LOST)


def candidates(subject: Subject) -> list[Candidate]:
    """Always tried."""
    return [
        Candidate(
            "rudder_effectiveness", "", (_LOST,), lambda model, v: scale(model, _FACTORS, v[0]),
            "the rudder has {0:.0%} [less|more] effect than the simulation gives it",
            lambda aircraft, v: with_coefficients(aircraft, _FACTORS, v[0]), 3.0,
        )
    ]  # fmt: skip
