"""Cross terms of roll and yaw that are not what the file says, or that it does not have at all."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject, scale
from wingwatch.diagnosis.coefficients import with_coefficients
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]

_FACTORS = {"Cl_r": 1.0, "Cl_rudder": 1.0, "Cn_p": 1.0, "Cn_aileron": 1.0}
_RATIO = FreeParameter("change", "", 0.02, 0.5, 0.05, -10.0, 10.0)
_MISSING = ("Cn_p", "CY_p", "Cn_aileron")
_ROLL_RATE = 3


def candidates(subject: Subject) -> list[Candidate]:
    """In proportion where the simulation has cross terms; added where it has no equation of roll."""
    if _ROLL_RATE in subject.followed and 1 not in subject.followed:
        return [_missing()]
    if not any(subject.states(name) for name in _FACTORS):
        return []
    return [
        Candidate(
            "roll_yaw_coupling", "", (_RATIO,), lambda model, v: scale(model, _FACTORS, v[0]),
            "roll and yaw act on each other {0:+.0%} more than in the simulation",
            lambda aircraft, v: with_coefficients(aircraft, _FACTORS, v[0]),
        )
    ]  # fmt: skip


def _missing() -> Candidate:
    """What rolling does to a simulation of sideslip and yaw alone."""

    def change(model: Model, v: NDArray[np.float64]) -> None:
        for name, value in zip(_MISSING, v, strict=True):
            model.row[INDEX[name]] += value

    parameters = tuple(FreeParameter(name, "", 0.005, 0.2, 0.01, -5.0, 5.0) for name in _MISSING)
    says = (
        "the simulation has no roll: rolling yaws the aircraft (Cn_p {0:+.3f}, Cn_aileron {2:+.3f}) and pushes it "
        "sideways (CY_p {1:+.3f}); take a lateral model of four degrees of freedom"
    )
    return Candidate("roll_yaw_coupling", "", parameters, change, says, odds=5.0)
