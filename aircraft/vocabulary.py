"""The derivatives' names: symbol, unit, meaning and the sign physics allows.

Symbols are the British concise derivatives of thesis tables B.1 to B.4: the first letter is the equation
(x, y, z force; l, m, n moment), the index is the motion or the surface that causes it
(w, q, v, p, r; eta elevator, xi aileron, zeta rudder).
"""

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["Derivative", "DERIVATIVES"]


@dataclass(frozen=True, slots=True)
class Derivative:
    """One concise derivative.

    Attributes:
        symbol: its name in every interface, such as ``m_q``.
        unit: its SI unit as printed (angles in rad are left out).
        meaning: one line for a reader who does not know the symbol.
        sign: the sign of a conventional stable aircraft under the sign convention of thesis 4.2.2
            (-1 or +1), or 0 where both occur.
    """

    symbol: str
    unit: str
    meaning: str
    sign: int


def _vocabulary() -> dict[str, Derivative]:
    rows = [
        ("z_w", "1/s", "normal acceleration due to normal velocity", -1),
        ("z_q", "m/s", "normal acceleration due to pitch rate, with the forward speed in it", +1),
        ("z_eta", "m/s2", "normal acceleration due to elevator", -1),
        ("m_w", "1/(m s)", "pitch acceleration due to normal velocity", -1),
        ("m_q", "1/s", "pitch acceleration due to pitch rate", -1),
        ("m_eta", "1/s2", "pitch acceleration due to elevator", -1),
        ("y_v", "1/s", "lateral acceleration due to lateral velocity", -1),
        ("y_p", "m/s", "lateral acceleration due to roll rate", 0),
        ("y_r", "m/s", "lateral acceleration due to yaw rate, with minus the forward speed in it", -1),
        ("y_xi", "m/s2", "lateral acceleration due to aileron", 0),
        ("y_zeta", "m/s2", "lateral acceleration due to rudder", +1),
        ("l_v", "1/(m s)", "roll acceleration due to lateral velocity", -1),
        ("l_p", "1/s", "roll acceleration due to roll rate", -1),
        ("l_r", "1/s", "roll acceleration due to yaw rate", +1),
        ("l_xi", "1/s2", "roll acceleration due to aileron", -1),
        ("l_zeta", "1/s2", "roll acceleration due to rudder", 0),
        ("n_v", "1/(m s)", "yaw acceleration due to lateral velocity", +1),
        ("n_p", "1/s", "yaw acceleration due to roll rate", 0),
        ("n_r", "1/s", "yaw acceleration due to yaw rate", -1),
        ("n_xi", "1/s2", "yaw acceleration due to aileron", 0),
        ("n_zeta", "1/s2", "yaw acceleration due to rudder", -1),
    ]
    return {symbol: Derivative(symbol, unit, meaning, sign) for symbol, unit, meaning, sign in rows}


DERIVATIVES: Mapping[str, Derivative] = _vocabulary()
"""Every derivative wingwatch knows, by symbol."""
