"""Icing by the published Twin Otter models: the linear one, and the non-linear one with left and right apart.

Linear (targets ``all``, ``wing``, ``tail``): C = (1 + eta k') C_clean, all coefficients at once. The factors are
those of ``wingwatch.aircraft.ICING_FACTORS`` (source there). They are given for body-axis coefficients of an
aircraft whose x axis lies close to the wind, ours are lift and drag: CZ_alpha, CZ_q and CZ_de stand for the lift's
terms, CX0 for the drag at no lift (CD_min); what ice does to drag due to lift follows from the lift line, which the
drag polar squares. CZ0 and Cm0 do not change.

Non-linear: increments of CL, CD and Cm that are polynomials of angle of attack and elevator, fitted to the iced
Twin Otter of the University of Illinois' Smart Icing Systems group (UIUC model in FlightGear, file
uiuc_iced_nonlin, version 020409; reference severities 0.08 of the wing and 0.20 of the tail), with a rolling and a
yawing moment in proportion to the left wing's severity less the right one's. ``nonlinear`` ices both wings and the
tail alike, ``nonlinear_wing`` and ``nonlinear_tail`` one of them, ``left`` and ``right`` one wing: then the mean
severity, which the increments take, is half of the size.

Both were fitted to one aircraft: that they hold for another is an assumption. Linear and non-linear severities are
not one scale (each has its own reference), and acting together they add.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from wingwatch.aircraft import ICING_FACTORS, ICING_SEVERITY_MAX
from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["LINEAR_FACTORS", "NONLINEAR_SHARES", "Icing"]

_BEHIND: Mapping[str, str] = {
    "CL_zero": "CZ0", "CL_alpha": "CZalpha", "CL_q": "CZq", "CL_elevator": "CZde", "CD_min": "CX0",
    "CY_beta": "CYbeta", "CY_p": "CYp", "CY_r": "CYr", "CY_aileron": "CYda", "CY_rudder": "CYdr",
    "Cl_beta": "Clbeta", "Cl_p": "Clp", "Cl_r": "Clr", "Cl_aileron": "Clda", "Cl_rudder": "Cldr",
    "Cm_zero": "Cm0", "Cm_alpha": "Cmalpha", "Cm_q": "Cmq", "Cm_elevator": "Cmde",
    "Cn_beta": "Cnbeta", "Cn_p": "Cnp", "Cn_r": "Cnr", "Cn_aileron": "Cnda", "Cn_rudder": "Cndr",
}  # fmt: skip
"""Published coefficient behind each of the aircraft file's."""

LINEAR_FACTORS: Mapping[str, Mapping[str, float]] = {
    str(kind): {ours: published[theirs] for ours, theirs in _BEHIND.items()}
    for kind, published in ICING_FACTORS.items()
}
"""What a severity of 1 adds to the ratio of each coefficient to the clean one."""
NONLINEAR_SHARES: Mapping[str, Mapping[str, float]] = {
    "nonlinear": {"ice_wing": 1.0, "ice_tail": 1.0},
    "nonlinear_wing": {"ice_wing": 1.0},
    "nonlinear_tail": {"ice_tail": 1.0},
    "left": {"ice_wing": 0.5, "ice_left_less_right": 1.0},
    "right": {"ice_wing": 0.5, "ice_left_less_right": -1.0},
}
"""What a severity of 1 adds; the wing's is the mean of left and right."""


@dataclass(frozen=True, slots=True)
class Icing(Effect):
    """``size`` is the severity eta: 0.0675 takes 10 % from the lift slope, the published files advise no more than
    0.4.

    ``target`` says where the ice is and by which model; everywhere and linear where nothing is said.
    """

    name: ClassVar[str] = "icing"
    size_max: ClassVar[float] = ICING_SEVERITY_MAX
    size_meaning: ClassVar[str] = "the severity eta"
    targets: ClassVar[tuple[str, ...]] = (*LINEAR_FACTORS, *NONLINEAR_SHARES)
    target_default: ClassVar[str] = "all"

    def apply(self, parameters: Parameters, severity: float) -> None:
        """Each coefficient times 1 + severity k', or the severities of the non-linear model."""
        if self.target in LINEAR_FACTORS:
            parameters.scale(LINEAR_FACTORS[self.target], severity)
        else:
            for name, share in NONLINEAR_SHARES[self.target].items():
                parameters[name] += severity * share
