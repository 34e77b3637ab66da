"""Cross terms of roll and yaw that are not what the file says."""

from wingwatch.diagnosis.candidate import Candidate, FreeParameter, Subject, scale
from wingwatch.diagnosis.extension import with_coefficients

__all__ = ["candidates"]

_FACTORS = {"Cl_r": 1.0, "Cl_rudder": 1.0, "Cn_p": 1.0, "Cn_aileron": 1.0}
_RATIO = FreeParameter("change", "", 0.02, 0.5, 0.05, -10.0, 10.0)


def candidates(subject: Subject) -> list[Candidate]:
    """Where the simulation has cross terms."""
    if not any(subject.states(name) for name in _FACTORS):
        return []
    return [
        Candidate(
            "roll_yaw_coupling", "", (_RATIO,), lambda model, v: scale(model, _FACTORS, v[0]),
            "roll and yaw act on each other {0:+.0%} more than in the simulation",
            lambda aircraft, v: with_coefficients(aircraft, _FACTORS, v[0]),
        )
    ]  # fmt: skip
