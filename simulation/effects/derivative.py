"""One stability or control derivative that is wrong, by its concise name.

Behind each stands one coefficient of the aircraft file: rows z, y, l, m, n are CL, CY, Cl, Cm, Cn, indices w and v
are alpha and beta, eta, xi and zeta are elevator, aileron and rudder: ``m_q`` is Cm_q, ``n_v`` Cn_beta. It is that
coefficient that changes, so a derivative keeps what is not aerodynamic in it (the forward speed in z_q and y_r) and
what other coefficients give (Ixz carries rolling moments into n, drag has a share in z_w), and CL_alpha moves the
trim.
"""

from dataclasses import dataclass
from typing import ClassVar

from wingwatch.aircraft import DERIVATIVES, SURFACE_OF_INPUT
from wingwatch.simulation.effects.effect import Effect, Parameters

__all__ = ["DerivativeChange", "coefficient_behind"]

_ROW = {"z": "CL", "y": "CY", "l": "Cl", "m": "Cm", "n": "Cn"}
_INDEX = {"w": "alpha", "v": "beta", "p": "p", "q": "q", "r": "r", **SURFACE_OF_INPUT}


def coefficient_behind(symbol: str) -> str:
    """The aircraft file's coefficient behind a concise derivative."""
    row, index = symbol.split("_")
    return f"{_ROW[row]}_{_INDEX[index]}"


@dataclass(frozen=True, slots=True)
class DerivativeChange(Effect):
    """``size`` is the ratio of the coefficient after to before, minus 1."""

    name: ClassVar[str] = "derivative"
    size_min: ClassVar[float] = -10.0
    size_max: ClassVar[float] = 10.0
    size_meaning: ClassVar[str] = "the ratio of the coefficient minus 1"
    targets: ClassVar[tuple[str, ...]] = tuple(DERIVATIVES)

    def apply(self, parameters: Parameters, severity: float) -> None:
        """One coefficient times 1 + severity."""
        behind = coefficient_behind(self.target)
        parameters.need_one_of((behind,), f"{self.name} of {self.target}")
        parameters.scale({behind: 1.0}, severity)
