"""Icing by the linear model C = (1 + eta k') C_clean with the published Twin Otter factors.

The factors are those of ``wingwatch.aircraft.ICING_FACTORS`` (source there); that they hold for another aircraft is an
assumption. They are given for body-axis coefficients of an aircraft whose x axis lies close to the wind, ours are lift
and drag: CZ_alpha, CZ_q and CZ_de stand for the lift's terms, CX0 for the drag at no lift (CD_min); what ice does
to drag due to lift follows from the lift line, which the drag polar squares. CZ0 and Cm0 do not change.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from wingwatch.aircraft import ICING_FACTORS, ICING_SEVERITY_MAX, IcingKind
from wingwatch.simulation.effects.effect import Effect

__all__ = ["Icing"]

_BEHIND: Mapping[str, str] = {
    "CL_zero": "CZ0", "CL_alpha": "CZalpha", "CL_q": "CZq", "CL_elevator": "CZde", "CD_min": "CX0",
    "CY_beta": "CYbeta", "CY_p": "CYp", "CY_r": "CYr", "CY_aileron": "CYda", "CY_rudder": "CYdr",
    "Cl_beta": "Clbeta", "Cl_p": "Clp", "Cl_r": "Clr", "Cl_aileron": "Clda", "Cl_rudder": "Cldr",
    "Cm_zero": "Cm0", "Cm_alpha": "Cmalpha", "Cm_q": "Cmq", "Cm_elevator": "Cmde",
    "Cn_beta": "Cnbeta", "Cn_p": "Cnp", "Cn_r": "Cnr", "Cn_aileron": "Cnda", "Cn_rudder": "Cndr",
}  # fmt: skip
"""Published coefficient behind each of the aircraft file's."""


@dataclass(frozen=True, slots=True)
class Icing(Effect):
    """``size`` is the severity eta: 0.0675 takes 10 % from the lift slope, the published files advise no more than 0.4.

    Attributes:
        kind: where the ice is: all, wing or tail.
    """

    kind: IcingKind = "all"

    name: ClassVar[str] = "icing"
    size_max: ClassVar[float] = ICING_SEVERITY_MAX
    size_meaning: ClassVar[str] = "the severity eta"

    def factors(self) -> Mapping[str, float]:
        """k' of each coefficient."""
        published = ICING_FACTORS[self.kind]
        return {ours: published[theirs] for ours, theirs in _BEHIND.items()}
