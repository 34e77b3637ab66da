"""Loss of the outer part of one wing, by strips (lift, damping, and moments of what is no longer symmetric).

With the fraction f of a semi-span gone, k1 = 1 - (1 - f)^2, k2 = 1 - (1 - f)^3, s = 1 on the right and -1 on the left:
lift keeps 1 - f/2, dihedral's moment 1 - k1/2, roll damping 1 - k2/2, and the lift that is left rolls towards the
damage, Cl += s CL k1/8.
"""

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import INDEX, Candidate, FreeParameter, Subject, scale
from wingwatch.diagnosis.replay import Model

__all__ = ["candidates"]

_LOST = FreeParameter("fraction_of_semi_span_lost", "", 0.01, 0.2, 0.02, 0.0, 0.9)


def candidates(subject: Subject) -> list[Candidate]:
    """Right and left."""
    return [
        Candidate(
            "wing_damage", side, (_LOST,), _Loss(sign), f"the outer {{0:.0%}} of the {side} wing's semi-span is lost",
            odds=0.5,
        )
        for side, sign in (("right", 1.0), ("left", -1.0))
    ]  # fmt: skip


class _Loss:
    def __init__(self, sign: float) -> None:
        self.sign = sign

    def __call__(self, model: Model, v: NDArray[np.float64]) -> None:
        """In place."""
        lost = float(v[0])
        first, second = 1.0 - (1.0 - lost) ** 2, 1.0 - (1.0 - lost) ** 3
        for name, of_wing in (("Cl_zero", "CL_zero"), ("Cl_alpha", "CL_alpha")):
            model.row[INDEX[name]] += self.sign * model.row[INDEX[of_wing]] * first / 8.0
        scale(model, {"CL_zero": -0.5, "CL_alpha": -0.5}, lost)
        scale(model, {"Cl_beta": -0.5}, first)
        scale(model, {"Cl_p": -0.5, "Cl_r": -0.5, "Cn_p": -0.5}, second)
