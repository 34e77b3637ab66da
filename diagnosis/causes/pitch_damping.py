"""Pitch damping that is not what the file says."""

from wingwatch.diagnosis.candidate import Candidate, FreeParameter, Subject, scale
from wingwatch.diagnosis.coefficients import with_coefficients

__all__ = ["candidates"]

_FACTORS = {"Cm_q": 1.0}
_RATIO = FreeParameter("change", "", 0.02, 0.3, 0.03, -3.0, 5.0)


def candidates(subject: Subject) -> list[Candidate]:
    """Always tried."""
    return [
        Candidate(
            "pitch_damping", "", (_RATIO,), lambda model, v: scale(model, _FACTORS, v[0]),
            "pitch damping (Cm_q) differs from the simulation's by {0:+.0%}",
            lambda aircraft, v: with_coefficients(aircraft, _FACTORS, v[0]), 3.0,
        )
    ]  # fmt: skip
